#!/usr/bin/env python3
"""An xarray.Dataset, converted, drawn and plotted: dataset.py NAME makes NAME.splats and NAME.png, by matplotlib."""

import sys

import matplotlib
import numpy as np
import xarray

import curvisplat

matplotlib.use("Agg")
from matplotlib import pyplot  # noqa: E402

if len(sys.argv) != 2:
    sys.exit(__doc__)
name = sys.argv[1]

# Terrain-following levels: x and y are axes, z has all three dimensions.
x, y, level = np.linspace(0, 40, 60), np.linspace(0, 30, 45), np.linspace(0, 1, 20)
hill = 3 * np.exp(-((x[None, :] - 15) ** 2 + (y[:, None] - 15) ** 2) / 40)
z = hill + level[:, None, None] * (10 - hill)
wind = (5 + 10 * np.sqrt(level))[:, None, None] * (1 + 0.5 * hill * np.exp(-3 * level[:, None, None]))
dataset = xarray.Dataset({"wind": (("level", "y", "x"), wind.astype(np.float32), {"units": "m s-1"})},
                         {"x": x, "y": y, "z": (("level", "y", "x"), z)})

curvisplat.convert_arrays(name + ".splats", curvisplat.from_xarray(dataset), overwrite=True)
with curvisplat.open(name + ".splats") as cache:
    picture = cache.render("wind", size=(480, 360), colours="viridis", scalar_bar=True, outline=True)
    shares, ends = cache.histogram("wind", bins=40)

figure, (left, right) = pyplot.subplots(1, 2, figsize=(10, 4))
left.imshow(np.clip(picture, 0, 1))
left.set_axis_off()
right.stairs(100 * shares, ends, fill=True)
right.set(xlabel="wind [m/s]", ylabel="volume [%]")
figure.savefig(name + ".png")
