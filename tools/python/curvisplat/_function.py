"""Transfer functions: which colour and opacity a scalar's values have."""

from __future__ import annotations

import dataclasses
import os
from typing import Any, List, Optional, Sequence, Tuple, Union

from . import _core


def colour_maps() -> List[str]:
    """The names of the colour maps, as `curvisplat colormaps` lists them."""
    return _core.colour_maps()


@dataclasses.dataclass(frozen=True)
class TransferFunction:
    """Colours and opacities over a scalar. What is None is chosen from the data.

    colours: a colour map (`curvisplat.colour_maps()`; NAME_r is reversed) or the path of a ParaView preset. range: (low, high) in the
    scalar's unit, "data", or percentiles such as "1%,99%". opacity: points (position, opacity), both 0..1, the position over the
    range; or "ramp" or "auto". asinh: (centre, width), to stretch the values around one. opacity_unit: the length, in the
    grid's unit, over which opacity accumulates; smaller is more opaque.
    """

    colours: Union[str, os.PathLike, None] = None
    range: Union[str, Tuple[float, float], None] = None
    opacity: Union[str, Sequence[Tuple[float, float]], None] = None
    asinh: Optional[Tuple[float, float]] = None
    opacity_unit: Optional[float] = None

    def replaced(self, **changes: Any) -> "TransferFunction":
        """The same function with some of its parts changed."""
        return dataclasses.replace(self, **changes)

    def options(self) -> dict:
        """The keyword arguments of render() that are this function."""
        return {name: value for name, value in vars(self).items() if value is not None}
