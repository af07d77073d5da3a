#!/usr/bin/python3
"""model_dialects_test.py CURVISPLAT

NetCDF files as particular models and archives write them: CESM's POP, COSMO, MERRA-2, ERA5. model_files.py says how. Exit status 77
(skipped) without python3-netcdf4.
"""
import unittest

from model_files import RANDOM, ModelFileTest, np, sphere


class ModelDialects(ModelFileTest):
    def test_pop_has_two_sets_of_points_on_the_same_dimensions(self):
        """With a displaced pole: coordinates are of two dimensions, and a variable names those of its points."""
        lat, lon = np.meshgrid(np.linspace(-70, 70, 8), np.linspace(0, 110, 12), indexing="ij")
        depths = np.array([500.0, 3000, 20000])
        levels = RANDOM.integers(0, 4, (8, 12))
        t = RANDOM.random((3, 8, 12)).astype("f4")
        t[np.arange(3)[:, None, None] >= levels] = 9.96921e36
        with self.file(time=None, z_t=3, nlat=8, nlon=12) as f:
            for point, shift in (("T", 0), ("U", 5)):
                f.add(f"{point}LONG", "nlat nlon", lon + shift, units="degrees_east")
                f.add(f"{point}LAT", "nlat nlon", lat + shift, units="degrees_north")
            f.add("z_t", "z_t", depths, units="centimeters", positive="down")
            f.add("KMT", "nlat nlon", levels, "f8", coordinates="TLONG TLAT")
            for name, point in (("TEMP", "T"), ("SALT", "T"), ("UVEL", "U")):
                f.add(name, "time z_t nlat nlon", t[None], "f4", np.float32(9.96921e36), missing_value=np.float32(9.96921e36),
                      coordinates=f"{point}LONG {point}LAT z_t time")
        info = self.info()
        values = np.where(t > 1e30, np.nan, t)
        self.expect(info, sphere(lon, lat, -1e-5 * depths[:, None, None]), values)
        self.assertEqual(info["blanking"], "TEMP is missing where it is equal to 9.96921e+36, or where KMT counts fewer levels")
        self.assertEqual([s["name"] for s in info["scalars"]], ["TEMP", "SALT"])
        self.assertIn("left out: UVEL, on another grid (nlon, nlat, z_t at ULONG, ULAT); select that grid with --scalar NAME",
                      info["warnings"])

    def test_cosmo_has_the_heights_of_half_levels(self):
        """And the levels have no unit of length."""
        t = RANDOM.random((3, 8, 12)).astype("f4")
        ground = 1000 * RANDOM.random((8, 12))
        half = ground + (12000 - ground) * np.linspace(1, 0, 4)[:, None, None] ** 2
        for positive in ("up", "down"):
            sign = 1 if positive == "up" else -1
            with self.file(time=None, rlon=12, rlat=8, level=3, level1=4) as f:
                lon, lat = np.linspace(0, 9, 12), np.linspace(45, 52, 8)[:, None]
                f.add("lon", "rlat rlon", lon + 0 * lat, units="degrees_east")
                f.add("lat", "rlat rlon", lat + 0 * lon, units="degrees_north")
                f.add("level", "level", np.arange(1, 4), units="1", axis="Z")
                f.add("level1", "level1", np.arange(1, 5), axis="Z")
                f.add("HHL", "time level1 rlat rlon", sign * half[None], units="m", standard_name="altitude", positive=positive)
                f.add("T", "time level rlat rlon", t[None], "f4", coordinates="lon lat")
            info = self.info()
            self.expect(info, sphere(lon, lat, 1e-3 * (half[1:] + half[:-1]) / 2), t)
            self.assertIn("interface height HHL", info["format"])

    def test_merra_has_the_heights_of_layers(self):
        t, h = RANDOM.random((3, 8, 12)).astype("f4"), 100 * RANDOM.random((3, 8, 12)) + np.array([8000, 4000, 60])[:, None, None]
        for name, unit, scale in (("mid_layer_heights", "m", 1), ("mid_level_pressure", "Pa", None)):
            with self.file(lon=12, lat=8, lev=3) as f:
                lon, lat = self.air(f)
                f.add("lev", "lev", [70.0, 71, 72], units="layer", positive="down", standard_name="model_layers")
                f.add("T", "lev lat lon", t, "f4", standard_name="air_temperature")
                values = h if scale else np.array([30000.0, 60000, 100000])[:, None, None] + 0 * h
                f.add("H", "lev lat lon", values, "f4", units=unit, standard_name=name)
            info = self.info()
            if scale:
                self.expect(info, sphere(lon, lat, 1e-3 * h.astype("f4")), t)
            else:
                self.assertIn("pressure, at heights of the standard atmosphere", info["format"])

    def test_further_dimensions_are_named(self):
        """ERA5 of the last months has two experiments; ensembles have members."""
        with self.file(time=2, expver=2, lon=12, lat=8, level=3) as f:
            self.air(f)
            f.add("level", "level", [100.0, 500, 1000], units="millibars")
            f.add("time", "time", [0.0, 1], units="hours since 1900-01-01")
            f.add("t", "time expver level lat lon", RANDOM.random((2, 2, 3, 8, 12)), "f4")
        line = self.info(fails=True)
        self.assertIn("t: 4 dimensions besides time (expver, level, lat, lon); expected 3", line)
        self.assertEqual(line.count("\n"), 1)


if __name__ == "__main__":
    unittest.main()
