#!/usr/bin/python3
"""odd_names_test.py CURVISPLAT

File names with escape sequences, which a terminal would obey: nothing that the program prints has control characters in it,
those of ASCII or of Latin-1 (U+0080 to U+009F), in whatever command. Bytes that are not UTF-8 do no harm either. And very many
names: looked up one by one in lists, they would take minutes.
"""
import os
import pathlib
import struct
import subprocess
import sys
import tempfile
import unittest

PATIENCE_S = 100
PROGRAM = str(pathlib.Path(sys.argv.pop(1)).resolve())

# Erase the screen, set the window's title, the same by the one-byte introducers, line breaks; and bytes of no encoding.
NAMES = [b"a\x1b[2Jb\x1b]0;owned\x07c", "a\u009b2Jb\u009d0;owned\u009cc\x7f".encode(), b"a\nb\rc\td",
         b"a\x9b2Jb\x80\xff\xc3", "Größe 寸法 µ".encode()]


def controls(text):
    """What a terminal would obey besides line breaks."""
    found = [c for c in text.decode("utf-8", "surrogateescape") if (c < " " and c != "\n") or "\x7f" <= c < "\xa0"]
    # A terminal without UTF-8 takes such bytes for U+0080 to U+009F.
    return found + [c for c in text.decode("utf-8", "surrogateescape") if "\udc80" <= c < "\udca0"]


def classic_netcdf(scalars):
    """A file of 2 x 2 x 2 nodes, with scalars of these names."""
    def name(text):
        data = text.encode()
        return struct.pack(">I", len(data)) + data + bytes(-len(data) % 4)

    def attribute(key, text):
        return name(key) + struct.pack(">I", 2) + name(text)

    axes = {"depth": "m", "lat": "degrees_north", "lon": "degrees_east"}
    head = b"CDF\1" + struct.pack(">III", 0, 10, 3) + b"".join(name(axis) + struct.pack(">I", 2) for axis in axes) + bytes(8)
    variables = [(axis, [n], attribute("units", unit), 6, 16) for n, (axis, unit) in enumerate(axes.items())]
    variables += [(scalar, [0, 1, 2], b"", 5, 32) for scalar in scalars]
    parts = [(name(text) + struct.pack(f">I{len(dims)}I", len(dims), *dims) + (struct.pack(">II", 12, 1) + units if units else bytes(8))
              + struct.pack(">II", kind, size), size) for text, dims, units, kind, size in variables]
    offset, table = len(head) + 8 + sum(len(part) + 4 for part, _ in parts), b""
    for part, size in parts:
        table += part + struct.pack(">I", offset)
        offset += size
    values = struct.pack(">6d", 0, 1, 0, 1, 0, 1) + struct.pack(">8f", *range(8)) * len(scalars)
    return head + struct.pack(">II", 11, len(parts)) + table + values


class OddNames(unittest.TestCase):
    def setUp(self):
        self.folder = tempfile.TemporaryDirectory()
        self.addCleanup(self.folder.cleanup)

    def run_in(self, *words, status=0):
        run = subprocess.run([PROGRAM, *words], cwd=self.folder.name, capture_output=True, stdin=subprocess.DEVNULL, timeout=PATIENCE_S)
        self.assertEqual(run.returncode, status, run.stderr)
        for stream in (run.stdout, run.stderr):
            self.assertEqual(controls(stream), [], stream)
        return run.stdout

    def test_no_command_prints_them(self):
        for name in NAMES:
            with self.subTest(name=name):
                def of(ending):
                    return name + ending.encode()
                shown = self.run_in("generate", "o-grid", "--size", "9x8x7", "-o", name)
                self.assertEqual(shown.count(b"\n"), 4)  # three files and a sum, a line each
                self.run_in("generate", "wake", "--size", "9x8x7", "--steps", "2", "--moving", "-o", of("_s"))
                grid = (of(".xyz"), of(".fun"))
                self.run_in("info", *grid)
                self.run_in("convert", *grid, "-o", of(".splats"), "--dry-run")
                self.run_in("convert", *grid, "-o", of(".splats"))
                self.run_in("convert", of("_s_0000.xyz"), of("_s_0000.fun"), of("_s_0001.fun"), "-o", of("_s.splats"))
                for cache in (of(".splats"), of("_s.splats")):
                    self.run_in("info", cache)
                    self.run_in("info", cache, "--verify")
                    self.run_in("info", cache, "--probe", "0.5,0.5,0.5")
                self.run_in("render", of(".splats"), "-o", of(".png"), "--size", "32x32")
                self.run_in("render", of(".splats"), "-o", of("_%d.png"), "--size", "32x32", "--orbit", "10", "--frames", "2")
                self.run_in("export", of(".splats"), "-o", of(".ply"), "--no-comparison")
                self.run_in("compare", of(".png"), of(".png"))
                self.run_in("info", of(".png"), status=1)
                self.run_in("render", of(".splats"), "-o", of(".png"), "--scalar", name, status=1)
                for file in os.listdir(os.fsencode(self.folder.name)):
                    if not os.path.isdir(os.path.join(os.fsencode(self.folder.name), file)):
                        os.remove(os.path.join(os.fsencode(self.folder.name), file))

    def test_nor_names_in_files(self):
        """A function's name from a .nam file, as a scalar of grids, caches and series."""
        for name in NAMES:
            if b"\n" in name or b"\xff" in name:
                continue
            with self.subTest(name=name):
                self.run_in("generate", "o-grid", "--size", "9x8x7", "-o", "g")
                pathlib.Path(self.folder.name, "g.nam").write_bytes(name + b"\n")
                self.run_in("info", "g.xyz", "g.fun")
                self.run_in("convert", "g.xyz", "g.fun", "-o", "g.splats", "--overwrite")
                self.run_in("info", "g.splats")
                self.run_in("info", "g.splats", "--probe", "0.5,0.5,0.5")
                self.run_in("render", "g.splats", "-o", "g.png", "--size", "32x32")
                self.run_in("export", "g.splats", "-o", "g.ply", "--no-comparison")

    def test_very_many_names(self):
        names = [f"s{n}" for n in range(100000)]
        folder = pathlib.Path(self.folder.name)
        (folder / "a.vtk").write_text("# vtk DataFile Version 3.0\nt\nASCII\nDATASET STRUCTURED_POINTS\nDIMENSIONS 2 2 2\nORIGIN 0 0 0\n"
                                      f"SPACING 1 1 1\nPOINT_DATA 8\nFIELD f {len(names)}\n"
                                      + "".join(f"{name} 1 8 double\n1 2 3 4 5 6 7 8\n" for name in names))
        (folder / "a.nc").write_bytes(classic_netcdf(names[:15000]))
        # A section of Gmsh for each step of a scalar.
        (folder / "a.msh").write_text("$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$Nodes\n4\n1 0 0 0\n2 1 0 0\n3 0 1 0\n4 0 0 1\n$EndNodes\n"
                                      "$Elements\n1\n1 4 2 1 1 1 2 3 4\n$EndElements\n"
                                      + "".join(f'$NodeData\n1\n"s14999"\n1\n{n}\n3\n{n}\n1\n4\n1 0\n2 1\n3 2\n4 3\n$EndNodeData\n' for n in range(50000)))
        for file in ("a.vtk", "a.nc", "a.msh"):
            with self.subTest(file=file):
                self.run_in("convert", file, "--scalar", "s14999", "-o", f"{file}.splats")


if __name__ == "__main__":
    unittest.main()
