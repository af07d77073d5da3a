#!/usr/bin/env python3
"""Checks sources with Clang 14, without output: its warnings, which are errors, and -Wthread-safety, which checks
that members are only touched while their mutex is held (stream/base/mutex.h). With --tidy, those that are not tests are checked
by clang-tidy (.clang-tidy) as well. Takes the commands of build/release, which tools/build.sh configures.

    tools/check_clang.py [--tidy] [FILE ...]    these; without any, all sources
    tools/check_clang.py [--tidy] --since REV   those that have changed since this commit, or include a header that has; by clang-tidy
                                                only those that have changed themselves

Headers take most of the time. So sources with the same macros are checked several at a time, as one that includes them, and
what most include (tools/cmake/common_headers.h, and GoogleTest) is parsed once. Names that two of them have for themselves
would collide there: tools/cmake/unity_groups.py keeps these apart. Should it miss some, and the compiler finds anything in several,
each half of them is checked again, down to single ones.
"""

import argparse
import concurrent.futures
import json
import os
import pathlib
import re
import shlex
import subprocess
import sys
import tempfile

ROOT = pathlib.Path(__file__).resolve().parent.parent
sys.path.insert(0, str(ROOT / "tools/cmake"))
import unity_groups  # noqa: E402

BUILD = ROOT / "build/release"
# GCC's commands name warnings and pragmas that Clang does not know; and Clang warns of & between cheap conditions.
FLAGS = ["-Wthread-safety", "-Werror", "-Wno-unknown-warning-option", "-Wno-bitwise-instead-of-logical",
         "-Wno-unknown-pragmas"]
AT_A_TIME = 16


def sources_of(file):
    """What a file of the build compiles: itself, or those that it includes (tools/cmake/unity.cmake)."""
    if file.parent.name != "Unity":
        return [file]
    return [pathlib.Path(source) for source in re.findall(r'#include "(.*)"', file.read_text(encoding="utf-8"))]


def commands(named):
    """(file, its compiler's arguments) of each source of ours, or of those named, which a build must have."""
    path = BUILD / "compile_commands.json"
    if not path.exists():
        sys.exit("check_clang: build/release is not configured; run tools/build.sh first")
    ours = {}
    for entry in json.loads(path.read_text()):
        for file in sources_of(pathlib.Path(entry["file"])):
            if not file.is_relative_to(ROOT / "build") and (not named or file in named):
                ours[file] = shlex.split(entry["command"])
    missing = named - ours.keys()
    if missing:
        sys.exit(f"check_clang: {min(missing)}: no target compiles this file; name a .cpp file of the build")
    return sorted(ours.items())


def changed_since(revision):
    """What has changed since a commit, in the working tree as well, and still exists."""
    run = subprocess.run(["git", "diff", "--name-only", "--diff-filter=d", revision, "--", "*.cpp", "*.h"], cwd=ROOT, text=True,
                         capture_output=True)
    if run.returncode:
        sys.exit(f"check_clang: --since {revision}: {run.stderr.strip()}; name a commit of this repository")
    return set(run.stdout.splitlines())


def affected(sources, changed):
    """Those of the sources that have changed, or that include a header that has."""
    def is_affected(file):
        included = re.findall(r'^#include "([^"]+)"', file.read_text(encoding="utf-8"), re.MULTILINE)
        return not changed.isdisjoint([str(file.relative_to(ROOT)), *included])
    return [(file, arguments) for file, arguments in sources if is_affected(file)]


class Group:
    """Sources with the same macros, and what Clang needs to parse any of them."""

    def __init__(self, folder, are_tests, tidy):
        self.folder, self.are_tests, self.tidy = folder, are_tests, tidy
        self.files, self.flags, self.precompiled = [], [], []

    def add(self, file, arguments):
        self.files.append(file)
        rest = iter(arguments)
        for argument in rest:
            if argument == "-isystem":
                argument += next(rest)
            if argument == "-Wno-shadow" and not self.are_tests:
                continue  # of builds of sources that are compiled together
            if argument.startswith(("-D", "-I", "-isystem", "-std", "-W")) and argument not in (*self.flags, "-Winvalid-pch"):
                self.flags.append(argument)

    def precompile(self):
        headers = ["-include", "gtest/gtest.h"] if self.are_tests else []
        output = str(self.folder / f"{id(self)}.pch")
        subprocess.run(["clang++-14", *self.flags, *FLAGS, *headers, "-x", "c++-header",
                        str(ROOT / "tools/cmake/common_headers.h"), "-o", output], cwd=BUILD, check=True)
        self.precompiled = ["-include-pch", output]

    def batches(self):
        numbers = unity_groups.groups([file.read_text(encoding="utf-8") for file in self.files], AT_A_TIME)
        return [(self, [file for file, of in zip(self.files, numbers) if of == n]) for n in range(max(numbers) + 1)]

    def findings(self, files):
        """What is found in these files, or ""."""
        with tempfile.NamedTemporaryFile("w", suffix=".cpp", dir=self.folder) as several:
            several.writelines(f'#include "{file}"\n' for file in files)
            several.flush()
            words = [*self.flags, *FLAGS, *self.precompiled]
            source = several.name if len(files) > 1 else str(files[0])
            if self.tidy:  # it gives the compiler's warnings, too
                words = ["clang-tidy-14", "--quiet", f"--config-file={ROOT / '.clang-tidy'}", source, "--", *words]
            else:
                words = ["clang++-14", *words, "-fsyntax-only", source]
            run = subprocess.run(words, cwd=BUILD, text=True, stdout=subprocess.PIPE, stderr=subprocess.STDOUT)
        if run.returncode == 0:
            return ""
        together = any(words in run.stdout for words in ("clang-diagnostic", "PLEASE submit a bug report"))
        if len(files) == 1 or (self.tidy and not together):
            return run.stdout
        half = len(files) // 2
        return self.findings(files[:half]) + self.findings(files[half:])


def groups(folder, sources, tidied):
    found = {}
    for file, arguments in sources:
        are_tests = file.is_relative_to(ROOT / "tests")
        tidy = file in tidied and not are_tests
        macros = sorted(argument for argument in arguments if argument.startswith("-D"))
        found.setdefault((are_tests, tidy, *macros), Group(folder, are_tests, tidy)).add(file, arguments)
    return list(found.values())


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--tidy", action="store_true", help="run clang-tidy, too")
    parser.add_argument("--since", metavar="REV", help="check what has changed since this commit, or includes a header that has")
    parser.add_argument("files", nargs="*", type=pathlib.Path)
    options = parser.parse_args()
    named = {file.resolve() for file in options.files}
    packages = ["clang-14"] + (["clang-tidy-14"] if options.tidy else [])
    subprocess.run([ROOT / "tools/setup.sh", *packages], check=True)

    sources = commands(named)
    tidied = {file for file, _ in sources} if options.tidy else set()
    if options.since:
        changed = changed_since(options.since)
        sources = affected(sources, changed)
        tidied &= {ROOT / name for name in changed}
    with tempfile.TemporaryDirectory() as folder, concurrent.futures.ThreadPoolExecutor(os.cpu_count()) as pool:
        alike = groups(pathlib.Path(folder), sources, tidied)
        list(pool.map(Group.precompile, [group for group in alike if len(group.files) > AT_A_TIME]))
        batches = [batch for group in alike for batch in group.batches()]
        found = [findings for findings in pool.map(lambda batch: batch[0].findings(batch[1]), batches) if findings]
    for findings in found:
        print(findings, end="")
    print(f"check_clang: {len(sources)} files, {'warnings above' if found else 'no warnings'}")
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main())
