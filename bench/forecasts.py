#!/usr/bin/env python3
"""What `convert --dry-run` estimates, divided by what the conversion then takes: for real grids, generated ones, or meshes.

    bench/forecasts.py [--data ../shared/data] [--program build/release/tools/curvisplat]
    bench/forecasts.py --generated 192x128x96
    bench/forecasts.py --meshes 64,100 --memory 160M

Meshes are those of big_mesh.py: cubes of so many hexahedra, or of six times as many tetrahedra, along each edge, with the cells in
order and in a random order, and scalars at points and in cells. They need numpy.

Memory and time are of processes: other work on the machine changes the time of both. Exit status 1 where bytes or memory, of meshes
temporary bytes, are more than 30 % from the truth.
"""
import argparse
import json
import pathlib
import subprocess
import sys
import tempfile

GRIDS = {
    "bluntfin": ("bluntfin/bluntfinxyz.bin", "bluntfin/bluntfinq.bin"),
    "delta_wing": ("delta_wing/delta_vertex.cgns",),
    "lox_post": ("lox_post/postxyz.bin", "lox_post/postq.bin"),
    "combustor": ("combustor/combxyz.bin", "combustor/combq.bin"),
    "nek": ("nek/Combined_PressureSide_Block.xyz", "nek/pressure.fun"),
    "sqnz": ("cgns/sqnz_s.hdf.cgns",),
    "vtk": ("vtk/StructuredGrid.vts",),
    "nemo_northsea": ("nemo_northsea/nemo_northsea_u.xyz", "nemo_northsea/nemo_northsea_u.fun"),
}

SCENES = ("half-annulus", "shell", "o-grid", "axis", "sheared-waves", "wake", "spectral", "dome", "globe", "duct")


def generated(program, size, folder):
    """The files of each scene, which are removed before those of the next are written."""
    for scene in SCENES:
        subprocess.run([program, "generate", scene, "--size", size, "-o", f"{folder}/{scene}"], check=True, capture_output=True)
        yield scene, [f"{folder}/{scene}.xyz", f"{folder}/{scene}.fun"]
        for file in pathlib.Path(folder).glob(f"{scene}*"):
            file.unlink()


def meshes(sizes, folder):
    """The file of each mesh and a scalar of it. Files are removed as those of generated() are."""
    for size in sizes.split(","):
        for shape in ("hexahedra", "tetrahedra"):
            for order in ("in order", "shuffled"):
                file = pathlib.Path(folder) / "mesh.vtu"
                options = (["--tetrahedra"] if shape == "tetrahedra" else []) + (["--shuffled"] if order == "shuffled" else [])
                subprocess.run([sys.executable, pathlib.Path(__file__).with_name("big_mesh.py"), file, "--size", size, *options],
                               check=True)
                for scalar, centring in (("f", "points"), ("c", "cells")):
                    yield f"{size}³ {shape}, {order}, {centring}", [file, "--scalar", scalar]
                file.unlink()


def main():
    root = pathlib.Path(__file__).resolve().parent.parent
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--data", type=pathlib.Path, default=root.parent / "shared/data")
    parser.add_argument("--program", type=pathlib.Path, default=root / "build/release/tools/curvisplat")
    parser.add_argument("--generated", metavar="NIxNJxNK", help="analytic scenes of this size instead of real grids")
    parser.add_argument("--meshes", metavar="SIZES", help="meshes of cubes instead, SIZE along each edge")
    parser.add_argument("--memory", help="the conversions' --memory")
    words = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        if words.generated:
            grids = generated(words.program, words.generated, folder)
        elif words.meshes:
            grids = meshes(words.meshes, folder)
        else:
            grids = [(name, [words.data / file for file in files]) for name, files in GRIDS.items()]
        sys.exit(compare(words.program, grids, ["--memory", words.memory] if words.memory else [], bool(words.meshes)))


def compare(program, grids, options, of_meshes):
    """Prints a line for each (name, files); whether what is judged of one was more than 30 % from the truth."""
    far = False
    print("| grid | samples | cache | temporary | memory | time |\n|---|---|---|---|---|---|")
    for name, files in grids:
        with tempfile.TemporaryDirectory() as folder:
            stats = []
            for more in (["--dry-run"], []):
                stats.append(pathlib.Path(folder) / f"{len(stats)}.json")
                done = subprocess.run([program, "convert", *files, "-o", f"{folder}/grid.splats", "--stats", stats[-1],
                                       *options, *more], capture_output=True, text=True)
                if done.returncode:
                    sys.exit(done.stderr)
            guess, truth = (json.loads(file.read_text()) for file in stats)
        guess = guess["dry_run"]
        ratios = [guess["cache_bytes"] / truth["cache_bytes"],
                  guess["temporary_bytes"] / truth["temporary_bytes"] if truth["temporary_bytes"] else 1,
                  guess["memory_bytes"] / truth["peak_memory_bytes"], guess["seconds"] / truth["seconds"]]
        far |= any(not 0.7 <= ratio <= 1.3 for ratio in (ratios[1:2] if of_meshes else ratios[:3]))
        print(f"| {name} | {truth['samples']:,} | " + " | ".join(f"{ratio:.2f}" for ratio in ratios) + " |", flush=True)
    return far


if __name__ == "__main__":
    main()
