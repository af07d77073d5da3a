#!/usr/bin/env python3
"""Tests what peers/compare_peers.py computes of its measurements. Needs neither VTK nor the program."""
import pathlib
import sys
import unittest

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent / "peers"))
import compare_peers
import results


def row_of(technique, primitives, picture, seconds):
    return {"case": "half-annulus-100x100x100", "function": "smooth", "technique": technique, "build_s": 0.34, "first_frame_s": 5.048,
            "frame_s": seconds, "peak_memory_bytes": 745 * 2**20, "psnr_db": 54.3, "primitives": primitives,
            **compare_peers.rates_of(primitives, picture, seconds)}


class Rates(unittest.TestCase):
    def test_primitives_and_pixels_are_divided_by_the_time_of_a_frame(self):
        rates = compare_peers.rates_of(3_000_000, "1000x500", 0.25)
        self.assertEqual(rates, {"primitives_per_s": 12_000_000, "pixels_per_s": 2_000_000})

    def test_a_row_has_them_in_millions(self):
        # 99³ cells in five tetrahedra each; 4851495 / 4.142 = 1171293, 65536 / 4.142 = 15822.
        cells = compare_peers.line_of(row_of("projected-tetrahedra", 5 * 99**3, "256x256", 4.142)).split(" | ")
        heading = compare_peers.HEADING.splitlines()[0].split(" | ")
        found = dict(zip(heading, cells, strict=True))
        self.assertEqual(found["draws"], "4.85 M tetrahedra")
        self.assertEqual((found["M a second"], found["megapixels/s"], found["frame"]), ("1.17", "0.0158", "4.142 s"))
        self.assertEqual(compare_peers.HEADING.splitlines()[1].count("---"), len(heading))

    def test_each_technique_draws_something(self):
        self.assertEqual(set(compare_peers.PRIMITIVES), set(compare_peers.NAMES))
        for technique, primitives in (("resampled", "voxels"), ("ray-cast", "tetrahedra"), ("curvisplat", "splats")):
            self.assertIn(f"| 2.10 M {primitives} |", compare_peers.line_of(row_of(technique, 2_097_152, "64x64", 1)))


class Digits(unittest.TestCase):
    def test_three_digits_without_an_exponent(self):
        for number, text in ((0.0158221, "0.0158"), (1.171293, "1.17"), (9.999, "10.0"), (722.4, "722"), (5060.2, "5060"), (0, "0.00")):
            self.assertEqual(results.three_digits(number), text)


if __name__ == "__main__":
    unittest.main()
