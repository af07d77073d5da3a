#!/usr/bin/env python3
"""Tests tools/cmake/unity_groups.py: which names a source declares, and which sources it puts together."""
import contextlib
import io
import pathlib
import re
import sys
import unittest

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[2] / "tools/cmake"))
import unity_groups  # noqa: E402

HEADER = '#include "tests/faults/small_conversion.h"\n'

SOURCE = """\
#include "stream/base/error.h"
#define LIMIT 3

namespace curvisplat {
namespace {

namespace fs = std::filesystem;
using Words = std::vector<std::string>;
constexpr double kRatio = 2;
constexpr int kLeft = 1, kRight = 2;
const std::vector<int> kSides{1, 2};
std::array<int, 3> table[2];
thread_local Counter counter;
enum class Kind { kFirst };
struct Part;
template <typename T>
std::vector<T> sorted(std::vector<T> values) {
  const int inner = 1;
  return values;
}

class Lines final : public Source {
  int member_ = 0;
};

TEST(Suite, Holds) {
}
TEST_P(Other, Holds) {}
INSTANTIATE_TEST_SUITE_P(All, Other, testing::Values(1));

}  // namespace

Reader::Reader(int at) : at_(at) {
}
Reader::~Reader() = default;
void Reader::open() {
}

}  // namespace curvisplat
"""


class UnityGroups(unittest.TestCase):
    def test_names_are_those_that_a_source_declares_in_its_namespaces(self):
        self.assertEqual(unity_groups.names(SOURCE), {
            "LIMIT", "Words", "kRatio", "kLeft", "kRight", "kSides", "table", "counter", "Kind", "sorted", "Lines", "Suite_Holds", "Other_Holds",
            "All_Other"})

    def test_uses_of_macros_and_texts_in_other_languages_declare_nothing(self):
        shader = 'const char* const kShader = R"glsl(\nlayout(local_size_x = 8) in;\nvoid main() {\n}\n)glsl";\nint after() {\n'
        self.assertEqual(unity_groups.names(shader), {"kShader", "after"})
        self.assertEqual(unity_groups.names("BENCHMARK(sort)->Arg(3);\nstatic_assert(sizeof(int) == 4);\n"), set())

    def test_a_source_that_defines_what_its_header_declares_is_with_others_that_include_it(self):
        defines = HEADER + "Blocks twoBlocks() {"
        self.assertEqual(unity_groups.groups([defines, HEADER], 10), [0, 0])
        self.assertEqual(unity_groups.groups([defines, "int twoBlocks() {"], 10), [0, 1])

    def test_sources_with_a_name_in_common_are_apart(self):
        a, b, c = "int first() {", "int second() {", "bool first(double x) {"
        self.assertEqual(unity_groups.groups([a, b, c, b], 10), [0, 0, 1, 1])

    def test_a_source_with_a_type_of_a_name_that_an_included_header_has_is_apart(self):
        self.assertEqual(unity_groups.types("struct Brick {\nclass Forward;\ninline int size() {\n"), {"Brick"})
        includes = '#include "stream/cache/cache_reader.h"\n'  # which includes stream/model/octree.h
        self.assertTrue({"CacheReader", "Brick"} <= unity_groups.included(includes))
        self.assertNotIn("readTextFile", unity_groups.included('#include "stream/base/file.h"\n'))  # a function
        for name in ("CacheReader", "Brick"):
            for texts in (["int a() {", f"struct {name} {{", includes], [includes, f"struct {name} {{", "int b() {"]):
                numbers = unity_groups.groups(texts, 10)
                self.assertNotEqual(numbers[texts.index(includes)], numbers[1])
        self.assertEqual(unity_groups.groups(["int a() {", "struct Brick {", "int b() {"], 10), [0, 0, 0])

    def test_a_source_with_a_constant_of_a_name_that_an_included_header_has_is_apart(self):
        self.assertEqual(unity_groups.types("inline constexpr float kMost = 0x1p30f;\ninline constexpr Size kSize{3, 4};\n"), {"kMost", "kSize"})
        includes = '#include "stream/codec/brick_codec.h"\n'
        name = next(name for name in sorted(unity_groups.included(includes)) if re.match("k[A-Z]", name))
        self.assertEqual(unity_groups.groups([includes, f"constexpr int {name} = 1;"], 10), [0, 1])

    def test_names_of_an_included_header_of_tests(self):
        self.assertIn("twoBlocks", unity_groups.included(HEADER))
        # Sources that include it may be together; one that declares the same name may not be with them, before or after.
        for texts in ([HEADER, HEADER, "int twoBlocks() {"], ["int twoBlocks() {", HEADER, HEADER]):
            numbers = unity_groups.groups(texts, 10)
            self.assertEqual(len(set(numbers)), 2)
            self.assertEqual(numbers[1], numbers[0] if texts[0] == HEADER else numbers[2])

    def test_neighbours_are_together_in_groups_of_the_same_size(self):
        texts = [f"int f{n}() {{" for n in range(12)]
        self.assertEqual(unity_groups.groups(texts, 10), [0] * 6 + [1] * 6)
        self.assertEqual(unity_groups.groups([], 10), [])

    def test_targets_are_apart(self):
        source, output = str(pathlib.Path(__file__).resolve().parents[2] / "tools/main.cpp"), io.StringIO()
        with contextlib.redirect_stdout(output):
            unity_groups.main("10", source, source, "--", "10", source)
        self.assertEqual(output.getvalue().split(), ["0", "1", "0"])


if __name__ == "__main__":
    unittest.main()
