#!/usr/bin/env python3
"""Checks the table of CONTRIBUTING.md, "Finding your way": check_where_table.py [ROOT]

Each name in the second column (a function, a class or a constant, in code quotes) must be defined in the file that follows it. The
names in the third column must be defined somewhere.
"""
import pathlib
import re
import sys


def is_defined(name, text):
    """Whether a file defines Class::f outside of the class, or f where the class has its body."""
    *scope, last = name.split("::")
    head = r"^(?!  return )(?:  (?=[^\s(]+ ))?(?! )[\w:<>,&*~ \[\]]*"
    function = head + rf"\b{name}\([^;{{\"]*(?:\{{|\)\s+: \w)"  # to its body, or to a constructor's initialisers
    if last in text and re.search(function + rf"|^(class|struct) {name}\b[^;]*\{{|^constexpr .*\b{name}[{{\[]", text, re.M):
        return True
    return len(scope) > 0 and last in text and re.search(rf"(class|struct) (\w+::)*{scope[-1]}\b[^;]*\{{", text) and is_defined(last, text)


def main():
    root = pathlib.Path(sys.argv[1]) if len(sys.argv) > 1 else pathlib.Path(__file__).resolve().parents[2]
    section = (root / "CONTRIBUTING.md").read_text().split("## Finding your way")[1].split("\n## ")[0]
    rows = [line.strip("|").split(" | ") for line in section.splitlines() if line.startswith("| ")][1:]
    sources = [p.read_text() for r in ("stream", "preprocess", "render", "tools") for p in (root / r).rglob("*") if p.suffix in (".cpp", ".h")]
    faults = [f"{row[0]}: has {len(row)} columns, expected 3" for row in rows if len(row) != 3]
    for question, where, when in (row for row in rows if len(row) == 3):
        for names, file in re.findall(r"((?:`[^`/]+`, )+)`([^`]+/[^`]+)`", where) or [("`no function`", "")]:
            text = (root / file).read_text() if (root / file).is_file() else ""
            faults += [f"{question}: {file} does not define {name}" for name in re.findall(r"`([^`]+)`", names) if not is_defined(name, text)]
        for name in re.findall(r"`([A-Za-z]\w*(?:::\w+)*)`", when):
            faults += [] if any(is_defined(name, text) for text in sources) else [f"{question}: {name} is not defined anywhere"]
    print(*faults, f"{len(rows)} rows, {len(faults)} faults", sep="\n")
    return 1 if faults or not rows else 0


if __name__ == "__main__":
    sys.exit(main())
