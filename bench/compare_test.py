#!/usr/bin/env python3
"""Tests compare.py with measurements whose comparison is known."""
import json
import pathlib
import subprocess
import sys
import tempfile
import unittest

import compare
import results

QUIET = [1.00, 1.01, 0.99, 1.005, 0.995]
NOISY = [1.0, 1.3, 0.8, 1.1, 0.9]


def of(samples, name="frames/wake", unit="s"):
    return {"measurements": [{"name": name, "unit": unit, "samples": samples}]}


def scaled(samples, factor):
    return [sample * factor for sample in samples]


class Judgements(unittest.TestCase):
    def judged(self, old, new, judgement, failed, **how):
        rows, does_fail = compare.compare(old, new, **how)
        self.assertEqual(([row[1] for row in rows], does_fail), ([judgement], failed))

    def test_equal_ones_are_the_same(self):
        self.judged(of(QUIET), of(QUIET), "same", False)

    def test_what_lies_within_the_noise_is_the_same(self):
        self.judged(of(NOISY), of(scaled(NOISY, 1.15)), "same", False)

    def test_beyond_the_noise_slower_fails_and_faster_does_not(self):
        self.judged(of(QUIET), of(scaled(QUIET, 1.15)), "worse", True)
        self.judged(of(QUIET), of(scaled(QUIET, 0.85)), "better", False)
        self.judged(of(NOISY), of(scaled(NOISY, 3)), "worse", True)

    def test_of_a_rate_more_is_better(self):
        self.judged(of(QUIET, unit="nodes/s"), of(scaled(QUIET, 1.15), unit="nodes/s"), "better", False)
        self.judged(of(QUIET, unit="nodes/s"), of(scaled(QUIET, 0.85), unit="nodes/s"), "worse", True)

    def test_a_small_change_is_none_even_without_noise(self):
        self.judged(of([1.0] * 5), of([1.02] * 5), "same", False)
        self.judged(of([1.0] * 5), of([1.02] * 5), "worse", True, least=0.01)

    def test_one_stray_sample_changes_nothing(self):
        self.judged(of(QUIET), of([*QUIET[:4], 9.0]), "same", False)

    def test_two_of_three_that_lie_together_by_chance_are_not_the_spread(self):
        self.judged(of([1.0, 1.001, 1.3]), of([1.1, 1.101, 1.0]), "same", False)

    def test_a_single_time_is_not_judged_but_bytes_and_decibels_are(self):
        self.judged(of([1.0]), of([2.0]), "one sample", False)
        self.judged(of([100.0], unit="B"), of([110.0], unit="B"), "worse", True)
        self.judged(of([60.0], unit="dB"), of([59.9], unit="dB"), "same", False)
        self.judged(of([60.0], unit="dB"), of([59.5], unit="dB"), "worse", True)

    def test_what_is_missing_fails_unless_allowed_and_what_is_new_does_not(self):
        nothing = {"measurements": []}
        self.judged(of(QUIET), nothing, "missing", True)
        self.judged(of(QUIET), nothing, "missing", False, allow_missing=True)
        self.judged(nothing, of(QUIET), "new", False)

    def test_another_unit_fails(self):
        self.judged(of(QUIET), of(scaled(QUIET, 1000), unit="ms"), "other unit", True)

    def test_names_can_be_chosen(self):
        rows, failed = compare.compare(of(QUIET), of(scaled(QUIET, 2)), only="^disk/")
        self.assertEqual((rows, failed), ([], False))


class Files(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.folder = pathlib.Path(folder.name)

    def file(self, name, content):
        path = self.folder / name
        path.write_text(content if isinstance(content, str) else json.dumps(content))
        return path

    def exit_status(self, *words):
        program = pathlib.Path(__file__).with_name("compare.py")
        return subprocess.run([sys.executable, program, *words], capture_output=True).returncode

    def test_exit_status(self):
        quick, slow = self.file("quick.json", of(QUIET)), self.file("slow.json", of(scaled(QUIET, 2)))
        self.assertEqual(self.exit_status(quick, quick), 0)
        self.assertEqual(self.exit_status(quick, slow), 1)
        self.assertEqual(self.exit_status(slow, quick), 0)
        self.assertEqual(self.exit_status(quick, slow, "--least", "200"), 0)
        self.assertEqual(self.exit_status(quick, self.file("cut.json", '{"measurements": [')), 2)
        self.assertEqual(self.exit_status(quick, self.file("other.json", {"frames": []})), 2)
        self.assertEqual(self.exit_status(quick, self.folder / "absent.json"), 2)

    def test_google_benchmark_with_repetitions(self):
        def one(value, **more):
            return {"name": "cut/400000", "run_name": "cut/400000", "run_type": "iteration", "real_time": value,
                    "time_unit": "us", **more}
        path = self.file("google.json", {"context": {"num_cpus": 2}, "benchmarks": [
            one(10.0), one(11.0), one(12.0), one(11.0, run_type="aggregate", name="cut/400000_mean"),
            {"name": "egl", "run_name": "egl", "run_type": "iteration", "error_occurred": True,
             "error_message": "no EGL", "real_time": 0.0, "time_unit": "ns"}]})
        content = results.read(path)
        self.assertEqual([one["name"] for one in content["measurements"]], ["cut/400000"])
        for sample, expected in zip(content["measurements"][0]["samples"], (10e-6, 11e-6, 12e-6), strict=True):
            self.assertAlmostEqual(sample, expected, 12)
        self.assertEqual(content["left_out"], [{"name": "egl", "reason": "no EGL"}])

    def test_what_is_written_is_read_again(self):
        out = results.Results()
        out.add("frames/wake", "s", [3, 1, 2])
        out.leave_out("frames/egl", "no graphics card")
        out.write(self.folder / "out.json", "frame_times", "0.1.0")
        content = results.read(self.folder / "out.json")
        self.assertEqual((content["measurements"][0]["median"], content["measurements"][0]["better"]), (2, "less"))
        self.assertEqual(content["left_out"][0]["reason"], "no graphics card")
        with self.assertRaises(ValueError):
            out.add("frames/wake", "s", [1])


if __name__ == "__main__":
    unittest.main()
