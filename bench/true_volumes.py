#!/usr/bin/env python3
"""Draws small generated grids as a uniform medium and compares volumes and optical depths with exact ones.

    bench/true_volumes.py FOLDER [--only REGEX] [--quick] [--program PROGRAM] [--dump DUMP_CACHE] [--convert=OPTION ...] [--json OUT.json]

Each grid has one trouble of real ones: cells that grow quickly from a wall, closed rows, one layer of cells, joints at an angle,
steep terrain, poles, an ocean's floor in steps, a mesh that is refined 2:1. The columns:

weights         sum of the splats' weights over the grid's volume (of trilinear cells, exact by quadrature)
uniform         the least and the largest total optical depth of four views, over the exact one
above middle    the same of what is warmer than the middle of the range; with --quick of one view
rms, p98/p2     deviation of the optical depth over the true one, inside of the outline, in squares of 4 x 4 pixels; the worst view
of 255          the largest difference of a square, where a third of the diagonal halves the light
outside         optical depth in squares that have none and lie beside none that has
beyond          how far means of splats, of all levels, go beyond the samples, in % of their range

--quick: grids that have limits (LIMITS) alone, with fewer points for the truth; exit status 1 if a figure is beyond its limit.
Needs numpy.
"""
import argparse
import json
import pathlib
import re
import subprocess
import sys

try:
    import numpy as np
except ImportError:
    print("true_volumes: needs numpy; skipped")
    sys.exit(77)

HERE = pathlib.Path(__file__).resolve().parent
VIEWS = {"+x": (1, 0, 0), "+y": (0, 1, 0), "+z": (0, 0, 1), "oblique": (0.6, 0.5, 0.62)}  # towards the camera
PIXELS = 192
BLOCK = 4  # pixels along the edge of the squares that depths are compared in


def cell_corners(xyz):
    """[cell, corner of 8, 3], the corner's number with bits along i, j, k."""
    n = [slice(0, -1), slice(1, None)]
    return np.stack([xyz[n[c & 1], n[c >> 1 & 1], n[c >> 2]].reshape(-1, 3) for c in range(8)], axis=1)


def coefficients(corners):
    """[term, component, cell] of trilinear cells: the term of u has bit 1, of v bit 2, of w bit 4."""
    terms = np.moveaxis(corners, 0, -1).copy()
    for bit in (1, 2, 4):
        for c in range(8):
            if c & bit:
                terms[c] -= terms[c ^ bit]
    return terms


def trilinear(terms, u, v, w):
    """[component, cell]."""
    _1, _u, _v, _uv, _w, _uw, _vw, _uvw = terms
    return _1 + u * (_u + v * (_uv + w * _uvw) + w * _uw) + v * (_v + w * _vw) + w * _w


def determinant(terms, u, v, w):
    """The Jacobian's, without its sign."""
    _, _u, _v, _uv, _w, _uw, _vw, _uvw = terms
    x_u = _u + v * (_uv + w * _uvw) + w * _uw
    x_v = _v + u * (_uv + w * _uvw) + w * _vw
    x_w = _w + u * (_uw + v * _uvw) + v * _vw
    return np.abs(sum(x_u[n] * (x_v[n - 2] * x_w[n - 1] - x_v[n - 1] * x_w[n - 2]) for n in range(3)))


def halves(corners):
    """[part of 8 * cell, corner of 8, 3]: the cells' parts, by their own trilinear maps."""
    terms = coefficients(corners)
    return np.concatenate([np.stack([trilinear(terms, *((part >> axis & 1) / 2 + (c >> axis & 1) / 2 for axis in range(3))).T
                                     for c in range(8)], axis=1) for part in range(8)])


def drawn_cells(xyz, values):
    """Corners of the cells that are drawn (those without NaN), and the values at them (or theirs). A mesh comes as such corners."""
    if xyz.ndim == 3:
        return xyz, values.reshape(len(xyz), -1, 1), values.ndim == 2
    of_nodes = values.shape == xyz.shape[:3]
    f = cell_corners(np.repeat(values[..., None], 3, -1))[..., :1] if of_nodes else values.reshape(-1, 1, 1)
    there = ~np.isnan(f).any(axis=(1, 2))
    return cell_corners(xyz)[there], f[there], of_nodes


def volumes(blocks, threshold, points):
    """The volume of the trilinear cells, and of what is above the threshold."""
    at, weight = np.polynomial.legendre.leggauss(points)
    at, weight = (at + 1) / 2, weight / 2
    whole = above = 0.0
    for xyz, values in blocks:
        corners, f, of_nodes = drawn_cells(xyz, values)
        terms, terms_of_f = coefficients(corners), coefficients(f) if of_nodes else None
        for u, a in zip(at, weight):
            for v, b in zip(at, weight):
                for w, c in zip(at, weight):
                    part = a * b * c * determinant(terms, u, v, w)
                    here = trilinear(terms_of_f, u, v, w)[0] if of_nodes else f[:, 0, 0]
                    whole += part.sum()
                    above += part[here > threshold].sum()
    return whole, above


def axes_of(view):
    """Right, up and back."""
    back = np.array(VIEWS[view]) / np.linalg.norm(VIEWS[view])
    right = np.cross((0, 1, 0) if view == "+z" else (0, 0, 1), back)
    right /= np.linalg.norm(right)
    return right, np.cross(back, right), back


def depths_of(blocks, middle, scale, points):
    """The volume that lies behind each square of the picture, of each view: points in all cells, about as many as the cell has of the
    volume, each with its share of it; in halves of a few large cells. They are those of a sequence of low discrepancy, which each cell begins elsewhere, so that the
    points of many cells do not line up."""
    at_once = 1 << 16
    count = PIXELS // BLOCK
    sums = {view: np.zeros(count * count) for view in VIEWS}
    to_squares = np.concatenate([axes_of(view)[:2] for view in VIEWS]) * count / (2 * scale)
    cells = np.concatenate([drawn_cells(xyz, values)[0] for xyz, values in blocks])
    terms = coefficients(halves(cells) if len(cells) < 10_000 else cells)
    volume = determinant(terms, 0.5, 0.5, 0.5)
    halvings = np.rint(np.log2(np.maximum(points * volume / volume.sum(), 64))).astype(int)
    begin = np.random.default_rng(1).random((3, len(volume), 1))
    for per_cell in 1 << np.unique(halvings):
        some = 1 << halvings == per_cell
        of_some = terms[..., some, None]
        step = max(1, at_once // some.sum())
        for first in range(0, per_cell, step):
            n = np.arange(first, min(first + step, per_cell))
            u, v, w = ((begin[axis, some] + n * 1.2207440846057596 ** (-axis - 1)) % 1 for axis in range(3))
            part = np.ravel(determinant(of_some, u, v, w) / per_cell)
            at = trilinear(of_some, u, v, w).reshape(3, -1)
            places = (to_squares @ (at - middle[:, None]) + count / 2).astype(int)
            for view, x, y in zip(VIEWS, places[::2], places[1::2]):
                sums[view] += np.bincount(y * count + x, weights=part, minlength=count * count)
    return {view: of_view.reshape(count, count) for view, of_view in sums.items()}


def around(picture, reduce):
    """The least or largest of each square and the eight around it."""
    wide = np.pad(picture, 1, mode="edge")
    rows, columns = picture.shape
    return reduce([wide[j:j + rows, i:i + columns] for j in range(3) for i in range(3)], axis=0)


def means_of(dump, cache):
    """The least and the largest mean of the first scalar of all splats (tests/programs/dump_cache.cpp)."""
    dumped = subprocess.run([str(dump), str(cache)], check=True, capture_output=True).stdout
    at, least, most = 0, np.inf, -np.inf
    while at < len(dumped):
        splats, runs = (int(n) for n in np.frombuffer(dumped, "<u8", 2, at))
        at += 16 + 40 * runs + 4 * 12 * splats
        means = np.frombuffer(dumped, "<f4", splats, at)
        least, most = min(least, means.min()), max(most, means.max())
        at += 4 * 5 * splats
    return float(least), float(most)


def lattice(i, j, k, to_xyz):
    return np.stack(to_xyz(*np.meshgrid(i, j, k, indexing="ij")), axis=-1)


def growing(first, factor, count):
    return np.concatenate([[0], np.cumsum(first * factor ** np.arange(count))])


def polar(r, t, z):
    return r * np.cos(t), r * np.sin(t), z


def sphere(r, lat, lon):
    return r * np.cos(lat) * np.cos(lon), r * np.cos(lat) * np.sin(lon), r * np.sin(lat)


def nodes(xyz, f):
    return xyz, f(*np.moveaxis(xyz, -1, 0))


def cells(xyz, f):
    return xyz, f(*cell_corners(xyz).mean(axis=1).T).reshape([n - 1 for n in xyz.shape[:3]])


def torus(around, layers):
    def at(r, t, p):
        return (3 + r * np.cos(t)) * np.cos(p), (3 + r * np.cos(t)) * np.sin(p), r * np.sin(t)
    turn = np.linspace(0, 2 * np.pi, around + 1)
    return lattice(layers, turn, turn, at)


def closed(xyz, axis):
    """Makes the last plane the first one's bits."""
    xyz = np.moveaxis(xyz, axis, 0).copy()
    xyz[-1] = xyz[0]
    return np.moveaxis(xyz, 0, axis)


def grids():
    def height(x, y, z):
        return z
    radial = growing(0.01, 1.35, 18)
    yield "omesh", [nodes(lattice(1 + radial, np.linspace(0, 1.5 * np.pi, 31), np.linspace(0, 3, 5), polar), height)]
    spheres = lattice(1 + radial, np.linspace(-1.2, 1.2, 17), np.linspace(0, 4.5, 31), sphere)
    yield "omesh_sphere", [nodes(spheres, height)]
    yield "omesh_cells", [cells(lattice(1 + radial, np.linspace(0, 1.5 * np.pi, 31), np.linspace(0, 3, 5), polar), height)]
    ring = lattice(np.linspace(1, 2, 9), np.linspace(0, 2 * np.pi, 37), np.linspace(0, 1, 9), polar)
    yield "ring", [nodes(closed(ring, 1), height)]
    yield "torus", [nodes(closed(closed(torus(24, np.linspace(0.5, 1, 7)), 1), 2), lambda x, y, z: np.hypot(np.hypot(x, y) - 3, z))]
    thin = lattice(6371 + np.arange(9) * 0.02, np.radians(np.arange(-60, 61, 10)), np.radians(np.arange(0, 361, 10)), sphere)
    yield "thin_layers", [nodes(closed(thin, 2), lambda x, y, z: 10 + 5 * (np.sqrt(x * x + y * y + z * z) - 6371) / 0.16)]
    for degrees in (2, 5):
        air = lattice(6371 + np.arange(13) * 30, np.radians(np.arange(-60, 61, degrees)), np.radians(np.arange(0, 361, degrees)), sphere)
        yield f"sphere_{degrees}", [nodes(closed(air, 2), lambda x, y, z: 307 - 100 * (np.sqrt(x * x + y * y + z * z) - 6371) / 360)]
    globe = lattice(np.linspace(1, 2, 9), np.radians(np.linspace(-90, 90, 19)), np.radians(np.arange(0, 361, 10)), sphere)
    globe[:, [0, -1], :, :2] = 0
    yield "poles", [nodes(closed(globe, 2), height)]
    plate = lattice(np.linspace(0, 4, 41), np.linspace(0, 3, 31), [0, 0.6], lambda x, y, z: (x + 0.2 * y, y, z))
    yield "slab_cells", [cells(plate, lambda x, y, z: x)]
    u = np.linspace(0, 1, 17)
    chevron = [lattice(u, u, u, lambda x, y, z, s=s: (s * x, y + 0.7 * x, z)) for s in (1, -1)]
    yield "joint", [nodes(block, height) for block in chevron]
    corner = [(0, 0), (1, 0), (0.5, 0.9), (-0.8, 0.8), (-1, -0.1), (-0.6, -1), (0.5, -0.9)]

    def patch(a, b, c):
        return lattice(u, u, u, lambda x, y, z: tuple(x * (1 - y) * a[n] + x * y * b[n] + (1 - x) * y * c[n] for n in (0, 1)) + (z,))
    yield "corner", [nodes(patch(corner[1 + 2 * n], corner[2 + 2 * n], corner[1 + (2 * n + 2) % 6]), height) for n in range(3)]

    def hills(x, y, s):  # drawn ten times as high
        ground = 6 + 2 * np.sin(2.1 * x + 0.7 * y) + 2 * np.sin(1.3 * x - 2.3 * y + 1) + np.sin(3.9 * x + 2.5 * y)
        return x, y, ground + s * (16 - ground)
    flat = np.linspace(0, 8, 25)
    layers = lattice(flat, flat, np.linspace(0, 1, 9) ** 1.5, hills)
    yield "terrain", [nodes(layers, height)]
    yield "terrain_cells", [cells(layers, height)]
    sheared = lattice(np.linspace(0, 1, 17), np.linspace(0, 1, 17), np.linspace(0, 1, 17), lambda x, y, z: (x + 6 * z, y, z))
    yield "sheared", [nodes(sheared, height)]
    twist = lattice(np.linspace(1, 2, 13), np.linspace(0, 2 * np.pi, 49), np.linspace(0, 1, 9),
                    lambda r, t, z: polar(r, t + 3 * r * z, 4 * z))
    yield "field_lines", [nodes(closed(twist, 1), height)]
    levels = lattice(np.linspace(0, 10, 26), np.linspace(0, 8, 21), -growing(0.05, 1.2, 14), lambda x, y, z: (x, y, z))
    yield "sea_floor", [with_land(*nodes(levels, lambda x, y, z: z + 0.2 * x))]
    yield "sea_floor_cells", [with_land(*cells(levels, lambda x, y, z: z + 0.2 * x))]
    hexahedra = cell_corners(layers)
    yield "terrain_mesh", [(hexahedra, hexahedra[..., 2])]
    hexahedra = cell_corners(lattice(1 + radial, np.linspace(0, 1.5 * np.pi, 31), np.linspace(0, 3, 5), polar))
    yield "omesh_mesh", [(hexahedra, hexahedra[..., 2])]
    yield "omesh_mesh_cells", [(hexahedra, hexahedra[..., 2].mean(axis=1))]
    octree = refined_mesh(8, 2)
    yield "octree", [(octree, octree[..., 2])]
    yield "octree_cells", [(octree, octree[..., 2].mean(axis=1))]


def refined_mesh(base, levels):
    """Corners of the cubes of an octree, fine near a sphere: neighbours differ by one level at most, and nodes hang."""
    cells = {(0, *c) for c in np.ndindex(base, base, base)}

    def split(cell):
        cells.remove(cell)
        cells.update((cell[0] + 1, *(2 * np.array(cell[1:]) + c).tolist()) for c in np.ndindex(2, 2, 2))
    for level in range(levels):
        size = 1 / (base << level)
        for cell in sorted(c for c in cells if c[0] == level):
            if abs(np.linalg.norm((np.array(cell[1:]) + 0.5) * size - 0.45) - 0.3) < (1.2 if level == 0 else 0.8) * size:
                split(cell)
        coarse = True
        while coarse:
            coarse = {(up, *above) for c in cells for axis in range(3) for side in (-1, 1) for up in range(c[0] - 1)
                      if (up, *(above := tuple(int(x) + side * (n == axis) >> c[0] - up for n, x in enumerate(c[1:])))) in cells}
            for cell in sorted(coarse):
                split(cell)
    return np.array([[(np.array(c[1:]) + (n & 1, n >> 1 & 1, n >> 2)) / (base << c[0]) for n in range(8)] for c in sorted(cells)])


def with_land(xyz, values):
    """A sea of z-levels, whose floor is steps, with samples of land here and there, and single ones of water in the land."""
    middles = xyz if values.shape == xyz.shape[:3] else cell_corners(xyz).mean(axis=1).reshape(*values.shape, 3)
    x, y, z = np.moveaxis(middles, -1, 0)
    water = z > -(1 + 4 * np.sin(0.3 * x) ** 2 + 0.6 * y) * (1 + 0.2 * np.sin(1.7 * x + 2.3 * y))
    alone = np.zeros(water.shape, bool)
    alone[2::5, 2::5, -3::-4] = True
    return xyz, np.where(water ^ (alone & (z < -1)), values, np.nan)


def write_plot3d(path, blocks):
    with open(path.with_suffix(".xyz"), "wb") as grid, open(path.with_suffix(".fun"), "wb") as function:
        np.array([len(blocks)], "<i4").tofile(grid)
        np.array([len(blocks)], "<i4").tofile(function)
        for xyz, _ in blocks:
            np.array(xyz.shape[:3], "<i4").tofile(grid)
            np.array([*xyz.shape[:3], 1], "<i4").tofile(function)
        for xyz, values in blocks:
            xyz.transpose(3, 2, 1, 0).astype("<f8").tofile(grid)
            values.transpose(2, 1, 0).astype("<f8").tofile(function)
    return [path.with_suffix(".xyz"), path.with_suffix(".fun")]


def write_cells(path, xyz, values):
    extent = " ".join(f"0 {n - 1}" for n in xyz.shape[:3])
    def text(array, components):
        array = array.transpose(2, 1, 0, *([3] if components > 1 else [])).reshape(-1)
        return " ".join(f"{x:.17g}" for x in array)
    path.with_suffix(".vts").write_text(
        f'<VTKFile type="StructuredGrid" version="0.1" byte_order="LittleEndian"><StructuredGrid WholeExtent="{extent}">'
        f'<Piece Extent="{extent}"><CellData><DataArray type="Float64" Name="f" format="ascii">{text(values, 1)}</DataArray></CellData>'
        f'<Points><DataArray type="Float64" NumberOfComponents="3" format="ascii">{text(xyz, 3)}</DataArray></Points>'
        "</Piece></StructuredGrid></VTKFile>")
    return [path.with_suffix(".vts")]


def write_mesh(path, corners, values):
    points, numbers = np.unique(corners.reshape(-1, 3), axis=0, return_inverse=True)
    cells = numbers.reshape(-1, 8)[:, [0, 1, 3, 2, 4, 5, 7, 6]]
    of_points = values.ndim == 2
    if of_points:
        values = values.reshape(-1)[np.unique(numbers, return_index=True)[1]]

    def array(kind, name, data, components=1):
        text = " ".join(f"{x:.17g}" for x in np.ravel(data))
        return f'<DataArray type="{kind}" Name="{name}" NumberOfComponents="{components}" format="ascii">{text}</DataArray>'
    data = "PointData" if of_points else "CellData"
    path.with_suffix(".vtu").write_text(
        '<VTKFile type="UnstructuredGrid" version="0.1" byte_order="LittleEndian"><UnstructuredGrid>'
        f'<Piece NumberOfPoints="{len(points)}" NumberOfCells="{len(cells)}"><{data}>{array("Float64", "f", values)}</{data}>'
        f'<Points>{array("Float64", "points", points, 3)}</Points><Cells>{array("Int64", "connectivity", cells)}'
        f'{array("Int64", "offsets", 8 * np.arange(1, len(cells) + 1))}{array("UInt8", "types", np.full(len(cells), 12))}</Cells>'
        "</Piece></UnstructuredGrid></VTKFile>")
    return [path.with_suffix(".vtu")]


def write(path, blocks):
    xyz, values = blocks[0]
    if xyz.ndim == 3:
        return write_mesh(path, xyz, values)
    return write_plot3d(path, blocks) if values.shape == xyz.shape[:3] else write_cells(path, xyz, values)


def read_pfm(path):
    with open(path, "rb") as file:
        kind, size, scale = (file.readline().split() for _ in range(3))
        channels = 3 if kind[0] == b"PF" else 1
        return np.frombuffer(file.read(), "<f4" if float(scale[0]) < 0 else ">f4").reshape(int(size[1]), int(size[0]), channels)[..., 0]


def measure(arguments, name, blocks):
    path = arguments.folder / name
    values = np.concatenate([v.ravel() for _, v in blocks])
    low, high = np.nanmin(values), np.nanmax(values)
    middle = 0.5 * (low + high)
    exact, above = volumes(blocks, middle, 6)
    cache = path.with_suffix(".splats")
    def run(*words):
        return subprocess.run([str(arguments.program), *map(str, words)], check=True, capture_output=True, text=True).stdout
    run("convert", *write(path, blocks), "-o", cache, "--overwrite", *(arguments.convert or []))
    facts = json.loads(run("info", cache, "--json"))
    row = {"grid": name, "weights": facts["volume"] / exact, "splats": facts["splats"]}
    least, most = means_of(arguments.dump, cache)
    row["beyond_percent"] = 100 * max(0, low - least, most - high) / (high - low)
    lower, upper = np.array(facts["lower"]), np.array(facts["upper"])
    size = np.linalg.norm(upper - lower)
    opaque = json.dumps([{"Name": "black", "RGBPoints": [low - 1, 0, 0, 0, high + 1, 0, 0, 0],
                          "Points": [low - 1e9, 0.5, 0.5, 0, high + 1e9, 0.5, 0.5, 0]}])
    step = json.dumps([{"Name": "step", "RGBPoints": [low - 1, 0, 0, 0, high + 1, 0, 0, 0],
                        "Points": [low - 1e9, 0, 0.5, 0, middle, 0, 0.5, 0, middle + 1e-6 * (high - low), 0.5, 0.5, 0,
                                   high + 1e9, 0.5, 0.5, 0]}])
    totals, ratios, worst, outside = {}, [], 0.0, 0.0
    scale, centre = 0.52 * size, (lower + upper) / 2
    truth = depths_of(blocks, centre, scale, 3_000_000 if arguments.quick else 12_000_000)
    for what, preset, volume in (("uniform", opaque, exact), ("above", step, above)):
        chosen = path.with_suffix(f".{what}.json")
        chosen.write_text(preset)
        depths = []
        for view in VIEWS if what == "uniform" or not arguments.quick else ["oblique"]:
            picture = path.with_suffix(f".{what}{view}.pfm")
            def point(p):
                return ",".join(f"{x:.17g}" for x in p)
            _, up, back = axes_of(view)
            run("render", cache, "-o", picture, "--size", f"{PIXELS}x{PIXELS}", "--tf", chosen, f"--opacity-unit={size / 3}",
                f"--position={point(centre + size * back)}", f"--focal-point={point(centre)}", f"--view-up={point(up)}",
                "--parallel-scale", scale, "--lod-pixels", 0, "--backend", "cpu", "--background", "white")
            depth = -np.log(np.clip(read_pfm(picture), 1e-12, 1)) * (size / 3) / np.log(2)
            depths.append(depth.sum() * (2 * scale / PIXELS) ** 2 / volume)
            if what == "above":
                continue
            side = PIXELS // BLOCK
            drawn = depth.reshape(side, BLOCK, side, BLOCK).mean(axis=(1, 3))
            true = truth[view] / (2 * scale / side) ** 2
            is_in = around(true, np.min) > 0.05 * true.max()
            ratios.append((drawn / np.where(is_in, true, 1))[is_in])
            worst = max(worst, 255 * np.abs(np.exp2(-3 * drawn / size) - np.exp2(-3 * true / size)).max())
            outside = max(outside, 100 * drawn[around(true, np.max) == 0].sum() / drawn.sum())
        totals[what] = depths
    row |= {what: (min(d), max(d)) for what, d in totals.items()}
    row |= {"rms_percent": max(100 * np.std(r / r.mean()) for r in ratios if len(r)), "worst_255": worst, "outside_percent": outside,
            "p98_over_p2": max(np.quantile(r, 0.98) / np.quantile(r, 0.02) for r in ratios if len(r))}
    return row


# Grids whose trouble no other test draws: how far what is above the middle may be off, as a share of it; rms in %; p98/p2; of 255;
# outside in %. For all: weights within 1e-3, the uniform medium within 1 %, means beyond the samples by 0.1 % of their range.
LIMITS = {
    "omesh_cells": (0.02, 1.3, 1.06, 9, 0.05),
    "sphere_5": (0.05, 0.6, 1.03, 3, 0.05),
    "joint": (0.02, 0.6, 1.03, 9, 0.05),
    "corner": (0.02, 0.9, 1.05, 10, 0.05),
    "terrain": (0.02, 1.1, 1.05, 9, 0.05),
    "sheared": (0.02, 0.9, 1.05, 10, 0.05),
    "field_lines": (0.02, 1.2, 1.06, 10, 0.05),
    "sea_floor": (0.02, 0.9, 1.05, 12, 0.05),
    "sea_floor_cells": (0.02, 1.5, 1.07, 12, 0.05),
    "octree": (0.02, 0.9, 1.04, 9, 0.05),
    "octree_cells": (0.05, 1.0, 1.05, 12, 0.05),
}


def beyond_limits(row):
    above, *limits = LIMITS[row["grid"]]
    figures = {"weights": (abs(row["weights"] - 1), 1e-3), "uniform": (max(abs(total - 1) for total in row["uniform"]), 0.01),
               "above middle": (max(abs(total - 1) for total in row["above"]), above), "beyond %": (row["beyond_percent"], 0.1)}
    figures |= {name: (row[name], limit) for name, limit in zip(("rms_percent", "p98_over_p2", "worst_255", "outside_percent"), limits)}
    return [f"{row['grid']}: {name}: {figure:.4g} is beyond the limit {limit:g}"
            for name, (figure, limit) in figures.items() if not figure <= limit]


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=pathlib.Path)
    parser.add_argument("--only", default=".*")
    parser.add_argument("--program", default=HERE.parent / "build/release/tools/curvisplat")
    parser.add_argument("--dump", default=HERE.parent / "build/release/tests/dump_cache")
    parser.add_argument("--convert", action="append", help="an option for convert")
    parser.add_argument("--quick", action="store_true")
    parser.add_argument("--json", type=pathlib.Path)
    arguments = parser.parse_args()
    arguments.folder.mkdir(parents=True, exist_ok=True)
    rows, missed = [], []
    print(f"{'grid':<16} {'weights':>8} {'uniform, views':>16} {'above middle':>16} {'rms %':>6} {'p98/p2':>6} {'of 255':>6} {'outside %':>9} "
          f"{'beyond %':>8} {'splats':>8}")
    for name, blocks in grids():
        if not re.search(arguments.only, name) or (arguments.quick and name not in LIMITS):
            continue
        row = measure(arguments, name, blocks)
        print(f"{name:<16} {row['weights']:8.5f} {row['uniform'][0]:7.4f} {row['uniform'][1]:8.4f} {row['above'][0]:7.3f} "
              f"{row['above'][1]:8.3f} {row['rms_percent']:6.2f} {row['p98_over_p2']:6.3f} {row['worst_255']:6.1f} {row['outside_percent']:9.3f} "
              f"{row['beyond_percent']:8.3f} {row['splats']:8d}", flush=True)
        rows.append(row)
        if arguments.quick:
            missed += beyond_limits(row)
    if arguments.json:
        arguments.json.write_text(json.dumps(rows, indent=1) + "\n")
    print("\n".join(missed), end="\n" if missed else "")
    return 1 if missed else 0


if __name__ == "__main__":
    sys.exit(main())
