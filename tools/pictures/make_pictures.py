#!/usr/bin/env python3
"""Draws the pictures of README.md again.

    tools/pictures/make_pictures.py DATA [--program build/release/tools/curvisplat] [--only NAME,...]

DATA has the grids: bluntfinxyz.bin and bluntfinq.bin, delta_vertex.cgns, nemo_northsea_u.xyz and .fun, face1_*.vts to face6_*.vts,
anywhere below it. The window is drawn on a virtual display (Xvfb, xwd). `sea` and `torus` need Debian's python3-vtk9, by which their
lines are computed (flow_lines.py); around_pairs.py draws them beside VTK's.
"""
import argparse
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
    "fin": (["bluntfinxyz.bin", "bluntfinq.bin"], ["--scalar", "density,mach_number,pressure_gradient_magnitude"]),
    "wing": (["delta_vertex.cgns"], ["--scalar", "entropy"]),
    "currents": (["nemo_northsea_u.xyz", "nemo_northsea_u.fun"], ["--scalar", "uo"]),
    "globe": ([f"face{n}_*.vts" for n in range(1, 7)], ["--scalar", "T"]),
    "wake": (["wake.xyz", "wake.fun"], []),
    "torus": (["torus.vts"], []),
}
# picture: a function of flow_lines.py, which writes the files that its options name, and perhaps the grid
LINES_OF = {"sea": "sea", "torus": "torus"}
# picture: (cache, options of render)
PICTURES = {
    "fin": ("fin", ["--scalar", "mach_number", "--opacity-by", "pressure_gradient_magnitude", "--size", "960x540", "--surface",
                    "kmin,jmin", "--surface-colour", "#8a8f98", "--position=-16,-18,13", "--focal-point", "2.6,2.6,1.9",
                    "--view-angle", "28", "--scalar-bar"]),
    "fin_default": ("fin", ["--size", "480x360"]),
    "fin_range": ("fin", ["--range", "1.1,4", "--opacity-unit", "0.05", "--size", "480x360", *FIN_CAMERA,
                          "--view-angle", "36", *LINES, "--outline"]),
    "wing": ("wing", ["--tf", "glow", "--range", "0.002,0.06", "--opacity", "0:0,0.2:0.1,1:0.6", "--opacity-unit", "0.05", "--size",
                      "960x540", "--surface", "kmin", "--surface-colour", "#8a95a3", "--position=-0.9,1.5,1.25", "--focal-point",
                      "0.75,0.35,0.05", "--view-angle", "30"]),
    "currents": ("currents", ["--tf", "cool-warm", "--range=-0.4,0.4", "--opacity", "0:0.9,0.3:0.35,0.5:0.12,0.7:0.35,1:0.9",
                              "--opacity-unit", "2", "--size", "960x540", "--position", "6000,-760,10500", "--focal-point",
                              "3000,-380,5250", "--view-up", "0,0,1", "--view-angle", "16", "--scalar-bar"]),
    "globe": ("globe", ["--tf", "thermal", "--range=-2,30", "--opacity", "0:0.9,1:0.9", "--opacity-unit", "30", "--size", "960x540",
                        "--position", "14000,-12000,8000", "--focal-point", "0,0,0", "--view-angle", "40", "--light", "0.5,0.5,0",
                        "--light-direction", "1,-0.2,0.8", "--scalar-bar"]),
    "sea": ("currents", ["--tf", "cool-warm", "--range=-0.4,0.4", "--opacity", "0:0.9,0.3:0.25,0.5:0.04,0.7:0.25,1:0.9",
                         "--opacity-unit", "4", "--size", "960x600", "--position", "6000,-760,10500", "--focal-point", "3000,-380,5250",
                         "--view-up", "0,0,1", "--view-angle", "16", "--lines", "sea_coast.vtp", "--line-width", "1.5px", "--points",
                         "sea_points.vtp", "--point-size", "7px", "--lines-colour", "#d0c8a0", "--lines-colour", "#ffd040"]),
    "torus": ("torus", ["--tf", "thermal", "--range", "0,1", "--opacity", "0:0,0.3:0.1,1:0.5", "--opacity-unit", "0.3", "--size",
                        "960x600", "--lines", "torus_lines.vtp", "--lines-by", "B", "--line-width", "0.06", "--shadow", "0.8",
                        "--light-direction", "0.3,-0.5,1", "--surface", "torus_floor.vtp", "--surface-colour", "#a0a4aa",
                        "--position=-7,-9,7", "--focal-point", "0,0,-0.3", "--view-angle", "28", "--no-scalar-bar"]),
    "wake": ("wake", ["--tf", "glow", "--opacity-unit", "0.034", "--position", "7.2,-10,8", "--focal-point", "3.2,0,2",
                      "--view-angle", "34", "--size", "960x600"]),
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
    """A screenshot of `view` as it opens."""
    size = "%dx%d" % WINDOW
    read, write = os.pipe()
    server = subprocess.Popen(["Xvfb", "-displayfd", str(write), "-screen", "0", f"{size}x24", "-nolisten", "tcp"],
                              pass_fds=[write], stderr=subprocess.DEVNULL)
    os.close(write)
    try:
        with os.fdopen(read) as number:
            environment = dict(os.environ, DISPLAY=":" + number.readline().strip(), XDG_CONFIG_HOME=str(folder))
        window = subprocess.Popen([program, "view", cache, "--size", size],
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
    arguments.data = arguments.data.resolve()
    chosen = [name for name in re.split(",", arguments.only) if name] or [*PICTURES, "window"]

    with tempfile.TemporaryDirectory() as name:
        folder = pathlib.Path(name)

        def run(*words):
            subprocess.run([program, *words], check=True, cwd=folder)

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
                if picture in LINES_OF:
                    import flow_lines  # needs VTK
                    getattr(flow_lines, LINES_OF[picture])(arguments.data, folder)
                run("render", cache_of(cache), "-o", HERE / f"{picture}.png", *options)


if __name__ == "__main__":
    main()
