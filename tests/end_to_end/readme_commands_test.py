#!/usr/bin/env python3
"""Runs the commands that README.md and tools/REFERENCE.md quote, and checks those of all other pages, and their links.

    readme_commands_test.py PROGRAM      exit status 1 if anything failed, with a line for each failure

- In README.md and tools/REFERENCE.md every indented line that begins with `curvisplat` is run, in the order of the page, with
  small grids and pictures in place of large ones. All input files are made here.
- tools/demo.sh is run as it stands, but for building the program, which is the one tested.
- `curvisplat view` is run without a display: it has to fail for that reason, and not for its options.
- In all pages the scripts and programs of indented commands have to exist, scripts have to be executable, and the options have
  to be in their --help; presets and targets of CMake have to be defined. bench/README.md's scripts are run in short by
  bench/run.py --smoke.
- Relative links and pictures of every page have to lead to a file.
"""

import functools
import json
import math
import os
import re
import shlex
import shutil
import struct
import subprocess
import sys
import tempfile

ROOT = os.path.dirname(os.path.dirname(os.path.dirname(os.path.abspath(__file__))))
PAGES_WITH_COMMANDS = ["README.md", "tools/REFERENCE.md"]
NI, NJ, NK = 12, 10, 8  # of the grids made here

failures = []


def fail(page, text):
    failures.append(f"{page}: {text}")


def lattice():
    """Nodes of a bent block around (2, 2, 2), i fastest: (x, y, z)."""
    for k in range(NK):
        for j in range(NJ):
            for i in range(NI):
                angle, radius = math.pi * i / (NI - 1), 1 + 3 * j / (NJ - 1)
                yield 4 - radius * math.cos(angle), radius * math.sin(angle), 5 * k / (NK - 1)


def write_plot3d(folder):
    """A grid and a Q file: single precision, big-endian, without record markers, as NASA's blunt fin; and a series of two."""
    nodes = list(lattice())
    dimensions = struct.pack(">3i", NI, NJ, NK)
    with open(os.path.join(folder, "bluntfinxyz.bin"), "wb") as file:
        file.write(dimensions)
        for axis in range(3):
            file.write(struct.pack(f">{len(nodes)}f", *(node[axis] for node in nodes)))
    density = [1 + 0.5 * math.sin(x + y) for x, y, _ in nodes]
    momentum = [[2 * d for d in density], [0.1 * d for d in density], [0.0] * len(density)]
    energy = [2.5 + 3 * d for d in density]
    with open(os.path.join(folder, "bluntfinq.bin"), "wb") as file:
        file.write(dimensions + struct.pack(">4f", 2.95, 0, 1e6, 0))
        for values in [density, *momentum, energy]:
            file.write(struct.pack(f">{len(values)}f", *values))
    shutil.copy(os.path.join(folder, "bluntfinxyz.bin"), os.path.join(folder, "grid.xyz"))
    for step in ("0", "1"):
        shutil.copy(os.path.join(folder, "bluntfinq.bin"), os.path.join(folder, f"q.{step}"))


def write_vts(folder):
    """An ASCII .vts file with a scalar p and a vector U."""
    nodes = list(lattice())
    points = " ".join(f"{x:.6g} {y:.6g} {z:.6g}" for x, y, z in nodes)
    pressure = " ".join(f"{math.sin(x) + z:.6g}" for x, _, z in nodes)
    velocity = " ".join(f"{y:.6g} {-x:.6g} 0.1" for x, y, _ in nodes)
    extent = f"0 {NI - 1} 0 {NJ - 1} 0 {NK - 1}"
    with open(os.path.join(folder, "flow.vts"), "w") as file:
        file.write(
            f'<VTKFile type="StructuredGrid" version="0.1" byte_order="LittleEndian">'
            f'<StructuredGrid WholeExtent="{extent}"><Piece Extent="{extent}"><PointData>'
            f'<DataArray type="Float32" Name="p" format="ascii">{pressure}</DataArray>'
            f'<DataArray type="Float32" Name="U" NumberOfComponents="3" format="ascii">{velocity}</DataArray>'
            f'</PointData><Points><DataArray type="Float32" Name="Points" NumberOfComponents="3" format="ascii">'
            f"{points}</DataArray></Points></Piece></StructuredGrid></VTKFile>\n")


def write_tecplot(folder):
    """A text file of one ordered zone, with a scalar p."""
    with open(os.path.join(folder, "jet.dat"), "w") as file:
        file.write(f'VARIABLES = "x" "y" "z" "p"\nZONE I={NI} J={NJ} K={NK} DATAPACKING=POINT\n')
        file.writelines(f"{x:.6g} {y:.6g} {z:.6g} {math.sin(x) + z:.6g}\n" for x, y, z in lattice())


def write_netcdf(path, dimensions, variables):
    """A file in NetCDF's classic format. `variables`: (name, numbers of its dimensions, attributes, values)."""
    def text(name):
        data = name.encode()
        return struct.pack(">i", len(data)) + data + b"\0" * (-len(data) % 4)

    def attributes(pairs):
        return struct.pack(">2i", 12, len(pairs)) + b"".join(
            text(name) + struct.pack(">i", 2) + text(value) for name, value in pairs)

    head = b"CDF\x01" + struct.pack(">i", 0)
    head += struct.pack(">2i", 10, len(dimensions))
    head += b"".join(text(name) + struct.pack(">i", length) for name, length in dimensions)
    head += attributes([("Conventions", "CF-1.8")])
    head += struct.pack(">2i", 11, len(variables))
    entries = [text(name) + struct.pack(f">{1 + len(shape)}i", len(shape), *shape) + attributes(pairs) +
               struct.pack(">2i", 5, 4 * len(values)) for name, shape, pairs, values in variables]
    begin = len(head) + sum(len(entry) + 4 for entry in entries)
    with open(path, "wb") as file:
        file.write(head)
        for entry, (_, _, _, values) in zip(entries, variables):
            file.write(entry + struct.pack(">i", begin))
            begin += 4 * len(values)
        for _, _, _, values in variables:
            file.write(struct.pack(f">{len(values)}f", *values))


def write_ocean(folder):
    """temp(depth, lat, lon) along axes; and the same on a curvilinear grid whose coordinates are in a file of their own."""
    temperatures = [20 - 2 * k + math.sin(0.5 * i) + math.cos(0.4 * j)
                    for k in range(NK) for j in range(NJ) for i in range(NI)]
    depth = ("depth", [0], [("standard_name", "depth"), ("units", "m"), ("positive", "down")],
             [10.0 * (k + 1) ** 2 for k in range(NK)])
    lat, lon = ([("standard_name", name), ("units", unit)] for name, unit in (("latitude", "degrees_north"),
                                                                              ("longitude", "degrees_east")))
    write_netcdf(os.path.join(folder, "ocean.nc"), [("depth", NK), ("lat", NJ), ("lon", NI)], [
        depth, ("lat", [1], lat, [40 + 0.5 * j for j in range(NJ)]), ("lon", [2], lon, [0.5 * i - 20 for i in range(NI)]),
        ("temp", [0, 1, 2], [("units", "degC")], temperatures)])
    dimensions = [("depth", NK), ("y", NJ), ("x", NI)]
    write_netcdf(os.path.join(folder, "his.nc"), dimensions, [
        depth, ("temp", [0, 1, 2], [("units", "degC"), ("coordinates", "lat lon")], temperatures)])
    write_netcdf(os.path.join(folder, "grid.nc"), dimensions[1:], [
        ("lat", [0, 1], lat, [40 + 0.5 * j + 0.1 * i for j in range(NJ) for i in range(NI)]),
        ("lon", [0, 1], lon, [0.5 * i - 20 - 0.1 * j for j in range(NJ) for i in range(NI)])])


def write_stl(folder):
    """A plate of two triangles."""
    corners = [(0, 0, 2), (4, 0, 2), (4, 4, 2), (0, 4, 2)]
    with open(os.path.join(folder, "plate.stl"), "w") as file:
        file.write("solid plate\n")
        for triangle in ((0, 1, 2), (0, 2, 3)):
            file.write("facet normal 0 0 1\nouter loop\n")
            file.writelines("vertex {} {} {}\n".format(*corners[n]) for n in triangle)
            file.write("endloop\nendfacet\n")
        file.write("endsolid plate\n")


def make_tetrahedra(folder):
    """A cube of 6 tetrahedra, with pressure at the points."""
    points = [(i, j, k) for k in (0, 1) for j in (0, 1) for i in (0, 1)]
    cells = [(0, 1, 3, 7), (0, 3, 2, 7), (0, 2, 6, 7), (0, 6, 4, 7), (0, 4, 5, 7), (0, 5, 1, 7)]
    words = lambda rows: " ".join(str(number) for row in rows for number in row)
    with open(os.path.join(folder, "body.vtu"), "w") as file:
        file.write(f"""<VTKFile type="UnstructuredGrid"><UnstructuredGrid><Piece NumberOfPoints="8" NumberOfCells="6">
<Points><DataArray type="Float32" NumberOfComponents="3">{words(points)}</DataArray></Points>
<Cells><DataArray type="Int32" Name="connectivity">{words(cells)}</DataArray>
<DataArray type="Int32" Name="offsets">4 8 12 16 20 24</DataArray>
<DataArray type="UInt8" Name="types">10 10 10 10 10 10</DataArray></Cells>
<PointData><DataArray type="Float32" Name="p">0 1 2 3 4 5 6 7</DataArray></PointData>
</Piece></UnstructuredGrid></VTKFile>""")


def make_inputs(folder):
    make_tetrahedra(folder)
    write_plot3d(folder)
    write_stl(folder)
    write_vts(folder)
    write_tecplot(folder)
    write_ocean(folder)
    os.symlink(os.path.join(ROOT, "tests/data/cgns/flow.cgns"), os.path.join(folder, "delta_vertex.cgns"))
    os.symlink(os.path.join(ROOT, "tools"), os.path.join(folder, "tools"))


def shortened(words):
    """The same command, for a grid or picture of a few pixels."""
    words = list(words)
    for n, word in enumerate(words[:-1]):
        if word == "--size":
            words[n + 1] = "48x24x16" if words[1] == "generate" else "96x54"
        elif word in ("--frames", "--until"):
            words[n + 1] = "2"
    if words[1] == "render" and "--size" not in words:
        words += ["--size", "64x64"]
    if words[1] == "bench":
        words += ["--size", "64x64"] + ([] if "--quick" in words else ["--quick"])
    return words


def run_command(page, line, program, folder):
    words = shlex.split(line, comments=True)
    environment = {name: value for name, value in os.environ.items() if name not in ("DISPLAY", "WAYLAND_DISPLAY")}
    environment["XDG_CONFIG_HOME"] = os.path.join(folder, "config")
    command = shortened(words)
    if words[1] == "serve":  # goes on for ever; its tests are in tests/serve
        command = ["curvisplat", "serve", "--help"]
    result = subprocess.run([program, *command[1:]], cwd=folder, env=environment, stdin=subprocess.DEVNULL,
                            capture_output=True, text=True, errors="replace", check=False)
    said = result.stderr.strip()
    if words[1] == "view":
        if result.returncode != 1 or "DISPLAY" not in said:
            fail(page, f"{line}: status {result.returncode} without a display; expected 1 and the reason: {said}")
    elif result.returncode != 0:
        fail(page, f"{line}: status {result.returncode}: {said}")


def indented_commands(text):
    """Also those that go on behind a backslash, or are joined by &&."""
    for block in re.findall(r"^(?: {4}){1,2}(\S.*(?:\\\n.*)*)$", text, re.MULTILINE):
        yield from (command.strip() for command in re.sub(r"\\\n\s*", "", block).split("&&"))


def check_script(page, path):
    full = os.path.join(ROOT, path)
    if not os.path.isfile(full):
        fail(page, f"{path} does not exist")
    elif not os.access(full, os.X_OK):
        fail(page, f"{path} is not executable")


@functools.cache
def help_of(*command):
    """What --help prints; None if it cannot be run here."""
    result = subprocess.run([*command, "--help"], stdin=subprocess.DEVNULL, capture_output=True, text=True, check=False)
    if "ModuleNotFoundError" in result.stderr:
        return None
    return result.stdout + result.stderr


def check_options(page, line, words, known):
    if known is None:
        return
    for word in words:
        option = word.strip("[]").split("=")[0]
        if option.startswith("--") and not re.search(re.escape(option) + r"\b", known):
            fail(page, f"{line}: {words[0]} has no option {option}")


def check_cmake(page, line, words):
    with open(os.path.join(ROOT, "CMakePresets.json"), encoding="utf-8") as file:
        presets = {preset["name"] for preset in json.load(file)["configurePresets"]}
    defined = ""
    for folder, _, names in os.walk(ROOT):
        if "CMakeLists.txt" in names and "/build" not in folder[len(ROOT):]:
            with open(os.path.join(folder, "CMakeLists.txt"), encoding="utf-8") as file:
                defined += file.read()
    for word, value in zip(words, words[1:]):
        if word == "--preset" and value not in presets:
            fail(page, f"{line}: there is no preset {value}")
        if word == "--target" and not re.search(rf"\((?:TARGET )?{value}\b", defined):
            fail(page, f"{line}: there is no target {value}")
    for option in re.findall(r"-D(CURVISPLAT_\w+)=", line):
        if not re.search(rf"\(\s*{option}\b", defined):
            fail(page, f"{line}: there is no option {option}")


@functools.cache
def is_target(build, name):
    """Whether a program of this name is built there, at some time."""
    path = os.path.join(build, "build.ninja")
    if not os.path.exists(path):
        return True
    with open(path, encoding="utf-8") as file:
        return re.search(rf"[ /]{name}:", file.read()) is not None


def check_command(page, line, program):
    """A command that is not run: what it names has to exist."""
    build = os.path.dirname(os.path.dirname(program))
    try:
        words = shlex.split(line, comments=True)
    except ValueError:  # an apostrophe: a diagram, not a command
        return
    while words and (re.match(r"[A-Z_]+=", words[0]) or words[0] in ("xvfb-run", "sudo")):
        words = words[1:]
    if words and words[0] in ("mpirun", "srun") and "curvisplat" in words:
        words = words[words.index("curvisplat"):]
    if len(words) < 2:
        return
    if words[0] == "curvisplat" and re.fullmatch(r"[a-z]+", words[1]):
        known = help_of(program, words[1])
        if "Usage:" not in known or words[1] not in known:
            fail(page, f"{line}: there is no subcommand {words[1]}")
        check_options(page, line, words, known)
    elif re.match(r"(tools|bench|tests)/[\w/]+\.(py|sh)$", words[0]):
        check_script(page, words[0])
        if words[0].endswith(".py"):
            check_options(page, line, words, help_of(sys.executable, os.path.join(ROOT, words[0])))
    elif words[0].startswith("build/release/") and os.path.isdir(os.path.join(build, "bench")):
        path = os.path.join(build, words[0][len("build/release/"):])
        if os.path.exists(path):
            check_options(page, line, words, help_of(path))
        elif not is_target(build, os.path.basename(path)):
            fail(page, f"{line}: {words[0]} is not built by that name")
    elif words[0] == "cmake":
        check_cmake(page, line, words)


def check_links(page, text):
    for target in re.findall(r"\]\(([^)#\s]+)(?:#[^)]*)?\)", text):
        if "://" in target:
            continue
        if not os.path.exists(os.path.join(ROOT, os.path.dirname(page), target)):
            fail(page, f"link to {target}, which does not exist")


def run_demo(program, folder):
    result = subprocess.run([os.path.join(ROOT, "tools/demo.sh")], stdin=subprocess.DEVNULL, capture_output=True, text=True,
                            env={**os.environ, "CURVISPLAT": program, "OUT": os.path.join(folder, "demo")}, check=False)
    picture = os.path.join(folder, "demo/demo.png")
    if result.returncode != 0 or f"Wrote {picture}" not in result.stdout or not os.path.exists(picture):
        fail("README.md", f"tools/demo.sh: exit status {result.returncode}: {result.stdout}{result.stderr}")


def pages():
    for folder, folders, names in os.walk(ROOT):
        folders[:] = [name for name in folders if name not in (".git", "build", "out")]
        for name in names:
            if name.endswith(".md"):
                yield os.path.relpath(os.path.join(folder, name), ROOT)


def main():
    if len(sys.argv) != 2:
        sys.exit(__doc__)
    program = os.path.abspath(sys.argv[1])
    with tempfile.TemporaryDirectory() as folder:
        make_inputs(folder)
        for page in PAGES_WITH_COMMANDS:
            with open(os.path.join(ROOT, page), encoding="utf-8") as file:
                text = file.read()
            run = 0
            for line in indented_commands(text):
                if line.startswith("curvisplat "):
                    run_command(page, line, program, folder)
                    run += 1
            if run == 0:
                fail(page, "quotes no command; is it laid out differently?")
        run_demo(program, folder)
    for page in pages():
        with open(os.path.join(ROOT, page), encoding="utf-8") as file:
            text = file.read()
        check_links(page, text)
        for path in re.findall(r"`((?:tools|bench|tests)/[\w/]+\.(?:sh|py))\b", text):
            check_script(page, path)
        for line in indented_commands(text):
            if page not in PAGES_WITH_COMMANDS or not line.startswith("curvisplat "):
                check_command(page, line, program)
    for failure in failures:
        print(failure, file=sys.stderr)
    sys.exit(1 if failures else 0)


if __name__ == "__main__":
    main()
