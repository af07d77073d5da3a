#!/usr/bin/python3
"""Exported splats in an independent viewer, three.js with @mkkellogg/gaussian-splats-3d, in headless Chromium, against our pictures.

    splats_test.py PROGRAM [FOLDER]    FOLDER: keeps the pictures there

Exit status 77 (skipped) without Chromium or without node_modules here: npm install --ignore-scripts.
"""
import base64
import functools
import http.server
import math
import pathlib
import re
import subprocess
import sys
import tempfile
import threading

HERE = pathlib.Path(__file__).resolve().parent
sys.path.insert(0, str(HERE.parent / "serve"))
if not (HERE / "node_modules" / "three").is_dir():
    print(f"skipped: no node_modules in {HERE.name}; npm install --ignore-scripts installs them")
    sys.exit(77)
from serving import Chromium  # noqa: E402

PROGRAM = pathlib.Path(sys.argv[1]).resolve()
KEPT = pathlib.Path(sys.argv[2]) if len(sys.argv) > 2 else None
SIDE = 512
PATIENCE_S = 600  # for a picture: the viewer draws without a graphics card, beside other tests


class Files(http.server.SimpleHTTPRequestHandler):
    """node_modules and the page, and the splats of a temporary folder."""

    def __init__(self, *arguments, splats, **options):
        self.splats = splats
        super().__init__(*arguments, directory=HERE, **options)

    def translate_path(self, path):
        if path.startswith("/splats/"):
            return str(pathlib.Path(self.splats, pathlib.PurePath(path).name))
        return super().translate_path(path)

    def log_message(self, *_):
        pass


def run(*words):
    return subprocess.run([PROGRAM, *map(str, words)], check=True, capture_output=True, text=True).stdout


def psnr(a, b):
    done = subprocess.run([PROGRAM, "compare", a, b], capture_output=True, text=True)
    return float(re.search(r"([\d.]+) dB", done.stdout).group(1))


def placed(text, ending):
    """Where the viewer sees a position p of the data, and how much larger lengths are there. `text`: what export printed."""
    if ending == "glb":  # y points upwards
        return lambda p: [p[0], p[2], -p[1]], 1
    if ending == "ply":
        return lambda p: p, 1
    *centre, scale = map(float, re.search(r"\(p - \((\S+), (\S+), (\S+)\)\) \* (\S+)", text).groups())
    return lambda p: [(x - c) * scale for x, c in zip(p, centre)], scale


def compare(tab, folder, ending, function):
    """Mean PSNR over three directions, and what `export` says of the same splats."""
    text = run("export", folder / "g.splats", "-o", folder / f"g.{ending}", "--max-splats", "500K", *function)
    place, scale = placed(text, ending)
    said = float(re.search(r"12 directions: ([\d.]+) dB", text).group(1))
    info = run("info", folder / "g.splats")
    low, high = zip(*(map(float, re.search(rf"{line}(\S+) \.\. (\S+)", info).groups())
                      for line in (r"bounds +", r"bounds[^\n]*\n +", r"bounds[^\n]*\n[^\n]*\n +")))
    centre = [(a + b) / 2 for a, b in zip(low, high)]
    depth = sum((b - a) ** 2 for a, b in zip(low, high)) ** 0.5
    half = 0.55 * depth
    tab.run(f"(async () => {{ window.opened = await open_splats('/splats/g.{ending}', {half * scale}, {depth * scale}); }})()")
    squares = []
    for number, direction in enumerate(((0.5, -0.6, 0.62), (-0.8, 0.1, 0.59), (0.1, 0.95, -0.3))):
        position = [c + depth * d for c, d in zip(centre, direction)]
        up = [0, 1, 0] if ending == "glb" else [0, 0, 1]
        picture = tab.run(f"draw_splats({place(position)}, {place(centre)}, {up})")
        theirs, ours = folder / f"{ending}_{number}_theirs.png", folder / f"{ending}_{number}_ours.png"
        theirs.write_bytes(base64.b64decode(picture.split(",", 1)[1]))
        numbers = lambda p: ",".join(repr(x) for x in p)  # noqa: E731
        run("render", folder / "g.splats", "-o", ours, "--size", f"{SIDE}x{SIDE}", f"--position={numbers(position)}",
            f"--focal-point={numbers(centre)}", "--view-up", "0,0,1", "--parallel-scale", half, "--background", "white", *function)
        squares.append(10 ** (-0.1 * psnr(theirs, ours)))
        if KEPT:
            KEPT.mkdir(parents=True, exist_ok=True)
            for file in (theirs, ours):
                (KEPT / file.name).write_bytes(file.read_bytes())
    return -10 * math.log10(sum(squares) / len(squares)), said


def main():
    wrong = []
    with tempfile.TemporaryDirectory() as name:
        folder = pathlib.Path(name)
        run("generate", "half-annulus", "--size", "64x48x32", "-o", folder / "g")
        run("convert", folder / "g.xyz", folder / "g.fun", "-o", folder / "g.splats")
        server = http.server.ThreadingHTTPServer(("127.0.0.1", 0), functools.partial(Files, splats=folder))
        threading.Thread(target=server.serve_forever, daemon=True).start()
        browser = Chromium("--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--ignore-gpu-blocklist")
        try:
            for what, ending, function, least in CASES:
                tab = browser.tab(f"http://127.0.0.1:{server.server_port}/page.html", (SIDE, SIDE))
                tab.socket.settimeout(PATIENCE_S)
                tab.wait("window.ready === true", "the viewer to load")
                found, said = compare(tab, folder, ending, function)
                print(f"{what}, .{ending}: {found:.1f} dB in the viewer, {said:.1f} dB by export's own drawing")
                if found < least:
                    wrong.append(f"{what}, .{ending}: {found:.1f} dB, expected {least}")
        finally:
            browser.close()
            server.shutdown()
    for line in wrong:
        print("FAILED:", line)
    return int(bool(wrong))


SMOOTH = HERE.parent / "data" / "half_annulus_smooth.json"  # DESIGN.md, "Fidelity"
FUNCTIONS = {"smooth": ["--tf", SMOOTH, "--range", "0,1", "--opacity-unit", "0.01"],
             "a ramp": ["--tf", "viridis", "--range", "0,1", "--opacity", "0:0,1:0.5", "--opacity-unit", "0.5"]}
CASES = [(what, ending, FUNCTIONS[what], least) for what, ending, least in (
    ("smooth", "ply", 35), ("a ramp", "ply", 42), ("smooth", "spz", 36.8), ("a ramp", "spz", 45.9),
    ("smooth", "glb", 35), ("a ramp", "glb", 42))]

if __name__ == "__main__":
    sys.exit(main())
