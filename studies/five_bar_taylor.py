"""How far does a Taylor polynomial of a 5-bar's inverse kinematics reach?

After Fig. 1 of de Jong, Müller, van Dijk and Herder (2018): 200 positions of the end effector on four trajectories, joint angles by
Taylor polynomials about one point, and where the left and the right arm then put their tips. Beyond the paper: orders to 10, the radius
of convergence in every direction against the reach circles, and the estimated error over the workspace.

Run: python studies/five_bar_taylor.py [--size small] [--out DIR]
"""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from shared.running import run_study

from flexlin.mechanics.closure import five_bar
from flexlin.series import ImplicitMap

BASE, LEFT, RIGHT = 0.25, (0.3, 0.4), (0.3, 0.4)
POINT = np.array([0.125, 0.45])
GUESS = [2.3, -1.6, 0.8, 1.6, *POINT]
INVERSE = (4, 5)
SIZES = {"full": (50, 72, 101), "small": (8, 6, 9)}
"""Positions on each trajectory, directions of the radius, points along each side of the map."""


@dataclass(frozen=True)
class Result:
    """errors[order - 1, trajectory]: the largest distance between commanded and reached tip (m); radius_gap: |radius - closed form|."""

    errors: np.ndarray
    radii: np.ndarray
    kinds: tuple[str, ...]
    radius_gap: float
    error_ratio: float


def trajectories(count: int) -> list[np.ndarray]:
    """Return four trajectories du (count, 2) around the point of evaluation: a small and a large circle, a diagonal, a wave."""
    t = np.linspace(0, 1, count)
    circle = np.column_stack([np.cos(2 * np.pi * t), np.sin(2 * np.pi * t)])
    return [
        0.05 * circle,
        0.12 * circle,
        np.outer(2 * t - 1, [0.12, 0.08]),
        np.column_stack([0.2 * (2 * t - 1), 0.03 * np.sin(4 * np.pi * t)]),
    ]


def tips(v: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return where the left and the right arm put their tips, (N, 2) each."""
    sides = []
    for origin, (a, b), q in ((0.0, LEFT, v[:, :2]), (BASE, RIGHT, v[:, 2:])):
        first, second = q[:, 0], q.sum(axis=1)
        x = origin + a * np.cos(first) + b * np.cos(second)
        sides.append(np.column_stack([x, a * np.sin(first) + b * np.sin(second)]))
    return sides[0], sides[1]


def nearest_reach_circle(direction: np.ndarray) -> complex:
    """Return the nearest t, complex too, at which POINT + t d is on a circle where an arm is stretched or folded."""
    roots = []
    for origin, (a, b) in ((0.0, LEFT), (BASE, RIGHT)):
        p = POINT - [origin, 0.0]
        for reach in (a + b, abs(a - b)):
            roots += list(np.roots([1.0, 2 * p @ direction, p @ p - reach**2]))
    return min(roots, key=abs)


def study(size: str) -> tuple[Result, list[ImplicitMap]]:
    """Compute every number of the study."""
    positions, directions, _ = SIZES[size]
    loop = five_bar(BASE, LEFT, RIGHT)
    s0 = loop.close(GUESS, INVERSE)
    maps = [loop.taylor(s0, INVERSE, order) for order in range(1, 11)]
    errors = np.array(
        [[max(np.abs(tip - (POINT + du)).max() for tip in tips(c(du))) for du in trajectories(positions)] for c in maps]
    )
    all_around = rays(directions)
    radii = [maps[4].radius(d) for d in all_around]
    gaps = [
        abs(r - abs(nearest_reach_circle(d)))
        for r, d in zip(radii, all_around, strict=True)
        if r.kind == "real singularity"
    ]
    inside = np.concatenate([0.5 * r * d[None, :] for r, d in zip(radii, all_around, strict=True) if np.isfinite(r)])
    true = np.linalg.norm(maps[4](inside) - maps[4].refined(inside), axis=1)
    ratios = maps[4].error(inside) / true
    result = Result(
        errors, np.array(radii, dtype=float), tuple(r.kind for r in radii), max(gaps), np.abs(ratios - 1).max()
    )
    return result, maps


def draw(result: Result, maps: list[ImplicitMap], size: str, out: Path) -> None:
    """Draw trajectories with their insert, the orders to 10, and the map of validity."""
    from matplotlib.figure import Figure

    positions, directions, side = SIZES[size]
    figure = Figure(figsize=(18, 6), layout="tight")
    left, middle, right = figure.subplots(1, 3)
    draw_trajectories(left, maps, positions)
    draw_orders(middle, maps)
    levels = draw_validity(right, maps[4], result.radii, directions, side)
    figure.colorbar(levels, ax=right, label="log10 of the estimated error in rad, order 5")
    figure.savefig(out / "five_bar_taylor.png", dpi=110)


def draw_trajectories(ax: Any, maps: list[ImplicitMap], positions: int) -> None:
    """Commanded tips (dashed) and where both arms put them, orders 1 to 5; the insert is far from the point of evaluation."""
    inset = ax.inset_axes((0.62, 0.03, 0.36, 0.36))
    for area in (ax, inset):
        for du in trajectories(positions):
            area.plot(*(POINT + du).T, "k--", lw=1)
            for order in range(1, 6):
                for tip, style in zip(tips(maps[order - 1](du)), ("-", ":"), strict=True):
                    label = f"order {order}" if style == "-" else None
                    area.plot(*tip.T, style, color=f"C{order - 1}", lw=0.9, label=label)
    far = POINT + trajectories(positions)[3][-1]
    inset.set(xlim=far[0] + np.array([-0.03, 0.03]), ylim=far[1] + np.array([-0.03, 0.03]), xticks=[], yticks=[])
    ax.indicate_inset_zoom(inset)
    handles = dict(zip(*ax.get_legend_handles_labels()[::-1], strict=True))
    ax.legend(handles.values(), handles.keys(), fontsize=7, loc="upper left")
    ax.set(title="left (solid) and right (dotted) estimates", xlabel="x in m", ylabel="y in m", aspect="equal")


def draw_orders(ax: Any, maps: list[ImplicitMap]) -> None:
    """Error straight up by order, through the radius of convergence."""
    d = np.array([0.0, 1.0])
    radius = float(maps[4].radius(d))
    t = np.linspace(0.01, 1.2, 60)[:, None] * radius
    for order, c in enumerate(maps, start=1):
        error = np.abs(tips(c(t * d))[0] - POINT - t * d).max(axis=1)
        ax.semilogy(t, np.maximum(error, 1e-17), label=f"order {order}")
    ax.axvline(radius, color="k", lw=1, label="radius of convergence")
    ax.legend(fontsize=7)
    ax.set(title="error of the left tip, straight up", xlabel="distance in m", ylabel="m")


def draw_validity(ax: Any, c: ImplicitMap, radii: np.ndarray, directions: int, side: int) -> Any:
    """The estimated error over the workspace, with the radius of convergence and the outer reach circles."""
    x, y = np.meshgrid(*[np.linspace(-0.45, 0.45, side)] * 2)
    error = c.error(np.column_stack([x.ravel(), y.ravel()])).reshape(x.shape)
    shades = np.log10(np.clip(error, 1e-9, 1e1))
    levels = ax.contourf(POINT[0] + x, POINT[1] + y, shades, levels=np.arange(-9, 2), cmap="viridis_r")
    edge = POINT + radii[:, None] * rays(directions)
    ax.plot(*edge.T, "r.", ms=3, label="radius of convergence")
    for origin, lengths in ((0.0, LEFT), (BASE, RIGHT)):
        angle = np.linspace(0, 2 * np.pi, 200)
        ax.plot(origin + sum(lengths) * np.cos(angle), sum(lengths) * np.sin(angle), "k--", lw=1)
    ax.plot(*POINT, "k+")
    ax.legend(fontsize=7)
    ax.set(xlim=POINT[0] + np.array([-0.45, 0.45]), ylim=POINT[1] + np.array([-0.45, 0.45]))
    ax.set(title="where order 5 may be trusted", xlabel="x in m", ylabel="y in m", aspect="equal")
    return levels


def rays(count: int) -> np.ndarray:
    """Return directions of length 1 all around (count, 2)."""
    angles = 2 * np.pi * (np.arange(count) + 0.3) / count
    return np.column_stack([np.cos(angles), np.sin(angles)])


def main(size: str = "full", out: Path | None = None) -> Result:
    """Run the study; with `out`, draw its picture there."""
    result, maps = study(size)
    if out is not None:
        draw(result, maps, size, Path(out))
    return result


if __name__ == "__main__":
    answer = run_study(main, sizes=SIZES)
    print("largest tip error in m, by order (rows) and trajectory (columns)")
    for order, row in enumerate(answer.errors, start=1):
        print(f"{order:3d}  " + "  ".join(f"{e:9.2e}" for e in row))
    kinds = ", ".join(f"{answer.kinds.count(kind)} {kind}" for kind in sorted(set(answer.kinds)))
    print(f"radius {answer.radii.min():.4f} to {answer.radii.max():.4f} m: {kinds}")
    print(f"radius against reach circles: {answer.radius_gap:.1e} m")
    print(f"estimated against true error at half the radius: within {100 * answer.error_ratio:.1f} %")
