#!/usr/bin/env python3
"""Runs real_grids.py on generated grids in small pictures, and checks that its columns hold what they should.

    real_grids_test.py PROGRAM FOLDER

VTK's columns are checked where VTK is installed. Thresholds are far below what is measured: they tell numbers from nonsense.
"""
import json
import pathlib
import shutil
import subprocess
import sys
import unittest

HERE = pathlib.Path(__file__).resolve().parent
PYTHON = "/usr/bin/python3"
HAS_VTK = bool(shutil.which("Xvfb")) and subprocess.run([PYTHON, "-c", "import vtk"], capture_output=True).returncode == 0
VIEWS = {"+z", "+z 0.1", "iso"}


class RealGrids(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        shutil.rmtree(FOLDER, ignore_errors=True)
        cls.said = cls.run_on("^(globe|duct)$", "48")
        cls.rows = json.loads((FOLDER / "real_grids.json").read_text())

    @staticmethod
    def run_on(only, pixels, *more):
        return subprocess.run([sys.executable, HERE / "real_grids.py", FOLDER, "--program", PROGRAM, "--only", only, "--views",
                               r"^(\+z|\+z 0\.1|iso)$", "--pixels", pixels, "--vtk-python", PYTHON, *more,
                               *([] if HAS_VTK else ["--without-vtk"])], capture_output=True, text=True)

    def test_has_every_grid_in_every_view(self):
        self.assertEqual(self.said.returncode, 0, self.said.stderr)
        self.assertEqual({(row["grid"], row["view"]) for row in self.rows},
                         {(grid, view) for grid in ("globe", "duct") for view in VIEWS})

    def test_columns_are_in_range(self):
        for row in self.rows:
            with self.subTest(grid=row["grid"], view=row["view"]):
                self.assertTrue(0 < row["rms_percent"] < 10)
                self.assertTrue(1 < row["p98_over_p2"] < 1.5)
                self.assertTrue(0 <= row["outside_percent"] < 1)
                self.assertTrue(25 < row["inside_psnr_db"] < 99)
                self.assertTrue(15 < row["uniform_psnr_db"] <= row["inside_psnr_db"] + 6)
                self.assertTrue(15 < row["scalar_psnr_db"] < 99)
                self.assertEqual(row["order_255"], 0)

    def test_bands_show_more_along_an_axis(self):
        of = {(row["grid"], row["view"]): row for row in self.rows}
        self.assertLess(of["duct", "iso"]["rms_percent"], of["duct", "+z"]["rms_percent"])

    @unittest.skipUnless(HAS_VTK, "python3-vtk9 or Xvfb is not installed")
    def test_vtk_and_the_march_agree(self):
        for row in self.rows:
            with self.subTest(grid=row["grid"], view=row["view"]):
                # VTK draws lines of its own where it sees faces of tetrahedra nearly edge-on.
                self.assertTrue((35 if row["view"] == "+z 0.1" else 50) < row["vtk_uniform_psnr_db"] < 99)
                self.assertTrue(15 < row["vtk_scalar_psnr_db"] < 99)

    def test_leaves_table_and_sheets(self):
        lines = (FOLDER / "real_grids.md").read_text().splitlines()
        self.assertEqual(len(lines), 2 + 2)
        self.assertEqual(len({line.count("|") for line in lines}), 1)
        for name in ("sheet.png", "sheet_globe.png", "sheet_duct.png"):
            self.assertTrue((FOLDER / name).read_bytes().startswith(b"\x89PNG"), name)

    def test_says_that_there_is_no_such_grid(self):
        said = self.run_on("^cheese$", "48")
        self.assertNotEqual(said.returncode, 0)
        self.assertIn("cheese", said.stderr)


if __name__ == "__main__":
    PROGRAM, FOLDER = map(pathlib.Path, sys.argv[1:3])
    unittest.main(argv=sys.argv[:1] + sys.argv[3:])
