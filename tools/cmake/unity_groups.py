"""Which sources can be compiled together, as one that includes them (tools/check_clang.py). None of a group declares a name for
itself that another one declares, too: a static function, or one in a namespace without name, say. One that has a type of the name
of a header's is alone. What is declared is read from the layout: our formatter puts declarations of a namespace at the beginning
of a line, and nothing else."""
import pathlib
import re

ROOT = pathlib.Path(__file__).resolve().parents[2]

TYPE = re.compile(r"(?:struct|class|union|enum(?: class)?) (\w+)\b(?!::)")
OTHER = re.compile(r"(?:struct|class|union) \w+;|using (?!\w+ =)|INSTANTIATE_\w+\($|(?:inline )?namespace|template|#include|extern")
ALIAS = re.compile(r"(?:using(?= \w+ =)|#define) (\w+)")
TEST = re.compile(r"\w*TEST\w*\((\w+), (\w+)[,)]")
FUNCTION = re.compile(r"[^(=]*?(?<![:\w])(\w+)\(")
VARIABLE = re.compile(r"[^(={]*?(?<![:\w])(\w+)(?:\[[^\]]*\])*(?: =|\{|;)")


def names(text):
    """What a source declares in its namespaces."""
    found = set()
    for line in text.splitlines():
        if not re.match(r"[\w#]", line) or OTHER.match(line):
            continue
        if match := TEST.match(line):
            found.add("_".join(match.groups()))
        elif match := TYPE.match(line) or ALIAS.match(line) or FUNCTION.match(line) or VARIABLE.match(line):
            found.add(match[1])
    return found


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
    for own in map(names, texts):
        at = next((n for n, (count, declared) in enumerate(known) if count < size and not own & declared), len(known))
        if own & taken:
            at = len(known)
        if at == len(known):
            known.append([0, set()])
        known[at] = [size if own & taken else known[at][0] + 1, known[at][1] | own]
        numbers.append(at)
    return numbers
