"""Reads splat caches; written from stream/FORMAT.md alone, without code of the program, which shows that the page is complete.
read_cache_test.py compares the two. Needs Debian's python3-numpy, python3-zstandard and python3-xxhash."""
import json
import pathlib
import re
import struct

import numpy as np
import zstandard
from xxhash import xxh3_64_intdigest as checksum

FEATURES = set("steps fine-values cell-growth merged-borders face-layers plates border-pairs border-faces cell-octants scaled-values own-blanks own-blanks-steps thin-walls".split())
SHAPE, VALUES = ["a0", "a1", "a2", "l10", "l20", "l21"], ["mean", "slope0", "slope1", "slope2", "variance"]


def need(condition, what):
    if not condition:
        raise ValueError(f"invalid {what}")


def records(data, fields):
    """Packed records as dictionaries. Fields are NAME:TYPE, with numpy's names of types."""
    table = np.frombuffer(data, np.dtype([tuple(field.split(":")) for field in fields.split()]).newbyteorder("<"))
    return [{name: record[name].tolist() for name in table.dtype.names} for record in table]


def unzigzag(code):
    return (code >> 1) ^ -(code & 1)


def predicted(predictor, rows, residuals):
    """The values v of an array. Rows are (first splat, splats, first splat of the row above or None)."""
    v = []
    for first, count, above in rows:
        from_above, linear = predictor > 2 and above is not None, predictor in (2, 4) or (predictor == 3 and above is None)
        last, change = 0 if from_above else v[above] if above is not None else v[-1] if v else 0, 0
        for m in range(count):
            w = v[above + m] if from_above else 0  # predicted are differences to it: the last one, and how that changed
            v.append((residuals[first + m] + (w + last + change if predictor > 0 else 0)) & 0xFFFFFFFF)
            change = v[-1] - w - last if linear and m > 0 else 0
            last = v[-1] - w
    return np.array(v, np.uint32)


class Contents:
    """The unpacked frame of a stream: varints, `skipped` bytes of another kind, and arrays of `count` elements."""
    def __init__(self, frame, codes, count, varint_bytes=0, skipped=0, in_time=False):
        self.codes, self.count, self.at = list(zip(codes[::2], codes[1::2])), count, varint_bytes + skipped
        need(all(P & (~8 if in_time else ~0) <= 4 and B <= 4 for P, B in self.codes), "array code")
        need(zstandard.frame_content_size(frame) == self.at + sum(B for _, B in self.codes) * count, "size of a frame")
        self.data = zstandard.ZstdDecompressor().decompress(frame)
        found = re.findall(rb"[\x80-\xff]*[\0-\x7f]", self.data[:varint_bytes])
        self.varints = [sum((byte & 127) << 7 * n for n, byte in enumerate(varint)) for varint in found]
        need(sum(map(len, found)) == varint_bytes and max(self.varints, default=0) < 1 << 64, "varint")

    def elements(self):
        """The predictor of the next array, and its elements."""
        (predictor, planes), *self.codes = self.codes
        size, u = planes * self.count, np.zeros((self.count, 4), np.uint8)
        u[:, :planes] = np.frombuffer(self.data, np.uint8, size, self.at).reshape(planes, self.count).T
        self.at += size
        return predictor, u.view("<u4")[:, 0]

    def values(self, limit=1 << 32, expected=np.uint32(0)):
        predictor, u = self.elements()
        v = predicted(predictor & 7, self.rows, unzigzag(u).tolist()) + np.uint32(predictor >> 3) * expected
        need(v.max() < limit, "value of an array")
        return v

    def raw(self):
        return np.stack([self.values(), self.values()], axis=1).view("<f8")[:, 0]


def rows_of(runs):
    """The rows of node runs (block, k, j, i, count)."""
    starts, rows, none = np.cumsum([0, *(run[4] for run in runs)]).tolist(), [], (None, None)
    ordered = all(a[:3] < b[:3] or (a[:3] == b[:3] and b[3] >= a[3] + a[4]) for a, b in zip(runs, runs[1:]))
    found = {(block, k, j, i + m): (start, start + m)  # the first splat of each node's run, and the node's
             for start, (block, k, j, i, count) in zip(starts, runs) for m in range(count if ordered else 0)}
    for start, (block, k, j, i, count) in zip(starts, runs):
        lines = [[found.get((block, *line, i + m), none) for m in range(count)] for line in ((k, j - 1), (k - 1, j))]
        above = lines[0] if set(lines[0]) != {none} else lines[1]
        cuts = [m for m in range(count) if m == 0 or above[m][0] != above[m - 1][0]]
        rows += [(start + m, end - m, above[m][1]) for m, end in zip(cuts, [*cuts[1:], count])]
    return rows


def decode_geometry(data, brick, root):
    bits, flags, _, varint_bytes, log0, log1, log_volume, *codes = struct.unpack_from("<BBHIddd46B", data)
    count, level, (raw_shapes, raw_weights, borders, growth) = brick["splats"], brick["level"], (flags >> n & 1 for n in range(4))
    need(flags <= 15 and 5 <= bits <= min(32, 48 - level) and varint_bytes <= 50 * count, "geometry header")
    arrays = 3 + 6 * (1 + raw_shapes) + 1 + raw_weights + 4 * borders + 2 * growth
    contents = Contents(data[80:], codes[:2 * arrays], count, varint_bytes)
    runs = np.cumsum(unzigzag(np.array(contents.varints, np.uint64).reshape(-1, 5)), axis=0, dtype=np.uint64).tolist()
    need(all(block < 1 << 32 and c > 0 and i + c < 1 << 64 for block, _, _, i, c in runs), "node run")
    need(sum(run[4] for run in runs) == (count if runs else 0), "number of nodes")
    contents.rows = rows_of(runs) or [(0, count, None)]

    def exponentials(base, step, n):
        return np.exp(base + (n >> 6) * (64 * step)) * np.exp((n & 63) * step)

    def floor2(x):
        return np.exp2(np.frexp(x)[1] - 1.0)

    out = {axis: (contents.values(1 << bits) + 0.5) * (root["size"] / 2**level) / 2**bits for axis in "xyz"}
    if raw_shapes:
        out |= {name: contents.raw() for name in SHAPE}
    else:
        n0, n1, nv = (contents.values(65536).astype(np.int64) for _ in range(3))
        s21, s10, s20 = (contents.values().view(np.int32) for _ in range(3))
        a0, a1 = exponentials(log0, 0.014, n0), exponentials(log1, 0.014, n1)
        a2 = exponentials(log_volume, 0.0016, nv) / (a0 * a1)
        l21 = s21 * floor2(0.027 * a2 / a1)
        l10 = s10 * floor2(0.027 * a1 / (a0 * np.maximum(1, np.abs(l21) * a1 / a2)))
        out |= zip(SHAPE, (a0, a1, a2, l10, s20 * floor2(0.027 * a2 / a0), l21))
    if raw_weights:
        out["weight"] = contents.raw()
    else:
        predictor, u = contents.elements()
        q = np.where(u > 1, unzigzag(u.astype(np.int64) - 1), 0)
        need(predictor == 0 and np.abs(q).max() <= 100000, "weight")
        out["weight"] = out["a0"] * out["a1"] * out["a2"] * np.where(u < 2, 1.0 - u, exponentials(-190.0, 0.0019, q + 100000))
    for code, flag, bits in (("border", borders, (8, 8, 8, 8)), ("growth", growth, (18, 12))):
        parts = [contents.values(1 << b) << np.uint32(sum(bits[:n])) for n, b in enumerate(bits) if flag]
        out[code] = sum(parts, np.zeros(count, np.uint32))
    return out | {"runs": runs}


def scaled_code(x, bits):
    above = (1 + np.abs(x)).view(np.uint64) - np.float64(1).view(np.uint64)
    return np.where(x < 0, -1, 1).astype(np.int32).view(np.uint32) * ((above + np.uint64(1 << (51 - bits))) >> np.uint64(52 - bits)).astype(np.uint32)


def scaled_number(codes, bits):
    size = np.minimum(np.abs(codes.astype(np.int64)), 1000 << bits).astype(np.uint64)
    return np.where(codes < 0, -1.0, 1.0) * ((np.float64(1).view(np.uint64) + (size << np.uint64(52 - bits))).view(np.float64) - 1)


def decode_values(data, count, reference):
    """`reference(steps back)`: the values of the brick that many steps before."""
    lower, upper, slope_step, deviation_step, varint_bytes, *codes, b1, b2 = struct.unpack_from("<ffddI12B", data)
    need(varint_bytes <= 10 * count and (b2 == 0 or 0 < b1 < b2), "values header")
    most = 2**24 - 1 if codes[0] & 16 else 65535  # with `fine-values`
    scaled_means, scaled, scale, centre = bool(codes[0] & 32), bool(codes[2] & 32), slope_step, deviation_step
    need(scaled or not scaled_means, "values header")
    codes[0], codes[2] = codes[0] & ~48, codes[2] & ~32
    contents = Contents(data[40:], codes, count, varint_bytes, in_time=b1 > 0)
    lengths, distances = contents.varints[::2], contents.varints[1::2]
    firsts = np.cumsum([0, *lengths]).tolist()
    need(len(lengths) == len(distances) and firsts[-1] == (count if lengths else 0) and all(lengths), "number of values")
    need(all(distance <= first for first, distance in zip(firsts, distances)), "row above")
    contents.rows = [(f, c, f - d if d else None) for f, c, d in zip(firsts, lengths, distances)] or [(0, count, None)]

    scales = (lower, (upper - lower) / most, 0, most), *[(0, slope_step, -2.0**30, 2.0**30)] * 3, (0, deviation_step, 0, 2.0**30)
    numbers, earlier = [], [reference(b) for b in (b1, b2) if b]
    for name, (origin, step, lowest, highest) in zip(VALUES, scales):
        by_scale, bits, unit = *((scaled_means, 10) if name == "mean" else (scaled, 9)), scale
        if by_scale and name != "mean":
            unit = scale + np.abs((numbers[0] + (centre if scaled_means else lower)).astype(np.float32).astype(np.float64) - centre)
        q, e = np.uint32(0), [values[name].astype(np.float32).astype(np.float64) for values in earlier]
        if e and (step > 0 or by_scale):
            e = np.sqrt(e) if name == "variance" else e
            e = e[0] + (e[0] - e[1]) * (b1 / (b2 - b1)) if b2 else e[0]
            if by_scale:
                q = scaled_code((e - centre if name == "mean" else np.maximum(e, 0) if name == "variance" else e) / unit, bits)
            else:
                q = np.rint(np.clip((e - origin) / step, lowest, highest)).astype(np.int64).astype(np.uint32)
        codes_of_array = contents.values(expected=q).view(np.int32)
        numbers.append(scaled_number(codes_of_array, bits) * unit if by_scale else codes_of_array * step)
    return dict(zip(VALUES, ((centre if scaled_means else lower) + numbers[0], *numbers[1:4], numbers[4]**2)))


def first_step(folder, manifest):
    """The bytes that steps.bin begins with, or would begin with if the cache was a series."""
    variables, files = manifest["variables"], {file["name"]: file for file in manifest["files"]}
    if "steps" in manifest["requires"]:
        return (folder / "steps.bin").read_bytes()[:48 + 32 * len(variables)]
    data = struct.pack("<8sIIdIIQQ", b"CVSsteps", 1, len(variables), manifest["steps"][0]["time"], 0, 0, 0,
                       int(manifest.get("grid_checksum", "0"), 16))
    for variable in variables:
        file = files[f"var.{variable['number']}.bin"]
        data += struct.pack("<ddQQ", variable["min"], variable["max"], file["size"], int(file["checksum"], 16))
    return data


class Cache:
    """Opens a cache and verifies all of it but the streams, which are verified when they are read."""
    def __init__(self, folder, step=0):
        self.folder, self.step, self.steps, self.data = pathlib.Path(folder), step, [], {}
        self.open_manifest()
        if "steps" in self.manifest.get("requires", []):
            self.open_step(len(self.manifest["variables"]))
        count, self.geometry_name, data = self.manifest["bricks"], self.manifest["steps"][0]["geometry"], self.verify("bricks.bin")
        need(data[:24] == struct.pack("<8sIIQ", b"CVSbrick", 1, 144, count), "header of bricks.bin")
        self.bricks = records(data[24:], "level:u4 at:3u4 splats:u4 octants:8u4 radius:f4 error:f4 parent:u4 box:6f8 "
                                         "children:2u4 offset:u8 checksum:u8 length:u4 reserved:u4")
        self.verify(self.geometry_name, lambda _: np.array([brick["checksum"] for brick in self.bricks], "<u8"))
        self.tables = {number: self.table(number, step) for number in self.manifest["steps"][0]["variables"]}

    def open_manifest(self):
        self.manifest = json.loads(text := (self.folder / "manifest.json").read_text(encoding="utf-8"))
        version, requires = (self.manifest["format"], self.manifest["version"]), set(self.manifest.get("requires", []))
        need(version == ("curvisplat splat cache", 2 if requires else 1) and requires <= FEATURES, "format, version or feature")
        packed = re.sub(r'("(?:\\.|[^"\\])*")|\s+', lambda match: match[1] or "", text)
        found = format(checksum(re.sub(r',"checksum":"[0-9a-f]{16}"}$', "}", packed)), "016x")
        need(self.manifest.get("checksum", found) == found, "checksum of the manifest")
        for n, own in enumerate(self.manifest.get("own_blanks", []), 1):
            data = (self.folder / f"blanks.{n}/manifest.json").read_bytes()
            if "own-blanks-steps" in requires:
                data = first_step(self.folder / f"blanks.{n}", json.loads(data))
            need(checksum(data) == int(own["checksum"], 16), "checksum of a set")
        self.files = {file["name"]: (file["size"], int(file["checksum"], 16)) for file in self.manifest["files"]}
        return text

    def open_step(self, variables):
        """The geometry of the step, and the files of values of all steps that share it."""
        data = self.verify("steps.bin")
        need(data[:16] == struct.pack("<8sII", b"CVSsteps", 1, variables), "header of steps.bin")
        fields = "".join(f" range{v}:2f8 file{v}:2u8" for v in range(variables))
        self.steps = records(data[16:], "time:f8 geometry:u4 reserved:u4 checksum:u8 grid:u8" + fields)
        own = self.steps[self.step]
        if own["geometry"]:
            self.folder /= f"geometry.{own['geometry']}"
            need(checksum(self.open_manifest()) == own["checksum"], "checksum of a geometry")
        for v, variable in enumerate(self.manifest["variables"]):
            variable["min"], variable["max"] = own[f"range{v}"]
            self.files |= {self.values_name(variable["number"], s): step[f"file{v}"]
                           for s, step in enumerate(self.steps) if step["geometry"] == own["geometry"]}

    def values_name(self, number, step):
        of = [record["geometry"] for record in self.steps]
        return f"var.{number}.{step}.bin" if of and of.index(of[step]) < step else f"var.{number}.bin"

    def verify(self, name, checked=bytes):
        """The bytes of a file, whose checksum is that of the bytes that `checked` makes of them."""
        size, digest = self.files[name]
        data = self.data[name] = (self.folder / name).read_bytes()[:size if name == "steps.bin" else None]
        need(len(data) == size and checksum(checked(data)) == digest, f"size or checksum of {name}")
        return data

    def table(self, number, step):
        """Each brick's record of a variable at a step."""
        name, count = self.values_name(number, step), self.manifest["bricks"]
        data = self.verify(name, lambda data: data[:32] + data[-40 * count:])
        need(data[:32] == struct.pack("<8sIIQQ", b"CVSvalue", 1, 40, count, len(data) - 40 * count), f"header of {name}")
        return records(data[-40 * count:], "offset:u8 checksum:u8 length:u4 min:f4 max:f4 slope:f4 deviation:f4 reserved:u4")

    def stream(self, name, at):
        data = self.data[name][at["offset"]:at["offset"] + at["length"]]
        need(len(data) == at["length"] and checksum(data) == at["checksum"], f"checksum of a stream of {name}")
        return data

    def geometry(self, n):
        return decode_geometry(self.stream(self.geometry_name, self.bricks[n]), self.bricks[n], self.manifest["root"])

    def values(self, number, n, back=0):
        name = self.values_name(number, self.step - back)
        need(back <= self.step and name in self.files, "reference")
        data = self.stream(name, (self.table(number, self.step - back) if back else self.tables[number])[n])
        return decode_values(data, self.bricks[n]["splats"], lambda further: self.values(number, n, back + further))

    def open_faces(self):
        header = (self.folder / "faces.bin").read_bytes()[:88]
        magic, version, scalars, faces, patches, regions, _, table, *box = struct.unpack("<8s6IQ6d", header)
        data, self.face_box = self.verify("faces.bin", lambda data: data[:88] + data[table:]), np.reshape(box, (2, 3))
        parts = np.split(np.frombuffer(data, np.uint8), np.cumsum([table, 4 * scalars, 40 * faces, 112 * patches]))[1:]
        need((magic, version, len(parts[3])) == (b"CVSfaces", 1, 136 * regions), "header of faces.bin")
        self.face_variables = parts[0].view("<u4").tolist()
        self.faces = records(parts[1], "block:u4 axis:u1 side:u1 reserved:u2 index:u8 nodes:2u8 root:u4 end:u4")
        self.patches = records(parts[2], "face:u4 stride:2u4 nodes:2u2 first:2u8 children:2u4 error:f4 length:u4 offset:u8 "
                                         "checksum:u8 box:6f8")
        self.regions = records(parts[3], "face:u4 reserved:u4 first:2u8 last:2u8 name:S64 type:S32")

    def patch(self, n):
        """Positions, which quads are drawn, and scalars of a patch, after open_faces()."""
        data, (columns, rows) = self.stream("faces.bin", self.patches[n]), self.patches[n]["nodes"]
        u, v, scalars, *codes, _ = struct.unpack_from("<HHI6BH", data)
        need((u, v, scalars) == (columns, rows, len(self.face_variables)), "header of a patch")
        heads, quads = records(data[16:16 + 12 * scalars], "low:f4 high:f4 codes:2u1 reserved:u2"), (columns - 1) * (rows - 1)
        codes += [code for head in heads for code in head["codes"]]
        contents = Contents(data[16 + 12 * scalars:], codes, columns * rows, skipped=(quads + 7) // 8)
        contents.rows = [(row * columns, columns, (row - 1) * columns if row else None) for row in range(rows)]
        drawn = np.unpackbits(np.frombuffer(contents.data, np.uint8, (quads + 7) // 8), bitorder="little")[:quads]
        code = np.stack([contents.values(1 << 26) for _ in range(3)], axis=1)
        values = [head["low"] + (head["high"] - head["low"]) * contents.values().astype(np.float64) / 65535 for head in heads]
        return self.face_box[0] + self.face_box[1] * code, drawn, values
