#!/usr/bin/env python3
"""Conversion at growing sizes: rate, where the time goes, memory, disk, and what each stream takes.

    bench/convert_scaling.py FOLDER [--program build/release/tools/curvisplat] [--scene wake]
                             [--nodes 64M,512M] [--memory 512M] [--json OUT.json]

Generates the scene in FOLDER (kept there and used again; 16 bytes a node), converts it, and prints one table. A
conversion reads a file that was just written or read, so the pages it finds in memory are said, not hidden: "cached"
is the part of the grid's files that the page cache holds when the conversion starts, asked with mincore.
"""

import argparse
import ctypes
import json
import mmap
import os
import re
import subprocess
import sys

SUFFIX = {"K": 1000, "M": 1000**2, "G": 1000**3}


def count_of(text):
    match = re.fullmatch(r"(\d+)([KMG]?)", text)
    if not match:
        sys.exit(f"'{text}' is not a number of nodes such as 64M")
    return int(match[1]) * SUFFIX.get(match[2], 1)


def cached_part(path):
    """The part of a file's pages that lie in the page cache."""
    size = os.path.getsize(path)
    with open(path, "rb") as file, mmap.mmap(file.fileno(), size, access=mmap.ACCESS_COPY) as view:
        pages = (size + mmap.PAGESIZE - 1) // mmap.PAGESIZE
        resident = (ctypes.c_ubyte * pages)()
        anchor = ctypes.c_char.from_buffer(view)
        libc = ctypes.CDLL(None, use_errno=True)
        failed = libc.mincore(ctypes.c_void_p(ctypes.addressof(anchor)), ctypes.c_size_t(size), resident)
        del anchor
        if failed:
            sys.exit(f"mincore of {path}: {os.strerror(ctypes.get_errno())}")
        return sum(page & 1 for page in bytes(resident)) / pages


def run(command):
    result = subprocess.run(command, capture_output=True, text=True)
    if result.returncode != 0:
        sys.exit(f"{' '.join(command)}\n{result.stderr}")


def measure(arguments, nodes):
    edge = round(nodes ** (1 / 3))
    size = f"{edge}x{edge}x{edge}"
    prefix = os.path.join(arguments.folder, f"{arguments.scene}_{edge}")
    grid, function = prefix + ".xyz", prefix + ".fun"
    if not (os.path.exists(grid) and os.path.exists(function)):
        run([arguments.program, "generate", arguments.scene, "--size", size, "-o", prefix])
    cached = {os.path.basename(path): cached_part(path) for path in (grid, function)}
    stats = prefix + ".convert.json"
    run([arguments.program, "convert", grid, function, "-o", prefix + ".splats", "--overwrite",
         "--memory", arguments.memory, "--stats", stats])
    with open(stats) as file:
        result = json.load(file)
    result["size"] = size
    result["cached"] = cached
    return result


def report(results):
    for result in results:
        nodes = result["nodes"]
        print(f"\n{result['size']}  {nodes / 1e6:.1f} M nodes, {result['threads']} threads, "
              f"cap {result['memory_bytes'] / 2**20:.0f} MiB")
        print(f"  rate        {nodes / result['seconds'] / 1e6:8.2f} M nodes/s ({result['seconds']:.1f} s)")
        for phase in result["phases"]:
            print(f"  {phase['name']:<10}  {phase['seconds']:8.2f} s  {100 * phase['seconds'] / result['seconds']:5.1f} %  "
                  f"{phase['cpu_seconds']:8.2f} s of CPU")
        print(f"  peak        {result['peak_memory_bytes'] / 2**20:8.1f} MiB")
        print(f"  temporary   {result['temporary_bytes'] / nodes:8.2f} bytes a node")
        for name, size in result["files"].items():
            print(f"  {name:<13}{size / nodes:7.3f} bytes a node")
        print(f"  cache       {result['cache_bytes'] / nodes:8.3f} bytes a node")
        print("  cached      " + ", ".join(f"{name} {100 * part:.0f} %" for name, part in result["cached"].items()))
    first = results[0]
    for result in results[1:]:
        ratio = (result["nodes"] / result["seconds"]) / (first["nodes"] / first["seconds"])
        print(f"\nrate at {result['size']} / rate at {first['size']}: {ratio:.2f}")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder")
    parser.add_argument("--program", default="build/release/tools/curvisplat")
    parser.add_argument("--scene", default="wake")
    parser.add_argument("--nodes", default="64M", type=lambda text: [count_of(part) for part in text.split(",")])
    parser.add_argument("--memory", default="512M")
    parser.add_argument("--json")
    arguments = parser.parse_args()
    os.makedirs(arguments.folder, exist_ok=True)
    results = [measure(arguments, nodes) for nodes in arguments.nodes]
    report(results)
    if arguments.json:
        with open(arguments.json, "w") as file:
            json.dump(results, file, indent=1)


if __name__ == "__main__":
    main()
