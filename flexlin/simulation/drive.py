"""What the drive makes of the commanded torque: saturation, sampling, delay, steps of encoders and torques."""

from dataclasses import dataclass, replace

import numpy as np

from flexlin.checks import Array
from flexlin.errors import ArgumentError
from flexlin.linearization.linearization import Linearization


@dataclass(frozen=True)
class Drive:
    """What stands between the commanded torque and the joint; each part is off unless it is given.

    Parameters
    ----------
    limit : tuple of float, optional
        Largest |torque| of each of the m inputs, in N m.
    sample_time : float, optional
        The command is computed once in each interval of this length, in s, and held (zero-order hold).
    delay : float
        Time between measuring and the torque taking effect, in s; at most one sample time.
    rate : tuple of float, optional
        Largest rate at which each torque changes, in N m/s; not beside a sample time.
    encoders : tuple of float, optional
        Steps of the m encoders, in rad or m, to which their readings are rounded; with a sample time.
    steps : tuple of float, optional
        Steps of the m torques, in N m, to which these are rounded; with a sample time.

    Raises
    ------
    ArgumentError
        When a number is out of range.

    Examples
    --------
    >>> import numpy as np
    >>> from flexlin.simulation import Drive
    >>> Drive(limit=(2.0,)).saturated(np.array([3.5])).tolist()
    [2.0]
    """

    limit: tuple[float, ...] | None = None
    sample_time: float | None = None
    delay: float = 0.0
    rate: tuple[float, ...] | None = None
    encoders: tuple[float, ...] | None = None
    steps: tuple[float, ...] | None = None

    def __post_init__(self) -> None:
        for name in ("limit", "rate", "encoders", "steps", "sample_time"):
            values = getattr(self, name)
            if values is not None and not np.all(np.greater(values, 0)):
                raise ArgumentError(f"{name} is not positive", got=values, expected="numbers greater than 0")
        if self.rate is not None and self.sample_time is not None:
            raise ArgumentError(
                "a torque that is sampled and held changes in steps",
                got="[control.saturation] rate beside [control.sampling]",
                expected="one of them",
            )
        if self.sample_time is None and (self.encoders or self.steps):
            raise ArgumentError(
                "numbers are rounded where a device samples", got="steps without a sample time", expected="sample_time"
            )
        if not 0 <= self.delay <= (self.sample_time or 0.0):
            raise ArgumentError(
                "delay is out of range", got=self.delay, expected=f"0 to the sample time, {self.sample_time or 0.0} s"
            )

    def saturated(self, torque: Array) -> Array:
        """Return the torque that the motor gives.

        Parameters
        ----------
        torque : array, shape (m,)
            The commanded torque, in N m.

        Returns
        -------
        array, shape (m,)
            The torque in whole steps within the limits.
        """
        torque = torque if self.steps is None else np.array(self.steps) * np.round(torque / self.steps)
        return torque if self.limit is None else np.clip(torque, -np.array(self.limit), self.limit)


def scene_drive(lin: Linearization) -> Drive:
    """The drive that the scene's control tables describe."""
    if lin.control is None:
        return Drive()
    limit, sampling = lin.control.saturation, lin.control.sampling
    drive = Drive() if limit is None else Drive(limit=limit.torque, rate=limit.rate)
    if sampling is None:
        return drive
    steps = {"encoders": sampling.encoders, "steps": sampling.torque}
    return replace(drive, sample_time=sampling.period, delay=sampling.delay, **steps)
