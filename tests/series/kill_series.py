#!/usr/bin/env python3
"""Kills conversions of a series at random moments, and looks at what is left.

    kill_series.py PROGRAM [MOMENTS [SIZE [STEPS]]]

MOMENTS of each of: convert, convert --add-steps, convert --follow; on a fixed grid and on one that moves. Without MOMENTS, one: usually
convert and --follow on the fixed grid and --add-steps on the other; with CURVISPLAT_WHOLE (tools/test.sh --whole) 20 of all. After each the
cache must verify, with every step that was reported as finished and the bytes that an undisturbed conversion has; --resume must
complete it to the same files. Prints a line for each; exit status 1 if anything was wrong. Moments are seeded; what they hit is not.
"""
import hashlib
import json
import os
import pathlib
import random
import shutil
import signal
import subprocess
import sys
import tempfile
import time

IS_WHOLE = "CURVISPLAT_WHOLE" in os.environ
USUAL_KILLS = 20 if IS_WHOLE else 1


def digests(folder):
    return {str(path.relative_to(folder)): hashlib.sha256(path.read_bytes()).hexdigest()
            for path in sorted(folder.rglob("*")) if path.is_file()}


class Series:
    def __init__(self, program, folder, moving, size, steps):
        self.program, self.steps, self.cache = program, steps, folder / "a.splats"
        subprocess.run([program, "generate", "wake", "--size", size, "--steps", str(steps), *(["--moving"] if moving else []),
                        "-o", folder / "w"], check=True, stdout=subprocess.DEVNULL)
        for path in folder.iterdir():
            os.utime(path, (time.time() - 3600,) * 2)
        self.grid = folder / ("w_%04d.xyz" if moving else "w.xyz")
        grids = [folder / f"w_{step:04d}.xyz" for step in range(steps)] if moving else [self.grid]
        functions = [folder / f"w_{step:04d}.fun" for step in range(steps)]
        self.first = [*grids[:2], *functions[:2]]
        self.rest = [*(grids[2:] if moving else grids), *functions[2:]]
        self.whole = [self.grid, folder / "w_%04d.fun"]

    def commands(self):
        to = ["-o", self.cache]
        return {"convert": ["convert", *self.whole, *to],
                "add": ["convert", "--add-steps", *self.rest, "--to", self.cache],
                "follow": ["convert", *self.whole, "--follow", "--until", self.steps, *to]}

    def run(self, *words, check=True):
        return subprocess.run([str(word) for word in (self.program, *words)], check=check, capture_output=True, text=True)

    def clear(self):
        for path in self.cache.parent.glob("a.splats*"):
            shutil.rmtree(path)

    def prepare(self, job):
        self.clear()
        if job == "add":
            self.run("convert", *self.first, "-o", self.cache)

    def found_steps(self):
        if not self.cache.exists():
            return 0
        self.run("info", self.cache, "--verify")
        return len(json.loads(self.run("info", self.cache, "--json").stdout).get("steps", [0]))


def main(program, moments=USUAL_KILLS, size="28x24x12", steps=5):
    random.seed(5)
    failed = killed = tried = 0
    for moving in (False, True):
        with tempfile.TemporaryDirectory() as name:
            series = Series(program, pathlib.Path(name), moving, size, int(steps))
            series.run("convert", *series.whole, "-o", series.cache)
            wanted = digests(series.cache)
            for job, command in series.commands().items():
                if moving != (job == "add") and len(sys.argv) < 3 and not IS_WHOLE:
                    continue
                series.prepare(job)
                start = time.monotonic()
                series.run(*command)
                duration = time.monotonic() - start
                faults = [] if digests(series.cache) == wanted else [f"{job} gives other bytes"]
                for n in range(int(moments)):
                    series.prepare(job)
                    before = series.found_steps()
                    moment = duration * (n + random.random()) / int(moments)
                    process = subprocess.Popen([str(word) for word in (program, *command)], stdout=subprocess.PIPE,
                                               stderr=subprocess.DEVNULL, text=True)
                    try:
                        out = process.communicate(timeout=moment)[0]
                    except subprocess.TimeoutExpired:
                        process.send_signal(signal.SIGKILL)
                        out = process.communicate()[0]
                    killed += process.returncode == -signal.SIGKILL
                    tried += 1
                    finished = max(before, out.count("\nstep ") + out.startswith("step ") if job == "follow" else 0)
                    left = series.found_steps()
                    if left < finished:
                        faults.append(f"{finished} steps were finished, {left} are left")
                    values = [name for name in wanted if "var." in name or "geometry.bin" in name]
                    there = digests(series.cache) if series.cache.exists() else {}
                    if left == int(steps) and any(there.get(name) != wanted[name] for name in values):
                        faults.append("the steps that are left have other bytes")
                    series.run("convert", *series.whole, "--resume", "-o", series.cache)
                    if digests(series.cache) != wanted:
                        faults.append("resumed, it has other files")
                    if list(series.cache.parent.glob("a.splats?*")):
                        faults.append("something lies beside the cache")
                    print(f"{'moving' if moving else 'fixed'} {job} killed after {moment:.3f} of {duration:.3f} s: {left} steps left; "
                          f"{'; '.join(faults).upper() or 'resumed to the same bytes'}", flush=True)
                    failed |= bool(faults)
                    faults = []
    print(f"{killed} of {tried} were killed before they were done")
    sys.exit(failed or killed == 0)


if __name__ == "__main__":
    main(*sys.argv[1:])
