#!/usr/bin/env python3
"""What `convert --dry-run` estimates for real grids, divided by what their conversion then takes.

    bench/forecasts.py [--data ../shared/data] [--program build/release/tools/curvisplat]

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


def main():
    root = pathlib.Path(__file__).resolve().parent.parent
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--data", type=pathlib.Path, default=root.parent / "shared/data")
    parser.add_argument("--program", type=pathlib.Path, default=root / "build/release/tools/curvisplat")
    words = parser.parse_args()
    far = False
    print("| grid | samples | cache | temporary | memory | time |\n|---|---|---|---|---|---|")
    for name, files in GRIDS.items():
        with tempfile.TemporaryDirectory() as folder:
            stats = []
            for more in (["--dry-run"], []):
                stats.append(pathlib.Path(folder) / f"{len(stats)}.json")
                done = subprocess.run([words.program, "convert", *[words.data / file for file in files], "-o",
                                       f"{folder}/grid.splats", "--stats", stats[-1], *more], capture_output=True, text=True)
                if done.returncode:
                    sys.exit(done.stderr)
            guess, truth = (json.loads(file.read_text()) for file in stats)
        guess = guess["dry_run"]
        ratios = [guess["cache_bytes"] / truth["cache_bytes"],
                  guess["temporary_bytes"] / truth["temporary_bytes"] if truth["temporary_bytes"] else 1,
                  guess["memory_bytes"] / truth["peak_memory_bytes"], guess["seconds"] / truth["seconds"]]
        far |= any(not 0.7 <= ratio <= 1.3 for ratio in ratios[:3])
        print(f"| {name} | {truth['samples']:,} | " + " | ".join(f"{ratio:.2f}" for ratio in ratios) + " |", flush=True)
    sys.exit(far)


if __name__ == "__main__":
    main()
