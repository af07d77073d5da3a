"""What the tests of structured formats share. Each grid is written in the format under test, and by VTK: the caches are equal byte
by byte (format_case.py), so that every coordinate, value and blanked sample is the same. Where VTK reads the format, it is asked,
too.
"""
import sys

from format_case import PROGRAM, FormatCase, np  # noqa: F401

try:
    import vtk
    from vtk.util.numpy_support import numpy_to_vtk
except ModuleNotFoundError as error:
    print(f"skipped: {error}; install python3-vtk9")
    sys.exit(77)

RANDOM = np.random.default_rng(11)


class Block:
    """Curved nodes, indexed (k, j, i), a field `p` of the nodes and a field `c` of the cells. No two dimensions are equal."""

    def __init__(self, shape=(6, 5, 7), shift=0.0, kind="f8"):
        k, j, i = np.meshgrid(*map(np.arange, shape), indexing="ij")
        bent = 0.3 * np.sin(0.5 * k + 0.2 * j)
        self.places = np.stack([i + shift + bent, j + 0.1 * i, k + 0.2 * np.cos(0.3 * i)]).astype(kind)
        self.p = RANDOM.random(shape).astype(kind)
        self.c = RANDOM.random([n - 1 for n in shape]).astype(kind)
        self.shape = shape

    def vtk(self):
        grid, points = vtk.vtkStructuredGrid(), vtk.vtkPoints()
        points.SetData(numpy_to_vtk(np.moveaxis(self.places, 0, -1).reshape(-1, 3).copy(), deep=True))
        grid.SetDimensions(*self.shape[::-1])
        grid.SetPoints(points)
        for data, name in ((grid.GetPointData(), "p"), (grid.GetCellData(), "c")):
            array = numpy_to_vtk(getattr(self, name).ravel(), deep=True)
            array.SetName(name)
            data.AddArray(array)
        return grid


class StructuredFormats(FormatCase):
    RANDOM = RANDOM

    def vtk_file(self, blocks):
        """VTK's own file of the blocks."""
        path = self.folder / "expected.vtm"
        collection = vtk.vtkMultiBlockDataSet()
        for n, block in enumerate(blocks):
            collection.SetBlock(n, block.vtk())
        writer = vtk.vtkXMLMultiBlockDataWriter()
        writer.SetFileName(str(path))
        writer.SetInputData(collection)
        writer.Write()
        return path

    def expect_same(self, paths, blocks, names=None, options=()):
        """The files and VTK's file of the blocks give the same caches. `names`: what the files call p and c; None: nothing."""
        self.expect_same_caches(paths, self.vtk_file(blocks), names, options)
