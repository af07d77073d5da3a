#!/usr/bin/env python3
"""Converts, adds a scalar and draws by 2, 3, 4, 7 and 16 ranks on this machine, and compares every byte with what one process makes.

    many_ranks.py PROGRAM [--ranks 2 3 4 7 16] [--size 160x120x60] [--folder /tmp]

A grid, one of 60 nodes (most ranks have nothing to do), a series of time steps on a grid that stays and on one that moves, the same
series in as many parts as ranks, pictures with surfaces, cuts and light, an orbit, and a picture of two tiles. The peak memory of
each rank must be within --memory. Prints a line for each; exit status 1 if anything differs, 77 without mpirun. Without --ranks and
--size it runs only with CURVISPLAT_WHOLE, as tools/test.sh --whole sets it; else exit status 77.
"""
import argparse
import hashlib
import os
import pathlib
import shutil
import subprocess
import sys
import tempfile

# Sanitizers take memory for themselves, as much as the program or more: then what a rank takes is not judged.
IS_SANITIZED = "CURVISPLAT_SANITIZED" in os.environ
MEMORY_MIB = 1024 if IS_SANITIZED else 256
# A rank's --memory includes the program and MPI; that of one process alone does not.
PROGRAM_MIB = 64
# A rank: the program, whose peak memory goes to a file.
RANK = """#!/usr/bin/env python3
import os, sys
child = os.fork()
if child == 0:
    os.execv(sys.argv[2], sys.argv[2:])
_, status, usage = os.wait4(child, 0)
with open(sys.argv[1] + "/" + os.environ["OMPI_COMM_WORLD_RANK"], "w") as told:
    told.write(str(usage.ru_maxrss // 1024))
sys.exit(os.waitstatus_to_exitcode(status))
"""


def digests(path):
    files = [path] if path.is_file() else sorted(file for file in path.rglob("*") if file.is_file())
    return {str(file.relative_to(path)): hashlib.sha256(file.read_bytes()).hexdigest() for file in files}


class Jobs:
    def __init__(self, program, folder):
        self.program, self.folder, self.failures, self.expected = program, folder, 0, {}
        self.rank = folder / "rank.py"
        self.rank.write_text(RANK)
        self.rank.chmod(0o755)

    def run(self, *words):
        return subprocess.run([str(word) for word in (self.program, *words)], capture_output=True, text=True)

    def run_ranks(self, count, *words):
        peaks = self.folder / "peaks"
        shutil.rmtree(peaks, ignore_errors=True)
        peaks.mkdir()
        result = subprocess.run([str(word) for word in (
            "mpirun", "--oversubscribe", "--allow-run-as-root", "--bind-to", "none", "-q", "-n", count, self.rank, peaks, self.program,
            *words)], capture_output=True, text=True, stdin=subprocess.DEVNULL)
        return result, [int(told.read_text()) for told in peaks.iterdir()]

    def memory_fault(self, count, peaks):
        if IS_SANITIZED:
            return ""
        allowed = MEMORY_MIB + (PROGRAM_MIB if count == 1 else 0)
        return f"MEMORY: {peaks} MiB, {allowed} allowed" if len(peaks) != count or max(peaks) > allowed else ""

    def tell(self, what, count, fault, peak):
        self.failures += bool(fault)
        print(f"{what:24} {count:3} ranks  {'peak %4d MiB' % peak if peak else '':14} {fault or 'equal'}", flush=True)

    def compare(self, what, count, words, output):
        """`words` without -o: by one process, kept under the name of the job; then by ranks."""
        name = what.replace(" ", "_")
        wanted = self.folder / f"{name}_one{output}"
        if what not in self.expected:
            result = self.run(*words, "-o", wanted)
            if result.returncode:
                sys.exit(f"{what}: one process fails: {result.stderr}")
            paths = [wanted] if "%" not in output else sorted(self.folder.glob(f"{name}_one*"))
            self.expected[what] = [digests(path) for path in paths]
        found = self.folder / f"{name}_ranks{output}"
        result, peaks = self.run_ranks(count, *words, "-o", found)
        paths = [found] if "%" not in output else sorted(self.folder.glob(f"{name}_ranks*"))
        fault = ""
        if result.returncode:
            fault = f"FAILS: {result.stderr.strip()}"
        elif [digests(path) for path in paths] != self.expected[what]:
            fault = "DIFFERENT"
        else:
            fault = self.memory_fault(count, peaks)
        self.tell(what, count, fault, max(peaks, default=0))
        for path in paths:
            shutil.rmtree(path) if path.is_dir() else path.unlink(missing_ok=True)

    def compare_addition(self, what, count, words, cache):
        """Adds to copies of `cache`; `words` without --to."""
        wanted, found = self.folder / "added_one.splats", self.folder / "added_ranks.splats"
        if what not in self.expected:
            shutil.copytree(cache, wanted)
            result = self.run(*words, "--to", wanted)
            if result.returncode:
                sys.exit(f"{what}: one process fails: {result.stderr}")
            self.expected[what] = digests(wanted)
        shutil.copytree(cache, found)
        result, peaks = self.run_ranks(count, *words, "--to", found)
        fault = ""
        if result.returncode:
            fault = f"FAILS: {result.stderr.strip()}"
        elif digests(found) != self.expected[what]:
            fault = "DIFFERENT"
        elif list(self.folder.glob("added_ranks.splats?*")):
            fault = "SOMETHING IS LEFT"
        else:
            fault = self.memory_fault(count, peaks)
        self.tell(what, count, fault, max(peaks, default=0))
        shutil.rmtree(found)

    def compare_parts(self, what, count, words):
        output = self.folder / "joined.splats"
        faults = ""
        for part in range(1, count + 1):
            result = self.run(*words, "-o", output, "--part", f"{part}/{count}")
            faults = faults or result.stderr
        result = self.run("convert", "--join", f"{output}.parts", "-o", output)
        faults = faults or result.stderr or ("" if [digests(output)] == self.expected[what] else "DIFFERENT")
        self.tell(f"{what} in parts", count, faults, 0)
        shutil.rmtree(output, ignore_errors=True)
        shutil.rmtree(f"{output}.parts", ignore_errors=True)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("program", type=pathlib.Path)
    parser.add_argument("--ranks", type=int, nargs="+")
    parser.add_argument("--size")
    parser.add_argument("--steps", default="8")
    parser.add_argument("--folder", default="/tmp")
    arguments = parser.parse_args()
    if not (arguments.ranks or arguments.size or "CURVISPLAT_WHOLE" in os.environ):
        print("skipped: only with tools/test.sh --whole")
        sys.exit(77)
    program = arguments.program.resolve()
    if not shutil.which("mpirun") or not (program.parent / "curvisplat-mpi.so").exists():
        print("skipped: no mpirun (Debian: openmpi-bin), or built without MPI")
        sys.exit(77)
    with tempfile.TemporaryDirectory(dir=arguments.folder, prefix="many_ranks.") as name:
        folder = pathlib.Path(name)
        jobs = Jobs(program, folder)
        generated = {"one": ["--size", arguments.size or "160x120x60"], "tiny": ["--size", "5x4x3"],
                     "still": ["--size", "40x32x16", "--steps", arguments.steps],
                     "moving": ["--size", "40x32x16", "--steps", arguments.steps, "--moving"]}
        for grid, words in generated.items():
            result = jobs.run("generate", "wake", *words, "-o", folder / grid)
            if result.returncode:
                sys.exit(result.stderr)
        limits = ["--memory", f"{MEMORY_MIB}M", "--threads", "1"]
        series = {"still": [folder / "still.xyz", folder / "still_%04d.fun"],
                  "moving": [folder / "moving_%04d.xyz", folder / "moving_%04d.fun"]}
        jobs.run("convert", folder / "one.xyz", folder / "one.fun", "-o", folder / "drawn.splats", *limits)
        draw = ["render", folder / "drawn.splats", "--range", "0,1", *limits]
        looks = ["--shade", "--outline", "--surface", "kmin", "--slice=0,0,0.5,0,0,1", "--size", "300x200"]
        for count in arguments.ranks or (2, 3, 4, 7, 16):
            for grid in ("one", "tiny"):
                jobs.compare(f"convert {grid}", count, ["convert", folder / f"{grid}.xyz", folder / f"{grid}.fun", *limits], ".splats")
            jobs.compare_addition("add a scalar", count, ["convert", folder / "one.xyz", folder / "one.fun", "--add-scalar", "volume", *limits],
                                  folder / "drawn.splats")
            for grid, files in series.items():
                words = ["convert", *files, *limits]
                jobs.compare(f"series {grid}", count, words, ".splats")
                jobs.compare_parts(f"series {grid}", count, words)
            jobs.compare("picture", count, [*draw, *looks], ".exr")
            jobs.compare("two tiles", count, [*draw, "--size", "64x32"], ".png")
            jobs.compare("orbit", count, [*draw, "--orbit", "90", "--frames", "3", "--size", "64x64"], "_%d.png")
        sys.exit(1 if jobs.failures else 0)


if __name__ == "__main__":
    main()
