"""A cache in a browser or a notebook: the server, as a process of its own."""

from __future__ import annotations

import errno
import html
import os
import pathlib
import shutil
import subprocess
import tempfile
import weakref
from typing import Any, Optional

from . import _arguments, _core


def program() -> str:
    """The path of the program `curvisplat` that belongs to this package: in it as a wheel has it, beside it in a build tree, or the one
    in PATH. Raises Error if there is none."""
    here = pathlib.Path(__file__).resolve()
    for beside in (here.parent / "curvisplat", here.parents[2] / "curvisplat"):
        if os.access(beside, os.X_OK) and beside.is_file():
            return str(beside)
    found = shutil.which("curvisplat")
    if found is None:
        raise _core.Error("the program curvisplat is neither beside the package nor in PATH; install it")
    return found


_default_program = program  # View's argument has its name


def _end(process: subprocess.Popen) -> None:
    if process.poll() is None:
        process.terminate()
        try:
            process.wait(10)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()
    if process.stdout:
        process.stdout.close()


class View:
    """A running server. A notebook shows its page; `url` opens it in a browser on this machine."""

    @_arguments.in_one_line
    def __init__(self, path: str, height: int = 600, program: Optional[str] = None):
        self.height = _arguments.whole("height", height, 1)
        own_program = _arguments.maybe("program", program, _arguments.path)
        command = [os.fsdecode(own_program or _default_program()), "serve", os.fsdecode(_arguments.path("path", path)), "--port", "0"]
        with tempfile.TemporaryFile("w+") as messages:  # of its start; nobody reads later ones
            try:
                # A session of its own: Ctrl-C in the interpreter is not meant for it.
                process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=messages, text=True, start_new_session=True)
            except OSError as error:
                advice = "; raise the limits of processes and threads (ulimit -u)" if error.errno == errno.EAGAIN else ""
                raise _core.Error(f"{command[0]}: cannot be run: {error.strerror}{advice}") from error
            assert process.stdout is not None
            self.url = process.stdout.readline().strip()
            if not self.url:
                _end(process)
                messages.seek(0)
                raise _core.Error(messages.read().strip().removeprefix("curvisplat: ") or f"{command[0]} has no server")
        self._process = process
        self._end = weakref.finalize(self, _end, process)

    def close(self) -> None:
        """Ends the server. Pages that show it say so."""
        self._end()

    @property
    def is_open(self) -> bool:
        """Whether the server runs."""
        return self._end.alive and self._process.poll() is None

    def __enter__(self) -> "View":
        return self

    def __exit__(self, *_: Any) -> None:
        self.close()

    def __repr__(self) -> str:
        return f"<curvisplat.View {self.url if self.is_open else 'closed'}>"

    def _repr_html_(self) -> str:
        """The page in a frame. The browser must be on this machine, or have a tunnel to the port."""
        if not self.is_open:
            return "<p>This view is closed; cache.view() opens another one.</p>"
        return (f'<iframe src="{html.escape(self.url)}" width="100%" height="{self.height}" style="border: 0" '
                'allow="fullscreen" title="curvisplat"></iframe>')
