#!/usr/bin/env python3
"""An option that several commands have says the same in all of them: tools/options/shared_options.h and its neighbours declare it
once. A command may add its default, or a note at the end.

    tests/end_to_end/option_texts_test.py PROGRAM
"""

import collections
import pathlib
import re
import subprocess
import sys
import tempfile
import unittest

# Options of one name and several meanings: what is written, what is counted, what is converted.
OWN = {
    "--output": {"render", "export", "generate", "colormaps", "info", "convert"},
    "--size": {"view", "generate"},
    "--steps": {"generate"},
    "--scalar": {"convert"},
    "--part": {"convert"},
    "--surface": {"convert"},
    "--keep-going": {"convert"},
    "--value-precision": {"convert"},
    "--tmp": {"bench"},
    "--iso": {"export"},
    "--json": {"bench"},
}


def texts():
    """{option: {command: help}}, as the manual pages have them."""
    found = collections.defaultdict(dict)
    with tempfile.TemporaryDirectory() as folder:
        subprocess.run([sys.argv[1], "manual", folder], check=True, timeout=60)
        for page in pathlib.Path(folder).glob("curvisplat-*.1"):
            plain = re.sub(r"\\f[BIR]|\\", "", page.read_text())
            for option, text in re.findall(r"^\.TP\n.*?(--[\w-]+).*\n(.*)", plain, re.M):
                found[option][page.stem.removeprefix("curvisplat-")] = text
    return found


def without_default(text):
    return re.sub(r" \(default:? .*\)$", "", text)


class SharedOptions(unittest.TestCase):
    def test_have_one_text(self):
        shared = 0
        for option, by_command in texts().items():
            of_all = {command: without_default(text) for command, text in by_command.items() if command not in OWN.get(option, ())}
            if len(of_all) < 2:
                continue
            shared += 1
            shortest = min(of_all.values(), key=len)
            for command, text in of_all.items():
                self.assertTrue(text.startswith(shortest), f"{command} {option}: '{text}' instead of '{shortest} ...'")
        self.assertGreater(shared, 40)


if __name__ == "__main__":
    unittest.main(argv=sys.argv[:1])
