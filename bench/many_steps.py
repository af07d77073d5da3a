#!/usr/bin/python3
"""Times how long a cache of very many steps takes to open.

    bench/many_steps.py FOLDER [--steps 10000] [--program PROGRAM]

Converts three steps of a tiny wake and lists the first one's values again and again, by hard links, in the way that FORMAT.md
describes; a conversion of as many steps would take an hour. Then draws the last step, and prints the processors' time of the whole
program, which starts, opens the cache, chooses functions, draws 64x64 pixels and writes. Needs Debian's python3-xxhash.
"""
import argparse
import json
import os
import pathlib
import resource
import shutil
import struct
import subprocess

import xxhash

HERE = pathlib.Path(__file__).resolve().parent


def checksum(data):
    return f"{xxhash.xxh3_64_intdigest(data):016x}"


def multiply(cache, steps):
    """Makes a cache of three steps one of `steps`, each with the values of the first."""
    manifest = json.loads((cache / "manifest.json").read_text())
    table = (cache / "steps.bin").read_bytes()
    record = (len(table) - 16) // 3
    body = table[16:16 + record]
    table = table[:16] + b"".join(struct.pack("<d", step) + body[8:] for step in range(steps))
    (cache / "steps.bin").write_bytes(table)
    files = [entry for entry in manifest["files"] if not entry["name"].startswith("faces.step")]
    for entry in files:
        if entry["name"] == "steps.bin":
            entry.update(size=len(table), checksum=checksum(table))
    faces = next((entry for entry in manifest["files"] if entry["name"] == "faces.step1.bin"), None)
    for step in range(1, steps):
        for variable in manifest["variables"]:
            number = variable.get("number", 0)
            link = cache / f"var.{number}.{step}.bin"
            link.unlink(missing_ok=True)
            os.link(cache / f"var.{number}.bin", link)
        if faces:
            files.append({**faces, "name": f"faces.step{step}.bin"})
            if step > 2:
                os.link(cache / "faces.step1.bin", cache / f"faces.step{step}.bin")
    manifest["files"] = files
    manifest.pop("checksum")
    text = json.dumps(manifest, separators=(",", ":"), ensure_ascii=False)
    manifest["checksum"] = checksum(text.encode())
    (cache / "manifest.json").write_text(json.dumps(manifest, ensure_ascii=False))


def cpu_seconds(*words):
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    subprocess.run([str(word) for word in words], check=True, stdout=subprocess.DEVNULL)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=pathlib.Path)
    parser.add_argument("--steps", type=int, default=10000)
    parser.add_argument("--program", default=HERE.parent / "build/release/tools/curvisplat")
    arguments = parser.parse_args()
    folder, cache = arguments.folder, arguments.folder / "many.splats"
    folder.mkdir(parents=True, exist_ok=True)
    shutil.rmtree(cache, ignore_errors=True)
    quiet = {"check": True, "stdout": subprocess.DEVNULL}
    subprocess.run([arguments.program, "generate", "wake", "--size", "12x10x6", "--steps", "3", "-o", folder / "w"], **quiet)
    subprocess.run([arguments.program, "convert", folder / "w.xyz", folder / "w_%04d.fun", "-o", cache], **quiet)
    draw = [arguments.program, "render", cache, "-o", folder / "x.png", "--size", "64x64", "--step"]
    few = cpu_seconds(*draw, 2)
    multiply(cache, arguments.steps)
    many = cpu_seconds(*draw, arguments.steps - 1)
    print(f"{arguments.steps} steps: manifest.json {(cache / 'manifest.json').stat().st_size >> 10} KiB, "
          f"steps.bin {(cache / 'steps.bin').stat().st_size >> 10} KiB")
    print(f"drawing one step: {few:.2f} s of processors with 3 steps, {many:.2f} s with {arguments.steps}")


if __name__ == "__main__":
    main()
