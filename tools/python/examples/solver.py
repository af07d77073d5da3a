#!/usr/bin/env python3
"""A solver whose steps become a cache while it runs: solver.py NAME makes NAME.splats, to which it adds steps, and NAME.png.

Heat in a bent duct, by explicit differences on the curvilinear grid; `curvisplat view NAME.splats` or `serve` shows what there is.
"""

import sys

import numpy as np

import curvisplat

# A quarter of a ring: arrays of shape (nk, nj, ni), whose cells are dr, r da and dz wide.
nk, nj, ni = 12, 20, 60
z, r, a = np.meshgrid(np.linspace(0, 0.5, nk), np.linspace(1, 2, nj), np.linspace(0, np.pi / 2, ni), indexing="ij")
x, y = r * np.cos(a), r * np.sin(a)
dr, da, dz = 1 / (nj - 1), np.pi / 2 / (ni - 1), 0.5 / (nk - 1)

temperature = np.zeros((nk, nj, ni))
temperature[:, :, 0] = 100  # a hot end; the other walls let nothing through
conductivity, step = 0.1, 0.2 * min(dr, da, dz) ** 2 / 0.1


def advanced(t):
    """One step of dT/dt = c (T_rr + T_r / r + T_aa / r^2 + T_zz)."""
    padded = np.pad(t, 1, mode="edge")
    middle = np.s_[1:-1]
    along_r = (padded[middle, 2:, middle] - 2 * t + padded[middle, :-2, middle]) / dr**2
    slope_r = (padded[middle, 2:, middle] - padded[middle, :-2, middle]) / (2 * dr) / r
    along_a = (padded[middle, middle, 2:] - 2 * t + padded[middle, middle, :-2]) / (da * r) ** 2
    along_z = (padded[2:, middle, middle] - 2 * t + padded[:-2, middle, middle]) / dz**2
    t = t + step * conductivity * (along_r + slope_r + along_a + along_z)
    t[:, :, 0] = 100
    return t


if len(sys.argv) != 2:
    sys.exit(__doc__)
name = sys.argv[1]
for number in range(5):
    time = number * 400 * step
    block = curvisplat.Block(x, y, z, {"temperature": temperature}, units={"temperature": "K"})
    if number == 0:
        curvisplat.convert_arrays(name + ".splats", block, overwrite=True, time=time, title="heat in a duct")
    else:
        curvisplat.append_arrays(name + ".splats", block, time=time)
    print(f"step {number}: time {time:.3f}, mean temperature {temperature.mean():.2f}")
    for _ in range(400):  # the solver goes on with its own arrays
        temperature = advanced(temperature)

with curvisplat.open(name + ".splats") as cache:
    print(len(cache.times), "steps at", cache.times.round(3))
    function = curvisplat.TransferFunction("inferno", range=(0, 100), opacity=[(0, 0.1), (1, 0.9)], opacity_unit=0.1)
    pictures = [cache.render("temperature", step=n, camera=cache.camera("+z", size=(320, 320)), size=(320, 320), function=function)
                for n in (0, len(cache.times) - 1)]
    both = np.hstack([np.asarray(picture) for picture in pictures]).view(curvisplat.Picture)
    both.save(name + ".png")
