#!/usr/bin/env python3
"""What `convert --dry-run` estimates, divided by what the conversion then takes: for real grids, or for generated ones.

    bench/forecasts.py [--data ../shared/data] [--program build/release/tools/curvisplat]
    bench/forecasts.py --generated 192x128x96

Memory and time are of processes: other work on the machine changes the time of both. Exit status 1 where bytes or memory are
more than 30 % from the truth.
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


def main():
    root = pathlib.Path(__file__).resolve().parent.parent
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--data", type=pathlib.Path, default=root.parent / "shared/data")
    parser.add_argument("--program", type=pathlib.Path, default=root / "build/release/tools/curvisplat")
    parser.add_argument("--generated", metavar="NIxNJxNK", help="analytic scenes of this size instead of real grids")
    words = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        if words.generated:
            grids = generated(words.program, words.generated, folder)
        else:
            grids = [(name, [words.data / file for file in files]) for name, files in GRIDS.items()]
        sys.exit(compare(words.program, grids))


def compare(program, grids):
    """Prints a line for each (name, files); whether bytes or memory of one were more than 30 % from the truth."""
    far = False
    print("| grid | samples | cache | temporary | memory | time |\n|---|---|---|---|---|---|")
    for name, files in grids:
        with tempfile.TemporaryDirectory() as folder:
            stats = []
            for more in (["--dry-run"], []):
                stats.append(pathlib.Path(folder) / f"{len(stats)}.json")
                done = subprocess.run([program, "convert", *files, "-o", f"{folder}/grid.splats", "--stats", stats[-1],
                                       *more], capture_output=True, text=True)
                if done.returncode:
                    sys.exit(done.stderr)
            guess, truth = (json.loads(file.read_text()) for file in stats)
        guess = guess["dry_run"]
        ratios = [guess["cache_bytes"] / truth["cache_bytes"],
                  guess["temporary_bytes"] / truth["temporary_bytes"] if truth["temporary_bytes"] else 1,
                  guess["memory_bytes"] / truth["peak_memory_bytes"], guess["seconds"] / truth["seconds"]]
        far |= any(not 0.7 <= ratio <= 1.3 for ratio in ratios[:3])
        print(f"| {name} | {truth['samples']:,} | " + " | ".join(f"{ratio:.2f}" for ratio in ratios) + " |", flush=True)
    return far


if __name__ == "__main__":
    main()
