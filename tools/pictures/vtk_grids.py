"""Structured grids by VTK's own readers, and pictures of a window by VTK. Needs Debian's python3-vtk9."""
import pathlib

import vtk


def blocks_of(files):
    """The grid's blocks, with their arrays at the points: those of cells too, where the points have none.

    FILES: a .vtk or .vts file, a CGNS file, or PLOT3D's grid and its Q or function file.
    """
    files = [pathlib.Path(file) for file in files]
    ending = files[0].suffix
    if ending in (".vtk", ".vts"):
        reader = vtk.vtkStructuredGridReader() if ending == ".vtk" else vtk.vtkXMLStructuredGridReader()
        reader.SetFileName(str(files[0]))
        reader.Update()
        return [with_point_data(reader.GetOutput())]
    reader = cgns_reader(files[0]) if ending == ".cgns" else plot3d_reader(files)
    reader.Update()
    blocks, at = [], reader.GetOutput().NewIterator()
    at.InitTraversal()
    while not at.IsDoneWithTraversal():
        blocks.append(with_point_data(at.GetCurrentDataObject()))
        at.GoToNextItem()
    return blocks


def cgns_reader(file):
    reader = vtk.vtkCGNSReader()
    reader.SetFileName(str(file))
    reader.UpdateInformation()
    reader.EnableAllBases()
    for n in range(reader.GetNumberOfPointArrays()):
        reader.SetPointArrayStatus(reader.GetPointArrayName(n), 1)
    for n in range(reader.GetNumberOfCellArrays()):
        reader.SetCellArrayStatus(reader.GetCellArrayName(n), 1)
    return reader


def plot3d_reader(files):
    reader = vtk.vtkMultiBlockPLOT3DReader()
    reader.AutoDetectFormatOn()
    reader.SetXYZFileName(str(files[0]))
    if len(files) > 1:
        (reader.SetFunctionFileName if files[1].suffix == ".fun" else reader.SetQFileName)(str(files[1]))
    return reader


def with_point_data(grid):
    if not grid.GetCellData().GetNumberOfArrays() or grid.GetPointData().GetNumberOfArrays():
        return grid
    to_points = vtk.vtkCellDataToPointData()
    to_points.SetInputData(grid)
    to_points.Update()
    return to_points.GetOutput()


def write_picture(window, path):
    """A .png or .ppm of what the window shows."""
    grab = vtk.vtkWindowToImageFilter()
    grab.SetInput(window)
    writer = vtk.vtkPNGWriter() if pathlib.Path(path).suffix == ".png" else vtk.vtkPNMWriter()
    writer.SetFileName(str(path))
    writer.SetInputConnection(grab.GetOutputPort())
    writer.Write()
