#!/usr/bin/env python3
"""Rendering at a fixed view and error from caches of growing size: time, splats, bytes, first picture, memory.

    bench/stream_scaling.py FOLDER [--program build/release/tools/curvisplat] [--scene wake]
                            [--nodes 1M,8M,64M] [--large] [--lod-pixels 1,2,3] [--max-splats N]
                            [--size 600x600] [--memory 256M] [--repeats 3] [--json OUT.json] [--plot OUT.svg]

Generates and converts the scene in FOLDER (caches are kept there and used again, grids are not; --large adds 512 M
nodes: 8 GB of grid while it is converted). Each size is rendered --repeats times with each error of --lod-pixels; the
tables have medians, the plot has a line for each error.
"first" is the time from the start of the process to a first, coarse picture in a file; the cache's files were put out
of the page cache before ("cold"), the program's own were not. "frame" is the whole picture after that. "peak" is the
largest memory of the process (VmHWM), and "above" what of it is more than with a cache of a few splats: program,
driver and image take the rest.
"""

import argparse
import json
import os
import shutil
import statistics
import subprocess
import sys

from convert_scaling import count_of, run
from line_plot import write_line_plot


def convert(arguments, name, size):
    """The cache of the scene at `size`; made if it is not there."""
    prefix = os.path.join(arguments.folder, name)
    cache = prefix + ".splats"
    if not os.path.exists(os.path.join(cache, "manifest.json")):
        print(f"making {cache}", file=sys.stderr)
        run([arguments.program, "generate", arguments.scene, "--size", size, "-o", prefix])
        run([arguments.program, "convert", prefix + ".xyz", prefix + ".fun", "-o", cache])
        for ending in (".xyz", ".fun", ".nam"):
            if os.path.exists(prefix + ending):
                os.remove(prefix + ending)
    return cache


def forget(cache):
    """Puts a cache's files out of the page cache."""
    for entry in os.scandir(cache):
        descriptor = os.open(entry.path, os.O_RDONLY)
        try:
            os.fsync(descriptor)  # pages that are not yet written stay
            os.posix_fadvise(descriptor, 0, 0, os.POSIX_FADV_DONTNEED)
        finally:
            os.close(descriptor)


def render(arguments, cache, lod_pixels):
    """One run's --stats."""
    output = os.path.join(arguments.folder, "stream_scaling")
    forget(cache)
    command = [arguments.program, "render", cache, "-o", output + ".png", "--first-image", output + "_first.png",
               "--stats", output + ".json", "--size", arguments.size, "--memory", arguments.memory,
               "--lod-pixels", lod_pixels]
    if arguments.max_splats:
        command += ["--max-splats", arguments.max_splats]
    run(command)
    with open(output + ".json") as file:
        result = json.load(file)
    compared = subprocess.run([arguments.program, "compare", output + "_first.png", output + ".png"],
                              capture_output=True, text=True)
    result["first_image_against_final"] = compared.stdout.strip() or compared.stderr.strip()
    return result


def median(results, *keys):
    values = []
    for result in results:
        for key in keys:
            result = result[key]
        values.append(result)
    return statistics.median(values)


def measure(arguments, name, size, lod_pixels):
    cache = convert(arguments, name, size)
    with open(os.path.join(cache, "manifest.json")) as file:
        nodes = json.load(file)["nodes"]
    runs = [render(arguments, cache, lod_pixels) for _ in range(arguments.repeats)]
    return {
        "size": size,
        "nodes": nodes,
        "cache_bytes": sum(entry.stat().st_size for entry in os.scandir(cache)),
        "first_image_s": median(runs, "time_to_first_image_s"),
        "first_image_against_final": runs[-1]["first_image_against_final"],
        "frame_s": median(runs, "frames", 0, "seconds", "total"),
        "seconds": {stage: median(runs, "frames", 0, "seconds", stage) for stage in runs[0]["frames"][0]["seconds"]},
        "splats_drawn": runs[0]["frames"][0]["splats_drawn"],
        "bricks_drawn": runs[0]["frames"][0]["bricks_drawn"],
        "bytes_read": runs[0]["frames"][0]["bytes_read"],
        "peak_memory_bytes": median(runs, "peak_memory_bytes"),
        "backend": runs[0]["backend"],
    }


def report(results, baseline, lod_pixels):
    print(f"\n{lod_pixels} pixels of error, {results[0]['backend']}")
    print(f"{'nodes':>12} {'cache MiB':>10} {'first s':>8} {'frame s':>8} {'M splats':>9} {'bricks':>7} "
          f"{'read MiB':>9} {'peak MiB':>9} {'above MiB':>10}")
    for result in [baseline] + results:
        above = result["peak_memory_bytes"] - baseline["peak_memory_bytes"]
        print(f"{result['nodes']:>12} {result['cache_bytes'] / 2**20:>10.1f} {result['first_image_s']:>8.2f} "
              f"{result['frame_s']:>8.2f} {result['splats_drawn'] / 1e6:>9.3f} {result['bricks_drawn']:>7} "
              f"{result['bytes_read'] / 2**20:>9.2f} {result['peak_memory_bytes'] / 2**20:>9.1f} {above / 2**20:>10.1f}")
    print("\nseconds of each stage; of workers, summed over them")
    stages = list(results[0]["seconds"])
    print(f"{'nodes':>12} " + " ".join(f"{stage:>14}" for stage in stages))
    for result in results:
        print(f"{result['nodes']:>12} " + " ".join(f"{result['seconds'][stage]:>14.4f}" for stage in stages))
    print()
    for before, after in zip(results, results[1:]):
        print(f"frame at {after['size']} / frame at {before['size']}: {after['frame_s'] / before['frame_s']:.2f}")
    for result in results:
        print(f"first picture at {result['size']} against the whole one: {result['first_image_against_final']}")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder")
    parser.add_argument("--program", default="build/release/tools/curvisplat")
    parser.add_argument("--scene", default="wake")
    parser.add_argument("--nodes", default="1M,8M,64M")
    parser.add_argument("--large", action="store_true", help="512 M nodes as well")
    parser.add_argument("--lod-pixels", default="1,2,3")
    parser.add_argument("--max-splats")
    parser.add_argument("--size", default="600x600")
    parser.add_argument("--memory", default="256M")
    parser.add_argument("--repeats", type=int, default=3)
    parser.add_argument("--json")
    parser.add_argument("--plot")
    arguments = parser.parse_args()
    os.makedirs(arguments.folder, exist_ok=True)
    if shutil.which(arguments.program) is None:
        sys.exit(f"{arguments.program}: is no program; build it, or give --program")

    edges = [round(count_of(nodes) ** (1 / 3)) for nodes in arguments.nodes.split(",")]
    if arguments.large:
        edges.append(800)
    all_results, lines = {}, {}
    for lod_pixels in arguments.lod_pixels.split(","):
        baseline = measure(arguments, f"{arguments.scene}_tiny", "2x2x2", lod_pixels)
        results = [measure(arguments, f"{arguments.scene}_{edge}", f"{edge}x{edge}x{edge}", lod_pixels) for edge in edges]
        report(results, baseline, lod_pixels)
        all_results[lod_pixels] = {"baseline": baseline, "sizes": results}
        lines[f"{lod_pixels} px of error"] = [(result["nodes"], result["frame_s"]) for result in results]
    if arguments.json:
        with open(arguments.json, "w") as file:
            json.dump(all_results, file, indent=1)
    if arguments.plot:
        write_line_plot(arguments.plot, lines, "nodes in the cache", "seconds a frame, cold")


if __name__ == "__main__":
    main()
