#!/usr/bin/python3
"""odd_scalars_test.py CURVISPLAT

Scalars that are too small for single precision or differ by less than it resolves, meshes that have none, and cells that are copies of those of other pieces. VTK, netCDF4
and h5py write the files. Exit status 77 (skipped) without python3-vtk9, python3-netcdf4 and python3-h5py.
"""
import os
import sys
import unittest

from format_case import np

try:
    import h5py
    import netCDF4
    import vtk
    from vtk.util.numpy_support import numpy_to_vtk

    from mesh_case import MeshCase
    from mesh_cubes import cube, hexahedra, insert, lattice, write_xml
except ModuleNotFoundError as error:
    print(f"skipped: {error}; install python3-vtk9, python3-netcdf4 and python3-h5py")
    sys.exit(77)


class OddScalars(MeshCase):
    VALUES = np.linspace(0, 3.4e-105, 60)  # from a public report: concentrations before anything arrives

    def setUp(self):
        super().setUp()
        os.environ["XDG_CACHE_HOME"] = str(self.folder / "kept")
        self.addCleanup(os.environ.pop, "XDG_CACHE_HOME")

    def write_vtk(self, binary):
        image = vtk.vtkImageData()
        image.SetDimensions(3, 4, 5)
        array = numpy_to_vtk(self.values, deep=True)
        array.SetName("c")
        image.GetPointData().AddArray(array)
        writer = vtk.vtkXMLImageDataWriter()
        (writer.SetDataModeToAppended if binary else writer.SetDataModeToAscii)()
        writer.SetFileName(str(self.folder / "a.vti"))
        writer.SetInputData(image)
        writer.Write()
        return self.folder / "a.vti"

    def write_netcdf(self, form):
        with netCDF4.Dataset(self.folder / "a.nc", "w", format=form) as f:
            for name, size, unit in (("z", 5, "m"), ("lat", 4, "degrees_north"), ("lon", 3, "degrees_east")):
                f.createDimension(name, size)
                v = f.createVariable(name, "f8", (name,))
                v.units, v[:] = unit, np.arange(size)
            f["z"].positive = "up"
            f.createVariable("c", "f8", ("z", "lat", "lon"))[:] = self.values.reshape(5, 4, 3)
        return self.folder / "a.nc"

    def write_xdmf(self):
        with h5py.File(self.folder / "a.h5", "w") as f:
            f["c"] = self.values.reshape(5, 4, 3)
        path = self.folder / "a.xmf"
        path.write_text('<Xdmf Version="3.0"><Domain><Grid><Topology TopologyType="3DCoRectMesh" Dimensions="5 4 3"/><Geometry GeometryType="ORIGIN_DXDYDZ">'
                        '<DataItem Dimensions="3">0 0 0</DataItem><DataItem Dimensions="3">1 1 1</DataItem></Geometry><Attribute Name="c" Center="Node">'
                        '<DataItem Dimensions="5 4 3" Format="HDF" NumberType="Float" Precision="8">a.h5:/c</DataItem></Attribute></Grid></Domain></Xdmf>')
        return path

    def write_tecplot(self):
        k, j, i = np.meshgrid(np.arange(5), np.arange(4), np.arange(3), indexing="ij")
        rows = np.stack([i.ravel(), j.ravel(), k.ravel(), self.values], 1)
        path = self.folder / "a.dat"
        path.write_text('VARIABLES = "x" "y" "z" "c"\nZONE I=3 J=4 K=5 F=POINT DT=(DOUBLE DOUBLE DOUBLE DOUBLE)\n'
                        + "\n".join(" ".join(map(repr, map(float, row))) for row in rows) + "\n")
        return path

    def test_the_value_of_a_constant_is_short(self):
        """0.4 in single precision is 0.4000000059604645, and -0 is 0."""
        for value, text in ((np.float32(0.4), "c is 0.4 everywhere"), (-0.0, "c is 0 everywhere")):
            self.values = np.full(60, value, "f4")
            drawn = self.run_program("render", self.write_vtk(True), "-o", self.folder / "p.png", "--size", "40x40")
            self.assertIn(text, drawn.stdout + drawn.stderr)

    def test_a_scalar_that_varies_takes_the_place_of_constants(self):
        """Whether it is the seventeenth of the file or of the other centring."""
        image = vtk.vtkImageData()
        image.SetDimensions(3, 4, 5)
        for name, values in [(f"a{n:02}", np.full(60, n, "f4")) for n in range(16)] + [("z", np.arange(60, dtype="f4"))]:
            array = numpy_to_vtk(values, deep=True)
            array.SetName(name)
            image.GetPointData().AddArray(array)
        path = self.folder / "a.vti"
        writer = vtk.vtkXMLImageDataWriter()
        writer.SetFileName(str(path))
        writer.SetInputData(image)
        writer.Write()
        picture = [path, "-o", self.folder / "p.png", "--size", "40x40"]
        self.assertIn("a15 are constant, so z took their place", self.run_program("render", *picture).stderr)
        image.GetPointData().RemoveArray("z")
        array = numpy_to_vtk(np.arange(24, dtype="f4"), deep=True)
        array.SetName("c")
        image.GetCellData().AddArray(array)
        writer.Write()
        drawn = self.run_program("render", *picture)
        self.assertIn("a15 are constant, so c took their place", drawn.stderr)
        self.assertIn("24 splats of c", drawn.stdout)

    def test_of_steps_that_begin_uniform_the_last_is_drawn(self):
        for first, said in ((0.0, "the last, since the first is constant,"), (1.0, "the first")):
            with netCDF4.Dataset(self.folder / "a.nc", "w") as f:
                for name, size in (("time", 3), ("z", 5), ("y", 4), ("x", 3)):
                    f.createDimension(name, size)
                    v = f.createVariable(name, "f8", (name,))
                    v.axis, v[:] = name[0].upper(), np.arange(size)
                f["z"].positive = "up"
                f["time"].units = "days since 2000-01-01"
                ramp = np.arange(60.0).reshape(5, 4, 3)
                f.createVariable("c", "f8", ("time", "z", "y", "x"))[:] = np.stack([first * ramp, 2 * ramp, 4 * ramp])
            picture = [self.folder / "a.nc", "-o", self.folder / "p.png", "--size", "40x40"]
            drawn = self.run_program("render", *picture)
            self.assertIn(f"3 time steps from 0 to 2 (2000-01-01 00:00:00 to 2000-01-03 00:00:00); {said} is shown; all of them: curvisplat convert ", drawn.stderr)
            self.assertIn(f"{self.folder}/a.nc --steps all", drawn.stderr)
            self.assertNotIn("everywhere", drawn.stderr)
            refused = self.run_program("render", *picture, "--step", "1")
            self.assertIn("has one time step, 0; of files with more, `convert --steps all`", refused.stderr)

    def test_a_scalar_of_too_wide_a_range_is_left_out_of_a_picture_of_others(self):
        k, j, i = np.meshgrid(np.arange(4), np.arange(4), np.arange(4), indexing="ij")
        wide = np.where(i == 1, 3e19, -3e19)
        grid, solution = self.folder / "w.xyz", self.folder / "w.q"
        grid.write_text("4 4 4\n" + "\n".join(str(n) for axis in (i, j, k) for n in axis.ravel()))
        solution.write_text("4 4 4\n0 0 0 0\n" + "\n".join(str(n) for values in (i, wide, wide, j, k) for n in values.ravel()))
        picture = ("-o", self.folder / "p.png", "--size", "40x40")
        refused = self.run_program("render", grid, solution, "--scalar", "momentum_x", *picture)
        reason = "momentum_x: its values go from -3e+19 to 3e+19, more than 1e+18 apart"
        self.assertEqual((refused.returncode, refused.stderr.startswith("curvisplat: " + reason)), (1, True), refused.stderr)
        drawn = self.run_program("render", grid, solution, "--scalar", "energy", *picture)
        self.assertEqual(drawn.returncode, 0, drawn.stderr)
        self.assertIn("warning: left out: momentum_x, momentum_y: " + reason, drawn.stderr)
        refused = self.run_program("render", grid, solution, "--scalar", "momentum_y", *picture)  # which the cache lacks
        self.assertEqual((refused.returncode, "momentum_y: its values go" in refused.stderr), (1, True), refused.stderr)

    def test_values_too_small_for_single_precision(self):
        warning = "c: its values are smaller than 1.2e-38 in magnitude, too small for single precision"
        for sign in (1, -1):
            self.values = sign * self.VALUES
            for path in (self.write_vtk(True), self.write_vtk(False), self.write_netcdf("NETCDF4"), self.write_netcdf("NETCDF3_CLASSIC"),
                         self.write_xdmf(), self.write_tecplot()):
                with self.subTest(path=path.name, sign=sign):
                    info = self.info(path)
                    self.assertTrue(any(w.startswith(warning) for w in info["warnings"]), info["warnings"])
                    self.assertGreater(max(sign * info["scalars"][0][word] for word in ("min", "max")), 0)
                    limit = "0 .. below 1.2e-38" if sign > 0 else "above -1.2e-38 .. 0"
                    self.assertIn(limit, self.run_program("info", path).stdout)
                    result = self.run_program("convert", path, "-o", self.folder / "d.splats", "--overwrite")
                    self.assertEqual(result.returncode, 0, result.stderr)
                    self.assertIn("warning: " + warning, result.stderr)

    def test_a_mesh_warns_as_well(self):
        grid = cube(2, ("hexahedron",))
        for n in range(grid.GetNumberOfCells()):
            grid.GetCellData().GetArray("c").SetValue(n, 1e-60 * n)
        write_xml(grid, self.folder / "m.vtu")
        self.assertTrue(any(w.startswith("c: its values are smaller") for w in self.info(self.folder / "m.vtu")["warnings"]))

    def test_differences_that_single_precision_loses(self):
        """As a low-Mach run: 101325 Pa and some mPa. Doubles that are equal, and floats, have nothing to lose."""
        self.values = 101325 + np.arange(60) * 8e-5
        for path in (self.write_vtk(True), self.write_vtk(False), self.write_netcdf("NETCDF4"), self.write_netcdf("NETCDF3_CLASSIC"),
                     self.write_xdmf(), self.write_tecplot()):
            with self.subTest(path=path.name):
                expected = "c: its values differ by about 0.0045, which single precision loses: it has steps of 0.0078 at 101325"
                self.assertEqual([w[:len(expected)] for w in self.info(path)["warnings"] if w.startswith("c: ")], [expected])
                result = self.run_program("convert", path, "-o", self.folder / "d.splats", "--refine", "1", "--overwrite")
                self.assertIn("warning: " + expected, result.stderr)
        for self.values in (np.full(60, 101325.1), (101325 + np.arange(60) / 64).astype("f4"), 101325 + np.arange(60) * 0.1):
            for path in (self.write_vtk(True), self.write_netcdf("NETCDF4")):
                self.assertEqual([w for w in self.info(path)["warnings"] if w.startswith("c: ")], [])
        grid = cube(2, ("hexahedron",))
        for n in range(grid.GetNumberOfCells()):
            grid.GetCellData().GetArray("c").SetValue(n, 300 + 1e-6 * n)
        write_xml(grid, self.folder / "m.vtu")
        self.assertTrue(any(w.startswith("c: its values differ by about 7e-06") for w in self.info(self.folder / "m.vtu")["warnings"]))

    def test_zeros_and_ordinary_values_are_no_reason_to_warn(self):
        for self.values in (np.zeros(60), np.linspace(0, 1, 60), np.linspace(1e-37, 1e-36, 60)):
            for path in (self.write_vtk(True), self.write_netcdf("NETCDF4")):
                self.assertEqual([w for w in self.info(path)["warnings"] if w.startswith("c: ")], [])

    def test_a_mesh_without_scalars(self):
        """Its volume is drawn as a constant, which a warning says. A mesh of SU2 asks for its restart file beside that."""
        points, grid = vtk.vtkPoints(), vtk.vtkUnstructuredGrid()
        for point in lattice(3):
            points.InsertNextPoint(point)
        grid.SetPoints(points)
        for corners in hexahedra(3):
            insert(grid, vtk.VTK_HEXAHEDRON, corners)
        write_xml(grid, self.folder / "m.vtu")
        info = self.info(self.folder / "m.vtu")
        self.assertEqual([(s["name"], s["min"], s["max"], s["centring"]) for s in info["scalars"]], [("constant", 1, 1, "cell")])
        self.assertEqual(info["warnings"], ["the files contain no scalar; a constant, 1 in all cells, takes its place"])
        result = self.run_program("convert", self.folder / "m.vtu", "-o", self.folder / "d.splats")
        self.assertEqual(result.returncode, 0, result.stderr)
        self.assertIn("warning: the files contain no scalar", result.stderr)
        manifest = self.manifest(self.folder / "d.splats")
        self.assertEqual((manifest["centring"], manifest["splats"], manifest["variables"][0]["name"]), ("cell", len(list(hexahedra(3))), "constant"))
        result = self.run_program("render", self.folder / "d.splats", "-o", self.folder / "p.png", "--size", "64x64")
        self.assertEqual(result.returncode, 0, result.stderr)
        self.assertNotIn("empty", result.stderr)

    def test_a_piece_alone_lacks_the_copies_of_others(self):
        grid = cube(2, ("hexahedron",))
        flags = np.zeros(grid.GetNumberOfCells(), "u1")
        flags[:3] = vtk.vtkDataSetAttributes.DUPLICATECELL
        array = numpy_to_vtk(flags, deep=True)
        array.SetName("vtkGhostType")
        grid.GetCellData().AddArray(array)
        write_xml(grid, self.folder / "m.vtu")
        info = self.info(self.folder / "m.vtu")
        self.assertEqual(info["warnings"], [f"left out: 3 of {len(flags)} cells, which vtkGhostType marks as copies of other pieces'; the file "
                                            "that names all pieces (.pvtu) draws them"])


if __name__ == "__main__":
    unittest.main()
