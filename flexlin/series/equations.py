"""Equations f(u, v) = 0 with V = D_v f as programs: the series of their solution v(u), Newton's method, and folds.

Folds are where V is singular, real or complex: how far a Taylor series of v converges is the distance to the nearest.
"""

from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from typing import Any, Literal, Self

import casadi as ca
import numpy as np

from flexlin.checks import Array
from flexlin.program import Program
from flexlin.series.indices import kept_indices
from flexlin.series.jets import Jet, Space, Work, carry_out, scalar_function


@dataclass(frozen=True, eq=False)
class Equations:
    """f(u, v), with as many rows as v, and V = D_v f, column by column."""

    gap: Program
    slope: Program

    @classmethod
    def read(cls, f: Any, u: Any, v: Any) -> Self:
        """Those of CasADi expressions (SX or MX). Raises: ArgumentError where f has free symbols."""
        function = scalar_function("f", [ca.vec(f)], [u, v])
        inputs = function.sx_in()
        V = ca.vec(ca.densify(ca.jacobian(function.call(inputs)[0], inputs[1])))
        return cls(Program.read(function), Program.read(ca.Function("V", inputs, [V])))

    def slopes(self, u: list[Jet], v: list[Jet]) -> list[list[Jet]]:
        """V as series, row by row."""
        (jets,) = carry_out(self.slope, u, v)
        rows = int(self.gap.sizes[0])
        return [jets[i::rows] for i in range(rows)]

    def at(self, u: Array, v: Array) -> tuple[Array, Array]:
        """f (N, m) and V (N, m, m) at u (N, nu), v (N, nv)."""
        space = Space(1, 0, (len(u),), np.result_type(u, v))
        given = [[Jet(space, (), column[None]) for column in x.T] for x in (u, v)]
        f = np.array([jet.c[0] for jet in carry_out(self.gap, *given)[0]]).T
        V = np.array([[jet.c[0] for jet in row] for row in self.slopes(*given)])
        return f, np.moveaxis(V, 2, 0)

    @np.errstate(all="ignore")
    def expand(self, space: Space, u: Callable[[Space], list[Jet]], v0: Array) -> Array:
        """The coefficients (nv, size, ...) of v(u) from its value (nv, ...), where f = 0 and V is regular.

            V dv = -f(u, v),   v right up to the degree r, dv from r + 1 to 2r + 1

        Parameters: u: gives the independent coordinates as series of a space, which is this one with lower orders.
        Source: the equations of de Jong et al. (14)-(25), by Newton's method on series instead of by Kronecker products.
        """
        v, r = np.array([space.zeros(space.all) for _ in v0]), 0
        v[:, 0] = v0
        while r < space.order:
            near, far = (
                replace(space, order=order) for order in (min(r, space.order - r - 1), min(2 * r + 1, space.order))
            )
            V = self.slopes(u(near), [near.fit(one) for one in v])
            (f,) = carry_out(self.gap, u(far), [far.fit(one) for one in v])
            step = solve_linear(far, V, [jet.whole for jet in f], r + 1)
            v[:, : step.shape[1]] += step
            r = far.order
        return v


def solve_linear(space: Space, V: list[list[Jet]], f: list[Array], first: int) -> Array:
    """x (nv, size, ...) of V x = -f from the degree `first` on, in which f begins.

    V_0 x_k = -f_k - sum_(j > 0) V_j x_(k-j)
    """
    work = Work(space, space.all, space.indices(space.all), [])
    x = np.array([space.zeros(space.all) for _ in V])
    head = np.array([[jet.c[0] for jet in row] for row in V])
    moving = [[(i, space.fit(jet.whole).c) for i, jet in enumerate(row) if jet.variables] for row in V]
    for k in range(first, space.order + 1):
        where = work.degree(k)
        right = np.array([-one[where] for one in f])
        for one, row in zip(right, moving, strict=True):
            for i, c in row if k > first else ():
                one -= work.convolve(c, x[i], k)
        x[:, where] = space.solve(head, right)
    return x


def newton_step(equations: Equations, u: Array, v: Array) -> Array:
    """Return V^-1 f (N, nv); infinite where V is singular or not finite."""
    f, V = equations.at(u, v)
    regular = np.all(np.isfinite(V), axis=(1, 2)) & np.all(np.isfinite(f), axis=1)
    regular[regular] = np.linalg.matrix_rank(V[regular]) == V.shape[1]
    step = np.full(f.shape, np.inf, dtype=f.dtype)
    step[regular] = np.linalg.solve(V[regular], f[regular][..., None])[..., 0]
    return step


def newton(equations: Equations, u: Array, v: Array, steps: int = 25) -> tuple[Array, Array]:
    """Refine v until f(u, v) = 0 to rounding.

    Returns: v (N, nv) and the size of the last step of each point (N,): above 1e-12 or infinite where the iteration did not end.
    """
    v, size = v.copy(), np.full(len(v), np.inf)
    active = np.arange(len(v))
    for _ in range(steps):
        step = newton_step(equations, u[active], v[active])
        size[active] = np.abs(step).max(axis=1)
        moving = np.isfinite(size[active])
        v[active[moving]] -= step[moving]
        active = active[moving & (size[active] > 1e-14 * (1 + np.abs(v[active]).max(axis=1)))]
        if not active.size:
            break
    return v, size


@dataclass(frozen=True)
class Fold:
    """A point u = u0 + S t with f(u, v) = 0 and V phi = 0; `defect`: the larger of Newton's last step and what is left of f and V phi."""

    t: Array
    v: Array
    phi: Array
    defect: float


@np.errstate(all="ignore")
def find_fold(equations: Equations, u0: Array, S: Array, start: tuple[Array, Array]) -> Fold:
    """Solve for the fold that Newton's method reaches from a start.

        f(u0 + S t, v) = 0,   V phi = 0,   c phi = 1     with c = conj(phi) of the start

    Square for one parameter t; for more, each step is the shortest one, so a near fold is found.

    Parameters: u0 (nu,), S (nu, p), start (t (p,), v (nv,)), real or complex.
    Returns: the last iterate with its defect; infinite when the iteration broke down.
    """
    t, v = start
    nv, p = len(v), len(t)
    _, V, _ = second_order(equations, u0, S, t, v)
    if not np.all(np.isfinite(V)):
        return Fold(t, v, np.full(nv, np.nan), np.inf)
    phi = np.linalg.svd(V[:, :nv])[2][-1].conj()
    c, defect = phi.conj(), np.inf
    for _ in range(30):
        f, J, H = second_order(equations, u0, S, t, v)
        V, turned = J[:, :nv], np.einsum("ijl,l->ij", H[:, :, :nv], phi)
        matrix = np.zeros((2 * nv + 1, 2 * nv + p), dtype=J.dtype)
        matrix[:nv, : nv + p], matrix[nv:-1, : nv + p], matrix[nv:-1, nv + p :], matrix[-1, nv + p :] = J, turned, V, c
        right = np.concatenate([f, V @ phi, [c @ phi - 1]])
        if not (np.all(np.isfinite(matrix)) and np.all(np.isfinite(right))):
            return Fold(t, v, phi, np.inf)
        step = np.linalg.lstsq(matrix, right, rcond=None)[0]
        defect = max(float(np.abs(step).max()), float(np.abs(right).max()))
        if defect < 1e-13 * (1 + np.abs(v).max()):
            break
        v, t, phi = v - step[:nv], t - step[nv : nv + p], phi - step[nv + p :]
    return Fold(t, v, phi, defect)


def second_order(equations: Equations, u0: Array, S: Array, t: Array, v: Array) -> tuple[Array, Array, Array]:
    """Return f (m,), its Jacobian (m, n) and second derivatives (m, n, n) by [v; t], n = nv + p."""
    nv, p = len(v), len(t)
    table, space = kept_indices(nv + p, 2), Space(nv + p, 2, (), np.result_type(u0, t, v))
    moved = [
        space.polynomial(space.all, [value, *np.zeros(nv), *row]) for value, row in zip(u0 + S @ t, S, strict=True)
    ]
    (jets,) = carry_out(equations.gap, moved, [space.variable(i, value) for i, value in enumerate(v)])
    coefficients = np.array([jet.whole for jet in jets])
    places = table.dense(2)
    H = (coefficients[:, places] * table.factorials[places]).reshape(-1, nv + p, nv + p)
    return coefficients[:, 0], coefficients[:, table.degree(1)], H


SINGULARITY_ORDER = 40
"""Order of the series in one variable from which singularities are estimated."""
NEAR_POLE, NEAR_GROWTH = 0.08, 0.035
"""A fold counts when it lies this near (relative) to where it was sought; the nearest one must lie this near to the radius
that the growth of the coefficients shows."""

Kind = Literal["real singularity", "complex pair", "not found"]


class Radius(float):
    """A radius of convergence: a length |du|, with what limits it.

    Attributes
    ----------
    kind : {"real singularity", "complex pair", "not found"}
        What limits the series. When nothing was found the number is nan and `estimate` is all there is.
    location : complex
        The signed or complex distance along the direction.
    v : array, shape (nv,)
        The dependent coordinates there.
    estimate : float
        The distance read off the series alone.

    Examples
    --------
    >>> import casadi as ca
    >>> import flexlin as fl
    >>> u, v = ca.SX.sym("u"), ca.SX.sym("v")
    >>> circle = fl.implicit_taylor(u**2 + v**2 - 1, u, v, [0.6], [0.8], 4)
    >>> print(circle.radius([1.0]).status)
    a singular configuration lies ahead, at a distance of 0.4
    """

    kind: Kind
    location: complex
    v: Array
    estimate: float

    def __new__(cls, kind: Kind, location: complex, v: Array, estimate: float) -> "Radius":
        value = super().__new__(cls, abs(location))
        value.kind, value.location, value.v, value.estimate = kind, location, v, estimate
        return value

    def __reduce__(self) -> tuple[type["Radius"], tuple[Kind, complex, Array, float]]:
        return type(self), (self.kind, self.location, self.v, self.estimate)

    def __repr__(self) -> str:
        return (
            f"Radius({float(self):.6g}, kind={self.kind!r}, location={self.location:.6g}, estimate={self.estimate:.6g})"
        )

    @property
    def status(self) -> str:
        """What the number means and what to do next."""
        if self.kind == "real singularity":
            side = "ahead" if self.location.real > 0 else "behind"
            return f"a singular configuration lies {side}, at a distance of {float(self):.6g}"
        if self.kind == "complex pair":
            return f"no real singularity limits the series but a complex pair at {self.location:.6g}; check c.error(du)"
        return f"no fold was confirmed; the series alone suggests {self.estimate:.4g}: check c.error(du) before use"


def line_series(equations: Equations, space: Space, u0: Iterable[Any], v0: Any, direction: Iterable[Any]) -> Array:
    """Return the coefficients of v(u0 + t d) by powers of t, (order + 1, nv); the space is of one variable."""

    def line(space: Space) -> list[Jet]:
        return [space.polynomial((0,), pair) for pair in zip(u0, direction, strict=True)]

    return equations.expand(space, line, v0).T


@np.errstate(all="ignore")
def radius_along(equations: Equations, u0: Array, v0: Array, direction: Array) -> Radius:
    """Return the distance to the nearest singularity of v(u0 + t d) in the complex plane of t.

    Padé approximants of w''/w' (w = entries of v) have a pole with residue -1/2 at each fold; such poles start Newton's method on
    the fold equations, which must end where it started from. Real folds are also sought by following the real branch: where w' = 0 at
    the start, there are no approximants.

    Parameters: direction (nu,) of length 1.
    """
    scale = growth(line_series(equations, Space(1, 8), u0, v0, direction))
    if not np.isfinite(scale):
        return Radius("not found", complex(np.nan), np.full(len(v0), np.nan), float("inf"))
    series = line_series(equations, Space(1, SINGULARITY_ORDER), u0, v0, scale * direction)
    estimate, S = growth(series), (scale * direction)[:, None]
    folds = [fold for side in (estimate, -estimate) for fold in real_fold(equations, u0, S, series, side)]
    for pole in singularities(series):
        if abs(pole) > 1.25 * estimate or any(abs(fold.t[0] - pole) < 0.01 * abs(pole) for fold in folds):
            continue
        fold = fold_from(equations, u0, S, series, complex(pole))
        if fold.defect < 1e-9 and abs(fold.t[0] - pole) < NEAR_POLE * abs(pole):
            folds.append(fold)
    nearest = min(folds, key=lambda fold: abs(fold.t[0]), default=None)
    if nearest is None or abs(abs(nearest.t[0]) - estimate) > NEAR_GROWTH * estimate:
        return Radius("not found", complex(np.nan), np.full(len(v0), np.nan), scale * estimate)
    t = complex(nearest.t[0])
    if abs(t.imag) < 1e-9 * abs(t):
        return Radius("real singularity", scale * complex(t.real), nearest.v.real, scale * estimate)
    return Radius("complex pair", scale * t, nearest.v, scale * estimate)


def real_fold(equations: Equations, u0: Array, S: Array, series: Array, estimate: float) -> list[Fold]:
    """Follow the real branch past an estimate: where it ends, bisection comes near enough for Newton's method to find the fold."""
    low, high = 0.9 * estimate, 1.05 * estimate
    v = (low ** np.arange(len(series)) @ series)[None, :]

    def follow(t: float) -> bool:
        nonlocal v
        there, last = newton(equations, (u0 + S @ np.array([t]))[None, :], v, 8)
        reached = bool(last[0] < 1e-9 and np.abs(there - v).max() < 0.5 * (1 + np.abs(v).max()))
        v = there if reached else v
        return reached

    if not follow(low) or follow(high):
        return []
    for _ in range(10):
        middle = (low + high) / 2
        low, high = (middle, high) if follow(middle) else (low, middle)
    fold = find_fold(equations, u0, S, (np.array([low]), v[0]))
    return [fold] if fold.defect < 1e-9 else []


def fold_from(equations: Equations, u0: Array, S: Array, series: Array, pole: complex) -> Fold:
    """Run Newton's method for a fold from just before a pole, on the branch that the series describes."""
    near = 0.98 * pole if abs(pole.imag) > 1e-3 * abs(pole) else 0.98 * pole.real
    t = np.array([near])
    v, _ = newton(equations, (u0 + S @ t)[None, :], (near ** np.arange(len(series)) @ series)[None, :], 8)
    return find_fold(equations, u0, S, (t, v[0]))


def growth(series: Array) -> float:
    """Estimate a radius of convergence from how fast coefficients grow: infinite for a polynomial.

    |c_k| ~ A k^(-3/2) rho^(-k) near a fold; log rho by a straight line through the upper half of the orders,
    smoothed over a window against the beat of complex pairs.
    """
    sizes = np.linalg.norm(series, axis=1)
    if np.all(sizes[len(sizes) // 2 :] <= 1e-14 * sizes[1:].max()):
        return float("inf")
    k = np.arange(len(sizes) // 2, len(sizes))
    width = len(k) // 3 + 1
    smooth = np.sqrt(np.convolve((sizes[k] * k**1.5) ** 2, np.ones(width), "valid"))
    return float(np.exp(-np.polyfit(np.arange(len(smooth)), np.log(smooth), 1)[0]))


def singularities(series: Array) -> Array:
    """Return the branch points that the series shows, nearest first, by Padé approximants of w''/w'.

    A factor (1 - t/t*)^a of w' gives a pole of residue a; zeros of w' (a = 1, 2 ...) and noise (a = 0) are left out.
    """
    from scipy.linalg import solve_triangular, toeplitz

    k, nv = np.arange(1, len(series)), series.shape[1]
    poles = []
    for weights in (*np.eye(nv), np.cos(1.0 + np.arange(nv))):
        first = k * (series[1:] @ weights)
        second = k[:-1] * first[1:]
        if abs(first[0]) <= 1e-9 * np.abs(first[:4]).max():
            continue
        quotient = solve_triangular(toeplitz(first[:-1], 0 * first[:-1]), second, lower=True, check_finite=False)
        if not np.all(np.isfinite(quotient)):
            continue
        for pole, residue in pade_poles(quotient):
            if residue.real < -0.25 and abs(residue.imag) < 0.3 and pole.imag >= 0:
                poles.append(pole)
    return np.array(sorted(poles, key=abs), dtype=complex)


def pade_poles(c: Array) -> list[tuple[complex, complex]]:
    """Return the poles of the diagonal Padé approximant of a power series with their residues."""
    m = (len(c) - 1) // 2
    rows = np.arange(m + 1, 2 * m + 1)[:, None] - np.arange(m + 1)[None, :]
    denominator = np.linalg.svd(c[rows])[2][-1]
    numerator = np.convolve(denominator, c)[: m + 1]
    poles = np.roots(denominator[::-1])
    slope = np.polyder(denominator[::-1])
    residues = np.polyval(numerator[::-1], poles) / np.polyval(slope, poles)
    return [(complex(p), complex(r)) for p, r in zip(poles, residues, strict=True) if np.isfinite(p)]
