#!/usr/bin/python3
"""odd_hosts_test.py CURVISPLAT

Hosts that are set up in another way: locales with a decimal comma and with another lower case of I, file systems without
O_DIRECT or O_TMPFILE, a clock that runs backwards, and a stand-in for a network file system: calls that behave like one's.
The same files are made everywhere, byte for byte. What the machine lacks (localedef, the right to mount, a C compiler) is
skipped and said.
"""
import contextlib
import ctypes
import hashlib
import json
import os
import pathlib
import shutil
import subprocess
import sys
import tempfile
import time
import unittest

from sweep import some_of

PROGRAM = str(pathlib.Path(sys.argv.pop(1)).resolve())

# CLOCK_REALTIME as of a machine whose clock is set back by a day again and again.
CLOCK = r"""
#define _GNU_SOURCE
#include <stdatomic.h>
#include <stdio.h>
#include <stdlib.h>
#include <sys/syscall.h>
#include <sys/time.h>
#include <time.h>
#include <unistd.h>
static atomic_long calls;
int clock_gettime(clockid_t clock, struct timespec* to) {
  const int status = (int)syscall(SYS_clock_gettime, clock, to);
  if (clock == CLOCK_REALTIME) to->tv_sec -= 86400 * ++calls;
  return status;
}
time_t time(time_t* to) {
  struct timespec now;
  clock_gettime(CLOCK_REALTIME, &now);
  if (to) *to = now.tv_sec;
  return now.tv_sec;
}
int gettimeofday(struct timeval* to, void* zone) {
  struct timespec now;
  (void)zone;
  clock_gettime(CLOCK_REALTIME, &now);
  to->tv_sec = now.tv_sec;
  to->tv_usec = now.tv_nsec / 1000;
  return 0;
}

__attribute__((destructor)) static void report(void) {
  const char* name = getenv("CLOCK_REPORT");
  FILE* to = name ? fopen(name, "a") : NULL;
  if (!to) return;
  fprintf(to, "%ld\n", (long)calls);
  fclose(to);
}
"""

# The calls of a network file system, as libraries see them: reads and writes of half of what is asked for, no O_DIRECT, no
# O_TMPFILE, no fallocate, no io_uring, with NO_FLOCK no flock; stat() by name answers from a cache of attributes until the file is opened.
# The file SEEN_MARK is made when the size of SEEN_FILE is remembered. With ESTALE_AT=n the n-th read or write of a regular file below ESTALE_FOLDER, and all that follow of that descriptor, fail.
NETWORK = r"""
#define _GNU_SOURCE
#include <dlfcn.h>
#include <errno.h>
#include <fcntl.h>
#include <limits.h>
#include <pthread.h>
#include <stdarg.h>
#include <stdatomic.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <sys/uio.h>
#include <unistd.h>

#define NEXT(name) ((__typeof__(&name))dlsym(RTLD_NEXT, #name))

static pthread_mutex_t mutex = PTHREAD_MUTEX_INITIALIZER;
static struct { char path[512]; struct stat status; } cached[256];
static int places = 0;
static atomic_int stale[4096];
static atomic_long transfers, refused, cut, late;

static void forget(const char* path) {
  pthread_mutex_lock(&mutex);
  for (int n = 0; n < places; ++n)
    if (strcmp(cached[n].path, path) == 0) cached[n].path[0] = 0;
  pthread_mutex_unlock(&mutex);
}

static int refuses(int flags) {
  if ((flags & O_TMPFILE) == O_TMPFILE) errno = EOPNOTSUPP;
  else if (flags & O_DIRECT) errno = EINVAL;
  else return 0;
  ++refused;
  return 1;
}

#define OPEN(name)                                             \
  int name(const char* path, int flags, ...) {                 \
    va_list more;                                              \
    va_start(more, flags);                                     \
    mode_t mode = va_arg(more, mode_t);                        \
    va_end(more);                                              \
    if (refuses(flags)) return -1;                             \
    forget(path);                                              \
    int fd = NEXT(name)(path, flags, mode);                    \
    if (fd >= 0 && fd < 4096) stale[fd] = 0;                   \
    return fd;                                                 \
  }
OPEN(open)
OPEN(open64)

static int answer(const char* path, struct stat* to, int (*ask)(const char*, struct stat*)) {
  pthread_mutex_lock(&mutex);
  for (int n = 0; n < places; ++n)
    if (strcmp(cached[n].path, path) == 0) {
      struct stat now;
      if (ask(path, &now) == 0 && now.st_ino == cached[n].status.st_ino) {
        if (now.st_size != cached[n].status.st_size) ++late;
        *to = cached[n].status;
        pthread_mutex_unlock(&mutex);
        return 0;
      }
      cached[n].path[0] = 0;
    }
  int result = ask(path, to), error = errno;
  if (result == 0 && S_ISREG(to->st_mode) && strlen(path) < sizeof cached[0].path && places < 256) {
    strcpy(cached[places].path, path);
    cached[places++].status = *to;
    const char* file = getenv("SEEN_FILE");
    if (file && strcmp(path, file) == 0) close(NEXT(open)(getenv("SEEN_MARK"), O_CREAT | O_WRONLY, 0600));
  }
  pthread_mutex_unlock(&mutex);
  errno = error;
  return result;
}
int stat(const char* path, struct stat* to) { return answer(path, to, NEXT(stat)); }
int stat64(const char* path, struct stat64* to) { return answer(path, (struct stat*)to, NEXT(stat)); }

static int isStale(int fd) {
  static long at = -1;
  if (at < 0) at = getenv("ESTALE_AT") ? atol(getenv("ESTALE_AT")) : 0;
  if (fd < 0 || fd >= 4096) return 0;
  if (!stale[fd] && at > 0) {
    struct stat status;
    char name[64], path[PATH_MAX];
    snprintf(name, sizeof name, "/proc/self/fd/%d", fd);
    ssize_t length = readlink(name, path, sizeof path - 1);
    const char* folder = getenv("ESTALE_FOLDER");
    if (length <= 0 || strncmp(path, folder, strlen(folder)) != 0 || fstat(fd, &status) != 0 || !S_ISREG(status.st_mode))
      return 0;
    if (++transfers == at) stale[fd] = 1;
  }
  if (stale[fd]) errno = ESTALE;
  return stale[fd];
}
static size_t half(size_t bytes) {
  if (bytes > 1) ++cut;
  return bytes - bytes / 2;
}

ssize_t read(int fd, void* to, size_t bytes) { return isStale(fd) ? -1 : NEXT(read)(fd, to, half(bytes)); }
ssize_t pread(int fd, void* to, size_t bytes, off_t at) { return isStale(fd) ? -1 : NEXT(pread)(fd, to, half(bytes), at); }
ssize_t pread64(int fd, void* to, size_t bytes, off64_t at) { return isStale(fd) ? -1 : NEXT(pread64)(fd, to, half(bytes), at); }
ssize_t write(int fd, const void* from, size_t bytes) {
  return isStale(fd) ? -1 : NEXT(write)(fd, from, fd > 2 ? half(bytes) : bytes);
}
ssize_t pwrite(int fd, const void* from, size_t bytes, off_t at) { return isStale(fd) ? -1 : NEXT(pwrite)(fd, from, half(bytes), at); }
ssize_t pwrite64(int fd, const void* from, size_t bytes, off64_t at) {
  return isStale(fd) ? -1 : NEXT(pwrite64)(fd, from, half(bytes), at);
}
int flock(int fd, int what) {
  if (!getenv("NO_FLOCK")) return NEXT(flock)(fd, what);
  errno = ENOLCK;
  return -1;
}
int fallocate(int fd, int mode, off_t at, off_t bytes) { (void)fd, (void)mode, (void)at, (void)bytes; errno = EOPNOTSUPP; return -1; }
int fallocate64(int fd, int mode, off64_t at, off64_t bytes) { (void)fd, (void)mode, (void)at, (void)bytes; errno = EOPNOTSUPP; return -1; }
int io_uring_queue_init(unsigned entries, void* ring, unsigned flags) { (void)entries, (void)ring, (void)flags; return -ENOSYS; }
int io_uring_queue_init_params(unsigned entries, void* ring, void* how) { (void)entries, (void)ring, (void)how; return -ENOSYS; }

__attribute__((destructor)) static void report(void) {
  const char* name = getenv("NETWORK_REPORT");
  FILE* to = name ? fopen(name, "a") : NULL;
  if (!to) return;
  fprintf(to, "%ld %ld %ld\n", (long)cut, (long)refused, (long)late);
  fclose(to);
}
"""

# A file system whose inodes differ in their upper 32 bits alone, as large ones (XFS with inode64) and unions of them have them.
INODES = r"""
#define _GNU_SOURCE
#include <dlfcn.h>
#include <fcntl.h>
#include <sys/stat.h>

#define NEXT(name) ((__typeof__(&name))dlsym(RTLD_NEXT, #name))
static int far(int result, ino_t* inode) {
  if (result == 0) *inode = (*inode << 32) | 7;
  return result;
}
int stat(const char* path, struct stat* to) { return far(NEXT(stat)(path, to), &to->st_ino); }
int lstat(const char* path, struct stat* to) { return far(NEXT(lstat)(path, to), &to->st_ino); }
int fstat(int fd, struct stat* to) { return far(NEXT(fstat)(fd, to), &to->st_ino); }
int fstatat(int fd, const char* path, struct stat* to, int flags) { return far(NEXT(fstatat)(fd, path, to, flags), &to->st_ino); }
int stat64(const char* path, struct stat64* to) { return far(NEXT(stat64)(path, to), &to->st_ino); }
int lstat64(const char* path, struct stat64* to) { return far(NEXT(lstat64)(path, to), &to->st_ino); }
int fstat64(int fd, struct stat64* to) { return far(NEXT(fstat64)(fd, to), &to->st_ino); }
int fstatat64(int fd, const char* path, struct stat64* to, int flags) { return far(NEXT(fstatat64)(fd, path, to, flags), &to->st_ino); }
int statx(int fd, const char* path, int flags, unsigned mask, struct statx* to) {
  int result = NEXT(statx)(fd, path, flags, mask, to);
  if (result == 0) to->stx_ino = (to->stx_ino << 32) | 7;
  return result;
}
"""

# Of open files in a folder: what fstat() finds is not known at one call, or from one on.
UNKNOWN = r"""
#define _GNU_SOURCE
#include <dlfcn.h>
#include <errno.h>
#include <limits.h>
#include <stdatomic.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#define NEXT(name) ((__typeof__(&name))dlsym(RTLD_NEXT, #name))
static atomic_long calls;

static int refuses(int fd) {
  char name[64], path[PATH_MAX];
  snprintf(name, sizeof name, "/proc/self/fd/%d", fd);
  ssize_t length = readlink(name, path, sizeof path - 1);
  const char* folder = getenv("UNKNOWN_FOLDER");
  if (length <= 0 || strncmp(path, folder, strlen(folder)) != 0) return 0;
  long call = ++calls, from = atol(getenv("UNKNOWN_FROM")), to = atol(getenv("UNKNOWN_TO"));
  errno = ESTALE;
  return call >= from && call <= to;
}
int fstat(int fd, struct stat* to) { return refuses(fd) ? -1 : NEXT(fstat)(fd, to); }
int fstat64(int fd, struct stat64* to) { return refuses(fd) ? -1 : NEXT(fstat64)(fd, to); }
"""


def opens(folder, flags):
    try:
        os.close(os.open(folder, flags, 0o600))
        return True
    except OSError:
        return False


class OddHosts(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.temporary = tempfile.TemporaryDirectory(prefix="curvisplat_hosts_")
        cls.folder = pathlib.Path(cls.temporary.name)
        (cls.folder / "plain").mkdir()
        cls.expected = cls.work(cls.folder / "plain")

    @classmethod
    def tearDownClass(cls):
        cls.temporary.cleanup()

    @staticmethod
    def work(folder, environment=None):
        """What a user does, in a folder: name -> hash of all files that it makes, and what is printed."""
        commands = ["generate o-grid --size 12x10x8 -o o", "convert o.xyz o.fun -o o.splats --stats convert.json",
                    "convert o.xyz --add-scalar i --to o.splats",
                    "render o.splats -o a.png --size 64x48 --range 0.25,1.5 --parallel-scale 2.5 --stats render.json",
                    "render o.splats -o b.pfm --size 32x32 --view +z --opacity-unit 0.125",
                    "info o.splats --verify --json", "info o.xyz o.fun", "render I.splats -o c.png"]
        script = f"cd '{folder}'\n" + "".join(f"'{PROGRAM}' {c} || echo status $?\n" for c in commands)
        result = subprocess.run(["sh", "-c", script + "sha256sum o.* o.splats/* a.png b.pfm 2>&1\ncat render.json\n"],
                                capture_output=True, text=True, env={**os.environ, **(environment or {})}, check=False)
        text = result.stdout + result.stderr
        if "status 1" not in text or text.count("status ") != 1:
            raise AssertionError(text)
        lines = text.splitlines()
        json.loads(text[text.rindex("\n{"):text.rindex("\n}") + 2])
        hashes = {line.split()[1]: line.split()[0] for line in lines if len(line.split(" ")[0]) == 64}
        assert "o.splats/manifest.json" in hashes, text
        said = [line for line in lines if line.startswith(("curvisplat: ", "scalar", "nodes"))]
        return hashes, said

    def expect_same(self, folder, environment=None):
        hashes, said = self.work(folder, environment)
        self.assertEqual(hashes, self.expected[0])
        self.assertEqual(said, self.expected[1])

    def test_starts_without_the_libraries_of_its_plug_ins(self):
        linked = subprocess.run(["ldd", PROGRAM], capture_output=True, text=True, check=True).stdout
        for library in ("hdf5", "netcdf", "cgns", "proj", "openvdb", "mpi", "curl"):
            self.assertNotIn(f"lib{library}", linked)

    def test_locales(self):
        if not shutil.which("localedef"):
            self.skipTest("no localedef")
        locales = self.folder / "locales"
        locales.mkdir()
        made = 0
        for name in some_of(("tr_TR", "de_DE", "fr_FR"), 3):  # a comma before decimals, and in Turkish other capitals
            subprocess.run(["localedef", "-i", name, "-f", "UTF-8", "--no-archive", locales / f"{name}.UTF-8"],
                           capture_output=True, check=False)
            if not (locales / f"{name}.UTF-8" / "LC_NUMERIC").exists():
                continue
            made += 1
            folder = self.folder / name
            folder.mkdir()
            environment = {"LOCPATH": str(locales), "LC_ALL": f"{name}.UTF-8", "LANG": f"{name}.UTF-8"}
            comma = subprocess.run(["printf", "%.1f", "0"], capture_output=True, text=True, env={**os.environ, **environment},
                                   check=False)
            self.assertEqual(comma.stdout, "0,0", "the locale is not in use")
            with self.subTest(name):
                self.expect_same(folder, environment)
        if made == 0:
            self.skipTest("no locale can be made")

    def test_file_systems(self):
        tried = []
        for kind in ("ramfs", "tmpfs", "overlay"):
            folder = self.folder / kind
            folder.mkdir()
            mount = f"mount -t {kind} none '{folder}'"
            if kind == "overlay":
                base = self.folder / "base"
                base.mkdir()
                mount = (f"mount -t tmpfs none '{base}' && mkdir '{base}/lower' '{base}/upper' '{base}/work' && mount -t overlay "
                         f"-o 'lowerdir={base}/lower,upperdir={base}/upper,workdir={base}/work' none '{folder}'")
            with self.subTest(kind):
                if self.in_namespace(folder, mount):
                    tried.append(kind)
        if not tried:
            self.skipTest("no file system can be mounted here")

    def test_a_full_disk_for_the_shaders_of_mesa(self):
        def draw(folder):
            os.sync()
            with open(folder / "full", "wb", buffering=0) as file:
                with contextlib.suppress(OSError):
                    while True:
                        file.write(bytes(65536))
            for backend in ("osmesa", "egl-quads"):
                done = subprocess.run([PROGRAM, "render", self.folder / "plain" / "o.splats", "-o", self.folder / "full.png", "--size", "40x40",
                                       "--backend", backend], env={**os.environ, "XDG_CACHE_HOME": str(folder)},
                                      capture_output=True, text=True, check=False)
                if done.returncode != 1 or "libEGL" not in done.stderr:
                    self.assertEqual((done.returncode, done.stderr), (0, ""), backend)

        folder = self.folder / "mesa"
        folder.mkdir()
        if not self.in_namespace(folder, f"mount -t tmpfs -o size=512k none '{folder}'", draw):
            self.skipTest("no file system can be mounted here")

    def in_namespace(self, folder, mount, check=None):
        """Whether it can be mounted. In a child, so that this process stays in its namespace."""
        new_namespace, not_mounted = 0x00020000, 77
        pid = os.fork()
        if pid == 0:
            status = 1
            try:
                shell = "mount --make-rprivate / && " + mount
                if ctypes.CDLL(None).unshare(new_namespace) != 0 or subprocess.run(
                        ["sh", "-c", shell], stderr=subprocess.DEVNULL, check=False).returncode != 0:
                    status = not_mounted
                else:
                    has = [name for name, flags in (("O_DIRECT", os.O_DIRECT | os.O_CREAT | os.O_RDWR),
                                                    ("O_TMPFILE", os.O_TMPFILE | os.O_RDWR))
                           if opens(folder if name == "O_TMPFILE" else folder / "probe", flags)]
                    print(f"{folder.name}: has {', '.join(has) or 'neither O_DIRECT nor O_TMPFILE'}", flush=True)
                    (check or self.expect_same)(folder)
                    status = 0
            except BaseException as error:  # the child must not go on
                print(error, file=sys.stderr, flush=True)
            os._exit(status)
        status = os.waitstatus_to_exitcode(os.waitpid(pid, 0)[1])
        self.assertIn(status, (0, not_mounted))
        return status == 0

    def test_a_clock_that_is_set_back(self):
        compiler = shutil.which("cc") or shutil.which("gcc")
        if not compiler:
            self.skipTest("no C compiler")
        source, library = self.folder / "clock.c", self.folder / "clock.so"
        source.write_text(CLOCK)
        subprocess.run([compiler, "-shared", "-fPIC", "-O1", "-o", library, source], check=True)
        folder, report = self.folder / "clock", self.folder / "clock.txt"
        folder.mkdir()
        self.expect_same(folder, {"LD_PRELOAD": str(library), "CLOCK_REPORT": str(report)})
        calls = sum(map(int, report.read_text().split()))
        print(f"clock: {calls} calls got an earlier time")
        self.assertGreater(calls, 0, "the library is not in use")

    def test_inodes_beyond_32_bits(self):
        compiler = shutil.which("cc") or shutil.which("gcc")
        if not compiler:
            self.skipTest("no C compiler")
        source, library = self.folder / "inodes.c", self.folder / "inodes.so"
        source.write_text(INODES)
        subprocess.run([compiler, "-shared", "-fPIC", "-O1", "-o", library, source, "-ldl"], check=True)
        environment = {"LD_PRELOAD": str(library)}
        seen = subprocess.run(["stat", "-c", "%i", source, library], capture_output=True, text=True, env={**os.environ, **environment}, check=True)
        numbers = [int(number) for number in seen.stdout.split()]
        self.assertEqual([number & 0xffffffff for number in numbers], [7, 7], "the library is not in use")
        self.assertNotEqual(*numbers)
        folder = self.folder / "inodes"
        folder.mkdir()
        self.expect_same(folder, environment)
        # A file in the place of another, of the same size and time: what is kept for the first is not taken for it.
        run = lambda *words: subprocess.run([PROGRAM, *words], cwd=folder, capture_output=True, text=True, check=True,
                                            env={**os.environ, **environment, "XDG_CACHE_HOME": str(folder / "kept")})
        draw = lambda to: (run("render", "same.vtk", "-o", to, "--size", "48x32", "--range", "0,30"), (folder / to).read_bytes())[1]
        pictures = []
        for name, value in (("a", "1"), ("b", "9")):
            values = " ".join(str((n % 10) * int(value) % 30) for n in range(1000))
            (folder / name).write_text("# vtk DataFile Version 3.0\na\nASCII\nDATASET STRUCTURED_POINTS\nDIMENSIONS 10 10 10\nORIGIN 0 0 0\n"
                                       f"SPACING 1 1 1\nPOINT_DATA 1000\nSCALARS p float 1\nLOOKUP_TABLE default\n{values:<4000}\n")
            os.utime(folder / name, (1e9, 1e9))
        self.assertEqual((folder / "a").stat().st_size, (folder / "b").stat().st_size)
        for name in ("a", "b"):
            (folder / name).rename(folder / "same.vtk")
            pictures.append(draw(f"{name}.png"))
        self.assertNotEqual(*pictures)

    def network(self):
        compiler = shutil.which("cc") or shutil.which("gcc")
        if not compiler:
            self.skipTest("no C compiler")
        library = self.folder / "network.so"
        if not library.exists():
            source = self.folder / "network.c"
            source.write_text(NETWORK)
            subprocess.run([compiler, "-shared", "-fPIC", "-O1", "-o", library, source, "-ldl"], check=True)
        return {"LD_PRELOAD": str(library)}

    def test_calls_of_a_network_file_system(self):
        environment = self.network()
        folder, report = self.folder / "network", self.folder / "network.txt"
        folder.mkdir()
        self.expect_same(folder, {**environment, "NETWORK_REPORT": str(report)})
        cut, refused, _ = self.counted(report)
        print(f"network: {cut} short transfers, {refused} opens refused")
        self.assertGreater(cut, 100)
        self.assertGreater(refused, 0)

    @staticmethod
    def counted(report):
        """Short transfers, refused opens, and sizes by name that were late, of all processes."""
        return [sum(int(line.split()[n]) for line in report.read_text().splitlines()) for n in range(3)]

    def test_sizes_that_are_late(self):
        """Of a file that a simulation goes on writing after `convert --follow` has looked at it by name. No other command
        looks at a file by name that grows and stays closed."""
        folder, report, seen = self.folder / "late", self.folder / "late.txt", self.folder / "late.seen"
        folder.mkdir()
        run = lambda *words: subprocess.run([PROGRAM, *words], cwd=folder, capture_output=True, check=True)
        run("generate", "wake", "--size", "12x10x8", "--steps", "2", "-o", "w")
        files = [str(folder / name) for name in ("w.xyz", "w_*.fun")]
        run("convert", *files, "-o", "whole.splats")
        growing = folder / "w_0001.fun"
        content = growing.read_bytes()
        for path in folder.glob("w*.*"):
            if path.is_file():
                os.utime(path, (1e9, 1e9))
        growing.write_bytes(content[:len(content) // 2])
        environment = {**os.environ, **self.network(), "NETWORK_REPORT": str(report), "SEEN_FILE": str(growing), "SEEN_MARK": str(seen)}
        with subprocess.Popen([PROGRAM, "convert", *files, "-o", "followed.splats", "--follow", "--until", "2"], cwd=folder,
                              stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, env=environment) as following:
            while not seen.exists() and following.poll() is None:
                time.sleep(0.01)
            with open(growing, "ab") as file:
                file.write(content[len(content) // 2:])
            said = following.communicate(timeout=60)[0]
        self.assertEqual(following.returncode, 0, said)
        late = self.counted(report)[2]
        print(f"network: {late} late sizes")
        self.assertGreater(late, 0)
        caches = [{path.name: path.read_bytes() for path in (folder / name).iterdir()} for name in ("whole.splats", "followed.splats")]
        self.assertEqual(*caches)

    def test_without_flock_a_conversion_is_refused_and_leaves_nothing(self):
        folder = self.folder / "unlocked"
        folder.mkdir()
        run = lambda *words: subprocess.run([PROGRAM, *words], cwd=folder, capture_output=True, text=True, check=False,
                                            env={**os.environ, **self.network(), "NO_FLOCK": "1"})
        self.assertEqual(run("generate", "o-grid", "--size", "12x10x8", "-o", "o").returncode, 0)
        before = sorted(folder.iterdir())
        result = run("convert", "o.xyz", "o.fun", "-o", "o.splats")
        self.assertEqual(result.returncode, 1)
        self.assertIn("No locks available; choose an output on a file system that supports flock", result.stderr)
        self.assertEqual(result.stderr.count("\n"), 1, result.stderr)
        self.assertEqual(sorted(folder.iterdir()), before)

    def failed_with_one_line(self, result, folder, before):
        """Whether it failed; then with status 1 and one line, and nothing is left. Removes what it has made in `folder`."""
        made = [path for path in folder.iterdir() if path not in before]
        if result.returncode == 0:
            self.assertLessEqual({path.name for path in made}, {"new.splats", "new.png"})
        else:
            self.assertEqual(result.returncode, 1, result.stderr)
            lines = [line for line in result.stderr.splitlines() if not line.startswith("curvisplat: note")]
            self.assertEqual(len(lines), 1, result.stderr)
            self.assertEqual(made, [], result.stderr)
        for path in made:
            shutil.rmtree(path) if path.is_dir() else path.unlink()
        return result.returncode != 0

    def test_a_stale_handle_is_one_line_and_leaves_nothing(self):
        """The server has forgotten a file, at one of its reads or writes."""
        environment = self.network()
        folder = self.folder / "stale"
        folder.mkdir()
        run = lambda *words, at=0: subprocess.run([PROGRAM, *words], cwd=folder, capture_output=True, text=True, check=False, env={
            **os.environ, **environment, "ESTALE_FOLDER": str(folder), **({"ESTALE_AT": str(at)} if at else {})})
        self.assertEqual(run("generate", "o-grid", "--size", "12x10x8", "-o", "o").returncode, 0)
        self.assertEqual(run("convert", "o.xyz", "o.fun", "-o", "whole.splats").returncode, 0)
        jobs = {"convert": ["convert", "o.xyz", "o.fun", "-o", "new.splats", "--threads", "1"],
                "render": ["render", "whole.splats", "-o", "new.png", "--size", "48x32", "--threads", "1"],
                "info": ["info", "whole.splats", "--verify"]}
        for name, words in jobs.items():
            failures = 0
            before = sorted(folder.iterdir())
            for at in some_of((*range(1, 30), 35, 40, 50, 60, 80, 100, 130, 160, 200, 250, 300, 400), 5, first=6):
                with self.subTest(name, at=at):
                    failures += self.failed_with_one_line(run(*words, at=at), folder, before)
            print(f"ESTALE: {name}: {failures} ended with one line", flush=True)
            self.assertGreater(failures, 0, name)

    def test_a_file_that_cannot_be_examined_is_one_line_and_leaves_nothing(self):
        """fstat() fails once, or from one call on, and everything else goes on."""
        compiler = shutil.which("cc") or shutil.which("gcc")
        if not compiler:
            self.skipTest("no C compiler")
        source, library, folder = self.folder / "unknown.c", self.folder / "unknown.so", self.folder / "unknown"
        source.write_text(UNKNOWN)
        subprocess.run([compiler, "-shared", "-fPIC", "-O1", "-o", library, source, "-ldl"], check=True)
        folder.mkdir()
        environment = {**os.environ, "LD_PRELOAD": str(library), "UNKNOWN_FOLDER": str(folder)}
        run = lambda *words, at=(0, 0): subprocess.run(
            [PROGRAM, *words], cwd=folder, capture_output=True, text=True, check=False, timeout=60,
            env={**environment, "UNKNOWN_FROM": str(at[0]), "UNKNOWN_TO": str(at[1])})
        self.assertEqual(run("generate", "o-grid", "--size", "12x10x8", "-o", "o").returncode, 0)
        self.assertEqual(run("convert", "o.xyz", "o.fun", "-o", "whole.splats").returncode, 0)
        jobs = {"convert": ["convert", "o.xyz", "o.fun", "-o", "new.splats", "--threads", "1"],
                "render": ["render", "whole.splats", "-o", "new.png", "--size", "48x32", "--threads", "1"]}
        for name, words in jobs.items():
            failures, before = 0, sorted(folder.iterdir())
            for at in some_of(range(1, 60), 9, first=6):
                for end in some_of((at, 1 << 40), 2, turn=at):
                    with self.subTest(name, at=at, end=end):
                        failures += self.failed_with_one_line(run(*words, at=(at, end)), folder, before)
            print(f"fstat: {name}: {failures} ended with one line", flush=True)
            self.assertGreater(failures, 0, name)


if __name__ == "__main__":
    unittest.main()
