#!/usr/bin/python3
"""read_cache_test.py DUMP_CACHE CACHE...

Decodes caches with read_cache.py and compares every number with what the program decodes, to float rounding:
the caches named, and those that `DUMP_CACHE --make` makes. These must use every predictor and every flag of the format.
The reader stays small: at most 290 lines, and no code but Python's own and the three packages.
Exit status 77 (skipped) without the packages that read_cache.py needs.
"""
import ast
import io
import pathlib
import struct
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

        header = cache.stream(cache.geometry_name, brick)[:80]
        seen |= {f"geometry predictor {predictor}" for predictor in header[32:74:2]}
        seen |= {f"flag {flag}" for flag in (1, 2, 4) if header[1] & flag}
        for number, table in cache.tables.items():
            header = cache.stream(cache.values_name(number, cache.step), table[n])[:40]
            seen |= {f"values predictor {predictor & 7}" for predictor in header[28:38:2]}
            seen |= {f"scaled {what}" for what, code in (("means", header[28]), ("slopes", header[30])) if code & 32}
            seen |= {"values with rows" if any(header[24:28]) else "values without rows"}
    if dump.read(1):
        sys.exit(f"{cache.folder}: the program decodes more bricks")
    for number in cache.tables:
        if has_histogram(cache, number):
            compare_histogram(cache, number)
            seen.add("histogram")
            seen |= compare_percentiles(cache, number)
    print(f"{cache.folder}: {len(cache.bricks)} bricks, {numbers} numbers agree")


def histogram(cache, number):
    """The last 2096 bytes before the table of a variable, which may be a histogram."""
    data = cache.data[cache.values_name(number, cache.step)]
    end = struct.unpack_from("<Q", data, 24)[0]
    return data[max(0, end - 2096):end]


def has_histogram(cache, number):
    return histogram(cache, number).startswith(b"CVShisto")


def compare_histogram(cache, number):
    """The shares that the program has written, with those of the leaves that were decoded here."""
    record = histogram(cache, number)
    _, version, bins, lower, upper, volume, checksum = struct.unpack_from("<8sIIdddQ", record)
    if (version, bins) != (1, 512) or read_cache.checksum(record[:40] + record[48:]) != checksum:
        sys.exit(f"{cache.folder}: the histogram of variable {number} has another header or checksum")
    shares = np.frombuffer(record, "<f4", bins, 48)
    volumes = np.zeros(len(shares))
    for n, brick in enumerate(cache.bricks):
        if brick["children"][1] == 0:
            means = cache.values(number, n)["mean"].astype(np.float32).astype(np.float64)
            bins = np.clip((means - lower) * (len(shares) / (upper - lower)) if upper > lower else 0 * means, 0, len(shares) - 1)
            np.add.at(volumes, bins.astype(int), cache.geometry(n)["weight"])
    variable = next(v for v in cache.manifest["variables"] if v["number"] == number)
    if (lower, upper) != (variable["min"], variable["max"]) or abs(volume - volumes.sum()) > 1e-9 * volume \
            or np.abs(volumes / volumes.sum() - shares).max() > 1e-6:
        sys.exit(f"{cache.folder}: the histogram of variable {number} is not that of its leaves")


def compare_percentiles(cache, number):
    """The 4032 bytes before the histogram, if they are percentiles: in order, from the least to the largest value."""
    data = cache.data[cache.values_name(number, cache.step)]
    record = data[(end := struct.unpack_from("<Q", data, 24)[0] - 2096) - 4032:end]
    if not record.startswith(b"CVSperct"):
        return set()
    values = np.frombuffer(record, "<f4", 1001, 24)
    variable = next(v for v in cache.manifest["variables"] if v["number"] == number)
    if struct.unpack_from("<IIQ", record, 8) != (1, 1000, read_cache.checksum(record[24:4028])) or (np.diff(values) < 0).any() \
            or (values[0], values[-1]) != (np.float32(variable["min"]), np.float32(variable["max"])):
        sys.exit(f"{cache.folder}: the percentiles of variable {number} are none")
    return {"percentiles"}


def lattice(cache, n):
    """The nodes of the face that a patch has, along u and v."""
    patch = cache.patches[n]
    return [np.minimum(f + s * np.arange(count), last - 1) for f, s, count, last in
            zip(patch["first"], patch["stride"], patch["nodes"], cache.faces[patch["face"]]["nodes"])]


def compare_faces(cache, dump):
    cache.open_faces()
    numbers = 0
    for n, patch in enumerate(cache.patches):
        nodes, quads, scalars = (int(count) for count in np.frombuffer(dump.read(24), "<u8"))
        positions, drawn, values = cache.patch(n)
        theirs = [np.frombuffer(dump.read(24 * nodes), "<f8").reshape(-1, 3), np.frombuffer(dump.read(quads), "u1")]
        theirs += [np.frombuffer(dump.read(4 * nodes), "<f4") for _ in range(scalars)]
        if not np.allclose(positions, theirs[0], rtol=1e-15, atol=1e-14) or (drawn != theirs[1]).any():
            sys.exit(f"{cache.folder}: patch {n} of the faces: other nodes or quads than the program decodes")
        for ours, value in zip(values, theirs[2:], strict=True):
            if not (np.abs(ours.astype(np.float32) - value) <= np.spacing(np.abs(value))).all():
                sys.exit(f"{cache.folder}: patch {n} of the faces: other values than the program decodes")
        numbers += positions.size + drawn.size + scalars * nodes
        # Nodes lie where the lattice says: a parent's are among its children's.
        for c in range(patch["children"][0], patch["children"][0] + patch["children"][1]):
            u, v = np.intersect1d(lattice(cache, n)[0], lattice(cache, c)[0]), np.intersect1d(lattice(cache, n)[1], lattice(cache, c)[1])
            place = [[np.searchsorted(lattice, along) for lattice, along in zip(lattice(cache, p), (u, v))] for p in (n, c)]
            ours, of_child = (nodes_at(cache, p, *at) for p, at in zip((n, c), place))
            if not len(u) or not len(v) or not np.array_equal(ours, of_child):
                sys.exit(f"{cache.folder}: patch {n} of the faces: a node is elsewhere in its child {c}")
    if dump.read(1) or not cache.patches:
        sys.exit(f"{cache.folder}: the program decodes other patches")
    print(f"{cache.folder}: {len(cache.faces)} faces, {len(cache.patches)} patches, {numbers} numbers agree")


def nodes_at(cache, patch, u, v):
    columns, rows = cache.patches[patch]["nodes"]
    return cache.patch(patch)[0].reshape(rows, columns, 3)[np.ix_(v, u)]


def check_reader():
    text = pathlib.Path(read_cache.__file__).read_text()
    if len(text.splitlines()) > 290:
        sys.exit(f"{read_cache.__file__}: {len(text.splitlines())} lines; a reader of the format has at most 290")
    nodes = list(ast.walk(ast.parse(text)))
    names = {alias.name for node in nodes if isinstance(node, ast.Import) for alias in node.names}
    names |= {node.module for node in nodes if isinstance(node, ast.ImportFrom)}
    if names - sys.stdlib_module_names - {"numpy", "xxhash", "zstandard"}:
        sys.exit(f"{read_cache.__file__}: imports {sorted(names)}; it is to be a single file")


def main(program, *caches):
    check_reader()
    seen = set()
    with tempfile.TemporaryDirectory() as folder:
        subprocess.run([program, "--make", folder], check=True)
        made = sorted(pathlib.Path(folder).glob("*.splats"))
        of_sets = [path for cache in caches for path in sorted(pathlib.Path(cache).glob("blanks.*"))]
        for path in [*caches, *of_sets, *made]:
            cache = read_cache.Cache(path)
            for step in range(len(cache.steps) or 1):
                dump = subprocess.run([program, path, str(step)], check=True, stdout=subprocess.PIPE).stdout
                compare(read_cache.Cache(path, step), io.BytesIO(dump), seen)
            if "faces.bin" in cache.files:
                dump = subprocess.run([program, "--faces", path], check=True, stdout=subprocess.PIPE).stdout
                compare_faces(cache, io.BytesIO(dump))
                seen.add("faces")
    wanted = {f"{kind} predictor {n}" for kind in ("geometry", "values") for n in range(5)}
    wanted |= {"flag 1", "flag 2", "flag 4", "values with rows", "values without rows", "faces", "histogram", "percentiles",
               "scaled means", "scaled slopes"}
    if not made or wanted - seen:
        sys.exit(f"no cache uses: {', '.join(sorted(wanted - seen))}")


if __name__ == "__main__":
    main(*sys.argv[1:])
