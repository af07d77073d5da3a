"""Which of a file's pages lie in the page cache, and putting them out of it."""
import ctypes
import mmap
import os
import sys


def cached_part(path):
    """The part of a file's pages that lie in the page cache, as mincore says."""
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
    """Puts the files of a folder out of the page cache. -> The largest part of one that stays in it: 0, unless another
    program has it mapped or the file system lives in memory; what is measured then is not cold."""
    left = 0.0
    for entry in os.scandir(folder):
        descriptor = os.open(entry.path, os.O_RDONLY)
        try:
            os.fsync(descriptor)  # pages that are not yet written stay
            os.posix_fadvise(descriptor, 0, 0, os.POSIX_FADV_DONTNEED)
        finally:
            os.close(descriptor)
        left = max(left, cached_part(entry.path))
    return left
