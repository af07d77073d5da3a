#!/usr/bin/python3
"""round_trips_test.py CURVISPLAT

One grid through the libraries that people write with: h5py in the layout of CGNS (pyCGNS is not packaged by Debian), netCDF4,
xarray, VTK, meshio, and column-major writers as MATLAB and Fortran have them. The caches of structured files are byte for byte
that of VTK's file. Exit status 77 (skipped) without python3-vtk9 or python3-h5py; a library that is missing skips its test.
"""
import json
import unittest

import cgns_library as cg
from cgns_layout import CgnsLayout, library
from sweep import IS_WHOLE
from structured_formats import RANDOM, Block, StructuredFormats, np, vtk


class RoundTrips(StructuredFormats):
    def test_h5py_in_the_layout_of_cgns(self):
        for kind in ("f4", "f8"):
            blocks = [Block(kind=kind), Block((4, 3, 5), 9, kind)]
            path = self.folder / "grid.cgns"
            file = CgnsLayout(path)
            base = file.node(file.file, "Base", "CGNSBase_t", np.array([3, 3], "i4"))
            for n, block in enumerate(blocks):
                file.zone(base, f"zone {n}", block)
            file.file.close()
            self.expect_same([path], blocks)

    @unittest.skipUnless(cg.library(), "no libcgns")
    def test_overset_holes_of_cgns(self):
        """Holes are what VTK calls blanked points and cells."""
        path, expected, block = self.folder / "grid.cgns", self.folder / "expected.vts", Block()
        inside = np.s_[:3, 1:4, 1:5]  # k, j, i: from 1, with their ends
        ranges = [[2, 2, 1, 5, 4, 3]]
        for kind in (cg.ADF, cg.HDF5):
            for location in (cg.VERTEX, cg.CELL_CENTER):
                with cg.CgnsFile(path, kind) as file:
                    file.base()
                    file.block("zone", block.places)
                    file.solution("nodes", cg.VERTEX, {"p": block.p})
                    file.solution("cells", cg.CELL_CENTER, {"c": block.c})
                    file.hole("hole", ranges, location)
                grid = block.vtk()
                hidden = np.zeros(block.shape if location == cg.VERTEX else block.c.shape, bool)
                hidden[inside] = True
                for n in np.flatnonzero(hidden):
                    (grid.BlankPoint if location == cg.VERTEX else grid.BlankCell)(int(n))
                writer = vtk.vtkXMLStructuredGridWriter()
                writer.SetFileName(str(expected))
                writer.SetInputData(grid)
                writer.Write()
                info = self.info(path)
                self.assertIn("overset holes: 1 set", info["notes"])
                self.assertGreater(info["blanked"]["by_grid"], 0)
                self.expect_same_caches([path], expected)

    @unittest.skipUnless(cg.library(), "no libcgns")
    def test_links_of_cgns(self):
        """Fields in one file, whose coordinates are a link to another."""
        block, path = Block(), self.folder / "flow.cgns"
        for kind in (cg.ADF, cg.HDF5):
            with cg.CgnsFile(self.folder / "grid.cgns", kind) as file:
                file.base()
                file.block("zone", block.places)
            with cg.CgnsFile(path, kind) as file:
                file.base()
                nodes = np.array(block.shape[::-1], "i4")
                file.z = file.call("cg_zone_write", file.b, b"zone", file.ints([nodes, nodes - 1, 0 * nodes]), cg.STRUCTURED)
                file.solution("nodes", cg.VERTEX, {"p": block.p})
                file.solution("cells", cg.CELL_CENTER, {"c": block.c})
                file.check(file.lib.cg_goto(file.number, file.b, b"Zone_t", file.z, b"end"))
                file.check(file.lib.cg_link_write(b"GridCoordinates", b"grid.cgns", b"/Base/zone/GridCoordinates"))
            self.expect_same([path], [block])
            (self.folder / "grid.cgns").unlink()
            self.expect_line(path, words="flow.cgns")

    def test_vtk(self):
        """Files of other encodings than the one that is compared with."""
        block = Block()
        writer = vtk.vtkXMLStructuredGridWriter()
        for mode in ("Ascii", "Binary", "Appended"):
            path = self.folder / "grid.vts"
            writer.SetFileName(str(path))
            getattr(writer, f"SetDataModeTo{mode}")()
            writer.SetInputData(block.vtk())
            writer.Write()
            self.expect_same([path], [block])
        block = Block((60, 90, 101), kind="f4")
        for mode in ("Ascii", "Binary", "Appended")[: None if IS_WHOLE else 2]:  # format_memory_test.py has the third
            getattr(writer, f"SetDataModeTo{mode}")()
            writer.SetInputData(block.vtk())
            writer.Write()
            self.assertLess(self.peak_memory(path, "p", "160M"), 160 << 20, mode)
        block = Block()
        legacy = vtk.vtkStructuredGridWriter()
        legacy.SetFileName(str(self.folder / "grid.vtk"))
        legacy.SetFileTypeToBinary()
        legacy.SetInputData(block.vtk())
        legacy.Write()
        self.expect_same([self.folder / "grid.vtk"], [block])

    def test_times_and_directions_of_vtk(self):
        """VTK 9 turns uniform grids by a matrix, and keeps a file's time in its field data."""
        block = Block()
        grid, path = block.vtk(), self.folder / "grid.vts"
        time = vtk.vtkDoubleArray()
        time.SetName("TimeValue")
        time.InsertNextValue(3.25)
        grid.GetFieldData().AddArray(time)
        writer = vtk.vtkXMLStructuredGridWriter()
        writer.SetFileName(str(path))
        writer.SetInputData(grid)
        writer.Write()
        self.assertEqual(self.info(path)["times"], [3.25])
        self.expect_same([path], [block])
        image = vtk.vtkImageData()
        image.SetDimensions(*block.shape[::-1])
        image.SetOrigin(1, 2, 3)
        image.SetSpacing(0.5, 1, 2)
        image.SetDirectionMatrix(0, -1, 0, 1, 0, 0, 0, 0, 1)
        image.GetPointData().AddArray(grid.GetPointData().GetArray("p"))
        image.GetCellData().AddArray(grid.GetCellData().GetArray("c"))
        writer = vtk.vtkXMLImageDataWriter()
        writer.SetFileName(str(self.folder / "grid.vti"))
        writer.SetInputData(image)
        writer.Write()
        block.places = np.array([image.GetPoint(n) for n in range(block.p.size)]).T.reshape(block.places.shape)
        self.expect_same([self.folder / "grid.vti"], [block])

    def ocean(self):
        lon, lat, depth = np.linspace(0, 9, 7), np.linspace(30, 36, 5), np.linspace(5, 500, 6)
        return lon, lat, depth, RANDOM.random((2, 6, 5, 7)).astype("f4")

    def expect_ocean(self, path, values):
        """Dimensions, times, and the range of each step."""
        info = self.info(path)
        block = info["blocks"][0]
        self.assertEqual((block["nk"], block["nj"], block["ni"]), values.shape[1:])
        self.assertEqual(len(info["times"]), len(values))
        for step, of_step in enumerate(values):
            result = self.run_program("info", path, "--json", "--time-step", step)
            scalar = json.loads(result.stdout)["scalars"][0]
            self.assertEqual([np.float32(scalar["min"]), np.float32(scalar["max"])], [of_step.min(), of_step.max()])

    def test_xarray_and_netcdf4(self):
        xarray, netcdf = library("xarray"), library("netCDF4")
        lon, lat, depth, t = self.ocean()
        data = xarray.Dataset({"t": (("time", "depth", "lat", "lon"), t)}, {
            "time": ("time", np.array(["2001-01-01", "2001-01-02"], "M8[ns]")),
            "depth": ("depth", depth, {"units": "m", "positive": "down"}),
            "lat": ("lat", lat, {"units": "degrees_north"}), "lon": ("lon", lon, {"units": "degrees_east"})})
        for form, engine in (("NETCDF4", "netcdf4"), ("NETCDF3_64BIT", "netcdf4"), ("NETCDF3_CLASSIC", "scipy")):
            with self.subTest(form):
                path = self.folder / f"{form}.nc"
                data.to_netcdf(path, format=form, engine=engine)
                self.expect_ocean(path, t)
        try:
            data.to_netcdf(self.folder / "h5netcdf.nc", engine="h5netcdf")
        except (ImportError, ValueError):
            print("without h5netcdf")
        else:
            self.expect_ocean(self.folder / "h5netcdf.nc", t)
        packed = self.folder / "packed.nc"
        data.to_netcdf(packed, encoding={"t": {"dtype": "i2", "scale_factor": 1e-4, "add_offset": 0.5, "_FillValue": -32768}})
        self.expect_ocean(packed, (np.rint((t.astype("f8") - 0.5) / 1e-4) * 1e-4 + 0.5).astype("f4"))
        caches = []
        for name, form in (("a.nc", "NETCDF4"), ("b.nc", "NETCDF3_CLASSIC")):
            with netcdf.Dataset(self.folder / name, "w", format=form) as f:
                for key, values, units in (("depth", depth, "m"), ("lat", lat, "degrees_north"), ("lon", lon, "degrees_east")):
                    f.createDimension(key, len(values))
                    f.createVariable(key, "f8", (key,))[:] = values
                    f[key].units = units
                f["depth"].positive = "down"
                f.createVariable("t", "f4", ("depth", "lat", "lon"))[:] = t[0]
            caches.append(self.cache([self.folder / name], "t"))
        caches.append(self.cache([self.folder / "NETCDF4.nc"], "t"))
        self.assertEqual(caches[0], caches[1])
        self.assertEqual(caches[0], caches[2])

    def test_column_major_writers(self):
        """MATLAB and Fortran store (i, j, k) with i the fastest. h5py and nccreate turn the dimensions round; fwrite does not."""
        block = Block()
        ijk = [np.asfortranarray(np.transpose(a)) for a in (*block.places, block.p)]  # as MATLAB has them in memory
        self.assertEqual(ijk[0].shape, block.shape[::-1])
        # fwrite(file, x, 'double'): the memory as it is. PLOT3D, without records.
        ni, nj, nk = ijk[0].shape
        head = np.array([ni, nj, nk], "i4").tobytes()
        grid, function, xmf = self.folder / "grid.xyz", self.folder / "grid.f", self.folder / "grid.xmf"
        grid.write_bytes(head + b"".join(a.tobytes(order="F") for a in ijk[:3]))
        function.write_bytes(np.array([ni, nj, nk, 1], "i4").tobytes() + ijk[3].tobytes(order="F"))
        (self.folder / "grid.nam").write_text("p\n")
        self.expect_same([grid, function], [block], {"c": None})
        # h5write: MATLAB's HDF5 files have the dimensions in the opposite order.
        with library("h5py").File(self.folder / "grid.mat", "w", userblock_size=512) as file:
            for name, values in zip("xyzp", ijk):
                file.create_dataset(name, data=values.transpose(), chunks=True)
        item = '<DataItem Dimensions="{} {} {}" Precision="8" Format="HDF">grid.mat:/{}</DataItem>'
        places = "".join(item.format(nk, nj, ni, name) for name in "xyz")
        xmf.write_text(f'<Xdmf Version="3.0"><Domain><Grid><Topology TopologyType="3DSMesh" Dimensions="{nk} {nj} {ni}"/>'
                       f'<Geometry GeometryType="X_Y_Z">{places}</Geometry><Attribute Name="p">{item.format(nk, nj, ni, "p")}'
                       "</Attribute></Grid></Domain></Xdmf>")
        self.expect_same([xmf], [block], {"c": None})

    def test_meshio(self):
        meshio = library("meshio")
        shape = (4, 3, 5)
        block = Block(shape)
        n = np.arange(np.prod(shape)).reshape(shape)
        low = n[:-1, :-1, :-1].ravel()
        si, sj, sk = 1, shape[2], shape[1] * shape[2]
        cells = np.stack([low + o for o in (0, si, si + sj, sj, sk, sk + si, sk + si + sj, sk + sj)], -1)
        mesh = meshio.Mesh(np.moveaxis(block.places, 0, -1).reshape(-1, 3), [("hexahedron", cells)],
                           point_data={"p": block.p.ravel()}, cell_data={"c": [block.c.ravel()]})
        caches = {}
        for name, options in (("a.vtu", {"binary": False}), ("b.vtu", {"binary": True}), ("c.vtk", {"binary": True})):
            path = self.folder / name
            mesh.write(path, **options)
            info = self.info(path)
            self.assertEqual((info["nodes"], info["cells"]["count"]), (n.size, low.size))
            caches[name] = [self.cache([path], scalar) for scalar in "pc"]
            ranges = [[s["min"], s["max"]] for s in info["scalars"]]
            np.testing.assert_allclose(ranges, [[a.min(), a.max()] for a in (block.p, block.c)], rtol=1e-6)
        self.assertEqual(caches["b.vtu"], caches["c.vtk"])  # meshio writes eleven digits of text
        integers = meshio.Mesh(mesh.points, mesh.cells, cell_data={"n": [np.arange(low.size, dtype="i4")]})
        integers.write(self.folder / "e.vtk")  # as vtktypeint32, a word of meshio's
        self.assertEqual(self.info(self.folder / "e.vtk")["scalars"][0]["max"], low.size - 1)
        path = self.folder / "d.xdmf"
        mesh.write(path)
        self.assertEqual([self.cache([path], scalar) for scalar in "pc"], caches["b.vtu"])


if __name__ == "__main__":
    unittest.main(verbosity=2)
