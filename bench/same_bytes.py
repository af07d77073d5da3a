#!/usr/bin/env python3
"""Checks that two builds of the program make the same caches and pictures, byte for byte, and compares their processor time.

    bench/same_bytes.py OLD NEW FOLDER [--only NAME,...] [--rounds 3] [--time 200x200x160]

Generated grids, kept in FOLDER: scenes with smooth, growing and collapsing cells, a grid of cells, one with blanked nodes, and two
blocks that share a face. Each is converted by OLD once, and by NEW with one thread, with all, and within the least memory; both
draw the finest level from an oblique direction. Exit status 1 if a byte differs.

Then the wake of --time is converted --rounds times by each in turn. The machine may have other work, so what is printed is
the time of the processors, user and system.
"""
import argparse
import array
import math
import os
import pathlib
import resource
import shutil
import statistics
import subprocess
import sys

SCENES = {"wake": "96x64x48", "half-annulus": "120x60x40", "dome": "60x60x40", "spectral": "73x60x41",
          "globe": "90x45x20", "axis": "60x40x50", "o-grid": "200x100x40"}
WAYS = {"all threads": [], "one thread": ["--threads", "1"], "160 MiB": ["--memory", "160M"]}


def run(*command):
    done = subprocess.run([str(word) for word in command], capture_output=True, text=True)
    if done.returncode:
        sys.exit(f"same_bytes: {' '.join(map(str, command))}: {done.stderr.strip()}")


def nodes_of(size, shift):
    """Positions of a sheared grid, i fastest, that grows along j."""
    ni, nj, nk = size
    for k in range(nk):
        for j in range(nj):
            for i in range(ni):
                u, v, w = i / (ni - 1), j / (nj - 1), k / (nk - 1)
                yield u + shift + 0.1 * math.sin(3 * v) + 0.02 * math.sin(7 * w), math.expm1(3 * v) / 19, w * (1 + 0.3 * (u + shift))


def scalar_of(x, y, z):
    return math.sin(5 * x) * y + z


def write_plot3d(prefix, blocks, blanks):
    """Blocks of nodes, as multi-block files of floats. `blanks`: every seventh value of some rows is not a number."""
    counts, dims = array.array("i", [len(blocks)]), array.array("i")
    dims_of_values = array.array("i")
    grid, values = array.array("f"), array.array("f")
    for size, shift in blocks:
        dims.extend(size)
        dims_of_values.extend([*size, 1])
        points = list(nodes_of(size, shift))
        for axis in range(3):
            grid.extend(point[axis] for point in points)
        row = size[0]
        values.extend(math.nan if blanks and n % 7 == 0 and n // row % 5 == 2 else scalar_of(*point) for n, point in enumerate(points))
    with open(f"{prefix}.xyz", "wb") as file:
        file.write(counts.tobytes() + dims.tobytes() + grid.tobytes())
    with open(f"{prefix}.fun", "wb") as file:
        file.write(counts.tobytes() + dims_of_values.tobytes() + values.tobytes())


def write_cells(path, size):
    """A legacy VTK file with a value for each cell."""
    points = array.array("f", (x for point in nodes_of(size, 0) for x in point))
    cells = [n - 1 for n in size]
    values = array.array("f", (math.sin(0.1 * n) for n in range(cells[0] * cells[1] * cells[2])))
    points.byteswap()
    values.byteswap()
    with open(path, "wb") as file:
        file.write(b"# vtk DataFile Version 3.0\ncells\nBINARY\nDATASET STRUCTURED_GRID\nDIMENSIONS %d %d %d\nPOINTS %d float\n"
                   % (*size, len(points) // 3))
        file.write(points.tobytes())
        file.write(b"\nCELL_DATA %d\nSCALARS c float 1\nLOOKUP_TABLE default\n" % len(values) + values.tobytes())


def grids_in(folder, program):
    grids = {}
    for scene, size in SCENES.items():
        if not (folder / f"{scene}.fun").exists():
            run(program, "generate", scene, "--size", size, "-o", folder / scene)
        grids[scene] = [folder / f"{scene}.xyz", folder / f"{scene}.fun"]
    write_plot3d(folder / "blanks", [((50, 40, 30), 0)], True)
    write_plot3d(folder / "blocks", [((40, 30, 30), 0), ((25, 30, 30), 1)], False)
    for name in ("blanks", "blocks"):
        grids[name] = [folder / f"{name}.xyz", folder / f"{name}.fun"]
    write_cells(folder / "cells.vtk", (61, 41, 31))
    grids["cells"] = [folder / "cells.vtk"]
    return grids


def contents(cache):
    return {path.name: path.read_bytes() for path in sorted(cache.iterdir())}


def convert(program, grid, cache, options):
    shutil.rmtree(cache, ignore_errors=True)
    run(program, "convert", *grid, "-o", cache, *options)


def picture(program, cache, folder):
    out = folder / "picture.pfm"
    out.unlink(missing_ok=True)
    run(program, "render", cache, "-o", out, "--size", "200x150", "--lod-pixels", "0", "--view", "iso")
    return out.read_bytes()


def compare(arguments):
    """Returns the number of grids with a difference."""
    differing = 0
    grids = grids_in(arguments.folder, arguments.old)
    names = arguments.only.split(",") if arguments.only else list(grids)
    unknown = [name for name in names if name not in grids]
    if unknown:
        sys.exit(f"same_bytes: --only {unknown[0]}: no such grid; there are {', '.join(grids)}")
    for name in names:
        grid = grids[name]
        cache = arguments.folder / "same.splats"
        convert(arguments.old, grid, cache, [])
        expected, drawn = contents(cache), picture(arguments.old, cache, arguments.folder)
        found = []
        for way, options in WAYS.items():
            convert(arguments.new, grid, cache, options)
            now = contents(cache)
            found += [f"{way}: {file}" for file in sorted(expected.keys() | now.keys()) if expected.get(file) != now.get(file)]
        if picture(arguments.new, cache, arguments.folder) != drawn:
            found.append("picture")
        print(f"{name}: {'differs (' + ', '.join(found) + ')' if found else 'the same'}", flush=True)
        differing += bool(found)
    return differing


def time_both(arguments):
    prefix = arguments.folder / "timed"
    run(arguments.old, "generate", "wake", "--size", arguments.time, "-o", prefix)
    seconds = {"old": [], "new": []}
    for _ in range(arguments.rounds):
        for name, program in (("old", arguments.old), ("new", arguments.new)):
            before = resource.getrusage(resource.RUSAGE_CHILDREN)
            convert(program, [f"{prefix}.xyz", f"{prefix}.fun"], arguments.folder / "same.splats", [])
            after = resource.getrusage(resource.RUSAGE_CHILDREN)
            seconds[name].append((after.ru_utime - before.ru_utime, after.ru_stime - before.ru_stime))
    for name, times in seconds.items():
        totals = [sum(time) for time in times]
        print(f"{name}: {', '.join('%.2f + %.2f' % time for time in times)} s, least {min(totals):.2f}, median {statistics.median(totals):.2f}")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("old", type=os.path.abspath)
    parser.add_argument("new", type=os.path.abspath)
    parser.add_argument("folder", type=pathlib.Path)
    parser.add_argument("--only", default="", help="names of the grids to compare (default: all)")
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--time", default="200x200x160")
    arguments = parser.parse_args()
    arguments.folder.mkdir(parents=True, exist_ok=True)
    differing = compare(arguments)
    if arguments.rounds:
        time_both(arguments)
    shutil.rmtree(arguments.folder / "same.splats", ignore_errors=True)
    sys.exit(1 if differing else 0)


if __name__ == "__main__":
    main()
