#!/usr/bin/env python3
"""That check_comments.py sees fragments above declarations, and takes nothing else for one."""
import unittest

import check_comments


class Checks(unittest.TestCase):
    def fragments(self, source):
        return [(line, sentence) for line, sentence, declaration in check_comments.first_sentences(source)
                if check_comments.is_fragment(sentence, declaration)]

    def test_words_that_go_on(self):
        self.assertEqual(self.fragments("/// Of a face: its rows.\nint rows();\n"), [(1, "Of a face:")])
        self.assertEqual(self.fragments("struct A {\n  // As text(), but in small letters.\n  int word();\n};\n"),
                         [(2, "As text(), but in small letters.")])
        self.assertEqual(self.fragments("/// What the rows need.\nint rows();\n"), [(1, "What the rows need.")])
        self.assertEqual(self.fragments("/// Offsets of rows.\nint rows();\n"), [])

    def test_prepositions(self):
        self.assertEqual(self.fragments("/// For tests.\nint rows();\n"), [(1, "For tests.")])
        self.assertEqual(self.fragments("/// After close(): reads, and waits.\nint rows();\n"), [(1, "After close():")])
        self.assertEqual(self.fragments("/// Reads. For a scene of one block, too.\nint rows();\n"), [])

    def test_small_letters(self):
        self.assertEqual(self.fragments("/// in world units\nint rows();\n"), [(1, "in world units")])
        self.assertEqual(self.fragments("/// the same.\nint rows();\n"), [(1, "the same.")])
        for name in ("`rows` of it.", "read_at is first.", "readAt is first.", "read() is first.", "std::sort, stable.", "x and y.",
                     "nullopt if there is none.", "rows of the slab.", "out: colours.", "manifest.json has it.", "[n] rows."):
            self.assertEqual(self.fragments(f"/// {name}\nint rows();\n"), [], name)

    def test_heads_of_files(self):
        self.assertEqual(self.fragments("// Which cells are drawn.\n#pragma once\n"), [(1, "Which cells are drawn.")])
        self.assertEqual(self.fragments("// Chooses cells.\n//\n// Of these, some are drawn.\n#pragma once\n"), [])

    def test_what_documents_nothing(self):
        self.assertEqual(self.fragments("int f() {\n  // Of the two.\n  return 1;\n}\n"), [])
        self.assertEqual(self.fragments("int f(int a,\n      // Of the two.\n      int b);\n"), [])
        self.assertEqual(self.fragments("int a;  // the first,\n        // of two\nint b;  // of the two\n"), [])
        self.assertEqual(self.fragments("// half   a pipe\nint a;\n"), [])

    def test_sentences_that_begin_with_of(self):
        inverted = lambda source: list(check_comments.inverted_sentences(source))
        self.assertEqual(inverted("int f() {\n  // Of higher order.\n  return 1;\n}\n"), [(2, "Of higher order.")])
        self.assertEqual(inverted("// Chooses cells.\n//\n// Any thread. Of these,\n// some are drawn: red.\n"),
                         [(1, "Of these, some are drawn:")])
        self.assertEqual(inverted("// Chooses cells\n// Of a kind. Offsets follow.\nint a;  // Of it.\n"), [])
        self.assertEqual(inverted('const char* kShader = R"glsl(\n// Of pixels.\n)glsl";\n// Of it.\n'), [(4, "Of it.")])

    def test_scopes(self):
        inner = "  /// Of it.\n  int a;\n"
        for head in ("namespace n {", "class A final : public B {", "struct alignas(64) A {", "template <typename T>\nstruct A {"):
            self.assertEqual(len(self.fragments(f"{head}\n{inner}}}\n")), 1, head)
        for head in ("void f(const struct stat& s) {", "const auto f = [] {", "int f() const {\n  if (x) {"):
            self.assertEqual(self.fragments(f"{head}\n{inner}}}\n"), [], head)


if __name__ == "__main__":
    unittest.main()
