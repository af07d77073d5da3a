"""Pictures of curvilinear simulation grids, larger than memory if need be.

    import curvisplat
    curvisplat.convert("wing.splats", "wing.xyz", ["wing.q"])       # once: a grid becomes a cache
    cache = curvisplat.open("wing.splats")
    picture = cache.render(scalar="density", view="+x", size=(800, 600))
    picture.save("wing.png")

Positions and lengths are in the grid's own unit. Colours are premultiplied by alpha.
"""

from . import _threads  # Before the libraries are loaded: see there.
from . import _libraries  # Before _core: see there.
from ._arrays import Block, from_xarray
from ._cache import Cache, Picture, Points, Samples, Scalar, open
from ._camera import Camera, orbit
from ._convert import Report, append, append_arrays, convert, convert_arrays, convert_callable
from ._core import Error, UsageError
from ._core import version as __version__
from ._function import TransferFunction, colour_maps
from ._view import View, program

__all__ = ["Block", "Cache", "Camera", "Error", "Picture", "Points", "Report", "Samples", "Scalar", "TransferFunction", "UsageError",
           "View", "append", "append_arrays", "colour_maps", "convert", "convert_arrays", "convert_callable", "from_xarray", "open", "orbit",
           "program"]
