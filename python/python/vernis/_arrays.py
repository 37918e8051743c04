"""Arrays as they come, made into those that the extension takes: C-contiguous, of one type, of one shape."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ._errors import InputError

Floats = NDArray[np.float64]

#: How far the length of a direction may be from 1: what float32 and normalised half floats leave.
UNIT_TOLERANCE = 1e-3


def real(array: Any, what: str) -> NDArray[Any]:
    """An array of real numbers, of whatever shape."""
    try:
        array = np.asarray(array)
    except Exception as error:
        raise InputError(f"{what} cannot be made into an array: {error}") from error
    if array.dtype.kind not in "fiu":
        raise InputError(f"{what} has the dtype {array.dtype}; it must be one of real numbers, such as float64 or float32")
    return array


def directions(array: Any, what: str) -> Floats:
    """Unit vectors of shape (..., 3)."""
    array = real(array, what)
    if array.ndim == 0 or array.shape[-1] != 3:
        raise InputError(f"{what} has the shape {array.shape}; it must be (..., 3), a unit vector a row")
    vectors = array.astype(np.float64)
    lengths = np.sqrt(np.sum(vectors**2, axis=-1))
    wrong = ~(np.abs(lengths - 1.0) <= UNIT_TOLERANCE)
    if wrong.any():
        first = tuple(int(i) for i in np.argwhere(wrong)[0])
        raise InputError(f"{what}{list(first) if first else ''} is {vectors[first].tolist()}; it must be a unit vector")
    return vectors


def values(array: Any, nodes: int, what: str = "values") -> Floats:
    """Values on nodes, of shape (n, 3) or (batch, n, 3)."""
    array = real(array, what)
    if array.ndim not in (2, 3) or array.shape[-2:] != (nodes, 3):
        raise InputError(f"{what} has the shape {array.shape}; it must be ({nodes}, 3) or (batch, {nodes}, 3), RGB a node")
    return np.ascontiguousarray(array, dtype=np.float64)
