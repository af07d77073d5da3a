#!/usr/bin/python3
"""option_pairs_test.py RUN_BY_FORK

Pairs of options, with plausible and absurd values, of each command: status 0, or 1 or 2 with one line, which names an option or
its value where the usage is wrong; no signal, no hang, nothing left behind but the file that an option names. A sample; all
pairs with CURVISPLAT_WHOLE. view, serve and bench have no display or no cache, so that they only read their options.
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
LEFT_OUT = {"--help", "--help-all", "--version", "--follow", "--output", "-o"}
TO_FILES = {"--stats", "--trace", "--write-tf", "--json", "--plot"}  # write what their values name


def run(folder, *arguments):
    environment = {name: value for name, value in os.environ.items() if name not in ("DISPLAY", "WAYLAND_DISPLAY")}
    return subprocess.run([program, *map(str, arguments)], cwd=folder, capture_output=True, text=True, errors="replace", timeout=60,
                          stdin=subprocess.DEVNULL, env=environment)


class OptionPairs(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.temporary = tempfile.TemporaryDirectory()
        cls.addClassCleanup(cls.temporary.cleanup)
        cls.folder = pathlib.Path(cls.temporary.name) / "work"  # values such as ../x stay within the temporary folder
        cls.folder.mkdir()
        for command in (["generate", "half-annulus", "--size", "5x4x3", "-o", "g"], ["convert", "g.xyz", "g.fun", "-o", "a.splats"]):
            done = run(cls.folder, *command)
            assert done.returncode == 0, done.stderr

    def try_all(self, command, *inputs, otherwise=None, output=None):
        """`otherwise`: options and their values, unless they are in a pair."""
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
        outside = set(self.folder.parent.iterdir())
        for pair, values in cases:
            words = [f"{name}={value}" if has_value else name for (name, has_value), value in zip(pair, values)]
            words += [f"{name}={value}" for name, value in (otherwise or {}).items() if name not in dict(pair)]
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
            left = (set(self.folder.iterdir()) - before) | (set(self.folder.parent.iterdir()) - outside)
            # Even of a run that fails. After "--trace=" the next word is the value.
            asked = [path for (name, _), value in zip(pair, values) if name in TO_FILES for path in ([value] if value else words + target)]
            if output is not None and done.returncode == 0:
                asked.append(output)
            new = left - {(self.folder / path).parent.resolve() / pathlib.Path(path).name for path in asked}
            self.assertEqual({path.name for path in new}, set(), told)
            for path in left:
                subprocess.run(["rm", "-rf", path], check=True)

    def test_render(self):
        self.try_all("render", "a.splats", otherwise={"--size": "16x12", "--threads": 1}, output="a.png")

    def test_convert(self):
        self.try_all("convert", "g.xyz", "g.fun", otherwise={"--threads": 1}, output="b.splats")

    def test_info(self):
        self.try_all("info", "a.splats")

    def test_info_of_a_grid(self):
        self.try_all("info", "g.xyz", "g.fun")

    def test_export(self):
        self.try_all("export", "a.splats", output="a.ply")

    def test_view(self):
        self.try_all("view", "a.splats")

    def test_serve(self):
        self.try_all("serve", "missing.splats")

    def test_bench(self):
        self.try_all("bench", "missing.splats")

    def test_generate(self):
        self.try_all("generate", "wake", otherwise={"--size": "5x4x3"}, output="h")


unittest.main()
