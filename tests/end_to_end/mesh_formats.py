"""What the tests of unstructured formats share. Each grid is written by the libraries of the field and converted, and so is VTK's
file of the same cells in the same order: the caches are equal byte by byte (format_case.py). Where VTK reads the format, it is
asked, too.
"""
import sys

from format_case import PROGRAM, FormatCase, np  # noqa: F401

try:
    import vtk
    from vtk.util.numpy_support import numpy_to_vtk

    from mesh_cubes import HEXAHEDRON_FACES, hexahedra, lattice, write_xml
except ModuleNotFoundError as error:
    print(f"skipped: {error}; install python3-vtk9")
    sys.exit(77)

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


class MeshFormats(FormatCase):
    SCALAR = "c"
    RANDOM = RANDOM

    def volume(self, paths, scalar, *options):
        """Of the cache."""
        return self.manifest(self.convert(paths, scalar, *options))["volume"]

    def expect_same(self, paths, grid, names=None, options=()):
        """The file and VTK's file of `grid`, of volume 1, give the same caches. `names`: what the file calls p and c."""
        vtu = self.folder / "expected.vtu"
        write_xml(grid, vtu)
        self.expect_same_caches(paths, vtu, names, options)
        self.assertAlmostEqual(self.manifest(self.folder / "a.splats")["volume"], 1, delta=2e-3)
