#!/usr/bin/python3
"""mesh_tecplot_test.py CURVISPLAT

Tecplot's zones of finite elements, text and binary, written from its Data Format Guide: mesh_formats.py says how. Exit status 77
(skipped) without python3-vtk9.
"""
import unittest

from mesh_cubes import write_xml
from mesh_formats import Mesh, MeshFormats, np
from tecplot_files import Binary

NAMES = {4: ("FETETRAHEDRON", "TETRAHEDRON", 4), 8: ("FEBRICK", "BRICK", 5)}


class TecplotMeshes(MeshFormats):
    def setUp(self):
        super().setUp()
        self.path = self.folder / "a.dat"

    def write_text(self, zones):
        """Of (words of the header, rows of numbers)."""
        lines = ['VARIABLES = "X" "Y" "Z" "p" "c"']
        for words, rows in zones:
            lines += [f"ZONE {words}", *(" ".join(map(repr, np.asarray(row).tolist())) for row in rows)]
        self.path.write_text("\n".join(lines) + "\n")
        return self.path

    def blocks(self, mesh, elements=True):
        return [*mesh.points.T, mesh.p, mesh.c, *((np.array(mesh.cells) + 1) if elements else [])]

    def words(self, mesh, kind):
        return f"N={len(mesh.points)}, E={len(mesh.cells)}, ZONETYPE={NAMES[kind][0]}, DATAPACKING=BLOCK, VARLOCATION=([5]=CELLCENTERED)"

    def test_text(self):
        for kind in (4, 8):
            mesh = Mesh(2, (kind,))
            self.expect_same([self.write_text([(self.words(mesh, kind), self.blocks(mesh))])], mesh.vtk())
            # By points, in the words of older files; c is a variable of nodes then.
            rows = [*np.column_stack([mesh.points, mesh.p, mesh.p]), *(np.array(mesh.cells) + 1)]
            self.write_text([(f"T=\"a\", N={len(mesh.points)}, E={len(mesh.cells)}, F=FEPOINT, ET={NAMES[kind][1]}", rows)])
            self.expect_same([self.path], mesh.vtk(), {"c": None})
            # The counts as I and J, as before version 10 and as FUN3D writes them.
            self.write_text([(f"t=\"a\", i={len(mesh.points)}, j={len(mesh.cells)}, f=fepoint, et={NAMES[kind][1].lower()}, solutiontime= 0.1250E+00, strandid=1", rows)])
            self.expect_same([self.path], mesh.vtk(), {"c": None})

    def test_shared_elements(self):
        mesh, words = Mesh(2, (8,)), None
        words = self.words(mesh, 8)
        zones = [(words + ", SOLUTIONTIME=1, STRANDID=1", self.blocks(mesh))]
        first = mesh.p
        mesh.p = mesh.p[::-1].copy()
        zones.append((words + ", SOLUTIONTIME=2, STRANDID=1, VARSHARELIST=([1-3]=1), CONNECTIVITYSHAREZONE=1", [mesh.p, mesh.c]))
        self.write_text(zones)
        self.expect_same([self.path], mesh.vtk(), options=["--time-step", 1])
        mesh.p = first
        self.expect_same([self.path], mesh.vtk(), options=["--time-step", 0])
        file = Binary(["X", "Y", "Z", "p", "c"])
        arrays = [*mesh.points.T.copy(), mesh.p, mesh.c]
        options = {"centrings": [0, 0, 0, 0, 1], "zone_type": 5, "elements": mesh.cells, "strand": 0}
        file.zone(len(mesh.points), arrays, time=1.0, **options)
        file.zone(len(mesh.points), [None] * 3 + [first[::-1].copy(), mesh.c], time=2.0, shared=[0, 0, 0, -1, -1], elements_of=0, **options)
        file.write(self.path)
        mesh.p = first[::-1].copy()
        self.expect_same([self.path], mesh.vtk(), options=["--time-step", 1])

    def test_binary(self):
        for kind in (4, 8):
            for order, version, neighbours in (("<", 112, False), (">", 107, True)):
                mesh = Mesh(2, (kind,))
                file = Binary(["X", "Y", "Z", "p", "c"], version=version, order=order)
                file.zone(len(mesh.points), [*mesh.points.T.copy(), mesh.p, mesh.c], centrings=[0, 0, 0, 0, 1], zone_type=NAMES[kind][2],
                          elements=mesh.cells, face_neighbours=neighbours)
                file.zone(len(mesh.points), [*mesh.points.T.copy() + 7, mesh.p, mesh.c], centrings=[0, 0, 0, 0, 1], zone_type=NAMES[kind][2],
                          elements=mesh.cells)
                file.write(self.path)
                info = self.info(self.path)
                self.assertEqual(len(info["pieces"]), 2)
                self.assertIn("2 zones of finite elements", info["format"])
                self.assertAlmostEqual(self.volume([self.path], "c"), 2, delta=4e-3)

    def test_surfaces_beside_the_volume(self):
        """As solvers save the walls and the volume in one file: the walls come first, and have lines of their own."""
        mesh = Mesh(2, (8,))
        surfaces = [("FETRIANGLE", [[0, 1, 4]]), ("FEQUADRILATERAL", [[0, 1, 4, 3], [1, 2, 5, 4]]), ("FELINESEG", [[0, 1]])]
        wall = [*mesh.points[:9].T, mesh.p[:9]]
        zones = [(f'T="wall", N=9, E={len(cells)}, ZONETYPE={name}, DATAPACKING=BLOCK, VARLOCATION=([5]=CELLCENTERED)',
                  [*wall, np.ones(len(cells)), *(np.array(cells) + 1)]) for name, cells in surfaces]
        zones.insert(2, (self.words(mesh, 8), self.blocks(mesh)))
        self.expect_same([self.write_text(zones)], mesh.vtk())
        self.assertIn("3 of 4 zones are flat and left out, such as zone 1 (wall) of FETRIANGLE", self.info(self.path)["warnings"])
        self.expect_line(self.write_text(zones[:2]), words="has no zone with volume: zone 1 (wall) of FETRIANGLE")
        for version, neighbours in ((112, False), (107, True)):
            file = Binary(["X", "Y", "Z", "p", "c"], version=version)
            for number, (_, cells) in zip((2, 3, 1), surfaces):
                file.zone(9, [*map(np.ascontiguousarray, wall), np.ones(len(cells))], centrings=[0, 0, 0, 0, 1], zone_type=number,
                          elements=cells, face_neighbours=neighbours)
            file.zone(len(mesh.points), [*mesh.points.T.copy(), mesh.p, mesh.c], centrings=[0, 0, 0, 0, 1], zone_type=5, elements=mesh.cells)
            file.write(self.path)
            self.expect_same([self.path], mesh.vtk())

    def polyhedra(self, mesh):
        """VTK's grid of polyhedra; the corners of the faces, and the elements on their left and right, from 0, -1 outside."""
        corners, sides, of_cells = mesh.faces()
        grid = mesh.vtk([[corners[n][::-1] if turned else corners[n] for n, turned in faces] for faces in of_cells])
        return grid, corners, [side[0] for side in sides], [side[1] if len(side) > 1 else -1 for side in sides]

    def expect_same_volumes(self, grid, **options):
        """Which side a face is seen from moves a splat by a rounding."""
        vtu = self.folder / "expected.vtu"
        write_xml(grid, vtu)
        for name in "pc":
            self.assertAlmostEqual(self.volume([self.path], name), self.volume([vtu], name), places=6)
        found, expected = self.info(self.path), self.info(vtu)
        self.assertEqual(found["cells"], expected["cells"])
        self.assertEqual([(s["min"], s["max"]) for s in found["scalars"]], [(s["min"], s["max"]) for s in expected["scalars"]])

    def test_polyhedra(self):
        mesh = Mesh(2, (8, 4, 6, 5))
        grid, corners, left, right = self.polyhedra(mesh)
        count = f"NODES={len(mesh.points)}, FACES={len(corners)}, ELEMENTS={len(mesh.cells)}, TOTALNUMFACENODES={sum(map(len, corners))}"
        head = "DATAPACKING=BLOCK, VARLOCATION=([5]=CELLCENTERED), NUMCONNECTEDBOUNDARYFACES="
        rows = [*self.blocks(mesh, False), [len(face) for face in corners], *(np.array(face) + 1 for face in corners), np.array(left) + 1, np.array(right) + 1]
        for connected in (0, 1):
            words = f"{count}, ZONETYPE=FEPOLYHEDRON, {head}{connected}, TOTALNUMBOUNDARYCONNECTIONS={2 * connected}"
            if connected:
                rows[-1] = np.where(rows[-1] == 0, -1, rows[-1])
                rows += [[2], [1, 2], [2, 2]]
            wall = (f"T=wall, NODES=3, FACES=3, ELEMENTS=1, ZONETYPE=FEPOLYGON, {head}0, TOTALNUMBOUNDARYCONNECTIONS=0",
                    [*mesh.points[:3].T, mesh.p[:3], [1.0], [1, 2, 2, 3, 3, 1], [1, 1, 1], [0, 0, 0]])
            self.write_text([wall, (words, rows)])
            self.expect_same_volumes(grid)
            self.assertIn("1 of 2 zones are flat and left out, such as zone 1 (wall) of FEPOLYGON", self.info(self.path)["warnings"])
        arrays = [*mesh.points.T.copy(), mesh.p, mesh.c]
        for order, from_one, connected in (("<", 0, ()), (">", 1, (1, 2))):
            file = Binary(["X", "Y", "Z", "p", "c"], order=order)
            file.zone(3, [*mesh.points[:3].T.copy(), mesh.p[:3], np.ones(1)], centrings=[0, 0, 0, 0, 1], zone_type=6, elements=[0],
                      faces=([[0, 1], [1, 2], [2, 0]], [0] * 3, [-1] * 3))
            faces = (corners, np.array(left) + from_one, np.array(right) + from_one, *connected)
            file.zone(len(mesh.points), arrays, centrings=[0, 0, 0, 0, 1], zone_type=7, elements=mesh.cells, faces=faces)
            file.zone(len(mesh.points), [a + 7 for a in arrays[:3]] + arrays[3:], centrings=[0, 0, 0, 0, 1], zone_type=7, elements=mesh.cells,
                      elements_of=1, faces=faces)
            file.write(self.path)
            self.assertEqual(len(self.info(self.path)["pieces"]), 2)
            self.assertAlmostEqual(self.volume([self.path], "c"), 2, delta=4e-3)

    def test_polyhedra_that_are_damaged(self):
        mesh = Mesh(2, (8,))
        _, corners, left, right = self.polyhedra(mesh)
        words = (f"NODES={len(mesh.points)}, FACES={len(corners)}, ELEMENTS={len(mesh.cells)}, TOTALNUMFACENODES={4 * len(corners)}, ZONETYPE=FEPOLYHEDRON, "
                 "DATAPACKING=BLOCK, VARLOCATION=([5]=CELLCENTERED)")
        rows = [*self.blocks(mesh, False), [4] * len(corners), *(np.array(face) + 1 for face in corners), np.array(left) + 1, np.array(right) + 1]
        changed = lambda at, values: rows[:at] + [values] + rows[at + 1:]
        for zone, told in (((words.replace("FACES=36, ", ""), rows), "has no number of faces"),
                           ((words, changed(5, [5] + [4] * 35)), "begin at 145; expected 141 to 144"), ((words, changed(-2, [99] + list(np.array(left[1:]) + 1))), "belongs to element 99"),
                           ((words, rows[:-1]), "numbers; expected"), ((words, changed(6, [1, 2, 3, 999])), "refers to point")):
            self.expect_line(self.write_text([zone]), words=told)
        self.write_text([(words, rows)])
        self.assertGreater(self.expect_harmless(self.path), 0.3)
        file = Binary(["X", "Y", "Z", "p", "c"])
        file.zone(len(mesh.points), [*mesh.points.T.copy(), mesh.p, mesh.c], centrings=[0, 0, 0, 0, 1], zone_type=7, elements=mesh.cells, faces=(corners, left, right))
        file.write(self.path)
        self.assertGreater(self.expect_harmless(self.path), 0.3)

    def test_what_is_refused(self):
        mesh = Mesh(2, (8,))
        words, rows = self.words(mesh, 8), self.blocks(mesh)
        for changed, told in (((words.replace("E=8", "E=9"), rows), "numbers; expected"), ((words.replace("E=8", "E=99999999999999"), rows), "unknown value"),
                              ((words.replace("FEBRICK", "FEPRISM"), rows), "a kind of elements"), ((words.replace("E=8, ", ""), rows), "without NODES"),
                              ((words, rows[:-1] + [[1, 2, 3, 4, 5, 6, 7, 99]]), "refers to point 98"), ((words, rows[:-1] + [[0, 2, 3, 4, 5, 6, 7, 8]]), "refers to point"),
                              ((words + ", CONNECTIVITYSHAREZONE=3", rows[:-8]), "unknown value")):
            self.expect_line(self.write_text([changed]), words=told)

    def test_damage(self):
        mesh = Mesh(2, (8,))
        self.write_text([(self.words(mesh, 8), self.blocks(mesh))])
        self.assertGreater(self.expect_harmless(self.path), 0.3)
        file = Binary(["X", "Y", "Z", "p", "c"])
        file.zone(len(mesh.points), [*mesh.points.T.copy(), mesh.p, mesh.c], centrings=[0, 0, 0, 0, 1], zone_type=5, elements=mesh.cells)
        file.write(self.path)
        self.assertGreater(self.expect_harmless(self.path), 0.3)


if __name__ == "__main__":
    unittest.main()
