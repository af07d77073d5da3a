#!/usr/bin/python3
"""read_series_test.py PROGRAM DUMP_CACHE FOLDER_OF_READ_CACHE

Decodes series of time steps with read_cache.py and compares every number with what the program decodes: one on a
fixed grid, whose values are predicted in time, one on a grid that moves, and one whose second scalar has values at other samples.
Exit status 77 (skipped) without the packages that read_cache.py needs.
"""
import io
import pathlib
import subprocess
import sys
import tempfile

sys.path.insert(0, sys.argv[3])
try:
    import numpy as np
    import read_cache
    import read_cache_test
except ModuleNotFoundError as error:
    print(f"skipped: {error}")
    sys.exit(77)


def run(*words):
    return subprocess.run([str(word) for word in words], check=True, stdout=subprocess.PIPE).stdout


def main(program, dump_cache):
    back = set()
    with tempfile.TemporaryDirectory() as name:
        folder = pathlib.Path(name)
        for moving in (False, True):
            cache = folder / f"moving{moving}.splats"
            run(program, "generate", "wake", "--size", "24x20x12", "--steps", 5, *(["--moving"] if moving else []),
                "-o", folder / "w")
            grid = folder / ("w_%04d.xyz" if moving else "w.xyz")
            run(program, "convert", grid, folder / "w_%04d.fun", "-o", cache)
            for step in range(5):
                ours = read_cache.Cache(cache, step)
                if ours.steps[step]["time"] != step or ours.steps[step]["geometry"] != (step if moving else 0):
                    sys.exit(f"{cache}: step {step} has another time or geometry")
                dump = run(dump_cache, cache, step)
                read_cache_test.compare(ours, io.BytesIO(dump), set())
                for number, table in ours.tables.items():
                    for brick in table:
                        header = ours.stream(ours.values_name(number, step), brick)[:40]
                        back.add(tuple(header[38:40]))
        for path in folder.glob("w_*.fun"):
            data = path.read_bytes()
            values = np.frombuffer(data[16:], "<f4")
            path.write_bytes(data[:12] + b"\2\0\0\0" + data[16:] + np.where(np.arange(len(values)) < 100, np.nan, values).astype("<f4").tobytes())
        run(program, "convert", folder / "w.xyz", folder / "w_%04d.fun", "-o", folder / "sets.splats")
        read_cache.Cache(folder / "sets.splats", 4)  # and the checksum of the set
        for step in range(5):
            ours = read_cache.Cache(folder / "sets.splats/blanks.1", step)
            read_cache_test.compare(ours, io.BytesIO(run(dump_cache, ours.folder, step)), set())
    if back != {(0, 0), (1, 0), (1, 2)}:
        sys.exit(f"streams have references {sorted(back)}; expected none, one and two")


if __name__ == "__main__":
    main(*sys.argv[1:3])
