"""A brick's streams of a splat cache as numbers: geometry and values, by stream/FORMAT.md. A part of read_cache.py."""
import struct

import numpy as np
import zstandard

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
    lower, upper, slope_step, deviation_step, most = header
    b, values = references
    if array == 4:
        values = [np.sqrt(value) for value in values]
    e = values[0] if len(values) == 1 else values[0] + (values[0] - values[1]) * (b[0] / (b[1] - b[0]))
    origin, step = (lower, (upper - lower) / most) if array == 0 else (0.0, deviation_step if array == 4 else slope_step)
    if not step > 0:
        return np.zeros(len(e), np.uint64)
    low, high = 0 if array in (0, 4) else -2.0**30, most if array == 0 else 2.0**30
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
    most = 2**24 - 1 if data[28] & 16 else 65535  # with `fine-values`
    contents = Contents(data[40:], varint_bytes, zip((data[28] & ~16, *data[30:38:2]), data[29:38:2]), count, bool(back))
    earlier = [reference(b) for b in back]
    header = lower, upper, slope_step, deviation_step, most
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
    steps = lower + m * ((upper - lower) / most), s0 * slope_step, s1 * slope_step, s2 * slope_step
    return dict(zip(VALUES, (*steps, (d * deviation_step) ** 2)))
