#!/usr/bin/python3
"""early_signals_test.py CURVISPLAT

Signals before there is anything to show: in the first 0.12 s of each command (some are done by then), and while `info` reads a
sparse grid of 192 GB, which shows how far it has come. Also while `generate` writes, `bench` converts and `export` compares.
"""
import os
import pathlib
import pty
import select
import shutil
import signal
import struct
import subprocess
import sys
import tempfile
import time
import unittest

from sweep import some_of

PROGRAM = str(pathlib.Path(sys.argv.pop(1)).resolve())
MOST_SECONDS = 240  # until the machine counts as stuck


class EarlySignals(unittest.TestCase):
    def setUp(self):
        temporary = tempfile.TemporaryDirectory(prefix="curvisplat_signals_")
        self.addCleanup(temporary.cleanup)
        self.folder = pathlib.Path(temporary.name)
        (self.folder / "temporary").mkdir()
        self.environment = {**os.environ, "TMPDIR": str(self.folder / "temporary"), "XDG_CACHE_HOME": str(self.folder / "kept")}

    def run_program(self, *words):
        return subprocess.run([PROGRAM, *words], cwd=self.folder, env=self.environment, capture_output=True, text=True, check=True)

    def files(self):
        """All files but those that are kept for the next run."""
        return sorted(str(path.relative_to(self.folder)) for path in self.folder.rglob("*") if "kept" not in path.parts)

    def assert_same_caches(self, one, other):
        contents = [{path.name: path.read_bytes() for path in (self.folder / cache).iterdir()} for cache in (one, other)]
        self.assertEqual(contents[0].keys(), contents[1].keys())
        self.assertEqual([name for name in contents[0] if contents[0][name] != contents[1][name]], [])

    def test_info_of_a_sparse_grid_shows_its_progress_and_can_be_stopped(self):
        side = 2000
        with (self.folder / "sparse.xyz").open("wb") as file:
            file.write(struct.pack("<3i", side, side, side))
            try:
                file.truncate(12 + 24 * side**3)
            except OSError as error:
                self.skipTest(f"no sparse file of 192 GB here: {error}")
        before = self.files()
        ours, theirs = pty.openpty()
        self.addCleanup(os.close, ours)
        program = subprocess.Popen([PROGRAM, "info", "sparse.xyz"], cwd=self.folder, env=self.environment, stdout=subprocess.PIPE,
                                   stderr=theirs, text=True)
        os.close(theirs)
        self.addCleanup(program.stdout.close)
        self.addCleanup(program.kill)
        shown = b""
        while not (b"reading" in shown and b"s left" in shown):
            self.assertTrue(select.select([ours], [], [], MOST_SECONDS)[0], f"shows nothing: {shown}")
            shown += os.read(ours, 4096)
        program.send_signal(signal.SIGINT)
        self.assertIn(program.wait(MOST_SECONDS), (-signal.SIGINT, 128 + signal.SIGINT))
        self.assertEqual(self.files(), before)

    def test_a_signal_as_early_as_it_may_come_leaves_nothing(self):
        """Until the work has begun the system ends the program; from then on the program ends in order. A shell sees one status.
        A conversion that is done with its first pass by then keeps it, says so, and can be resumed."""
        self.run_program("generate", "o-grid", "--size", "40x30x20", "-o", "o")
        self.run_program("convert", "o.xyz", "o.fun", "-o", "whole.splats")
        before = self.files()
        commands = (["convert", "o.xyz", "o.fun", "-o", "new.splats"], ["render", "whole.splats", "-o", "new.png", "--size", "64x48"],
                    ["info", "o.xyz", "o.fun"])
        moments = [(milliseconds, number)
                   for milliseconds in (0, 1, 2, 5, 10, 15, 20, 25, 30, 35, 40, 45, 50, 60, 70, 80, 90, 100, 110, 120)
                   for number in (signal.SIGTERM, signal.SIGINT, signal.SIGHUP)]
        ended_early = 0
        for n, command in enumerate(commands):
            for milliseconds, number in some_of(moments, 7, turn=n):
                with self.subTest(" ".join(command), milliseconds=milliseconds, signal=number.name):
                    program = subprocess.Popen([PROGRAM, *command], cwd=self.folder, env=self.environment, stdout=subprocess.PIPE,
                                               stderr=subprocess.PIPE, text=True)
                    time.sleep(milliseconds / 1000)
                    program.send_signal(number)
                    message = program.communicate(timeout=MOST_SECONDS)[1]
                    done = program.returncode == 0
                    if not done:
                        self.assertIn(program.returncode, (-number, 128 + number), message)
                        self.assertLessEqual(message.count("curvisplat: "), 1 if program.returncode > 0 else 0, message)
                        ended_early += 1
                    resumes = not done and "--resume" in message
                    if resumes:
                        self.run_program(*command, "--resume")
                    if resumes or done and command[0] == "convert":
                        self.assert_same_caches("whole.splats", "new.splats")
                        shutil.rmtree(self.folder / "new.splats")
                    elif done:
                        (self.folder / "new.png").unlink(missing_ok=True)
                    self.assertEqual(self.files(), before)
        print(f"{ended_early} runs ended by a signal", flush=True)
        self.assertGreater(ended_early, 10)

    def stopped(self, words, begun, by=signal.SIGINT):
        """Sends a signal once begun() is true. The status and the message."""
        program = subprocess.Popen([PROGRAM, *words], cwd=self.folder, env=self.environment, stdout=subprocess.PIPE,
                                   stderr=subprocess.PIPE, text=True)
        self.addCleanup(program.kill)
        deadline = time.monotonic() + MOST_SECONDS
        while not begun() and program.poll() is None:
            self.assertLess(time.monotonic(), deadline)
            time.sleep(0.001)
        program.send_signal(by)
        message = program.communicate(timeout=MOST_SECONDS)[1]
        return program.returncode, message

    def test_generate_that_is_stopped_leaves_nothing(self):
        for further in ([], ["--steps", "3"]):
            status, message = self.stopped(["generate", "wake", "--size", "400x300x100", "-o", "g", *further],
                                           lambda: list(self.folder.glob(".curvisplat.*.part")))
            self.assertEqual(status, 128 + signal.SIGINT, message)
            self.assertEqual(message.count("\n"), 1, message)
            self.assertEqual(self.files(), ["temporary"])

    def test_generate_removes_what_a_killed_one_left(self):
        unfinished = lambda: list(self.folder.glob(".curvisplat.*.part"))
        self.stopped(["generate", "wake", "--size", "400x300x100", "-o", "g"], unfinished, signal.SIGKILL)
        self.assertTrue(unfinished())
        subprocess.run([PROGRAM, "generate", "wake", "--size", "4x4x4", "-o", "h"], cwd=self.folder, check=True,
                       env=self.environment, stdout=subprocess.DEVNULL)
        self.assertEqual(self.files(), ["h.fun", "h.nam", "h.xyz", "temporary"])

    def test_bench_that_is_stopped_does_not_offer_to_go_on(self):
        status, message = self.stopped(["bench", "--convert", "--nodes", "2M", "--tmp", "temporary"],
                                       lambda: any(path.stat().st_size > 0
                                                   for path in self.folder.glob("temporary/*/grid.splats.partial/geometry.bin")))
        self.assertEqual(status, 128 + signal.SIGINT, message)
        self.assertNotIn("--resume", message)
        self.assertEqual(self.files(), ["temporary"])

    def test_an_export_that_is_stopped_while_it_is_compared_is_complete_and_says_so(self):
        self.run_program("generate", "o-grid", "--size", "40x30x20", "-o", "o")
        self.run_program("convert", "o.xyz", "o.fun", "-o", "o.splats")
        self.run_program("export", "o.splats", "-o", "whole.ply", "--no-comparison")
        status, message = self.stopped(["export", "o.splats", "-o", "a.ply"], (self.folder / "a.ply").exists)
        self.assertEqual(status, 128 + signal.SIGINT, message)
        self.assertIn("a.ply: is complete", message)
        self.assertEqual((self.folder / "a.ply").read_bytes(), (self.folder / "whole.ply").read_bytes())


if __name__ == "__main__":
    # What a shell starts in the background, or nohup, ignores these, and so would what is started here.
    signal.signal(signal.SIGINT, signal.default_int_handler)
    signal.signal(signal.SIGHUP, signal.SIG_DFL)
    unittest.main()
