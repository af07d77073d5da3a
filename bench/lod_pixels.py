#!/usr/bin/env python3
"""Compares coarser levels with the finest: splats, seconds and PSNR of the pictures of caches.

    bench/lod_pixels.py CACHE [CACHE ...] [--size 600x600] [--lod-pixels 1,2,4,8] [--program ...]

The pictures are chosen from the data, and are drawn a second time ("step") with a function that is opaque above the
middle of the range and empty below. Prints a row for each picture.
"""
import argparse
import json
import pathlib
import re
import tempfile

import results

FUNCTIONS = {"default": [], "step": ["--opacity", "0:0,0.499:0,0.501:0.9,1:0.9"]}


def draw(program, cache, picture, size, pixels, function):
    told = picture.with_suffix(".json")
    results.run([program, "render", cache, "-o", picture, "--size", size, "--lod-pixels", pixels, "--stats", told,
                 *FUNCTIONS[function]])
    frame = json.loads(told.read_text())["frames"][0]
    return frame["splats_drawn"], frame["seconds"]["total"]


def psnr(program, finest, picture):
    """Of single precision; None where the pictures are the same."""
    said = results.run([program, "compare", finest, picture])
    found = re.search(r"PSNR ([\d.]+) dB", said)
    if not found and "identical" not in said:
        raise SystemExit(f"{program} compare: {said}")
    return float(found[1]) if found else None


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("caches", nargs="+", type=pathlib.Path, metavar="CACHE")
    parser.add_argument("--size", default="600x600")
    parser.add_argument("--lod-pixels", default="1,2,4,8")
    parser.add_argument("--program", default="build/release/tools/curvisplat")
    arguments = parser.parse_args()
    levels = arguments.lod_pixels.split(",")
    print(f"| {arguments.size} | function | finest | " + " | ".join(f"{level} px" for level in levels) + " |")
    print("|---" * (3 + len(levels)) + "|")
    with tempfile.TemporaryDirectory() as folder:
        finest, picture = pathlib.Path(folder) / "finest.pfm", pathlib.Path(folder) / "coarser.pfm"
        for cache in arguments.caches:
            for function in FUNCTIONS:
                splats, seconds = draw(arguments.program, cache, finest, arguments.size, "0", function)
                row = [f"{splats} splats, {seconds:.2f} s"]
                for level in levels:
                    splats, seconds = draw(arguments.program, cache, picture, arguments.size, level, function)
                    ratio = psnr(arguments.program, finest, picture)
                    row.append("the same" if ratio is None else f"{ratio:.1f} dB, {splats} splats, {seconds:.2f} s")
                print(f"| {cache.stem} | {function} | " + " | ".join(row) + " |", flush=True)


if __name__ == "__main__":
    main()
