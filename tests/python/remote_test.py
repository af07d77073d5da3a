#!/usr/bin/python3
"""Caches on a web server, read by HTTP ranges: the same bits as from the disk, and one line where a server fails or lies.

    remote_test.py PROGRAM    the package is found by PYTHONPATH
"""
import base64
import gc
import http.server
import os
import pathlib
import re
import signal
import subprocess
import sys
import tempfile
import threading
import unittest

import numpy as np

import curvisplat
from curvisplat import _remote

PROGRAM = sys.argv.pop(1)
_remote._FIRST_PAUSE_S = 0.001  # the pauses are not what is tested


class Handler(http.server.BaseHTTPRequestHandler):
    """Sends ranges of files; `server.fault(handler, name, offset)` may answer in its place, and says so."""

    protocol_version = "HTTP/1.1"
    disable_nagle_algorithm = True

    def log_message(self, *_):
        pass

    def do_GET(self):
        server = self.server
        name = self.path.split("?")[0].lstrip("/")
        begin, end = map(int, re.fullmatch(r"bytes=(\d+)-(\d+)", self.headers["Range"]).groups())
        with server.lock:
            server.requests.append((name, begin, end, dict(self.headers)))
        if server.fault and server.fault(self, name, begin):
            return
        file = server.root / name
        if not file.is_file():
            return self.send(404)
        whole = file.read_bytes()
        if begin >= len(whole):
            return self.send(416, {"Content-Range": f"bytes */{len(whole)}"})
        self.send(206, {"Content-Range": f"bytes {begin}-{min(end + 1, len(whole)) - 1}/{len(whole)}", "ETag": '"one"'}, whole[begin:end + 1])

    def send(self, status, headers=None, body=b"", length=None):
        self.send_response(status)
        for key, value in (headers or {}).items():
            self.send_header(key, value)
        self.send_header("Content-Length", str(len(body) if length is None else length))
        self.end_headers()
        self.wfile.write(body)
        if length is not None:
            self.close_connection = True


class Server(http.server.ThreadingHTTPServer):
    daemon_threads = True

    def __init__(self, root):
        super().__init__(("127.0.0.1", 0), Handler)
        self.root, self.fault, self.requests, self.lock = root, None, [], threading.Lock()
        self.url = f"http://127.0.0.1:{self.server_address[1]}"
        threading.Thread(target=self.serve_forever, args=(0.01,), daemon=True).start()

    def handle_error(self, *_):
        pass  # clients that go away


class Remote(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.folder = tempfile.TemporaryDirectory()
        cls.addClassCleanup(cls.folder.cleanup)
        cls.root = pathlib.Path(cls.folder.name)

        def run(*words):
            subprocess.run([PROGRAM, *words], cwd=cls.root, check=True, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE)

        run("generate", "half-annulus", "--size", "96x64x64", "-o", "grid")
        run("convert", "grid.xyz", "grid.fun", "-o", "grid.splats")
        run("generate", "half-annulus", "--size", "112x80x64", "-o", "big")
        run("convert", "big.xyz", "big.fun", "-o", "big.splats")
        run("generate", "wake", "--size", "24x16x8", "--steps", "3", "--moving", "-o", "wake")
        run("convert", "wake_*.xyz", "wake_*.fun", "-o", "wake.splats")
        cls.fine = curvisplat.open(str(cls.root / "grid.splats")).render(size=(200, 200), lod_pixels=0.5)
        cls.server = Server(cls.root)
        cls.addClassCleanup(cls.server.shutdown)
        cls.url = cls.server.url + "/grid.splats"

    def setUp(self):
        self.server.fault = None
        self.server.requests.clear()

    def local(self, name="grid"):
        return curvisplat.open(str(self.root / f"{name}.splats"))

    def fails(self, pattern, call, *arguments, **named):
        with self.assertRaises(curvisplat.Error) as raised:
            call(*arguments, **named)
        text = str(raised.exception)
        self.assertRegex(text, pattern)
        self.assertNotIn("\n", text)
        self.assertNotIn(tempfile.gettempdir(), text)

    def fails_to_draw(self, pattern):
        cache = curvisplat.open(self.url)
        cache.render(size=(8, 8), lod_pixels=8)
        self.server.fault, fault = self.fault, self.server.fault
        try:
            self.fails(pattern, cache.render, size=(200, 200), lod_pixels=0.5)
        finally:
            self.server.fault = fault
        # Another picture is drawn as if nothing had happened.
        np.testing.assert_array_equal(cache.render(size=(200, 200), lod_pixels=0.5), self.fine)

    # What is the same as from the disk.

    def test_same_bits(self):
        remote, local = curvisplat.open(self.url), self.local()
        self.assertEqual(remote.path, self.url)
        self.assertEqual(remote.scalars, local.scalars)
        for view in ("iso", "+x"):
            np.testing.assert_array_equal(remote.render(view=view, size=(200, 150)), local.render(view=view, size=(200, 150)))
        np.testing.assert_array_equal(remote.sample(size=16).value, local.sample(size=16).value)
        np.testing.assert_array_equal(remote.points().positions, local.points().positions)
        np.testing.assert_array_equal(remote.histogram()[0], local.histogram()[0])
        point = local.points().positions[100]
        self.assertEqual(remote.probe(point), local.probe(point))
        self.fails("view: the cache is on a server", remote.view)
        self.fails(self.url + ": the cache has no scalar 'nothing'", remote.render, "nothing")

    def test_series_of_a_moving_grid(self):
        remote, local = curvisplat.open(self.server.url + "/wake.splats/"), self.local("wake")
        self.assertEqual(len(remote.times), 3)
        for step in (0, 2, 1):
            np.testing.assert_array_equal(remote.render(step=step, size=(80, 60)), local.render(step=step, size=(80, 60)))

    def test_reads_what_is_drawn(self):
        cache = curvisplat.open(self.server.url + "/big.splats")
        cache.render(size=(24, 24), lod_pixels=4)
        once = len(self.server.requests)
        whole = sum(file.stat().st_size for file in (self.root / "big.splats").iterdir())
        self.assertLess(cache._core.fetched_bytes, whole / 2)
        cache.render(size=(24, 24), lod_pixels=4)
        self.assertEqual(len(self.server.requests), once, "the same bytes were asked for twice")

    def test_leaves_nothing(self):
        with tempfile.TemporaryDirectory() as folder:
            with curvisplat.open(self.url, folder=folder) as cache:
                cache.render(size=(20, 20))
                self.assertEqual(len(os.listdir(folder)), 1)
            del cache
            gc.collect()
            self.assertEqual(os.listdir(folder), [])

    def test_a_process_that_is_forked_leaves_the_files_to_its_parent(self):
        with tempfile.TemporaryDirectory() as folder, curvisplat.open(self.url, folder=folder) as cache:
            held, let_go = threading.Event(), threading.Event()

            def hold():  # a thread that the new process does not have
                with cache._core._remote._lock:
                    held.set()
                    let_go.wait()

            thread = threading.Thread(target=hold)
            thread.start()
            held.wait()
            child = os.fork()
            if child == 0:
                signal.alarm(30)
                failed = cache.samples == 0
                cache.__dict__.clear()
                gc.collect()
                os._exit(failed)
            let_go.set()
            thread.join()
            self.assertEqual(os.waitpid(child, 0)[1], 0)
            self.assertEqual(len(os.listdir(folder)), 1)
            cache.render(size=(20, 20))

    def test_what_handles_a_signal_reads_the_cache(self):
        cache = curvisplat.open(self.url)
        before = signal.signal(signal.SIGUSR1, lambda *_: cache.title)
        try:
            with cache._core._remote._lock, cache._core._remote._connections._lock:
                os.kill(os.getpid(), signal.SIGUSR1)
            cache.render(size=(20, 20))
        finally:
            signal.signal(signal.SIGUSR1, before)

    def test_scalars_with_blanks_of_their_own(self):
        k, j, i = np.meshgrid(*3 * [np.linspace(0, 1, 24)], indexing="ij")
        half = np.where(i < 0.5, np.nan, i).astype("f4")
        curvisplat.convert_arrays(self.root / "own.splats", curvisplat.Block(i, j, k, {"whole": (i + j).astype("f4"), "half": half}), overwrite=True)
        remote, local = curvisplat.open(self.server.url + "/own.splats"), self.local("own")
        for _ in range(2):
            np.testing.assert_array_equal(remote.render("half", size=(80, 60)), local.render("half", size=(80, 60)))
            remote.close()
        self.assertEqual(remote.scalars, local.scalars)

    def test_headers_and_names_in_the_address(self):
        cache = curvisplat.open(self.url.replace("//", "//me:a%20secret@") + "?key=1", headers={"X-Key": "2"})
        self.assertEqual(cache.path, self.url)
        sent = self.server.requests[0][3]
        self.assertEqual(sent["Authorization"], "Basic " + base64.b64encode(b"me:a secret").decode())
        self.assertEqual(sent["X-Key"], "2")
        self.fails("headers and folder are for caches on a server", curvisplat.open, str(self.root / "grid.splats"), headers={})

    def test_redirections(self):
        def fault(handler, name, _):
            if name.startswith("old/"):
                handler.send(302, {"Location": "/" + name[4:]})
            elif name.startswith("round/"):
                handler.send(307, {"Location": handler.path})
            elif name.startswith("away/"):
                handler.send(301, {"Location": "file:///etc/passwd"})
            else:
                return False
            return True

        self.server.fault = fault
        local = self.local().render(size=(40, 40))
        np.testing.assert_array_equal(curvisplat.open(self.server.url + "/old/grid.splats").render(size=(40, 40)), local)
        self.fails("redirects more than", curvisplat.open, self.server.url + "/round/grid.splats")
        self.fails("not secure, or not of HTTP", curvisplat.open, self.server.url + "/away/grid.splats")

    # Servers that fail.

    def test_nothing_there(self):
        self.fails("manifest.json: not found .404.; expected the address of a splat cache", curvisplat.open, self.server.url + "/none.splats")
        self.fails("Connection refused", curvisplat.open, "http://127.0.0.1:1/grid.splats")
        self.fails("its port is not a number", curvisplat.open, "http://127.0.0.1:port/grid.splats")

    def test_a_file_is_missing(self):
        self.server.fault = lambda handler, name, _: name.endswith("geometry.bin") and not handler.send(404)
        self.fails("geometry.bin: not found", curvisplat.open, self.url)

    def test_refuses(self):
        self.server.fault = lambda handler, *_: not handler.send(403)
        self.fails("refuses access .403.", curvisplat.open, self.url)

    def test_no_ranges(self):
        def fault(handler, name, _):
            handler.send(200, {}, (self.root / name).read_bytes())
            return True

        self.server.fault = fault
        self.fails("does not send parts of files", curvisplat.open, self.url)

    def test_compresses(self):
        self.server.fault = lambda handler, *_: not handler.send(206, {"Content-Encoding": "gzip", "Content-Range": "bytes 0-3/4"}, b"abcd")
        self.fails("sends it compressed", curvisplat.open, self.url)

    def test_passing_faults(self):
        for kind in ("503", "lost", "short"):
            seen = set()

            def fault(handler, name, begin):
                with self.server.lock:
                    first = (name, begin) not in seen
                    seen.add((name, begin))
                if not first:
                    return False
                if kind == "503":
                    handler.send(503)
                elif kind == "short":
                    handler.send(206, {"Content-Range": f"bytes {begin}-{begin + 9}/10"}, b"abc", length=10)
                else:
                    handler.close_connection = True
                return True

            self.server.fault = fault if kind != "short" else None
            cache = curvisplat.open(self.url)
            np.testing.assert_array_equal(cache.render(size=(40, 40)), self.local().render(size=(40, 40)))

    def test_connection_lost_for_good(self):
        def fault(handler, name, begin):
            whole = (self.root / name).read_bytes()
            end = min(begin + 64, len(whole))
            handler.send(206, {"Content-Range": handler_range(handler, len(whole)), "ETag": '"one"'}, whole[begin:end], length=1 << 16)
            return True

        self.fault = fault
        self.fails_to_draw("cannot be read, tried 4 times: ")
        self.assertLess(len(self.server.requests), 400)

    def test_fails_for_good(self):
        self.fault = lambda handler, *_: not handler.send(500)
        self.fails_to_draw("tried 4 times: the server answered 500")

    # Servers that lie.

    def test_changes_meanwhile(self):
        def fault(handler, name, begin):
            whole = (self.root / name).read_bytes()
            handler.send(206, {"Content-Range": handler_range(handler, len(whole)), "ETag": '"two"'}, part(handler, whole))
            return True

        self.fault = fault
        self.fails_to_draw("has changed on the server; open the cache again")

    def test_changes_its_size(self):
        def fault(handler, name, begin):
            whole = (self.root / name).read_bytes() + b"more"
            handler.send(206, {"Content-Range": handler_range(handler, len(whole)), "ETag": '"one"'}, part(handler, whole))
            return True

        self.fault = fault
        self.fails_to_draw("has changed on the server; open the cache again")

    def test_other_bytes_than_asked_for(self):
        self.fault = lambda handler, name, begin: not handler.send(206, {"Content-Range": "bytes 7-9/10", "ETag": '"one"'}, b"abc")
        self.fails_to_draw("the server sent bytes 7-9 of 10, expected")

    def test_too_many_bytes(self):
        def fault(handler, name, begin):
            whole = (self.root / name).read_bytes()
            handler.send(206, {"Content-Range": handler_range(handler, len(whole)), "ETag": '"one"'}, part(handler, whole) + b"more")
            return True

        self.fault = fault
        self.fails_to_draw("the server sent bytes")

    def test_nonsense(self):
        for headers in ({}, {"Content-Range": "bytes 0-/9"}, {"Content-Range": "bytes 9-0/10"}, {"Content-Range": "x" * 1000}):
            self.server.fault = lambda handler, *_: not handler.send(206, headers, b"abc")
            self.fails("the server (answered 206|sent bytes)", curvisplat.open, self.url)

    def test_a_huge_file(self):
        def fault(handler, name, begin):
            if name.endswith(".json"):
                return False
            handler.send(206, {"Content-Range": f"bytes 0-65535/{10**17}", "ETag": '"one"'}, bytes(65536))
            return True

        self.server.fault = fault
        self.fails("bricks.bin", curvisplat.open, self.url)

    def test_damaged_bytes(self):
        def fault(handler, name, begin):
            whole = (self.root / name).read_bytes()
            handler.send(206, {"Content-Range": handler_range(handler, len(whole)), "ETag": '"one"'}, bytes(b ^ 1 for b in part(handler, whole)))
            return True

        cache = curvisplat.open(self.url)
        self.server.fault = fault
        self.fails(re.escape(self.url) + "/.*(checksum|damaged)", cache.render, size=(300, 300))

    # Ctrl-C.

    def test_interrupt(self):
        let_go = threading.Event()

        def fault(handler, *_):
            os.kill(os.getpid(), signal.SIGINT)
            let_go.wait()
            return False

        cache = curvisplat.open(self.url)
        self.server.fault = fault
        try:
            with self.assertRaises(KeyboardInterrupt):
                cache.render(size=(200, 200), lod_pixels=0.5)
                let_go.wait()
        finally:
            self.server.fault = None
            let_go.set()
        np.testing.assert_array_equal(cache.render(size=(200, 200), lod_pixels=0.5), self.fine)


def range_of(handler):
    return tuple(map(int, re.fullmatch(r"bytes=(\d+)-(\d+)", handler.headers["Range"]).groups()))


def part(handler, whole):
    begin, end = range_of(handler)
    return whole[begin:end + 1]


def handler_range(handler, size):
    begin, end = range_of(handler)
    return f"bytes {begin}-{min(end + 1, size) - 1}/{size}"


if __name__ == "__main__":
    unittest.main(verbosity=1)
