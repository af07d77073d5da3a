#!/usr/bin/env python3
"""Compares the numbers that `info` prints with those that numpy finds in the same files: percentiles and values at points.

    bench/true_numbers.py DATA FOLDER [--only REGEX] [--program PROGRAM] [--points 10000] [--json OUT.json]

DATA has NASA's and other real grids (blunt fin, combustor, LOX post, nek, NEMO, a cubed sphere); meshes and a sphere are made in FOLDER.
A row has, of one scalar, the largest error in rank, in %, of the percentiles at 0.1, 1, 50, 99 and 99.9 %: against the samples' values,
each with its share of the cells around it; and against the volume itself, whose values are trilinear between nodes (27 points a cell; what
`info` means), with that of the samples beside it. Ranks are those of values within 1e-4 of the range: on a plateau every rank is as good. Then the largest and the 99th percentile of |probed - true| / range at random points in random cells, from
the cache alone and with --source; "missed" are points that are called outside. Needs numpy and VTK's Python modules.
"""
import argparse
import csv
import io
import json
import pathlib
import re
import subprocess
import time

import numpy as np
import vtk
from vtk.util.numpy_support import numpy_to_vtk, numpy_to_vtkIdTypeArray, vtk_to_numpy

HERE = pathlib.Path(__file__).resolve().parent
PARTS = (0.1, 1, 50, 99, 99.9)


def take(data, at, count, kind):
    return np.frombuffer(data, kind, count, at), at + count * np.dtype(kind).itemsize


def plot3d_q(folder, grid, solution, iblank=False):
    """A grid and its Q file of one block, big-endian, without records: x, y, z, whether a node is there, and five scalars."""
    data = (folder / grid).read_bytes()
    n, at = take(data, 0, 3, ">i4")
    shape = tuple(n[::-1])
    xyz, at = take(data, at, 3 * n.prod(), ">f4")
    there = np.frombuffer(data, ">i4", n.prod(), at).reshape(shape) != 0 if iblank else np.ones(shape, bool)
    q = np.frombuffer((folder / solution).read_bytes(), ">f4", 5 * n.prod(), 12 + 16)
    names = ["density", "x_momentum", "y_momentum", "z_momentum", "energy"]
    return xyz.reshape(3, *shape).astype(float), there, dict(zip(names, q.reshape(5, *shape).astype(float)))


def records(path, kinds):
    """Fortran's records, little-endian."""
    data, at, all_of_them = path.read_bytes(), 0, []
    while at < len(data):
        length = int(np.frombuffer(data, "<i4", 1, at)[0])
        all_of_them.append(data[at + 4:at + 4 + length])
        at += 8 + length
    return all_of_them


def plot3d_function(folder, grid, function, names, iblank=False):
    _, sizes, body = records(folder / grid, None)[:3]
    n = np.frombuffer(sizes, "<i4")[:3]
    shape, count = tuple(n[::-1]), int(n.prod())
    xyz = np.frombuffer(body, "<f4", 3 * count).reshape(3, *shape).astype(float)
    there = np.frombuffer(body, "<i4", count, 12 * count).reshape(shape) != 0 if iblank else np.ones(shape, bool)
    values = np.frombuffer(records(folder / function, None)[2], "<f4").reshape(-1, *shape).astype(float)
    return xyz, there, {names[n] if n < len(names) else str(n): values[n] for n in range(len(values))}


def corners_of(a):
    """[8 corners, cells] of the last three axes; bits along i, j, k."""
    s = [slice(0, -1), slice(1, None)]
    return np.stack([a[..., s[c >> 2], s[c >> 1 & 1], s[c & 1]] for c in range(8)])


def shape_functions(u):
    return np.stack([np.prod([u[:, d] if c >> d & 1 else 1 - u[:, d] for d in range(3)], axis=0) for c in range(8)])


def node_weights(xyz, there):
    """Of each node the volume nearer to it in its cells' own coordinates, by 2 x 2 x 2 Gauss points an octant."""
    c = corners_of(xyz)
    whole = corners_of(there).all(axis=0)
    weights = np.zeros(there.shape)
    at = np.array([-1, 1]) / np.sqrt(3) / 4
    for corner in range(8):
        part = np.zeros(whole.shape)
        for g in range(8):
            u = [(0.75 if corner >> d & 1 else 0.25) + at[g >> d & 1] for d in range(3)]
            columns = []
            for d in range(3):
                rest = [np.prod([u[e] if k >> e & 1 else 1 - u[e] for e in range(3) if e != d]) * (1 if k >> d & 1 else -1) for k in range(8)]
                columns.append(np.tensordot(np.array(rest), c, 1))
            part += np.abs(np.einsum("a...,a...->...", columns[0], np.cross(columns[1], columns[2], axis=0))) / 64
        s = [slice(0, -1), slice(1, None)]
        weights[s[corner >> 2], s[corner >> 1 & 1], s[corner & 1]] += np.where(whole, part, 0)
    return weights


def field(xyz, there, values):
    """Values and volumes at 27 points of every cell, 8 in large grids."""
    corners, whole = corners_of(xyz), corners_of(there).all(axis=0)
    of_cells, corners = corners_of(values)[:, whole], corners[:, :, whole]
    count = 3 if whole.sum() < 500000 else 2
    at = (np.arange(count) + 0.5) / count
    found, volumes = [], []
    for u in np.stack(np.meshgrid(at, at, at), -1).reshape(-1, 3):
        columns = []
        for d in range(3):
            rest = [np.prod([u[e] if k >> e & 1 else 1 - u[e] for e in range(3) if e != d]) * (1 if k >> d & 1 else -1) for k in range(8)]
            columns.append(np.tensordot(np.array(rest), corners, 1))
        volumes.append(np.abs(np.einsum("an,an->n", columns[0], np.cross(columns[1], columns[2], axis=0))))
        found.append(shape_functions(u[None])[:, 0] @ of_cells)
    return np.concatenate(found), np.concatenate(volumes)


def probe_points(xyz, there, count, rng, centred):
    whole = np.argwhere(corners_of(there).all(axis=0) if not centred else there)
    cells = whole[rng.integers(0, len(whole), count)]
    u = rng.uniform(0.02, 0.98, (count, 3))
    n = shape_functions(u)
    pick = lambda a: np.stack([a[..., cells[:, 0] + (c >> 2), cells[:, 1] + (c >> 1 & 1), cells[:, 2] + (c & 1)] for c in range(8)])
    return np.einsum("cn,can->na", n, pick(xyz)), (lambda f: np.einsum("cn,cn->n", n, pick(f))) if not centred else (lambda f: f[tuple(cells.T)])


def write_mesh(path, xyz, cells, kind, values, of_cells):
    grid, points, array = vtk.vtkUnstructuredGrid(), vtk.vtkPoints(), vtk.vtkCellArray()
    points.SetDataTypeToDouble()
    points.SetData(numpy_to_vtk(np.ascontiguousarray(xyz), deep=1))
    ids = np.hstack([np.full((len(cells), 1), cells.shape[1]), cells]).astype(np.int64).ravel()
    array.SetCells(len(cells), numpy_to_vtkIdTypeArray(ids, deep=1))
    grid.SetPoints(points)
    grid.SetCells(kind, array)
    for data, name, numbers in ((grid.GetPointData(), "f", values), (grid.GetCellData(), "c", of_cells)):
        a = numpy_to_vtk(np.ascontiguousarray(numbers, np.float32), deep=1)
        a.SetName(name)
        data.AddArray(a)
    writer = vtk.vtkXMLUnstructuredGridWriter()
    writer.SetFileName(str(path))
    writer.SetInputData(grid)
    writer.Write()


def mesh(folder, name, rng, count):
    """Distorted cells of one shape: (file, points, true values of f, of c)."""
    n = 24
    i = np.arange(n + 1.0)
    xyz = np.stack(np.meshgrid(i, 0.7 * i, 0.31 * i, indexing="ij"), -1).reshape(-1, 3)
    inner = ((xyz / [1, 0.7, 0.31]) % n != 0).all(axis=1)
    xyz[inner] += rng.uniform(-0.06, 0.06, (inner.sum(), 3))
    number = lambda a, b, c: (a * (n + 1) + b) * (n + 1) + c
    I, J, K = (a.ravel() for a in np.meshgrid(*[np.arange(n)] * 3, indexing="ij"))
    box = np.stack([number(I + a, J + b, K + c) for a, b, c in ((0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (0, 0, 1), (1, 0, 1), (1, 1, 1), (0, 1, 1))], 1)
    parts, kind = {"hexahedra": ([range(8)], 12), "wedges": ([(0, 1, 2, 4, 5, 6), (0, 2, 3, 4, 6, 7)], 13),
                   "tetrahedra": ([(0, 1, 2, 6), (0, 2, 3, 6), (0, 3, 7, 6), (0, 7, 4, 6), (0, 4, 5, 6), (0, 5, 1, 6)], 10)}[name]
    cells = np.concatenate([box[:, list(p)] for p in parts])
    f = (np.sin(0.4 * xyz[:, 0]) + 0.3 * xyz[:, 1] * xyz[:, 2] / 10).astype(np.float32)
    c = np.sin(xyz[cells].mean(axis=1) @ [0.4, 0.3, 0.9]).astype(np.float32)
    path = folder / f"{name}.vtu"
    write_mesh(path, xyz, cells, kind, f, c)
    chosen = cells[at := rng.integers(0, len(cells), count)]
    if name == "hexahedra":
        u = rng.uniform(0.02, 0.98, (count, 3))
        w = shape_functions(u)[[0, 1, 3, 2, 4, 5, 7, 6]].T
    elif name == "wedges":
        r, t = rng.dirichlet([1, 1, 1], count) * 0.96 + 0.04 / 3, rng.uniform(0.02, 0.98, (count, 1))
        w = np.hstack([r * (1 - t), r * t])
    else:
        w = rng.dirichlet([1] * 4, count) * 0.96 + 0.01
    return [path], np.einsum("nc,nca->na", w, xyz[chosen]), {"f": np.einsum("nc,nc->n", w, f[chosen])}, {"c": c[at].astype(float)}


def structured(data):
    """name: (files, options of convert, x y z, there, scalars, cell-centred)"""
    def of(folder, files, read, options=()):
        return lambda: ([data / folder / f for f in files], options, *read(data / folder), False)
    return {
        "bluntfin": of("bluntfin", ["bluntfinxyz.bin", "bluntfinq.bin"], lambda f: plot3d_q(f, "bluntfinxyz.bin", "bluntfinq.bin")),
        "combustor": of("combustor", ["combxyz.bin", "combq.bin"], lambda f: plot3d_q(f, "combxyz.bin", "combq.bin")),
        "lox_post": of("lox_post", ["postxyz.bin", "postq.bin"], lambda f: plot3d_q(f, "postxyz.bin", "postq.bin", True)),
        "nek": of("nek", ["Combined_PressureSide_Block.xyz", "pressure.fun"], lambda f: plot3d_function(f, "Combined_PressureSide_Block.xyz", "pressure.fun", [])),
        "nemo": of("nemo_northsea", ["nemo_northsea_u.xyz", "nemo_northsea_u.fun"], lambda f: plot3d_function(f, "nemo_northsea_u.xyz", "nemo_northsea_u.fun", ["uo", "depth"], True)),
        "cubed_sphere": lambda: of_vts(data / "vts_encodings" / "face3_appended_raw.vts"),
    }


def of_vts(path):
    reader = vtk.vtkXMLStructuredGridReader()
    reader.SetFileName(str(path))
    reader.Update()
    grid = reader.GetOutput()
    n = np.array(grid.GetDimensions())
    xyz = vtk_to_numpy(grid.GetPoints().GetData()).astype(float).reshape(*n[::-1], 3).transpose(3, 0, 1, 2)
    cells = {grid.GetCellData().GetArrayName(a): vtk_to_numpy(grid.GetCellData().GetArray(a)).astype(float).reshape(*(n - 1)[::-1])
             for a in range(grid.GetCellData().GetNumberOfArrays()) if grid.GetCellData().GetArrayName(a) in "TS"}
    return [path], (), xyz, np.ones(tuple((n - 1)[::-1]), bool), cells, True


def rank_errors(values, weights, percentiles):
    order = np.argsort(values, kind="stable")
    sums = np.concatenate([[0], np.cumsum(weights[order])]) / weights.sum()
    slack = 1e-4 * np.ptp(values)
    lower = np.searchsorted(values[order], percentiles - slack, "left")
    upper = np.searchsorted(values[order], percentiles + slack, "right")
    parts = np.array(PARTS) / 100
    return 100 * np.maximum(0, np.maximum(sums[lower] - parts, parts - sums[np.minimum(upper + 1, len(values))]))


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("data", type=pathlib.Path)
    parser.add_argument("folder", type=pathlib.Path)
    parser.add_argument("--only", default="")
    parser.add_argument("--points", type=int, default=10000)
    parser.add_argument("--program", default=HERE.parent / "build/release/tools/curvisplat")
    parser.add_argument("--json", type=pathlib.Path)
    arguments = parser.parse_args()
    arguments.folder.mkdir(parents=True, exist_ok=True)
    rng = np.random.default_rng(7)
    rows = []

    def run(*words):
        return subprocess.run([str(w) for w in (arguments.program, *words)], check=True, capture_output=True, text=True).stdout

    def probe(cache, names, points, truths, row_of):
        table = arguments.folder / "points.csv"
        np.savetxt(table, points, delimiter=",", fmt="%.17g")
        for how, words in (("cache", ()), ("source", ("--source",))):
            begun = time.time()
            answers = list(csv.reader(io.StringIO(run("info", cache, "--probe", table, *words))))
            seconds = time.time() - begun
            for name in names:
                column = answers[0].index(name)
                got = np.array([float(a[column] or "nan") for a in answers[1:]])
                error = np.abs(got - truths[name]) / (max(np.ptp(truths[name]), 1e-9 * np.abs(truths[name]).max()) or 1)
                row_of[name].update({f"{how}_max": np.nanmax(error), f"{how}_99": np.nanpercentile(error, 99),
                                     f"{how}_missed": int(np.isnan(got).sum()), f"{how}_s": seconds})

    print(f"{'grid':14}{'scalar':14}{'rank error %':>14}{'in volume':>11}{'samples so':>12}{'cache 99 %':>12}{'largest':>10}{'missed':>8}{'s':>6}{'source 99 %':>13}{'largest':>10}{'missed':>8}{'s':>6}")

    def report(grid, row_of):
        for name, row in row_of.items():
            rows.append({"grid": grid, "scalar": name, **row})
            rank = "" if "rank" not in row else f"{max(row['rank']):.3f}"
            volume = "".join(f"{max(row[of]):.3f}".rjust(width) if of in row else " " * width for of, width in (("field", 11), ("samples", 12)))
            print(f"{grid:14}{name:14}{rank:>14}{volume}{row['cache_99']:12.1e}{row['cache_max']:10.1e}{row['cache_missed']:8}{row['cache_s']:6.2f}"
                  f"{row['source_99']:13.1e}{row['source_max']:10.1e}{row['source_missed']:8}{row['source_s']:6.2f}", flush=True)

    for grid, read in structured(arguments.data).items():
        if not re.search(arguments.only, grid):
            continue
        files, options, xyz, there, scalars, centred = read()
        cache = arguments.folder / f"{grid}.splats"
        run("convert", *files, "-o", cache, "--overwrite", *options)
        info = json.loads(run("info", cache, "--json"))
        if centred:
            there = ~np.any([np.isnan(s) for s in scalars.values()], axis=0)
            if "S" in scalars:
                there &= np.isfinite(scalars["S"])
            u = np.full((1, 3), 0.5)
            c = corners_of(xyz)
            columns = [np.tensordot(np.array([(1 if k >> d & 1 else -1) / 4 for k in range(8)]), c, 1) for d in range(3)]
            weights = np.where(there, np.abs(np.einsum("a...,a...->...", columns[0], np.cross(columns[1], columns[2], axis=0))), 0)
        else:
            weights = node_weights(xyz, there)
        points, true_at = probe_points(xyz, there, arguments.points, rng, centred)
        names = [v["name"] for v in info["variables"]]
        by_name = dict(zip(names, scalars.values())) if not set(names) <= set(scalars) else {n: scalars[n] for n in names}
        used = weights > 0
        row_of = {}
        for n, name in enumerate(names):
            percentiles = np.array(info["histograms"][n]["percentiles"])
            wanted = [percentiles[int(round(10 * p))] for p in PARTS]
            samples, shares = by_name[name][used], weights[used]
            row_of[name] = {"rank": list(rank_errors(samples, shares, np.array(wanted)))}
            if centred:
                continue
            order = np.argsort(samples)
            sums = np.cumsum(shares[order]) / shares.sum()
            theirs = samples[order][np.searchsorted(sums, np.array(PARTS) / 100)]
            volume = field(xyz, there, by_name[name])
            row_of[name].update({"field": list(rank_errors(*volume, np.array(wanted))), "samples": list(rank_errors(*volume, theirs))})
        probe(cache, names, points, {n: true_at(by_name[n]) for n in names}, row_of)
        report(grid, row_of)
    for shape in ("hexahedra", "tetrahedra", "wedges"):
        if not re.search(arguments.only, shape):
            continue
        files, points, *truths = mesh(arguments.folder, shape, rng, arguments.points)
        for truth in truths:
            name = next(iter(truth))
            cache = arguments.folder / f"{shape}_{name}.splats"
            run("convert", *files, "-o", cache, "--overwrite", "--scalar", name)
            row_of = {name: {}}
            probe(cache, [name], points, truth, row_of)
            report(shape, row_of)
    if arguments.json:
        arguments.json.write_text(json.dumps(rows, indent=1))


if __name__ == "__main__":
    main()
