#!/usr/bin/env python3
"""Converts files of any format within one memory budget, and prints time and peak memory of each.

    bench/format_memory.py grid.vts flow.cgns --scalar p --memory 160M

Each file is converted by a process of its own into a temporary folder. Exit status 1 if any exceeds the budget.
"""
import argparse
import json
import pathlib
import subprocess
import sys
import tempfile

UNITS = {"K": 1 << 10, "M": 1 << 20, "G": 1 << 30}


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("files", nargs="+")
    parser.add_argument("--scalar", required=True)
    parser.add_argument("--memory", default="160M", help="budget, a number with K, M or G")
    parser.add_argument("--program", default="build/release/tools/curvisplat")
    words = parser.parse_args()
    budget = int(words.memory[:-1]) * UNITS[words.memory[-1]]

    too_much = False
    print("| file | samples | seconds | peak MiB | budget MiB |\n|---|---|---|---|---|")
    for file in words.files:
        with tempfile.TemporaryDirectory(dir=pathlib.Path(file).resolve().parent) as folder:
            statistics = pathlib.Path(folder) / "stats.json"
            command = [words.program, "convert", file, "-o", f"{folder}/out.splats", "--scalar", words.scalar]
            command += ["--memory", words.memory, "--stats", str(statistics)]
            result = subprocess.run(command, capture_output=True, text=True)
            if result.returncode:
                sys.exit(f"{file}: {result.stderr.strip()}")
            told = json.loads(statistics.read_text())
        peak = told["peak_memory_bytes"]
        too_much |= peak > budget
        samples = told["samples"]
        print(f"| {pathlib.Path(file).name} | {samples} | {told['seconds']:.1f} | {peak / 2**20:.0f} | {budget / 2**20:.0f} |")
    sys.exit(1 if too_much else 0)


if __name__ == "__main__":
    main()
