#!/usr/bin/env python3
"""Which sources can be compiled together, as one that includes them (tools/cmake/unity.cmake, tools/check_clang.py).

    unity_groups.py SIZE FILE ... [-- SIZE FILE ...]    prints the number of each file's group, one a line

Each `--` begins the files of another target. A group has at most SIZE files. None of them declares a name for itself that another one
declares, too, or that a header declares which another one includes (a type or constant; in headers of the tests any name): a static
function, or one in a namespace without name, say. What is declared is read from the layout: our formatter puts declarations of a
namespace at the beginning of a line, and nothing else."""
import functools
import itertools
import pathlib
import re
import sys

ROOT = pathlib.Path(__file__).resolve().parents[2]

TYPE = re.compile(r"(?:struct|class|union|enum(?: class)?) (\w+)\b(?!::)")
OTHER = re.compile(r"(?:struct|class|union) \w+;|using (?!\w+ =)|INSTANTIATE_\w+\($|(?:inline )?namespace|template|#include|extern")
CONSTANT = re.compile(r"inline constexpr [^({=]*?(\w+)(?: =|\{)")
ALIAS = re.compile(r"(?:using(?= \w+ =)|#define) (\w+)")
TEST = re.compile(r"\w*TEST\w*\((\w+), (\w+)[,)]")
FUNCTION = re.compile(r"[^(=]*?(?<![:~\w])(\w+)\(")
VARIABLE = re.compile(r"[^(={]*?(?<![:\w])(\w+)(?:\[[^\]]*\])*(?: =|\{|;)")
HEADER = re.compile(r'#include "([^"]*/[^"]*\.h)"')
NEXT = re.compile(r", (\w+)(?: =|\{)")  # of several variables on a line
MACRO = re.compile(r"(?:[A-Z][A-Z0-9_]+|static_assert)\(")  # a macro's use declares nothing that it is given
SHADER = re.compile(r'R"(\w*)\(.*?\)\1"', re.DOTALL)  # a text in another language


def names(text):
    """What a source declares in its namespaces."""
    found = set()
    for line in SHADER.sub('""', text).splitlines():
        if not re.match(r"[\w#]", line) or OTHER.match(line):
            continue
        if match := TEST.match(line):
            found.add("_".join(match.groups()))
        elif MACRO.match(line):
            continue
        elif match := TYPE.match(line) or ALIAS.match(line) or FUNCTION.match(line):
            found.add(match[1])
        elif match := VARIABLE.match(line):
            found.update([match[1], *NEXT.findall(line)])
    return found


def types(text):
    """The types and constants that a header declares in its namespaces."""
    return {match[1] for line in text.splitlines()
            if (match := CONSTANT.match(line) or (not OTHER.match(line) and TYPE.match(line)))}


@functools.lru_cache(maxsize=None)
def names_of_header(path):
    """What a header of ours declares, and those that it includes."""
    file = ROOT / path
    if not file.exists():  # generated, or a library's
        return frozenset()
    text = file.read_text(encoding="utf-8")
    return frozenset((names(text) if path.startswith("tests/") else types(text)) | included(text))


def included(text):
    """What the headers declare that a source includes."""
    return set().union(*(names_of_header(path) for path in HEADER.findall(text)))


def groups(texts, size):
    """The number of each text's group. Neighbours, which include the same headers, are together where that is possible."""
    size = -(-len(texts) // -(-len(texts) // size)) if texts else size  # as many groups, of the same size
    known, numbers = [], []
    for text in texts:
        foreign = included(text)
        own = names(text) - foreign  # its headers declare the others, and the source defines them
        at = next((n for n, (count, declared, others) in enumerate(known)
                   if count < size and not own & declared and not own & others and not foreign & declared), len(known))
        if at == len(known):
            known.append([0, set(), set()])
        known[at] = [known[at][0] + 1, known[at][1] | own, known[at][2] | foreign]
        numbers.append(at)
    return numbers


def main(*words):
    for are_between, target in itertools.groupby(words, "--".__eq__):
        if not are_between:
            size, *files = target
            print(*groups([pathlib.Path(file).read_text(encoding="utf-8") for file in files], int(size)), sep="\n")


if __name__ == "__main__":
    main(*sys.argv[1:])
