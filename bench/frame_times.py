#!/usr/bin/env python3
"""Times whole frames of the scenes in frame_scenes.json, each backend in turn.

    bench/frame_times.py FOLDER [--scene NAME] [--repeats 8] [--backends cpu,osmesa] [--threads N]

A scene says how its cache is made (once, in FOLDER; those with "grid" need the named files there) and how it
is drawn. Prints the shortest and the median frame, from the program's own --stats, and the least processor
time of the whole program, its start included.
"""
import argparse
import json
import pathlib
import resource
import statistics
import subprocess

HERE = pathlib.Path(__file__).resolve().parent
PROGRAM = HERE.parent / "build/release/tools/curvisplat"


def run(*arguments):
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    subprocess.run([PROGRAM, *map(str, arguments)], check=True, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def cache_of(scene, folder):
    cache = folder / f"{scene['name']}.splats"
    if cache.exists():
        return cache
    if "generate" in scene:
        grid = folder / scene["name"]
        run("generate", *scene["generate"], "-o", grid)
        files = [grid.with_suffix(".xyz"), grid.with_suffix(".fun")]
    else:
        files = [folder / name for name in scene["grid"]]
    run("convert", *files, "-o", cache, *scene.get("convert", []))
    return cache


def measure(scene, cache, backend, folder, repeats, threads):
    seconds, processor = [], []
    for _ in range(repeats):
        processor.append(run("render", cache, "-o", folder / "frame.pfm", "--stats", folder / "frame.json",
                             "--backend", backend, *scene["render"], *threads))
        frame = json.loads((folder / "frame.json").read_text())["frames"][0]
        seconds.append(frame["seconds"]["total"])
    print(f"{scene['name']:12} {backend:7} {frame['splats_drawn']:10} splats {1e3 * min(seconds):8.1f} ms "
          f"(median {1e3 * statistics.median(seconds):.1f}), processor {1e3 * min(processor):.0f} ms")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=pathlib.Path)
    parser.add_argument("--scene")
    parser.add_argument("--repeats", type=int, default=8)
    parser.add_argument("--backends", default="cpu,osmesa")
    parser.add_argument("--threads", type=int)
    arguments = parser.parse_args()
    arguments.folder.mkdir(parents=True, exist_ok=True)
    threads = ["--threads", arguments.threads] if arguments.threads else []
    for scene in json.loads((HERE / "frame_scenes.json").read_text()):
        if arguments.scene and scene["name"] != arguments.scene:
            continue
        if not all((arguments.folder / name).exists() for name in scene.get("grid", [])):
            print(f"{scene['name']}: {' and '.join(scene['grid'])} are not in {arguments.folder}")
            continue
        cache = cache_of(scene, arguments.folder)
        for backend in arguments.backends.split(","):
            measure(scene, cache, backend, arguments.folder, arguments.repeats, threads)


main()
