#!/usr/bin/env python3
"""Measures conversion and rendering at growing sizes: rates, bytes, first picture, frame, memory, and how each grows.

    bench/scaling.py FOLDER --nodes 1M,8M,64M [--json OUT.json] [--plot OUT.png]

Each size of the scene is generated in FOLDER and converted --conversions times. Caches and the measurements of their
conversions are kept there and reused, unless --again is given; grids are deleted. A conversion needs 16 bytes a node for the
grid and 67 for temporary files. Then each cache is drawn --repeats times with each error of --lod-pixels.

"cached" is the part of the grid's files that is in the page cache when a conversion starts, by mincore: they were just
written. A cache's files are evicted from the page cache before it is drawn ("cold", checked with mincore), the program's own
files are not. A conversion whose peak passes --convert-memory ends the script with status 1. "first" is the time from the
start of the process until a first, coarse picture is in its file, "frame" the time of the whole picture once the cache is
open. With --against ERROR, "against" is the PSNR of the whole picture against one with this error, in pixels. "peak" is the peak memory of the process, and "above" the part that a cache of
eight splats does not need: program, driver and image take the rest.
"""
import argparse
import json
import os
import pathlib
import re
import statistics
import sys

import page_cache
import results
from line_plot import exponent_of, trends_of, write_line_plots

SUFFIX = {"": 1, "K": 1000, "M": 1000**2, "G": 1000**3}
MIB = 2**20


def count_of(text):
    match = re.fullmatch(r"(\d+)([KMG]?)", text)
    if not match:
        raise argparse.ArgumentTypeError(f"'{text}' is not a number of nodes; expected one such as 64M")
    return int(match[1]) * SUFFIX[match[2]]


def bytes_of(text):
    match = re.fullmatch(r"(\d+)([KMG]?)", text)
    if not match:
        raise argparse.ArgumentTypeError(f"'{text}' is not a size; expected one such as 512M")
    return int(match[1]) * 1024 ** " KMG".index(match[2] or " ")


def counts_of(text):
    return [count_of(part) for part in text.split(",")]


def converted(arguments, edge, conversions):
    """Returns the cache of a cube of nodes, and the --stats of its conversions."""
    prefix = arguments.folder / f"{arguments.scene}_{edge}"
    cache, kept = prefix.with_suffix(".splats"), prefix.with_suffix(".conversions.json")
    if not arguments.again and kept.exists() and (cache / "manifest.json").exists():
        return cache, json.loads(kept.read_text())
    print(f"making {cache}", flush=True)
    results.run([arguments.program, "generate", arguments.scene, "--size", f"{edge}x{edge}x{edge}", "-o", prefix])
    grid = [prefix.with_suffix(ending) for ending in (".xyz", ".fun")]
    runs = []
    for _ in range(conversions):
        cached = sum(page_cache.cached_part(file) * file.stat().st_size for file in grid)
        statistics_file = prefix.with_suffix(".json")
        results.run([arguments.program, "convert", *grid, "-o", cache, "--overwrite", "--memory",
                     arguments.convert_memory, "--stats", statistics_file])
        runs.append(json.loads(statistics_file.read_text()))
        runs[-1]["cached"] = cached / sum(file.stat().st_size for file in grid)
        statistics_file.unlink()
    for ending in (".xyz", ".fun", ".nam"):
        prefix.with_suffix(ending).unlink(missing_ok=True)
    kept.write_text(json.dumps(runs, indent=1))
    return cache, runs


def psnr_text(arguments, picture, reference):
    return results.run([arguments.program, "compare", picture, reference]).split(",")[0].strip()


def finer_picture(arguments, cache):
    """The picture that others are compared with, or None."""
    if not arguments.against:
        return None
    picture = arguments.folder / "scaling_finer.pfm"
    results.run([arguments.program, "render", cache, "-o", picture, "--size", arguments.size, "--memory", arguments.memory,
                 "--lod-pixels", arguments.against])
    return picture


def drawn(arguments, cache, lod_pixels, finer):
    """Returns the --stats of one cold picture, with the PSNR of the first picture against it, and its own against `finer`."""
    output = arguments.folder / "scaling.pfm"  # 8 bits would bound the PSNR
    first = output.with_name("scaling_first.pfm")
    statistics_file = output.with_suffix(".json")
    still_there = page_cache.forget(cache)
    results.run([arguments.program, "render", cache, "-o", output, "--first-image", first, "--stats", statistics_file,
                 "--size", arguments.size, "--memory", arguments.memory, "--lod-pixels", lod_pixels])
    told = json.loads(statistics_file.read_text())
    told["cached"] = still_there
    told["first_against_whole"] = psnr_text(arguments, first, output)
    told["against_finer"] = psnr_text(arguments, output, finer) if finer else "-"
    for file in (output, first, statistics_file):
        file.unlink(missing_ok=True)
    return told


def measure(arguments, edge, out):
    """Measures one size; adds it to `out` and returns it as a row."""
    cache, conversions = converted(arguments, edge, arguments.conversions)
    nodes = conversions[0]["samples"]
    row = {"nodes": nodes, "size": f"{edge}x{edge}x{edge}", "conversion": conversions[-1], "pictures": {}}

    def add(name, unit, samples):
        out.add(f"scaling/{name}/nodes:{nodes}", unit, samples)

    add("convert", "nodes/s", [nodes / run["seconds"] for run in conversions])
    add("convert_peak", "B", [run["peak_memory_bytes"] for run in conversions])
    add("cache", "B", [conversions[-1]["cache_bytes"]])
    finer = finer_picture(arguments, cache)
    for lod_pixels in arguments.lod_pixels.split(","):
        runs = [drawn(arguments, cache, lod_pixels, finer) for _ in range(arguments.repeats)]
        row["pictures"][lod_pixels] = runs
        still_there = max(run["cached"] for run in runs)
        for what, keys in (("first", ["time_to_first_image_s"]), ("frame", ["frames", 0, "seconds", "total"])):
            if still_there == 0:
                add(f"{what}/error:{lod_pixels}px", "s", [value_of(run, keys) for run in runs])
            else:
                out.leave_out(f"scaling/{what}/error:{lod_pixels}px/nodes:{nodes}",
                              f"not cold: {100 * still_there:.0f} % of a file stayed in memory; use a folder on a disk")
        add(f"peak/error:{lod_pixels}px", "B", [run["peak_memory_bytes"] for run in runs])
    if finer:
        finer.unlink()
    return row


def value_of(told, keys):
    for key in keys:
        told = told[key]
    return told


def beyond_cap(rows, cap):
    """A line for each size whose conversion took more memory than it was given."""
    return [f"conversion of {row['nodes'] / 1e6:.3g} M nodes took {row['conversion']['peak_memory_bytes'] / MIB:.1f} MiB, more than "
            f"--convert-memory, {cap / MIB:.0f} MiB"
            for row in rows if row["conversion"]["peak_memory_bytes"] > cap]


def middle(runs, *keys):
    return statistics.median(value_of(run, keys) for run in runs)


def report_conversions(rows):
    print("\n| nodes | rate | seconds | scan, count | scatter, seams | build, finish | peak | temporary | cache | "
          "cached |\n|---|---|---|---|---|---|---|---|---|---|")
    for row in rows:
        run, nodes = row["conversion"], row["nodes"]
        of = {phase["name"]: phase["seconds"] for phase in run["phases"]}

        def both(a, b):
            return f"{of.get(a, 0):.1f} + {of.get(b, 0):.1f} s"

        print(f"| {nodes / 1e6:.3g} M | {nodes / run['seconds'] / 1e6:.2f} M nodes/s | {run['seconds']:.1f} "
              f"| {both('scan', 'count')} | {both('scatter', 'seams')} | {both('build', 'finish')} "
              f"| {run['peak_memory_bytes'] / MIB:.0f} MiB | {run['temporary_bytes'] / nodes:.1f} bytes a node "
              f"| {run['cache_bytes'] / nodes:.2f} bytes a node | {100 * run['cached']:.0f} % |")


def report_pictures(rows, base):
    print("\n| error | nodes | cache | first | it, against the whole | frame | against | splats | bricks | read | peak | above | "
          "the painter waited |\n|---|---|---|---|---|---|---|---|---|---|---|---|---|")
    for lod_pixels in rows[0]["pictures"]:
        for row in rows:
            runs = row["pictures"][lod_pixels]
            frame = runs[0]["frames"][0]
            peak, seconds = middle(runs, "peak_memory_bytes"), middle(runs, "frames", 0, "seconds", "total")
            waited = middle(runs, "frames", 0, "seconds", "painter_waited")
            print(f"| {lod_pixels} px | {row['nodes'] / 1e6:.3g} M | {row['conversion']['cache_bytes'] / MIB:.1f} MiB "
                  f"| {middle(runs, 'time_to_first_image_s'):.2f} s | {runs[0]['first_against_whole']} "
                  f"| {seconds:.2f} s | {runs[0]['against_finer']} | {frame['splats_drawn'] / 1e6:.2f} M | {frame['bricks_drawn']} "
                  f"| {frame['bytes_read'] / MIB:.1f} MiB | {peak / MIB:.0f} MiB "
                  f"| {(peak - middle(base['pictures'][lod_pixels], 'peak_memory_bytes')) / MIB:.0f} MiB "
                  f"| {100 * waited / seconds:.1f} % |")
    for lod_pixels, runs in base["pictures"].items():
        print(f"\neight nodes, {lod_pixels} px: {middle(runs, 'frames', 0, 'seconds', 'total'):.2f} s, "
              f"{middle(runs, 'peak_memory_bytes') / MIB:.0f} MiB")


def plots_of(rows):
    def line(of):
        return [(row["nodes"], of(row)) for row in rows]

    def lines(*keys):
        return {f"{lod_pixels} px": line(lambda row, lod_pixels=lod_pixels: middle(row["pictures"][lod_pixels], *keys))
                for lod_pixels in rows[0]["pictures"]}

    def plot(title, y_name, of):
        return {"title": title, "x_name": "nodes", "y_name": y_name, "log_values": True, "lines": of}

    return [plot("Conversion", "seconds", {"convert": line(lambda row: row["conversion"]["seconds"])}),
            plot("What a cache takes", "bytes", {"cache": line(lambda row: row["conversion"]["cache_bytes"])}),
            plot("First picture, cold", "seconds", lines("time_to_first_image_s")),
            plot("A frame, cold", "seconds", lines("frames", 0, "seconds", "total")),
            plot("Peak memory", "bytes", {"convert": line(lambda row: row["conversion"]["peak_memory_bytes"]),
                                          **lines("peak_memory_bytes")})]


def report_trends(plots):
    print("\n| grows as the nodes to the power of | |\n|---|---|")
    for plot in plots:
        for name, line in plot["lines"].items():
            print(f"| {plot['title']}: {name} | {exponent_of(line):.2f} |")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=pathlib.Path)
    parser.add_argument("--program", default="build/release/tools/curvisplat")
    parser.add_argument("--scene", default="wake")
    parser.add_argument("--nodes", default="1M,8M,64M", type=counts_of)
    parser.add_argument("--lod-pixels", default="1,2,3")
    parser.add_argument("--against", help="error of the picture that all are compared with, such as 0.4")
    parser.add_argument("--size", default="600x600")
    parser.add_argument("--memory", default="256M", help="--memory of pictures")
    parser.add_argument("--convert-memory", default="512M")
    parser.add_argument("--repeats", type=int, default=3, help="pictures of each cache with each error")
    parser.add_argument("--conversions", type=int, default=1, help="conversions of each size")
    parser.add_argument("--again", action="store_true", help="convert again what FOLDER already has")
    parser.add_argument("--json")
    parser.add_argument("--plot")
    arguments = parser.parse_args()
    os.makedirs(arguments.folder, exist_ok=True)
    edges = [round(nodes ** (1 / 3)) for nodes in arguments.nodes]

    out = results.Results()
    version = results.version_of(arguments.program)
    base = measure(arguments, 2, results.Results())
    rows = [measure(arguments, edge, out) for edge in edges]
    plots = plots_of(rows)
    report_conversions(rows)
    report_pictures(rows, base)
    if len(rows) > 1:
        report_trends(plots)
    for left in out.left_out:
        print(f"{left['name']}: {left['reason']}")
    if arguments.json:
        out.write(arguments.json, "scaling", version, words=vars(arguments) | {"folder": str(arguments.folder)},
                  base=base, sizes=rows)
    if arguments.plot:
        write_line_plots(arguments.program, arguments.plot,
                         [plot | {"lines": trends_of(plot["lines"])} for plot in plots])
    passed = beyond_cap(rows, bytes_of(arguments.convert_memory))
    for line in passed:
        print(line)
    return 1 if passed else 0


if __name__ == "__main__":
    sys.exit(main())
