#!/usr/bin/env python3
"""Runs all of bench/: in short (five to ten minutes on two cores), or as a smoke test.

    bench/run.py FOLDER [--smoke] [--only STEP,...] [--without STEP,...] [--fin GRID SOLUTION]

Each step writes FOLDER/STEP.json, its output to FOLDER/STEP.log, and plots; FOLDER/all.json has all measurements, for
bench/compare.py. Caches, grids and reference pictures stay in FOLDER and are reused. A step's JSON lists what could not be
measured, with the reason. The smoke test uses tiny sizes: it shows that the benchmarks work, its figures mean nothing.

Exit status 1 if a step fails or writes no valid measurements; the other steps are still run. The whole should end within ten minutes
on two idle cores: a line at the end warns if it took longer.
"""
import argparse
import json
import os
import pathlib
import subprocess
import sys
import time

import results

HERE = pathlib.Path(__file__).resolve().parent
MOST_SECONDS = 600


class Form:
    """Arguments of the short form."""
    micro = ["--benchmark_min_time=0.05", "--benchmark_repetitions=3"]
    bench = []
    micro_cache = False  # verify, decode and project make a half annulus of 2 M nodes
    cache = "200x200x200"
    convert_nodes = "8M"
    scaling = ["--nodes", "1M,8M", "--repeats", "3"]
    peers = ["--sizes", "40x32x32,100x100x100", "--frames", "3", "--seconds", "15"]
    fidelity = ["--only", "^(half-annulus 2.5|o-grid|shell)$", "--quick"]
    frames = ["--repeats", "3", "--scenes", "^(wake|half_annulus|ocean)"]


class SmokeForm(Form):
    # Of each benchmark its least form.
    micro = ["--benchmark_min_time=0.000001",
             "--benchmark_filter=-plainReader|pager|radius:[248]/|kind:[12]|million:(3|30|100|1000000)$|openIndex|makePlanner|lod_pixels:[14]|"
             "lines:1000?/|side:(256|1024)|threads:2|blank_every:1001|perspective:1|readVts/(raw_|base64)|netcdf4$|readSingle|readDoubleNative|"
             "splats:(512|65536)|workers:[24]"]
    bench = ["--size", "64x64", "--lod-pixels", "2", "--backend", "cpu"]
    micro_cache = True  # they use the cache of the step "bench"
    cache = "32x32x32"
    convert_nodes = "30K"
    scaling = ["--nodes", "4K,30K", "--repeats", "1", "--lod-pixels", "2", "--size", "64x64"]
    peers = ["--sizes", "12x10x8", "--frames", "1", "--picture", "32x32", "--resample", "16"]
    fidelity = ["--only", "^shell$", "--quick", "--pixels", "16"]
    frames = ["--repeats", "1", "--frames", "2", "--sizes", "64x64", "--nodes", "16x16x16"]


def cache_commands(paths, form):
    """Commands that make the cache of the wake, unless it exists."""
    if (paths.cache / "manifest.json").exists():
        return []
    grid = paths.cache.with_suffix("")
    return [[paths.program, "generate", "wake", "--size", form.cache, "-o", grid],
            [paths.program, "convert", f"{grid}.xyz", f"{grid}.fun", "-o", paths.cache],
            ["rm", f"{grid}.xyz", f"{grid}.fun"]]


def step_micro(paths, form):
    words = [f"CURVISPLAT_BENCH_FOLDER={paths.folder}"]
    if form.micro_cache:
        words.append(f"CURVISPLAT_BENCH_CACHE={paths.cache}")
    return [*(cache_commands(paths, form) if form.micro_cache else []),
            ["env", *words, paths.bench / "curvisplat_bench", *form.micro, f"--benchmark_out={paths.json('micro')}",
             "--benchmark_out_format=json"]]


def step_bench(paths, form):
    return [*cache_commands(paths, form), [paths.program, "bench", paths.cache, "--quick", *form.bench, "--json", paths.json("bench"),
                                           "--plot", paths.folder / "bench_plots"]]


def step_convert(paths, form):
    return [[paths.program, "bench", "--convert", "--nodes", form.convert_nodes, "--tmp", paths.folder,
             "--json", paths.json("convert")]]


def step_scaling(paths, form):
    return [[sys.executable, HERE / "scaling.py", paths.folder / "scaling", "--program", paths.program, *form.scaling,
             "--json", paths.json("scaling"), "--plot", paths.folder / "scaling.png"]]


def step_peers(paths, form):
    fin = ["--fin", *paths.fin] if paths.fin else []
    return [[sys.executable, HERE / "peers/compare_peers.py", paths.folder / "peers", "--program", paths.program,
             "--reference", paths.bench / "curvisplat_reference", *form.peers, *fin, "--json", paths.json("peers"),
             "--plot", paths.folder / "peers.png", "--table", paths.folder / "peers.md"]]


def step_fidelity(paths, form):
    return [[paths.bench / "curvisplat_fidelity", paths.folder / "fidelity", *form.fidelity, "--json",
              paths.json("fidelity")]]


def step_frames(paths, form):
    return [[sys.executable, HERE / "frame_times.py", paths.folder / "frames", "--program", paths.program, *form.frames,
             "--json", paths.json("frames")]]


STEPS = {"micro": step_micro, "bench": step_bench, "convert": step_convert, "scaling": step_scaling,
         "frames": step_frames, "fidelity": step_fidelity, "peers": step_peers}


class Paths:
    def __init__(self, arguments):
        self.folder, self.fin = arguments.folder, arguments.fin
        self.program = arguments.build / "tools/curvisplat"
        self.bench = arguments.build / "bench"
        size = (SmokeForm if arguments.smoke else Form).cache
        self.cache = arguments.folder / f"wake_{size}.splats"

    def json(self, step):
        return self.folder / f"{step}.json"


def read_fidelity(path):
    """The rows of curvisplat_fidelity as measurements."""
    out = results.Results()
    for row in json.loads(path.read_text()):
        name = "/".join(row[key].replace(" ", "_") for key in ("case", "view", "function", "classification"))
        out.add(f"fidelity/{name}/error:{row['lod_pixels']:g}px", "dB", [row["psnr_db"]])
    return {"measurements": out.measurements}


def run_step(name, paths, form, everything):
    """Returns what went wrong, or None."""
    if name in ("bench", "convert") and subprocess.run([paths.program, "bench", "--help"], capture_output=True).returncode:
        return f"{paths.program}: has no subcommand `bench`; rebuild it, or run --without bench,convert"
    commands = STEPS[name](paths, form)
    paths.json(name).unlink(missing_ok=True)
    log = paths.folder / f"{name}.log"
    with open(log, "w") as file:
        for command in commands:
            words = [str(word) for word in command]
            file.write("+ " + " ".join(words) + "\n")
            file.flush()
            try:
                status = subprocess.run(words, stdout=file, stderr=subprocess.STDOUT).returncode
            except FileNotFoundError:
                return f"{words[0]}: no such program; build with -DCURVISPLAT_BENCH=ON"
            if status != 0:
                return f"exit status {status} of {' '.join(words[:3])} ...; its output:\n{log.read_text()[-2000:]}"
    try:
        found = read_fidelity(paths.json(name)) if name == "fidelity" else results.read(paths.json(name))
    except (OSError, ValueError, KeyError) as error:
        return f"expected measurements in {paths.json(name)}; {error}"
    if not found["measurements"]:
        return f"{paths.json(name)}: contains no measurements"
    everything.take(found, "micro/" if name == "micro" else "")
    return None


def steps_of(text):
    steps = [step for step in text.split(",") if step]
    if not set(steps) <= set(STEPS):
        raise argparse.ArgumentTypeError(f"unknown step in '{text}'; expected some of {', '.join(STEPS)}")
    return steps


def lacks_vtk():
    return subprocess.run(["/usr/bin/python3", "-c", "import vtk"], stderr=subprocess.DEVNULL).returncode != 0


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=pathlib.Path, help="for results; needs a few GB on a disk, not in memory")
    parser.add_argument("--smoke", action="store_true", help="tiny sizes: under a minute, figures mean nothing")
    parser.add_argument("--build", type=pathlib.Path, default=HERE.parent / "build/release",
                        help="build folder, configured with -DCURVISPLAT_BENCH=ON")
    parser.add_argument("--only", type=steps_of, default=list(STEPS))
    parser.add_argument("--without", type=steps_of, default=[], action="extend")
    parser.add_argument("--fin", nargs=2, metavar=("GRID", "SOLUTION"), help="PLOT3D grid and Q file for the step peers")
    arguments = parser.parse_args()
    if arguments.smoke and "peers" in arguments.only and lacks_vtk():
        print("the smoke test leaves out peers: python3-vtk9 is not installed")
        arguments.without.append("peers")
    os.makedirs(arguments.folder, exist_ok=True)

    paths, form = Paths(arguments), SmokeForm if arguments.smoke else Form
    everything, failed, begin = results.Results(), [], time.monotonic()
    version = results.version_of(paths.program)
    for name in STEPS:
        if name not in arguments.only or name in arguments.without:
            continue
        start = time.monotonic()
        problem = run_step(name, paths, form, everything)
        print(f"{name:10} {time.monotonic() - start:6.1f} s  {'FAILED: ' + problem if problem else 'done'}", flush=True)
        if problem:
            failed.append(name)
    everything.write(paths.folder / "all.json", "bench/run.py", version, form="smoke" if arguments.smoke else "short")
    for left in everything.left_out:
        print(f"left out: {left['name']}: {left['reason']}")
    took = time.monotonic() - begin
    print(f"{len(everything.measurements)} measurements in {paths.folder / 'all.json'}, {took:.0f} s")
    if took > MOST_SECONDS:
        print(f"warning: took longer than {MOST_SECONDS} s: other programs have the cores or the disk, or a step has become too slow",
              flush=True)
    sys.exit(1 if failed else 0)


if __name__ == "__main__":
    main()
