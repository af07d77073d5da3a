#!/usr/bin/env python3
"""Makes the index of the cache that a grid of twice as many nodes along i, j and k would have, for `curvisplat bench --ranks`.

    finer_index.py CACHE.splats OUT.splats

Each leaf of n splats becomes a brick with eight children of n splats each, half as large and with half their radius; a leaf whose
8n splats fit into a brick stays one. Errors of the bricks that were leaves are half of their parents'. OUT has no splats: its files
are as long as they would be, but empty. It cannot be drawn.
"""
import ctypes
import json
import pathlib
import sys

import numpy as np

MAX_SPLATS = 65536
NO_BRICK = 0xffffffff
HEADER = np.dtype([("magic", "S8"), ("version", "<u4"), ("record_bytes", "<u4"), ("bricks", "<u8")])
BRICK = np.dtype([("level", "<u4"), ("at", "<u4", 3), ("splats", "<u4"), ("octant_splats", "<u4", 8), ("largest_radius", "<f4"),
                  ("error", "<f4"), ("parent", "<u4"), ("lower", "<f8", 3), ("upper", "<f8", 3), ("first_child", "<u4"),
                  ("child_count", "<u4"), ("offset", "<u8"), ("checksum", "<u8"), ("length", "<u4"), ("reserved", "<u4")])
VARIABLE_HEADER = np.dtype(HEADER.descr + [("table_offset", "<u8")])
VARIABLE = np.dtype([("offset", "<u8"), ("checksum", "<u8"), ("length", "<u4"), ("ranges", "<f4", 4), ("reserved", "<u4")])
xxhash = ctypes.CDLL("libxxhash.so.0")
xxhash.XXH3_64bits.restype = ctypes.c_uint64
xxhash.XXH3_64bits.argtypes = [ctypes.c_char_p, ctypes.c_size_t]


def checksum(data):
    return f"{xxhash.XXH3_64bits(data, len(data)):016x}"


def laid_out(records, begin):
    """Gives each stream its offset; returns the end."""
    ends = begin + np.cumsum(records["length"].astype(np.uint64))
    records["offset"] = ends - records["length"]
    return int(ends[-1])


def main():
    cache, out = (pathlib.Path(name) for name in sys.argv[1:])
    manifest = json.loads((cache / "manifest.json").read_text())
    root, size = np.array(manifest["root"]["min"]), manifest["root"]["size"]
    data = (cache / "bricks.bin").read_bytes()
    header = np.frombuffer(data, HEADER, 1).copy()
    bricks = np.frombuffer(data, BRICK, offset=HEADER.itemsize)
    values_name = f"var.{manifest['variables'][0]['number']}.bin"
    data = (cache / values_name).read_bytes()
    values_header = np.frombuffer(data, VARIABLE_HEADER, 1).copy()
    values = np.frombuffer(data, VARIABLE, offset=int(values_header["table_offset"][0]))

    # [new brick]: the old one and the child of it, or -1. Levels stay in Morton order, since all children of a cell follow it.
    rows = [[] for _ in range(manifest["levels"] + 1)]
    for n, brick in enumerate(bricks):
        rows[brick["level"]].append((n, -1))
        if brick["child_count"] == 0 and 8 * int(brick["splats"]) > MAX_SPLATS:
            rows[brick["level"] + 1] += [(n, octant) for octant in range(8)]
    # Children of old bricks and of old leaves of one level: in the order of their parents.
    place = {}
    order = []
    for level, row in enumerate(rows):
        if level > 0:
            row.sort(key=lambda entry: (place[entry[0], -1] if entry[1] >= 0 else place[bricks[entry[0]]["parent"], -1], entry))
        for entry in row:
            place[entry] = len(order)
            order.append(entry)
    made, made_values = np.empty(len(order), BRICK), np.empty(len(order), VARIABLE)
    for place_of, (n, octant) in enumerate(order):
        old, new = bricks[n], made[place_of]
        made[place_of], made_values[place_of] = old, values[n]
        if old["parent"] != NO_BRICK:
            new["parent"] = place[old["parent"], -1]
        if old["child_count"]:
            new["first_child"] = place[old["first_child"], -1]
        elif 8 * int(old["splats"]) <= MAX_SPLATS:
            new["splats"] *= 8
            new["octant_splats"] *= 8
            new["length"] *= 8
            made_values[place_of]["length"] *= 8
            new["largest_radius"] /= 2
        elif octant < 0:
            new["first_child"], new["child_count"] = place[n, 0], 8
            new["error"] = 0.5 * bricks[old["parent"]]["error"] if old["parent"] != NO_BRICK else 1
            octants = np.full(8, old["splats"] // 8)
            octants[: old["splats"] % 8] += 1
            new["octant_splats"] = octants
        else:
            new["parent"] = place[n, -1]
            new["level"] += 1
            new["largest_radius"] /= 2
            half = np.array([octant & 1, octant >> 1 & 1, octant >> 2])
            new["at"] = 2 * old["at"] + half
            # The same part of its cell as the leaf has of its own, turned into the octant.
            edge = size / 2.0 ** new["level"]
            corner = root + edge * new["at"]
            middle = 0.5 * (old["lower"] + old["upper"])
            low, high = np.where(half, middle, old["lower"]), np.where(half, old["upper"], middle)
            new["lower"], new["upper"] = np.clip(low, corner, corner + edge), np.clip(high, corner, corner + edge)

    out.mkdir()
    leaves = made["child_count"] == 0
    geometry_end = laid_out(made, 0)
    values_end = laid_out(made_values, VARIABLE_HEADER.itemsize)
    geometry = manifest["steps"][0]["geometry"]
    with open(out / geometry, "wb") as file:
        file.truncate(geometry_end)
    header["bricks"] = values_header["bricks"] = len(made)
    values_header["table_offset"] = values_end
    index = header.tobytes() + made.tobytes()
    (out / "bricks.bin").write_bytes(index)
    with open(out / values_name, "wb") as file:
        file.write(values_header.tobytes())
        file.truncate(values_end)
        file.seek(values_end)
        file.write(made_values.tobytes())
    manifest |= {"splats": int(made["splats"][leaves].sum()), "bricks": len(made), "levels": int(made["level"].max()) + 1,
                 "nodes": 8 * manifest["nodes"], "variables": manifest["variables"][:1]}
    manifest["files"] = [
        {"name": "bricks.bin", "size": len(index), "checksum": checksum(index)},
        {"name": geometry, "size": geometry_end, "checksum": checksum(made["checksum"].tobytes())},
        {"name": values_name, "size": values_end + made_values.nbytes, "checksum": checksum(values_header.tobytes() + made_values.tobytes())}]
    manifest["steps"][0]["variables"] = manifest["steps"][0]["variables"][:1]
    del manifest["checksum"]
    (out / "manifest.json").write_text(json.dumps(manifest, indent=2))


if __name__ == "__main__":
    main()
