#!/usr/bin/env python3
"""Measures series of time steps: conversion of further steps, bytes, and frames while the steps change.

    bench/steps.py FOLDER [--nodes 192x128x48] [--steps 12] [--memory 512M] [--json OUT.json]
    bench/steps.py FOLDER --nodes 512x500x250 --steps 100 --one-by-one --series fixed --views 4px

The wake on a fixed grid, and on one that moves. With --one-by-one each step is generated, added to the cache and removed before the
next one: the disk then holds one step's files beside the cache (64 M nodes: 1.3 GB beside 1.4 bytes a node and step). Frames are drawn by `render --steps`, forwards, at the finest level (256x256) and
at 4 pixels (600x600); the first frame, which opens the cache, is a measurement of its own. The processors' time, of opening and
writing too, tells more than the clock where other programs run.
"""
import argparse
import json
import pathlib
import resource
import shutil
import statistics
import time

import results

HERE = pathlib.Path(__file__).resolve().parent
VIEWS = {"finest": ["--lod-pixels", "0", "--size", "256x256"], "4px": ["--lod-pixels", "4", "--size", "600x600"]}


def convert(arguments, name, moving, out):
    program, folder = arguments.program, arguments.folder
    grid, cache, told = folder / name, folder / f"{name}.splats", folder / "convert.json"
    results.run([program, "generate", "wake", "--size", arguments.nodes, "--steps", arguments.steps, "-o", grid,
                 *(["--moving"] if moving else [])])
    shutil.rmtree(cache, ignore_errors=True)
    results.run([program, "convert", f"{grid}_%04d.xyz" if moving else f"{grid}.xyz", f"{grid}_%04d.fun", "-o", cache, "--memory",
                 arguments.memory, "--stats", told])
    report = json.loads(told.read_text())
    tell(name, report["each_step"], report["samples"], out)
    return cache


def add_one_by_one(arguments, name, moving, out):
    program, folder = arguments.program, arguments.folder
    grid, cache = folder / name, folder / f"{name}.splats"
    shutil.rmtree(cache, ignore_errors=True)
    ni, nj, nk = (int(number) for number in arguments.nodes.split("x"))
    steps, before = [], 0
    for step in range(arguments.steps):
        results.run([program, "generate", "wake", "--size", arguments.nodes, "--first-step", step, "--steps", 1, "-o", grid,
                     *(["--moving"] if moving else [])])
        files = [folder / (f"{name}_{step:04}.xyz" if moving else f"{name}.xyz"), folder / f"{name}_{step:04}.fun"]
        to = ["--add-steps", "--to", cache] if step else ["-o", cache]
        began = time.monotonic()
        results.run([program, "convert", *files, *to, "--memory", arguments.memory])
        seconds = time.monotonic() - began
        size = sum(file.stat().st_size for file in cache.rglob("*") if file.is_file())
        steps.append(dict(seconds=seconds, bytes=size - before))
        before = size
        for file in files:
            file.unlink()
    tell(name, steps, ni * nj * nk, out)
    return cache


def tell(name, steps, nodes, out):
    rates = [nodes / step["seconds"] for step in steps]
    size = [step["bytes"] / nodes for step in steps]
    out.add(f"steps/{name}/convert/first", "nodes/s", rates[:1])
    out.add(f"steps/{name}/convert/further", "nodes/s", rates[1:])
    out.add(f"steps/{name}/bytes_per_node/further", "1", size[1:])
    print(f"{name}: first step {rates[0] / 1e6:.2f} M nodes/s, further {statistics.median(rates[1:]) / 1e6:.2f} "
          f"({statistics.median(rates[1:]) / rates[0]:.2f} times), {statistics.mean(size[1:]):.2f} bytes a node and step", flush=True)


def cpu_seconds():
    """Of all programs that have ended."""
    usage = resource.getrusage(resource.RUSAGE_CHILDREN)
    return usage.ru_utime + usage.ru_stime


def draw(arguments, name, cache, view, out):
    told = arguments.folder / "frames.json"
    before = cpu_seconds()
    results.run([arguments.program, "render", cache, "-o", arguments.folder / "step_%04d.pfm", "--steps", "all", "--range", "0,1",
                 "--view", "iso", "--memory", arguments.memory, "--stats", told, *VIEWS[view]])
    seconds = [frame["seconds"]["total"] for frame in json.loads(told.read_text())["frames"]]
    cpu = (cpu_seconds() - before) / len(seconds)
    out.add(f"steps/{name}/first_frame/{view}", "s", seconds[:1])
    out.add(f"steps/{name}/cpu_a_frame/{view}", "s", [cpu])
    out.add(f"steps/{name}/frame/{view}", "s", seconds[1:])
    print(f"{name}, {view}: first frame {seconds[0]:.3f} s, then {statistics.median(seconds[1:]):.3f} s a step; "
          f"{cpu:.3f} s of processors a step", flush=True)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=pathlib.Path)
    parser.add_argument("--program", default=HERE.parent / "build/release/tools/curvisplat")
    parser.add_argument("--nodes", default="192x128x48", help="NIxNJxNK of the grid")
    parser.add_argument("--steps", type=int, default=12)
    parser.add_argument("--memory", default="512M")
    parser.add_argument("--one-by-one", action="store_true", help="one step's files at a time")
    parser.add_argument("--series", choices=("fixed", "moving"), help="only this one")
    parser.add_argument("--views", nargs="+", choices=VIEWS, default=list(VIEWS))
    parser.add_argument("--json")
    parser.add_argument("--smoke", action="store_true", help="a small grid and three steps: whether it runs, not how fast")
    arguments = parser.parse_args()
    if arguments.smoke:
        arguments.nodes, arguments.steps = "24x20x12", 3
    arguments.folder.mkdir(parents=True, exist_ok=True)
    out = results.Results()
    for name, moving in (("fixed", False), ("moving", True)):
        if arguments.series not in (None, name):
            continue
        cache = (add_one_by_one if arguments.one_by_one else convert)(arguments, name, moving, out)
        for view in arguments.views:
            draw(arguments, name, cache, view, out)
    if arguments.json:
        out.write(arguments.json, "steps", results.version_of(arguments.program))


if __name__ == "__main__":
    main()
