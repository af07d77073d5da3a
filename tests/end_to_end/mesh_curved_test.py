#!/usr/bin/python3
"""mesh_curved_test.py CURVISPLAT

Cells of higher order, whose nodes are where VTK's own cells have them: straight ones fill their volume whatever the order of nodes
is, only if it is read right, and are cut into as many linear cells as their order. Exit status 77 (skipped) without python3-vtk9.
"""
import unittest

from mesh_case import MeshCase, np, vtk
from mesh_cubes import write_legacy, write_xml
from vtk.util.numpy_support import numpy_to_vtk

QUADRATIC = {vtk.VTK_QUADRATIC_TETRA: (8, 1 / 6), vtk.VTK_QUADRATIC_HEXAHEDRON: (9, 1), vtk.VTK_TRIQUADRATIC_HEXAHEDRON: (8, 1),
             vtk.VTK_BIQUADRATIC_QUADRATIC_HEXAHEDRON: (9, 1), vtk.VTK_QUADRATIC_WEDGE: (7, 1 / 2), vtk.VTK_BIQUADRATIC_QUADRATIC_WEDGE: (8, 1 / 2),
             vtk.VTK_QUADRATIC_LINEAR_WEDGE: (4, 1 / 2), vtk.VTK_QUADRATIC_PYRAMID: (6, 1 / 3),
             vtk.VTK_TRIQUADRATIC_PYRAMID: (10, 1 / 6)}
LAGRANGE = {vtk.VTK_LAGRANGE_HEXAHEDRON: (lambda n: (n + 1) ** 3, 1), vtk.VTK_LAGRANGE_WEDGE: (lambda n: (n + 1) ** 2 * (n + 2) // 2, 1 / 2),
            vtk.VTK_LAGRANGE_TETRAHEDRON: (lambda n: (n + 1) * (n + 2) * (n + 3) // 6, 1 / 6)}


def nodes_of(kind, order=2):
    """Where VTK has the nodes of a straight cell."""
    cell = vtk.vtkGenericCell.InstantiateCell(kind)
    if kind in LAGRANGE:
        count = LAGRANGE[kind][0](order)
        cell.GetPointIds().SetNumberOfIds(count)
        cell.GetPoints().SetNumberOfPoints(count)
        if kind != vtk.VTK_LAGRANGE_TETRAHEDRON:
            cell.SetUniformOrderFromNumPoints(count)
        else:
            cell.Initialize()
    count = cell.GetNumberOfPoints()
    if kind == vtk.VTK_LAGRANGE_TETRAHEDRON:
        places = []
        for n in range(count):
            index = [0] * 4
            cell.ToBarycentricIndex(n, index)
            places.append(np.array(index[:3]) / order)
        return np.array(places)
    if kind in (vtk.VTK_LAGRANGE_HEXAHEDRON, vtk.VTK_LAGRANGE_WEDGE):
        places = np.full((count, 3), np.nan)
        wedge = kind == vtk.VTK_LAGRANGE_WEDGE
        index_of = (vtk.vtkHigherOrderWedge if wedge else vtk.vtkHigherOrderHexahedron).PointIndexFromIJK
        for k in range(order + 1):
            for j in range(order + 1):
                for i in range(order + 1 - (j if wedge else 0)):
                    places[index_of(i, j, k, [order] * 3 + [count])] = i / order, j / order, k / order
        return places
    places = np.array(cell.GetParametricCoords()).reshape(-1, 3)
    if kind == vtk.VTK_QUADRATIC_PYRAMID:  # whose coordinates are those of a cube
        places[5:] = [(places[a] + places[b]) / 2 for a, b in ((0, 1), (1, 2), (2, 3), (3, 0), (0, 4), (1, 4), (2, 4), (3, 4))]
    return places


def grid_of(kind, points, cells, p=None):
    grid = vtk.vtkUnstructuredGrid()
    grid.Allocate(1)
    for nodes in cells:
        grid.InsertNextCell(kind, len(nodes), [int(n) for n in nodes])
    at = vtk.vtkPoints()
    at.SetData(numpy_to_vtk(np.ascontiguousarray(points), deep=True))
    grid.SetPoints(at)
    for data, name, values in ((grid.GetPointData(), "p", points[:, 0] if p is None else p), (grid.GetCellData(), "c", np.arange(len(cells)) + 1.0)):
        array = numpy_to_vtk(np.ascontiguousarray(values), deep=True)
        array.SetName(name)
        data.AddArray(array)
    return grid


def shell(order, sides=1):
    """A spherical shell from radius 1 to 2, of one layer of hexahedra: `sides` times `sides` on each face of a cube."""
    at = nodes_of(vtk.VTK_LAGRANGE_HEXAHEDRON, order)
    points, cells = [], []
    for axis in range(3):
        for sign in (-1, 1):
            for a in range(sides):
                for b in range(sides):
                    angle = np.pi / 4 * (2 * (at[:, :2] + [a, b]) / sides - 1)
                    direction = np.stack([np.full(len(at), float(sign)), sign * np.tan(angle[:, 0]), np.tan(angle[:, 1])], 1)
                    direction = np.roll(direction / np.linalg.norm(direction, axis=1)[:, None], axis, 1)
                    cells.append(np.arange(len(at)) + len(points) * len(at))
                    points.append(direction * (1 + at[:, 2:]))
    points = np.concatenate(points)
    _, first, numbers = np.unique(points.round(9) + 0.0, axis=0, return_index=True, return_inverse=True)
    return points[first], [numbers.ravel()[cell] for cell in cells]


class CurvedCells(MeshCase):
    def check_cut(self, grid, parts, volume):
        path = self.folder / "a.vtu"
        write_xml(grid, path)
        info = self.info(path)
        self.assertEqual(info["cells"]["count"], parts * grid.GetNumberOfCells())
        self.assertIn("linear ones", " ".join(info["notes"]))
        self.assertAlmostEqual(self.volume(path, "p"), volume, delta=1e-3 * volume)
        corners = self.info(path, "--order", "1")
        self.assertEqual(corners["cells"]["count"], grid.GetNumberOfCells())
        self.assertIn("drawn by their corners", " ".join(corners["warnings"]))

    def test_quadratic_cells(self):
        for kind, (parts, volume) in QUADRATIC.items():
            with self.subTest(kind=vtk.vtkCellTypes.GetClassNameFromTypeId(kind)):
                points = nodes_of(kind)
                self.check_cut(grid_of(kind, points, [range(len(points))]), parts, volume)

    def test_lagrange_cells(self):
        for kind, (_, volume) in LAGRANGE.items():
            for order in (2, 3, 4, 7, 10):
                with self.subTest(kind=vtk.vtkCellTypes.GetClassNameFromTypeId(kind), order=order):
                    points = nodes_of(kind, order)
                    self.check_cut(grid_of(kind, points, [range(len(points))]), order**3, volume)

    def test_a_shell_of_one_layer(self):
        exact = 4 * np.pi / 3 * (8 - 1)
        points, cells = shell(7)
        path = self.folder / "shell.vtu"
        write_xml(grid_of(vtk.VTK_LAGRANGE_HEXAHEDRON, points, cells), path)
        self.assertEqual(self.info(path)["cells"]["count"], 6 * 7**3)
        for scalar in ("p", "c"):
            # Splats' weights are rounded; before that it is right to 1e-6: tests/mesh/curved_cells_test.cpp. Flat parts: 0.98.
            self.assertAlmostEqual(self.volume(path, scalar) / exact, 1, delta=3e-4)

    def test_older_files(self):
        """Before VTK 9.1 two edges of a Lagrange hexahedron were in each other's place."""
        kind, path = vtk.VTK_LAGRANGE_HEXAHEDRON, self.folder / "a.vtu"
        points = nodes_of(kind, 3)
        points[:, 2] += 0.4 * points[:, 0] * (1 - points[:, 1])
        older = points.copy()
        older[[28, 29, 30, 31]] = points[[30, 31, 28, 29]]
        caches = []
        for places, version in ((points, "2.2"), (older, "1.0")):
            write_xml(grid_of(kind, places, [range(64)]), path, mode="Ascii")
            path.write_text(path.read_text().replace('version="2.2"', f'version="{version}"'))
            caches.append(self.manifest(self.convert([path], "c"))["volume"])
            write_legacy(grid_of(kind, places, [range(64)]), self.folder / "a.vtk", True, 51 if version == "2.2" else 42)
            caches.append(self.manifest(self.convert([self.folder / "a.vtk"], "c"))["volume"])
        self.assertEqual(len({round(volume, 6) for volume in caches}), 1)

    def bezier(self, kind, controls, values, weights=None, degrees=None):
        grid = grid_of(kind, controls, [range(len(controls))], values)
        for data, name, array in ((grid.GetPointData(), "RationalWeights", weights), (grid.GetCellData(), "HigherOrderDegrees", degrees)):
            if array is not None:
                array = numpy_to_vtk(np.array(array, dtype=float), deep=True)
                array.SetName(name)
                getattr(data, f"Set{name}")(array)
        return grid

    def probe(self, path, scalar, points):
        """The values of the grid's own cells."""
        table = self.folder / "points.txt"
        np.savetxt(table, points, delimiter=",")
        result = self.run_program("info", self.convert([path], scalar), "--probe", table, "--source")
        self.assertEqual(result.returncode, 0, result.stderr)
        return np.array([[float(word) for word in line.split(",")[:4]] for line in result.stdout.splitlines()[1:]])

    def test_bezier_cells(self):
        """Points within, and values there, as VTK's own cells have them: control points and weights at random."""
        random = np.random.default_rng(3)
        for kind, lagrange, order, degrees in ((vtk.VTK_BEZIER_HEXAHEDRON, vtk.VTK_LAGRANGE_HEXAHEDRON, 3, None), (vtk.VTK_BEZIER_WEDGE, vtk.VTK_LAGRANGE_WEDGE, 4, None),
                                               (vtk.VTK_BEZIER_TETRAHEDRON, vtk.VTK_LAGRANGE_TETRAHEDRON, 5, None), (vtk.VTK_BEZIER_HEXAHEDRON, None, 4, (4, 2, 3))):
            for rational in (False, True):
                with self.subTest(kind=kind, rational=rational):
                    if lagrange:
                        places = nodes_of(lagrange, order)
                    else:
                        places, (a, b, c) = np.empty((60, 3)), degrees
                        for i, j, k in np.ndindex(a + 1, b + 1, c + 1):
                            places[vtk.vtkHigherOrderHexahedron.PointIndexFromIJK(i, j, k, [*degrees, 60])] = i / a, j / b, k / c
                    controls = places + random.uniform(-0.05, 0.05, places.shape)
                    values = random.random(len(places))
                    grid = self.bezier(kind, controls, values, random.uniform(0.5, 2, len(places)) if rational else None, [degrees] if degrees else None)
                    path = self.folder / "a.vtu"
                    write_xml(grid, path)
                    inner = [p for p in places if (p > 1e-9).all() and (p < 1 - 1e-9).all() and (kind == vtk.VTK_BEZIER_HEXAHEDRON or p[0] + p[1] + p[2] * (kind == vtk.VTK_BEZIER_TETRAHEDRON) < 1 - 1e-9)]
                    self.assertGreater(len(inner), 3)
                    cell, at, expected = grid.GetCell(0), [], []
                    for place in inner:
                        point, shares = [0.0] * 3, [0.0] * len(places)
                        cell.EvaluateLocation(vtk.reference(0), place, point, shares)
                        at.append(point)
                        expected.append(np.dot(shares, values))
                    found = self.probe(path, "p", at)
                    np.testing.assert_allclose(found[:, 3], expected, atol=2e-6)
                    info = self.info(path)
                    self.assertEqual(info["cells"]["count"], (len(inner) and np.prod(degrees or (order,) * 3)))
                    self.assertEqual(self.info(path, "--order", "1")["nodes"], len(places))

    def test_a_rational_ring(self):
        """Four quarters of a ring, by rational cells of orders 2, 1 and 1; --order 1 draws their corners."""
        weight, degrees = np.sqrt(0.5), (2, 1, 1)
        places = np.empty((12, 3))
        for i, j, k in np.ndindex(3, 2, 2):
            places[vtk.vtkHigherOrderHexahedron.PointIndexFromIJK(i, j, k, [*degrees, 12])] = i, j, k
        i, j, k = places.T
        quarter = np.stack([(1 + j) * (i < 2), (1 + j) * (i > 0), 3 * k], 1)
        turned = [np.stack([c * quarter[:, 0] - s * quarter[:, 1], s * quarter[:, 0] + c * quarter[:, 1], quarter[:, 2]], 1) for c, s in ((1, 0), (0, 1), (-1, 0), (0, -1))]
        points = np.concatenate(turned)
        grid = grid_of(vtk.VTK_BEZIER_HEXAHEDRON, points, np.arange(48).reshape(4, 12))
        weights = numpy_to_vtk(np.tile(np.where(i == 1, weight, 1), 4), deep=True)
        weights.SetName("RationalWeights")
        grid.GetPointData().SetRationalWeights(weights)
        orders = numpy_to_vtk(np.tile(np.array(degrees, float), (4, 1)), deep=True)
        orders.SetName("HigherOrderDegrees")
        grid.GetCellData().SetHigherOrderDegrees(orders)
        path, exact = self.folder / "ring.vtu", np.pi * (4 - 1) * 3
        write_xml(grid, path)
        self.assertEqual(self.info(path)["cells"]["count"], 8)
        for scalar in ("p", "c"):
            self.assertAlmostEqual(self.volume(path, scalar) / exact, 1, delta=1e-3)
        np.testing.assert_allclose(self.info(path)["bounds"]["upper"], (2, 2, 3), atol=1e-12)

    def test_lagrange_cells_of_several_orders(self):
        """HigherOrderDegrees: 2 x 2 x 5 nodes are as many as a quadratic hexahedron has at its corners and edges."""
        degrees = (1, 1, 4)
        places = np.empty((20, 3))
        for i, j, k in np.ndindex(2, 2, 5):
            places[vtk.vtkHigherOrderHexahedron.PointIndexFromIJK(i, j, k, [*degrees, 20])] = i, j, k / 4
        places[:, 0] += np.sin(np.pi * places[:, 2])
        grid = self.bezier(vtk.VTK_LAGRANGE_HEXAHEDRON, places, places[:, 2], degrees=[degrees])
        path = self.folder / "a.vtu"
        write_xml(grid, path)
        self.assertEqual(self.info(path)["cells"]["count"], 4)
        self.assertAlmostEqual(self.volume(path, "p"), 1, delta=1e-3)

    def test_cells_without_a_known_order(self):
        """Pyramids of Lagrange and Bezier, whose nodes have no order in VTK, and numbers of nodes that no order has."""
        points = nodes_of(vtk.VTK_LAGRANGE_HEXAHEDRON, 2)
        path = self.folder / "a.vtu"
        for kind, count in ((vtk.VTK_BEZIER_PYRAMID, 14), (vtk.VTK_BEZIER_HEXAHEDRON, 20), (vtk.VTK_BEZIER_HEXAHEDRON, 26)):
            write_xml(grid_of(kind, points[:count], [range(count)]), path)
            info = self.info(path)
            self.assertEqual(info["cells"]["count"], 1)
            self.assertIn("1 of 1 solid cells are quadratic or of higher order; they are drawn by their corners", info["warnings"])


if __name__ == "__main__":
    unittest.main()
