#!/usr/bin/env python3
"""Measures what building and testing cost, in processor seconds (user and system).

    bench/build_times.py build [--target curvisplat] [--define CURVISPLAT_UNITY=OFF]    a build from nothing
    bench/build_times.py headers [--top 30]      each header parsed alone, and the sources that include it
    bench/build_times.py tests [CTEST OPTIONS]   the built test suite, each test by the clock
    bench/build_times.py each [CTEST OPTIONS]    each test alone: its processor time, with that of all processes that it leaves, and
                                                 its time by the clock: far more of it tells of a test that sleeps or waits

`build` configures and builds in a temporary folder, and prints the sum, the rooms and the slowest of what was compiled: several
sources at once, unless CURVISPLAT_UNITY is off. `headers`, `tests` and `each` use build/release, which tools/build.sh makes. The machine
should be idle otherwise: other work slows the processor down.
"""
import argparse
import collections
import ctypes
import json
import os
import pathlib
import re
import resource
import shlex
import signal
import subprocess
import sys
import tempfile
import time
import xml.etree.ElementTree as xml

ROOT = pathlib.Path(__file__).resolve().parent.parent
RELEASE = ROOT / "build/release"


def processor_seconds():
    """Processor time of all child processes that have ended."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def run(command, **options):
    if subprocess.run(command, **options).returncode:
        sys.exit(f"build_times: failed: {shlex.join(map(str, command))}")


def compile_and_log(log, command):
    """The compiler's launcher of a measured build: appends the processor time and the object's name to `log`."""
    status = subprocess.run(command).returncode
    output = command[command.index("-o") + 1] if "-o" in command else "?"
    with open(log, "a", encoding="utf-8") as file:
        file.write(f"{processor_seconds():.3f}\t{output}\n")
    sys.exit(status)


def room_of(output):
    """The source folder of an object file, CMake's folder for it left out."""
    return re.sub(r"/?CMakeFiles/[^/]*\.dir(?=/|$)", "", output.rpartition("/")[0]) or "."


def print_table(rows, title, count):
    print(f"\n{title}")
    for seconds, name in sorted(rows, reverse=True)[:count]:
        print(f"{seconds:8.1f} s  {name}")


def build(options):
    with tempfile.TemporaryDirectory(prefix="build_times_") as folder:
        log = f"{folder}/log"
        launcher = f"{sys.executable};{__file__};--launch;{log}"
        run(["cmake", "--preset", "release", "-B", folder, f"-DCMAKE_CXX_COMPILER_LAUNCHER={launcher}",
             "-DCURVISPLAT_PRECOMPILE=ON", "-DCURVISPLAT_UNITY=ON", *(f"-D{define}" for define in options.define)],
            cwd=ROOT, stdout=subprocess.DEVNULL)
        before = processor_seconds()
        run(["cmake", "--build", folder, "--parallel", str(options.jobs), "--target", *options.target],
            stdout=subprocess.DEVNULL)
        total = processor_seconds() - before
        rooms, sources = collections.Counter(), []
        for line in pathlib.Path(log).read_text(encoding="utf-8").splitlines():
            seconds, output = line.split("\t")
            rooms[room_of(output)] += float(seconds)
            sources.append((float(seconds), output))
    print(f"{total:.0f} s of processor time, {len(sources)} compiled, {sum(s for s, _ in sources):.0f} s of them compiling")
    print_table([(seconds, room) for room, seconds in rooms.items()], "By room", options.top)
    print_table(sources, "By what was compiled", options.top)


def flags_of_a_source():
    """The options that say where headers are and what is defined, of all sources of the program."""
    flags = dict.fromkeys(["-std=c++20"])
    for entry in json.loads((RELEASE / "compile_commands.json").read_text()):
        words = iter(shlex.split(entry["command"]))
        for word in words:
            if word == "-isystem":
                flags[f"-isystem{next(words)}"] = None
            elif word.startswith(("-I", "-D")):
                flags[word] = None
    return list(flags)


def headers(options):
    deps = subprocess.run(["ninja", "-C", str(RELEASE), "-t", "deps"], capture_output=True, text=True, check=True).stdout
    users = collections.Counter()
    for block in deps.split("\n\n"):
        users.update({line.strip() for line in block.splitlines()[1:]})
    flags = flags_of_a_source()
    ours = [path for top in ("stream", "preprocess", "render", "tools", "tests") for path in (ROOT / top).rglob("*.h")]
    libraries = [header for header in ("openvdb/openvdb.h", "CLI/CLI.hpp", "nlohmann/json.hpp", "gtest/gtest.h", "fmt/format.h", "fmt/core.h",
                                       "boost/beast.hpp", "tbb/parallel_for.h", "hwy/highway.h")]
    rows = []
    for name in [*map(str, ours), *libraries]:
        if "-inl" in name:
            continue
        count = next((n for path, n in users.items() if os.path.normpath(RELEASE / path) == name or path.endswith("/include/" + name)), 0)
        before = processor_seconds()
        done = subprocess.run(["g++", *flags, "-fsyntax-only", "-x", "c++", "-"], input=f"#include <{name}>\n",
                              text=True, stderr=subprocess.DEVNULL, cwd=ROOT)
        if done.returncode == 0:
            seconds = processor_seconds() - before
            rows.append((seconds * count, f"= {seconds:.2f} s x {count:4} objects  {name.removeprefix(str(ROOT) + '/')}"))
    print_table(rows, "Headers: processor time if each object parses them anew", options.top)


def tests(options):
    with tempfile.NamedTemporaryFile(suffix=".xml") as report:
        before = processor_seconds()
        status = subprocess.run(["ctest", "--test-dir", str(RELEASE), "--output-junit", report.name, "-j", str(options.jobs),
                                 *options.arguments], stdout=subprocess.DEVNULL).returncode
        total = processor_seconds() - before
        suite = xml.parse(report.name).getroot()
    cases = [(float(case.get("time")), case.get("name")) for case in suite.iter("testcase")]
    folders = collections.Counter()
    for seconds, name in cases:
        folders[name.partition(".")[0]] += seconds
    print(f"{total:.0f} s of processor time, {float(suite.get('time', 0)):.0f} s by the clock, {len(cases)} tests"
          f"{', SOME FAILED' if status else ''}")
    print_table([(seconds, name) for name, seconds in folders.items()], "By folder (by the clock)", options.top)
    print_table(cases, "By test (by the clock)", options.top)


def end_orphans():
    """Ends the processes that a test has left, such as the one that forks (tests/programs/serve_runs.cpp), and waits for them."""
    me = os.getpid()
    while True:
        try:
            ended, _ = os.waitpid(-1, os.WNOHANG)
        except ChildProcessError:
            return
        if ended == 0:
            for process in pathlib.Path(f"/proc/{me}/task/{me}/children").read_text().split():
                os.kill(int(process), signal.SIGKILL)
            time.sleep(0.005)


def each(options):
    becomes_parent_of_orphans = 36  # PR_SET_CHILD_SUBREAPER
    ctypes.CDLL(None).prctl(becomes_parent_of_orphans, 1, 0, 0, 0)
    listed = subprocess.run(["ctest", "--test-dir", str(RELEASE), "--show-only=json-v1", *options.arguments], capture_output=True, check=True)
    rows = []
    for test in json.loads(listed.stdout)["tests"]:
        properties = {one["name"]: one["value"] for one in test["properties"]}
        if "command" not in test or "whole" in properties.get("LABELS", []):
            continue
        environment = dict(os.environ, **dict(one.split("=", 1) for one in properties.get("ENVIRONMENT", [])))
        before, start = processor_seconds(), time.monotonic()
        status = subprocess.run(test["command"], cwd=properties.get("WORKING_DIRECTORY", RELEASE), env=environment, stdin=subprocess.DEVNULL,
                                stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL).returncode
        clock = time.monotonic() - start
        end_orphans()
        failure = f"  (exit status {status})" if status else ""
        rows.append((processor_seconds() - before, f"{clock:8.1f} s by the clock  {test['name']}{failure}"))
        print(f"{rows[-1][0]:8.1f} s  {rows[-1][1]}", flush=True)
    print_table(rows, f"{sum(seconds for seconds, _ in rows):.0f} s of processor time, {len(rows)} tests", options.top)


def main():
    if sys.argv[1:2] == ["--launch"]:
        compile_and_log(sys.argv[2], sys.argv[3:])
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    commands = parser.add_subparsers(required=True)
    for function in (build, headers, tests, each):
        command = commands.add_parser(function.__name__)
        command.set_defaults(call=function)
        command.add_argument("--top", type=int, default=25, help="rows of each table (default 25)")
        command.add_argument("--jobs", type=int, default=os.cpu_count(), help="processes at a time (default: all cores)")
        if function is build:
            command.add_argument("--target", nargs="+", default=["curvisplat"], help="what to build (default curvisplat)")
            command.add_argument("--define", action="append", default=[], help="CMake option, as NAME=VALUE")
    options, rest = parser.parse_known_args()
    if rest and options.call not in (tests, each):
        parser.error(f"unknown argument {rest[0]}")
    options.arguments = rest
    options.call(options)


if __name__ == "__main__":
    main()
