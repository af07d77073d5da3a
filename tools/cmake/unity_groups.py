#!/usr/bin/env python3
"""Which sources can be compiled together, as one that includes them (tools/check_clang.py, unity.cmake).

    unity_groups.py SIZE FILE ...    prints the number of each file's group, one a line

A group has at most SIZE files. None of them declares a name for itself that another one declares, too, or that a header of the
tests declares which another one includes: a static function, or one in a namespace without name, say. One that has a type of the name of a header's is alone. What is declared is read from the layout: our
formatter puts declarations of a namespace at the beginning of a line, and nothing else."""
import functools
import pathlib
import re
import sys

ROOT = pathlib.Path(__file__).resolve().parents[2]

TYPE = re.compile(r"(?:struct|class|union|enum(?: class)?) (\w+)\b(?!::)")
OTHER = re.compile(r"(?:struct|class|union) \w+;|using (?!\w+ =)|INSTANTIATE_\w+\($|(?:inline )?namespace|template|#include|extern")
ALIAS = re.compile(r"(?:using(?= \w+ =)|#define) (\w+)")
TEST = re.compile(r"\w*TEST\w*\((\w+), (\w+)[,)]")
FUNCTION = re.compile(r"[^(=]*?(?<![:\w])(\w+)\(")
VARIABLE = re.compile(r"[^(={]*?(?<![:\w])(\w+)(?:\[[^\]]*\])*(?: =|\{|;)")
HEADER = re.compile(r'#include "(tests/[^"]*\.h)"')
NEXT = re.compile(r", (\w+)(?: =|\{)")  # of several variables on a line


def names(text):
    """What a source declares in its namespaces."""
    found = set()
    for line in text.splitlines():
        if not re.match(r"[\w#]", line) or OTHER.match(line):
            continue
        if match := TEST.match(line):
            found.add("_".join(match.groups()))
        elif match := TYPE.match(line) or ALIAS.match(line) or FUNCTION.match(line):
            found.add(match[1])
        elif match := VARIABLE.match(line):
            found.update([match[1], *NEXT.findall(line)])
    return found


@functools.lru_cache(maxsize=None)
def names_of_header(path):
    """What a header of the tests declares, and those that it includes."""
    text = (ROOT / path).read_text(encoding="utf-8")
    return frozenset(names(text) | included(text))


def included(text):
    """What the tests' headers declare that a source includes."""
    return set().union(*(names_of_header(path) for path in HEADER.findall(text)))


def types(text):
    """The types that a header declares in its namespaces."""
    return {match[1] for line in text.splitlines() if not OTHER.match(line) and (match := TYPE.match(line))}


def types_of_headers():
    folders = ("stream", "preprocess", "render", "tools", "tests")
    return set().union(*(types(path.read_text(encoding="utf-8")) for folder in folders for path in (ROOT / folder).rglob("*.h")))


def groups(texts, size, taken=frozenset()):
    """The number of each text's group. Neighbours, which include the same headers, are together where that is possible. A text
    that declares one of the names `taken` is alone."""
    size = -(-len(texts) // -(-len(texts) // size)) if texts else size  # as many groups, of the same size
    known, numbers = [], []
    for text in texts:
        own, foreign = names(text), included(text)
        at = next((n for n, (count, declared, others) in enumerate(known)
                   if count < size and not own & declared and not own & others and not foreign & declared), len(known))
        if own & taken:
            at = len(known)
        if at == len(known):
            known.append([0, set(), set()])
        known[at] = [size if own & taken else known[at][0] + 1, known[at][1] | own, known[at][2] | foreign]
        numbers.append(at)
    return numbers


def main(size, *files):
    for number in groups([pathlib.Path(file).read_text(encoding="utf-8") for file in files], int(size), types_of_headers()):
        print(number)


if __name__ == "__main__":
    main(*sys.argv[1:])
