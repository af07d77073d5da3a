#!/usr/bin/python3
"""model_tiles_test.py CURVISPLAT

Cubed spheres in a file for each face, as FV3 and FMS write them: history files of six tiles, with the coordinates in them or in
grid_spec files, at the middles of the cells or at their corners. What `info` and `convert` measure is compared with the same cube in one file
and with the shell of a sphere. model_files.py says how. Exit status 77 (skipped) without python3-netcdf4.
"""
import gzip
import json
import subprocess
import unittest

from model_faces_test import CUBE, SHELL, degrees, on_face
from model_files import PROGRAM, RANDOM, File, ModelFileTest, np
from sweep import some_of

N = 12
LEVELS = np.array([0.0, 200, 500])  # kilometres: those of model_faces_test.py's shell
FACES = range(len(CUBE))


class ModelTiles(ModelFileTest):
    """The files are of NetCDF's classic format, which is read in a fraction of NetCDF-4's time, but for tests that say otherwise."""

    form = "NETCDF3_CLASSIC"

    def file(self, name="file.nc", **dimensions):
        return File(self.folder / name, dimensions, format=self.form)

    def setUp(self):
        super().setUp()
        self.values = RANDOM.random((len(LEVELS), 6, N, N)).astype("f4")
        middles, edges = (np.arange(N) + 0.5) * 90 / N - 45, np.arange(N + 1) * 90 / N - 45
        corners = np.stack([on_face(face, edges, edges) for face in FACES])
        self.corners = degrees(corners)
        self.centres = degrees(np.stack([on_face(face, middles, middles) for face in FACES]))
        middle = corners[:, 1:, 1:] + corners[:, :-1, 1:] + corners[:, 1:, :-1] + corners[:, :-1, :-1]
        self.middles = degrees(middle / np.linalg.norm(middle, axis=-1, keepdims=True))  # what FV3 calls centres

    def coordinates(self, f, face, kinds):
        if "centres" in kinds:
            for name, values, units in zip(("grid_lont", "grid_latt"), self.middles, ("degrees_E", "degrees_N")):
                f.add(name, "grid_yt grid_xt", values[face], units=units)
        if "corners" in kinds:
            for name, values, units in zip(("grid_lon", "grid_lat"), self.corners, ("degrees_E", "degrees_N")):
                f.add(name, "grid_y grid_x", values[face], units=units)

    def dimensions(self):
        return {"grid_x": N + 1, "grid_y": N + 1, "grid_xt": N, "grid_yt": N}

    def write(self, name="atmos.tile{}.nc", kinds=("centres", "corners"), order=FACES):
        """History files, whose axes grid_xt and grid_yt hold indices in degrees. Their names."""
        names = []
        for tile, face in enumerate(order, 1):
            names.append(name.format(tile))
            with self.file(names[-1], time=None, pfull=len(LEVELS), **self.dimensions()) as f:
                f.add("time", "time", [3.0], units="days since 2016-08-01 00:00:00", calendar="julian")
                f.add("pfull", "pfull", LEVELS, units="km", positive="up", cartesian_axis="Z", long_name="height")
                for axis, units in (("x", "degrees_E"), ("y", "degrees_N")):
                    f.add(f"grid_{axis}t", f"grid_{axis}t", np.arange(1.0, N + 1), units=units, cartesian_axis=axis.upper(),
                          long_name=f"T-cell {'longitude' if axis == 'x' else 'latitude'}")
                self.coordinates(f, face, kinds)
                f.add("ps", "time grid_yt grid_xt", self.values[:1, face], "f4", units="Pa")
                f.add("temp", "time pfull grid_yt grid_xt", self.values[None, :, face], "f4", units="degrees_K", missing_value=np.float32(-1e10),
                      cell_methods="time: point")
        return names

    def write_grids(self, kinds):
        names = []
        for face in FACES:
            names.append(f"grid_spec.tile{face + 1}.nc")
            with self.file(names[-1], **self.dimensions()) as f:
                self.coordinates(f, face, kinds)
                f.add("area", "grid_yt grid_xt", np.ones((N, N)), units="m2")
        return names

    def convert(self, names, *options):
        cache = self.folder / "a.splats"
        done = subprocess.run([PROGRAM, "convert", *(str(self.folder / name) for name in names), "-o", str(cache), "--overwrite",
                               "--scalar", "temp", *options], capture_output=True, text=True, check=False)
        self.assertEqual(done.returncode, 0, done.stderr)
        files = {p.relative_to(cache): p.read_bytes() for p in sorted(cache.rglob("*")) if p.is_file() and p.name != "manifest.json"}
        return files, json.loads((cache / "manifest.json").read_text())

    def expect_closed(self, info):
        self.assertEqual([(b["ni"], b["nj"], b["nk"]) for b in info["blocks"]], 6 * [(N, N, 3)] + 12 * [(2, N, 3)] + 8 * [(2, 2, 3)])
        self.assertEqual([b["name"] for b in info["blocks"][:6]], [f"tile {n}" for n in range(1, 7)])
        self.assertIn("6 faces joined at 12 edges and 8 corners", info["format"])
        self.assertAlmostEqual(sum(abs(b["volume"]) for b in info["blocks"]) / SHELL, 1, delta=0.01)
        self.assertEqual([info["scalars"][0][end] for end in ("min", "max")], [self.values.min(), self.values.max()])
        self.assertEqual(info["blanked"]["by_grid"], 0)
        self.assertEqual(info["scalars"][0]["name"], "temp")
        self.assertEqual(info["times"], [3.0])

    def test_six_files_are_the_cube_of_one(self):
        self.form = "NETCDF4"
        names = self.write()
        info = self.info(*names)
        self.expect_closed(info)
        tiles, manifest = self.convert(names)
        self.assertAlmostEqual(manifest["volume"] / SHELL, 1, delta=0.01)
        with self.file("one.nc", time=None, tile=6, **{"pfull": len(LEVELS), **self.dimensions()}) as f:
            f.add("time", "time", [3.0], units="days since 2016-08-01 00:00:00", calendar="julian")
            f.add("pfull", "pfull", LEVELS, units="km", positive="up")
            f.add("lon", "tile grid_yt grid_xt", self.middles[0], units="degrees_east")
            f.add("lat", "tile grid_yt grid_xt", self.middles[1], units="degrees_north")
            f.add("temp", "time pfull tile grid_yt grid_xt", self.values[None], "f4", missing_value=np.float32(-1e10))
        self.assertEqual(tiles, self.convert(["one.nc"])[0])

    def test_coordinates_in_a_second_set_of_files(self):
        expected = self.convert(self.write())[0]
        names = self.write(kinds=())
        for kinds in (("centres", "corners"), ("corners",)):
            grids = self.write_grids(kinds)
            mixed = [name for pair in zip(names[::-1], grids[::-1]) for name in pair]
            for files in (names + grids, mixed):
                self.expect_closed(self.info(*files))
            found = self.convert(names + grids)[0]
            if "centres" in kinds:
                self.assertEqual(found, expected)
            else:  # rounding
                self.assertEqual({k: len(v) for k, v in found.items()}.keys(), expected.keys())
        line = self.info(*names, fails=True)
        self.assertIn("grid_spec.tile1.nc", line)
        self.assertEqual(line.count("\n"), 1, line)

    def write_supergrids(self, name="C12_grid.tile{}.nc", units=("degree_east", "degree_north")):
        """As FRE's make_hgrid writes them: a centre is the middle of the corners on the sphere."""
        fine = np.full((6, 2 * N + 1, 2 * N + 1, 2), np.nan)
        for kind, values in ((0, self.corners), (1, self.middles)):
            for n in (0, 1):
                fine[:, kind::2, kind::2, n] = values[n]
        names = []
        for face in FACES:
            names.append(name.format(face + 1))
            with self.file(names[-1], string=255, nx=2 * N, ny=2 * N, nxp=2 * N + 1, nyp=2 * N + 1) as f:
                f.createVariable("tile", "S1", ("string",)).setncatts({"standard_name": "grid_tile_spec", "geometry": "spherical"})
                for n, (axis, word) in enumerate((("x", "longitude"), ("y", "latitude"))):
                    attributes = {"standard_name": f"geographic_{word}"} if units[n] else {}
                    f.add(axis, "nyp nxp", fine[face, ..., n], units=units[n] or "degrees", **attributes)
                f.add("area", "ny nx", np.ones((2 * N, 2 * N)), units="m2")
        return names

    def test_supergrids_beside_the_data(self):
        """Centres at odd, corners at even indices. What is between them is NaN here, so that nothing else can be read."""
        self.form = "NETCDF4"
        expected = self.convert(self.write())[0]
        names = self.write(kinds=())
        for units in (("degree_east", "degree_north"), (None, None)):
            grids = self.write_supergrids(units=units)
            info = self.info(*names, *grids)
            self.expect_closed(info)
            self.assertIn(", x, y on a sphere", info["format"])
            for files in some_of((names + grids, grids + names), 2, turn=units[0] is None):
                self.assertEqual(self.convert(files)[0], expected)
        one = self.info("atmos.tile3.nc", "C12_grid.tile3.nc")
        self.assertAlmostEqual(abs(one["blocks"][0]["volume"]) / SHELL, (N - 1) ** 2 / N**2 / 6, delta=0.01)

    def test_values_at_the_corners_of_a_supergrid(self):
        """Six faces of (N + 1)^2 corners, whose edges coincide: nothing is left to join."""
        names = []
        for face in FACES:
            names.append(f"corner.tile{face + 1}.nc")
            with self.file(names[-1], lev=len(LEVELS), grid_y=N + 1, grid_x=N + 1) as f:
                f.add("lev", "lev", LEVELS, units="km", positive="up")
                f.add("vort", "lev grid_y grid_x", np.full((len(LEVELS), N + 1, N + 1), float(face)), "f4")
        info = self.info(*names, *self.write_supergrids())
        self.assertEqual([(b["ni"], b["nj"], b["nk"]) for b in info["blocks"]], 6 * [(N + 1, N + 1, 3)])
        self.assertAlmostEqual(sum(abs(b["volume"]) for b in info["blocks"]) / SHELL, 1, delta=0.01)

    def write_names(self, file, **variables):
        """Text as FRE's tools write it (characters), or as xarray does (strings)."""
        for form in ("NETCDF3_CLASSIC", "NETCDF4"):
            with File(self.folder / file, {"string": 255}, format=form) as f:
                for variable, names in variables.items():
                    dimensions = ()
                    if isinstance(names, list):
                        dimensions = ("ntiles",)
                        f.createDimension("ntiles", len(names))
                    if form == "NETCDF4":
                        f.createVariable(variable, str, dimensions)[...] = np.array(names, object)
                        continue
                    padded = np.zeros((np.size(names), 255), "S1")
                    for n, name in enumerate(np.atleast_1d(names)):
                        padded[n, : len(name)] = list(name)
                    f.createVariable(variable, "S1", (*dimensions, "string"))[:] = padded if dimensions else padded[0]
            yield form

    def test_a_mosaic_names_its_grid_files(self):
        names, grids = self.write(kinds=()), self.write_supergrids()
        for _ in self.write_names("C12_mosaic.nc", gridfiles=grids):
            self.expect_closed(self.info(*names, "C12_mosaic.nc"))
            self.expect_closed(self.info(*names, "C12_mosaic.nc", *grids[:2]))
            one = self.info(names[2], "C12_mosaic.nc")
            self.assertEqual([(b["ni"], b["nj"], b["nk"]) for b in one["blocks"]], [(N, N, 3)])
            self.assertTrue(one["files"][2].endswith(grids[2]), one["files"])
        (self.folder / grids[4]).unlink()
        line = self.info(*names, "C12_mosaic.nc", fails=True)
        self.assertIn("C12_mosaic.nc: names the grid file C12_grid.tile5.nc, which is not beside it", line)
        self.assertEqual(line.count("\n"), 1, line)

    def test_a_coupled_model_names_its_mosaics(self):
        """Of the atmosphere's six tiles and the ocean's single one, the data's own are read."""
        names, grids = self.write(kinds=()), self.write_supergrids()
        ocean, hgrid, _, _ = self.write_ocean()
        list(self.write_names("C12_mosaic.nc", gridfiles=grids))
        list(self.write_names("ocean_mosaic.nc", gridfiles=[hgrid]))
        components = {"atm_mosaic_file": "C12_mosaic.nc", "lnd_mosaic_file": "C12_mosaic.nc", "ocn_mosaic_file": "ocean_mosaic.nc"}
        expected, expected_ocean = self.convert([*names, *grids])[0], self.info(ocean, hgrid)
        for form in self.write_names("grid_spec.nc", **components):
            self.expect_closed(self.info(*names, "grid_spec.nc"))
            self.assertEqual(self.info(ocean, "grid_spec.nc")["bounds"], expected_ocean["bounds"], form)
        self.assertEqual(self.convert([*names, "grid_spec.nc"])[0], expected)
        (self.folder / "ocean_mosaic.nc").unlink()
        self.expect_closed(self.info(*names, "grid_spec.nc"))
        line = self.info(ocean, "grid_spec.nc", fails=True)
        self.assertIn("grid_spec.nc: names the mosaics C12_mosaic.nc, ocean_mosaic.nc; none of them with a grid of one tile is beside it", line)
        self.assertEqual(line.count("\n"), 1, line)
        list(self.write_names("ocean_mosaic.nc", gridfiles=[hgrid]))
        list(self.write_names("land_mosaic.nc", gridfiles=["land_hgrid.nc"]))
        list(self.write_names("grid_spec.nc", **{**components, "lnd_mosaic_file": "land_mosaic.nc"}))
        line = self.info(ocean, "grid_spec.nc", fails=True)
        self.assertIn("grid_spec.nc: names several grids (ocean_hgrid.nc, land_hgrid.nc)", line)
        self.assertEqual(line.count("\n"), 1, line)

    def write_ocean(self):
        """MOM6: nominal longitudes and latitudes of one dimension in the file, the true ones in ocean_hgrid.nc."""
        ni, nj = 10, 8
        x, y = np.meshgrid(np.arange(2 * ni + 1) / 2, np.arange(2 * nj + 1) / 2 + 20)
        x = x + 0.3 * (y - 20)
        with self.file("ocean.nc", time=None, zl=3, yh=nj, xh=ni) as f:
            f.add("xh", "xh", np.arange(ni) + 0.5, units="degrees_east", long_name="h point nominal longitude")
            f.add("yh", "yh", np.arange(nj) + 20.5, units="degrees_north", long_name="h point nominal latitude")
            f.add("zl", "zl", [10.0, 20, 30], units="m", positive="down")
            f.add("thetao", "time zl yh xh", np.ones((1, 3, nj, ni)), "f4")
        with self.file("ocean_hgrid.nc", nyp=2 * nj + 1, nxp=2 * ni + 1) as f:
            f.add("x", "nyp nxp", x, units="degrees")
            f.add("y", "nyp nxp", y, units="degrees")
        return "ocean.nc", "ocean_hgrid.nc", x, y

    def test_a_supergrid_of_a_single_tile(self):
        ocean, hgrid, x, y = self.write_ocean()
        nominal, true = self.info(ocean), self.info(ocean, hgrid)
        self.assertIn("xh, yh", nominal["format"])
        east, north = np.radians(x[1::2, 1::2]), np.radians(y[1::2, 1::2])
        places = np.stack([np.cos(north) * np.cos(east), np.cos(north) * np.sin(east), np.sin(north)], -1)
        places = np.stack([(6371 - depth) * places for depth in (0.01, 0.02, 0.03)])
        np.testing.assert_allclose(true["bounds"]["lower"], places.min(axis=(0, 1, 2)), rtol=1e-9)
        np.testing.assert_allclose(true["bounds"]["upper"], places.max(axis=(0, 1, 2)), rtol=1e-9)

    def test_corners_alone_place_the_nodes_in_their_middles(self):
        """The poles are in the middles of two tiles, where longitudes have no mean."""
        corners = self.info(*self.write(kinds=("corners",)))
        centres = self.info(*self.write())
        self.expect_closed(corners)
        for a, b in zip(corners["blocks"], centres["blocks"]):
            self.assertAlmostEqual(a["volume"] / b["volume"], 1, places=9)
        np.testing.assert_allclose(corners["bounds"]["upper"], centres["bounds"]["upper"], rtol=1e-12)

    def test_names_and_files_of_all_tiles(self):
        self.expect_closed(self.info(*self.write("tile{}.nc")))
        self.expect_closed(self.info(*self.write("20160801.C12_tile{}.nc")))
        names = self.write("gz.tile{}.nc")
        for name in names:
            path = self.folder / name
            path.with_name(name + ".gz").write_bytes(gzip.compress(path.read_bytes()))
        self.expect_closed(self.info(*(name + ".gz" for name in names)))
        # Levels in a file of their own.
        names = self.write("h.tile{}.nc")
        with self.file("levels.nc", pfull=len(LEVELS)) as f:
            f.add("levels", "pfull", LEVELS)
        self.expect_closed(self.info(*names, "levels.nc"))

    def test_one_tile_alone_is_a_block(self):
        self.write()
        info = self.info("atmos.tile3.nc")
        self.assertEqual([(b["ni"], b["nj"], b["nk"]) for b in info["blocks"]], [(N, N, 3)])
        self.assertAlmostEqual(abs(info["blocks"][0]["volume"]) / SHELL, (N - 1) ** 2 / N**2 / 6, delta=0.01)
        self.assertIn("grid_lont", info["format"])

    def test_tiles_that_do_not_belong_together(self):
        names = self.write()
        with self.file("atmos.tile7.nc", time=None, pfull=len(LEVELS), grid_xt=5, grid_yt=4) as f:
            f.add("grid_lont", "grid_yt grid_xt", np.arange(20.0).reshape(4, 5), units="degrees_E")
            f.add("grid_latt", "grid_yt grid_xt", np.arange(20.0).reshape(4, 5) / 2, units="degrees_N")
            f.add("pfull", "pfull", LEVELS, units="km", positive="up")
            f.add("temp", "time pfull grid_yt grid_xt", np.ones((1, 3, 4, 5)), "f4")
        self.assertIn("atmos.tile7.nc: has 5 x 4 x 3 nodes; expected 12 x 12 x 3 nodes", self.info(*names, "atmos.tile7.nc", fails=True))
        with self.file("atmos.tile2.nc", time=None, pfull=len(LEVELS), **self.dimensions()) as f:
            f.add("pfull", "pfull", LEVELS, units="km", positive="up")
            f.add("time", "time", [3.0], units="days since 2016-08-01 00:00:00")
            self.coordinates(f, 1, ("centres",))
            f.add("q", "time pfull grid_yt grid_xt", self.values[None, :, 1], "f4")
        self.assertIn("atmos.tile2.nc: has the variables q; expected those of tile 1: temp", self.info(*names, fails=True))
        self.write()
        import netCDF4

        with netCDF4.Dataset(self.folder / "atmos.tile4.nc", "a") as f:
            f["time"][:] = 4
        self.assertIn("atmos.tile4.nc: has other times than tile 1", self.info(*names, fails=True))
        self.write()
        # Five tiles leave the place of the sixth open.
        self.assertIn("5 faces joined at 8 edges and 4 corners", self.info(*names[:5])["format"])

    def expect_no_crash(self, name, files):
        """Truncations and wrong bytes of the file, by `info` of all files: a line or numbers. Returns the share that was refused."""
        path = self.folder / name
        data = path.read_bytes()
        refused = 0
        tried = some_of(range(20), 2)
        for n in tried:
            damaged = bytearray(data[: len(data) * (n + 1) // 11] if n < 10 else data)
            for at in RANDOM.integers(0, min(len(damaged), 8192), 3 if n >= 10 else 0):
                damaged[at] ^= int(RANDOM.integers(1, 256))
            path.write_bytes(bytes(damaged))
            done = subprocess.run([PROGRAM, "info", *(str(self.folder / name) for name in files)], capture_output=True, text=True, errors="replace")
            self.assertIn(done.returncode, (0, 1), done.stderr)
            if done.returncode:
                self.assertEqual(done.stderr.count("\n"), 1, done.stderr)
                refused += 1
        path.write_bytes(data)
        return refused / len(tried)

    def test_damage(self):
        self.form = "NETCDF4"
        names = self.write()
        self.expect_no_crash(names[2], names)

    def test_damaged_supergrids_and_mosaics(self):
        """Truncated files are refused. Their names lead to no file elsewhere."""
        ocean, hgrid, x, y = self.write_ocean()
        for form in self.write_names("ocean_mosaic.nc", gridfiles=[hgrid]):
            self.assertGreaterEqual(self.expect_no_crash("ocean_mosaic.nc", [ocean, "ocean_mosaic.nc"]), 0.4, form)
            with File(self.folder / hgrid, {"nyp": x.shape[0], "nxp": x.shape[1]}, format=form) as f:
                f.add("x", "nyp nxp", x, units="degrees")
                f.add("y", "nyp nxp", y, units="degrees")
            self.assertGreaterEqual(self.expect_no_crash(hgrid, [ocean, hgrid]), 0.4, form)
        for form in self.write_names("grid_spec.nc", ocn_mosaic_file="ocean_mosaic.nc"):
            self.assertGreaterEqual(self.expect_no_crash("grid_spec.nc", [ocean, "grid_spec.nc"]), 0.4, form)
        for wrong in ("../ocean_hgrid.nc", "/etc/passwd", ".", "", "ocean.nc/", "x" * 200, "a\x01b"):
            list(self.write_names("ocean_mosaic.nc", gridfiles=[wrong]))
            done = subprocess.run([PROGRAM, "info", str(self.folder / ocean), str(self.folder / "ocean_mosaic.nc")],
                                  capture_output=True, text=True, errors="replace")
            self.assertIn(done.returncode, (0, 1), wrong)
            self.assertNotIn("root", done.stdout + done.stderr)
            if done.returncode:
                self.assertEqual(done.stderr.count("\n"), 1, done.stderr)

    def test_stacked_faces_are_named(self):
        """A restart file of GCHP."""
        with self.file(time=None, lev=3, lat=6 * N, lon=N) as f:
            for name in ("lev", "lat", "lon"):
                f.add(name, name, np.arange(1.0, len(f.dimensions[name]) + 1),
                      units={"lev": "km", "lat": "degrees_north", "lon": "degrees_east"}[name])
            f.add("SPC_O3", "time lev lat lon", np.ones((1, 3, 6 * N, N)), "f4")
        line = self.info(fails=True)
        self.assertIn("the faces of a cubed sphere are stacked along it", line)
        self.assertEqual(line.count("\n"), 1, line)


if __name__ == "__main__":
    unittest.main()
