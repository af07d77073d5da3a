#!/usr/bin/env python3
"""Draws what lies around a volume beside VTK's picture of the same data, with the same camera, functions, colours and light.

    xvfb-run tools/pictures/around_pairs.py DATA FOLDER [--program curvisplat] [--only NAME]

DATA is a folder like shared/data. Writes FOLDER/around_NAME.png: ours at the left, VTK's at the right, and each alone as
NAME_ours.png and NAME_vtk.png. Scenes: the delta wing with its vortex, the blunt fin with fin and plate, a duct with a slice, a
globe with a cut; the wing with its vortex lines, a sea with coast and points, a torus with field lines, as tubes and spheres. VTK draws the best that a patient user gets of it: no resampled volume, but the grid's own cells, cut into
tetrahedra (vtkProjectedTetrahedraMapper) and clipped as such, with the same extinction per length; surfaces and slices from the
grid itself, blocks joined, smooth, with our light; all of it at twice the size and averaged. Needs Debian's python3-vtk9, and xvfb.
"""
import argparse
import math
import pathlib
import struct
import subprocess
import zlib

import numpy as np
import vtk
from vtk.util.numpy_support import vtk_to_numpy

import flow_lines
import vtk_grids

WIDTH, HEIGHT = 480, 360
FINER = 2  # VTK's picture, before it is averaged
GREY = (0.69, 0.69, 0.69)
VIRIDIS = [(0, 0.267, 0.005, 0.329), (0.125, 0.279, 0.175, 0.483), (0.25, 0.230, 0.322, 0.546), (0.375, 0.173, 0.449, 0.558),
           (0.5, 0.128, 0.567, 0.551), (0.625, 0.157, 0.684, 0.502), (0.75, 0.369, 0.789, 0.383), (0.875, 0.678, 0.864, 0.190),
           (1, 0.993, 0.906, 0.144)]

# volume: opacity points over the range, and their unit. faces: (axis, index, range of i); none: the outer surface. Lengths of the
# globe are in its radii.
SCENES = {
    "wing": dict(files=["delta_wing/delta_vertex.cgns"], scalar="Density", vtk="Density", range=(0.86, 0.985),
                 volume=([(0, 0.8), (0.5, 0.2), (1, 0)], 0.02), faces=[(2, 0, (0, 23))], surface="kmin:i=0-23", opacity=1,
                 position=(-0.75, 1.5, 1.25), focal=(0.62, 0.22, 0.02), scale=0.42),
    "fin": dict(files=["bluntfin/bluntfinxyz.bin", "bluntfin/bluntfinq.bin"], scalar="density", vtk="Density", range=(1.1, 4),
                volume=([(0, 0), (0.3, 0.1), (1, 0.8)], 0.1), faces=[(1, 0, None), (2, 0, None)], surface="jmin,kmin", opacity=1,
                position=(-16, 24, 17), focal=(1.2, 2.5, 2), scale=5),
    "duct": dict(files=["cgns/sqnz_s.hdf.cgns"], scalar="Density", vtk="Density", range=(0.16, 0.97), surface="all", opacity=0.25,
                 slice=(0, 0.5, 0, 0, 1, 0), position=(-3, -4, 2.5), focal=(-0.1, 0.5, 0.5), scale=1.1),
    "globe": dict(generate="globe", scalar="f", vtk="Function0", slice=(0, 0, 0, 0, 1, 0), cut=(0, 0, 0, 0, 1, 0), surface="kmin",
                  opacity=1, faces=[(2, 0, None)], volume=([(0, 0.02), (0.5, 0.05), (1, 0.9)], 0.05), position=(3, 9, 4),
                  focal=(0, 0, 0), scale=1.15, of_radius=True),
    "wing_lines": dict(files=["delta_wing/delta_vertex.cgns"], scalar="Density", vtk="Density", range=(0.86, 0.985),
                       volume=([(0, 0.8), (0.5, 0.2), (1, 0)], 0.05), faces=[(2, 0, (0, 23))], surface="kmin:i=0-23", opacity=1,
                       position=(-0.9, 1.2, 0.9), focal=(0.5, 0.14, 0.06), scale=0.3, made=flow_lines.wing,
                       tubes=[("wing_vortex_lines.vtp", 0.004, "#ffd040"), ("wing_streamlines.vtp", 0.004, "#58c8ff")]),
    "sea": dict(files=["nemo_northsea/nemo_northsea_u.xyz", "nemo_northsea/nemo_northsea_u.fun"], scalar="uo", vtk="Function0",
                range=(-0.4, 0.4), volume=([(0, 0.9), (0.3, 0.25), (0.5, 0.04), (0.7, 0.25), (1, 0.9)], 4), blanked=True,
                position=(6000, -760, 10500), focal=(3000, -380, 5250), scale=900, made=flow_lines.sea,
                tubes=[("sea_coast.vtp", 8, "#303030")], balls=[("sea_points.vtp", 24, "#ff8000")]),
    "torus": dict(made=flow_lines.torus, scalar="pressure", vtk="pressure", range=(0, 1),
                  volume=([(0, 0), (0.3, 0.1), (1, 0.5)], 0.3), position=(-7, -9, 7), focal=(0, 0, 0), scale=3.3,
                  tubes=[("torus_lines.vtp", 0.06, "#c04080")]),
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
             f"--focal-point={commas(scene['focal'])}", "--parallel-scale", scene["scale"], "--view-up", "0,0,1",
             "--background", "white"]
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
    for option, size, things in (("--lines", "--line-width", "tubes"), ("--points", "--point-size", "balls")):
        for file, width, _ in scene.get(things, []):
            words += [option, picture.parent / file, size, width] if size not in words else [option, picture.parent / file]
    for *_, colour in scene.get("tubes", []) + scene.get("balls", []):
        words += ["--lines-colour", colour]
    run(program, *words)


def colours(scene):
    low, high = scene["range"]
    function = vtk.vtkColorTransferFunction()
    for x, r, g, b in VIRIDIS:
        function.AddRGBPoint(low + x * (high - low), r, g, b)
    return function


def actor_of(port, scene, colour=None, opacity=1.0):
    """Colour none: by the scalar, unlit. Light as ours."""
    actor, mapper = vtk.vtkActor(), vtk.vtkPolyDataMapper()
    mapper.SetInputConnection(port)
    actor.SetMapper(mapper)
    mapper.SetScalarVisibility(colour is None)
    look = actor.GetProperty()
    if colour is None:
        mapper.SetLookupTable(colours(scene))
        mapper.SelectColorArray(scene["vtk"])
        mapper.SetScalarModeToUsePointFieldData()
        mapper.InterpolateScalarsBeforeMappingOn()
        look.LightingOff()
    else:
        look.SetColor(*colour)
        look.SetInterpolationToPhong()
        look.SetAmbient(0.3)
        look.SetDiffuse(0.7)
    look.SetOpacity(opacity)
    return actor


def joined(grids, scene):
    """The blocks as one grid of cells, whose points are shared where blocks meet."""
    append = vtk.vtkAppendFilter()
    append.MergePointsOn()
    for grid in grids:
        append.AddInputData(grid)
    append.Update()
    append.GetOutput().GetPointData().SetActiveScalars(scene["vtk"])
    return append.GetOutput()


def faces_of(grids, scene):
    """Ports with the outer surface, or with index planes."""
    if "faces" not in scene:
        outside = vtk.vtkDataSetSurfaceFilter()
        outside.SetInputData(joined(grids, scene))
        return [outside]
    faces = []
    for grid in grids:
        last = np.array(grid.GetExtent()).reshape(3, 2)
        for axis, index, along_i in scene["faces"]:
            extent = last.copy()
            extent[axis] = last[axis][0] + index
            if along_i:
                extent[0] = along_i
            extract, geometry = vtk.vtkExtractGrid(), vtk.vtkGeometryFilter()
            extract.SetInputData(grid)
            extract.SetVOI(*extent.flatten().tolist())
            geometry.SetInputConnection(extract.GetOutputPort())
            faces.append(geometry)
    return faces


def things_of(scene, folder):
    """Ports with lines as tubes and points as spheres, and their colours."""
    for file, width, colour in scene.get("tubes", []) + scene.get("balls", []):
        reader = vtk.vtkXMLPolyDataReader()
        reader.SetFileName(str(folder / file))
        if (file, width, colour) in scene.get("tubes", []):
            shape = vtk.vtkTubeFilter()
            shape.SetRadius(0.5 * width)
            shape.SetNumberOfSides(16)
            shape.CappingOn()
        else:
            ball, shape = vtk.vtkSphereSource(), vtk.vtkGlyph3D()
            ball.SetRadius(0.5 * width)
            ball.SetThetaResolution(16)
            ball.SetPhiResolution(16)
            shape.SetSourceConnection(ball.GetOutputPort())
            shape.ScalingOff()
        shape.SetInputConnection(reader.GetOutputPort())
        yield shape, [int(colour[n:n + 2], 16) / 255 for n in (1, 3, 5)]


def volume_of(grids, scene):
    """Tetrahedra of what the cut leaves. The mapper takes what it calls opacity for the extinction over the unit, in bytes."""
    cells = joined(grids, scene)
    if scene.get("blanked"):
        drawn = vtk.vtkThreshold()
        drawn.SetInputData(cells)
        drawn.SetInputArrayToProcess(0, 0, 0, vtk.vtkDataObject.FIELD_ASSOCIATION_POINTS, "IBlank")
        drawn.SetUpperThreshold(0.5)
        drawn.SetThresholdFunction(vtk.vtkThreshold.THRESHOLD_UPPER)
        drawn.AllScalarsOn()
        drawn.Update()
        cells = drawn.GetOutput()
    if "cut" in scene:
        clip = vtk.vtkTableBasedClipDataSet()
        clip.SetInputData(cells)
        clip.SetClipFunction(plane_of(scene["cut"]))
        clip.Update()
        cells = clip.GetOutput()
    cutter = vtk.vtkDataSetTriangleFilter()
    cutter.TetrahedraOnlyOn()
    cutter.SetInputData(cells)
    cutter.Update()
    tetrahedra = cutter.GetOutput()
    tetrahedra.GetPointData().SetActiveScalars(scene["vtk"])
    low, high = scene["range"]
    points, unit = scene["volume"]
    # Between the points it is the opacity that is linear.
    finer = np.unique(np.concatenate([np.linspace(0, 1, 129), [x for x, _ in points]]))
    opacities = np.interp(finer, [x for x, _ in points], [a for _, a in points])
    extinctions = list(zip(low + finer * (high - low), -np.log1p(-opacities)))
    largest = max(extinction for _, extinction in extinctions)
    opacity = vtk.vtkPiecewiseFunction()
    for x, extinction in extinctions:
        opacity.AddPoint(x, extinction / largest)
    mapper, volume = vtk.vtkProjectedTetrahedraMapper(), vtk.vtkVolume()
    mapper.SetInputData(tetrahedra)
    volume.SetMapper(mapper)
    volume.GetProperty().SetScalarOpacity(opacity)
    volume.GetProperty().SetColor(colours(scene))
    volume.GetProperty().SetInterpolationTypeToLinear()
    volume.GetProperty().SetScalarOpacityUnitDistance(unit / largest)
    return volume


def plane_of(numbers):
    plane = vtk.vtkPlane()
    plane.SetOrigin(numbers[:3])
    plane.SetNormal(numbers[3:])
    return plane


def by_vtk(grids, scene, picture):
    renderer, window = vtk.vtkRenderer(), vtk.vtkRenderWindow()
    renderer.SetBackground(1, 1, 1)
    if "surface" in scene:
        for face in faces_of(grids, scene):
            normals = vtk.vtkPolyDataNormals()
            normals.SetInputConnection(face.GetOutputPort())
            renderer.AddActor(actor_of(normals.GetOutputPort(), scene, GREY, scene["opacity"]))
    for shape, colour in things_of(scene, picture.parent):
        renderer.AddActor(actor_of(shape.GetOutputPort(), scene, colour))
    if "slice" in scene:
        cutter = vtk.vtkCutter()
        cutter.SetCutFunction(plane_of(scene["slice"]))
        cutter.SetInputData(joined(grids, scene))
        renderer.AddActor(actor_of(cutter.GetOutputPort(), scene))
    if "volume" in scene:
        renderer.AddVolume(volume_of(grids, scene))
    window.SetOffScreenRendering(1)
    window.SetMultiSamples(0)
    window.SetSize(FINER * WIDTH, FINER * HEIGHT)
    if scene.get("opacity", 1) < 1:
        window.SetAlphaBitPlanes(1)
        renderer.SetUseDepthPeeling(1)
        renderer.SetMaximumNumberOfPeels(16)
        renderer.SetOcclusionRatio(0)
    window.AddRenderer(renderer)
    camera = renderer.GetActiveCamera()
    camera.ParallelProjectionOn()
    camera.SetPosition(*scene["position"])
    camera.SetFocalPoint(*scene["focal"])
    camera.SetViewUp(0, 0, 1)
    camera.SetParallelScale(scene["scale"])
    renderer.ResetCameraClippingRange()
    window.Render()
    vtk_grids.write_picture(window, picture)


def pixels_of(path):
    """Averaged down to the pair's size."""
    reader = vtk.vtkPNGReader()
    reader.SetFileName(str(path))
    reader.Update()
    image = reader.GetOutput()
    width, height, _ = image.GetDimensions()
    values = vtk_to_numpy(image.GetPointData().GetScalars()).reshape(height, width, -1)[::-1, :, :3]
    values = values.reshape(HEIGHT, height // HEIGHT, WIDTH, width // WIDTH, 3).mean(axis=(1, 3))
    return np.round(values).astype(np.uint8)


def write_png(path, pixels):
    rows = b"".join(b"\0" + row.tobytes() for row in np.ascontiguousarray(pixels, np.uint8))

    def chunk(name, data):
        return struct.pack(">I", len(data)) + name + data + struct.pack(">I", zlib.crc32(name + data))

    header = struct.pack(">IIBBBBB", pixels.shape[1], pixels.shape[0], 8, 2, 0, 0, 0)
    path.write_bytes(b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", header) + chunk(b"IDAT", zlib.compress(rows, 9)) + chunk(b"IEND", b""))


def prepared(name, scene, data, folder, program):
    """The scene's files, and its cache; its lines are in the folder."""
    made = scene["made"](data, folder) if "made" in scene else []
    if "generate" in scene:
        run(program, "generate", scene["generate"], "--size", "96x96x24", "-o", folder / name)
        files = [folder / f"{name}.xyz", folder / f"{name}.fun"]
    else:
        files = [data / file for file in scene["files"]] if "files" in scene else made[:1]
    cache = folder / f"{name}.splats"
    run(program, "convert", *files, "-o", cache, "--overwrite")
    return files, cache


def in_radii(scene, grids):
    """Lengths and range from the data."""
    bounds = np.array([grid.GetBounds() for grid in grids])
    radius = 0.5 * (bounds[:, 1].max() - bounds[:, 0].min())
    scalars = np.array([grid.GetPointData().GetArray(scene["vtk"]).GetRange() for grid in grids])
    points, unit = scene["volume"]
    scene.update(scale=radius * scene["scale"], range=(scalars[:, 0].min(), scalars[:, 1].max()), volume=(points, unit * radius),
                 position=tuple(radius * x for x in scene["position"]), focal=tuple(radius * x for x in scene["focal"]))


def main():
    arguments = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    arguments.add_argument("data", type=pathlib.Path)
    arguments.add_argument("folder", type=pathlib.Path)
    arguments.add_argument("--program", default="curvisplat")
    arguments.add_argument("--only", choices=SCENES)
    given = arguments.parse_args()
    given.folder.mkdir(parents=True, exist_ok=True)
    for name in [given.only] if given.only else SCENES:
        scene = SCENES[name]
        files, cache = prepared(name, scene, given.data, given.folder, given.program)
        grids = vtk_grids.blocks_of(files)
        if "of_radius" in scene:
            in_radii(scene, grids)
        ours(given.program, cache, scene, given.folder / f"{name}_ours.png")
        by_vtk(grids, scene, given.folder / f"{name}_vtk.png")
        left, right = (pixels_of(given.folder / f"{name}_{of}.png") for of in ("ours", "vtk"))
        gap = np.full((HEIGHT, 8, 3), 128, np.uint8)
        write_png(given.folder / f"around_{name}.png", np.concatenate([left, gap, right], axis=1))
        away = left.astype(float) - right
        print(f"{name}: {10 * math.log10(255**2 / max(1e-9, (away**2).mean())):.1f} dB between the two")


main()
