"""Grids that are in memory."""

from __future__ import annotations

import dataclasses
from typing import Any, Hashable, Mapping, Optional, Sequence

import numpy as np

from . import _arguments, _core


@dataclasses.dataclass
class Block:
    """One block of a curvilinear grid in memory.

    x, y, z: positions of the nodes, arrays of shape (nk, nj, ni), float32 or float64. Any strides do, and nothing is
    copied: pass `a.T` for arrays of shape (ni, nj, nk). scalars: values by name, at the nodes (the same shape) or in the cells (one
    less along each dimension). blank: True where a node is not there. units: of the scalars, by name.
    """

    x: np.ndarray
    y: np.ndarray
    z: np.ndarray
    scalars: Mapping[str, np.ndarray]
    blank: Optional[np.ndarray] = None
    name: str = ""
    units: Mapping[str, str] = dataclasses.field(default_factory=dict)


def _values(name: str, array: Any) -> np.ndarray:
    """As numpy has it; masked values become NaN, which blanks them."""
    if np.ma.isMaskedArray(array) and np.ma.is_masked(array):
        kind = array.dtype if array.dtype.kind == "f" else np.dtype(np.float32)
        return array.astype(kind).filled(np.nan)
    return _arguments.array(name, array)


@_arguments.in_one_line
def from_xarray(dataset: Any, coordinates: Sequence[str] = ("x", "y", "z"),
                scalars: Optional[Sequence[str]] = None) -> Block:
    """The Block of an xarray.Dataset.

    coordinates: the variables of the positions along x, y and z; each may have fewer dimensions than three, such as an axis,
    and is spread over the others. scalars: names of data variables (default: all that have all three dimensions).
    """
    if not all(hasattr(dataset, name) for name in ("data_vars", "variables", "isel")):
        raise _arguments.wrong("dataset", dataset, "an xarray.Dataset")

    def known(argument: str, given: Any, what: str) -> list:
        found = [given] if isinstance(given, str) else _arguments.items(argument, given, what)
        for name in found:
            if not isinstance(name, Hashable) or name not in dataset:
                raise _core.UsageError(f"{argument}: the dataset has no variable {_arguments.shown(name)}; "
                                       f"it has {', '.join(map(str, dataset.variables))}")
        return found

    coordinates = known("coordinates", coordinates, "the names of three variables")
    if len(coordinates) != 3:
        raise _arguments.wrong("coordinates", coordinates, "the names of three variables")
    names = [name for name in dataset.data_vars if name not in coordinates]
    scalars = [name for name in names if dataset[name].ndim == 3] if scalars is None else known("scalars", scalars, "names of variables")
    more = next((name for name in scalars or names if dataset[name].ndim > 3), None)
    if more is not None and (scalars or not any(dataset[name].ndim == 3 for name in names)):
        first = dataset[more].dims[0]
        raise _core.UsageError(f"'{more}' has the dimensions {', '.join(map(str, dataset[more].dims))}; "
                               f"choose one of them first, as dataset.isel({first}=0)")
    if not scalars:
        raise _core.UsageError("scalars: the dataset has no variable of three dimensions, but " + ", ".join(map(str, names)))
    dimensions = dataset[scalars[0]].dims
    like = dataset[scalars[0]]

    def spread(name: str) -> np.ndarray:
        array = dataset[name].broadcast_like(like).transpose(*dimensions).values
        return array if array.dtype.kind == "f" and array.dtype.itemsize in (4, 8) else array.astype(np.float64)

    x, y, z = (spread(name) for name in coordinates)
    values = {str(name): _values(name, dataset[name].transpose(*dimensions).values) for name in scalars}
    units = {str(name): str(dataset[name].attrs.get("units", "")) for name in scalars}
    return Block(x, y, z, values, units=units)
