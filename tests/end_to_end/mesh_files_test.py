#!/usr/bin/python3
"""mesh_files_test.py CURVISPLAT

Unstructured grids that VTK wrote, in every encoding and of every kind of cell: what `curvisplat info` measures is compared
with the arrays, and the volume that `curvisplat convert` writes with VTK's own. Damaged files get one line. Exit status 77
(skipped) without python3-vtk9.
"""
import gzip
import json
import pathlib
import shutil
import struct
import subprocess
import sys
import tempfile
import unittest

try:
    import numpy as np
    import vtk
    from vtk.util.numpy_support import numpy_to_vtk, vtk_to_numpy

    from sweep import some_of
    from mesh_cubes import HEXAHEDRON_FACES, RANDOM, cube, hexahedra, insert, lattice, with_scalars, write_legacy, write_xml
except ModuleNotFoundError as error:
    print(f"skipped: {error}; install python3-vtk9 and python3-numpy")
    sys.exit(77)

PROGRAM = str(pathlib.Path(sys.argv.pop(1)).resolve())
class FoamCase:
    """A case of hexahedra, as OpenFOAM writes it."""

    def __init__(self, folder, binary=False, packed=False, label_bytes=4):
        self.folder, self.binary, self.packed, self.label_bytes = folder, binary, packed, label_bytes

    def write(self, path, kind, *parts):
        arch = f'arch "LSB;label={8 * self.label_bytes};scalar=64";'
        head = (f"/*--- a comment ---*/\nFoamFile\n{{\n    version 2.0;\n    format {'binary' if self.binary else 'ascii'};\n"
                f"    {arch if self.binary else ''}\n    class {kind};\n    object {path.name};\n}}\n// * * //\n\n")
        data = head.encode() + b"".join(part if isinstance(part, bytes) else part.encode() for part in parts) + b"\n"
        path.parent.mkdir(parents=True, exist_ok=True)
        if self.packed:
            path.with_name(path.name + ".gz").write_bytes(gzip.compress(data))
        else:
            path.write_bytes(data)

    def labels(self, values):
        values = np.asarray(values)
        if self.binary:
            return f"{len(values)}(".encode() + values.astype(f"<i{self.label_bytes}").tobytes() + b")"
        return f"{len(values)}\n(\n" + "\n".join(map(str, values)) + "\n)\n"

    def numbers(self, values):
        if self.binary:
            return f"{len(values)}(".encode() + np.ascontiguousarray(values, "<f8").tobytes() + b")"
        row = lambda v: repr(float(v)) if np.ndim(v) == 0 else "(" + " ".join(repr(float(x)) for x in v) + ")"
        return f"{len(values)}\n(\n" + "\n".join(map(row, values)) + "\n)\n"

    def write_mesh(self, where, points, cells):
        faces, owner, neighbour, number = [], [], {}, {}
        for n, c in enumerate(cells):
            for f in HEXAHEDRON_FACES:
                ids = [int(c[m]) for m in f]
                key = tuple(sorted(ids))
                if key in number:
                    neighbour[number[key]] = n
                else:
                    number[key] = len(faces)
                    faces.append(ids)
                    owner.append(n)
        # Internal faces come first.
        order = sorted(range(len(faces)), key=lambda f: (f not in neighbour, owner[f], neighbour.get(f, 0)))
        mesh = where / "polyMesh"
        self.write(mesh / "points", "vectorField", self.numbers(points))
        if self.binary:
            ends = np.cumsum([0] + [len(faces[f]) for f in order])
            self.write(mesh / "faces", "faceCompactList", self.labels(ends), "\n",
                       self.labels([p for f in order for p in faces[f]]))
        else:
            self.write(mesh / "faces", "faceList", f"{len(order)}\n(\n",
                       "".join(f"{len(faces[f])}({' '.join(map(str, faces[f]))})\n" for f in order), ")\n")
        self.write(mesh / "owner", "labelList", self.labels([owner[f] for f in order]))
        self.write(mesh / "neighbour", "labelList", self.labels([neighbour[f] for f in order if f in neighbour]))
        patches = (f"1\n(\n    walls\n    {{\n        type wall;\n        nFaces {len(order) - len(neighbour)};\n"
                   f"        startFace {len(neighbour)};\n    }}\n)\n")
        binary, self.binary = self.binary, False
        self.write(mesh / "boundary", "polyBoundaryMesh", patches)
        self.binary = binary

    def write_field(self, time, name, values):
        kind, of = (("volScalarField", "scalar") if np.ndim(values) < 2 else ("volVectorField", "vector"))
        what = f"uniform {values};" if np.ndim(values) == 0 else None
        parts = ([what] if what else [f"nonuniform List<{of}>\n", self.numbers(values), ";"])
        self.write(time / name, kind, "dimensions [0 2 -2 0 0 0 0];\n\ninternalField   ", *parts,
                   "\n\nboundaryField\n{\n    walls { type zeroGradient; }\n}\n")


class MeshFiles(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.folder = pathlib.Path(folder.name)

    def run_program(self, *words):
        return subprocess.run([PROGRAM, *map(str, words)], capture_output=True, text=True)

    def info(self, path):
        result = self.run_program("info", path, "--json")
        self.assertEqual(result.returncode, 0, result.stderr)
        return json.loads(result.stdout)

    def volume(self, path, scalar):
        cache = self.folder / "mesh.splats"
        result = self.run_program("convert", path, "-o", cache, "--scalar", scalar, "--overwrite")
        self.assertEqual(result.returncode, 0, result.stderr)
        return json.loads((cache / "manifest.json").read_text())["volume"]

    def check(self, path, grid):
        info = self.info(path)
        self.assertEqual(info["nodes"], grid.GetNumberOfPoints())
        self.assertEqual(info["cells"]["count"], grid.GetNumberOfCells())
        points = vtk_to_numpy(grid.GetPoints().GetData())
        used = np.zeros(len(points), bool)
        for n in range(grid.GetNumberOfCells()):
            cell = grid.GetCell(n)
            corners = 8 if cell.GetCellType() == vtk.VTK_QUADRATIC_HEXAHEDRON else cell.GetNumberOfPoints()
            if cell.GetCellDimension() == 3:
                used[[cell.GetPointId(m) for m in range(corners)]] = True
        self.assertEqual(info["unused_nodes"], int((~used).sum()))
        np.testing.assert_allclose(info["bounds"]["lower"], points[used].min(0), rtol=1e-6)
        np.testing.assert_allclose(info["bounds"]["upper"], points[used].max(0), rtol=1e-6)
        arrays = {"p": vtk_to_numpy(grid.GetPointData().GetArray("p")),
                  "v:mag": np.linalg.norm(vtk_to_numpy(grid.GetPointData().GetArray("v")), axis=1),
                  "c": vtk_to_numpy(grid.GetCellData().GetArray("c"))}
        scalars = {scalar["name"]: scalar for scalar in info["scalars"]}
        for name, values in arrays.items():
            self.assertAlmostEqual(scalars[name]["min"], values.min(), places=5)
            self.assertAlmostEqual(scalars[name]["max"], values.max(), places=5)
        return info

    def test_every_encoding_of_xml(self):
        grid = cube(3)
        path = self.folder / "mesh.vtu"
        for mode, raw in (("Ascii", True), ("Binary", True), ("Appended", True), ("Appended", False)):
            for compressor in ("None", "ZLib", "LZ4"):
                for order, header in (("LittleEndian", "UInt32"), ("BigEndian", "UInt64")):
                    with self.subTest(mode=mode, raw=raw, compressor=compressor, order=order):
                        write_xml(grid, path, mode, compressor, raw=raw, order=order, header=header)
                        self.check(path, grid)

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
        self.assertTrue(any("quadratic" in warning for warning in info["warnings"]))
        self.assertTrue(any("vertices, lines or faces" in warning for warning in info["warnings"]))
        for scalar in ("p", "c", "v:x"):
            self.assertAlmostEqual(self.volume(path, scalar), 1, delta=1e-3)

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
            of_whole = json.loads((self.folder / "mesh.splats/manifest.json").read_text())
            self.assertAlmostEqual(self.volume(parts, scalar), expected, delta=1e-6)
            of_parts = json.loads((self.folder / "mesh.splats/manifest.json").read_text())
            self.assertEqual(of_parts["splats"], of_whole["splats"])

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

    def foam_case(self, n=4, parts=1, **how):
        case = self.folder / "case"
        shutil.rmtree(case, ignore_errors=True)
        writer = FoamCase(case, **how)
        points, cells = lattice(n), hexahedra(n)
        middles = points[cells].mean(1)
        p, u = middles @ [1.0, 2.0, 3.0], np.stack([middles[:, 1], -middles[:, 0], 0 * middles[:, 2] + 2], 1)
        for part in range(parts):
            mine = np.arange(len(cells)) % 7 % parts == part if parts > 1 else np.ones(len(cells), bool)
            used, local = np.unique(cells[mine], return_inverse=True)
            folder = case / f"processor{part}" if parts > 1 else case
            writer.write_mesh(folder / "constant", points[used], local.reshape(-1, 8))
            for time in ("0", "0.5"):
                writer.write_field(folder / time, "p", p[mine] + float(time))
                writer.write_field(folder / time, "U", u[mine])
                writer.write_field(folder / time, "T", 300)
        (case / "case.foam").write_text("")
        return case, p, u

    def test_openfoam_cases(self):
        for how in ({}, {"binary": True}, {"binary": True, "label_bytes": 8}, {"packed": True},
                    {"binary": True, "packed": True}):
            with self.subTest(**how):
                case, p, u = self.foam_case(**how)
                for path in (case, case / "case.foam"):
                    info = self.info(path)
                    self.assertEqual(info["nodes"], 125)
                    self.assertEqual(info["cells"]["polyhedra"], 64)
                    self.assertEqual(info["times"], [0, 0.5])
                    scalars = {scalar["name"]: scalar for scalar in info["scalars"]}
                    self.assertEqual(sorted(scalars), ["T", "U:mag", "U:x", "U:y", "U:z", "p"])
                    self.assertAlmostEqual(scalars["p"]["max"], p.max(), places=5)
                    self.assertAlmostEqual(scalars["U:mag"]["min"], np.linalg.norm(u, axis=1).min(), places=5)
                    self.assertEqual(scalars["T"]["min"], 300)
                    self.assertAlmostEqual(self.volume(path, "p"), 1, delta=2e-3)
                # VTK's own reader knows the case, too.
                if not how.get("packed") and how.get("label_bytes", 4) == 4:
                    reader = vtk.vtkOpenFOAMReader()
                    reader.SetFileName(str(case / "case.foam"))
                    reader.Update()
                    block = reader.GetOutput().GetBlock(0)
                    self.assertEqual(block.GetNumberOfCells(), 64)
                    np.testing.assert_allclose(vtk_to_numpy(block.GetCellData().GetArray("p")), p, rtol=1e-6)

    def test_openfoam_times_and_moving_meshes(self):
        case, p, _ = self.foam_case()
        result = self.run_program("info", case, "--json", "--time-step", "1")
        scalars = {scalar["name"]: scalar for scalar in json.loads(result.stdout)["scalars"]}
        self.assertAlmostEqual(scalars["p"]["max"], p.max() + 0.5, places=5)
        FoamCase(case).write(case / "0.5" / "polyMesh" / "points", "vectorField",
                             FoamCase(case).numbers(2 * lattice(4)))
        result = self.run_program("info", case, "--json", "--time-step", "1")
        self.assertEqual(json.loads(result.stdout)["bounds"]["upper"], [2, 2, 2])
        self.assertEqual(self.info(case)["bounds"]["upper"], [1, 1, 1])

    def test_decomposed_openfoam_cases_are_one_mesh(self):
        RANDOM.bit_generator.state = np.random.default_rng(3).bit_generator.state
        case, _, _ = self.foam_case()
        expected = self.volume(case, "p")
        RANDOM.bit_generator.state = np.random.default_rng(3).bit_generator.state
        case, _, _ = self.foam_case(parts=3)
        info = self.info(case)
        self.assertEqual([piece["name"] for piece in info["pieces"]], ["processor0", "processor1", "processor2"])
        self.assertAlmostEqual(self.volume(case, "p"), expected, delta=1e-6)

    def test_damaged_openfoam_cases_get_one_line(self):
        def expect_line(case, name):
            result = self.run_program("convert", case, "-o", self.folder / "d.splats", "--overwrite", "--scalar", "p")
            self.assertEqual(result.returncode, 1, (name, result.stderr))
            self.assertEqual(result.stderr.count("\n"), 1, result.stderr)
            self.assertIn("case", result.stderr)

        for binary in (False, True):
            for name in ("points", "faces", "owner", "neighbour", "p"):
                case, _, _ = self.foam_case(binary=binary)
                path = case / "0" / name if name == "p" else case / "constant" / "polyMesh" / name
                data = path.read_bytes()
                # Behind the values of a field nothing is read.
                for length in (10, 60, len(data) // 2, len(data) - (120 if name == "p" else 3)):
                    with self.subTest(binary=binary, name=name, length=length):
                        path.write_bytes(data[:length])
                        expect_line(case, name)
        case, _, _ = self.foam_case()
        for name, old, new in (("owner", "\n0\n", "\n999999\n"), ("owner", "\n0\n", "\n-5\n"),
                               ("faces", "4(", "9("), ("faces", "(0 ", "(99999 "), ("points", "(0.0", "(nope")):
            path = case / "constant" / "polyMesh" / name
            text = path.read_text()
            path.write_text(text.replace(old, new, 1))
            with self.subTest(name=name, new=new):
                expect_line(case, name)
            path.write_text(text)
        (case / "constant" / "polyMesh" / "points").unlink()
        expect_line(case, "points")

    def write_exodus(self, path, form="NETCDF3_64BIT_OFFSET", one_coord=False, shift=0):
        import netCDF4
        points, cells = lattice(4), hexahedra(4)
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
            values = f.createVariable("vals_nod_var1", "f8", ("time_step", "num_nodes"))
            values[0], values[1] = p, p + 1
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
        result = self.run_program("convert", path, "--add-scalar", "v:x", "--to", self.folder / "mesh.splats")
        self.assertEqual(result.returncode, 0, result.stderr)
        result = self.run_program("convert", path, "--add-scalar", "v:x", "--to", self.folder / "mesh.splats")
        self.assertIn("has a scalar 'v:x' already", result.stderr)
        write_xml(grid, self.folder / "fields.vtu")
        result = self.run_program("convert", path, self.folder / "fields.vtu", "-o", self.folder / "two.splats")
        self.assertEqual(result.returncode, 1)
        self.assertIn("cannot be combined", result.stderr)


if __name__ == "__main__":
    unittest.main()
