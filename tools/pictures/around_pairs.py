#!/usr/bin/env python3
"""Draws what lies around a volume beside VTK's picture of the same data, with the same camera, functions and colours.

    xvfb-run tools/pictures/around_pairs.py DATA FOLDER [--program curvisplat]

DATA is a folder like shared/data. Writes FOLDER/around_NAME.png: ours at the left, VTK's at the right. Scenes: the delta
wing with its vortex, the blunt fin with fin and plate, a duct with a slice, a globe with a cut. VTK draws volumes from a
resampled image (128^3 points), surfaces and slices from the grid itself, smooth, with eight samples a pixel. Needs Debian's
python3-vtk9 and xvfb.
"""
import argparse
import pathlib
import struct
import subprocess
import zlib

import numpy as np
import vtk
from vtk.util.numpy_support import vtk_to_numpy

WIDTH, HEIGHT = 420, 300
GREY = (0.69, 0.69, 0.69)
VIRIDIS = [(0, 0.267, 0.005, 0.329), (0.125, 0.279, 0.175, 0.483), (0.25, 0.230, 0.322, 0.546), (0.375, 0.173, 0.449, 0.558),
           (0.5, 0.128, 0.567, 0.551), (0.625, 0.157, 0.684, 0.502), (0.75, 0.369, 0.789, 0.383), (0.875, 0.678, 0.864, 0.190),
           (1, 0.993, 0.906, 0.144)]

# volume: opacity points over the range, and their unit. faces: (axis, index, range of i), index -1: the last.
SCENES = {
    "wing": dict(files=["delta_wing/delta_vertex.cgns"], scalar="Density", vtk="Density", range=(0.86, 0.985),
                 volume=([(0, 0.8), (0.5, 0.2), (1, 0)], 0.02), faces=[(2, 0, (0, 23))], surface="kmin:i=0-23", opacity=1,
                 position=(-0.75, 1.5, 1.25), focal=(0.5, 0.45, 0.0), scale=0.52),
    "fin": dict(files=["bluntfin/bluntfinxyz.bin", "bluntfin/bluntfinq.bin"], scalar="density", vtk="Density", range=(1.1, 4),
                volume=([(0, 0), (0.3, 0.1), (1, 0.8)], 0.1), faces=[(1, 0, None), (2, 0, None)], surface="jmin,kmin", opacity=1,
                position=(-16, 24, 17), focal=(1.2, 2.5, 2), scale=5),
    "duct": dict(files=["cgns/sqnz_s.hdf.cgns"], scalar="Density", vtk="Density", range=(0.16, 0.97), surface="all", opacity=0.25,
                 slice=(0, 0.5, 0, 0, 1, 0), position=(-3, -4, 2.5), focal=(-0.1, 0.5, 0.5), scale=1.1),
    "globe": dict(generate="globe", scalar="f", vtk="Function0", slice=(0, 0, 0, 0, 1, 0), cut=(0, 0, 0, 0, 1, 0), surface="kmin",
                  opacity=1, faces=[(2, 0, None)], volume=([(0, 0.02), (0.5, 0.05), (1, 0.9)], None), position=(3, 9, 4),
                  focal=(0, 0, 0), scale=None),
}


def run(program, *words):
    done = subprocess.run([program, *map(str, words)], capture_output=True, text=True, check=False)
    if done.returncode:
        raise SystemExit(done.stderr)
    return done.stdout


def commas(numbers):
    return ",".join(f"{x:.9g}" for x in numbers)


def ours(program, cache, scene, picture):
    words = ["render", cache, "-o", picture, "--size", f"{WIDTH}x{HEIGHT}", "--scalar", scene["scalar"], "--tf", "viridis",
             "--range", commas(scene["range"]), f"--position={commas(scene['position'])}",
             f"--focal-point={commas(scene['focal'])}", "--parallel-scale", scene["scale"], "--view-up", "0,0,1"]
    if "volume" in scene:
        points, unit = scene["volume"]
        words += ["--opacity", ",".join(f"{x}:{a}" for x, a in points), "--opacity-unit", unit]
    else:
        words += ["--volume", "off"]
    if "surface" in scene:
        words += ["--surface", scene["surface"], "--surface-colour", "#b0b0b0", "--surface-opacity", scene["opacity"]]
    for option in ("slice", "cut"):
        if option in scene:
            words += [f"--{'clip-plane' if option == 'cut' else 'slice'}={commas(scene[option])}"]
    if scene.get("shade"):
        words += ["--shade"]
    run(program, *words)


def grids_of(files):
    if files[0].suffix == ".cgns":
        reader = vtk.vtkCGNSReader()
        reader.SetFileName(str(files[0]))
        reader.UpdateInformation()
        reader.EnableAllBases()
        for n in range(reader.GetNumberOfPointArrays()):
            reader.SetPointArrayStatus(reader.GetPointArrayName(n), 1)
        for n in range(reader.GetNumberOfCellArrays()):
            reader.SetCellArrayStatus(reader.GetCellArrayName(n), 1)
    else:
        reader = vtk.vtkMultiBlockPLOT3DReader()
        reader.AutoDetectFormatOn()
        reader.SetXYZFileName(str(files[0]))
        (reader.SetFunctionFileName if files[1].suffix == ".fun" else reader.SetQFileName)(str(files[1]))
    reader.Update()
    grids, at = [], reader.GetOutput().NewIterator()
    at.InitTraversal()
    while not at.IsDoneWithTraversal():
        grid = at.GetCurrentDataObject()
        if grid.GetCellData().GetNumberOfArrays() and not grid.GetPointData().GetNumberOfArrays():
            to_points = vtk.vtkCellDataToPointData()
            to_points.SetInputData(grid)
            to_points.Update()
            grid = to_points.GetOutput()
        grids.append(grid)
        at.GoToNextItem()
    return grids


def lit(mapper, scene, colour=None, opacity=1.0):
    """Colour none: by the scalar, unlit."""
    actor = vtk.vtkActor()
    actor.SetMapper(mapper)
    mapper.SetScalarVisibility(colour is None)
    if colour is None:
        mapper.SetLookupTable(colours(scene))
        mapper.SelectColorArray(scene["vtk"])
        mapper.SetScalarModeToUsePointFieldData()
        actor.GetProperty().LightingOff()
    else:
        actor.GetProperty().SetColor(*colour)
    actor.GetProperty().SetOpacity(opacity)
    return actor


def colours(scene):
    low, high = scene["range"]
    function = vtk.vtkColorTransferFunction()
    for x, r, g, b in VIRIDIS:
        function.AddRGBPoint(low + x * (high - low), r, g, b)
    return function


def faces_of(grid, scene):
    """Extracts of index planes; of `all`, the outer surface."""
    last = np.array(grid.GetExtent()).reshape(3, 2)
    if "faces" not in scene:
        geometry = vtk.vtkGeometryFilter()
        geometry.SetInputData(grid)
        return [geometry]
    extracts = []
    for axis, index, along_i in scene["faces"]:
        extent = last.copy()
        extent[axis] = last[axis][0] + index
        if along_i:
            extent[0] = along_i
        extract, geometry = vtk.vtkExtractGrid(), vtk.vtkGeometryFilter()
        extract.SetInputData(grid)
        extract.SetVOI(*extent.flatten().tolist())
        geometry.SetInputConnection(extract.GetOutputPort())
        extracts.append(geometry)
    return extracts


def volume_of(grids, scene):
    append = vtk.vtkAppendFilter()
    for grid in grids:
        append.AddInputData(grid)
    append.Update()
    sampler = vtk.vtkResampleToImage()
    sampler.SetInputDataObject(append.GetOutput())
    sampler.SetSamplingDimensions(128, 128, 128)
    sampler.Update()
    image = sampler.GetOutput()
    image.GetPointData().SetActiveScalars(scene["vtk"])
    low, high = scene["range"]
    points, unit = scene["volume"]
    opacity = vtk.vtkPiecewiseFunction()
    for x, a in points:
        opacity.AddPoint(low + x * (high - low), a)
    mapper, volume = vtk.vtkSmartVolumeMapper(), vtk.vtkVolume()
    mapper.SetInputData(image)
    if "cut" in scene:
        plane = vtk.vtkPlane()
        plane.SetOrigin(scene["cut"][:3])
        plane.SetNormal(scene["cut"][3:])
        mapper.AddClippingPlane(plane)
    volume.SetMapper(mapper)
    volume.GetProperty().SetScalarOpacity(opacity)
    volume.GetProperty().SetColor(colours(scene))
    volume.GetProperty().SetInterpolationTypeToLinear()
    volume.GetProperty().SetScalarOpacityUnitDistance(unit)
    if scene.get("shade"):
        volume.GetProperty().ShadeOn()
        volume.GetProperty().SetAmbient(0.3)
        volume.GetProperty().SetSpecular(0.25)
        volume.GetProperty().SetSpecularPower(32)
    return volume


def by_vtk(grids, scene, picture):
    renderer, window = vtk.vtkRenderer(), vtk.vtkRenderWindow()
    renderer.SetBackground(1, 1, 1)
    if "surface" in scene:
        for grid in grids:
            for face in faces_of(grid, scene):
                normals, mapper = vtk.vtkPolyDataNormals(), vtk.vtkPolyDataMapper()
                normals.SetInputConnection(face.GetOutputPort())
                mapper.SetInputConnection(normals.GetOutputPort())
                renderer.AddActor(lit(mapper, scene, GREY, scene["opacity"]))
    if "slice" in scene:
        for grid in grids:
            plane, cutter, mapper = vtk.vtkPlane(), vtk.vtkCutter(), vtk.vtkPolyDataMapper()
            plane.SetOrigin(scene["slice"][:3])
            plane.SetNormal(scene["slice"][3:])
            cutter.SetCutFunction(plane)
            cutter.SetInputData(grid)
            mapper.SetInputConnection(cutter.GetOutputPort())
            renderer.AddActor(lit(mapper, scene))
    if "volume" in scene:
        renderer.AddVolume(volume_of(grids, scene))
    window.SetOffScreenRendering(1)
    window.SetMultiSamples(8)
    window.SetSize(WIDTH, HEIGHT)
    if scene.get("opacity", 1) < 1:
        window.SetAlphaBitPlanes(1)
        window.SetMultiSamples(0)
        renderer.SetUseDepthPeeling(1)
        renderer.SetMaximumNumberOfPeels(8)
    window.AddRenderer(renderer)
    camera = renderer.GetActiveCamera()
    camera.ParallelProjectionOn()
    camera.SetPosition(*scene["position"])
    camera.SetFocalPoint(*scene["focal"])
    camera.SetViewUp(0, 0, 1)
    camera.SetParallelScale(scene["scale"])
    renderer.ResetCameraClippingRange()
    window.Render()
    grab, writer = vtk.vtkWindowToImageFilter(), vtk.vtkPNGWriter()
    grab.SetInput(window)
    writer.SetFileName(str(picture))
    writer.SetInputConnection(grab.GetOutputPort())
    writer.Write()


def pixels_of(path):
    reader = vtk.vtkPNGReader()
    reader.SetFileName(str(path))
    reader.Update()
    image = reader.GetOutput()
    values = vtk_to_numpy(image.GetPointData().GetScalars())
    return values.reshape(HEIGHT, WIDTH, -1)[::-1, :, :3]


def write_png(path, pixels):
    rows = b"".join(b"\0" + row.tobytes() for row in np.ascontiguousarray(pixels, np.uint8))

    def chunk(name, data):
        return struct.pack(">I", len(data)) + name + data + struct.pack(">I", zlib.crc32(name + data))

    header = struct.pack(">IIBBBBB", pixels.shape[1], pixels.shape[0], 8, 2, 0, 0, 0)
    path.write_bytes(b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", header) + chunk(b"IDAT", zlib.compress(rows, 9)) + chunk(b"IEND", b""))


def prepared(name, scene, data, folder, program):
    """The scene's files, and its cache."""
    if "generate" in scene:
        run(program, "generate", scene["generate"], "--size", "96x96x24", "-o", folder / name)
        files = [folder / f"{name}.xyz", folder / f"{name}.fun"]
    else:
        files = [data / file for file in scene["files"]]
    cache = folder / f"{name}.splats"
    run(program, "convert", *files, "-o", cache, "--overwrite")
    return files, cache


def main():
    arguments = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    arguments.add_argument("data", type=pathlib.Path)
    arguments.add_argument("folder", type=pathlib.Path)
    arguments.add_argument("--program", default="curvisplat")
    given = arguments.parse_args()
    given.folder.mkdir(parents=True, exist_ok=True)
    for name, scene in SCENES.items():
        files, cache = prepared(name, scene, given.data, given.folder, given.program)
        grids = grids_of(files)
        if scene["scale"] is None:
            bounds = np.array(grids[0].GetBounds())
            for grid in grids:
                other = np.array(grid.GetBounds())
                bounds[::2], bounds[1::2] = np.minimum(bounds[::2], other[::2]), np.maximum(bounds[1::2], other[1::2])
            radius = 0.5 * (bounds[1] - bounds[0])
            scalars = [grid.GetPointData().GetArray(scene["vtk"]).GetRange() for grid in grids]
            scene.update(scale=1.15 * radius, range=(min(s[0] for s in scalars), max(s[1] for s in scalars)),
                         volume=(scene["volume"][0], 0.05 * radius),
                         position=tuple(radius * x for x in scene["position"]))
        ours(given.program, cache, scene, given.folder / f"{name}_ours.png")
        by_vtk(grids, scene, given.folder / f"{name}_vtk.png")
        left, right = (pixels_of(given.folder / f"{name}_{of}.png") for of in ("ours", "vtk"))
        gap = np.full((HEIGHT, 8, 3), 128, np.uint8)
        write_png(given.folder / f"around_{name}.png", np.concatenate([left, gap, right], axis=1))


main()
