#!/usr/bin/env python3
"""Draws a sheet of default pictures: what `render CACHE -o PICTURE` shows of real grids, without any option.

    tools/pictures/default_pictures.py DATA SHEET.png [--program ...] [--only NAME,...] [--keep FOLDER] [OPTION ...]
    tools/pictures/default_pictures.py DATA SHEET.png --pairs FOLDER --seed 1

DATA is a folder like shared/data (its README.md lists the grids). Prints one line for each picture, in the order of the
sheet (left to right, top to bottom): the share of pixels that differ by 0.1 or more from the background and from the
most frequent colour, and the options that were chosen. Exit status 1 if more than a fifth of the pictures have less than
5 %. OPTIONs after -- are given to every `render`.

--pairs writes FOLDER/pairs_1.png, pairs_2.png, ...: each of our pictures beside VTK's (vtk_default_volume.py, as ParaView draws a
volume without settings), pairs and sides in random order, without names. Judge each half "usable" or not (the main feature is
visible, not one colour, not nearly blank) before opening FOLDER/key.json, which says what they are. Another --seed shuffles anew.
"""
import argparse
import array
import collections
import json
import pathlib
import random
import struct
import subprocess
import sys
import tempfile
import zlib

HERE = pathlib.Path(__file__).resolve().parent
SIDE = 240

COLUMNS_OF_PAIRS, ROWS_OF_PAIRS = 2, 4
# What VTK calls a scalar of ours.
VTK_NAMES = {"density": "Density", "momentum_x": "Momentum:x", "momentum_y": "Momentum:y", "momentum_z": "Momentum:z",
             "energy": "StagnationEnergy", "MomentumX": "Momentum:x", "uo": "Function0", "depth": "Function1", "1": "Function0", "2": "Function1", "3": "Function2",
             "4": "Function3"}

# name: (files, or a scene to generate; scalars, which are drawn one by one)
GRIDS = {
    "bluntfin": (["bluntfin/bluntfinxyz.bin", "bluntfin/bluntfinq.bin"],
                 ["density", "momentum_x", "momentum_y", "momentum_z", "energy"]),
    "delta_wing": (["delta_wing/delta_vertex.cgns"], ["Density", "mach_number", "vorticity_magnitude"]),
    "lox_post": (["lox_post/postxyz.bin", "lox_post/postq.bin"],
                 ["density", "momentum_x", "momentum_y", "momentum_z", "energy"]),
    "combustor": (["combustor/combxyz.bin", "combustor/combq.bin"], ["density", "momentum_x", "momentum_y", "momentum_z", "energy"]),
    "nek": (["nek/Combined_PressureSide_Block.xyz", "nek/pressure.fun"], ["1", "2", "3", "4"]),
    "vtk_sample": (["vtk/SampleStructGrid.vtk"], ["scalars"]),
    "vtk_comb": (["vtk/multicomb_0.vts"], ["Density", "Momentum:mag"]),
    "mitgcm": (["vts_encodings/face3_appended_raw.vts"], ["T", "S"]),
    "cgns_sqnz": (["cgns/sqnz_s.hdf.cgns"], ["Density", "MomentumX"]),
    "globe": ("globe", ["T"]),
    "nemo": (["nemo_northsea/nemo_northsea_u.xyz", "nemo_northsea/nemo_northsea_u.fun"], ["uo", "depth"]),
}


def read_pfm(path):
    """Width, height and rows of (red, green, blue) floats, from the top."""
    data = path.read_bytes()
    header = data.split(b"\n", 3)
    width, height = map(int, header[1].split())
    values = array.array("f", header[3])
    assert header[0] == b"PF" and float(header[2]) < 0 and len(values) == 3 * width * height
    rows = [values[3 * width * y:3 * width * (y + 1)] for y in reversed(range(height))]
    return width, height, rows


def contrast(rows, background=(1, 1, 1)):
    """The share of pixels that differ by 0.1 from the background and from the most frequent other colour."""
    seen = collections.Counter()
    for row in rows:
        for n in range(0, len(row), 3):
            colour = row[n:n + 3]
            if max(abs(colour[c] - background[c]) for c in range(3)) >= 0.1:
                seen[tuple(min(9, int(10 * channel)) for channel in colour)] += 1
    if not seen:
        return 0
    mode = [(channel + 0.5) / 10 for channel in seen.most_common(1)[0][0]]
    other = sum(count for colour, count in seen.items()
                if max(abs((channel + 0.5) / 10 - mode[c]) for c, channel in enumerate(colour)) >= 0.099)
    return other / sum(len(row) // 3 for row in rows)


def write_png(path, width, height, rows):
    def chunk(name, data):
        return struct.pack(">I", len(data)) + name + data + struct.pack(">I", zlib.crc32(name + data))

    def difference(row):
        return b"\1" + bytes([*row[:3], *((a - b) & 255 for a, b in zip(row[3:], row))])

    raw = b"".join(map(difference, rows))
    path.write_bytes(b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", struct.pack(">IIBBBBB", width, height, 8, 2, 0, 0, 0)) +
                     chunk(b"IDAT", zlib.compress(raw, 9)) + chunk(b"IEND", b""))


def read_ppm(path):
    data = path.read_bytes()
    header = [line for line in data.split(b"\n", 5) if not line.startswith(b"#")]  # VTK writes a comment
    fields = b" ".join(header[:3]).split()
    width, height = int(fields[1]), int(fields[2])
    pixels = data[-3 * width * height:]
    assert fields[0] == b"P6"
    return [[byte / 255 for byte in pixels[3 * width * y:3 * width * (y + 1)]] for y in range(height)]


def draw_by_vtk(files, scalar, folder):
    picture = folder / "vtk.ppm"
    words = ["xvfb-run", "-a", "/usr/bin/python3", HERE / "vtk_default_volume.py", picture, SIDE, scalar, *files]
    result = subprocess.run([str(word) for word in words], capture_output=True, text=True)
    if result.returncode:
        print(f"VTK draws no {scalar} of {files[0]}: {result.stderr.strip().splitlines()[-1]}")
        return [[0.5] * (3 * SIDE) for _ in range(SIDE)]
    return read_ppm(picture)


def write_pairs(pairs, folder, seed):
    """pairs: (name, ours, VTK's)."""
    folder.mkdir(parents=True, exist_ok=True)
    chance, key = random.Random(seed), []
    pairs = chance.sample(pairs, len(pairs))
    on_sheet = COLUMNS_OF_PAIRS * ROWS_OF_PAIRS
    for first in range(0, len(pairs), on_sheet):
        halves = []
        for name, *drawn in pairs[first:first + on_sheet]:
            swapped = chance.random() < 0.5
            halves += reversed(drawn) if swapped else drawn
            key.append({"pair": len(key) + 1, "name": name, "ours": "right" if swapped else "left"})
        write_sheet(folder / f"pairs_{first // on_sheet + 1}.png", halves, 2 * COLUMNS_OF_PAIRS)
    (folder / "key.json").write_text(json.dumps(key, indent=1))


def write_sheet(path, pictures, columns):
    gap = 4
    cell = SIDE + gap
    rows_of_cells = -(-len(pictures) // columns)
    width, height = columns * cell, rows_of_cells * cell
    sheet = [bytearray(b"\x60" * (3 * width)) for _ in range(height)]
    for n, rows in enumerate(pictures):
        x, y = n % columns * cell, n // columns * cell
        for r, row in enumerate(rows):
            line = bytes(max(0, min(255, round(255 * value))) for value in row)
            sheet[y + r][3 * x:3 * x + len(line)] = line
    write_png(path, width, height, sheet)


def inputs_of(name, files, data, folder):
    return [folder / f"{name}.xyz", folder / f"{name}.fun"] if isinstance(files, str) else [data / file for file in files]


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("data", type=pathlib.Path)
    parser.add_argument("sheet", type=pathlib.Path)
    parser.add_argument("--program", type=pathlib.Path, default=HERE.parents[1] / "build/release/tools/curvisplat")
    parser.add_argument("--only", default="")
    parser.add_argument("--keep", type=pathlib.Path, help="folder for the caches, which are made once")
    parser.add_argument("--columns", type=int, default=6)
    parser.add_argument("--pairs", type=pathlib.Path, help="folder for pairs with VTK's pictures, to be judged blind")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("options", nargs="*")
    arguments = parser.parse_args()

    def run(*words):
        result = subprocess.run([str(arguments.program), *map(str, words)], capture_output=True, text=True)
        if result.returncode:
            sys.exit(result.stderr)
        return result.stdout

    pictures, pairs, poor = [], [], 0
    with tempfile.TemporaryDirectory() as temporary:
        folder = arguments.keep or pathlib.Path(temporary)
        folder.mkdir(exist_ok=True)
        for name, (files, scalars) in GRIDS.items():
            if arguments.only and name not in arguments.only.split(","):
                continue
            cache = folder / f"{name}.splats"
            if not cache.exists():
                if isinstance(files, str):
                    run("generate", files, "--size", "96x48x24", "-o", folder / name)
                chosen = [] if isinstance(files, str) else ["--scalar", ",".join(scalars)]
                run("convert", *inputs_of(name, files, arguments.data, folder), "-o", cache, *chosen)
            for scalar in scalars:
                picture = folder / f"{name}.pfm"
                choice = [] if isinstance(files, str) else ["--scalar", scalar]
                out = run("render", cache, "-o", picture, "--size", f"{SIDE}x{SIDE}", *choice, *arguments.options)
                rows = read_pfm(picture)[2]
                pictures.append(rows)
                if arguments.pairs:
                    sources = inputs_of(name, files, arguments.data, folder)
                    pairs.append((f"{name} {scalar}", rows, draw_by_vtk(sources, "Function0" if name == "globe"
                                                                         else VTK_NAMES.get(scalar, scalar), folder)))
                share = contrast(rows)
                poor += share < 0.05
                print(f"{len(pictures):3} {name:12} {scalar:20} {100 * share:5.1f} %  {out.splitlines()[-1]}")
    write_sheet(arguments.sheet, pictures, arguments.columns)
    if arguments.pairs:
        write_pairs(pairs, arguments.pairs, arguments.seed)
    print(f"{arguments.sheet}: {len(pictures)} pictures, {poor} of them with less than 5 % contrast")
    return 1 if poor > 0.2 * len(pictures) else 0


if __name__ == "__main__":
    sys.exit(main())
