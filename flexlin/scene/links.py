"""The links of a planar chain."""

from typing import Annotated, Literal

from pydantic import Field

from flexlin.scene.base import NonNegative, Positive, Table

MAX_MODES = 60


class Link(Table):
    """A slender uniform link: Euler-Bernoulli bending in the plane, `modes` assumed modes (0: rigid)."""

    length: Positive
    mass_per_length: NonNegative
    bending_stiffness: Positive | None = None
    modes: Annotated[int, Field(strict=True, ge=0, le=MAX_MODES)] = 0
    mode_shapes: Literal["clamped-free"] = "clamped-free"
