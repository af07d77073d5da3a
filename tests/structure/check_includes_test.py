#!/usr/bin/env python3
"""That check_includes.py finds each kind of fault, and none in a project without one."""
import pathlib
import tempfile
import unittest

import check_includes

SOUND = {
    "stream/base/CMakeLists.txt": "curvisplat_room(stream_base PUBLIC TBB::tbb)",
    "stream/base/error.h": "#include <string>",
    "stream/base/error.cpp": '#include "stream/base/error.h"',
    "stream/cache/CMakeLists.txt": "curvisplat_room(stream_cache\n  PUBLIC curvisplat::stream_base)",
    "stream/cache/reader.h": '#include "stream/base/error.h"',
    "preprocess/grid/CMakeLists.txt": "curvisplat_room(preprocess_grid PRIVATE curvisplat::stream_cache)",
    "preprocess/grid/grid.h": "",
    "preprocess/grid/grid.cpp": '#include "preprocess/grid/grid.h"\n#include "stream/base/error.h"',
    "render/frame/CMakeLists.txt": "curvisplat_room(render_frame PUBLIC curvisplat::stream)",
    "render/frame/frame.h": '#include "stream/cache/reader.h"',
    "tools/viewer/CMakeLists.txt": "curvisplat_room(viewer PUBLIC curvisplat::render)",
    "tools/viewer/viewer.h": '#include "render/frame/frame.h"',
    "tools/output/files.h": "",
    "tools/commands/view.h": '#include "tools/output/files.h"\n#include "tools/viewer/viewer.h"',
    "tools/main.cpp": '#include "tools/commands/view.h"',
    "tests/support/disk.h": '#include "stream/base/error.h"',
    "tests/stream/reader_test.cpp": '#include "tests/support/disk.h"\n#include "stream/cache/reader.h"',
    "bench/read_bench.cpp": '#include "tests/support/disk.h"',
}


class Checks(unittest.TestCase):
    def faults(self, changed):
        """What is found in the sound project with these files changed."""
        with tempfile.TemporaryDirectory() as folder:
            root = pathlib.Path(folder)
            for name, text in (SOUND | changed).items():
                (root / name).parent.mkdir(parents=True, exist_ok=True)
                (root / name).write_text(text + "\n")
            return check_includes.check(root)[1]

    def finds(self, expected, changed):
        faults = self.faults(changed)
        self.assertTrue(any(expected in fault for fault in faults), faults)

    def test_a_sound_project_has_no_faults(self):
        self.assertEqual(self.faults({}), [])

    def test_a_path_that_is_not_from_the_root(self):
        self.finds('"error.h" is not the path', {"stream/base/error.cpp": '#include "error.h"'})
        self.finds("is not the path", {"stream/base/error.cpp": '#include "stream/base/../base/error.h"'})

    def test_a_file_that_does_not_exist(self):
        self.finds("is not the path", {"stream/base/error.cpp": '  #  include "stream/base/none.h"'})

    def test_a_project_file_in_angle_brackets(self):
        self.finds("is a file of ours", {"stream/cache/reader.h": "#include <stream/base/error.h>"})

    def test_a_cycle_between_headers(self):
        self.finds("cycle of files: stream/base/a, stream/base/b", {
            "stream/base/a.h": '#include "stream/base/b.h"', "stream/base/b.h": '#include "stream/base/a.h"'})

    def test_a_cycle_through_sources(self):
        self.finds("cycle of files: stream/base/a, stream/base/b, stream/base/c", {
            "stream/base/a.h": "", "stream/base/a.cpp": '#include "stream/base/b.h"',
            "stream/base/b.h": "", "stream/base/b.cpp": '#include "stream/base/c.h"',
            "stream/base/c.h": '#include "stream/base/a.h"'})

    def test_a_cycle_between_rooms_of_different_files(self):
        self.finds("cycle of rooms: stream/base, stream/cache", {
            "stream/base/other.cpp": '#include "stream/cache/other.h"', "stream/cache/other.h": ""})

    def test_a_cycle_of_links(self):
        self.finds("cycle of links: stream_base, stream_cache", {
            "stream/base/CMakeLists.txt": "curvisplat_room(stream_base PRIVATE curvisplat::stream_cache)"})

    def test_a_folder_above(self):
        self.finds("stream/ may include nothing else", {"stream/base/up.cpp": '#include "render/frame/frame.h"'})
        self.finds("render/ may include stream", {"render/frame/up.cpp": '#include "tools/output/files.h"'})
        self.finds("tools/ may include", {"tools/main.cpp": '#include "tests/support/disk.h"'})

    def test_preprocess_and_render_do_not_know_one_another(self):
        self.finds("preprocess/ may include", {"preprocess/grid/grid.cpp": '#include "render/frame/frame.h"'})
        self.finds("render/ may include", {"render/frame/frame.cpp": '#include "preprocess/grid/grid.h"'})

    def test_a_room_that_is_not_linked(self):
        self.finds("does not link stream/cache/reader.h", {
            "stream/codec/CMakeLists.txt": "curvisplat_room(stream_codec PUBLIC curvisplat::stream_base)",
            "stream/codec/codec.cpp": '#include "stream/cache/reader.h"'})

    def test_a_header_that_includes_what_is_linked_privately(self):
        self.finds("links that room as PRIVATE", {"preprocess/grid/grid.h": '#include "stream/cache/reader.h"'})

    def test_parts_of_the_program_out_of_order(self):
        self.finds("tools/output/ may not include", {"tools/output/up.cpp": '#include "tools/commands/view.h"'})

    def test_a_table_of_rooms_in_another_order(self):
        cache = "| [`cache`](cache/README.md) | files |\n"
        base = "| [`base`](base/README.md) | errors |\n"
        self.assertEqual(self.faults({"stream/README.md": base + cache}), [])
        self.finds("README.md lists base below cache", {"stream/README.md": cache + base})
        self.finds("its table has no row for cache/", {"stream/README.md": base})

    def test_a_folder_without_a_room(self):
        self.finds("stream/new/CMakeLists.txt has no", {"stream/new/new.cpp": '#include "stream/base/error.h"'})


if __name__ == "__main__":
    unittest.main()
