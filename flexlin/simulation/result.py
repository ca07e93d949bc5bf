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
    tip, tip_linear, tip_rigid: positions (N, 2) in m; error: of the nonlinear states, from a second run at a tenth of the tolerance;
    energy_error: largest mismatch between the energy and the work done by torques and damping, relative to the largest energy
    that was moved (nan when the manipulator gives no energy); difference: largest distance of the two tips, in m;
    status: what the difference means.
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
    energy_error: float

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
        what, unit, apart, error = "tips", "m", self.difference, self.tip_error
        if not np.isfinite(apart):  # a model without points
            n = len(self.names)
            apart, error = np.abs(self.nonlinear - self.linear)[:, :n].max(), np.abs(self.nonlinear)[:, :n].max()
            what, unit = "coordinates", "rad or m"
        if apart <= self.error:
            return f"linear and nonlinear {what} agree to the error of the integration, {self.error:.0e}: the linear model holds here"
        share = apart / max(error, self.deviation)
        told = f"linear and nonlinear {what} differ by {apart:.3g} {unit}, {100 * share:.2g} % of the largest deviation"
        if share > 0.2:
            return (
                f"{told}: beyond the linear model; reduce speed, payload or disturbance, or trust the simulation only"
            )
        return f"{told}: the linear model holds here"

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
        data.attrs["energy_error"] = self.energy_error
        return data
