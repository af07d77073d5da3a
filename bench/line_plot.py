"""Draws line plots with logarithmic axes, side by side, as SVG. Needs no library."""

import math
from xml.sax.saxutils import escape

WIDTH, HEIGHT = 640, 400
LEFT, RIGHT, TOP, BOTTOM = 70, 200, 36, 50
COLOURS = ["#0b5394", "#cc0000", "#38761d", "#b45f06", "#674ea7"]


def exponent_of(line):
    """The exponent p of the power law y = c x^p that fits best: least squares of the logarithms."""
    xs, ys = [math.log(x) for x, _ in line], [math.log(y) for _, y in line]
    x_mean, y_mean = sum(xs) / len(xs), sum(ys) / len(ys)
    return (sum((x - x_mean) * (y - y_mean) for x, y in zip(xs, ys))
            / sum((x - x_mean) ** 2 for x in xs))


def axis(values, begin, end):
    """Returns (coordinate of a value, ticks) of an axis over the whole decades around the values."""
    low = math.floor(math.log10(min(values)))
    high = max(math.ceil(math.log10(max(values))), low + 1)
    return (lambda value: begin + (math.log10(value) - low) / (high - low) * (end - begin),
            [10.0**power for power in range(low, high + 1)])


def linear_axis(values, begin, end):
    """As axis(), linear from 0 in steps of ten."""
    high = max(10 * math.ceil(max(values) / 10), 10)
    return (lambda value: begin + value / high * (end - begin), [float(tick) for tick in range(0, high + 1, 10)])


def text(x, y, words, anchor="middle", colour="#222", turn=""):
    return f'<text x="{x:.1f}" y="{y:.1f}" text-anchor="{anchor}" fill="{colour}"{turn}>{escape(words)}</text>'


def number(value):
    for unit, letter in ((1e9, "G"), (1e6, "M"), (1e3, "k")):
        if value >= unit:
            return f"{value / unit:g} {letter}"
    return f"{value:g}"


def apart(places):
    """Heights of labels, moved down where they would overlap."""
    out, last = {}, -math.inf
    for at in sorted(range(len(places)), key=lambda at: places[at]):
        last = max(places[at], last + 15)
        out[at] = last
    return [out[at] for at in range(len(places))]


def panel(plot):
    """The SVG elements of one plot, with its upper left corner at 0, 0."""
    lines = {name: line for name, line in plot["lines"].items() if line}
    points = [point for line in lines.values() for point in line]
    x_of, x_ticks = axis([x for x, _ in points], LEFT, WIDTH - RIGHT)
    y_of, y_ticks = (linear_axis if plot.get("linear_y") else axis)([y for _, y in points], HEIGHT - BOTTOM, TOP)
    svg = [text((LEFT + WIDTH - RIGHT) / 2, 20, plot["title"])]
    for x in x_ticks:
        svg.append(f'<path d="M{x_of(x):.1f} {TOP}V{HEIGHT - BOTTOM}" stroke="#ddd"/>')
        svg.append(text(x_of(x), HEIGHT - BOTTOM + 18, number(x)))
    for y in y_ticks:
        svg.append(f'<path d="M{LEFT} {y_of(y):.1f}H{WIDTH - RIGHT}" stroke="#ddd"/>')
        svg.append(text(LEFT - 8, y_of(y) + 4, number(y), "end"))
    svg.append(text((LEFT + WIDTH - RIGHT) / 2, HEIGHT - 10, plot["x_name"]))
    middle = (TOP + HEIGHT - BOTTOM) / 2
    svg.append(text(0, 0, plot["y_name"], turn=f' transform="translate(18 {middle:.1f}) rotate(-90)"'))
    labels = apart([y_of(line[-1][1]) + 4 for line in lines.values()])
    for colour, label, (name, line) in zip(COLOURS, labels, lines.items()):
        places = [(x_of(x), y_of(y)) for x, y in line]
        way = " L".join(f"{x:.1f} {y:.1f}" for x, y in places)
        svg.append(f'<path d="M{way}" fill="none" stroke="{colour}" stroke-width="2"/>')
        svg += [f'<circle cx="{x:.1f}" cy="{y:.1f}" r="3.5" fill="{colour}"/>' for x, y in places]
        if plot.get("trend") and len({x for x, _ in line}) > 1:
            name += f": n^{exponent_of(line):.2f}"
        svg.append(text(places[-1][0] + 10, label, name, "start", colour))
    return svg


def write_line_plots(path, plots, columns=2):
    """`plots`: [{"title", "x_name", "y_name", "lines": {name: [(x, y), ...]}}]; all numbers positive. "trend" adds
    the fitted power of x to each line's name; "linear_y" makes y linear from 0."""
    plots = [plot for plot in plots if any(plot["lines"].values())]
    rows = math.ceil(len(plots) / columns)
    width, height = WIDTH * min(columns, len(plots)), HEIGHT * rows
    svg = [f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width} {height}" font-family="sans-serif" '
           'font-size="13">', f'<rect width="{width}" height="{height}" fill="white"/>']
    for at, plot in enumerate(plots):
        svg.append(f'<g transform="translate({at % columns * WIDTH} {at // columns * HEIGHT})">')
        svg += panel(plot) + ["</g>"]
    with open(path, "w") as file:
        file.write("\n".join(svg + ["</svg>", ""]))
