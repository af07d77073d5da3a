#!/usr/bin/python3
"""cgns_ioss_test.py CURVISPLAT

CGNS files with the habits of IOSS (Sierra) and of other writers: tables of solutions for each location, whose names are padded or name
nothing; solutions of all steps in one zone; solutions at faces; conditions that their families describe. Written by h5py and by libcgns; the
cache of each step is byte for byte that of VTK's file of the same nodes and values. Exit status 77 (skipped) without python3-vtk9 or
python3-h5py.
"""
import ctypes
import json
import sys
import unittest

from structured_formats import RANDOM, Block, StructuredFormats, np

import cgns_library as cg
from sweep import some_of
from cgns_layout import CgnsLayout, library

try:
    library("h5py")
except unittest.SkipTest as error:
    print(f"skipped: {error}")
    sys.exit(77)

TIMES = [0.5, 1.25, 4.0]


class Step:
    """The block at one step. `p` or `c` is None where the file has no solution of it."""

    def __init__(self, block, p=True, c=True):
        self.block = block
        self.p = RANDOM.random(block.p.shape) if p else None
        self.c = RANDOM.random(block.c.shape) if c else None

    def as_block(self):
        copy = Block(self.block.shape)
        copy.places = self.block.places
        copy.p, copy.c = (own if own is not None else np.zeros_like(shape) for own, shape in
                          ((self.p, self.block.p), (self.c, self.block.c)))
        return copy


class CgnsIoss(StructuredFormats):
    SCALAR = "p"

    def setUp(self):
        super().setUp()
        self.path = self.folder / "grid.cgns"
        self.turn = 0

    def write(self, block, steps, tables=None, times=TIMES, **habits):
        """`tables`: of the zone's iterative data; None: it has none."""
        located = habits.get("located", True)  # solutions of nodes have a GridLocation
        descriptor = habits.get("descriptor", "Step")
        names = habits.get("names", "{}SolutionAtStep{}")
        numbers = habits.get("numbers", range(1, len(steps) + 1))  # of the steps, in names and descriptors
        file = CgnsLayout(self.path)
        base = file.node(file.file, "Base", "CGNSBase_t", np.array([3, 3], "i4"))
        for family, condition in (("inlet", "BCInflow"), ("wall", "BCWall")):
            node = file.node(base, family, "Family_t")
            file.node(node, "FamBC", "FamilyBC_t", condition)
            file.node(node, "FamBC_UserId", "Descriptor_t", "17")
        zone = file.block(base, "block_1", block)
        file.node(zone, "FamilyName", "FamilyName_t", "block_1")
        if habits.get("conditions"):
            self.write_conditions(file, zone, block)
        for n, step in enumerate(steps):
            number = numbers[n]
            for location, field in (("Vertex", "p"), ("CellCenter", "c"), ("KFaceCenter", "flux")):
                values = np.ones(3) if field == "flux" else getattr(step, field)
                if values is None:
                    continue
                solution = file.node(zone, names.format(location, number), "FlowSolution_t")
                if located or location != "Vertex":  # without one, CGNS says that it is Vertex
                    file.node(solution, "GridLocation", "GridLocation_t", location)
                if descriptor:
                    file.node(solution, descriptor, "Descriptor_t", str(number))
                file.node(solution, field, "DataArray_t", values)
        if times:
            data = file.node(base, "TimeIterValues", "BaseIterativeData_t", np.array([len(times)], "i4"))
            file.node(data, "TimeValues", "DataArray_t", np.array(times))
        if tables is not None:
            data = file.node(zone, "ZoneIterativeData", "ZoneIterativeData_t")
            for name, texts in tables.items():
                file.table(data, name, texts)
        file.file.close()

    @staticmethod
    def write_conditions(file, zone, block):
        conditions = file.node(zone, "ZoneBC", "ZoneBC_t")
        ni, nj, nk = block.shape[::-1]
        for name, family, ends in (("inlet_1", "inlet", [[1, 1, 1], [1, nj, nk]]), ("wall_1", "wall", [[1, 1, 1], [ni, nj, 1]])):
            node = file.node(conditions, name, "BC_t", "FamilySpecified")
            file.node(node, "PointRange", "IndexRange_t", np.array(ends, "i4"))
            file.node(node, "FamilyName", "FamilyName_t", family)
            file.node(node, "GridLocation", "GridLocation_t", "Vertex")

    def expect_steps(self, steps, times=TIMES):
        info = self.info(self.path)
        self.assertEqual(info["times"], times)
        for n, step in enumerate(steps):
            names = {field: field if getattr(step, field) is not None else None for field in "pc"}
            at = self.run_program("info", self.path, "--json", "--time-step", n)
            self.assertEqual(at.returncode, 0, at.stderr)
            found = {scalar["name"]: (scalar["min"], scalar["max"]) for scalar in json.loads(at.stdout)["scalars"]}
            self.assertEqual(set(found), {field for field in names.values() if field})
            for field, (low, high) in found.items():
                values = getattr(step, field).astype("f4")
                self.assertEqual((np.float32(low), np.float32(high)), (values.min(), values.max()))
            self.expect_same_step(n, step, [name for name in "pc" if names[name]])

    def expect_same_step(self, n, step, names):
        """Usually of one of the step's fields, by turns."""
        self.turn += 1
        expected = self.vtk_file([step.as_block()])
        for name in some_of(names, len(names), turn=self.turn):
            self.assertEqual(self.cache([self.path], name, "--time-step", n), self.expected_cache(expected, name), (n, name))

    @staticmethod
    def tables(**names):
        return {f"{location}SolutionPointers": texts for location, texts in names.items()}

    def test_tables_of_each_location(self):
        """FlowSolutionPointers name what does not exist. Descriptors tell the step, and solutions at faces are left out."""
        block = Block()
        steps = [Step(block, c=False), Step(block), Step(block)]
        for flow in ({}, {"Flow": [f"SolutionAtStep{n}" for n in (1, 2, 3)]}, {"Flow": ["", "", ""]}):
            self.write(block, steps, self.tables(
                Vertex=[f"VertexSolutionAtStep{n}" for n in (1, 2, 3)],
                CellCenter=["Null", "CellCenterSolutionAtStep2", "CellCenterSolutionAtStep3"], **flow))
            self.expect_steps(steps)

    def test_pointers_alone_that_name_nothing(self):
        """Without a table for each location the numbers of IOSS tell the steps, in descriptors or at the ends of names."""
        block = Block()
        steps = [Step(block, c=False), Step(block), Step(block)]
        for habits in ({}, {"descriptor": None}, {"numbers": [9, 10, 11]}):
            with self.subTest(habits):
                self.write(block, steps, self.tables(Flow=[f"SolutionAtStep{n}" for n in (1, 2, 3)]), **habits)
                self.expect_steps(steps)
        # No numbers: which solution is which step is a guess.
        self.write(block, steps, self.tables(Flow=["A", "B", "C"]), descriptor=None, names="{}Solution{}")
        self.expect_line(self.path, words="names A for time step 0, but the zone has no such node")

    def test_conditions_of_families(self):
        """Notes name them, and the cache has their faces."""
        block = Block()
        step = Step(block)
        self.write(block, [step], times=None, conditions=True)
        notes = self.info(self.path)["notes"]
        self.assertIn("families: inlet, wall", notes)
        self.assertIn("boundary conditions: FamilySpecified 2", notes)
        found = self.cache([self.path], "p")
        self.write(block, [step], times=None)
        self.assertNotEqual(found, self.cache([self.path], "p"))

    def test_faces_that_the_tables_name(self):
        block = Block()
        steps = [Step(block), Step(block), Step(block)]
        self.write(block, steps, self.tables(
            Vertex=[f"VertexSolutionAtStep{n}" for n in (1, 2, 3)], CellCenter=[f"CellCenterSolutionAtStep{n}" for n in (1, 2, 3)],
            KFaceCenter=[f"KFaceCenterSolutionAtStep{n}" for n in (1, 2, 3)]))
        self.expect_steps(steps)
        self.assertIn("its GridLocation is KFaceCenter", " ".join(self.info(self.path)["warnings"]))

    def test_a_run_that_did_not_end(self):
        """IOSS writes the tables at the end: until then the descriptors tell the steps, or the names of the solutions. Cells have values from
        the second step on."""
        block = Block()
        steps = [Step(block, c=False), Step(block), Step(block)]
        for options in ({}, {"descriptor": None}, {"descriptor": "step"}, {"located": False}, {"tables": {}}):
            with self.subTest(options):
                self.write(block, steps, **options)
                self.expect_steps(steps)
        self.write(block, steps, times=None)
        self.expect_steps(steps, [0.0, 1.0, 2.0])
        # Steps 9 to 11: h5py's order of the names is not that of the numbers.
        self.write(block, steps, times=None, descriptor=None, numbers=[9, 10, 11])
        self.expect_steps(steps, [0.0, 1.0, 2.0])

    def test_a_single_step_without_times(self):
        block = Block()
        step = Step(block)
        self.write(block, [step], times=None, located=False, names="{}Solution{}")
        self.assertEqual(self.info(self.path)["times"], [])
        names = {"p": "p", "c": "c"}
        self.expect_same_caches([self.path], self.vtk_file([step.as_block()]), names)

    def test_entries_that_name_nothing(self):
        block = Block()
        steps = [Step(block), Step(block), Step(block)]
        good = [f"VertexSolutionAtStep{n}" for n in (1, 2, 3)]
        self.write(block, steps, self.tables(Vertex=good[:2]))
        self.expect_line(self.path, words="VertexSolutionPointers has 2 entries; expected 3, one per time step")
        self.write(block, steps, self.tables(Vertex=["gone", *good[1:]]))
        self.expect_line(self.path, words="names gone for time step 0, but the zone has no such node")

    @unittest.skipUnless(cg.library(), "no libcgns")
    def test_written_by_libcgns(self):
        for kind in (cg.ADF, cg.HDF5):
            block = Block()
            steps = [Step(block), Step(block, c=False), Step(block)]
            with cg.CgnsFile(self.path, kind) as file:
                file.base()
                file.block("block_1", block.places)
                for n, step in enumerate(steps, 1):
                    file.solution(f"VertexSolutionAtStep{n}", cg.VERTEX, {"p": step.p})
                    if step.c is not None:
                        file.solution(f"CellCenterSolutionAtStep{n}", cg.CELL_CENTER, {"c": step.c})
                lib, number = file.lib, file.number
                file.check(lib.cg_biter_write(number, file.b, b"TimeIterValues", len(TIMES)))

                def go(*path):
                    file.check(lib.cg_goto(number, file.b, *path, b"end"))

                def array(name, data_type, shape, data):
                    file.check(lib.cg_array_write(name, data_type, len(shape), file.ints(shape), data))

                go(b"BaseIterativeData_t", 1)
                pointer, _kept = file.numbers(TIMES)
                array(b"TimeValues", cg.REAL_DOUBLE, [len(TIMES)], pointer)
                file.check(lib.cg_ziter_write(number, file.b, file.z, b"ZoneIterativeData"))
                go(b"Zone_t", file.z, b"ZoneIterativeData_t", 1)
                character = 5
                for name, texts in (("Flow", [f"SolutionAtStep{n}" for n in (1, 2, 3)]),
                                    ("Vertex", [f"VertexSolutionAtStep{n}" for n in (1, 2, 3)]),
                                    ("CellCenter", ["CellCenterSolutionAtStep1", "Null", "CellCenterSolutionAtStep3"])):
                    text = ctypes.c_char_p("".join(one.ljust(32) for one in texts).encode())
                    array(f"{name}SolutionPointers".encode(), character, [32, len(texts)], text)
            self.expect_steps(steps)

    def test_damage(self):
        block = Block((3, 4, 5))
        self.write(block, [Step(block), Step(block), Step(block)], self.tables(Vertex=[f"VertexSolutionAtStep{n}" for n in (1, 2, 3)]))
        self.expect_harmless(self.path)


if __name__ == "__main__":
    unittest.main(verbosity=2)
