#!/usr/bin/env python3
"""Measures how fast the window responds, on a virtual display.

Prints the time from the start until the window and until data are on the screen; from a key, and from a drag of the mouse,
until the screen changes, at moments spread over the refinement; from Ctrl+Q until the program ends; and its peak memory. The
screen is polled about every millisecond through Xlib: a screenshot by another program would take longer than what is measured.
Of each time the part is printed, too, that the window's own thread waited for a core (Linux's schedstat): other work on the
machine adds to it, and a machine with nothing else to do has little of it.

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
import sys
import tempfile
import time

SIZE = (1200, 800)
KEYSYMS = {"h": 0x68, "q": 0x71, "Control_L": 0xFFE3}


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
            sys.exit(f"{name}: cannot open the display")
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

    def key(self, *names):
        """Presses the keys together: the last one, while the others are held."""
        codes = [self.x.XKeysymToKeycode(self.display, ctypes.c_ulong(KEYSYMS[name])) for name in names]
        for down, code in [(1, code) for code in codes] + [(0, code) for code in reversed(codes)]:
            self.test.XTestFakeKeyEvent(self.display, code, down, ctypes.c_ulong(0))
        self.x.XSync(self.display, 0)

    def move(self, x, y):
        self.test.XTestFakeMotionEvent(self.display, -1, x, y, ctypes.c_ulong(0))
        self.x.XSync(self.display, 0)

    def button(self, down):
        self.test.XTestFakeButtonEvent(self.display, 1, down, ctypes.c_ulong(0))
        self.x.XSync(self.display, 0)

    def until_changed(self, box, act, process=None):
        """Seconds, and those of them that the main thread of `process` waited for a core."""
        before = self.pixels(box)
        waited = waited_for_a_core(process)
        start = time.monotonic()
        act()
        while self.pixels(box) == before:
            time.sleep(0.001)
            if time.monotonic() - start > 60:
                sys.exit("the window does not answer")
        return time.monotonic() - start, waited_for_a_core(process) - waited


def waited_for_a_core(process):
    """Seconds that the main thread was ready to run and did not."""
    return int(open(f"/proc/{process.pid}/task/{process.pid}/schedstat").read().split()[1]) / 1e9 if process else 0


def place_of(widget, places):
    """x, y, width and height of a widget, from the file that the window writes (tools/viewer/widget_places.h)."""
    end = time.monotonic() + 20
    while time.monotonic() < end:
        for line in places.read_text().splitlines() if places.exists() else ():
            words = line.split(maxsplit=4)
            if words[4:] == [widget]:
                return tuple(map(int, words[:4]))
        time.sleep(0.02)
    sys.exit(f"the window has no widget '{widget}'")


def coloured(pixels):
    """Whether data is shown: more than 100 pixels that are not grey, as outline, axis names and background are."""
    return sum(max(p) - min(p) > 12 for p in zip(pixels[0::16], pixels[1::16], pixels[2::16])) > 100


def spread(name, times):
    """`times`: seconds, and those of waiting for a core."""
    if not times:
        return print(f"{name}: it was over before there was one")
    def line(seconds):
        ordered = sorted(seconds)
        of = lambda part: 1000 * ordered[min(len(ordered) - 1, int(part * len(ordered)))]
        return f"50 % within {of(0.5):.0f} ms, 95 % within {of(0.95):.0f} ms, all within {1000 * ordered[-1]:.0f} ms"
    print(f"{name}: {len(times)} samples, {line([seconds for seconds, _ in times])}")
    print(f"    without waiting for a core: {line([max(0, seconds - waited) for seconds, waited in times])}")


def click(display, widget, places):
    left, top, width, height = place_of(widget, places)
    display.move(left + width // 2, top + height // 2)
    time.sleep(0.1)
    for down in (1, 0):
        display.button(down)
        time.sleep(0.05)


def is_there(widget, places):
    return places.exists() and any(line.split(maxsplit=4)[4:] == [widget] for line in places.read_text().splitlines())


def measure_keys(display, chance, panel, goes_on, window):
    """Keys, as long as something goes on."""
    keys = []
    while goes_on() and len(keys) < 500:
        time.sleep(chance.uniform(0.05, 0.4))
        keys.append(display.until_changed(panel, lambda: display.key("h"), window))
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
    chance = random.Random(1)
    with tempfile.TemporaryDirectory() as folder:
        answer, number = os.pipe()
        server = subprocess.Popen(["Xvfb", "-displayfd", str(number), "-screen", "0", "%dx%dx24" % SIZE, "-noreset",
                                   "-nolisten", "tcp"], stderr=subprocess.DEVNULL, pass_fds=[number])
        os.close(number)
        window = None
        try:
            with open(answer) as file:
                name = f":{file.readline().strip()}"
            display = Display(name)
            places = pathlib.Path(folder) / "widgets"
            environment = dict(os.environ, DISPLAY=name, XDG_CONFIG_HOME=folder, XDG_CACHE_HOME=folder,
                               CURVISPLAT_WIDGETS=str(places))
            screen = (0, 0, *SIZE)
            blank = display.pixels(screen)
            start = time.monotonic()
            window = subprocess.Popen(
                [words.program.resolve(), "view", *[file.resolve() for file in words.cache], "--size", "%dx%d" % SIZE, "--backend",
                 words.backend], cwd=folder, env=environment, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
            converts = not words.cache[0].is_dir()
            while display.pixels(screen) == blank:
                time.sleep(0.001)
            print(f"window on the screen after {1000 * (time.monotonic() - start):.0f} ms")
            left, top, width, height = place_of("picture", places)
            middle = (left + width // 2, top + height // 2)
            # A part of the picture that is clear of the scalar bar; and the curve of the opacities.
            picture = (left + width // 8, top + 9 * height // 20, 5 * width // 8, height // 10)
            panel = place_of("curve", places)
            while not coloured(display.pixels(picture)):
                time.sleep(0.005)
            print(f"data on the screen after {1000 * (time.monotonic() - start):.0f} ms")
            if converts:
                if is_there("opening", places):
                    print("that is a preview")
                    goes_on = lambda: is_there("opening", places)
                    spread("keys while it converts", measure_keys(display, chance, panel, goes_on, window))
                print(f"the whole is there after {time.monotonic() - start:.1f} s")
                for _ in range(2):
                    display.until_changed(panel, lambda: display.key("h"))
            if words.add_scalar:
                click(display, "scalar", places)
                click(display, "further scalar " + words.add_scalar, places)
                place_of("opening", places)
                display.move(*middle)
                spread("keys while a scalar is added",
                       measure_keys(display, chance, panel, lambda: is_there("opening", places), window))

            keys, drags = [], []
            display.move(*middle)
            for _ in range(words.inputs):
                time.sleep(chance.uniform(0.05, 0.8))
                keys.append(display.until_changed(panel, lambda: display.key("h"), window))
            for _ in range(words.inputs):
                time.sleep(chance.uniform(0.05, 0.8))
                display.move(*middle)
                display.button(1)
                display.move(middle[0] + width // 80, middle[1] + height // 160)  # so that the next movement comes during a drag
                time.sleep(chance.uniform(0.02, 0.3))
                there = middle[0] + width // 30, middle[1] + height // 50
                drags.append(display.until_changed(picture, lambda: display.move(*there), window))
                display.button(0)
            spread("keys", keys)
            spread("movements", drags)
            peak = [line for line in open(f"/proc/{window.pid}/status") if line.startswith("VmHWM")][0]
            print(f"peak memory {int(peak.split()[1]) / 1024:.0f} MiB")
            start = time.monotonic()
            display.key("Control_L", "q")
            window.wait(20)
            print(f"closed {1000 * (time.monotonic() - start):.0f} ms after Ctrl+Q")
        finally:
            if window:
                window.kill()
            server.terminate()
            server.wait()


if __name__ == "__main__":
    main()
