#!/usr/bin/python3
"""read_series_test.py PROGRAM DUMP_CACHE FOLDER_OF_READ_CACHE

Decodes series of time steps with read_cache.py and compares every number with what the program decodes: one on a
fixed grid, whose values are predicted in time, and one on a grid that moves.
Exit status 77 (skipped) without the packages that read_cache.py needs.
"""
import io
import pathlib
import subprocess
import sys
import tempfile

sys.path.insert(0, sys.argv[3])
try:
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
    if back != {(0, 0), (1, 0), (1, 2)}:
        sys.exit(f"streams have references {sorted(back)}; expected none, one and two")


if __name__ == "__main__":
    main(*sys.argv[1:3])
