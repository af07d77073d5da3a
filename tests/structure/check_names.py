#!/usr/bin/env python3
"""Checks that names follow one scheme (CONTRIBUTING.md, "Names"), in the sources alone: nothing is built.

    check_names.py [ROOT]    prints one line for each fault; exit status 1 if there is one

  types       UpperCamel; specialisations have their template's name
  enumerators kUpperCamel
  constants   kUpperCamel: constexpr variables, wherever they are, and const ones of a namespace; limits are kMax and kMin,
              not kMost and kLeast
  headers     no two of the libraries and the program have a type of one name in one namespace: a source that included both would
              not compile, and a program that is linked of both is undefined

C++ is read as clang-format leaves it: what a namespace holds is not indented.
"""
import bisect
import pathlib
import re
import sys

from check_parameters import FOLDERS, without_text

TYPE = re.compile(r"^\s*(?:template <[^;{}]*>\s*)?(?:class|struct|enum class|enum|union)\s+"
                  r"(?:CURVISPLAT_\w+\([^;{}]*\)\s+|alignas\([^)]*\)\s+)?(\w+)\b(?!::)(?:\s+final)?(?:\s*:[^;(){}=]*)?\s*\{", re.M)
ENUM = re.compile(r"\benum\b(?:\s+(?:class|struct))?\s*\w*\s*(?::\s*[\w:]+\s*)?\{([^}]*)\}")
DECLARED = r"[\w:<>,\s*&()]*?[\w>*&]\s+\*?(\w+)(?:\[[^\]]*\])*\s*(?:=|\{|;)"
CONSTEXPR = re.compile(r"^[ \t]*(?:(?:static|inline|thread_local|HWY_MAYBE_UNUSED)\s+)*constexpr\s+" + DECLARED, re.M)
CONST = re.compile(r"^(?:(?:static|inline)\s+)*const\s+" + DECLARED, re.M)

UPPER_CAMEL = re.compile(r"[A-Z][A-Za-z0-9]*")
CONSTANT = re.compile(r"k(?!(?:Most|Least)(?![a-z]))[A-Z0-9][A-Za-z0-9]*")


NAMESPACE = re.compile(r"^namespace ([\w:]+) \{")
DEFINED = re.compile(r"^(?:template <[^;{}]*> )?(?:class|struct|enum class|enum|union) (?:alignas\(\w+\) )?(\w+)\b(?!::)(?!.*;$)")
PRODUCT = ("stream", "preprocess", "render", "tools")


def types_of_header(source):
    """(line, namespace and name) of each type that a header defines in a namespace."""
    namespace = ""
    for number, line in enumerate(without_text(source).split("\n"), 1):
        if match := NAMESPACE.match(line):
            namespace = match[1]
        elif match := DEFINED.match(line):
            yield number, f"{namespace}::{match[1]}"


def defined_twice(headers):
    """`headers`: (path, source). (path, line, name, the path of the first) of each type that an earlier header has, too."""
    first = {}
    for path, source in headers:
        for line, name in types_of_header(source):
            if first.setdefault(name, path) != path:
                yield path, line, name, first[name]


def is_function(match):
    return "(" in re.sub(r"\b(?:decltype|alignas|sizeof)\([^)]*\)", "", match[0])


def names_of(source):
    """(line, kind, name, whether it follows the scheme) of each name that is checked."""
    code = without_text(source)
    ends = [match.start() for match in re.finditer("\n", code)]

    def line(place):
        return bisect.bisect_left(ends, place) + 1

    for match in TYPE.finditer(code):
        yield line(match.start(1)), "type", match[1], bool(UPPER_CAMEL.fullmatch(match[1]))
    for match in ENUM.finditer(code):
        place = match.start(1)
        for enumerator in match[1].split(","):
            name = enumerator.split("=")[0].strip()
            if name:
                yield line(place + len(enumerator) - len(enumerator.lstrip())), "enumerator", name, bool(CONSTANT.fullmatch(name))
            place += len(enumerator) + 1
    for pattern in (CONSTEXPR, CONST):
        for match in pattern.finditer(code):
            if not is_function(match):
                yield line(match.start(1)), "constant", match[1], bool(CONSTANT.fullmatch(match[1]))


def main():
    root = pathlib.Path(sys.argv[1]) if len(sys.argv) > 1 else pathlib.Path(__file__).resolve().parents[2]
    checked = faults = 0
    for top in FOLDERS:
        for path in sorted((root / top).rglob("*")):
            if path.suffix not in (".h", ".cpp"):
                continue
            for line, kind, name, fits in names_of(path.read_text()):
                checked += 1
                if not fits:
                    faults += 1
                    expected = "UpperCamel" if kind == "type" else "kUpperCamel, and of limits kMax or kMin"
                    print(f"{path.relative_to(root).as_posix()}:{line}: {kind} {name}; expected {expected}")
    headers = [(path.relative_to(root).as_posix(), path.read_text()) for top in PRODUCT for path in sorted((root / top).rglob("*.h"))]
    for path, line, name, other in defined_twice(headers):
        faults += 1
        print(f"{path}:{line}: {name} is also in {other}; give one of them another name")
    if checked == 0:
        print(f"{root}: there are no sources")
        return 1
    print(f"{checked} names, {faults} faults")
    return 1 if faults else 0


if __name__ == "__main__":
    sys.exit(main())
