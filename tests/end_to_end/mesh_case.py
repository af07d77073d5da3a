"""What the tests of files with unstructured grids share: the program, a folder, and what `info` and `convert` make of a file."""
import vtk
from vtk.util.numpy_support import vtk_to_numpy

from format_case import PROGRAM, FormatCase, np  # noqa: F401


class MeshCase(FormatCase):
    def volume(self, path, scalar):
        return self.manifest(self.convert([path], scalar))["volume"]

    def check(self, path, grid):
        info = self.info(path)
        self.assertEqual(info["nodes"], grid.GetNumberOfPoints())
        curved = sum(grid.GetCellType(n) == vtk.VTK_QUADRATIC_HEXAHEDRON for n in range(grid.GetNumberOfCells()))
        self.assertEqual(info["cells"]["count"], grid.GetNumberOfCells() + 8 * curved)
        points = vtk_to_numpy(grid.GetPoints().GetData())
        used = np.zeros(len(points), bool)
        for n in range(grid.GetNumberOfCells()):
            cell = grid.GetCell(n)
            if cell.GetCellDimension() == 3:
                used[[cell.GetPointId(m) for m in range(cell.GetNumberOfPoints())]] = True
        self.assertEqual(info["unused_nodes"], int((~used).sum()))
        np.testing.assert_allclose(info["bounds"]["lower"], points[used].min(0), rtol=1e-6)
        np.testing.assert_allclose(info["bounds"]["upper"], points[used].max(0), rtol=1e-6)
        solid = np.array([grid.GetCell(n).GetCellDimension() == 3 for n in range(grid.GetNumberOfCells())])
        arrays = {"p": vtk_to_numpy(grid.GetPointData().GetArray("p"))[used],
                  "v:mag": np.linalg.norm(vtk_to_numpy(grid.GetPointData().GetArray("v"))[used], axis=1),
                  "c": vtk_to_numpy(grid.GetCellData().GetArray("c"))[solid]}
        scalars = {scalar["name"]: scalar for scalar in info["scalars"]}
        for name, values in arrays.items():
            self.assertAlmostEqual(scalars[name]["min"], values.min(), places=5)
            self.assertAlmostEqual(scalars[name]["max"], values.max(), places=5)
        return info
