#!/usr/bin/python3
"""format_memory_test.py CURVISPLAT

Converts one grid of a million nodes from every format within the least memory that is accepted, and prints the peak memory of each; and a
thin one, of which not even a row and its neighbours fit in a slab, to the same bytes as with more memory. Usually one storage of each
format, and the thin grid alone but for tiles; with CURVISPLAT_WHOLE (tools/test.sh --whole) all of
them, of two million nodes, files that are compressed as a whole, and a grid of which no row fits. Exit status 77 (skipped) without python3-vtk9, python3-netcdf4 or python3-h5py.
"""
import gzip
import json
import lzma
import re
import shutil
import struct
import subprocess
import sys
import unittest

from structured_formats import Block, StructuredFormats, np, vtk
from tecplot_files import Binary, write_text
from cgns_layout import CgnsLayout
from mesh_ensight_test import EnsightFile
from sweep import IS_WHOLE, ONLY_WHOLE
from zarr_stores import Store

try:
    import h5py
    import netCDF4
except ModuleNotFoundError as error:
    print(f"skipped: {error}; install python3-netcdf4 and python3-h5py")
    sys.exit(77)

TILE = (60, 76, 76) if IS_WHOLE else (40, 68, 68)


class FormatMemory(StructuredFormats):
    """1,089,000 nodes, which take 171 MiB where nothing limits them; 1,109,760 in six tiles."""

    SHAPE, SMALL = (120, 120, 151) if IS_WHOLE else (90, 100, 121), (60, 90, 101)
    USUAL = ("test_tiles",)  # LongRows has the others, with fewer nodes
    ALL_STORAGES = IS_WHOLE  # else the first of each format
    options = ()  # of the conversions

    @classmethod
    def setUpClass(cls):
        cls.block = Block(cls.SHAPE, kind="f4")

    def setUp(self):
        super().setUp()
        if self._testMethodName not in (self.USUAL or (self._testMethodName,)) and not IS_WHOLE:
            self.skipTest(ONLY_WHOLE)
        self.seen = set()
        if "budget" not in vars(type(self)):
            type(self).budget = self.least_memory()

    def least_memory(self):
        grid, function = self.write_plot3d()
        refused = self.run_program("convert", grid, function, "-o", self.folder / "a.splats", "--scalar", "1", "--memory", "1M")
        return int(re.search(r"conversion of 1 scalar takes at least (\d+) MiB", refused.stderr)[1])

    def chunks(self, *most):
        return tuple(map(min, most, self.SHAPE))

    def is_left_out(self, what):
        """Whether it is another storage of a format that has been tried: "NetCDF, deflated" after "NetCDF, classic"."""
        form = what.split(",")[0]
        was_seen = form in self.seen
        self.seen.add(form)
        return was_seen and not self.ALL_STORAGES

    def expect_within(self, what, *paths, scalar="p"):
        """Whether it was tried."""
        if self.is_left_out(what):
            return False
        peak = self.peak_memory_of(paths, scalar)
        print(f"{what:<44} {peak:6.1f} MiB of {self.budget}")
        self.assertLessEqual(peak, self.budget, what)
        return True

    def peak_memory_of(self, paths, scalar):
        first, *others = paths
        return self.peak_memory(first, scalar, f"{self.budget}M", *others, *self.options) / (1 << 20)

    def write_plot3d(self):
        grid, function = self.folder / "a.xyz", self.folder / "a.fun"
        dims = struct.pack("<3i", *self.SHAPE[::-1])
        grid.write_bytes(dims + self.block.places.astype("<f4").tobytes())
        function.write_bytes(dims + struct.pack("<i", 1) + self.block.p.astype("<f4").tobytes())
        return grid, function

    def test_plot3d(self):
        self.expect_within("PLOT3D, grid and functions", *self.write_plot3d(), scalar="1")

    def write_vts(self, path, mode):
        writer = vtk.vtkXMLStructuredGridWriter()
        writer.SetFileName(str(path))
        writer.SetInputData(self.block.vtk())
        getattr(writer, f"SetDataModeTo{mode}")()
        if mode == "Appended":
            writer.SetCompressorTypeToNone()
            writer.EncodeAppendedDataOff()
        writer.Write()
        return path

    def test_vtk(self):
        modes = ("appended, raw", "Appended"), ("zlib, base64", "Binary"), ("ASCII", "Ascii")
        for name, mode in modes if self.ALL_STORAGES else modes[:1]:
            self.expect_within(f"VTK .vts, {name}", self.write_vts(self.folder / "a.vts", mode))

    def test_cgns(self):
        path = self.folder / "a.cgns"
        layout = CgnsLayout(path)
        base = layout.node(layout.file, "Base", "CGNSBase_t", np.array([3, 3], "i4"))
        layout.zone(base, "zone", self.block)
        layout.file.close()
        self.expect_within("CGNS, HDF5", path)

    def test_overset_holes_of_cgns(self):
        """Blanked nodes, and cells that blank what they surround."""
        path, last = self.folder / "a.cgns", np.array(self.SHAPE[::-1])
        layout = CgnsLayout(path)
        base = layout.node(layout.file, "Base", "CGNSBase_t", np.array([3, 3], "i4"))
        zone = layout.zone(base, "zone", self.block)
        connectivity = layout.node(zone, "ZoneGridConnectivity", "ZoneGridConnectivity_t")
        for name, location, first, end in (("nodes", "Vertex", last // 5 + 1, last // 4 + 1), ("cells", "CellCenter", last // 3 + 1, last // 2)):
            hole = layout.node(connectivity, name, "OversetHoles_t")
            layout.node(hole, "GridLocation", "GridLocation_t", location)
            layout.node(hole, "PointRange", "IndexRange_t", np.array([np.minimum(first, end), end], "i4"))
        layout.file.close()
        self.expect_within("CGNS zones with holes", path)

    def write_netcdf(self, path, form, places=True, values=True, **options):
        with netCDF4.Dataset(path, "w", format=form) as f:
            for name, length in zip(("lev", "y", "x"), self.SHAPE):
                f.createDimension(name, length)
            if places:
                f.createVariable("lev", "f8", ("lev",))[:] = np.arange(self.SHAPE[0])
                f["lev"].units, f["lev"].positive = "m", "up"
                j, i = np.meshgrid(np.arange(self.SHAPE[1]), np.arange(self.SHAPE[2]), indexing="ij")
                step = min(0.1, 300 / self.SHAPE[2])  # not round the globe again and again
                for name, array in (("lon", i * step + 0.01 * j), ("lat", j * 0.1)):
                    f.createVariable(name, "f8", ("y", "x"))[:] = array
                f["lon"].units, f["lat"].units = "degrees_east", "degrees_north"
            if values:
                f.createVariable("p", "f4", ("lev", "y", "x"), **options)[:] = self.block.p
        return path

    def test_netcdf(self):
        classic = self.write_netcdf(self.folder / "a.nc", "NETCDF3_CLASSIC")
        self.expect_within("NetCDF, classic", classic)
        if not self.ALL_STORAGES:
            return
        deflated = self.write_netcdf(self.folder / "b.nc", "NETCDF4", zlib=True, chunksizes=self.chunks(16, 60, 76))
        self.expect_within("NetCDF-4, deflated", deflated)
        places = self.write_netcdf(self.folder / "c.nc", "NETCDF4", values=False)
        values = self.write_netcdf(self.folder / "d.nc", "NETCDF3_CLASSIC", places=False)
        self.expect_within("NetCDF, coordinates in a second file", values, places)

    def test_zarr(self):
        """In chunks of 1.1 MB, as NetCDF-4 above."""
        store = Store(self.folder / "z.zarr", 3)
        with netCDF4.Dataset(self.write_netcdf(self.folder / "z.nc", "NETCDF3_CLASSIC")) as f:
            for name, variable in f.variables.items():
                most = self.chunks(16, 60, 76) if variable.ndim == 3 else variable.shape
                store.add(name, " ".join(variable.dimensions), variable[:].data, chunks=most, codecs=("blosc",), **variable.__dict__)
        self.expect_within("Zarr", store.path)

    def test_netcdf_around_the_earth(self):
        """The last column is a step before the first."""
        path, (nk, nj, ni) = self.folder / "a.nc", self.SHAPE
        if nj < 4:  # as few rows are not closed: more of them, which are shorter
            nj, ni = 4, nj * ni // 4
        with netCDF4.Dataset(path, "w", format="NETCDF3_CLASSIC") as f:
            for name, length in zip(("lev", "y", "x"), (nk, nj, ni)):
                f.createDimension(name, length)
            f.createVariable("lev", "f8", ("lev",))[:] = 1e5 * np.arange(nk)
            f["lev"].units, f["lev"].positive = "m", "up"
            for name, array in (("lon", np.broadcast_to(np.arange(ni) * 360 / ni, (nj, ni))),
                                ("lat", np.broadcast_to(np.linspace(-60, 60, nj)[:, np.newaxis], (nj, ni)))):
                f.createVariable(name, "f8", ("y", "x"))[:] = array
            f["lon"].units, f["lat"].units = "degrees_east", "degrees_north"
            f.createVariable("p", "f4", ("lev", "y", "x"))[:] = np.random.default_rng(3).random((nk, nj, ni))
        described = self.run_program("info", path)
        self.assertIn("closed around the Earth", described.stdout)
        self.expect_within("NetCDF around the Earth", path)

    @staticmethod
    def packed(path):
        """The file compressed as a whole, in every way that there is here."""
        data, kinds = path.read_bytes(), {}
        for kind, pack in (("gz", lambda d: gzip.compress(d, 1)), ("xz", lambda d: lzma.compress(d, preset=0))):
            kinds[kind] = path.with_name(f"{path.name}.{kind}")
            kinds[kind].write_bytes(pack(data))
        if shutil.which("zstd"):
            subprocess.run(["zstd", "-q", "-1", path], check=True)
            kinds["zst"] = path.with_name(f"{path.name}.zst")
        path.unlink()
        return kinds

    @unittest.skipUnless(IS_WHOLE, ONLY_WHOLE)
    def test_compressed_files(self):
        path = self.write_netcdf(self.folder / "a.nc", "NETCDF3_CLASSIC")
        for kind, packed in self.packed(path).items():
            self.expect_within(f"NetCDF, compressed as a whole (.{kind})", packed)
        for kind, packed in self.packed(self.write_vts(self.folder / "a.vts", "Appended")).items():
            self.expect_within(f"VTK .vts, compressed as a whole (.{kind})", packed)
        grid, function = (self.packed(path) for path in self.write_plot3d())
        for kind in grid:
            self.expect_within(f"PLOT3D, compressed as a whole (.{kind})", grid[kind], function[kind], scalar="1")

    @unittest.skipUnless(IS_WHOLE, ONLY_WHOLE)
    def test_compressed_tiles(self):
        """Names of unpacked files are removed while they are open: all of them stay open."""
        values, grids = ([self.packed(path) for path in paths] for paths in self.write_tiles())
        for kind in values[0]:
            self.expect_within(f"NetCDF, six tiles with supergrids (.{kind})", *(p[kind] for p in values), *(p[kind] for p in grids))

    def write_tiles(self):
        """The tiles lie side by side; x and y of the grid files are those of a supergrid."""
        values, grids = [], []
        nk, nj, ni = TILE
        fine = np.meshgrid(np.arange(2 * ni + 1) / 2, np.arange(2 * nj + 1) / 2)
        for n in range(6):
            values.append(self.folder / f"atmos.tile{n + 1}.nc")
            with netCDF4.Dataset(values[-1], "w", format="NETCDF4") as f:
                for name, length in zip(("pfull", "grid_yt", "grid_xt"), TILE):
                    f.createDimension(name, length)
                f.createVariable("pfull", "f8", ("pfull",))[:] = np.arange(nk)
                f["pfull"].units, f["pfull"].positive = "km", "up"
                f.createVariable("p", "f4", ("pfull", "grid_yt", "grid_xt"), zlib=True)[:] = np.random.default_rng(n).random(TILE)
            grids.append(self.folder / f"C76_grid.tile{n + 1}.nc")
            with netCDF4.Dataset(grids[-1], "w", format="NETCDF3_CLASSIC") as f:
                f.createDimension("nyp", 2 * nj + 1)
                f.createDimension("nxp", 2 * ni + 1)
                for name, array, units in (("x", 0.7 * fine[0] + 59 * n, "degree_east"), ("y", 0.7 * fine[1] - 26, "degree_north")):
                    f.createVariable(name, "f8", ("nyp", "nxp"))[:] = array
                    f[name].units = units
        return values, grids

    def test_tiles(self):
        values, grids = self.write_tiles()
        self.expect_within("NetCDF, six tiles with supergrids", *values, *grids)

    def test_several_blocks(self):
        paths = []
        for n in range(3):
            paths.append(self.folder / f"part{'abc'[n]}.vts")
            writer = vtk.vtkXMLStructuredGridWriter()
            writer.SetFileName(str(paths[-1]))
            writer.SetInputData(Block((40, 120, 151), shift=200.0 * n, kind="f4").vtk())
            writer.Write()
        self.expect_within("VTK .vts, three files", *paths)

    def test_tecplot(self):
        text, binary = self.folder / "a.dat", self.folder / "a.plt"
        if IS_WHOLE:
            small = Block(self.SMALL, kind="f4")
            size = " ".join(f"{axis}={n}," for axis, n in zip("IJK", small.shape[::-1]))
            write_text(text, [(size + " F=POINT", "POINT", [*small.places, small.p])])
            self.expect_within(f"Tecplot text, {small.p.size:,} nodes", text)
        file = Binary(("X", "Y", "Z", "p"))
        file.zone(self.SHAPE, [*self.block.places, self.block.p])
        file.write(binary)
        self.expect_within("Tecplot, binary", binary)

    def test_ensight(self):
        geometry, values, case = (self.folder / name for name in ("a.geo", "a.p", "a.case"))
        file = EnsightFile("<")
        file.text("C Binary", "a grid", "", "node id off", "element id off", "part")
        file.ints([1])
        file.text("block", "block")
        file.ints(list(self.SHAPE[::-1]))
        file.floats(self.block.places)
        geometry.write_bytes(file.data)
        file = EnsightFile("<")
        file.text("p", "part")
        file.ints([1])
        file.text("block")
        file.floats(self.block.p)
        values.write_bytes(file.data)
        case.write_text("FORMAT\ntype: ensight gold\nGEOMETRY\nmodel: a.geo\nVARIABLE\nscalar per node: p a.p\n")
        self.expect_within("EnSight Gold, a structured part", case)

    def test_xdmf(self):
        path, size = self.folder / "a.xmf", " ".join(map(str, self.SHAPE))
        with h5py.File(self.folder / "a.h5", "w") as file:
            file.create_dataset("xyz", data=np.moveaxis(self.block.places, 0, -1), chunks=(*self.chunks(8, 64, 64), 3), compression="gzip", compression_opts=1)
            file.create_dataset("p", data=self.block.p, chunks=self.chunks(8, 64, 64), compression="gzip", compression_opts=1)
        path.write_text(
            f'<Xdmf><Domain><Grid><Topology TopologyType="3DSMesh" Dimensions="{size}"/><Geometry GeometryType="XYZ">'
            f'<DataItem Dimensions="{size} 3" Format="HDF">a.h5:/xyz</DataItem></Geometry>'
            f'<Attribute Name="p"><DataItem Dimensions="{size}" Format="HDF">a.h5:/p</DataItem></Attribute></Grid></Domain></Xdmf>')
        self.expect_within("XDMF, HDF5 deflated", path)

    def test_vtkhdf(self):
        path = self.folder / "a.vtkhdf"
        with h5py.File(path, "w") as file:
            group = file.create_group("VTKHDF")
            group.attrs["Version"] = (2, 0)
            group.attrs["Type"] = "ImageData"
            group.attrs["WholeExtent"] = [end for n in self.SHAPE[::-1] for end in (0, n - 1)]
            group.attrs["Origin"], group.attrs["Spacing"] = (0.0,) * 3, (1.0,) * 3
            group.create_dataset("PointData/p", data=self.block.p, chunks=self.chunks(8, 64, 64), compression="gzip", compression_opts=1)
        self.expect_within("VTKHDF, deflated", path)


class LongRows(FormatMemory):
    """The four rows take more than the memory of a slab, which has room for 308,000 nodes."""

    SHAPE = SMALL = (2, 2, 100_000) if IS_WHOLE else (2, 2, 80_000)
    USUAL = None
    ALL_STORAGES = False  # rows are cut in the same way
    test_tiles = test_several_blocks = None
    test_compressed_files = test_compressed_tiles = None  # the same readers

    # What formats that hold the same nodes become with more memory: it is converted once, from the first of them.
    SAME_NODES = (("PLOT3D", "VTK .vts", "CGNS, HDF5", "Tecplot, binary", "EnSight Gold", "XDMF"), ("NetCDF, classic", "NetCDF-4, deflated", "Zarr"))
    WHOLE = {}

    def whole(self, what, paths, scalar):
        """What files_of() finds of the cache that is converted with more memory."""
        nodes = next((same for same in self.SAME_NODES if what.startswith(same)), what)
        if nodes not in self.WHOLE:
            cache = self.folder / "whole" / "m.splats"
            cache.parent.mkdir()
            run = self.run_program("convert", *paths, "-o", cache, "--scalar", scalar, "--memory", "2G", *self.options)
            self.assertEqual(run.returncode, 0, run.stderr)
            self.WHOLE[nodes] = self.files_of(cache)
        return self.WHOLE[nodes]

    def chunks(self, *most):
        """Usually long ones: HDF5 looks for thousands of short ones again and again."""
        return super().chunks(*most) if IS_WHOLE else super().chunks(*most[:2], 4096)

    def files_of(self, cache):
        """Its files; the manifest without what names the grid's files and their format."""
        files = {path.name: path.read_bytes() for path in cache.iterdir()}
        manifest = json.loads(files["manifest.json"])
        for variable in manifest["variables"]:
            del variable["name"]
        files["manifest.json"] = {key: manifest[key] for key in manifest.keys() - {"title", "sources", "reader", "blocks", "checksum"}}
        return files

    def expect_within(self, what, *paths, scalar="p"):
        # Outer faces take a third of a conversion, and come from the same nodes: usually one format has them. With --whole all do.
        self.options = () if IS_WHOLE or what.startswith("CGNS zones") else ("--no-surfaces",)
        if not super().expect_within(f"{what}, long rows", *paths, scalar=scalar):
            return False
        cut, whole = self.files_of(self.folder / "m.splats"), self.whole(what, paths, scalar)
        self.assertEqual(cut.keys(), whole.keys())
        for name, data in cut.items():
            self.assertTrue(data == whole[name], f"{what}: {name}")
        return True


@unittest.skipUnless(IS_WHOLE, ONLY_WHOLE)
class LongestRows(FormatMemory):
    """A single row does not fit in a slab."""

    SHAPE = SMALL = (2, 2, 1_000_000)
    USUAL = None
    test_plot3d = test_vtk = test_tiles = test_several_blocks = test_tecplot = test_ensight = test_xdmf = test_vtkhdf = None
    test_compressed_files = test_compressed_tiles = None

    def expect_within(self, what, *paths, scalar="p"):
        return super().expect_within(f"{what}, rows of a million nodes", *paths, scalar=scalar)


if __name__ == "__main__":
    unittest.main(verbosity=0)
