#!/usr/bin/python3
"""mesh_needs_test.py CURVISPLAT

What holds for every format, of those that codes write now: derived scalars, files that are the steps of a series, and truncated files, which
are refused by one line. Memory, threads and ranks: mesh_bytes_test.py. Exit status 77 (skipped) without python3-vtk9 or python3-h5py.
"""
import sys
import unittest

from mesh_formats import Mesh, MeshFormats, np, numpy_to_vtk, vtk, write_xml

try:
    import h5py

    import mesh_fluent_test
    import vtkhdf_test
except ModuleNotFoundError as error:
    print(f"skipped: {error}; install python3-h5py")
    sys.exit(77)

import gmsh_files
import mesh_curved_test
import mesh_xdmf_test
from sweep import some_of
from tecplot_files import Binary

NAMES = ("Density", "Momentum", "Energy")


def flow(places, step=0):
    """Density, momentum and energy, of which the pressure follows."""
    density = 1 + places[..., 0]
    return density, density[..., None] * [1.0, 2.0, 0.5], 10 + step + places[..., 1]


def pressure(density, momentum, energy):
    return 0.4 * (energy - 0.5 * (momentum**2).sum(-1) / density)


class Needs(MeshFormats):
    """A writer of a format is given a name and a step, and returns the file and the pressure at its samples."""

    def gmsh(self, name, step):
        mesh = Mesh(2, (8,))
        file = gmsh_files.Msh(mesh.vtk()).mesh()
        for field, values in zip(NAMES, flow(mesh.points, step)):
            file.data(field, values)
        return file.write(self.folder / f"{name}.msh"), pressure(*flow(mesh.points, step))

    def tecplot(self, name, step):
        mesh = Mesh(2, (8,))
        density, momentum, energy = flow(mesh.points, step)
        file = Binary(["X", "Y", "Z", "Density", *(f"Momentum{axis}" for axis in "XYZ"), "Energy"])
        file.zone(len(mesh.points), [*mesh.points.T.copy(), density, *momentum.T.copy(), energy], zone_type=5, elements=mesh.cells)
        path = self.folder / f"{name}.plt"
        file.write(path)
        return path, pressure(*flow(mesh.points, step))

    def vtkhdf(self, name, step):
        mesh, path = Mesh(2), self.folder / f"{name}.vtkhdf"
        with h5py.File(path, "w", track_order=True) as f:
            vtkhdf_test.write_mesh(f.create_group("VTKHDF"), [mesh])
            for field, values in zip(NAMES, flow(mesh.points, step)):
                f[f"VTKHDF/PointData/{field}"] = values
        return path, pressure(*flow(mesh.points, step))

    def functions(self, name, step):
        """Functions of finite elements of degree 2 in XDMF, all numbers in the XML."""
        writer = mesh_xdmf_test.XdmfMeshes("run_program")
        writer.setUp()
        self.addCleanup(writer.doCleanups)
        writer.path, in_file = self.folder / f"{name}.xmf", writer.item
        writer.item = lambda values, kind="XML": in_file(values, "XML")
        mesh, cells, _ = writer.tetrahedra(1)
        ten = writer.ten_points(mesh)
        density, momentum, energy = flow(ten, step)
        grid = writer.grid(mesh, ("Tetrahedron", len(cells), cells), "XML")
        along = np.concatenate([writer.by_ufc(momentum[:, :, axis]) for axis in range(3)], 1)
        text = grid[:grid.index("<Attribute")] + "".join(
            writer.function(field, 2, "CG", values, kind)
            for field, values, kind in (("Density", writer.by_ufc(density), "Scalar"), ("Momentum", along, "Vector"), ("Energy", writer.by_ufc(energy), "Scalar")))
        return writer.write(text + "</Grid>"), pressure(density, momentum, energy)

    def curved(self, name, step, kind=vtk.VTK_LAGRANGE_HEXAHEDRON):
        """A Bezier cell of even control points has the linear fields of these at its nodes, as Lagrange's has."""
        places = mesh_curved_test.nodes_of(vtk.VTK_LAGRANGE_HEXAHEDRON, 3)
        grid = mesh_curved_test.grid_of(kind, places, [range(len(places))])
        density = np.ones(len(places))
        fields = density, density[:, None] * [1.0, 2.0, 0.5], 10 + step + places[:, 1]
        for field, values in zip(NAMES, fields):
            array = numpy_to_vtk(values, deep=True)
            array.SetName(field)
            grid.GetPointData().AddArray(array)
        write_xml(grid, self.folder / f"{name}.vtu")
        return self.folder / f"{name}.vtu", pressure(*fields)

    def bezier(self, name, step):
        return self.curved(name, step, vtk.VTK_BEZIER_HEXAHEDRON)

    def fluent(self, name, step):
        """A data file has its case beside it, by its name."""
        points, corners = mesh_fluent_test.lattice(3), mesh_fluent_test.hexahedra(3)
        case = mesh_fluent_test.Case(self.folder / f"{name}.cas.h5", points, list(map(mesh_fluent_test.hexahedron, corners)))
        values = 10.0 + step + np.arange(27) / 27
        case.data(self.folder / f"{name}.dat.h5", {"SV_P": values, "SV_U": values / 10})
        return case.path, values

    FORMATS = (gmsh, tecplot, vtkhdf, functions, curved, bezier)

    def test_derived_scalars(self):
        for writer in self.FORMATS:
            with self.subTest(format=writer.__name__):
                path, values = writer(self, "a", 0)
                scalars = {scalar["name"]: scalar for scalar in self.info(path)["scalars"]}
                np.testing.assert_allclose((scalars["pressure"]["min"], scalars["pressure"]["max"]), (values.min(), values.max()), rtol=1e-5)
                self.assertGreater(self.volume([path], "pressure"), 0.9)

    def test_series(self):
        """Each step has its own values: the pressure rises by the same everywhere."""
        points = self.folder / "points.txt"
        points.write_text("0.45,0.4,0.35\n")
        for writer in self.FORMATS:
            with self.subTest(format=writer.__name__):
                paths = [writer(self, f"{writer.__name__}_{step}", step)[0] for step in range(3)]
                cache = self.folder / f"{writer.__name__}.splats"
                done = self.run_program("convert", *paths, "-o", cache, "--scalar", "pressure", "--steps", "all")
                self.assertEqual(done.returncode, 0, done.stderr)
                self.assertIn("3 steps", done.stdout)
                lines = self.run_program("info", cache, "--probe", points, "--steps", "all").stdout.splitlines()
                values = [float(line.split(",")[5]) for line in lines[1:]]
                np.testing.assert_allclose(np.diff(values), [0.4, 0.4], atol=0.01)

    def test_truncated_files(self):
        for writer in (*self.FORMATS, Needs.fluent):
            path, _ = writer(self, "t", 0)
            data = path.read_bytes()
            for cut in some_of(range(0, len(data) - 40, max(1, len(data) // 40)), 8):
                path.write_bytes(data[:cut])
                done = self.run_program("info", path)
                self.assertEqual((done.returncode, done.stderr.count("\n")), (1, 1), (path.name, cut, len(data), done.stderr))


if __name__ == "__main__":
    unittest.main()
