#!/usr/bin/python3
"""odd_coordinates_test.py CURVISPLAT

Coordinates that are NaN or infinite, in every structured format: these nodes are left out, and all others are where numpy says. A
coordinate of 1e300, which is finite in double precision, is refused in one line. Exit status 77 (skipped) without python3-vtk9, python3-netcdf4 or python3-h5py.
"""
import struct
import sys
import unittest

from structured_formats import Block, StructuredFormats, np, vtk
from tecplot_files import Binary, write_text
from cgns_layout import CgnsLayout
from mesh_ensight_test import EnsightFile

try:
    import h5py
    import netCDF4
except ModuleNotFoundError as error:
    print(f"skipped: {error}; install python3-netcdf4 and python3-h5py")
    sys.exit(77)

SHAPE = (6, 5, 7)


class OddCoordinates(StructuredFormats):
    def setUp(self):
        super().setUp()
        self.block = Block(SHAPE)
        places = self.block.places
        places[0, 1, 2, 3] = np.nan
        places[1, 4, 0, 6] = np.inf
        places[2, 0, 4, 0] = -np.inf

    def single(self):
        """The block as a format of single precision holds it."""
        self.block.places, self.block.p = self.block.places.astype("f4"), self.block.p.astype("f4")
        return self.block

    def expect(self, write, scalar="p", double=True):
        """`write()` writes the block, and returns the names of its files."""
        paths = [self.folder / name for name in write()]
        info = self.info(*paths)
        seen = np.all(np.isfinite(self.block.places), axis=0)
        odd = int((~seen).sum())
        self.assertEqual(info["blanked"]["by_grid"], 0)
        self.assertEqual(info["blanked"]["not_finite"], odd)
        for n, axis in enumerate(self.block.places):
            np.testing.assert_allclose([info["bounds"][end][n] for end in ("lower", "upper")], [axis[seen].min(), axis[seen].max()], rtol=1e-6)
        manifest = self.manifest(self.convert(paths, scalar, "--refine", "1"))
        self.assertEqual(manifest["splats"], SHAPE[0] * SHAPE[1] * SHAPE[2] - odd)
        if double:
            self.block.places[2, 3, 3, 3] = -1e300
            write()
            self.expect_line(*paths, scalar=scalar, words="the grid is 1e+300 units long; scale it to between 1e-09 and 1e+12")

    def test_plot3d(self):
        dims = struct.pack("<3i", *SHAPE[::-1])

        def write(kind):
            (self.folder / "a.xyz").write_bytes(dims + self.block.places.astype(kind).tobytes())
            (self.folder / "a.fun").write_bytes(dims + struct.pack("<i", 1) + self.block.p.astype(kind).tobytes())
            return "a.xyz", "a.fun"

        self.expect(lambda: write("<f8"), scalar="1")
        self.setUp()
        self.single()
        self.expect(lambda: write("<f4"), scalar="1", double=False)

    def test_vtk(self):
        def write(mode):
            writer = vtk.vtkXMLStructuredGridWriter()
            writer.SetFileName(str(self.folder / "a.vts"))
            writer.SetInputData(self.block.vtk())
            getattr(writer, f"SetDataModeTo{mode}")()
            writer.Write()
            return ("a.vts",)

        for mode in ("Appended", "Ascii"):
            self.expect(lambda: write(mode))
            self.setUp()

    def test_cgns(self):
        def write():
            layout = CgnsLayout(self.folder / "a.cgns")
            base = layout.node(layout.file, "Base", "CGNSBase_t", np.array([3, 3], "i4"))
            layout.zone(base, "zone", self.block)
            layout.file.close()
            return ("a.cgns",)

        self.expect(write)

    def test_netcdf(self):
        """x and y of each column, z of each node."""
        self.block.places[:] = Block(SHAPE).places
        x, y, z = self.block.places
        x[:], y[:] = x[0], y[0]
        x[:, 1, 2] = np.nan
        y[:, 3, 5] = np.inf
        z[2, 2, 3] = np.nan

        def write():
            with netCDF4.Dataset(self.folder / "a.nc", "w") as f:
                for name, length in zip("kji", SHAPE):
                    f.createDimension(name, length)
                for name, dims, values in (("x", ("j", "i"), x[0]), ("y", ("j", "i"), y[0]), ("z", ("k", "j", "i"), z)):
                    f.createVariable(name, "f8", dims, fill_value=False)[:] = values
                    f[name].units = "km"
                    f[name].standard_name = {"x": "projection_x_coordinate", "y": "projection_y_coordinate", "z": "height"}[name]
                f.createVariable("p", "f8", ("k", "j", "i"))[:] = self.block.p
                f["p"].coordinates = "x y z"
            return ("a.nc",)

        self.expect(write)

    def test_tecplot(self):
        def binary():
            file = Binary(("X", "Y", "Z", "p"))
            file.zone(SHAPE, [*self.block.places, self.block.p])
            file.write(self.folder / "a.plt")
            return ("a.plt",)

        def text():
            size = " ".join(f"{axis}={n}," for axis, n in zip("IJK", SHAPE[::-1]))
            write_text(self.folder / "a.dat", [(size + " F=POINT", "POINT", [*self.block.places, self.block.p])])
            return ("a.dat",)

        self.expect(binary)
        self.setUp()
        self.expect(text)

    def test_ensight(self):
        def write():
            file = EnsightFile("<")
            file.text("C Binary", "a grid", "", "node id off", "element id off", "part")
            file.ints([1])
            file.text("block", "block")
            file.ints(list(SHAPE[::-1]))
            file.floats(self.block.places)
            (self.folder / "a.geo").write_bytes(file.data)
            file = EnsightFile("<")
            file.text("p", "part")
            file.ints([1])
            file.text("block")
            file.floats(self.block.p)
            (self.folder / "a.p").write_bytes(file.data)
            (self.folder / "a.case").write_text("FORMAT\ntype: ensight gold\nGEOMETRY\nmodel: a.geo\nVARIABLE\nscalar per node: p a.p\n")
            return ("a.case",)

        self.single()
        self.expect(write, double=False)

    def test_xdmf(self):
        def write():
            size = " ".join(map(str, SHAPE))
            with h5py.File(self.folder / "a.h5", "w") as file:
                file["xyz"], file["p"] = np.moveaxis(self.block.places, 0, -1), self.block.p
            item = '<DataItem Dimensions="{} {}" NumberType="Float" Precision="8" Format="HDF">a.h5:/{}</DataItem>'
            (self.folder / "a.xmf").write_text(
                f'<Xdmf><Domain><Grid><Topology TopologyType="3DSMesh" Dimensions="{size}"/><Geometry GeometryType="XYZ">'
                f'{item.format(size, 3, "xyz")}</Geometry><Attribute Name="p">{item.format(size, "", "p")}</Attribute></Grid></Domain></Xdmf>')
            return ("a.xmf",)

        self.expect(write)


if __name__ == "__main__":
    unittest.main()
