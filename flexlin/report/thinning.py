"""A large sweep on as many values as a picture can show: of neighbours the one that grows fastest stands for all."""

import numpy as np
import xarray

from flexlin.checks import Array

MOST = {1: 2000, 2: 300}
"""Values along an axis of a picture, by the number of axes: about two a pixel, and two pixels a cell."""


def thin(data: xarray.Dataset) -> xarray.Dataset:
    """The sweep itself where it is small; else blocks of neighbours, each with the numbers of its fastest growing value."""
    dims = [str(dim) for dim in data["verdict"].dims]
    most = MOST[len(dims)]
    if max(data["verdict"].shape) <= most:
        return data
    size = [-(-n // most) for n in data["verdict"].shape]
    chosen = find_fastest(np.nan_to_num(data["exponents"].real.max("mode").to_numpy(), nan=-np.inf), size)
    if len(dims) == 1:
        return data.isel({dims[0]: chosen[0].ravel()})
    where = {dim: xarray.DataArray(index, dims=dims) for dim, index in zip(dims, chosen, strict=True)}
    axes = {dim: thin_axis(data[dim].to_numpy(), step) for dim, step in zip(dims, size, strict=True)}
    return data.isel(where).drop_vars(dims).assign_coords(axes)


def find_fastest(growth: Array, size: list[int]) -> tuple[Array, ...]:
    """The indices of the largest value of each block of `size` neighbours."""
    blocks = [-(-n // step) for n, step in zip(growth.shape, size, strict=True)]
    padded = np.full([count * step for count, step in zip(blocks, size, strict=True)], -np.inf)
    padded[tuple(slice(n) for n in growth.shape)] = growth
    cut = padded.reshape([part for pair in zip(blocks, size, strict=True) for part in pair])
    order = [*range(0, cut.ndim, 2), *range(1, cut.ndim, 2)]
    inner = np.unravel_index(cut.transpose(order).reshape(*blocks, -1).argmax(axis=-1), size)
    starts = np.meshgrid(*(np.arange(count) * step for count, step in zip(blocks, size, strict=True)), indexing="ij")
    return tuple(
        np.minimum(start + offset, n - 1) for start, offset, n in zip(starts, inner, growth.shape, strict=True)
    )


def thin_axis(values: Array, step: int) -> Array:
    """The middle of each block of neighbours; the ends stay."""
    middle = values[np.minimum(np.arange(0, len(values), step) + step // 2, len(values) - 1)].copy()
    middle[0], middle[-1] = values[0], values[-1]
    return middle
