"""Imported before _core: its libraries start threads as it is loaded, and end the interpreter where that fails (ulimit -u, ulimit -v)."""

import os
import threading
import time

import numpy  # noqa: F401  Some of its builds start threads, too; those are counted by now.

_OF_LIBRARIES = 4  # log4cplus, which OpenVDB needs
_MOST_SECONDS = 0.2


def _running() -> int:
    """The threads of this process as the system counts them; 0 without /proc."""
    try:
        return len(os.listdir("/proc/self/task"))
    except OSError:
        return 0


def _require(count: int) -> None:
    """Raises ImportError if this process cannot have `count` threads more."""
    before = _running()
    end = threading.Event()
    threads = [threading.Thread(target=end.wait, daemon=True) for _ in range(count)]
    started = []
    try:
        for thread in threads:
            thread.start()
            started.append(thread)
    except (RuntimeError, MemoryError):
        raise ImportError(f"curvisplat: cannot start {count} threads; "
                          "raise the limits of processes and memory (ulimit -u, ulimit -v)") from None
    finally:
        end.set()
        for thread in started:
            thread.join()
        # join() returns a little before the system has counted a thread out.
        until = time.monotonic() + _MOST_SECONDS
        while _running() > before and time.monotonic() < until:
            time.sleep(0)


_require(_OF_LIBRARIES)
