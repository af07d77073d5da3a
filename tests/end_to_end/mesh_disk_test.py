#!/usr/bin/python3
"""mesh_disk_test.py CURVISPLAT

What conversion of unstructured grids will take on disk: what `--dry-run` estimates beside what --stats then reports, and disks that
are too small. Exit status 77 (skipped) without numpy.
"""
import json
import pathlib
import subprocess
import sys
import unittest

from format_case import PROGRAM, FormatCase
from sweep import some_of

BIG_MESH = pathlib.Path(__file__).resolve().parents[2] / "bench" / "big_mesh.py"


class MeshDisk(FormatCase):
    def mesh(self, *options):
        path = self.folder / "mesh.vtu"
        subprocess.run([sys.executable, BIG_MESH, path, *options], check=True)
        return path

    def stats(self, path, scalar, *options):
        out = self.folder / "stats.json"
        self.convert([path], scalar, "--memory", "160M", "--stats", out, *options)
        return json.loads(out.read_text())

    def test_estimates_are_right(self):
        turn = 0
        for options in some_of((["--size", "42", "--shuffled"], ["--size", "42"], ["--size", "28", "--tetrahedra"],
                                ["--size", "24", "--tetrahedra", "--shuffled"]), 2):
            path = self.mesh(*options)
            turn += 1
            for scalar in some_of("fc", 2, turn=turn):
                with self.subTest(options=options, scalar=scalar):
                    guess = self.stats(path, scalar, "--dry-run")["dry_run"]
                    truth = self.stats(path, scalar)
                    ratio = guess["temporary_bytes"] / truth["temporary_bytes"]
                    self.assertGreater(ratio, 0.97)
                    self.assertLess(ratio, 1.4)
                    self.assertGreater(guess["cache_bytes"] / truth["cache_bytes"], 0.5)
                    self.assertLess(guess["cache_bytes"] / truth["cache_bytes"], 1.5)

    def test_a_series_is_estimated_from_its_first_step(self):
        path = self.mesh("--size", "24", "--tetrahedra")
        steps = [path.rename(self.folder / "mesh.0.vtu"), path.with_name("mesh.1.vtu")]
        steps[1].write_bytes(steps[0].read_bytes())
        out = self.folder / "stats.json"
        self.convert(steps, "f", "--dry-run", "--stats", out)
        guess = json.loads(out.read_text())["dry_run"]
        self.assertEqual(guess["steps"], 2)
        cache = sum(file.stat().st_size for file in self.convert(steps, "f").rglob("*") if file.is_file())
        self.assertGreater(guess["cache_bytes"] / cache, 0.6)
        self.assertLess(guess["cache_bytes"] / cache, 1.6)

    def on_a_disk(self, megabytes, path, scalar, *options):
        """Of a conversion to a disk of that size; skips the test where none can be mounted."""
        disk = self.folder / "disk"
        disk.mkdir(exist_ok=True)
        command = (f"mount -t tmpfs -o size={megabytes}m none '{disk}' && exec '{PROGRAM}' convert '{path}' -o '{disk}/a.splats' "
                   f"--scalar {scalar} --memory 160M {' '.join(options)}")
        done = subprocess.run(["unshare", "--mount", "sh", "-c", command], capture_output=True, text=True, check=False)
        if done.returncode and not done.stderr.startswith("curvisplat: "):
            self.skipTest("no file system can be mounted here")
        return done

    def test_disks_that_suffice_and_that_do_not(self):
        for options in some_of((["--size", "30", "--tetrahedra", "--shuffled"], ["--size", "40", "--tetrahedra"]), 2):
            path = self.mesh(*options)
            for scalar in some_of("fc", 2, turn="--shuffled" in options):
                with self.subTest(options=options, scalar=scalar):
                    truth = self.stats(path, scalar)
                    megabyte = 1 << 20
                    # Both disks are one: temporary files that go before the cache is written leave their space to it.
                    enough = 1.25 * (truth["temporary_bytes"] + truth["cache_bytes"]) / megabyte + 2
                    self.assertEqual(self.on_a_disk(round(enough), path, scalar).returncode, 0)
                    too_small = self.on_a_disk(round(0.8 * truth["temporary_bytes"] / megabyte), path, scalar)
                    self.assertEqual(too_small.returncode, 1)
                    self.assertIn("the cache and temporary files need about", too_small.stderr)


if __name__ == "__main__":
    unittest.main()
