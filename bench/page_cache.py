"""Tells how much of a file is in the page cache, and evicts it."""
import ctypes
import mmap
import os
import sys


def cached_part(path):
    """The fraction of a file's pages that are in the page cache, by mincore."""
    size = os.path.getsize(path)
    if size == 0:
        return 0.0
    with open(path, "rb") as file, mmap.mmap(file.fileno(), size, access=mmap.ACCESS_COPY) as view:
        pages = (size + mmap.PAGESIZE - 1) // mmap.PAGESIZE
        resident = (ctypes.c_ubyte * pages)()
        anchor = ctypes.c_char.from_buffer(view)
        libc = ctypes.CDLL(None, use_errno=True)
        failed = libc.mincore(ctypes.c_void_p(ctypes.addressof(anchor)), ctypes.c_size_t(size), resident)
        del anchor
        if failed:
            sys.exit(f"mincore of {path}: {os.strerror(ctypes.get_errno())}")
        return sum(page & 1 for page in bytes(resident)) / pages


def forget(folder):
    """Evicts the files of a folder from the page cache. Returns the largest fraction of one that stays: 0, unless another
    program has it mapped or the file system is in memory; a measurement is not cold then."""
    left = 0.0
    for entry in os.scandir(folder):
        descriptor = os.open(entry.path, os.O_RDONLY)
        try:
            os.fsync(descriptor)  # dirty pages would stay
            os.posix_fadvise(descriptor, 0, 0, os.POSIX_FADV_DONTNEED)
        finally:
            os.close(descriptor)
        left = max(left, cached_part(entry.path))
    return left
