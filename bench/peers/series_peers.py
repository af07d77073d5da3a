#!/usr/bin/python3
"""Steps through one series with curvisplat and with VTK, and packs it with both curvisplat and zfp, in one run.

    bench/peers/series_peers.py FOLDER [--nodes 192x128x48] [--steps 6] [--resample 128] [--json OUT.json]

The wake on a fixed grid. VTK reads each step, resamples it to RESAMPLE^3 points (vtkResampleToImage, as ParaView's volume rendering
of curvilinear grids does) and draws it with vtkSmartVolumeMapper's ray cast on the processor, 256x256. curvisplat draws the finest level,
of every node, and reads its cache. zfp packs the samples as a 4-D array of all steps (and each step by itself in 3-D), with the
tolerance at which its largest error is that of curvisplat's means: half a code of the brick of the widest range. A cache also
has the slopes of splats and its coarser levels, which zfp's stream has not. Needs Debian's python3-vtk9 and python3-zfpy.
"""
import argparse
import json
import os
import pathlib
import shutil
import statistics
import sys
import time

HERE = pathlib.Path(__file__).resolve().parent
sys.path.insert(0, str(HERE.parent))
sys.path.insert(0, str(HERE.parent.parent / "tests" / "stream"))
import results

CAMERA = ["--view", "iso", "--range", "0,1", "--opacity-unit", "0.02"]


def step_with_vtk(folder, steps, samples):
    """Seconds of each step after the first: reading, resampling, drawing."""
    import vtk
    mapper, volume, renderer, window = vtk.vtkSmartVolumeMapper(), vtk.vtkVolume(), vtk.vtkRenderer(), vtk.vtkRenderWindow()
    mapper.SetRequestedRenderModeToRayCast()
    volume.SetMapper(mapper)
    opacity, colour = vtk.vtkPiecewiseFunction(), vtk.vtkColorTransferFunction()
    for x in (0.0, 1.0):
        opacity.AddPoint(x, 0.6 * x)
        colour.AddRGBPoint(x, x, 0.2, 1 - x)
    volume.GetProperty().SetScalarOpacity(opacity)
    volume.GetProperty().SetColor(colour)
    volume.GetProperty().SetInterpolationTypeToLinear()
    volume.GetProperty().SetScalarOpacityUnitDistance(0.1)
    window.SetOffScreenRendering(1)
    window.SetSize(256, 256)
    window.AddRenderer(renderer)
    renderer.AddVolume(volume)
    seconds = []
    for step in range(steps):
        begin = time.monotonic()
        reader = vtk.vtkMultiBlockPLOT3DReader()
        reader.AutoDetectFormatOn()
        reader.SetXYZFileName(str(folder / "w.xyz"))
        reader.SetFunctionFileName(str(folder / f"w_{step:04d}.fun"))
        reader.Update()
        grid = reader.GetOutput().GetBlock(0)
        name = grid.GetPointData().GetArrayName(0)
        sampler = vtk.vtkResampleToImage()
        sampler.SetInputDataObject(grid)
        sampler.UseInputBoundsOn()
        sampler.SetSamplingDimensions(samples, samples, samples)
        read = time.monotonic()
        sampler.Update()
        image = sampler.GetOutput()
        image.GetPointData().SetActiveScalars(name)
        sampled = time.monotonic()
        mapper.SetInputData(image)
        if step == 0:
            renderer.ResetCamera()
        window.Render()
        end = time.monotonic()
        seconds.append((end - begin, read - begin, sampled - read, end - sampled))
    return seconds[1:]


def step_with_us(program, folder, size, out):
    told = folder / "stats.json"
    results.run([program, "render", folder / "w.splats", "-o", folder / "s_%04d.pfm", "--steps", "all", "--lod-pixels", "0",
                 "--size", size, "--memory", "1G", "--stats", told, *CAMERA])
    return [frame["seconds"]["total"] for frame in json.loads(told.read_text())["frames"]][1:]


def largest_error(cache, steps):
    import read_cache
    worst = 0
    for step in range(steps):
        for table in read_cache.Cache(cache, step).tables.values():
            worst = max(worst, *((brick["max"] - brick["min"]) / 65535 / 2 for brick in table))
    return worst


def zfp_bytes(array, error):
    """Of the loosest power-of-two tolerance whose largest error is no more; zfp's tolerances are rounded down to these."""
    import numpy as np
    import zfpy
    tolerance = 2.0 ** np.ceil(np.log2(error) + 6)
    while True:
        packed = zfpy.compress_numpy(array, tolerance=tolerance)
        found = float(np.abs(zfpy.decompress_numpy(packed) - array).max())
        if found <= error:
            return len(packed), found
        tolerance /= 2


def pack(folder, arguments, out):
    import numpy as np
    ni, nj, nk = map(int, arguments.nodes.split("x"))
    size = ni * nj * nk
    values = np.stack([np.frombuffer((folder / f"w_{step:04d}.fun").read_bytes()[-4 * size:], "<f4").reshape(nk, nj, ni)
                       for step in range(arguments.steps)])
    cache = folder / "w.splats"
    error = largest_error(cache, arguments.steps)
    # Streams, without the folder's other files: the values of all steps.
    ours = sum(path.stat().st_size for path in cache.glob("var.0*.bin")) / (size * arguments.steps)
    in_4d, found = zfp_bytes(values, error)
    in_3d = sum(zfp_bytes(np.ascontiguousarray(step), error)[0] for step in values)
    rows = {"curvisplat": ours, "zfp 4-D": in_4d / values.size, "zfp 3-D": in_3d / values.size}
    for name, bytes_a_node in rows.items():
        out.add(f"series_peers/bytes_per_node/{name.replace(' ', '_')}", "1", [bytes_a_node])
        print(f"{name}: {bytes_a_node:.3f} bytes a node and step")
    print(f"largest error {error:.3g} ours, {found:.3g} zfp's; range {values.min():.3g} to {values.max():.3g}")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=pathlib.Path)
    parser.add_argument("--program", default=HERE.parent.parent / "build/release/tools/curvisplat")
    parser.add_argument("--nodes", default="192x128x48")
    parser.add_argument("--steps", type=int, default=6)
    parser.add_argument("--resample", type=int, default=128)
    parser.add_argument("--json")
    arguments = parser.parse_args()
    folder, out = arguments.folder, results.Results()
    folder.mkdir(parents=True, exist_ok=True)
    shutil.rmtree(folder / "w.splats", ignore_errors=True)
    results.run([arguments.program, "generate", "wake", "--size", arguments.nodes, "--steps", arguments.steps, "-o", folder / "w"])
    results.run([arguments.program, "convert", folder / "w.xyz", folder / "w_*.fun", "-o", folder / "w.splats"])
    pack(folder, arguments, out)
    us = step_with_us(arguments.program, folder, "256x256", out)
    out.add("series_peers/step/curvisplat", "s", us)
    vtk_steps = step_with_vtk(folder, arguments.steps, arguments.resample)
    out.add("series_peers/step/vtk_resampled", "s", [step[0] for step in vtk_steps])
    total, read, sample, draw = (statistics.median(part) for part in zip(*vtk_steps))
    print(f"a step, {os.cpu_count()} cores: curvisplat {statistics.median(us):.3f} s (finest level); VTK, {arguments.resample}^3 samples, "
          f"{total:.3f} s (reads {read:.3f}, resamples {sample:.3f}, draws {draw:.3f})")
    if arguments.json:
        out.write(arguments.json, "series_peers", results.version_of(arguments.program))


if __name__ == "__main__":
    main()
