#!/usr/bin/python3
"""failing_calls_test.py CURVISPLAT

Files that libraries and other programs write for curvisplat, OpenVDB's and ffmpeg's, on a disk that fails: each call that writes
fails once, or from then on. The file is right, or the old one is there, with one line and status 1; nothing else is left. (Calls of
curvisplat's own are tested by tests/faults.)
"""
import errno
import os
import pathlib
import shutil
import subprocess
import sys
import tempfile
import unittest

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent.parent / "support"))
from failing_calls import built, places  # noqa: E402

from sweep import some_of  # noqa: E402

PROGRAM = str(pathlib.Path(sys.argv.pop(1)).resolve())
STRIDE = 17
KINDS = (errno.ENOSPC, 1), (errno.EIO, 0), (errno.EIO, 1)  # the error, and whether all calls from then on fail


def without_random_number(name, data):
    """OpenVDB gives each file one, of 36 digits after 21 bytes."""
    return data[:21] + data[57:] if name.endswith(".vdb") else data


class FailingCalls(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        temporary = tempfile.TemporaryDirectory(prefix="curvisplat_calls_")
        cls.addClassCleanup(temporary.cleanup)
        cls.folder = pathlib.Path(os.path.realpath(temporary.name))
        cls.library = built(cls.folder)
        if not cls.library:
            raise unittest.SkipTest("no C compiler")
        for words in (["generate", "o-grid", "--size", "12x10x8", "-o", "o"], ["convert", "o.xyz", "o.fun", "-o", "o.splats"]):
            subprocess.run([PROGRAM, *words], cwd=cls.folder, capture_output=True, check=True)

    def sweep(self, name, kinds, *words):
        work, report = self.folder / "work", self.folder / "report"

        def run(**environment):
            shutil.rmtree(work, ignore_errors=True)
            work.mkdir()
            (work / name).write_bytes(b"an old file")
            report.unlink(missing_ok=True)
            done = subprocess.run([PROGRAM, *words, "-o", f"work/{name}"], cwd=self.folder, capture_output=True, text=True,
                                  env={**os.environ, **environment}, timeout=120, check=False)
            return done, {path.name: without_random_number(path.name, path.read_bytes()) for path in work.iterdir()}

        done, after = run()
        self.assertEqual((done.returncode, list(after)), (0, [name]), done.stderr)
        failures = 0
        for error, on in kinds:
            for at in places(STRIDE):
                done, found = run(LD_PRELOAD=str(self.library), FAULTS_FOLDER=str(work), FAULTS_AT=str(at), FAULTS_ON=str(on),
                                  FAULTS_ERROR=str(error), FAULTS_REPORT=str(report))
                if not any(map(int, report.read_text().split())):
                    self.assertEqual((done.returncode, found), (0, after), done.stderr)
                    break
                failures += 1
                with self.subTest(at=at, on=on, error=errno.errorcode[error], said=done.stderr):
                    if done.returncode == 0:
                        self.assertEqual(found, after)
                        continue
                    self.assertEqual(done.returncode, 1)
                    lines = [line for line in done.stderr.splitlines() if "note: " not in line]
                    self.assertEqual(len(lines), 1)
                    self.assertIn("work", lines[0])
                    if error == errno.ENOSPC:
                        self.assertNotIn(".part", lines[0])
                        self.assertIn("make room" if name.endswith(".vdb") else os.strerror(error), lines[0])
                    old = {name: without_random_number(name, b"an old file")}
                    self.assertTrue(found == (after if "a power loss may undo" in lines[0] else old), sorted(found))
        print(f"{name}: {failures} calls failed", flush=True)
        self.assertGreater(failures, 2 * len(kinds), "the library is not in use")

    def test_a_vdb_file(self):
        self.sweep("a.vdb", KINDS, "export", "o.splats", "--voxels", "24")

    def test_movies(self):
        if not shutil.which("ffmpeg"):
            self.skipTest("ffmpeg is not installed")
        for turn, name in enumerate(("a.mp4", "a.gif")):
            self.sweep(name, some_of(KINDS, 2, turn=turn), "render", "o.splats", "--orbit", "30", "--frames", "3", "--size", "32x24", "--threads", "1")


if __name__ == "__main__":
    unittest.main()
