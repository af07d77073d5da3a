#!/usr/bin/env python3
"""That check_names.py sees names of all kinds, and takes nothing else for one."""
import unittest

import check_names


class Checks(unittest.TestCase):
    def faults(self, source):
        return [(line, kind, name) for line, kind, name, fits in check_names.names_of(source) if not fits]

    def test_enumerators(self):
        self.assertEqual(self.faults("enum class Way {\n  kFast,\n  slow,  // words, of it\n  LAST = 7\n};\n"),
                         [(3, "enumerator", "slow"), (4, "enumerator", "LAST")])
        self.assertEqual(self.faults("  enum class State : uint8_t { kIdle, kDrawing };\n"), [])

    def test_constants(self):
        self.assertEqual(self.faults("constexpr int limit = 3;\n"), [(1, "constant", "limit")])
        self.assertEqual(self.faults("  static constexpr double kWait_s = 0.1;\n"), [(1, "constant", "kWait_s")])
        self.assertEqual(self.faults("constexpr std::array<int, 2> names[] = {{1, 2}};\n"), [(1, "constant", "names")])
        self.assertEqual(self.faults("const std::string usual = \"a\";\n"), [(1, "constant", "usual")])
        self.assertEqual(self.faults("inline constexpr auto kSupport = static_cast<float>(kKernelSupport);\n"), [])

    def test_limits(self):
        self.assertEqual(self.faults("constexpr int kMostNodes = 3, kMaxFiles = 2;\n"), [(1, "constant", "kMostNodes")])
        self.assertEqual(self.faults("constexpr int kMostly = 2;\nconstexpr int kLeast = 1;\n"), [(2, "constant", "kLeast")])

    def test_types(self):
        self.assertEqual(self.faults("struct brick_t {\n};\nclass octree final : public Tree<int> {\n"),
                         [(1, "type", "brick_t"), (3, "type", "octree")])
        self.assertEqual(self.faults("template <>\nstruct std::hash<curvisplat::A> {\n"), [])

    def test_types_of_two_headers(self):
        first = ("a.h", "namespace n {\nstruct Face {\n  int x;\n};\nclass Later;\n}\n")
        again = ("b.h", "namespace n {\n\nclass Face : public Base {\n};\n}\n")
        self.assertEqual(list(check_names.defined_twice([first, again])), [("b.h", 3, "n::Face", "a.h")])
        other = ("c.h", "namespace m {\nstruct Face {\n};\n}\nnamespace n {\nclass Face;\nstruct Face::Part {\n};\n}\n")
        self.assertEqual(list(check_names.defined_twice([first, other])), [])
        aligned = [(name, f"namespace n {{\nstruct alignas(64) {type} {{\n}};\n}}\n")
                   for name, type in (("d.h", "Row"), ("e.h", "Lane"), ("f.h", "Row"))]
        self.assertEqual(list(check_names.defined_twice(aligned)), [("f.h", 2, "n::Row", "d.h")])

    def test_what_is_none(self):
        self.assertEqual(self.faults("  const int local = 3;\n  struct stat found {};\n  struct stat now;\n"), [])
        self.assertEqual(self.faults("constexpr int twice(int n) {\n  return 2 * n;\n}\n"), [])
        self.assertEqual(self.faults("// constexpr int limit = 3;\nprint(\"enum { small };\");\n"), [])
        self.assertEqual(self.faults("const Image& Frame::image() const {\n"), [])


if __name__ == "__main__":
    unittest.main()
