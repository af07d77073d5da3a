#!/usr/bin/env python3
"""Times frames of many splats in large pictures: OpenGL's upload and drawing apart, beside the processor's painter.

    bench/card_frames.py FOLDER [--sizes 1M,10M,50M] [--pictures 1920x1080,3840x2160] [--backends egl,osmesa,cpu]
                         [--software] [--frames 5] [--threads N] [--json OUT.json]

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

A backend that cannot be had is left out, and so is one that draws in software, unless --software is given.
"""
import argparse
import json
import pathlib
import statistics

import results
from scaling import count_of

HERE = pathlib.Path(__file__).resolve().parent
MIB = 2**20
WARM_UP = 2
SOFTWARE = ("llvmpipe", "softpipe", "SWR", "SwiftShader", "Software")  # as render/gl/gl_context.cpp
# What is measured, as sums of fields of --stats: of OpenGL alone, and of all backends.
OF_GL = {"upload": ["upload"], "gl_draw": ["gl_draw"]}
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


def cache_of(arguments, splats):
    edge = round(splats ** (1 / 3))
    grid = arguments.folder / f"half_annulus_{edge}"
    cache = grid.with_suffix(".splats")
    if not (cache / "manifest.json").exists():
        print(f"making {cache}", flush=True)
        results.run([arguments.program, "generate", "half-annulus", "--size", f"{edge}x{edge}x{edge}", "-o", grid])
        results.run([arguments.program, "convert", f"{grid}.xyz", f"{grid}.fun", "-o", cache, "--overwrite"])
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


def measure(arguments, size, picture, backend, cpu_s, out):
    """Prints a row. Returns the median time of a frame."""
    frames = frames_of(arguments, cache_of(arguments, count_of(size)), count_of(size), picture, backend)
    median = {}
    for name, fields in (OF_ALL if backend == "cpu" else OF_ALL | OF_GL).items():
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
    if any(frame["bricks_read"] for frame in frames):
        print("note: bricks were read again: the times of this row include it", flush=True)
    return median["frame"]


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=pathlib.Path)
    parser.add_argument("--sizes", default="1M,10M,50M", help="numbers of splats")
    parser.add_argument("--pictures", default="1920x1080,3840x2160")
    parser.add_argument("--backends", default="egl,osmesa,cpu")
    parser.add_argument("--software", action="store_true", help="measure OpenGL that draws in software, too")
    parser.add_argument("--frames", type=int, default=5, help="frames that are measured, after two that are not")
    parser.add_argument("--threads", type=int)
    parser.add_argument("--program", default=HERE.parent / "build/release/tools/curvisplat")
    parser.add_argument("--json")
    arguments = parser.parse_args()
    arguments.folder.mkdir(parents=True, exist_ok=True)
    out = results.Results()
    # The processor's painter first, since the others are compared with it.
    backends = sorted(usable_backends(arguments, out), key=lambda backend: backend != "cpu")
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


if __name__ == "__main__":
    main()
