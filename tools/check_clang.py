#!/usr/bin/env python3
"""Checks sources with Clang 14, without output: its warnings, which are errors, and -Wthread-safety, which checks
that members are only touched while their mutex is held (stream/base/mutex.h). With --tidy, clang-tidy checks them
by .clang-tidy as well. Takes the commands of build/release, which tools/build.sh configures. What most sources include
(tools/cmake/common_headers.h, and GoogleTest) is parsed once for all that are compiled alike: half of the time.

    tools/check_clang.py [--tidy] [FILE ...]    these; without any, all sources
    tools/check_clang.py [--tidy] --since REV   those that have changed since this commit
"""

import argparse
import concurrent.futures
import json
import os
import pathlib
import shlex
import subprocess
import sys
import tempfile

ROOT = pathlib.Path(__file__).resolve().parent.parent
# GCC's commands name warnings and pragmas that Clang does not know; and Clang warns of & between cheap conditions.
FLAGS = ["-Wthread-safety", "-Werror", "-Wno-unknown-warning-option", "-Wno-bitwise-instead-of-logical",
         "-Wno-unknown-pragmas"]


def commands(chosen):
    """(file, folder, arguments) of each source of ours, or of those chosen."""
    path = ROOT / "build/release/compile_commands.json"
    if not path.exists():
        sys.exit("check_clang: build/release is not configured; run tools/build.sh first")
    ours = {}
    for entry in json.loads(path.read_text()):
        file = pathlib.Path(entry["file"])
        if file.is_relative_to(ROOT / "build") or (chosen and file not in chosen):
            continue
        ours[file] = (entry["directory"], shlex.split(entry["command"]))
    missing = chosen - ours.keys()
    if missing:
        sys.exit(f"check_clang: {min(missing)}: no target compiles this file; name a .cpp file of the build")
    return sorted((file, *rest) for file, rest in ours.items())


def changed_since(revision):
    """The sources that have changed since a commit, in the working tree as well, and still exist."""
    run = subprocess.run(["git", "diff", "--name-only", "--diff-filter=d", revision, "--", "*.cpp"], cwd=ROOT, text=True,
                         capture_output=True)
    if run.returncode:
        sys.exit(f"check_clang: --since {revision}: {run.stderr.strip()}; name a commit of this repository")
    return {ROOT / line for line in run.stdout.splitlines()}


def clang_arguments(arguments):
    """Those of the compiler's that are left for Clang."""
    kept = []
    rest = iter(arguments)
    for argument in rest:
        if argument in ("-o", "-c", "-include"):  # -include: what GCC has precompiled
            next(rest)
        elif argument != "-Winvalid-pch" and not argument.endswith("ccache") and not os.path.basename(argument).startswith(("c++", "g++")):
            kept.append(argument)
    return kept


class CommonHeaders:
    """What most sources include, precompiled: once for each set of flags that Clang requires to be the same."""

    LEAST_SOURCES = 8  # of one set of flags; fewer cost less without

    def __init__(self, folder, jobs):
        self.headers = {}
        groups = {}
        for file, cwd, arguments in jobs:
            groups.setdefault(self.key(file, arguments), []).append((cwd, clang_arguments(arguments)))
        for key, members in groups.items():
            if len(members) >= self.LEAST_SOURCES:
                self.headers[key] = self.precompile(folder / f"{len(self.headers)}.pch", *key[:1], members)

    @staticmethod
    def key(file, arguments):
        is_test = file.name.endswith("_test.cpp")
        return (is_test, *sorted(a for a in arguments if a.startswith(("-f", "-s", "-O", "-m", "-p"))))

    @staticmethod
    def precompile(output, is_test, members):
        """Without the macros and folders that only some of its sources have."""
        cwd, first = members[0]
        common = set(first).intersection(*(arguments for _, arguments in members))
        kept = [a for n, a in enumerate(first) if a in common and first[n - 1] != "-isystem" and a != "-isystem"]
        words = ["clang++-14", *kept, *FLAGS]
        words += ["-include", "gtest/gtest.h"] if is_test else []
        words += ["-x", "c++-header", str(ROOT / "tools/cmake/common_headers.h"), "-o", str(output)]
        subprocess.run(words, cwd=cwd, check=True)
        return output

    def flags(self, file, arguments):
        header = self.headers.get(self.key(file, arguments))
        return ["-include-pch", str(header)] if header else []


def check(job, headers):
    """Clang's output if it finds anything."""
    file, folder, arguments = job
    words = ["clang++-14", *clang_arguments(arguments), *FLAGS, *headers.flags(file, arguments), "-fsyntax-only", str(file)]
    run = subprocess.run(words, cwd=folder, text=True, capture_output=True)
    return run.stderr if run.returncode else ""


def tidy(files):
    extra = [f"--extra-arg={flag}" for flag in FLAGS]
    return subprocess.run(["xargs", "-0", "-n", "4", "-P", str(os.cpu_count()), "clang-tidy-14", "-p",
                           "build/release", "--quiet", *extra], cwd=ROOT, text=True,
                          input="\0".join(map(str, files)), stderr=subprocess.DEVNULL).returncode


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--tidy", action="store_true", help="run clang-tidy, too")
    parser.add_argument("--since", metavar="REV", help="check the sources that have changed since this commit")
    parser.add_argument("files", nargs="*", type=pathlib.Path)
    options = parser.parse_args()
    chosen = {file.resolve() for file in options.files}
    if options.since:
        chosen |= changed_since(options.since)
        if not chosen:
            print(f"check_clang: no source has changed since {options.since}")
            return 0
    packages = ["clang-14"] + (["clang-tidy-14"] if options.tidy else [])
    subprocess.run([ROOT / "tools/setup.sh", *packages], check=True)

    jobs = commands(chosen)
    with tempfile.TemporaryDirectory() as folder, concurrent.futures.ThreadPoolExecutor(os.cpu_count()) as pool:
        headers = CommonHeaders(pathlib.Path(folder), jobs)
        found = [output for output in pool.map(lambda job: check(job, headers), jobs) if output]
    for output in found:
        print(output, end="")
    failed = bool(found) or (options.tidy and tidy([job[0] for job in jobs]) != 0)
    print(f"check_clang: {len(jobs)} files, {'warnings above' if failed else 'no warnings'}")
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
