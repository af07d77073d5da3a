#!/usr/bin/env python3
"""Layers seen obliquely, against integrals: do splats come in the order of the layers?

    bench/layered.py CURVISPLAT [--quick] [--limit E] [--backend cpu|osmesa|egl] [--only REGEX]

slab            cells 24 to 480 times as wide as thick, f = 0 to 1 from the bottom to the top, optical depth 3 across, seen from above to 80
                degrees, by parallel rays and in perspective; grey values of the middle of the picture
levels          the slab of 256 x 256 x 64 nodes at 0, 4 and 16 pixels, also with a clip plane and with a slice in it
ocean           a patch of a sphere, 16 layers, a thousandth of the radius deep, f and the optical depth as the slab's, where it is seen
                at 0, 30, 60 and 70 degrees; cells of one degree, and of a quarter
closed          four scenes whose pixels are integrals along one ray each: the slab, a shell a tenth of its radius deep, a boundary
                layer on a cylinder, an ocean a thousandth of the radius deep; from 0 to 80 degrees, by parallel rays and in
                perspective, at 0, 1, 4 and 16 pixels: 160 pictures, of cells of about a pixel
boundary layer  half a cylinder, 21 layers within 0.04 of the wall (1e-4 to 9e-3 thick), f = 1 - sqrt(distance / 0.04), by the functions
                "smooth" and "band" of bench/fidelity per 0.02 of length; from the front, obliquely, and from the top

Prints truth, mean error and rms, of the boundary layer PSNR, also two pixels inside of its outline; of the closed scenes a table of mean
errors, of the worst channel.
--limit: exit status 1 if a mean error is larger, at 4 and 16 pixels if it is twice as large. --quick: the slabs, and closed scenes of
larger cells at 30 and 60 degrees, at 0 and 16 pixels.
Needs numpy.
"""
import argparse
import json
import math
import pathlib
import re
import subprocess
import sys
import tempfile

try:
    import numpy as np
except ImportError:
    print("layered: needs numpy; skipped")
    sys.exit(77)

CROSS = 3.0  # optical depth of a slab, at right angles


class Judge:
    """Prints what differs, and keeps the worst."""

    def __init__(self, only):
        self.only, self.worst = re.compile(only), 0.0

    def wants(self, what):
        return self.only.search(what) is not None

    def compare(self, what, drawn, truth):
        error = drawn - truth
        of_channels = error.reshape(-1, error.shape[-1] if error.ndim > 1 else 1).mean(0)
        worst = of_channels[np.abs(of_channels).argmax()]
        self.worst = max(self.worst, abs(worst) / (2 if re.search(r" (4|16) pixels", what) else 1))
        print(f"{what:58} truth {truth.mean():.4f}  mean error {error.mean():+.4f}  rms {error.std():.4f}", flush=True)
        return worst


class Program:
    def __init__(self, path, folder, backend):
        self.path, self.folder, self.backend = path.resolve(), folder, backend

    def run(self, *words):
        done = subprocess.run([self.path, *map(str, words)], capture_output=True, text=True, cwd=self.folder)
        if done.returncode:
            sys.exit(f"layered: {' '.join(map(str, words))}: {done.stderr.strip()}")

    def convert(self, name, x, y, z, f):
        """A PLOT3D grid with one function."""
        for suffix, head, arrays in ((".xyz", x.shape, (x, y, z)), (".fun", (*x.shape, 1), (f,))):
            with open(self.folder / (name + suffix), "wb") as out:
                np.array(head, "<i4").tofile(out)
                for array in arrays:
                    array.astype("<f8").ravel(order="F").tofile(out)
        self.run("convert", name + ".xyz", name + ".fun", "-o", name + ".splats", "--overwrite")

    def render(self, name, *options):
        self.run("render", name + ".splats", "-o", "a.pfm", "--backend", self.backend, *options)
        with open(self.folder / "a.pfm", "rb") as file:
            channels = 3 if file.readline().strip() == b"PF" else 1
            width, height = map(int, file.readline().split())
            file.readline()
            return np.fromfile(file, "<f4").reshape(height, width, channels)


def seen_of_slab(cosines, top=1.0):
    """The integral of f exp(-tau) from f = top down to 0, for rays at these angles with the slab's normal."""
    s = (np.arange(20000) + 0.5) / 20000
    tau = (top * CROSS / np.asarray(cosines, float)).reshape(-1, 1)
    return (top * (1 - s) * np.exp(-tau * s)).sum(1) * tau[:, 0] / 20000


def convert_slab(program, nodes, layers, thickness):
    i, j, k = np.meshgrid(np.arange(nodes), np.arange(nodes), np.arange(layers), indexing="ij")
    at = [i / (nodes - 1) - 0.5, j / (nodes - 1) - 0.5, (k / (layers - 1) - 0.5) * thickness]
    program.convert("slab", *at, k / (layers - 1.0))


def seen_with_slice(cosine, value, opacity=0.5):
    """The same of the whole slab with a slice within it, where f is `value`."""
    before = math.exp(-(1 - value) * CROSS / cosine)
    return seen_of_slab([cosine]) + before * opacity * (value - seen_of_slab([cosine], value))


def draw_slab(program, thickness, degrees, level, perspective, *more):
    """The middle of the picture, and what is true there without `more` options."""
    pixels, angle = 300, math.radians(degrees)
    eye = 4 * np.array([0.8 * math.sin(angle), 0.6 * math.sin(angle), math.cos(angle)])
    lens = ("--view-angle", "17") if perspective else ("--parallel-scale", "0.6")
    picture = program.render(
        "slab", "--size", f"{pixels}x{pixels}", "--position=%g,%g,%g" % tuple(eye), "--focal-point", "0,0,0", "--view-up",
        "0,1,0.0001", *lens, "--background", "black", "--range", "0,1", "--opacity", "0:0.5,1:0.5", "--opacity-unit",
        repr(math.log(2) * thickness / CROSS), "--tf", "grey", "--lod-pixels", level, *more)
    rows, columns = (slice(140, 160), slice(140, 160)) if degrees < 60 else (slice(147, 153), slice(130, 170))
    drawn = picture[rows, columns, 0].ravel()
    if not perspective:
        return drawn, seen_of_slab([math.cos(angle)]).repeat(drawn.size)
    forward = -eye / np.linalg.norm(eye)
    right = np.cross(forward, [0, 1, 0.0001])
    right /= np.linalg.norm(right)
    down = np.cross(forward, right)
    tangent = (np.arange(pixels) + 0.5 - pixels / 2) * math.tan(math.radians(8.5)) / (pixels / 2)
    across, along = np.meshgrid(tangent[columns], -tangent[rows])  # a PFM's first row is the lowest
    rays = forward + across[..., None] * right + along[..., None] * down
    return drawn, seen_of_slab((np.abs(rays[..., 2]) / np.linalg.norm(rays, axis=-1)).ravel())


def slabs(program, judge, quick):
    for thickness in (0.1, 0.02, 0.001):
        convert_slab(program, 32, 16, thickness)
        for degrees in (0, 10, 30, 60, 80) if thickness < 0.1 else (0, 10, 30):
            for perspective in (False, True):
                what = f"slab, {1.5 / thickness / 3.1:.0f} times as wide, {degrees} degrees" + ", perspective" * perspective
                if judge.wants(what):
                    judge.compare(what, *draw_slab(program, thickness, degrees, "0", perspective))
    if quick or not judge.wants("levels"):
        return
    convert_slab(program, 256, 64, 0.02)
    value, plane = 0.6, "0,0,0.002,0,0,-1"
    for degrees in (0, 30, 60):
        cosine = math.cos(math.radians(degrees))
        for level in ("0", "4", "16"):
            for name, truth, more in (("", seen_of_slab([cosine]), ()),
                                      (", cut", seen_of_slab([cosine], value), ("--clip-plane", plane)),
                                      (", sliced", seen_with_slice(cosine, value), ("--slice", plane, "--slice-opacity", "0.5"))):
                what = f"levels, {degrees} degrees, {level} pixels{name}"
                if judge.wants(what):
                    judge.compare(what, draw_slab(program, 0.02, degrees, level, False, *more)[0], truth)


def oceans(program, judge):
    for nodes in ((161, 41, 16), (641, 161, 16)):
        ocean(program, judge, nodes)


def ocean(program, judge, nodes):
    """From the equator, where the eye is: a point at a longitude is seen at that angle."""
    depth, pixels, half = 1e-3, 300, 1.05
    i, j, k = np.meshgrid(*(np.linspace(0, 1, n) for n in nodes), indexing="ij")
    longitude, latitude, radius = math.pi * 0.9 * (i - 0.5), 0.8 * (j - 0.5), 1 - depth * (1 - k)
    at = [radius * np.cos(latitude) * np.cos(longitude), radius * np.cos(latitude) * np.sin(longitude), radius * np.sin(latitude)]
    program.convert("ocean", *at, k)
    picture = program.render(
        "ocean", "--size", f"{pixels}x{pixels}", "--position", "4,0,0", "--focal-point", "0,0,0", "--view-up", "0,0,1",
        "--parallel-scale", repr(half), "--background", "black", "--range", "0,1", "--opacity", "0:0.5,1:0.5", "--opacity-unit",
        repr(math.log(2) * depth / CROSS), "--tf", "grey", "--lod-pixels", "0")
    across = ((np.arange(pixels) + 0.5) / pixels * 2 - 1) * half
    rows = slice(148, 152)
    for degrees in (0, 30, 60, 70):
        what = f"ocean, cells of {162 / (nodes[0] - 1):.2g} degrees, {degrees} degrees"
        columns = np.abs(across - math.sin(math.radians(degrees))) < 0.015
        if judge.wants(what):
            y, z = np.meshgrid(across[columns], across[rows])
            judge.compare(what, picture[rows][:, columns, 0].ravel(), seen_of_slab(np.sqrt(1 - y**2 - z**2).ravel()))


class Closed:
    """Layers whose r goes from 1 - depth to 1, with r^2 a sum of some squares of x, y and z: planes, cylinders or spheres. They are seen
    where they meet the z axis. f(s) has s = 0 at the inside and 1 at the outside; extinction(f) and colour(f) are given."""

    def __init__(self, name, squares, depth, half, nodes, distances=None):
        self.name, self.squares, self.depth, self.half, self.nodes = name, np.array(squares, float), depth, half, nodes
        self.distances = np.linspace(0, depth, nodes[2]) if distances is None else distances
        self.wall = distances is not None  # a boundary layer, which is drawn with colours
        self.background = float(self.wall)

    def f(self, above):
        return 1 - np.sqrt(np.clip(above / WALL, 0, 1)) if self.wall else np.clip(above / self.depth, 0, 1)

    def convert(self, program):
        u, v, d = np.meshgrid(*(np.linspace(-h, h, n) for h, n in zip(self.half, self.nodes)), self.distances, indexing="ij")
        r = 1 - self.depth + d
        across, along = self.squares[:2] > 0
        x = r * np.sin(u) * (np.cos(v) if along else 1) if across else u
        z = r * (np.cos(u) if across else 1) * (np.cos(v) if along else 1)
        program.convert(self.name, x, r * np.sin(v) if along else v, z, self.f(d))

    def truth(self, eyes, rays):
        """The colour of each ray, by 4000 midpoints between its entrance and its exit."""
        a, b, c = (self.squares * rays**2).sum(-1), (self.squares * eyes * rays).sum(-1), (self.squares * eyes**2).sum(-1)
        inner = b * b - a * (c - (1 - self.depth) ** 2)
        begin = (-b - np.sqrt(b * b - a * (c - 1))) / a
        end = (-b + np.where(inner > 0, -np.sqrt(np.abs(inner)), np.sqrt(b * b - a * (c - 1)))) / a
        share = (np.arange(4000) + 0.5) / 4000
        t = begin[:, None] + (end - begin)[:, None] * share
        f = self.f(np.sqrt(a[:, None] * t * t + 2 * b[:, None] * t + c[:, None]) - (1 - self.depth))
        density = FUNCTIONS["smooth"](f) / LENGTH if self.wall else np.full_like(f, CROSS / self.depth)
        left = np.exp(-np.cumsum(np.pad(density * ((end - begin) / 4000)[:, None], ((0, 0), (1, 0))), 1))
        weights = left[:, :-1] - left[:, 1:]
        shown = colours(f) if self.wall else [f]
        return np.stack([(weights * one).sum(1) + self.background * left[:, -1] for one in shown], 1)

    def function(self, program):
        if not self.wall:
            return "--opacity", "0:0.5,1:0.5", "--opacity-unit", repr(math.log(2) * self.depth / CROSS), "--tf", "grey"
        write_function(program.folder / "function.json", FUNCTIONS["smooth"])
        return "--opacity-unit", repr(0.05 * LENGTH), "--tf", "function.json"

    def draw(self, program, degrees, perspective, level, pixel=0.002, pixels=200):
        """The middle of the picture, and what is true there; where that is, and the camera of parallel rays."""
        angle, distance = math.radians(degrees), 1.0 if perspective else 4.0
        back = np.array([0.8 * math.sin(angle), 0.6 * math.sin(angle), math.cos(angle)])
        focus = np.array([0, 0, 1.0])
        eye, half = focus + distance * back, pixel * pixels / 2
        lens = ("--view-angle", repr(2 * math.degrees(math.atan(half)))) if perspective else ("--parallel-scale", repr(half))
        picture = program.render(
            self.name, "--size", f"{pixels}x{pixels}", "--position=%.9g,%.9g,%.9g" % tuple(eye), "--focal-point", "0,0,1", "--view-up",
            "0,1,0.0001", *lens, "--range", "0,1", "--lod-pixels", level, "--background",
            "white" if self.background else "black", *self.function(program))
        reach = 10 if degrees < 80 else 3
        window = slice(pixels // 2 - reach, pixels // 2 + reach)
        right = np.cross([0, 1, 0.0001], back)
        right /= np.linalg.norm(right)
        at = (np.arange(2 * reach) - reach + 0.5) * pixel
        across, up = np.meshgrid(at, at)  # a PFM's first row is the lowest
        offsets = (across[..., None] * right + up[..., None] * np.cross(back, right)).reshape(-1, 3)
        eyes = eye + (0 if perspective else offsets)
        rays = -back + (offsets if perspective else 0 * offsets)
        rays = rays / np.linalg.norm(rays, axis=1)[:, None]
        drawn = picture[window, window].reshape(len(rays), -1)
        truth = self.truth(np.broadcast_to(eyes, rays.shape), rays)
        camera = {"position": list(eye), "focal_point": [0, 0, 1], "view_up": [0, 1, 0.0001], "parallel_scale": half}
        return drawn[:, :truth.shape[1]], truth, window, camera


def closed_scenes(cell):
    """Scenes of cells of this size, of twice that where rays are long; the radius is 1."""
    distances = 1e-4 * np.cumsum(np.r_[0, 1.25 ** np.arange(21)])
    count, wide = (round(extent / cell) + 1 for extent in (0.6, 0.5))
    return [Closed("slab", (0, 0, 1), 0.02, (0.3, 0.3), (count, count, 16)),
            Closed("shell", (1, 1, 1), 0.1, (0.5, 0.5), (wide, wide, 24)),
            Closed("layer", (1, 0, 1), distances[-1], (0.6, 0.5), (count, wide, len(distances)), distances),
            Closed("ocean", (1, 1, 1), 1e-3, (0.3, 0.3), (count, count, 16))]


def closed(program, judge, cell, angles, levels):
    table = [f"| scene, {', '.join(map(str, angles))} degrees | parallel | perspective |", "|---|---|---|"]
    for scene in closed_scenes(cell):
        scene.convert(program)
        for level in levels:
            row = [f"{scene.name}, {level} pixels"]
            for perspective in (False, True):
                errors = []
                for degrees in angles:
                    what = f"closed, {row[0]}{', perspective' * perspective}, {degrees} degrees"
                    if judge.wants(what):
                        errors.append(judge.compare(what, *scene.draw(program, degrees, perspective, level)[:2]))
                row.append(", ".join(f"{error:+.3f}" for error in errors))
            table.append(f"| {' | '.join(row)} |")
    print("\n".join(table))


LENGTH, WALL, HALF = 0.02, 0.04, 0.7  # of the functions; the layer's thickness; the camera's parallel scale
FUNCTIONS = {"smooth": lambda f: 8 * f * f, "band": lambda f: 24 * np.exp(-((f - 0.5) ** 2) / 0.0018)}


def colours(f):
    return [np.clip(2 * f - 0.4, 0, 1), np.clip(1 - 2.5 * abs(f - 0.5), 0, 1), np.clip(1 - 2 * f, 0, 1)]


def write_function(path, extinction):
    f = np.arange(2049) / 2048
    points = np.stack([f, 1 - np.exp(-extinction(f) * 0.05), 0 * f + 0.5, 0 * f], 1).ravel()
    rgb = np.stack([f, *colours(f)], 1).ravel()
    path.write_text(json.dumps([{"Name": "x", "ColorSpace": "RGB", "RGBPoints": list(rgb), "Points": list(points),
                                 "ScalarOpacityUnitDistance": 0.05}]))


def march(pixels, position, focus, up, extinction, thickest):
    """The picture by fine sums along each pixel's ray."""
    back = np.subtract(position, focus)
    back = back / np.linalg.norm(back)
    right = np.cross(up, back)
    right /= np.linalg.norm(right)
    above = np.cross(back, right)
    picture, steps = np.zeros((pixels, pixels, 3)), 12000
    u, t = (np.arange(pixels) + 0.5) / pixels * 2 - 1, np.linspace(1.6, -1.6, steps)
    for row in range(pixels):
        at = focus + u[row] * HALF * above + (u * HALF)[:, None] * right
        at = at[:, None, :] + t[None, :, None] * back
        wall = np.hypot(at[..., 0], at[..., 1]) - 0.5
        inside = (wall >= 0) & (wall <= thickest) & (at[..., 1] >= 0) & (at[..., 2] >= 0) & (at[..., 2] <= 1)
        f = 1 - np.sqrt(np.clip(wall / 0.04, 0, 1))
        depth = np.cumsum(np.where(inside, extinction(f) / LENGTH * 3.2 / steps, 0), 1)
        left = np.exp(-np.concatenate([np.zeros((pixels, 1)), depth], 1))
        weight = left[:, :-1] - left[:, 1:]
        picture[row] = np.stack([(weight * c).sum(1) + left[:, -1] for c in colours(f)], 1)
    return picture


def boundary_layers(program, judge, pixels=128):
    distance = 1e-4 * np.cumsum(np.r_[0, 1.25 ** np.arange(39)])
    distance = distance[distance < 0.5]
    angle, d, z = np.meshgrid(np.linspace(0, math.pi, 65), distance, np.linspace(0, 1, 17), indexing="ij")
    program.convert("layer", (0.5 + d) * np.cos(angle), (0.5 + d) * np.sin(angle), z, 1 - np.sqrt(np.minimum(1, d / 0.04)))
    focus = np.array([0, 0.3, 0.5])
    for view, position, up in (("front", (0, 4, 0.5), (0, 0, 1)), ("oblique", (2, 3, 2), (0, 0, 1)), ("top", (1.2, 1, 4), (0, 1, 0))):
        for name, extinction in FUNCTIONS.items():
            what = f"boundary layer, {view}, {name}"
            if not judge.wants(what):
                continue
            write_function(program.folder / "function.json", extinction)
            drawn = program.render("layer", "--size", f"{pixels}x{pixels}", "--position=%g,%g,%g" % position, "--focal-point",
                                   "0,0.3,0.5", "--view-up", "%g,%g,%g" % up, "--parallel-scale", HALF, "--tf", "function.json",
                                   "--range=0,1", "--opacity-unit", 0.05 * LENGTH, "--background", "white", "--lod-pixels", "0")
            truth = march(pixels, position, focus, up, extinction, distance[-1])
            data = truth.min(2) < 0.95
            inside = data.copy()  # by two pixels: a ray through its middle is not the truth of a pixel at the outline
            for _ in range(2):
                inside &= np.roll(inside, 1, 0) & np.roll(inside, -1, 0) & np.roll(inside, 1, 1) & np.roll(inside, -1, 1)
            psnr, of_inside = (-10 * math.log10(((drawn - truth)[where] ** 2).mean()) for where in (data | True, inside))
            judge.compare(f"{what}: {psnr:.1f} dB, inside {of_inside:.1f} dB; where data is", drawn[data], truth[data])


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("program", type=pathlib.Path)
    parser.add_argument("--quick", action="store_true")
    parser.add_argument("--limit", type=float)
    parser.add_argument("--backend", default="cpu")
    parser.add_argument("--only", default="")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        program, judge = Program(options.program, pathlib.Path(folder), options.backend), Judge(options.only)
        slabs(program, judge, options.quick)
        if judge.wants("closed"):
            closed(program, judge, *((0.004, (30, 60), (0, 16)) if options.quick else (0.002, (0, 10, 30, 60, 80), (0, 1, 4, 16))))
        if not options.quick:
            oceans(program, judge)
        if not options.quick and judge.wants("boundary layer"):
            boundary_layers(program, judge)
    print(f"worst mean error {judge.worst:.4f}")
    return 1 if options.limit is not None and judge.worst > options.limit else 0


if __name__ == "__main__":
    sys.exit(main())
