"""Conversion: grids become caches."""

from __future__ import annotations

import inspect
import os
from typing import Any, Callable, Mapping, NamedTuple, Optional, Sequence, Tuple, Union

import numpy as np

from . import _arguments, _core
from ._arrays import Block, _values

Path = Union[str, os.PathLike]
Progress = Callable[[str, int, int, str], None]


class Report(NamedTuple):
    """What a conversion did. `samples`: nodes or cells of the grid, `blanked` of which are not drawn; `volume`: of the cells; `steps`
    of the cache; `notes`: what was done to the cells without being asked for. Of a series `blanked`, `merged_nodes` and the rest are of its first step, `bytes` of all."""

    samples: int
    blanked: int
    splats: int
    bricks: int
    levels: int
    volume: float
    merged_nodes: int
    bytes: int
    warnings: Sequence[str]
    steps: int = 1
    notes: Sequence[str] = ()


def _options(overwrite: bool, resume: bool, blank_value: Optional[float], memory: Union[str, int, None], threads: int,
             title: str) -> dict:
    return {"overwrite": _arguments.flag("overwrite", overwrite), "resume": _arguments.flag("resume", resume),
            "blank_value": _arguments.maybe("blank_value", blank_value, _arguments.number),
            "threads": _arguments.whole("threads", threads), "title": _arguments.text("title", title),
            "memory": _arguments.maybe("memory", memory, _arguments.amount) or "", "value_precision": "auto"}


@_arguments.in_one_line
def convert(output: Path, grid: Path, solutions: Union[Path, Sequence[Path]] = (), *, scalars: Union[str, Sequence[str]] = (),
            time_step: Optional[int] = None, steps: Optional[str] = None, keep_going: bool = False, vertical_scale: float = 1,
            select: Optional[Mapping[str, float]] = None, blank_value: Optional[float] = None, refine: Union[int, str] = "auto", overwrite: bool = False, resume: bool = False,
            memory: Union[str, int, None] = None, threads: int = 0, title: str = "", value_precision: str = "auto",
            progress: Optional[Progress] = None) -> Report:
    """Converts grid files of any kind that `curvisplat convert` reads to the cache `output`, with the same bytes.

    Several solutions or grids whose names differ in numbers only, patterns such as "q.*" or "q_%04d.fun" among the names, and files
    with several steps together with `steps` become a series. steps: "all", "FIRST:LAST" or "FIRST:LAST:STRIDE" of them;
    keep_going: leave out those that cannot be converted; time_step: one of a file's.

    scalars: names (default: all that the files store). vertical_scale: the exaggeration of heights on the globe.
    select: which value to read of dimensions of NetCDF that are neither space nor time, such as {"month": 3}.
    blank_value: samples with this value are not drawn. refine: "auto" cuts the cells of structured grids where they differ much
    from those beside them; a number (1 to 16) cuts each into so many parts along each axis, by its own trilinear map, 1 none. resume: go on from an interrupted conversion. memory: the limit of this process, in bytes or as
    "2G". value_precision: "auto" (as fine as the spread of values needs), "normal" (16 bits for the range of a brick) or "fine" (24). progress: called with (phase, done,
    total, unit).

    Raises Error, UsageError and, after Ctrl-C, KeyboardInterrupt; then no partial cache is left unless `resume` was given,
    and of a series the steps so far.
    """
    options = _options(overwrite, resume, blank_value, memory, threads, title)
    options["value_precision"] = _arguments.text("value_precision", value_precision)
    options["refine"] = _arguments.refinement(refine)
    return _convert_files(output, grid, solutions, scalars, options, time_step=time_step, steps=steps, keep_going=keep_going,
                          vertical_scale=vertical_scale, select=select, progress=progress)


@_arguments.in_one_line
def append(cache: Path, grid: Path, solutions: Union[Path, Sequence[Path]] = (), *, steps: Optional[str] = None,
           keep_going: bool = False, vertical_scale: float = 1, select: Optional[Mapping[str, float]] = None, blank_value: Optional[float] = None,
           memory: Union[str, int, None] = None, threads: int = 0, progress: Optional[Progress] = None) -> Report:
    """Adds the time steps of further files to a cache, as `curvisplat convert --add-steps` does. Arguments and errors as of convert()."""
    options = _options(False, False, blank_value, memory, threads, "")
    return _convert_files(cache, grid, solutions, (), options, add=True, steps=steps, keep_going=keep_going,
                          vertical_scale=vertical_scale, select=select, progress=progress)


def _convert_files(output: Path, grid: Path, solutions: Any, scalars: Any, options: dict, *, progress: Optional[Progress],
                   add: bool = False, time_step: Optional[int] = None, steps: Optional[str] = None, keep_going: bool = False,
                   vertical_scale: float = 1, select: Optional[Mapping[str, float]] = None) -> Report:
    options["add"] = add
    options["time_step"] = _arguments.maybe("time_step", time_step, _arguments.whole)
    options["steps"] = _arguments.maybe("steps", steps, _arguments.amount)
    options["keep_going"] = _arguments.flag("keep_going", keep_going)
    options["vertical_scale"] = _arguments.number("vertical_scale", vertical_scale)
    options["select"] = _arguments.selection(select)
    return Report(**_core.convert_files(_arguments.path("cache" if add else "output", output), _arguments.path("grid", grid),
                                        _arguments.paths("solutions", solutions), _arguments.texts("scalars", scalars), options, progress))


def _tuples(blocks: Sequence[Block]) -> Tuple[list, list]:
    """The blocks and the scalars as the module takes them."""
    if not blocks:
        raise _core.UsageError("no block to convert; pass one Block or more")
    for block in blocks:
        if not isinstance(block, Block):
            raise _core.UsageError(f"blocks: {type(block).__name__} is no Block; make one by Block() or from_xarray()")
        for what in ("scalars", "units"):
            if not isinstance(getattr(block, what), Mapping):
                raise _arguments.wrong(what, getattr(block, what), "a dict by name")
    names = list(blocks[0].scalars)
    units = [(_arguments.text("scalars", name), _arguments.text("units", blocks[0].units.get(name, ""))) for name in names]
    tuples = []
    for number, block in enumerate(blocks, 1):
        name = _arguments.text("name", block.name) or f"block {number}"
        missing = [scalar for scalar in names if scalar not in block.scalars]
        if missing:
            raise _core.UsageError(f"{name}: has no scalar '{missing[0]}', which the first block has")
        blank = None if block.blank is None else _arguments.array("blank", block.blank)
        if blank is not None and blank.dtype != np.bool_:
            raise _core.UsageError(f"{name}: blank: its values are {blank.dtype}; expected bool, True where a node is not there")
        values = [_values(scalar, block.scalars[scalar]) for scalar in names]
        x, y, z = (_arguments.array(axis, getattr(block, axis)) for axis in "xyz")
        tuples.append((name, x, y, z, values, blank))
    return tuples, units


@_arguments.in_one_line
def convert_arrays(output: Path, *blocks: Block, blank_value: Optional[float] = None, refine: Union[int, str] = "auto",
                   overwrite: bool = False, memory: Union[str, int, None] = None, threads: int = 0, title: str = "",
                   time: Optional[float] = None, value_precision: str = "auto", progress: Optional[Progress] = None) -> Report:
    """Converts blocks in memory to the cache `output`. Samples that are NaN are not drawn. The arrays must not change meanwhile. `memory` does not count them.

    refine: as in convert(). time: of this step, if others are to follow by append_arrays(), with the same value_precision.
    Raises as convert() does; UsageError for arrays whose types or shapes do not fit.
    """
    tuples, units = _tuples(blocks)
    options = _options(overwrite, False, blank_value, memory, threads, title)
    options["value_precision"] = _arguments.text("value_precision", value_precision)
    options["refine"] = _arguments.refinement(refine)
    options["time"] = _arguments.maybe("time", time, _arguments.number)
    return Report(**_core.convert_arrays(_arguments.path("output", output), tuples, units, options, progress))


@_arguments.in_one_line
def append_arrays(cache: Path, *blocks: Block, time: Optional[float] = None, blank_value: Optional[float] = None,
                  memory: Union[str, int, None] = None, threads: int = 0, progress: Optional[Progress] = None) -> int:
    """Adds a time step to a cache: blocks of the same shapes, with the cache's scalars. Returns how many steps it has then.

    time: after that of the last step; by default one more. The cache can be looked at meanwhile, and has the steps before if this
    fails or is interrupted. Raises as convert_arrays().
    """
    tuples, units = _tuples(blocks)
    options = _options(False, False, blank_value, memory, threads, "")
    options["time"] = _arguments.maybe("time", time, _arguments.number)
    return _core.append_arrays(_arguments.path("cache", cache), tuples, units, options, progress)


def _takes_parts_of_rows(read: Callable[..., Any]) -> bool:
    try:
        return {"i0", "i1"} <= inspect.signature(read).parameters.keys()
    except (TypeError, ValueError):  # built in, without a signature
        return False


@_arguments.in_one_line
def convert_callable(output: Path, shapes: Sequence[Tuple[int, int, int]], read: Callable[..., Tuple[Any, ...]],
                     scalars: Union[Sequence[str], Mapping[str, str]], *, blank_value: Optional[float] = None, refine: Union[int, str] = "auto",
                     overwrite: bool = False, memory: Union[str, int, None] = None, threads: int = 0, title: str = "",
                     value_precision: str = "auto", progress: Optional[Progress] = None) -> Report:
    """Converts a grid larger than memory that `read` hands out piece by piece.

    shapes: (nk, nj, ni) of each block. scalars: names, or units by name. read(block, k0, k1, j0, j1, names) returns (x, y, z, [values of
    each name], blank): arrays of shape (k1 - k0, j1 - j0, ni); blank is None or of bool. If `read` has parameters i0 and i1, it is
    called with them, too, and returns arrays of i1 - i0 elements along i: then rows may be longer than what fits in `memory`. It is
    called three times for each piece, and first for its coordinates unless `refine` is a number, in any thread, one call at a time. refine: as in convert(). Raises as convert() does,
    and what `read` raises.
    """
    units = list(scalars.items()) if isinstance(scalars, Mapping) else [(name, "") for name in _arguments.texts("scalars", scalars)]
    units = [(_arguments.text("scalars", name), _arguments.text("scalars", unit)) for name, unit in units]
    options = _options(overwrite, False, blank_value, memory, threads, title)
    options["value_precision"] = _arguments.text("value_precision", value_precision)
    options["refine"] = _arguments.refinement(refine)
    if not callable(read):
        raise _arguments.wrong("read", read, "a function")
    options["parts_of_rows"] = _takes_parts_of_rows(read)
    blocks = [_arguments.shape(shape) for shape in _arguments.items("shapes", shapes, "(nk, nj, ni) of each block, in a list")]
    return Report(**_core.convert_callable(_arguments.path("output", output), blocks, units, read, options, progress))
