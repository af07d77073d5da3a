#!/usr/bin/env python3
"""replay_frame_test.py CURVISPLAT FOLDER

Replays a trace whose answer is known, and those of a small grid with several numbers of threads.
"""
import json
import pathlib
import shutil
import subprocess
import sys
import unittest

import replay_frame

PROGRAM, FOLDER = pathlib.Path(sys.argv.pop(1)).absolute(), pathlib.Path(sys.argv.pop(1)).absolute()


def run(*arguments):
    subprocess.run([str(PROGRAM), *map(str, arguments)], capture_output=True, check=True)


def scope(name, thread, begin_s, end_s, kind="work", **numbers):
    return {"name": name, "cat": kind, "ph": "X", "pid": 0, "tid": thread, "ts": 1e6 * begin_s, "dur": 1e6 * (end_s - begin_s),
            "tdur": 1e6 * (end_s - begin_s), "args": numbers}


def known_trace():
    """Of two threads: a brick, a batch of it, two ranges in each pass of bins, three of tiles."""
    return [
        scope("frame", 1, 0, 40, "stage"), scope("plan", 1, 0, 0.5), scope("start frame", 1, 0.5, 1),
        scope("start slab", 1, 1, 1, "stage", number=1, splats=100),
        scope("begin picture", 1, 1, 3, "stage"), scope("clear tiles", 1, 1, 2), scope("clear tiles", 1, 2, 3),
        scope("decode brick", 2, 1, 1.5), scope("sort brick", 2, 1.5, 2, number=0, splats=100),
        scope("enter sweep", 2, 2, 3.5), scope("fill sweep", 2, 3.5, 4.5),
        scope("sort batch", 3, 3.5, 4, number=1, splats=100), scope("copy batch", 3, 5, 6, number=0, splats=100),
        scope("draw batch", 1, 10, 30, "stage"),
        scope("sort bins", 1, 10, 11), scope("sort bins", 4, 10.5, 11.5), scope("sum bins", 1, 12, 13),
        scope("sort bins", 1, 13, 14), scope("sort bins", 4, 13.5, 14.5), scope("list tiles", 1, 15, 15.5),
        scope("paint tiles", 1, 16, 17), scope("paint tiles", 4, 16.5, 18.5), scope("paint tiles", 1, 17, 20),
        scope("finish picture", 1, 30, 33, "stage"), scope("make image", 1, 30, 31), scope("finish tiles", 1, 31, 32),
        scope("finish tiles", 1, 32, 33),
    ]


class ReplayFrame(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        shutil.rmtree(FOLDER, ignore_errors=True)
        FOLDER.mkdir(parents=True)

    def known(self):
        path = FOLDER / "known.json"
        path.write_text(json.dumps(known_trace()))
        frame, = replay_frame.frames_of(path)
        return frame

    def test_known_answer(self):
        frame = self.known()
        self.assertEqual((frame.threads, frame.workers), (2, 2))
        self.assertAlmostEqual(frame.work, 22.5)
        # One worker prepares from 1 to 2, enters until 3.5 and fills until 4.5. The other sorts the batch from 3.5 to 4, waits
        # for the fill, and copies until 5.5. Bins until 6.5, their sum until 7.5, bins until 8.5, the list until 9. Tiles
        # until 13: 1 and then 3 s on one core. The end: 1 s alone, then 1 s.
        replay = replay_frame.Replay(frame, 2)
        self.assertAlmostEqual(replay.now, 15)
        self.assertAlmostEqual(sum(replay.idle.values()), 2 * 15 - 22.5)
        self.assertAlmostEqual(replay.idle["paint tiles, last ranges"], 2)

    def test_longest_first(self):
        frame = self.known()
        frame.change("longest-first")
        self.assertAlmostEqual(replay_frame.Replay(frame, 2).now, 14)

    def test_one_core_does_the_work_and_no_more(self):
        self.assertAlmostEqual(replay_frame.Replay(self.known(), 1).now, 22.5)

    def test_waking_takes_time(self):
        self.assertGreater(replay_frame.Replay(self.known(), 2, wake_s=0.1).now, 15)

    def test_ring_holds_back_batches(self):
        # Of 100 splats: a batch of 60 is granted when that before it is released.
        replay = replay_frame.Replay(self.known(), 2)
        self.assertEqual(replay.place_for(60), 100)
        replay.segments.append(100)
        replay.end = 160
        self.assertIsNone(replay.place_for(60))
        self.assertEqual(replay.place_for(40), 160)

    def test_frames_of_the_program(self):
        run("generate", "o-grid", "--size", "80x60x50", "-o", FOLDER / "o")
        run("convert", FOLDER / "o.xyz", FOLDER / "o.fun", "-o", FOLDER / "o.splats")
        for count in 1, 2, 5:
            path = FOLDER / f"{count}.json"
            run("render", FOLDER / "o.splats", "-o", FOLDER / "o_%d.png", "--orbit", 30, "--frames", 2, "--backend", "cpu",
                "--lod-pixels", 0, "--size", "600x600", "--threads", count, "--trace", path)
            frames = replay_frame.frames_of(path)
            self.assertEqual(len(frames), 2)
            for frame in frames:
                self.assertEqual(frame.threads, count)
                replay = replay_frame.Replay(frame, count)
                self.assertAlmostEqual(sum(replay.idle.values()), count * replay.now - frame.work)
                self.assertLessEqual(replay.now, frame.work * (1 + 1e-9))
        printed = subprocess.run([sys.executable, replay_frame.__file__, *(str(FOLDER / f"{count}.json") for count in (1, 2, 5))],
                                 capture_output=True, text=True, check=True).stdout
        self.assertRegex(printed, r"(?m)^ +1 .* 1\.00$")


if __name__ == "__main__":
    unittest.main(argv=sys.argv[:1])
