#!/usr/bin/python3
"""Pictures of a moving camera from `curvisplat serve`: how many a second, and what each takes of the processors.

    bench/page_times.py CACHE [--seconds 10] [--size 1280x800] [--program build/release/tools/curvisplat] [--delay-ms 0]

A page without a browser turns the camera by a degree a request, as a dragged mouse does, and reports each picture as soon as it
is there (or `--delay-ms` later: a slow line), as often as a screen of 240 Hz shows. Prints pictures a second, the server's
processor time for each, and their bytes, after a second of adaptation. Processor time tells versions apart on a machine with
other work; pictures a second do not.
"""
import argparse
import json
import math
import os
import pathlib
import struct
import sys
import time

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent.parent / "tests" / "serve"))
from serving import serving  # noqa: E402

FRAME_S = 1 / 240


def processor_seconds(process):
    fields = pathlib.Path(f"/proc/{process.pid}/stat").read_text().rsplit(")", 1)[1].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def turned(camera, degrees):
    """The camera about the z axis through its focal point."""
    c, s = math.cos(math.radians(degrees)), math.sin(math.radians(degrees))
    x, y = (camera["position"][n] - camera["focal_point"][n] for n in (0, 1))
    place = [camera["focal_point"][0] + c * x - s * y, camera["focal_point"][1] + s * x + c * y, camera["position"][2]]
    return {**camera, "position": place}


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("cache")
    parser.add_argument("--seconds", type=float, default=10)
    parser.add_argument("--size", default="1280x800")
    parser.add_argument("--program", default="build/release/tools/curvisplat")
    parser.add_argument("--delay-ms", type=float, default=0)
    arguments = parser.parse_args()
    size = [int(n) for n in arguments.size.split("x")]
    with serving(arguments.program, [arguments.cache]) as server:
        begin = time.monotonic()
        page = server.socket()

        def receive():
            data = page.recv()
            return json.loads(data) if isinstance(data, str) else data

        receive()
        page.send(json.dumps({"type": "open", "cache": 0, "size": size}))
        state = receive()["state"]
        camera, number, pictures, sent = state["camera"], 0, [], 0.0
        first, asked = None, 0.0

        def ask():
            nonlocal number, camera, asked
            number += 1
            asked = time.monotonic()
            camera = turned(camera, 1)
            page.send(json.dumps({"type": "view", "number": number, "cache": 0, "size": size, "moving": True, "step": 0,
                                  "state": {**state, "camera": camera}}))

        ask()
        ask()
        while first is None or time.monotonic() < first + 1 + arguments.seconds:
            message = receive()
            if isinstance(message, dict):
                raise SystemExit(str(message))
            now = time.monotonic()
            if first is None:
                first, until_first = now, processor_seconds(server.process)
            if now > first + 1 and not sent:
                sent, counted = processor_seconds(server.process), now
            if sent:
                pictures.append((len(message), struct.unpack_from("<f", message, 28)[0], struct.unpack_from("<I", message, 36)[0]))
            time.sleep(max(arguments.delay_ms / 1000, asked + FRAME_S - time.monotonic()))
            page.send(json.dumps({"type": "shown", "picture": struct.unpack_from("<I", message, 4)[0]}))
            ask()
        used = processor_seconds(server.process) - sent
        passed = time.monotonic() - counted
    middle = sorted(pictures)[len(pictures) // 2]
    print(f"first picture after {first - begin:.2f} s and {until_first:.2f} s of the processors; "
          f"{len(pictures) / passed:.1f} pictures a second; {1000 * used / len(pictures):.1f} ms of the processors each; "
          f"median of {middle[0] / 1024:.0f} KiB, drawn in {1000 * middle[1]:.1f} ms, of {middle[2]} splats")


if __name__ == "__main__":
    main()
