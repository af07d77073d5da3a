"""Open caches, and pictures of them."""

from __future__ import annotations

import inspect
import os
import pathlib
import tempfile
import warnings
from typing import Any, Callable, List, Mapping, NamedTuple, Optional, Sequence, Tuple, Union

import numpy as np

from . import _arguments, _core, _remote
from ._camera import Camera
from ._function import TransferFunction
from ._view import View

Vector = Sequence[float]
Progress = Callable[[str, int, int, str], None]


class Scalar(NamedTuple):
    """A scalar of a cache: its name, its unit ("" if unknown) and the range of its values."""

    name: str
    unit: str
    min: float
    max: float


class Samples(NamedTuple):
    """Means over the boxes of a regular lattice: arrays of shape (nz, ny, nx), float32.

    `value`: of the scalar; NaN where there is no data. `density`: 1 inside the data to within a tenth, less in boxes at its
    border, 0 outside. `origin`: the middle of the first box, (x, y, z); `spacing`: of the middles.
    """

    value: np.ndarray
    density: np.ndarray
    origin: np.ndarray
    spacing: np.ndarray


class Points(NamedTuple):
    """The splats of a level. `positions` (n, 3), float64; `values` of the scalar at them (n); `volumes` of the space that each
    stands for (n), the grid's unit cubed; `shapes` (n, 3, 3): S of the ellipsoid x S⁻¹ x = 1, one grid spacing wide each way. float32."""

    positions: np.ndarray
    values: np.ndarray
    volumes: np.ndarray
    shapes: np.ndarray


class _ListsItsOwn(type):
    """Has dir() and help() list what a class adds to numpy's array, and not the array's 2,200 lines."""

    def __dir__(cls) -> List[str]:
        inherited = set(dir(np.ndarray)) - set(vars(cls))
        return [name for name in super().__dir__() if name not in inherited]


class Picture(np.ndarray, metaclass=_ListsItsOwn):
    """An array of shape (height, width, 4): red, green and blue, premultiplied by alpha, and alpha; float32, rows from the top.

    `options` are those of `curvisplat render` that were chosen from the data, `notes` what there is to know about the
    transfer function, `warnings` what may be wrong with the picture, such as why it is empty, `statistics` counts and seconds.
    `channels`: what was asked for by `channels=`, by the names in OpenEXR: Z, N.X, N.Y, N.Z, scalar; arrays of shape (height, width).
    """

    options: str = ""
    notes: Sequence[str] = ()
    warnings: Sequence[str] = ()
    channels: dict = {}
    statistics: dict = {}

    def __array_finalize__(self, other: Any) -> None:
        for name in ("options", "notes", "warnings", "channels", "statistics"):
            if hasattr(other, name):
                setattr(self, name, getattr(other, name))

    @_arguments.in_one_line
    def save(self, path: Union[str, os.PathLike]) -> None:
        """Writes the picture as .png (8 bits), .exr or .pfm (float32); .exr with the channels."""
        name = _arguments.path("path", path)
        _core.write_image(np.ascontiguousarray(self, dtype=np.float32), name, self.channels if name.lower().endswith(b".exr") else {})

    def _repr_png_(self) -> Optional[bytes]:
        """The picture for a notebook; None for an array that is no picture any more, such as one row or none."""
        if self.ndim != 3 or self.shape[2] != 4 or 0 in self.shape or max(self.shape) > 1 << 16:
            return None
        with tempfile.TemporaryDirectory() as folder:
            path = pathlib.Path(folder) / "picture.png"
            self.save(path)
            return path.read_bytes()


def _instead(whole: Any, name: str, **parts: Any) -> dict:
    """The options of a Camera or TransferFunction, or those given one by one."""
    kind = {"camera": Camera, "function": TransferFunction}[name]
    if whole is not None and not isinstance(whole, kind):
        instead = "colours" if name == "function" else "view"
        raise _core.UsageError(f"{name}: {_arguments.shown(whole)} is no {kind.__name__}"
                               + (f"; a name is passed as {instead}={_arguments.shown(whole)}" if isinstance(whole, str) else ""))
    given = {part: value for part, value in parts.items() if value is not None}
    if whole is None:
        return given
    if given:
        raise _core.UsageError(f"{next(iter(given))} cannot be combined with {name}, which has it")
    return whole.options()


def _function_texts(colours: Any = None, opacity: Any = None, **others: Any) -> dict:
    texts = _arguments.given(**others)
    if colours is not None:
        texts["tf"] = _arguments.path("colours", colours)
    if opacity is not None:
        texts["opacity"] = _arguments.opacities("opacity", opacity)
    return texts


class Cache:
    """A splat cache, open for drawing. One thread may draw at a time; `close()` or `with` gives its memory back."""

    @_arguments.in_one_line
    def __init__(self, path: Union[str, os.PathLike], *, headers: Optional[Mapping[str, str]] = None,
                 folder: Union[str, os.PathLike, None] = None):
        headers = _arguments.headers(headers)
        parent = _arguments.maybe("folder", folder, _arguments.path)
        if _remote.is_address(path):
            self._core = _remote.opened(_arguments.text("path", path), headers, parent)
        elif headers is not None or folder is not None:
            raise _core.UsageError("headers and folder are for caches on a server, http://... or https://...")
        else:
            self._core = _core.OpenCache(_arguments.path("path", path))

    def __enter__(self) -> "Cache":
        return self

    def __exit__(self, *_: Any) -> None:
        self.close()

    def __repr__(self) -> str:
        names = ", ".join(scalar.name for scalar in self.scalars)
        return f"<curvisplat.Cache {self.title!r}: {self.samples} samples, {names}>"

    def close(self) -> None:
        """Ends the threads and frees the memory that pictures use. Drawing again starts them again."""
        self._core.release()

    @property
    def path(self) -> str:
        """The directory, or the address on a server."""
        return self._core.path

    @property
    def title(self) -> str:
        """What the cache was named when it was converted."""
        return self._core.title

    @property
    def scalars(self) -> Tuple[Scalar, ...]:
        """The scalars, in the order of the cache."""
        return tuple(Scalar(*scalar) for scalar in self._core.scalars)

    @property
    def bounds(self) -> Tuple[np.ndarray, np.ndarray]:
        """The lower and the upper corner of the box that the grid lies in."""
        return np.array(self._core.lower), np.array(self._core.upper)

    @property
    def samples(self) -> int:
        """The nodes of the grid, or its cells if the values are in cells."""
        return self._core.samples

    @property
    def splats(self) -> int:
        """The splats of the finest level."""
        return self._core.splats

    @property
    def levels(self) -> int:
        """The levels of detail."""
        return self._core.levels

    @property
    def volume(self) -> float:
        """The volume of the grid's cells."""
        return self._core.volume

    @property
    def blocks(self) -> Tuple[Tuple[str, int, int, int], ...]:
        """(name, ni, nj, nk) of each block."""
        return tuple(self._core.blocks)

    @property
    def times(self) -> np.ndarray:
        """The time of each step; one for a cache that is no series. Their unit is `time_unit`."""
        return np.array(self._core.times)

    @property
    def time_unit(self) -> str:
        """Of the times, such as "days since 1900-01-01"; "" if unknown."""
        return self._core.time_unit

    @_arguments.in_one_line
    def histogram(self, scalar: str = "", *, bins: int = 128, range: Optional[Tuple[float, float]] = None,
                  log: bool = False) -> Tuple[np.ndarray, np.ndarray]:
        """The share of the data's volume in each of `bins` intervals, and the bins + 1 ends of the intervals.

        scalar: a name (default: the first). range: (low, high), by default that of the scalar. log: intervals of equal
        width in the logarithm. Of the step that was drawn last, from a coarse level: fast for any cache."""
        scalar = _arguments.text("scalar", scalar)
        of = next((s for s in self.scalars if not scalar or s.name == scalar), None)
        low, high = (_arguments.numbers("range", range, "(low, high)", 2) if range is not None
                     else (of.min, of.max) if of else (0, 1))  # no such scalar: said below
        if not low < high and range is None:
            low, high = low - 0.5, low + 0.5
        bins = _arguments.whole("bins", bins, 1)
        shares = np.array(self._core.histogram(scalar, (low, high), _arguments.flag("log", log), bins))
        return shares, np.geomspace(low, high, bins + 1) if log else np.linspace(low, high, bins + 1)

    @_arguments.in_one_line
    def view(self, *, height: int = 600, program: Optional[str] = None) -> View:
        """The cache in a browser or a notebook, to move in: `curvisplat serve` on this machine. A notebook shows the result; its
        `url` is for a browser on this machine. It ends by `close()` or with the interpreter."""
        if _remote.is_address(self.path):
            raise _core.UsageError("view: the cache is on a server; copy it to this machine, or run curvisplat serve there")
        return View(self.path, height, program)

    @_arguments.in_one_line
    def probe(self, point: Any, *, source: Any = None) -> Optional[dict]:
        """What is at a point (x, y, z): {"values": {scalar: value at the point}, "block": from 1, "index": (i, j, k) from 0 of the sample
        that it lies in, "position": the middle of that sample's cell, "sample_values": {scalar: value there}}. NaN for a scalar that has no value
        there where others have one. None if the point is outside of the grid.

        Of points (n, 3) the same with arrays: values of shape (n,), "block" 0 and NaN outside.

        source: True takes the values from the files that the cache names, or a list of files from these: exactly what the grid's own cell has
        there (trilinear; of cell-centred scalars the cell's value), where the cache has rounded means. "position" and "sample_values" are then those of the
        nearest node itself, or of the cell, and points outside of the cells are outside.
        """
        given = point if isinstance(point, (str, bytes)) else _arguments.array("point", point)
        several = np.ndim(given) == 2
        if several:
            try:
                points = given.astype(float)
            except Exception:
                raise _arguments.wrong("point", point, "numbers of shape (n, 3)") from None
            if points.shape[1] != 3 or not np.isfinite(points).all():
                raise _core.UsageError(f"point: points of shape {points.shape}: expected finite numbers of shape (n, 3)")
        else:
            points = np.array([_arguments.numbers("point", point, "(x, y, z)", 3)])
        files = None if source is None or source is False else [] if source is True else _arguments.paths("source", source)
        values, block, index, position, sample_values = self._core.probe(points, files)
        if not several:
            if block[0] == 0:
                return None
            values, sample_values = ({name: float(v[0]) for name, v in of.items()} for of in (values, sample_values))
            block, index, position = int(block[0]), tuple(int(n) for n in index[0]), tuple(float(x) for x in position[0])
        return {"values": values, "block": block, "index": index, "position": position, "sample_values": sample_values}

    def _box(self, box: Optional[Vector]) -> Tuple[list, list]:
        if box is None:
            return list(self._core.lower), list(self._core.upper)
        values = _arguments.numbers("box", box, "(x0, x1, y0, y1, z0, z1)", 6)
        return list(values[0::2]), list(values[1::2])

    @_arguments.in_one_line
    def sample(self, scalar: str = "", *, size: Union[int, Tuple[int, int, int]] = 128, box: Optional[Vector] = None,
               level: Optional[int] = None, step: int = 0, progress: Optional[Progress] = None) -> Samples:
        """The scalar on a regular lattice.

        scalar: a name (default: the first). size: boxes along (x, y, z), or along the longest side. box: (x0, x1, y0, y1, z0,
        z1), by default that of the grid; along an axis without extent boxes are as wide as the widest others, with the
        plane in their middle. level: the octree's, 0 is the coarsest; by default the coarsest whose detail is half a box. step: of a series.
        Takes, besides what it returns, 64 MiB or a quarter of that; or a plane's 32 bytes a point where that is more.
        Raises UsageError for what makes no sense, Error if reading fails, KeyboardInterrupt after Ctrl-C.
        """
        scalar = _arguments.text("scalar", scalar)
        lower, upper = self._box(box)
        extent = np.subtract(upper, lower)
        if isinstance(size, (int, np.integer)) and size > 0:
            longest, widest = _arguments.whole("size", size), max(float(extent.max()), 1e-300)
            size = tuple(int(max(1, np.ceil(longest * max(side, 0) / widest - 1e-6))) for side in extent)
        if np.ndim(_arguments.array("size", size)) != 1 or len(size) != 3:
            raise _arguments.wrong("size", size, "one number or three, above zero")
        size = [_arguments.whole("size", n, 1) for n in size]
        spacing = extent / np.asarray(size)
        spacing[extent == 0] = spacing.max()
        middle, half = np.add(lower, upper) / 2, np.asarray(size) * spacing / 2
        corners = [np.where(extent == 0, middle + side * half, end) for side, end in ((-1, lower), (1, upper))]
        choice = _core.DataChoice(scalar, *map(list, corners), _arguments.maybe("level", level, _arguments.whole), _arguments.whole("step", step))
        value, density = self._core.sample(choice, size, progress)
        return Samples(value, density, corners[0] + spacing / 2, spacing)

    @_arguments.in_one_line
    def points(self, scalar: str = "", *, level: Optional[int] = None, box: Optional[Vector] = None, step: int = 0,
               progress: Optional[Progress] = None) -> Points:
        """The splats of a level with their centres in a box.

        level: of the octree, 0 is the coarsest; by default the finest, which has a splat for each sample. Others as in sample(), which
        this raises as, too.
        """
        lower, upper = self._box(box)
        choice = _core.DataChoice(_arguments.text("scalar", scalar), lower, upper, _arguments.maybe("level", level, _arguments.whole),
                                  _arguments.whole("step", step))
        return Points(*self._core.points(choice, progress))

    @_arguments.in_one_line
    def camera(self, view: str = "iso", *, size: Tuple[int, int] = (600, 600), scale: Vector = (1, 1, 1),
               vertical_scale: Optional[float] = None, view_angle: Optional[float] = None) -> Camera:
        """A camera that has all of the data in a picture of this size, which render() draws with this scale and vertical_scale: iso,
        +x, -x, +y, -y, +z or -z; with view_angle (degrees) in perspective."""
        return self.orbit(view, frames=1, degrees=0, size=size, scale=scale, vertical_scale=vertical_scale,
                          view_angle=view_angle)[0]

    @_arguments.in_one_line
    def orbit(self, view: str = "iso", *, frames: int = 90, degrees: float = 360, size: Tuple[int, int] = (600, 600),
              scale: Vector = (1, 1, 1), vertical_scale: Optional[float] = None,
              view_angle: Optional[float] = None) -> Sequence[Camera]:
        """The cameras of `curvisplat render --orbit`, one a frame, which all have all of the data in the picture."""
        angle = _arguments.maybe("view_angle", view_angle, _arguments.number)
        options = _arguments.given(view=_arguments.text("view", view), view_angle=angle, orbit=_arguments.number("degrees", degrees),
                                   vertical_scale=vertical_scale)
        cameras = self._core.cameras(options, _arguments.picture_size(size), _arguments.option("scale", scale),
                                     _arguments.whole("frames", frames))
        return [Camera(position, focal_point, view_up, None if angle else half, angle)
                for position, focal_point, view_up, half in cameras]

    @_arguments.in_one_line
    def render(self, scalar: str = "", *, camera: Optional[Camera] = None, function: Optional[TransferFunction] = None,
               size: Tuple[int, int] = (600, 600), colours: Optional[str] = None, range: Union[str, Tuple[float, float], None] = None,
               opacity: Union[str, Sequence[Tuple[float, float]], None] = None,
               asinh: Optional[Tuple[float, float]] = None, opacity_unit: Optional[float] = None,
               opacity_by: str = "", opacity_range: Union[str, Tuple[float, float], None] = None,
               opacity_asinh: Optional[Tuple[float, float]] = None, opacity_tf: Union[str, os.PathLike, None] = None,
               classify: str = "pixel", view: Optional[str] = None, position: Optional[Vector] = None, focal_point: Optional[Vector] = None,
               view_up: Optional[Vector] = None, parallel_scale: Optional[float] = None,
               view_angle: Optional[float] = None, azimuth: Optional[float] = None, elevation: Optional[float] = None,
               roll: Optional[float] = None, zoom: Optional[float] = None, scale: Vector = (1, 1, 1),
               vertical_scale: Optional[float] = None, clip_box: Optional[Vector] = None,
               clip_planes: Sequence[Vector] = (), step: Optional[int] = None, time: Optional[float] = None,
               interpolate: bool = False, surfaces: Union[str, Sequence[str]] = (), surface_colours: Union[str, Sequence[str]] = (),
               surface_by: str = "", surface_opacity: Union[float, str, Sequence[Union[float, str]]] = (), slices: Sequence[Vector] = (),
               slice_opacity: Union[float, str] = 1, isovalues: Union[float, Sequence[float], Mapping[str, Union[float, Sequence[float]]]] = (),
               iso_opacity: Union[float, str, None] = None, iso_by: str = "", iso_colour: Union[str, Sequence[str]] = (),
               volume: bool = True, shade: bool = False, light: Optional[Vector] = None,
               light_direction: Optional[Vector] = None, shadow: Optional[float] = None, ambient_occlusion: Optional[float] = None,
               gradient_opacity: Union[str, Sequence[Tuple[float, float]], None] = None, background: str = "dark", scalar_bar: bool = False,
               scalar_bar_titles: Union[str, Sequence[str]] = (), axes: bool = False, axes_grid: bool = False,
               axes_titles: Optional[Sequence[str]] = None, outline: bool = False, markers: Sequence[Tuple[Vector, str]] = (),
               title: Optional[str] = None,
               label: Optional[str] = None, text_size: Optional[float] = None, lines: Union[str, Sequence[str]] = (), points: Union[str, Sequence[str]] = (),
               lines_by: str = "", lines_colour: Union[str, Sequence[str]] = (), line_width: Union[str, float] = "3px",
               point_size: Union[str, float] = "6px", lines_opacity: float = 1, lines_time: Union[str, float, None] = None,
               map: Union[str, os.PathLike, None] = None, map_height: Optional[float] = None,
               globe: Optional[Sequence[float]] = None, look_at: Optional[Tuple[float, float]] = None, from_height: Optional[float] = None,
               channels: Union[str, Sequence[str]] = (), lod_pixels: float = 1,
               max_splats: Optional[int] = None, memory: Union[str, int] = "512M",
               card_memory: Union[str, int, None] = None, threads: int = 0,
               backend: str = "auto", keep_going: bool = False, progress: Optional[Progress] = None) -> Picture:
        """Draws a picture, bit for bit the one of `curvisplat render` with the same options.

        What is left out is chosen from the data; `Picture.options` says what was.

        scalar: a name (default: the first field that is not constant). size: (width, height) in pixels.

        camera, function: instead of the options that they have.

        colours: a colour map (`curvisplat.colour_maps()`; NAME_r is reversed) or the path of a ParaView preset.

        range: (low, high), "data", or percentiles such as "1%,99%". opacity: points (position 0..1, opacity 0..1), "ramp"
        or "auto". asinh: (centre, width). opacity_unit: the length over which opacity accumulates.

        opacity_by: the scalar of the opacities, if that is another one, with opacity_range, opacity_asinh and opacity_tf,
        the path of a ParaView preset. classify: "pixel", or "flat": one colour for each splat.

        view: iso, +x, -x, +y, -y, +z or -z; or a camera by position, focal_point, view_up and parallel_scale (half the
        picture's height) or view_angle (perspective, degrees). azimuth, elevation and roll (degrees) turn it, whether given
        or chosen, and zoom magnifies.

        scale: factors of the data along x, y, z. vertical_scale: exaggerates heights instead, of a flat map in place of the
        factor that it was converted with. clip_box: (x0, x1, y0, y1, z0, z1). clip_planes: (px, py, pz, nx, ny,
        nz) each; nothing is drawn where n does not point.

        step: of a series; or time: the step nearest to it, with interpolate what lies between two.

        surfaces: files, or faces of the grid such as "kmin" or "blanks"; surface_by: the scalar that colours them, or
        surface_colours; surface_opacity: of all, or of each.

        slices: (px, py, pz, nx, ny, nz) each.

        lines, points: files, drawn as tubes and spheres of line_width and point_size (a length, or pixels as "3px"), in
        lines_colour or coloured by their scalar lines_by.

        lines_time: of lines with times "past", "all", or how long before the time of the picture they begin. globe: (radius,
        vertical scale) of the sphere of a cache that does not have them.

        map: the Earth below the data, an image of all of it or a colour "#rrggbb"; map_height: where, in kilometres (default: the
        data's lowest, at most 0).

        look_at: (longitude, latitude), from_height: kilometres; a camera above that place.

        isovalues: of the scalar, or of iso_by; or of several scalars, {"p": 1.5, "T": [300, 400]}; iso_colour: "#rrggbb" or "function", of all or of each. slice_opacity, iso_opacity: 0 to 1, or "function" for that of the transfer
        function.

        volume: False leaves the volume out. background: "dark" (#15171c), "white", another colour, or "transparent"; colours that are chosen suit it.

        shade: light level surfaces from the viewer; light: (ambient, diffuse, specular), light_direction, shadow and
        ambient_occlusion (0..1: how dark it is where the volume keeps light out) turn it on, too. gradient_opacity: points (share of the volume that is less steep 0..1, factor of the opacity 0..1).

        scalar_bar, scalar_bar_titles, axes, axes_grid, axes_titles (of x, y and z), outline and markers (points with texts)
        are drawn into the picture, and title and label, texts with the fields {time}, {step}, {frame}, {scalar} and {units}, in a font of text_size pixels. channels: some of "depth", "normal" and "scalar", taken where half of the pixel's opacity lies in front.

        lod_pixels: the largest error of a merged splat on the screen; 0 draws the finest level; max_splats instead draws
        the best that has no more. memory: the limit, in bytes or as "512M"; card_memory: of a
        graphics card, for bricks that stay there (default: three quarters of what is free); threads: 0 for all cores; backend: "auto",
        "cpu", "egl", "egl-quads" or "osmesa". keep_going: draw coarser where bricks are damaged. progress: called with (phase, done,
        total, unit).

        Raises UsageError for options that make no sense, Error if reading or drawing fails, KeyboardInterrupt after
        Ctrl-C. Warns (UserWarning) of an empty or poor picture.
        """
        of_function = _instead(function, "function", colours=colours, range=range, opacity=opacity, asinh=asinh,
                               opacity_unit=opacity_unit)
        of_camera = _instead(camera, "camera", view=view, position=position, focal_point=focal_point, view_up=view_up,
                             parallel_scale=parallel_scale, view_angle=view_angle, look_at=look_at, from_height=from_height)
        of_camera |= {name: value for name, value in (("azimuth", azimuth), ("elevation", elevation), ("roll", roll), ("zoom", zoom))
                      if value is not None}
        given, texts, paths, flag = _arguments.given, _arguments.texts, _arguments.paths, _arguments.flag
        of_two = given(opacity_by=_arguments.text("opacity_by", opacity_by) or None, opacity_range=opacity_range, opacity_asinh=opacity_asinh)
        if opacity_tf is not None:
            of_two["opacity_tf"] = _arguments.path("opacity_tf", opacity_tf)
        # None is an error here, unlike for the options below.
        frame = {"size": _arguments.picture_size(size), "classify": _arguments.text("classify", classify),
                 "background": _arguments.text("background", background), "scale": _arguments.option("scale", scale),
                 "memory": _arguments.amount("memory", memory), "lod_pixels": _arguments.option("lod_pixels", lod_pixels),
                 "channels": ",".join(texts("channels", channels)) or "none",
                 **given(time=time, vertical_scale=vertical_scale, clip_box=clip_box, light=light, light_direction=light_direction,
                         shadow=shadow, ambient_occlusion=ambient_occlusion, lines_time=lines_time, globe=globe, map_height=map_height,
                         text_size=text_size)}
        for name, value, kind in (("card_memory", card_memory, _arguments.amount), ("max_splats", max_splats, _arguments.amount),
                                  ("gradient_opacity", gradient_opacity, _arguments.opacities), ("map", map, _arguments.path),
                                  ("title", title, _arguments.text), ("label", label, _arguments.text)):
            if value is not None:
                frame[name] = kind(name, value)
        if axes_titles is not None:
            frame["axes_titles"] = ",".join(texts("axes_titles", axes_titles))
        others = {"clip_planes": _arguments.planes("clip_planes", clip_planes),
                  "step": _arguments.maybe("step", step, _arguments.whole),
                  "interpolate": flag("interpolate", interpolate),
                  "surfaces": paths("surfaces", surfaces),
                  "surface_colours": texts("surface_colours", surface_colours), "surface_by": _arguments.text("surface_by", surface_by),
                  "surface_opacity": _arguments.several("surface_opacity", surface_opacity, _arguments.option, (str, int, float, np.number)),
                  "lines": paths("lines", lines), "points": paths("points", points),
                  "lines_colour": texts("lines_colour", lines_colour), "lines_by": _arguments.text("lines_by", lines_by),
                  "line_width": _arguments.option("line_width", line_width), "point_size": _arguments.option("point_size", point_size),
                  "lines_opacity": _arguments.option("lines_opacity", lines_opacity),
                  "slices": _arguments.planes("slices", slices), "slice_opacity": _arguments.option("slice_opacity", slice_opacity),
                  "isovalues": _arguments.isovalues(isovalues), "iso_by": _arguments.text("iso_by", iso_by),
                  "iso_colour": texts("iso_colour", iso_colour),
                  "volume": flag("volume", volume), "shade": flag("shade", shade), "threads": _arguments.whole("threads", threads),
                  "keep_going": flag("keep_going", keep_going), "backend": _arguments.text("backend", backend),
                  "scalar_bar": flag("scalar_bar", scalar_bar), "scalar_bar_titles": texts("scalar_bar_titles", scalar_bar_titles),
                  "axes": flag("axes", axes), "axes_grid": flag("axes_grid", axes_grid), "outline": flag("outline", outline),
                  "markers": _arguments.markers(markers)}
        if iso_opacity is not None:
            others["iso_opacity"] = _arguments.option("iso_opacity", iso_opacity)
        rgba, *about = self._core.render({"scalar": _arguments.text("scalar", scalar), **_function_texts(**of_function), **of_two},
                                         given(**of_camera), frame, others, progress)
        picture = rgba.view(Picture)
        picture.options, picture.notes, picture.warnings, picture.channels, picture.statistics = about
        picture.warnings = [_arguments.with_own_names(warning, inspect.signature(Cache.render).parameters) for warning in picture.warnings]
        for warning in picture.warnings:
            warnings.warn(warning, stacklevel=3)  # where in_one_line() is called
        return picture


def open(path: Union[str, os.PathLike], *, headers: Optional[Mapping[str, str]] = None,
         folder: Union[str, os.PathLike, None] = None) -> Cache:
    """Opens a splat cache, a directory NAME.splats, or its address on a web server that sends parts of files: http://... or https://....
    Raises Error if it is none or damaged.

    Of a cache on a server, those parts are read that are drawn. They are kept in a temporary directory in `folder` (default: the
    system's) until the cache is no longer used. headers: sent with each request, such as {"Authorization": "Bearer ..."}.
    """
    return Cache(path, headers=headers, folder=folder)
