#!/usr/bin/python3
"""mesh_gmsh_test.py CURVISPLAT

Gmsh's meshes, written here as its manual describes them and by meshio where it is installed, against VTK's XML files of the same mesh: the
caches are equal byte by byte. Damaged files get one line. Exit status 77 (skipped) without python3-vtk9.
"""
import sys
import unittest

try:
    import numpy as np
    import vtk
    from vtk.util.numpy_support import vtk_to_numpy

    from gmsh_files import LATTICES, PYRAMIDS, Msh, lattice_of
    from mesh_case import MeshCase
    from mesh_cubes import RANDOM, cube
    from mesh_curved_test import grid_of, nodes_of
    from sweep import some_of
except ModuleNotFoundError as error:
    print(f"skipped: {error}; install python3-vtk9 and python3-numpy")
    sys.exit(77)

try:
    import meshio
except ModuleNotFoundError:
    meshio = None


class MeshGmsh(MeshCase):
    VARIANTS = [(4.1, "<"), (4.1, ""), (2.2, "<"), (2.2, ""), (4.1, ">"), (2.2, ">"), (4, "<"), (4, "")]

    def written(self, grid, version=4.1, order="<", **tags):
        file = Msh(grid, version, order, **tags).mesh()
        for name in "pv":
            file.data(name, vtk_to_numpy(grid.GetPointData().GetArray(name)))
        return file.data("c", vtk_to_numpy(grid.GetCellData().GetArray("c")), "Element").write(self.folder / "a.msh")

    def vtu(self, grid):
        writer = vtk.vtkXMLUnstructuredGridWriter()
        writer.SetFileName(str(self.folder / "expected.vtu"))
        writer.SetInputData(grid)
        writer.Write()
        return self.folder / "expected.vtu"

    def test_versions_and_byte_orders(self):
        grid = cube(kinds=("hexahedron", "tetrahedra", "wedges", "pyramids"))
        expected = self.vtu(grid)
        for version, order in self.VARIANTS:
            with self.subTest(version=version, order=order):
                path = self.written(grid, version, order)
                self.expect_same_caches([path], expected)
                self.check(path, grid)
        self.assertEqual(self.info(path)["format"], "Gmsh 4.0, ASCII")

    def test_numbers_in_any_order(self):
        grid = cube(kinds=("hexahedron", "tetrahedra", "face"))
        points, cells = grid.GetNumberOfPoints(), grid.GetNumberOfCells()
        solid = np.array([grid.GetCell(n).GetCellDimension() == 3 for n in range(cells)])
        values = vtk_to_numpy(grid.GetCellData().GetArray("c"))
        for version, order in some_of(self.VARIANTS, 2):
            path = self.written(grid, version, order, tags=RANDOM.permutation(3 * points)[:points] + 7, element_tags=RANDOM.permutation(cells) + 1)
            self.expect_same_caches([path], self.vtu(grid), names={"c": None})
            info = {scalar["name"]: scalar for scalar in self.info(path)["scalars"]}
            self.assertEqual((info["c"]["min"], info["c"]["max"]), (np.float32(values[solid].min()), np.float32(values[solid].max())))

    def test_comments_before_the_format(self):
        grid = cube(kinds=("hexahedron",))
        for order in ("<", ""):
            path = self.written(grid, 4.1, order)
            path.write_bytes(b"$Comments\nmade by hand\n$EndComments\n" + path.read_bytes())
            self.assertEqual(self.info(path)["cells"]["count"], grid.GetNumberOfCells())
        path.write_text("$Comments\n$EndComments\n$NOD\n4\n1 0 0 0\n")
        self.expect_line(path, words="has no $MeshFormat: it is of Gmsh's version 1")

    def test_cells_of_second_order(self):
        grid = cube(kinds=("quadratic",))
        for version, order in some_of(self.VARIANTS, 3):
            self.expect_same_caches([self.written(grid, version, order)], self.vtu(grid))

    def test_cells_of_higher_order(self):
        for kind, (of_vtk, order, text) in LATTICES.items():
            places = nodes_of(of_vtk, order)
            number = {tuple(place.round(9)): n for n, place in enumerate(places)}
            kinds = {of_vtk: (kind, [number[tuple(place.round(9))] for place in lattice_of(order, text)])}
            grid = grid_of(of_vtk, places + RANDOM.uniform(-0.02, 0.02, places.shape), [range(len(places))], RANDOM.random(len(places)))
            for version, binary in some_of(self.VARIANTS[:4], 2):
                path = Msh(grid, version, binary, kinds=kinds).mesh().data("p", vtk_to_numpy(grid.GetPointData().GetArray("p"))).write(self.folder / "a.msh")
                self.expect_same_caches([path], self.vtu(grid), names={"c": None})

    def test_pyramids_of_higher_order(self):
        """A straight one is filled, whatever the order of its nodes, only if that is read right."""
        for order, (kind, text) in PYRAMIDS.items():
            places = lattice_of(order, text)
            grid = grid_of(vtk.VTK_LAGRANGE_PYRAMID, places, [range(len(places))], places @ (1, 2, 3))
            path = Msh(grid, 4.1, "", kinds={vtk.VTK_LAGRANGE_PYRAMID: (kind, range(len(places)))}).mesh().data("p", vtk_to_numpy(grid.GetPointData().GetArray("p"))).write(self.folder / "a.msh")
            info = self.info(path)
            along = np.arange(1, order + 1)
            self.assertEqual(info["cells"]["pyramids"], (along**2 + (along - 1)**2).sum())
            self.assertEqual(info["cells"]["tetrahedra"], (2 * along * (along - 1)).sum())
            self.assertEqual(info["warnings"], [])
            self.assertAlmostEqual(self.volume(path, "p"), 1 / 3, delta=1e-3)

    def test_files_of_partitions(self):
        """As Gmsh saves them with Mesh.PartitionSplitMeshFiles: numbers go through all files, which are no steps of a series."""
        grid = cube(kinds=("hexahedron",))
        cells = grid.GetNumberOfCells()
        for order in ("<", ""):
            paths = []
            for part, some in enumerate((range(cells // 2), range(cells // 2, cells)), 1):
                file = Msh(grid, 4.1, order, partition=(part, 2))
                used = sorted({node for n in some for node in file.cells[n][1]})
                renumbered = {node: n for n, node in enumerate(used)}
                file.cells = [(kind, [renumbered[node] for node in nodes]) for kind, nodes in (file.cells[n] for n in some)]
                file.tags, file.points, file.element_tags = file.tags[used], file.points[used], file.element_tags[list(some)]
                paths.append(file.mesh().data("p", vtk_to_numpy(grid.GetPointData().GetArray("p"))[used]).write(self.folder / f"a_{part}.msh"))
            info = self.info(*paths)
            self.assertEqual((info["cells"]["count"], [piece["name"] for piece in info["pieces"]], info["warnings"]), (cells, ["a_1.msh", "a_2.msh"], []))
            whole = self.manifest(self.convert([self.vtu(grid)], "p"))
            self.assertEqual(self.manifest(self.convert(paths, "p"))["splats"], whole["splats"])
            self.assertAlmostEqual(self.manifest(self.convert(paths, "p"))["volume"], whole["volume"], delta=1e-3 * whole["volume"])
            self.assertIn("a_2.msh is part 2 of a mesh that Gmsh saved in 2 files: give all of them", " ".join(self.info(paths[1])["warnings"]))

    def test_elements_in_several_groups(self):
        grid = cube(kinds=("hexahedron", "tetrahedra"))
        for order in ("", "<"):
            path = self.written(grid, 2.2, order, groups=3)
            self.assertIn("repeated for further physical groups", " ".join(self.check(path, grid)["notes"]))

    def test_parametric_nodes(self):
        grid = cube(kinds=("hexahedron",))
        for order in ("", "<"):
            path = Msh(grid, 2.2, order).mesh(parametric=True).data("p", vtk_to_numpy(grid.GetPointData().GetArray("p"))).write(self.folder / "a.msh")
            self.expect_same_caches([path], self.vtu(grid), names={"c": None})

    def test_views_with_their_mesh(self):
        grid, other = cube(kinds=("hexahedron",)), cube(kinds=("hexahedron",))
        for version, order in self.VARIANTS[:4]:
            file = Msh(grid, version, order).mesh().data("p", vtk_to_numpy(grid.GetPointData().GetArray("p")))
            file.mesh().data("c", vtk_to_numpy(grid.GetCellData().GetArray("c")), "Element")
            self.expect_same_caches([file.write(self.folder / "a.msh")], self.vtu(grid))
            file.out += Msh(other, version, order).mesh().out
            result = self.run_program("info", file.write(self.folder / "b.msh"))
            self.assertIn("has several meshes; expected one", result.stderr)

    def test_values_at_nodes_of_elements(self):
        grid = cube(kinds=("hexahedron", "tetrahedra", "quadratic"))
        values = vtk_to_numpy(grid.GetPointData().GetArray("p")).astype("f8")
        path = self.folder / "a.msh"
        for version, order in self.VARIANTS[:4]:
            Msh(grid, version, order).mesh().data_at_nodes("p", lambda _, node: values[node]).write(path)
            self.expect_same_caches([path], self.vtu(grid), names={"c": None})
        # Of a node the mean.
        file = Msh(grid).mesh().data_at_nodes("m", lambda element, node: element)
        around = [[n for n, (_, nodes) in enumerate(file.cells) if point in nodes] for point in range(grid.GetNumberOfPoints())]
        file.data("e", [np.mean(elements) for elements in around]).write(path)
        self.assertEqual(self.cache([path], "m"), self.cache([path], "e"))

    def test_steps_without_times(self):
        grid = cube(2, kinds=("hexahedron",))
        file = Msh(grid).mesh()
        for step in (3, 8):
            file.data("T", np.full(grid.GetNumberOfPoints(), step), time=0.0, step=step)
        path = file.write(self.folder / "s.msh")
        self.assertEqual(self.info(path)["times"], [3, 8])
        self.assertEqual(self.info(path, "--time-step", 1)["scalars"][0]["min"], 8)

    def test_steps(self):
        grid = cube(kinds=("hexahedron",))
        values = RANDOM.random((3, grid.GetNumberOfPoints()))
        for version, order in some_of(self.VARIANTS, 3):
            file = Msh(grid, version, order).mesh()
            for step in (1, 0, 2):
                file.data("T", values[step], time=0.25 * step, step=step)
            path = file.write(self.folder / "s.msh")
            self.assertEqual(self.info(path)["times"], [0, 0.25, 0.5])
            for step in range(3):
                scalar = self.info(path, "--time-step", step)["scalars"][0]
                self.assertEqual((scalar["min"], scalar["max"]), (np.float32(values[step].min()), np.float32(values[step].max())))

    def test_values_of_some(self):
        grid = cube(kinds=("hexahedron",))
        values = RANDOM.random(grid.GetNumberOfCells())
        path = Msh(grid).mesh().data("c", values, "Element", some=range(9, 30)).data("c", values, "Element", some=range(40, 50)).write(self.folder / "s.msh")
        kept = values[[*range(9, 30), *range(40, 50)]]
        info = self.info(path)
        self.assertEqual((info["scalars"][0]["min"], info["scalars"][0]["max"]), (np.float32(kept.min()), np.float32(kept.max())))

    @unittest.skipUnless(meshio, "no meshio")
    def test_meshio(self):
        grid = cube(kinds=("hexahedron",))
        expected = self.vtu(grid)
        mesh = meshio.read(expected)
        mesh.point_data = {"p": mesh.point_data["p"]}
        for form, binary in (("gmsh", True), ("gmsh", False), ("gmsh22", True), ("gmsh22", False)):
            meshio.write(self.folder / "m.msh", mesh, form, binary=binary)
            self.expect_same_caches([self.folder / "m.msh"], expected)

    def test_damage(self):
        grid = cube(2, kinds=("hexahedron", "tetrahedra"))

        def refused(path, words=""):
            result = self.run_program("info", path)
            self.assertEqual((result.returncode, result.stderr.count("\n")), (1, 1), result.stderr)
            self.assertIn(words or path.name, result.stderr)

        for version, order in self.VARIANTS[:4]:
            path = self.written(grid, version, order)
            whole = path.read_bytes()
            # Behind the last value nothing is missed but the end of the section.
            for cut in some_of(sorted({*range(12, len(whole) - 20, max(1, len(whole) // 40)), whole.index(b"$Elements") + 3})):
                path.write_bytes(whole[:cut])
                result = self.run_program("info", path)
                ends = whole[:cut].rstrip().endswith((b"$EndElements", b"$EndNodeData"))
                self.assertEqual((result.returncode, result.stderr.count("\n")) if not ends else (1, 1), (1, 1), (version, order, cut, result.stderr))
            for place in some_of(RANDOM.integers(20, len(whole), 60).tolist()):
                changed = bytearray(whole)
                changed[place] = int(RANDOM.integers(256))
                path.write_bytes(changed)
                result = self.run_program("info", path)
                self.assertIn(result.returncode, (0, 1), result.stderr)
        path = self.folder / "b.msh"
        text = self.written(grid, 2.2, "").read_bytes()
        for old, new, words in ((b"2.2 0 8", b"3 0 8", "of version 3; expected 4.1, 4.0 or 2.2"), (b"$Nodes", b"$Knots", "has no $EndKnots"),
                                (b"$Nodes\n", b"$Nodes\n99999999\n", "counts 99999999"), (b" 5 2 1 1 ", b" 5 2 1 1 999", "refers to point"),
                                (b" 5 2 1 1 ", b" 77 2 1 1 ", "elements of type 77"), (b"\n\"p\"\n1\n0.0\n3\n0\n1\n", b"\n\"p\"\n1\n0.0\n3\n0\n0\n", "of 0 components")):
            self.assertIn(old, text)
            path.write_bytes(text.replace(old, new, 1))
            refused(path, words)


if __name__ == "__main__":
    unittest.main()
