"""What the tests of structured formats share. Each grid is written in the format under test, and by VTK: the caches are equal byte
by byte but for the names in their manifests, so that every coordinate, value and blanked sample is the same. Where VTK reads the
format, it is asked, too.
"""
import hashlib
import json
import pathlib
import subprocess
import sys
import tempfile
import unittest

try:
    import numpy as np
    import vtk
    from vtk.util.numpy_support import numpy_to_vtk

    from sweep import some_of
except ModuleNotFoundError as error:
    print(f"skipped: {error}; install python3-vtk9 and python3-numpy")
    sys.exit(77)

PROGRAM = str(pathlib.Path(sys.argv.pop(1)).resolve())
RANDOM = np.random.default_rng(11)


class Block:
    """Curved nodes, indexed (k, j, i), a field `p` of the nodes and a field `c` of the cells. No two dimensions are equal."""

    def __init__(self, shape=(6, 5, 7), shift=0.0, kind="f8"):
        k, j, i = np.meshgrid(*map(np.arange, shape), indexing="ij")
        bent = 0.3 * np.sin(0.5 * k + 0.2 * j)
        self.places = np.stack([i + shift + bent, j + 0.1 * i, k + 0.2 * np.cos(0.3 * i)]).astype(kind)
        self.p = RANDOM.random(shape).astype(kind)
        self.c = RANDOM.random([n - 1 for n in shape]).astype(kind)
        self.shape = shape

    def vtk(self):
        grid, points = vtk.vtkStructuredGrid(), vtk.vtkPoints()
        points.SetData(numpy_to_vtk(np.moveaxis(self.places, 0, -1).reshape(-1, 3).copy(), deep=True))
        grid.SetDimensions(*self.shape[::-1])
        grid.SetPoints(points)
        for data, name in ((grid.GetPointData(), "p"), (grid.GetCellData(), "c")):
            array = numpy_to_vtk(getattr(self, name).ravel(), deep=True)
            array.SetName(name)
            data.AddArray(array)
        return grid


class StructuredFormats(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.folder = pathlib.Path(folder.name)

    def run_program(self, *words):
        return subprocess.run([PROGRAM, *map(str, words)], capture_output=True, text=True, check=False, errors="replace")

    def info(self, *paths):
        result = self.run_program("info", *paths, "--json")
        self.assertEqual(result.returncode, 0, result.stderr)
        return json.loads(result.stdout)

    def cache(self, paths, scalar, *options):
        """Checksums of a cache's files."""
        cache = self.folder / "a.splats"
        result = self.run_program("convert", *paths, "-o", cache, "--scalar", scalar, "--overwrite", *options)
        self.assertEqual(result.returncode, 0, result.stderr)
        return sorted(hashlib.sha256(p.read_bytes()).hexdigest()
                      for p in cache.rglob("*") if p.is_file() and p.name != "manifest.json")

    def vtk_file(self, blocks):
        """VTK's own file of the blocks."""
        path = self.folder / "expected.vtm"
        collection = vtk.vtkMultiBlockDataSet()
        for n, block in enumerate(blocks):
            collection.SetBlock(n, block.vtk())
        writer = vtk.vtkXMLMultiBlockDataWriter()
        writer.SetFileName(str(path))
        writer.SetInputData(collection)
        writer.Write()
        return path

    def expect_same(self, paths, blocks, names=None, options=()):
        """The files and VTK's file of the blocks give the same caches. `names`: what the files call p and c; None: nothing."""
        expected = self.vtk_file(blocks)
        for name in "pc":
            called = (names or {}).get(name, name)
            if called is None:
                continue
            found = self.cache(paths, called, *options)
            self.assertGreater(len(found), 1)
            self.assertEqual(found, self.cache([expected], name), name)

    def expect_line(self, *paths, scalar="p", words=""):
        result = self.run_program("convert", *paths, "-o", self.folder / "d.splats", "--overwrite", "--scalar", scalar)
        self.assertEqual(result.returncode, 1, result.stderr)
        self.assertEqual(result.stderr.count("\n"), 1, result.stderr)
        self.assertIn(words, result.stderr)

    def expect_harmless(self, path, count=40, scalar="p", opened=None):
        """Truncated files, and some with a wrong byte, are refused by one line or read. Returns the share that is refused.
        `opened`: the file that names `path`."""
        data, refused = path.read_bytes(), 0
        damaged = [data[:len(data) * n // count] for n in range(count)]
        for n in RANDOM.integers(0, len(data), 2 * count):
            wrong = bytearray(data)
            wrong[n] ^= int(RANDOM.integers(1, 256))
            damaged.append(bytes(wrong))
        tried = some_of(damaged)
        for bytes_of in tried:
            path.write_bytes(bytes_of)
            result = self.run_program("convert", opened or path, "-o", self.folder / "d.splats", "--overwrite", "--scalar", scalar)
            self.assertIn(result.returncode, (0, 1, 2), result.stderr)
            if result.returncode:
                refused += 1
                errors = [line for line in result.stderr.splitlines() if not line.startswith("curvisplat: warning")]
                self.assertEqual(len(errors), 1, result.stderr)
        path.write_bytes(data)
        return refused / len(tried)

    def peak_memory(self, path, scalar, budget):
        """Peak memory in bytes of a conversion within `budget` ("144M")."""
        statistics = self.folder / "stats.json"
        result = self.run_program("convert", path, "-o", self.folder / "m.splats", "--overwrite", "--scalar", scalar,
                                  "--memory", budget, "--stats", statistics)
        self.assertEqual(result.returncode, 0, result.stderr)
        return json.loads(statistics.read_text())["peak_memory_bytes"]
