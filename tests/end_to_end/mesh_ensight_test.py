#!/usr/bin/python3
"""mesh_ensight_test.py CURVISPLAT

EnSight Gold, structured and unstructured: mesh_formats.py says how. Exit status 77 (skipped) without python3-vtk9.
"""
import copy
import ctypes
import json
import unittest

from sweep import IS_WHOLE, some_of
from mesh_formats import RANDOM, Mesh, MeshFormats, np, numpy_to_vtk, vtk
from vtk.util.numpy_support import vtk_to_numpy

REAL = "%12.8e"  # in ASCII


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
            form = "%10d" if kind == "i" else REAL
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

    def as_written(self, mesh, order):
        """VTK's grid with the positions that the file says: decimals, in ASCII."""
        if not order:
            mesh = copy.copy(mesh)
            mesh.points = np.array([[float(REAL % x) for x in point] for point in mesh.points])
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
                self.expect_same([self.path], self.as_written(mesh, order).vtk())
                mesh.p *= 2
                mesh.c *= 2
                self.expect_same([self.path], self.as_written(mesh, order).vtk(), options=("--time-step", "1"))
                mesh.p /= 2
                mesh.c /= 2

    def test_exact_values_without_the_name_of_the_case(self):
        """Nor with the number of the step."""
        mesh = self.rounded(Mesh())
        self.write(mesh)
        for step, factor in (("0", 1), ("1", 2)):
            cache = self.convert([self.path], "c", "--time-step", step)
            for n in (0, len(mesh.cells) - 1):
                at = ",".join(map(str, mesh.points[mesh.cells[n]].mean(0)))
                told = self.run_program("info", cache, f"--probe={at}", "--source", "--json")
                self.assertEqual(told.returncode, 0, told.stderr)
                self.assertAlmostEqual(json.loads(told.stdout)["probe"]["values"][0]["value"], factor * mesh.c[n], places=4)

    def file_set(self, mesh, order, sizes_differ, with_c_binary=False):
        """Both steps of each file in one, as Ansys' solvers and Code_Aster write them."""
        self.write(mesh, order)
        record = (lambda words: words.encode().ljust(80, b"\0")) if order else (lambda words: words.encode() + b"\n")
        c_binary = record("C Binary") if order else b""
        for name, steps in (("mesh.geo", ["mesh.geo"] * 2), ("p.set", ["p.003", "p.007"]), ("c.set", ["c.003", "c.007"])):
            contents = [(self.folder / step).read_bytes() for step in steps]
            if name == "mesh.geo":
                contents = [content[len(c_binary):] for content in contents]
            data = c_binary if name == "mesh.geo" or with_c_binary else b""
            for number, content in enumerate(contents):
                data += record("BEGIN TIME STEP") + content + record("END TIME STEP")
                data += record("a comment") * (sizes_differ and number == 0)
            (self.folder / name).write_bytes(data)
        self.path.write_text("FORMAT\ntype: ensight gold\nGEOMETRY\nmodel: 1 1 mesh.geo\nVARIABLE\nscalar per node: 1 1 p p.set\n"
                             "scalar per element: 1 1 c c.set\n" + self.STEPS + "FILE\nfile set: 1\nnumber of steps: 2\n")

    def test_file_sets(self):
        mesh = self.rounded(Mesh(2))
        for order, differ, c_binary in ((None, False, False), ("<", False, False), (">", True, True)):
            with self.subTest(order=order):
                self.file_set(mesh, order, differ, c_binary)
                self.assertEqual(self.info(self.path)["times"], [0.5, 1.5])
                expected = self.as_written(mesh, order)
                self.expect_same([self.path], expected.vtk())
                expected = copy.copy(expected)
                expected.p, expected.c = 2 * mesh.p, 2 * mesh.c
                self.expect_same([self.path], expected.vtk(), options=("--time-step", "1"))
        text = self.path.read_text()
        for old, new, words in (("number of steps: 2\nfile", "", ""), ("FILE\nfile set: 1", "FILE\nfile set: 2", "file set 1, which FILE does not have"),
                                ("set: 1\nnumber of steps: 2\n", "set: 1\nnumber of steps: 1\n", "file set 1 has fewer steps than time set 1")):
            at = text.rfind(old)
            if at >= 0:
                self.path.write_text(text[:at] + new + text[at + len(old):])
                self.expect_line(self.path, "--time-step", "1", words=words)
        self.path.write_text(text)
        self.assertGreater(self.expect_damage("c.set"), 3)
        # Over two files, whose numbers are in their names.
        for name, step in (("p", "p.003"), ("p", "p.007")):
            data = b"C Binary".ljust(80, b"\0") + b"BEGIN TIME STEP".ljust(80) + (self.folder / step).read_bytes() + b"END TIME STEP".ljust(80)
            (self.folder / f"{name}.{'1' if step == 'p.003' else '2'}").write_bytes(data)
        self.path.write_text(text.replace("1 1 p p.set", "1 2 p p.*") + "file set: 2\nfilename index: 1\nnumber of steps: 1\n"
                             "filename index: 2\nnumber of steps: 1\n")
        info = self.info(self.path, "--time-step", 1)
        self.assertAlmostEqual(info["scalars"][0]["max"], 2 * mesh.p.max(), places=5)

    def test_polyhedra(self):
        mesh = self.rounded(Mesh())
        faces, _, of_cells = mesh.faces()
        polyhedra = [[faces[f] for f, _ in cell] for cell in of_cells]
        for order in (None, "<"):
            self.write(mesh, order, "given", polyhedra)
            self.expect_same([self.path], self.as_written(mesh, order).vtk(polyhedra))

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
            self.assertAlmostEqual(self.volume([self.folder / "written.0.case"], names[name]), 1, delta=2e-3)

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
                        found = self.cache([self.path], name)
                        expected = self.cache([self.folder / "expected.vts"], name)
                        self.assertEqual(found, expected, name)

    def test_names_with_blanks(self):
        """In quotation marks: of files (ANSYS) and of variables. Keys and sections in capitals, tabs, a comment behind a line."""
        mesh = self.rounded(Mesh())
        self.write(mesh)
        (self.folder / "mesh.geo").rename(self.folder / "the mesh.geo")
        (self.folder / "p.003").rename(self.folder / "my p.003")
        for name, shown in (('"static pressure"', "static pressure"), ("p", "p")):
            self.path.write_text('FORMAT\ntype:\tensight gold\nGEOMETRY\nmodel:\t1\t"the mesh.geo"   change_coords_only\nVARIABLE\n'
                                 f'scalar per node:\t1\t{name}\t"my p.003" # a comment\n' + self.STEPS)
            self.assertEqual([s["name"] for s in self.info(self.path)["scalars"]], [shown])
            self.convert([self.path], shown)

    def test_several_steps_at_one_time(self):
        mesh = self.rounded(Mesh(2, (8,)))
        self.write(mesh)
        self.path.write_text(self.path.read_text().replace("0.5\n 1.5", "0.5\n 0.5"))
        info = self.info(self.path)
        self.assertEqual(info["times"], [0.5])
        self.assertIn("time set 1 has several steps at time 0.5; the last one is read", info["warnings"])
        self.assertAlmostEqual(next(s for s in info["scalars"] if s["name"] == "p")["max"], 2 * mesh.p.max(), places=4)

    def test_several_parts(self):
        """Two parts of the cube are the cube: nodes that they share coincide."""
        mesh = self.rounded(Mesh(kinds=(8,)))
        half = len(mesh.cells) // 2
        parts = [(4, mesh.cells[:half], mesh.c[:half]), (9, mesh.cells[half:], mesh.c[half:])]
        for order in (None, "<"):
            geometry, values = self.head(order, "off"), EnsightFile(order)
            values.text("values")
            for number, cells, c in parts:
                geometry.text("part")
                geometry.ints([number])
                geometry.text(f"part {number}", "coordinates")
                geometry.ints([len(mesh.points)])
                geometry.floats(mesh.points.T)
                geometry.text("hexa8")
                geometry.ints([len(cells)])
                geometry.ints(np.array(cells) + 1)
                values.text("part")
                values.ints([number])
                values.text("hexa8")
                values.floats(c)
            (self.folder / "mesh.geo").write_bytes(geometry.data)
            (self.folder / "c").write_bytes(values.data)
            self.path.write_text("FORMAT\ntype: ensight gold\nGEOMETRY\nmodel: mesh.geo\nVARIABLE\nscalar per element: c c\n")
            info = self.info(self.path)
            self.assertEqual(info["cells"]["count"], len(mesh.cells))
            np.testing.assert_allclose([info["scalars"][0][end] for end in ("min", "max")], [mesh.c.min(), mesh.c.max()], rtol=1e-7)
            self.assertAlmostEqual(self.volume([self.path], "c"), 1, delta=2e-3)
            # A part may lack a variable: it is drawn where it is, and the other everywhere.
            values = EnsightFile(order)
            values.text("values")
            values.text("part")
            values.ints([4])
            values.text("hexa8")
            values.floats(parts[0][2])
            (self.folder / "d").write_bytes(values.data)
            self.path.write_text(self.path.read_text() + "scalar per element: d d\n")
            cache = self.folder / "parts.splats"
            result = self.run_program("convert", self.path, "-o", cache, "--overwrite")
            self.assertEqual(result.returncode, 0, result.stderr)
            whole = self.manifest(cache)
            self.assertAlmostEqual(whole["volume"], 1, delta=2e-3)
            # Where parts meet, the border of what is there is thicker by some percent of a cell.
            self.assertAlmostEqual(self.manifest(cache / "blanks.1")["volume"], half / len(mesh.cells), delta=0.02)

    def test_damage(self):
        mesh = self.rounded(Mesh(2))
        for order in (None, "<"):
            self.write(mesh, order)
            self.assertGreater(self.expect_damage("mesh.geo"), 20 if IS_WHOLE else 6)
            self.assertGreater(self.expect_damage("c.003"), 10 if IS_WHOLE else 3)
        for old, new, words in (("ensight gold", "ensight", "expected 'ensight gold'"), ("mesh.geo", "none.geo", "none.geo"),
                                ("model: 1 mesh.geo", "model: 1 1 mesh.geo", "which FILE does not have"), ("steps: 2", "steps: 3", "time set 1"),
                                ("p p.***", "p", "which does not exist"), ("1.5", "-1.5", "time set 1"), ("1.5", "nan", "time set 1"),
                                ("1.5", "inf", "time set 1"), ("scalar per node: 1 p p.***", "scalar per \33node: p", "scalar per ?node")):
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
        for bytes_of in some_of(damaged, 3):
            path.write_bytes(bytes_of)
            result = self.run_program("convert", self.path, "-o", self.folder / "d.splats", "--overwrite", "--scalar", "c")
            self.assertIn(result.returncode, (0, 1, 2), result.stderr)
            if result.returncode:
                refused += 1
                self.assertEqual(result.stderr.count("\n"), 1, result.stderr)
        path.write_bytes(data)
        return refused


if __name__ == "__main__":
    unittest.main()
