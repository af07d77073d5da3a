#!/usr/bin/python3
"""odd_hosts_test.py CURVISPLAT

Hosts that are set up in another way: locales with a decimal comma and with another lower case of I, file systems without
O_DIRECT or O_TMPFILE, a clock that runs backwards. The same files are made everywhere, byte for byte. What the machine
lacks (localedef, the right to mount, a C compiler) is skipped and said.
"""
import ctypes
import hashlib
import json
import os
import pathlib
import shutil
import subprocess
import sys
import tempfile
import unittest

PROGRAM = str(pathlib.Path(sys.argv.pop(1)).resolve())

# CLOCK_REALTIME as of a machine whose clock is set back by a day again and again.
CLOCK = """
#define _GNU_SOURCE
#include <stdatomic.h>
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

    def test_locales(self):
        if not shutil.which("localedef"):
            self.skipTest("no localedef")
        locales = self.folder / "locales"
        locales.mkdir()
        made = 0
        for name in ("de_DE", "tr_TR", "fr_FR"):
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

    def in_namespace(self, folder, mount):
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
                    self.expect_same(folder)
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
        folder = self.folder / "clock"
        folder.mkdir()
        self.expect_same(folder, {"LD_PRELOAD": str(library)})


if __name__ == "__main__":
    unittest.main()
