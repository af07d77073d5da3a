#!/usr/bin/env python3
"""Draws the pictures of GALLERY.md again, and writes that page.

    tools/pictures/make_gallery.py DATA [--program build/release/tools/curvisplat] [--only NAME,...]

DATA has the grids of the table below, anywhere below it. Each picture has VTK's beside it, as ParaView's volume rendering draws the same
scalar without any setting (vtk_default_volume.py); without python3-vtk9 and xvfb-run that half stays grey.
"""
import argparse
import pathlib
import shlex
import subprocess
import tempfile

import default_pictures

HERE = pathlib.Path(__file__).resolve().parent
WIDTH, HEIGHT = 400, 300

# name: (title, files, scalar, VTK's name of it or None for no picture by VTK, options of render, where the grid comes from)
GALLERY = {
    "fin": ("Density of a flow past a blunt fin: the bow shock", ["bluntfinxyz.bin", "bluntfinq.bin"], "density", "Density", [],
            "NASA's blunt fin, PLOT3D, 40x32x32; pyvista/vtk-data, Apache-2.0"),
    "wing": ("Entropy above a delta wing: the vortex from its leading edge", ["delta_vertex.cgns"], "entropy", "Density",
             ["--tf", "glow", "--range", "0.002,0.06", "--opacity", "0:0,0.2:0.1,1:0.6", "--opacity-unit", "0.05", "--surface", "kmin",
              "--surface-colour", "#8a95a3", "--position=-0.9,1.5,1.25", "--focal-point", "0.75,0.35,0.05", "--view-angle", "35"],
             "a delta wing, CGNS, 37x65x65; the examples of CGNS. VTK draws the density, as it knows no entropy"),
    "post": ("Momentum along the axis around a post in a stream of liquid oxygen", ["postxyz.bin", "postq.bin"], "momentum_x", "Momentum:x",
             [], "NASA's LOX post, PLOT3D with blanks, 38x76x38; pyvista/vtk-data, Apache-2.0"),
    "combustor": ("Density in a combustor: cold jets in hot gas", ["combxyz.bin", "combq.bin"], "density", "Density", [],
                  "NASA's combustor, PLOT3D, 57x33x25; pyvista/vtk-data, Apache-2.0"),
    "nek": ("Pressure at the nose of a wing", ["Combined_PressureSide_Block.xyz", "pressure.fun"], "4", "Function3", [],
            "a solution of Nek5000 as PLOT3D, left-handed, 61x10x151; ZhenrongJING/ConvertNek5000ToPlot3d"),
    "sea": ("Currents eastward in the north-east Atlantic and the North Sea", ["nemo_northsea_u.xyz", "nemo_northsea_u.fun"], "uo", "Function0",
            ["--tf", "cool-warm", "--range=-0.4,0.4", "--opacity", "0:0.9,0.3:0.35,0.5:0.12,0.7:0.35,1:0.9", "--opacity-unit", "2",
             "--position", "6000,-760,10500", "--focal-point", "3000,-380,5250", "--view-up", "0,0,1", "--view-angle", "34"],
            "a NEMO model as PLOT3D with blanks, 151x201x75, depths 50 times as large"),
    "globe": ("Temperature of the oceans on a cubed sphere", [f"face{n}_*.vts" for n in range(1, 7)], "T", None, [],
              "MITgcm's global ocean, six VTS files of 33x33x16 with values in cells; the script for VTK draws single grids"),
    "cells": ("Density in twelve blocks, values in cells", ["sqnz_s.hdf.cgns"], "Density", "Density", [],
              "a nozzle, CGNS, 15,228 nodes; the examples of CGNS"),
}

PAGE = """# Gallery of real grids

Left: `curvisplat render`, 400x300, with no option but those that are named. Right: the same scalar by VTK as ParaView's volume rendering
draws it without any setting: resampled to 128³ points, over white, seen along -z. `tools/pictures/make_gallery.py DATA` draws all of them
again, and writes this page; the grids are not part of the project.
"""


def drawn(program, name, data, folder):
    """The rows of both pictures beside each other."""
    _, files, scalar, of_vtk, options, _ = GALLERY[name]
    found = [path for file in files for path in sorted(data.rglob(file))[:1]]
    cache, picture = folder / f"{name}.splats", folder / f"{name}.pfm"
    subprocess.run([program, "convert", *found, "-o", cache, "--scalar", scalar], check=True, stdout=subprocess.DEVNULL)
    subprocess.run([program, "render", cache, "-o", picture, "--size", f"{WIDTH}x{HEIGHT}", *options], check=True, stdout=subprocess.DEVNULL)
    ours = default_pictures.read_pfm(picture)[2]
    vtk = default_pictures.draw_by_vtk(found, of_vtk, folder) if of_vtk else [[]] * HEIGHT
    return [bytes(max(0, min(255, round(255 * value))) for value in [*left, *right]) for left, right in zip(ours, vtk)]


def page():
    parts = [PAGE]
    for name, (title, files, scalar, _, options, source) in GALLERY.items():
        convert = shlex.join(["curvisplat", "convert", *files, "-o", f"{name}.splats", "--scalar", scalar]).replace("'", "")
        render = shlex.join(["curvisplat", "render", f"{name}.splats", "-o", f"{name}.png", "--size", f"{WIDTH}x{HEIGHT}", *options])
        parts.append(f"\n## {title}\n\n![curvisplat, VTK](gallery_{name}.png)\n\n    {convert}\n    {render}\n\nThe grid: {source}.\n")
    return "".join(parts)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("data", type=pathlib.Path)
    parser.add_argument("--program", type=pathlib.Path, default=HERE.parents[1] / "build/release/tools/curvisplat")
    parser.add_argument("--only", default="", help="names of the pictures to draw (default: all)")
    arguments = parser.parse_args()
    default_pictures.SIDE = HEIGHT
    with tempfile.TemporaryDirectory() as folder:
        for name in arguments.only.split(",") if arguments.only else GALLERY:
            rows = drawn(arguments.program.resolve(), name, arguments.data, pathlib.Path(folder))
            default_pictures.write_png(HERE / f"gallery_{name}.png", len(rows[0]) // 3, HEIGHT, rows)
    (HERE / "GALLERY.md").write_text(page())


if __name__ == "__main__":
    main()
