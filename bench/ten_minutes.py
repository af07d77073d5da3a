#!/usr/bin/env python3
"""Measures what bench/NUMBERS.md shows, and prints its table: a minute on two idle cores, ten on busy ones.

    bench/ten_minutes.py [FOLDER] [--program build/release/tools/curvisplat] [--size 128x128x128] [--peers 64x64x64] [--repeat 3]

A half-annulus is generated in FOLDER (default: a temporary one) in two sizes. The larger is converted and drawn --repeat times: a figure is the
best of these, since other work can only make it worse. The smaller is drawn by curvisplat and by VTK, and both pictures are compared with the
reference march; without python3-vtk9 and Xvfb, or without curvisplat_reference (cmake -DCURVISPLAT_BENCH=ON), these rows are left out, with
the reason. Nothing but the program is needed for the rest.
"""
import argparse
import dataclasses
import json
import os
import pathlib
import re
import shutil
import statistics
import subprocess
import sys
import tempfile
import time

HERE = pathlib.Path(__file__).resolve().parent
ROOT = HERE.parent
MIB = 2**20
FRAMES = 10  # of an orbit


@dataclasses.dataclass
class Run:
    """A process: seconds by the clock, of all its threads' work, and its peak memory in bytes."""
    clock: float
    work: float
    peak: int


def run(*words):
    words = [str(word) for word in words]
    begin = time.monotonic()
    process = subprocess.Popen(words, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)
    said = process.stderr.read()
    _, status, usage = os.wait4(process.pid, 0)
    process.returncode = os.waitstatus_to_exitcode(status)
    if process.returncode != 0:
        sys.exit(f"ten_minutes: {' '.join(words)}: {said.strip()}")
    return Run(time.monotonic() - begin, usage.ru_utime + usage.ru_stime, 1024 * usage.ru_maxrss)


def best(runs):
    return Run(*(min(getattr(one, field.name) for one in runs) for field in dataclasses.fields(Run)))


def nodes_of(size):
    i, j, k = map(int, size.split("x"))
    return i * j * k


def own_rows(arguments, folder):
    """The table's rows of one program: (what, figure, processor time or nothing, peak memory or nothing)."""
    program, nodes = arguments.program, nodes_of(arguments.size)
    prefix, cache, told = folder / "grid", folder / "grid.splats", folder / "told.json"
    run(program, "generate", "half-annulus", "--size", arguments.size, "-o", prefix)
    files = [prefix.with_suffix(".xyz"), prefix.with_suffix(".fun")]
    convert = best([run(program, "convert", *files, "-o", cache, "--overwrite") for _ in range(arguments.repeat)])
    size = sum(file.stat().st_size for file in cache.iterdir())
    picture = best([run(program, "render", cache, "-o", folder / "first.png") for _ in range(arguments.repeat)])
    frames, orbits = [], []
    for _ in range(arguments.repeat):
        orbits.append(run(program, "render", cache, "-o", folder / "frame_%02d.png", "--orbit", 20, "--frames", FRAMES, "--stats", told))
        told_frames = json.loads(told.read_text())["frames"]
        frames.append(statistics.median(frame["seconds"]["total"] for frame in told_frames[1:]))
    yield f"convert {nodes / 1e6:.1f} M nodes", f"{convert.clock:.2f} s, {nodes / convert.clock / 1e6:.2f} M nodes/s", f"{convert.work:.2f} s", convert.peak
    yield "the cache", f"{size / MIB:.1f} MiB, {size / nodes:.2f} bytes a node", "", None
    yield "a first picture, from the command to the file, 600x600", f"{picture.clock:.2f} s", f"{picture.work:.2f} s", picture.peak
    yield "a frame of an orbit, 600x600", f"{min(frames):.3f} s", f"{best(orbits).work / FRAMES:.2f} s", best(orbits).peak


def peer_rows(arguments, folder):
    """Rows of the smaller grid, each with its PSNR; or the reason why there are none."""
    reference = arguments.program.parent.parent / "bench/curvisplat_reference"
    if not reference.exists():
        return [], f"{reference.name} is not built (-DCURVISPLAT_BENCH=ON)"
    techniques = ["curvisplat", "curvisplat-1px"]
    vtk = subprocess.run(["/usr/bin/python3", "-c", "import vtk; print(vtk.vtkVersion().GetVTKVersion())"], capture_output=True, text=True)
    reason = None
    if vtk.returncode == 0 and shutil.which("Xvfb"):
        techniques += ["projected-tetrahedra", "ray-cast", "resampled"]
    else:
        reason = "VTK is left out: install python3-vtk9 and xvfb"
    told = folder / "peers.json"
    run(sys.executable, HERE / "peers/compare_peers.py", folder, "--sizes", arguments.peers, "--techniques", ",".join(techniques), "--frames", 5,
        "--seconds", 20, "--program", arguments.program, "--reference", reference, "--json", told, *([] if reason is None else ["--display", "none"]))
    names = {"curvisplat": "curvisplat, all splats", "curvisplat-1px": "curvisplat, 1 pixel of error", "ray-cast": "VTK, ray cast of tetrahedra",
             "projected-tetrahedra": "VTK, projected tetrahedra", "resampled": "VTK, resampled to 128³, then ray cast"}
    rows = [(names[row["technique"]], f"{row['build_s']:.2f} s", f"{min(row['frames_s'] or [row['first_frame_s']]):.3f} s",
             f"{row['peak_memory_bytes'] / MIB:.0f} MiB", f"{row['psnr_db']:.1f} dB") for row in json.loads(told.read_text())["rows"]]
    return rows, reason if reason else f"VTK {vtk.stdout.strip()}"


def processor():
    for line in pathlib.Path("/proc/cpuinfo").read_text().splitlines():
        if line.startswith("model name"):
            return re.sub(r"\s+", " ", line.split(":", 1)[1]).strip()
    return "an unknown processor"


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", nargs="?", type=pathlib.Path)
    parser.add_argument("--program", type=pathlib.Path, default=ROOT / "build/release/tools/curvisplat")
    parser.add_argument("--size", default="128x128x128")
    parser.add_argument("--peers", default="64x64x64")
    parser.add_argument("--repeat", type=int, default=3)
    arguments = parser.parse_args()
    arguments.program = arguments.program.resolve()
    if not arguments.program.is_file():
        sys.exit(f"ten_minutes: {arguments.program}: does not exist; build curvisplat, or name it with --program")
    begin, load = time.monotonic(), os.getloadavg()[0]
    with tempfile.TemporaryDirectory() as temporary:
        folder = arguments.folder or pathlib.Path(temporary)
        folder.mkdir(parents=True, exist_ok=True)
        own = list(own_rows(arguments, folder))
        peers, about = peer_rows(arguments, folder)
    version = subprocess.run([arguments.program, "--version"], capture_output=True, text=True, check=True).stdout.strip()
    print(f"{version} on {processor()}, {os.cpu_count()} cores, {time.strftime('%Y-%m-%d')}; load {load:.1f} before and {os.getloadavg()[0]:.1f} "
          f"after; best of {arguments.repeat}; {(time.monotonic() - begin) / 60:.0f} minutes in all.\n")
    print("| half-annulus | by the clock | work of all threads | peak memory |\n|---|---|---|---|")
    for what, figure, work, peak in own:
        print(f"| {what} | {figure} | {work} | {f'{peak / MIB:.0f} MiB' if peak else ''} |")
    if peers:
        print(f"\nThe same camera and function, {arguments.peers} nodes, 256x256 pixels, one sample a pixel; {about}:\n")
        print("| drawn by | prepared once | a frame | peak memory | against the march |\n|---|---|---|---|---|")
        for row in peers:
            print("| " + " | ".join(row) + " |")
    else:
        print(f"\nNot compared with the march: {about}.")


if __name__ == "__main__":
    main()
