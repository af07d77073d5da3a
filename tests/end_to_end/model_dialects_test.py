#!/usr/bin/python3
"""model_dialects_test.py CURVISPLAT

NetCDF files as particular models and archives write them: CESM's POP, COSMO, MERRA-2, ERA5. model_files.py says how. Exit status 77
(skipped) without python3-netcdf4.
"""
import subprocess
import unittest

from model_files import PROGRAM, RADIUS, RANDOM, ModelFileTest, np, sphere, standard_altitude


def besides_bends(info):
    """The warnings but that of coarse cells on the sphere."""
    return [warning for warning in info["warnings"] if "below the sphere" not in warning]


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

    def test_the_further_dimension_is_proposed(self):
        """Not one of space, which would leave none of its levels."""
        for values in ([1, 2, 3], None):
            with self.file(depth=5, lat=8, lon=12, ens=3) as f:
                self.air(f)
                f.add("depth", "depth", np.arange(5.0), units="m", positive="down")
                if values:
                    f.add("ens", "ens", values, "i4", standard_name="realization")
                f.add("t", "depth lat lon ens", RANDOM.random((5, 8, 12, 3)), "f4")
            choice = "ens=1" if values else "ens=0"
            self.assertIn(f"such as --select {choice}", self.info(fails=True))
            self.info("file.nc", "--select", choice)


class Levels(ModelFileTest):
    """Vertical coordinates as programs write them, on T(lev, lat, lon)."""

    T = RANDOM.random((4, 8, 12)).astype("f4")
    LON, LAT = np.linspace(0, 33, 12), np.linspace(10, 31, 8)[:, None]

    def levels(self, name, values, more=None, **attributes):
        with self.file(lon=12, lat=8, time=None, **{name: 4}) as f:
            self.air(f)
            if values is not None:
                f.add(name, name, values, **attributes)
            f.add("T", f"{name} lat lon", self.T, "f4")
            if more:
                more(f)

    def expect_heights(self, kilometres, near=1e-3):
        info = self.info()
        self.expect(info, sphere(self.LON, self.LAT, np.broadcast_to(np.asarray(kilometres).reshape(-1, *np.shape(kilometres)[1:] or (1, 1)), (4, 8, 12))),
                    self.T, near=near)
        return info

    def test_pressures_of_sea_water(self):
        """Saunders' formula, at 45 degrees."""
        p = np.array([5.0, 100, 1000, 4000])
        for unit, values, attributes in (("dbar", p, {}), ("decibar", p, {}), ("Pa", 1e4 * p, {"standard_name": "sea_water_pressure"})):
            self.levels("lev", values, units=unit, positive="down", axis="Z", **attributes)
            self.expect_heights(-1e-3 * ((1 - (5.92 + 2.625) * 1e-3) * p - 2.21e-6 * p**2))

    def test_pressures_of_thin_air(self):
        """WACCM-X: by the table of the U.S. Standard Atmosphere, 1976."""
        self.levels("lev", [8.2130e-10, 8.4736e-7, 3.2011e-4, 1.8359e-3], units="hPa", positive="down")
        self.expect_heights([600, 200, 100, 90])
        # The tables of both atmospheres meet at 86 km.
        self.levels("lev", [0.37338, 0.37339, 10, 1000], units="Pa", positive="down")
        self.expect_heights([86, 86, standard_altitude(10.0), standard_altitude(1000.0)], near=0.05)

    def test_distances_from_the_centre_of_the_earth(self):
        self.levels("radius", [5.7e6, 5.9e6, 6.1e6, 6.3e6], units="meters")
        self.expect_heights(np.array([5700, 5900, 6100, 6300]) - RADIUS)

    def test_attributes_padded_with_blanks(self):
        """As Fortran writes a character(len=8); some with zeros."""
        for unit, positive in (("m       ", "down   "), ("  m", "down\t"), ("m\0\0\0", "down\0")):
            self.levels("depth", [5.0, 100, 1000, 4000], units=unit, positive=positive)
            self.expect_heights([-0.005, -0.1, -1, -4])
        self.levels("lev", [1000, 850, 500, 300], units="hPa ", positive="down  ")
        self.expect_heights(standard_altitude(np.array([1e5, 85000, 50000, 30000])))
        for unit, scale in (("[hPa]", 1), ("(mbar)", 1), ("100 Pa", 1), ("10 Pa", 10)):
            self.levels("lev", scale * np.array([1000, 850, 500, 300]), units=unit, positive="down")
            self.expect_heights(standard_altitude(np.array([1e5, 85000, 50000, 30000])))

    def test_lengths_that_nothing_calls_heights(self):
        for unit in ("m", "meters MSL", "m above sea level"):
            self.levels("lv_GPML8", [10.0, 500, 2000, 9000], units=unit)
            self.expect_heights([0.01, 0.5, 2, 9])

    def test_lengths_in_every_unit(self):
        for unit, metres in (("[m]", 1), ("(km)", 1000), ("dam", 10), ("dm", 0.1), ("hm", 100), ("mm", 1e-3), ("Mm", 1e6), ("1000 m", 1000),
                             ("1e3 m", 1000), ("100 km", 1e5), ("fathoms", 1.8288), ("decimeters", 0.1), ("hectometre", 100), ("m_above_MSL", 1)):
            self.levels("z", np.array([10.0, 500, 2000, 9000]) / metres, units=unit, positive="up")
            self.expect_heights([0.01, 0.5, 2, 9])

    def test_units_of_no_height(self):
        """Nobody is told to call them metres."""
        for unit in ("K", "GHz", "nm", "um", "yyyymmdd", "m s-1", "m2", "level", "dm3"):
            self.levels("z", [10.0, 500, 2000, 9000], units=unit, axis="Z")
            line = self.info(fails=True)
            self.assertIn(f"z has the unit '{unit}'; expected a length or a pressure: give heights of the levels", line)
            self.assertNotIn("ncatted", line)

    def test_sigma_is_no_length(self):
        for name, unit, values in (("sigma", None, [0.02, 0.3, 0.7, 0.997]), ("eta", "1", [1, 0.7, 0.3, 0.1]), ("z", None, [-0.9, -0.6, -0.3, 0])):
            self.levels(name, values, axis="Z", **({"units": unit} if unit else {}))
            self.assertIn("are no lengths, but those of a sigma or hybrid coordinate", self.info(fails=True))

    def test_negative_depths_that_grow_downwards(self):
        self.levels("depth", [-4000.0, -1000, -100, -5], units="m", positive="down", standard_name="depth")
        info = self.expect_heights([-4, -1, -0.1, -0.005])
        self.assertIn("depth is positive down, but its values are from -4000 to -5", info["warnings"][0])

    def test_depths_that_only_their_names_tell(self):
        for name, attributes in (("nav_lev", {}), ("st_ocean_depth", {}), ("zlev", {"axis": "Z", "long_name": "Depth of cell centres"})):
            self.levels(name, [5.0, 100, 1000, 4000], units="m", **attributes)
            self.expect_heights([-0.005, -0.1, -1, -4])

    def test_levels_of_the_soil_and_the_sea_lie_below(self):
        """CLM's levels of the ground, and others without `positive`, or with a wrong one."""
        sea, soil = "sea_water_potential_temperature", "soil_temperature"
        for name, values, field, attributes, words in (
                ("levgrnd", [0.01, 0.1, 1, 3], None, {"long_name": "coordinate ground levels"}, None),
                ("levsoi", [0.01, 0.1, 1, 3], None, {"long_name": "coordinate soil levels"}, None),
                ("layer", [0.01, 0.1, 1, 3], None, {"long_name": "soil layer depth", "axis": "Z"}, None),
                ("lev", [5, 50, 500, 5000], sea, {"long_name": "ocean depth", "axis": "Z"}, None),
                ("lev", [5, 50, 500, 5000], sea, {"axis": "Z"}, "lev has no attribute `positive`, but is a coordinate of T, below the surface"),
                ("lev", [0.01, 0.1, 1, 3], soil, {"positive": "up"}, "lev is positive up, but is a coordinate of T, below the surface"),
                ("depth", [0, 10, 20, 40], sea, {"positive": "up", "standard_name": "depth"}, "depth is positive up, but is a depth")):
            self.levels(name, values, lambda f: field and f["T"].setncattr("standard_name", field), units="m", **attributes)
            info = self.expect_heights(-1e-3 * np.array(values))
            self.assertEqual(len(besides_bends(info)), words is not None)
            self.assertIn(words or "", "".join(info["warnings"]))
        for attributes in ({"long_name": "height above ground level"}, {"standard_name": "height"}, {"long_name": "height above the bottom"}):
            self.levels("lev", [5, 50, 500, 5000], lambda f: f["T"].setncattr("standard_name", sea), units="m", **attributes)
            self.expect_heights([0.005, 0.05, 0.5, 5])

    def test_lengths_that_are_no_heights(self):
        for name, values, attributes in (
                ("wavelength", [4e-7, 5e-7, 6e-7, 7e-7], {"standard_name": "radiation_wavelength"}), ("size", [1e-6, 2e-6, 4e-6, 8e-6], {"long_name": "drop"}),
                ("band", [1, 2, 4, 8], {"long_name": "wavelength of the band"}), ("d", [0.01, 0.02, 0.03, 0.04], {"long_name": "hail diameter"}),
                ("radius", [1e-6, 2e-6, 4e-6, 8e-6], {}), ("rad", [1, 2, 4, 8], {})):
            self.levels(name, values, units="m", **attributes)
            self.assertIn(f"{name} is {values[0]:g} .. {values[-1]:g} m, which are no heights", self.info(fails=True))

    def test_levels_that_cannot_be(self):
        for name, values, attributes, words in (
                ("depth", [0, 10, 20, 1e20], {"units": "m", "positive": "down"}, "depth is 1e+20 at level 3, counted from 0, which is no height"),
                ("depth", [0, 10, 20, -9999], {"units": "m", "positive": "down"}, "depth is -9999 at level 3, counted from 0, but levels only rise or only fall"),
                ("lev", [-999, 850, 500, 300], {"units": "hPa"}, "lev is 500 at level 2, counted from 0, but levels only rise or only fall"),
                ("lev", [1e5, 85000, 50000, 30000], {"units": "hPa"}, "lev is 30000 .. 100000 hPa, more than the pressure of any air on the Earth"),
                ("depth", [0, 1, 2, 7e6], {"units": "m", "positive": "down"}, "depth is 0 .. 7e+06 m, below the Earth's centre"),
                ("z", [0, 0, 0, 0], {"units": "m", "axis": "Z"}, "z is 0 .. 0 m, which are no heights")):
            self.levels(name, values, **attributes)
            self.assertIn(words, self.info(fails=True))
        # A formula's: ap in Pa that is called hPa.
        def more(f):
            f.add("ap", "lev", [0, 1e4, 2e4, 0], units="hPa")
            f.add("b", "lev", [1, 0.7, 0.3, 0.1])
            f.add("ps", "lat lon", np.full((8, 12), 1e5), units="Pa")
        self.levels("lev", [4.0, 3, 2, 1], more, units="level")
        self.assertIn("the pressures of formula of ap and b (pressure, at heights of the standard atmosphere) are more than those of any air", self.info(fails=True))
        # Of the nodes, some may have none.
        z = 1000 * np.arange(4.0)[:, None, None] + np.zeros((8, 12))
        self.levels("lev", None, lambda f: f.add("height", "lev lat lon", np.where(self.LON > 20, 1e20, z), units="m"))
        self.assertEqual(self.info()["blanked"]["not_finite"], 4 * 8 * (self.LON > 20).sum())

    def test_numbers_of_levels_come_after_metres(self):
        """ECCO's k beside Z(k); CDO's generalized height is no length."""
        z = [-5.0, -15, -25, -45]
        def more(f):
            f.add("Z", "k", z, units="m", positive="up", standard_name="depth")
        self.levels("k", np.arange(4), more, axis="Z", standard_name="z_grid_index", long_name="z-dimension of the t grid")
        self.assertEqual(besides_bends(self.expect_heights(1e-3 * np.array(z))), [])
        for name, attributes in (("k", {"axis": "Z", "standard_name": "z_grid_index"}), ("height", {"standard_name": "height", "long_name": "generalized_height", "axis": "Z"})):
            self.levels(name, np.arange(4), **attributes)
            self.assertIn(f"{name} numbers the levels; expected a length or a pressure: give heights", self.info(fails=True))

    def test_a_formula_of_a_coordinate_beside_the_numbers_of_levels(self):
        """As iris writes the hybrid heights of the Unified Model; the ground may be in another file under another name."""
        z, sigma, ground = np.array([20.0, 1000, 5000, 20000]), np.array([0.99, 0.8, 0.3, 0]), 2000 * RANDOM.random((8, 12))
        for name in ("surface_altitude", "orog"):
            def more(f):
                f.add("level_height", "model_level_number", z, units="m", positive="up", standard_name="atmosphere_hybrid_height_coordinate",
                      formula_terms="a: level_height b: sigma orog: surface_altitude")
                f.add("sigma", "model_level_number", sigma, units="1")
                f.add(name, "lat lon", ground, units="m", standard_name="surface_altitude")
                f["T"].coordinates = "level_height sigma surface_altitude"
            self.levels("model_level_number", np.arange(1, 5), more, units="1", positive="up", axis="Z", standard_name="model_level_number")
            self.expect_heights(1e-3 * (z[:, None, None] + sigma[:, None, None] * ground))
        def lacking(f):
            f["lev"].formula_terms = "a: lev b: sigma orog: ground"
        self.levels("lev", z, lacking, units="m", positive="up", standard_name="atmosphere_hybrid_height_coordinate")
        self.assertIn("has no term 'b' on these dimensions; its nominal heights are taken", "".join(self.expect_heights(1e-3 * z)["warnings"]))

    def test_roms_without_attributes(self):
        """Equations of Vtransform 1 and 2 of ROMS' manual."""
        h, zeta, hc = 100 + 900 * RANDOM.random((8, 12)), RANDOM.random((8, 12)), 50.0
        s, c = np.linspace(-0.9, -0.1, 4), np.linspace(-0.95, -0.02, 4) ** 3
        S, C = s[:, None, None], c[:, None, None]
        for transform in (1, 2, None):
            def more(f):
                f.add("Cs_r", "s_rho", c)
                f.add("h", "lat lon", h)
                f.add("zeta", "lat lon", zeta)
                f.add("hc", "", hc)
                if transform:
                    f.add("Vtransform", "", transform, "i4")
            self.levels("s_rho", s, more)
            z0 = hc * S + (h - hc) * C
            heights = zeta + (zeta + h) * (hc * S + h * C) / (hc + h) if transform == 2 else z0 + zeta * (1 + z0 / h)
            self.expect_heights(1e-3 * heights)

    def test_hybrid_pressures_by_the_names_of_their_terms(self):
        a, b, ground = np.array([0.02, 0.1, 0.2, 0]), np.array([0, 0.05, 0.3, 1]), 95000 + 6000 * RANDOM.random((8, 12))
        for unit, names in (("1", ("hyam", "hybm", "PS")), ("Pa", ("ap", "b", "aps"))):
            def more(f):
                f.add(names[0], "lev", a * (1e5 if unit == "Pa" else 1), units=unit)
                f.add(names[1], "lev", b)
                f.add(names[2], "lat lon", ground, units="Pa")
            self.levels("lev", [20.0, 100, 500, 1000], more, units="level", positive="down")
            self.expect_heights(standard_altitude(1e5 * a[:, None, None] + b[:, None, None] * ground))

    def test_the_logarithm_of_the_surface_pressure(self):
        """The ECMWF's levels: lnsp, as a field of one level."""
        a, b, ground = np.array([2000.0, 9000, 8000, 0]), np.array([0, 0.1, 0.6, 1]), 95000 + 6000 * RANDOM.random((8, 12))
        for attributes in ({"standard_name": "atmosphere_hybrid_sigma_pressure_coordinate", "formula_terms": "ap: hyam b: hybm ps: lnsp"}, {}):
            def more(f):
                f.createDimension("lev_2", 1)
                f.add("hyam", "lev", a, units="Pa")
                f.add("hybm", "lev", b)
                f.add("lnsp", "lev_2 lat lon", np.log(ground)[None], long_name="Logarithm of surface pressure")
            self.levels("lev", [1.0, 2, 3, 4], more, units="level", positive="down", **attributes)
            self.expect_heights(standard_altitude(a[:, None, None] + b[:, None, None] * ground))

    def test_hybrid_terms_between_the_levels(self):
        """GFDL: pk and bk are those of half levels; FV3's ak and bk are attributes of the file."""
        a, b, ground = np.array([5e3, 2e4, 1.5e4, 1e3, 0]), np.array([0, 0.1, 0.5, 0.8, 1]), 70000 + 30000 * RANDOM.random((8, 12))
        middle = [((x[1:] + x[:-1]) / 2)[:, None, None] for x in (a, b)]
        for form in ("variables", "attributes"):
            def more(f):
                if form == "variables":
                    f.createDimension("phalf", 5)
                    f.add("pk", "phalf", a, units="pascal")
                    f.add("bk", "phalf", b)
                    f.add("phalf", "phalf", [50.0, 300, 600, 850, 1000], units="mb")
                else:
                    f.ak, f.bk = a, b
                f.add("ps", "lat lon", ground, units="Pa")
            self.levels("pfull", [100.0, 400, 700, 900], more, units="mb", positive="down", edges="phalf")
            info = self.expect_heights(standard_altitude(middle[0] + middle[1] * ground))
            self.assertIn("formula of", info["format"])
        def more(f):
            for name, values in (("hyam", [0.02, 0.1, 0.2, 0]), ("hybm", [0, 0.05, 0.3, 1])):
                f.add(name, "lev", values)
        self.levels("lev", [20.0, 150, 500, 1000], more, units="hPa", positive="down")
        self.assertEqual(besides_bends(self.info()), ["there are hyam and hybm, but no surface pressure (ps); the nominal pressures are taken"])

    def test_terms_that_are_attributes_of_the_file(self):
        """CROCO's sc_r, Cs_r and hc. What a formula lacks is named, not a unit that makes metres of it."""
        h, zeta, hc, s = 100 + 900 * RANDOM.random((8, 12)), RANDOM.random((8, 12)), 50.0, np.linspace(-0.9, -0.1, 4)
        for name in ("ocean_s_coordinate_g2", "ocean_s_coordinate"):
            def more(f):
                f.sc_r, f.Cs_r, f.hc, f.VertCoordType = s, s**3, hc, "NEW"
                f.add("h", "lat lon", h, units="meter")
                f.add("zeta", "lat lon", zeta, units="meter")
            attributes = {"axis": "Z", "positive": "up", "standard_name": name, "formula_terms": "s: sc_r C: Cs_r eta: zeta depth: h depth_c: hc"}
            self.levels("s_rho", s, more, **attributes)
            S = s[:, None, None]
            self.expect_heights(1e-3 * (zeta + (zeta + h) * (hc * S + h * S**3) / (hc + h)))
        self.levels("s_rho", s, **attributes)
        line = self.info(fails=True)
        self.assertIn("the formula of s_rho has no term 's' on these dimensions", line)
        self.assertNotIn("ncatted", line)

    def test_hybrid_terms_with_the_unit_of_a_pressure(self):
        """GEOS-Chem: hyam is in hPa and is called a; P0 is 1000 hPa."""
        a, b, ground = np.array([0, 10.0, 50, 100]), np.array([0.99, 0.89, 0.65, 0]), 950 + 60 * RANDOM.random((8, 12))
        def more(f):
            for name, dims, values in (("hyam", "lev", a), ("hybm", "lev", b), ("P0", "", 1000.0), ("PS", "lat lon", ground)):
                f.add(name, dims, values, units="1" if name == "hybm" else "hPa")
        self.levels("lev", [0.99, 0.9, 0.7, 0.1], more, units="level", positive="up", axis="Z",
                    standard_name="atmosphere_hybrid_sigma_pressure_coordinate", formula_terms="a: hyam b: hybm p0: P0 ps: PS")
        self.expect_heights(standard_altitude(100 * (a[:, None, None] + b[:, None, None] * ground)))

    def test_heights_and_pressures_of_nodes_beside_numbered_levels(self):
        """WRF's met_em."""
        ght = 1000 * RANDOM.random((4, 8, 12)) + np.array([0, 3000, 6000, 9000])[:, None, None]
        self.levels("num_metgrid_levels", None, lambda f: f.add("GHT", "num_metgrid_levels lat lon", ght, units="meters MSL"))
        self.expect_heights(1e-3 * ght)
        self.levels("num_metgrid_levels", None, lambda f: f.add("PRES", "num_metgrid_levels lat lon", 1e5 - 8 * ght, units="Pa"))
        self.expect_heights(standard_altitude(1e5 - 8 * ght))
        # GETM's, and WRF's pressure of which the geopotential was not written.
        self.levels("level", [1, 2, 3, 4], lambda f: f.add("zc", "level lat lon", -ght[::-1], units="m", long_name="z-coordinate at layer centers"), units="level")
        self.expect_heights(-1e-3 * ght[::-1])
        def more(f):
            for name, values in (("P", 100 - ght), ("PB", 1e5 - 7 * ght)):
                f.add(name, "bottom_top lat lon", values, units="Pa")
        self.levels("bottom_top", None, more)
        self.expect_heights(standard_altitude(100100 - 8 * ght))
        # Both come before the fields in the file, and after them in the list.
        with self.file(lon=12, lat=8, time=None, num_metgrid_levels=4) as f:
            self.air(f)
            for name, values, unit in (("PRES", 1e5 - 8 * ght, "Pa"), ("GHT", ght, "meters MSL"), ("TT", self.T, "K")):
                f.add(name, "num_metgrid_levels lat lon", values, units=unit)
        self.assertEqual([scalar["name"] for scalar in self.info()["scalars"]], ["TT", "PRES", "GHT"])
        # Its first level is the ground's, which lies above the next ones in mountains: its nodes are not drawn.
        ground = ght.copy()
        ground[0] = ght[1] + 500 * (self.LON > 20)
        self.levels("num_metgrid_levels", None, lambda f: f.add("GHT", "num_metgrid_levels lat lon", ground, units="meters MSL"))
        info = self.info()
        self.assertIn("the first level of num_metgrid_levels is that of the ground, above others; it is left out", info["warnings"])
        self.assertEqual(info["cells"]["inverted"], 0)
        self.assertEqual(info["blanked"]["by_grid"], 96)


class Places(ModelFileTest):
    def test_places_that_are_not_on_the_earth(self):
        """Fill values that no attribute names; what is left stays where it is."""
        lon, lat = np.meshgrid(10.0 + 2 * np.arange(16), 60.0 + np.arange(10))
        hole = (np.arange(16) < 4) & (np.arange(10)[:, None] < 3)
        for fill in (-999, 1e20, -9999):
            with self.file(x=16, y=10, lev=3) as f:
                f.add("lon", "y x", np.where(hole, fill, lon), units="degrees_east")
                f.add("lat", "y x", np.where(hole, fill, lat), units="degrees_north")
                f.add("lev", "lev", [0, 1000, 3000], units="m", positive="up")
                f.add("t", "lev y x", RANDOM.random((3, 10, 16)), "f4", coordinates="lon lat")
            info = self.info()
            self.assertEqual(info["blanked"]["not_finite"], 36)
            places = sphere(lon, lat, np.array([0, 1, 3])[:, None, None])[:, ~hole]
            np.testing.assert_allclose(info["bounds"]["upper"], places.reshape(-1, 3).max(0), atol=1e-3)
            np.testing.assert_allclose(info["bounds"]["lower"], places.reshape(-1, 3).min(0), atol=1e-3)

    def test_many_nodes_at_one_place(self):
        """NEMO: 0, 0 where a processor would have had land alone."""
        lon, lat = np.meshgrid(10.0 + np.arange(16), 40.0 + np.arange(10))
        hole = (np.arange(16) >= 8) & (np.arange(10)[:, None] < 4)
        t = RANDOM.random((3, 10, 16)).astype("f4")
        for place in (0, -1):
            with self.file(x=16, y=10, deptht=3) as f:
                f.add("nav_lon", "y x", np.where(hole, place, lon), units="degrees_east")
                f.add("nav_lat", "y x", np.where(hole, place, lat), units="degrees_north")
                f.add("deptht", "deptht", [5, 50, 500], units="m", positive="down")
                f.add("thetao", "deptht y x", np.where(hole, 0, t), "f4", coordinates="nav_lon nav_lat")
            info = self.info()
            self.assertEqual(info["blanked"]["not_finite"], 3 * hole.sum())
            self.assertEqual((info["cells"]["degenerate"], info["cells"]["inverted"]), (0, 0))
            self.assertIn(f"nav_lon and nav_lat are {place} and {place} at neighbouring nodes", info["warnings"][0])
            places = sphere(lon, lat, -np.array([0.005, 0.05, 0.5])[:, None, None])[:, ~hole].reshape(-1, 3)
            np.testing.assert_allclose(info["bounds"]["upper"], places.max(0), atol=1e-3)
            np.testing.assert_allclose(info["bounds"]["lower"], places.min(0), atol=1e-3)

    def test_degrees_from_a_pole(self):
        for rows in (8, 30):
            with self.file(lon=12, lat=rows, lev=3) as f:
                f.add("lon", "lon", 30.0 * np.arange(12), units="degrees_east")
                f.add("lat", "lat", np.linspace(5, 175, rows), units="degrees_north")
                f.add("lev", "lev", [0, 1000, 3000], units="m", positive="up")
                f.add("t", "lev lat lon", np.ones((3, rows, 12)), "f4")
            self.assertIn("lat is 5 .. 175, which are degrees from a pole; expected degrees_north", self.info(fails=True))

    def test_degrees_and_radians(self):
        """DYNAMICO's and ICON's angles; x and y that only their long_name calls longitude and latitude."""
        t = RANDOM.random((3, 8, 12)).astype("f4")
        lon, lat = np.meshgrid(10.0 + np.arange(12), 40.0 + np.arange(8))
        for unit, dims, standard in (("radian", 1, True), ("radians", 2, True), ("rad", 1, False), ("degrees", 1, False), ("degree", 2, False)):
            scale = np.pi / 180 if unit.startswith("rad") else 1
            with self.file(x=12, y=8, lev=3) as f:
                for name, long_name, values, alone in (("x", "longitude", lon, lon[0]), ("y", "latitude", lat, lat[:, 0])):
                    called = {"standard_name": long_name} if standard else {"long_name": long_name + " of the centre"}
                    f.add(name if dims == 1 else "c" + name, name if dims == 1 else "y x", scale * (alone if dims == 1 else values), units=unit, **called)
                f.add("lev", "lev", [0, 1000, 3000], units="m", positive="up")
                f.add("t", "lev y x", t, "f4", coordinates="x y" if dims == 1 else "cx cy")
            self.expect(self.info(), sphere(lon, lat, np.array([0, 1, 3])[:, None, None]), t)

    def test_degrees_west(self):
        """Files that have this unit count to the east all the same: their longitudes are negative in the west."""
        t = RANDOM.random((3, 8, 12)).astype("f4")
        lon, lat = -20.0 + np.arange(12), 40.0 + np.arange(8)
        with self.file(lon=12, lat=8, lev=3) as f:
            f.add("lon", "lon", lon, units="degrees_west", standard_name="longitude")
            f.add("lat", "lat", lat, units="degrees_west", standard_name="latitude")
            f.add("lev", "lev", [0, 1000, 3000], units="m", positive="up")
            f.add("t", "lev lat lon", t, "f4")
        told = self.info()
        self.expect(told, sphere(*np.meshgrid(lon, lat), np.array([0, 1, 3])[:, None, None]), t)
        self.assertIn("lon has the unit 'degrees_west', and is read as degrees east; if it counts to the west, change its sign "
                      "(ncap2 -s 'lon=-lon' IN OUT)", told["warnings"])

    def test_places_in_a_unit_of_no_length(self):
        for unit in ("rad", "pixel"):
            with self.file(x=12, y=8, z=3) as f:
                for name, count in (("x", 12), ("y", 8)):
                    f.add(name, name, 0.5 * np.arange(count), units=unit, standard_name=f"projection_{name}_coordinate")
                f.add("z", "z", [0, 1000, 3000], units="m", positive="up")
                f.add("t", "z y x", RANDOM.random((3, 8, 12)), "f4")
            self.assertIn(f"x and y have the unit '{unit}', which is no length; metres are assumed", self.info()["warnings"])

    def test_idealised_runs(self):
        """WRF: XLAT and XLONG are 0, or metres with the unit of degrees; DX and DY are the distances of the nodes."""
        x, y = np.meshgrid(2000.0 * np.arange(12), 3000.0 * np.arange(8))
        for east, north, spacing in ((0 * x, 0 * y, True), (x, y, True), (x, y, False)):
            with self.file(west_east=12, south_north=8, bottom_top=4, Time=None) as f:
                if spacing:
                    f.DX, f.DY = 2000.0, 3000.0
                f.add("XLONG", "Time south_north west_east", east[None], units="degree_east")
                f.add("XLAT", "Time south_north west_east", north[None], units="degree_north")
                f.add("Z", "Time bottom_top south_north west_east", (np.arange(4)[:, None, None] * 500 + 0 * x)[None], units="m", positive="up")
                f.add("T", "Time bottom_top south_north west_east", RANDOM.random((1, 4, 8, 12)), "f4")
            if spacing:
                info = self.info()
                np.testing.assert_allclose(info["bounds"]["upper"], [22, 21, 1.5])
                self.assertIn("which are no longitudes and latitudes of a grid in degrees", "".join(info["warnings"]))
            else:
                self.assertIn("XLONG is 0 .. 22000 and XLAT is 0 .. 21000, which are no longitudes", self.info(fails=True))

    def test_numbers_that_are_text(self):
        """missing_value = "-999", scale_factor = "0.5": as scripts write that take every attribute for text."""
        t = RANDOM.integers(0, 100, (3, 8, 12))
        hole = RANDOM.random(t.shape) < 0.2
        for attributes in ({"missing_value": "-999"}, {"missing_value": "-999.0f"}, {"valid_range": "0, 100"}, {"valid_min": "0"}):
            with self.file(lon=12, lat=8, lev=3) as f:
                lon, lat = self.air(f)
                f.add("lev", "lev", [0, 1000, 3000], units="m", positive="up")
                f.add("T", "lev lat lon", np.where(hole, -999, t), "i2", scale_factor="0.5", **attributes)
            self.expect(self.info(), sphere(lon, lat, np.array([0, 1, 3])[:, None, None]), np.where(hole, np.nan, t / 2))

    def test_axes_without_units(self):
        for names, attributes in (("x y z", {"units": "1"}), ("x1 x2 x3", {}), ("xh y z", {}), ("xc yc zc", {}), ("a b c", {"units": "-"})):
            with self.file(**{name: n for name, n in zip(names.split(), (12, 8, 4))}) as f:
                for n, name, axis in zip((12, 8, 4), names.split(), "XYZ"):
                    f.add(name, name, 500.0 * np.arange(n), **attributes, **({"axis": axis} if attributes or name == "x1" else {}))
                f.add("rho", " ".join(names.split()[::-1]), RANDOM.random((4, 8, 12)), "f4")
            info = self.info()
            np.testing.assert_allclose(info["bounds"]["upper"], [5.5, 3.5, 1.5])
            self.assertIn("metres are assumed", "".join(info["warnings"]))
        # `convert` prints what `info` warns of.
        done = subprocess.run([PROGRAM, "convert", str(self.folder / "file.nc"), "-o", str(self.folder / "a.splats")], capture_output=True,
                              text=True, check=False)
        self.assertEqual([done.stderr.count(line) for line in info["warnings"]], [1, 1], done.stderr)

    def test_the_nearest_variable_is_named(self):
        with self.file(ncells=8, nv=3, depth=3, time=1) as f:
            for name, unit in (("clon", "longitude"), ("clat", "latitude")):
                f.add(name, "ncells", np.arange(8), units="radian", standard_name=unit, bounds=name + "_vertices")
                f.add(name + "_vertices", "ncells nv", np.zeros((8, 3)))
            f.add("depth", "depth", [10, 30, 50], units="m", positive="down")
            f.add("time", "time", 0, units="days since 2000-01-01")
            f.add("S", "time depth ncells", np.zeros((1, 3, 8)), "f4", coordinates="clon clat")
        line = self.info(fails=True)
        self.assertIn("S has 2 (depth, ncells), the cells of an unstructured map: give the grid file that has their faces", line)


    def test_what_a_message_must_not_say(self):
        """Maps of two dimensions whose coordinates have other names than they (NCL); forecasts by lead time; MPAS' bare mesh."""
        with self.file(time=2, latitude=4, longitude=5) as f:
            f.add("time", "time", [1, 2], units="Month")
            f.add("lat", "latitude", np.arange(4), units="degrees_north")
            f.add("lon", "longitude", np.arange(5), units="degrees_east")
            f.add("sst", "time latitude longitude", np.zeros((2, 4, 5)), "f4")
        line = self.info(fails=True)
        self.assertIn("sst has 2 (latitude, longitude)", line)
        self.assertNotIn("unstructured", line)
        with self.file(frtime=3, level=4, lat=5, lon=6) as f:
            f.add("frtime", "frtime", [0, 12, 24], units="hours")
            f.add("level", "level", [1000, 850, 500, 100], units="hPa")
            f.add("lat", "lat", np.arange(5), units="degrees_north")
            f.add("lon", "lon", np.arange(6), units="degrees_east")
            f.add("T", "frtime level lat lon", np.ones((3, 4, 5, 6)), "f4")
            f.add("Psl", "frtime lat lon", np.ones((3, 5, 6)), "f4")
        self.assertNotIn("expected a length", "".join(self.info()["warnings"]))
        with self.file(nCells=4, nVertices=6, maxEdges=3, vertexDegree=3) as f:
            for place, of in (("Cell", "nCells"), ("Vertex", "nVertices")):
                for name in ("lon", "lat"):
                    f.add(name + place, of, np.linspace(0, 1, 4 if of == "nCells" else 6))
            f.add("verticesOnCell", "nCells maxEdges", np.ones((4, 3)), "i4")
            f.add("nEdgesOnCell", "nCells", [3] * 4, "i4")
            f.add("kiteAreasOnVertex", "nVertices vertexDegree", np.ones((6, 3)))
        self.assertIn("a grid of MPAS, and no scalar lies at its faces or nodes; give the file with its scalars before it", self.info(fails=True))


class Fields(ModelFileTest):
    """Which variables are taken where none is asked for."""

    def test_a_mesh_file_beside_the_data(self):
        """NEMO: mesh_mask.nc has more variables of three dimensions than the data, on levels of another name, and masks of them."""
        t, mask = RANDOM.random((3, 8, 12)).astype("f4"), RANDOM.random((3, 8, 12)) < 0.7
        mask[0] |= mask[1:].any(0)
        lon, lat = np.meshgrid(np.linspace(0, 33, 12), np.linspace(10, 31, 8))
        depths = np.array([5.0, 50, 500])
        with self.file("data.nc", time_counter=None, deptht=3, y=8, x=12) as f:
            f.add("nav_lon", "y x", lon, units="degrees_east")
            f.add("nav_lat", "y x", lat, units="degrees_north")
            f.add("deptht", "deptht", depths, units="m", positive="down")
            f.add("votemper", "time_counter deptht y x", t[None], "f4", coordinates="nav_lon nav_lat")
        with self.file("mesh_mask.nc", t=1, nav_lev=3, y=8, x=12) as f:
            f.add("nav_lon", "y x", lon, units="degrees_east")
            f.add("nav_lat", "y x", lat, units="degrees_north")
            f.add("nav_lev", "nav_lev", depths, units="m")
            f.add("tmaskutil", "t y x", mask[:1], "i1")
            for name in ("tmask", "umask", "vmask"):
                f.add(name, "t nav_lev y x", mask[None], "i1")
            for name in ("e3t_0", "e3u_0", "e3v_0", "e3w_0", "gdept_0", "gdepw_0"):
                f.add(name, "t nav_lev y x", np.ones((1, 3, 8, 12)) * depths[:, None, None], units="m")
        info = self.info("data.nc", "mesh_mask.nc")
        self.assertEqual(info["scalars"][0]["name"], "votemper")
        self.assertIn("tmask is 0", info["blanking"])
        self.expect(info, sphere(lon, lat, -1e-3 * depths[:, None, None]), np.where(mask, t, np.nan))

    def test_sizes_of_cells_and_flags_come_last(self):
        """CMIP's Omon files, and a region before the temperature."""
        region = {"standard_name": "region", "flag_values": np.array([1, 2], "i4"), "flag_meanings": "atlantic pacific"}
        for attributes in ({"standard_name": "cell_thickness", "units": "m"}, {"standard_name": "ocean_volume", "units": "m3"}, {"long_name": "Cell Thickness", "units": "m"}, region,
                           {"flag_masks": np.array([1, 2], "i4"), "flag_meanings": "bad good"}, {"standard_name": "sea_water_temperature status_flag"}):
            with self.file(depth=3, lat=8, lon=12) as f:
                self.air(f)
                f.add("depth", "depth", [5.0, 50, 500], units="m", positive="down")
                f.add("a", "depth lat lon", RANDOM.integers(1, 3, (3, 8, 12)), "i4", **attributes)
                f.add("thetao", "depth lat lon", RANDOM.random((3, 8, 12)), "f4", standard_name="sea_water_potential_temperature")
            self.assertEqual([s["name"] for s in self.info()["scalars"]], ["thetao", "a"])

    def test_what_heights_are_made_of_is_no_field(self):
        """WRF: PH and PHB are on more points than T."""
        z = np.linspace(0, 5000, 5)[:, None, None] + np.zeros((8, 12))
        lon, lat = np.meshgrid(np.linspace(0, 11, 12), np.linspace(40, 47, 8))
        with self.file(Time=None, bottom_top=4, bottom_top_stag=5, south_north=8, west_east=12) as f:
            f.add("XLONG", "Time south_north west_east", lon[None], units="degree_east")
            f.add("XLAT", "Time south_north west_east", lat[None], units="degree_north")
            for name, part in (("PH", 0.1), ("PHB", 0.9)):
                f.add(name, "Time bottom_top_stag south_north west_east", 9.81 * part * z[None], "f4", units="m2 s-2")
            f.add("T", "Time bottom_top south_north west_east", RANDOM.random((1, 4, 8, 12)), "f4", units="K")
        info = self.info()
        self.assertEqual([s["name"] for s in info["scalars"]], ["T"])

    def test_times_have_the_digits_that_tell_steps_apart(self):
        with self.file(lon=12, lat=8, lev=3, time=4) as f:
            self.air(f)
            f.add("lev", "lev", [0, 1000, 3000], units="m", positive="up")
            f.add("time", "time", 2459300.5 + np.arange(4) / 24, units="days since -4713-01-01")
            f.add("T", "time lev lat lon", RANDOM.random((4, 3, 8, 12)), "f4")
        done = subprocess.run([PROGRAM, "convert", self.folder / "file.nc", "-o", self.folder / "s.splats"], check=True, capture_output=True, text=True)
        self.assertIn("4 time steps from 2459300.5 to 2459300.62", done.stderr)

    def test_months_and_members_are_steps(self):
        t = RANDOM.random((5, 3, 8, 12)).astype("f4")
        for name, values, times in (("month", [1, 2, 3, 4, 5], [1, 2, 3, 4, 5]), ("member", None, [0, 1, 2, 3, 4]), ("region", [3, 1, 4, 1, 5], [0, 1, 2, 3, 4])):
            for time in ("", "time "):
                with self.file(lon=12, lat=8, lev=3, time=1, **{name: 5}) as f:
                    lon, lat = self.air(f)
                    f.add("lev", "lev", [0, 1000, 3000], units="m", positive="up")
                    f.add("time", "time", [0], units="days since 2000-01-01")
                    if values:
                        f.add(name, name, values, "i4")
                    f.add("T", f"{time}{name} lev lat lon", t[None] if time else t, "f4")
                info = self.info("file.nc", "--time-step", "3")
                self.assertEqual(info["times"], times)
                self.assertIn(f"the steps are the 5 values of {name}", info["notes"])
                self.expect(info, sphere(lon, lat, np.array([0, 1, 3])[:, None, None]), t[3])


if __name__ == "__main__":
    unittest.main()
