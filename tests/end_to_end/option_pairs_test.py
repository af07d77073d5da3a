#!/usr/bin/python3
"""option_pairs_test.py RUN_BY_FORK

Pairs of options, with plausible and absurd values, of each command: status 0, or 1 or 2 with one line, which names an option or
its value where the usage is wrong; no signal, no hang, nothing left behind. A
sample; all pairs with CURVISPLAT_WHOLE.
"""
import itertools
import os
import pathlib
import random
import re
import subprocess
import sys
import tempfile
import unittest

program = str(pathlib.Path(sys.argv.pop(1)).resolve())
SAMPLE = 40  # runs of each command
ABSURD = ["", "-1", "0", "nan", "1e308", "999999999999999999999", "a", "1,2", "\x1b[2J", "-", "1:1", "../x", "x" * 300]
PLAUSIBLE = ["1", "2", "0.5", "0,0,0", "30x20", "128M", "p", "auto", "x", "0:1", "1,0,0,0", "off", "red"]
LEFT_OUT = {"--help", "--help-all", "--version", "--follow", "--output", "-o", "--tmp", "--stats", "--trace", "--port", "--write-tf", "--threads",
            "--size", "--frames", "--fps", "--voxels", "--no-preflight", "--resume", "--overwrite"}


def run(folder, *arguments):
    return subprocess.run([program, *map(str, arguments)], cwd=folder, capture_output=True, text=True, errors="replace", timeout=60,
                          stdin=subprocess.DEVNULL)


class OptionPairs(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.temporary = tempfile.TemporaryDirectory()
        cls.addClassCleanup(cls.temporary.cleanup)
        cls.folder = pathlib.Path(cls.temporary.name)
        for command in (["generate", "half-annulus", "--size", "5x4x3", "-o", "g"], ["convert", "g.xyz", "g.fun", "-o", "a.splats"]):
            done = run(cls.folder, *command)
            assert done.returncode == 0, done.stderr

    def try_all(self, command, *inputs, output=None):
        names = [(name, bool(value)) for name, value in
                 re.findall(r"^\s+(?:-\w, ?)?(--[a-z][a-z-]*)(?:,\S+)?( [A-Z\[<({]\S*| \S*:\S*)?", run(self.folder, command, "--help").stdout, re.M)
                 if name not in LEFT_OUT]
        self.assertGreater(len(names), 2, command)
        chosen = random.Random(command)
        pairs = list(itertools.combinations(names, 2))
        cases = [(pair, [chosen.choice(ABSURD if chosen.random() < 0.5 else PLAUSIBLE) for _ in pair]) for pair in pairs]
        if "CURVISPLAT_WHOLE" not in os.environ:
            cases = chosen.sample(cases, min(SAMPLE, len(cases)))
        before = set(self.folder.iterdir())
        for number, (pair, values) in enumerate(cases):
            words = [f"{name}={value}" if has_value else name for (name, has_value), value in zip(pair, values)]
            target = [] if output is None else ["-o", output]
            done = run(self.folder, command, *inputs, *words, *target)
            told = f"{command} {words}: {done.returncode} {done.stderr[:600]!r}"
            self.assertIn(done.returncode, (0, 1, 2), told)
            if done.returncode:
                errors = [line for line in done.stderr.splitlines() if not line.startswith(("curvisplat: note:", "curvisplat: warning:"))]
                self.assertEqual(len(errors), 1, told)
                self.assertTrue(errors[0].startswith("curvisplat: "), told)
                self.assertNotIn("\x1b", done.stderr, told)
                if done.returncode == 2:
                    said = [text for (name, _), value in zip(pair, values) for text in (name, value.strip("\x1b")) if text]
                    self.assertTrue(re.search("--[a-z]|: -o ", done.stderr) or any(text in done.stderr for text in said), told)
            left = set(self.folder.iterdir()) - before
            if output is not None and done.returncode == 0:
                left.discard(self.folder / output)
            self.assertEqual({path.name for path in left}, set(), told)
            for path in set(self.folder.iterdir()) - before:
                subprocess.run(["rm", "-rf", path], check=True)

    def test_render(self):
        self.try_all("render", "a.splats", "--size", "16x12", "--threads", "1", output="a.png")

    def test_convert(self):
        self.try_all("convert", "g.xyz", "g.fun", "--threads", "1", output="b.splats")

    def test_info(self):
        self.try_all("info", "a.splats")

    def test_info_of_a_grid(self):
        self.try_all("info", "g.xyz", "g.fun")

    def test_export(self):
        self.try_all("export", "a.splats", output="a.ply")

    def test_generate(self):
        self.try_all("generate", "wake", "--size", "5x4x3", output="h")


unittest.main()
