#!/usr/bin/env python3
"""Writes half_annulus_{smooth,band,step}.json beside itself: the half-annulus scene's three transfer functions
as ParaView colour-map presets. Colour is linear between few points, and exact. Opacity per unit distance,
1 - exp(-kappa u), is nearly linear in kappa for u this small, and its points are so dense that interpolating
between them costs nothing to be seen at 60 dB."""

import json
import math
import pathlib

UNIT = 0.01
JUMP = 1e-7  # the step's width; the scalars are single precision


def clamp(x):
    return min(1.0, max(0.0, x))


def colour(f):
    return [clamp(2 * f - 0.4), clamp(1 - 2.5 * abs(f - 0.5)), clamp(1 - 2 * f)]


def smooth(f):
    return 8 * f * f


def band(f):
    return 24 * math.exp(-((f - 0.5) ** 2) / 0.0018)


def step(f):
    return 16 if f > 0.5 else 0


def even(begin, end, count):
    return [begin + (end - begin) * n / count for n in range(count + 1)]


SCALARS = {
    smooth: even(0, 1, 512),
    band: [0.0] + even(0.3, 0.7, 1024) + [1.0],
    step: [0.0, 0.5, 0.5 + JUMP, 1.0],
}

for kappa, scalars in SCALARS.items():
    points = []
    for f in scalars:
        points += [round(f, 9), round(abs(math.expm1(-kappa(f) * UNIT)), 12), 0.5, 0.0]
    preset = {
        "Name": f"half-annulus {kappa.__name__}",
        "ColorSpace": "RGB",
        "RGBPoints": [x for f in (0.0, 0.1, 0.2, 0.5, 0.7, 0.9, 1.0) for x in [f, *map(lambda c: round(c, 9), colour(f))]],
        "Points": points,
        "ScalarOpacityUnitDistance": UNIT,
    }
    path = pathlib.Path(__file__).parent / f"half_annulus_{kappa.__name__}.json"
    path.write_text(json.dumps([preset]) + "\n")
