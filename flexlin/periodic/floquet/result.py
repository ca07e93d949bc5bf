"""What `floquet` returns: exponents with their errors, a verdict that admits doubt, and what to do next."""

from dataclasses import field
from importlib import import_module
from math import inf
from typing import TYPE_CHECKING, Any

import numpy as np

from flexlin.checks import Array
from flexlin.errors import NotStable, counted
from flexlin.periodic.circle import measure_distances
from flexlin.periodic.coefficient_series.matrix import ResolvedCompanion, ResolvedMatrix
from flexlin.periodic.coefficient_series.sampling import RESOLVED_TOL
from flexlin.periodic.decoupling.coupling import Decoupled
from flexlin.periodic.transition.choose_segments import Setting
from flexlin.plots.view import Series, Shown, View
from flexlin.summary import immutable

if TYPE_CHECKING:
    import xarray

MARGINAL_GROWTH = 1e-9
"""Growth per basic frequency below which no arm shows whether a motion grows or decays."""
MARGINAL_ADVICE = (
    "add damping, write A in coordinates in which its entries are smaller, or treat the system as marginal "
    "(undamped and rigid-body modes are)"
)
"""What to do where rounding, or an exponent that is zero, leaves the verdict open."""
TOO_COARSE, UNRESOLVED = "the resolution is too coarse to decide", "leave method, order and segments to the solver"
"""Why a resolution that is held leaves the verdict open, and what to do."""


@immutable
class FloquetResult(Shown):
    """Floquet exponents lambda of x' = A(t) x, each with its error, and the verdict that they allow.

        x(t) = exp(lambda t) p(t),   p(t + T) = p(t)

    Attributes
    ----------
    exponents : array, shape (n,)
        Complex, in 1/s, by falling real part; imaginary parts in (-pi/T, pi/T].
    errors : array, shape (n,)
        Estimated bounds of the error of each exponent, in 1/s: by perturbation theory, from what the method leaves out, what is not
        known of A, and rounding. inf for modes too fast, or hidden by rounding: they grow less than the largest growth rate and its error.
    period : float
        T in s.
    verdict : str
        stable, unstable or undecided; undecided where an exponent's distance to the imaginary axis is below its error.
    status : str
        What the verdict rests on and what to do next.
    setting : Setting
        How the exponents were computed: method, order and segments, and `setting.reason` for the choice.
    reason : str
        Why a verdict is undecided or practically marginal, in one sentence; empty where it is neither.
    resolved : ResolvedMatrix or ResolvedCompanion
        A(t) as the series that the exponents belong to, for the certificate.
    decoupled : Decoupled
        Coordinates in which the modes stand apart, for `floquet_modes`, where the exponents were found in them.

    Examples
    --------
    >>> import flexlin as fl
    >>> result = fl.floquet(fl.PeriodicSystem([[0.0, 1.0], [-1.0, -0.2]], 1.0))
    >>> result.verdict, result.exponents.real.round(9).tolist(), result.error < 1e-12
    ('stable', [-0.1, -0.1], True)
    """

    exponents: Array
    errors: Array
    period: float
    verdict: str
    status: str
    setting: Setting
    reason: str = ""
    resolved: ResolvedMatrix | ResolvedCompanion | None = field(default=None, repr=False, compare=False)
    decoupled: Decoupled | None = field(default=None, repr=False, compare=False)

    @property
    def error(self) -> float:
        """The largest error of a resolved exponent, in 1/s."""
        known = self.errors[np.isfinite(self.errors)]
        return float(known.max()) if len(known) else np.inf

    @property
    def log_multipliers(self) -> Array:
        """log of the multipliers; imaginary parts in (-pi, pi]."""
        return self.exponents * self.period

    @property
    def multipliers(self) -> Array:
        """exp(lambda T); 0 or inf where that leaves the range of floating-point numbers."""
        with np.errstate(over="ignore", under="ignore", invalid="ignore"):
            size = np.exp(self.log_multipliers.real)
            angle = self.log_multipliers.imag
            return np.where(np.isinf(size), size + 0j, size * np.exp(1j * angle))

    def certificate(self) -> Any:
        """Issue a Lyapunov certificate: a periodic X(t) > 0 with X' + A' X + X A < 0 proved over the whole period.

        Returns
        -------
        Certificate
            X(t), margin, tolerates.

        Raises
        ------
        NotCertified
            For an unstable or undecided loop, or where no X that is tried proves it.

        References
        ----------
        Bittanti, Colaneri, Periodic Systems (2009), ch. 4 (periodic Lyapunov inequality).

        Examples
        --------
        >>> import flexlin as fl
        >>> print(f"{fl.floquet(fl.PeriodicSystem([[-0.3]], 1.0)).certificate().margin:.4f}")
        0.6000
        """
        certify = import_module("flexlin.periodic.certificate").certify  # it stands above this room
        return certify(self)

    def to_xarray(self) -> "xarray.Dataset":
        """Return exponents, errors and multipliers as a dataset with units.

        Returns
        -------
        xarray.Dataset
            exponents, multipliers (complex), growth_rate, frequency and error, each by mode; verdict, status and period as attributes.
        """
        import xarray

        found = {
            "exponents": (self.exponents, "1/s"),
            "error": (self.errors, "1/s"),
            "growth_rate": (self.exponents.real, "1/s"),
            "frequency": (np.abs(self.exponents.imag) / (2 * np.pi), "Hz"),
            "multipliers": (self.multipliers, "1"),
        }
        series = {name: ("mode", values, {"units": unit}) for name, (values, unit) in found.items()}
        attributes = {"verdict": self.verdict, "status": self.status, "period": self.period, "period_units": "s"}
        return xarray.Dataset(series, coords={"mode": np.arange(len(self.exponents))}, attrs=attributes)

    def _view(self) -> View:
        growth, error = float(self.exponents[0].real), float(self.errors[0])
        upper = self.exponents[self.exponents.imag >= 0]
        places = Series("exponents", upper.real, upper.imag / (2 * np.pi), "dots")
        facts = [
            f"growth rate {growth:.6g} ± {error:.0e} 1/s, {counted(len(self.exponents), 'exponent')}, period {self.period:.6g} s",
            f"by {self.setting}",
            *([self.reason] if self.reason else []),
        ]
        return View("Floquet", self.verdict, tuple(facts), "growth rate in 1/s", "frequency in Hz", (places,), True)


def judge(
    exponents: Array,
    errors: Array,
    period: float,
    setting: Setting,
    tol: float,
    undamped: bool = False,
    coarse: bool = False,
    decoupled: Decoupled | None = None,
) -> FloquetResult:
    """Give the verdict: undecided when an exponent's distance to the imaginary axis is below its error.

    undamped: the system is Hamiltonian; coarse: the resolution makes the errors, and another one makes smaller ones; decoupled: what the
    exponents were found in, to be kept.
    """
    # a few numbers, faster than arrays
    values, growth, off = exponents.tolist(), exponents.real.tolist(), errors.tolist()
    both, modes = list(zip(growth, off, strict=True)), range(len(off))
    critical = max(modes, key=lambda i: -inf if off[i] == inf else growth[i] + off[i])
    if any(g > e for g, e in both):
        critical = max(modes, key=lambda i: growth[i] - off[i])
        verdict = "unstable"
    elif min(off) < inf and all(g < -e or (e == inf and g < 0) for g, e in both):
        verdict = "stable"
    else:
        verdict = "undecided"
    facts = f"growth rate {growth[critical]:.6g} +- {off[critical]:.1e} 1/s by {setting}"
    isolated = (
        undamped and verdict == "undecided" and not find_coinciding_within(period * exponents, period * errors).any()
    )
    rounded = off[critical] <= RESOLVED_TOL * max(1 / period, max(map(abs, values)))
    reason = explain(verdict, growth[critical], off[critical], period, tol, isolated, coarse, rounded)
    advice = {
        "stable": "every disturbance decays",
        "unstable": "some disturbance grows: change the motion, the speed, the payload or the controller",
        "undecided": UNRESOLVED if reason == TOO_COARSE else MARGINAL_ADVICE,
    }[verdict]
    advice = f"{reason}; {advice}" if reason else advice
    hidden = off.count(inf)
    if hidden:
        most = max((g + e for g, e in both if e != inf), default=inf)
        bounded = f", only known to lie below {most:.3g} 1/s" if hidden < len(off) else ""
        advice += f"; too fast or hidden by rounding: {counted(hidden, 'exponent')}{bounded}"
    missed = any(e != inf and e > tol * max(1.0, abs(value)) for value, e in zip(values, off, strict=True))
    allows = "the resolution allows" if coarse else "rounding and the resolution allow"
    limit = f"; tol {tol:.0e} was not reached, the error above is what {allows}" if missed else ""
    status = f"{verdict}: {facts}; {advice}{limit}"
    return FloquetResult(exponents, errors, period, verdict, status, setting, reason, None, decoupled)


def need_stable(found: FloquetResult, what: str) -> None:
    """Refuse what a system that is not known to be stable does not have. Raises: NotStable, with `what` as its reason."""
    if found.verdict != "stable":
        raise NotStable(what, got=found.status, expected="a stable system") from None  # the verdict is the reason


def find_reached(exponents: Array, errors: Array, tol: float) -> Array:
    """Which errors (n,) are at most tol, relative beyond 1/s."""
    return np.asarray(errors <= tol * np.maximum(1.0, np.abs(exponents)))


def explain(
    verdict: str, growth: float, error: float, period: float, tol: float, isolated: bool, coarse: bool, rounded: bool
) -> str:
    """Why a verdict is undecided, or says less than it seems to; nothing where it is plain."""
    if isolated:
        return (
            "the system is undamped and every multiplier is simple: all lie on the unit circle, the motion stays bounded "
            "and nothing decays"
        )
    if verdict == "undecided" and error > tol * max(1.0, abs(growth)):
        if coarse:
            return TOO_COARSE
        return (
            "double precision cannot decide: rounding moves the growth rate by more than its distance to zero, because exponents "
            "nearly coincide or the system is far from normal"
        )
    if verdict == "undecided":
        return f"the growth rate is zero to within its error{', which rounding makes' if rounded else ': a smaller tol may decide'}"
    if abs(growth) * period < MARGINAL_GROWTH * 2 * np.pi:
        return f"practically marginal: the growth rate is below {MARGINAL_GROWTH:.0e} of the basic frequency"
    return ""


def find_coinciding_within(logs: Array, errors: Array) -> Array:
    """Which logs of multipliers agree with another one within their errors, (n,)."""
    with np.errstate(invalid="ignore"):
        near = measure_distances(logs, logs) <= errors[:, None] + errors
    return np.asarray((near & ~np.eye(len(logs), dtype=bool)).any(axis=1))
