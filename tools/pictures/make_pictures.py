#!/usr/bin/env python3
"""Draws the pictures of README.md again.

    tools/pictures/make_pictures.py DATA [--program build/release/tools/curvisplat] [--only NAME,...]

DATA has the grids: bluntfinxyz.bin and bluntfinq.bin, delta_vertex.cgns, nemo_northsea_u.xyz and .fun, anywhere below
it. The window is drawn on a virtual display (Xvfb, xwd).
"""
import argparse
import json
import os
import pathlib
import re
import struct
import subprocess
import tempfile
import time
import zlib

HERE = pathlib.Path(__file__).resolve().parent
WINDOW = (1120, 680)
FIN_CAMERA = ["--position=-14,-24,17", "--focal-point", "3.6,3.6,2"]
LINES = ["--scalar-bar", "--axes"]

# cache: (files, options of convert)
CACHES = {
    "fin": (["bluntfinxyz.bin", "bluntfinq.bin"], ["--scalar", "density"]),
    "wing": (["delta_vertex.cgns"], ["--scalar", "entropy"]),
    "currents": (["nemo_northsea_u.xyz", "nemo_northsea_u.fun"], ["--scalar", "uo"]),
    "wake": (["wake.xyz", "wake.fun"], []),
}
# picture: (cache, options of render)
PICTURES = {
    "fin": ("fin", ["--tf", HERE / "fin.json", "--size", "960x540", *FIN_CAMERA, "--view-angle", "26", *LINES, "--outline"]),
    "fin_default": ("fin", ["--size", "480x360"]),
    "fin_range": ("fin", ["--range", "1.1,4", "--opacity-unit", "0.05", "--size", "480x360", *FIN_CAMERA,
                          "--view-angle", "36", *LINES, "--outline"]),
    "wing": ("wing", ["--tf", HERE / "wing.json", "--size", "960x540", "--position=-0.9,1.5,1.25", "--focal-point",
                      "0.85,0.4,0.1", "--view-angle", "34", *LINES]),
    "currents": ("currents", ["--tf", HERE / "currents.json", "--size", "960x540", "--position", "5230,-630,9150",
                              "--focal-point", "3000,-380,5250", "--view-up=-0.85,0.1,0.5", "--view-angle", "30",
                              "--scalar-bar", "--background", "#202830"]),
    "wake": ("wake", ["--tf", "inferno", "--background", "black", "--opacity-unit", "0.034", "--position", "7.2,-10,8",
                      "--focal-point", "3.2,0,2", "--view-angle", "34", "--size", "960x600"]),
}


def png_of_xwd(xwd):
    """A PNG of a screenshot by xwd with 32 bits a pixel."""
    words = struct.unpack(">25I", xwd[:100])
    width, height, stride = words[4], words[5], words[12]
    begin = words[0] + 12 * words[19]  # header, colour table
    rows = bytearray()
    for y in range(height):
        row = xwd[begin + y * stride:begin + y * stride + 4 * width]
        pixels = bytearray(3 * width)
        pixels[0::3], pixels[1::3], pixels[2::3] = row[2::4], row[1::4], row[0::4]
        rows += b"\0" + pixels

    def chunk(name, data):
        return struct.pack(">I", len(data)) + name + data + struct.pack(">I", zlib.crc32(name + data))

    return (b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", struct.pack(">IIBBBBB", width, height, 8, 2, 0, 0, 0)) +
            chunk(b"IDAT", zlib.compress(bytes(rows), 9)) + chunk(b"IEND", b""))


def draw_window(program, cache, folder):
    """A screenshot of `view`, with the camera and the function of the picture "fin"."""
    state = {"curvisplat_view": 1, "variable": "density", "preset": "",
             "function": json.loads((HERE / "fin.json").read_text())[0],
             "camera": {"position": [-14, -24, 17], "focal_point": [3.6, 3.6, 2], "view_up": [0, 0, 1],
                        "perspective": True, "parallel_scale": 8, "view_angle": 36},
             "lod_pixels": 0.5, "memory_bytes": 512 << 20, "flat": False, "scale": [1, 1, 1], "clip_box": None,
             "dark": False, "scalar_bar": True, "axes": True, "outline": True}
    (folder / "state.json").write_text(json.dumps(state))
    size = "%dx%d" % WINDOW
    read, write = os.pipe()
    server = subprocess.Popen(["Xvfb", "-displayfd", str(write), "-screen", "0", f"{size}x24", "-nolisten", "tcp"],
                              pass_fds=[write], stderr=subprocess.DEVNULL)
    os.close(write)
    try:
        with os.fdopen(read) as number:
            environment = dict(os.environ, DISPLAY=":" + number.readline().strip(), XDG_CONFIG_HOME=str(folder))
        window = subprocess.Popen([program, "view", cache, "--size", size, "--state", folder / "state.json"],
                                  env=environment, stderr=subprocess.DEVNULL)
        time.sleep(20)  # until the picture is final
        xwd = subprocess.run(["xwd", "-root", "-silent"], env=environment, check=True, capture_output=True).stdout
        window.terminate()
        window.wait()
    finally:
        server.terminate()
        server.wait()
    (HERE / "window.png").write_bytes(png_of_xwd(xwd))


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("data", type=pathlib.Path)
    parser.add_argument("--program", type=pathlib.Path, default=HERE.parent.parent / "build/release/tools/curvisplat")
    parser.add_argument("--only", default="", help="names of the pictures to draw (default: all)")
    arguments = parser.parse_args()
    program = arguments.program.resolve()
    chosen = [name for name in re.split(",", arguments.only) if name] or [*PICTURES, "window"]

    with tempfile.TemporaryDirectory() as name:
        folder = pathlib.Path(name)

        def run(*words):
            subprocess.run([program, *words], check=True)

        def found(file):
            if (folder / file).exists():
                return folder / file
            return next(arguments.data.rglob(file))

        def cache_of(cache):
            path = folder / f"{cache}.splats"
            if not path.exists():
                if cache == "wake":
                    run("generate", "wake", "--size", "192x128x96", "-o", folder / "wake")
                files, options = CACHES[cache]
                run("convert", *map(found, files), "-o", path, *options)
            return path

        for picture in chosen:
            if picture == "window":
                draw_window(program, cache_of("fin"), folder)
            else:
                cache, options = PICTURES[picture]
                run("render", cache_of(cache), "-o", HERE / f"{picture}.png", *options)


if __name__ == "__main__":
    main()
