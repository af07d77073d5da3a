#!/usr/bin/python3
"""read_cache.py CACHE [STEP]: prints a splat cache's octree and the first splats of every brick.

Written from stream/FORMAT.md alone, with cache_streams.py and read_faces.py, which shows that the page is complete. They share
no code with the program; read_cache_test.py compares the two. Needs Debian's python3-numpy, python3-zstandard and
python3-xxhash.
"""
import json
import pathlib
import re
import struct
import sys

import xxhash
from cache_streams import SHAPE, VALUES, decode_geometry, decode_values, need

checksum = xxhash.xxh3_64_intdigest


class Cache:
    """Opens a cache and verifies all of it but the streams, which are verified when they are read."""
    def __init__(self, folder, step=0):
        self.folder, self.data, self.tables = pathlib.Path(folder), {}, {}
        self.step, self.steps = step, None
        text = (self.folder / "manifest.json").read_text(encoding="utf-8")
        self.manifest = json.loads(text)
        version, requires = self.manifest["version"], self.manifest.get("requires", [])
        need(self.manifest["format"] == "curvisplat splat cache" and version == (2 if requires else 1), "format version")
        need(set(requires) <= {"border-faces", "cell-growth", "merged-borders", "face-layers", "border-pairs", "steps", "fine-values", "cell-octants"}, "required feature")
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


    def histogram(self, number):
        """Range, volume and shares of the finest splats, or None: the last bytes before the table may be such a record."""
        name = self.values_name(number, self.step)
        data, end = self.data[name], struct.unpack_from("<Q", self.data[name], 24)[0]
        record = data[max(0, end - 2096):end]
        if len(record) < 2096 or record[:8] != b"CVShisto":
            return None
        _, version, bins, lower, upper, volume, digest = struct.unpack_from("<8sIIdddQ", record)
        need((version, bins) == (1, 512), "histogram")
        need(checksum(record[:40] + record[48:]) == digest, "checksum of a histogram")
        return lower, upper, volume, struct.unpack_from("<512f", record, 48)


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
