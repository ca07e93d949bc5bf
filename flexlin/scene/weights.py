"""Weights of a design in physical sizes: the largest deviations that are acceptable."""

from typing import Annotated, Any

from pydantic import ConfigDict

from flexlin.scene.base import Table, Unit
from flexlin.scene.units import AnyDeviation, AnyDisplacement, AnyInput, AnyIntegral, AnyRate, Length, Speed

RATE = "_rate"
"""What stands behind a coordinate's name for its rate."""


class Weights(Table):
    """The largest acceptable deviations (Bryson's rule): Q and R hold the inverses of their squares.

        Q(t) = sum_i (y_i / d_i)^2 + |C_tip(t) [y; y']|^2 / d_tip^2,   R = diag(1 / d_u^2)

    tip: distance of the tip from its path; joints, rates: each angle of joints and of motors behind flexible joints, and its rate (a
    list: one a joint); deflection, deflection_rates: each elastic coordinate; input: each torque (a list: one each).
    integrals: the integral of each torque-driven joint's error, a state more (LQI).
    A coordinate's own name, such as w11 or q1_rate, takes the place of what the others say about it. What is not named costs nothing.
    """

    model_config = ConfigDict(frozen=True, extra="allow", allow_inf_nan=False)
    __pydantic_extra__: dict[str, AnyDeviation]

    tip: Length | None = None
    """Acceptable distance of the tip from its path."""
    joints: Annotated[AnyDisplacement | None, Unit("rad or m")] = None
    """Acceptable deviation of joints, or a list of one each."""
    rates: Annotated[AnyRate | None, Unit("rad/s or m/s")] = None
    """Acceptable deviation of the joints' rates, or a list of one each."""
    deflection: Length | None = None
    """Acceptable deviation of elastic coordinates."""
    deflection_rates: Speed | None = None
    """Acceptable rate of elastic coordinates."""
    integrals: Annotated[AnyIntegral | None, Unit("rad s or m s")] = None
    """Acceptable integral of the error of each torque-driven joint, or a list of one each: the design has integral action."""
    input: Annotated[AnyInput, Unit("N m, N or V")]
    """Acceptable torque, or a list of one each."""

    @property
    def coordinates(self) -> dict[str, Any]:
        """What is said of single coordinates and rates, by their names."""
        return dict(self.__pydantic_extra__ or {})
