"""Which parametric resonance an unstable exponent belongs to: principal or combination, sum or difference, and its order."""

from dataclasses import dataclass

import numpy as np

from flexlin.arguments import checked
from flexlin.checks import Array
from flexlin.periodic.floquet.modes import FloquetModes
from flexlin.periodic.system import PeriodicSystem
from flexlin.precision import CUBE_ROOT_EPS, MINOR


@dataclass(frozen=True)
class Resonance:
    """One unstable exponent and what drives it.

    kind: "principal" (2 w_a = k w), "sum" (w_a + w_b = k w), "difference" (w_a - w_b = k w), or "average" (one mode grows by itself, in
    the averaged system or by what the variation takes from its damping); order k; frequencies (w_a, w_b) of the averaged modes in rad/s;
    detuning, and w = 2 pi / T, in rad/s.
    """

    exponent: complex
    kind: str
    order: int
    frequencies: tuple[float, float]
    detuning: float
    w: float

    def __str__(self) -> str:
        growth = f"growth {self.exponent.real:.3g} 1/s"
        if self.kind == "average":
            return f"{growth}: {self.own_cause}"
        name = "parametric resonance" if self.kind == "principal" else f"{self.kind} combination resonance"
        return f"{growth}: {name} of order {self.order}, {self.condition}, detuning {self.detuning:.2g} rad/s"

    @property
    def own_cause(self) -> str:
        """Why one mode grows where no two averaged ones meet, in words: it may turn by w / 2, which no average of its own does."""
        own, half = self.frequencies[0], self.w / 2
        locked, by_chance = (abs(one % self.w - half) <= CUBE_ROOT_EPS * self.w for one in (self.exponent.imag, own))
        if locked and not by_chance:
            return f"parametric resonance at w / 2 = {half:.4g} rad/s"
        if abs(self.exponent.imag) <= CUBE_ROOT_EPS * abs(self.exponent):
            return "divergence, by no resonance with the motion"
        return f"flutter near {own:.4g} rad/s, by no resonance with the motion"

    @property
    def condition(self) -> str:
        """Which frequencies meet which multiple of the motion's, in words."""
        a, b = self.frequencies
        rule = {"principal": f"2 x {a:.4g}", "sum": f"{a:.4g} + {b:.4g}", "difference": f"{a:.4g} - {b:.4g}"}[self.kind]
        near = self.detuning <= MINOR * self.order * self.w
        where = "near" if near else f"at {self.detuning:.2g} rad/s from"
        return f"{rule} rad/s {where} {self.order} w, w = {self.w:.4g} rad/s = 2 pi / T"


@checked
def find_resonances(system: PeriodicSystem, modes: FloquetModes) -> list[Resonance]:
    """Identify the resonance behind every exponent that is unstable beyond its error (one entry for each complex pair).

        p(t) exp(lambda t) = sum_(m, j) c_mj phi_m exp((lambda + i j w) t),   mean A phi_m = sigma_m phi_m

    A component is strong where lambda + i j w is near sigma_m. The two strongest averaged modes a, b of an unstable Floquet mode
    satisfy Im(sigma_a - sigma_b) = (j_a - j_b) w: that is its resonance condition.

    Source: Nayfeh, Mook, Nonlinear Oscillations (1979), ch. 5; Xie, Dynamic Stability of Structures (2006).
    """
    values, vectors = np.linalg.eig(system.resolved.mean())
    found = []
    for i, exponent in enumerate(modes.exponents):
        if exponent.real > modes.errors[i] and exponent.imag >= 0:
            share = measure_shares(modes, i, vectors, values)
            if system.resolved.constant:  # modes that share a multiplier by chance do not drive each other
                share[np.arange(share.size).reshape(share.shape) != share.argmax()] = 0.0
            found.append(identify_resonance(exponent, share, values, 2 * np.pi / modes.period))
    return found


def measure_shares(modes: FloquetModes, i: int, vectors: Array, values: Array) -> Array:
    """|c_mj| of Floquet mode i: (n, 2 J + 1), harmonics -J ... J wide enough for every frequency of the averaged system."""
    w = 2 * np.pi / modes.period
    J = min(400, int(np.ceil(np.abs(values.imag).max() / w)) + 2)
    j = np.arange(-J, J + 1)
    kernel = modes.weights * np.exp(-1j * w * j[:, None] * modes.times)
    return np.abs(np.linalg.solve(vectors, (kernel @ modes.right[:, :, i]).T))


def identify_resonance(exponent: complex, share: Array, values: Array, w: float) -> Resonance:
    """Read the resonance condition off the two strongest averaged modes."""
    half = (share.shape[1] - 1) // 2
    strongest = share.max(axis=1)
    harmonic = share.argmax(axis=1) - half
    a, b = np.argsort(-strongest)[[0, min(1, len(strongest) - 1)]].tolist()  # a mode may be alone
    wa, wb = float(values[a].imag), float(values[b].imag)
    order = int(harmonic[b] - harmonic[a])
    detuning = abs(wa - wb - (harmonic[a] - harmonic[b]) * w)
    apart = detuning > w  # one drives the other, which follows at a frequency of its own
    if apart:  # the one that oscillates as the Floquet mode does
        wa = min((wa, wb), key=lambda one: abs((one - exponent.imag + w / 2) % w - w / 2))
    if strongest[b] < MINOR * strongest[a] or order == 0 or max(abs(wa), abs(wb)) == 0 or apart:
        return Resonance(complex(exponent), "average", 0, (abs(wa), abs(wa)), 0.0, w)
    conjugate = abs(values[a] - values[b].conjugate()) < 1e-9 * abs(values[a])
    kind = "difference" if wa * wb > 0 else "principal" if conjugate else "sum"
    high, low = max(abs(wa), abs(wb)), min(abs(wa), abs(wb))
    return Resonance(complex(exponent), kind, abs(order), (high, low), float(detuning), w)
