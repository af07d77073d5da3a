"""Imported before _core: its libraries start threads as it is loaded, and end the interpreter where that fails (ulimit -u, ulimit -v)."""

import ctypes
import os
import time

import numpy  # noqa: F401  Some of its builds start threads, too; those are counted by now.

_OF_LIBRARIES = 4  # log4cplus, which OpenVDB needs
_MOST_SECONDS = 0.2
_SEMAPHORE_BYTES = 64  # 32 on Linux


def _running() -> int:
    """The threads of this process as the system counts them; 0 without /proc."""
    try:
        return len(os.listdir("/proc/self/task"))
    except OSError:
        return 0


def _require(count: int) -> None:
    """Raises ImportError if this process cannot have `count` threads more.

    They are not Python's: each of those would keep 64 MiB of address space (malloc's arenas), of which ulimit -v may leave little.
    """
    libc = ctypes.CDLL(None)
    before = _running()
    semaphore = ctypes.create_string_buffer(_SEMAPHORE_BYTES)
    libc.sem_init(semaphore, 0, 0)
    threads = []
    for _ in range(count):
        thread = ctypes.c_void_p()
        if libc.pthread_create(ctypes.byref(thread), None, libc.sem_wait, semaphore) != 0:
            break
        threads.append(thread)
    for _ in threads:
        libc.sem_post(semaphore)
    for thread in threads:
        libc.pthread_join(thread, None)
    # pthread_join() returns a little before the system has counted a thread out.
    until = time.monotonic() + _MOST_SECONDS
    while _running() > before and time.monotonic() < until:
        time.sleep(0)
    if len(threads) < count:
        raise ImportError(f"curvisplat: cannot start {count} threads; "
                          "raise the limits of processes and memory (ulimit -u, ulimit -v)")


_require(_OF_LIBRARIES)
