#!/usr/bin/env python3
"""That check_portable.py finds Linux's own calls, and nothing else."""
import pathlib
import tempfile
import unittest

import check_portable

ROOT = pathlib.Path(__file__).resolve().parents[2]


class Checks(unittest.TestCase):
    def faults(self, **files):
        """Those of sources beside twins that are whole."""
        with tempfile.TemporaryDirectory() as folder:
            root = pathlib.Path(folder)
            (root / "CMakeLists.txt").write_text((ROOT / "CMakeLists.txt").read_text())
            for twin in check_portable.TWINS:
                for end in (".cpp", "_left_out.cpp"):
                    (root / (twin + end)).parent.mkdir(parents=True, exist_ok=True)
                    (root / (twin + end)).write_text("#include <sys/prctl.h>\n" if end == ".cpp" else "")
            for name, text in files.items():
                (root / "stream" / name.replace("_cpp", ".cpp")).write_text(text)
            return list(check_portable.faults(root))

    def test_twins_may(self):
        self.assertEqual(self.faults(), [])

    def test_headers(self):
        self.assertEqual(self.faults(a_cpp="#include <sys/inotify.h>\n"),
                         ["stream/a.cpp:1: sys/inotify.h is Linux's alone; ask stream/base/os.h for it"])

    def test_calls_flags_and_files(self):
        for text in ("::memfd_create(name, 0)", "flags | O_DIRECT", 'std::ifstream("/proc/self/io")', "gettid()"):
            self.assertEqual(len(self.faults(a_cpp=f"\n{text};\n")), 1, text)

    def test_what_is_not_a_call(self):
        for text in ("// O_DIRECT", 'print("io_uring_enter")', "os::hasRoom(a, 1)", "calls.splice(list)", "O_DIRECTORY", "mySysinfo"):
            self.assertEqual(self.faults(a_cpp=f"{text};\n"), [], text)


if __name__ == "__main__":
    unittest.main()
