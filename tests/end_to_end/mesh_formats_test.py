#!/usr/bin/python3
"""mesh_formats_test.py CURVISPLAT

Unstructured grids of further formats, written by the libraries of the field. Each is converted, and so is VTK's file of the
same cells in the same order: the caches are equal byte by byte but for the names in their manifests. Where VTK reads the
format, it is asked, too. Exit status 77 (skipped) without python3-vtk9.
"""
import ctypes
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
    from vtk.util.numpy_support import numpy_to_vtk, vtk_to_numpy

    import cgns_library as cg
    from mesh_cubes import HEXAHEDRON_FACES, hexahedra, lattice, write_xml
except ModuleNotFoundError as error:
    print(f"skipped: {error}; install python3-vtk9 and python3-numpy")
    sys.exit(77)

try:
    import meshio
except ModuleNotFoundError:
    meshio = None
try:
    import netCDF4
except ModuleNotFoundError:
    netCDF4 = None

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
        """Truncated files, and some with a wrong byte, are refused by one line or read. Returns how many are refused."""
        data, refused = path.read_bytes(), 0
        damaged = [data[:len(data) * n // count] for n in range(count)]
        for n in RANDOM.integers(0, len(data), 2 * count):
            wrong = bytearray(data)
            wrong[n] ^= int(RANDOM.integers(1, 256))
            damaged.append(bytes(wrong))
        for bytes_of in damaged:
            path.write_bytes(bytes_of)
            result = self.run_program("convert", path, "-o", self.folder / "d.splats", "--overwrite", "--scalar", scalar)
            self.assertIn(result.returncode, (0, 1, 2), result.stderr)
            if result.returncode:
                refused += 1
                self.assertEqual(result.stderr.count("\n"), 1, result.stderr)
        path.write_bytes(data)
        return refused


@unittest.skipUnless(cg.library(), "no libcgns")
class CgnsMeshes(MeshFormats):
    def setUp(self):
        super().setUp()
        self.path = self.folder / "mesh.cgns"

    def finish(self, file, mesh):
        file.solution("Nodes", cg.VERTEX, {"p": mesh.p})
        file.solution("Cells", cg.CELL_CENTER, {"c": mesh.c})

    def write_sections(self, mesh, kind=cg.HDF5, wall=True):
        kinds = {4: cg.TETRA_4, 5: cg.PYRA_5, 6: cg.PENTA_6, 8: cg.HEXA_8}
        with cg.CgnsFile(self.path, kind) as file:
            file.base()
            file.family("Walls")
            file.zone("Cube", mesh.points, len(mesh.cells))
            if wall:
                file.section("wall", cg.QUAD_4, mesh.cells[0][None, :4] + 1)
            for n, run in enumerate(mesh.runs()):
                file.section(f"run {n}", kinds[run.shape[1]], run + 1)
            file.wall("Bottom", [1, 2, 3])
            self.finish(file, mesh)

    def mixed(self, mesh, faces=0):
        kinds = {4: cg.TETRA_4, 5: cg.PYRA_5, 6: cg.PENTA_6, 8: cg.HEXA_8}
        words = [[cg.QUAD_4, *(mesh.cells[0][:4] + 1)]] * faces + [[kinds[len(c)], *(c + 1)] for c in mesh.cells]
        begins = np.cumsum([0] + [len(w) for w in words])
        return np.concatenate(words), begins

    def write_polyhedra(self, mesh, cells=True, parents=True):
        faces, sides, of_cells = mesh.faces()
        with cg.CgnsFile(self.path) as file:
            file.base()
            file.zone("Cube", mesh.points, len(mesh.cells))
            half = len(faces) // 2
            for name, part in (("low", faces[:half]), ("high", faces[half:])):
                section = file.section(name, cg.NGON, np.concatenate(part) + 1, len(part),
                                       np.cumsum([0] + [len(f) for f in part]))
                if parents:
                    of = sides[:half] if name == "low" else sides[half:]
                    first = len(faces) + 1
                    file.parents(section, np.array([s[0] + first for s in of]),
                                 np.array([s[1] + first if len(s) > 1 else 0 for s in of]))
            if cells:
                signed = [[-(f + 1) if turned else f + 1 for f, turned in cell] for cell in of_cells]
                file.section("cells", cg.NFACE, np.concatenate(signed), len(signed),
                             np.cumsum([0] + [len(c) for c in signed]))
            self.finish(file, mesh)
        if cells:
            return [[faces[f] for f, _ in cell] for cell in of_cells]
        # By the sides of faces: first the one, then the other.
        sorted_cells = [[] for _ in mesh.cells]
        for part in (range(half), range(half, len(faces))):
            for side in (0, 1):
                for face in part:
                    if side < len(sides[face]):
                        sorted_cells[sides[face][side]].append(faces[face])
        return sorted_cells

    def old_layout(self, *sections):
        """Rewrites sections as CGNS before 3.4 had them: lengths among the numbers, no offsets."""
        import h5py
        with h5py.File(self.path, "r+") as file:
            for name in sections:
                group = file[f"Base/Cube/{name}"]
                words = group["ElementConnectivity/ data"][:]
                begins = group["ElementStartOffset/ data"][:]
                if group[" data"][0] != cg.MIXED:
                    words = np.concatenate([[b - a, *words[a:b]] for a, b in zip(begins, begins[1:])]).astype("i4")
                del group["ElementStartOffset"]
                del group["ElementConnectivity/ data"]
                group["ElementConnectivity"].create_dataset(" data", data=words)

    def test_sections_of_one_kind(self):
        mesh = Mesh()
        for kind in (cg.HDF5, cg.ADF):
            with self.subTest(kind=kind):
                self.write_sections(mesh, kind)
                info = self.info(self.path)
                self.assertEqual(info["nodes"], len(mesh.points))
                self.assertEqual(info["cells"]["count"], len(mesh.cells))
                self.assertIn("unstructured zone", info["format"])
                self.assertTrue(any("BCWall" in note for note in info["notes"]), info["notes"])
                self.assertTrue(any("Walls" in note for note in info["notes"]), info["notes"])
                self.expect_same([self.path], mesh.vtk())

    def test_mixed_sections(self):
        mesh = Mesh()
        words, begins = self.mixed(mesh)
        with cg.CgnsFile(self.path) as file:
            file.base()
            file.zone("Cube", mesh.points, len(mesh.cells))
            file.section("all", cg.MIXED, words, len(mesh.cells), begins)
            self.finish(file, mesh)
        self.expect_same([self.path], mesh.vtk())
        self.old_layout("all")
        self.expect_same([self.path], mesh.vtk())

    def test_mixed_sections_with_faces(self):
        mesh = Mesh()
        words, begins = self.mixed(mesh, faces=3)
        with cg.CgnsFile(self.path) as file:
            file.base()
            file.zone("Cube", mesh.points, len(mesh.cells))
            file.section("all", cg.MIXED, words, len(mesh.cells) + 3, begins)
            self.finish(file, mesh)
        warnings = self.info(self.path)["warnings"]
        self.assertTrue(any("3 elements are nodes, lines or faces" in w for w in warnings), warnings)
        self.assertTrue(any("cell-centred fields" in w for w in warnings), warnings)
        self.expect_same([self.path], mesh.vtk(), {"c": None})

    def test_polyhedra(self):
        mesh = Mesh()
        self.expect_same([self.path], mesh.vtk(self.write_polyhedra(mesh, parents=False)))
        self.old_layout("low", "high", "cells")
        self.expect_same([self.path], mesh.vtk(self.write_polyhedra(mesh)))
        self.expect_same([self.path], mesh.vtk(self.write_polyhedra(mesh, cells=False)))
        self.write_polyhedra(mesh, cells=False, parents=False)
        self.expect_line(self.path, words="neither cells (NFACE_n) nor ParentElements")

    def test_several_zones_and_quadratic_elements(self):
        mesh = Mesh(kinds=(8,))
        middles = np.array([(mesh.points[c[a]] + mesh.points[c[b]]) / 2 for c in mesh.cells for a, b in
                            [(0, 1), (1, 2), (2, 3), (3, 0), (0, 4), (1, 5), (2, 6), (3, 7), (4, 5), (5, 6), (6, 7), (7, 4)]])
        points = np.concatenate([mesh.points, middles])
        half = len(mesh.cells) // 2
        with cg.CgnsFile(self.path) as file:
            file.base()
            for name, part in (("Low", range(half)), ("High", range(half, len(mesh.cells)))):
                file.zone(name, points, half)
                number = len(mesh.points) + 12 * np.array(part)[:, None] + np.arange(12)
                file.section("bricks", cg.HEXA_20, np.concatenate([np.array(mesh.cells)[part], number], 1) + 1)
                file.solution("Cells", cg.CELL_CENTER, {"c": mesh.c[part]})
        info = self.info(self.path)
        self.assertEqual(info["cells"]["count"], len(mesh.cells))
        self.assertTrue(any("higher order" in w for w in info["warnings"]), info["warnings"])
        self.assertAlmostEqual(self.cache([self.path], "c")[1], 1, delta=2e-3)

    def test_the_reader_of_vtk_agrees(self):
        mesh = Mesh()
        self.write_sections(mesh, wall=False)
        reader = vtk.vtkCGNSReader()
        reader.SetFileName(str(self.path))
        reader.UpdateInformation()
        reader.EnableAllPointArrays()
        reader.EnableAllCellArrays()
        reader.Update()
        grid = reader.GetOutput().GetBlock(0).GetBlock(0)
        while not grid.IsA("vtkUnstructuredGrid"):
            grid = grid.GetBlock(0)
        self.assertEqual(grid.GetNumberOfCells(), len(mesh.cells))
        self.expect_same([self.path], grid)

    def test_damage(self):
        mesh = Mesh(2)
        self.write_sections(mesh, cg.ADF)
        self.assertGreater(self.expect_harmless(self.path), 40)
        self.write_polyhedra(mesh)
        self.assertGreater(self.expect_harmless(self.path), 40)

    def test_numbers_that_do_not_exist(self):
        import h5py
        mesh = Mesh(2)
        for where, value in (("low/ElementConnectivity", 10**6), ("cells/ElementConnectivity", 0),
                             ("cells/ElementConnectivity", -(2**31)), ("cells/ElementStartOffset", -1),
                             ("low/ElementStartOffset", 2**31 - 1), ("cells/ElementRange", 2**31 - 1)):
            with self.subTest(where=where, value=value):
                self.write_polyhedra(mesh)
                with h5py.File(self.path, "r+") as file:
                    data = file[f"Base/Cube/{where}/ data"]
                    data[min(len(data) - 1, 3)] = value
                self.expect_line(self.path, words="mesh.cgns")


class Su2Meshes(MeshFormats):
    def setUp(self):
        super().setUp()
        self.path, self.restart = self.folder / "mesh.su2", self.folder / "restart_flow"

    def write(self, mesh, numbered=True, zones=1):
        kinds = {4: 10, 5: 14, 6: 13, 8: 12}
        with self.path.open("w") as out:
            if zones > 1:
                out.write(f"NZONE= {zones}\n")
            for zone in range(zones):
                of_zone = range(zone * len(mesh.cells) // zones, (zone + 1) * len(mesh.cells) // zones)
                out.write((f"IZONE= {zone + 1}\n" if zones > 1 else "") + "%\n% a comment\nNDIME= 3\n"
                          f"NELEM= {len(of_zone)}\n")
                for n in of_zone:
                    corners = " ".join(str(c) for c in mesh.cells[n])
                    out.write(f"{kinds[len(mesh.cells[n])]} {corners}{f' {n}' if numbered else ''}\n")
                out.write(f"NPOIN= {len(mesh.points)}{f' {len(mesh.points)}' if numbered else ''}\n")
                for n, point in enumerate(mesh.points.tolist()):
                    out.write(" ".join(map(repr, point)) + (f" {n}\n" if numbered else "\n"))
                out.write("NMARK= 2\nMARKER_TAG= lower\nMARKER_ELEMS= 1\n9 0 1 6 5\nMARKER_TAG= upper\nMARKER_ELEMS= 1\n9 1 2 7 6\n")

    def write_restart(self, mesh, how, order="<"):
        names = ["x", "y", "z", "p", "Momentum_x"]
        table = np.column_stack([mesh.points, mesh.p, 2 * mesh.p])
        if how == "binary":
            head = np.array([535532, len(names), len(table), 1, 8], order + "i4").tobytes()
            text = b"".join(name.encode().ljust(33, b"\0") for name in names)
            self.restart.write_bytes(head + text + table.astype(order + "f8").tobytes() + bytes(8 * 8 + 4))
            return
        between = ", " if how == "csv" else "\t"
        with self.restart.open("w") as out:
            out.write(between.join(f'"{name}"' for name in ["PointID", *names]) + "\n")
            for n, row in enumerate(table.tolist()):
                out.write(between.join([str(n), *map(repr, row)]) + "\n")
            out.write("EXT_ITER= 3\n" if how == "dat" else "")

    def test_meshes_and_restarts(self):
        mesh = Mesh()
        grid = mesh.vtk()
        for numbered, how, order in ((True, "csv", "<"), (False, "dat", "<"), (True, "binary", "<"), (False, "binary", ">")):
            with self.subTest(numbered=numbered, how=how, order=order):
                self.write(mesh, numbered)
                self.write_restart(mesh, how, order)
                info = self.info(self.path, self.restart)
                self.assertEqual([s["name"] for s in info["scalars"]], ["p", "Momentum_x"])
                self.assertEqual(info["cells"]["count"], len(mesh.cells))
                self.assertIn("boundaries: lower, upper", info["notes"])
                self.expect_same([self.path, self.restart], grid, {"c": None})

    def test_zones(self):
        mesh = Mesh()
        self.write(mesh, zones=2)
        self.write_restart(mesh, "binary")
        other = self.folder / "restart_other"
        other.write_bytes(self.restart.read_bytes())
        self.assertEqual(self.info(self.path, self.restart, other)["cells"]["count"], len(mesh.cells))
        self.assertAlmostEqual(self.cache([self.path, self.restart, other], "p")[1], 1, delta=2e-3)
        self.expect_line(self.path, self.restart, words="has 2 zones, but 1 restart files")

    @unittest.skipUnless(meshio, "no python3-meshio")
    def test_meshio_agrees(self):
        mesh = Mesh(kinds=(8, 4))
        cells = [("hexahedron" if run.shape[1] == 8 else "tetra", run) for run in mesh.runs()]
        meshio.write(self.path, meshio.Mesh(mesh.points, cells))
        self.write_restart(mesh, "csv")
        self.expect_same([self.path, self.restart], mesh.vtk(), {"c": None})
        self.write(mesh)
        read = meshio.read(self.path)
        np.testing.assert_array_equal(read.points, mesh.points)
        self.assertEqual(sum(len(b.data) for b in read.cells if b.type in ("hexahedron", "tetra")), len(mesh.cells))

    def test_damage(self):
        mesh = Mesh(2)
        self.write(mesh)
        self.assertGreater(self.expect_harmless(self.path, scalar="volume"), 40)
        for how in ("csv", "binary"):
            self.write_restart(mesh, how)
            data = self.restart.read_bytes()
            for n in range(1, 20):
                self.restart.write_bytes(data[:len(data) * n // 24])
                self.expect_line(self.path, self.restart, scalar="p", words="restart_flow")
        text = self.path.read_text()
        for old, new, words in (("NDIME= 3", "NDIME= 2", "is a mesh of 2 dimensions"), ("NELEM= ", "NELEM= 1", "is not an element"),
                                ("\n12 ", "\n77 ", "is not an element"), ("NPOIN", "NPOINT", "has 0 points"),
                                ("\n12 0 ", "\n12 99999 ", "refers to point 99999"), ("NDIME= 3", "NDIME= -1", "the count")):
            self.write_restart(mesh, "csv")
            self.path.write_text(text.replace(old, new, 1))
            self.expect_line(self.path, *([self.restart] if "refers" in words else []), scalar="p", words=words)


class EnsightFile:
    """A file of EnSight Gold: texts, integers and floats, in ASCII or C Binary."""

    def __init__(self, order=None):
        self.order, self.data = order, b""

    def text(self, *lines):
        for line in lines:
            self.data += line.encode().ljust(80) if self.order else line.encode() + b"\n"

    def put(self, values, kind):
        rows = np.reshape(values, (-1, np.shape(values)[-1] if np.ndim(values) == 2 and kind == "i" else 1))
        values = rows.ravel()
        if self.order:
            self.data += values.astype(f"{self.order}{kind}4").tobytes()
        else:
            form = "%10d" if kind == "i" else "%12.8e"
            self.data += "".join("".join(form % v for v in row) + "\n" for row in rows).encode()

    def ints(self, values):
        self.put(values, "i")

    def floats(self, values):
        self.put(values, "f")


class EnsightCases(MeshFormats):
    NAMES = {4: "tetra4", 5: "pyramid5", 6: "penta6", 8: "hexa8"}
    STEPS = "TIME\ntime set: 1\nnumber of steps: 2\nfilename start number: 3\nfilename increment: 4\ntime values: 0.5\n 1.5\n"

    def setUp(self):
        super().setUp()
        self.path = self.folder / "cube.case"

    def rounded(self, mesh):
        mesh.points, mesh.p, mesh.c = (a.astype("f4").astype("f8") for a in (mesh.points, mesh.p, mesh.c))
        return mesh

    def head(self, order, ids):
        file = EnsightFile(order)
        file.text(*(["C Binary"] if order else []), "a cube", "", f"node id {ids}", f"element id {ids}")
        return file

    def write(self, mesh, order=None, ids="off", polyhedra=None, variables=("p", "c")):
        file = self.head(order, ids)
        if ids == "given":
            file.text("extents")
            file.floats([0, 1] * 3)
        file.text("part")
        file.ints([7])
        file.text("the cube", "coordinates")
        file.ints([len(mesh.points)])
        given = ids == "given"
        file.ints(np.arange(len(mesh.points) * given) + 1)
        file.floats(mesh.points.T)
        file.text("quad4")
        file.ints([1, *([9] * given)])
        file.ints([[1, 2, 7, 6]])
        if polyhedra:
            file.text("nfaced")
            file.ints([len(polyhedra), *(range(len(polyhedra) * given))])
            file.ints([len(cell) for cell in polyhedra])
            file.ints([len(face) for cell in polyhedra for face in cell])
            for face in (face for cell in polyhedra for face in cell):
                file.ints(np.array([face]) + 1)
        for run in mesh.runs() if not polyhedra else ():
            file.text(self.NAMES[run.shape[1]])
            file.ints([len(run), *range(len(run) * given)])
            file.ints(run + 1)
        (self.folder / "mesh.geo").write_bytes(file.data)
        for step, name in ((3, "p"), (3, "c"), (7, "p"), (7, "c"), (3, "v")):
            file = EnsightFile(order)
            file.text("values")
            file.text("part")
            file.ints([7])
            if name in "pv":
                file.text("coordinates")
                file.floats([mesh.p, 2 * mesh.p, 2 * mesh.p] if name == "v" else mesh.p * (1 if step == 3 else 2))
            else:
                begin = 0
                for run in mesh.runs():
                    file.text("nfaced" if polyhedra else self.NAMES[run.shape[1]])
                    count = len(mesh.cells) if polyhedra else len(run)
                    file.floats(mesh.c[begin:begin + count] * (1 if step == 3 else 2))
                    begin += count
                    if polyhedra:
                        break
            (self.folder / f"{name}.{step:03d}").write_bytes(file.data)
        self.path.write_text("# made by hand\nFORMAT\ntype:  ensight gold\n\nGEOMETRY\nmodel: 1 mesh.geo\nVARIABLE\n"
                             "scalar per node: 1 p p.***\nscalar per element: 1 c c.***\nvector per node: 1 v v.003\n"
                             "tensor symm per node: 1 t t.***\nconstant per case: gamma 1.4\n" + self.STEPS)

    def test_unstructured_parts(self):
        mesh = self.rounded(Mesh())
        for order, ids in ((None, "off"), (None, "given"), ("<", "given"), (">", "off")):
            with self.subTest(order=order, ids=ids):
                self.write(mesh, order, ids)
                info = self.info(self.path)
                self.assertEqual(info["cells"]["count"], len(mesh.cells))
                self.assertEqual(info["times"], [0.5, 1.5])
                self.assertEqual([s["name"] for s in info["scalars"]], ["p", "c", "v:mag", "v:x", "v:y", "v:z"])
                self.assertAlmostEqual(info["scalars"][2]["max"], 3 * mesh.p.max(), places=5)
                self.assertTrue(any("tensor symm" in w for w in info["warnings"]), info["warnings"])
                self.expect_same([self.path], mesh.vtk())
                mesh.p *= 2
                mesh.c *= 2
                self.expect_same([self.path], mesh.vtk(), options=("--time-step", "1"))
                mesh.p /= 2
                mesh.c /= 2

    def test_polyhedra(self):
        mesh = self.rounded(Mesh())
        faces, _, of_cells = mesh.faces()
        polyhedra = [[faces[f] for f, _ in cell] for cell in of_cells]
        for order in (None, "<"):
            self.write(mesh, order, "given", polyhedra)
            self.expect_same([self.path], mesh.vtk(polyhedra))

    def test_the_reader_and_the_writer_of_vtk_agree(self):
        mesh = self.rounded(Mesh())
        for order in (None, ">", "<"):
            self.write(mesh, order)
            reader = vtk.vtkEnSightGoldBinaryReader() if order else vtk.vtkEnSightGoldReader()
            if order:
                reader.SetByteOrderToBigEndian() if order == ">" else reader.SetByteOrderToLittleEndian()
            reader.SetCaseFileName(str(self.path))
            reader.Update()
            output = reader.GetOutput()
            grid = next(output.GetBlock(n) for n in range(output.GetNumberOfBlocks()) if output.GetBlock(n))
            self.assertEqual(grid.GetNumberOfCells(), len(mesh.cells) + 1)
            np.testing.assert_array_equal(vtk_to_numpy(grid.GetPoints().GetData()), mesh.points.astype("f4"))
            info = self.info(self.path)
            self.assertAlmostEqual(info["scalars"][0]["min"], vtk_to_numpy(grid.GetPointData().GetArray("p")).min(), places=6)
        grid = mesh.vtk()
        ids = numpy_to_vtk(np.ones(len(mesh.cells), "i4"), deep=True)
        ids.SetName("BlockId")
        grid.GetCellData().AddArray(ids)
        points = vtk.vtkPoints()
        points.SetData(numpy_to_vtk(mesh.points.astype("f4"), deep=True))
        grid.SetPoints(points)
        for data, name, values in ((grid.GetPointData(), "p", mesh.p), (grid.GetCellData(), "c", mesh.c)):
            data.RemoveArray(name)
            array = numpy_to_vtk(values.astype("f4"), deep=True)
            array.SetName(name)
            data.AddArray(array)
        writer = vtk.vtkEnSightWriter()
        writer.SetPath(str(self.folder))
        writer.SetBaseName("written")
        writer.SetFileName(str(self.folder / "written"))
        writer.SetInputData(grid)
        writer.Write()
        writer.WriteCaseFile(1)
        ctypes.CDLL(None).fflush(None)  # VTK 9.1 does not close the case file
        info = self.info(self.folder / "written.0.case")
        self.assertEqual(info["cells"]["count"], len(mesh.cells))
        names = {s["name"][0]: s["name"] for s in info["scalars"]}
        for name in "pc":
            self.assertAlmostEqual(self.cache([self.folder / "written.0.case"], names[name])[1], 1, delta=2e-3)

    def test_structured_parts(self):
        ni, nj, nk = 5, 4, 3
        k, j, i = np.meshgrid(*(np.arange(n) for n in (nk, nj, ni)), indexing="ij")
        points = np.stack([i + 0.25 * k, j / 2, k * 1.5 + i * j / 8], -1).reshape(-1, 3)
        p, c = np.arange(len(points)) / 4, np.arange((ni - 1) * (nj - 1) * (nk - 1)) / 2.0
        hidden = (i.ravel() == 0) & (j.ravel() == 0)
        for order in (None, "<", ">"):
            for how in ("block", "block iblanked", "block rectilinear", "block uniform"):
                with self.subTest(order=order, how=how):
                    at = points
                    file = self.head(order, "off")
                    file.text("part")
                    file.ints([1])
                    file.text("block of nodes", how)
                    file.ints([ni, nj, nk])
                    if how in ("block rectilinear", "block uniform"):
                        at = np.stack([i / 2 + 1, j * 2, k / 4], -1).reshape(-1, 3)
                        file.floats([1, 0, 0, 0.5, 2, 0.25] if how.endswith("uniform") else
                                    [*(np.arange(ni) / 2 + 1), *(np.arange(nj) * 2), *(np.arange(nk) / 4)])
                    else:
                        file.floats(points.T)
                    if how.endswith("iblanked"):
                        file.ints(~hidden)
                    (self.folder / "mesh.geo").write_bytes(file.data)
                    for name, values in (("p", p), ("c", c)):
                        file = EnsightFile(order)
                        file.text("values", "part")
                        file.ints([1])
                        file.text("block")
                        file.floats(values)
                        (self.folder / name).write_bytes(file.data)
                    self.path.write_text("FORMAT\ntype: ensight gold\nGEOMETRY\nmodel: mesh.geo\nVARIABLE\n"
                                         "scalar per node: p p\nscalar per element: c c\n")
                    info = self.info(self.path)
                    self.assertEqual(info["blocks"][0]["dimensions"] if "dimensions" in info["blocks"][0] else None or
                                     [info["blocks"][0][d] for d in ("ni", "nj", "nk")], [ni, nj, nk])
                    grid = vtk.vtkStructuredGrid()
                    grid.SetDimensions(ni, nj, nk)
                    of = vtk.vtkPoints()
                    of.SetData(numpy_to_vtk(np.ascontiguousarray(at.astype("f8")), deep=True))
                    grid.SetPoints(of)
                    for data, name, values in ((grid.GetPointData(), "p", p), (grid.GetCellData(), "c", c)):
                        array = numpy_to_vtk(values.astype("f8"), deep=True)
                        array.SetName(name)
                        data.AddArray(array)
                    if how.endswith("iblanked"):
                        for n in np.flatnonzero(hidden):
                            grid.BlankPoint(int(n))
                    writer = vtk.vtkXMLStructuredGridWriter()
                    writer.SetFileName(str(self.folder / "expected.vts"))
                    writer.SetInputData(grid)
                    writer.Write()
                    for name in "pc" if how != "block iblanked" else "p":
                        found, _ = self.cache([self.path], name)
                        expected, _ = self.cache([self.folder / "expected.vts"], name)
                        self.assertEqual(sorted(found.values()), sorted(expected.values()), name)

    def test_damage(self):
        mesh = self.rounded(Mesh(2))
        for order in (None, "<"):
            self.write(mesh, order)
            self.assertGreater(self.expect_damage("mesh.geo"), 20)
            self.assertGreater(self.expect_damage("c.003"), 10)
        for old, new, words in (("ensight gold", "ensight", "expected 'ensight gold'"), ("mesh.geo", "none.geo", "none.geo"),
                                ("model: 1 mesh.geo", "model: 1 1 mesh.geo", "file sets"), ("steps: 2", "steps: 3", "time set 1"),
                                ("p p.***", "p", "cannot be opened"), ("1.5", "-1.5", "time set 1")):
            text = self.path.read_text()
            self.path.write_text(text.replace(old, new))
            self.expect_line(self.path, words=words)
            self.path.write_text(text)

    def expect_damage(self, name):
        """As expect_harmless(), of another file than the one that is opened."""
        path, refused = self.folder / name, 0
        data = path.read_bytes()
        damaged = [data[:len(data) * n // 20] for n in range(20)]
        for n in RANDOM.integers(0, len(data), 30):
            wrong = bytearray(data)
            wrong[n] ^= int(RANDOM.integers(1, 256))
            damaged.append(bytes(wrong))
        for bytes_of in damaged:
            path.write_bytes(bytes_of)
            result = self.run_program("convert", self.path, "-o", self.folder / "d.splats", "--overwrite", "--scalar", "c")
            self.assertIn(result.returncode, (0, 1, 2), result.stderr)
            if result.returncode:
                refused += 1
                self.assertEqual(result.stderr.count("\n"), 1, result.stderr)
        path.write_bytes(data)
        return refused


@unittest.skipUnless(netCDF4, "no python3-netcdf4")
class Columns(MeshFormats):
    """UGRID, ICON and MPAS: prisms over the faces of a map. The map is a plane or a patch of the globe, with quadrangles and
    triangles, and hexagons where the format has them."""

    LAYERS = 3

    def setUp(self):
        super().setUp()
        self.path = self.folder / "grid.nc"
        # A patch of 3 x 2 quadrangles, the last of them cut into triangles.
        y, x = np.meshgrid(np.arange(3.0), np.arange(4.0), indexing="ij")
        self.nodes = np.stack([x.ravel() + 0.1 * y.ravel(), y.ravel()], 1)
        quads = [[4 * j + i, 4 * j + i + 1, 4 * j + i + 5, 4 * j + i + 4] for j in range(2) for i in range(3)]
        self.faces = [*quads[:5], quads[5][:3], [quads[5][k] for k in (0, 2, 3)]]
        self.levels = np.array([0.0, 100.0, 300.0, 600.0])
        self.t = RANDOM.random((self.LAYERS, len(self.faces))).astype("f4")

    def place(self, longitude, latitude, height, sphere=True):
        if not sphere:
            return [longitude, latitude, height]
        east, north, r = np.radians(longitude), np.radians(latitude), 6371 + height
        return [r * np.cos(north) * np.cos(east), r * np.cos(north) * np.sin(east), r * np.sin(north)]

    def expected(self, column_by_column=False, heights=None, sphere=True, faces=None, nodes=None):
        """VTK's grid of the same prisms. `heights`: [level][node], in kilometres."""
        faces, nodes = faces or self.faces, self.nodes if nodes is None else nodes
        levels, columns = self.LAYERS + 1, len(nodes)
        heights = np.repeat(self.levels[:, None] / 1000, columns, 1) if heights is None else heights
        points = np.zeros((levels * columns, 3))
        number = lambda level, node: node * levels + level if column_by_column else level * columns + node
        for level in range(levels):
            for node in range(columns):
                points[number(level, node)] = self.place(*nodes[node], heights[level][node], sphere)
        grid = vtk.vtkUnstructuredGrid()
        grid.Allocate(1)
        order = [(l, f) for f in range(len(faces)) for l in range(self.LAYERS)] if column_by_column else \
            [(l, f) for l in range(self.LAYERS) for f in range(len(faces))]
        kinds = {3: vtk.VTK_WEDGE, 4: vtk.VTK_HEXAHEDRON, 5: vtk.VTK_PENTAGONAL_PRISM, 6: vtk.VTK_HEXAGONAL_PRISM}
        for layer, face in order:
            ids = [int(number(level, node)) for level in (layer, layer + 1) for node in faces[face]]
            grid.InsertNextCell(kinds[len(faces[face])], len(ids), ids)
        of = vtk.vtkPoints()
        of.SetData(numpy_to_vtk(points, deep=True))
        grid.SetPoints(of)
        array = numpy_to_vtk(np.array([self.t[l, f] for l, f in order]), deep=True)
        array.SetName("c")
        grid.GetCellData().AddArray(array)
        return grid

    def expect_columns(self, paths, grid, name="t"):
        """Positions are computed by two programs: the caches agree in what `info` says and in volume, to rounding."""
        vtu = self.folder / "expected.vtu"
        write_xml(grid, vtu)
        found, expected = self.info(*paths), self.info(vtu)
        self.assertEqual(found["cells"], expected["cells"])
        self.assertEqual(found["nodes"], expected["nodes"])
        for end in ("lower", "upper"):
            np.testing.assert_allclose(found["bounds"][end], expected["bounds"][end], rtol=1e-9, atol=1e-9)
        scalar = next(s for s in found["scalars"] if s["name"] == name)
        self.assertAlmostEqual(scalar["min"], float(self.t.min()), places=6)
        self.assertAlmostEqual(scalar["max"], float(self.t.max()), places=6)
        volumes = [self.cache(paths, name)[1], self.cache([vtu], "c")[1]]
        self.assertAlmostEqual(volumes[0] / volumes[1], 1, delta=1e-5)
        drawn = []
        for words, scalar in ((paths, name), ([vtu], "c")):
            cache = self.folder / "b.splats"
            self.run_program("convert", *words, "-o", cache, "--scalar", scalar, "--overwrite")
            result = self.run_program("render", cache, "-o", self.folder / "b.png", "--size", "64x64", "--range", "0,1")
            self.assertEqual(result.returncode, 0, result.stderr)
            drawn.append((self.folder / "b.png").read_bytes())
        self.assertEqual(*drawn)

    def write_ugrid(self, form="NETCDF4", start=0, column_by_column=False, unit="m", at_nodes=False):
        with netCDF4.Dataset(self.path, "w", format=form) as f:
            f.Conventions = "CF-1.8 UGRID-1.0"
            for name, size in (("time", None), ("layer", self.LAYERS), ("two", 2), ("face", len(self.faces)), ("node", len(self.nodes)),
                               ("corner", 4)):
                f.createDimension(name, size)
            mesh = f.createVariable("mesh", "i4")
            mesh.cf_role, mesh.topology_dimension = "mesh_topology", np.int32(2)
            mesh.node_coordinates, mesh.face_node_connectivity = "lon lat", "corners"
            for name, axis in (("lon", 0), ("lat", 1)):
                v = f.createVariable(name, "f8", ("node",))
                v.units = "degrees_east" if axis == 0 else "degrees_north"
                v.standard_name = "longitude" if axis == 0 else "latitude"
                v[:] = self.nodes[:, axis]
            corners = f.createVariable("corners", "i4", ("face", "corner"), fill_value=-999)
            corners.start_index = np.int32(start)
            corners[:] = [[n + start for n in face] + [-999] * (4 - len(face)) for face in self.faces]
            layer = f.createVariable("layer", "f8", ("layer",))
            layer.units, layer.positive, layer.bounds = unit, "up", "bounds"
            layer[:] = (self.levels[1:] + self.levels[:-1]) / 2
            f.createVariable("bounds", "f8", ("layer", "two"))[:] = np.stack([self.levels[:-1], self.levels[1:]], 1)
            time = f.createVariable("time", "f8", ("time",))
            time.units = "days since 2000-01-01"
            time[:] = [1, 2]
            where = "node" if at_nodes else "face"
            dims = ("time", where, "layer") if column_by_column else ("time", "layer", where)
            t = f.createVariable("t", "f4", dims)
            t.mesh, t.location, t.units = "mesh", where, "K"
            values = self.t if not at_nodes else np.arange(self.LAYERS * len(self.nodes), dtype="f4").reshape(self.LAYERS, -1)
            t[0], t[1] = (values.T, values.T + 1) if column_by_column else (values, values + 1)

    def test_ugrid(self):
        for form, start, column_by_column in (("NETCDF4", 0, False), ("NETCDF3_CLASSIC", 1, False), ("NETCDF4", 1, True)):
            with self.subTest(form=form, start=start, column_by_column=column_by_column):
                self.write_ugrid(form, start, column_by_column)
                self.expect_columns([self.path], self.expected(column_by_column))
        info = self.info(self.path)
        self.assertEqual(info["cells"]["count"], self.LAYERS * len(self.faces))
        self.assertEqual(len(info["times"]), 2)

    def test_ugrid_at_nodes(self):
        self.write_ugrid(at_nodes=True)
        info = self.info(self.path)
        self.assertEqual(info["nodes"], self.LAYERS * len(self.nodes))
        self.assertEqual(info["cells"]["count"], (self.LAYERS - 1) * len(self.faces))
        self.assertEqual(info["scalars"][0]["max"], self.LAYERS * len(self.nodes) - 1)
        self.assertGreater(self.cache([self.path], "t")[1], 0)

    def test_icon_with_its_grid_in_a_second_file(self):
        triangles = [t for face in self.faces for t in ([face] if len(face) == 3 else [face[:3], [face[k] for k in (0, 2, 3)]])]
        self.t = RANDOM.random((self.LAYERS, len(triangles))).astype("f4")
        heights = RANDOM.random(len(triangles))[None] * 50 + self.levels[::-1, None]
        with netCDF4.Dataset(self.folder / "icon_grid.nc", "w") as f:
            for name, size in (("cell", len(triangles)), ("vertex", len(self.nodes)), ("nv", 3)):
                f.createDimension(name, size)
            for name, axis in (("vlon", 0), ("vlat", 1)):
                v = f.createVariable(name, "f8", ("vertex",))
                v.units = "radian"
                v[:] = np.radians(self.nodes[:, axis])
            f.createVariable("vertex_of_cell", "i4", ("nv", "cell"))[:] = np.array(triangles).T + 1
        with netCDF4.Dataset(self.path, "w") as f:
            f.number_of_grid_used = 24
            for name, size in (("time", None), ("height", self.LAYERS), ("height_2", self.LAYERS + 1), ("cell", len(triangles))):
                f.createDimension(name, size)
            f.createVariable("time", "f8", ("time",))[:] = [0]
            f.createVariable("t", "f4", ("time", "height", "cell"))[0] = self.t
            z = f.createVariable("z_ifc", "f8", ("height_2", "cell"))
            z.units = "m"
            z[:] = heights
        of_nodes = np.array([[np.mean([heights[l, n] for n, face in enumerate(triangles) if node in face])
                              for node in range(len(self.nodes))] for l in range(self.LAYERS + 1)]) / 1000
        self.expect_columns([self.path, self.folder / "icon_grid.nc"], self.expected(heights=of_nodes, faces=triangles))
        self.expect_line(self.path, scalar="t", words="ICON")

    def test_mpas(self):
        # Two hexagons and two triangles between them.
        nodes = np.array([[np.cos(a) + dx, np.sin(a)] for dx in (0, np.sqrt(3)) for a in np.pi / 6 + np.arange(6) * np.pi / 3])
        nodes, first = np.unique(nodes.round(9), axis=0, return_inverse=True)
        faces = [list(map(int, first[:6])), list(map(int, first[6:]))]
        self.t = RANDOM.random((self.LAYERS, 2)).astype("f4")
        heights = np.stack([self.levels, self.levels + 30], 1)
        for ocean in (False, True):
            with self.subTest(ocean=ocean), netCDF4.Dataset(self.path, "w", format="NETCDF3_64BIT_OFFSET") as f:
                for name, size in (("Time", None), ("nCells", 2), ("nVertices", len(nodes)), ("maxEdges", 7), ("nVertLevels", self.LAYERS),
                                   ("nVertLevelsP1", self.LAYERS + 1)):
                    f.createDimension(name, size)
                f.on_a_sphere = "YES             "
                for name, axis in (("lonVertex", 0), ("latVertex", 1)):
                    f.createVariable(name, "f8", ("nVertices",))[:] = np.radians(nodes[:, axis])
                f.createVariable("verticesOnCell", "i4", ("nCells", "maxEdges"))[:] = [[n + 1 for n in face] + [0] for face in faces]
                f.createVariable("nEdgesOnCell", "i4", ("nCells",))[:] = 6
                if ocean:
                    depth = f.createVariable("refBottomDepth", "f8", ("nVertLevels",))
                    depth.units = "m"
                    depth[:] = self.levels[1:]
                    f.createVariable("maxLevelCell", "i4", ("nCells",))[:] = [self.LAYERS, 1]
                else:
                    z = f.createVariable("zgrid", "f8", ("nCells", "nVertLevelsP1"))
                    z.units = "m"
                    z[:] = heights.T
                f.createVariable("t", "f4", ("Time", "nCells", "nVertLevels"))[0] = self.t.T
            if ocean:
                info = self.info(self.path)
                self.assertEqual(info["cells"]["count"], 2 * self.LAYERS)
                whole = self.expected(True, faces=faces, nodes=nodes, heights=-np.repeat(self.levels[:, None] / 1000, len(nodes), 1))
                write_xml(whole, self.folder / "whole.vtu")
                share = self.cache([self.path], "t")[1] / self.cache([self.folder / "whole.vtu"], "c")[1]
                self.assertAlmostEqual(share, (600 + 100) / 1200, delta=2e-3)  # the hidden ones are not counted
                continue
            of_nodes = np.array([[np.mean([heights[l, n] for n, face in enumerate(faces) if node in face])
                                  for node in range(len(nodes))] for l in range(self.LAYERS + 1)]) / 1000
            self.expect_columns([self.path], self.expected(True, of_nodes, faces=faces, nodes=nodes))

    def test_damage(self):
        for form in ("NETCDF3_CLASSIC", "NETCDF4"):
            self.write_ugrid(form)
            self.assertGreater(self.expect_harmless(self.path, 20, "t"), 10)
        self.write_ugrid()
        with netCDF4.Dataset(self.path, "r+") as f:
            f["corners"][3, 1] = 99
        self.expect_line(self.path, scalar="t", words="face 3 has the node 99")
        self.write_ugrid(unit="1")
        self.expect_line(self.path, scalar="t", words="have no heights")


if __name__ == "__main__":
    unittest.main()
