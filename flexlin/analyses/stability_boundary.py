"""The curves in two of a scene's numbers along which the loop becomes unstable."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from flexlin.analyses.critical_values import check_limits, describe_causes
from flexlin.analyses.spectra import LOOSE_LOG_ERROR, SCAN_ERROR, Family, Source, make_family
from flexlin.arguments import checked
from flexlin.checks import Array, positive, whole
from flexlin.errors import ArgumentError, counted
from flexlin.periodic.boundary.crossings import CELLS
from flexlin.periodic.boundary.curves import Curve, find_curves, find_lost_ends
from flexlin.periodic.boundary.spectra import Effort, SpectraFunction
from flexlin.precision import MINOR
from flexlin.summary import represent


@dataclass(frozen=True)
class BoundaryCurve:
    """A curve in two numbers that parts stability from instability; the unstable side is on its left.

    Attributes
    ----------
    paths : (str, str)
        Dotted paths of both numbers.
    points : array, shape (N, 2)
        The curve as a polyline, in the numbers' units, as fine as the wanted error asks.
    error : array, shape (N,)
        Distance of each point from the exact boundary, in the unit of the number with the longer range: each range counts as that long.
    closed : bool
        Whether the curve ends where it begins: the rim of an island, or of a hole.
    resonance : str
        What makes the loop unstable beside the curve's middle, in words.
    inside : (float, float)
        An unstable point beside the curve's middle.
    evaluations : int
        Spectra that the search for all curves took.
    lost : array, shape (K, 2)
        Ends inside the ranges: the boundary goes on there, and was not found; none where all of it was.
    status : str
        Whether every point is as near to the boundary as was asked, and if not, how far off, where, and what to do.

    Examples
    --------
    >>> import flexlin as fl
    >>> scene = fl.load_scene("spinning-link")
    >>> ranges = {"motion.joints.0.rate": (3.5, 4.5), "effects.gravity.acceleration": (1.0, 4.0)}
    >>> curves = fl.stability_boundary(scene, ranges, tol=1e-4)
    >>> len(curves), curves[0].closed, curves[0].resonance[:30]
    (2, False, 'principal resonance of order 2')
    """

    paths: tuple[str, str]
    points: Array
    error: Array
    closed: bool
    resonance: str
    inside: tuple[float, float]
    evaluations: int
    lost: Array
    status: str

    __repr__ = represent


@checked
def stability_boundary(
    source: Source,
    ranges: Mapping[str, tuple[float, float]],
    tol: float = 1e-6,
    *,
    loop: str = "own",
    cells: int = CELLS,
) -> list[BoundaryCurve]:
    """Find the curves in two numbers, within their ranges, along which a loop becomes unstable.

        max_i Re lambda_i(p, q) = 0

    Spectra on the lines of a lattice give the points at which the boundary crosses them, tongues between two lattice points included;
    through each cell the points are joined by cubics whose middles are compared with the boundary itself, and which are halved until
    they agree. Islands and holes wider than a cell are found; smaller ones where the growth rate peaks at a lattice point beside them.
    Tongues are followed into the tips at which they close, to within rounding.

    Parameters
    ----------
    source : Scene, PeriodicFamily, or function of two floats that returns a PeriodicSystem
        The scene; or the systems themselves, where there is no scene. A family's go through compiled code together.
    ranges : mapping of str to (float, float)
        Two dotted paths with the least and largest value of each, in the numbers' units.
    tol : float
        Wanted distance of the curves from the exact boundary: in the numbers' units, or as a share of a range shorter than one.
    loop : str
        Which loop of the scene, as in `critical_values`.
    cells : int
        Cells of the lattice on either side.

    Returns
    -------
    list of BoundaryCurve
        Longest first; empty where the verdict is the same everywhere.

    Raises
    ------
    ArgumentError
        For paths that lead to no free numbers, ranges that do not rise, or an unknown loop.
    SceneError
        For ranges that the scene's schema refuses.
    ModelError
        For ranges in which the equations break, as where M is indefinite.

    References
    ----------
    Allgower, Georg, Introduction to Numerical Continuation Methods (2003), ch. 15, for curves from a lattice; Seyranian, Mailybaev,
    Multiparameter Stability Theory with Mechanical Applications (2003), ch. 11, for boundaries of parametric resonance.

    Examples
    --------
    Both sides of the first tongue of a damped Mathieu equation, y'' + 0.2 y' + (a - 2 q cos 2t) y = 0, meet at its tip:

    >>> import numpy as np
    >>> import flexlin as fl
    >>> def mathieu(a, q):
    ...     def stiffness(t):
    ...         return (a - 2 * q * np.cos(2 * t))[:, None, None]
    ...     return fl.PeriodicSystem.from_second_order([[1.0]], [[0.2]], stiffness, np.pi)
    >>> (curve,) = fl.stability_boundary(mathieu, {"a": (0.6, 1.4), "q": (0.0, 0.3)}, tol=1e-3, cells=4)
    >>> bool(abs(curve.points[:, 1].min() - 0.2) < 2e-3)
    True
    """
    if len(ranges) != 2:
        expected = "two numbers with their ranges"
        raise ArgumentError("a boundary has two parameters", got=", ".join(ranges) or "none", expected=expected)
    return search_boundary(source, ranges, positive("tol", tol), loop, whole("cells", cells, 2), Effort())


def search_boundary(
    source: Source, ranges: Mapping[str, tuple[float, float]], tol: float, loop: str, cells: int, effort: Effort
) -> list[BoundaryCurve]:
    """The curves of `stability_boundary`; effort: ends the search for tongues' tips, and knows whether it did."""
    limits = np.array([check_limits(path, limits) for path, limits in ranges.items()])
    low, span = limits[:, 0], limits[:, 1] - limits[:, 0]
    share = tol / max(1.0, float(span.max()))
    coarsest = float(
        np.clip(MINOR * share, SCAN_ERROR, LOOSE_LOG_ERROR)
    )  # it moves a place by a small part of the wanted distance
    ends = {path: (float(a), float(b)) for path, (a, b) in ranges.items()}
    family = make_family(source, ends, loop, coarsest=coarsest)
    rough: SpectraFunction = lambda points: family.rough(low + span * points)  # noqa: E731
    found = find_curves(rough, share, cells, family.is_constant(low + span / 2), effort)
    first, second = ranges
    curves = [
        describe_curve((first, second), curve, low + span * lost, family, low, span, share)
        for curve, lost in zip(found, find_lost_ends(found), strict=True)
    ]
    return sorted(curves, key=lambda curve: -len(curve.points))


def describe_curve(
    paths: tuple[str, str], curve: Curve, lost: Array, family: Family, low: Array, span: Array, share: float
) -> BoundaryCurve:
    """A curve in the numbers' units, with its resonance; share: the wanted distance, of the ranges."""
    inside = low + span * curve.inside
    text, evaluations = describe_causes(family, inside), family.evaluations
    place = (float(inside[0]), float(inside[1]))
    points, error, wanted = low + span * curve.points, curve.errors * float(span.max()), share * float(span.max())
    status = describe_errors(paths, points, error, wanted)
    if len(lost):
        status += f"; it was lost at {name_place(paths, lost[0])}: ask for narrower ranges around that place"
    return BoundaryCurve(paths, points, error, curve.closed, text, place, evaluations, lost, status)


def describe_errors(paths: tuple[str, str], points: Array, error: Array, wanted: float) -> str:
    """Whether a curve is as near to the boundary as was asked, and what to do if it is not."""
    worst, far = int(error.argmax()), int((error > wanted).sum())
    if not far:
        return f"every point lies within {error[worst]:.1e} of the boundary"
    where = name_place(paths, points[worst])
    return (
        f"{far} of {counted(len(points), 'point')} may lie further from the boundary than the {wanted:.1e} asked for, "
        f"up to {error[worst]:.1e} at {where}; ask for narrower ranges around that place, or for a larger tol"
    )


def name_place(paths: tuple[str, str], point: Array) -> str:
    """Both numbers at a point."""
    return ", ".join(f"{path} = {value:.6g}" for path, value in zip(paths, point, strict=True))
