"""A cube of side 1 in cells of every kind, as a grid of VTK, and VTK's files of it: for the tests of unstructured grids."""
import numpy as np
import vtk
from vtk.util.numpy_support import numpy_to_vtk

RANDOM = np.random.default_rng(1)

HEXAHEDRON_FACES = [(0, 1, 2, 3), (4, 7, 6, 5), (0, 4, 5, 1), (1, 5, 6, 2), (2, 6, 7, 3), (3, 7, 4, 0)]


def lattice(n):
    k, j, i = np.meshgrid(np.arange(n + 1), np.arange(n + 1), np.arange(n + 1), indexing="ij")
    points = np.stack([i, j, k], -1).reshape(-1, 3).astype("f8")
    inner = ((points > 0) & (points < n)).all(1)
    points[inner] += RANDOM.uniform(-0.15, 0.15, (inner.sum(), 3))
    return points / n


def hexahedra(n):
    number = np.arange((n + 1) ** 3).reshape(n + 1, n + 1, n + 1)
    at = lambda i, j, k: number[k:n + k, j:n + j, i:n + i].ravel()
    return np.stack([at(0, 0, 0), at(1, 0, 0), at(1, 1, 0), at(0, 1, 0), at(0, 0, 1), at(1, 0, 1), at(1, 1, 1), at(0, 1, 1)], 1)


def insert(grid, kind, points):
    grid.InsertNextCell(kind, len(points), [int(p) for p in points])


def cube(n=4, kinds=("hexahedron", "voxel", "tetrahedra", "wedges", "pyramids", "polyhedron", "quadratic", "face")):
    """A cube of side 1 in cells of all kinds, with scalars at points and in cells."""
    positions = list(lattice(n))
    grid = vtk.vtkUnstructuredGrid()
    grid.Allocate(1)
    for number, c in enumerate(hexahedra(n)):
        kind = kinds[number % len(kinds)]
        if kind == "voxel":
            insert(grid, vtk.VTK_VOXEL, c[[0, 1, 3, 2, 4, 5, 7, 6]])
        elif kind == "tetrahedra":
            for t in [(0, 1, 2, 6), (0, 2, 3, 6), (0, 3, 7, 6), (0, 7, 4, 6), (0, 4, 5, 6), (0, 5, 1, 6)]:
                insert(grid, vtk.VTK_TETRA, c[list(t)])
        elif kind == "wedges":
            insert(grid, vtk.VTK_WEDGE, c[[0, 1, 2, 4, 5, 6]])
            insert(grid, vtk.VTK_WEDGE, c[[0, 2, 3, 4, 6, 7]])
        elif kind == "pyramids":
            positions.append(np.mean([positions[p] for p in c], 0))
            for f in HEXAHEDRON_FACES:
                insert(grid, vtk.VTK_PYRAMID, [*c[list(f)], len(positions) - 1])
        elif kind == "polyhedron":
            faces = [6]
            for f in HEXAHEDRON_FACES:
                faces += [4, *(int(p) for p in c[list(f)])]
            ids = vtk.vtkIdList()
            for word in faces:
                ids.InsertNextId(word)
            grid.InsertNextCell(vtk.VTK_POLYHEDRON, ids)
        elif kind == "quadratic":
            edges = [(0, 1), (1, 2), (2, 3), (3, 0), (4, 5), (5, 6), (6, 7), (7, 4), (0, 4), (1, 5), (2, 6), (3, 7)]
            middles = []
            for a, b in edges:
                positions.append((positions[c[a]] + positions[c[b]]) / 2)
                middles.append(len(positions) - 1)
            insert(grid, vtk.VTK_QUADRATIC_HEXAHEDRON, [*c, *middles])
        else:
            if kind == "face":
                insert(grid, vtk.VTK_QUAD, c[:4])
            insert(grid, vtk.VTK_HEXAHEDRON, c)
    points = vtk.vtkPoints()
    points.SetData(numpy_to_vtk(np.array(positions), deep=True))
    grid.SetPoints(points)
    return with_scalars(grid)


def with_scalars(grid):
    values = {"p": (grid.GetPointData(), RANDOM.random(grid.GetNumberOfPoints()).astype("f4")),
              "v": (grid.GetPointData(), RANDOM.random((grid.GetNumberOfPoints(), 3))),
              "c": (grid.GetCellData(), RANDOM.random(grid.GetNumberOfCells()))}
    for name, (data, array) in values.items():
        array = numpy_to_vtk(array, deep=True)
        array.SetName(name)
        data.AddArray(array)
    return grid


def write_xml(grid, path, mode="Appended", compressor="ZLib", *, raw=True, order="LittleEndian", header="UInt32"):
    writer = vtk.vtkXMLUnstructuredGridWriter()
    writer.SetFileName(str(path))
    writer.SetInputData(grid)
    getattr(writer, f"SetDataModeTo{mode}")()
    getattr(writer, f"SetCompressorTypeTo{compressor}")()
    writer.SetEncodeAppendedData(not raw)
    getattr(writer, f"SetByteOrderTo{order}")()
    getattr(writer, f"SetHeaderTypeTo{header}")()
    writer.SetBlockSize(4096)
    writer.Write()


def write_legacy(grid, path, binary, version):
    writer = vtk.vtkUnstructuredGridWriter()
    writer.SetFileName(str(path))
    writer.SetInputData(grid)
    writer.SetFileVersion(version)
    writer.SetFileTypeToBinary() if binary else writer.SetFileTypeToASCII()
    writer.Write()
