#!/usr/bin/python3
"""A server's peak of memory beside large pictures: what annotates, encodes and sends them is part of --viewer-memory.

    memory_test.py PROGRAM
"""
import os
import pathlib
import struct
import subprocess
import sys
import tempfile
import unittest

sys.path.insert(0, str(pathlib.Path(__file__).parent))
from serving import Viewer, serving  # noqa: E402

program = sys.argv.pop(1)
LARGE = (3840, 2160)
PROGRAM_MIB = 12  # code that is loaded with the first picture, and the stacks of threads
SANITIZED = "CURVISPLAT_SANITIZED" in os.environ
IS_WHOLE = "CURVISPLAT_WHOLE" in os.environ


def size_of(message):
    """Of the PNG file in it."""
    return struct.unpack_from(">II", message, 44 + 16)


class ServerMemory(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.folder = tempfile.TemporaryDirectory()
        cls.addClassCleanup(cls.folder.cleanup)
        cls.cache = f"{cls.folder.name}/g.splats"
        for command in (["generate", "half-annulus", "--size", "64x40x40", "-o", f"{cls.folder.name}/g"],
                        ["convert", f"{cls.folder.name}/g.xyz", f"{cls.folder.name}/g.fun", "-o", cls.cache]):
            subprocess.run([program, *command], check=True, capture_output=True)

    def look(self, memory_mib, size, **state):
        """A viewer that turns and rests: the last picture, and the errors that it was told."""
        memory = f"{memory_mib}M"
        with serving(program, [self.cache], "--viewer-memory", memory, "--memory", memory, "--backend", "cpu") as server:
            before = server.kilobytes()
            viewer, told = Viewer(server, size=size), []
            viewer.open()
            for moving in (False, True, True, False) if IS_WHOLE else (True, False):
                shown = viewer.facts["state"] | state
                shown["camera"]["parallel_scale"] *= 0.9
                viewer.view(shown, moving=moving)
                while True:
                    message = viewer.receive()
                    if isinstance(message, dict):
                        told += [message["text"]] if message["type"] == "error" else []
                        continue
                    viewer.send(type="shown", picture=struct.unpack_from("<I", message, 4)[0])
                    if struct.unpack_from("<d", message, 8)[0] == viewer.number and (moving or message[25]):
                        break
            if not SANITIZED:
                peak = (server.kilobytes("VmHWM") - before) >> 10
                self.assertLess(peak, memory_mib + PROGRAM_MIB, f"{memory}, {size}, {state}")
            return message, told

    def test_large_pictures_are_whole_within_the_memory_of_a_viewer(self):
        for state in ({"scalar_bar": False, "axes": False, "outline": False}, {"axes_grid": True})[not IS_WHOLE:]:
            message, told = self.look(512, LARGE, **state)
            self.assertEqual((size_of(message), told), (LARGE, []), state)

    def test_pictures_have_fewer_pixels_where_memory_is_too_short_and_the_viewer_is_told_once(self):
        for memory, reduction in ((280, 2), (112, 4)):
            message, told = self.look(memory, LARGE)
            self.assertEqual(size_of(message), (LARGE[0] // reduction, LARGE[1] // reduction))
            self.assertEqual(struct.unpack_from("<HH", message, 20), LARGE, "the page shows it in this size")
            self.assertRegex("\n".join(told), rf"^--viewer-memory {memory} MiB: too little for 3840x2160 pixels of this cache, which "
                                              rf"need \d+ MiB; the picture has 1/{reduction} of them each way$")

    def test_a_viewer_is_told_of_its_own_memory_alone(self):
        """Isosurfaces whose splats lie in one tile, so that fewer pixels do not help."""
        with serving(program, [self.cache], "--viewer-memory", "64M", "--memory", "64M", "--backend", "cpu") as server:
            viewer = Viewer(server)
            shown = viewer.open()["state"]
            low, high = viewer.facts["scalars"][0]["low"], viewer.facts["scalars"][0]["high"]
            values = [low + (high - low) * (n + 0.5) / 32 for n in range(32)]
            shown |= {"isosurfaces": [{"scalar": shown["variable"], "value": value, "visible": True} for value in values],
                      "lod_pixels": 0}
            shown["camera"]["parallel_scale"] *= 10
            viewer.view(shown)
            self.assertRegex(viewer.picture(),
                             r"^--viewer-memory 64 MiB: too little for 64x48 pixels of this cache(, which need \d+ MiB)?$")

    def test_pictures_of_usual_sizes_are_drawn_while_others_are_sent(self):
        message, told = self.look(512, (1280, 800))
        self.assertEqual((size_of(message), told), ((1280, 800), []))


unittest.main()
