#!/usr/bin/env python3
"""Draws every grid with curvisplat and with VTK, compares both with the truth, and makes one table and one sheet of pictures.

    bench/real_grids.py FOLDER [--data DATA] [--only REGEX] [--views REGEX] [--pixels N] [--json OUT.json] [--table OUT.md]

Without --data: the generated grids alone. With it: also those of the folder of real grids (real_grids_cases.cpp names them).
Caches, marched pictures and VTK's pictures stay in FOLDER and are used again. FOLDER/sheet.png has all grids at half size,
FOLDER/sheet_GRID.png one at full size; a row has for the uniform medium and then for the scalar curvisplat's picture, the truth,
VTK's, and the differences of curvisplat and of VTK to the truth, around grey, 5 and 10 times as large as they are.
real_grids.cpp says what the columns of the table are.
"""
import argparse
import json
import pathlib
import signal
import subprocess
import sys

HERE = pathlib.Path(__file__).resolve().parent
sys.path.insert(0, str(HERE / "peers"))
import results
from compare_peers import display, python_with_vtk

TECHNIQUES = ["projected-tetrahedra", "ray-cast"]


def drawn_by_vtk(arguments, words):
    """Draws what is missing; a grid that VTK cannot draw in time is left out, and named."""
    results.run([arguments.program, arguments.folder, *words, "--for-vtk"])
    python = python_with_vtk(arguments.vtk_python)
    with display(arguments.display):
        for job in sorted(arguments.folder.glob("*_vtk.json")):
            try:
                results.run([python, HERE / "peers/vtk_views.py", arguments.technique, job], timeout=arguments.vtk_seconds)
            except subprocess.TimeoutExpired:
                print(f"{job.stem.removesuffix('_vtk')}: VTK took more than {arguments.vtk_seconds} s; some of its "
                      "pictures are missing", file=sys.stderr)
            job.unlink()


def worst_rows(rows):
    """For each grid the worst of each column over its views."""
    of_grid = {}
    for row in rows:
        of_grid.setdefault(row["grid"], []).append(row)
    largest = ["rms_percent", "p98_over_p2", "outside_percent", "order_255"]
    for grid, views in of_grid.items():
        worst = {"grid": grid}
        for key in views[0]:
            if key in ("grid", "view", "lod_pixels"):
                continue
            pick = max if key in largest else min
            found = pick((view for view in views if key in view), key=lambda view: view[key])
            worst[key] = (found[key], found["view"])
        yield worst


COLUMNS = [("rms %", "rms_percent", ".2f"), ("p98/p2", "p98_over_p2", ".3f"), ("outside %", "outside_percent", ".3f"),
           ("order", "order_255", ".0f"), ("inside", "inside_psnr_db", ".1f"), ("VTK", "vtk_inside_psnr_db", ".1f"),
           ("all pixels", "uniform_psnr_db", ".1f"), ("VTK", "vtk_uniform_psnr_db", ".1f"),
           ("scalar", "scalar_psnr_db", ".1f"), ("VTK", "vtk_scalar_psnr_db", ".1f")]


def table_of(rows):
    """Markdown: the worst view of each grid, column by column."""
    lines = ["| grid | " + " | ".join(name for name, _, _ in COLUMNS) + " |", "|---" * (len(COLUMNS) + 1) + "|"]
    for worst in worst_rows(rows):
        cells = [f"{worst[key][0]:{form}} ({worst[key][1]})" if key in worst else "" for _, key, form in COLUMNS]
        lines.append(f"| {worst['grid']} | " + " | ".join(cells) + " |")
    return "\n".join(lines) + "\n"


def parsed():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=pathlib.Path)
    parser.add_argument("--data", help="folder of real grids (default: only the generated ones)")
    parser.add_argument("--only", default=".*", help="regular expression of the grids")
    parser.add_argument("--views", default=".*", help="regular expression of the views: +x, '+x 0.1', ..., iso")
    parser.add_argument("--pixels", default="256", help="width and height of the pictures")
    parser.add_argument("--rays", default="1", help="average the uniform medium's truth over N x N rays a pixel")
    parser.add_argument("--refine", default="1", help="convert with each cell cut into N x N x N, or with 0 as --refine auto does; the truth stays that of the grid")
    parser.add_argument("--lod-pixels", default="0", help="screen error; 0 is the finest level")
    parser.add_argument("--technique", default=TECHNIQUES[0], choices=TECHNIQUES, help="VTK's")
    parser.add_argument("--without-vtk", action="store_true")
    parser.add_argument("--vtk-seconds", type=float, default=600, help="VTK's time for a grid")
    parser.add_argument("--program", default=HERE.parent / "build/release/bench/curvisplat_real_grids", type=pathlib.Path)
    parser.add_argument("--vtk-python", help="a Python that has VTK 9")
    parser.add_argument("--display", help="display to draw on (default: a virtual one)")
    parser.add_argument("--json", type=pathlib.Path, help="default: FOLDER/real_grids.json")
    parser.add_argument("--table", type=pathlib.Path, help="default: FOLDER/real_grids.md")
    return parser.parse_args()


def main():
    arguments = parsed()
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(1))  # so that Xvfb is ended as well
    arguments.folder.mkdir(parents=True, exist_ok=True)
    told = arguments.json or arguments.folder / "real_grids.json"
    words = ["--only", arguments.only, "--views", arguments.views, "--pixels", arguments.pixels]
    if arguments.data:
        words += ["--data", arguments.data]
    if not arguments.without_vtk:
        drawn_by_vtk(arguments, words)
    command = [str(word) for word in [arguments.program, arguments.folder, *words, "--lod-pixels", arguments.lod_pixels,
                                      "--rays", arguments.rays, "--refine", arguments.refine, "--json", told]]
    if subprocess.run(command).returncode != 0:
        sys.exit(1)
    table = table_of(json.loads(told.read_text()))
    (arguments.table or arguments.folder / "real_grids.md").write_text(table)
    print(f"\nThe worst view of each grid:\n\n{table}\n{arguments.folder / 'sheet.png'}")


if __name__ == "__main__":
    main()
