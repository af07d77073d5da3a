#!/usr/bin/env python3
"""short_forms_test.py CURVISPLAT FOLDER

Runs the scripts that nothing else runs, in their short forms: whether they work and print what they promise. No figure
is judged.
"""
import json
import os
import pathlib
import shutil
import subprocess
import sys
import unittest

PROGRAM, FOLDER = pathlib.Path(sys.argv.pop(1)).absolute(), pathlib.Path(sys.argv.pop(1)).absolute()
SCRIPTS = pathlib.Path(__file__).resolve().parent


def output(command):
    done = subprocess.run([str(word) for word in command], capture_output=True, text=True)
    assert done.returncode == 0, f"{command}: {done.returncode}\n{done.stdout}{done.stderr}"
    return done.stdout


def run(script, *arguments):
    return output([sys.executable, SCRIPTS / script, *arguments, "--program", PROGRAM])


needs_whole = unittest.skipUnless("CURVISPLAT_WHOLE" in os.environ, "takes seconds; only with CURVISPLAT_WHOLE")


class ShortForms(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        shutil.rmtree(FOLDER, ignore_errors=True)
        FOLDER.mkdir(parents=True)

    @needs_whole
    def test_around(self):
        lines = run("around.py", FOLDER / "around", "--smoke").splitlines()[-13:]
        for line, name in zip(lines, ["plain", "lit", "six clip planes", "opaque body", "two scalars", "no depth (.exr)",
                                      "depth (.exr)"]):
            self.assertTrue(line.startswith(name), lines)
            self.assertIn("of the plain picture", line)
        self.assertRegex(lines[7], r"^opaque body +bytes read: [1-9]\d* of [1-9]\d*$")
        self.assertRegex(lines[8], r"^opaque body +splats drawn: [1-9]\d* of [1-9]\d*$")
        for line, what in zip(lines[9:], ["", ", by a scalar", ", finest", ", finest, by a scalar"], strict=True):
            self.assertRegex(line, rf"^1024 quads{what}: -?\d+ ms of processor time a frame")

    def test_window_times(self):
        for needed in ("Xvfb", "xdotool"):
            if not shutil.which(needed):
                self.skipTest(f"{needed} is not installed")
        made = FOLDER / "window"
        subprocess.run([PROGRAM, "generate", "half-annulus", "--size", "24x12x12", "-o", made], check=True, capture_output=True)
        cache = f"{made}.splats"
        subprocess.run([PROGRAM, "convert", f"{made}.xyz", f"{made}.fun", "-o", cache], check=True, capture_output=True)
        lines = run("window_times.py", cache, "--inputs", 2).splitlines()
        without_waiting = "    without waiting for a core"
        for begin, line in zip(["window on the screen after", "data on the screen after", "keys: 2 samples", without_waiting,
                                "movements: 2 samples", without_waiting, "peak memory", "closed"], lines, strict=True):
            self.assertTrue(line.startswith(begin), lines)

    def test_format_memory(self):
        grid = FOLDER / "cube.vtk"
        nodes = range(8 ** 3)
        grid.write_text("\n".join(["# vtk DataFile Version 3.0", "cube", "ASCII", "DATASET STRUCTURED_GRID", "DIMENSIONS 8 8 8",
                                   f"POINTS {len(nodes)} float", *(f"{n % 8} {n // 8 % 8} {n // 64}" for n in nodes),
                                   f"POINT_DATA {len(nodes)}", "SCALARS p float 1", "LOOKUP_TABLE default",
                                   *(str(n) for n in nodes), ""]))
        lines = run("format_memory.py", grid, "--scalar", "p", "--memory", "1G").splitlines()
        self.assertRegex(lines[-1], r"^\| cube.vtk \| 512 \| \d+\.\d \| \d+ \| 1024 \|$")

    def test_same_bytes(self):
        lines = output([SCRIPTS / "same_bytes.py", PROGRAM, PROGRAM, FOLDER / "same", "--only", "blocks", "--rounds", 1,
                        "--time", "12x10x6"]).splitlines()
        self.assertEqual(lines[0], "blocks: the same")
        self.assertRegex(lines[1], r"^old: \d+\.\d+ \+ \d+\.\d+ s, least ")

    @needs_whole
    def test_lod_pixels(self):
        made = FOLDER / "levels"
        subprocess.run([PROGRAM, "generate", "half-annulus", "--size", "64x32x32", "-o", made], check=True, capture_output=True)
        subprocess.run([PROGRAM, "convert", f"{made}.xyz", f"{made}.fun", "-o", f"{made}.splats"], check=True, capture_output=True)
        lines = run("lod_pixels.py", f"{made}.splats", "--size", "32x32", "--lod-pixels", "0,4").splitlines()
        for line, function in zip(lines[2:], ["default", "step"], strict=True):
            self.assertRegex(line, rf"^\| levels \| {function} \| \d+ splats, \S+ s \| the same "
                                   r"\| (the same|\d+\.\d dB, \d+ splats, \S+ s) \|$")

    def test_card_frames(self):
        form = [FOLDER / "card", "--sizes", "4K", "--pictures", "64x48", "--frames", 2]
        software = {one["name"] for one in json.loads(output([PROGRAM, "info", "--system", "--json"]))["backends"]
                    if one["works"] and "llvmpipe" in one["found"]}
        lines = run("card_frames.py", *form, "--backends", "osmesa,cpu").splitlines()
        if "osmesa" in software:
            self.assertRegex(lines[0], r"^osmesa: left out: draws in software \(OSMesa .*\); give --software to measure it all the same$")
        row = r"^\| 4096 \| 64x48 \| {} \| \S+ ms \| \S+ ms \| {} \| \S+ ms \| {} \| \S+ \| \S+ \| {} \|"
        self.assertRegex(lines[-1], row.format("cpu", "", "", ""))
        if "egl" not in software:
            self.skipTest("EGL does not draw in software")
        if "CURVISPLAT_WHOLE" not in os.environ:
            self.skipTest("EGL in software takes seconds")
        told = FOLDER / "card.json"
        said = run("card_frames.py", *form, "--backends", "egl,cpu", "--quick", "--json", told)
        lines = said.splitlines()
        self.assertRegex(lines[-3], row.format("cpu", "", "", ""))
        self.assertRegex(lines[-2], row.format("egl", r"\S+ ms", r"\S+ ms", r"\S+"))
        self.assertRegex(lines[-1], r"^  project \S+ ms, list \S+ ms, sort \S+ ms, paint \S+ ms; \d+ splats of stored bricks, [1-9]\d* entries, ")
        for picture in ("plain", "clip planes", "slices", "two scalars"):
            self.assertRegex(said, rf"(?m)^\| {picture} \| \d+\.\d dB \|$")
        counted = run("card_frames.py", FOLDER / "card", "--counts", "--quick", "--sizes", "8K").splitlines()
        rows = [line for line in counted if line.startswith(("| wake |", "| half-annulus, 8K |"))]
        for line, scene in zip(rows, ["wake", "half-annulus, 8K"], strict=True):
            self.assertRegex(line, rf"^\| {scene} \| \S+ M \| \S+ M \| \S+ M \| \S+ M \| (\S+, ){{4}}\S+ \| \S+, \S+ \|$")
            splats, keys, looks, blends = (float(cell.split()[0]) for cell in line.split("|")[2:6])
            self.assertTrue(0 < splats < keys and 0 < blends < looks <= 16 * keys, line)
        names = {one["name"]: len(one["samples"]) for one in json.loads(told.read_text())["measurements"]}
        self.assertEqual(names["card_frames/gl_draw/splats:4K/picture:64x48/backend:egl"], 2)
        self.assertNotIn("card_frames/gl_draw/splats:4K/picture:64x48/backend:cpu", names)

    def test_many_steps(self):
        lines = output([SCRIPTS / "many_steps.py", FOLDER / "many", "--steps", 20, "--program", PROGRAM]).splitlines()
        self.assertRegex(lines[0], r"^20 steps: manifest.json \d+ KiB, steps.bin \d+ KiB$")
        self.assertRegex(lines[1], r"^drawing one step: \S+ s of processors with 3 steps, \S+ s with 20$")

    def test_page_times(self):
        made = FOLDER / "page"
        subprocess.run([PROGRAM, "generate", "half-annulus", "--size", "24x12x12", "-o", made], check=True, capture_output=True)
        subprocess.run([PROGRAM, "convert", f"{made}.xyz", f"{made}.fun", "-o", f"{made}.splats"], check=True, capture_output=True)
        line = output([SCRIPTS / "page_times.py", f"{made}.splats", "--seconds", 0.5, "--size", "64x48", "--program", PROGRAM])
        self.assertRegex(line, r"^first picture after .* pictures a second; .* of [1-9]\d* splats$")


if __name__ == "__main__":
    unittest.main()
