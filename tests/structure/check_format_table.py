#!/usr/bin/env python3
"""Checks that every test that preprocess/README.md names exists: check_format_table.py [ROOT]

Names in code quotes that begin with test_, alone or after a class (`TecplotText.test_times`), are methods of the Python tests; one that
ends in ... is the beginning of a name. Words that end in _test are files of tests. "fuzz: NAME" is a target with a corpus. Each cell
of a table is a dash, names a test or a target, or says that there is none.
"""
import pathlib
import re
import sys

QUOTED = re.compile(r"`(?:(\w+)\.)?(test_\w+|[A-Z]\w+\.\w+)(\.\.\.)?`")
FILE = re.compile(r"\b(\w+_test)(?:\.py)?\b")
FUZZ = re.compile(r"fuzz: (\w+)")
ANSWER = re.compile(r"^-$|: - \(|no test|none at hand|the same|as stored|as of")


def python_tests(root):
    """Methods of all Python tests: name, and class.name."""
    names = set()
    for path in (root / "tests").rglob("*.py"):
        group = ""
        for line in path.read_text().splitlines():
            if found := re.match(r"class (\w+)", line):
                group = found[1]
            if found := re.match(r" +def (test_\w+)", line):
                names |= {found[1], f"{group}.{found[1]}"}
    return names


def faults_in(text, root):
    methods = python_tests(root)
    files = {path.stem for path in (root / "tests").rglob("*_test.*")}
    targets = {path.name for path in (root / "tests/fuzz/corpus").iterdir()}
    for number, line in enumerate(text.splitlines(), 1):
        for group, name, is_start in QUOTED.findall(line):
            full = f"{group}.{name}" if group else name
            known = any(m.startswith(full) for m in methods) if is_start or full.endswith("_") else full in methods
            if not known:
                yield f"{number}: there is no test {full}"
        for name in FILE.findall(line):
            if not name.startswith("test_") and name not in files:
                yield f"{number}: there is no file of tests {name}"
        for name in FUZZ.findall(line):
            if name not in targets:
                yield f"{number}: there is no fuzz target {name}"
        cells = [cell.strip() for cell in line.strip("|").split(" | ")]
        if in_table(text, number) and not line.startswith("|---"):
            for cell in cells[1:]:
                has_test = QUOTED.search(cell) or FILE.search(cell) or FUZZ.search(cell) or re.search(r"\b[smutfx]\b|tests/", cell)
                if not has_test and not ANSWER.search(cell):
                    yield f'{number}: "{cell}" names no test'


def in_table(text, number):
    """Whether the line is a row, not the head, of a table whose columns are formats."""
    lines = text.splitlines()
    if not lines[number - 1].startswith("| "):
        return False
    first = number - 1
    while first > 0 and lines[first - 1].startswith("|"):
        first -= 1
    return lines[first].startswith("| | ") and number - 1 > first


def main():
    root = pathlib.Path(sys.argv[1]) if len(sys.argv) > 1 else pathlib.Path(__file__).resolve().parents[2]
    text = (root / "preprocess/README.md").read_text()
    faults = list(faults_in(text, root))
    for fault in faults:
        print(f"preprocess/README.md:{fault}")
    rows = sum(in_table(text, n + 1) for n in range(len(text.splitlines())))
    print(f"{rows} rows of tables, {len(faults)} faults")
    return 1 if faults or rows == 0 else 0


if __name__ == "__main__":
    sys.exit(main())
