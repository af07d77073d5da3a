#!/usr/bin/env python3
"""Times frames of the scenes in frame_scenes.json: real grids, in their default pictures and with a plain ramp, and generated ones.

    bench/frame_times.py FOLDER --data DATA [--scenes REGEX] [--sizes 600x600,1920x1080] [--json OUT.json]
    bench/frame_times.py FOLDER --programs OLD,NEW            # in turn; prints NEW's times over OLD's
    bench/frame_times.py FOLDER --convert                     # times conversions instead

A scene states its files (in DATA; without --data such scenes are left out) or how its grid is generated, and its pictures if they
are others. Caches are made once, in FOLDER, by the last program. Each program draws an orbit of --frames frames, --repeats times,
all programs in turn. Printed of each: the first frame, the median of the others, both from the program's own --stats, and the
processor time of the whole program over its frames; the shortest of the repeats. --stages adds the medians of the last program's
stages; preparing (decode, project, sort) and drawing overlap. --convert prints seconds, nodes per second and processor time.

The torus is that of a stellarator's code: thin cells, and a scalar with noise in its single precision. It needs numpy.
"""
import argparse
import importlib.util
import json
import math
import pathlib
import re
import resource
import shutil
import statistics
import subprocess
import time

import results

HERE = pathlib.Path(__file__).resolve().parent
PICTURES = {"default": [], "ramp": ["--tf", "viridis", "--opacity", "ramp"]}
PARTS = ("first", "orbit", "processor")
STAGES = ("plan", "decode", "project", "sort", "draw")


def processor_seconds():
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def write_noisy_torus(grid, size):
    """Of PLOT3D: twisted ellipses around an axis, and a scalar with noise of a thousandth."""
    import numpy as np
    ni, nj, nk = map(int, size.split("x"))
    radius = np.linspace(0.02, 1, ni, dtype="f4")[None, None, :]
    theta = np.linspace(0, 2 * np.pi, nj, dtype="f4")[None, :, None]
    phi = np.linspace(0, 2 * np.pi, nk, dtype="f4")[:, None, None]
    across, up = radius * np.cos(theta), 0.5 * radius * np.sin(theta)
    twist = 2 * phi
    away = 4 + across * np.cos(twist) - up * np.sin(twist)
    height = across * np.sin(twist) + up * np.cos(twist)
    noise = np.random.default_rng(1).normal(0, 1e-3, (nk, nj, ni))
    scalar = (1 - radius ** 2) * (1 + 0.3 * np.cos(3 * theta - 5 * phi)) + noise
    with open(grid.with_suffix(".xyz"), "wb") as file:
        np.array([ni, nj, nk], "<i4").tofile(file)
        for along in (away * np.cos(phi), away * np.sin(phi), height):
            along.astype("<f4").tofile(file)
    with open(grid.with_suffix(".fun"), "wb") as file:
        np.array([ni, nj, nk, 1], "<i4").tofile(file)
        scalar.astype("<f4").tofile(file)


def files_of(arguments, scene):
    """The grid's files, which are made if they are not there, and the name of what is made of them."""
    made = "generate" in scene or "torus" in scene
    name = scene["name"] + (f"_{arguments.nodes}" if arguments.nodes and made else "")
    if not made:
        return [arguments.data / file for file in scene["files"]], name
    grid = arguments.folder / name
    files = [grid.with_suffix(".xyz"), grid.with_suffix(".fun")]
    if all(file.exists() for file in files):
        return files, name
    if "torus" in scene:
        write_noisy_torus(grid, arguments.nodes or scene["torus"])
    else:
        words = list(scene["generate"])
        if arguments.nodes:
            words[words.index("--size") + 1] = arguments.nodes
        results.run([arguments.programs[-1], "generate", *words, "-o", grid])
    return files, name


def cache_of(arguments, scene):
    files, name = files_of(arguments, scene)
    cache = arguments.folder / f"{name}.splats"
    if not cache.exists():
        results.run([arguments.programs[-1], "convert", *files, "-o", cache, *scene.get("convert", [])])
    return cache


def convert(arguments, scene):
    """Prints a row. Returns the samples of each program: seconds and processor time."""
    files, name = files_of(arguments, scene)
    cache = arguments.folder / f"converted_{name}.splats"
    samples = [{"seconds": [], "processor": []} for _ in arguments.programs]
    for _ in range(arguments.repeats):
        for program, of_program in zip(arguments.programs, samples):
            shutil.rmtree(cache, ignore_errors=True)
            processor, begin = processor_seconds(), time.monotonic()
            results.run([program, "convert", *files, "-o", cache, *scene.get("convert", [])])
            of_program["seconds"].append(time.monotonic() - begin)
            of_program["processor"].append(processor_seconds() - processor)
    info = json.loads(subprocess.run([arguments.programs[-1], "info", cache, "--json"], check=True, capture_output=True).stdout)
    shutil.rmtree(cache)
    best = [{part: min(of_program[part]) for part in of_program} for of_program in samples]
    row = f"{scene['name']:15} {info['splats']:10} splats{best[-1]['seconds']:9.3f} s {best[-1]['processor']:9.3f} s of processors"
    row += f"{info['splats'] / best[-1]['seconds'] / 1e6:8.2f} M/s"
    if len(best) > 1:
        row += "   over the first's: " + ", ".join(f"{best[-1][part] / best[0][part]:.2f}" for part in best[0])
    print(row, flush=True)
    return samples


def draw(arguments, program, cache, words):
    """An orbit: seconds of the first frame, of the others and of the processor, a frame; its splats, and medians of its stages."""
    told = arguments.folder / "frames.json"
    before = processor_seconds()
    results.run([program, "render", cache, "-o", arguments.folder / "frame_%02d.pfm", "--stats", told, *words, "--orbit", "20",
                 "--frames", str(arguments.frames)])
    processor = processor_seconds() - before
    frames = json.loads(told.read_text())["frames"]
    seconds = [frame["seconds"]["total"] for frame in frames]
    stages = {stage: statistics.median(frame["seconds"][stage] for frame in frames[1:] or frames) for stage in STAGES}
    return (seconds[0], statistics.median(seconds[1:] or seconds), processor / len(frames)), frames[-1]["splats_drawn"], stages


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
            times, splats, stages = draw(arguments, program, cache, words)
            for part, seconds in zip(PARTS, times):
                of_program[part].append(seconds)
    best = [[min(of_program[part]) for part in PARTS] for of_program in samples]
    row = f"{scene['name']:15} {picture:8} {size:9} {backend:7} {splats:8} splats"
    row += "".join(f"{1e3 * seconds:9.1f}" for seconds in best[-1]) + " ms"
    if len(best) > 1:
        row += "   over the first's: " + ", ".join(f"{new / old:.2f}" for old, new in zip(best[0], best[-1]))
    print(row, flush=True)
    if arguments.stages:
        print("    " + ", ".join(f"{stage} {1e3 * seconds:.1f}" for stage, seconds in stages.items()) + " ms", flush=True)
    return samples


def add(out, ratios, name, part, of_programs):
    """Adds a part's samples, as the programs have them; `name` has a place for the part."""
    out.add(name.format(part), "s", of_programs[-1])
    ratios.setdefault(part, []).append(min(of_programs[-1]) / min(of_programs[0]))


def take_conversion(arguments, scene, out, ratios):
    samples = convert(arguments, scene)
    for part in samples[0]:
        add(out, ratios, f"conversions/{scene['name']}/{{}}", part, [one[part] for one in samples])


def take_frames(arguments, scene, out, ratios):
    for size in arguments.sizes.split(","):
        for backend in arguments.backends.split(","):
            for picture in scene.get("pictures", PICTURES):
                samples = measure(arguments, scene, picture, size, backend)
                for part in PARTS:
                    add(out, ratios, f"frames/{scene['name']}/{picture}/{{}}/size:{size}/backend:{backend}", part,
                        [one[part] for one in samples])


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
    parser.add_argument("--stages", action="store_true", help="prints the stages of a frame, too")
    parser.add_argument("--convert", action="store_true", help="times conversions instead of frames")
    parser.add_argument("--json")
    arguments = parser.parse_args()
    arguments.programs = arguments.programs.split(",") if arguments.programs else [arguments.program]
    arguments.folder.mkdir(parents=True, exist_ok=True)
    out, ratios = results.Results(), {}
    take = take_conversion if arguments.convert else take_frames
    if not arguments.convert:
        print(f"{'':57} first    orbit  processor (a frame)")
    for scene in json.loads((HERE / "frame_scenes.json").read_text()):
        if not re.search(arguments.scenes, scene["name"]):
            continue
        if "files" in scene and not arguments.data:
            out.leave_out(f"frames/{scene['name']}", "needs the real grids: --data")
            continue
        if "torus" in scene and not importlib.util.find_spec("numpy"):
            out.leave_out(f"frames/{scene['name']}", "needs numpy")
            continue
        take(arguments, scene, out, ratios)
    if len(arguments.programs) > 1:
        means = ", ".join(f"{part} {math.exp(statistics.fmean(map(math.log, of_part))):.3f}" for part, of_part in ratios.items())
        print(f"geometric means of the ratios: {means}")
    if arguments.json:
        out.write(arguments.json, "frame_times", results.version_of(arguments.programs[-1]))


if __name__ == "__main__":
    main()
