"""What a simulation hands back."""

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from flexlin.checks import Array

if TYPE_CHECKING:
    import xarray


@dataclass(frozen=True)
class Simulation:
    """A nonlinear simulation and the linear prediction of the same motion.

    t (N,) in s; nonlinear, linear: deviations from the rigid motion as states [y; y'] (N, 2n); torque (N, m) in N m;
    tip, tip_linear, tip_rigid: positions (N, 2) in m; error: of the nonlinear states, from a second run at a tenth of the tolerance,
    on other steps and by a method of another order; linear_error: of the linear states, in the same way; both relative to the
    largest number of the states, or absolute below 1;
    energy_error: largest mismatch between the energy and the work done by torques and damping, relative to the largest energy
    that went to and fro (nan when the manipulator gives no energy); difference: largest distance of the two tips, in m;
    difference_error: of that distance, in m, both sides together; status: what the difference means.
    """

    names: tuple[str, ...]
    t: Array
    nonlinear: Array
    linear: Array
    torque: Array
    tip: Array
    tip_linear: Array
    tip_rigid: Array
    error: float
    linear_error: float
    energy_error: float
    difference_error: float

    @property
    def difference(self) -> float:
        """The largest distance between the nonlinear and the linear tip, in m."""
        return float(np.linalg.norm(self.tip - self.tip_linear, axis=1).max())

    @property
    def tip_error(self) -> float:
        """The largest distance of the nonlinear tip from the rigid one, in m."""
        return float(np.linalg.norm(self.tip - self.tip_rigid, axis=1).max())

    @property
    def deviation(self) -> float:
        """The largest deviation of a coordinate from the rigid motion, in rad or m."""
        return float(np.abs(self.nonlinear[:, : len(self.names)]).max())

    @property
    def status(self) -> str:
        """How far the linear model can be trusted here, and what to do."""
        what, apart, largest, error = self.apart
        if apart <= error:
            return f"linear and nonlinear {what} agree to the error of the integration, {error:.0e}: the linear model holds here"
        share = apart / largest
        facts = f"linear and nonlinear {what} differ by {apart:.3g}{self.unit}, {100 * share:.2g} % of the largest deviation"
        if share > 0.2:
            return (
                f"{facts}: beyond the linear model; reduce speed, payload or disturbance, or trust the simulation only"
            )
        return f"{facts}: the linear model holds here"

    @property
    def unit(self) -> str:
        """The unit of what is compared: metres of the tips; coordinates bear their own."""
        return " m" if np.isfinite(self.difference) else ""

    @property
    def apart(self) -> tuple[str, float, float, float]:
        """What is compared, how far the two answers are apart, the largest deviation of either, and the error of the difference.

        Tips in m against tips; for a model without points that coordinate of which the linear answer misses the largest share.
        """
        if np.isfinite(self.difference):
            linear = float(np.linalg.norm(self.tip_linear - self.tip_rigid, axis=1).max())
            return "tips", self.difference, max(self.tip_error, linear), self.difference_error
        n = len(self.names)
        nonlinear, linear_y = self.nonlinear[:, :n], self.linear[:, :n]
        error = (self.error + self.linear_error) * max(1.0, float(np.abs(self.nonlinear).max()))
        apart = np.abs(nonlinear - linear_y).max(axis=0)
        largest = np.maximum(np.abs(nonlinear), np.abs(linear_y)).max(axis=0)
        share = np.where(apart > error, apart / np.where(largest > 0, largest, 1.0), 0.0)
        worst = int(np.argmax(share)) if share.any() else int(np.argmax(apart))
        return self.names[worst], float(apart[worst]), float(largest[worst]), error

    def dataset(self) -> "xarray.Dataset":
        """All series as an xarray.Dataset."""
        import xarray

        states = [*self.names, *[f"{name}_rate" for name in self.names]]
        series = {
            "nonlinear": (("time", "state"), self.nonlinear),
            "linear": (("time", "state"), self.linear),
            "torque": (("time", "input"), self.torque),
            "tip": (("time", "axis"), self.tip),
            "tip_linear": (("time", "axis"), self.tip_linear),
            "tip_rigid": (("time", "axis"), self.tip_rigid),
        }
        data = xarray.Dataset(series, coords={"time": self.t, "state": states, "axis": ["x", "y"]})
        data["time"].attrs["units"] = "s"
        data.attrs["integration_error"] = self.error
        data.attrs["linear_error"] = self.linear_error
        data.attrs["difference_error"] = self.difference_error
        data.attrs["energy_error"] = self.energy_error
        return data
