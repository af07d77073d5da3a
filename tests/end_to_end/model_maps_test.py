#!/usr/bin/python3
"""model_maps_test.py CURVISPLAT

NetCDF files as models and their tools write them: map projections, planes, grids that close around the Earth. model_files.py
says how. Exit status 77 (skipped) without python3-netcdf4.
"""
import unittest

from model_files import RADIUS, RANDOM, ModelFileTest, np, sphere, volume


class ModelMaps(ModelFileTest):
    # -- maps

    def test_a_rotated_pole(self):
        rlon, rlat, t = np.linspace(-10, 12, 12), np.linspace(-8, 8, 8), RANDOM.random((3, 8, 12)).astype("f4")
        for turn in (0.0, 20.0):
            with self.file(rlon=12, rlat=8, height=3) as f:
                f.add("rlon", "rlon", rlon, units="degrees", standard_name="grid_longitude")
                f.add("rlat", "rlat", rlat, units="degrees", standard_name="grid_latitude")
                f.add("height", "height", [10.0, 1000, 5000], units="m", positive="up")
                f.add("rotated_pole", "", 0, "i4", grid_mapping_name="rotated_latitude_longitude",
                      grid_north_pole_latitude=39.25, grid_north_pole_longitude=-162.0, north_pole_grid_longitude=turn)
                f.add("T", "height rlat rlon", t, "f4", grid_mapping="rotated_pole")
            # The grid's sphere is turned about its axis, tilted until its pole stands at the pole's latitude, and turned
            # to the pole's longitude.
            at = sphere(rlon - turn, rlat[:, None], 1e-3 * np.array([10.0, 1000, 5000])[:, None, None])
            tilt, around = np.radians(90 - 39.25), np.radians(-162.0)
            y = np.array([[np.cos(tilt), 0, np.sin(tilt)], [0, 1, 0], [-np.sin(tilt), 0, np.cos(tilt)]])
            z = np.array([[np.cos(around), -np.sin(around), 0], [np.sin(around), np.cos(around), 0], [0, 0, 1]])
            half = np.diag([-1.0, -1.0, 1.0])  # grid longitude 0 is the meridian that points away from the pole
            self.expect(self.info(), at @ half.T @ y.T @ z.T, t)

    def test_lambert_and_stereographic_maps(self):
        x, y, t = np.arange(12) * 1e5 - 5e5, np.arange(8) * 1e5 - 4e5, RANDOM.random((3, 8, 12)).astype("f4")
        metres = RADIUS * 1e3
        north, n = y[:, None], np.sin(np.radians(45))
        # A cone that touches the sphere at 45 degrees north; the plane that touches it at the pole.
        rho0 = metres / np.tan(np.radians(45))
        rho = np.hypot(x, rho0 - north)
        cone = (10 + np.degrees(np.arctan2(x, rho0 - north)) / n,
                np.degrees(2 * np.arctan((rho0 / rho) ** (1 / n) * np.tan(np.radians(67.5))) - np.pi / 2))
        pole = (-45 + np.degrees(np.arctan2(x, -north)), 90 - 2 * np.degrees(np.arctan(np.hypot(x, north) / (2 * metres))))
        cases = [
            ({"grid_mapping_name": "lambert_conformal_conic", "standard_parallel": 45.0,
              "longitude_of_central_meridian": 10.0, "latitude_of_projection_origin": 45.0}, cone),
            ({"grid_mapping_name": "polar_stereographic", "straight_vertical_longitude_from_pole": -45.0,
              "latitude_of_projection_origin": 90.0, "scale_factor_at_projection_origin": 1.0}, pole),
        ]
        for mapping, (lon, lat) in cases:
            for unit, scale in (("m", 1), ("km", 1e-3)):
                with self.subTest(mapping["grid_mapping_name"], unit=unit):
                    with self.file(x=12, y=8, z=3) as f:
                        f.add("x", "x", x * scale, units=unit, standard_name="projection_x_coordinate")
                        f.add("y", "y", y * scale, units=unit, standard_name="projection_y_coordinate")
                        f.add("z", "z", [10.0, 1000, 5000], units="m", standard_name="height")
                        f.add("crs", "", 0, "i4", earth_radius=metres, **mapping)
                        f.add("T", "z y x", t, "f4", grid_mapping="crs")
                    height = 1e-3 * np.array([10.0, 1000, 5000])[:, None, None]
                    self.expect(self.info(), sphere(lon, lat, height), t)
                    flat = np.stack(np.broadcast_arrays(1e-3 * x, 1e-3 * north, height), -1)
                    self.expect(self.info("file.nc", "--flat"), flat, t)

    def test_a_projection_that_is_not_known(self):
        with self.file(rlon=12, rlat=8, height=3) as f:
            f.add("rlon", "rlon", np.arange(12.0), units="degrees", standard_name="grid_longitude")
            f.add("rlat", "rlat", np.arange(8.0), units="degrees", standard_name="grid_latitude")
            f.add("height", "height", [10.0, 1000, 5000], units="m", positive="up")
            f.add("T", "height rlat rlon", RANDOM.random((3, 8, 12)), "f4")
        self.assertIn("degrees from a rotated pole, but no grid_mapping", self.info("file.nc", fails=True))

    # -- dimensions

    def test_planes_and_indices(self):
        t = RANDOM.random((3, 8, 12)).astype("f4")
        i, j, k = np.arange(12.0), np.arange(8.0)[:, None], np.arange(3.0)[:, None, None]
        with self.file(x=12, y=8, z=3) as f:
            f.add("x", "x", i, units="km", standard_name="plane_x_coordinate")
            f.add("y", "y", j[:, 0], units="km", standard_name="plane_y_coordinate")
            f.add("z", "z", k[:, 0, 0], units="km", standard_name="height")
            f.add("T", "z y x", t, "f4")
        places = np.stack(np.broadcast_arrays(i, j, k), -1)
        self.expect(self.info(), places, t)
        with self.file(a=12, b=8, c=3) as f:
            f.add("T", "c b a", t, "f4")
        info = self.info()
        self.expect(info, places, t)
        self.assertIn("have no coordinates", " ".join(info["warnings"]))
        with self.file(a=12, b=8, c=3) as f:
            f.DX, f.DY = 2000.0, 4000.0
            f.add("z", "c", 500 * k[:, 0, 0], units="m", standard_name="height")
            f.add("T", "c b a", t, "f4")
        self.expect(self.info(), np.stack(np.broadcast_arrays(2 * i, 4 * j, 0.5 * k), -1), t)

    def test_an_unlimited_dimension_that_is_not_time(self):
        t = RANDOM.random((3, 8, 12)).astype("f4")
        with self.file(lon=12, lat=8, height=None) as f:
            lon, lat = self.air(f)
            f.add("height", "height", [10.0, 1000, 5000], units="m", positive="up")
            f.add("T", "height lat lon", t, "f4")
        info = self.info()
        self.expect(info, sphere(lon, lat, 1e-3 * np.array([10.0, 1000, 5000])[:, None, None]), t)
        self.assertEqual(info["times"], [])

    # -- around the Earth

    def globe(self, lon, lat, t, **attributes):
        """Writes two levels of a grid with longitudes and latitudes of every column."""
        nj, ni = lon.shape
        with self.file(x=ni, y=nj, z=2) as f:
            f.add("lon", "y x", lon, units="degrees_east")
            f.add("lat", "y x", lat, units="degrees_north")
            f.add("z", "z", [0.0, 100e3], units="m", standard_name="height")
            f.add("t", "z y x", t, "f4", **attributes)
        return self.info()

    def test_global_longitude_closes(self):
        lat, height = np.linspace(-80, 80, 41), np.array([0, 100.0])[:, None, None]
        for first, last in ((0, 355), (-177.5, 177.5), (2.5, 362.5), (0, 360), (180, -180)):
            with self.subTest(first):
                lon = np.linspace(first, last, 73 if (last - first) % 360 == 0 else 72)
                t = RANDOM.random((2, 41, len(lon))).astype("f4")
                if len(lon) == 73:
                    t[..., -1] = t[..., 0]
                info = self.globe(*np.meshgrid(lon, lat), t)
                whole = np.linspace(first, first + (360 if last > first else -360), 73)
                self.expect(info, sphere(whole, lat[:, None], height), np.concatenate([t, t[..., :1]], -1)[..., :73])
                self.assertEqual("closed around the Earth" in info["format"], len(lon) == 72)
        # Columns on both sides that repeat others, as NEMO's; and three quarters of the Earth.
        lon = np.arange(-5, 365, 5.0)
        t = RANDOM.random((2, 41, 72)).astype("f4")
        t = np.concatenate([t[..., -1:], t, t[..., :1]], -1)
        info = self.globe(*np.meshgrid(lon, lat), t)
        self.expect(info, sphere(lon[:-1], lat[:, None], height), t[..., :-1])
        info = self.globe(*np.meshgrid(np.arange(0, 270, 5.0), lat), t[..., :54])
        self.assertEqual(info["blocks"][0]["ni"], 54)

    def test_tripolar_grids_close_at_their_fold(self):
        # Confocal ellipses: their innermost row is a segment, whose two sides are the two halves of the fold.
        columns, rows, top = 48, 9, 1.2
        height = np.array([0, 100.0])[:, None, None]
        step = top / (rows - 1)

        def places(v, u):
            x, y = np.cosh(u)[:, None] * np.cos(v), np.sinh(u)[:, None] * np.sin(v)
            return np.degrees(np.arctan2(y, x)), 90 - 15 * np.hypot(x, y)

        at_points = 2 * np.pi * np.arange(columns) / columns
        between = at_points + np.pi / columns
        through_points = step * np.arange(rows - 1, -3, -1)
        through_edges = step * (np.arange(rows - 1, -2, -1) + 0.5)
        cases = {
            "through points": (at_points, through_points[:-2], 0),
            "through points, repeated": (at_points, through_points[:-1], 1),
            "through edges": (between, through_edges[:-1], -1),
            "through edges, repeated": (between, through_edges, 0),
        }
        for name, (v, u, dropped) in cases.items():
            for halo in (False, True):
                with self.subTest(name, halo=halo):
                    angle = np.concatenate([v[-1:], v, v[:1]]) if halo else v
                    t = RANDOM.random((2, len(u), len(angle))).astype("f4")
                    info = self.globe(*places(angle, u), t)
                    block = info["blocks"][0]
                    self.assertEqual((block["nj"], block["ni"]), (len(u) - dropped, columns + 1))
                    lon, lat = places(np.append(v, v[0]), np.linspace(u[0], 0, 60))
                    np.testing.assert_allclose(abs(block["volume"]), volume(sphere(lon, lat, height)), rtol=0.01)
                    hidden = columns + 1 - columns // 2 if "edges" in name else 0
                    self.assertIn(info["blanked"]["by_grid"], (2 * hidden, 2 * hidden - 2))
                    self.assertEqual("fold" in info["format"], name != "through points")


if __name__ == "__main__":
    unittest.main()
