#!/usr/bin/python3
"""mesh_files_test.py CURVISPLAT

Unstructured grids that VTK wrote, in every encoding and of every kind of cell: what `curvisplat info` measures is compared
with the arrays, and the volume that `curvisplat convert` writes with VTK's own. Damaged files get one line. Exit status 77
(skipped) without python3-vtk9.
"""
import gzip
import itertools
import json
import os
import pathlib
import re
import struct
import subprocess
import sys
import unittest
import unittest.mock

try:
    import numpy as np
    import vtk
    from vtk.util.numpy_support import numpy_to_vtk

    from sweep import some_of
    from mesh_case import PROGRAM, MeshCase
    from mesh_cubes import HEXAHEDRON_FACES, RANDOM, cube, hexahedra, insert, lattice, with_scalars, write_legacy, write_xml
except ModuleNotFoundError as error:
    print(f"skipped: {error}; install python3-vtk9 and python3-numpy")
    sys.exit(77)


class MeshFiles(MeshCase):
    def setUp(self):
        super().setUp()
        RANDOM.bit_generator.state = np.random.default_rng(1).bit_generator.state  # the same cube in every order of tests

    def test_every_encoding_of_xml(self):
        grid = cube(3)
        path = self.folder / "mesh.vtu"
        modes = ("Ascii", True), ("Binary", True), ("Appended", True), ("Appended", False)
        orders = ("LittleEndian", "UInt32"), ("BigEndian", "UInt64")
        # Usually each once at least: structured grids are decoded by the same code (VtkEncodings).
        for (mode, raw), compressor, (order, header) in some_of(itertools.product(modes, ("None", "ZLib", "LZ4", "LZMA"), orders), 3):
            with self.subTest(mode=mode, raw=raw, compressor=compressor, order=order):
                write_xml(grid, path, mode, compressor, raw=raw, order=order, header=header)
                self.check(path, grid)

    def test_base64_of_one_value(self):
        """VTK's own writer: the types of one cell are 4 bytes of header and one of data, "AQAAAAw="."""
        points = vtk.vtkPoints()
        grid = vtk.vtkUnstructuredGrid()
        for k in range(2):
            for corner in lattice(1):
                points.InsertNextPoint(corner + [2 * k, 0, 0])
            grid.SetPoints(points)
            insert(grid, vtk.VTK_HEXAHEDRON, hexahedra(1)[0] + 8 * k)
            with_scalars(grid)
            for header in ("UInt32", "UInt64"):
                for compressor in ("None", "ZLib"):
                    write_xml(grid, self.folder / "one.vtu", "Binary", compressor, header=header)
                    self.check(self.folder / "one.vtu", grid)

    def test_base64_in_lines(self):
        grid = cube(3)
        path = self.folder / "mesh.vtu"

        def lines(text, length, end):
            return end.join(text[n:n + length] for n in range(0, len(text), length))

        for header in ("UInt32", "UInt64"):
            for compressor in ("None", "ZLib"):
                write_xml(grid, path, "Binary", compressor, header=header)
                text = path.read_text()
                for length, end in some_of(((76, "\n"), (64, "\r\n"), (76, "\n      "), (1000, "\n")), 2, turn=compressor == "ZLib"):
                    # MIME's lines run through; others break the line behind the header, too.
                    for apart in (False, True):
                        def broken(found):
                            head = found[2].index("=") if apart and "=" in found[2][:-4] else -4
                            head = (head + 4) // 4 * 4
                            parts = (found[2][:head], found[2][head:]) if head else (found[2],)
                            return found[1] + "\n" + end.join(lines(part, length, end) for part in parts) + "\n<"
                        path.write_bytes(re.sub('(format="binary"[^>]*>)\\s*([A-Za-z0-9+/=]+)\\s*<', broken, text).encode())
                        with self.subTest(header=header, compressor=compressor, length=length, end=end, apart=apart):
                            self.check(path, grid)
        path.write_text(re.sub('([A-Za-z0-9+/]{30})([A-Za-z0-9+/]{25})', "\\1\n\\2\n", text))
        self.assertIn("write it without line breaks", self.run_program("info", path).stderr)

    def test_attributes_that_fortran_padded(self):
        grid = cube(3)
        path = self.folder / "mesh.vtu"
        for mode in ("Ascii", "Appended"):
            write_xml(grid, path, mode)
            head, tail = re.split(b"(?=<AppendedData)|$", path.read_bytes(), maxsplit=1)
            path.write_bytes(re.sub(rb'="([^"]*)"', rb'="  \1   "', head) + tail)
            self.check(path, grid)

    def test_equal_times_of_a_collection(self):
        """Versions of one part (a steady run, or one that was restarted and appended to the file), and parts that do not say so."""
        def collection(*entries):
            (self.folder / "a.pvd").write_text('<?xml version="1.0"?>\n<VTKFile type="Collection" version="0.1">\n<Collection>\n' + "".join(
                f'<DataSet timestep="{time}" group="" part="{part}" file="u{n}.vtu"/>\n' for time, part, n in entries)
                + "</Collection>\n</VTKFile>\n")
            return self.info(self.folder / "a.pvd")

        for n in range(6):
            grid = cube(2, kinds=("hexahedron",))
            grid.GetPoints().SetData(numpy_to_vtk(np.stack(np.meshgrid(*[np.arange(3.0)] * 3), -1).reshape(-1, 3) + [2 * (n > 3), 0, 0], deep=True))
            grid.GetPointData().GetArray("p").Fill(n)
            write_xml(grid, self.folder / f"u{n}.vtu")
        for entries, cells, value, times in (
                ([(0, 0, 0), (0, 0, 1), (0, 0, 2)], 8, 2, 1),            # three versions
                ([(0, 0, 0), (1, 0, 1), (0, 0, 2), (2, 0, 3)], 8, 2, 3),  # a restart
                ([(0, 0, 0), (1, 0, 1), (0, 0, 4)], 8, 4, 2),             # a restart with another mesh
                ([(0, 0, 3), (0, 0, 4)], 16, 4, 1),                       # parts that all call themselves 0
                ([(0, 0, 3), (1, 0, 2), (0, 1, 4), (1, 1, 5)], 16, 4, 2)):  # part after part
            with self.subTest(entries=entries):
                info = collection(*entries)
                self.assertEqual(info["cells"]["count"], cells)
                self.assertEqual({s["name"]: s["max"] for s in info["scalars"]}["p"], value)
                self.assertEqual(len(info.get("times", [])) or 1, times)
                self.assertEqual(any("the last one is read" in w for w in info["warnings"]), cells == 8)

    def test_a_mesh_that_changes(self):
        """Each step has its own mesh; steps of the same mesh share it."""
        for step, n in enumerate((2, 2, 3, 4)):
            RANDOM.bit_generator.state = np.random.default_rng(n).bit_generator.state
            grid = cube(n)
            grid.GetPointData().GetArray("p").Fill(step)
            write_xml(grid, self.folder / f"step_{step}.vtu")
        cache = self.convert([self.folder / f"step_{n}.vtu" for n in range(4)], "p")
        volumes = [self.manifest(folder)["volume"] for folder in (cache, cache / "geometry.1", cache / "geometry.2")]
        np.testing.assert_allclose(volumes, [1, 1, 1], atol=5e-3)
        self.assertFalse((cache / "geometry.3").exists())
        result = self.run_program("info", cache, "--verify")
        self.assertIn("at all 4 time steps", result.stdout, result.stderr)
        for step in range(4):
            self.assertEqual(self.run_program("render", cache, "-o", self.folder / "a.png", "--step", step, "--size", "64x64", "--range", "0,4").returncode, 0)

    def test_scalars_that_lack_values_at_different_samples(self):
        """Each has its own range in `info`; without --scalar those that have none where others do get no part in the cache."""
        def ranges(info):
            return {s["name"]: (s["min"], s["max"]) for s in info["scalars"]}

        for where in ("points", "cells", "nodes", "mesh cells"):
            count, side = ((128, 8) if "cells" in where else (225, 9))
            values = {"c": np.arange(count) % side, "d": np.arange(count) % side * 2.0}
            for name, part in (("a", lambda v: v > 4), ("b", lambda v: v < 2)):
                values[name] = np.where(part(values["c"]), np.nan, values["c"])
            image = vtk.vtkImageData()
            image.SetDimensions(9, 5, 5)
            for name in ("a", "c", "b", "d"):
                array = numpy_to_vtk(values[name].astype("f8"), deep=True)
                array.SetName(name)
                (image.GetCellData() if "cells" in where else image.GetPointData()).AddArray(array)
            path = self.folder / "a.vti"
            writer = vtk.vtkXMLImageDataWriter()
            if where in ("nodes", "mesh cells"):
                shift = vtk.vtkAppendFilter()
                shift.AddInputData(image)
                shift.Update()
                image, path, writer = shift.GetOutput(), self.folder / "a.vtu", vtk.vtkXMLUnstructuredGridWriter()
            writer.SetFileName(str(path))
            writer.SetInputData(image)
            writer.Write()
            with self.subTest(where=where):
                top = side - 1
                ranges_of = {"a": (0, 4), "b": (2, top), "c": (0, top), "d": (0, 2 * top)}
                self.assertEqual(ranges(self.info(path)), ranges_of)
                result = self.run_program("convert", path, "-o", self.folder / "n.splats", "--overwrite")
                self.assertEqual(result.returncode, 0, result.stderr)
                self.assertIn("a has values at other samples than c, d", result.stderr)
                cache = self.folder / "n.splats"
                whole = self.info(cache)
                self.assertIn("own-blanks", whole["requires"])
                volumes = {}
                for part in (whole, *whole["own_blanks"]):
                    for v in part["variables"]:
                        self.assertAlmostEqual(v["min"], ranges_of[v["name"]][0], delta=1e-4)
                        self.assertAlmostEqual(v["max"], ranges_of[v["name"]][1], delta=1e-4)
                        volumes[v["name"]] = part["volume"]
                # Of cells of side 1, and of nodes whose cells have no NaN corner: counted by hand.
                cells = "cells" in where
                for name, volume in {"c": 128, "d": 128, "a": 80 if cells else 64, "b": 96}.items():
                    self.assertAlmostEqual(volumes[name], volume, delta=0.003 * volume, msg=name)
                # Each is what a cache of its own has.
                self.assertEqual(self.run_program("convert", path, "-o", self.folder / "own.splats", "--overwrite", "--scalar", "a").returncode, 0)
                for name in ("geometry.bin", "bricks.bin", "var.0.bin"):
                    self.assertEqual((cache / "blanks.1" / name).read_bytes(), (self.folder / "own.splats" / name).read_bytes(), name)
                before = {str(p.relative_to(cache)): p.read_bytes() for p in cache.rglob("*") if p.is_file()}
                result = self.run_program("convert", path, "-o", cache, "--overwrite", "--resume", "--threads", "1")
                self.assertEqual(result.returncode, 0, result.stderr)
                self.assertEqual({str(p.relative_to(cache)): p.read_bytes() for p in cache.rglob("*") if p.is_file()}, before)
                result = self.run_program("convert", path, "-o", cache, "--overwrite", "--scalar", "c,a")
                self.assertEqual([p["variables"][0]["name"] for p in self.info(cache)["own_blanks"]], ["a"], result.stderr)

    def write_image(self, name, arrays):
        """An image of 9x5x5 points."""
        image = vtk.vtkImageData()
        image.SetDimensions(9, 5, 5)
        for of, values in arrays.items():
            array = numpy_to_vtk(values, deep=True)
            array.SetName(of)
            image.GetPointData().AddArray(array)
        writer = vtk.vtkXMLImageDataWriter()
        writer.SetFileName(str(self.folder / name))
        writer.SetInputData(image)
        writer.Write()
        return self.folder / name

    def test_blanks_of_a_later_step_are_counted(self):
        """A scalar that lacks values at one step alone: what the others lose there is said, with the step."""
        x = (np.arange(225) % 9).astype(float)
        files = [self.write_image(f"run_{step}.vti", {"low": np.where((x > 4) & (step == 1), np.nan, x), "all": x + step})
                 for step in range(3)]
        result = self.run_program("convert", *files, "-o", self.folder / "run.splats")
        self.assertEqual(result.returncode, 0, result.stderr)
        warnings = [line for line in result.stderr.splitlines() if "warning" in line]
        self.assertEqual(len(warnings), 1, result.stderr)
        self.assertIn("run_1.vti: 100 of the values of all are left out, since other scalars of the cache have none there", warnings[0])

    def test_own_blanks_of_a_series(self):
        """Each set of scalars has the steps; one without any value at a later step ends before it."""
        x = (np.arange(225) % 9).astype(float)
        files = [self.write_image(f"set_{step}.vti", {"low": np.where(x > 4, np.nan, x + step), "all": x + step,
                                                      "high": np.where((x < 3) | (step == 2), np.nan, x)}) for step in range(3)]
        cache = self.folder / "set.splats"
        result = self.run_program("convert", *files, "-o", cache)
        self.assertEqual(result.returncode, 0, result.stderr)
        self.assertIn("set_2.vti: high: no sample has a value at this step; kept up to the step before", result.stderr)
        whole = self.info(cache, "--verify", "--step", "2")
        of_sets = {part["variables"][0]["name"]: part for part in (whole, *whole["own_blanks"])}
        self.assertEqual({name: (len(part["steps"]), part["variables"][0]["max"]) for name, part in of_sets.items()},
                         {"low": (3, 6), "all": (3, 10), "high": (2, 8)})
        for name, splats in (("low", 125), ("all", 225)):
            drawn = self.run_program("render", cache, "-o", self.folder / "p.png", "--size", "40x40", "--scalar", name, "--step", "2")
            self.assertIn(f"{splats} splats of {name}", drawn.stdout, drawn.stderr)
        self.assertIn("--step 2: is out of range", self.run_program("render", cache, "-o", self.folder / "p.png", "--scalar", "high", "--step", "2").stderr)
        rows = [line.split(",") for line in self.run_program("info", cache, "--probe", "3,2,2", "--steps", "all").stdout.splitlines()]
        columns = [rows[0].index(name) for name in ("low", "all", "high")]
        found = [[float(row[at] or "nan") for at in columns] for row in rows[1:]]
        np.testing.assert_allclose(found, [[3, 3, 3], [4, 4, 3], [5, 5, np.nan]], atol=0.01)

    def test_own_blanks_are_drawn_and_checked(self):
        """Scalars that have a value nowhere together, and one that has none."""
        image = vtk.vtkImageData()
        image.SetDimensions(9, 5, 5)
        x = (np.arange(225) % 9).astype(float)
        for name, values in (("low", np.where(x > 4, np.nan, x)), ("high", np.where(x <= 4, np.nan, x)), ("none", x * np.nan)):
            array = numpy_to_vtk(values, deep=True)
            array.SetName(name)
            image.GetPointData().AddArray(array)
        writer = vtk.vtkXMLImageDataWriter()
        writer.SetFileName(str(self.folder / "apart.vti"))
        writer.SetInputData(image)
        writer.Write()
        cache = self.folder / "apart.splats"
        result = self.run_program("convert", self.folder / "apart.vti", "-o", cache)
        self.assertEqual(result.returncode, 0, result.stderr)
        self.assertIn("left out: none, without a value at any sample", result.stderr)
        whole = self.info(cache, "--verify")
        self.assertEqual([[v["name"] for v in part["variables"]] for part in (whole, *whole["own_blanks"])], [["low"], ["high"]])
        for name, splats in (("low", 125), ("high", 100)):
            drawn = self.run_program("render", cache, "-o", self.folder / "p.png", "--size", "40x40", "--scalar", name)
            self.assertIn(f"{splats} splats of {name}", drawn.stdout, drawn.stderr)
        # At x = 2 there is low, at x = 7 high, at x = 20 neither.
        point = self.run_program("info", cache, "--probe", "7,2,2")
        self.assertEqual(point.returncode, 0, point.stderr)
        self.assertRegex(point.stdout, "(?s)nearest node i 7, j 2, k 2 .*low +no value at the point.*high +7.* at the point")
        told = json.loads(self.run_program("info", cache, "--probe", "7,2,2", "--json").stdout)
        self.assertEqual([value["name"] for value in told["probe"]["values"]], ["low", "high"])
        self.assertIsNone(told["probe"]["values"][0]["value"])
        self.assertAlmostEqual(told["probe"]["values"][1]["value"], 7, delta=0.01)
        self.assertNotIn("probe", told["own_blanks"][0])
        points = self.folder / "points.csv"
        points.write_text("x,y,z\n2,2,2\n7,2,2\n20,2,2\n")
        table = self.run_program("info", cache, "--probe", points)
        rows = [line.split(",") for line in table.stdout.splitlines()]
        self.assertEqual(rows[0], "x,y,z,low,high,block,i,j,k,sample_x,sample_y,sample_z,sample_low,sample_high".split(","))
        self.assertEqual([[bool(cell) for cell in row[3:6]] for row in rows[1:]], [[True, False, True], [False, True, True], [False, False, False]])
        np.testing.assert_allclose([float(rows[1][3]), float(rows[2][4])], [2, 7], atol=0.01)
        outside = self.run_program("info", cache, "--probe", "20,2,2")
        self.assertIn("is outside of the data, which lies in x 0 to 8", outside.stderr)
        self.assertEqual(outside.returncode, 1)
        exact = self.run_program("info", cache, "--probe", "6.5,2,2", "--source")
        self.assertRegex(exact.stdout, "high +6.5 at the point", exact.stderr)
        line = self.run_program("info", cache, "--probe-line", "0,2,2", "8,2,2", "9", "-o", self.folder / "line.png")
        self.assertEqual(line.returncode, 0, line.stderr)
        refused = self.run_program("render", cache, "-o", self.folder / "p.png", "--size", "40x40", "--opacity-by", "high")
        self.assertIn("high has values at other samples than low", refused.stderr)
        refused = self.run_program("convert", self.folder / "apart.vti", "--to", cache, "--add-scalar", "high")
        self.assertIn("already has a scalar 'high'", refused.stderr)
        refused = self.run_program("convert", self.folder / "apart.vti", "--to", cache / "blanks.1", "--add-scalar", "volume")
        self.assertIn("is a part of", refused.stderr)
        manifest = cache / "blanks.1" / "manifest.json"
        manifest.write_text(manifest.read_text().replace('"apart"', '"other"'))
        refused = self.run_program("render", cache, "-o", self.folder / "p.png", "--scalar", "high")
        self.assertIn("has a wrong checksum", refused.stderr)
        self.assertEqual(refused.returncode, 1)

    def test_points_of_cells_without_values_are_not_said_to_have_no_cell(self):
        """Of sets of scalars that have values in other cells."""
        grid = cube(2, kinds=("hexahedron",))
        n = np.arange(grid.GetNumberOfCells()).astype(float)
        for name, values in (("low", np.where(n < len(n) / 2, n, np.nan)), ("high", np.where(n < len(n) / 2, np.nan, n))):
            array = numpy_to_vtk(values, deep=True)
            array.SetName(name)
            grid.GetCellData().AddArray(array)
        write_xml(grid, self.folder / "mesh.vtu")
        convert = ("convert", self.folder / "mesh.vtu", "-o", self.folder / "a.splats", "--scalar", "low,high", "--overwrite")
        result = self.run_program(*convert)
        self.assertEqual(result.returncode, 0, result.stderr)
        self.assertIn("high has values at other samples than low", result.stdout + result.stderr)
        self.assertNotIn("belong to no solid cell", result.stderr)
        grid.GetPoints().InsertNextPoint(0, 0, 0)
        for index in range(grid.GetPointData().GetNumberOfArrays()):
            array = grid.GetPointData().GetArray(index)
            array.InsertNextTuple([0] * array.GetNumberOfComponents())
        write_xml(grid, self.folder / "mesh.vtu")
        points = grid.GetNumberOfPoints()
        self.assertIn(f"1 of {points} points belong to no solid cell", self.run_program(*convert).stderr)

    def test_ranges_are_of_what_is_drawn(self):
        """Faces that mesh generators write beside the cells have values, too."""
        grid = cube(2)
        for n in range(grid.GetNumberOfCells()):
            if grid.GetCell(n).GetCellDimension() < 3:
                grid.GetCellData().GetArray("c").SetValue(n, 1000)
        write_xml(grid, self.folder / "mesh.vtu")
        self.assertLess({s["name"]: s["max"] for s in self.info(self.folder / "mesh.vtu")["scalars"]}["c"], 1000)
        # A point that no cell has, as one in the middle of an edge of a quadratic cell.
        grid.GetPoints().InsertNextPoint(0, 0, 0)
        for name, value in (("p", 5000), ("v", None)):
            array = grid.GetPointData().GetArray(name)
            array.InsertNextTuple([value or 0] * array.GetNumberOfComponents())
        write_xml(grid, self.folder / "mesh.vtu")
        self.assertLess({s["name"]: s["max"] for s in self.info(self.folder / "mesh.vtu")["scalars"]}["p"], 5000)

    def test_names_of_steps_with_decimals(self):
        grid = cube(1, kinds=("hexahedron",))
        for names, order in ((("0.001", "0.01", "0.0005", "0.0015"), "0.0005 0.001 0.0015 0.01"), (("0", "0.5", "2", "10", "1e-05"), "0 1e-05 0.5 2 10"),
                             (("0.75", "0.8", "1.25"), "0.75 0.8 1.25"), (("1.9", "1.10", "1.1"), "1.1 1.9 1.10"), (("9", "10", "0100"), "9 10 0100")):
            folder = self.folder / names[0]
            folder.mkdir()
            for name in names:
                write_xml(grid, folder / f"Result-{name}.vtu")
            for command in (("convert", "--scalar", "p", "-o", self.folder / "s.splats", "--overwrite"), ("info", "--json")):
                result = self.run_program(command[0], folder / "Result-*.vtu", *command[1:])
                self.assertEqual(result.returncode, 0, result.stderr)
            self.assertIn(f"{len(names)} steps, {folder}/Result-{order.split()[0]}.vtu .. {folder}/Result-{order.split()[-1]}.vtu;", json.loads(result.stdout)["series"])
            found = [pathlib.Path(source).stem[7:] for source in self.manifest(self.folder / "s.splats")["sources"]]
            self.assertEqual(" ".join(found), order)

    def test_legacy_files(self):
        grid = cube(3)
        path = self.folder / "mesh.vtk"
        for binary in (True, False):
            for version in (42, 51):
                with self.subTest(binary=binary, version=version):
                    write_legacy(grid, path, binary, version)
                    self.check(path, grid)
                    self.assertAlmostEqual(self.volume(path, "c"), 1, delta=2e-3)

    def test_all_kinds_of_cells_fill_the_cube(self):
        grid = cube(8)
        path = self.folder / "mesh.vtu"
        write_xml(grid, path)
        info = self.check(path, grid)
        for kind in ("tetrahedra", "pyramids", "wedges", "hexahedra", "polyhedra"):
            self.assertGreater(info["cells"][kind], 0)
        self.assertTrue(any("of higher order; they are cut" in note for note in info["notes"]))
        self.assertTrue(any("vertices, lines or faces" in warning for warning in info["warnings"]))
        for scalar in ("p", "c", "v:x"):
            self.assertAlmostEqual(self.volume(path, scalar), 1, delta=1e-3)

    def test_polyhedra_of_vtk_9_4(self):
        """VTK 9.4 writes the arrays face_connectivity, face_offsets, polyhedron_to_faces and polyhedron_offsets."""
        path, newer = self.folder / "mesh.vtu", self.folder / "newer.vtu"
        write_xml(cube(8), path, mode="Ascii")
        text = path.read_text()
        array = lambda name: re.search(f'<DataArray[^>]*Name="{name}"[^>]*>([^<]*)<', text)
        stream, ends = ([int(word) for word in array(name)[1].split()] for name in ("faces", "faceoffsets"))
        faces, of_cells, counts, begin = [], [], [], 0
        for end in ends:
            if end >= 0:
                at = begin + 1
                while at < end:
                    of_cells.append(len(faces))
                    faces.append(stream[at + 1:at + 1 + stream[at]])
                    at += stream[at] + 1
                begin = end
            counts.append(len(of_cells))
        lists = {"face_connectivity": sum(faces, []), "face_offsets": np.cumsum([len(face) for face in faces]),
                 "polyhedron_to_faces": of_cells, "polyhedron_offsets": counts}
        added = "".join(f'<DataArray type="Int64" Name="{name}" format="ascii">{" ".join(map(str, values))}</DataArray>'
                        for name, values in lists.items())
        for name in ("faces", "faceoffsets"):
            text = text.replace(array(name)[0] + "/DataArray>", "")
        newer.write_text(text.replace("</Cells>", added + "</Cells>"))
        self.assertNotIn('"faces"', newer.read_text())
        self.assertEqual(self.cache([newer], "c"), self.cache([path], "c"))

    def test_polyhedra_that_do_not_close(self):
        """A cell of which a face is missing: info and convert say so, with its number."""
        for left_out in (0, 1):
            grid = vtk.vtkUnstructuredGrid()
            points = vtk.vtkPoints()
            for point in [(i, j, k) for k in range(3) for j in range(2) for i in range(2)]:
                points.InsertNextPoint(point)
            grid.SetPoints(points)
            for n, faces in enumerate((HEXAHEDRON_FACES, HEXAHEDRON_FACES[left_out:])):
                corners = np.array([0, 1, 3, 2, 4, 5, 7, 6]) + 4 * n
                ids = vtk.vtkIdList()
                for word in (len(faces), *(word for face in faces for word in (len(face), *corners[list(face)]))):
                    ids.InsertNextId(int(word))
                grid.InsertNextCell(vtk.VTK_POLYHEDRON, ids)
            values = numpy_to_vtk(np.arange(2.0), deep=True)
            values.SetName("c")
            grid.GetCellData().AddArray(values)
            path = self.folder / "open.vtu"
            write_xml(grid, path)
            words = "1 of 2 polyhedra do not close, the first is cell 1"
            self.assertEqual(words in " ".join(self.info(path)["warnings"]), left_out == 1)
            done = self.run_program("convert", path, "-o", self.folder / "open.splats", "--overwrite")
            self.assertEqual((done.returncode, done.stderr.count(words)), (0, left_out), done.stderr)

    def test_prisms_over_polygons(self):
        for sides, kind in ((5, vtk.VTK_PENTAGONAL_PRISM), (6, vtk.VTK_HEXAGONAL_PRISM)):
            angle = 2 * np.pi * np.arange(sides) / sides
            ring = np.stack([np.cos(angle), np.sin(angle), np.zeros(sides)], 1)
            grid = vtk.vtkUnstructuredGrid()
            grid.Allocate(1)
            insert(grid, kind, range(2 * sides))
            points = vtk.vtkPoints()
            points.SetData(numpy_to_vtk(np.concatenate([ring, ring + [0, 0, 1]]), deep=True))
            grid.SetPoints(points)
            path = self.folder / "prism.vtu"
            write_xml(with_scalars(grid), path)
            self.assertAlmostEqual(self.volume(path, "p"), sides / 2 * np.sin(2 * np.pi / sides), delta=2e-3)

    def test_pieces_are_one_mesh(self):
        grid = cube(6, ("hexahedron",))
        whole, parts = self.folder / "whole.vtu", self.folder / "parts.pvtu"
        write_xml(grid, whole)
        split = vtk.vtkUnstructuredGrid()
        pieces = []
        for part in range(3):
            select = vtk.vtkExtractCells()
            select.SetInputData(grid)
            ids = vtk.vtkIdList()
            # With a layer of the next part's cells, which are ghosts.
            ghosts = []
            for n in range(grid.GetNumberOfCells()):
                if n % 3 == part or (part == 0 and n % 3 == 1):
                    ids.InsertNextId(n)
                    ghosts.append(vtk.vtkDataSetAttributes.DUPLICATECELL if n % 3 != part else 0)
            select.SetCellList(ids)
            select.Update()
            split = select.GetOutput()
            array = numpy_to_vtk(np.array(ghosts, "u1"), deep=True)
            array.SetName("vtkGhostType")
            split.GetCellData().AddArray(array)
            write_xml(split, self.folder / f"part{part}.vtu")
            pieces.append(f'<Piece Source="part{part}.vtu"/>')
        parts.write_text('<VTKFile type="PUnstructuredGrid"><PUnstructuredGrid GhostLevel="1">' + "".join(pieces) +
                         "</PUnstructuredGrid></VTKFile>")
        for scalar in ("p", "c"):
            expected = self.volume(whole, scalar)
            of_whole = self.manifest(self.folder / "a.splats")
            self.assertAlmostEqual(self.volume(parts, scalar), expected, delta=1e-6)
            of_parts = self.manifest(self.folder / "a.splats")
            self.assertEqual(of_parts["splats"], of_whole["splats"])

    def test_ghost_levels(self):
        """The ghosts of VTK before 7, in files of version 0.1: VTK's own reader makes duplicates of them."""
        points = "".join(f"{i} {j} {k}\n" for k in (0, 1) for j in (0, 1) for i in range(3))

        def write(name, values, levels):
            (self.folder / name).write_text(
                '<VTKFile type="UnstructuredGrid" version="0.1" byte_order="LittleEndian"><UnstructuredGrid><Piece NumberOfPoints="12" NumberOfCells="2">'
                f'<CellData><DataArray type="Float64" Name="T" format="ascii">{values}</DataArray><DataArray type="UInt8" Name="vtkGhostLevels" '
                f'format="ascii">{levels}</DataArray></CellData><Points><DataArray type="Float64" NumberOfComponents="3" format="ascii">{points}'
                '</DataArray></Points><Cells><DataArray type="Int32" Name="connectivity" format="ascii">0 1 4 3 6 7 10 9 1 2 5 4 7 8 11 10</DataArray>'
                '<DataArray type="Int32" Name="offsets" format="ascii">8 16</DataArray><DataArray type="UInt8" Name="types" format="ascii">12 12'
                '</DataArray></Cells></Piece></UnstructuredGrid></VTKFile>')
            return self.folder / name

        write("a.vtu", "1 999", "0 2")
        alone = write("b.vtu", "999 2", "1 0")
        reader = vtk.vtkXMLUnstructuredGridReader()
        reader.SetFileName(str(alone))
        reader.Update()
        self.assertEqual([reader.GetOutput().GetCellData().GetArray("vtkGhostType").GetTuple1(n) for n in range(2)], [1, 0])
        both = self.folder / "p.pvtu"
        both.write_text('<VTKFile type="PUnstructuredGrid" version="0.1"><PUnstructuredGrid GhostLevel="1"><Piece Source="a.vtu"/><Piece Source="b.vtu"/>'
                        "</PUnstructuredGrid></VTKFile>")
        self.assertEqual([(s["min"], s["max"]) for s in self.info(both)["scalars"]], [(1, 2)])
        self.assertAlmostEqual(self.volume(both, "T"), 2, delta=4e-3)
        self.assertIn("left out: 1 of 2 cells, which vtkGhostLevels marks as copies", self.info(alone)["warnings"][0])

    def write_cube(self, path, x0=0, **values):
        grid, points = vtk.vtkUnstructuredGrid(), vtk.vtkPoints()
        for corner in lattice(1):
            points.InsertNextPoint(corner + [x0, 0, 0])
        grid.SetPoints(points)
        insert(grid, vtk.VTK_HEXAHEDRON, hexahedra(1)[0])
        for name, value in values.items():
            array = numpy_to_vtk(np.full(8, float(value)), deep=True)
            array.SetName(name)
            grid.GetPointData().AddArray(array)
        write_xml(grid, path)
        return path

    def series(self, files, *options, scalar="T"):
        """The mean value and the volume of each step."""
        cache = self.folder / "s.splats"
        result = self.run_program("convert", *files, "-o", cache, "--scalar", scalar, "--overwrite", *options)
        self.assertEqual(result.returncode, 0, result.stderr)
        steps = len(json.loads(self.run_program("info", cache, "--json").stdout)["steps"])
        infos = [json.loads(self.run_program("info", cache, "--json", "--step", n).stdout) for n in range(steps)]
        return [(round(i["variables"][0]["max"], 6), round(i["volume"], 2)) for i in infos]

    def test_pieces_of_steps_by_their_names(self):
        """Processors' files without a .pvtu: three steps of two pieces. One varying number is a time unless its word says otherwise."""
        for name in ("t{}_p{}", "rank{1}.{0}", "u-part{1}-{0:03}"):
            files = [self.write_cube(self.folder / (name.format(t, p) + ".vtu"), p, T=t) for t in range(3) for p in range(2)]
            self.assertEqual(self.series(files[::-1]), [(0, 2), (1, 2), (2, 2)])
        self.assertEqual(len(self.info(*files)["pieces"]), 2)
        self.assertIn("3 steps", self.info(*files)["series"])
        self.assertAlmostEqual(self.volume_of(files[:2]), 2, delta=4e-3)
        alike = [self.write_cube(self.folder / f"proc{n}.vtu", 0, T=n) for n in range(2)]
        self.expect_refused(alike, "has the points of")
        # A day and an hour are a time, and so is a number that not all have.
        files = [self.write_cube(self.folder / f"d{d}_h{h}.vtu", 0, T=2 * d + h) for d in range(2) for h in range(2)]
        self.assertEqual(self.series(files), [(n, 1) for n in range(4)])

    def volume_of(self, files):
        return self.manifest(self.convert(files, "T"))["volume"]

    def expect_refused(self, files, words):
        result = self.run_program("info", *files)
        self.assertEqual((result.returncode, result.stderr.count("\n")), (1, 1), result.stderr)
        self.assertIn(words, result.stderr)

    def test_negative_numbers_in_names(self):
        files = [self.write_cube(self.folder / f"r{t}.vtu", 0, T=t) for t in (-5, -10, 5, 0)]
        self.assertEqual([t for t, _ in self.series(files)], [-10, -5, 0, 5])
        self.assertEqual([t for t, _ in self.series([self.folder / "r*.vtu"])], [-10, -5, 0, 5])
        files = [self.write_cube(self.folder / f"run-{t}.vtu", 0, T=t) for t in (10, 9)]
        self.assertEqual([t for t, _ in self.series(files)], [9, 10])

    def test_arrays_of_later_steps(self):
        files = [self.write_cube(self.folder / f"e{t}.vtu", 0, T=t, **({"E": 7} if t > 0 else {})) for t in range(3)]
        note = "the last step has E, which the first one lacks"
        self.assertIn(note, self.info(*files)["series"])
        result = self.run_program("convert", *files, "-o", self.folder / "s.splats", "--overwrite")
        self.assertIn("warning: " + note, result.stderr)
        self.assertEqual(self.series(files, "--steps", "1:", scalar="E"), [(7, 1), (7, 1)])
        collection = self.folder / "e.pvd"
        collection.write_text('<VTKFile type="Collection"><Collection>' + "".join(f'<DataSet timestep="{t}" file="e{t}.vtu"/>' for t in range(3))
                              + "</Collection></VTKFile>")
        self.assertIn(note, self.info(collection)["series"])
        self.assertNotIn("series", self.info(files[1]))

    def test_series_and_collections(self):
        grid = cube(2)
        for step in range(2):
            write_xml(grid, self.folder / f"step{step}.vtu")
        (self.folder / "run.pvd").write_text(
            '<VTKFile type="Collection"><Collection><DataSet timestep="1" file="step0.vtu"/>'
            '<DataSet timestep="3" file="step1.vtu"/></Collection></VTKFile>')
        info = self.check(self.folder / "run.pvd", grid)
        self.assertEqual(info["times"], [1, 3])
        cache = self.folder / "s.splats"
        for files in ((self.folder / "run.pvd", "--steps", "all"), (self.folder / "step0.vtu", self.folder / "step1.vtu")):
            result = self.run_program("convert", *files, "-o", cache, "--scalar", "p", "--overwrite")
            self.assertEqual(result.returncode, 0, result.stderr)
            self.assertIn("2 steps, 2 of them converted now, 0 with a geometry of their own", result.stdout)
        result = self.run_program("convert", self.folder / "step0.vtu", "-o", cache, "--scalar", "c", "--overwrite")
        self.assertEqual(result.returncode, 0, result.stderr)
        result = self.run_program("convert", self.folder / "step0.vtu", "--add-scalar", "p", "--to", cache)
        self.assertIn("its scalars are cell-centred, but p is node-centred", result.stderr)

    def test_compressed_as_a_whole(self):
        grid = cube(2)
        write_xml(grid, self.folder / "mesh.vtu")
        data = (self.folder / "mesh.vtu").read_bytes()
        (self.folder / "mesh.vtu.gz").write_bytes(gzip.compress(data))
        self.check(self.folder / "mesh.vtu.gz", grid)
        self.assertAlmostEqual(self.volume(self.folder / "mesh.vtu.gz", "c"), 1, delta=2e-3)

    def write_exodus(self, path, form="NETCDF3_64BIT_OFFSET", one_coord=False, shift=0, n=4):
        import netCDF4
        points, cells = lattice(n), hexahedra(n)
        tetrahedra = np.concatenate([cells[40:][:, t] for t in
                                     [(0, 1, 2, 6), (0, 2, 3, 6), (0, 3, 7, 6), (0, 7, 4, 6), (0, 4, 5, 6), (0, 5, 1, 6)]])
        blocks = [("HEX8", cells[:40]), ("TETRA4", tetrahedra), ("SHELL4", cells[:3, :4])]
        p = points @ [1.0, 2.0, 3.0]
        with netCDF4.Dataset(path, "w", format=form) as f:
            f.api_version, f.version, f.floating_point_word_size, f.file_size = 4.98, 4.98, 8, 1
            f.title = "a cube"
            for name, size in (("len_string", 33), ("len_name", 33), ("four", 4), ("num_dim", 3), ("num_nodes", len(points)),
                               ("num_elem", sum(len(c) for _, c in blocks)), ("num_el_blk", len(blocks)),
                               ("num_nod_var", 1), ("num_elem_var", 1), ("time_step", None)):
                f.createDimension(name, size)
            f.createVariable("time_whole", "f8", ("time_step",))[:] = [0.25, 0.5]
            f.createVariable("eb_status", "i4", ("num_el_blk",))[:] = 1
            ids = f.createVariable("eb_prop1", "i4", ("num_el_blk",))
            ids.setncattr("name", "ID")
            ids[:] = [10, 20, 30]
            if one_coord:
                f.createVariable("coord", "f8", ("num_dim", "num_nodes"))[:] = points.T
            else:
                for axis in range(3):
                    f.createVariable("coord" + "xyz"[axis], "f8", ("num_nodes",))[:] = points[:, axis]
            for prefix, name in (("nod", "pressure"), ("elem", "density")):
                names = f.createVariable(f"name_{prefix}_var", "S1", (f"num_{prefix}_var", "len_name"))
                names[0] = np.array(list(name.ljust(33, "\0")), "S1")
            if one_coord:
                f.createVariable("vals_nod_var", "f8", ("time_step", "num_nod_var", "num_nodes"))[:] = [[p], [p + 1]]
            else:
                f.createVariable("vals_nod_var1", "f8", ("time_step", "num_nodes"))[:] = [p, p + 1]
            f.createVariable("elem_var_tab", "i4", ("num_el_blk", "num_elem_var"))[:] = [[1], [1], [0]]
            for n, (kind, c) in enumerate(blocks, 1):
                f.createDimension(f"num_el_in_blk{n}", len(c))
                f.createDimension(f"num_nod_per_el{n}", c.shape[1])
                connect = f.createVariable(f"connect{n}", "i4", (f"num_el_in_blk{n}", f"num_nod_per_el{n}"))
                connect.elem_type = kind
                connect[:] = c + 1 + shift
                if n < 3:
                    values = f.createVariable(f"vals_elem_var1eb{n}", "f8", ("time_step", f"num_el_in_blk{n}"))
                    values[0], values[1] = n + np.arange(len(c)) / 100, 0 * c[:, 0]
        return points, p, blocks

    def test_the_last_step_is_drawn_before_scalars_of_the_other_centring(self):
        import netCDF4
        kept = unittest.mock.patch.dict(os.environ, XDG_CACHE_HOME=str(self.folder / "kept"))
        kept.start()
        self.addCleanup(kept.stop)
        path = self.folder / "uniform.e"
        self.write_exodus(path)
        with netCDF4.Dataset(path, "a") as f:
            f["vals_nod_var1"][0] = 7
        drawn = self.run_program("render", path, "-o", self.folder / "p.png", "--size", "40x40")
        self.assertIn("splats of pressure", drawn.stdout)
        self.assertIn("the last, since the first is constant,", drawn.stderr)
        self.assertEqual(drawn.stderr.count("left out: density"), 1, drawn.stderr)

    def test_exodus_files(self):
        for form, one_coord in (("NETCDF3_64BIT_OFFSET", False), ("NETCDF4", False), ("NETCDF3_CLASSIC", True)):
            with self.subTest(form=form, one_coord=one_coord):
                path = self.folder / "mesh.e"
                points, p, blocks = self.write_exodus(path, form, one_coord)
                info = self.info(path)
                self.assertEqual(info["nodes"], len(points))
                self.assertEqual((info["cells"]["hexahedra"], info["cells"]["tetrahedra"]), (40, 144))
                self.assertEqual(info["times"], [0.25, 0.5])
                scalars = {scalar["name"]: scalar for scalar in info["scalars"]}
                self.assertAlmostEqual(scalars["pressure"]["max"], p.max(), places=5)
                self.assertAlmostEqual(scalars["density"]["max"], 2 + 1.43, places=5)
                for scalar in ("pressure", "density"):
                    self.assertAlmostEqual(self.volume(path, scalar), 1, delta=2e-3)
                result = self.run_program("info", path, "--json", "--time-step", "1")
                scalars = {scalar["name"]: scalar for scalar in json.loads(result.stdout)["scalars"]}
                self.assertAlmostEqual(scalars["pressure"]["max"], p.max() + 1, places=5)
                if not one_coord:
                    # VTK's own reader knows the file, too.
                    reader = vtk.vtkExodusIIReader()
                    reader.SetFileName(str(path))
                    reader.UpdateInformation()
                    reader.Update()
                    of_hexahedra = reader.GetOutput().GetBlock(0).GetBlock(0)
                    self.assertEqual(of_hexahedra.GetNumberOfCells(), 40)

    def write_run(self, name, times, n, x0=0):
        """A row of cubes, as SEACAS writes a file of a run."""
        import netCDF4
        with netCDF4.Dataset(self.folder / name, "w", format="NETCDF3_64BIT_OFFSET") as f:
            f.api_version, f.version, f.floating_point_word_size, f.file_size = np.float32(8.03), np.float32(8.03), np.int32(8), np.int32(1)
            points = np.array([(x0 + i, j, k) for k in range(2) for j in range(2) for i in range(n + 1)], float)
            for key, size in (("len_string", 33), ("len_name", 33), ("num_dim", 3), ("num_nodes", len(points)), ("num_elem", n), ("num_el_blk", 1),
                              ("num_nod_var", 1), ("num_el_in_blk1", n), ("num_nod_per_el1", 8), ("time_step", None)):
                f.createDimension(key, size)
            f.createVariable("time_whole", "f8", ("time_step",))[:] = times
            for axis in range(3):
                f.createVariable("coord" + "xyz"[axis], "f8", ("num_nodes",))[:] = points[:, axis]
            f.createVariable("eb_prop1", "i4", ("num_el_blk",))[:] = 1
            connect, m = f.createVariable("connect1", "i4", ("num_el_in_blk1", "num_nod_per_el1")), n + 1
            connect.elem_type = "HEX8"
            connect[:] = [[i + 1, i + 2, i + 2 + m, i + 1 + m, i + 1 + 2 * m, i + 2 + 2 * m, i + 2 + 3 * m, i + 1 + 3 * m] for i in range(n)]
            f.createVariable("name_nod_var", "S1", ("num_nod_var", "len_name"))[0, :] = np.frombuffer(b"T".ljust(33, b"\0"), "S1")
            values = f.createVariable("vals_nod_var1", "f8", ("time_step", "num_nodes"))
            for step, time in enumerate(times):
                values[step, :] = points[:, 0] + 100 * time
        return self.folder / name

    def test_exodus_files_of_processors(self):
        parts = [self.write_run(f"d.e.2.{n}", [0, 1], 4, 4 * n) for n in range(2)]
        info = self.info(*parts)
        self.assertEqual((info["cells"]["hexahedra"], info["times"], [p["name"] for p in info["pieces"]]), (8, [0, 1], ["d.e.2.0", "d.e.2.1"]))
        self.assertEqual(info["warnings"], [])
        self.assertAlmostEqual(self.volume_of(parts), 8, delta=0.01)
        self.assertEqual(self.series(parts, "--steps", "all"), [(8, 8), (108, 8)])
        self.assertIn("the part of processor 1 of 2", self.info(parts[1])["warnings"][0])
        some = [self.write_run(f"e.e.3.{n}", [0, 1], 4, 4 * n) for n in range(2)]
        self.assertIn("the part of processor 0 of 3", self.info(*some)["warnings"][0])
        more = [self.write_run(f"d.e-s002.2.{n}", [2], 1, n) for n in range(2)]
        self.assertEqual(self.series(parts + more), [(8, 8), (108, 8), (202, 2)])

    def test_exodus_files_of_a_run_whose_mesh_changes(self):
        files = [self.write_run("m.e", [0, 1], 4), self.write_run("m.e-s002", [2, 3], 6), self.write_run("m.e-s003", [4], 2)]
        self.assertEqual(self.series(files[::-1]), [(4, 4), (104, 4), (206, 6), (306, 6), (402, 2)])
        self.assertEqual(self.info(*files)["warnings"], [])
        self.assertIn("goes on in 2 files, m.e-s002 to m.e-s003", self.info(files[0])["warnings"][0])
        self.assertEqual(self.info(files[1])["warnings"], [])

    def test_exodus_variables_of_some_blocks(self):
        """By the truth table, a second variable is in the hexahedra alone: it is drawn there, and the first everywhere."""
        import netCDF4
        path = self.folder / "mesh.e"
        points, _, blocks = self.write_exodus(path, "NETCDF4")
        with netCDF4.Dataset(path, "a") as f:
            f.renameDimension("num_elem_var", "one")
            f.renameVariable("name_elem_var", "unused")
            f.renameVariable("elem_var_tab", "unused_table")
            f.createDimension("num_elem_var", 2)
            names = f.createVariable("name_elem_var", "S1", ("num_elem_var", "len_name"))
            for n, name in enumerate(("density", "stress")):
                names[n] = np.array(list(name.ljust(33, "\0")), "S1")
            f.createVariable("elem_var_tab", "i4", ("num_el_blk", "num_elem_var"))[:] = [[1, 1], [1, 0], [0, 0]]
            f.createVariable("vals_elem_var2eb1", "f8", ("time_step", "num_el_in_blk1"))[:] = np.ones((2, 40)) * np.arange(40)
        cache = self.folder / "blocks.splats"
        for scalar, volume in (("density", 1), ("stress", 40 / 64)):
            result = self.run_program("convert", path, "-o", cache, "--overwrite", "--scalar", "density,stress")
            self.assertEqual(result.returncode, 0, result.stderr)
            part = cache if scalar == "density" else cache / "blanks.1"
            found = json.loads((part / "manifest.json").read_text())
            self.assertEqual([v["name"] for v in found["variables"]], [scalar])
            # Where two kinds of cells meet, the border of what is there is thicker by some percent of a cell.
            self.assertAlmostEqual(found["volume"], volume, delta=2e-3 if volume == 1 else 0.02)

    def test_damaged_exodus_files_get_one_line(self):
        path = self.folder / "mesh.e"
        self.write_exodus(path)
        data = path.read_bytes()

        def expect_line():
            result = self.run_program("convert", path, "-o", self.folder / "d.splats", "--overwrite", "--scalar", "density")
            self.assertEqual(result.returncode, 1, result.stderr)
            self.assertEqual(result.stderr.count("\n"), 1, result.stderr)
            self.assertIn("mesh.e", result.stderr)

        for length in some_of(range(40, len(data) - 3000, len(data) // 15)):
            path.write_bytes(data[:length])
            expect_line()
        for shift in (-1, 100000):
            self.write_exodus(path, shift=shift)
            expect_line()
        # A number of blocks that no file has: only those that are there are looked at.
        self.write_exodus(path)
        data = path.read_bytes()
        name = data.index(b"num_el_blk") + 12
        path.write_bytes(data[:name] + struct.pack(">I", 0x7ffffff0) + data[name + 4:])
        result = subprocess.run([PROGRAM, "info", path], capture_output=True, text=True, timeout=60, check=False)
        self.assertLess(result.returncode, 2, result.stderr)

    def test_damaged_files_get_one_line(self):
        grid = cube(2)
        path = self.folder / "mesh.vtu"
        refused = 0

        def expect_line(path):
            result = self.run_program("convert", path, "-o", self.folder / "d.splats", "--overwrite", "--scalar", "c")
            if result.returncode == 0:
                return False
            self.assertEqual(result.returncode, 1, result.stderr)
            self.assertEqual(result.stderr.count("\n"), 1, result.stderr)
            self.assertIn(path.name, result.stderr)
            return True

        write_xml(grid, path, "Appended", "None")
        data = path.read_bytes()
        lengths = some_of(range(200, len(data) - 100, len(data) // 25))
        for length in lengths:
            path.write_bytes(data[:length])
            refused += expect_line(path)
        self.assertGreater(refused, len(lengths) * 0.75)
        write_xml(grid, path, "Ascii", "None")
        text = path.read_text()

        def replaced(name, change):
            begin = text.index(">", text.index(f'Name="{name}"')) + 1
            end = text.index("<", begin)
            words = text[begin:end].split()
            path.write_text(text[:begin] + " ".join(change(words)) + text[end:])
            return path

        for name, change in (("connectivity", lambda w: ["99999", *w[1:]]), ("connectivity", lambda w: ["-1", *w[1:]]),
                             ("offsets", lambda w: [w[0], "3", *w[2:]]), ("offsets", lambda w: ["999999999", *w[1:]]),
                             ("types", lambda w: ["200", *w[1:]]), ("types", lambda w: ["12"] * len(w)),
                             ("faces", lambda w: ["7", *w[1:]]), ("faces", lambda w: [*w[:1], "999", *w[2:]]),
                             ("faceoffsets", lambda w: ["5"] * len(w))):
            with self.subTest(name=name):
                self.assertTrue(expect_line(replaced(name, change)))
        write_legacy(grid, self.folder / "mesh.vtk", True, 42)
        data = (self.folder / "mesh.vtk").read_bytes()
        for length in some_of(range(100, len(data) - 2000, len(data) // 20)):
            (self.folder / "mesh.vtk").write_bytes(data[:length])
            self.assertTrue(expect_line(self.folder / "mesh.vtk"), length)

    def test_what_cannot_be_done_is_said(self):
        grid = cube(2)
        path = self.folder / "mesh.vtu"
        write_xml(grid, path)
        self.volume(path, "p")
        result = self.run_program("convert", path, "--add-scalar", "v:x", "--to", self.folder / "a.splats")
        self.assertEqual(result.returncode, 0, result.stderr)
        result = self.run_program("convert", path, "--add-scalar", "v:x", "--to", self.folder / "a.splats")
        self.assertIn("already has a scalar 'v:x'", result.stderr)
        write_xml(grid, self.folder / "fields.vtu")
        result = self.run_program("convert", path, self.folder / "fields.vtu", "-o", self.folder / "two.splats")
        self.assertEqual(result.returncode, 1)
        self.assertIn("cannot be combined", result.stderr)


if __name__ == "__main__":
    unittest.main()
