#!/usr/bin/env python3
"""Writes published_maps.cpp: the colour maps of matplotlib, cmocean and ParaView by their published values.

    render/colour/make_published_maps.py MATPLOTLIB CMOCEAN PARAVIEW.json > render/colour/published_maps.cpp

MATPLOTLIB is the package's folder (3.6.3 was used: _cm.py and _cm_listed.py are run without the rest of it), CMOCEAN a folder
of cmocean_NAME.rgb (256 colours a file, as NCL ships them), PARAVIEW.json its presets (5.11: Remoting/Views/ColorMaps.json).
Tables of 256 colours are written as the fewest points between which linear interpolation is within 1/255 of all of them.
"""
import importlib
import json
import pathlib
import re
import sys
import types

SEQUENTIAL, DIVERGING, CYCLIC = "Sequential", "Diverging", "Cyclic"
SAFE = True  # told apart with the common forms of colour blindness: an even change of lightness, no red beside green

MATPLOTLIB = {
    "magma": (SEQUENTIAL, SAFE), "cividis": (SEQUENTIAL, SAFE), "turbo": (SEQUENTIAL, False),
    "Blues": (SEQUENTIAL, SAFE), "Greens": (SEQUENTIAL, SAFE), "Greys": (SEQUENTIAL, SAFE), "Oranges": (SEQUENTIAL, SAFE),
    "Purples": (SEQUENTIAL, SAFE), "Reds": (SEQUENTIAL, SAFE), "YlGnBu": (SEQUENTIAL, SAFE), "YlOrRd": (SEQUENTIAL, SAFE),
    "hot": (SEQUENTIAL, SAFE), "gist_heat": (SEQUENTIAL, SAFE), "copper": (SEQUENTIAL, SAFE), "bone": (SEQUENTIAL, SAFE),
    "cubehelix": (SEQUENTIAL, SAFE), "gist_earth": (SEQUENTIAL, False), "terrain": (SEQUENTIAL, False),
    "jet": (SEQUENTIAL, False), "rainbow": (SEQUENTIAL, False),
    "coolwarm": (DIVERGING, SAFE), "bwr": (DIVERGING, SAFE), "seismic": (DIVERGING, SAFE), "RdBu": (DIVERGING, SAFE),
    "RdYlBu": (DIVERGING, SAFE), "PuOr": (DIVERGING, SAFE), "PRGn": (DIVERGING, SAFE), "PiYG": (DIVERGING, SAFE),
    "BrBG": (DIVERGING, SAFE), "Spectral": (DIVERGING, False),
    "twilight": (CYCLIC, SAFE), "twilight_shifted": (CYCLIC, SAFE), "hsv": (CYCLIC, False),
}
CMOCEAN = {name: (SEQUENTIAL, SAFE) for name in
           "thermal haline solar ice oxy deep dense algae matter turbid speed amp tempo".split()}
CMOCEAN.update({"balance": (DIVERGING, SAFE), "delta": (DIVERGING, SAFE), "curl": (DIVERGING, SAFE), "phase": (CYCLIC, SAFE)})
CMOCEAN["oxy"] = (SEQUENTIAL, False)
PARAVIEW = {
    "cool-warm-extended": ("Cool to Warm (Extended)", DIVERGING, SAFE),
    "blue-orange": ("Blue Orange (divergent)", DIVERGING, SAFE),
    "cold-and-hot": ("Cold and Hot", DIVERGING, SAFE),
    "gray-and-red": ("Gray and Red", DIVERGING, SAFE),
    "yellow-gray-blue": ("Yellow - Gray - Blue", DIVERGING, SAFE),
    "green-blue-divergent": ("Green-Blue Asymmetric Divergent (62Blbc)", DIVERGING, False),
    "black-body": ("Black-Body Radiation", SEQUENTIAL, SAFE),
    "x-ray": ("X Ray", SEQUENTIAL, SAFE),
    "linear-ygb": ("Linear YGB 1211g", SEQUENTIAL, SAFE),
    "linear-green": ("Linear Green (Gr4L)", SEQUENTIAL, SAFE),
    "linear-blue": ("Linear Blue (8_31f)", SEQUENTIAL, SAFE),
    "earth-tones": ("Asymmetrical Earth Tones (6_21b)", SEQUENTIAL, False),
    "rainbow-desaturated": ("Rainbow Desaturated", SEQUENTIAL, False),
    "rainbow-uniform": ("Rainbow Uniform", SEQUENTIAL, False),
    "blue-red-rainbow": ("Blue to Red Rainbow", SEQUENTIAL, False),
}
SPACES = {"RGB": "kRgb", "Lab": "kLab", "CIELAB": "kLab", "HSV": "kHsvNoWrap", "Diverging": "kDiverging"}


def reduced(table):
    """The fewest (position, red, green, blue) that give the table within 1/255."""
    last = len(table) - 1

    def fits(a, b):
        return all(abs(table[a][c] + (table[b][c] - table[a][c]) * (n - a) / (b - a) - table[n][c]) <= 1.0001 / 255
                   for n in range(a + 1, b) for c in range(3))

    kept = [0]
    while kept[-1] < last:
        b = kept[-1] + 1
        while b < last and fits(kept[-1], b + 1):
            b += 1
        kept.append(b)
    return [(n / last, *table[n]) for n in kept]


def matplotlib_maps(folder):
    """name -> [(position, red, green, blue)], linear in RGB."""
    package = types.ModuleType("matplotlib")
    package.__path__ = [str(folder)]
    colours = types.ModuleType("matplotlib.colors")
    colours.ListedColormap = lambda data, name=None: types.SimpleNamespace(colors=data)
    sys.modules.update({"matplotlib": package, "matplotlib.colors": colours})
    sys.path.insert(0, str(folder.parent))
    listed = importlib.import_module("matplotlib._cm_listed").cmaps
    others = importlib.import_module("matplotlib._cm").datad
    for name in MATPLOTLIB:
        if name in listed:
            yield name, reduced(listed[name].colors)
            continue
        data = others[name]
        if isinstance(data, dict) and not callable(data["red"]):
            places = sorted({point[0] for channel in ("red", "green", "blue") for point in data[channel]})

            def value(channel, x):
                points = data[channel]
                for (x0, _, after), (x1, before, _) in zip(points, points[1:]):
                    if x0 <= x <= x1:
                        return after + (before - after) * (x - x0) / (x1 - x0)
                raise ValueError(x)

            assert all(len(p) == 3 and (p[1] == p[2] or p[0] in (0, 1)) for c in data.values() for p in c), name
            yield name, [(x, *(value(channel, x) for channel in ("red", "green", "blue"))) for x in places]
        elif isinstance(data, dict):
            clip = lambda v: min(1.0, max(0.0, float(v)))
            import numpy
            x = numpy.linspace(0, 1, 256)
            channels = [data[channel](x) for channel in ("red", "green", "blue")]
            yield name, reduced([[clip(channel[n]) for channel in channels] for n in range(256)])
        else:
            if "listed" in data:
                data = data["listed"]
            if len(data[0]) == 2:  # (position, colour)
                yield name, [(x, *colour) for x, colour in data]
            else:
                yield name, [(n / (len(data) - 1), *colour) for n, colour in enumerate(data)]


def cmocean_maps(folder):
    for name in CMOCEAN:
        rows = [line.split() for line in (folder / f"cmocean_{name}.rgb").read_text().splitlines()]
        table = [[float(word) for word in row[:3]] for row in rows if len(row) >= 3 and re.fullmatch(r"[\d.]+", row[0])]
        assert len(table) == 256, (name, len(table))
        if max(max(row) for row in table) > 1:
            table = [[value / 255 for value in row] for row in table]
        yield name, reduced(table)


def number(value):
    return f"{value:.6g}"


def main():
    matplotlib, cmocean, paraview = map(pathlib.Path, sys.argv[1:4])
    presets = {preset["Name"]: preset for preset in json.loads(paraview.read_text())}
    maps = [(name, "matplotlib", *MATPLOTLIB[name], "kRgb", points) for name, points in matplotlib_maps(matplotlib)]
    maps += [(name, "cmocean", *CMOCEAN[name], "kRgb", points) for name, points in cmocean_maps(cmocean)]
    for name, (preset, category, safe) in PARAVIEW.items():
        rgb = presets[preset]["RGBPoints"]
        points = [tuple(rgb[n:n + 4]) for n in range(0, len(rgb), 4)]
        low, high = points[0][0], points[-1][0]
        points = [((x - low) / (high - low), *colour) for x, *colour in points]
        maps.append((name, "ParaView", category, safe, SPACES[presets[preset].get("ColorSpace", "RGB")], points))

    print("""// Colour maps by their published values. Written by make_published_maps.py; do not edit.
//
//   matplotlib  3.6.3. magma: S. van der Walt, N. Smith (CC0); cividis: Nunez, Anderton, Renslow (CC0); turbo: A. Mikhailov
//               (Apache-2.0); twilight: B. Bechtold (CC0); Blues to Spectral: ColorBrewer, C. Brewer (Apache-2.0);
//               the others: matplotlib's own (PSF-based licence)
//   cmocean     K. Thyng (MIT): Thyng et al., "True colors of oceanography", Oceanography 29 (2016)
//   ParaView    5.11 (BSD-3-Clause). The maps with many points are F. Samsel's, Los Alamos National Laboratory
#include "render/colour/transfer_function.h"

namespace curvisplat {
namespace {

// Position, red, green, blue.
using Points = const PublishedMap::Point[];
// clang-format off""")
    for n, (_, _, _, _, _, points) in enumerate(maps):
        print(f"constexpr Points kMap{n} = {{")
        line = "   "
        for point in points:
            text = " {" + ", ".join(number(value) for value in point) + "},"
            if len(line) + len(text) > 110:
                print(line)
                line = "   "
            line += text
        print(line + "};")
    print("\nconstexpr PublishedMap kMaps[] = {")
    for n, (name, source, category, safe, space, _) in enumerate(maps):
        print(f'    {{"{name}", "{source}", MapCategory::k{category}, {"true" if safe else "false"}, '
              f"ColourSpace::{space}, kMap{n}}},")
    print("""};
// clang-format on

}  // namespace

std::span<const PublishedMap> publishedMaps() {
  return kMaps;
}

}  // namespace curvisplat""")


if __name__ == "__main__":
    main()
