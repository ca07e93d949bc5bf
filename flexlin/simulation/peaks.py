"""The largest values of a simulation, sought between its output times too: on the integrator's own steps, which follow the motion."""

from dataclasses import dataclass

import numpy as np

from flexlin.checks import Array

PARTS = 8
"""Parts of a step at whose ends peaks are looked for; between these they are a parabola's."""
MOST_NUMBERS = 2**24
"""Numbers that are looked at, at the most; where steps are very many each has fewer parts."""


@dataclass(frozen=True)
class Peaks:
    """Largest absolute values: of the distances of the nonlinear tip from the linear one, and of both from the rigid one, in m; of the
    coordinates (n,) by the nonlinear equations, by the linear ones, and of their difference; of the torques (m,)."""

    difference: float
    tip: float
    tip_linear: float
    nonlinear: Array
    linear: Array
    apart: Array
    torque: Array

    @classmethod
    def of(cls, t: Array, y: tuple[Array, Array], tips: tuple[Array, Array, Array], torque: Array) -> "Peaks":
        """Those of series at times t (N,): y by both equations, (N, n); the nonlinear, the linear and the rigid tip; the torques (N, m).

        Torques may have corners, so no parabola is laid through them.
        """
        tip, linear, rigid = tips
        away = ((tip, linear), (tip, rigid), (linear, rigid))
        distances = [np.linalg.norm(one - other, axis=1) for one, other in away]
        found = find_peaks(t, np.column_stack([*distances, np.abs(y[0]), np.abs(y[1]), np.abs(y[0] - y[1])]))
        (difference, of_tip, of_linear), (both, by_linear, apart) = found[:3].tolist(), found[3:].reshape(3, -1)
        return cls(
            difference, of_tip, of_linear, both, by_linear, apart, torque=np.abs(torque).max(axis=0, initial=0.0)
        )


def find_peaks(t: Array, values: Array) -> Array:
    """The largest values (k,) of functions (N, k) at times t (N,): of the parabola through the largest one and its neighbours."""
    if len(t) < 3:
        return values.max(axis=0)
    column = np.arange(values.shape[1])
    at = np.clip(values.argmax(axis=0), 1, len(t) - 2)
    before, top, behind = (values[at + k, column] for k in (-1, 0, 1))
    left, right = t[at] - t[at - 1], t[at + 1] - t[at]
    with np.errstate(all="ignore"):
        rise, fall = (top - before) / left, (top - behind) / right
        bend = (rise + fall) / (left + right)
        slope = (rise * right - fall * left) / (left + right)
        more = np.minimum(slope**2 / (4 * bend), top - np.minimum(before, behind))
    inside = (top >= before) & (top >= behind) & (bend > 0)
    return np.maximum(values.max(axis=0), np.where(inside, top + more, -np.inf))


def subdivide(t: Array, reached: Array, columns: int) -> Array:
    """The output times t and, in order with them, the ends of the parts of all steps that ended at `reached`."""
    edges = np.union1d(t[[0, -1]], reached[(reached > t[0]) & (reached < t[-1])])
    parts = min(PARTS, MOST_NUMBERS // (columns * len(edges)))
    if parts == 0:
        return t
    inner = edges[:-1, None] + np.diff(edges)[:, None] * np.arange(parts) / parts
    return np.union1d(t, inner)
