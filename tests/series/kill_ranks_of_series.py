#!/usr/bin/env python3
"""Kills one rank of conversions of series by three ranks, in their rounds of steps, and looks at what is left.

    kill_ranks_of_series.py PROGRAM [KILLS [SIZE [STEPS]]]

KILLS of each of: convert and convert --add-steps, on a fixed grid and on one that moves; without KILLS, usually one of the former on the fixed
and of the latter on the other, with CURVISPLAT_WHOLE (tools/test.sh --whole) 20 of all; at moments spread over the
time that an undisturbed run takes. After each the job must end, the cache, if there is one, must verify, and --resume by 1 to 4 ranks
must complete it to the files of one process. Prints a line for each; exit status 1 if anything was wrong, 77 without mpirun.
"""
import os
import pathlib
import random
import shutil
import signal
import subprocess
import sys
import tempfile
import time

from kill_series import IS_WHOLE, USUAL_KILLS, Series, digests

MPIRUN = ["mpirun", "--oversubscribe", "--allow-run-as-root", "--bind-to", "none", "-q", "-n"]
RANKS = 3


def ranks_of(pid, program):
    """The processes below `pid` that run the program."""
    found = []
    for child in pathlib.Path(f"/proc/{pid}/task/{pid}/children").read_text().split():
        try:
            own = os.readlink(f"/proc/{child}/exe") == program
            found += [int(child)] if own else ranks_of(child, program)
        except OSError:
            pass  # has ended
    return found


def living(pids):
    """Those of `pids` that have not ended; one that its parent has not yet asked for (a zombie) has."""
    found = []
    for pid in pids:
        try:
            state = pathlib.Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0]
        except OSError:
            continue
        if state not in "XZ":
            found.append((pid, state))
    return found


class RanksOfSeries(Series):
    def by_ranks(self, count, command):
        return [str(word) for word in (*MPIRUN, count, self.program, *command, "--threads", "1", "--memory", "256M")]

    def undisturbed(self, command):
        start = time.monotonic()
        subprocess.run(self.by_ranks(RANKS, command), check=True, capture_output=True)
        return time.monotonic() - start

    def killed(self, command, moment):
        """Whether a rank was killed before the job was done, and what else is worth saying of its end.

        Open MPI's launcher sleeps for ever, now and then, when a rank dies within MPI_Init: once all ranks have ended, it is killed.
        """
        with subprocess.Popen(self.by_ranks(RANKS, command), stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL) as job:
            try:
                job.wait(timeout=moment)
                return False, ""
            except subprocess.TimeoutExpired:
                pass
            ranks = ranks_of(job.pid, self.program)
            if ranks:
                try:
                    os.kill(random.choice(ranks), signal.SIGKILL)
                except ProcessLookupError:
                    pass
            try:
                return job.wait(timeout=60) != 0, ""
            except subprocess.TimeoutExpired:
                left = living({*ranks, *ranks_of(job.pid, self.program)})
                job.kill()
                for pid, _ in left:
                    os.kill(pid, signal.SIGKILL)
                if left:
                    raise SystemExit(f"ranks did not end within a minute: {left}") from None
                return True, " (all ranks ended, their launcher did not)"


def main(program, kills=USUAL_KILLS, size="28x24x12", steps=8):
    if not shutil.which("mpirun") or not (pathlib.Path(program).parent / "curvisplat-mpi.so").exists():
        print("skipped: no mpirun (Debian: openmpi-bin), or built without MPI")
        sys.exit(77)
    program, kills = str(pathlib.Path(program).resolve()), int(kills)
    random.seed(7)
    failed = killed = tried = 0
    for moving in (False, True):
        with tempfile.TemporaryDirectory() as name:
            series = RanksOfSeries(program, pathlib.Path(name), moving, size, int(steps))
            series.run("convert", *series.whole, "-o", series.cache)
            wanted = digests(series.cache)
            for job, command in series.commands().items():
                if job == "follow" or (moving != (job == "add") and len(sys.argv) < 3 and not IS_WHOLE):
                    continue  # the former is one process
                series.prepare(job)
                duration = series.undisturbed(command)
                faults = [] if digests(series.cache) == wanted else [f"{job} gives other bytes"]
                for n in range(kills):
                    series.prepare(job)
                    moment = duration * (n + random.random()) / kills
                    tried += 1
                    ended, remark = series.killed(command, moment)
                    killed += ended
                    left = series.found_steps()
                    resuming = random.randint(1, 4)
                    # What was to be added may not have a cache of its own: the whole is resumed.
                    result = subprocess.run(series.by_ranks(resuming, ["convert", *series.whole, "--resume", "-o", series.cache]),
                                            check=False, capture_output=True, text=True)
                    if result.returncode:
                        faults.append(result.stderr.strip())
                    elif digests(series.cache) != wanted:
                        faults.append("resumed, it has other files")
                    if list(series.cache.parent.glob("a.splats?*")):
                        faults.append("something lies beside the cache")
                    print(f"{'moving' if moving else 'fixed'} {job}: a rank killed after {moment:.3f} of {duration:.3f} s{remark}: "
                          f"{left} steps left; by {resuming}: {'; '.join(faults).upper() or 'resumed to the same bytes'}", flush=True)
                    failed |= bool(faults)
                    faults = []
    print(f"{killed} of {tried} were ended before they were done")
    sys.exit(failed or killed == 0)


if __name__ == "__main__":
    main(*sys.argv[1:])
