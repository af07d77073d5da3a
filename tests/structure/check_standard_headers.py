#!/usr/bin/env python3
"""Checks that sources include the standard headers whose names they use, themselves or by way of our own: builds
with precompiled headers (tools/cmake/common_headers.h) compile without them, others do not.

    check_standard_headers.py [ROOT]    prints one line for each fault; exit status 1 if there is one
"""
import pathlib
import re
import sys

FOLDERS = ("stream", "preprocess", "render", "tools", "tests", "bench")
# Names that only this header promises. Those that others bring along on any compiler are not looked for.
NAMES = {
    "algorithm": r"std::(sort|stable_sort|min_element|max_element|clamp|fill|copy_n|lower_bound|upper_bound|any_of|all_of|"
                 r"none_of|transform|nth_element|partition|reverse|rotate|unique|binary_search|find_if|count_if)\s*[(<]",
    "array": r"std::array\s*<",
    "chrono": r"std::chrono::",
    "cmath": r"std::(sqrt|floor|ceil|exp|log|pow|sin|cos|isfinite|isnan|round|lround|llround|fma|hypot|ldexp)\s*\(",
    "condition_variable": r"std::condition_variable",
    "cstring": r"std::(memcpy|memset|memcmp|strlen|strcmp)\s*\(",
    "filesystem": r"std::filesystem\b",
    "fstream": r"std::[io]?fstream\b",
    "functional": r"std::function\s*<",
    "limits": r"std::numeric_limits\s*<",
    "map": r"std::(multi)?map\s*<",
    "memory": r"std::(unique_ptr|shared_ptr|weak_ptr)\s*<|std::make_(unique|shared)\s*<",
    "mutex": r"std::(mutex|lock_guard|unique_lock|call_once)\b",
    "numeric": r"std::(accumulate|iota|partial_sum|gcd|exclusive_scan|inclusive_scan)\s*[(<]",
    "optional": r"std::optional\s*<",
    "random": r"std::(mt19937|uniform_\w+_distribution|normal_distribution)",
    "set": r"std::(multi)?set\s*<",
    "span": r"std::span\s*<",
    "stop_token": r"std::stop_(token|source|callback)\b",
    "string": r"std::(string\b(?!_view)|to_string\b)",
    "thread": r"std::(thread|jthread|this_thread)\b",
    "unordered_map": r"std::unordered_map\s*<",
    "vector": r"std::vector\s*<",
    "fmt/core.h": r"fmt::format\s*\(",
    "fmt/format.h": r"fmt::join\s*\(",
}
# What brings a header along, on any compiler.
BRINGS = {"string": ("string_view",), "fmt/core.h": ("string",), "fmt/format.h": ("fmt/core.h", "string"),
          "fstream": ("string",), "filesystem": ("string",), "sstream": ("string",), "thread": ("stop_token",), "gtest/gtest.h": ("memory", "string", "vector", "map", "set")}
INCLUDE = re.compile(r'^\s*#\s*include\s*(?:"([^"]+)"|<([^>]+)>)', re.M)
COMMENT = re.compile(r'//[^\n]*|/\*.*?\*/|R"(\w*)\(.*?\)\1"|"(?:\\.|[^"\\\n])*"', re.S)


class Sources:
    def __init__(self, root):
        self.root = root
        self.included = {}

    def headers_of(self, path):
        """The standard headers that a file includes, itself and by way of ours."""
        if path not in self.included:
            found = self.included[path] = set()
            for ours, standard in INCLUDE.findall((self.root / path).read_text()):
                if standard:
                    found.add(standard)
                    found.update(BRINGS.get(standard, ()))
                elif (self.root / ours).exists():
                    found |= self.headers_of(ours)
        return self.included[path]


def faults(root):
    sources = Sources(root)
    for folder in FOLDERS:
        for file in sorted((root / folder).rglob("*.[ch]*")):
            if file.suffix not in (".h", ".cpp"):
                continue
            path = str(file.relative_to(root))
            text = COMMENT.sub("", file.read_text())
            headers = sources.headers_of(path)
            for header, names in NAMES.items():
                used = re.search(names, text)
                if used and header not in headers:
                    yield f"{path}: uses {used[0].strip(' (<')} and does not include <{header}>"


def main():
    root = pathlib.Path(sys.argv[1]) if len(sys.argv) > 1 else pathlib.Path(__file__).resolve().parents[2]
    found = list(faults(root))
    for line in found:
        print(line)
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main())
