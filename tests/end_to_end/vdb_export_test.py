#!/usr/bin/python3
"""vdb_export_test.py CURVISPLAT

`export -o out.vdb` against closed forms, read by OpenVDB's own Python module. Exit status 77 (skipped) without python3-openvdb.
"""
import os
import pathlib
import re
import resource
import subprocess
import sys
import tempfile
import unittest

try:
    import numpy as np
    import pyopenvdb as vdb
except ImportError as error:
    print(f"skipped: {error}")
    sys.exit(77)

PROGRAM = sys.argv.pop(1)


def run(*words, fails=False):
    done = subprocess.run([PROGRAM, *map(str, words)], capture_output=True, text=True)
    assert (done.returncode != 0) == fails, done.stderr
    return done.stderr if fails else done.stdout


def write_plot3d(folder, name, places, scalar):
    """NAME.xyz and NAME.f, in single precision."""
    shape = scalar.shape[::-1]
    (folder / f"{name}.xyz").write_bytes(np.array(shape, "<i4").tobytes() + b"".join(a.astype("<f4").tobytes() for a in places))
    (folder / f"{name}.f").write_bytes(np.array([*shape, 1], "<i4").tobytes() + scalar.astype("<f4").tobytes())


class Grid:
    """A grid of a file, as an array over its bounding box, with the middles of its voxels."""

    def __init__(self, grid):
        lower, upper = np.array(grid.evalActiveVoxelBoundingBox())
        self.values = np.zeros(upper - lower + 1, "f4")
        grid.copyToArray(self.values, ijk=tuple(map(int, lower)))
        self.voxel = grid.transform.voxelSize()[0]
        first = np.array(grid.transform.indexToWorld(tuple(map(int, lower))))
        index = np.stack(np.meshgrid(*map(np.arange, self.values.shape), indexing="ij"), -1)
        self.places = first + self.voxel * index
        self.active = grid.activeVoxelCount()


class VdbExport(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.holder = tempfile.TemporaryDirectory()
        cls.folder = pathlib.Path(cls.holder.name)
        # A ring of the radii 1 to 2 and the height 1, in the middle of which the nodes crowd: T = x + 2 y + 3 z.
        k, r, a = np.meshgrid(np.linspace(0, 1, 20), 1.5 + 0.5 * np.sinh(3 * np.linspace(-1, 1, 40)) / np.sinh(3), np.linspace(0, 1.5 * np.pi, 120),
                              indexing="ij")
        x, y = r * np.cos(a), r * np.sin(a)
        write_plot3d(cls.folder, "ring", (x, y, k), x + 2 * y + 3 * k)
        run("convert", cls.folder / "ring.xyz", cls.folder / "ring.f", "-o", cls.folder / "ring.splats")

    @classmethod
    def tearDownClass(cls):
        cls.holder.cleanup()

    def exported(self, *options, cache="ring.splats", name="out.vdb"):
        text = run("export", self.folder / cache, "-o", self.folder / name, *options)
        grids, _ = vdb.readAll(str(self.folder / name))
        return text, {grid.name: grid for grid in grids}

    def test_has_the_values_and_the_volume_of_the_data(self):
        for voxels in (48, 96, 200) if "CURVISPLAT_WHOLE" in os.environ else (48, 120):
            text, grids = self.exported("--voxels", voxels)
            self.assertEqual(set(grids), {"value", "density"})
            density, value = Grid(grids["density"]), Grid(grids["value"])
            self.assertEqual(density.active, value.active)
            self.assertIn(f" {density.active} voxels", text)
            self.assertEqual(grids["density"].gridClass, "fog volume")
            self.assertEqual(grids["value"]["scalar"], "1")  # of a function file without names
            volume = density.values.sum(dtype="f8") * density.voxel**3
            exact = 0.5 * 1.5 * np.pi * (2**2 - 1)
            # Inside: the ring, less two voxels at each side. Outside: more than two voxels away.
            radius, z = np.hypot(*density.places[..., :2].transpose(3, 0, 1, 2)), density.places[..., 2]
            angle = np.arctan2(density.places[..., 1], density.places[..., 0]) % (2 * np.pi)
            two = 2 * density.voxel
            inside = ((radius > 1 + two) & (radius < 2 - two) & (z > two) & (z < 1 - two) & (angle > two) & (angle < 1.5 * np.pi - two))
            far = (radius < 1 - two) | (radius > 2 + two) | ((angle > 1.5 * np.pi + two) & (angle < 2 * np.pi - two))
            error = np.abs(value.values - value.places @ [1, 2, 3])[inside]
            print(f"{voxels} voxels: volume {volume:.4f} of {exact:.4f}, {inside.sum()} inside: density {density.values[inside].min():.3f} to "
                  f"{density.values[inside].max():.3f}, value {error.max():.4f} off")
            self.assertAlmostEqual(volume / exact, 1, delta=0.005)
            self.assertGreater(inside.sum(), 1000)
            self.assertLess(error.max(), 0.02)
            self.assertLess(np.abs(density.values[inside] - 1).max(), 0.15)
            self.assertLess(np.abs(density.values[inside] - 1).mean(), 0.02)
            self.assertTrue((density.values[far] == 0).all() and far.any())

    def test_is_the_same_for_any_memory_and_threads(self):
        _, first = self.exported("--voxels", 100)
        first = {name: Grid(grid).values for name, grid in first.items()}
        one = subprocess.run(["taskset", "-c", "0", PROGRAM, "export", str(self.folder / "ring.splats"), "-o", str(self.folder / "one.vdb"), "--voxels",
                              "100", "--memory", "96M"], capture_output=True, text=True)
        self.assertEqual(one.returncode, 0, one.stderr)
        for grid in vdb.readAll(str(self.folder / "one.vdb"))[0]:
            np.testing.assert_array_equal(Grid(grid).values, first[grid.name])

    def test_keeps_to_the_memory(self):
        limit = 96
        command = [PROGRAM, "export", str(self.folder / "ring.splats"), "-o", str(self.folder / "big.vdb"), "--voxels", "256", "--memory", f"{limit}M"]
        script = ("import resource, subprocess, sys; code = subprocess.run(sys.argv[1:], capture_output=True).returncode; "
                  "print(code, resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss)")

        def peak(words):
            code, kilobytes = subprocess.run([sys.executable, "-c", script, *words], capture_output=True, text=True, check=True).stdout.split()
            self.assertEqual(code, "0")
            return int(kilobytes) / 1024
        # The program itself, its libraries and a decoded brick.
        small = peak([*command[:-4], "--voxels", "8", "--memory", f"{limit}M"])
        large = peak(command)
        print(f"memory: {large:.0f} MiB for 256 voxels, {small:.0f} for 8; limit {limit}")
        if "CURVISPLAT_SANITIZED" not in os.environ:  # sanitizers keep freed memory
            self.assertLess(large - small, limit)
        message = run("export", self.folder / "ring.splats", "-o", self.folder / "never.vdb", "--voxels", 2000, "--memory", "96M", fails=True)
        self.assertRegex(message, "give --memory .*M or fewer --voxels")
        self.assertFalse((self.folder / "never.vdb").exists())

    def test_that_does_not_fit_on_the_disk_is_an_error_and_leaves_no_file(self):
        whole = self.folder / "whole.vdb"
        run("export", self.folder / "ring.splats", "-o", whole, "--voxels", 64)
        # Near the end, too, where a buffer is written last.
        for limit in (8192, whole.stat().st_size // 2, whole.stat().st_size - 1):
            done = subprocess.run([PROGRAM, "export", str(self.folder / "ring.splats"), "-o", str(self.folder / "never.vdb"), "--voxels", "64"],
                                  capture_output=True, text=True,
                                  preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (limit, limit)))
            self.assertEqual(done.returncode, 1, f"{limit} bytes: {done.stdout}")
            self.assertEqual(done.stderr.count("\n"), 1, done.stderr)
            self.assertRegex(done.stderr, "never.vdb: .*File too large")
            self.assertFalse((self.folder / "never.vdb").exists())
        self.assertEqual([p.name for p in self.folder.iterdir() if p.name.startswith(".curvisplat")], [])

    def test_has_a_step_and_a_scalar_and_says_what_is_wrong(self):
        run("generate", "wake", "--size", "24x20x12", "--steps", "3", "-o", self.folder / "w")
        run("convert", self.folder / "w.xyz", self.folder / "w_*.fun", "-o", self.folder / "w.splats")
        first, last = (self.exported("--voxels", 24, "--step", step, cache="w.splats")[1] for step in (0, 2))
        self.assertNotEqual(first["value"]["time"], last["value"]["time"])
        self.assertFalse(np.array_equal(Grid(first["value"]).values, Grid(last["value"]).values))
        np.testing.assert_array_equal(Grid(first["density"]).values, Grid(last["density"]).values)
        for options, words in ((["--step", 3], "step"), (["--voxels", 0], "--voxels"), (["--voxels", 9000], "at most 8192"), (["--scalar", "none"], "none")):
            message = run("export", self.folder / "w.splats", "-o", self.folder / "never.vdb", *options, fails=True)
            self.assertIn(words, message)
            self.assertEqual(message.count("\n"), 1)
        self.assertFalse((self.folder / "never.vdb").exists())
        self.assertEqual([p.name for p in self.folder.iterdir() if p.name.startswith(".curvisplat")], [])

    def test_options_of_other_files_are_refused(self):
        of_splats = (["--opacity", "ramp"], ["--range", "0,1"], ["--tf", "viridis"], ["--max-splats", "1M"], ["--no-comparison"])
        for name, options in [("never.vdb", words) for words in of_splats] + [("never.ply", ["--voxels", 20])]:
            message = run("export", self.folder / "ring.splats", "-o", self.folder / name, *options, fails=True)
            self.assertIn(f"{options[0]} cannot be combined with", message)
            self.assertFalse((self.folder / name).exists())


if __name__ == "__main__":
    unittest.main(verbosity=1)
