#!/usr/bin/python3
"""The ParaView plugin in Debian's pvpython.

    plugin_test.py PROGRAM PYTHON_FOLDER [PICTURE_FOLDER]    PYTHON_FOLDER: has the package curvisplat

Exit status 77 (skipped) without pvpython, which python3-paraview has.
"""
import os
import pathlib
import shutil
import subprocess
import sys
import tempfile

ROOT = pathlib.Path(__file__).resolve().parents[2]
PLUGIN = ROOT / "tools" / "paraview" / "curvisplat_paraview.py"


def inside(folder, pictures):
    """What runs in pvpython."""
    import inspect
    if not hasattr(inspect, "getargspec"):  # ParaView 5.11 imports it, and Python 3.11 has it no more
        inspect.getargspec = inspect.getfullargspec
    import numpy as np
    from paraview import servermanager, simple
    from vtkmodules.util.numpy_support import vtk_to_numpy

    simple.LoadPlugin(str(PLUGIN), remote=False, ns=globals())
    make_image, make_points = globals()["curvisplatImageData"], globals()["curvisplatPoints"]

    def arrays(source, time=None):
        source.UpdatePipeline(time) if time is not None else source.UpdatePipeline()
        data = servermanager.Fetch(source)
        return data, {data.GetPointData().GetArrayName(n): vtk_to_numpy(data.GetPointData().GetArray(n))
                      for n in range(data.GetPointData().GetNumberOfArrays())}

    # A sheared box of the volume 2 * 3 * 4, whose scalar is x + 2 y + 3 z.
    image = make_image(FileName=f"{folder}/box.splats/manifest.json", Resolution=40)
    data, found = arrays(image)
    size = data.GetDimensions()
    assert max(size) == 40, size
    spacing, origin = np.array(data.GetSpacing()), np.array(data.GetOrigin())
    grid = np.stack(np.meshgrid(*(origin[a] + spacing[a] * np.arange(size[a]) for a in range(3)), indexing="ij"), -1)
    places = grid.transpose(2, 1, 0, 3).reshape(-1, 3)
    density, value = found["density"], found["t"]
    volume = density.sum() * spacing.prod()
    assert abs(volume - 24) < 0.15, volume
    inner = density > 0.95
    error = np.abs(value[inner] - places[inner] @ [1, 2, 3])
    print(f"image data {size}: volume {volume:.3f} of 24, largest error {error.max():.4f} in {inner.sum()} points")
    assert inner.sum() > 0.5 * len(value) * 24 / (spacing.prod() * len(value)) and error.max() < 0.02
    assert np.isnan(value[density == 0]).all() and (density == 0).any()

    # A part of it: its own box, finer.
    image.Box = [1.0, 1.5, 1.0, 1.5, 1.0, 1.5]
    image.Resolution = 10
    data, found = arrays(image)
    assert data.GetDimensions() == (10, 10, 10) and np.allclose(data.GetBounds(), [1.025, 1.475] * 3), data.GetBounds()
    assert abs(found["density"].mean() - 1) < 0.03

    # Points: as many as samples, with the volume and the shape of their cells.
    points = make_points(FileName=f"{folder}/box.splats")
    data, found = arrays(points)
    assert data.GetNumberOfPoints() == data.GetNumberOfVerts() == 40 * 44 * 48, data.GetNumberOfPoints()
    places = vtk_to_numpy(data.GetPoints().GetData())
    assert np.abs(found["t"] - places @ [1, 2, 3]).max() < 0.01
    assert abs(found["volume"].sum(dtype="f8") - 24) < 0.03, found["volume"].sum(dtype="f8")
    roots = found["shape"].reshape(-1, 3, 3)
    assert data.GetPointData().GetTensors().GetNumberOfComponents() == 9
    assert np.allclose(roots, roots.transpose(0, 2, 1)) and (np.linalg.eigvalsh(roots.astype("f8")) > 0).all()
    inner = (np.abs(places - places.mean(0)) < 0.4).all(1)
    cell = 24 / (39 * 43 * 47)
    assert np.allclose(np.linalg.det(roots[inner].astype("f8")), cell, rtol=0.02), np.linalg.det(roots[inner])
    points.Level = 0
    coarse, found = arrays(points)
    assert 0 < coarse.GetNumberOfPoints() < data.GetNumberOfPoints() and abs(found["volume"].sum(dtype="f8") - 24) < 0.05
    print(f"points: {data.GetNumberOfPoints()}, at level 0 {coarse.GetNumberOfPoints()}")

    # Time steps: the box's scalar times 1, 2 and 3.
    series = make_image(FileName=f"{folder}/steps.splats", Resolution=12)
    series.UpdatePipelineInformation()
    times = list(series.TimestepValues)
    assert times == [0.0, 1.0, 2.0], times
    means = [np.nanmean(arrays(series, time)[1]["1"]) for time in times]
    assert np.allclose(np.array(means) / means[0], [1, 2, 3], rtol=1e-3), means
    print("time steps:", times)

    # What is wrong is said in a line.
    bad = make_image(FileName=f"{folder}/none.splats")
    try:
        bad.UpdatePipeline()
    except RuntimeError:
        pass

    if pictures:
        draw(simple, image, points, pictures)
    print("plugin: all right")


def draw(simple, image, points, pictures):
    """Both sources in a view, coloured by t, which runs from 0 to 20; tests that the pictures have the colours' ends."""
    from vtkmodules.util.numpy_support import vtk_to_numpy
    from vtkmodules.vtkIOImage import vtkPNGReader
    view = simple.CreateView("RenderView")
    view.ViewSize = [640, 480]
    view.OrientationAxesVisibility = 0
    points.Level = 0
    image.Box, image.Resolution = [0.0] * 6, 40
    # A sphere of ParaView's has a radius of 1/2.
    glyphs = simple.TensorGlyph(Input=points, Tensors=["POINTS", "shape"], Scalars=["POINTS", "t"], GlyphType="Sphere", ScaleFactor=1.0)
    cut = simple.Threshold(Input=image, Scalars=["POINTS", "density"], LowerThreshold=0.5, UpperThreshold=2.0)
    for name, shown in (("points", glyphs), ("image", cut)):
        shown.UpdatePipeline()
        display = simple.Show(shown, view)
        simple.ColorBy(display, ("POINTS", "t"))
        display.RescaleTransferFunctionToDataRange(False, True)
        display.SetScalarBarVisibility(view, True)
        view.CameraPosition, view.CameraFocalPoint, view.CameraViewUp = [9, -12, 9], [1.3, 1.7, 2], [0, 0, 1]
        simple.ResetCamera(view)
        file = f"{pictures}/paraview_{name}.png"
        simple.SaveScreenshot(file, view)
        simple.Hide(shown, view)
        display.SetScalarBarVisibility(view, False)
        reader = vtkPNGReader()
        reader.SetFileName(file)
        reader.Update()
        colours = vtk_to_numpy(reader.GetOutput().GetPointData().GetScalars()).astype(int)[:, :3]
        # ParaView's colours run from blue over grey to red.
        reddish = colours[:, 0] - colours[:, 2]
        red, blue = (reddish > 60).mean(), (reddish < -60).mean()
        print(f"picture of {name}: red {red:.0%}, blue {blue:.0%}")
        assert red > 0.03 and blue > 0.03, f"{file} has not the colours of t"


def make_caches(folder):
    import numpy as np
    import curvisplat
    k, j, i = np.meshgrid(np.linspace(0, 4, 48), np.linspace(0, 3, 44), np.linspace(0, 2, 40), indexing="ij")
    x, y, z = i + 0.2 * j, j + 0.1 * k, k
    t = x + 2 * y + 3 * z
    curvisplat.convert_arrays(f"{folder}/box.splats", curvisplat.Block(x, y, z, {"t": t}))
    program = sys.argv[1]
    grid = pathlib.Path(folder, "box.xyz")
    header = np.array(t.shape[::-1], "<i4").tobytes()
    grid.write_bytes(header + b"".join(a.astype("<f4").tobytes() for a in (x, y, z)))
    for step in range(3):
        pathlib.Path(folder, f"box_{step}.f").write_bytes(
            np.array([*t.shape[::-1], 1], "<i4").tobytes() + ((step + 1) * t).astype("<f4").tobytes())
    subprocess.run([program, "convert", str(grid), *[f"{folder}/box_{step}.f" for step in range(3)], "-o", f"{folder}/steps.splats"], check=True, capture_output=True)


def main():
    pvpython = shutil.which("pvpython")
    if not pvpython:
        print("skipped: pvpython is not installed (Debian's package python3-paraview)")
        return 77
    sys.path.insert(0, sys.argv[2])
    with tempfile.TemporaryDirectory() as folder:
        make_caches(folder)
        # What PYTHONPATH has stays: a ParaView that is unpacked, not installed, finds its own modules by it.
        paths = [str(pathlib.Path(sys.argv[2]).resolve()), *filter(None, [os.environ.get("PYTHONPATH")])]
        environment = {**os.environ, "PYTHONPATH": os.pathsep.join(paths), "QT_QPA_PLATFORM": "offscreen"}
        # Debian's ParaView draws through X even off the screen, and without an X server it crashes there.
        draws = len(sys.argv) > 3
        if draws and "DISPLAY" not in os.environ and not shutil.which("xvfb-run"):
            print("wrong: pictures need an X server: set DISPLAY or install xvfb")
            return 1
        screen = ["xvfb-run", "-a"] if draws and "DISPLAY" not in os.environ else []
        run = subprocess.run([*screen, pvpython, "--force-offscreen-rendering", __file__, "--inside", folder, *sys.argv[3:]], env=environment,
                             capture_output=True, text=True, timeout=500)
    print(run.stdout, run.stderr, sep="", end="")
    if run.returncode != 0 and "No module named 'paraview" in run.stderr:
        print("skipped: pvpython has no module paraview (Debian's package python3-paraview)")
        return 77
    wrong = run.returncode != 0 or "plugin: all right" not in run.stdout
    wrong |= "none.splats" not in run.stderr
    return int(wrong)


if __name__ == "__main__":
    if sys.argv[1] == "--inside":
        inside(sys.argv[2], sys.argv[3] if len(sys.argv) > 3 else None)
    else:
        sys.exit(main())
