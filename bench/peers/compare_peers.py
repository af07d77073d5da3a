#!/usr/bin/env python3
"""Draws the same grid, camera and transfer function with curvisplat and with VTK, in one run.

    bench/peers/compare_peers.py FOLDER [--sizes 40x32x32,100x100x100] [--tetrahedra 64x32x32]
                                 [--body-centred 50x25x25 [--cells]] [--fin GRID SOLUTION] [--functions smooth]
                                 [--json OUT.json] [--plot OUT.png] [--table OUT.md]

The half-annulus scene is generated in FOLDER in each of --sizes; for --tetrahedra its cells are cut into tetrahedra by VTK, and all programs read
the same .vtu file, as for --body-centred, the scene in the tetrahedra of a body-centred lattice of so many cubes (half_annulus_mesh.py),
with the scalar at points or, with --cells, in the cells; --fin draws the density of a PLOT3D grid with a Q file, such as
the blunt fin (40x32x32). Every picture is compared with the reference march of curvisplat_reference: of the analytic field for
the scene, of the trilinear field in the grid's own cells for --fin. All programs get the extinctions and colours of
tests/data/half_annulus_*.json over white, an orthographic camera and one sample a pixel, and write PNG.

"build" is what precedes the first picture and is kept: reading and cutting into tetrahedra, or resampling; for curvisplat the
conversion, which is done once, to a file. "frame" is the median of further frames, between which the camera moves a little. "peak"
is the peak memory of the process; for curvisplat that of its picture, with that of the conversion beside it in the JSON.
"draws" is the number of primitives in a frame: splats, tetrahedra, or the voxels of the resampled grid. They and the picture's pixels
are divided by "frame": "M a second" is millions of primitives.
"""
import argparse
import contextlib
import dataclasses
import json
import math
import os
import pathlib
import re
import shutil
import signal
import statistics
import subprocess
import sys

HERE = pathlib.Path(__file__).resolve().parent
ROOT = HERE.parent.parent
sys.path.insert(0, str(HERE.parent))
import results
from line_plot import write_line_plots

VTK_TECHNIQUES = ["projected-tetrahedra", "ray-cast", "zsweep", "resampled"]
OWN_TECHNIQUES = {"curvisplat": "0", "curvisplat-1px": "1"}  # and their --lod-pixels
NAMES = {"projected-tetrahedra": "VTK, projected tetrahedra", "ray-cast": "VTK, ray cast of tetrahedra",
         "zsweep": "VTK, ZSweep", "resampled": "VTK, resampled and ray cast",
         "curvisplat": "curvisplat, finest level", "curvisplat-1px": "curvisplat, 1 pixel of error"}
# What each technique draws; its number is in the answer under this name.
PRIMITIVES = {"projected-tetrahedra": "tetrahedra", "ray-cast": "tetrahedra", "zsweep": "tetrahedra", "resampled": "voxels",
              "curvisplat": "splats", "curvisplat-1px": "splats"}
CLUSTERING = 2.5
MIB = 2**20


def normalized(vector):
    length = math.sqrt(sum(x * x for x in vector))
    return [x / length for x in vector]


def camera_along(direction, focal_point, distance, parallel_scale):
    along = normalized(direction)
    return {"position": [f - distance * d for f, d in zip(focal_point, along)], "focal_point": focal_point,
            "view_up": [0, 0, 1], "parallel_scale": parallel_scale}


@dataclasses.dataclass
class Case:
    """A grid, with its camera, range and reference."""
    name: str
    grid: pathlib.Path
    solution: pathlib.Path | None
    scalar: str
    kind: str  # VTK's, as the array's name
    array: str
    camera: dict
    range: tuple
    length: float
    truth: list  # arguments of curvisplat_reference
    nodes: int = 0

    def files(self):
        return [file for file in (self.grid, self.solution) if file]

    def camera_words(self):
        def words(vector):
            return ",".join(f"{x:.17g}" for x in vector)
        return [f"--position={words(self.camera['position'])}", f"--focal-point={words(self.camera['focal_point'])}",
                f"--view-up={words(self.camera['view_up'])}", f"--parallel-scale={self.camera['parallel_scale']:.17g}"]


def scene_case(arguments, size):
    prefix = arguments.folder / f"half_annulus_{size}"
    results.run([arguments.program, "generate", "half-annulus", "--size", size, "--clustering", CLUSTERING, "-o", prefix])
    camera = camera_along([0.8, 0.35, -0.45], [-0.4, 0, 0.5], 4, 1.25)
    return Case(f"half-annulus-{size}", prefix.with_suffix(".xyz"), prefix.with_suffix(".fun"), "1", "function",
                "Function0", camera, (0, 1), 1, ["--scene", "half-annulus", "--clustering", CLUSTERING])


def tetrahedra_case(arguments, size):
    case = scene_case(arguments, size)
    grid = arguments.folder / f"half_annulus_tetrahedra_{size}.vtu"
    job = grid.with_suffix(".job.json")
    job.write_text(json.dumps({"grid": str(case.grid), "solution": str(case.solution), "solution_kind": case.kind, "array": case.array,
                               "write_tetrahedra": str(grid)}))
    results.run([arguments.vtk_python, HERE / "vtk_render.py", job])
    job.unlink()
    return dataclasses.replace(case, name=f"half-annulus-tetrahedra-{size}", grid=grid, solution=None, scalar="scalar", array="scalar")


def body_centred_case(arguments, cubes):
    of_cells = "-cells" if arguments.cells else ""
    grid = arguments.folder / f"half_annulus_body_centred{of_cells}_{cubes}.vtu"
    results.run([arguments.vtk_python, HERE / "half_annulus_mesh.py", grid, "--cubes", cubes, *(["--cells"] if of_cells else [])])
    return dataclasses.replace(scene_case(arguments, "9x9x9"), name=f"half-annulus-body-centred{of_cells}-{cubes}", grid=grid,
                               solution=None, scalar="scalar", array="scalar")


def fin_case(arguments, grid, solution):
    told = json.loads(results.run([arguments.program, "info", grid, solution, "--json"]))
    lower, upper = told["bounds"]["lower"], told["bounds"]["upper"]
    density = next(scalar for scalar in told["scalars"] if scalar["name"] == "density")
    centre = [0.5 * (a + b) for a, b in zip(lower, upper)]
    diagonal = math.dist(lower, upper)
    camera = camera_along([-1, -1, -1], centre, diagonal, 0.4 * diagonal)
    return Case("fin", grid, solution, "density", "q", "Density", camera, (density["min"], density["max"]), diagonal / 3,
                ["--grid", grid, "--solution", solution, "--scalar", "density"])


def function_file(function):
    return ROOT / f"tests/data/half_annulus_{function}.json"


def stretched(points, width, value_range):
    low, high = value_range
    return [[low + points[at] * (high - low), *points[at + 1:at + width]] for at in range(0, len(points), 4)]


def vtk_job(arguments, case, function, technique, picture):
    preset = json.loads(function_file(function).read_text())[0]
    return {"grid": str(case.grid), "solution": str(case.solution), "solution_kind": case.kind, "array": case.array,
            "technique": technique, "camera": case.camera, "size": [int(n) for n in arguments.picture.split("x")],
            "colours": stretched(preset["RGBPoints"], 4, case.range),
            "opacities": stretched(preset["Points"], 2, case.range),
            "opacity_unit": preset["ScalarOpacityUnitDistance"] * case.length, "frames": arguments.frames,
            "seconds": arguments.seconds, "resample": arguments.resample, "picture": str(picture)}


def drawn_by_vtk(arguments, case, function, technique, picture):
    job = picture.with_suffix(".job.json")
    job.write_text(json.dumps(vtk_job(arguments, case, function, technique, picture)))
    answer = json.loads(results.run([arguments.vtk_python, HERE / "vtk_render.py", job]))
    job.unlink()
    return {"build_s": answer["load_s"] + answer["build_s"], **answer}


def own_words(arguments, case, function, lod_pixels):
    preset = json.loads(function_file(function).read_text())[0]
    return ["--size", arguments.picture, "--tf", function_file(function),
            f"--range={case.range[0]:.17g},{case.range[1]:.17g}", "--opacity-unit",
            preset["ScalarOpacityUnitDistance"] * case.length, "--background", "white", "--lod-pixels", lod_pixels,
            "--classify", "pixel", *case.camera_words()]


def converted(arguments, case):
    cache, told = arguments.folder / f"{case.name}.splats", arguments.folder / "convert.json"
    results.run([arguments.program, "convert", *case.files(), "-o", cache, "--scalar", case.scalar,
                 "--overwrite", "--stats", told])
    return cache, json.loads(told.read_text())


def drawn_by_us(arguments, case, made, function, technique, picture):
    cache, conversion = made
    told = arguments.folder / "render.json"
    words = own_words(arguments, case, function, OWN_TECHNIQUES[technique])
    results.run([arguments.program, "render", cache, "-o", picture, *words])
    frames = arguments.folder / "frame_%02d.png"
    results.run([arguments.program, "render", cache, "-o", frames, "--stats", told, *words,
                 "--orbit", 0.01 * (arguments.frames + 1), "--frames", arguments.frames + 1])
    for file in arguments.folder.glob("frame_*.png"):
        file.unlink()
    answer = json.loads(told.read_text())
    seconds = [frame["seconds"]["total"] for frame in answer["frames"]]
    splats = [frame["splats_drawn"] for frame in answer["frames"]]
    return {"splats": round(statistics.median(splats[1:] or splats)), "build_s": conversion["seconds"],
            "first_frame_s": seconds[0], "frames_s": seconds[1:],
            "peak_memory_bytes": answer["peak_memory_bytes"], "drawn_by": answer["backend"],
            "conversion_peak_memory_bytes": conversion["peak_memory_bytes"], "cache_bytes": conversion["cache_bytes"]}


def truth_of(arguments, case, function):
    """The reference picture; made once."""
    # One picture serves all grids of an analytic field; any other grid has its own.
    what = re.sub("(-tetrahedra|-body-centred(-cells)?)?-[0-9x]+$", "", case.name) if case.name != "fin" else f"fin_{pathlib.Path(case.grid).stem}"
    path = arguments.folder / f"truth_{what}_{function}_{arguments.picture}.pfm"
    if not path.exists():
        print(f"marching {path}", flush=True)
        results.run([arguments.reference, *case.truth, "--function", function, f"--range={case.range[0]:.17g},"
                     f"{case.range[1]:.17g}", "--length", case.length, "--size", arguments.picture,
                     *case.camera_words(), "-o", path])
    return path


def psnr_of(arguments, picture, truth):
    said = results.run([arguments.program, "compare", picture, truth])
    found = re.match(r"PSNR ([0-9.]+) dB", said)
    if not found:
        sys.exit(f"{picture}: expected a PSNR against {truth}, found: {said}")
    return float(found[1])


def rates_of(primitives, picture, seconds):
    """Primitives and pixels a second, of a picture such as "256x256"."""
    width, height = picture.split("x")
    return {"primitives_per_s": primitives / seconds, "pixels_per_s": int(width) * int(height) / seconds}


def measure(arguments, case, out):
    """Returns a row for every technique and function."""
    told = json.loads(results.run([arguments.program, "info", *case.files(), "--json"]))
    case.nodes = told["nodes"]
    made = converted(arguments, case)
    rows = []
    for function in arguments.functions:
        truth = truth_of(arguments, case, function)
        for technique in arguments.techniques:
            picture = arguments.folder / f"{case.name}_{function}_{technique}.png"
            if technique in OWN_TECHNIQUES:
                row = drawn_by_us(arguments, case, made, function, technique, picture)
            else:
                row = drawn_by_vtk(arguments, case, function, technique, picture)
            row |= {"case": case.name, "nodes": case.nodes, "function": function, "technique": technique,
                    "frame_s": statistics.median(row["frames_s"] or [row["first_frame_s"]]),
                    "psnr_db": psnr_of(arguments, picture, truth), "primitives": row[PRIMITIVES[technique]]}
            row |= rates_of(row["primitives"], arguments.picture, row["frame_s"])
            rows.append(row)
            print(line_of(row), flush=True)
            name = f"peers/{technique}/{case.name}/{function}"
            out.add(f"{name}/build", "s", [row["build_s"]])
            out.add(f"{name}/first_frame", "s", [row["first_frame_s"]])
            out.add(f"{name}/frame", "s", row["frames_s"] or [row["first_frame_s"]])
            out.add(f"{name}/peak_memory", "B", [row["peak_memory_bytes"]])
            out.add(f"{name}/psnr", "dB", [row["psnr_db"]])
    return rows


HEADING = ("| grid | function | drawn by | draws | build | first frame | frame | M a second | megapixels/s | peak | PSNR |\n"
           "|---|---|---|---|---|---|---|---|---|---|---|")


def line_of(row):
    primitives, primitives_per_s, pixels_per_s = (results.three_digits(1e-6 * row[name])
                                                  for name in ("primitives", "primitives_per_s", "pixels_per_s"))
    return (f"| {row['case']} | {row['function']} | {NAMES[row['technique']]} | {primitives} M {PRIMITIVES[row['technique']]} "
            f"| {row['build_s']:.2f} s | {row['first_frame_s']:.3f} s | {row['frame_s']:.3f} s | {primitives_per_s} "
            f"| {pixels_per_s} | {row['peak_memory_bytes'] / MIB:.0f} MiB | {row['psnr_db']:.1f} dB |")


def plots_of(rows, function):
    """Plots of seconds, memory and fidelity over the nodes of the half-annulus."""
    def lines(value):
        of = {}
        for row in rows:
            if row["function"] == function and row["case"] != "fin" and row["technique"] != "curvisplat-1px":
                of.setdefault(NAMES[row["technique"]], []).append((row["nodes"], row[value]))
        return {name: sorted(line) for name, line in of.items()}

    def plot(title, y_name, value, **more):
        return {"title": f"{title} ({function})", "x_name": "nodes", "y_name": y_name, "lines": lines(value),
                "log_values": True, **more}
    return [plot("Build, once", "seconds", "build_s"), plot("A frame", "seconds", "frame_s"),
            plot("Peak memory", "bytes", "peak_memory_bytes"), plot("Against the reference", "dB", "psnr_db", log_values=False)]


@contextlib.contextmanager
def display(named):
    """A virtual display for VTK, or the one that is named."""
    if named:
        os.environ["DISPLAY"] = named
        yield
        return
    if not shutil.which("Xvfb"):
        sys.exit("Xvfb: not installed, and VTK needs a display; apt-get install xvfb, or give --display")
    read, write = os.pipe()
    server = subprocess.Popen(["Xvfb", "-displayfd", str(write), "-screen", "0", "1280x1280x24", "-nolisten", "tcp"],
                              pass_fds=[write], stderr=subprocess.DEVNULL)
    os.close(write)
    try:
        with os.fdopen(read) as number:
            answer = number.readline().strip()
        if not answer:
            sys.exit("Xvfb: ended without opening a display")
        os.environ["DISPLAY"] = f":{answer}"
        yield
    finally:
        server.terminate()
        server.wait()


def python_with_vtk(named):
    tried = [named] if named else [sys.executable, "/usr/bin/python3"]
    for python in tried:
        if shutil.which(python) and subprocess.run([python, "-c", "import vtk"], capture_output=True).returncode == 0:
            return python
    sys.exit(f"{', '.join(tried)}: none of them has VTK; apt-get install --no-install-recommends python3-vtk9, "
             "or give --vtk-python")


def one_of(choices):
    def parse(text):
        chosen = text.split(",")
        if not set(chosen) <= set(choices):
            raise argparse.ArgumentTypeError(f"unknown name in '{text}'; expected some of {', '.join(choices)}")
        return chosen
    return parse


def parsed():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    every = [*VTK_TECHNIQUES, *OWN_TECHNIQUES]
    parser.add_argument("folder", type=pathlib.Path)
    parser.add_argument("--sizes", default="40x32x32,100x100x100", help="nodes of the half-annulus; '' for none")
    parser.add_argument("--tetrahedra", default="", help="the same, cut into tetrahedra: nodes of the grid")
    parser.add_argument("--body-centred", default="", help="tetrahedra of a body-centred lattice: numbers of cubes")
    parser.add_argument("--cells", action="store_true", help="the scalar of --body-centred in its cells")
    parser.add_argument("--fin", nargs=2, metavar=("GRID", "SOLUTION"), help="a PLOT3D grid and Q file")
    parser.add_argument("--functions", default=["smooth"], type=one_of(["smooth", "band", "step"]))
    parser.add_argument("--techniques", default=[one for one in every if one != "zsweep"], type=one_of(every))
    parser.add_argument("--picture", default="256x256")
    parser.add_argument("--frames", type=int, default=5, help="frames after the first")
    parser.add_argument("--seconds", type=float, default=30, help="VTK begins no further frame after this many seconds")
    parser.add_argument("--resample", type=int, default=128, help="samples along each axis")
    parser.add_argument("--program", default=ROOT / "build/release/tools/curvisplat", type=pathlib.Path)
    parser.add_argument("--reference", default=ROOT / "build/release/bench/curvisplat_reference", type=pathlib.Path)
    parser.add_argument("--vtk-python", help="a Python that has VTK 9")
    parser.add_argument("--display", help="display to draw on, for example one with a graphics card (default: a virtual one)")
    parser.add_argument("--json")
    parser.add_argument("--plot")
    parser.add_argument("--table")
    return parser.parse_args()


def main():
    arguments = parsed()
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(1))  # so that Xvfb is ended as well
    arguments.folder.mkdir(parents=True, exist_ok=True)
    version = results.version_of(arguments.program)
    if set(arguments.techniques) & set(VTK_TECHNIQUES):
        arguments.vtk_python = python_with_vtk(arguments.vtk_python)
    cases = [fin_case(arguments, *map(pathlib.Path, arguments.fin))] if arguments.fin else []
    cases += [scene_case(arguments, size) for size in arguments.sizes.split(",") if size]
    cases += [tetrahedra_case(arguments, size) for size in arguments.tetrahedra.split(",") if size]
    cases += [body_centred_case(arguments, cubes) for cubes in arguments.body_centred.split(",") if cubes]
    out, rows = results.Results(), []
    print(HEADING)
    with display(arguments.display):
        for case in cases:
            rows += measure(arguments, case, out)
    if arguments.table:
        pathlib.Path(arguments.table).write_text("\n".join([HEADING, *map(line_of, rows), ""]))
    if arguments.json:
        out.write(arguments.json, "peers", version, picture=arguments.picture, rows=rows)
    if arguments.plot and any(row["case"] != "fin" for row in rows):
        write_line_plots(arguments.program, arguments.plot, plots_of(rows, arguments.functions[0]))


if __name__ == "__main__":
    main()
