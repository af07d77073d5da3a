"""What the tests of unstructured formats share. Each grid is written by the libraries of the field and converted, and so is VTK's
file of the same cells in the same order: the caches are equal byte by byte but for the names in their manifests. Where VTK reads
the format, it is asked, too.
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
    from mesh_cubes import HEXAHEDRON_FACES, hexahedra, lattice, write_xml
except ModuleNotFoundError as error:
    print(f"skipped: {error}; install python3-vtk9 and python3-numpy")
    sys.exit(77)

PROGRAM = str(pathlib.Path(sys.argv.pop(1)).resolve())
RANDOM = np.random.default_rng(7)
TETRAHEDRA = [(0, 1, 2, 6), (0, 2, 3, 6), (0, 3, 7, 6), (0, 7, 4, 6), (0, 4, 5, 6), (0, 5, 1, 6)]
VTK_KINDS = {4: vtk.VTK_TETRA, 5: vtk.VTK_PYRAMID, 6: vtk.VTK_WEDGE, 8: vtk.VTK_HEXAHEDRON}


class Mesh:
    """A cube of side 1: points, cells by their corners, one field of each centring."""

    def __init__(self, n=4, kinds=(8, 4, 6, 5)):
        points, self.cells = list(lattice(n)), []
        for number, c in enumerate(hexahedra(n)):
            kind = kinds[number * len(kinds) // n**3]
            if kind == 4:
                self.cells += [c[list(t)] for t in TETRAHEDRA]
            elif kind == 6:
                self.cells += [c[[0, 1, 2, 4, 5, 6]], c[[0, 2, 3, 4, 6, 7]]]
            elif kind == 5:
                points.append(np.mean([points[p] for p in c], 0))
                self.cells += [np.array([*c[list(f)], len(points) - 1]) for f in HEXAHEDRON_FACES]
            else:
                self.cells.append(c)
        self.points = np.array(points)
        self.p, self.c = RANDOM.random(len(points)), RANDOM.random(len(self.cells))

    def vtk(self, polyhedra=None):
        """`polyhedra`: the faces of each cell, in place of its corners."""
        grid = vtk.vtkUnstructuredGrid()
        grid.Allocate(1)
        for n, cell in enumerate(self.cells):
            if polyhedra is None:
                grid.InsertNextCell(VTK_KINDS[len(cell)], len(cell), [int(p) for p in cell])
                continue
            ids = vtk.vtkIdList()
            ids.InsertNextId(len(polyhedra[n]))
            for face in polyhedra[n]:
                for word in (len(face), *face):
                    ids.InsertNextId(int(word))
            grid.InsertNextCell(vtk.VTK_POLYHEDRON, ids)
        points = vtk.vtkPoints()
        points.SetData(numpy_to_vtk(self.points, deep=True))
        grid.SetPoints(points)
        for data, name, values in ((grid.GetPointData(), "p", self.p), (grid.GetCellData(), "c", self.c)):
            array = numpy_to_vtk(values, deep=True)
            array.SetName(name)
            data.AddArray(array)
        return grid

    def runs(self):
        """Cells of one kind that follow one another."""
        runs = []
        for cell in self.cells:
            if not runs or len(runs[-1][0]) != len(cell):
                runs.append([])
            runs[-1].append(cell)
        return [np.array(run) for run in runs]

    def faces(self):
        """Each face's corners, its cells, and each cell's faces: (number, turned round)."""
        shapes = {4: [(0, 2, 1), (0, 1, 3), (1, 2, 3), (2, 0, 3)], 8: HEXAHEDRON_FACES,
                  5: [(0, 3, 2, 1), (0, 1, 4), (1, 2, 4), (2, 3, 4), (3, 0, 4)],
                  6: [(0, 2, 1), (3, 4, 5), (0, 1, 4, 3), (1, 2, 5, 4), (2, 0, 3, 5)]}
        faces, sides, of_cells, known = [], [], [], {}
        for n, cell in enumerate(self.cells):
            of_cells.append([])
            for shape in shapes[len(cell)]:
                corners = [int(cell[m]) for m in shape]
                key = tuple(sorted(corners))
                if key in known:
                    sides[known[key]].append(n)
                else:
                    known[key] = len(faces)
                    faces.append(corners)
                    sides.append([n])
                of_cells[-1].append((known[key], sides[known[key]][0] != n))
        return faces, sides, of_cells


class MeshFormats(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.folder = pathlib.Path(folder.name)

    def run_program(self, *words):
        return subprocess.run([PROGRAM, *map(str, words)], capture_output=True, text=True, check=False,
                              errors="replace")

    def info(self, *paths):
        result = self.run_program("info", *paths, "--json")
        self.assertEqual(result.returncode, 0, result.stderr)
        return json.loads(result.stdout)

    def cache(self, paths, scalar, *options):
        """Checksums of a cache's files, and its volume."""
        cache = self.folder / "a.splats"
        result = self.run_program("convert", *paths, "-o", cache, "--scalar", scalar, "--overwrite", *options)
        self.assertEqual(result.returncode, 0, result.stderr)
        files = {str(p.relative_to(cache)): hashlib.sha256(p.read_bytes()).hexdigest()
                 for p in cache.rglob("*") if p.is_file() and p.name != "manifest.json"}
        return files, json.loads((cache / "manifest.json").read_text())["volume"]

    def expect_same(self, paths, grid, names=None, options=()):
        """The file and VTK's file of `grid` give the same caches. `names`: what the file calls p and c."""
        vtu = self.folder / "expected.vtu"
        write_xml(grid, vtu)
        for name in "pc":
            called = (names or {}).get(name, name)
            if called is None:
                continue
            found, volume = self.cache(paths, called, *options)
            expected, _ = self.cache([vtu], name)
            self.assertGreater(len(expected), 1)
            self.assertEqual(sorted(found.values()), sorted(expected.values()), (name, sorted(found)))
            self.assertAlmostEqual(volume, 1, delta=2e-3)

    def expect_line(self, *paths, scalar="c", words=""):
        result = self.run_program("convert", *paths, "-o", self.folder / "d.splats", "--overwrite", "--scalar", scalar)
        self.assertEqual(result.returncode, 1, result.stderr)
        self.assertEqual(result.stderr.count("\n"), 1, result.stderr)
        self.assertIn(words, result.stderr)

    def expect_harmless(self, path, count=40, scalar="c"):
        """Truncated files, and some with a wrong byte, are refused by one line or read. Returns the share that is refused."""
        data, refused = path.read_bytes(), 0
        damaged = [data[:len(data) * n // count] for n in range(count)]
        for n in RANDOM.integers(0, len(data), 2 * count):
            wrong = bytearray(data)
            wrong[n] ^= int(RANDOM.integers(1, 256))
            damaged.append(bytes(wrong))
        tried = some_of(damaged)
        for bytes_of in tried:
            path.write_bytes(bytes_of)
            result = self.run_program("convert", path, "-o", self.folder / "d.splats", "--overwrite", "--scalar", scalar)
            self.assertIn(result.returncode, (0, 1, 2), result.stderr)
            if result.returncode:
                refused += 1
                self.assertEqual(result.stderr.count("\n"), 1, result.stderr)
        path.write_bytes(data)
        return refused / len(tried)
