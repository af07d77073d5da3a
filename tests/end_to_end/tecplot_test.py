#!/usr/bin/python3
"""tecplot_test.py CURVISPLAT

Tecplot's files of ordered zones, text and binary, against VTK's files of the same grids, and against VTK's reader of the text.
Exit status 77 (skipped) without python3-vtk9.
"""
import unittest

from structured_formats import RANDOM, Block, StructuredFormats, np, vtk
from sweep import IS_WHOLE, ONLY_WHOLE, some_of
from tecplot_files import Binary, flat, padded, write_text
from vtk.util.numpy_support import vtk_to_numpy

XYZ, XYZP, XYZPC = ("X", "Y", "Z"), ("X", "Y", "Z", "p"), ("X", "Y", "Z", "p", "c")


def size(block):
    return "I={}, J={}, K={}".format(*block.shape[::-1])


class TecplotText(StructuredFormats):
    def write(self, zones, variables=XYZP):
        path = self.folder / "grid.dat"
        write_text(path, zones, variables)
        return path

    def test_points_and_blocks(self):
        blocks = [Block(), Block((4, 3, 5), 9)]
        for words, packing in (("F={}", "POINT"), ("F={}", "BLOCK"), ("DATAPACKING={}", "POINT"),
                               ("ZONETYPE=ORDERED\n DATAPACKING = {}\n DT=(DOUBLE DOUBLE DOUBLE DOUBLE)", "BLOCK")):
            path = self.write([(f'T="a zone, {n}" {size(b)} ' + words.format(packing), packing, [*b.places, b.p])
                               for n, b in enumerate(blocks)])
            self.expect_same([path], blocks, {"c": None})
        self.assertEqual([b["name"] for b in self.info(path)["blocks"]], ["a zone, 0", "a zone, 1"])

    def test_values_of_cells(self):
        block = Block()
        for words in ("VARLOCATION=([5]=CELLCENTERED)", "VARLOCATION=(NODAL,NODAL NODAL NODAL CELLCENTERED)",
                      "varlocation=([1-4]=NODAL,\n [5]=CellCentered)"):
            path = self.write([(f"{size(block)}, DATAPACKING=BLOCK {words}", "BLOCK", [*block.places, block.p, block.c])], XYZPC)
            self.expect_same([path], [block])

    def test_shared_and_passive_variables(self):
        a, b = Block(), Block()
        b.p = a.p + 1
        expected = [a, b]
        path = self.write([(f"T=a {size(a)} F=BLOCK", "BLOCK", [*a.places, a.p]),
                           (f"T=b {size(a)} F=BLOCK VARSHARELIST=([1-3]=1)", "BLOCK", [b.p])])
        self.expect_same([path], expected, {"c": None})
        path = self.write([(f"T=a {size(a)} F=BLOCK", "BLOCK", [*a.places, a.p]), (f"{size(a)} F=BLOCK D=(1,2,3)", "BLOCK", [b.p])])
        self.expect_same([path], expected, {"c": None})
        b.p[:] = a.p
        path = self.write([(f"T=a {size(a)} F=BLOCK", "BLOCK", [*a.places, a.p]), (f"{size(a)} VARSHARELIST=([1-4]=1)", "BLOCK", [])])
        self.expect_same([path], expected, {"c": None})
        b.p[:] = np.nan
        path = self.write([(f"{size(a)} F=BLOCK", "BLOCK", [*a.places, a.p]),
                           (f"{size(a)} F=BLOCK VARSHARELIST=([1-3]=1) PASSIVEVARLIST=[4]", "BLOCK", [])])
        self.expect_same([path], expected, {"c": None})
        self.assertIn("1 of 2 zones have no values of p", self.run_program("info", path).stdout)

    def test_times(self):
        blocks = [Block() for _ in range(3)]
        still = Block((4, 3, 5), 9)
        zones = [(f"T=moving {size(b)} STRANDID=1, SOLUTIONTIME={0.5 * n}", "POINT", [*b.places, b.p]) for n, b in enumerate(blocks)]
        zones.append((f"T=still {size(still)}", "POINT", [*still.places, still.p]))
        path = self.write(zones)
        self.assertEqual(self.info(path)["times"], [0, 0.5, 1])
        for n, block in enumerate(blocks):
            self.expect_same([path], [block, still], {"c": None}, ["--time-step", n])
        zones = [(words.replace("STRANDID=1", "STRANDID=0"), packing, arrays) for words, packing, arrays in zones[:3]]
        self.assertEqual(len(self.info(self.write(zones))["blocks"]), 3)

    def test_numbers_of_fortran_and_repeats(self):
        block = Block()
        block.p[:] = 0.25
        path = self.write([(f"{size(block)} F=BLOCK", "BLOCK", [*block.places, None])])
        text = path.read_text() + f"{block.p.size - 2}*2.5D-1\n\t0.25,2.5-1\n"
        path.write_text(text.replace("\n", "\r\n"))
        self.expect_same([path], [block], {"c": None})

    def test_names_of_coordinates(self):
        block = Block()
        names = ("p", "z [m]", "CoordinateY", "X (m)")
        path = self.write([(f"{size(block)}", "POINT", [block.p, block.places[2], block.places[1], block.places[0]])], names)
        self.expect_same([path], [block], {"c": None})
        path = self.write([(f"{size(block)}", "POINT", [*block.places, block.p])], ("a", "b", "c", "p"))
        self.expect_same([path], [block], {"c": None})
        self.assertIn("the first three", self.run_program("info", path).stdout)

    def test_blanking(self):
        block = Block()
        iblank = RANDOM.integers(0, 2, block.shape)
        path = self.write([(size(block), "POINT", [*block.places, block.p, iblank])], (*XYZP, "IBLANK"))
        info = self.info(path)
        self.assertEqual([s["name"] for s in info["scalars"]], ["p"])
        self.assertEqual(info["blanked"]["by_grid"], int((iblank == 0).sum()))

    def test_precision(self):
        """Of coordinates: by the type of each variable, or by the digits."""
        block = Block()
        rounded = Block()
        rounded.places = rounded.places.round(5)
        rounded.p = rounded.p.round(5)
        for b, words, expected in ((block, "", 8), (block, "DT=(DOUBLE DOUBLE DOUBLE SINGLE)", 8), (block, "DT=(SINGLE SINGLE SINGLE DOUBLE)", 4),
                                   (block, "DT=(SINGLE, SINGLE, DOUBLE, SINGLE)", 8), (rounded, "", 4), (rounded, "DT=(DOUBLE DOUBLE DOUBLE DOUBLE)", 4)):
            path = self.write([(f"{size(b)} {words}", "POINT", [*b.places, b.p])])
            self.assertEqual(self.info(path)["coordinate_bytes"], expected, words)

    def test_names_that_move_the_cursor(self):
        block = Block()
        path = self.write([(f'T="a\x1b[2J" {size(block)}', "POINT", [*block.places, block.p])], ("a\x1b[1m", "b", "c", "p\x1b]0;x\x07"))
        shown = self.run_program("info", path).stdout
        self.assertIn("the first three (a [1m", shown)
        self.assertEqual([c for c in shown if c < " " and c != "\n"], [])

    def test_the_reader_of_vtk_agrees(self):
        block = Block()
        path = self.write([(f'T="a" {size(block)} F=POINT', "POINT", [*block.places, block.p])])
        reader = vtk.vtkTecplotReader()
        reader.SetFileName(str(path))
        reader.Update()
        grid = reader.GetOutput().GetBlock(0)
        self.assertEqual(grid.GetDimensions(), block.shape[::-1])
        values = vtk_to_numpy(grid.GetPointData().GetArray("p"))
        info = self.info(path)
        scalar = info["scalars"][0]
        np.testing.assert_allclose([scalar["min"], scalar["max"]], [values.min(), values.max()], rtol=1e-6)
        points = vtk_to_numpy(grid.GetPoints().GetData())
        np.testing.assert_allclose(info["bounds"]["lower"], points.min(0), atol=1e-6)
        np.testing.assert_allclose(info["bounds"]["upper"], points.max(0), rtol=1e-6)

    def test_what_is_refused(self):
        block = Block()
        arrays = [*block.places, block.p]
        for words, told in (("N=4, E=1, F=FEPOINT, ET=PRISM", "a kind of elements"),
                            ("NODES=4 ELEMENTS=1 ZONETYPE=FEPOLYHEDRON DATAPACKING=BLOCK", "has no number of faces"),
                            ("I=9 J=9 K=1", "is flat"),
                            ("I=9 J=9 K=9", "expected 2916"),
                            (f"{size(block)} F=POINT VARLOCATION=([4]=CELLCENTERED)", "expected DATAPACKING=BLOCK"),
                            (f"{size(block)} VARSHARELIST=([4]=7)", "VARSHARELIST"),
                            (f"{size(block)} VARLOCATION=([9]=CELLCENTERED)", "VARLOCATION"),
                            ("I=-3 J=4 K=5", "I = -3"), ("I=1e30 J=4 K=5", "I = 1e30")):
            arrays_of = [a.ravel()[:81] for a in arrays] if told == "is flat" else arrays
            self.expect_line(self.write([(words, "POINT", arrays_of)]), words=told)
        sets = ",".join(["[1-4]=1"] * 9)
        path = self.write([(size(block), "POINT", arrays), (f"{size(block)} VARSHARELIST=({sets})", "BLOCK", [])])
        self.expect_line(path, words="VARSHARELIST")
        path = self.write([(size(block), "POINT", arrays)])
        text = path.read_text()
        for damaged, told in ((text.replace("0.", "o.", 9), "grid.dat"), (text[:len(text) // 2], "expected 840"),
                              (text.replace("VARIABLES", "# "), "no VARIABLES"),
                              (f'FILETYPE=SOLUTION\n{text}', "solutions alone"),
                              (text.split("\n# a comment")[0] + "\n99999999999*0\n", "expected 840")):
            path.write_text(damaged)
            self.expect_line(path, words=told)

    def test_damage(self):
        block = Block((3, 4, 5))
        path = self.write([(f"T=a {size(block)} F=BLOCK VARLOCATION=([5]=CELLCENTERED)", "BLOCK", [*block.places, block.p, block.c]),
                           (f"{size(block)} F=BLOCK VARSHARELIST=([1-3]=1) PASSIVEVARLIST=[5]", "BLOCK", [block.p])], XYZPC)
        self.assertGreater(self.expect_harmless(path), 0.3)

    def test_memory(self):
        block = Block((60, 90, 101), kind="f4")
        path = self.write([(size(block), "POINT", [*block.places, block.p])])
        self.assertLess(self.peak_memory(path, "p", "160M"), 160 << 20)


class TecplotBinary(StructuredFormats):
    def write(self, file, **options):
        path = self.folder / "grid.plt"
        file.write(path, **options)
        return path

    def test_versions_and_byte_orders(self):
        for kind, versions in (("f4", (104, 107, 111, 112)), ("f8", (106, 108, 112))):
            blocks = [Block((4, 3, 5), kind=kind), Block((3, 5, 4), 9, kind)]
            for n, version in enumerate(versions):
                for order in some_of("<>", 2, turn=n + (kind == "f8")):
                    file = Binary(XYZPC, version, order)
                    for b in blocks:
                        file.zone(b.shape, [*b.places, b.p, padded(b, b.c)], "a", centrings=[0, 0, 0, 0, 1],
                                  auxiliary=[("key", "value"), ("other", "")])
                    file.geometry()
                    self.expect_same([self.write(file)], blocks)
        self.assertIn("version 112, big-endian", self.info(self.folder / "grid.plt")["format"])

    def test_other_writers(self):
        """The packing in version 112; the last plane of cells."""
        block = Block()
        for has_packing in (False, True):
            for last_plane in (False, True):
                for count in some_of((1, 2), 2, turn=has_packing + last_plane):
                    file = Binary(XYZPC, has_packing=has_packing)
                    for _ in range(count):
                        file.zone(block.shape, [*block.places, block.p, padded(block, block.c, last_plane)], centrings=[0, 0, 0, 0, 1])
                    self.expect_same([self.write(file)], [block] * count)

    def test_points(self):
        block = Block()
        file = Binary(XYZP, 108)
        file.zone(block.shape, [*block.places, block.p], point=True)
        self.expect_same([self.write(file)], [block], {"c": None})

    def test_types(self):
        block = Block()
        integers = {"i4": RANDOM.integers(-(2**31), 2**31, block.shape), "i2": RANDOM.integers(-(2**15), 2**15, block.shape),
                    "u1": RANDOM.integers(0, 256, block.shape)}
        for n, (kind, values) in enumerate(integers.items()):
            for order in some_of("<>", 2, turn=n):
                file = Binary(XYZP, order=order)
                file.zone(block.shape, [*block.places, values.astype(kind)])
                block.p = values.astype("f4")
                self.expect_same([self.write(file)], [block], {"c": None})

    def test_shared_and_passive_variables(self):
        a, b = Block(), Block()
        b.c[:] = np.nan
        file = Binary(XYZPC)
        file.zone(a.shape, [*a.places, a.p, padded(a, a.c)], centrings=[0, 0, 0, 0, 1])
        file.zone(a.shape, [None, None, None, b.p, None], centrings=[0, 0, 0, 0, 1], shared=[0, 0, 0, -1, -1], passive=[0, 0, 0, 0, 1])
        self.expect_same([self.write(file)], [a, b])

    def test_times(self):
        blocks = [Block() for _ in range(3)]
        still = Block((4, 3, 5), 9)
        for turn, strand in enumerate((0, 3, -2)):
            file = Binary(XYZP)
            for n, b in enumerate(blocks):
                file.zone(b.shape, [*b.places, b.p], "moving", strand=strand, time=0.5 * n)
            file.zone(still.shape, [*still.places, still.p], "still")
            path = self.write(file)
            self.assertEqual(self.info(path)["times"], [0, 0.5, 1])
            for n, block in some_of(enumerate(blocks), 3, turn=turn):
                self.expect_same([path], [block, still], {"c": None}, ["--time-step", n])

    def test_what_is_refused(self):
        block = Block()
        arrays = [*block.places, block.p]
        file = Binary(XYZP)
        file.zone(block.shape, arrays, "wing", zone_type=8)
        self.expect_line(self.write(file), words="the type of a zone is 8")
        file = Binary(XYZP)
        file.zone((1, 30, 7), [a.ravel().reshape(1, 30, 7) for a in arrays])
        self.expect_line(self.write(file), words="is flat")
        file = Binary(XYZP)
        file.zone(block.shape, arrays)
        self.expect_line(self.write(file, file_type=2), words="solutions alone")
        path = self.write(file)
        data = path.read_bytes()
        for damaged, told in ((data.replace(b"#!TDV112", b"#!TDV75 "), "version 75"), (data[:-1], "truncated"), (data[:100], "truncated"),
                              (b"#!SZPLT1" + data[8:], "subzone"), (data.replace(b"\x07\0\0\0", b"\xff\xff\xff\x7f"), "can hold"),
                              (data.replace(b"\x07\0\0\0", b"\xff\xff\xff\xff"), "a count")):
            path.write_bytes(damaged)
            self.expect_line(path, words=told)

    def test_many_variables(self):
        """Counts that a file might hold, but no program writes, take no memory."""
        block = Block((3, 2, 3))
        data = self.write(Binary([*XYZP, *(f"v{n}" for n in range(2000))])).read_bytes()
        at = data.index(b"t\0\0\0\0\0\0\0") + 8
        self.assertEqual(data[at:at + 4], (2004).to_bytes(4, "little"))
        path = self.folder / "many.plt"
        path.write_bytes(data[:at] + (70000).to_bytes(4, "little") + bytes(4 * 70000) + data[at + 4:])
        self.expect_line(path, words="has 70000 variables (expected at most 65536)")
        file = Binary([*XYZP, *(f"v{n}" for n in range(400))])
        file.zone(block.shape, [*block.places, block.p, *[block.p] * 400])
        self.expect_same([self.write(file)], [block], {"c": None})

    def test_damage(self):
        block = Block((3, 4, 5))
        file = Binary(XYZPC)
        for _ in range(2):
            file.zone(block.shape, [*block.places, block.p, padded(block, block.c)], centrings=[0, 0, 0, 0, 1])
        path = self.write(file)
        self.assertGreater(self.expect_harmless(path), 0.3)
        # The headers, byte by byte.
        data = path.read_bytes()
        for n in some_of(range(0, 700, 7), 5):
            path.write_bytes(data[:n] + b"\xff" + data[n + 1:])
            result = self.run_program("info", path)
            self.assertIn(result.returncode, (0, 1), result.stderr)

    @unittest.skipUnless(IS_WHOLE, ONLY_WHOLE)  # LongRows of format_memory_test.py has a file within the least memory
    def test_memory(self):
        block = Block((120, 120, 151), kind="f4")
        file = Binary(XYZP)
        file.zone(block.shape, [*block.places, block.p])
        path = self.write(file)
        self.assertLess(self.peak_memory(path, "p", "160M"), 160 << 20)


if __name__ == "__main__":
    unittest.main(verbosity=2)
