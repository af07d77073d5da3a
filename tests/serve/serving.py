"""A server for tests, and Chromium to look at it: what the tests of `curvisplat serve` share."""
import base64
import contextlib
import json
import pathlib
import shutil
import signal
import struct
import subprocess
import sys
import tempfile
import time
import urllib.request

try:
    import websocket  # python3-websocket
except ImportError:
    print("skipped: python3-websocket is not installed")
    sys.exit(77)

PATIENCE_S = 60


def wait_for(condition, what, patience_s=PATIENCE_S):
    """Asks until the answer is true, and returns it."""
    end = time.monotonic() + patience_s
    while True:
        answer = condition()
        if answer:
            return answer
        if time.monotonic() > end:
            raise AssertionError(f"waited {patience_s} s for {what}")
        time.sleep(0.02)


class Server:
    """`curvisplat serve` of some caches, at a port of its own. `process`: as subprocess.Popen takes it."""

    def __init__(self, program, caches, *options, port=0, **process):
        self.command = [str(program), "serve", *map(str, caches), "--port", str(port), *options]
        self.log = tempfile.TemporaryFile("w+")
        self.process = subprocess.Popen(self.command, stdout=subprocess.PIPE, stderr=self.log, text=True, **process)
        self.url = self.process.stdout.readline().strip()
        if not self.url.startswith("http://"):
            raise AssertionError(f"the server did not start: {self.messages()}")
        host, _, query = self.url.removeprefix("http://").partition("/?token=")
        self.host, self.token = host, query
        self.name, _, port = host.rpartition(":")
        self.port = int(port)

    def messages(self):
        self.log.seek(0)
        return self.log.read()

    def kilobytes(self, field="VmRSS"):
        for line in pathlib.Path(f"/proc/{self.process.pid}/status").read_text().splitlines():
            if line.startswith(field + ":"):
                return int(line.split()[1])
        raise AssertionError(field)

    def threads(self):
        return len(list(pathlib.Path(f"/proc/{self.process.pid}/task").iterdir()))

    def is_alive(self):
        return self.process.poll() is None

    def kill(self):
        self.process.kill()
        self.process.wait()

    def stop(self):
        """Ends it as Ctrl-C does, and returns the exit status."""
        self.process.send_signal(signal.SIGINT)
        return self.process.wait(PATIENCE_S)

    def socket(self, token=None, origin=None, host=None, path="/socket", timeout=PATIENCE_S):
        token = self.token if token is None else token
        return websocket.create_connection(
            f"ws://{self.host}{path}?token={token}", origin=origin or f"http://{host or self.host}", host=host or self.host,
            timeout=timeout)


@contextlib.contextmanager
def serving(program, caches, *options, **more):
    server = Server(program, caches, *options, **more)
    try:
        yield server
    finally:
        if server.is_alive():
            server.kill()
        server.process.stdout.close()
        server.log.close()


class Viewer:
    """A page without a browser. Waits for a place: viewers that have gone keep theirs until their pictures have been stopped."""

    def __init__(self, server, size=(64, 48)):
        self.size = list(size)
        self.number = 0
        wait_for(lambda: self.gets_in(server), "a place among the viewers")

    def gets_in(self, server):
        self.socket = server.socket()
        try:
            self.hello = self.text("hello")
            return True
        except (ValueError, websocket.WebSocketException):  # it was told to try again later
            self.socket.close()
            return False

    def send(self, **message):
        self.socket.send(json.dumps(message))

    def receive(self):
        data = self.socket.recv()
        return json.loads(data) if isinstance(data, str) else data

    def text(self, kind):
        while True:
            message = self.receive()
            if isinstance(message, dict) and message["type"] == kind:
                return message

    def open(self, cache=0):
        self.cache = cache
        self.send(type="open", cache=cache, size=self.size)
        self.facts = self.text("cache")
        return self.facts

    def view(self, state=None, moving=False, **more):
        self.number += 1
        self.send(**{"type": "view", "number": self.number, "cache": self.cache, "size": self.size, "moving": moving, "step": 0,
                     "state": state or self.facts["state"], **more})

    def picture(self):
        """Waits for a picture that is final, or an error's text."""
        while True:
            message = self.receive()
            if isinstance(message, dict):
                if message["type"] == "error":
                    return message["text"]
                continue
            number, = struct.unpack_from("<I", message, 4)
            self.send(type="shown", picture=number)
            request, = struct.unpack_from("<d", message, 8)
            if request == self.number and message[25]:
                return message


class Tab:
    """A page in Chromium, driven through the DevTools protocol."""

    def __init__(self, address):
        self.socket = websocket.create_connection(address, timeout=PATIENCE_S, suppress_origin=True)
        self.count = 0

    def call(self, method, **parameters):
        self.count += 1
        self.socket.send(json.dumps({"id": self.count, "method": method, "params": parameters}))
        while True:
            answer = json.loads(self.socket.recv())
            if answer.get("id") != self.count:
                continue
            if "error" in answer:
                raise AssertionError(f"{method}: {answer['error']}")
            return answer["result"]

    def run(self, script):
        """The value of an expression of the page's script; promises are waited for."""
        answer = self.call("Runtime.evaluate", expression=script, returnByValue=True, awaitPromise=True)
        if "exceptionDetails" in answer:
            raise AssertionError(f"{script}: {answer['exceptionDetails']}")
        return answer["result"].get("value")

    def wait(self, script, what=None, patience_s=PATIENCE_S):
        return wait_for(lambda: self.run(script), what or script, patience_s)

    def resize(self, width, height, ratio=1, mobile=False):
        self.call("Emulation.setDeviceMetricsOverride", width=width, height=height, deviceScaleFactor=ratio, mobile=mobile)

    def mouse(self, kind, x, y, button="left", **more):
        self.call("Input.dispatchMouseEvent", type=kind, x=x, y=y, button=button, clickCount=1, **more)

    def drag(self, start, end, steps=10, button="left", modifiers=0, pause_s=0.0):
        buttons = {"left": 1, "right": 2, "middle": 4}[button]
        self.mouse("mousePressed", *start, button=button, buttons=buttons, modifiers=modifiers)
        for n in range(1, steps + 1):
            x, y = (a + (b - a) * n / steps for a, b in zip(start, end))
            self.mouse("mouseMoved", x, y, button=button, buttons=buttons, modifiers=modifiers)
            time.sleep(pause_s)
        self.mouse("mouseReleased", *end, button=button, modifiers=modifiers)

    def touch(self, kind, *points):
        self.call("Input.dispatchTouchEvent", type=kind, touchPoints=[{"x": x, "y": y, "id": n} for n, (x, y) in enumerate(points)])

    def key(self, key):
        for kind in ("keyDown", "keyUp"):
            self.call("Input.dispatchKeyEvent", type=kind, key=key, text=key if kind == "keyDown" else "")

    def place(self, selector):
        """The middle of an element."""
        return self.run(f"(() => {{ const e = document.querySelector({json.dumps(selector)}); e.scrollIntoView({{block: 'nearest'}});"
                        "const r = e.getBoundingClientRect(); return [r.x + r.width / 2, r.y + r.height / 2]; })()")

    def click(self, selector):
        x, y = self.place(selector)
        self.mouse("mousePressed", x, y, buttons=1)
        self.mouse("mouseReleased", x, y)

    def screenshot(self, path):
        pathlib.Path(path).write_bytes(base64.b64decode(self.call("Page.captureScreenshot")["data"]))


class Chromium:
    """`options`: of the command line; without any it has no WebGL."""

    def __init__(self, *options):
        program = shutil.which("chromium") or shutil.which("chromium-browser")
        if not program:
            print("skipped: chromium is not installed")
            sys.exit(77)
        self.folder = tempfile.TemporaryDirectory(ignore_cleanup_errors=True)
        self.process = subprocess.Popen(
            [program, "--headless=new", "--no-sandbox", *(options or ("--disable-gpu",)), "--no-first-run", "--disable-dev-shm-usage",
             "--disable-background-networking", "--disable-backgrounding-occluded-windows", "--disable-renderer-backgrounding", "--disable-component-update", "--hide-scrollbars",
             "--remote-debugging-port=0", f"--user-data-dir={self.folder.name}", "about:blank"],
            stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        file = pathlib.Path(self.folder.name, "DevToolsActivePort")
        wait_for(lambda: file.is_file() and "\n" in file.read_text(), "Chromium to start")
        self.port = int(file.read_text().split()[0])

    def tab(self, url="about:blank", size=(1280, 800), ratio=1):
        with urllib.request.urlopen(f"http://127.0.0.1:{self.port}/json/version", timeout=PATIENCE_S) as answer:
            browser = Tab(json.load(answer)["webSocketDebuggerUrl"])
        target = browser.call("Target.createTarget", url="about:blank", newWindow=True)["targetId"]
        browser.socket.close()
        tab = Tab(f"ws://127.0.0.1:{self.port}/devtools/page/{target}")
        tab.call("Page.enable")
        tab.resize(*size, ratio)
        tab.call("Page.navigate", url=url)
        return tab

    def close(self):
        self.process.terminate()
        self.process.wait(PATIENCE_S)
        self.folder.cleanup()
