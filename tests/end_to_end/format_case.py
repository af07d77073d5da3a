"""What the tests of file formats share: the program, a folder, and what `info` and `convert` make of files. Files in the format under
test and VTK's file of the same grid are converted, and the caches compared byte by byte but for the names in their manifests.
"""
import hashlib
import json
import os
import pathlib
import subprocess
import sys
import tempfile
import unittest

try:
    import numpy as np

    from sweep import some_of
except ModuleNotFoundError as error:
    print(f"skipped: {error}; install python3-numpy")
    sys.exit(77)

PROGRAM = str(pathlib.Path(sys.argv.pop(1)).resolve())


class FormatCase(unittest.TestCase):
    SCALAR = "p"  # that the damaged files are converted with
    RANDOM = np.random.default_rng(11)
    EXPECTED = {}  # checksums of the caches of VTK's files; most are the same grid's again

    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.folder = pathlib.Path(folder.name)
        self.compared = 0  # pairs of caches in this test

    def run_program(self, *words):
        return subprocess.run([PROGRAM, *map(str, words)], capture_output=True, text=True, check=False, errors="replace")

    def info(self, *paths):
        result = self.run_program("info", *paths, "--json")
        self.assertEqual(result.returncode, 0, result.stderr)
        return json.loads(result.stdout)

    def convert(self, paths, scalar, *options):
        """The folder of the cache."""
        cache = self.folder / "a.splats"
        result = self.run_program("convert", *paths, "-o", cache, "--scalar", scalar, "--overwrite", *options)
        self.assertEqual(result.returncode, 0, result.stderr)
        return cache

    def manifest(self, cache):
        return json.loads((cache / "manifest.json").read_text())

    def checksums(self, cache):
        """Of its files but the manifest."""
        return sorted(hashlib.sha256(p.read_bytes()).hexdigest()
                      for p in cache.rglob("*") if p.is_file() and p.name != "manifest.json")

    def cache(self, paths, scalar, *options):
        return self.checksums(self.convert(paths, scalar, *options))

    def expected_cache(self, path, scalar):
        """As cache(). A file of several blocks has a folder of its name beside it."""
        files = [path, *sorted(p for p in path.with_suffix("").rglob("*") if p.is_file())]
        key = (scalar, *(hashlib.sha256(file.read_bytes()).digest() for file in files))
        if key not in self.EXPECTED:
            self.EXPECTED[key] = self.cache([path], scalar)
        return self.EXPECTED[key]

    def expect_same_caches(self, paths, expected, names=None, options=()):
        """`names`: what the files call the fields p and c of the file `expected`; None: nothing. After a test's first comparison usually
        one of the two fields is compared, in turn."""
        fields = [(name, called) for name in "pc" if (called := (names or {}).get(name, name)) is not None]
        if self.compared > 0 and len(fields) > 1:
            fields = some_of(fields, 2, turn=self.compared)
        self.compared += 1
        for name, called in fields:
            found = self.cache(paths, called, *options)
            self.assertGreater(len(found), 1)
            self.assertEqual(found, self.expected_cache(expected, name), name)

    def expect_line(self, *paths, scalar=None, words=""):
        result = self.run_program("convert", *paths, "-o", self.folder / "d.splats", "--overwrite", "--scalar", scalar or self.SCALAR)
        self.assertEqual(result.returncode, 1, result.stderr)
        self.assertEqual(result.stderr.count("\n"), 1, result.stderr)
        self.assertIn(words, result.stderr)

    def expect_harmless(self, path, count=40, scalar=None, opened=None):
        """Truncated files, and some with a wrong byte, are refused by one line or read. Returns the share that is refused.
        `opened`: the file that names `path`."""
        data, refused = path.read_bytes(), 0
        damaged = [data[:len(data) * n // count] for n in range(count)]
        for n in self.RANDOM.integers(0, len(data), 2 * count):
            wrong = bytearray(data)
            wrong[n] ^= int(self.RANDOM.integers(1, 256))
            damaged.append(bytes(wrong))
        tried = some_of(damaged, 11)
        for bytes_of in tried:
            path.write_bytes(bytes_of)
            result = self.run_program("convert", opened or path, "-o", self.folder / "d.splats", "--overwrite",
                                      "--scalar", scalar or self.SCALAR)
            self.assertIn(result.returncode, (0, 1, 2), result.stderr)
            if result.returncode:
                refused += 1
                errors = [line for line in result.stderr.splitlines() if not line.startswith("curvisplat: warning")]
                self.assertEqual(len(errors), 1, result.stderr)
        path.write_bytes(data)
        return refused / len(tried)

    def peak_memory(self, path, scalar, budget, *others):
        """Peak memory in bytes of a conversion within `budget` ("160M"). `others`: further files of the grid. 0 if the program is built
        with sanitizers, which need memory of their own."""
        statistics = self.folder / "stats.json"
        result = self.run_program("convert", path, *others, "-o", self.folder / "m.splats", "--overwrite", "--scalar", scalar,
                                  "--memory", budget, "--stats", statistics)
        self.assertEqual(result.returncode, 0, result.stderr)
        return 0 if "CURVISPLAT_SANITIZED" in os.environ else json.loads(statistics.read_text())["peak_memory_bytes"]
