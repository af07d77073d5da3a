#!/usr/bin/python3
"""The Python package: its pictures are those of the command, arrays become the caches that files become, and errors,
interrupts and memory are as its pages say.

    python_test.py PROGRAM    the curvisplat program; the package is found by PYTHONPATH
"""

import inspect
import json
import os
import pathlib
import re
import shlex
import shutil
import signal
import subprocess
import sys
import tempfile
import threading
import time
import unittest
import urllib.request

import numpy as np

import curvisplat

PROGRAM = None
IS_WHOLE = "CURVISPLAT_WHOLE" in os.environ
# A view and a function: choosing them from the data takes longer than the picture.
KNOWN = {"view": "iso", "opacity": [(0, 0), (1, 0.5)], "opacity_unit": 0.5}
KNOWN_WORDS = ("--view", "iso", "--opacity", "0:0,1:0.5", "--opacity-unit", 0.5)
RENDERS, INTERRUPTS = (100, 20) if IS_WHOLE else (12, 6)  # whose memory must not add up


def command(*words):
    return subprocess.run([PROGRAM, *map(str, words)], check=True, capture_output=True, text=True)


def bent_duct(nk=12, nj=10, ni=40):
    """Positions and a scalar of shape (nk, nj, ni)."""
    k, j, i = np.meshgrid(np.linspace(0, 1, nk), np.linspace(1, 2, nj), np.linspace(0, 1.5, ni), indexing="ij")
    return j * np.cos(i), j * np.sin(i), k, (300 + 50 * np.sin(6 * i) * j).astype(np.float32)


class PythonTest(unittest.TestCase):
    """Each class has a folder of its own, with a copy of one wake and its cache."""
    made = None

    @classmethod
    def setUpClass(cls):
        if PythonTest.made is None:
            PythonTest.made = tempfile.TemporaryDirectory()
            wake = pathlib.Path(PythonTest.made.name, "wake")
            command("generate", "wake", "--size", "48x40x24", "-o", wake)
            curvisplat.convert(wake.with_suffix(".splats"), wake.with_suffix(".xyz"), [wake.with_suffix(".fun")], refine=1)
        cls.folder_holder = tempfile.TemporaryDirectory()
        cls.folder = pathlib.Path(cls.folder_holder.name)
        shutil.copytree(PythonTest.made.name, cls.folder, dirs_exist_ok=True)
        cls.cache = cls.folder / "wake.splats"

    @classmethod
    def tearDownClass(cls):
        cls.folder_holder.cleanup()

    def drawn(self, *options):
        """The command's picture, in float."""
        path = self.folder / "command.pfm"
        command("render", self.cache, "-o", path, "--size", "160x120", *options)
        return read_pfm(path)

    def expect_same(self, picture, *options):
        np.testing.assert_array_equal(np.asarray(picture)[..., :3], self.drawn(*options))


def read_pfm(path):
    data = path.read_bytes()
    kind, size, scale, pixels = data.split(b"\n", 3)
    assert kind == b"PF" and float(scale) < 0
    width, height = map(int, size.split())
    return np.frombuffer(pixels, "<f4").reshape(height, width, 3)[::-1]


class Pictures(PythonTest):
    def test_are_those_of_the_command(self):
        with curvisplat.open(self.cache) as cache:
            size = (160, 120)
            self.expect_same(cache.render(size=size))
            self.expect_same(cache.render(size=size, view="+x", colours="inferno", range=(0.0, 0.7)),
                             "--view", "+x", "--tf", "inferno", "--range", "0.0,0.7")
            name = cache.scalars[0].name
            self.expect_same(
                cache.render(name, size=size, range="1%,99%", opacity=[(0, 0), (0.5, 0.8), (1, 0.1)],
                             opacity_unit=0.25, position=(20, -9, 8), focal_point=(4, 0, 2), view_angle=35,
                             background="black", lod_pixels=2, shade=True, light_direction=(1, 0, 1), shadow=0.5,
                             ambient_occlusion=0.25),
                "--scalar", name, "--range", "1%,99%", "--opacity", "0:0,0.5:0.8,1:0.1", "--opacity-unit", 0.25,
                "--position", "20,-9,8", "--focal-point", "4,0,2", "--view-angle", 35, "--background", "black",
                "--lod-pixels", 2, "--shade", "--light-direction", "1,0,1", "--shadow", 0.5, "--ambient-occlusion", 0.25)
            self.expect_same(cache.render(size=size, azimuth=30, elevation=-10.5, roll=5, zoom=1.5, gradient_opacity=[(0, 0), (0.5, 1)]),
                             "--azimuth", 30, "--elevation=-10.5", "--roll", 5, "--zoom", 1.5, "--gradient-opacity", "0:0,0.5:1")
            lines = self.folder / "lines.csv"
            lines.write_text("x,y,z,speed\n0,0,0,1\n6,0.5,2,3\n")
            self.expect_same(cache.render(size=size, lines=lines, points=[str(lines)], lines_by="speed", line_width=0.1, point_size="9px",
                                          lines_opacity=0.5, title="{scalar} {step}", label="t = {time:.1f}"),
                             "--lines", lines, "--points", lines, "--lines-by", "speed", "--line-width", 0.1, "--point-size", "9px",
                             "--lines-opacity", 0.5, "--title", "{scalar} {step}", "--label", "t = {time:.1f}")
            lines.write_text("lon,lat,time\n0,10,0\n60,20,3\n")
            self.expect_same(cache.render(size=size, lines=lines, lines_time=2.5, globe=(5, 2), look_at=(10, 20.5), from_height=8, axes_grid=True,
                                          map="#204060", map_height=-0.5),
                             "--lines", lines, "--lines-time", 2.5, "--globe", "5,2", "--look-at", "10,20.5", "--from-height", 8,
                             "--axes-grid", "--map", "#204060", "--map-height=-0.5")
            self.expect_same(cache.render(size=size, camera=curvisplat.Camera((20, -9, 8)), zoom=2), "--position", "20,-9,8",
                             "--focal-point", "0,0,0", "--zoom", 2)
            self.expect_same(
                cache.render(size=size, view="iso", clip_planes=[(4, 0, 0, 1, 0, 0), (0, 0, 1, 0, 0, 1)],
                             clip_box=(0, 9, -9, 9, -9, 9), scale=(1, 1, 2), memory=256 << 20, threads=1),
                "--view", "iso", "--clip-plane", "4,0,0,1,0,0", "--clip-plane", "0,0,1,0,0,1", "--clip-box",
                "0,9,-9,9,-9,9", "--scale", "1,1,2")
            self.expect_same(cache.render(size=size, view="iso", vertical_scale=3), "--view", "iso", "--vertical-scale", 3)

    def test_have_every_option_of_the_command(self):
        own_names = {"-o": "", "tf": "colours", "clip-plane": "clip_planes", "surface": "surfaces", "surface-colour": "surface_colours",
                     "slice": "slices", "iso": "isovalues", "scalar-bar-title": "scalar_bar_titles", "marker": "markers"}
        # Of grids, of several frames (orbit() has their cameras), of files; and what is not drawn unless it is asked for.
        others = {"help", "help-all", "value-precision", "output", "steps", "orbit", "path", "frames", "frame-rate", "part", "first-image",
                  "stats", "trace", "no-scalar-bar"}
        told = command("render", "--help").stdout
        options = set(re.findall(r"--([a-z-]+)", told.split("\n", 1)[1]))
        listed = {name for name in options - others if f"  --{name} " in told}
        parameters = set(inspect.signature(curvisplat.Cache.render).parameters)
        missing = {name for name in listed if own_names.get(name, name.replace("-", "_")) not in parameters}
        self.assertEqual(missing, set())
        self.assertGreater(len(listed), 40)

    def test_of_two_scalars_are_the_commands(self):
        self.cache = self.folder / "two.splats"  # for expect_same()
        curvisplat.convert(self.cache, self.folder / "wake.xyz", [self.folder / "wake.fun"], scalars=["f", "volume"], refine=1)
        with curvisplat.open(self.cache) as cache:
            two, one = (scalar.name for scalar in cache.scalars[:2])
            middle = (cache.scalars[0].min + cache.scalars[0].max) / 2
            self.expect_same(cache.render(one, size=(160, 120), opacity_by=two, opacity_range=(0.1, 0.9), opacity=[(0, 0), (1, 0.7)],
                                          isovalues=middle, iso_by=two, iso_opacity=0.5, iso_colour="#ff8000",
                                          classify="flat", view="iso", opacity_unit=0.5),
                             "--scalar", one, "--opacity-by", two, "--opacity-range", "0.1,0.9", "--opacity", "0:0,1:0.7", "--iso", repr(middle),
                             "--iso-by", two, "--iso-opacity", 0.5, "--iso-colour", "#ff8000", "--classify", "flat", "--view", "iso",
                             "--opacity-unit", 0.5)
            with self.assertWarnsRegex(UserWarning, f"of {two} is finer than its stored values"):
                cache.render(one, size=(16, 12), opacity_by=two, opacity_range=(0.5, 0.50001), **KNOWN)
            self.expect_same(cache.render(one, size=(160, 120), isovalues={two: middle}, **KNOWN), *KNOWN_WORDS, "--scalar", one,
                             "--iso", f"{two}={middle!r}")
            both = cache.render(one, size=(160, 120), opacity_by=two, **KNOWN)
            self.expect_same(both, *KNOWN_WORDS, "--scalar", one, "--opacity-by", two)
            self.expect_same(cache.render(two, size=(160, 120)), "--scalar", two)
            np.testing.assert_array_equal(cache.render(one, size=(160, 120), opacity_by=two, **KNOWN), both)
            self.expect_same(cache.render(one, size=(160, 120), surfaces=["kmin", "jmax"], surface_opacity=0.25, volume=False, **KNOWN),
                             *KNOWN_WORDS, "--scalar", one, "--surface", "kmin", "--surface", "jmax", "--surface-opacity", 0.25, "--volume", "off")

    def test_are_annotated_as_by_the_command(self):
        with curvisplat.open(self.cache) as cache:
            try:
                picture = cache.render(size=(160, 120), scalar_bar=True, axes=True, outline=True, **KNOWN)
            except curvisplat.Error as error:
                self.skipTest(str(error))  # built without annotations
            self.assertEqual(picture.shape, (120, 160, 4))
            self.expect_same(picture, *KNOWN_WORDS, "--scalar-bar", "--axes", "--outline")
            self.expect_same(cache.render(size=(160, 120), scalar_bar=True, text_size=14, **KNOWN), *KNOWN_WORDS, "--scalar-bar", "--text-size", 14)
            self.expect_same(cache.render(size=(160, 120), scalar_bar_titles="speed", axes_titles=("x [m]", "y [m]", "z [m]"), **KNOWN),
                             *KNOWN_WORDS, "--scalar-bar-title", "speed", "--axes-titles", "x [m],y [m],z [m]")
            self.expect_same(cache.render(size=(160, 120), axes_grid=True, background="black", **KNOWN), *KNOWN_WORDS, "--axes-grid",
                             "--background", "black")
            marked = cache.render(size=(160, 120), markers=[((1, 0.5, 0.25), "here: {1}"), ((-1, 0, 0), "")], **KNOWN)
            self.expect_same(marked, *KNOWN_WORDS, "--marker", "1,0.5,0.25:here: {1}", "--marker", "-1,0,0")
            self.assertFalse(np.array_equal(marked, cache.render(size=(160, 120), **KNOWN)))
            for wrong in ("1,0,0:a", [(1, 0, 0)], [((1, 0), "a")]):
                with self.assertRaisesRegex(curvisplat.UsageError, "markers: "):
                    cache.render(size=(32, 32), markers=wrong)

    def test_have_channels_and_are_saved_with_them(self):
        with curvisplat.open(self.cache) as cache:
            picture = cache.render(size=(160, 120), channels="depth", **KNOWN)
            self.assertEqual(set(picture.channels), {"Z"})
            self.assertTrue((picture.channels["Z"][np.asarray(picture)[..., 3] > 0.6] > 0).all())
            picture.save(self.folder / "ours.exr")
            command("render", self.cache, "-o", self.folder / "theirs.exr", "--size", "160x120", *KNOWN_WORDS)
            self.assertEqual((self.folder / "ours.exr").read_bytes(), (self.folder / "theirs.exr").read_bytes())
            all_of_them = cache.render(size=(160, 120), channels=("depth", "normal", "scalar"), **KNOWN)
            self.assertEqual(set(all_of_them.channels), {"Z", "N.X", "N.Y", "N.Z", "scalar"})
            self.assertEqual(cache.render(size=(32, 32), **KNOWN).channels, {})

    def test_say_why_they_are_empty(self):
        with curvisplat.open(self.cache) as cache:
            with self.assertWarnsRegex(UserWarning, "the picture is empty"):
                picture = cache.render(size=(64, 64), range=(100, 200), opacity=[(0, 0), (1, 1)], background="transparent")
            self.assertFalse(np.asarray(picture).any())
            self.assertTrue(picture.warnings)
            with self.assertWarnsRegex(UserWarning, "^slices .* misses the data") as warned:
                cache.render(size=(64, 64), slices=[(1e6, 0, 0, 1, 0, 0)])
            self.assertEqual(warned.filename, __file__)  # the line that calls render()

    def test_know_what_was_chosen(self):
        with curvisplat.open(self.cache) as cache:
            picture = cache.render(size=(160, 120))
            self.assertIn("--opacity", picture.options)
            self.assertEqual(picture.shape, (120, 160, 4))
            self.assertEqual(picture.dtype, np.float32)
            self.assertGreater(picture.statistics["splats_drawn"], 0)
            again = self.drawn(*picture.options.split())
            np.testing.assert_array_equal(np.asarray(picture)[..., :3], again)

    def test_are_shown_in_notebooks_and_saved(self):
        with curvisplat.open(self.cache) as cache:
            picture = cache.render(size=(160, 120))
        self.assertTrue(picture._repr_png_().startswith(b"\x89PNG"))
        self.assertIsNone(picture[0]._repr_png_())
        picture.save(self.folder / "saved.pfm")
        np.testing.assert_array_equal(read_pfm(self.folder / "saved.pfm"), np.asarray(picture)[..., :3])

    def test_outlive_their_cache(self):
        cache = curvisplat.open(self.cache)
        picture = cache.render(size=(64, 64))
        before = picture.copy()
        del cache
        np.testing.assert_array_equal(picture, before)

    def test_of_surfaces_and_slices_are_the_commands(self):
        with curvisplat.open(self.cache) as cache:
            lower, upper = cache.bounds
            plane = [*(lower + upper) / 2, 0, 0, 1]
            text = ",".join(map(repr, map(float, plane)))
            self.expect_same(cache.render(size=(160, 120), slices=[plane], slice_opacity=0.5, **KNOWN), *KNOWN_WORDS, "--slice=" + text,
                             "--slice-opacity", "0.5")
            self.expect_same(cache.render(size=(160, 120), surfaces=["kmin"], surface_by=cache.scalars[0].name, volume=False, **KNOWN),
                             *KNOWN_WORDS, "--surface", "kmin", "--surface-by", cache.scalars[0].name, "--volume", "off")
            middle = (cache.scalars[0].min + cache.scalars[0].max) / 2
            self.expect_same(cache.render(size=(160, 120), isovalues=[middle], **KNOWN), *KNOWN_WORDS, "--iso", repr(middle))
            with self.assertRaisesRegex(curvisplat.UsageError, "--volume|volume"):
                cache.render(size=(16, 12), volume=False)

    def test_of_time_steps_are_the_commands(self):
        command("generate", "wake", "--size", "24x20x12", "--steps", "3", "-o", self.folder / "steps")
        command("convert", self.folder / "steps.xyz", self.folder / "steps_*.fun", "-o", self.folder / "steps.splats")
        with curvisplat.open(self.folder / "steps.splats") as cache:
            self.assertEqual(len(cache.times), 3)
            self.assertTrue((np.diff(cache.times) > 0).all())
            for step in (2, 0, 1):
                path = self.folder / "step.pfm"
                command("render", self.folder / "steps.splats", "-o", path, "--size", "80x60", "--step", step, *KNOWN_WORDS)
                np.testing.assert_array_equal(np.asarray(cache.render(size=(80, 60), step=step, **KNOWN))[..., :3], read_pfm(path))
            between = float(cache.times[0] * 0.25 + cache.times[1] * 0.75)
            for options in ((), ("--interpolate",)):
                command("render", self.folder / "steps.splats", "-o", path, "--size", "80x60", "--time", repr(between), *options, *KNOWN_WORDS)
                picture = cache.render(size=(80, 60), time=between, interpolate=bool(options), **KNOWN)
                np.testing.assert_array_equal(np.asarray(picture)[..., :3], read_pfm(path))
            with self.assertRaisesRegex(curvisplat.UsageError, "steps 0 to 2"):
                cache.render(size=(16, 12), step=3)

    def test_report_progress(self):
        seen = []
        with curvisplat.open(self.cache) as cache:
            cache.render(size=(64, 64), progress=lambda *state: seen.append(state))
        for phase, done, total, unit in seen:
            self.assertEqual((phase, unit), ("drawing", "bricks"))
            self.assertLessEqual(done, total)


class CamerasAndFunctions(PythonTest):
    def test_are_the_options_that_they_stand_for(self):
        function = curvisplat.TransferFunction("magma", (0.1, 0.6), [(0, 0), (1, 0.7)], opacity_unit=0.3)
        camera = curvisplat.Camera((20, -9, 8), (4, 0, 2), view_angle=35)
        with curvisplat.open(self.cache) as cache:
            picture = cache.render(size=(160, 120), camera=camera, function=function)
            self.expect_same(picture, "--tf", "magma", "--range", "0.1,0.6", "--opacity", "0:0,1:0.7", "--opacity-unit", 0.3,
                             "--position", "20,-9,8", "--focal-point", "4,0,2", "--view-up", "0,0,1", "--view-angle", 35)
            self.assertEqual(function.replaced(colours="inferno").range, (0.1, 0.6))
            with self.assertRaisesRegex(curvisplat.UsageError, "view cannot be combined with camera"):
                cache.render(camera=camera, view="+x")
            with self.assertRaisesRegex(curvisplat.UsageError, "range cannot be combined with function"):
                cache.render(function=function, range=(0, 1))
        with self.assertRaisesRegex(curvisplat.UsageError, "not both"):
            curvisplat.Camera((1, 2, 3), parallel_scale=1, view_angle=30)
        with self.assertRaisesRegex(curvisplat.UsageError, r"position: \(1, 2\); expected \(x, y, z\)"):
            curvisplat.Camera((1, 2))

    def test_orbit_as_the_command_does(self):
        frames = 3
        command("render", self.cache, "-o", self.folder / "orbit_%d.pfm", "--size", "80x60", "--view", "+x", "--orbit", 360, "--frames", frames)
        with curvisplat.open(self.cache) as cache:
            cameras = cache.orbit("+x", frames=frames, size=(80, 60))
            self.assertEqual(len(cameras), frames)
            for number, camera in enumerate(cameras):
                (path,) = self.folder.glob(f"orbit_{number}.pfm")
                picture = cache.render(size=(80, 60), camera=camera)
                np.testing.assert_array_equal(np.asarray(picture)[..., :3], read_pfm(path), str(number))
            around = curvisplat.orbit(cameras[0], frames)
            self.assertEqual(around, cameras)
            high = cache.camera("+x", size=(80, 60), vertical_scale=3)
            self.assertNotEqual(high, cache.camera("+x", size=(80, 60)))
            picture = cache.render(size=(80, 60), camera=high, vertical_scale=3)
            np.testing.assert_array_equal(picture, cache.render(size=(80, 60), view="+x", vertical_scale=3))
            with self.assertRaisesRegex(curvisplat.UsageError, "expected from 1"):
                cache.orbit(frames=0)
            with self.assertRaisesRegex(curvisplat.UsageError, "expected a whole number from 1"):
                curvisplat.orbit(cameras[0], 0)
        back = curvisplat.Camera((3, 0, 0), parallel_scale=2).turned(180)
        np.testing.assert_allclose(back.position, (-3, 0, 0), atol=1e-12)
        self.assertEqual(back.parallel_scale, 2)


class Data(PythonTest):
    """Arrays of a cache, against closed forms."""

    @classmethod
    def setUpClass(cls):
        super().setUpClass()
        k, j, i = np.meshgrid(np.linspace(0, 4, 48), np.linspace(0, 3, 44), np.linspace(0, 2, 40), indexing="ij")
        cls.ramp = cls.folder / "ramp.splats"
        curvisplat.convert_arrays(cls.ramp, curvisplat.Block(i, j, k, {"t": i + 2 * j + 3 * k}))

    def test_are_sampled(self):
        with curvisplat.open(self.ramp) as cache:
            samples = cache.sample(size=40)
            self.assertEqual(samples.value.shape, (40, 30, 20))
            np.testing.assert_allclose(samples.spacing, 0.1)
            np.testing.assert_allclose(samples.origin, 0.05)
            self.assertAlmostEqual(samples.density.sum(dtype="f8") * 1e-3, 24, delta=0.05)
            z, y, x = np.meshgrid(*(0.05 + 0.1 * np.arange(n) for n in (40, 30, 20)), indexing="ij")
            self.assertLess(np.abs(samples.value - (x + 2 * y + 3 * z)).max(), 0.1)
            self.assertLess(np.abs(samples.value - (x + 2 * y + 3 * z))[2:-2, 2:-2, 2:-2].max(), 0.01)
            # Beyond the data there is nothing; a slab of it alone has the same bits.
            wide = cache.sample(size=(40, 30, 40), box=(0, 4, 0, 3, 0, 4))
            self.assertTrue(np.isnan(wide.value[:, :, 25:]).all() and (wide.density[:, :, 25:] == 0).all())
            coarse = cache.sample(size=8, level=0)
            self.assertAlmostEqual(float(coarse.density.sum()) * 0.125, 24, delta=1)
            self.assertTrue(np.array_equal(cache.sample(size=40).value, samples.value))

    def test_are_sampled_in_a_plane(self):
        with curvisplat.open(self.ramp) as cache:
            samples = cache.sample(size=30, box=(0, 2, 0, 3, 1, 1))
            self.assertEqual(samples.value.shape, (1, 30, 20))
            np.testing.assert_allclose(samples.spacing, 0.1)
            np.testing.assert_allclose(samples.origin, (0.05, 0.05, 1))
            y, x = np.meshgrid(*(0.05 + 0.1 * np.arange(n) for n in (30, 20)), indexing="ij")
            self.assertLess(np.abs(samples.value[0] - (x + 2 * y + 3))[2:-2, 2:-2].max(), 0.01)
            with self.assertRaisesRegex(curvisplat.UsageError, "empty"):
                cache.sample(box=(1, 1, 2, 2, 0.5, 0.5))
        # A grid of one plane has no volume, and so no density, but its box has samples.
        k, j, i = np.meshgrid([0.5], np.linspace(0, 3, 9), np.linspace(0, 2, 9), indexing="ij")
        path = self.folder / "plane.splats"
        curvisplat.convert_arrays(path, curvisplat.Block(i, j, k, {"t": i + 2 * j}))
        with curvisplat.open(path) as cache:
            for size, shape in ((30, (1, 30, 20)), ((20, 30, 2), (2, 30, 20))):
                samples = cache.sample(size=size)
                self.assertEqual(samples.value.shape, shape)
                self.assertTrue((samples.density == 0).all())

    def test_are_sampled_in_little_more_memory_than_they_take(self):
        script = ("import curvisplat, re, sys\n"
                  "def peak(): return int(re.search(r'VmHWM:\\s+(\\d+)', open('/proc/self/status').read())[1]) >> 10\n"
                  "with curvisplat.open(sys.argv[1]) as cache:\n"
                  "    cache.sample(size=(8, 8, 8)); before = peak()\n"
                  "    samples = cache.sample(size=(1000, 1000, 8), box=(0, 20, 0, 30, 0, 4))\n"  # most of it empty, which is quick
                  "    print(peak() - before, (samples.value.nbytes + samples.density.nbytes) >> 20)")
        words = subprocess.run([sys.executable, "-c", script, self.ramp], check=True, capture_output=True, text=True).stdout.split()
        taken, returned = map(int, words)
        print(f"sample(): {taken} MiB taken, {returned} returned")
        self.assertLess(taken - returned, 64 + 32)

    def test_are_points(self):
        with curvisplat.open(self.ramp) as cache:
            points = cache.points()
            self.assertEqual(len(points.values), 40 * 44 * 48)
            self.assertLess(np.abs(points.values - points.positions @ [1, 2, 3]).max(), 0.02)
            self.assertAlmostEqual(points.volumes.sum(dtype="f8"), 24, delta=0.03)
            inner = cache.points(box=(0.5, 1.5, 1, 2, 1, 3))
            self.assertTrue(((inner.positions > [0.5, 1, 1]) & (inner.positions < [1.5, 2, 3])).all())
            spacing = np.array([2 / 39, 3 / 43, 4 / 47])
            np.testing.assert_allclose(inner.shapes, np.broadcast_to(np.diag(spacing**2), inner.shapes.shape), rtol=0.05, atol=1e-4)
            self.assertLess(len(cache.points(level=0).values), 40 * 44 * 48)

    def test_are_of_a_step_and_say_what_is_wrong(self):
        with curvisplat.open(self.ramp) as cache:
            for wrong, words in (({"size": 0}, "size"), ({"size": (1, 2)}, "expected one number or three"), ({"box": (0, 1)}, "expected .x0"),
                                 ({"box": (1, 0, 0, 1, 0, 1)}, "empty"), ({"step": 1}, "no step 1"), ({"level": 9}, "no level 9"),
                                 ({"scalar": "u"}, "no scalar"), ({"size": (100000, 100000, 100000)}, "more than")):
                with self.assertRaisesRegex(curvisplat.UsageError, words):
                    cache.sample(**wrong)
            for wrong, words in (({"level": 9}, "no level 9"), ({"step": 1}, "no step 1")):
                with self.assertRaisesRegex(curvisplat.UsageError, words):
                    cache.points(**wrong)

    def test_help_is_of_the_package_alone(self):
        """help(curvisplat) has what the package adds, and none of what its arrays inherit."""
        import pydoc
        text = pydoc.render_doc(curvisplat, renderer=pydoc.plaintext)
        for name in curvisplat.__all__:
            self.assertIn(name, text)
        self.assertIn("Writes the picture as .png", text)
        self.assertNotIn("tobytes", text)  # a method of numpy's arrays
        self.assertLess(len(pydoc.render_doc(curvisplat.Picture, renderer=pydoc.plaintext).splitlines()), 100)

    def test_are_documented_and_typed(self):
        """Everything public has a docstring, and what the stubs say of the module is there."""
        import ast
        import inspect
        for name in curvisplat.__all__:
            thing = getattr(curvisplat, name)
            self.assertTrue(inspect.getdoc(thing), name)
            if inspect.isclass(thing) and not issubclass(thing, (Exception, np.ndarray, tuple)):
                for method, function in vars(thing).items():
                    if not method.startswith("_") and callable(function):
                        self.assertTrue(inspect.getdoc(function), f"{name}.{method}")
        folder = pathlib.Path(curvisplat.__file__).parent
        self.assertTrue((folder / "py.typed").is_file())
        stubs = ast.parse((folder / "_core.pyi").read_text())
        declared = {node.name for node in stubs.body if isinstance(node, (ast.FunctionDef, ast.ClassDef))}
        self.assertEqual(declared - {name for name in dir(curvisplat._core) if not name.startswith("_")}, set())
        (of_cache,) = [node for node in stubs.body if isinstance(node, ast.ClassDef) and node.name == "OpenCache"]
        methods = {node.name for node in of_cache.body if isinstance(node, ast.FunctionDef)}
        self.assertEqual({m for m in dir(curvisplat._core.OpenCache) if not m.startswith("_")} - methods
                         - {node.target.id for node in of_cache.body if isinstance(node, ast.AnnAssign)}, set())


class Histograms(PythonTest):
    def test_are_shares_of_the_volume(self):
        k, j, i = np.meshgrid(np.linspace(0, 1, 9), np.linspace(0, 2, 9), np.linspace(0, 3, 65), indexing="ij")
        path = self.folder / "ramp.splats"
        curvisplat.convert_arrays(path, curvisplat.Block(i, j, k, {"x": i.copy(), "one": np.ones_like(i)}))
        with curvisplat.open(path) as cache:
            shares, ends = cache.histogram("x", bins=6)
            self.assertEqual((len(shares), len(ends)), (6, 7))
            np.testing.assert_allclose(ends, np.linspace(0, 3, 7))
            np.testing.assert_allclose(shares, np.full(6, 1 / 6), atol=0.02)  # x is even over the box
            shares, _ = cache.histogram("x", bins=4, range=(0, 1.5))
            self.assertAlmostEqual(float(shares.sum()), 0.5, delta=0.02)
            shares, ends = cache.histogram("x", bins=2, range=(0.03, 3), log=True)
            np.testing.assert_allclose(ends, [0.03, 0.3, 3])
            self.assertGreater(shares[1], 5 * shares[0])
            self.assertAlmostEqual(float(cache.histogram("one")[0].sum()), 1, places=6)
            for bad in ((1, 1), (2, 1)):
                with self.assertRaisesRegex(curvisplat.UsageError, "increases"):
                    cache.histogram("x", range=bad)
            with self.assertRaisesRegex(curvisplat.UsageError, "above zero"):
                cache.histogram("x", range=(0, 1), log=True)
            with self.assertRaisesRegex(curvisplat.UsageError, "no scalar"):
                cache.histogram("y", range=(0, 1))
            with self.assertRaisesRegex(curvisplat.UsageError, "no scalar"):
                cache.histogram("y")


class Series(PythonTest):
    def test_of_files_are_those_of_the_command(self):
        command("generate", "wake", "--size", "24x20x12", "--steps", "5", "-o", self.folder / "s")
        theirs, ours = self.folder / "theirs.splats", self.folder / "ours.splats"
        command("convert", self.folder / "s.xyz", self.folder / "s_*.fun", "--steps", "0:4:2", "--refine", "1", "-o", theirs)
        report = curvisplat.convert(ours, self.folder / "s.xyz", self.folder / "s_*.fun", steps="0:4:2", refine=1)
        self.assertEqual(self.files_of(ours), self.files_of(theirs))
        self.assertEqual((report.steps, report.samples), (3, 24 * 20 * 12))
        self.assertEqual(report.bytes, sum(len(data) for data in self.files_of(ours).values()))
        later = [self.folder / f"s_{n:04}.fun" for n in (3, 4)]
        later_times = self.folder / "later.splats"
        first = curvisplat.convert(later_times, self.folder / "s.xyz", [self.folder / f"s_{n:04}.fun" for n in (0, 1, 2)])
        self.assertEqual(first.steps, 3)
        self.assertEqual(curvisplat.append(later_times, self.folder / "s.xyz", later).steps, 5)
        whole = self.folder / "whole.splats"
        command("convert", self.folder / "s.xyz", self.folder / "s_*.fun", "-o", whole)
        with curvisplat.open(later_times) as cache, curvisplat.open(whole) as at_once:
            self.assertEqual(len(cache.times), 5)
            np.testing.assert_array_equal(cache.render(size=(64, 48), step=4), at_once.render(size=(64, 48), step=4))

    def test_that_lack_a_step_say_which(self):
        with self.assertRaisesRegex(curvisplat.Error, "none_"):
            curvisplat.convert(self.folder / "n.splats", self.folder / "wake.xyz", self.folder / "none_*.fun")
        with self.assertRaisesRegex(curvisplat.UsageError, "steps"):
            curvisplat.convert(self.folder / "n.splats", self.folder / "wake.xyz", self.folder / "wake.fun", steps="many")
        self.assertFalse((self.folder / "n.splats").exists())

    def files_of(self, folder):
        return {path.name: path.read_bytes() for path in sorted(folder.rglob("*")) if path.is_file()}


class Views(PythonTest):
    def test_are_pages_that_end_with_them(self):
        with curvisplat.open(self.cache) as cache, cache.view(program=PROGRAM, height=300) as view:
            self.assertIn(f'src="{view.url}"', view._repr_html_())
            self.assertIn('height="300"', view._repr_html_())
            with urllib.request.urlopen(view.url) as page:
                self.assertIn(b"<canvas", page.read())
            self.assertTrue(view.is_open)
        self.assertFalse(view.is_open)
        self.assertNotIn("iframe", view._repr_html_())
        with self.assertRaises(OSError):
            urllib.request.urlopen(view.url)

    def test_know_that_their_server_was_killed(self):
        with curvisplat.open(self.cache) as cache, cache.view(program=PROGRAM) as view:
            view._process.kill()
            view._process.wait()
            self.assertFalse(view.is_open)

    def test_say_what_is_wrong(self):
        with curvisplat.open(self.cache) as cache:
            with self.assertRaisesRegex(curvisplat.Error, "cannot be run"):
                cache.view(program="/nowhere/curvisplat")
            with self.assertRaisesRegex(curvisplat.Error, "^unknown subcommand|has no server|.+"):
                cache.view(program="/bin/false")


class CachesAreDescribed(PythonTest):
    def test_as_the_command_describes_them(self):
        with curvisplat.open(self.cache) as cache:
            self.assertEqual(cache.blocks, (("block 1", 48, 40, 24),))
            self.assertEqual(cache.samples, 48 * 40 * 24)
            self.assertEqual(cache.splats, cache.samples - 40 * 24)  # the wake closes around its cylinder
            lower, upper = cache.bounds
            self.assertTrue((lower < upper).all())
            inside = cache.probe((lower + upper) / 2)
            self.assertEqual(set(inside["values"]), {scalar.name for scalar in cache.scalars})
            self.assertEqual(inside["block"], 1)
            self.assertIsNone(cache.probe(upper + 100))
            both = cache.probe(np.array([(lower + upper) / 2, upper + 100]))
            self.assertEqual(list(both["block"]), [inside["block"], 0])
            self.assertEqual(tuple(both["index"][0]), inside["index"])
            for name, values in both["values"].items():
                self.assertEqual(values[0], inside["values"][name])
                self.assertTrue(np.isnan(values[1]))
            self.assertIn("wake", repr(cache))


class Probes(PythonTest):
    def test_say_what_is_at_the_point_and_in_the_samples_cell(self):
        """Of a linear scalar on bent cells: it is known everywhere."""
        x, y, z, _ = bent_duct()
        at = lambda p: 2 * p[0] + 3 * p[1] - p[2]
        path = self.folder / "linear.splats"
        curvisplat.convert_arrays(path, curvisplat.Block(x, y, z, {"t": at((x, y, z))}))
        near = 2e-3 * np.ptp(at((x, y, z)))
        with curvisplat.open(path) as cache:
            for k, j, i in np.random.default_rng(1).integers(2, np.array(x.shape) - 3, (40, 3)):
                point = [(c[k, j, i] + c[k + 1, j + 1, i + 1]) / 2 for c in (x, y, z)]
                found = cache.probe(point)
                self.assertAlmostEqual(found["values"]["t"], at(point), delta=near)
                self.assertAlmostEqual(found["sample_values"]["t"], at(found["position"]), delta=near)


class Arrays(PythonTest):
    def test_become_the_cache_that_the_same_file_becomes(self):
        x, y, z, t = bent_duct()
        whole = self.folder / "arrays.splats"
        report = curvisplat.convert_arrays(whole, curvisplat.Block(x, y, z, {"t": t}, units={"t": "K"}))
        self.assertEqual(report.samples, t.size)
        # The same through a PLOT3D grid in double precision and a function file.
        grid, function = self.folder / "duct.xyz", self.folder / "duct.f"
        nk, nj, ni = t.shape
        with open(grid, "wb") as file:
            np.array([ni, nj, nk], "<i4").tofile(file)
            for array in (x, y, z):
                array.astype("<f8").tofile(file)
        with open(function, "wb") as file:
            np.array([ni, nj, nk, 1], "<i4").tofile(file)
            t.astype("<f8").tofile(file)
        of_files = self.folder / "files.splats"
        curvisplat.convert(of_files, grid, [function])
        for name in ("bricks.bin", "geometry.bin", "var.0.bin"):
            self.assertEqual((whole / name).read_bytes(), (of_files / name).read_bytes(), name)
        with curvisplat.open(whole) as cache:
            self.assertEqual(cache.scalars[0][:2], ("t", "K"))
        for words, path in (((curvisplat.Block(x, y, z, {"t": t}),), whole), ((grid, [function]), of_files)):
            convert = curvisplat.convert_arrays if path == whole else curvisplat.convert
            convert(path, *words, overwrite=True, value_precision="fine")
            self.assertIn("fine-values", json.loads((path / "manifest.json").read_text())["requires"])
        with self.assertRaises(curvisplat.UsageError):
            curvisplat.convert(of_files, grid, [function], overwrite=True, value_precision="finer")
        convert_both = ((curvisplat.convert_arrays, whole, (curvisplat.Block(x, y, z, {"t": t}),)),
                        (curvisplat.convert, of_files, (grid, [function])))
        for convert, path, words in convert_both:
            convert(path, *words, overwrite=True, refine=2)
            self.assertEqual(json.loads((path / "manifest.json").read_text())["refined"], 2)
            with self.assertRaises(curvisplat.UsageError):
                convert(path, *words, overwrite=True, refine=17)
            with self.assertRaises(curvisplat.UsageError):
                convert(path, *words, overwrite=True, refine="some")
        for name in ("bricks.bin", "geometry.bin", "var.0.bin"):
            self.assertEqual((whole / name).read_bytes(), (of_files / name).read_bytes(), name)

    def test_cells_are_cut_by_need(self):
        x, y, z, t = bent_duct(ni=4)
        path = self.folder / "need.splats"
        block = curvisplat.Block(x, y, z, {"t": t})
        report = curvisplat.convert_arrays(path, block, refine="auto")
        self.assertRegex(report.notes[0], f"cells .* are cut: {t.size} nodes .*; refine=1 leaves them whole")
        self.assertEqual(curvisplat.convert_arrays(path, block, refine=1, overwrite=True).notes, [])
        curvisplat.convert_arrays(path, block, overwrite=True)
        cuts = json.loads((path / "manifest.json").read_text())["blocks"][0]["refined"]
        self.assertGreater(cuts[0], 1)
        self.assertEqual(cuts[1:], [1, 1])
        # Read in threads of the conversion, which wait for the interpreter.
        def read(block, k0, k1, j0, j1, names):
            piece = np.s_[k0:k1, j0:j1]
            return x[piece], y[piece], z[piece], [t[piece] for _ in names], None

        of_callable = self.folder / "need_callable.splats"
        curvisplat.convert_callable(of_callable, [t.shape], read, {"t": ""}, refine="auto")
        for name in ("bricks.bin", "geometry.bin", "var.0.bin"):
            self.assertEqual((path / name).read_bytes(), (of_callable / name).read_bytes(), name)

    def test_of_any_strides_and_layouts_are_the_same(self):
        x, y, z, t = bent_duct()
        first, second = self.folder / "c.splats", self.folder / "f.splats"
        curvisplat.convert_arrays(first, curvisplat.Block(x, y, z, {"t": t}))
        wide = np.zeros((*t.shape, 3))
        wide[..., 0], wide[..., 1], wide[..., 2] = x, y, z
        fortran = np.asfortranarray(t)
        curvisplat.convert_arrays(second, curvisplat.Block(wide[..., 0], wide[..., 1], wide[..., 2], {"t": fortran}))
        self.assertEqual((first / "var.0.bin").read_bytes(), (second / "var.0.bin").read_bytes())

    def test_that_are_masked_or_blank_are_left_out(self):
        x, y, z, t = bent_duct()
        blank = np.zeros(t.shape, bool)
        blank[:, :, :10] = True
        report = curvisplat.convert_arrays(self.folder / "blank.splats", curvisplat.Block(x, y, z, {"t": t}, blank))
        masked = np.ma.masked_array(t, blank)
        same = curvisplat.convert_arrays(self.folder / "masked.splats", curvisplat.Block(x, y, z, {"t": masked}))
        self.assertEqual((report.blanked, same.blanked), (blank.sum(), blank.sum()))

    def test_in_cells_and_in_several_blocks(self):
        x, y, z, t = bent_duct()
        cells = t[1:, 1:, 1:]
        report = curvisplat.convert_arrays(self.folder / "cells.splats", curvisplat.Block(x, y, z, {"t": cells}))
        self.assertEqual(report.samples, cells.size)
        left, right = np.s_[:, :, :21], np.s_[:, :, 20:]
        blocks = [curvisplat.Block(x[part], y[part], z[part], {"t": t[part]}, name=name)
                  for part, name in ((left, "left"), (right, "right"))]
        report = curvisplat.convert_arrays(self.folder / "two.splats", *blocks)
        self.assertEqual(report.merged_nodes, t.shape[0] * t.shape[1])
        with curvisplat.open(self.folder / "two.splats") as cache:
            self.assertEqual([block[0] for block in cache.blocks], ["left", "right"])

    def test_of_a_callable_are_read_piece_by_piece(self):
        x, y, z, t = bent_duct()
        largest = 0

        def read(block, k0, k1, j0, j1, names):
            nonlocal largest
            self.assertEqual(block, 0)
            piece = np.s_[k0:k1, j0:j1]
            largest = max(largest, t[piece].size)
            return x[piece], y[piece], z[piece], [t[piece] for _ in names], None

        first, second = self.folder / "whole.splats", self.folder / "pieces.splats"
        curvisplat.convert_arrays(first, curvisplat.Block(x, y, z, {"t": t}))
        curvisplat.convert_callable(second, [t.shape], read, {"t": "K"})
        for name in ("bricks.bin", "geometry.bin", "var.0.bin"):
            self.assertEqual((first / name).read_bytes(), (second / name).read_bytes(), name)
        self.assertGreater(largest, 0)

    def test_with_long_rows_fit_in_memory_or_are_refused_with_a_sufficient_size(self):
        """170,000 nodes along i, which do not fit in a slab: the peak of a process that makes no other arrays. Read in parts, by whole rows
        and from arrays, they become the same bytes."""
        script = ("import curvisplat, numpy as np, re, sys\n"
                  "def peak(): return int(re.search(r'VmHWM:\\s+(\\d+)', open('/proc/self/status').read())[1]) >> 10\n"
                  "ni, parts_of_rows = 170_000, 0\n"
                  "def piece(k0, k1, j0, j1, i0, i1):\n"
                  "    k, j, i = np.meshgrid(np.arange(k0, k1), np.arange(j0, j1), np.arange(i0, i1), indexing='ij')\n"
                  "    return 1e-3 * i, j.astype('f8'), k.astype('f8'), 1e-3 * i, i % 1013 == 5\n"
                  "def parts(block, k0, k1, j0, j1, names, *, i0, i1):\n"
                  "    global parts_of_rows\n"
                  "    parts_of_rows += 1 < i1 - i0 < ni\n"
                  "    x, y, z, t, blank = piece(k0, k1, j0, j1, i0, i1)\n"
                  "    return x, y, z, [t for _ in names], blank\n"
                  "def rows(block, k0, k1, j0, j1, names): return parts(block, k0, k1, j0, j1, names, i0=0, i1=ni)\n"
                  "out, kind, memory = sys.argv[1:]\n"
                  "options = {'memory': memory, 'threads': 2, 'overwrite': True}\n"
                  "if kind in ('arrays', 'cells'):\n"
                  "    x, y, z, t, blank = piece(0, 2 if kind == 'cells' else 1, 0, 2, 0, ni)\n"
                  "    before = peak()\n"
                  "    t = t[1:, 1:, 1:] if kind == 'cells' else t\n"
                  "    curvisplat.convert_arrays(out, curvisplat.Block(x, y, z, {'t': t}, blank=blank), **options)\n"
                  "else:\n"
                  "    before = peak()\n"
                  "    try:\n"
                  "        curvisplat.convert_callable(out, [(1, 2, ni)], {'parts': parts, 'rows': rows}[kind], ['t'], **options)\n"
                  "    except curvisplat.Error as error:\n"
                  "        sys.exit(print(error))\n"
                  "print(peak(), before, parts_of_rows)\n")
        files = ("bricks.bin", "geometry.bin", "var.0.bin")

        def convert(kind, memory):
            run = subprocess.run([sys.executable, "-c", script, self.folder / f"{kind}.splats", kind, memory], capture_output=True, text=True)
            self.assertEqual(run.returncode, 0, run.stderr)
            return run.stdout

        def bytes_within(kind, memory, is_in_parts=False):
            peak, before, parts = map(int, convert(kind, memory).split())
            print(f"{kind}, memory {memory}: {peak} MiB, {before} before")
            self.assertLessEqual(peak, int(memory[:-1]) + before)
            self.assertEqual(parts > 0, is_in_parts)
            return [(self.folder / f"{kind}.splats" / file).read_bytes() for file in files]

        refused = convert("rows", "160M")
        self.assertRegex(refused, r"read by whole rows.*at least \d+ MiB")
        expected = bytes_within("rows", re.search(r"at least (\d+) MiB", refused)[1] + "M")
        self.assertEqual(bytes_within("parts", "160M", is_in_parts=True), expected)
        self.assertEqual(bytes_within("arrays", "160M"), expected)
        if IS_WHOLE:
            self.assertEqual(bytes_within("cells", "160M"), bytes_within("cells", "2000M"))

    def test_are_appended_as_steps(self):
        x, y, z, t = bent_duct()
        steps = self.folder / "appended.splats"
        curvisplat.convert_arrays(steps, curvisplat.Block(x, y, z, {"t": t}), time=1.5)
        self.assertEqual(curvisplat.append_arrays(steps, curvisplat.Block(x, y, z, {"t": 2 * t}), time=2.5), 2)
        self.assertEqual(curvisplat.append_arrays(steps, curvisplat.Block(x, y, z, {"t": 3 * t})), 3)
        with curvisplat.open(steps) as cache:
            np.testing.assert_array_equal(cache.times, [1.5, 2.5, 3.5])
            first, last = (cache.points(step=step).values for step in (0, 2))
            np.testing.assert_allclose(last, 3 * first, rtol=1e-3)
        for wrong, words in (({"time": 3.0}, "time"), ({}, "has no scalar|no scalar")):
            scalars = {"t": t} if wrong else {"u": t}
            with self.assertRaisesRegex(curvisplat.Error, words):
                curvisplat.append_arrays(steps, curvisplat.Block(x, y, z, scalars), **wrong)
        with self.assertRaises(curvisplat.Error):
            curvisplat.append_arrays(self.folder / "none.splats", curvisplat.Block(x, y, z, {"t": t}))
        with curvisplat.open(steps) as cache:
            self.assertEqual(len(cache.times), 3)

    def test_select_of_a_further_dimension(self):
        try:
            import netCDF4
        except ModuleNotFoundError:
            self.skipTest("netCDF4 is not installed")
        path = self.folder / "months.nc"
        with netCDF4.Dataset(path, "w") as file:
            for name, unit, values in (("month", "1", [1, 2, 3]), ("z", "m", [0, 1, 2]), ("y", "m", [0, 1, 2]), ("x", "m", [0, 1, 2])):
                file.createDimension(name, 3)
                variable = file.createVariable(name, "f8", (name,))
                variable[:] = values
                variable.units = unit
                if name != "month":
                    variable.axis = name.upper()
            file.createVariable("t", "f4", ("month", "z", "y", "x"))[:] = 100 * np.arange(1, 4)[:, None, None, None] + np.arange(27).reshape(3, 3, 3)
        curvisplat.convert(self.folder / "month.splats", path, select={"month": 3})
        scalar, = curvisplat.open(self.folder / "month.splats").scalars
        self.assertEqual((scalar.min, scalar.max), (300, 326))
        for wrong in ("month=3", {"month": 4}):
            with self.assertRaises(curvisplat.Error):
                curvisplat.convert(self.folder / "no.splats", path, select=wrong)

    def test_scalars_with_blanks_of_their_own(self):
        x, y, z, t = bent_duct()
        half = np.where(np.arange(t.shape[2]) < 20, np.nan, t)
        cache = self.folder / "half.splats"
        curvisplat.convert_arrays(cache, curvisplat.Block(x, y, z, {"t": t, "half": half}))
        opened = curvisplat.open(cache)
        self.assertEqual([s.name for s in opened.scalars], ["t", "half"])
        counts = [opened.points(name).positions.shape[0] for name in ("t", "half")]
        self.assertEqual(counts, [t.size, t.size // 2])
        drawn = [opened.render(name, size=(40, 40), lod_pixels=0).statistics["splats_drawn"] for name in ("t", "half")]
        self.assertEqual(drawn, counts)
        # Both are known at the first point, one at the second, none at the third.
        places = np.array([[c[3, 3, i] for c in (x, y, z)] for i in (30, 10)] + [[1e3, 0, 0]])
        found = opened.probe(places)
        self.assertEqual(list(found["values"]), ["t", "half"])
        self.assertEqual((found["block"] == 0).tolist(), [False, False, True])
        for of in (found["values"], found["sample_values"]):
            self.assertEqual(np.isnan(of["t"]).tolist(), [False, False, True])
            self.assertEqual(np.isnan(of["half"]).tolist(), [False, True, True])
            self.assertAlmostEqual(of["half"][0], t[3, 3, 30], delta=2e-3 * np.ptp(t))
        np.testing.assert_array_equal(found["index"][:2, 0], [30, 10])
        single = opened.probe(places[1])
        self.assertTrue(np.isnan(single["values"]["half"]))
        self.assertEqual(single["values"]["t"], found["values"]["t"][1])
        opened.close()
        self.assertEqual(opened.render("half", size=(40, 40)).statistics["splats_drawn"], counts[1])
        # A step is added to both.
        curvisplat.append_arrays(cache, curvisplat.Block(x, y, z, {"t": t + 1, "half": half + 1}))
        later = curvisplat.open(cache)
        for name, count in zip(("t", "half"), counts):
            self.assertEqual(later.render(name, size=(40, 40), step=1, lod_pixels=0).statistics["splats_drawn"], count)
            change = later.points(name, step=1).values.mean() - later.points(name).values.mean()
            self.assertAlmostEqual(change, 1, delta=0.01)

    def test_of_xarray_say_what_is_missing(self):
        try:
            import xarray
        except ImportError:
            self.skipTest("xarray is not installed")
        x, y, z, t = bent_duct()
        spatial = ("k", "j", "i")
        dataset = xarray.Dataset({"t": (("time", *spatial), t[None])}, {"x": (spatial, x.astype("f4")), "y": (spatial, y), "z": (spatial, z)})
        for wrong, words in (({}, "isel.time=0."), ({"scalars": ["t"]}, "isel.time=0."), ({"scalars": ["u"]}, "no variable 'u'"),
                             ({"coordinates": ("lon", "y", "z")}, "no variable 'lon'")):
            with self.assertRaisesRegex(curvisplat.UsageError, words):
                curvisplat.from_xarray(dataset, **wrong)
        block = curvisplat.from_xarray(dataset.isel(time=0))
        self.assertTrue(np.shares_memory(block.x, dataset.x.values) and np.shares_memory(block.y, dataset.y.values))

    def test_of_the_example_are_drawn_by_the_command_it_prints(self):
        example = pathlib.Path(__file__).resolve().parents[2] / "tools" / "python" / "examples" / "arrays.py"
        run = subprocess.run([sys.executable, example, "duct"], cwd=self.folder, check=True, capture_output=True, text=True)
        words = shlex.split(run.stdout.split("by hand: ")[1])
        subprocess.run([PROGRAM, *words[1:]], cwd=self.folder, check=True, capture_output=True)
        self.assertEqual((self.folder / "again.png").read_bytes(), (self.folder / "duct.png").read_bytes())

    def test_of_a_dataset_are_plotted(self):
        try:
            import matplotlib  # noqa: F401
            import xarray  # noqa: F401
        except ImportError as error:
            self.skipTest(str(error))
        example = pathlib.Path(__file__).resolve().parents[2] / "tools" / "python" / "examples" / "dataset.py"
        subprocess.run([sys.executable, example, "wind"], cwd=self.folder, check=True, capture_output=True)
        self.assertTrue((self.folder / "wind.png").read_bytes().startswith(b"\x89PNG"))
        with curvisplat.open(self.folder / "wind.splats") as cache:
            self.assertEqual((cache.samples, cache.scalars[0].name, cache.scalars[0].unit), (60 * 45 * 20, "wind", "m s-1"))

    def test_of_a_solver_that_runs(self):
        package = pathlib.Path(__file__).resolve().parents[2] / "tools" / "python" / "examples" / "solver.py"
        name = self.folder / "heat"
        done = subprocess.run([sys.executable, package, name], capture_output=True, text=True, env=os.environ)
        self.assertEqual(done.returncode, 0, done.stderr)
        means = [float(line.rsplit(" ", 1)[1]) for line in done.stdout.splitlines() if line.startswith("step")]
        self.assertEqual(len(means), 5)
        self.assertTrue(all(a < b for a, b in zip(means, means[1:])), means)  # heat comes in
        with curvisplat.open(f"{name}.splats") as cache:
            self.assertEqual(len(cache.times), 5)
            for step in range(len(means)):
                points = cache.points(step=step)
                self.assertLessEqual(points.values.max(), 100.01)
            # Diffusion from one end: the temperature falls along the duct, the same at all heights.
            angle = np.arctan2(points.positions[:, 1], points.positions[:, 0])
            self.assertLess(np.corrcoef(angle, points.values)[0, 1], -0.7)
        self.assertGreater((self.folder / "heat.png").stat().st_size, 2000)

    def test_of_xarray(self):
        try:
            import xarray
        except ImportError:
            self.skipTest("python3-xarray is not installed")
        x, y, z, t = bent_duct()
        dims = ("k", "j", "i")
        dataset = xarray.Dataset({"t": (dims, t, {"units": "K"})}, coords={
            "x": (dims[1:], x[0]), "y": (dims[1:], y[0]), "z": ("k", z[:, 0, 0])})
        first, second = self.folder / "numpy.splats", self.folder / "xarray.splats"
        curvisplat.convert_arrays(first, curvisplat.Block(x, y, z, {"t": t}))
        curvisplat.convert_arrays(second, curvisplat.from_xarray(dataset))
        self.assertEqual((first / "var.0.bin").read_bytes(), (second / "var.0.bin").read_bytes())
        with curvisplat.open(second) as cache:
            self.assertEqual(cache.scalars[0].unit, "K")


class Errors(PythonTest):
    def expect_error(self, kind, text, call, *arguments, **options):
        with self.assertRaises(kind) as caught:
            call(*arguments, **options)
        self.assertIn(text, str(caught.exception))
        self.assertNotIn("\n", str(caught.exception))

    def test_have_the_commands_messages(self):
        self.expect_error(curvisplat.Error, "none.splats", curvisplat.open, "none.splats")
        with curvisplat.open(self.cache) as cache:
            self.expect_error(curvisplat.Error, "nope", cache.render, "nope")
            self.expect_error(curvisplat.UsageError, "upside-down", cache.render, view="upside-down")
            self.expect_error(ValueError, "0x10", cache.render, size=(0, 10))
            self.expect_error(curvisplat.UsageError, "direction", cache.render, clip_planes=[(0, 0, 0, 0, 0, 0)])
            self.expect_error(curvisplat.UsageError, "memory", cache.render, memory="1K")
            cache.render(size=(32, 32))  # still works

    def test_name_the_argument(self):
        wrong = curvisplat.UsageError
        with curvisplat.open(self.cache) as cache:
            scalar = cache.scalars[0].name
            for name, value, words in (("step", -1, "from 0"), ("threads", -1, "from 0"), ("step", 1.5, "whole number"),
                                       ("shade", "yes", "neither True nor False"), ("size", 300, "(width, height)"),
                                       ("size", (10.5, 10), "whole numbers"), ("function", "viridis", "colours='viridis'"),
                                       ("camera", "+z", "view='+z'"), ("slices", (0, 0, 0, 0, 0, 1), "several in a list"),
                                       ("clip_planes", [(0, 0, 1)], "(px, py, pz, nx, ny, nz)")):
                self.expect_error(wrong, f"{name}: {value if name == 'step' else ''}", cache.render, **{name: value})
                self.expect_error(wrong, words, cache.render, **{name: value})
            for bins in (0, -1, 10**9):
                self.expect_error(wrong, "bins", cache.histogram, scalar, bins=bins)
            self.expect_error(wrong, "finite", cache.histogram, scalar, range=(1, np.inf))
            self.expect_error(wrong, "(x, y, z)", cache.probe, (1, 2))
            self.expect_error(wrong, "level: -1", cache.sample, level=-1)
            self.expect_error(wrong, "frames: -1", cache.orbit, frames=-1)
            whole = cache.render(size=(64, 48), surfaces="kmin", slices=[(0, 0, 0.5, 0, 0, 1)], slice_opacity="function")
            np.testing.assert_array_equal(whole, cache.render(size=(64, 48), surfaces=["kmin"], slices=[(0, 0, 0.5, 0, 0, 1)],
                                                              slice_opacity="function"))

    def test_of_arrays_say_which(self):
        x, y, z, t = bent_duct()
        out = self.folder / "never.splats"
        make = curvisplat.convert_arrays
        self.expect_error(curvisplat.UsageError, "y: the array has the shape", make, out,
                          curvisplat.Block(x, y[1:], z, {"t": t}))
        self.expect_error(curvisplat.UsageError, "int64", make, out, curvisplat.Block(x, y, z, {"t": t.astype("i8")}))
        self.expect_error(curvisplat.UsageError, "2 dimensions", make, out,
                          curvisplat.Block(x[0], y, z, {"t": t}))
        self.expect_error(curvisplat.UsageError, "no block", make, out)
        self.expect_error(curvisplat.UsageError, "dict is no Block", make, out, {"t": t})
        self.expect_error(curvisplat.UsageError, "expected bool", make, out, curvisplat.Block(x, y, z, {"t": t}, blank=t * 0))
        self.expect_error(curvisplat.UsageError, "has no scalar 't'", make, out, curvisplat.Block(x, y, z, {"t": t}),
                          curvisplat.Block(x, y, z, {"u": t}))
        self.assertFalse(out.exists())

    def test_of_a_callable_come_through(self):
        def read(*_):
            raise KeyError("lost")

        out = self.folder / "lost.splats"
        with self.assertRaises(KeyError):
            curvisplat.convert_callable(out, [(4, 4, 4)], read, ["t"])
        self.assertEqual(list(self.folder.glob("lost*")), [])


class Interrupts(PythonTest):
    def test_end_a_conversion_and_leave_nothing(self):
        x, y, z, t = bent_duct(8, 8, 8)

        def read(block, k0, k1, j0, j1, names):
            time.sleep(0.05)
            shape = (k1 - k0, j1 - j0, 64)
            return np.zeros(shape), np.zeros(shape), np.zeros(shape), [np.zeros(shape) for _ in names], None

        out = self.folder / "stopped.splats"
        threading.Timer(0.3, lambda: os.kill(os.getpid(), signal.SIGINT)).start()
        with self.assertRaises(KeyboardInterrupt):
            curvisplat.convert_callable(out, [(4000, 4, 64)] * 50, read, ["t"], memory="160M")
        self.assertEqual(list(self.folder.glob("stopped*")), [])

    def test_leave_no_thread_and_no_memory(self):
        def threads():
            return len(os.listdir("/proc/self/task"))

        def resident():
            with open("/proc/self/statm") as file:
                return int(file.read().split()[1]) * os.sysconf("SC_PAGE_SIZE")

        cache = curvisplat.open(self.cache)
        for _ in range(3):
            cache.render(size=(100, 100))
            cache.render(size=(450, 450), lod_pixels=0)
        before_threads, before = threads(), resident()
        for n in range(RENDERS):
            cache.render(size=(100, 100), view="+x" if n % 2 else "iso")
        for n in range(INTERRUPTS):
            timer = threading.Timer(0.01 * (n % 5), lambda: os.kill(os.getpid(), signal.SIGINT))
            with self.assertRaises(KeyboardInterrupt):
                timer.start()
                while True:
                    cache.render(size=(450, 450), lod_pixels=0)
            timer.join()
        self.assertLessEqual(threads(), before_threads)
        print(f"{RENDERS} renders and {INTERRUPTS} interrupted ones: {threads() - before_threads} threads and {(resident() - before) / (1 << 20):.1f} MiB more")
        self.assertLess(resident() - before, 64 << 20)
        cache.close()


if __name__ == "__main__":
    PROGRAM = sys.argv.pop(1)
    unittest.main(verbosity=1)
