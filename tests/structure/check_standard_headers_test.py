#!/usr/bin/env python3
"""That check_standard_headers.py finds what is missing, and what our own headers bring."""
import pathlib
import tempfile
import unittest

import check_standard_headers


class Checks(unittest.TestCase):
    def faults(self, **files):
        with tempfile.TemporaryDirectory() as folder:
            root = pathlib.Path(folder)
            (root / "stream").mkdir()
            for name, text in files.items():
                (root / "stream" / name.replace("_", ".")).write_text(text)
            return list(check_standard_headers.faults(root))

    def test_missing(self):
        self.assertEqual(self.faults(a_cpp="std::vector<int> a;\n"),
                         ["stream/a.cpp: uses std::vector and does not include <vector>"])

    def test_included(self):
        self.assertEqual(self.faults(a_cpp="#include <vector>\nstd::vector<int> a;\n"), [])

    def test_brought_by_ours(self):
        self.assertEqual(self.faults(a_h="#include <vector>\n", a_cpp='#include "stream/a.h"\nstd::vector<int> a;\n'), [])

    def test_words_in_comments_and_strings(self):
        self.assertEqual(self.faults(a_cpp='// std::vector<int>\nconst char* a = "std::vector<int>";\n'), [])


if __name__ == "__main__":
    unittest.main()
