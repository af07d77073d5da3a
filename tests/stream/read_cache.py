#!/usr/bin/python3
"""read_cache.py CACHE [STEP]: prints a splat cache's octree and the first splats of every brick.

Written from stream/FORMAT.md alone, which shows that the page is complete. It shares no code with the program;
read_cache_test.py compares the two. Needs Debian's python3-numpy, python3-zstandard and python3-xxhash.
"""
import json
import pathlib
import re
import struct
import sys

import numpy as np
import xxhash
import zstandard

checksum = xxhash.xxh3_64_intdigest
RAW_SHAPES, RAW_WEIGHTS, BORDERS, GROWTH = 1, 2, 4, 8
SHAPE = ["a0", "a1", "a2", "l10", "l20", "l21"]
VALUES = ["mean", "slope0", "slope1", "slope2", "variance"]


def need(condition, what):
    if not condition:
        raise ValueError(f"invalid {what}")


def unzigzag(code):
    return (code >> 1) ^ -(code & 1)


def exponentials(base, step, n):
    return np.exp(base + (n >> 6) * (64 * step)) * np.exp((n & 63) * step)


def varints(data):
    value = shift = 0
    for byte in data:
        value |= (byte & 0x7F) << shift
        shift += 7
        if byte < 0x80:
            need(value < 1 << 64, "varint")
            yield value
            value = shift = 0
    need(shift == 0, "end of a varint")


def expected(array, header, references):
    """The codes q that the references of a values stream have, in its own steps."""
    lower, upper, slope_step, deviation_step = header
    b, values = references
    if array == 4:
        values = [np.sqrt(value) for value in values]
    e = values[0] if len(values) == 1 else values[0] + (values[0] - values[1]) * (b[0] / (b[1] - b[0]))
    origin, step = (lower, (upper - lower) / 65535) if array == 0 else (0.0, deviation_step if array == 4 else slope_step)
    if not step > 0:
        return np.zeros(len(e), np.uint64)
    low, high = 0 if array in (0, 4) else -2.0**30, 65535 if array == 0 else 2.0**30
    return np.rint(np.clip((e - origin) / step, low, high)).astype(np.int64).astype(np.uint64)


def predicted(predictor, rows, residuals):
    """The values v of an array. Rows are (first splat, splats, first splat of the row above or None)."""
    v = []
    for first, count, above in rows:
        for m in range(count):
            n, p = first + m, 0
            if predictor > 0 and m == 0:
                p = v[above] if above is not None else v[n - 1] if n > 0 else 0
            elif predictor == 1:
                p = v[n - 1]
            elif predictor == 2 or (predictor > 2 and above is None):
                p = v[n - 1] + (v[n - 1] - v[n - 2] if m > 1 else 0)
            elif predictor > 2:
                d = v[n - 1] - v[above + m - 1]
                p = v[above + m] + d
                if predictor == 4 and m > 1:
                    p += d - (v[n - 2] - v[above + m - 2])
            v.append((residuals[n] + p) & 0xFFFFFFFF)
    return np.array(v, np.uint64)


class Contents:
    """The unpacked frame of a stream: its varints, and its arrays one after another."""
    def __init__(self, frame, varint_bytes, codes, count, timed=False, before=0):  # `before`: bytes of another kind
        self.codes, self.at, self.count, self.rows = list(codes), varint_bytes + before, count, None
        need(all((predictor & ~8 if timed else predictor) <= 4 and planes <= 4 for predictor, planes in self.codes), "array code")
        size = varint_bytes + before + sum(planes for _, planes in self.codes) * count
        need(zstandard.frame_content_size(frame) == size, "size of a frame")
        self.data = zstandard.ZstdDecompressor().decompress(frame)
        self.varints = list(varints(self.data[:varint_bytes]))

    def elements(self):
        predictor, planes = self.codes.pop(0)
        u, data = np.zeros((self.count, 4), np.uint8), np.frombuffer(self.data, np.uint8)
        u[:, :planes] = data[self.at:self.at + planes * self.count].reshape(planes, self.count).T
        self.at += planes * self.count
        return predictor, u.view("<u4")[:, 0].astype(np.uint64)

    def values(self, in_time=None):
        predictor, u = self.elements()
        values = predicted(predictor & 7, self.rows, [unzigzag(code) for code in u.tolist()])
        return (values + in_time()) & np.uint64(0xFFFFFFFF) if predictor & 8 else values

    def signed(self, in_time=None):
        return self.values(in_time).astype(np.uint32).view(np.int32).astype(np.float64)

    def raw(self):
        return (self.values() | self.values() << np.uint64(32)).view(np.float64)


def rows_of(runs, count):  # runs: (block, k, j, i, count)
    if not runs:
        return [(0, count, None)]
    starts = [0, *np.cumsum([run[4] for run in runs]).tolist()]
    if not all(a[:3] < b[:3] or (a[:3] == b[:3] and b[3] >= a[3] + a[4]) for a, b in zip(runs, runs[1:])):
        return [(start, run[4], None) for start, run in zip(starts, runs)]
    lines, rows = {}, []
    for start, (*line, i, c) in zip(starts, runs):
        lines.setdefault(tuple(line), []).append((i, i + c, start))
    for start, (block, k, j, i, c) in zip(starts, runs):
        near = [[run for run in lines.get(line, []) if run[0] < i + c and run[1] > i]
                for line in ((block, k, j - 1), (block, k - 1, j))]
        above = near[0] or near[1]
        cuts = sorted({i, i + c, *(cut for run in above for cut in run[:2] if i < cut < i + c)})
        for low, high in zip(cuts, cuts[1:]):
            run = next((run for run in above if run[0] <= low < run[1]), None)
            rows.append((start + low - i, high - low, run and run[2] + low - run[0]))
    return rows


def decode_geometry(data, brick, root):
    bits, flags, _, varint_bytes, log0, log1, log_volume = struct.unpack_from("<BBHIddd", data)
    count, level = brick["splats"], brick["level"]
    need(flags <= 15 and 5 <= bits <= min(32, 48 - level) and varint_bytes <= 50 * count, "geometry header")
    arrays = 3 + (12 if flags & RAW_SHAPES else 6) + (2 if flags & RAW_WEIGHTS else 1) + (4 if flags & BORDERS else 0)
    arrays += 2 if flags & GROWTH else 0
    contents = Contents(data[80:], varint_bytes, list(zip(data[32:78:2], data[33:78:2]))[:arrays], count)

    runs, run = [], [0] * 5
    need(len(contents.varints) % 5 == 0, "node runs")
    for at in range(0, len(contents.varints), 5):
        run = [(a + unzigzag(b)) % (1 << 64) for a, b in zip(run, contents.varints[at:at + 5])]
        need(run[0] < 1 << 32 and run[4] > 0 and run[3] + run[4] < 1 << 64, "node run")
        runs.append(tuple(run))
    need(sum(run[4] for run in runs) == (count if runs else 0), "number of nodes")
    contents.rows = rows_of(runs, count)

    out = {"runs": runs, "flags": flags}
    for axis in "xyz":
        c = contents.values()
        need(c.max() < 1 << bits, "position")
        out[axis] = (c + 0.5) * (root["size"] / 2**level) / 2**bits
    if flags & RAW_SHAPES:
        out.update((name, contents.raw()) for name in SHAPE)
    else:
        n0, n1, nv = (contents.values() for _ in range(3))
        need(max(n0.max(), n1.max(), nv.max()) <= 65535, "axis or volume")
        a0, a1 = exponentials(log0, 0.014, n0), exponentials(log1, 0.014, n1)
        a2 = exponentials(log_volume, 0.0016, nv) / (a0 * a1)
        s21, s10, s20 = (contents.signed() for _ in range(3))
        def floor2(x):
            return np.exp2(np.frexp(x)[1] - 1.0)
        l21 = s21 * floor2(0.027 * a2 / a1)
        l10 = s10 * floor2(0.027 * a1 / (a0 * np.maximum(1, np.abs(l21) * a1 / a2)))
        out.update(zip(SHAPE, (a0, a1, a2, l10, s20 * floor2(0.027 * a2 / a0), l21)))
    if flags & RAW_WEIGHTS:
        out["weight"] = contents.raw()
    else:
        predictor, u = contents.elements()
        need(predictor == 0, "predictor of the weights")
        q = np.array([unzigzag(code - 1) if code > 1 else 0 for code in u.tolist()])
        need(np.abs(q).max() <= 100000, "weight")
        volume = out["a0"] * out["a1"] * out["a2"]
        out["weight"] = volume * np.where(u < 2, 1.0 - u, exponentials(-190.0, 0.0019, q + 100000))
    out["border"] = np.zeros(count, np.uint64)
    for byte in range(4 if flags & BORDERS else 0):
        value = contents.values()
        need(value.max() <= 255, "border code")
        out["border"] |= value << np.uint64(8 * byte)
    out["growth"] = np.zeros(count, np.uint64)
    if flags & GROWTH:
        growth, rotation = contents.values(), contents.values()
        need(growth.max() < 1 << 18 and rotation.max() < 1 << 12, "growth code")
        out["growth"] = growth | rotation << np.uint64(18)
    return out


def decode_values(data, count, reference):
    """`reference(steps back)`: the values of the brick there."""
    lower, upper, slope_step, deviation_step, varint_bytes = struct.unpack_from("<ffddI", data)
    need(varint_bytes <= 10 * count, "values header")
    back = [b for b in data[38:40] if b]
    need(back == sorted(set(back)) and (data[38] or not data[39]), "reference")
    contents = Contents(data[40:], varint_bytes, zip(data[28:38:2], data[29:38:2]), count, bool(back))
    earlier = [reference(b) for b in back]
    header = lower, upper, slope_step, deviation_step
    rows, first = [], 0
    for length, distance in zip(contents.varints[::2], contents.varints[1::2]):
        need(length > 0 and distance <= first, "row")
        rows.append((first, length, first - distance if distance else None))
        first += length
    need(first == (count if varint_bytes else 0), "number of values")
    contents.rows = rows or [(0, count, None)]
    m, s0, s1, s2, d = (contents.signed(lambda a=a: expected(a, header, (back, [e[VALUES[a]].astype(np.float32).astype(np.float64)
                                                                                for e in earlier])))
                        for a in range(5))
    steps = lower + m * ((upper - lower) / 65535), s0 * slope_step, s1 * slope_step, s2 * slope_step
    return dict(zip(VALUES, (*steps, (d * deviation_step) ** 2)))


class Cache:
    """Opens a cache and verifies all of it but the streams, which are verified when they are read."""
    def __init__(self, folder, step=0):
        self.folder, self.data, self.tables = pathlib.Path(folder), {}, {}
        self.step, self.steps = step, None
        text = (self.folder / "manifest.json").read_text(encoding="utf-8")
        self.manifest = json.loads(text)
        version, requires = self.manifest["version"], self.manifest.get("requires", [])
        need(self.manifest["format"] == "curvisplat splat cache" and version == (2 if requires else 1), "format version")
        need(set(requires) <= {"border-faces", "cell-growth", "merged-borders", "steps"}, "required feature")
        self.files = {file["name"]: file for file in self.manifest["files"]}
        if "steps" in requires:
            self.open_step(text)
            return
        self.open(text)

    def open_step(self, text):
        """The geometry of the step, and its values instead of those of the geometry's first step."""
        size, v = self.files["steps.bin"]["size"], len(self.manifest["variables"])
        data = (self.folder / "steps.bin").read_bytes()[:size]
        self.verify("steps.bin", data)
        need(struct.unpack_from("<8sII", data) == (b"CVSsteps", 1, v), "header of steps.bin")
        need(len(data) > 16 and (len(data) - 16) % (32 + 32 * v) == 0, "size of steps.bin")
        self.steps = [struct.unpack_from("<dIIQQ" + "ddQQ" * v, data, at) for at in range(16, len(data), 32 + 32 * v)]
        geometry = self.steps[self.step][1]
        self.first = next(s for s, record in enumerate(self.steps) if record[1] == geometry)
        if geometry:
            self.folder /= f"geometry.{geometry}"
            raw = (self.folder / "manifest.json").read_bytes()
            need(checksum(raw) == self.steps[self.step][3], "checksum of a geometry")
            text = raw.decode()
            self.manifest = json.loads(text)
            self.files = {file["name"]: file for file in self.manifest["files"]}
        self.open(text)
        for v, variable in enumerate(self.manifest["variables"]):
            variable["min"], variable["max"] = self.steps[self.step][5 + 4 * v:7 + 4 * v]

    def values_name(self, number, step):
        return f"var.{number}.bin" if self.steps is None or step == self.first else f"var.{number}.{step}.bin"

    def table(self, number, step):
        """The table of a variable at a step, which is loaded."""
        name, count = self.values_name(number, step), self.manifest["bricks"]
        if self.steps is not None:
            v = [variable["number"] for variable in self.manifest["variables"]].index(number)
            size, digest = self.steps[step][7 + 4 * v:9 + 4 * v]
            self.files[name] = {"name": name, "size": size, "checksum": f"{digest:016x}"}
        data = self.load(name)
        *header, table = struct.unpack_from("<8sIIQQ", data)
        need(header == [b"CVSvalue", 1, 40, count] and len(data) == table + 40 * count, f"header of {name}")
        self.verify(name, data[:32] + data[table:])
        return [dict(extent=(f[0], f[2], f[1]), min=f[3], max=f[4], slope=f[5], deviation=f[6])
                for f in struct.iter_unpack("<QQIffffI", data[table:])]

    def open(self, text):
        if "checksum" in self.manifest:
            packed = re.sub(r'("(?:\\.|[^"\\])*")|\s+', lambda match: match[1] or "", text)
            packed = re.sub(r',"checksum":"[0-9a-f]{16}"}$', "}", packed)
            need(f"{checksum(packed.encode()):016x}" == self.manifest["checksum"], "checksum of the manifest")

        data, count = self.load("bricks.bin"), self.manifest["bricks"]
        need(struct.unpack_from("<8sIIQ", data) == (b"CVSbrick", 1, 144, count), "header of bricks.bin")
        self.verify("bricks.bin", data)
        self.bricks = [dict(level=f[0], at=f[1:4], splats=f[4], octants=f[5:13], radius=f[13], error=f[14],
                            parent=f[15], box=f[16:22], children=f[22:24], extent=(f[24], f[26], f[25]))
                       for f in struct.iter_unpack("<I3II8IffI3d3dIIQQII", data[24:])]
        self.geometry_name = self.manifest["steps"][0]["geometry"]
        self.load(self.geometry_name)
        self.verify(self.geometry_name, b"".join(struct.pack("<Q", brick["extent"][2]) for brick in self.bricks))
        for number in self.manifest["steps"][0]["variables"]:
            self.tables[number] = self.table(number, self.step)

    def load(self, name):
        self.data[name] = (self.folder / name).read_bytes()
        need(len(self.data[name]) == self.files[name]["size"], f"size of {name}")
        return self.data[name]

    def verify(self, name, data):
        need(f"{checksum(data):016x}" == self.files[name]["checksum"], f"checksum of {name}")

    def stream(self, name, extent):
        data = self.data[name][extent[0]:extent[0] + extent[1]]
        need(len(data) == extent[1] and checksum(data) == extent[2], f"checksum of a stream of {name}")
        return data

    def geometry(self, n):
        data = self.stream(self.geometry_name, self.bricks[n]["extent"])
        return decode_geometry(data, self.bricks[n], self.manifest["root"])

    def values(self, number, n, step=None):
        step = self.step if step is None else step
        table = self.tables[number] if step == self.step else self.table(number, step)
        data = self.stream(self.values_name(number, step), table[n]["extent"])

        def reference(back):
            need(back <= step and self.steps[step - back][1] == self.steps[step][1], "reference")
            return self.values(number, n, step - back)
        return decode_values(data, self.bricks[n]["splats"], reference)


class Faces:
    """faces.bin of an open cache: faces, patches, regions, and the nodes of a patch."""
    def __init__(self, cache):
        self.cache, self.file = cache, cache.load("faces.bin")
        magic, version, v, *counts, _, table = struct.unpack_from("<8s6IQ", self.file)
        need((magic, version) == (b"CVSfaces", 1), "header of faces.bin")
        cache.verify("faces.bin", self.file[:88] + self.file[table:])
        self.box = np.array(struct.unpack_from("<6d", self.file, 40)).reshape(2, 3)
        sizes = [4 * v, *(count * size for count, size in zip(counts, (40, 112, 136)))]
        need(table + sum(sizes) == len(self.file), "size of the table of faces.bin")
        ends = np.cumsum([table, *sizes]).tolist()
        parts = [self.file[begin:end] for begin, end in zip(ends, ends[1:])]
        self.variables = np.frombuffer(parts[0], "<u4").tolist()
        self.faces = [dict(block=f[0], axis=f[1], side=f[2], index=f[4], nodes=f[5:7], root=f[7])
                      for f in struct.iter_unpack("<IBBHQQQII", parts[1])]
        self.patches = [dict(face=f[0], stride=f[1:3], nodes=f[3:5], first=f[5:7], children=f[7:9], error=f[9],
                             extent=(f[11], f[10], f[12]), box=f[13:19])
                        for f in struct.iter_unpack("<III2H2QIIfIQQ6d", parts[2])]
        self.regions = [dict(face=f[0], first=f[2:4], last=f[4:6], name=f[6].rstrip(b"\0").decode(),
                             type=f[7].rstrip(b"\0").decode()) for f in struct.iter_unpack("<II4Q64s32s", parts[3])]

    def lattice(self, n):
        """The nodes of the face that a patch has, along u and v."""
        patch = self.patches[n]
        return [np.minimum(f + s * np.arange(count), last - 1) for f, s, count, last in
                zip(patch["first"], patch["stride"], patch["nodes"], self.faces[patch["face"]]["nodes"])]

    def patch(self, n):
        """Positions, which quads are drawn, and scalars."""
        data, (columns, rows) = self.cache.stream("faces.bin", self.patches[n]["extent"]), self.patches[n]["nodes"]
        u, v, scalars, *codes = struct.unpack_from("<HHI6B", data)
        need((u, v, scalars) == (columns, rows, len(self.variables)), "header of a patch")
        heads = [struct.unpack_from("<ffBB", data, 16 + 12 * s) for s in range(scalars)]
        quads = (columns - 1) * (rows - 1)
        frame, codes = data[16 + 12 * scalars:], [*zip(codes[::2], codes[1::2]), *(head[2:] for head in heads)]
        contents = Contents(frame, 0, codes, columns * rows, before=(quads + 7) // 8)
        drawn = np.unpackbits(np.frombuffer(contents.data, np.uint8, (quads + 7) // 8), bitorder="little")[:quads]
        contents.rows = [(row * columns, columns, (row - 1) * columns if row else None) for row in range(rows)]
        code = np.stack([contents.values() for _ in range(3)], axis=1).astype(np.float64)
        need(code.max() < 2 ** 26, "coordinate of a patch")
        values = [lower + (upper - lower) * contents.values().astype(np.float64) / 65535 for lower, upper, *_ in heads]
        return self.box[0] + self.box[1] * code, drawn, values


def main(folder, step=0):
    cache = Cache(folder, int(step))
    for n, brick in enumerate(cache.bricks):
        print(f"brick {n}: level {brick['level']}, cell {brick['at']}, {brick['splats']} splats")
        geometry, values = cache.geometry(n), [cache.values(number, n) for number in cache.tables]
        columns = [geometry[name] for name in (*"xyz", *SHAPE, "weight")]
        columns += [value[name] for value in values for name in VALUES]
        for splat in list(zip(*columns))[:3]:
            print("  " + " ".join(f"{number:.7g}" for number in splat))


if __name__ == "__main__":
    main(*sys.argv[1:])
