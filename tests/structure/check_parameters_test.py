#!/usr/bin/env python3
"""That check_parameters.py counts parameters of all kinds of functions, and takes no call for one."""
import pathlib
import tempfile
import unittest

import check_parameters

SEVEN = "int a, float b, const A& c, std::map<int, int> d, A* e, A&& f, bool g"


class Checks(unittest.TestCase):
    def counts(self, source):
        return [(name, count) for line, name, count in check_parameters.functions_of(source)]

    def counted(self, expected, source):
        self.assertIn(expected, self.counts(source))

    def not_counted(self, source):
        self.assertTrue(all(count <= check_parameters.LIMIT for _, count in self.counts(source)), self.counts(source))

    def test_functions(self):
        self.counted(("draw", 7), f"void draw({SEVEN});")
        self.counted(("draw", 7), f"template <typename T>\nHWY_INLINE T draw({SEVEN}) noexcept {{ return 1; }}")
        self.counted(("draw", 7), f"auto A::draw({SEVEN}) const -> int {{}}")
        self.counted(("draw", 2), "void draw(int a, int b) {}")

    def test_constructors_and_lambdas(self):
        self.counted(("Painter", 7), f"explicit Painter({SEVEN}) : a_(a), b_(b) {{}}")
        self.counted(("a lambda", 7), f"const auto paint = [&]({SEVEN}) {{ return a; }};")

    def test_default_values(self):
        self.counted(("draw", 7), "void draw(int a, int b = f(1, 2), A c = {1, 2}, int d = 0, int e = 0, int f = 0, int g = 0);")

    def test_parameters_without_names(self):
        self.counted(("draw", 7), "void draw(int, int, const A&, int, int, int, int);")
        self.counted(("draw", 7), "void draw(A& a, A& b, A& c, A& d, A& e, A& f, A& g);")
        self.counted(("draw", 7), "void draw(A* a, A* b, A* c, A* d, A* e, A* f, A* g);")

    def test_functions_as_parameters(self):
        self.counted(("draw", 2), "void draw(const std::function<void(int a, int b, int c)>& use, int n);")

    def test_shaders(self):
        self.counted(("shade", 7), 'text = R"(\nvec2 shade(vec4 a, float b, vec2 c, float d, float e, bool f, vec2 g) {\n})";')

    def test_calls_are_not_functions(self):
        self.not_counted("draw(a * b, c & d, e && f, g - h, i, j, k);")
        self.not_counted("draw(a < b, c > d, new A, sizeof b, static_cast<int>(n) * m, in[n].data() + at, out);")
        self.not_counted("const glm::dmat3 m(a * b, c * d, 0, 0, 1, -2.5, x.y, z->w, *p);")
        self.not_counted("draw(a, b, c, d, e, f, [&](int x, int y) { return x + y; });")

    def test_text_and_comments(self):
        self.not_counted('print("f(int a, int b, int c, int d, int e, int f, int g)");')
        self.not_counted("// f(int a, int b, int c, int d, int e, int f, int g)\n#define F(int a, b, c, d, e, f, g) \\\n  1\n")
        self.not_counted("/* f(int a, int b, int c, int d, int e, int f, int g) */ int n = 1'000;")

    def test_python(self):
        python = "class A:\n    def f(self, a, b, c, d, e, f, g=1, *rest, h, i):\n        pass\n"
        self.assertEqual(list(check_parameters.python_functions_of(python)), [(2, "f", 7)])

    def test_a_project(self):
        with tempfile.TemporaryDirectory() as folder:
            root = pathlib.Path(folder)
            (root / "render").mkdir()
            (root / "render/sound.h").write_text("void sound(int a, int b, int c, int d, int e, int f);\n")
            self.assertEqual(check_parameters.check(root)[1], [])
            (root / "render/wide.h").write_text(f"\nvoid wide({SEVEN});\n")
            self.assertEqual(check_parameters.check(root)[1],
                             ["render/wide.h:2: wide has 7 parameters; group them, there may be 6"])


if __name__ == "__main__":
    unittest.main()
