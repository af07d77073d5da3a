#!/usr/bin/env python3
"""Times frames of the scenes in frame_scenes.json: real grids, in their default pictures and with a plain ramp, and generated ones.

    bench/frame_times.py FOLDER --data DATA [--scenes REGEX] [--sizes 600x600,1920x1080] [--json OUT.json]
    bench/frame_times.py FOLDER --programs OLD,NEW            # in turn; prints NEW's times over OLD's

A scene states its files (in DATA; without --data such scenes are left out) or how its grid is generated, and its pictures if they
are others. Caches are made once, in FOLDER, by the last program. Each program draws an orbit of --frames frames, --repeats times,
all programs in turn. Printed of each: the first frame, the median of the others, both from the program's own --stats, and the
processor time of the whole program over its frames; the shortest of the repeats.
"""
import argparse
import json
import math
import pathlib
import re
import resource
import statistics

import results

HERE = pathlib.Path(__file__).resolve().parent
PICTURES = {"default": [], "ramp": ["--tf", "viridis", "--opacity", "ramp"]}
PARTS = ("first", "orbit", "processor")


def processor_seconds():
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def cache_of(arguments, scene):
    name = scene["name"] + (f"_{arguments.nodes}" if arguments.nodes and "generate" in scene else "")
    cache = arguments.folder / f"{name}.splats"
    if cache.exists():
        return cache
    program = arguments.programs[-1]
    files = [arguments.data / file for file in scene.get("files", [])]
    if "generate" in scene:
        words = list(scene["generate"])
        if arguments.nodes:
            words[words.index("--size") + 1] = arguments.nodes
        grid = arguments.folder / name
        results.run([program, "generate", *words, "-o", grid])
        files = [grid.with_suffix(".xyz"), grid.with_suffix(".fun")]
    results.run([program, "convert", *files, "-o", cache, *scene.get("convert", [])])
    return cache


def draw(arguments, program, cache, words):
    """An orbit: seconds of the first frame, of the others and of the processor, a frame; and its splats."""
    told = arguments.folder / "frames.json"
    before = processor_seconds()
    results.run([program, "render", cache, "-o", arguments.folder / "frame_%02d.pfm", "--stats", told, *words, "--orbit", "20",
                 "--frames", str(arguments.frames)])
    processor = processor_seconds() - before
    frames = json.loads(told.read_text())["frames"]
    seconds = [frame["seconds"]["total"] for frame in frames]
    return (seconds[0], statistics.median(seconds[1:] or seconds), processor / len(frames)), frames[-1]["splats_drawn"]


def measure(arguments, scene, picture, size, backend):
    """Prints a row. Returns the samples of each program by part."""
    cache = cache_of(arguments, scene)
    pictures = scene.get("pictures", PICTURES)
    words = [*pictures[picture], "--size", size, "--backend", backend]
    if arguments.threads:
        words += ["--threads", str(arguments.threads)]
    samples = [{part: [] for part in PARTS} for _ in arguments.programs]
    for _ in range(arguments.repeats):
        for program, of_program in zip(arguments.programs, samples):
            times, splats = draw(arguments, program, cache, words)
            for part, seconds in zip(PARTS, times):
                of_program[part].append(seconds)
    best = [[min(of_program[part]) for part in PARTS] for of_program in samples]
    row = f"{scene['name']:15} {picture:8} {size:9} {backend:7} {splats:8} splats"
    row += "".join(f"{1e3 * seconds:9.1f}" for seconds in best[-1]) + " ms"
    if len(best) > 1:
        row += "   over the first's: " + ", ".join(f"{new / old:.2f}" for old, new in zip(best[0], best[-1]))
    print(row, flush=True)
    return samples


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=pathlib.Path)
    parser.add_argument("--data", type=pathlib.Path, help="the folder of the real grids")
    parser.add_argument("--program", default=HERE.parent / "build/release/tools/curvisplat")
    parser.add_argument("--programs", help="several, with commas")
    parser.add_argument("--scenes", default="")
    parser.add_argument("--nodes", help="NIxNJxNK of generated grids, instead of the scenes' own")
    parser.add_argument("--sizes", default="600x600")
    parser.add_argument("--backends", default="cpu")
    parser.add_argument("--frames", type=int, default=6)
    parser.add_argument("--repeats", type=int, default=3)
    parser.add_argument("--threads", type=int)
    parser.add_argument("--json")
    arguments = parser.parse_args()
    arguments.programs = arguments.programs.split(",") if arguments.programs else [arguments.program]
    arguments.folder.mkdir(parents=True, exist_ok=True)
    out, ratios = results.Results(), {part: [] for part in PARTS}
    print(f"{'':57} first    orbit  processor (a frame)")
    for scene in json.loads((HERE / "frame_scenes.json").read_text()):
        if not re.search(arguments.scenes, scene["name"]):
            continue
        if "files" in scene and not arguments.data:
            out.leave_out(f"frames/{scene['name']}", "needs the real grids: --data")
            continue
        for size in arguments.sizes.split(","):
            for backend in arguments.backends.split(","):
                for picture in scene.get("pictures", PICTURES):
                    samples = measure(arguments, scene, picture, size, backend)
                    for part in PARTS:
                        out.add(f"frames/{scene['name']}/{picture}/{part}/size:{size}/backend:{backend}", "s", samples[-1][part])
                        ratios[part].append(min(samples[-1][part]) / min(samples[0][part]))
    if len(arguments.programs) > 1:
        means = ", ".join(f"{part} {math.exp(statistics.fmean(map(math.log, ratios[part]))):.3f}" for part in PARTS)
        print(f"geometric means of the ratios: {means}")
    if arguments.json:
        out.write(arguments.json, "frame_times", results.version_of(arguments.programs[-1]))


if __name__ == "__main__":
    main()
