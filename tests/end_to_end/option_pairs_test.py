#!/usr/bin/python3
"""option_pairs_test.py RUN_BY_FORK

Pairs of options, with plausible and absurd values and those at the edges of what an option takes, of each command: status 0, or 1 or
2 with one line, which names an option or its value where the usage is wrong; no signal, no hang, nothing left behind but the file that
an option names. A sample; all pairs with CURVISPLAT_WHOLE. view and bench have no display or no cache, so that they only read their
options; serve is ended once it serves.
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
FEW = 400  # pairs; where a command has fewer, each is tried several times
ABSURD = ["", "-1", "0", "nan", "1e308", "999999999999999999999", "a", "1,2", "\x1b[2J", "-", "1:1", "../x", "x" * 300]
PLAUSIBLE = ["1", "2", "0.5", "0,0,0", "30x20", "128M", "p", "auto", "x", "0:1", "1,0,0,0", "off", "red"]
NUMBERS = ["0", "-1", "nan", "-inf", "1e308", "1e-308", "5e-324", "90", "89.9999999", "360", "0x10", "1,", " 1", "+1", "1e"]
COUNTS = ["0", "1", "1024", "1025", "4294967296", "18446744073709551615", "18446744073709551616", "-1", "1.5"]
VECTORS = ["0,0,0", "1,1,1", "0,0,-1", "1e308,1e308,1e308", "1e-300,0,0", "nan,0,0", "1,2", "1,2,3,4", "1,,1"]
PLANES = ["0,0,0,1,0,0", "0,0,0,0,0,0", "1e300,0,0,1,0,0", "0,0,0,1e-200,0,0", "0,0,0,1e200,1e200,0", "nan,0,0,1,0,0", "1,2,3"]
OPACITIES = ["0", "0.5", "2", "nan", "function", "function*2", "function*", "function*nan", "function*-1", "function*1e300"]
CURVES = ["0:0,1:1", "0:0", "1:1,0:0", "0.5:0.5", "ramp", "0:2", "-1:0,2:1", "nan:0", "0:nan", "0:0,,1:1", ",".join(f"{n / 5000}:{n % 2}" for n in range(5000))]
RANGES = ["0,1", "1,0", "1,1", "1%,99%", "99%,1%", "50%,50%", "-1%,101%", "nan,1", "-inf,inf", "1e308,-1e308", "-1e308,1e308", "0,1e-320", "1%,2", "1%"]
MEMORY = ["0", "1", "1M", "64M", "1T", "999999999999T", "1.5G", "-1M", "5Q", "18446744073709551616", "K", "nanM"]
ADDRESSES = ["127.0.0.1", "0.0.0.0", "::", "::1", "localhost", "8.8.8.8", "256.0.0.1"]
COLOURS = ["#ff0000", "#FFF", "#gggggg", "#", "#ff00000", "white", "transparent"]
LENGTHS = ["3px", "0.02", "0px", "-1px", "1e30px", "nanpx", "1e300", "px", "1e-300", "1000px"]
TITLES = ["{time}", "{", "{time:.99999f}", "{time:999999d}", "{time:{time}}", "{step:n}", "{nosuch}", "x" * 5000, "\n\n", "{scalar:>1000000000}"]
FACES = ["kmin", "kmin,kmax", "block 1:k=min", "block 0:k=min", "block 99:k=min", "block 1:k=-1", "block 1:k=99999999999", "k=2", "block", "g.xyz"]
EDGES = {  # values at the edges of what an option takes, by its name
    "--size": ["1x1", "0x0", "1x16384", "65536x1", "-1x5", "12x", "3e1x4", "99999999999x99999999999"], "--range": RANGES, "--opacity-range": RANGES,
    "--tf": ["viridis_r_r", "_r", "VIRIDIS", "g.xyz", "a.splats", "/dev/null"], "--opacity": CURVES, "--gradient-opacity": CURVES,
    "--asinh": ["0,1", "0,0", "0,-1", "1e308,1e308", "0,1e-320", "0,inf"], "--opacity-asinh": ["0,1", "0,-1", "nan,1"], "--max-splats": [*COUNTS, "8M"],
    "--scale": VECTORS, "--vertical-scale": NUMBERS, "--position": VECTORS, "--focal-point": VECTORS, "--view-up": VECTORS, "--light-direction": VECTORS, "--clip-plane": PLANES,
    "--slice": PLANES, "--clip-box": ["1,0,0,1,0,1", "0,0,0,0,0,0", "nan,1,0,1,0,1", "-1e308,1e308,-1e308,1e308,-1e308,1e308", "0,1,0,1"],
    "--light": ["0.3,0.7,0.25", "2,0,0", "-1,0,0", "nan,0,0", "1,1"], "--look-at": ["0,0", "nan,0", "0,91", "1e308,0", "180,-90", "0"],
    "--shadow": NUMBERS, "--text-size": NUMBERS, "--ambient-occlusion": NUMBERS, "--from-height": NUMBERS, "--lines-time": ["past", "all", "-1", "nan", "1e308", "1e308 days"],
    "--globe": ["off", "1", "nan", "-1", "1e308"], "--background": COLOURS, "--surface-colour": COLOURS, "--lines-colour": COLOURS,
    "--surface-opacity": OPACITIES, "--slice-opacity": OPACITIES, "--iso-opacity": OPACITIES, "--lines-opacity": OPACITIES, "--title": TITLES, "--label": TITLES,
    "--marker": [*VECTORS, "0,0,0:", "0.5,0,0:a: b", ":", "0,0,0:" + "x" * 5000, "0,0,0:\n\n"],
    "--iso": ["0.5", "0,1,2", "nan", "1e308", ",".join(str(n / 1000) for n in range(1000)), ",", "0.5,", "-1e-320"], "--surface": FACES,
    "--line-width": LENGTHS, "--point-size": LENGTHS, "--steps": ["0:1", "2:0", "0:99", "0:2:0", ":", "0:", "0:2:99999999999999999999", "all:2"],
    "--path": ["none.json", "/dev/null", "g.xyz", "."], "--frames": COUNTS[:-2], "--frame-rate": [*NUMBERS, "24000/1001"], "--orbit": NUMBERS, "--zoom": NUMBERS,
    "--part": ["1/1", "0/2", "3/2", "1/0", "1/99999999999", "-1/2", "1", "/", "1/4294967296"], "--memory": MEMORY, "--card-memory": MEMORY,
    "--viewer-memory": MEMORY, "--threads": COUNTS, "--refine": ["1", "4", "auto", "0", "9", "1000000", "nan", "4294967297"], "--step": COUNTS,
    "--tmp": [".", "/nonexistent", "g.xyz", "/proc"], "--time-step": COUNTS, "--select": ["month=3", "=", "a=", "=3", "month=nan"], "--until": COUNTS,
    "--probe": [*VECTORS, "g.xyz", "/dev/null"], "--voxels": [*COUNTS, "100000"], "--channels": ["depth,depth", "none,depth", ",", "rgb"], "--port": COUNTS,
    "--listen": ADDRESSES, "--host": ["example.org", "*", "a b", "x:80", "\u00e9"], "--token-file": ["g.xyz", ".", "/dev/null", "/dev/zero", "/etc/passwd"],
    "--backend": ["cpu", "osmesa", "egl", "egl-quads"], "--frame-time": NUMBERS}
LEFT_OUT = {"--help", "--help-all", "--version", "--follow", "--output", "-o"}
TO_FILES = {"--stats", "--trace", "--write-tf", "--json", "--plot"}  # write what their values name


def run(folder, *arguments):
    environment = {name: value for name, value in os.environ.items() if name not in ("DISPLAY", "WAYLAND_DISPLAY")}
    with subprocess.Popen([program, *map(str, arguments)], cwd=folder, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE,
                          stderr=subprocess.PIPE, text=True, errors="replace", env=environment) as running:
        served = arguments[0] == "serve" and "--help" not in arguments and running.stdout.readline()
        if served:  # its address
            running.terminate()
        try:
            out, err = running.communicate(timeout=60)
        except subprocess.TimeoutExpired:
            running.kill()
            raise
    return subprocess.CompletedProcess(arguments, 0 if served and running.returncode == 128 + 15 else running.returncode, out, err)


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

    @staticmethod
    def value(chosen, name):
        kind = chosen.random()
        return chosen.choice(ABSURD if kind < 0.3 else PLAUSIBLE if kind < 0.6 or name not in EDGES else EDGES[name])

    def try_all(self, command, *inputs, otherwise=None, output=None):
        """`otherwise`: options and their values, unless they are in a pair."""
        names = [(name, bool(value)) for name, value in
                 re.findall(r"^\s+(?:-\w, ?)?(--[a-z][a-z-]*)(?:,\S+)?( [A-Z\[<({]\S*| \S*:\S*)?", run(self.folder, command, "--help").stdout, re.M)
                 if name not in LEFT_OUT]
        self.assertGreater(len(names), 2, command)
        chosen = random.Random(command)
        pairs = list(itertools.combinations(names, 2))
        pairs *= max(1, FEW // len(pairs))
        cases = [(pair, [self.value(chosen, name) for name, _ in pair]) for pair in pairs]
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
            if output is not None and done.returncode == 0:  # a.parts with --part; h.xyz, h_0000.fun of h
                asked += [path for path in left if re.match(re.escape(output) + "([._]|$)", path.name)]
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
        self.try_all("serve", "a.splats", otherwise={"--port": 0})

    def test_bench(self):
        self.try_all("bench", "missing.splats")

    def test_generate(self):
        self.try_all("generate", "wake", otherwise={"--size": "5x4x3"}, output="h")


unittest.main()
