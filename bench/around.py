#!/usr/bin/env python3
"""Measures what is drawn around the volume: light, clip planes, an opaque body, two scalars, depth, surfaces of many quads.

    bench/around.py FOLDER [--program PROGRAM] [--frames 8] [--rounds 5] [--smoke]

Grids and caches are made in FOLDER and reused. Variants of one picture take turns, round after round, as orbits of --frames
frames; a ratio is the median over the rounds of a variant's processor time a frame over the plain picture's in the same
round. What the process takes to start is measured by an orbit of one frame and left out. What the body hides is counted in
one picture of a fresh process. Behind each ratio: what it may be at most. Frames of quads are timed on the wall, too.
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


def processor_seconds_of_frame(command, frames):
    """The run of several frames is the last."""
    first = processor_seconds([*command, "--frames", "1"])
    return (processor_seconds([*command, "--frames", str(frames + 1)]) - first) / frames


def counts(program, cache, folder, options):
    """Of one picture, in a process of its own."""
    stats = folder / "stats.json"
    command = [program, "render", cache, "-o", folder / "c_%02d.pfm", *options, "--frames", "1", "--stats", stats]
    subprocess.run(command, check=True, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    return json.loads(stats.read_text())["frames"][0]


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
                "no depth (.exr)": ["--channels", "none"], "depth (.exr)": []}
    most = {"lit": 1.1, "six clip planes": 1.3, "opaque body": 1}
    ratios = {name: [] for name in variants}
    for _ in range(arguments.rounds):
        times = {}
        for name, options in variants.items():
            output = folder / ("a_%02d.exr" if name.endswith("(.exr)") else "a_%02d.pfm")
            command = [program, "render", wake, "-o", output, *picture, *options]
            times[name] = processor_seconds_of_frame(command, arguments.frames)
        for name in variants:
            # A frame of --smoke takes less than the clock's tick.
            ratios[name].append(times[name] / times["plain"] if times["plain"] > 0 else math.nan)
    for name in variants:
        allowed = f", at most {most[name]}" if name in most else ""
        print(f"{name:16} {statistics.median(ratios[name]):.2f} of the plain picture "
              f"({min(ratios[name]):.2f} to {max(ratios[name]):.2f}{allowed})")
    counted = {name: counts(program, wake, folder, [*picture, *variants[name]]) for name in ("plain", "opaque body")}
    for count in ("bytes_read", "splats_drawn"):
        plain, behind = (counted[name][count] for name in ("plain", "opaque body"))
        print(f"{'opaque body':16} {count.replace('_', ' ')}: {behind} of {plain}")
    stats = folder / "stats.json"
    command = [program, "render", plate, "-o", folder / "b_%02d.pfm", "--size", pixels, "--surface", "kmax", "--volume", "off",
               "--orbit", "40", "--threads", "2"]
    sides = (int(quads.split("x")[0]) - 1) ** 2
    for what, options in (("", []), (", by a scalar", ["--surface-by", "f"]), (", finest", ["--lod-pixels", "0"]),
                          (", finest, by a scalar", ["--lod-pixels", "0", "--surface-by", "f"])):
        times, totals = [], []
        for _ in range(arguments.rounds):
            times.append(1000 * processor_seconds_of_frame([*command, *options, "--stats", stats], 4 * arguments.frames))
            further = json.loads(stats.read_text())["frames"][1:]
            totals.append(1000 * statistics.median(frame["seconds"]["total"] for frame in further))
        print(f"{sides} quads{what}: {statistics.median(times):.0f} ms of processor time a frame ({min(times):.0f} to "
              f"{max(times):.0f}); {statistics.median(totals):.0f} ms from its beginning to its end on two threads "
              f"({min(totals):.0f} to {max(totals):.0f}; at most 50 where two cores are idle)")


if __name__ == "__main__":
    main()
