#!/usr/bin/python3
"""few_threads_test.py

The Python package for a user who may have few processes and threads (ulimit -u), or little address space (ulimit -v): whatever it
is asked for works, or raises an exception of one line and leaves nothing; the interpreter goes on. The former limit does not bind
root, so that its test needs the right to become another user. The package is found by PYTHONPATH.
"""

import os
import pathlib
import resource
import shutil
import subprocess
import sys
import tempfile
import textwrap
import unittest

TESTS = pathlib.Path(__file__).resolve().parent.parent
sys.path[:0] = [str(TESTS / "support"), str(TESTS / "end_to_end")]
from limited_user import USER, LimitedUserTest, become_limited  # noqa: E402
from sweep import some_of  # noqa: E402

MOST_SECONDS = 120  # until the interpreter counts as stuck
MOST_PROCESSES = 23

GRID = """
import numpy as np
k, j, i = np.meshgrid(*3 * [np.linspace(0, 1, 12, dtype="f4")], indexing="ij")
"""
ARRAYS = GRID + "curvisplat.convert_arrays({}, curvisplat.Block(i.copy(), j.copy(), k.copy(), dict(s=i + j)), overwrite=True, time=0)\n"

RUN = """
import os, sys
try:
    import curvisplat
except ImportError as error:
    refused = error
else:
    before, refused = os.listdir(), None
    try:
        pass
{work}
    except curvisplat.Error as error:
        refused = error
        assert os.listdir() == before, os.listdir()
if refused:
    assert "thread" in str(refused) and "\\n" not in str(refused), refused
print("refused" if refused else "done")
"""


class FewThreadsTest(LimitedUserTest):
    @classmethod
    def setUpClass(cls):
        super().setUpClass()
        subprocess.run([sys.executable, "-c", "import curvisplat\n" + ARRAYS.format("'o.splats'")], cwd=cls.folder, check=True)

    def limited(self, work, processes):
        """The interpreter with so many processes and threads, in a folder of its own."""
        folder = self.folder / "work"
        shutil.rmtree(folder, ignore_errors=True)
        shutil.copytree(self.folder / "o.splats", folder / "a.splats")
        for path in [folder, *folder.rglob("*")]:
            os.chown(path, USER, USER)
        environment = {"PATH": os.environ["PATH"], "HOME": str(folder), "TMPDIR": str(folder), "PYTHONPATH": os.environ["PYTHONPATH"],
                       "PYTHONDONTWRITEBYTECODE": "1"}
        script = RUN.format(work=textwrap.indent(work, 8 * " "))
        try:
            return subprocess.run([sys.executable, "-c", script], cwd=folder, env=environment, capture_output=True, text=True,
                                  timeout=MOST_SECONDS, preexec_fn=lambda: become_limited(processes))
        except (PermissionError, subprocess.SubprocessError) as error:
            self.skipTest(f"another user cannot run the interpreter here: {error}")

    def test_everything_works_or_raises_one_line(self):
        works = {
            "import": "", "convert": ARRAYS.format("'b.splats'"),
            "append": GRID + "curvisplat.append_arrays('a.splats', curvisplat.Block(i.copy(), j.copy(), k.copy(), dict(s=i)))",
            "render": "curvisplat.open('a.splats').render(size=(64, 48)).save('a.png')",
            "sample": "curvisplat.open('a.splats').sample(size=16)", "points": "curvisplat.open('a.splats').points()",
            "histogram": "curvisplat.open('a.splats').histogram('s')", "view": "curvisplat.open('a.splats').view().close()"}
        for n, (name, work) in enumerate(works.items()):
            done = False
            for processes in (*some_of(range(1, MOST_PROCESSES), 9, turn=n), MOST_PROCESSES):
                with self.subTest(name, processes=processes):
                    run = self.limited(work, processes)
                    self.assertEqual(run.returncode, 0, run.stderr)
                    self.assertEqual(run.stderr, "")
                    done = run.stdout == "done\n"
                if done:
                    break
            # On machines of many cores more threads are needed.
            self.assertTrue(done or os.cpu_count() > 8, name)


class LittleAddressSpaceTest(unittest.TestCase):
    def test_it_works_or_raises(self):
        """ulimit -v: also where the libraries fit, and their threads do not."""
        work = "import curvisplat" + ARRAYS.format("'o.splats'")
        script = (f"import os\ntry:\n{textwrap.indent(work, ' ')}\n"
                  "except (ImportError, MemoryError, RuntimeError):\n assert not os.listdir()\n")
        for mebibytes in some_of(range(100, 640, 10), 13):
            with self.subTest(mebibytes=mebibytes), tempfile.TemporaryDirectory() as folder:
                run = subprocess.run([sys.executable, "-c", script], cwd=folder, capture_output=True, text=True, timeout=MOST_SECONDS,
                                     preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_AS, 2 * (mebibytes << 20,)))
                self.assertEqual(run.returncode, 0, run.stderr)


if __name__ == "__main__":
    unittest.main()
