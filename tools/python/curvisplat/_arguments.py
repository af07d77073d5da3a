"""What callers pass, as the module takes it: UsageError in one short line that names the argument."""

from __future__ import annotations

import functools
import inspect
import operator
import os
import re
import reprlib
from typing import Any, Callable, List, Mapping, Optional, Tuple, Union

import numpy as np

from . import _core

_LONGEST = 800  # characters of a message
_LONGEST_VALUE = 80
_OWN_NAMES = {"tf": "colours", "iso": "isovalues", "orbit": "degrees"}

_short = reprlib.Repr()
_short.maxstring = _short.maxother = _LONGEST_VALUE


def _cut(text: str, longest: int) -> str:
    """The text in one line, without its middle if it is long."""
    line = re.sub(r"\s*[\n\r]\s*", " ", text)
    return line if len(line) <= longest else f"{line[:longest // 2]} ... {line[-longest // 4:]}"


def shown(value: Any) -> str:
    """A value in a message."""
    if isinstance(value, np.ndarray):
        return f"an array of shape {value.shape}"
    try:
        return _cut(_short.repr(value), _LONGEST_VALUE)
    except Exception:  # its own, or of an int of too many digits
        return _cut(f"a value of type {type(value).__name__}", _LONGEST_VALUE)


def with_own_names(message: str, names: Any) -> str:
    """A message of the command line with the arguments `names` in place of the options that are the same."""

    def replaced(option: "re.Match[str]") -> str:
        own = _OWN_NAMES.get(option[1], option[1].replace("-", "_"))
        return next((name for name in (own, own + "s") if name in names), option[0])

    # Not in commands, `curvisplat ...`.
    return "`".join(part if n % 2 else re.sub(r"(?<![\w./-])--([a-z]+(?:-[a-z]+)*)(?![\w-])", replaced, part)
                    for n, part in enumerate(message.split("`")))


def in_one_line(function: Callable[..., Any]) -> Callable[..., Any]:
    """The function, whose errors are of one short line with the names of its arguments."""

    @functools.wraps(function)
    def call(*arguments: Any, **named: Any) -> Any:
        try:
            return function(*arguments, **named)
        except _core.Error as error:
            text = str(error)
            line = _cut(with_own_names(text, inspect.signature(function).parameters), _LONGEST)
            if line == text:
                raise
            raise type(error)(line) from None
        except (TypeError, RuntimeError) as error:  # the module's own, of several lines and with the types of C++
            if not re.search(r"incompatible (function|constructor) arguments|Unable to cast Python", str(error)):
                raise
            raise _core.UsageError(f"{function.__name__}(): an argument has a type that it cannot have; see help(curvisplat)") from None

    return call


def wrong(name: str, value: Any, expected: str) -> _core.UsageError:
    """The error for a value that is not what is expected."""
    return _core.UsageError(f"{name}: {shown(value)}; expected {expected}")


def whole(name: str, value: Any, least: int = 0) -> int:
    """A whole number, not below `least`."""
    try:
        number = operator.index(value)
    except Exception:
        raise _core.UsageError(f"{name}: {shown(value)} is not a whole number") from None
    if not least <= number < 1 << 32:
        raise _core.UsageError(f"{name}: {shown(number)}; expected a whole number from {least}")
    return number


def number(name: str, value: Any) -> float:
    """A number of any kind; not one in a text."""
    try:
        if isinstance(value, (str, bytes)):
            raise TypeError
        return float(value)
    except Exception:
        raise _core.UsageError(f"{name}: {shown(value)} is not a number") from None


def maybe(name: str, value: Any, kind: Callable[[str, Any], Any]) -> Any:
    """None, or a value of the kind."""
    return None if value is None else kind(name, value)


def refinement(value: Any) -> str:
    """Parts of a cell along each axis, or "auto"."""
    return text("refine", value) if isinstance(value, str) else str(whole("refine", value))


def amount(name: str, value: Any) -> str:
    """A whole number, or a text such as "2G"."""
    if isinstance(value, str):
        return text(name, value)
    try:
        number = operator.index(value)
    except Exception:
        raise wrong(name, value, "a whole number, or a text that has one") from None
    if not 0 <= number < 1 << 63:
        raise _core.UsageError(f"{name}: {shown(number)} is out of range")
    return str(number)


def flag(name: str, value: Any) -> bool:
    """True or False."""
    if not isinstance(value, bool):
        raise _core.UsageError(f"{name}: {shown(value)} is neither True nor False")
    return value


def text(name: str, value: Any) -> str:
    """A string that UTF-8 can hold."""
    if not isinstance(value, str):
        raise _core.UsageError(f"{name}: {shown(value)} is not a string")
    try:
        value.encode()
    except UnicodeEncodeError:
        raise _core.UsageError(f"{name}: {shown(value)} has characters that UTF-8 cannot hold") from None
    return value


def path(name: str, value: Any) -> bytes:
    """A file's name, as the system has it."""
    try:
        found = os.fsencode(value)
    except Exception:
        raise _core.UsageError(f"{name}: {shown(value)} is not a path") from None
    if b"\0" in found:
        raise _core.UsageError(f"{name}: {shown(value)}: a file's name cannot have a null character")
    return found


def shape(value: Any) -> Tuple[int, int, int]:
    """(nk, nj, ni)."""
    try:
        lengths = tuple(operator.index(length) for length in value)
    except Exception:
        lengths = ()
    if len(lengths) != 3 or not all(0 < length < 1 << 63 for length in lengths):
        raise wrong("shapes", value, "(nk, nj, ni), three whole numbers above zero")
    return lengths


def items(name: str, value: Any, what: str) -> List[Any]:
    """Those of a sequence of anything, which is no text."""
    try:
        if isinstance(value, (str, bytes)):
            raise TypeError
        return list(value)
    except Exception:
        raise wrong(name, value, what) from None


def numbers(name: str, value: Any, what: str, count: Optional[int] = None) -> Tuple[float, ...]:
    """Numbers, `count` of them, which are `what`: "(x, y, z)"."""
    found = items(name, value, what)
    if count is not None and len(found) != count:
        raise wrong(name, value, what)
    try:
        return tuple(number(name, one) for one in found)
    except _core.UsageError:
        raise wrong(name, value, what) from None


def array(name: str, value: Any) -> np.ndarray:
    """As numpy has it."""
    try:
        return np.asarray(value)
    except Exception:
        raise wrong(name, value, "an array") from None


def picture_size(value: Any) -> str:
    """(width, height) as the command line writes it."""
    width, height = numbers("size", value, "(width, height)", 2)
    if not (width.is_integer() and height.is_integer()):
        raise wrong("size", value, "whole numbers")
    return f"{_digits(width)}x{_digits(height)}"


def _digits(number: float) -> str:
    return str(int(number)) if abs(number) < 1e15 else repr(number)


def _written(number: float) -> str:
    return repr(float(number))


def _joined(numbers: Any) -> str:
    return ",".join(map(_written, numbers))


def option(name: str, value: Any) -> str:
    """A number, several or a text as the command line writes them: numbers joined by commas."""
    if isinstance(value, str):
        return text(name, value)
    what = "a number, numbers or a text"
    if not np.isscalar(value) and not (isinstance(value, np.ndarray) and value.ndim == 0):
        return _joined(numbers(name, value, what))
    try:
        return _written(number(name, value))
    except _core.UsageError:
        raise wrong(name, value, what) from None


def given(**options: Any) -> dict:
    """The options that are not None."""
    return {name: option(name, value) for name, value in options.items() if value is not None}


def several(name: str, value: Any, kind: Callable[[str, Any], Any], single: Union[type, Tuple[type, ...]] = str) -> List[Any]:
    """Values of a kind, of which one may stand alone."""
    what = {text: "a string", path: "a path", option: "a number or a text"}[kind]
    return [kind(name, one) for one in ([value] if isinstance(value, single) else items(name, value, f"{what}, or several in a list"))]


def texts(name: str, value: Any) -> List[str]:
    """Strings, of which one may stand alone."""
    return several(name, value, text)


def paths(name: str, value: Any) -> List[bytes]:
    """Paths, of which one may stand alone."""
    return several(name, value, path, (str, bytes, os.PathLike))


def isovalues(value: Any) -> List[str]:
    """Options of --iso: one for each value, or for each scalar of a dict."""
    what = "a number, numbers, or those of several scalars in a dict"

    def found(of_it: Any) -> Tuple[float, ...]:
        return numbers("isovalues", [of_it] if np.isscalar(of_it) else of_it, what)

    if isinstance(value, Mapping):
        by_name = {text("isovalues", name): found(of_it) for name, of_it in value.items()}
        return [f"{name}={_joined(values)}" for name, values in by_name.items() if values]
    return [_written(one) for one in found(value)]


def opacities(name: str, value: Any) -> str:
    """Points as text."""
    if isinstance(value, str):
        return text(name, value)
    what = "points (position, opacity), several in a list, or a text"
    return ",".join("{}:{}".format(*map(_written, numbers(name, point, what, 2))) for point in items(name, value, what))


def markers(value: Any) -> List[str]:
    """Markers as text: (point, text) each."""
    what = "markers ((x, y, z), text), several in a list"
    found = []
    for marker in items("markers", value, what):
        if not isinstance(marker, (tuple, list)) or len(marker) != 2 or not isinstance(marker[1], str):
            raise wrong("markers", marker, what)
        found.append(f"{_joined(numbers('markers', marker[0], what, 3))}:{text('markers', marker[1])}")
    return found


def planes(name: str, value: Any) -> List[str]:
    """Planes as text: (px, py, pz, nx, ny, nz) each."""
    what = "planes (px, py, pz, nx, ny, nz), several in a list"
    return [_joined(numbers(name, plane, what, 6)) for plane in items(name, value, what)]


def selection(value: Any) -> List[str]:
    """A value of each dimension, as text."""
    what = 'values by dimension, such as {"month": 3}'
    if value is None:
        return []
    if not isinstance(value, Mapping) or not all(isinstance(one, (str, int, float, np.number)) for one in value.values()):
        raise wrong("select", value, what)
    return [f"{text('select', dimension)}={text('select', str(one))}" for dimension, one in value.items()]


def headers(value: Any) -> Optional[Mapping[str, str]]:
    """Texts by name."""
    if value is not None and not (isinstance(value, Mapping) and all(isinstance(one, str) for pair in value.items() for one in pair)):
        raise wrong("headers", value, "texts by name")
    return value
