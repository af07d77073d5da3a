#!/usr/bin/env python3
"""Fits the numbers of stream/model/fits.h again, by least squares in one dimension, and prints the old ones beside the new.

    bench/fits.py [--only REGEX]

Each group of numbers starts from those of the header, while the others stay as they are; so does kSkewOfCut, which was chosen.
The error is that of a uniform medium's density, as splats draw it: rms with the header's numbers and with the new ones. Numbers
that are fitted with others, or that were chosen between fits of several kinds of lines, differ; the errors say how much that
matters. Lines: cells that grow steadily, elements of few steps, even or growing, tanh spacing in blocks, jumps, random walks. Each
counts equally. Exit status 1 if an error of the header's is more than 1.2 times the new one.
Needs numpy.
"""
import argparse
import math
import pathlib
import re
import sys

try:
    import numpy as np
except ImportError:
    print("fits: needs numpy; skipped")
    sys.exit(77)

HEADER = pathlib.Path(__file__).resolve().parent.parent / "stream/model/fits.h"
SUPPORT, SIGMA = 1.556228, 0.44655


def header_numbers():
    """{name: [numbers]} of the header's constants."""
    text = re.sub(r"//.*", "", HEADER.read_text())
    found = {}
    for statement in re.findall(r"inline constexpr \w+ ([^;]*);", text):
        for name, plain, braced in re.findall(r"(k\w+)\s*(?:=\s*([-\d.]+)f?|(\{[^k]*\}))", statement):
            found[name] = [float(n) for n in re.findall(r"-?\d+\.?\d*", plain or braced)]
    return found


def profile():
    """The kernel's integral over two axes, as a function of the third."""
    r = np.linspace(0, SUPPORT, 20001)
    kernel = np.where(r < 0.889392, 0.557526 + r * r * (-1.157743 + 0.671033 * r),
                      (SUPPORT - r) ** 2 * (0.067599 + 0.282474 * (SUPPORT - r)))
    steps = 0.5 * np.diff(r) * (kernel[1:] * r[1:] + kernel[:-1] * r[:-1])
    beyond = np.append(np.cumsum(steps[::-1])[::-1], 0)
    return lambda u: np.interp(np.abs(u), r, 2 * math.pi * beyond)


WORST = []  # the header's errors over the new ones
PROFILE = profile()
OLD = header_numbers()


def density(x, middle, length, weight, growth=0.0, skew=OLD["kSkewOfGrowth"][0]):
    """At the places x, of splats with these middles, lengths, weights (the even one is its length) and growths."""
    middle, length, weight, growth = (np.broadcast_to(np.asarray(a, float), np.shape(middle)) for a in
                                      (middle, length, weight, growth))
    u = (x[:, None] - middle) / length
    v = u / SIGMA
    return (weight / length * PROFILE(u) * np.maximum(0, 1 + skew * growth * (v ** 3 - 3 * v) / 6)).sum(1)


def fitted(residuals, start):
    """Least squares from `start`, by Levenberg's method."""
    p, damping = np.array(start, float), 1e-6
    r = residuals(p)
    for _ in range(60):
        jacobian = np.stack([(residuals(p + h) - r) / 1e-5 for h in 1e-5 * np.eye(len(p))], 1)
        squares = jacobian.T @ jacobian
        step = np.linalg.solve(squares + damping * np.diag(np.diag(squares) + 1e-12), -jacobian.T @ r)
        there = residuals(p + step)
        if there @ there < r @ r:
            small = np.abs(step).max() < 1e-6
            p, r, damping = p + step, there, damping / 5
            if small:
                break
        else:
            damping *= 10
            if damping > 1e9:
                break
    return p


def print_errors(title, residuals, old, new):
    rms = [math.sqrt(np.mean(residuals(np.array(p)) ** 2)) for p in (old, new)]
    print(f"{title}: rms {100 * rms[0]:.3f} % with the header's numbers, {100 * rms[1]:.3f} % fitted again")
    WORST.append(rms[0] / rms[1])


def report(title, names, residuals, start=None):
    """`names`: of the header's constants, all of whose numbers are fitted."""
    old = np.array([n for name in names for n in OLD[name]]) if start is None else np.array(start)
    new = fitted(residuals, old)
    print_errors(title, residuals, old, new)
    at = 0
    for name in names:
        count = len(OLD[name])
        print(f"  {name:24}", *(f"{o:8.4f} ->{n:8.4f} " for o, n in zip(old[at:at + count], new[at:at + count])))
        at += count


# Lines of cells away from borders.

def cells(steps):
    """Middles and lengths of the cells of nodes that are this far apart, without the end nodes'."""
    x = np.append(0, np.cumsum(steps))
    return 0.25 * (x[:-2] + 2 * x[1:-1] + x[2:]), 0.5 * (x[2:] - x[:-2])


def features(lengths):
    l = np.log(lengths)
    l0, l1, l2, l3 = (l[2 + d:len(l) - 2 + d] - l[2:-2] for d in (-2, -1, 1, 2))
    slope, bend = l2 - l1, np.clip((l3 - l0) - 2 * (l2 - l1), -1.5, 1.5)
    smaller, smallest = np.where(slope > 0, l1, l2), np.where(slope > 0, l0, l3)
    steady = np.where(smaller < -1e-3, np.clip((smallest - smaller) / np.minimum(smaller, -1e-3), 0, 1), 0)
    steep = steady * np.maximum(np.minimum(slope ** 2, 4) - OLD["kSteepFrom"][0], 0)
    return np.clip(l1 + l2, -1.25, 1.25), np.clip(l0 + l3, -2, 2), slope, bend, steep, np.where(slope < 0, -1, 1)


GENTLE = ["kLengthByCurve", "kLengthByCurve2", "kLengthByBendSlope", "kGrowthByCurve", "kGrowthByFarCurve",
          "kGrowthByBend", "kGrowthByBendCurve", "kDriftByCurve", "kDriftByBend"]
STEEP = ["kSteepLength", "kSteepLengthByCurve2", "kSteepLengthByBend", "kSteepGrowth", "kSteepDrift"]


def numbers(names):
    return [n for name in names for n in OLD[name]]


def line_error(steps, gentle, steep, drift=OLD["kDrift"][0], skew=OLD["kSkewOfGrowth"][0]):
    """The density less 1, at eight places in each cell."""
    middle, own = cells(steps)
    curve, far, slope, bend, q, way = features(own)
    middle, own = middle[2:-2], own[2:-2]
    a1, a2, a3, c1, c2, c3, c4, d1, d2 = gentle
    b1, b2, b3, c5, d3 = steep
    length = np.exp(np.clip(curve * (a1 + a2 * curve) + a3 * bend * slope + q * (b1 + b2 * curve ** 2 + b3 * way * bend), -0.3, 0.45))
    growth = np.clip(slope * (0.5 + c1 * curve + c2 * far) + bend * (c3 + c4 * curve) + c5 * way * q, -0.65, 0.65)
    moved = np.clip(slope * (0.5 * drift + d1 * curve) + d2 * bend + d3 * way * q, -0.125, 0.125)
    x = (middle[3:-3, None] + own[3:-3, None] * np.linspace(-0.4375, 0.4375, 8)).ravel()
    return density(x, middle + moved * own, length * own, own, growth, skew) - 1


def growing(factor, count=24):
    return factor ** np.arange(count)


def gentle_lines():
    random = np.random.default_rng(1)
    lobatto = {3: [1, 1.618, 1], 4: [1, 1.896, 1.896, 1], 5: [0.1175, 0.2401, 0.2848, 0.2401, 0.1175],
               6: [0.0849, 0.1808, 0.2343, 0.2343, 0.1808, 0.0849]}
    for steps in lobatto.values():
        yield np.tile(steps, 6)
        yield np.concatenate([np.array(steps) * 1.42 ** n for n in range(6)])
    for strength in (1.0, 1.5, 2.0):
        yield np.tile(np.diff(np.tanh(strength * np.linspace(-1, 1, 9))), 4)
    for jump in (1.5, 2.0):
        yield np.repeat([1, jump], 12)
    for factor in (1.1, 1.25, 1.5):
        yield growing(factor)
    for _ in range(4):
        yield np.exp(np.cumsum(random.normal(0, 0.15, 30)))


def steep_lines():
    yield from gentle_lines()
    for factor in (1.6, 1.75, 1.9, 2.1):
        yield growing(factor, 18)
        up = growing(factor, 8)
        yield np.concatenate([up, up[::-1] / 2, up])
    yield np.tile(np.diff(np.cos(np.linspace(math.pi, 0, 9))), 4)


def fit_lines():
    def steady(p):
        return np.concatenate([line_error(growing(f), numbers(GENTLE), numbers(STEEP), p[1], p[0])
                               for f in (1.1, 1.2, 1.3, 1.4, 1.5)])
    report("steady growth", ["kSkewOfGrowth", "kDrift"], steady)
    gentle = list(gentle_lines())
    report("lines", GENTLE, lambda p: np.concatenate([line_error(s, p, [0] * 5) for s in gentle]))
    steep = list(steep_lines())
    report("steep lines", STEEP, lambda p: np.concatenate([line_error(s, numbers(GENTLE), p) for s in steep]))


# Cells at borders. Inwards is positive, the face lies at zero.

PLACES = np.linspace(0, 4, 401)[:-1] + 0.005


def behind_face(growth, whole, count=14):
    """Middles and lengths of the cells behind the one at the face, whose own come first. They grow by e^growth."""
    steps = math.exp(growth) ** np.arange(count)
    if whole:
        x = np.append(0, np.cumsum(steps))
        return 0.5 * (x[1:] + x[:-1]), steps
    x = np.append(0, np.cumsum(steps))
    middle, length = cells(steps)
    return np.append(0.25, middle), np.append(0.5, length)


def cut_error(parts, growth=0.0, whole=False, skew=0.0, outside=False):
    """The density less 1 behind the face where its cell is drawn as these parts; before it, less 0, if `outside`."""
    middle, length = behind_face(growth, whole)
    x = np.append(-PLACES[PLACES < 1.5], PLACES) if outside else PLACES
    d = density(x, middle[1:] + OLD["kDrift"][0] * growth * length[1:], length[1:], length[1:], growth)
    for offset, size, share in np.reshape(parts, (-1, 3)):
        d = d + density(x, [middle[0] + offset * length[0]], [size * length[0]], [share * length[0]], skew * growth)
    return d - (x > 0)


def fit_borders():
    for style, whole in (("kHalfCellStyle", False), ("kWholeCellStyle", True)):
        old = OLD[style]
        for title, start, error in (("cut", old[:3], lambda p: cut_error(p, whole=whole)),
                                    ("in parts", old[3:8], lambda p: cut_error([*p, 1 - p[2]], whole=whole, outside=True))):
            new = fitted(error, start)
            print_errors(f"{style}, {title}", error, start, new)
            print(" ", *(f"{o:8.4f} ->{n:8.4f} " for o, n in zip(start, new)))


def fit_merged():
    ratios = 0.75 * 2 ** (np.arange(0, 21) / 10)

    def error(p):
        all_errors = []
        for ratio in ratios:
            w = 1 / ratio
            cubic = [p[0] + w * (p[1] + w * (p[2] + w * p[3])), *(1 + w * (c[0] + w * (c[1] + w * c[2])) for c in (p[4:7], p[7:10]))]
            x, middle = PLACES, w + 0.5 + np.arange(8)
            d = density(x, middle, np.ones(8), np.ones(8)) + density(x, [cubic[0]], [cubic[1]], [cubic[2]])
            all_errors.append(d - 1)
        return np.concatenate(all_errors)
    start = OLD["kMergedDistance"] + OLD["kMergedSize"][1:] + OLD["kMergedShare"][1:]
    OLD.update(kMergedSize=OLD["kMergedSize"][1:], kMergedShare=OLD["kMergedShare"][1:])  # both begin with 1
    report("merged splats", ["kMergedDistance", "kMergedSize", "kMergedShare"], error, start)


def fit_growing():
    growths = np.linspace(-0.25, 0.5, 16)

    def error(style, whole, choose):
        even, skew = np.array(OLD[style][:3]), OLD["kSkewOfCut"][0]
        return lambda p: np.concatenate([cut_error(even + g * choose(p, g), g, whole, skew) for g in growths])
    report("half cells of growing rows", ["kHalfCutByGrowth", "kHalfCutByGrowth2"],
           error("kHalfCellStyle", False, lambda p, g: p[0:3] + min(g, 0.3) * p[3:6]))
    report("whole cells of growing rows", ["kWholeCutByGrowth", "kWholeCutByShrinking"],
           error("kWholeCellStyle", True, lambda p, g: p[0:3] if g > 0 else p[3:6]))


def fit_layers():
    growths = np.linspace(-0.5, 0.5, 21)

    def error(p):
        found = []
        for g in growths:
            middle, length = behind_face(g, False, 4)
            found.append((middle[1] + OLD["kDrift"][0] * g * length[1]) / length[1] - 1 - p[0] * g)
        return np.array(found)
    report("distance of the face behind which a cell lies", ["kLayerDistanceByGrowth"], error)


def main():
    parser = argparse.ArgumentParser(usage=__doc__.split("\n\n")[1].strip())
    parser.add_argument("--only", default="")
    only = parser.parse_args().only
    for name, fit in (("lines", fit_lines), ("borders", fit_borders), ("merged", fit_merged), ("growing", fit_growing),
                      ("layers", fit_layers)):
        if re.search(only, name):
            fit()
    sys.exit(max(WORST) > 1.2)


if __name__ == "__main__":
    main()
