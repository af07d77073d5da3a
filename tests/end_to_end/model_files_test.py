#!/usr/bin/python3
"""model_files_test.py CURVISPLAT

NetCDF files as models and their tools write them: masks, heights, dates, damage. model_files.py says how. Exit status 77
(skipped) without python3-netcdf4.
"""
import subprocess
import unittest

from sweep import some_of
from model_files import PROGRAM, RANDOM, File, ModelFileTest, netCDF4, np, sphere, standard_altitude


class ModelFiles(ModelFileTest):
    # -- masks, from one file or two

    def roms(self, name, lon, lat, temp, attributes=None, **masks):
        nk, nj, ni = temp.shape
        s = (np.arange(nk) + 0.5) / nk - 1
        with self.file(name, xi_rho=ni, eta_rho=nj, s_rho=nk, ocean_time=None) as f:
            f.add("s_rho", "s_rho", s, standard_name="ocean_s_coordinate_g2", positive="up",
                  formula_terms="s: s_rho C: Cs_r eta: zeta depth: h depth_c: hc")
            f.add("Cs_r", "s_rho", -s * s)
            f.add("hc", "", 20.0)
            f.add("zeta", "ocean_time eta_rho xi_rho", np.zeros((1, nj, ni)), units="meter")
            f.add("ocean_time", "ocean_time", [0.0], units="seconds since 2001-01-01")
            f.add("temp", "ocean_time s_rho eta_rho xi_rho", temp[None], "f4")
            for mask, values in masks.items():
                f.add(mask, "eta_rho xi_rho", values, **(attributes or {}))
        s = s[:, None, None]
        return sphere(lon, lat, 1e-3 * 100 * (20 * s - 100 * s * s) / 120)

    def test_a_mask_and_the_grid_in_a_second_file(self):
        lon, lat = np.meshgrid(np.linspace(-10, 0, 20), np.linspace(40, 50, 15))
        mask = ((lon + lat) % 7 > 2).astype("f8")
        temp = (1 + RANDOM.random((6, 15, 20))).astype("f4")
        places = self.roms("his.nc", lon, lat, temp * mask.astype("f4"))
        with self.file("grid.nc", xi_rho=20, eta_rho=15) as f:
            f.add("lon_rho", "eta_rho xi_rho", lon, units="degree_east")
            f.add("lat_rho", "eta_rho xi_rho", lat, units="degree_north")
            f.add("h", "eta_rho xi_rho", 100 + 0 * lon, units="meter")
            f.add("mask_rho", "eta_rho xi_rho", mask)
        info = self.info("his.nc", "grid.nc")
        self.expect(info, places, np.where(mask == 0, np.nan, temp))
        self.assertEqual(len(info["files"]), 2)
        self.assertIn("mask_rho is 0", info["blanking"])
        self.assertIn("no longitude", self.info("his.nc", fails=True))

    def test_nemo_takes_the_mask_of_its_points(self):
        lon, lat = np.meshgrid(np.linspace(0, 9, 10), np.linspace(30, 36, 7))
        depth = np.array([5.0, 20, 60, 100])
        land = {p: RANDOM.random((4, 7, 10)) < 0.3 for p in "tu"}
        temp = RANDOM.random((4, 7, 10)).astype("f4")
        for point, places in (("t", "deptht"), ("u", "depthu")):
            with self.file(f"{point}.nc", x=10, y=7, time_counter=None, **{places: 4}) as f:
                f.add("nav_lon", "y x", lon, units="degrees_east")
                f.add("nav_lat", "y x", lat, units="degrees_north")
                f.add(places, places, depth, units="m", positive="down")
                f.add("field", f"time_counter {places} y x", temp[None], "f4")
        with self.file("mesh_mask.nc", x=10, y=7, z=4, t=None) as f:
            for point, hidden in land.items():
                f.add(f"{point}mask", "t z y x", ~hidden[None], "i1")
        for point, hidden in land.items():
            info = self.info(f"{point}.nc", "mesh_mask.nc")
            self.expect(info, sphere(lon, lat, -1e-3 * depth[:, None, None]), np.where(hidden, np.nan, temp))

    def ocean(self, f, nk=4, nj=7, ni=10):
        """Axes of an ocean, and its places."""
        lon, lat, depth = np.linspace(0, 9, ni), np.linspace(30, 36, nj), np.linspace(5, 100, nk)
        f.add("lon", "lon", lon, units="degrees_east")
        f.add("lat", "lat", lat, units="degrees_north")
        f.add("depth", "depth", depth, units="m", positive="down")
        return sphere(lon, lat[:, None], -1e-3 * depth[:, None, None])

    def test_masks_by_other_names_and_attributes(self):
        temp = RANDOM.random((4, 7, 10)).astype("f4")
        deep = RANDOM.integers(0, 5, (7, 10))
        part = RANDOM.random((4, 7, 10)) * (RANDOM.random((4, 7, 10)) > 0.4)
        wet = part > 0
        levels = np.arange(4)[:, None, None] < deep
        flags = {"flag_values": np.array([0, 1, 2], "i4"), "flag_meanings": "sea lake land"}
        cases = [
            ("hFacC", "depth lat lon", part, {}, wet),
            ("wet", "lat lon", wet[0], {}, wet[:1]),
            ("KMT", "lat lon", deep, {}, levels),
            ("ocean", "depth lat lon", wet, {"standard_name": "sea_binary_mask"}, wet),
            ("ground", "lat lon", ~wet[0], {"standard_name": "land_binary_mask"}, wet[:1]),
            ("LANDMASK", "lat lon", ~wet[0], {}, wet[:1]),
            ("kind", "lat lon", np.where(wet[0], 1, 2), flags, wet[:1]),
        ]
        for name, dims, values, attributes, seen in cases:
            with self.subTest(name):
                with self.file(lon=10, lat=7, depth=4) as f:
                    places = self.ocean(f)
                    f.add(name, dims, values, "f4" if name == "hFacC" else "i4", **attributes)
                    f.add("temp", "depth lat lon", temp, "f4")
                self.expect(self.info(), places, np.where(seen, temp, np.nan))

    def test_land_does_not_hide_the_air_above(self):
        temp = RANDOM.random((4, 7, 10)).astype("f4")
        with self.file(lon=10, lat=7, height=4) as f:
            f.add("lon", "lon", np.linspace(0, 9, 10), units="degrees_east")
            f.add("lat", "lat", np.linspace(30, 36, 7), units="degrees_north")
            f.add("height", "height", [10.0, 100, 1000, 5000], units="m", positive="up")
            f.add("LANDMASK", "lat lon", RANDOM.integers(0, 2, (7, 10)), standard_name="land_binary_mask")
            f.add("t", "height lat lon", temp, "f4")
        self.assertEqual(self.info()["blanked"]["by_grid"], 0)

    # -- heights

    def test_pressure_levels_in_every_unit(self):
        levels = np.array([1, 10, 100, 300, 500, 850, 1000, 1030.0])
        t = RANDOM.random((8, 8, 12)).astype("f4")
        for unit, pascals in (("millibars", 100), ("hPa", 100), ("Pa", 1), ("mb", 100)):
            with self.subTest(unit):
                with self.file(lon=12, lat=8, level=8, time=None) as f:
                    lon, lat = self.air(f)
                    f.add("level", "level", levels * 100 / pascals, units=unit)
                    f.add("time", "time", [900000.0], units="hours since 1900-01-01")
                    f.add("t", "time level lat lon", t[None], "f4")
                info = self.info()
                self.expect(info, sphere(lon, lat, standard_altitude(100 * levels)[:, None, None]), t, near=1e-3)
                self.assertIn("standard atmosphere", info["format"])

    def test_a_geopotential_goes_before_the_standard_atmosphere(self):
        t = RANDOM.random((5, 8, 12)).astype("f4")
        geopotential = 9.80665 * (np.array([16000, 9000, 5000, 1500, 100.0])[:, None, None] + 100 * RANDOM.random((5, 8, 12)))
        with self.file(lon=12, lat=8, plev=5) as f:
            lon, lat = self.air(f)
            f.add("plev", "plev", [1e4, 3e4, 5e4, 8.5e4, 1e5], units="Pa", positive="down")
            f.add("t", "plev lat lon", t, "f4")
            f.add("z", "plev lat lon", geopotential, standard_name="geopotential", units="m**2 s**-2")
        self.expect(self.info("file.nc"), sphere(lon, lat, 1e-3 * geopotential / 9.80665), t)

    def test_formulas_of_pressures_and_heights(self):
        a, b = np.array([0.05, 0.1, 0.2, 0.1, 0]), np.array([0, 0.05, 0.3, 0.7, 1])
        ground = 95000 + 6000 * RANDOM.random((8, 12))
        orography = 500 * RANDOM.random((8, 12))
        column = lambda values: values[:, None, None]
        t = RANDOM.random((5, 8, 12)).astype("f4")
        prefix = "atmosphere_"
        cases = [
            (prefix + "hybrid_sigma_pressure_coordinate", "a: A b: B p0: P0 ps: PS", column(a) * 1e5 + column(b) * ground),
            (prefix + "hybrid_sigma_pressure_coordinate", "ap: AP b: B ps: PS", column(a) * 9e4 + column(b) * ground),
            (prefix + "sigma_coordinate", "sigma: SIGMA ps: PS ptop: PTOP", 5000 + column(b + 0.01) * (ground - 5000)),
            (prefix + "ln_pressure_coordinate", "p0: P0 lev: LEV", column(1e5 * np.exp(-np.linspace(2, 0, 5))) + 0 * ground),
            (prefix + "hybrid_height_coordinate", "a: Z b: B orog: OROG", None),
        ]
        for name, terms, pascals in cases:
            with self.subTest(terms):
                with self.file(lon=12, lat=8, lev=5, time=None) as f:
                    lon, lat = self.air(f)
                    f.add("lev", "lev", 1000 * (a + b), units="level", positive="down", standard_name=name, formula_terms=terms)
                    f.add("A", "lev", a)
                    f.add("AP", "lev", 900 * a, units="hPa")
                    f.add("B", "lev", b)
                    f.add("SIGMA", "lev", b + 0.01)
                    f.add("LEV", "lev", np.linspace(2, 0, 5))
                    f.add("Z", "lev", 1e4 * (1.1 - b), units="m")
                    f.add("P0", "", 1000.0, units="hPa")
                    f.add("PTOP", "", 5000.0, units="Pa")
                    f.add("PS", "time lat lon", ground[None], units="Pa")
                    f.add("OROG", "lat lon", orography, units="m")
                    f.add("T", "time lev lat lon", t[None], "f4")
                if pascals is None:
                    height = 1e-3 * (column(1e4 * (1.1 - b)) + column(b) * orography)
                else:
                    height = standard_altitude(pascals)
                self.expect(self.info(), sphere(lon, lat, height), t, near=1e-3)

    def test_sleve_heights(self):
        a, b1, b2 = np.linspace(1, 0.05, 5), np.linspace(0, 0.9, 5), np.linspace(0, 0.95, 5) ** 3
        large, small = 500 * RANDOM.random((8, 12)), 90 * RANDOM.random((8, 12))
        t = RANDOM.random((5, 8, 12)).astype("f4")
        with self.file(lon=12, lat=8, lev=5, time=None) as f:
            lon, lat = self.air(f)
            f.add("lev", "lev", a, standard_name="atmosphere_sleve_coordinate", positive="up",
                  formula_terms="a: A b1: B1 b2: B2 ztop: TOP zsurf1: LARGE zsurf2: SMALL")
            for name, values in (("A", a), ("B1", b1), ("B2", b2)):
                f.add(name, "lev", values)
            f.add("TOP", "", 20.0, units="km")
            f.add("LARGE", "lat lon", large, units="m")
            f.add("SMALL", "lat lon", small, units="m")
            f.add("T", "time lev lat lon", t[None], "f4")
        height = a[:, None, None] * 20 + 1e-3 * (b1[:, None, None] * large + b2[:, None, None] * small)
        self.expect(self.info(), sphere(lon, lat, height), t, near=1e-3)

    def test_sigma_over_z_and_double_sigma(self):
        depth, eta = 100 + 900 * RANDOM.random((7, 10)), RANDOM.random((7, 10))
        t = RANDOM.random((6, 7, 10)).astype("f4")
        sigma = np.array([-0.1, -0.4, -0.9, np.nan, np.nan, np.nan])
        zlev = np.array([np.nan, np.nan, np.nan, -300.0, -500, -900])
        of_sigma = eta + sigma[:, None, None] * (np.minimum(200, depth) + eta)
        expected = np.where(np.arange(6)[:, None, None] < 3, of_sigma, zlev[:, None, None])
        over = np.linspace(0.1, 1, 3)
        middle = 0.5 * (40 + 60) + 0.5 * (40 - 60) * np.tanh(2 * 0.2 / (40 - 60) * (depth - 400))
        double = np.concatenate([-over[:, None, None] * middle, middle - (1 + over[:, None, None]) * (depth - middle)])
        common = {"DEPTH": ("lat lon", depth, "m"), "ETA": ("lat lon", eta, "m")}
        cases = [
            ("ocean_sigma_z_coordinate", "sigma: S eta: ETA depth: DEPTH depth_c: DC zlev: Z", {}, expected),
            ("ocean_sigma_z_coordinate", "sigma: S eta: ETA depth: DEPTH depth_c: DC nsigma: N zlev: Z", {"S": np.linspace(-0.1, -0.9, 6)}, None),
            ("ocean_double_sigma_coordinate", "sigma: S depth: DEPTH z1: Z1 z2: Z2 a: A href: H k_c: K",
             {"S": np.concatenate([-over, -over])}, double),
        ]
        for name, terms, other, height in cases:
            with self.subTest(terms):
                s = other.get("S", sigma)
                if height is None:
                    height = np.where(np.arange(6)[:, None, None] < 3, eta + s[:, None, None] * (np.minimum(200, depth) + eta),
                                      zlev[:, None, None])
                with self.file(lon=10, lat=7, lev=6) as f:
                    lon, lat = np.linspace(0, 9, 10), np.linspace(30, 36, 7)
                    f.add("lon", "lon", lon, units="degrees_east")
                    f.add("lat", "lat", lat, units="degrees_north")
                    f.add("lev", "lev", np.arange(6.0), standard_name=name, formula_terms=terms, positive="up")
                    f.add("S", "lev", np.nan_to_num(s, nan=-999), fill=-999.0)
                    f.add("Z", "lev", np.nan_to_num(zlev, nan=-999), fill=-999.0, units="m")
                    for key, (dims, values, units) in common.items():
                        f.add(key, dims, values, units=units)
                    for key, value in {"DC": 200.0, "N": 3, "Z1": 40.0, "Z2": 60.0, "A": 0.2, "H": 400.0, "K": 3}.items():
                        f.add(key, "", value)
                    f.add("T", "lev lat lon", t, "f4")
                self.expect(self.info(), sphere(lon, lat[:, None], 1e-3 * height), t, near=1e-3)

    def test_layers_of_density(self):
        thickness = 10 + 50 * RANDOM.random((5, 8, 12))
        thickness[1:3, 2, 3] = 0  # layers vanish
        salt = RANDOM.random((5, 8, 12)).astype("f4")
        above = np.cumsum(thickness, axis=0) - thickness / 2
        for positive in ("down", "up"):
            with self.subTest(positive):
                up = positive == "up"
                with self.file(lon=12, lat=8, zl=5) as f:
                    lon, lat = self.air(f)
                    f.add("zl", "zl", np.linspace(1025, 1028, 5), units="kg m-3", positive=positive)
                    f.add("salt", "zl lat lon", salt, "f4")
                    f.add("h", "zl lat lon", thickness[::-1] if up else thickness, units="m", long_name="Layer Thickness")
                self.expect(self.info(), sphere(lon, lat, -1e-3 * (above[::-1] if up else above)), salt)
        edges = -np.concatenate([np.zeros((1, 8, 12)), np.cumsum(thickness, axis=0)])
        with self.file(lon=12, lat=8, zl=5, zi=6) as f:
            lon, lat = self.air(f)
            f.add("zl", "zl", np.linspace(1025, 1028, 5), units="kg m-3", positive="down")
            f.add("salt", "zl lat lon", salt, "f4")
            f.add("e", "zi lat lon", edges, units="m", long_name="Interface Height Relative to Mean Sea Level")
        self.expect(self.info(), sphere(lon, lat, 1e-3 * (edges[1:] + edges[:-1]) / 2), salt)

    def test_depths_that_fall_are_heights(self):
        t = RANDOM.random((4, 7, 10)).astype("f4")
        with self.file(lon=10, lat=7, depth=4) as f:
            f.add("lon", "lon", np.linspace(0, 9, 10), units="degrees_east")
            f.add("lat", "lat", np.linspace(30, 36, 7), units="degrees_north")
            f.add("depth", "depth", [-5.0, -20, -60, -100], units="m")
            f.add("t", "depth lat lon", t, "f4")
        height = -1e-3 * np.array([5.0, 20, 60, 100])[:, None, None]
        self.expect(self.info(), sphere(np.linspace(0, 9, 10), np.linspace(30, 36, 7)[:, None], height), t)

    def test_levels_without_a_length_are_refused(self):
        for attributes, words in (({}, "lev has no unit"), ({"units": "1"}, "lev has the unit '1'")):
            with self.file(lon=12, lat=8, lev=5) as f:
                self.air(f)
                f.add("lev", "lev", np.linspace(1, 0, 5), **attributes)
                f.add("T", "lev lat lon", RANDOM.random((5, 8, 12)))
            self.assertIn(words, self.info("file.nc", fails=True))

    # -- when, and what is missing

    def test_dates_of_every_calendar(self):
        cases = [
            ("standard", "days since 1950-01-01", [0, 27000.25]),
            ("gregorian", "hours since 1900-01-01 00:00:0.0", [876576, 876582]),
            ("standard", "days since 0001-01-01 00:00:00", [0, 577736, 577737, 730000.5]),
            ("proleptic_gregorian", "seconds since 1970-01-01T00:00:00Z", [951782400, 951868799]),
            ("proleptic_gregorian", "minutes since 1583-03-01 12:00", [-1e6, 1e7]),
            ("julian", "days since 1500-02-28", [0, 1, 2, 40000]),
            ("noleap", "days since 2000-02-28 06:00:00", [0, 1, 365 * 4 + 1]),
            ("365_day", "days since 0001-01-01", [0, 58, 59, 364, 365]),
            ("all_leap", "days since 2001-01-01", [58, 59, 60, 366]),
            ("360_day", "days since 1850-01-01", [0, 29, 30, 59, 359, 360]),
            ("standard", "hours since 2001-03-01 00:00:00 -06:00", [0, 5.5]),
        ]
        t = RANDOM.random((8, 12)).astype("f4")
        for calendar, unit, times in cases:
            with self.file(lon=12, lat=8, height=2, time=None) as f:
                self.air(f)
                f.add("height", "height", [0.0, 1000], units="m", positive="up")
                f.add("time", "time", times, units=unit, calendar=calendar)
                f.add("T", "time height lat lon", np.broadcast_to(t, (len(times), 2, 8, 12)), "f4")
            for step, time in enumerate(times):
                with self.subTest(f"{time} {unit}, {calendar}"):
                    info = self.info("file.nc", "--time-step", str(step))
                    expected = netCDF4.num2date(time, unit, calendar).strftime("%Y-%m-%d %H:%M:%S").strip()
                    self.assertEqual(info["date"], expected.zfill(19))
                    self.assertEqual((info["time_unit"], info["times"][step]), (unit, time))

    def test_the_times_of_wrf(self):
        dates = ["2005-08-28_00:00:00", "2005-08-28_03:00:00", "2005-09-01_00:00:30"]
        with self.file(west_east=12, south_north=8, height=2, Time=None, DateStrLen=19) as f:
            f.add("XLONG", "south_north west_east", np.broadcast_to(np.linspace(0, 11, 12), (8, 12)), units="degree_east")
            f.add("XLAT", "south_north west_east", np.broadcast_to(np.linspace(0, 7, 8)[:, None], (8, 12)), units="degree_north")
            f.add("height", "height", [0.0, 1000], units="m", positive="up")
            f.add("Times", "Time DateStrLen", np.array([list(date) for date in dates], "S1"), "S1")
            f.add("XTIME", "Time", [0, 180, 5760], "f4", units="minutes since 2005-08-28 00:00:00")  # less exact
            f.add("T", "Time height south_north west_east", RANDOM.random((3, 2, 8, 12)), "f4")
        info = self.info("file.nc", "--time-step", "2")
        self.assertEqual(info["times"], [0, 10800, 4 * 86400 + 30])
        self.assertEqual(info["date"], "2005-09-01 00:00:30")

    def test_times_with_another_name_than_their_dimension(self):
        """Of a dimension that has no coordinate; the start of each forecast, and times that fall, are left out."""
        for length, time, others in ((None, [0.1, 0.25, 0.7], {}), (3, [0.1, 0.25, 0.7], {}), (3, [0, 1, 2], {"standard_name": "forecast_reference_time"}), (None, [0, 1, 2], {"scale_factor": -1.0})):
            with self.subTest(f"{length} {others}"), self.file(lon=12, lat=8, height=2, nt=length) as f:
                self.air(f)
                f.add("height", "height", [0.0, 1000], units="m", positive="up")
                f.add("time", "nt", [0.1, 0.25, 0.7], units="days since 2000-01-01", **others)
                f.add("T", "nt height lat lon", RANDOM.random((3, 2, 8, 12)), "f4")
            info = self.info("file.nc", "--time-step", "1")
            self.assertEqual(info["times"], time)
            self.assertEqual(info.get("date"), None if others else "2000-01-01 06:00:00")

    def test_land_that_is_zero_is_noticed(self):
        wet = RANDOM.random((7, 10)) > 0.3
        temp = (1 + RANDOM.random((4, 7, 10))).astype("f4")
        for values, noticed in ((temp * wet, True), (temp, False), (np.where(wet, temp, np.nan), False)):
            with self.file(lon=10, lat=7, depth=4) as f:
                self.ocean(f)
                f.add("temp", "depth lat lon", values, "f4")
            self.assertEqual("--blank 0" in " ".join(self.info()["warnings"]), noticed)

    # -- damage

    def test_damaged_files_are_refused_or_read(self):
        """Truncated headers and wrong bytes never crash; in classic files, whose parser is not HDF5's."""
        t = RANDOM.random((1, 3, 8, 12)).astype("f4")
        with File(self.folder / "all.nc", {"rlon": 12, "rlat": 8, "lev": 3, "time": None, "n": 19}, format="NETCDF3_CLASSIC") as f:
            f.add("rlon", "rlon", np.linspace(-10, 12, 12), units="degrees", standard_name="grid_longitude")
            f.add("rlat", "rlat", np.linspace(-8, 8, 8), units="degrees", standard_name="grid_latitude")
            f.add("pole", "", 0, "i4", grid_mapping_name="rotated_latitude_longitude", grid_north_pole_latitude=39.25,
                  grid_north_pole_longitude=-162.0)
            f.add("lev", "lev", [1.0, 2, 3], standard_name="atmosphere_hybrid_sigma_pressure_coordinate", units="level",
                  formula_terms="ap: A b: B ps: PS", positive="down")
            f.add("A", "lev", [1e4, 2e4, 0])
            f.add("B", "lev", [0, 0.3, 1])
            f.add("PS", "time rlat rlon", np.full((1, 8, 12), 1e5), units="Pa")
            f.add("kind", "rlat rlon", np.ones((8, 12)), "i4", flag_values=np.array([0, 1], "i4"), flag_meanings="hole sea")
            f.add("time", "time", [0.0], units="days since 2001-01-01 00:00:00", calendar="noleap")
            f.add("T", "time lev rlat rlon", t, "f4", grid_mapping="pole")
        data = (self.folder / "all.nc").read_bytes()
        self.assertEqual(self.info("all.nc")["blanked"]["by_grid"], 0)
        header = data.index(b"flag_meanings") + 1200
        refused = 0
        tried = some_of(range(250), 5)
        for n in tried:
            wrong = bytearray(data)
            wrong[int(RANDOM.integers(4, min(header, len(data))))] ^= int(RANDOM.integers(1, 256))
            if n < 40:
                wrong = wrong[: n * len(data) // 40]
            (self.folder / "wrong.nc").write_bytes(wrong)
            done = subprocess.run([PROGRAM, "info", "--json", str(self.folder / "wrong.nc")], capture_output=True, text=True,
                                  errors="replace", timeout=60)
            self.assertIn(done.returncode, (0, 1), f"case {n}: {done.stderr}")
            if done.returncode == 1:
                refused += 1
                self.assertRegex(done.stderr, r"^curvisplat: [^\n]*\n$")
        print(f"{refused} of {len(tried)} damaged files refused")
        self.assertGreater(refused, len(tried) / 5)

    def test_variables_in_groups_are_named(self):
        with self.file() as f:
            f.createGroup("empty")
            group = f.createGroup("model")
            for name, length, unit in (("lev", 3, "m"), ("lat", 4, "degrees_north"), ("lon", 5, "degrees_east")):
                group.createDimension(name, length)
                group.createVariable(name, "f8", (name,))[:] = np.arange(length)
                group[name].units = unit
            group.createVariable("t", "f4", ("lev", "lat", "lon"))[:] = 1
        line = self.info(fails=True)
        self.assertIn("its variables are in groups (model), which are not read", line)
        self.assertIn("ncks -G : -g model file.nc OUT", line)
        self.assertEqual(line.count("\n"), 1, line)

    def test_levels_without_a_unit(self):
        with self.file(lev=3, lat=8, lon=12) as f:
            self.air(f)
            f.add("lev", "lev", np.arange(3.0), axis="Z")
            f.add("t", "lev lat lon", np.ones((3, 8, 12)))
        self.assertIn("lev has no unit; expected a length or a pressure: if its values are metres, say so", self.info(fails=True))

    def test_integers_without_a_sign(self):
        """The classic format has none: `_Unsigned` says so. netCDF4 reads the same numbers."""
        stored = RANDOM.integers(0, 251, (6, 8, 12)).astype("u1")
        stored[0, 0, :3], stored[0, 1, 0], stored[0, 1, 1] = 255, 250, 0
        for kind, signed, unsigned in (("i1", "i1", "u1"), ("i2", "i2", "u2"), ("u1", "i1", "false")):
            form = "NETCDF4" if kind == "u1" else "NETCDF3_CLASSIC"
            raw = stored.astype("u2") * 257 if kind == "i2" else stored
            top = 255 * 257 if kind == "i2" else 255
            with File(self.folder / "file.nc", {"lev": 6, "lat": 8, "lon": 12}, format=form) as f:
                lon, lat = self.air(f)
                depth = np.arange(6.0)
                f.add("lev", "lev", depth, units="km", positive="up")
                whole = {"_Unsigned": "false"} if unsigned == "false" else {
                    "_Unsigned": "true", "valid_range": np.array([1, top - 1], unsigned).view(signed)}
                fill = np.array(top, "u2" if kind == "i2" else "u1").view(kind)
                f.add("q", "lev lat lon", raw.view(kind), kind, fill, scale_factor=0.5, add_offset=1.0, **whole)
            with netCDF4.Dataset(self.folder / "file.nc") as f:
                read = np.ma.filled(f["q"][:].astype("f8"), np.nan)
            if unsigned == "false":
                values = np.where(stored == 255, np.nan, 0.5 * stored.view("i1") + 1)
            else:
                values = np.where((raw == top) | (raw == 0), np.nan, 0.5 * raw + 1)
                np.testing.assert_array_equal(read, values)
            self.expect(self.info(), sphere(lon, lat, depth[:, None, None]), values)

    def test_a_field_called_z(self):
        """Data, where the levels have a unit of their own; heights, where they have none."""
        for units in ("km", None):
            with self.file(lev=3, lat=8, lon=12) as f:
                lon, lat = self.air(f)
                if units:
                    f.add("lev", "lev", [1.0, 2, 4], units=units, positive="up")
                t = RANDOM.random((3, 8, 12)).astype("f4")
                f.add("t", "lev lat lon", t, "f4")
                z = 1000 * np.array([1.0, 3, 4])[:, None, None] * np.ones((3, 8, 12))
                f.add("z", "lev lat lon", z)
            info = self.info()
            height = np.array([1.0, 2 if units else 3, 4])[:, None, None]
            self.assertIn("vertical lev" if units else "vertical z", info["format"])
            self.expect(info, sphere(lon, lat, height), t.astype("f8"), scalar=[s["name"] for s in info["scalars"]].index("t"))

    def test_lead_times_of_a_forecast(self):
        """As cfgrib and xarray write them: steps in hours since a start, which is a time of its own."""
        t = RANDOM.random((1, 3, 4, 8, 12)).astype("f4")
        for dimensions, name in (("time step lev lat lon", "step"), ("step lev lat lon", "step"), ("time fc lev lat lon", "fc")):
            with self.file(time=1, **{name: 3}, lev=4, lat=8, lon=12) as f:
                lon, lat = self.air(f)
                f.add("lev", "lev", np.arange(4.0), units="km", positive="up")
                f.add("time", "time", [6.0], units="hours since 2020-01-01", standard_name="time")
                f.add(name, name, [0.0, 6, 12], units="hours", **({} if name == "step" else {"standard_name": "forecast_period"}))
                f.add("t", dimensions, t if dimensions.startswith("time") else t[0], "f4")
            for step in range(3):
                info = self.info("file.nc", "--time-step", str(step))
                self.assertEqual(info["times"], [0, 6, 12])
                self.expect(info, sphere(lon, lat, np.arange(4.0)[:, None, None]), t[0, step].astype("f8"))

    def test_storages(self):
        """Every format of netCDF4, types that only some have, and HDF5's checksums and byte orders."""
        whole = RANDOM.integers(-10**12, 10**12, (3, 8, 12))
        small = RANDOM.integers(0, 60000, (3, 8, 12))
        for form, kind, values, options in (
                ("NETCDF3_CLASSIC", "i4", small, {}), ("NETCDF3_64BIT_OFFSET", "f8", small / 7, {}), ("NETCDF3_64BIT_DATA", "i8", whole, {}),
                ("NETCDF3_64BIT_DATA", "u2", small, {}), ("NETCDF4_CLASSIC", "f4", small, {}), ("NETCDF4", "i8", whole, {"endian": "big"}),
                ("NETCDF4", "f4", small, {"endian": "big", "fletcher32": True, "shuffle": True, "zlib": True, "chunksizes": (2, 5, 7)})):
            with File(self.folder / "file.nc", {"lev": 3, "lat": 8, "lon": 12}, format=form) as f:
                lon, lat = self.air(f)
                f.add("lev", "lev", [1.0, 2, 4], units="km", positive="up")
                f.createVariable("q", kind, ("lev", "lat", "lon"), **options)[:] = values
            with self.subTest(form=form, kind=kind):
                self.expect(self.info(), sphere(lon, lat, np.array([1.0, 2, 4])[:, None, None]), values.astype("f8"))

    def test_variables_of_other_types(self):
        """Enumerations, lists, records and strings do not stop the others."""
        with self.file(lev=3, lat=8, lon=12) as f:
            lon, lat = self.air(f)
            f.add("lev", "lev", [1.0, 2, 4], units="km", positive="up")
            on = ("lev", "lat", "lon")
            f.createVariable("a", f.createEnumType("u1", "kind", {"sea": 0, "ice": 1}), on)[:] = np.zeros((3, 8, 12), "u1")
            f.createVariable("b", f.createVLType("f4", "ragged"), on)
            f.createVariable("c", f.createCompoundType(np.dtype([("r", "f4"), ("i", "f4")]), "complex"), on)
            f.createVariable("d", str, on)
            f.createVariable("e", "S1", on)
            t = RANDOM.random((3, 8, 12)).astype("f4")
            f.add("t", "lev lat lon", t, "f4")
        info = self.info()
        self.assertEqual([s["name"] for s in info["scalars"]], ["t"])
        self.expect(info, sphere(lon, lat, np.array([1.0, 2, 4])[:, None, None]), t.astype("f8"))

    def test_a_file_without_a_record(self):
        with self.file(time=None, lev=3, lat=8, lon=12) as f:
            self.air(f)
            f.add("lev", "lev", [1.0, 2, 4], units="km", positive="up")
            f.createVariable("time", "f8", ("time",)).units = "days since 2000-01-01"
            f.createVariable("t", "f4", ("time", "lev", "lat", "lon"))
        self.assertIn("has no time step: dimension time has length 0", self.info(fails=True))

    def test_filters_that_are_not_installed(self):
        try:
            import h5py
        except ModuleNotFoundError:
            self.skipTest("no h5py")
        with self.file(lev=3, lat=8, lon=12) as f:
            self.air(f)
            f.add("lev", "lev", [1.0, 2, 4], units="km", positive="up")
        with h5py.File(self.folder / "file.nc", "a") as f:
            t = f.create_dataset("t", data=np.ones((3, 8, 12)), chunks=(3, 8, 12), compression="lzf")
            for n, name in enumerate(("lev", "lat", "lon")):
                t.dims[n].attach_scale(f[name])
        line = self.info(fails=True)
        self.assertIn("t is compressed by a filter that HDF5 lacks here", line)
        self.assertEqual(line.count("\n"), 1, line)

    def test_a_grid_without_a_node(self):
        with self.file(lev=3, lat=8, lon=12) as f:
            self.air(f)
            f.add("lev", "lev", np.arange(3.0), units="m")
            f.add("t", "lev lat lon", np.full((3, 8, 12), np.nan), fill=np.nan)
        done = subprocess.run([PROGRAM, "info", str(self.folder / "file.nc")], capture_output=True, text=True, check=True)
        self.assertNotIn("inf", done.stdout.replace("info", ""))
        for axis in "xyz":
            self.assertIn(f"\n{axis}         no node\n", done.stdout)


if __name__ == "__main__":
    unittest.main()
