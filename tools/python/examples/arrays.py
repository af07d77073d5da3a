#!/usr/bin/env python3
"""A simulation's own arrays, converted and drawn: arrays.py NAME makes NAME.splats and NAME.png."""

import sys

import numpy as np

import curvisplat

# A bent duct: arrays of shape (nk, nj, ni).
height, radius, angle = np.meshgrid(np.linspace(0, 1, 16), np.linspace(1, 2, 24), np.linspace(0, 1.5, 64), indexing="ij")
x, y, z = radius * np.cos(angle), radius * np.sin(angle), height
temperature = (300 + 50 * np.sin(6 * angle) * radius).astype(np.float32)

if len(sys.argv) != 2:
    sys.exit(__doc__)
name = sys.argv[1]
block = curvisplat.Block(x, y, z, {"temperature": temperature}, units={"temperature": "K"})
report = curvisplat.convert_arrays(name + ".splats", block, overwrite=True)
print(f"{report.samples} samples, {report.splats} splats, {report.bytes} bytes")

with curvisplat.open(name + ".splats") as cache:
    picture = cache.render("temperature", size=(320, 240), colours="inferno", shade=True)
    picture.save(name + ".png")
    print("the same by hand: curvisplat render", cache.path, "-o again.png --size 320x240 --tf inferno --shade",
          picture.options)
