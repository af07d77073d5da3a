#!/usr/bin/env python3
"""Times whole frames of the scenes in frame_scenes.json, each backend in turn.

    bench/frame_times.py FOLDER [--scene NAME] [--repeats 8] [--backends cpu,osmesa] [--threads N] [--json OUT.json]

A scene states how its cache is made and how it is drawn. Caches are made once, in FOLDER; scenes with "grid" need the
named files there. Prints the shortest and the median frame, from the program's own --stats, and the smallest processor
time of the whole program, including its start.
"""
import argparse
import json
import pathlib
import resource
import statistics

import results

HERE = pathlib.Path(__file__).resolve().parent


def run(*command):
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    results.run(command)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def cache_of(program, scene, folder, nodes):
    cache = folder / (f"{scene['name']}_{nodes}.splats" if nodes else f"{scene['name']}.splats")
    if cache.exists():
        return cache
    if "generate" in scene:
        grid = folder / scene["name"]
        words = list(scene["generate"])
        if nodes:
            words[words.index("--size") + 1] = nodes
        run(program, "generate", *words, "-o", grid)
        files = [grid.with_suffix(".xyz"), grid.with_suffix(".fun")]
    else:
        files = [folder / name for name in scene["grid"]]
    run(program, "convert", *files, "-o", cache, *scene.get("convert", []))
    return cache


def measure(arguments, scene, backend, out):
    cache, told = cache_of(arguments.program, scene, arguments.folder, arguments.nodes), arguments.folder / "frame.json"
    threads = ["--threads", arguments.threads] if arguments.threads else []
    seconds, processor = [], []
    for _ in range(arguments.repeats):
        processor.append(run(arguments.program, "render", cache, "-o", arguments.folder / "frame.pfm", "--stats", told,
                             "--backend", backend, *scene["render"], *threads))
        frame = json.loads(told.read_text())["frames"][0]
        seconds.append(frame["seconds"]["total"])
    print(f"{scene['name']:12} {backend:7} {frame['splats_drawn']:10} splats {1e3 * min(seconds):8.1f} ms "
          f"(median {1e3 * statistics.median(seconds):.1f}), processor {1e3 * min(processor):.0f} ms", flush=True)
    out.add(f"frames/{scene['name']}/backend:{backend}", "s", seconds)
    out.add(f"frames/{scene['name']}/processor/backend:{backend}", "s", processor)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=pathlib.Path)
    parser.add_argument("--program", default=HERE.parent / "build/release/tools/curvisplat")
    parser.add_argument("--scene")
    parser.add_argument("--nodes", help="NIxNJxNK of generated grids, instead of the scenes' own")
    parser.add_argument("--repeats", type=int, default=8)
    parser.add_argument("--backends", default="cpu,osmesa")
    parser.add_argument("--threads", type=int)
    parser.add_argument("--json")
    arguments = parser.parse_args()
    arguments.folder.mkdir(parents=True, exist_ok=True)
    out = results.Results()
    for scene in json.loads((HERE / "frame_scenes.json").read_text()):
        if arguments.scene and scene["name"] != arguments.scene:
            continue
        if not all((arguments.folder / name).exists() for name in scene.get("grid", [])):
            reason = f"{' and '.join(scene['grid'])} are not in {arguments.folder}"
            print(f"{scene['name']}: {reason}")
            out.leave_out(f"frames/{scene['name']}", reason)
            continue
        for backend in arguments.backends.split(","):
            measure(arguments, scene, backend, out)
    if arguments.json:
        out.write(arguments.json, "frame_times", results.version_of(arguments.program))


if __name__ == "__main__":
    main()
