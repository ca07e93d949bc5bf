"""The coefficients of M y'' + D y' + K y = h + B u along a motion, as functions of time."""

from dataclasses import dataclass

import casadi as ca
from numpy.typing import ArrayLike

from flexlin.about.deviation import Deviation
from flexlin.checks import Array, at_times, times
from flexlin.lazy import lazy
from flexlin.mechanics.coordinates import Coordinate
from flexlin.mechanics.manipulator import Manipulator
from flexlin.motion import Motion
from flexlin.summary import represent
from flexlin.symbolic import Part


@dataclass(frozen=True)
class Coefficients:
    """M_L, D_L, K_L (N, n, n), h_L (N, n), B_L (N, n, m) and the feedforward torque of the rigid motion tau (N, m), at N times."""

    M: Array
    D: Array
    K: Array
    h: Array
    B: Array
    tau: Array

    __repr__ = represent


@dataclass(frozen=True, eq=False)
class SecondOrderEquations:
    """The equations M_L y'' + D_L y' + K_L y = h_L + B_L u of the deviation y; those of the arm alone are one CasADi function.

    A loop adds B gain to [K_L, D_L] and the torque of the rigid motion to h_L, in numbers: no loop needs a function of its own.
    """

    about: Deviation
    of_arm: ca.Function

    @property
    def direct_gain(self) -> Array | None:
        """What of a loop's feedback answers [y; y'] at once, (m, 2n); none where nothing does."""
        return None

    @property
    def feeds_forward(self) -> bool:
        """Whether h_L holds the torque of the rigid motion."""
        return False

    @property
    def arm(self) -> Manipulator:
        """The manipulator."""
        return self.about.arm

    @property
    def motion(self) -> Motion:
        """The rigid basic motion."""
        return self.about.motion

    @property
    def kept(self) -> tuple[int, ...]:
        """Which coordinates of the arm are in y."""
        return self.about.kept

    @property
    def driven(self) -> tuple[int, ...]:
        """Which joints a torque drives."""
        return self.about.driven

    @property
    def period(self) -> float:
        """The period of the basic motion, in s."""
        return self.motion.period

    @property
    def n(self) -> int:
        """The number of coordinates of the linear equations."""
        return self.about.n

    @property
    def coordinates(self) -> tuple[Coordinate, ...]:
        """What each coordinate of y is."""
        return tuple(self.arm.coordinates[k] for k in self.kept)

    @property
    def names(self) -> tuple[str, ...]:
        """The names of the coordinates y."""
        return tuple(self.arm.names[k] for k in self.kept)

    @property
    def inputs(self) -> tuple[str, ...]:
        """The names of the coordinates that the inputs drive."""
        return tuple(self.arm.names[self.arm.drives[i]] for i in self.driven)

    def sample(self, t: Array) -> Coefficients:
        """Return all coefficients at many times, in one mapped call.

        Parameters
        ----------
        t : array, shape (N,)
            Times in s.

        Returns
        -------
        Coefficients
            M, D, K (N, n, n), h (N, n), B (N, n, m) and the torque of the rigid motion tau (N, m).
        """
        M, D, K, h, B, tau = self.about.evaluate(self.of_arm, times(t))
        forced = h + B @ tau if self.feeds_forward else h
        return Coefficients(M, *self._answered(D, K, B), forced[:, :, 0], B, tau[:, :, 0])

    def _answered(self, D: Array, K: Array, B: Array) -> tuple[Array, Array]:
        """D and K of the loop, from those of the arm."""
        gain, n = self.direct_gain, self.n
        if gain is None:
            return D, K
        loop = B @ gain
        return D + loop[..., n:], K + loop[..., :n]

    def M(self, t: ArrayLike) -> Array:
        """Return the mass matrix, Eq (65).

        Parameters
        ----------
        t : array_like, shape (N,) or ()
            Times in s.

        Returns
        -------
        array, shape (N, n, n) or (n, n)
            M_L, in kg m^2, kg m and kg.
        """
        return at_times(lambda t: self.mass_and_input(t)[0], t)

    def D(self, t: ArrayLike) -> Array:
        """Return the matrix of y', Eq (66).

        Parameters
        ----------
        t : array_like, shape (N,) or ()
            Times in s.

        Returns
        -------
        array, shape (N, n, n) or (n, n)
            D_L, in the unit of M per s.
        """
        return at_times(lambda t: self.equations(t)[1], t)

    def K(self, t: ArrayLike) -> Array:
        """Return the matrix of y, Eq (67).

        Parameters
        ----------
        t : array_like, shape (N,) or ()
            Times in s.

        Returns
        -------
        array, shape (N, n, n) or (n, n)
            K_L, in the unit of M per s^2.
        """
        return at_times(lambda t: self.equations(t)[2], t)

    def h(self, t: ArrayLike) -> Array:
        """Return the forcing that the rigid motion leaves over, Eq (64).

        Parameters
        ----------
        t : array_like, shape (N,) or ()
            Times in s.

        Returns
        -------
        array, shape (N, n) or (n,)
            h_L, in N m or N.
        """
        return at_times(lambda t: self.sample(t).h, t)

    def B(self, t: ArrayLike) -> Array:
        """Return the input matrix.

        Parameters
        ----------
        t : array_like, shape (N,) or ()
            Times in s.

        Returns
        -------
        array, shape (N, n, m) or (n, m)
            B_L.
        """
        return at_times(lambda t: self.mass_and_input(t)[1], t)

    def feedforward(self, t: ArrayLike) -> Array:
        """Return the torque of the rigid motion: what the arm would need if its links were rigid.

        Parameters
        ----------
        t : array_like, shape (N,) or ()
            Times in s.

        Returns
        -------
        array, shape (N, m) or (m,)
            The torque, in N m (N for sliding joints, V for motors).
        """
        return at_times(lambda t: self.about.evaluate(self._torque, t)[0][:, :, 0], t)

    def equations(self, t: Array) -> tuple[Array, Array, Array]:
        """Return M, D, K without the rest.

        Parameters
        ----------
        t : array, shape (N,)
            Times in s.

        Returns
        -------
        tuple of array, each of shape (N, n, n)
            M, D, K.
        """
        M, D, K, *B = self.about.evaluate(self._equations, times(t))
        return M, *(self._answered(D, K, *B) if B else (D, K))

    def mass_and_input(self, t: Array) -> tuple[Array, Array]:
        """Return M and B without the rest.

        Parameters
        ----------
        t : array, shape (N,)
            Times in s.

        Returns
        -------
        M : array, shape (N, n, n)
            Mass matrix.
        B : array, shape (N, n, m)
            Input matrix.
        """
        M, B = self.about.evaluate(self._inputs, times(t))
        return M, B

    @lazy
    def _equations(self) -> Part:
        return Part(self.of_arm, ("M", "D", "K") if self.direct_gain is None else ("M", "D", "K", "B"))

    @lazy
    def _inputs(self) -> Part:
        return Part(self.of_arm, ("M", "B"))

    @lazy
    def _forces(self) -> Part:
        return Part(self.of_arm, ("M", "h", "B", "tau") if self.feeds_forward else ("M", "h"))

    @lazy
    def _torque(self) -> Part:
        return Part(self.of_arm, ("tau",))
