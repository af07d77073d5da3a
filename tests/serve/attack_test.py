#!/usr/bin/python3
"""Attacks a server on the loopback: those without the token stay out, those with it harm no one but themselves.

    attack_test.py PROGRAM
"""
import json
import os
import pathlib
import random
import resource
import socket
import struct
import subprocess
import sys
import tempfile
import time

sys.path.insert(0, str(pathlib.Path(__file__).parent))
from serving import Viewer, serving, wait_for, websocket  # noqa: E402

IS_WHOLE = "CURVISPLAT_WHOLE" in os.environ
program = sys.argv[1]
failures = []


def expect(condition, what):
    if not condition:
        failures.append(what)
        print("FAILED:", what)


def ask(server, request, patience_s=15):
    """Sends bytes and returns all that comes back before the server closes; None if it does not."""
    with socket.create_connection((server.name.strip("[]"), server.port), timeout=patience_s) as line:
        try:
            line.sendall(request)
            answer = b""
            while part := line.recv(65536):
                answer += part
            return answer
        except (ConnectionResetError, BrokenPipeError):
            return answer if "answer" in dir() else b""
        except TimeoutError:
            return None


def status(answer):
    return int(answer.split()[1]) if answer and answer.startswith(b"HTTP/1.1 ") else None


def get(server, target, host=None, method="GET", headers=()):
    lines = [f"{method} {target} HTTP/1.1", f"Host: {server.host if host is None else host}", *headers, "", ""]
    return ask(server, "\r\n".join(lines).encode("latin-1"))


def upgrade(origin):
    return ["Connection: Upgrade", "Upgrade: websocket", "Sec-WebSocket-Version: 13", "Sec-WebSocket-Key: AAAAAAAAAAAAAAAAAAAAAA==",
            *([f"Origin: {origin}"] if origin else [])]


def draws(server, what):
    """Someone else still gets pictures."""
    viewer = Viewer(server)
    viewer.open()
    viewer.view()
    expect(isinstance(viewer.picture(), bytes), f"a viewer is served after {what}")
    viewer.socket.close()


def is_refused(connect, code, what):
    try:
        connect().close()
        expect(False, f"{what} is refused")
    except websocket.WebSocketBadStatusException as error:
        expect(error.status_code == code, f"{what}: status {error.status_code}, expected {code}")


def strangers(server):
    token = server.token
    expect(status(get(server, f"/?token={token}")) == 200, "the page is sent")
    for wrong in ("", token[:-1], token + "0", token[:-1] + ("0" if token[-1] != "0" else "1"), token.upper() + "A", "%00", "*", "'--"):
        answer = get(server, f"/?token={wrong}")
        expect(status(answer) == 403, f"token '{wrong}' is refused")
        expect(b"<html" not in answer and token.encode() not in answer, "a refusal has neither page nor token")
        is_refused(lambda wrong=wrong: server.socket(token=wrong), 403, f"a socket with token '{wrong}'")
    expect(status(get(server, "/")) == 403, "no token is refused")
    # Other names of this machine, which someone's own name server may give it.
    for host in ("evil.example", f"evil.example:{server.port}", "127.0.0.1.evil.example", "", "localhost:1:2"):
        expect(status(get(server, f"/?token={token}", host=host)) == 421, f"host '{host}' is refused")
    is_refused(lambda: server.socket(host="evil.example"), 421, "a socket by another name")
    # Pages of other sites, in the browser of someone who has the page open.
    for origin in ("http://evil.example", "null", f"http://{server.name}:1", "", f"http://{server.host}.evil.example"):
        answer = get(server, f"/socket?token={token}", headers=upgrade(origin))
        expect(status(answer) == 403, f"origin '{origin}' is refused")
    for method in ("POST", "PUT", "DELETE", "OPTIONS"):
        expect(status(get(server, f"/?token={token}", method=method)) == 405, f"{method} is refused")
    head = get(server, f"/?token={token}", method="HEAD")
    expect(status(head) == 200 and head.endswith(b"\r\n\r\n"), "HEAD has no body")
    page = get(server, f"/?token={token}").lower()
    for header in (b"content-security-policy: default-src 'none'", b"referrer-policy: no-referrer", b"cache-control: no-store",
                   b"x-content-type-options: nosniff"):
        expect(header in page, header.decode())
    expect(b"http://" not in page.split(b"\r\n\r\n", 1)[1], "the page names no other address")


def paths(server):
    token = server.token
    for path in ("/../../../../etc/passwd", "//etc/passwd", "/%2e%2e/%2e%2e/etc/passwd", "/..%2f..%2fetc/passwd", "/.", "/index.html", "/socket/",
                 "/socket/..", "/a\\..\\b", "*", "http://evil.example/", "/?/etc/passwd", "file:///etc/passwd"):
        answer = get(server, f"{path}{'&' if '?' in path else '?'}token={token}")
        expect(answer is not None and b"root:" not in answer, f"{path} leads nowhere")
        if "?" not in path:
            expect(status(answer) in (400, 404), f"{path}: {status(answer)}")


def broken_requests(server):
    random.seed(1)
    request = f"GET /?token={server.token} HTTP/1.1\r\nHost: {server.host}\r\n\r\n".encode()
    for answer in (ask(server, b"\x16\x03\x01\x02\x00" * 20), ask(server, b"GET / HTTP/9.9\r\n\r\n"), ask(server, b"\r\n\r\n\r\nX\r\n\r\n")):
        expect(answer is not None and status(answer) in (400, None), "what is not HTTP is refused")
    answer = ask(server, b"GET /" + b"a" * 100_000 + b" HTTP/1.1\r\n\r\n")
    expect(answer is not None and status(answer) in (413, None), "a huge request is refused")
    answer = ask(server, b"GET / HTTP/1.1\r\n" + b"X: y\r\n" * 20_000 + b"\r\n")
    expect(answer is not None and status(answer) in (413, None), "a huge header is refused")
    answer = get(server, f"/?token={server.token}", headers=["Content-Length: 99999999999"])
    expect(answer is not None and status(answer) in (413, None), "a huge body is refused")
    answer = get(server, f"/?token={server.token}", headers=["Content-Length: 5", "Transfer-Encoding: chunked"])
    expect(answer is not None and status(answer) != 200, "a body of two lengths is refused")
    for _ in range(200 if IS_WHOLE else 60):
        bad = bytearray(request)
        for _ in range(random.randint(1, 8)):
            bad[random.randrange(len(bad))] = random.randrange(256)
        with socket.create_connection((server.name, server.port), timeout=15) as line:
            line.sendall(bad[:random.randint(1, len(bad))])
    expect(server.is_alive(), "the server lives after broken requests")


def frame(opcode, payload=b"", final=True, masked=True, length=None, reserved=0):
    length = len(payload) if length is None else length
    head = bytes([(0x80 if final else 0) | reserved << 4 | opcode])
    mask = 0x80 if masked else 0
    if length < 126:
        head += bytes([mask | length])
    elif length < 65536:
        head += bytes([mask | 126]) + struct.pack(">H", length)
    else:
        head += bytes([mask | 127]) + struct.pack(">Q", length)
    return head + (b"\0\0\0\0" if masked else b"") + payload


def broken_frames(server):
    random.seed(2)
    cases = [frame(1, b"x" * 10, masked=False), frame(1, length=2**62), frame(1, length=2**63 + 5), frame(1, b"x" * 70_000), frame(2, b"\0" * 100),
             frame(3, b"x"), frame(9, b"p" * 126), frame(9, final=False), frame(0, b"x"), frame(1, b"{", final=False) + frame(1, b"}"),
             frame(1, b"x", reserved=7), frame(8, b"\x00"), frame(8, b"\x03\xe8\xff\xfe"), frame(1, b"\xff\xfe\xfd"),
             b"".join(frame(1 if n == 0 else 0, b"x" * 1000, final=False) for n in range(100))]
    cases += [bytes(random.randrange(256) for _ in range(random.randint(1, 300))) for _ in range(100 if IS_WHOLE else 25)]
    for case in cases:
        viewer = Viewer(server).socket
        try:
            viewer.sock.sendall(case)
            viewer.sock.sendall(frame(8, b"\x03\xe8"))
            viewer.sock.settimeout(5)
            while viewer.sock.recv(65536):
                pass
        except (OSError, TimeoutError):
            pass
        viewer.sock.close()
    expect(server.is_alive(), "the server lives after broken frames")
    draws(server, "broken frames")


def broken_messages(server):
    viewer = Viewer(server)
    viewer.open()
    base = viewer.facts["state"]
    for text in ("", "[]", "{}", '{"type": 1}', '{"type": "open"}', '{"type": "open", "cache": 99, "size": [1, 1]}', "[" * 5000, '"\\ud800"',
                 '{"type": "view", "number": 1e400}', '{"type": "histogram", "cache": 0, "scalar": "none", "low": 0, "high": 1, "log": false}',
                 '{"type": "command", "cache": 0, "size": [1, 1], "step": 0, "state": {}}',
                 json.dumps({"type": "command", "cache": 0, "size": [1, 1], "step": 9, "state": base}),
                 '{"type": "pick"}', '{"type": "pick", "x": 2, "y": 0}', '{"type": "pick", "x": "a", "y": 0}',
                 '{"type": "colours", "map": "../../etc/passwd"}', '{"type": "choose", "cache": 0, "scalar": "/etc/passwd"}'):
        viewer.socket.send(text)
        expect(viewer.text("error")["text"], f"'{text[:30]}' is answered with an error")
    # Views that can hardly be drawn (usually one in three): each is drawn, or refused by one line, which names no place of this machine.
    extremes = [0, -1, 1e-300, 1e300, 1e308, -1e308, 1e-20, 5e-324]
    changes = [("camera", "position", [v, v, v]) for v in extremes] + [("camera", "focal_point", [v, 0, v]) for v in extremes]
    changes += [("camera", "view_up", [v, 0, 0]) for v in extremes] + [("camera", "parallel_scale", v) for v in extremes]
    changes += [("camera", "view_angle", v) for v in extremes + [179.0, 0.001]] + [(None, "scale", [v, 1, 1]) for v in extremes]
    changes += [(None, "lod_pixels", v) for v in extremes] + [(None, "memory_bytes", v) for v in extremes]
    changes += [(None, "slice_opacity", v) for v in extremes]
    changes += [(None, "clip_box", {"lower": [v, v, v], "upper": [1e308] * 3}) for v in extremes]
    changes += [(None, list_, [{"point": [v, 0, 0], "normal": [v, 0, 0]}]) for v in extremes for list_ in ("clip_planes", "slices")]
    changes += [(None, "slices", [{"point": [0, 0, 0], "normal": [0, 0, 1]}] * 1000), (None, "variable", "../x"), (None, "curvisplat_view", 2)]
    changes += [("function", "RGBPoints", p) for p in ([], [0, 0, 0, 0], [0, 0, 0, 0, 1e308, 1, 1, 1], [-1e308, 0, 0, 0, 1e308, 1, 1, 1],
                                                       [0, 2, 0, 0, 1, 0, 0, 0], [0, 0, 0, 0, 5e-324, 1, 1, 1])]
    changes += [("function", "Points", p) for p in ([], [0, 1, .5, 0], [0, 1, .5, 0, 1e308, 1, .5, 0], [0, 1, 0, 1, 0, 0, 1, 1, 1, 1, .5, 0])]
    changes += [("function", "ScalarOpacityUnitDistance", v) for v in extremes] + [("function", "UseLogScale", 1)]
    drawn = refused = 0
    for place, field, value in changes if IS_WHOLE else changes[::3]:
        for perspective in ((False, True) if place == "camera" else (False,)):
            state = json.loads(json.dumps(base))
            state["camera"]["perspective"] = perspective
            (state[place] if place else state)[field] = value
            viewer.view(state)
            answer = viewer.picture()
            if isinstance(answer, str):
                refused += 1
                expect("\n" not in answer and str(folder) not in answer, f"'{answer}' has a path or lines")
            else:
                drawn += 1
            if not server.is_alive():
                expect(False, f"the server lives after {place}.{field} = {value}")
                return
    print(f"{drawn} odd views drawn, {refused} refused")
    # Places that nothing is seen at, and many at once: one line or a marker each, of the newest.
    viewer.view(base)
    viewer.picture()
    for x, y in ((0, 0), (1, 1), (0.5, 0.5)):
        for _ in range(20):
            viewer.send(type="pick", x=x, y=y)
        while True:
            message = viewer.receive()
            if isinstance(message, dict) and message["type"] in ("error", "marker"):
                expect(str(folder) not in json.dumps(message), f"no path in {message}")
                break
    expect(server.is_alive(), "the server lives after clicks")
    # A mouse that rests where there is nothing is told so, even if its view was sent just before; a command names no folder.
    viewer.view(base)
    viewer.send(type="pick", x=0, y=0, hovers=True)
    expect(viewer.text("value")["marker"] is None, "there is nothing in the corner")
    viewer.send(type="command", cache=0, size=[64, 48], step=0, state=base)
    expect(str(folder) not in json.dumps(viewer.text("command")), "no path in the command")
    # Faces that the grid lacks are refused, those that it has are drawn.
    face = {"colour": [1, 0, 0], "opacity": 1, "by_function": False, "visible": True}
    for name, is_drawn in (("jmin", True), ("../x", False), ("block 9:i=3", False), ("all", True)):
        viewer.view(base | {"faces": [face | {"name": name}]})
        expect(isinstance(viewer.picture(), bytes) == is_drawn, f"the face {name} is {'drawn' if is_drawn else 'refused'}")
    # Surfaces name files: none is read.
    secret = pathlib.Path(folder, "secret.stl")
    secret.write_text("solid x\nendsolid x\n")
    for file in ("/etc/passwd", str(secret), "/dev/zero"):
        state = json.loads(json.dumps(base))
        state["surfaces"] = [{"file": file, "colour": [1, 0, 0]}]
        viewer.view(state)
        expect(isinstance(viewer.picture(), bytes), f"the surface {file} is passed over")
    opened = subprocess.run(["ls", "-l", f"/proc/{server.process.pid}/fd"], capture_output=True, text=True).stdout
    expect("secret.stl" not in opened and "passwd" not in opened and "/dev/zero" not in opened, "no file of a message's was opened")
    viewer.socket.close()


def no_paths(server):
    """All that a viewer gets, searched for places of this machine."""
    viewer = Viewer(server)
    texts = [json.dumps(viewer.hello), json.dumps(viewer.open())]
    viewer.send(type="choose", cache=0, scalar="nothing")
    texts.append(json.dumps(viewer.text("error")))
    viewer.view(step=5)
    texts.append(str(viewer.picture()))
    for text in texts:
        expect(str(folder) not in text and "/tmp" not in text and "/home" not in text, f"no path in {text[:200]}")
    viewer.socket.close()


def floods(server):
    """Too many messages close the connection, whichever they are."""
    for what, payload in (("messages", frame(1, b'{"type":"shown","picture":1}')), ("pings", frame(9, b"x")),
                          ("requests", frame(1, b'{"type":"histogram","cache":0,"scalar":"value","low":0,"high":1,"log":false}'))):
        viewer = Viewer(server).socket
        viewer.sock.settimeout(30)
        try:
            for _ in range(300):
                viewer.sock.sendall(payload * 100)
            while viewer.sock.recv(65536):
                pass
            closed = True
        except TimeoutError:
            closed = False
        except OSError:
            closed = True
        expect(closed, f"a flood of {what} is cut off")
        viewer.sock.close()
    expect(server.kilobytes() < 600_000, f"memory after floods: {server.kilobytes()} kB")
    draws(server, "floods")


def slow_readers(server):
    """A page that reports no picture and reads nothing: what waits for it stays bounded."""
    readers = []
    for _ in range(3):
        viewer = Viewer(server, size=(800, 600))
        viewer.open()
        readers.append(viewer)
    before = server.kilobytes()
    for n in range(60):
        for viewer in readers:
            viewer.facts["state"]["camera"]["parallel_scale"] *= 1.001
            viewer.view(moving=True)
        time.sleep(0.02)
    draws(server, "slow readers")
    grown = server.kilobytes() - before
    expect(grown < 400_000, f"three readers that do not read cost {grown} kB")
    for viewer in readers:
        viewer.socket.sock.close()


def many_connections(server):
    """Connections that say nothing do not keep viewers out for longer than a request may take."""
    lines = []
    for _ in range(200):
        try:
            line = socket.create_connection((server.name, server.port), timeout=5)
            line.sendall(b"GET / HT")
            lines.append(line)
        except OSError:
            break
    start = time.monotonic()

    def connects():
        try:
            server.socket(timeout=2).close()
            return True
        except (OSError, websocket.WebSocketException):
            return False

    wait_for(connects, "a viewer to get in beside silent connections", 30)
    print(f"a viewer got in {time.monotonic() - start:.1f} s after 200 silent connections")
    for line in lines:
        line.close()


def too_many_viewers(server, most):
    viewers = []
    for _ in range(most):
        viewers.append(Viewer(server))
    extra = server.socket()
    told = extra.sock.recv(1000)
    expect(told[0] == 0x88 and struct.unpack(">H", told[2:4])[0] == 1013, "one viewer too many is told to try again later")
    viewers.pop().socket.close()
    Viewer(server).socket.close()  # the place is free again
    for viewer in viewers:
        viewer.socket.close()


def no_descriptors(server):
    """Connections that say nothing take all descriptors; once they have ended, others are heard again."""
    open_now = len(list(pathlib.Path(f"/proc/{server.process.pid}/fd").iterdir()))
    resource.prlimit(server.process.pid, resource.RLIMIT_NOFILE, (open_now + 4, open_now + 64))
    silent = [socket.create_connection((server.name, server.port)) for _ in range(12)]
    for connection in silent:
        connection.close()
    resource.prlimit(server.process.pid, resource.RLIMIT_NOFILE, (open_now + 64, open_now + 64))
    draws(server, "a lack of descriptors")


def changing_cache():
    """While a cache is served it gets a scalar and a time step, is damaged, and is replaced: the next viewer is shown that, and one that
    was connected before goes on."""
    def run(*words):
        subprocess.run([program, *words], check=True, capture_output=True)

    def facts():
        viewer = Viewer(server)
        viewer.open()
        viewer.socket.close()
        return [scalar["name"] for scalar in viewer.facts["scalars"]], len(viewer.facts["times"]), viewer.facts["samples"]

    def draws_on(what):
        before.view()
        expect(isinstance(before.picture(), bytes), f"a viewer from before draws after {what}")

    cache, manifest = f"{folder}/wake.splats", pathlib.Path(folder, "wake.splats", "manifest.json")
    run("generate", "wake", "--size", "24x16x12", "--steps", "2", "-o", f"{folder}/w")
    run("convert", f"{folder}/w.xyz", f"{folder}/w_0000.fun", "-o", cache, "--refine", "1")
    with serving(program, [cache]) as server:
        before = Viewer(server)
        name = before.open()["scalars"][0]["name"]
        draws_on("nothing")
        run("convert", "--add-scalar", "volume", f"{folder}/w.xyz", f"{folder}/w_0000.fun", "--to", cache)
        expect(facts() == ([name, "volume"], 1, 24 * 16 * 12), f"the new scalar is shown: {facts()}")
        draws_on("a scalar")
        run("convert", "--add-steps", f"{folder}/w.xyz", f"{folder}/w_0001.fun", "--to", cache)
        expect(facts()[1] == 2, f"the new step is shown: {facts()}")
        draws_on("a step")
        before.view(step=1)
        expect(before.picture() == "there is no step 1; the last one is 0", "a viewer from before has the steps from before")
        whole = manifest.read_bytes()
        manifest.write_bytes(whole[:100])
        expect(facts()[1] == 2 and "as it was before" in server.messages(), f"a damaged cache stays as it was: {server.messages()}")
        manifest.write_bytes(whole)
        run("generate", "wake", "--size", "20x16x12", "-o", f"{folder}/other")
        run("convert", f"{folder}/other.xyz", f"{folder}/other.fun", "-o", cache, "--overwrite", "--refine", "1")
        expect(facts() == ([name], 1, 20 * 16 * 12), f"the cache in its place is shown: {facts()}")
        draws_on("the end of its cache")


with tempfile.TemporaryDirectory() as folder:
    subprocess.run([program, "generate", "half-annulus", "--size", "40x20x20", "-o", f"{folder}/g"], check=True, capture_output=True)
    subprocess.run([program, "convert", f"{folder}/g.xyz", f"{folder}/g.fun", "-o", f"{folder}/secret place.splats"], check=True, capture_output=True)
    caches = [f"{folder}/secret place.splats"]
    with serving(program, caches, "--viewer-memory", "128M", "--memory", "512M", "--backend", "cpu") as server:
        threads = server.threads()
        for attack in (strangers, paths, broken_requests, broken_frames, broken_messages, no_paths, floods, slow_readers, many_connections, no_descriptors):
            attack(server)
            if not server.is_alive():
                print(f"FAILED: the server ended during {attack.__name__}: {server.messages()}")
                sys.exit(1)
            print(f"{attack.__name__}: {server.kilobytes()} kB, {server.threads()} threads")
        wait_for(lambda: server.threads() <= threads, "the viewers' threads to end")
        too_many_viewers(server, 4)
        expect(server.token not in server.messages(), "the log has no token")
        code = server.stop()
        expect(code == 130, f"Ctrl-C ends it: exit status {code}, {server.messages()}")
    # Its address names other machines: a warning.
    with serving(program, caches, "--listen", "0.0.0.0") as server:
        wait_for(lambda: "warning" in server.messages(), "the warning of --listen")
    refused = subprocess.run([program, "serve", *caches, "--listen", "evil.example"], capture_output=True, text=True)
    expect(refused.returncode == 2, "--listen wants an address in digits")
    with serving(program, caches) as server:
        taken = subprocess.run([program, "serve", *caches, "--port", str(server.port)], capture_output=True, text=True)
        expect(taken.returncode == 1 and "--port" in taken.stderr, f"a taken port: {taken.stderr}")

    changing_cache()

print(f"{len(failures)} failures")
sys.exit(1 if failures else 0)
