#!/usr/bin/env python3
"""Measures what is drawn around the volume: light, clip planes, an opaque body, two scalars, depth, surfaces of many quads.

    bench/around.py FOLDER [--program PROGRAM] [--frames 8] [--rounds 5] [--smoke]

Grids and caches are made in FOLDER and reused. Variants of one picture take turns, round after round, as orbits of --frames
frames; a ratio is the median over the rounds of a variant's processor time a frame over the plain picture's in the same
round. What the process takes to start is measured by an orbit of one frame and left out. Frames of surfaces are wall time,
without the first.
"""
import argparse
import json
import math
import pathlib
import resource
import statistics
import subprocess


def write_sphere(path, centre, radius, steps=48):
    def at(i, j):
        theta, phi = math.pi * j / steps, 2 * math.pi * i / steps
        return [centre[0] + radius * math.sin(theta) * math.cos(phi), centre[1] + radius * math.sin(theta) * math.sin(phi),
                centre[2] + radius * math.cos(theta)]
    lines = ["solid sphere"]
    for j in range(steps):
        for i in range(steps):
            a, b, c, d = at(i, j), at(i + 1, j), at(i, j + 1), at(i + 1, j + 1)
            for corners in ((a, c, b), (b, c, d)):
                lines += ["facet normal 0 0 0", "outer loop", *(f"vertex {x:.6g} {y:.6g} {z:.6g}" for x, y, z in corners),
                          "endloop", "endfacet"]
    path.write_text("\n".join([*lines, "endsolid sphere", ""]))


def processor_seconds(command):
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    subprocess.run(command, check=True, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=pathlib.Path)
    parser.add_argument("--program", default="build/release/tools/curvisplat")
    parser.add_argument("--frames", type=int, default=8)
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--smoke", action="store_true", help="tiny grids and pictures, one round: whether it runs, not how fast")
    arguments = parser.parse_args()
    if arguments.smoke:
        arguments.frames = arguments.rounds = 1
    grid, quads, pixels = ("24x16x12", "33x33x3", "64x64") if arguments.smoke else ("192x128x96", "1025x1025x3", "600x600")
    folder, program = arguments.folder, arguments.program
    folder.mkdir(parents=True, exist_ok=True)

    def made(name, size, *options):
        cache = folder / f"{name}.splats"
        if not cache.exists():
            grid = folder / name
            subprocess.run([program, "generate", "wake", "--size", size, "-o", grid], check=True)
            subprocess.run([program, "convert", f"{grid}.xyz", f"{grid}.fun", "-o", cache, *options], check=True)
        return cache

    wake, plate = made("wake", grid, "--scalar", "f,jacobian"), made("plate", quads)
    body = folder / "body.stl"
    write_sphere(body, (2, 0, 2), 3)
    picture = ["--size", pixels, "--range", "0,1", "--opacity", "0:0,0.3:0,0.5:0.3,1:0.8",
               "--opacity-unit", "0.05", "--backend", "cpu", "--orbit", "40"]
    planes = [f"{x},{y},{z},{-x},{-y},{2 - z}" for x, y, z in
              ((6, 0, 2), (-6, 0, 2), (0, 6, 2), (0, -6, 2), (3, 3, 3.2), (3, -3, 0.8))]
    scalar = json.loads(subprocess.run([program, "info", wake, "--json"], check=True, capture_output=True).stdout)
    names = [variable["name"] for variable in scalar["variables"]]
    variants = {"plain": [], "lit": ["--shade"], "six clip planes": [f"--clip-plane={plane}" for plane in planes],
                "opaque body": ["--surface", body],
                "two scalars": ["--scalar", names[1], "--opacity-by", names[0], "--opacity-range", "0,1"],
                "depth (.exr)": []}
    ratios = {name: [] for name in variants}
    for _ in range(arguments.rounds):
        times = {}
        for name, options in variants.items():
            output = folder / ("a_%02d.exr" if name.endswith("(.exr)") else "a_%02d.pfm")
            command = [program, "render", wake, "-o", output, *picture, *options]
            times[name] = (processor_seconds([*command, "--frames", str(arguments.frames + 1)]) -
                           processor_seconds([*command, "--frames", "1"])) / arguments.frames
        for name in variants:
            # A frame of --smoke takes less than the clock's tick.
            ratios[name].append(times[name] / times["plain"] if times["plain"] > 0 else math.nan)
    for name in variants:
        print(f"{name:16} {statistics.median(ratios[name]):.2f} of the plain picture "
              f"({min(ratios[name]):.2f} to {max(ratios[name]):.2f})")
    stats = folder / "stats.json"
    command = [program, "render", plate, "-o", folder / "b_%02d.pfm", "--size", pixels, "--surface", "kmax", "--volume", "off",
               "--lod-pixels", "0", "--orbit", "40", "--frames", str(arguments.frames + 1), "--stats", stats]
    seconds = []
    processor = processor_seconds(command)
    seconds = [frame["seconds"]["total"] for frame in json.loads(stats.read_text())["frames"]][1:]
    quads = (int(quads.split("x")[0]) - 1) ** 2
    print(f"{f'{quads} quads':16} {1000 * statistics.median(seconds):.0f} ms a frame ({1000 * min(seconds):.0f} to "
          f"{1000 * max(seconds):.0f}), {1000 * processor / len(seconds):.0f} ms of processor time with the start")


if __name__ == "__main__":
    main()
