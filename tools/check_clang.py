#!/usr/bin/env python3
"""Checks sources with Clang 14, without output: its warnings, which are errors, and -Wthread-safety, which checks
that members are only touched while their mutex is held (stream/base/mutex.h). With --tidy, clang-tidy checks them
by .clang-tidy as well. Takes the commands of build/release, which tools/build.sh configures.

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


def check(job):
    """Clang's output if it finds anything."""
    file, folder, arguments = job
    kept = []
    rest = iter(arguments)
    for argument in rest:
        if argument in ("-o", "-c"):
            next(rest)
        elif not argument.endswith("ccache") and not os.path.basename(argument).startswith(("c++", "g++")):
            kept.append(argument)
    run = subprocess.run(["clang++-14", *kept, *FLAGS, "-fsyntax-only", str(file)], cwd=folder, text=True,
                         capture_output=True)
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
    with concurrent.futures.ThreadPoolExecutor(os.cpu_count()) as pool:
        found = [output for output in pool.map(check, jobs) if output]
    for output in found:
        print(output, end="")
    failed = bool(found) or (options.tidy and tidy([job[0] for job in jobs]) != 0)
    print(f"check_clang: {len(jobs)} files, {'warnings above' if failed else 'no warnings'}")
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
