#!/usr/bin/python3
"""precision_test.py CURVISPLAT

How finely values are stored, as the reader that was written from stream/FORMAT.md decodes them: within the bound that `info` of the
cache prints, at both precisions, in a series too. Exit status 77 (skipped) without python3-zstandard and python3-xxhash.
"""
import json
import os
import pathlib
import subprocess
import sys
import unittest

from structured_formats import PROGRAM, RANDOM, Block, StructuredFormats, np

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent.parent / "stream"))
try:
    import read_cache
except ModuleNotFoundError as error:
    print(f"skipped: {error}; install python3-zstandard and python3-xxhash")
    sys.exit(77)


class Precision(StructuredFormats):
    def block(self):
        """A field with an outlier: 16 bits of its range are coarse for the others."""
        block = Block((7, 8, 9), kind="f4")
        block.p[3, 4, 5] = 1e5
        return block

    def means(self, cache, block, step=0):
        """Of the leaves' splats, by node. A mean is over the node's cell: the node's value where the field is linear."""
        reader = read_cache.Cache(cache, step)
        found = np.full(block.shape, np.nan)
        number = next(iter(reader.tables))
        for n, brick in enumerate(reader.bricks):
            if brick["children"][1]:
                continue
            means = iter(reader.values(number, n)["mean"].astype(np.float32))
            for _, k, j, i, count in reader.geometry(n)["runs"]:
                for m in range(count):
                    found[k, j, i + m] = next(means)
        self.assertFalse(np.isnan(found).any())
        return found

    def convert(self, *words):
        cache = self.folder / "a.splats"
        result = self.run_program("convert", *words, "-o", cache, "--scalar", "p", "--overwrite")
        self.assertEqual(result.returncode, 0, result.stderr)
        self.said = result.stdout
        return cache

    def test_convert_prints_the_bound(self):
        paths = []
        for n in range(2):
            block = self.block()
            block.p *= 1 + n
            path = self.vtk_file([block]).rename(self.folder / f"t{n}.vtm")
            (self.folder / "expected").rename(self.folder / f"t{n}")
            path.write_text(path.read_text().replace("expected/", f"t{n}/"))
            paths.append(path)
        for precision in ("normal", "fine"):
            bound = self.info(self.convert(paths[0], "--value-precision", precision))["stored_within"][0]
            self.assertIn(f", rounded within {bound:.1e}, typically ", self.said)
            cache = self.convert(*paths, "--value-precision", precision)
            bound = json.loads(self.run_program("info", cache, "--json", "--step", 1).stdout)["stored_within"][0]
            self.assertIn("\np at the last step: ", self.said)
            self.assertIn(f", rounded within {bound:.1e}, typically ", self.said)

    def test_grids_that_are_opened_directly(self):
        path, kept = self.vtk_file([self.block()]), self.folder / "kept"
        for precision in ("normal", "fine", "fine"):
            done = subprocess.run([PROGRAM, "render", path, "-o", self.folder / "a.png", "--size", "20x20", "--value-precision", precision],
                                  env={**os.environ, "XDG_CACHE_HOME": str(kept)}, capture_output=True, text=True, check=False)
            self.assertEqual(done.returncode, 0, done.stderr)
        caches = [json.loads(m.read_text())["requires"] for m in kept.rglob("manifest.json")]
        self.assertEqual(sorted("fine-values" in c for c in caches), [False, True])
        result = self.run_program("render", self.convert(path), "-o", self.folder / "a.png", "--value-precision", "fine")
        self.assertEqual(result.returncode, 2)
        self.assertIn("is for grids", result.stderr)

    def test_a_linear_field(self):
        """Its means are the nodes' values, but for the ends of the grid, where they are means over half a cell."""
        block = self.block()
        k, j, i = np.meshgrid(*map(np.arange, block.shape), indexing="ij")
        block.places = np.stack([i, j, k]).astype("f4")
        block.p = (1e5 * (i + 0.1 * j + 0.01 * k) + 0.3).astype("f4")
        inside = (slice(1, -1),) * 3
        bounds = []
        for precision in ("normal", "fine"):
            cache = self.convert(self.vtk_file([block]), "--value-precision", precision)
            info = self.info(cache)
            bounds.append(info["stored_within"][0])
            errors = np.abs(self.means(cache, block) - block.p)
            self.assertTrue((errors <= bounds[-1] + 2 * np.spacing(np.abs(block.p)))[inside].all(), (errors[inside].max(), bounds))
            self.assertEqual("fine-values" in info["requires"], precision == "fine")
            self.assertIn("rounded within", self.run_program("info", cache).stdout)
            verified = self.run_program("info", cache, "--verify")
            self.assertEqual(verified.returncode, 0, verified.stdout + verified.stderr)
        self.assertAlmostEqual(bounds[0] / bounds[1], 16777215 / 65535, places=3)

    def test_an_outlier(self):
        """Both precisions store the same within their bounds; at the normal one the small values have lost a hundredth."""
        block, means, bounds = self.block(), [], []
        for precision in ("normal", "fine"):
            cache = self.convert(self.vtk_file([block]), "--value-precision", precision)
            means.append(self.means(cache, block))
            bounds.append(self.info(cache)["stored_within"][0])
        apart = np.abs(means[0] - means[1])
        self.assertTrue((apart <= sum(bounds) + 2 * np.spacing(np.abs(means[1]).astype("f4"))).all(), (apart.max(), bounds))
        self.assertGreater(apart.max(), 0.3 * bounds[0])
        self.assertGreater(bounds[0], 0.1)
        self.assertLess(bounds[1], 0.01)

    def test_warnings_of_finer_differences(self):
        """A range of fewer than 100 steps of the stored values, and an isovalue that lies between two of them."""
        def warnings(*words):
            result = self.run_program(*words)
            self.assertEqual(result.returncode, 0, result.stderr)
            return [line for line in result.stderr.splitlines() if "stored values" in line]

        picture = ["-o", self.folder / "a.png", "--size", "20x20"]
        path = self.vtk_file([self.block()])
        cache = self.convert(path, "--value-precision", "normal")
        step = 2 * self.info(cache)["stored_within"][0]
        self.assertGreater(step, 0.5)
        self.assertEqual(warnings("render", cache, *picture, "--range", f"0,{101 * step}"), [])
        said = warnings("render", cache, *picture, "--range", f"0,{99 * step}")
        self.assertEqual(len(said), 1)
        self.assertIn(f"of p is finer than its stored values, which have steps of up to {step:.2g} there; convert again with --value-precision auto or fine",
                      said[0])
        self.assertEqual(len(warnings("render", cache, *picture, "--iso", "0.5", "--range", f"0,{101 * step}")), 1)
        self.assertEqual(len(warnings("render", cache, *picture, "--range", f"0,{99 * step}", "--iso", "0.5")), 2)
        self.assertEqual(len(warnings("export", cache, "--iso", "0.5", "-o", self.folder / "a.ply")), 1)
        self.assertEqual(warnings("export", cache, "--iso", "0.5", "--source", "-o", self.folder / "b.ply"), [])
        # The opacities' scalar is another one.
        both = self.folder / "both.splats"
        result = self.run_program("convert", path, "-o", both, "--scalar", "p,volume", "--value-precision", "normal")
        self.assertEqual(result.returncode, 0, result.stderr)
        by = ["--scalar", "volume", "--opacity-by", "p", "--opacity-range"]
        self.assertEqual(warnings("render", both, *picture, *by, f"0,{101 * step}"), [])
        self.assertEqual(len(warnings("render", both, *picture, *by, f"0,{99 * step}")), 1)
        # By their own scale the small values are stored more finely.
        cache = self.convert(path)
        self.assertEqual(warnings("render", cache, *picture, "--range", f"0,{99 * step}", "--iso", "0.5"), [])
        # Steps of `fine` are 1/256 of those of `normal`, 0.0024; those of `auto` 1/1024 of the spread, which is below 1.
        said = warnings("render", cache, *picture, "--range", "0.5,0.51")
        self.assertEqual(len(said), 1)
        self.assertIn("; no precision stores finer ones there", said[0])

    def test_series(self):
        """Steps that are predicted from earlier ones."""
        blocks, alone = [self.block() for _ in range(4)], []
        for n, block in enumerate(blocks):
            block.places = blocks[0].places
            block.p = (blocks[0].p * (1 + 0.01 * n)).astype("f4")
            path = self.vtk_file([block]).rename(self.folder / f"t{n}.vtm")
            (self.folder / "expected").rename(self.folder / f"t{n}")
            path.write_text(path.read_text().replace("expected/", f"t{n}/"))
            alone.append(self.means(self.convert(path, "--value-precision", "fine"), block))
        cache = self.convert(*(self.folder / f"t{n}.vtm" for n in range(4)), "--value-precision", "fine")
        bound = self.info(cache)["stored_within"][0] * 1.1
        for n, block in enumerate(blocks):
            apart = np.abs(self.means(cache, block, n) - alone[n])
            self.assertTrue((apart <= 2 * bound + 2 * np.spacing(np.abs(alone[n]).astype("f4"))).all(), (n, apart.max(), bound))

    def test_a_wrong_word(self):
        result = self.run_program("convert", self.vtk_file([self.block()]), "-o", self.folder / "a.splats", "--value-precision", "finer")
        self.assertEqual(result.returncode, 2)
        self.assertEqual(result.stderr.count("\n"), 1, result.stderr)
        self.assertIn("fine", result.stderr)


if __name__ == "__main__":
    unittest.main(verbosity=2)
