#!/usr/bin/env python3
"""Draws a structured PLOT3D grid by one of VTK's volume rendering techniques, and reports how long each part took.

    xvfb-run vtk_render.py JOB.json

JOB.json is written by compare_peers.py: files, scalar, technique, camera, size, function, frames and the picture to write.
A job with "write_tetrahedra" cuts the grid into tetrahedra and writes these to that .vtu file, which may be a job's grid.
The result, one JSON object, goes to standard output. Each picture has a process of its own, whose peak memory is the technique's.
Needs Debian's python3-vtk9, or any Python with VTK 9.
"""
import json
import math
import resource
import sys
import time

import vtk


def read_tetrahedra(job):
    reader = vtk.vtkXMLUnstructuredGridReader()
    reader.SetFileName(job["grid"])
    reader.Update()
    grid = reader.GetOutput()
    if grid.GetPointData().SetActiveScalars("scalar") < 0 and grid.GetCellData().SetActiveScalars("scalar") < 0:
        sys.exit(f"{job['grid']}: VTK does not find 'scalar' in it")
    return grid


def read_grid(job):
    """The first block, with the scalar in single precision at its points; or an unstructured grid of tetrahedra."""
    if job["grid"].endswith(".vtu"):
        return read_tetrahedra(job)
    reader = vtk.vtkMultiBlockPLOT3DReader()
    reader.AutoDetectFormatOn()
    reader.SetXYZFileName(job["grid"])
    (reader.SetQFileName if job["solution_kind"] == "q" else reader.SetFunctionFileName)(job["solution"])
    reader.Update()
    grid = reader.GetOutput().GetBlock(0)
    if grid is None or grid.GetPointData().GetArray(job["array"]) is None:
        sys.exit(f"{job['solution']}: VTK does not find {job['array']} in it")
    scalar = grid.GetPointData().GetArray(job["array"])
    single = vtk.vtkFloatArray()
    single.DeepCopy(scalar)
    single.SetName("scalar")
    out = vtk.vtkStructuredGrid()
    out.CopyStructure(grid)
    out.GetPointData().SetScalars(single)
    return out


def tetrahedra_of(grid):
    cut = vtk.vtkDataSetTriangleFilter()
    cut.TetrahedraOnlyOn()
    cut.SetInputData(grid)
    cut.Update()
    return cut.GetOutput(), {"tetrahedra": cut.GetOutput().GetNumberOfCells()}


def resampled(grid, samples):
    """A uniform grid over the bounds. Points outside of the cells are hidden, as in ParaView."""
    sampler = vtk.vtkResampleToImage()
    sampler.SetInputDataObject(grid)
    sampler.UseInputBoundsOn()
    sampler.SetSamplingDimensions(samples, samples, samples)
    sampler.Update()
    image = sampler.GetOutput()
    image.GetPointData().SetActiveScalars("scalar")
    return image, {"voxels": samples**3}


def build(job, grid):
    """Returns the volume's mapper with its data, and what to report about it."""
    technique = job["technique"]
    if technique == "resampled":
        image, told = resampled(grid, job["resample"])
        mapper = vtk.vtkGPUVolumeRayCastMapper()
        mapper.AutoAdjustSampleDistancesOff()
        mapper.SetSampleDistance(0.5 * min(image.GetSpacing()))
        mapper.SetInputData(image)
        return mapper, told
    if job["grid"].endswith(".vtu"):
        return mapper_of(technique, grid), {"tetrahedra": grid.GetNumberOfCells()}
    cells, told = tetrahedra_of(grid)
    return mapper_of(technique, cells), told


def mapper_of(technique, tetrahedra):
    mapper = {
        "projected-tetrahedra": vtk.vtkProjectedTetrahedraMapper,
        "ray-cast": vtk.vtkUnstructuredGridVolumeRayCastMapper,
        "zsweep": vtk.vtkUnstructuredGridVolumeZSweepMapper,
    }[technique]()
    if technique != "projected-tetrahedra":
        mapper.AutoAdjustSampleDistancesOff()
        mapper.SetImageSampleDistance(1)
        # The default integrates lines and loses precision in thin tetrahedra: 38, 12 and 24 dB instead of 46, 38 and 33.
        mapper.SetRayIntegrator(vtk.vtkUnstructuredGridHomogeneousRayIntegrator())
    mapper.SetInputData(tetrahedra)
    return mapper


def volume_property(job):
    """Colours and extinctions, linear between the job's points.

    The mappers of unstructured grids use what they call opacity as the extinction times the unit distance; projected
    tetrahedra store it in bytes, so the unit is chosen such that the largest is 1. The ray cast of images uses it as the
    opacity of a unit distance.
    """
    out = vtk.vtkVolumeProperty()
    unit = job["opacity_unit"]
    opacities = vtk.vtkPiecewiseFunction()
    if job["technique"] == "resampled":
        points = job["opacities"]
    else:
        points = [(value, -math.log1p(-opacity)) for value, opacity in job["opacities"]]
        largest = max(extinction for _, extinction in points)
        points = [(value, extinction / largest) for value, extinction in points]
        unit /= largest
    for value, opacity in points:
        opacities.AddPoint(value, opacity)
    colours = vtk.vtkColorTransferFunction()
    for value, red, green, blue in job["colours"]:
        colours.AddRGBPoint(value, red, green, blue)
    out.SetColor(colours)
    out.SetScalarOpacity(opacities)
    out.SetScalarOpacityUnitDistance(unit)
    out.SetInterpolationTypeToLinear()
    out.ShadeOff()
    return out


def place(renderer, where):
    camera = renderer.GetActiveCamera()
    camera.SetPosition(where["position"])
    camera.SetFocalPoint(where["focal_point"])
    camera.SetViewUp(where["view_up"])
    camera.ParallelProjectionOn()
    camera.SetParallelScale(where["parallel_scale"])
    renderer.ResetCameraClippingRange()


def scene_of(job, mapper):
    volume = vtk.vtkVolume()
    volume.SetMapper(mapper)
    volume.SetProperty(volume_property(job))
    renderer = vtk.vtkRenderer()
    renderer.SetBackground(1, 1, 1)
    renderer.AddVolume(volume)
    place(renderer, job["camera"])
    window = vtk.vtkRenderWindow()
    window.SetOffScreenRendering(1)
    window.SetMultiSamples(0)
    window.SetSize(job["size"])
    window.AddRenderer(renderer)
    return window, renderer.GetActiveCamera(), renderer


def write_picture(window, path):
    grab = vtk.vtkWindowToImageFilter()
    grab.SetInput(window)
    grab.SetInputBufferTypeToRGB()
    grab.ReadFrontBufferOff()
    grab.ShouldRerenderOff()
    writer = vtk.vtkPNGWriter()
    writer.SetFileName(path)
    writer.SetInputConnection(grab.GetOutputPort())
    writer.Write()


def drawn_by(window):
    for line in window.ReportCapabilities().splitlines():
        if line.startswith("OpenGL renderer string:"):
            return line.split(":", 1)[1].strip()
    return "unknown"


def main():
    with open(sys.argv[1]) as file:
        job = json.load(file)
    if "write_tetrahedra" in job:
        writer = vtk.vtkXMLUnstructuredGridWriter()
        writer.SetFileName(job["write_tetrahedra"])
        writer.SetInputData(tetrahedra_of(read_grid(job))[0])
        sys.exit(0 if writer.Write() else 1)
    clock = time.perf_counter
    begin = clock()
    grid = read_grid(job)
    loaded = clock()
    mapper, told = build(job, grid)
    built = clock()
    window, camera, renderer = scene_of(job, mapper)
    window.Render()
    window.WaitForCompletion()
    drawn = clock()
    write_picture(window, job["picture"])

    frames = []
    for _ in range(job["frames"]):
        # The camera moves a little, so that everything that depends on the view is recomputed.
        camera.Azimuth(0.01)
        renderer.ResetCameraClippingRange()
        start = clock()
        window.Render()
        window.WaitForCompletion()
        frames.append(clock() - start)
        if clock() - drawn > job["seconds"]:
            break
    json.dump({
        "vtk": vtk.vtkVersion().GetVTKVersion(),
        "drawn_by": drawn_by(window),
        "load_s": loaded - begin,
        "build_s": built - loaded,
        "first_frame_s": drawn - built,
        "frames_s": frames,
        "peak_memory_bytes": 1024 * resource.getrusage(resource.RUSAGE_SELF).ru_maxrss,
        **told,
    }, sys.stdout)


if __name__ == "__main__":
    main()
