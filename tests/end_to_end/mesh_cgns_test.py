#!/usr/bin/python3
"""mesh_cgns_test.py CURVISPLAT

Unstructured zones of CGNS, written by libcgns: mesh_formats.py says how. Exit status 77 (skipped) without python3-vtk9.
"""
import unittest

from mesh_formats import Mesh, MeshFormats, np, vtk

import cgns_library as cg


@unittest.skipUnless(cg.library(), "no libcgns")
class CgnsMeshes(MeshFormats):
    def setUp(self):
        super().setUp()
        self.path = self.folder / "mesh.cgns"

    def finish(self, file, mesh):
        file.solution("Nodes", cg.VERTEX, {"p": mesh.p})
        file.solution("Cells", cg.CELL_CENTER, {"c": mesh.c})

    def write_mixed(self, mesh, faces=0):
        """All cells, and some faces, in one section. Returns what mixed() does."""
        words, begins = self.mixed(mesh, faces=faces)
        with cg.CgnsFile(self.path) as file:
            file.base()
            file.zone("Cube", mesh.points, len(mesh.cells))
            file.section("all", cg.MIXED, words, len(mesh.cells) + faces, begins)
            self.finish(file, mesh)
        return words, begins

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

    def test_adf_of_version_b(self):
        """Its header has binary pointers, of either byte order."""
        mesh = Mesh()
        self.write_sections(mesh, cg.ADF)
        for layout in ("IEEE_LITTLE_64", "IEEE_LITTLE_32", "IEEE_BIG_64"):
            with self.subTest(layout=layout):
                path = self.folder / f"{layout}.cgns"
                cg.copy_adf(self.path, path, layout)
                whole = path.read_bytes()
                self.assertIn(b"Version B", whole[:32])
                self.expect_same([path], mesh.vtk())
                path.write_bytes(whole[:-4096])
                said = self.run_program("info", path).stderr
                self.assertIn(f"is truncated (found {len(whole) - 4096} bytes, expected", said)

    def test_bases_of_the_same_zones_are_said(self):
        """They may be time steps, as CFX writes them; others are parts of one grid."""
        mesh = Mesh()
        for names, zones, said in ((("Base 0", "Base 2", "Base 4"), ("piston",) * 3, True), (("Rotor", "Stator"), ("rotor", "stator"), False)):
            with cg.CgnsFile(self.path) as file:
                for base, zone in zip(names, zones):
                    file.base(base)
                    file.zone(zone, mesh.points, len(mesh.cells))
                    file.section("all", cg.MIXED, self.mixed(mesh)[0], len(mesh.cells), self.mixed(mesh)[1])
            warnings = " ".join(self.info(self.path)["warnings"])
            self.assertEqual("3 bases have the same zones (Base 0, Base 2, Base 4), and all of them are read" in warnings, said, warnings)
            self.assertEqual("bases" in warnings, said, warnings)

    def test_numbers_of_elements_of_every_version(self):
        """CGNS 3.0 counted PYRA_13 between PYRA_5 and PYRA_14: HEXA_8 was 18, MIXED 21. Polygons of MIXED were 21 or 22 and their nodes."""
        import h5py
        mesh = Mesh()
        for version in (2.4, 2.54, 3.0, 3.0999, 3.11, 3.21, 4.2):
            def stored(kind):
                return kind if kind <= cg.PYRA_5 or not 3 <= version < 3.09 else kind + 1
            for mixed in (False, True):
                with self.subTest(version=version, mixed=mixed):
                    if mixed:
                        words, begins = self.write_mixed(mesh)
                        self.old_layout("all")
                    else:
                        self.write_sections(mesh)
                    with h5py.File(self.path, "r+") as file:
                        file["CGNSLibraryVersion/ data"][:] = np.float32(version)
                        for name, group in file["Base/Cube"].items():
                            if isinstance(group, h5py.Group) and "ElementRange" in group:
                                group[" data"][0] = stored(group[" data"][0])
                        if mixed:
                            at = begins[:-1]
                            words = np.array(words)
                            words[at] = [stored(kind) for kind in words[at]]
                            data = file["Base/Cube/all/ElementConnectivity/ data"]
                            data[:] = words.astype(data.dtype)
                    self.expect_same([self.path], mesh.vtk())

    def test_mixed_sections(self):
        mesh = Mesh()
        self.write_mixed(mesh)
        self.expect_same([self.path], mesh.vtk())
        self.old_layout("all")
        self.expect_same([self.path], mesh.vtk())

    def test_mixed_sections_with_faces(self):
        mesh = Mesh()
        self.write_mixed(mesh, faces=3)
        warnings = self.info(self.path)["warnings"]
        self.assertTrue(any("3 elements are nodes, lines or faces" in w for w in warnings), warnings)
        self.assertTrue(any("cell-centred fields" in w for w in warnings), warnings)
        self.expect_same([self.path], mesh.vtk(), {"c": None})

    def test_a_mixed_section_of_faces_alone(self):
        """Its elements are no cells of the zone, whose values remain those of all cells."""
        mesh = Mesh()
        wall = [cg.QUAD_4, *(mesh.cells[0][:4] + 1)]
        words, begins = self.mixed(mesh)
        with cg.CgnsFile(self.path) as file:
            file.base()
            file.zone("Cube", mesh.points, len(mesh.cells))
            file.section("shells", cg.MIXED, np.array(wall + wall), 2, np.array([0, 5, 10]))
            file.section("all", cg.MIXED, words, len(mesh.cells), begins)
            self.finish(file, mesh)
        self.assertEqual(self.info(self.path)["cells"]["count"], len(mesh.cells))
        self.expect_same([self.path], mesh.vtk())

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
        self.assertEqual(info["cells"]["count"], 9 * len(mesh.cells))
        self.assertTrue(any("higher order" in note for note in info["notes"]), info["notes"])
        self.assertAlmostEqual(self.volume([self.path], "c"), 1, delta=2e-3)

    def test_a_series_whose_zones_change_their_order(self):
        """A step is the mesh of its own file: zones of unstructured grids need no match."""
        mesh = Mesh(kinds=(8,))
        half = len(mesh.cells) // 2
        zones = [("Low", range(half)), ("High", range(half, len(mesh.cells)))]
        for name, order, factor in (("run_1.cgns", zones, 1), ("run_2.cgns", zones[::-1], 2), ("run_3.cgns", zones, 3)):
            with cg.CgnsFile(self.folder / name) as file:
                file.base()
                for zone, part in order:
                    file.zone(zone, mesh.points, half)
                    file.section("bricks", cg.HEXA_8, np.array(mesh.cells)[part] + 1)
                    file.solution("Cells", cg.CELL_CENTER, {"c": factor * mesh.c[part]})
        names = [self.folder / f"run_{n}.cgns" for n in (1, 2, 3)]
        cache = self.folder / "series.splats"
        done = self.run_program("convert", *names, "-o", cache, "--scalar", "c", "--overwrite")
        self.assertEqual(done.returncode, 0, done.stderr)
        for step, name in enumerate(names):
            picture = {}
            for what, options in ((cache, ["--step", step]), (self.convert([name], "c"), [])):
                out = self.folder / "a.pfm"
                done = self.run_program("render", what, *options, "-o", out, "--size", "48x48", "--scalar", "c", "--range", f"0,{step + 1}")
                self.assertEqual(done.returncode, 0, done.stderr)
                picture[what] = out.read_bytes()
            self.assertEqual(len(set(picture.values())), 1, step)

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
        self.assertGreater(self.expect_harmless(self.path), 1 / 3)
        self.write_polyhedra(mesh)
        self.assertGreater(self.expect_harmless(self.path), 1 / 3)

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


if __name__ == "__main__":
    unittest.main()
