#!/usr/bin/env python3
"""Measures how fast the window responds, on a virtual display.

Prints the time from the start until the window and until data are on the screen; from a key, and from a drag of the mouse,
until the screen changes, at moments spread over the refinement; from Ctrl+Q until the program ends; and its peak memory. The
screen is polled about every millisecond through Xlib: a screenshot by another program would take longer than what is measured.
Of each time the part is printed, too, that the window's own thread waited for a core (Linux's schedstat): other work on the
machine adds to it, and a machine with nothing else to do has little of it.

    bench/window_times.py CACHE [--inputs 40] [--backend cpu] [--program build/release/tools/curvisplat]
    bench/window_times.py GRID SOLUTION              # while it converts: until the preview, and input until the whole is there
    bench/window_times.py --while-converting         # the same of a grid that it generates; ends with a line that says whether 95 %
                                                     # of the input is answered within 100 ms
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
    """x, y, width and height of a widget, from the file that the window writes (tools/window/widgets.h)."""
    end = time.monotonic() + 120
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


class Inputs:
    """Keys and movements of the mouse, and how long each takes until the screen changes."""

    def __init__(self, display, chance, places, window):
        self.display, self.chance, self.window = display, chance, window
        left, top, self.width, self.height = place_of("picture", places)
        self.middle = (left + self.width // 2, top + self.height // 2)
        # A part of the picture that is clear of the scalar bar; and the curve of the opacities.
        self.picture = (left + self.width // 8, top + 9 * self.height // 20, 5 * self.width // 8, self.height // 10)
        self.panel = place_of("curve", places)

    def key(self):
        return self.display.until_changed(self.panel, lambda: self.display.key("h"), self.window)

    def drag(self):
        self.display.move(*self.middle)
        self.display.button(1)
        # So that the next movement comes during a drag.
        self.display.move(self.middle[0] + self.width // 80, self.middle[1] + self.height // 160)
        time.sleep(self.chance.uniform(0.02, 0.3))
        there = self.middle[0] + self.width // 30, self.middle[1] + self.height // 50
        took = self.display.until_changed(self.picture, lambda: self.display.move(*there), self.window)
        self.display.button(0)
        return took

    def while_it_lasts(self, goes_on):
        """Two keys and a drag in turn, as long as something goes on."""
        keys, drags = [], []
        self.display.move(*self.middle)
        while goes_on() and len(keys) < 500:
            for _ in range(2):
                time.sleep(self.chance.uniform(0.05, 0.4))
                keys.append(self.key())
            time.sleep(self.chance.uniform(0.2, 0.6))
            if goes_on():
                drags.append(self.drag())
        return keys, drags


PROMISED_MS = 100


def within(times, part=0.95):
    """Milliseconds within which that part of the input was answered."""
    ordered = sorted(seconds for seconds, _ in times)
    return 1000 * ordered[min(len(ordered) - 1, int(part * len(ordered)))]


def judge(keys, drags):
    if min(len(keys), len(drags)) < 20:
        return print(f"no verdict: {len(keys)} keys and {len(drags)} movements while it converted, of 20 that are needed; "
                     "take a larger grid")
    slowest = max(within(keys), within(drags))
    print(f"while it converts, 95 % of keys are answered within {within(keys):.0f} ms and 95 % of movements within "
          f"{within(drags):.0f} ms: {'less' if slowest <= PROMISED_MS else 'MORE'} than the {PROMISED_MS} ms promised")


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("cache", type=pathlib.Path, nargs="*", help="a cache, or a grid and its solutions")
    parser.add_argument("--while-converting", action="store_true", help="of a grid that is generated")
    parser.add_argument("--nodes", default="320x256x192", help="of that grid (default: 320x256x192, 16 M nodes)")
    parser.add_argument("--add-scalar", help="of the cache's sources, which is added to it")
    parser.add_argument("--inputs", type=int, default=40)
    parser.add_argument("--backend", default="auto")
    root = pathlib.Path(__file__).resolve().parent.parent
    parser.add_argument("--program", type=pathlib.Path, default=root / "build/release/tools/curvisplat")
    words = parser.parse_args()
    if bool(words.cache) == words.while_converting:
        parser.error("name a cache or a grid, or give --while-converting")
    chance = random.Random(1)
    with tempfile.TemporaryDirectory() as folder:
        if words.while_converting:
            subprocess.run([words.program.resolve(), "generate", "half-annulus", "--size", words.nodes, "-o", "grid"],
                           cwd=folder, check=True, stdout=subprocess.DEVNULL)
            words.cache = [pathlib.Path(folder) / "grid.xyz", pathlib.Path(folder) / "grid.fun"]
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
            measured = [], []
            while display.pixels(screen) == blank:
                time.sleep(0.001)
            print(f"window on the screen after {1000 * (time.monotonic() - start):.0f} ms")
            inputs = Inputs(display, chance, places, window)
            while not coloured(display.pixels(inputs.picture)):
                time.sleep(0.005)
            print(f"data on the screen after {1000 * (time.monotonic() - start):.0f} ms")
            if converts:
                if is_there("opening", places):
                    print("that is a preview")
                    measured = inputs.while_it_lasts(lambda: is_there("opening", places))
                    for name, times in zip(("keys", "movements"), measured):
                        spread(f"{name} while it converts", times)
                print(f"the whole is there after {time.monotonic() - start:.1f} s")
                for _ in range(2):
                    inputs.key()
            if words.add_scalar:
                click(display, "scalar", places)
                click(display, "further scalar " + words.add_scalar, places)
                place_of("opening", places)
                measured = inputs.while_it_lasts(lambda: is_there("opening", places))
                for name, times in zip(("keys", "movements"), measured):
                    spread(f"{name} while a scalar is added", times)

            keys, drags = [], []
            display.move(*inputs.middle)
            for _ in range(words.inputs):
                time.sleep(chance.uniform(0.05, 0.8))
                keys.append(inputs.key())
            for _ in range(words.inputs):
                time.sleep(chance.uniform(0.05, 0.8))
                drags.append(inputs.drag())
            spread("keys", keys)
            spread("movements", drags)
            peak = [line for line in open(f"/proc/{window.pid}/status") if line.startswith("VmHWM")][0]
            print(f"peak memory {int(peak.split()[1]) / 1024:.0f} MiB")
            start = time.monotonic()
            display.key("Control_L", "q")
            window.wait(20)
            print(f"closed {1000 * (time.monotonic() - start):.0f} ms after Ctrl+Q")
            if words.while_converting:
                judge(*measured)
        finally:
            if window:
                window.kill()
            server.terminate()
            server.wait()


if __name__ == "__main__":
    main()
