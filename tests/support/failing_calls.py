"""A library to be loaded before a program (LD_PRELOAD) that lets one of its calls fail which write below a folder."""
import ctypes
import os
import pathlib
import shutil
import subprocess

# Counts calls that write, sync, rename, make or open for writing what is below a folder, from 1 on; the one at `at`, or all from
# there on, fail. A full disk (ENOSPC) opens what is there already. Syncing does nothing, to save time. A process is told by
# faults_begin(), or by its environment: FAULTS_FOLDER, FAULTS_AT, FAULTS_ON (1: from there on), FAULTS_ERROR; it appends to FAULTS_REPORT how many failed.
SOURCE = r"""
#define _GNU_SOURCE
#include <dlfcn.h>
#include <errno.h>
#include <fcntl.h>
#include <limits.h>
#include <stdarg.h>
#include <stdatomic.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <sys/uio.h>
#include <unistd.h>

#define NEXT(name) ((__typeof__(&name))dlsym(RTLD_NEXT, #name))

static char folder[PATH_MAX];
static atomic_long calls, failed;
static long from, to;
static int error_of_calls;

void faults_begin(const char* below, long at, int on, int error) {
  strncpy(folder, below, sizeof folder - 1);
  calls = failed = 0;
  from = at;
  to = on ? LONG_MAX : at;
  error_of_calls = error;
}
long faults_end(void) {
  folder[0] = 0;
  return failed;
}

__attribute__((constructor)) static void begin(void) {
  if (getenv("FAULTS_FOLDER"))
    faults_begin(getenv("FAULTS_FOLDER"), atol(getenv("FAULTS_AT")), atoi(getenv("FAULTS_ON")), atoi(getenv("FAULTS_ERROR")));
}
__attribute__((destructor)) static void report(void) {
  const char* name = getenv("FAULTS_REPORT");
  folder[0] = 0;
  FILE* file = name ? fopen(name, "a") : NULL;
  if (!file) return;
  fprintf(file, "%ld\n", (long)failed);
  fclose(file);
}

static int isBelow(const char* path) {
  char whole[2 * PATH_MAX];
  if (path[0] != '/' && getcwd(whole, PATH_MAX)) {
    strcat(whole, "/");
    strncat(whole, path, PATH_MAX - 1);
    path = whole;
  }
  const size_t length = strlen(folder);
  return length > 0 && strncmp(path, folder, length) == 0 && (path[length] == '/' || path[length] == 0);
}
static int isOpenBelow(int fd) {
  char name[64], path[PATH_MAX];
  if (!folder[0]) return 0;
  snprintf(name, sizeof name, "/proc/self/fd/%d", fd);
  const ssize_t length = readlink(name, path, sizeof path - 1);
  if (length <= 0) return 0;
  path[length] = 0;
  return isBelow(path);
}
static int fails(void) {
  const long call = ++calls;
  if (call < from || call > to) return 0;
  ++failed;
  errno = error_of_calls;
  return 1;
}

static int needsRoom(const char* path) { return error_of_calls != ENOSPC || access(path, F_OK) != 0; }

#define IF_GOOD(fd, call) (isOpenBelow(fd) && fails() ? -1 : (call))
ssize_t write(int fd, const void* bytes, size_t count) { return IF_GOOD(fd, NEXT(write)(fd, bytes, count)); }
ssize_t writev(int fd, const struct iovec* parts, int count) { return IF_GOOD(fd, NEXT(writev)(fd, parts, count)); }
ssize_t pwrite(int fd, const void* bytes, size_t count, off_t at) { return IF_GOOD(fd, NEXT(pwrite)(fd, bytes, count, at)); }
ssize_t pwrite64(int fd, const void* bytes, size_t count, off64_t at) { return IF_GOOD(fd, NEXT(pwrite64)(fd, bytes, count, at)); }
int fsync(int fd) { return isOpenBelow(fd) ? fails() ? -1 : 0 : NEXT(fsync)(fd); }
int fdatasync(int fd) { return isOpenBelow(fd) ? fails() ? -1 : 0 : NEXT(fdatasync)(fd); }

#define IF_ALLOWED(path, call) (isBelow(path) && fails() ? -1 : (call))
int rename(const char* old, const char* new) { return IF_ALLOWED(new, NEXT(rename)(old, new)); }
int renameat2(int a, const char* old, int b, const char* new, unsigned flags) {
  return IF_ALLOWED(new, NEXT(renameat2)(a, old, b, new, flags));
}
int mkdir(const char* path, mode_t mode) { return IF_ALLOWED(path, NEXT(mkdir)(path, mode)); }

#define OPEN(name)                                                                      \
  int name(const char* path, int flags, ...) {                                          \
    va_list more;                                                                       \
    va_start(more, flags);                                                              \
    const mode_t mode = flags & O_CREAT ? va_arg(more, mode_t) : 0;                     \
    va_end(more);                                                                       \
    if ((flags & O_ACCMODE) != O_RDONLY && isBelow(path) && needsRoom(path) && fails()) \
      return -1;                                                                        \
    return NEXT(name)(path, flags, mode);                                               \
  }
OPEN(open)
OPEN(open64)

#define FOPEN(name)                                                                     \
  FILE* name(const char* path, const char* mode) {                                      \
    if (mode[0] != 'r' && isBelow(path) && needsRoom(path) && fails()) return NULL;     \
    return NEXT(name)(path, mode);                                                      \
  }
FOPEN(fopen)
FOPEN(fopen64)
"""


def built(folder):
    """The library, compiled into a folder; None without a C compiler."""
    compiler = shutil.which("cc") or shutil.which("gcc")
    if not compiler:
        return None
    source, library = pathlib.Path(folder, "failing_calls.c"), pathlib.Path(folder, "failing_calls.so")
    source.write_text(SOURCE)
    subprocess.run([compiler, "-shared", "-fPIC", "-O1", "-o", library, source, "-ldl"], check=True)
    return library


def places(stride=5):
    """Which calls to let fail, without an end: the first six and then some; all with CURVISPLAT_WHOLE (support/fault_sweep.h)."""
    place = 1
    while True:
        yield place
        place += 1 if place <= 6 or "CURVISPLAT_WHOLE" in os.environ else stride


class FailingCalls:
    """In a process that the library was loaded into: `with FailingCalls(folder, at, on, error) as failing:`, then failing.count."""

    def __init__(self, folder, at, on, error):
        self.arguments = os.fsencode(folder), at, on, error
        self.count = 0

    def __enter__(self):
        self.library = ctypes.CDLL(None)
        self.library.faults_begin.argtypes = ctypes.c_char_p, ctypes.c_long, ctypes.c_int, ctypes.c_int
        self.library.faults_end.restype = ctypes.c_long
        self.library.faults_begin(*self.arguments)
        return self

    def __exit__(self, *_):
        self.count = self.library.faults_end()
