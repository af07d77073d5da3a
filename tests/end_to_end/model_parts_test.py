#!/usr/bin/python3
"""model_parts_test.py CURVISPLAT

NetCDF files of which a part is read, and files that are parts of a map: one value of a further dimension (--select), and the files of
NEMO's and XIOS' processors. model_files.py says how. Exit status 77 (skipped) without python3-netcdf4.
"""
import json
import subprocess
import unittest

from model_files import PROGRAM, RANDOM, ModelFileTest, netCDF4, np, sphere


class Selection(ModelFileTest):
    def write(self, coordinate=None, name="month", count=4):
        """Two times, `count` months or the like, three levels: T, and heights of the nodes that differ from month to month."""
        self.t = RANDOM.random((2, count, 3, 8, 12)).astype("f4")
        self.heights = np.arange(3)[:, None, None] + 0.1 * RANDOM.random((count, 3, 8, 12))
        with self.file(time=None, lev=3, lat=8, lon=12, length=8, **{name: count}) as f:
            self.lon, self.lat = self.air(f)
            f.add("time", "time", [3.0, 5], units="days since 2000-01-01")
            f.add("z", f"{name} lev lat lon", self.heights, units="km", positive="up", standard_name="altitude")
            if coordinate is not None and isinstance(coordinate[0], str):
                f.createVariable(name, "S1", (name, "length"))[...] = [list(word.ljust(8, "\0")) for word in coordinate]
            elif coordinate is not None:
                f.add(name, name, coordinate, "f4")
            f.add("T", f"time {name} lev lat lon", self.t, "f4", units="K", coordinates="z")

    def expect_member(self, words, member, step=0):
        info = self.info("file.nc", "--select", words, *(["--time-step", str(step)] if step else []))
        self.assertEqual(info["times"], [3, 5])
        self.assertIn(words.replace("=", " "), info["format"])
        self.expect(info, sphere(self.lon, self.lat, self.heights[member]), self.t[step, member])

    def test_by_the_coordinate_of_the_dimension(self):
        self.write([1, 2, 7, 4])
        self.expect_member("month=7", 2)
        self.expect_member("month=4", 3, step=1)

    def test_by_its_labels(self):
        self.write(["ensmean", "r1", "r2", "r10"], name="member")
        self.expect_member("member=r10", 3)

    def test_by_the_number_without_a_coordinate(self):
        self.write(name="member")
        self.expect_member("member=0", 0)
        self.expect_member("member=2", 2, step=1)

    def test_two_dimensions(self):
        t = RANDOM.random((2, 3, 3, 8, 12)).astype("f4")
        with self.file(expver=2, number=3, lev=3, lat=8, lon=12) as f:
            lon, lat = self.air(f)
            f.add("lev", "lev", [0, 1000, 3000], units="m", positive="up")
            f.add("expver", "expver", [1, 5], "i4")
            f.add("T", "expver number lev lat lon", t, "f4")
        places = sphere(lon, lat, np.array([0, 1, 3])[:, None, None])
        self.expect(self.info("file.nc", "--select", "expver=5", "--select", "number=1"), places, t[1, 1])
        # The other dimension becomes the steps.
        info = self.info("file.nc", "--select", "expver=1")
        self.assertEqual(info["times"], [0, 1, 2])
        self.expect(info, places, t[0, 0])

    def test_without_a_selection_it_is_proposed(self):
        self.write([1, 2, 3, 4])
        self.assertIn("T: 4 dimensions besides time (month, lev, lat, lon); expected 3: choose one value of the others, such as "
                      "--select month=1", self.info()["warnings"][0])

    def test_wrong_selections(self):
        self.write([1, 2, 3, 4])
        for words, expected in (
                ("month=7", "--select month=7: month has no such value; it has 4 values: 1, 2, 3, 4"),
                ("mont=1", "has no dimension 'mont' (did you mean month?)"),
                ("month", "expected DIMENSION=VALUE, such as month=3"),
                ("month=", "expected DIMENSION=VALUE, such as month=3"),
                ("time=3", "time steps are chosen with --time-step or --steps")):
            line = self.info("file.nc", "--select", words, fails=True)
            self.assertIn(expected, line)
            self.assertEqual(line.count("\n"), 1, line)
        self.write(name="member")
        for value in ("4", "-1", "15e-1", "x"):
            self.assertIn("member has 4 values; expected a number from 0 to 3",
                          self.info("file.nc", "--select", f"member={value}", fails=True))

    def test_other_formats_have_no_dimensions(self):
        (self.folder / "a.vtk").write_text("# vtk DataFile Version 3.0\nt\nASCII\nDATASET STRUCTURED_POINTS\nDIMENSIONS 2 2 2\nORIGIN 0 0 0\n"
                                           "SPACING 1 1 1\nPOINT_DATA 8\nSCALARS c float 1\nLOOKUP_TABLE default\n1 2 3 4 5 6 7 8\n")
        line = self.info("a.vtk", "--select", "month=3", fails=True)
        self.assertIn("is not a NetCDF file, whose dimensions have names", line)


class Processors(ModelFileTest):
    """NEMO and XIOS write a file a processor, with its place in the map in attributes DOMAIN_*; those of land alone are not there."""

    def setUp(self):
        super().setUp()
        self.lon, self.lat = np.meshgrid(np.linspace(0, 33, 12), np.linspace(10, 31, 9))
        self.lon = self.lon + 0.1 * self.lat
        self.depths = np.array([5.0, 50, 500])
        self.t = RANDOM.random((2, 3, 9, 12)).astype("f4")

    def write(self, name="out_{:04d}.nc", cuts=((0, 5, 12), (0, 4, 9)), halo=1, origin=1, without=(), time=0):
        """Parts with halos, whose values there are wrong, but the first part lies in the file as NEMO's restarts do."""
        names = []
        parts = [(i, j) for j in range(len(cuts[1]) - 1) for i in range(len(cuts[0]) - 1)]
        for number, part in enumerate(parts):
            if number in without:
                continue
            begin = [cuts[n][part[n]] for n in (0, 1)]
            end = [cuts[n][part[n] + 1] for n in (0, 1)]
            lower = [max(0, b - halo) for b in begin]
            upper = [min(cuts[n][-1], end[n] + halo) for n in (0, 1)]
            names.append(name.format(number))
            box = np.s_[lower[1]:upper[1], lower[0]:upper[0]]
            inside = np.zeros((9, 12), bool)
            inside[begin[1]:end[1], begin[0]:end[0]] = True
            with self.file(names[-1], x=upper[0] - lower[0], y=upper[1] - lower[1], deptht=3, time_counter=None) as f:
                f.DOMAIN_number_total = np.int32(len(parts) - len(without))
                f.DOMAIN_number = np.int32(number)
                for word, values in (("dimensions_ids", (1, 2)), ("size_global", (12, 9)), ("size_local", [u - b for b, u in zip(lower, upper)]),
                                     ("position_first", [b + origin for b in lower]), ("position_last", [u + origin - 1 for u in upper]),
                                     ("halo_size_start", [b - l for b, l in zip(begin, lower)]), ("halo_size_end", [u - e for u, e in zip(upper, end)])):
                    f.setncattr("DOMAIN_" + word, np.array(values, "i4"))
                f.DOMAIN_type = "BOX"
                f.add("nav_lon", "y x", np.where(inside, self.lon, 0)[box], units="degrees_east")
                f.add("nav_lat", "y x", np.where(inside, self.lat, 0)[box], units="degrees_north")
                f.add("deptht", "deptht", self.depths, units="m", positive="down")
                f.add("time_counter", "time_counter", [10.0 * time, 10.0 * time + 5], units="seconds since 2000-01-01")
                f.add("votemper", "time_counter deptht y x", np.where(inside, self.t, 99)[:, :, box[0], box[1]], "f4",
                      coordinates="nav_lon nav_lat")
        return names

    def places(self):
        return sphere(self.lon, self.lat, -1e-3 * self.depths[:, None, None])

    def test_they_are_one_grid(self):
        names = self.write()
        for files in (names, reversed(names), ["out_*.nc"]):
            info = self.info(*files)
            self.assertEqual(info["times"], [0, 5])
            self.expect(info, self.places(), self.t[0])
        self.expect(self.info(*names, "--time-step", "1"), self.places(), self.t[1])

    def test_many_without_halos_counted_from_0(self):
        """XIOS' own: more parts than are open at a time."""
        names = self.write(cuts=((0, 3, 6, 9, 12), (0, 2, 4, 6, 9)), halo=0, origin=0)
        self.assertEqual(len(names), 16)
        self.expect(self.info(*names), self.places(), self.t[0])

    def test_processors_of_land_alone_are_not_there(self):
        names = self.write(without=(2,))
        values = self.t[0].copy()
        values[:, 4:, :5] = np.nan
        info = self.info(*names)
        self.expect(info, self.places(), values)
        self.assertEqual([warning for warning in info["warnings"] if "below the sphere" not in warning], [])

    def test_missing_parts_are_mentioned(self):
        names = self.write()
        self.assertIn("3 of the 4 parts of its map are given; the nodes of the others are left out", self.info(*names[:3])["warnings"][0])
        alone = self.info(names[0])
        self.assertIn("1 of the 4 parts of its map is given; give all of them together (NAME_*.nc)", alone["warnings"][0])
        self.assertEqual((alone["blocks"][0]["ni"], alone["blocks"][0]["nj"]), (6, 5))

    def test_further_files_may_be_whole(self):
        names = self.write()
        with self.file("mesh_mask.nc", t=1, nav_lev=3, y=9, x=12) as f:
            mask = np.ones((1, 3, 9, 12))
            mask[0, 2, 3:6, 4:7] = 0
            f.add("tmask", "t nav_lev y x", mask, "i1")
        self.expect(self.info(*names, "mesh_mask.nc"), self.places(), np.where(mask[0] > 0, self.t[0], np.nan))

    def test_steps_in_files_of_their_own(self):
        names = []
        for time in (0, 1, 2):
            names += self.write(f"out_0000{time}0_restart_{{:04d}}.nc", time=time)
        done = subprocess.run([PROGRAM, "convert", *(self.folder / name for name in names), "-o", self.folder / "a.splats", "--refine", "1"],
                              capture_output=True, text=True)
        self.assertEqual(done.returncode, 0, done.stderr)
        cache = json.loads(subprocess.run([PROGRAM, "info", "--json", self.folder / "a.splats"], capture_output=True, text=True).stdout)
        self.assertEqual(cache["nodes"], 3 * 9 * 12)
        self.assertEqual([step["time"] for step in cache["steps"]], [0, 5, 10, 15, 20, 25])

    def test_damage_gets_one_line(self):
        for attribute, values in (("DOMAIN_position_first", (90, 1)), ("DOMAIN_size_local", (3, 3)), ("DOMAIN_halo_size_start", (8, 0))):
            names = self.write()
            with netCDF4.Dataset(self.folder / names[1], "a") as f:
                f.setncattr(attribute, np.array(values, "i4"))
            line = self.info(*names, fails=True)
            self.assertIn("its attributes DOMAIN_* do not fit its dimensions", line)
            self.assertEqual(line.count("\n"), 1)


if __name__ == "__main__":
    unittest.main()
