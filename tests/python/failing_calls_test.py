#!/usr/bin/python3
"""failing_calls_test.py

A disk that fails under the Python package: each call of a conversion from arrays, of a step that is appended and of a picture that
is saved fails once, or from then on. The work is done, or raises one `curvisplat.Error` of one line; what is there is whole or as
it was, nothing else is left, and the interpreter goes on: it is the same one for all calls. The package is found by PYTHONPATH.
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
from failing_calls import FailingCalls, built, places  # noqa: E402

STRIDE = 13


def files_of(folder):
    return {str(path.relative_to(folder)): path.read_bytes() for path in folder.rglob("*") if path.is_file()}


class FailingCallsTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        import numpy as np
        import curvisplat
        cls.curvisplat = curvisplat
        k, j, i = np.meshgrid(*3 * [np.linspace(0, 1, 8, dtype="f4")], indexing="ij")
        cls.arrays = i.copy(), j.copy(), k.copy(), i + j
        cls.folder = pathlib.Path(os.path.realpath("."))

    def convert(self, name, **options):
        x, y, z, s = self.arrays
        self.curvisplat.convert_arrays(name, self.curvisplat.Block(x, y, z, {"s": s}), threads=1, time=0, **options)

    def append(self, name, value):
        x, y, z, s = self.arrays
        self.curvisplat.append_arrays(name, self.curvisplat.Block(x, y, z, {"s": s + value}), threads=1)

    def sweep(self, job, prepare=lambda: None):
        """Lets each call of job(work) fail that writes below the folder `work`, which prepare() has filled."""
        work = self.folder / "work"

        def begin():
            shutil.rmtree(work, ignore_errors=True)
            work.mkdir()
            prepare()
            return files_of(work)

        before = begin()
        job()
        after = files_of(work)
        self.assertNotEqual(before, after)
        failures = 0
        for error, on in ((errno.ENOSPC, 1), (errno.EIO, 0), (errno.EIO, 1)):
            for at in places(STRIDE):
                begin()
                line = None
                try:
                    with FailingCalls(work, at, on, error) as failing:
                        job()
                except self.curvisplat.Error as raised:
                    line = str(raised)
                if failing.count == 0:
                    self.assertIsNone(line)
                    self.assertEqual(files_of(work), after)
                    break
                failures += 1
                with self.subTest(at=at, on=on, error=errno.errorcode[error], line=line):
                    found = files_of(work)
                    if line is None:
                        self.assertEqual(found, after)
                        continue
                    self.assertNotIn("\n", line)
                    self.assertIn(os.strerror(error), line)
                    self.assertIn("work", line)
                    if error == errno.ENOSPC:
                        self.assertNotRegex(line, r"\.part|\.tmp")
                        self.assertIn("make room", line)
                    # What was appended to the steps cannot be cut on a disk that is gone. No manifest lists it.
                    steps = "o.splats/steps.bin"
                    if on and error == errno.EIO and found.get(steps, b"").startswith(before.get(steps, b"-")):
                        found[steps] = before[steps]
                    # Where the names cannot be put back either, it says so.
                    self.assertTrue(found == (after if "a power loss may undo" in line else before), sorted(found))
        self.assertGreater(failures, 8, "the library is not in use")
        print(f"{self.id().rpartition('.')[2]}: {failures} calls failed", flush=True)
        self.assertEqual(begin(), before)
        job()
        self.assertEqual(files_of(work), after)

    def test_a_conversion(self):
        self.sweep(lambda: self.convert("work/o.splats"))

    def test_a_conversion_that_replaces_a_cache(self):
        shutil.rmtree("old.splats", ignore_errors=True)
        self.append_to_new("old.splats")
        self.sweep(lambda: self.convert("work/o.splats", overwrite=True), lambda: shutil.copytree("old.splats", "work/o.splats"))

    def append_to_new(self, name):
        self.convert(name)
        self.append(name, 1)

    def test_a_step_that_is_appended(self):
        shutil.rmtree("steps.splats", ignore_errors=True)
        self.append_to_new("steps.splats")
        self.sweep(lambda: self.append("work/o.splats", 2), lambda: shutil.copytree("steps.splats", "work/o.splats"))

    def test_pictures(self):
        shutil.rmtree("o.splats", ignore_errors=True)
        self.convert("o.splats")
        cache = self.curvisplat.open("o.splats")
        for name in ("a.png", "a.exr"):
            picture = lambda name=name: cache.render("s", size=(32, 24)).save(f"work/{name}")  # noqa: E731
            self.sweep(picture)
            self.sweep(picture, lambda name=name: pathlib.Path("work", name).write_bytes(b"an old picture"))


if __name__ == "__main__":
    if "--loaded" in sys.argv:
        sys.argv.remove("--loaded")
        unittest.main()
    with tempfile.TemporaryDirectory() as temporary:
        library = built(temporary)
        if not library:
            print("skipped: no C compiler")
            sys.exit(77)
        pathlib.Path(temporary, "here").mkdir()
        sys.exit(subprocess.run([sys.executable, os.path.abspath(__file__), "--loaded", *sys.argv[1:]], cwd=f"{temporary}/here",
                                env={**os.environ, "LD_PRELOAD": str(library)}, check=False).returncode)
