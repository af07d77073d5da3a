"""Line plots of the scripts in bench/, drawn by curvisplat_line_plot as `curvisplat bench --plot` draws its own."""

import json
import math
import pathlib
import subprocess


def exponent_of(line):
    """The exponent p of the power law y = c x^p that fits best: least squares of the logarithms."""
    xs, ys = [math.log(x) for x, _ in line], [math.log(y) for _, y in line]
    x_mean, y_mean = sum(xs) / len(xs), sum(ys) / len(ys)
    return (sum((x - x_mean) * (y - y_mean) for x, y in zip(xs, ys))
            / sum((x - x_mean) ** 2 for x in xs))


def trends_of(lines):
    """`lines` with the fitted power of x in each name."""
    return {f"{name}: n^{exponent_of(line):.2f}" if len({x for x, _ in line}) > 1 else name: line
            for name, line in lines.items()}


def write_line_plots(program, path, plots):
    """`program`: curvisplat, beside whose folder bench/ was built. `plots`: [{"title", "x_name", "y_name", "log_values",
    "lines": {name: [(x, y), ...]}}], drawn into the PNG file `path`. x is logarithmic."""
    drawer = pathlib.Path(program).resolve().parent.parent / "bench/curvisplat_line_plot"
    plots = [plot for plot in plots if any(plot["lines"].values())]
    subprocess.run([drawer, path], input=json.dumps(plots), text=True, check=True)
