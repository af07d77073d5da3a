"""What callers pass, as the module takes it: UsageError in one line that names the argument."""

from __future__ import annotations

import functools
import operator
import os
from typing import Any, Callable, Sequence, Tuple

from . import _core


def in_one_line(function: Callable[..., Any]) -> Callable[..., Any]:
    """The function, where the module's TypeError, of several lines, is a UsageError of one."""

    @functools.wraps(function)
    def call(*arguments: Any, **named: Any) -> Any:
        try:
            return function(*arguments, **named)
        except TypeError as error:
            if "incompatible function arguments" not in str(error) and "incompatible constructor arguments" not in str(error):
                raise
            raise _core.UsageError(f"{function.__name__}(): an argument has a type that it cannot have; see help(curvisplat)") from None

    return call


def whole(name: str, value: Any, least: int = 0) -> int:
    """A whole number, not below `least`."""
    try:
        number = operator.index(value)
    except TypeError:
        raise _core.UsageError(f"{name}: {value!r} is not a whole number") from None
    if not least <= number < 1 << 32:
        raise _core.UsageError(f"{name}: {number}; expected a whole number from {least}")
    return number


def refinement(value: Any) -> str:
    """Parts of a cell along each axis, or "auto"."""
    return value if isinstance(value, str) else str(whole("refine", value))


def flag(name: str, value: Any) -> bool:
    """True or False."""
    if not isinstance(value, bool):
        raise _core.UsageError(f"{name}: {value!r} is neither True nor False")
    return value


def text(name: str, value: Any) -> str:
    """A string that UTF-8 can hold."""
    if not isinstance(value, str):
        raise _core.UsageError(f"{name}: {value!r} is not a string")
    try:
        value.encode()
    except UnicodeEncodeError:
        raise _core.UsageError(f"{name}: {value!r} has characters that UTF-8 cannot hold") from None
    return value


def path(value: Any) -> Any:
    """A file's name, as the module takes it."""
    name = os.fspath(value)
    if ("\0" if isinstance(name, str) else b"\0") in name:
        raise _core.UsageError(f"{name!r}: a file's name cannot have a null character")
    return name


def shape(value: Any) -> Tuple[int, int, int]:
    """(nk, nj, ni)."""
    try:
        lengths = tuple(operator.index(length) for length in value)
    except TypeError:
        lengths = ()
    if len(lengths) != 3 or not all(0 < length < 1 << 63 for length in lengths):
        raise _core.UsageError(f"shapes: {value!r}; expected (nk, nj, ni), three whole numbers above zero")
    return lengths


def numbers(name: str, value: Any, what: str, count: int) -> Tuple[float, ...]:
    """`count` numbers, which are `what`: "(x, y, z)"."""
    try:
        found = tuple(float(number) for number in value)
    except (TypeError, ValueError):
        found = ()
    if len(found) != count or isinstance(value, str):
        raise _core.UsageError(f"{name}: {value!r}; expected {what}")
    return found


def picture_size(value: Any) -> str:
    """(width, height) as the command line writes it."""
    width, height = numbers("size", value, "(width, height)", 2)
    if width != int(width) or height != int(height):
        raise _core.UsageError(f"size: {value!r}; expected whole numbers")
    return f"{int(width)}x{int(height)}"


def several(value: Any, kind: type = str) -> Sequence[Any]:
    """A sequence, of one where a single one was passed."""
    return [value] if isinstance(value, kind) else list(value)


def markers(value: Any, text: Callable[[Sequence[float]], str]) -> list:
    """Markers as text: (point, text) each."""
    what = "markers ((x, y, z), text), several in a list"
    if isinstance(value, str):
        raise _core.UsageError(f"markers: {value!r}; expected {what}")
    found = []
    for marker in value:
        if not isinstance(marker, (tuple, list)) or len(marker) != 2 or not isinstance(marker[1], str):
            raise _core.UsageError(f"markers: {marker!r}; expected {what}")
        found.append(f"{text(numbers('markers', marker[0], what, 3))}:{marker[1]}")
    return found


def planes(name: str, value: Any, text: Callable[[Sequence[float]], str]) -> list:
    """Planes as text: (px, py, pz, nx, ny, nz) each."""
    what = "planes (px, py, pz, nx, ny, nz), several in a list"
    if isinstance(value, str):
        raise _core.UsageError(f"{name}: {value!r}; expected {what}")
    return [text(numbers(name, plane, what, 6)) for plane in value]
