#!/usr/bin/env python3
"""Draws a grid as ParaView's volume rendering does without any setting, by VTK alone.

    xvfb-run vtk_default_volume.py PICTURE.ppm SIDE SCALAR FILE...

The grid is resampled to 128^3 points (vtkResampleToImage) and drawn by vtkSmartVolumeMapper: opacity rises from 0 to 1 over
the scalar's range, colours are "Cool to Warm", the opacity unit is the diagonal over the cube root of the number of cells, the
camera looks along -z. The background is white, as in curvisplat's pictures. SCALAR is an array's name, NAME:x, NAME:y, NAME:z or
NAME:mag; mach_number and vorticity_magnitude are computed from density, momentum and energy.
Needs Debian's python3-vtk9.
"""
import sys

import numpy as np
import vtk
from vtk.util.numpy_support import numpy_to_vtk, vtk_to_numpy

import vtk_grids

SAMPLES = 128


def array(grid, name):
    data = grid.GetPointData().GetArray(name)
    return None if data is None else vtk_to_numpy(data).astype(float)


def flow(grid):
    """Density, momentum and energy, by the names that PLOT3D and CGNS give them."""
    density = array(grid, "Density")
    momentum = array(grid, "Momentum")
    if momentum is None:
        momentum = np.stack([array(grid, f"Momentum{axis}") for axis in "XYZ"], axis=1)
    energy = array(grid, "StagnationEnergy")
    return density, momentum, array(grid, "EnergyStagnationDensity") if energy is None else energy


def values_of(grid, name):
    if grid.GetPointData().GetArray(name.split(":")[0]) is None and grid.GetCellData().GetArray(name.split(":")[0]):
        to_points = vtk.vtkCellDataToPointData()
        to_points.SetInputData(grid)
        to_points.Update()
        grid.GetPointData().ShallowCopy(to_points.GetOutput().GetPointData())
    if name == "mach_number":
        density, momentum, energy = flow(grid)
        kinetic = 0.5 * (momentum**2).sum(axis=1) / density
        return np.sqrt(2 * kinetic / density / np.maximum(1e-12, 1.4 * 0.4 * (energy - kinetic) / density))
    if name == "vorticity_magnitude":
        density, momentum, _ = flow(grid)
        velocity = numpy_to_vtk(momentum / density[:, None], deep=1)
        velocity.SetName("velocity")
        grid.GetPointData().AddArray(velocity)
        gradient = vtk.vtkGradientFilter()
        gradient.SetInputData(grid)
        gradient.SetInputScalars(0, "velocity")
        gradient.ComputeVorticityOn()
        gradient.Update()
        return np.linalg.norm(vtk_to_numpy(gradient.GetOutput().GetPointData().GetArray("Vorticity")), axis=1)
    base, _, part = name.partition(":")
    values = array(grid, base)
    if part == "mag":
        return np.linalg.norm(values, axis=1)
    return values[:, "xyz".index(part)] if part else values


def one_grid(grids, name):
    append = vtk.vtkAppendFilter()
    for grid in grids:
        scalar = numpy_to_vtk(np.nan_to_num(values_of(grid, name)).astype(np.float32), deep=1)
        scalar.SetName("scalar")
        out = vtk.vtkStructuredGrid()
        out.CopyStructure(grid)
        ghosts = grid.GetPointData().GetArray("vtkGhostType")
        out.GetPointData().SetScalars(scalar)
        if ghosts:
            out.GetPointData().AddArray(ghosts)
        append.AddInputData(out)
    append.Update()
    return append.GetOutput()


def main():
    picture, side, name, files = sys.argv[1], int(sys.argv[2]), sys.argv[3], sys.argv[4:]
    grids = vtk_grids.blocks_of(files)
    grid = one_grid(grids, name) if len(grids) > 1 else grids[0]
    if len(grids) == 1:
        scalar = numpy_to_vtk(np.nan_to_num(values_of(grid, name)).astype(np.float32), deep=1)
        scalar.SetName("scalar")
        grid.GetPointData().SetScalars(scalar)
    low, high = grid.GetPointData().GetArray("scalar").GetRange()
    sampler = vtk.vtkResampleToImage()
    sampler.SetInputDataObject(grid)
    sampler.UseInputBoundsOn()
    sampler.SetSamplingDimensions(SAMPLES, SAMPLES, SAMPLES)
    sampler.Update()
    image = sampler.GetOutput()
    image.GetPointData().SetActiveScalars("scalar")
    high = high if high > low else low + 1
    opacity, colour = vtk.vtkPiecewiseFunction(), vtk.vtkColorTransferFunction()
    opacity.AddPoint(low, 0)
    opacity.AddPoint(high, 1)
    colour.SetColorSpaceToDiverging()
    colour.AddRGBPoint(low, 0.231373, 0.298039, 0.752941)
    colour.AddRGBPoint(0.5 * (low + high), 0.865003, 0.865003, 0.865003)
    colour.AddRGBPoint(high, 0.705882, 0.0156863, 0.14902)
    mapper, volume = vtk.vtkSmartVolumeMapper(), vtk.vtkVolume()
    mapper.SetInputData(image)
    volume.SetMapper(mapper)
    volume.GetProperty().SetScalarOpacity(opacity)
    volume.GetProperty().SetColor(colour)
    volume.GetProperty().SetInterpolationTypeToLinear()
    volume.GetProperty().SetScalarOpacityUnitDistance(grid.GetLength() / grid.GetNumberOfCells() ** (1 / 3))
    renderer, window = vtk.vtkRenderer(), vtk.vtkRenderWindow()
    renderer.SetBackground(1, 1, 1)
    renderer.AddVolume(volume)
    window.SetOffScreenRendering(1)
    window.SetSize(side, side)
    window.AddRenderer(renderer)
    renderer.ResetCamera()
    window.Render()
    vtk_grids.write_picture(window, picture)


main()
