#!/usr/bin/python3
"""zarr_test.py CURVISPLAT

Zarr stores: what `info` measures of them is what it measures of a NetCDF file with the same variables. They are written by
libnetcdf (NCZarr), by the specifications (zarr_stores.py), and, where it is installed, by zarr itself. Exit status 77
(skipped) without python3-netcdf4.
"""
import base64
import json
import os
import shutil
import struct
import subprocess
import sys
import unittest
import zipfile

from model_files import PROGRAM, RANDOM, ModelFileTest, netCDF4, np
from sweep import mpirun, some_of
from zarr_stores import Store

try:
    import zarr
except ModuleNotFoundError:
    zarr = None


class ZarrStores(ModelFileTest):
    NI, NJ, NK, NT = 23, 17, 9, 3

    def setUp(self):
        super().setUp()
        self.expected = {}  # of file.nc, by step
        self.lon, self.lat = np.linspace(-20, 24, self.NI), np.linspace(30, 46, self.NJ)
        self.depth, self.hours = np.linspace(0, 4000, self.NK), np.array([0.0, 6, 12])
        self.temp = (5 + RANDOM.random((self.NT, self.NK, self.NJ, self.NI))).astype("f4")
        self.temp[:, :, 3:6, 4:9] = 0  # whole chunks of a shard
        self.land = np.full((self.NK, self.NJ, self.NI), False)
        self.land[5:, 10:, :7] = True
        self.packed = np.where(self.land, -32768, np.round(self.temp[0] * 1000) - 3000).astype("i2")
        with self.file(lon=self.NI, lat=self.NJ, depth=self.NK, time=None) as f:
            self.fill(f.add)

    def fill(self, add, of_temp=None, of_packed=None, fill="_FillValue"):
        add("lon", "lon", self.lon, units="degrees_east")
        add("lat", "lat", self.lat, units="degrees_north")
        add("depth", "depth", self.depth, units="m", positive="down")
        add("time", "time", self.hours, units="hours since 2001-01-01", calendar="noleap")
        add("temp", "time depth lat lon", self.temp, units="degC", **(of_temp or {}))
        add("salt", "depth lat lon", self.packed, "i2", -32768, scale_factor=0.001, add_offset=3.0) if add.__qualname__.startswith(
            "File") else add("salt", "depth lat lon", self.packed, scale_factor=0.001, add_offset=3.0, **(of_packed or {}))

    def store(self, version, name="a.zarr", of_temp=None, of_packed=None):
        store = Store(self.folder / name, version, {"title": "a test", "Conventions": "CF-1.10"})
        self.fill(store.add, of_temp, of_packed)
        return store

    def measured(self, *words):
        info = self.info(*words)
        for key in ("files", "format", "blanking"):  # the last names the values
            info.pop(key)
        return info

    def expect_same(self, *words):
        for step in ("0", "2"):
            if step not in self.expected:
                self.expected[step] = self.measured("file.nc", "--time-step", step)
            self.assertEqual(self.measured(*words, "--time-step", step), self.expected[step], (words, step))

    # -- writers

    def test_libnetcdf(self):
        path = self.folder / "n.zarr"
        try:
            file = netCDF4.Dataset(f"file://{path}#mode=nczarr,file", "w")
        except OSError as error:
            self.skipTest(f"libnetcdf has no NCZarr: {error}")
        with file as f:
            for name, length in dict(lon=self.NI, lat=self.NJ, depth=self.NK, time=self.NT).items():
                f.createDimension(name, length)

            def add(name, dimensions, values, fill=None, **attributes):
                variable = f.createVariable(name, values.dtype, tuple(dimensions.split()), zlib=True, fill_value=fill,
                                            chunksizes=[min(5, n) for n in values.shape])
                variable.setncatts(attributes)
                variable.set_auto_maskandscale(False)
                variable[...] = values

            self.fill(add, of_packed={"fill": np.int16(-32768)})
        self.expect_same("n.zarr")
        self.assertEqual(self.info("n.zarr")["format"].split(",")[0], "Zarr")

    @unittest.skipUnless(zarr, "python3-zarr is not installed")
    def test_zarr(self):
        root = zarr.open_group(str(self.folder / "z.zarr"), "w")

        def add(name, dimensions, values, fill=None, **attributes):
            array = root.array(name, values, chunks=tuple(min(7, n) for n in values.shape), fill_value=fill)
            array.attrs.update(_ARRAY_DIMENSIONS=dimensions.split(), **attributes)

        self.fill(add, of_packed={"fill": -32768})
        self.expect_same("z.zarr")

    # -- versions, chunks and codecs

    def test_version_2(self):
        missing = {"of_packed": dict(fill=-32768, chunks=(4, 17, 5), codecs=("zlib",))}
        for n, options in enumerate(some_of([
                dict(), dict(chunks=(1, 4, 5, 6), codecs=("zlib",)), dict(chunks=(2, 9, 3, 23), codecs=("blosc",)),
                dict(chunks=(3, 2, 17, 8), codecs=("blosc-zstd",), separator="/"), dict(chunks=(1, 3, 5, 7), codecs=("shuffle", "zstd")),
                dict(chunks=(1, 9, 17, 10), codecs=("gzip",), order="F"), dict(chunks=(1, 4, 4, 4), codecs=("lz4",), kind=">f4"),
                dict(chunks=(2, 2, 2, 23), kind="f8")])):
            self.store(2, f"v2_{n}.zarr", dict(options, fill="NaN"), **missing)
            with self.subTest(options):
                self.expect_same(f"v2_{n}.zarr")

    def test_version_3(self):
        fill = base64.standard_b64encode(struct.pack("<d", float("nan"))).decode()
        missing = {"of_packed": dict(_FillValue=-32768, chunks=(3, 6, 8), shards=(6, 18, 16), codecs=("zstd",), fill=-1)}
        for n, options in enumerate(some_of([
                dict(), dict(chunks=(1, 4, 5, 6), codecs=("gzip", "crc32c")), dict(chunks=(2, 9, 3, 23), codecs=("blosc",)),
                dict(chunks=(1, 3, 3, 4), shards=(2, 6, 18, 24), codecs=("zstd", "crc32c")),
                dict(chunks=(1, 3, 5, 6), shards=(1, 9, 20, 24), codecs=("blosc-zstd",), index="start", order=(3, 1, 0, 2)),
                dict(chunks=(2, 2, 4, 23), kind=">f4", key="v2", order=(3, 2, 1, 0))])):
            self.store(3, f"v3_{n}.zarr", dict(options, _FillValue=fill), **missing)
            with self.subTest(options):
                self.expect_same(f"v3_{n}.zarr")

    def test_filters(self):
        for n, (of_temp, of_packed) in enumerate(((("bitround", "zlib"), ("delta", "adler32", "zlib")), (("quantize", "zlib"), ("fixedscaleoffset", "crc32", "zstd")))):
            self.store(2, f"f{n}.zarr", dict(codecs=of_temp, fill="NaN"), of_packed=dict(fill=-32768, chunks=(3, 6, 8), codecs=of_packed))
            self.expect_same(f"f{n}.zarr")

    def test_groups(self):
        self.store(2, "g.zarr/run", of_packed=dict(fill=-32768)).write("../.zgroup", json.dumps({"zarr_format": 2}))
        line = self.info("g.zarr", fails=True)
        self.assertIn("its arrays are in groups (run), each of which is a store: give the folder of one (", line)
        self.assertIn("g.zarr/run)", line)
        self.assertEqual(self.measured("g.zarr/run"), self.measured("file.nc"))

    def test_archives(self):
        for version in (2, 3):
            self.store(version, "z.zarr", of_packed=dict({2: "fill", 3: "_FillValue"}[version] and
                                                         {{2: "fill", 3: "_FillValue"}[version]: -32768})).zip()
            self.expect_same("z.zarr.zip")
        with zipfile.ZipFile(self.folder / "z.zarr.zip") as archive:
            archive.extractall(self.folder / "within" / "z.zarr")
        with zipfile.ZipFile(self.folder / "folder.zip", "w") as archive:
            for file in sorted((self.folder / "within").rglob("*")):
                archive.write(file, file.relative_to(self.folder / "within"))
        self.expect_same("folder.zip")
        self.store(2).zip(zipfile.ZIP_DEFLATED)
        self.assertIn("is compressed by the archive, which is not read; extract it", self.info("a.zarr.zip", fails=True))

    # -- values

    def test_chunks_that_were_not_written_have_the_fill_value(self):
        missing = [(0, k, 0, 0) for k in range(3)]
        values = self.temp.copy()
        values[0, :9, :6, :8] = np.nan
        for version, fill in ((2, dict(fill="NaN")), (3, dict(fill="NaN"))):
            self.store(version, f"m{version}.zarr", dict(chunks=(1, 3, 6, 8), codecs=("zlib",) if version == 2 else ("gzip",),
                                                         missing=missing, **fill))
            info = self.info(f"m{version}.zarr")
            self.assertEqual(info["scalars"][0]["missing"] if "missing" in info["scalars"][0] else np.isnan(values[0]).sum(),
                             np.isnan(values[0]).sum())
            self.assertEqual(info["blanked"]["by_grid"] + info["blanked"]["not_finite"], np.isnan(values[0]).sum())

    def test_chunks_that_cannot_be_looked_at_are_not_missing(self):
        store = self.store(2, "l.zarr", dict(chunks=(1, 9, 17, 24)))
        file = next(file for file in sorted((store.path / "temp").iterdir()) if file.name[0] in "0123456789")
        file.unlink()
        self.info("l.zarr")
        for make, told in ((file.mkdir, "is not a regular file"), (lambda: os.mkfifo(file), "is not a regular file"),
                           (lambda: file.symlink_to(file.name), "cannot be looked at"), (lambda: file.symlink_to("none"), "is a link to none, which does not exist")):
            make()
            error = self.info("l.zarr", fails=True)
            self.assertIn(f"{file.name}: {told}", error)
            self.assertEqual(error.count("\n"), 1)
            file.rmdir() if told.startswith("is not") and file.is_dir() else file.unlink()

    def test_numbers_of_every_type(self):
        for version in (2, 3):
            for kind in some_of("i1 u1 i2 u2 i4 u4 i8 u8 f2 f4 f8 ?".split(), 2, turn=version):
                store = Store(self.folder / f"{version}.zarr", version)
                values = (np.arange(5 * 6 * 7).reshape(5, 6, 7) % 90).astype(kind)
                for name, length in (("z", 5), ("y", 6), ("x", 7)):
                    store.add(name, name, np.arange(length) * 1.0, units="m")
                store.add("a", "z y x", values)
                info = self.info(f"{version}.zarr")
                self.assertEqual((info["scalars"][0]["min"], info["scalars"][0]["max"]), (values.min(), values.max()), (version, kind))

    def test_strings_choose_a_value(self):
        for version, kinds in ((2, ("S5", "U5", ">U5")),):
            for kind in kinds:
                store = Store(self.folder / "s.zarr", version)
                store.add("lon", "lon", self.lon, units="degrees_east")
                store.add("lat", "lat", self.lat, units="degrees_north")
                store.add("depth", "depth", self.depth, units="m", positive="down")
                store.add("region", "region", np.array(["north", "south"]), kind=kind)
                store.add("a", "region depth lat lon", self.temp[:2] + 10 * np.arange(2)[:, None, None, None], kind="f4")
                info = self.info("s.zarr", "--select", "region=south")
                self.assertEqual(np.float32(info["scalars"][0]["max"]), (self.temp[1] + 10).max())

    def test_names_of_variable_length(self):
        words = [b"north", "süd".encode()]
        data = struct.pack("<I", 2) + b"".join(struct.pack("<I", len(word)) + word for word in words)
        for version in (2, 3):
            store = Store(self.folder / f"{version}.zarr", version)
            store.add("lon", "lon", self.lon, units="degrees_east")
            store.add("lat", "lat", self.lat, units="degrees_north")
            store.add("depth", "depth", self.depth, units="m", positive="down")
            store.add("a", "region depth lat lon", self.temp[:2], kind="f4")
            if version == 2:
                store.write("region/.zarray", json.dumps({"zarr_format": 2, "shape": [2], "chunks": [2], "dtype": "|O", "fill_value": None,
                                                          "order": "C", "filters": [{"id": "vlen-utf8"}], "compressor": None}))
                store.write("region/.zattrs", json.dumps({"_ARRAY_DIMENSIONS": ["region"]}))
                store.write("region/0", data)
            else:
                store.write("region/zarr.json", json.dumps({
                    "zarr_format": 3, "node_type": "array", "shape": [2], "data_type": "string", "fill_value": "", "attributes": {},
                    "chunk_grid": {"name": "regular", "configuration": {"chunk_shape": [2]}}, "codecs": [{"name": "vlen-utf8"}],
                    "chunk_key_encoding": {"name": "default"}, "dimension_names": ["region"]}))
                store.write("region/c/0", data)
            info = self.info(f"{version}.zarr", "--select", "region=süd")
            self.assertEqual(np.float32(info["scalars"][0]["max"]), self.temp[1].max())

    def test_attributes_of_python(self):
        self.store(2, of_packed=dict(fill=-32768), of_temp=dict(valid_max=float("nan"), note='a "quoted" NaN', missing_value=float("inf")))
        self.assertIn("NaN,", (self.folder / "a.zarr/temp/.zattrs").read_text())
        self.expect_same("a.zarr")

    def test_arrays_without_names_are_grids_of_indices(self):
        store = Store(self.folder / "a.zarr", 3)
        store.add("a", "", self.temp[0])
        info = self.info("a.zarr")
        self.assertEqual([info["blocks"][0][n] for n in ("nk", "nj", "ni")], list(self.temp.shape[1:]))

    # -- as grids of other kinds

    def test_conversion(self):
        self.store(3, of_temp=dict(chunks=(1, 3, 5, 6), shards=(1, 9, 20, 24), codecs=("zstd",)), of_packed=dict(_FillValue=-32768))
        made = {}
        for source, start in (("file.nc", ()), ("a.zarr", ()), ("a.zarr", mpirun(PROGRAM))):
            subprocess.run([*start, PROGRAM, "convert", source, "-o", "made.splats", "--overwrite", "--scalar", "all", "--steps", "all"],
                           cwd=self.folder, check=True, capture_output=True)
            files = [file for file in (self.folder / "made.splats").rglob("*") if file.is_file() and file.suffix != ".json"]
            made[source, len(start)] = {file.name: file.read_bytes() for file in files}
        first, *others = made.values()
        self.assertIn("geometry.bin", first)
        for other in others:
            self.assertEqual(other.keys(), first.keys())
            for name in first:
                self.assertEqual(other[name], first[name], name)

    def test_a_series_of_stores(self):
        for step in range(2):
            self.store(2, f"run_{step}.zarr", of_packed=dict(fill=-32768))
            self.hours += 18
        done = subprocess.run([PROGRAM, "convert", "run_0.zarr", "run_1.zarr", "-o", "a.splats", "--scalar", "temp", "--steps", "all"],
                              cwd=self.folder, capture_output=True, text=True)
        self.assertEqual(done.returncode, 0, done.stderr)
        steps = json.loads(subprocess.run([PROGRAM, "info", "--json", "a.splats"], cwd=self.folder, capture_output=True, text=True).stdout)
        self.assertEqual(len(steps["steps"]), 6)

    def test_a_grid_in_another_store(self):
        grid = Store(self.folder / "grid.zarr", 2)
        grid.add("lon", "lon", self.lon, units="degrees_east")
        grid.add("lat", "lat", self.lat, units="degrees_north")
        data = Store(self.folder / "data.zarr", 3)
        data.add("depth", "depth", self.depth, units="m", positive="down")
        data.add("temp", "depth lat lon", self.temp[0])
        self.assertEqual(self.measured("data.zarr", "grid.zarr")["bounds"], self.measured("file.nc")["bounds"])

    # -- what is refused, and damage

    def refusal(self, version, change, **options):
        store = self.store(version, "r.zarr", options)
        change(store.path)
        error = self.info("r.zarr", fails=True)
        self.assertEqual(error.count("\n"), 1, error)
        shutil.rmtree(store.path)
        return error

    @staticmethod
    def edit(file, **changes):
        def change(path):
            metadata = json.loads((path / file).read_text())
            metadata.update(changes)
            (path / file).write_text(json.dumps(metadata))
        return change

    def test_refusals(self):
        for version, change, words in (
                (2, self.edit("temp/.zarray", compressor={"id": "bz2"}), "is stored with the codec 'bz2', which is not read; write it with zlib"),
                (2, self.edit("temp/.zarray", compressor={"id": "lzma"}), "is stored with the codec 'lzma', which is not read; write it with zlib"),
                (2, self.edit("temp/.zarray", filters=[{"id": "delta"}]), "codec 'delta'"),
                (2, self.edit("temp/.zarray", filters=[{"id": "delta", "dtype": "<f8"}]), "codec 'delta'"),
                (2, self.edit("temp/.zarray", filters=[{"id": "crc32"}]), "has a wrong checksum"),
                (2, self.edit("temp/.zarray", chunks=[3, 900, 1700, 2300]), "has chunks of 40272 MiB"),
                (2, self.edit("temp/.zarray", shape=[3, 9, 17, 10**12], chunks=[1, 1, 1, 10]), "next to no chunks"),
                (2, self.edit("temp/.zarray", chunks=[3]), "has 4 axes, but chunks of 1"),
                (2, self.edit("temp/.zarray", shape=[3, 9, 17, 22]), "has 22 values along lon; expected 23"),
                (2, lambda path: (path / "temp/.zarray").write_text("{"), "is not JSON"),
                (2, lambda path: (path / "temp/0.0.0.0").write_bytes(b"123"), "has 3 bytes (expected 42228)"),
                (2, self.edit("temp/.zarray", dimension_separator="/../../other."), "expected \".\" or \"/\""),
                (3, self.edit("temp/zarr.json", chunk_key_encoding={"name": "default", "configuration": {"separator": "/../"}}),
                 "expected \".\" or \"/\""),
                (3, self.edit("temp/zarr.json", chunk_grid={"name": "rectilinear"}), "expected \"regular\""),
                (3, self.edit("temp/zarr.json", shape=[3, -9, 17, 23]), "shape[1] is invalid"),
                (3, lambda path: (path / "zarr.json").write_text("[" * 100), "deep")):
            self.assertIn(words, self.refusal(version, change))
        self.assertIn("give the store", self.info(str(self.store(2, "s.zarr").path / "temp"), fails=True))

    def test_an_archive_that_overstates_its_members(self):
        store = self.store(2, "o.zarr", dict(chunks=(1, 1, 1, 10)))
        self.edit("temp/.zarray", shape=[3, 9, 17, 10**9])(store.path)
        (store.path / "temp/9").write_bytes(b"")
        archive = store.zip()
        listed = bytearray(archive.read_bytes())
        at = listed.rindex(b"temp/9") - 46  # its entry in the list of members, which has sizes after 20 bytes
        listed[at + 20:at + 28] = bytes([0, 0, 0, 0xf0] * 2)
        archive.write_bytes(listed)
        self.assertIn("next to no chunks", self.info(str(archive), fails=True))

    def test_many_missing_chunks(self):
        """A search among those that were missing would take the square of their number."""
        store = Store(self.folder / "m.zarr", 2)
        for name, length, words in (("lon", 200, dict(units="degrees_east")), ("lat", 200, dict(units="degrees_north")), ("depth", 2, dict(units="m"))):
            store.add(name, name, np.linspace(0, 40, length), **words)
        store.add("temp", "depth lat lon", np.zeros((2, 200, 200)), chunks=(2, 200, 200))
        self.edit("temp/.zarray", chunks=[1, 1, 1])(store.path)
        (store.path / "temp/0.0.0").write_bytes(bytes(8))
        block = self.info("m.zarr")["blocks"][0]
        self.assertEqual([block[axis] for axis in ("ni", "nj", "nk")], [200, 200, 2])

    def test_truncated_and_changed_chunks(self):
        kinds = [(2, dict(codecs=("zlib",), chunks=(3, 9, 17, 8))), (2, dict(codecs=("blosc",))), (2, dict(codecs=("lz4",))), (2, {}),
                 (3, dict(codecs=("zstd",))), (3, dict(codecs=("gzip", "crc32c"))), (3, dict(chunks=(1, 3, 9, 8), shards=(3, 9, 18, 24), codecs=("zstd",)))]
        for version, options in kinds:
            store = self.store(version, "d.zarr", options)
            file = next(file for file in sorted((store.path / "temp").rglob("*")) if file.is_file() and file.name[0] in "0123456789")
            whole = file.read_bytes()
            for cut in some_of(sorted({*range(0, 20), len(whole) - 1, *RANDOM.integers(0, len(whole), 20).tolist()})):
                file.write_bytes(whole[:cut])
                error = self.info("d.zarr", fails=True)
                self.assertTrue(error.startswith("curvisplat: ") and error.count("\n") == 1 and "d.zarr" in error, error)
            for place in some_of(RANDOM.integers(0, len(whole), 20).tolist()):
                changed = bytearray(whole)
                changed[place] ^= 1 << int(RANDOM.integers(8))
                file.write_bytes(changed)
                done = subprocess.run([PROGRAM, "info", str(store.path)], capture_output=True, text=True)
                self.assertIn(done.returncode, (0, 1), done.stderr)
            shutil.rmtree(store.path)


if __name__ == "__main__":
    unittest.main()
