#!/usr/bin/python3
"""read_cache_test.py DUMP_CACHE CACHE...

Decodes caches with read_cache.py and compares every number with what the program decodes, to float rounding:
the caches named, and those that `DUMP_CACHE --make` makes. These must use every predictor and every flag of the format.
Exit status 77 (skipped) without the packages that read_cache.py needs.
"""
import io
import pathlib
import subprocess
import sys
import tempfile

try:
    import numpy as np

    import read_cache
except ModuleNotFoundError as error:
    print(f"skipped: {error}; install python3-numpy, python3-zstandard and python3-xxhash")
    sys.exit(77)

FLOAT = np.finfo(np.float32)


def rounded(name, numbers, size):
    """As "Meaning of a splat" says that the program limits and rounds numbers. `size`: of the brick's cell."""
    numbers = np.clip(numbers, -FLOAT.max, FLOAT.max).astype(np.float32)
    if name in ("a0", "a1", "a2"):
        return np.maximum(numbers, FLOAT.tiny)
    if name in ("x", "y", "z"):
        inside = np.float32(size)
        return np.minimum(numbers, inside if inside < size else np.nextafter(inside, np.float32(0)))
    return numbers


def compare(cache, dump, seen):
    """Compares `cache` with the program's `dump`, and adds the features that its streams use to `seen`."""
    numbers = 0

    def same(brick, name, ours, theirs, what):
        nonlocal numbers
        numbers += len(theirs)
        wrong = np.flatnonzero(~(np.abs(ours - theirs) <= np.spacing(np.abs(theirs))))
        if len(wrong) > 0:
            s = wrong[0]
            sys.exit(f"{cache.folder}: brick {brick}, {what}{name} of splat {s}: decoded {ours[s]!r}, the program {theirs[s]!r} "
                     f"({len(wrong)} of {len(theirs)} differ)")

    for n, brick in enumerate(cache.bricks):
        size = cache.manifest["root"]["size"] / 2 ** brick["level"]
        splats, runs = np.frombuffer(dump.read(16), "<u8")
        if splats != brick["splats"]:
            sys.exit(f"{cache.folder}: brick {n} has {brick['splats']} splats, the program decodes {splats}")
        geometry = cache.geometry(n)
        run_numbers = np.frombuffer(dump.read(40 * int(runs)), "<u8").reshape(-1, 5)
        if run_numbers.tolist() != [list(run) for run in geometry["runs"]]:
            sys.exit(f"{cache.folder}: brick {n} has other node runs than the program decodes")
        for name in (*"xyz", *read_cache.SHAPE, "weight"):
            same(n, name, rounded(name, geometry[name], size), np.frombuffer(dump.read(4 * int(splats)), "<f4"), "")
        for name in ("border", "growth"):
            code = np.frombuffer(dump.read(4 * int(splats)), "<u4")
            same(n, f"{name} code", geometry[name].astype(np.float64), code.astype(np.float64), "")
        for number in cache.tables:
            values = cache.values(number, n)
            for name in read_cache.VALUES:
                theirs = np.frombuffer(dump.read(4 * int(splats)), "<f4")
                same(n, name, rounded(name, values[name], size), theirs, f"variable {number}, ")

        header = cache.stream(cache.geometry_name, brick["extent"])[:80]
        seen |= {f"geometry predictor {predictor}" for predictor in header[32:74:2]}
        seen |= {f"flag {flag}" for flag in (1, 2, 4) if header[1] & flag}
        for number, table in cache.tables.items():
            header = cache.stream(cache.values_name(number, cache.step), table[n]["extent"])[:40]
            seen |= {f"values predictor {predictor}" for predictor in header[28:38:2]}
            seen |= {"values with rows" if any(header[24:28]) else "values without rows"}
    if dump.read(1):
        sys.exit(f"{cache.folder}: the program decodes more bricks")
    print(f"{cache.folder}: {len(cache.bricks)} bricks, {numbers} numbers agree")


def main(program, *caches):
    seen = set()
    with tempfile.TemporaryDirectory() as folder:
        subprocess.run([program, "--make", folder], check=True)
        made = sorted(pathlib.Path(folder).glob("*.splats"))
        for path in [*caches, *made]:
            dump = subprocess.run([program, path], check=True, stdout=subprocess.PIPE).stdout
            compare(read_cache.Cache(path), io.BytesIO(dump), seen)
    wanted = {f"{kind} predictor {n}" for kind in ("geometry", "values") for n in range(5)}
    wanted |= {"flag 1", "flag 2", "flag 4", "values with rows", "values without rows"}
    if not made or wanted - seen:
        sys.exit(f"no cache uses: {', '.join(sorted(wanted - seen))}")


if __name__ == "__main__":
    main(*sys.argv[1:])
