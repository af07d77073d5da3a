#!/usr/bin/env python3
"""On a graphics card: whether its pictures are the processor's; then frames of many splats in large pictures, stage by stage, beside
the processor's painter with all cores, and the conversions that they need.

    bench/card_frames.py FOLDER [--sizes 1M,10M,50M] [--pictures 1920x1080,3840x2160] [--backends egl,egl-quads,cpu]
                         [--software] [--frames 5] [--threads N] [--json OUT.json] [--program BUNDLE/bin/curvisplat]
    bench/card_frames.py FOLDER --counts [--sizes 1M] [--grid FILE,FILE,...]   # what a card has to do, counted on any OpenGL 4.3
    bench/card_frames.py FOLDER --quick     # tiny sizes, OpenGL in software: a minute

It needs Python alone and the program, which tools/packaging/bundle.sh brings with its libraries to a machine that has neither. It
prints as it goes and begins with what matters most, so that little is lost where its time ends early.

First, for each backend but the processor's, pictures of a small scene with light, cuts, surfaces, slices, isosurfaces and two scalars:
the PSNR beside the processor's picture, and whether a second run has the same bits. It ends with status 1 where one is below 60 dB.

The half-annulus scene is generated in FOLDER with a node for each splat, and drawn at the finest level with one opacity everywhere, so
that no splat is left out as transparent and none as hidden: every backend draws the same ones. 50 M nodes need 4 GB of FOLDER's disk
while they are converted, and their pictures may use 10 GB of memory.

Two frames of an orbit come first, so that bricks are decoded and buffers exist. The camera moves a little between the frames after
them, of which medians are printed, from the program's own --stats:

    frame      the whole frame
    workers    the sum of what threads take to project and sort
    upload     of the drawing thread; 0 where workers write into memory that OpenGL reads
    draw       of the drawing thread
    OpenGL's   by OpenGL's own clock, without waiting for splats; says little where it draws in software
    x cpu      the frame, divided by the one of the processor's painter

and below a row in compute shaders, of one frame: the parts of OpenGL's time; splats of bricks that stay on the card; splats in tiles (entries), and the bytes of memory that
these take on paper: 32 an entry, which is written, sorted and read; 64 a splat to send it, and twice to read it. Each entry is looked at by the pixels of its tile, 16 where splats lean.

With --counts nothing is timed: a frame of the wake of 1 M nodes and one of the half-annulus for each of --sizes (1M), all splats drawn,
and the default picture of the grid, if one is given, are counted at 1920x1080: splats drawn (with the pieces of those at borders), keys
sorted (a splat in a tile), how often a pixel looks at a splat of its tile's list, and how often it blends one. Nothing is blended, which
in software would take hours: so nothing is opaque either, and what hides is counted in full. From these:

    project    GB: reads 68 bytes a stored splat, writes 64 a drawn one
    list       reads those twice, writes 8 bytes a key; sort: reads and writes the keys
    paint      reads 8 bytes of a key and 64 of its splat: tiles have 4x4 pixels where bricks are stored, all in one work group
    picture    windows of depth, read and written once: 32 bytes a pixel; made into 8 bits: 20
    least      milliseconds that an H200 takes for these bytes at 4.8 TB/s, and for the arithmetic (LOOK operations to look, BLEND to
               blend, counted in the shader by hand) at 67 TFLOP/s: NVIDIA's figures. No card reaches either: it is a bound

A backend that cannot be had is left out, and so is one that draws in software, unless --software is given.
"""
import argparse
import json
import os
import pathlib
import re
import statistics
import sys
import time

import results
from scaling import count_of

# An H200's memory and arithmetic, as NVIDIA publishes them, and what a pixel does in render/gl/splat_shader.cpp.
BYTES_PER_S, OPERATIONS_PER_S = 4.8e12, 67e12
LOOK, BLEND = 12, 160
HERE = pathlib.Path(__file__).resolve().parent
MIB = 2**20
WARM_UP = 2
SOFTWARE = ("llvmpipe", "softpipe", "SWR", "SwiftShader", "Software")  # as render/gl/gl_context.cpp
# What is measured, as sums of fields of --stats: of OpenGL alone, and of all backends.
OF_GL = {"upload": ["upload"], "gl_draw": ["gl_draw"]}
PARTS = {"project": ["gl_project"], "list": ["gl_list"], "sort": ["gl_sort"], "paint": ["gl_paint"]}  # in compute shaders
OF_ALL = {"frame": ["total"], "draw": ["draw"], "workers": ["project", "sort"]}


def usable_backends(arguments, out):
    """Those that are asked for and can be had; prints why others are left out."""
    found = {one["name"]: one for one in json.loads(results.run([arguments.program, "info", "--system", "--json"]))["backends"]}
    usable = []
    for backend in arguments.backends.split(","):
        one = found.get(backend)
        if one is None:
            raise SystemExit(f"--backends: '{backend}' is unknown; expected some of {', '.join(found)}")
        reason = None
        if not one["works"]:
            reason = one["found"]
        elif any(name in one["found"] for name in SOFTWARE) and not arguments.software:
            reason = f"draws in software ({one['found']}); give --software to measure it all the same"
        if reason:
            print(f"{backend}: left out: {reason}", flush=True)
            out.leave_out(f"card_frames/backend:{backend}", reason)
        else:
            usable.append(backend)
    return usable


# What a picture may have, each with what makes it different from the plain one.
FEATURES = {"plain": [], "perspective": ["--view-angle", 40], "light": ["--shade"], "opaque": ["--opacity-unit", 0.02],
            "clip planes": ["--clip-plane=2,0,2,1,0.3,0.2", "--clip-plane=2,0,2,0,-0.4,1"],
            "surfaces": ["--surface", "kmin,jmax", "--surface-opacity", 0.4], "slices": ["--slice=2,0,2,0.3,1,0.2", "--slice-opacity", 0.5],
            "isosurfaces": ["--iso", "0.3,0.6", "--iso-opacity", 0.5],
            "two scalars": ["--scalar", "jacobian", "--opacity-by", "f", "--opacity-range", "0,1"]}
LEAST_DB = 60


def compared(arguments, a, b):
    said = results.run([arguments.program, "compare", a, b])
    found = re.search(r"PSNR (\S+) dB", said)
    return float(found[1]) if found else float("inf")


def check_pictures(arguments, backends, out):
    """Prints how like the processor's pictures those of the backends are. Returns whether all are like enough."""
    size = "24x16x12" if arguments.quick else "128x96x64"
    wake = arguments.folder / f"wake_{size}"
    cache = wake.with_suffix(".splats")
    if not (cache / "manifest.json").exists():
        results.run([arguments.program, "generate", "wake", "--size", size, "-o", wake])
        results.run([arguments.program, "convert", f"{wake}.xyz", f"{wake}.fun", "-o", cache, "--overwrite", "--scalar", "f,jacobian"])
    picture = "80x60" if arguments.quick else "1920x1080"
    # Software keeps no bricks without being asked.
    stored = ["--card-memory", "64M"] if arguments.software else []

    def draw(backend, name, options):
        file = arguments.folder / f"{name}.pfm"
        results.run([arguments.program, "render", cache, "-o", file, "--backend", backend, "--size", picture, "--range", "0,1", "--view",
                     "iso", "--background", "white", "--memory", "2G", *stored, *options])
        return file

    good = True
    print("| picture | " + " | ".join(backends) + " |\n|---|" + "---|" * len(backends))
    for name, options in FEATURES.items():
        truth, cells = draw("cpu", "cpu", options), []
        for backend in backends:
            once, again = draw(backend, "once", options), draw(backend, "again", options)
            db, same = compared(arguments, truth, once), once.read_bytes() == again.read_bytes()
            good &= db >= LEAST_DB and same
            cells.append(f"{db:.1f} dB" + ("" if same else ", NOT THE SAME BITS") + ("" if db >= LEAST_DB else ", TOO FEW"))
            if db != float("inf"):
                out.add(f"card_frames/pictures/{name}/backend:{backend}", "dB", [db])
        print(f"| {name} | " + " | ".join(cells) + " |", flush=True)
    print()
    return good


def cache_of(arguments, splats, out):
    edge = round(splats ** (1 / 3))
    grid = arguments.folder / f"half_annulus_{edge}"
    cache = grid.with_suffix(".splats")
    if not (cache / "manifest.json").exists():
        print(f"making {cache}", flush=True)
        results.run([arguments.program, "generate", "half-annulus", "--size", f"{edge}x{edge}x{edge}", "-o", grid])
        began = time.monotonic()
        results.run([arguments.program, "convert", f"{grid}.xyz", f"{grid}.fun", "-o", cache, "--refine", "1", "--overwrite"])
        took = time.monotonic() - began
        print(f"converted: {edge**3} nodes in {took:.2f} s, {results.three_digits(1e-6 * edge**3 / took)} M/s", flush=True)
        out.add(f"card_frames/convert/nodes:{edge**3}", "s", [took])
        for ending in (".xyz", ".fun", ".nam"):
            grid.with_suffix(ending).unlink(missing_ok=True)
    return cache


def frames_of(arguments, cache, splats, picture, backend):
    """The --stats of the frames after the first ones."""
    told, pictures = arguments.folder / "card.json", arguments.folder / "card_%02d.png"
    frames = WARM_UP + arguments.frames
    threads = ["--threads", arguments.threads] if arguments.threads else []
    results.run([arguments.program, "render", cache, "-o", pictures, "--stats", told, "--backend", backend, "--size", picture,
                 "--lod-pixels", 0, "--classify", "pixel", "--view", "iso", "--tf", "viridis", "--range", "0,1", "--opacity",
                 "0:0.02,1:0.02", "--opacity-unit", 0.03, "--orbit", 0.01 * frames, "--frames", frames,
                 "--memory", f"{1024 + 192 * splats // MIB}M", *threads])
    frames = json.loads(told.read_text())["frames"][WARM_UP:]
    for file in (told, *arguments.folder.glob("card_*.png")):
        file.unlink()
    return frames


def print_work(frame, median):
    entries, splats = frame["card_entries"], frame["splats_drawn"]
    gigabytes = 1e-9 * (32 * entries + 192 * splats)
    parts = ", ".join(f"{name} {1e3 * median[name]:.1f} ms" for name in PARTS)
    print(f"  {parts}; {frame['card_splats']} splats of stored bricks, {entries} entries, {results.three_digits(gigabytes)} GB on paper; "
          f"{frame['card_peak_bytes'] / MIB:.0f} MiB of the card", flush=True)


def measure(arguments, size, picture, backend, cpu_s, out):
    """Prints a row. Returns the median time of a frame."""
    frames = frames_of(arguments, cache_of(arguments, count_of(size), out), count_of(size), picture, backend)
    median = {}
    in_tiles = frames[0]["card_entries"] > 0
    of_backend = OF_ALL if backend == "cpu" else OF_ALL | OF_GL | (PARTS if in_tiles else {})
    for name, fields in of_backend.items():
        samples = [sum(frame["seconds"][field] for field in fields) for frame in frames]
        median[name] = statistics.median(samples)
        out.add(f"card_frames/{name}/splats:{size}/picture:{picture}/backend:{backend}", "s", samples)
    splats = frames[0]["splats_drawn"]
    width, height = map(int, picture.split("x"))

    def rate(count):
        return results.three_digits(1e-6 * count / median["frame"])

    times = [f"{1e3 * median[name]:.1f} ms" if name in median else "" for name in ("frame", "workers", "upload", "draw", "gl_draw")]
    factor = "" if cpu_s is None else results.three_digits(median["frame"] / cpu_s)
    print(f"| {splats} | {picture} | {backend} | {' | '.join(times)} | {rate(splats)} | {rate(width * height)} | {factor} |", flush=True)
    if in_tiles:
        print_work(frames[-1], median)
        for name in ("card_entries", "card_peak_bytes"):
            out.add(f"card_frames/{name}/splats:{size}/picture:{picture}/backend:{backend}", "1", [frames[-1][name]])
    if any(frame["bricks_read"] for frame in frames):
        print("note: bricks were read again: the times of this row include it", flush=True)
    return median["frame"]


def wake_of(arguments, size):
    wake = arguments.folder / f"wake_{size}"
    cache = wake.with_suffix(".splats")
    if not (cache / "manifest.json").exists():
        results.run([arguments.program, "generate", "wake", "--size", size, "-o", wake])
        results.run([arguments.program, "convert", f"{wake}.xyz", f"{wake}.fun", "-o", cache, "--overwrite"])
    return cache


def grid_of(arguments):
    files = arguments.grid.split(",")
    cache = arguments.folder / f"{pathlib.Path(files[0]).stem}.splats"
    if not (cache / "manifest.json").exists():
        results.run([arguments.program, "convert", *files, "-o", cache, "--overwrite"])
    return cache


def gigabytes_of(frame, pixels):
    """What a frame moves on paper, by stage."""
    entries, elements = frame["card_entries"], frame["splats_drawn"]
    return {"project": 1e-9 * (68 * frame["card_splats"] + 64 * elements), "list": 1e-9 * (128 * elements + 8 * entries),
            "sort": 1e-9 * 16 * entries, "paint": 1e-9 * 72 * entries, "picture": 1e-9 * 52 * pixels}


def count(arguments, out):
    """Prints what cards have to do for a few pictures."""
    picture = "160x90" if arguments.quick else "1920x1080"
    width, height = map(int, picture.split("x"))
    plain = ["--lod-pixels", 0, "--classify", "pixel", "--view", "iso", "--tf", "viridis", "--range", "0,1", "--opacity", "0:0.02,1:0.02",
             "--opacity-unit", 0.03]
    edge = "24x16x12" if arguments.quick else "100x100x100"
    scenes = [("wake", wake_of(arguments, edge), plain)]
    scenes += [(f"half-annulus, {size}", cache_of(arguments, count_of(size), out), plain) for size in arguments.sizes.split(",")]
    if arguments.grid:
        scenes.append((pathlib.Path(arguments.grid.split(",")[0]).name, grid_of(arguments), []))
    print(f"| {picture} | splats | keys sorted | pixels look | pixels blend | GB: project, list, sort, paint, picture | least, ms: bytes, arithmetic |\n"
          "|---|---|---|---|---|---|---|")
    told = arguments.folder / "counts.json"
    for name, cache, options in scenes:
        results.run([arguments.program, "render", cache, "-o", arguments.folder / "counted.pfm", "--stats", told, "--backend", "egl",
                     "--card-memory", "4G", "--size", picture, "--memory", "2G", *options], env=os.environ | {"CURVISPLAT_COUNT_PIXELS": "alone"})
        frame = json.loads(told.read_text())["frames"][0]
        if not frame["card_pixels_listed"]:
            sys.exit(f"{name}: no compute shaders drew it; see {arguments.program} info --system")
        moved = gigabytes_of(frame, width * height)
        looks, blends = frame["card_pixels_listed"], frame["card_pixels_blended"]
        bytes_ms = 1e3 * sum(moved.values()) * 1e9 / BYTES_PER_S
        arithmetic_ms = 1e3 * (LOOK * looks + BLEND * blends) / OPERATIONS_PER_S
        digits = results.three_digits
        print(f"| {name} | {digits(1e-6 * frame['splats_drawn'])} M | {digits(1e-6 * frame['card_entries'])} M | {digits(1e-6 * looks)} M | "
              f"{digits(1e-6 * blends)} M | {', '.join(digits(part) for part in moved.values())} | {digits(bytes_ms)}, {digits(arithmetic_ms)} |",
              flush=True)
        for field in ("card_entries", "card_pixels_listed", "card_pixels_blended"):
            out.add(f"card_frames/{field}/scene:{name}", "1", [frame[field]])


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=pathlib.Path)
    parser.add_argument("--sizes", help="numbers of splats (1M,10M,50M)")
    parser.add_argument("--pictures", help="(1920x1080,3840x2160)")
    parser.add_argument("--backends", default="egl,egl-quads,cpu")
    parser.add_argument("--software", action="store_true", help="measure OpenGL that draws in software, too")
    parser.add_argument("--frames", type=int, help="frames that are measured, after two that are not (5)")
    parser.add_argument("--threads", type=int)
    parser.add_argument("--program", default=HERE.parent / "build/release/tools/curvisplat")
    parser.add_argument("--json")
    parser.add_argument("--counts", action="store_true", help="count what a frame takes, and time nothing")
    parser.add_argument("--grid", help="files of a real grid, for --counts")
    parser.add_argument("--quick", action="store_true", help="tiny sizes, in software, too")
    arguments = parser.parse_args()
    quick = arguments.quick
    arguments.software |= quick
    arguments.sizes = arguments.sizes or ("8K,60K" if quick else "1M" if arguments.counts else "1M,10M,50M")
    arguments.pictures = arguments.pictures or ("320x180" if quick else "1920x1080,3840x2160")
    arguments.frames = arguments.frames or (2 if quick else 5)
    arguments.folder.mkdir(parents=True, exist_ok=True)
    out = results.Results()
    if arguments.counts:
        count(arguments, out)
        if arguments.json:
            out.write(arguments.json, "card_frames", results.version_of(arguments.program))
        return
    # The processor's painter first, since the others are compared with it.
    backends = sorted(usable_backends(arguments, out), key=lambda backend: backend != "cpu")
    beside = [backend for backend in backends if backend != "cpu"]
    good = not beside or check_pictures(arguments, beside, out)
    print("| splats | picture | backend | frame | workers | upload | draw | OpenGL's | M splats/s | megapixels/s | x cpu |\n"
          "|---|---|---|---|---|---|---|---|---|---|---|")
    for size in arguments.sizes.split(","):
        for picture in arguments.pictures.split(","):
            cpu_s = None
            for backend in backends:
                frame_s = measure(arguments, size, picture, backend, cpu_s, out)
                cpu_s = frame_s if backend == "cpu" else cpu_s
    if arguments.json:
        out.write(arguments.json, "card_frames", results.version_of(arguments.program))
    if not good:
        raise SystemExit(f"pictures differ: from the processor's, with less than {LEAST_DB} dB, or from run to run")


if __name__ == "__main__":
    main()
