#!/usr/bin/env python3
"""threads_test.py CURVISPLAT FOLDER

Converts and draws a small grid with --trace. The traces have to be well formed: scopes of a thread lie within one another, and
every thread has a name. What threads.py makes of a trace whose answer is known is compared with it.
"""
import json
import pathlib
import shutil
import subprocess
import sys
import unittest

import threads

PROGRAM, FOLDER = pathlib.Path(sys.argv.pop(1)).absolute(), pathlib.Path(sys.argv.pop(1)).absolute()


def run(*arguments, status=0):
    done = subprocess.run([str(PROGRAM), *map(str, arguments)], capture_output=True, text=True)
    assert done.returncode == status, f"{arguments}: {done.returncode}\n{done.stderr}"
    return done


def scope(name, kind, thread, begin_s, end_s):
    return {"name": name, "cat": kind, "ph": "X", "pid": 0, "tid": thread, "ts": 1e6 * begin_s, "dur": 1e6 * (end_s - begin_s),
            "tdur": 1e6 * (end_s - begin_s)}


class Threads(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        shutil.rmtree(FOLDER, ignore_errors=True)
        FOLDER.mkdir(parents=True)
        run("generate", "o-grid", "--size", "40x30x20", "-o", FOLDER / "o")

    def written(self, path):
        scopes, names = threads.read(path)
        self.assertTrue(scopes)
        by_thread = {}
        for one in scopes:
            self.assertIn(one.thread, names)
            self.assertLessEqual(one.processor, one.end - one.begin + 0.011)  # the clocks differ by a tick at most
            by_thread.setdefault(one.thread, []).append(one)
        for own in by_thread.values():
            within = []
            for one in own:
                while within and within[-1].end <= one.begin:
                    within.pop()
                if within:
                    self.assertLessEqual(one.end, within[-1].end + 1e-6, (one.name, within[-1].name))
                within.append(one)
        return scopes, names

    def test_conversion(self):
        path = FOLDER / "convert.json"
        run("convert", FOLDER / "o.xyz", FOLDER / "o.fun", "-o", FOLDER / "o.splats", "--trace", path, "--threads", 2)
        scopes, names = self.written(path)
        self.assertEqual([stage.name for stage in threads.stages_of(scopes)],
                         ["scan", "count", "scatter", "seams", "build", "faces", "finish"])
        self.assertIn("main", names.values())
        self.assertIn("read-ahead", names.values())
        self.assertLessEqual({"make splats", "build leaf", "append bricks", "read ahead"}, {one.name for one in scopes})
        self.assertIn("efficiency", subprocess.run([sys.executable, threads.__file__, str(path)], capture_output=True,
                                                   text=True, check=True).stdout)

    def test_frames(self):
        path = FOLDER / "render.json"
        if not (FOLDER / "r.splats").exists():
            run("convert", FOLDER / "o.xyz", FOLDER / "o.fun", "-o", FOLDER / "r.splats")
        run("render", FOLDER / "r.splats", "-o", FOLDER / "f_%d.png", "--orbit", 30, "--frames", 3, "--backend", "cpu",
            "--trace", path)
        scopes, _ = self.written(path)
        frames = [one for one in scopes if one.name == "frame"]
        self.assertEqual(len(frames), 3)
        self.assertLessEqual({"plan", "project brick", "paint tiles", "write picture"}, {one.name for one in scopes})

    def at_once(self, path, *names_left_out):
        """The most threads that work at a time, without those of the names that are left out."""
        scopes, names = self.written(path)
        changes = []
        for thread in names.keys() - {thread for thread, name in names.items() if name in names_left_out}:
            for begin, end in threads.intervals_at_work([one for one in scopes if one.thread == thread]):
                if end - begin > 4e-6:  # the trace has whole microseconds
                    changes += [(begin + 2e-6, 1), (end - 2e-6, -1)]
        now = most = 0
        for _, change in sorted(changes):
            now += change
            most = max(most, now)
        return most

    def test_no_more_threads_compute_than_asked_for(self):
        run("generate", "o-grid", "--size", "48x36x30", "-o", FOLDER / "m")
        for count in 1, 2:
            path = FOLDER / f"bound_{count}.json"
            shutil.rmtree(FOLDER / "m.splats", ignore_errors=True)
            # Reading and writing have threads of their own.
            run("convert", FOLDER / "m.xyz", FOLDER / "m.fun", "-o", FOLDER / "m.splats", "--threads", count, "--trace", path)
            self.assertLessEqual(self.at_once(path, "read-ahead", "bucket-writer"), count)
            run("render", FOLDER / "m.splats", "-o", FOLDER / "m_%d.png", "--orbit", 30, "--frames", 3, "--backend", "cpu",
                "--lod-pixels", 0, "--size", "300x300", "--threads", count, "--trace", path)
            self.assertLessEqual(self.at_once(path), count)

    def test_trace_is_refused(self):
        found = run("render", FOLDER / "none.splats", "-o", FOLDER / "x.png", "--trace", FOLDER / "no" / "t.json", status=1)
        self.assertRegex(found.stderr, r"^curvisplat: --trace .*no/t.json: .*\n$")

    def test_trace_of_failure_is_whole(self):
        path = FOLDER / "failed.json"
        run("convert", FOLDER / "o.xyz", "-o", FOLDER / "none.splats", "--scalar", "none", "--trace", path, status=1)
        json.loads(path.read_text())

    def test_known_answer(self):
        path = FOLDER / "known.json"
        path.write_text(json.dumps([
            {"name": "thread_name", "ph": "M", "pid": 0, "tid": 1, "args": {"name": "main"}},
            {"name": "thread_name", "ph": "M", "pid": 0, "tid": 2, "args": {"name": "tbb"}},
            scope("pass", "stage", 1, 0, 10),
            scope("shared", "work", 1, 0, 4), scope("shared", "work", 2, 0, 4),
            scope("own", "work", 1, 4, 7), scope("waiting", "wait", 1, 5, 6),  # 3 s of work, 1 s of them waiting
        ]))
        scopes, names = threads.read(path)
        stage, = threads.stages_of(scopes)
        self.assertEqual(names, {1: "main", 2: "tbb"})
        self.assertAlmostEqual(stage.wall, 10)
        self.assertAlmostEqual(stage.alone, 2)
        self.assertAlmostEqual(stage.idle, 4)
        self.assertEqual(stage.only_of()[1:], (1, ["own"]))


if __name__ == "__main__":
    unittest.main(argv=sys.argv[:1])
