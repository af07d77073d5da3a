"""A plot of a few lines over logarithmic axes, as SVG, without any library."""

import math
from xml.sax.saxutils import escape

WIDTH, HEIGHT = 640, 400
LEFT, RIGHT, TOP, BOTTOM = 70, 130, 20, 50
COLOURS = ["#0b5394", "#cc0000", "#38761d", "#b45f06"]


def axis(values, begin, end):
    """Whole decades around the values -> (place of a value, ticks)."""
    low = math.floor(math.log10(min(values)))
    high = max(math.ceil(math.log10(max(values))), low + 1)
    return (lambda value: begin + (math.log10(value) - low) / (high - low) * (end - begin),
            [10.0**power for power in range(low, high + 1)])


def text(x, y, words, anchor="middle", colour="#222", turn=""):
    return f'<text x="{x:.1f}" y="{y:.1f}" text-anchor="{anchor}" fill="{colour}"{turn}>{escape(words)}</text>'


def number(value):
    for unit, letter in ((1e9, "G"), (1e6, "M"), (1e3, "k")):
        if value >= unit:
            return f"{value / unit:g} {letter}"
    return f"{value:g}"


def write_line_plot(path, lines, x_name, y_name):
    """`lines`: {name: [(x, y), ...]}, all positive."""
    points = [point for line in lines.values() for point in line]
    x_of, x_ticks = axis([x for x, _ in points], LEFT, WIDTH - RIGHT)
    y_of, y_ticks = axis([y for _, y in points], HEIGHT - BOTTOM, TOP)
    svg = [f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH} {HEIGHT}" font-family="sans-serif" '
           'font-size="13">', f'<rect width="{WIDTH}" height="{HEIGHT}" fill="white"/>']
    for x in x_ticks:
        svg.append(f'<path d="M{x_of(x):.1f} {TOP}V{HEIGHT - BOTTOM}" stroke="#ddd"/>')
        svg.append(text(x_of(x), HEIGHT - BOTTOM + 18, number(x)))
    for y in y_ticks:
        svg.append(f'<path d="M{LEFT} {y_of(y):.1f}H{WIDTH - RIGHT}" stroke="#ddd"/>')
        svg.append(text(LEFT - 8, y_of(y) + 4, number(y), "end"))
    svg.append(text((LEFT + WIDTH - RIGHT) / 2, HEIGHT - 10, x_name))
    middle = (TOP + HEIGHT - BOTTOM) / 2
    svg.append(text(18, middle, y_name, turn=f' transform="rotate(-90 18 {middle:.1f})"'))
    for colour, (name, line) in zip(COLOURS, lines.items()):
        places = [(x_of(x), y_of(y)) for x, y in line]
        way = " L".join(f"{x:.1f} {y:.1f}" for x, y in places)
        svg.append(f'<path d="M{way}" fill="none" stroke="{colour}" stroke-width="2"/>')
        svg += [f'<circle cx="{x:.1f}" cy="{y:.1f}" r="3.5" fill="{colour}"/>' for x, y in places]
        svg.append(text(places[-1][0] + 10, places[-1][1] + 4, name, "start", colour))
    with open(path, "w") as file:
        file.write("\n".join(svg + ["</svg>", ""]))
