"""The nonlinear equations solved for the acceleration at one time, with joints that stick."""

import numpy as np

from flexlin import symbolic
from flexlin.about.linearization import Linearization
from flexlin.checks import Array
from flexlin.lapack import LAPACK
from flexlin.lazy import lazy
from flexlin.simulation.equations import deviation_equations
from flexlin.simulation.friction import Friction
from flexlin.simulation.stepping import TrialLeftRange


class Acceleration:
    """M y'' + J holding = B torque - (M s_R'' + C s' + g + d),   J' (s_R'' + y'') = 0 for the joints J that stick."""

    def __init__(self, lin: Linearization, friction: Friction | None):
        self.about, self.friction, self._kept, self._n = lin.about, friction, list(lin.kept), lin.n

    @lazy
    def _equations(self) -> symbolic.Pointwise:
        return symbolic.Pointwise(deviation_equations(self.about))

    def rates(self, t: float, x: Array) -> Array:
        """The rates s' of all coordinates of the arm in a state [y; y'] (2n,)."""
        return np.asarray(self._equations(x, *self.about.place_at(t))[3][:, 0])

    def solve(self, t: float, x: Array, torque: Array, slip: Array | None = None) -> tuple[Array, Array, float]:
        """y'' (n,), the friction that holds the joints that stick, and the power into the arm, in a state x = [y; y'] (2n,).

        Parameters: slip: (p,) of the joints that may stick, 0 where one does and else the sign of its rate; None: smooth friction.
        Raises: TrialLeftRange where the mass matrix is not positive definite.
        """
        M, B, left, rates, lost = self._equations(x, *self.about.place_at(t))
        kept, left, rates, friction = self._kept, left[:, 0], rates[:, 0], self.friction
        if friction is not None and slip is not None:
            moving = list(friction.places)
            added = slip * friction.sliding(rates[moving]) - friction.smooth(rates[moving])
            left[moving] += added
            lost = lost + rates[moving] @ added
        _, acceleration, failed = LAPACK.dposv(M[kept], (B @ torque - left)[kept])
        if failed:
            raise TrialLeftRange("the mass matrix is not positive definite there")
        holding = np.zeros(0)
        if friction is not None and slip is not None and not np.all(slip):
            stuck = [row for row, mode in zip(friction.rows, slip, strict=True) if mode == 0]
            led = self.about.positions(np.array([t]), *np.zeros((3, 1, self._n)))[2][0, kept][stuck]
            reply = LAPACK.dposv(M[kept], np.eye(self._n)[:, stuck])[1]
            holding = np.linalg.solve(reply[stuck], acceleration[stuck] + led)
            acceleration = acceleration - reply @ holding
        return acceleration, holding, float(rates @ (left + M @ acceleration) - lost[0, 0])
