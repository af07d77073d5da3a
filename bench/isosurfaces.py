#!/usr/bin/env python3
"""Isosurfaces against VTK's contour of the same grid.

    bench/isosurfaces.py FOLDER [--curvisplat PROGRAM] [--grids GRIDS] [--only NAME] [--voxels 256 | --source | --drawn]

Grids: the blunt fin, the delta wing and the combustor of GRIDS (../shared/data beside the project; what is missing is
left out, and said so), and a generated wake. VTK computes q_criterion, the magnitude of the vorticity and that of the
pressure's gradient at their nodes; both programs then get the same .vts file. Of each scalar the values that 60, 80 and
95 % of the nodes are below are contoured. Half a cell is half of what the contour's cell measures along its normal.

--source: ours are contours of the grid's own cells, not of a lattice of voxels.

--drawn: what `render --iso` draws beside VTK's contour drawn by `render --surface`, from four views of 700x500 pixels.
Prints the least share of the pixels of either that both cover, that of each view, and the processor time of our picture
from +z. Besides the grids above: every other node of the North Sea (blanked), whose contour is that of the cells without a
blanked corner, and density in the cells of sqnz_s, whose contour is of the means at the nodes: not the same field.

Prints, for each: the share of VTK's surface within half a cell of ours and of ours within half a cell of VTK's, by area,
the 99 % distance in cells, triangles, and the processor time of both. Needs VTK for Python.
"""
import argparse
import pathlib
import resource
import subprocess
import sys
import time

import numpy as np
import vtk
from vtk.util.numpy_support import numpy_to_vtk, vtk_to_numpy

ROOT = pathlib.Path(__file__).resolve().parent.parent
SAMPLES = 20000  # of a surface


def plot3d(grid, q):
    reader = vtk.vtkMultiBlockPLOT3DReader()
    reader.SetFileName(str(grid))
    reader.SetQFileName(str(q))
    reader.AutoDetectFormatOn()
    reader.AddFunction(110)  # pressure
    reader.AddFunction(200)  # velocity
    reader.Update()
    block = reader.GetOutput().GetBlock(0)
    data = block.GetPointData()
    return block, vtk_to_numpy(data.GetArray("Velocity")), vtk_to_numpy(data.GetArray("Pressure"))


def cgns(path):
    reader = vtk.vtkCGNSReader()
    reader.SetFileName(str(path))
    reader.UpdateInformation()
    reader.EnableAllPointArrays()
    reader.Update()
    block = reader.GetOutput().GetBlock(0).GetBlock(0)
    data = block.GetPointData()
    array = lambda name: vtk_to_numpy(data.GetArray(name)).astype(float)
    density = array("Density")
    momentum = np.stack([array("Momentum" + axis) for axis in "XYZ"], -1) if data.GetArray("MomentumX") \
        else array("Momentum")
    energy = array("EnergyStagnationDensity")
    velocity = momentum / density[:, None]
    return block, velocity, 0.4 * (energy - 0.5 * density * np.sum(velocity**2, -1))


def gradient(block, values):
    """Of a scalar or a vector at the nodes, by VTK."""
    array = numpy_to_vtk(np.ascontiguousarray(values, dtype=float), deep=True)
    array.SetName("v")
    block.GetPointData().AddArray(array)
    of = vtk.vtkGradientFilter()
    of.SetInputData(block)
    of.SetInputScalars(vtk.vtkDataObject.FIELD_ASSOCIATION_POINTS, "v")
    of.SetResultArrayName("g")
    of.Update()
    return vtk_to_numpy(of.GetOutput().GetPointData().GetArray("g"))


def derived(block, velocity, pressure):
    g = gradient(block, velocity).reshape(-1, 3, 3)
    vorticity = np.stack([g[:, 2, 1] - g[:, 1, 2], g[:, 0, 2] - g[:, 2, 0], g[:, 1, 0] - g[:, 0, 1]], -1)
    return {
        "q_criterion": -0.5 * np.einsum("nij,nji->n", g, g),
        "vorticity_magnitude": np.linalg.norm(vorticity, axis=-1),
        "pressure_gradient_magnitude": np.linalg.norm(gradient(block, pressure), axis=-1),
    }


def wake(program, folder):
    stem = folder / "wake"
    subprocess.run([program, "generate", "wake", "--size", "96x64x48", "-o", stem], check=True,
                   stdout=subprocess.DEVNULL)
    with open(stem.with_suffix(".xyz"), "rb") as file:
        raw = file.read()
    dims = np.frombuffer(raw, "<i4", 3)
    points = np.frombuffer(raw, "<f4", 3 * int(np.prod(dims)), 12).reshape(3, -1).T
    values = np.frombuffer(stem.with_suffix(".fun").read_bytes(), "<f4", int(np.prod(dims)), 16)
    return structured(dims, points), {"f": values.astype(float)}


def structured(dims, points):
    grid = vtk.vtkStructuredGrid()
    grid.SetDimensions(*(int(n) for n in dims))
    at = vtk.vtkPoints()
    at.SetData(numpy_to_vtk(np.ascontiguousarray(points, dtype=float), deep=True))
    grid.SetPoints(at)
    return grid


def clean(block, scalars):
    """A grid of the same nodes that has these scalars alone."""
    grid = structured(block.GetDimensions(), vtk_to_numpy(block.GetPoints().GetData()))
    for name, values in scalars.items():
        array = numpy_to_vtk(np.nan_to_num(values).astype(np.float32), deep=True)
        array.SetName(name)
        grid.GetPointData().AddArray(array)
    return grid


def contour(grid, name, value):
    of = vtk.vtkContourFilter()
    of.SetInputData(grid)
    of.SetInputArrayToProcess(0, 0, 0, vtk.vtkDataObject.FIELD_ASSOCIATION_POINTS, name)
    of.SetValue(0, value)
    of.ComputeNormalsOff()
    begin = time.process_time()
    of.Update()
    return of.GetOutput(), time.process_time() - begin


def samples(surface, rng):
    """Points of a surface, evenly by area, and the normals there."""
    triangles = vtk.vtkTriangleFilter()
    triangles.SetInputData(surface)
    triangles.PassVertsOff()
    triangles.PassLinesOff()
    triangles.Update()
    surface = triangles.GetOutput()
    at = vtk_to_numpy(surface.GetPoints().GetData()).astype(float)
    cells = vtk_to_numpy(surface.GetPolys().GetConnectivityArray()).reshape(-1, 3)
    a, b, c = at[cells[:, 0]], at[cells[:, 1]], at[cells[:, 2]]
    normal = np.cross(b - a, c - a)
    area = np.linalg.norm(normal, axis=-1)
    chosen = rng.choice(len(cells), SAMPLES, p=area / area.sum())
    u, v = rng.random(SAMPLES), rng.random(SAMPLES)
    flip = u + v > 1
    u[flip], v[flip] = 1 - u[flip], 1 - v[flip]
    points = a[chosen] + u[:, None] * (b - a)[chosen] + v[:, None] * (c - a)[chosen]
    return points, normal[chosen] / area[chosen][:, None], area.sum() / 2


def cell_lengths(grid, points, normals):
    """Of the grid's cells at points, along the normals; not a number outside."""
    locator = vtk.vtkStaticCellLocator()
    locator.SetDataSet(grid)
    locator.BuildLocator()
    dims = np.array(grid.GetDimensions())
    nodes = vtk_to_numpy(grid.GetPoints().GetData()).astype(float).reshape(*dims[::-1], 3)
    lengths = np.full(len(points), np.nan)
    size = dims - 1
    for n, point in enumerate(points):
        cell = locator.FindCell(point)
        if cell < 0:
            continue
        i, j, k = cell % size[0], cell // size[0] % size[1], cell // (size[0] * size[1])
        corners = nodes[k:k + 2, j:j + 2, i:i + 2]
        edges = [np.mean(corners.take(1, axis) - corners.take(0, axis), (0, 1)) for axis in range(3)]
        lengths[n] = sum(abs(np.dot(edge, normals[n])) for edge in edges)
    return lengths


def distances(points, surface):
    locator = vtk.vtkStaticCellLocator()
    locator.SetDataSet(surface)
    locator.BuildLocator()
    near, cell, sub, d2 = [0.0] * 3, vtk.reference(0), vtk.reference(0), vtk.reference(0.0)
    out = np.empty(len(points))
    for n, point in enumerate(points):
        locator.FindClosestPoint(point, near, cell, sub, d2)
        out[n] = d2.get() ** 0.5
    return out


def within(grid, of, to, rng):
    """The share of a surface within half a cell of the other, and the distance of 99 % in cells."""
    points, normals, _ = samples(of, rng)
    lengths = cell_lengths(grid, points, normals)
    known = lengths > 0
    parts = distances(points, to)[known] / lengths[known]
    return np.mean(parts <= 0.5), np.quantile(parts, 0.99)


def north_sea(folder, grids):
    """Every other node along each axis. The file, and the cells that are there."""
    def records(path):
        raw = (grids / path).read_bytes()
        at = 0
        while at < len(raw):
            count = int(np.frombuffer(raw, "<i4", 1, at)[0])
            yield raw[at + 4:at + 4 + count]
            at += count + 8
    blocks, dims, nodes = records("nemo_northsea/nemo_northsea_u.xyz")
    shape = np.frombuffer(dims, "<i4")[::-1]
    count = int(np.prod(shape))
    at = np.frombuffer(nodes, "<f4", 3 * count).reshape(3, *shape)[:, ::2, ::2, ::2]
    there = np.frombuffer(nodes, "<i4", count, 12 * count).reshape(shape)[::2, ::2, ::2]
    values = np.frombuffer(list(records("nemo_northsea/nemo_northsea_u.fun"))[2], "<f4", count).reshape(shape)[::2, ::2, ::2]
    size = np.array(there.shape[::-1], "<i4")
    stem = folder / "ocean"
    stem.with_suffix(".xyz").write_bytes(size.tobytes() + at.tobytes() + there.astype("<i4").tobytes())
    stem.with_suffix(".fun").write_bytes(size.tobytes() + np.array([1], "<i4").tobytes() + values.tobytes())
    stem.with_suffix(".nam").write_text("uo\n")
    grid = structured(size, at.reshape(3, -1).T)
    grid.GetPointData().AddArray(named("uo", values.reshape(-1)))
    corners = [there[k:k + size[2] - 1, j:j + size[1] - 1, i:i + size[0] - 1] != 0
               for k in (0, 1) for j in (0, 1) for i in (0, 1)]
    grid.GetCellData().AddArray(named("there", np.all(corners, 0).reshape(-1).astype(float)))
    cells = vtk.vtkThreshold()
    cells.SetInputData(grid)
    cells.SetInputArrayToProcess(0, 0, 0, vtk.vtkDataObject.FIELD_ASSOCIATION_CELLS, "there")
    cells.SetLowerThreshold(0.5)
    cells.SetUpperThreshold(1.5)
    cells.Update()
    return [stem.with_suffix(".xyz"), stem.with_suffix(".fun")], cells.GetOutput(), values[there != 0]


def named(name, values):
    array = numpy_to_vtk(np.ascontiguousarray(values, dtype=np.float32), deep=True)
    array.SetName(name)
    return array


def squeezed(_, grids):
    """Cells of twelve blocks, with VTK's means at their nodes."""
    path = grids / "cgns/sqnz_s.adf.cgns"
    reader = vtk.vtkCGNSReader()
    reader.SetFileName(str(path))
    reader.UpdateInformation()
    reader.EnableAllCellArrays()
    reader.Update()
    all_blocks = vtk.vtkAppendFilter()
    all_blocks.MergePointsOn()
    base = reader.GetOutput().GetBlock(0)
    for n in range(base.GetNumberOfBlocks()):
        all_blocks.AddInputData(base.GetBlock(n))
    means = vtk.vtkCellDataToPointData()
    means.SetInputConnection(all_blocks.GetOutputPort())
    means.Update()
    grid = means.GetOutput()
    return [path], grid, vtk_to_numpy(grid.GetPointData().GetArray("Density"))


def drawn_besides(arguments):
    for name, read, scalar in (("ocean", north_sea, "uo"), ("sqnz", squeezed, "Density")):
        if arguments.only and arguments.only != name or not arguments.grids.is_dir():
            continue
        files, grid, values = read(arguments.folder, arguments.grids)
        cache = arguments.folder / f"{name}.splats"
        subprocess.run([arguments.curvisplat, "convert", *files, "-o", cache, "--overwrite", "--scalar", scalar],
                       check=True, stdout=subprocess.DEVNULL)
        for percent in (60, 80, 95):
            compare_drawn(arguments, grid, cache, name, scalar, float(np.percentile(values, percent)))


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=pathlib.Path)
    parser.add_argument("--curvisplat", default=ROOT / "build/release/tools/curvisplat")
    parser.add_argument("--grids", type=pathlib.Path, default=ROOT.parent / "shared/data")
    parser.add_argument("--only")
    parser.add_argument("--voxels", default="256")
    parser.add_argument("--source", action="store_true")
    parser.add_argument("--drawn", action="store_true")
    arguments = parser.parse_args()
    arguments.folder.mkdir(parents=True, exist_ok=True)
    grids = {
        "fin": lambda: plot3d(arguments.grids / "bluntfin/bluntfinxyz.bin", arguments.grids / "bluntfin/bluntfinq.bin"),
        "wing": lambda: cgns(arguments.grids / "delta_wing/delta_vertex.cgns"),
        "combustor": lambda: plot3d(arguments.grids / "combustor/combxyz.bin", arguments.grids / "combustor/combq.bin"),
        "wake": lambda: wake(arguments.curvisplat, arguments.folder),
    }
    if not arguments.drawn:
        print(f"{'grid':<10}{'scalar':<28}{'value':>10}{'VTK near ours':>15}{'ours near VTK':>15}{'99 % cells':>16}"
              f"{'triangles':>18}{'VTK s':>8}{'ours s':>8}")
    for name, read in grids.items():
        if arguments.only and arguments.only != name:
            continue
        if name != "wake" and not arguments.grids.is_dir():
            print(f"{name}: left out: {arguments.grids} is missing", file=sys.stderr)
            continue
        result = read()
        grid = clean(result[0], result[1] if len(result) == 2 else derived(*result))
        scalars = [grid.GetPointData().GetArrayName(n) for n in range(grid.GetPointData().GetNumberOfArrays())]
        file, cache = arguments.folder / f"{name}.vts", arguments.folder / f"{name}.splats"
        writer = vtk.vtkXMLStructuredGridWriter()
        writer.SetFileName(str(file))
        writer.SetInputData(grid)
        writer.Write()
        subprocess.run([arguments.curvisplat, "convert", file, "-o", cache, "--overwrite", "--scalar", ",".join(scalars)],
                       check=True, stdout=subprocess.DEVNULL)
        for scalar in scalars:
            values = vtk_to_numpy(grid.GetPointData().GetArray(scalar))
            for percent in (60, 80, 95):
                value = float(np.percentile(values, percent))
                (compare_drawn if arguments.drawn else compare)(arguments, grid, cache, name, scalar, value)
    if arguments.drawn:
        drawn_besides(arguments)


def covered(arguments, cache, scalar, view, what):
    """Which pixels a surface covers."""
    picture = arguments.folder / "drawn.png"
    subprocess.run([arguments.curvisplat, "render", cache, "--scalar", scalar, *what, "--volume", "off", "--view", view,
                    "--size", "700x500", "--background", "transparent", "-o", picture],
                   check=True, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    reader = vtk.vtkPNGReader()
    reader.SetFileName(str(picture))
    reader.Update()
    return vtk_to_numpy(reader.GetOutput().GetPointData().GetScalars())[:, 3] > 127


def compare_drawn(arguments, grid, cache, name, scalar, value):
    writer = vtk.vtkSTLWriter()
    triangles = vtk.vtkTriangleFilter()
    triangles.SetInputData(contour(grid, scalar, value)[0])
    writer.SetInputConnection(triangles.GetOutputPort())
    writer.SetFileTypeToBinary()
    writer.SetFileName(str(arguments.folder / "vtk.stl"))
    writer.Write()
    shares, seconds = [], 0
    for view in ("iso", "+x", "+y", "+z"):
        before = resource.getrusage(resource.RUSAGE_CHILDREN)
        ours = covered(arguments, cache, scalar, view, [f"--iso={value:.9g}"])
        after = resource.getrusage(resource.RUSAGE_CHILDREN)
        seconds = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
        theirs = covered(arguments, cache, scalar, view, ["--surface", arguments.folder / "vtk.stl"])
        shares.append((ours & theirs).sum() / max(1, (ours | theirs).sum()))
    print(f"{name:<10}{scalar:<28}{value:>10.4g}  least {100 * min(shares):.2f} %, " +
          ", ".join(f"{100 * share:.2f}" for share in shares) + f"; {seconds:.2f} s", flush=True)


def compare(arguments, grid, cache, name, scalar, value):
    mesh = arguments.folder / "iso.vtp"
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    result = subprocess.run([arguments.curvisplat, "export", cache, "--scalar", scalar, f"--iso={value:.9g}", "-o", mesh,
                             *(["--source"] if arguments.source else ["--voxels", arguments.voxels])], capture_output=True, text=True)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    theirs, seconds = contour(grid, scalar, value)
    head = f"{name:<10}{scalar:<28}{value:>10.4g}"
    if result.returncode != 0:
        print(head, result.stderr.strip(), flush=True)
        return
    reader = vtk.vtkXMLPolyDataReader()
    reader.SetFileName(str(mesh))
    reader.Update()
    ours = reader.GetOutput()
    rng = np.random.default_rng(1)
    there, their_cells = within(grid, theirs, ours, rng)
    back, our_cells = within(grid, ours, theirs, rng)
    print(f"{head}{100 * there:>13.2f} %{100 * back:>13.2f} %{their_cells:>8.2f}{our_cells:>8.2f}"
          f"{theirs.GetNumberOfPolys():>9}{ours.GetNumberOfPolys():>9}{seconds:>8.2f}"
          f"{after.ru_utime - before.ru_utime:>8.2f}", flush=True)


if __name__ == "__main__":
    main()
