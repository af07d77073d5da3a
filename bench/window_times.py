#!/usr/bin/env python3
"""Measures how fast the window responds, on a virtual display.

Prints the time from the start until the window and until data are on the screen; from a key, and from a drag of the mouse,
until the screen changes, at moments spread over the refinement; from Escape until the program ends; and its peak memory. The
screen is polled about every millisecond through Xlib: a screenshot by another program would take longer than what is measured.

    bench/window_times.py CACHE [--inputs 40] [--backend cpu] [--program build/release/tools/curvisplat]
    bench/window_times.py GRID SOLUTION              # while it converts: until the preview, and input until the whole is there
    bench/window_times.py CACHE --add-scalar NAME    # and input while the scalar is added from the cache's sources

Needs Xvfb, libX11 and libXtst (installed with xdotool). Nothing else should run meanwhile.
"""
import argparse
import ctypes
import os
import pathlib
import random
import subprocess
import tempfile
import time

SIZE = (1200, 800)
PANEL = (20, 40, 200, 100)  # x, y, width, height: the transfer function's curve
PICTURE = (420, 360, 560, 80)  # part of the picture, clear of panels and scalar bar
KEYSYMS = {"h": 0x68, "Escape": 0xFF1B}


class XImage(ctypes.Structure):
    _fields_ = [(name, ctypes.c_int) for name in ("width", "height", "xoffset", "format")] + [
        ("data", ctypes.c_void_p)] + [
        (name, ctypes.c_int) for name in ("byte_order", "unit", "bit_order", "pad", "depth", "bytes_per_line")]


class Display:
    """Input and pixels of an X display."""

    def __init__(self, name):
        self.x, self.test = ctypes.CDLL("libX11.so.6"), ctypes.CDLL("libXtst.so.6")
        self.x.XOpenDisplay.restype = ctypes.c_void_p
        self.x.XGetImage.restype = ctypes.POINTER(XImage)
        self.x.XDefaultRootWindow.restype = ctypes.c_ulong
        self.x.XKeysymToKeycode.restype = ctypes.c_ubyte
        self.display = ctypes.c_void_p(self.x.XOpenDisplay(name.encode()))
        if not self.display:
            raise SystemExit(f"{name}: cannot open the display")
        self.root = ctypes.c_ulong(self.x.XDefaultRootWindow(self.display))
        self.images = {}

    def pixels(self, box):
        """The pixels of a box: bytes of blue, green, red and padding."""
        planes, by_pixel = ctypes.c_ulong(0xFFFFFF), 2
        if box not in self.images:
            self.images[box] = self.x.XGetImage(self.display, self.root, *box, planes, by_pixel)
        image = self.images[box]
        self.x.XGetSubImage(self.display, self.root, *box, planes, by_pixel, image, 0, 0)
        return ctypes.string_at(image.contents.data, image.contents.bytes_per_line * box[3])

    def key(self, name):
        code = self.x.XKeysymToKeycode(self.display, ctypes.c_ulong(KEYSYMS[name]))
        for down in (1, 0):
            self.test.XTestFakeKeyEvent(self.display, code, down, ctypes.c_ulong(0))
        self.x.XSync(self.display, 0)

    def move(self, x, y):
        self.test.XTestFakeMotionEvent(self.display, -1, x, y, ctypes.c_ulong(0))
        self.x.XSync(self.display, 0)

    def button(self, down):
        self.test.XTestFakeButtonEvent(self.display, 1, down, ctypes.c_ulong(0))
        self.x.XSync(self.display, 0)

    def seconds_until_changed(self, box, act):
        before = self.pixels(box)
        start = time.monotonic()
        act()
        while self.pixels(box) == before:
            time.sleep(0.001)
            if time.monotonic() - start > 20:
                raise SystemExit("the window does not answer")
        return time.monotonic() - start


def coloured(pixels):
    """Whether data is shown: more than 100 pixels that are not grey, as outline, axis names and background are."""
    return sum(max(p) - min(p) > 12 for p in zip(pixels[0::16], pixels[1::16], pixels[2::16])) > 100


def spread(name, seconds):
    ordered = sorted(seconds)
    of = lambda part: 1000 * ordered[min(len(ordered) - 1, int(part * len(ordered)))]
    print(f"{name}: {len(ordered)} samples, 50 % within {of(0.5):.0f} ms, 95 % within {of(0.95):.0f} ms, "
          f"all within {1000 * ordered[-1]:.0f} ms")


def place_of(widgets, name, seconds=30):
    """The middle of a widget, by its name (CURVISPLAT_WIDGETS)."""
    deadline = time.monotonic() + seconds
    while time.monotonic() < deadline:
        lines = [line.split(" ", 4) for line in widgets.read_text().splitlines()] if widgets.exists() else []
        for x, y, width, height, found in lines:
            if found == name:
                return int(x) + int(width) // 2, int(y) + int(height) // 2
        time.sleep(0.02)
    raise SystemExit(f"the window has no '{name}'")


def click(display, place):
    display.move(*place)
    time.sleep(0.1)
    for down in (1, 0):
        display.button(down)
        time.sleep(0.05)


def is_there(widgets, name):
    return widgets.exists() and any(line.split(" ", 4)[4] == name for line in widgets.read_text().splitlines())


def measure_keys(display, chance, goes_on):
    """Keys, as long as something goes on."""
    keys = []
    while goes_on() and len(keys) < 500:
        time.sleep(chance.uniform(0.05, 0.4))
        keys.append(display.seconds_until_changed(PANEL, lambda: display.key("h")))
    if len(keys) % 2:
        display.key("h")  # the panels are there again
        time.sleep(0.5)
    return keys


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("cache", type=pathlib.Path, nargs="+", help="a cache, or a grid and its solutions")
    parser.add_argument("--add-scalar", help="of the cache's sources, which is added to it")
    parser.add_argument("--inputs", type=int, default=40)
    parser.add_argument("--backend", default="auto")
    root = pathlib.Path(__file__).resolve().parent.parent
    parser.add_argument("--program", type=pathlib.Path, default=root / "build/release/tools/curvisplat")
    words = parser.parse_args()
    name = f":{100 + os.getpid() % 20000}"
    chance = random.Random(1)
    with tempfile.TemporaryDirectory() as folder:
        server = subprocess.Popen(["Xvfb", name, "-screen", "0", "1280x900x24", "-noreset", "-nolisten", "tcp"],
                                  stderr=subprocess.DEVNULL)
        try:
            while not pathlib.Path(f"/tmp/.X11-unix/X{name[1:]}").exists():
                time.sleep(0.01)
            display = Display(name)
            widgets = pathlib.Path(folder) / "widgets"
            environment = dict(os.environ, DISPLAY=name, XDG_CONFIG_HOME=folder, XDG_CACHE_HOME=folder,
                               CURVISPLAT_WIDGETS=str(widgets))
            blank = display.pixels(PANEL)
            start = time.monotonic()
            window = subprocess.Popen(
                [words.program.resolve(), "view", *[file.resolve() for file in words.cache], "--size", "%dx%d" % SIZE, "--backend",
                 words.backend], cwd=folder, env=environment, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
            converts = not words.cache[0].is_dir()
            while display.pixels(PANEL) == blank:
                time.sleep(0.001)
            print(f"window on the screen after {1000 * (time.monotonic() - start):.0f} ms")
            while not coloured(display.pixels(PICTURE)):
                time.sleep(0.005)
            print(f"data on the screen after {1000 * (time.monotonic() - start):.0f} ms")
            if converts:
                place_of(widgets, "curve")
                if is_there(widgets, "opening"):
                    print("that is a preview")
                    spread("keys while it converts", measure_keys(display, chance, lambda: is_there(widgets, "opening")))
                print(f"the whole is there after {time.monotonic() - start:.1f} s")
                display.seconds_until_changed(PANEL, lambda: display.key("h"))
                display.seconds_until_changed(PANEL, lambda: display.key("h"))
            if words.add_scalar:
                click(display, place_of(widgets, "scalar"))
                click(display, place_of(widgets, "further scalar " + words.add_scalar))
                place_of(widgets, "opening")
                display.move(700, 400)
                spread("keys while a scalar is added",
                       measure_keys(display, chance, lambda: is_there(widgets, "opening")))

            keys, drags = [], []
            display.move(700, 400)
            for _ in range(words.inputs):
                time.sleep(chance.uniform(0.05, 0.8))
                keys.append(display.seconds_until_changed(PANEL, lambda: display.key("h")))
            for _ in range(words.inputs):
                time.sleep(chance.uniform(0.05, 0.8))
                display.move(700, 400)
                display.button(1)
                display.move(710, 405)  # so that the next movement comes during a drag
                time.sleep(chance.uniform(0.02, 0.3))
                drags.append(display.seconds_until_changed(PICTURE, lambda: display.move(730, 415)))
                display.button(0)
            spread("keys", keys)
            spread("movements", drags)
            peak = [line for line in open(f"/proc/{window.pid}/status") if line.startswith("VmHWM")][0]
            print(f"peak memory {int(peak.split()[1]) / 1024:.0f} MiB")
            start = time.monotonic()
            display.key("Escape")
            window.wait()
            print(f"closed {1000 * (time.monotonic() - start):.0f} ms after Escape")
        finally:
            server.terminate()
            server.wait()


main()
