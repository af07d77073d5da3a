#!/usr/bin/env python3
"""Kills one of three ranks that add a scalar to a cache, in every pass, and looks at what is left.

    kill_ranks_that_add.py PROGRAM [KILLS [SIZE]]

KILLS (with CURVISPLAT_WHOLE, as tools/test.sh --whole sets it, 20) are those of each pass, at moments spread over it; without them
there is one in every second pass, which kill_ranks.sh has the others of. After each the job must end within a minute, the cache must
have the files that it had, or all of the new ones as well, and adding the scalar by 1 to 4 ranks must give the files of one process
and leave nothing else behind. dying_ranks lies beside PROGRAM. Prints a line for each; exit status 1 if anything was wrong, 77
without mpirun.
"""
import hashlib
import os
import pathlib
import random
import shutil
import subprocess
import sys
import tempfile

MPIRUN = ["mpirun", "--oversubscribe", "--allow-run-as-root", "--bind-to", "none", "-q", "-n"]
SCALAR = "volume"
IS_WHOLE = "CURVISPLAT_WHOLE" in os.environ
USUAL_KILLS = 20 if IS_WHOLE else 1


def digests(cache):
    return {file.name: hashlib.sha256(file.read_bytes()).hexdigest() for file in cache.iterdir()}


def run(*words):
    return subprocess.run([str(word) for word in words], check=False, capture_output=True, text=True, timeout=60,
                          stdin=subprocess.DEVNULL)


class Additions:
    def __init__(self, program, folder, size):
        self.folder = folder
        self.dying = program.parent / "dying_ranks"
        self.grid = [folder / "in.xyz", folder / "in.fun"]
        self.work = folder / "work"
        self.cache = self.work / "a.splats"
        run(program, "generate", "wake", "--size", size, "-o", folder / "in")
        run(program, "convert", *self.grid, "--refine", "1", "-o", folder / "before.splats")  # as dying_ranks
        self.before = digests(folder / "before.splats")
        self.prepare()
        self.add()
        self.wanted = digests(self.cache)
        if len(self.wanted) <= len(self.before):
            sys.exit("one process fails")

    def prepare(self):
        shutil.rmtree(self.work, ignore_errors=True)
        self.work.mkdir()
        shutil.copytree(self.folder / "before.splats", self.cache)

    def add(self, ranks=1):
        return run(*MPIRUN, ranks, self.dying, *self.grid, self.cache, -1, 0, 0, SCALAR)

    def passes(self):
        """The seconds of each pass of an undisturbed addition by three ranks."""
        self.prepare()
        result = run(*MPIRUN, 3, self.dying, *self.grid, self.cache, -1, 0, 0, SCALAR)
        if result.returncode or digests(self.cache) != self.wanted:
            sys.exit(f"three ranks add something else: {result.stderr}")
        return [(name, float(seconds)) for name, seconds in (line.rsplit(maxsplit=1) for line in result.stdout.splitlines())]

    def kill(self, number, seconds):
        """Kills a rank so long after the first `number` passes. Whether that ended the job, and what was wrong."""
        self.prepare()
        victim = random.randrange(3)
        killed = run(*MPIRUN, 3, self.dying, *self.grid, self.cache, victim, number, round(1e6 * seconds), SCALAR).returncode != 0
        left = digests(self.cache)
        faults = []
        # What a killed rank 0 was writing has no place in the manifest; the next addition removes it.
        listed = {name: digest for name, digest in left.items() if not name.endswith(".part")}
        if listed["manifest.json"] == self.before["manifest.json"]:
            if {name: listed.get(name) for name in self.before} != self.before:
                faults.append("the cache has changed")
            ranks = random.randint(1, 4)
            result = self.add(ranks)
            if result.returncode:
                faults.append(f"{ranks} ranks cannot add: {result.stderr.strip()}")
        elif not self.add().returncode:  # removes the folder of a rank 0 that was killed after its work was in place
            faults.append("a scalar that is there is added again")
        if digests(self.cache) != self.wanted:
            faults.append("other files than one process's")
        if len(list(self.work.iterdir())) != 1:
            faults.append("something is left beside the cache")
        return killed, victim, faults


def main(program, kills=USUAL_KILLS, size="47x40x36"):
    program = pathlib.Path(program).resolve()
    if not shutil.which("mpirun") or not (program.parent / "curvisplat-mpi.so").exists():
        print("skipped: no mpirun (Debian: openmpi-bin), or built without MPI")
        sys.exit(77)
    random.seed(22)
    failed = ended = tried = 0
    with tempfile.TemporaryDirectory(prefix="kill_ranks_that_add.") as name:
        additions = Additions(program, pathlib.Path(name), size)
        for number, (of_pass, duration) in enumerate(additions.passes()):
            if number % 2 == 0 and len(sys.argv) < 3 and not IS_WHOLE:
                continue
            for n in range(int(kills)):
                moment = duration * (n + random.random()) / int(kills)
                killed, victim, faults = additions.kill(number, moment)
                tried += 1
                ended += killed
                failed |= bool(faults)
                print(f"{of_pass}: rank {victim} killed after {1e3 * moment:.0f} ms: {'ended' if killed else 'was done'}; "
                      f"{'; '.join(faults).upper() or 'added to the same bytes'}", flush=True)
    print(f"{ended} of {tried} were ended before they were done")
    sys.exit(failed or ended == 0)


if __name__ == "__main__":
    main(*sys.argv[1:])
