#!/usr/bin/python3
"""serve_viewers.py PROGRAM SAMPLES SECONDS CACHE...

The viewers of serve.sh. In each round three connect to a server at once, turn the view, change function, cuts, scalar and step, ask
for values and histograms, and leave, some in the middle of a picture. After each round a line is appended to SAMPLES: seconds, those
at the begin, KiB in memory, open files and threads of the server. Exit status 1 where the first view is not drawn as it was before,
or where memory, files or threads of viewers remain that have left.
"""
import concurrent.futures
import json
import pathlib
import random
import struct
import sys
import time

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent.parent / "serve"))
from serving import Viewer, serving, wait_for  # noqa: E402

program, samples, seconds, caches = sys.argv[1], sys.argv[2], float(sys.argv[3]), sys.argv[4:]
SIZE, VIEWERS = (160, 120), 3
KEPT_KIB = 24 << 10  # what malloc may keep of viewers that have left, and libraries that they have loaded


def at_rest(viewer, **view):
    """The final picture, a PNG: the same bytes whenever the same view is asked for."""
    viewer.view(**view)
    picture = viewer.picture()
    assert isinstance(picture, bytes), picture
    return picture[picture.index(b"\x89PNG"):]


def moving(viewer, **view):
    """The first picture of a view that is being turned."""
    viewer.view(moving=True, **view)
    while True:
        message = viewer.receive()
        if not isinstance(message, bytes):
            assert message["type"] != "error", message
            continue
        viewer.send(type="shown", picture=struct.unpack_from("<I", message, 4)[0])
        if struct.unpack_from("<d", message, 8)[0] == viewer.number:
            return


def turned(viewer, choice):
    state = json.loads(json.dumps(viewer.facts["state"]))
    camera = state["camera"]
    camera["position"] = [x + choice.uniform(-1, 1) for x in camera["position"]]
    camera["parallel_scale"] *= choice.uniform(0.3, 1)
    return state


def edited(viewer, choice):
    state = turned(viewer, choice)
    points = state["function"]["Points"]
    for n in range(1, len(points), 4):
        points[n] = choice.uniform(0, 1)
    state["function"]["ScalarOpacityUnitDistance"] *= choice.uniform(0.5, 2)
    if choice.random() < 0.5:
        state["clip_planes"] = [{"point": state["camera"]["focal_point"], "normal": [choice.uniform(-1, 1), 0.5, 1]}]
    return state


def visit(server, seed):
    """Returns the picture of the first view."""
    choice = random.Random(seed)
    viewer = Viewer(server, SIZE)
    cache = seed % len(caches)
    viewer.open(cache)
    scalars, steps = [scalar["name"] for scalar in viewer.facts["scalars"]], len(viewer.facts["times"])
    first = at_rest(viewer)
    for _ in range(3):
        moving(viewer, state=turned(viewer, choice), step=choice.randrange(steps))
    at_rest(viewer, state=edited(viewer, choice), step=choice.randrange(steps))
    viewer.send(type="pick", x=choice.random(), y=choice.random())
    viewer.send(type="choose", cache=cache, scalar=choice.choice(scalars))
    viewer.send(type="histogram", cache=cache, scalar=choice.choice(scalars), low=0, high=1, log=False)
    viewer.text("histogram")
    if choice.random() < 0.5:
        viewer.socket.close()
    else:  # as a page that is closed, or whose network is gone, while it is sent pictures
        viewer.view(state=edited(viewer, choice), moving=choice.random() < 0.5)
        viewer.socket.sock.close()
    return cache, first


def settled_kilobytes(server):
    """The server's memory once it stops falling: it gives back what a viewer had after that viewer's threads have ended."""
    least, fell = server.kilobytes(), time.time()
    while time.time() < fell + 0.5:
        time.sleep(0.05)
        if (now := server.kilobytes()) < least:
            least, fell = now, time.time()
    return least


def files_of(server):
    return len(list(pathlib.Path(f"/proc/{server.process.pid}/fd").iterdir()))


with serving(program, caches, "--viewer-memory", "96M", "--memory", "288M", "--backend", "cpu") as server, \
        concurrent.futures.ThreadPoolExecutor(VIEWERS) as pool, open(samples, "w", buffering=1) as log:
    def state():
        return {"files": files_of(server), "threads": server.threads(), "KiB": server.kilobytes()}

    before, begin = state(), time.time()
    before["KiB"] += KEPT_KIB
    rounds, pictures = 0, {}
    while time.time() < begin + seconds:
        seeds = range(VIEWERS * rounds, VIEWERS * (rounds + 1))
        for cache, first in pool.map(lambda seed: visit(server, seed), seeds):
            assert pictures.setdefault(cache, first) == first, f"round {rounds}: the first picture of cache {cache} has changed"
        rounds += 1
        try:
            wait_for(lambda: all(now <= before[what] for what, now in state().items()), "viewers to be gone", 20)
        except AssertionError:
            sys.exit(f"round {rounds}: when all viewers had left, the server had {state()}; expected at most {before}")
        log.write(f"{time.time()} {begin} {settled_kilobytes(server)} {files_of(server)} {server.threads()}\n")
    assert server.is_alive() and server.messages().count("\n") <= 1, server.messages()
    status = server.stop()
    assert status == 130, f"Ctrl-C ends it with status {status}"
    print(f"{rounds * VIEWERS} visits in {rounds} rounds")
