"""How a section's property varies along a link, relative to the link's own figure."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from flexlin.checks import Array, real_array
from flexlin.errors import ArgumentError


@dataclass(frozen=True)
class Profile:
    """A relative property over xi in [0, 1], smooth between its breaks.

    Parameters: function (N,) -> (N,); breaks: places in (0, 1) at which it or a derivative jumps.
    """

    function: Callable[[Array], Array]
    breaks: tuple[float, ...] = ()

    def __call__(self, xi: Array) -> Array:
        return self.function(xi)

    @classmethod
    def table(cls, xi: ArrayLike, values: ArrayLike) -> "Profile":
        """Interpolate a table linearly.

        Parameters: xi (k,) increasing from 0 to 1; values (k,) positive.
        Raises: ArgumentError when the table does not span [0, 1], does not increase or is not positive.
        """
        nodes = real_array("xi", xi, (None,))
        heights = real_array("values", values, (len(nodes),))
        if len(nodes) < 2 or nodes[0] != 0 or nodes[-1] != 1 or np.any(np.diff(nodes) <= 0):
            raise ArgumentError("the table's xi is not a partition", got=nodes, expected="increasing from 0 to 1")
        if np.any(heights <= 0):
            raise ArgumentError("a section property is not positive", got=heights.min(), expected="greater than 0")
        return cls(lambda x: np.interp(x, nodes, heights), tuple(nodes[1:-1].tolist()))


UNIFORM = Profile(np.ones_like)
