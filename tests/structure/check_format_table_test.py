#!/usr/bin/env python3
"""That check_format_table.py sees names of tests that do not exist, and cells that name none."""
import pathlib
import unittest

import check_format_table

ROOT = pathlib.Path(__file__).resolve().parents[2]


class Checks(unittest.TestCase):
    def faults(self, *cells):
        text = "| | PLOT3D | VTK |\n|---|---|---|\n| row | " + " | ".join(cells) + " |\n"
        return [fault.split(": ", 1)[1] for fault in check_format_table.faults_in(text, ROOT)]

    def test_what_exists(self):
        self.assertEqual(self.faults("a: netcdf_test, tests/overset; fuzz: su2", "b: t `TecplotText.test_times`, `test_planes_...`"), [])
        self.assertEqual(self.faults("-", "by the same code"), [])

    def test_what_does_not_exist(self):
        self.assertEqual(self.faults("a: nothing_test", "b: t `test_of_nothing`"),
                         ["there is no test test_of_nothing", "there is no file of tests nothing_test"])
        self.assertEqual(self.faults("t `TecplotText.test_damages`", "fuzz: nothing"),
                         ["there is no test TecplotText.test_damages", "there is no fuzz target nothing"])
        self.assertEqual(self.faults("t `test_of_nothing_...`", "-"), ["there is no test test_of_nothing_"])

    def test_cells_without_a_test(self):
        self.assertEqual(self.faults("some words", "-"), ['"some words" names no test'])


if __name__ == "__main__":
    unittest.main()
