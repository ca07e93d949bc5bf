"""What the Taylor maps are made of."""

from typing import Annotated, Any

import casadi as ca

from flexlin.arguments import Kind


def is_expression(value: Any) -> bool:
    """Whether it is of CasADi."""
    return isinstance(value, (ca.SX, ca.MX, ca.DM))


Expression = Annotated[Any, Kind("a CasADi expression", is_expression)]
