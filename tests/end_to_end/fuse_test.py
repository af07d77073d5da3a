#!/usr/bin/python3
"""fuse_test.py CURVISPLAT

A file system in user space (FUSE, by Debian's python3-fusepy) that behaves like a slow network's: transfers that come in halves,
sizes that are remembered for a second and late, no O_TMPFILE, no O_DIRECT, and ESTALE from the server. What convert, --add-scalar,
render and info make there has the bytes that they make elsewhere; ESTALE is one line and leaves no cache. Skipped (77) without
/dev/fuse, fusepy or the right to mount, and unless CURVISPLAT_WHOLE is set: odd_hosts_test.py has a stand-in.
"""
import ctypes
import errno
import hashlib
import os
import pathlib
import signal
import subprocess
import sys
import tempfile
import time
import unittest

try:
    import fusepy
except ImportError:
    fusepy = None
from sweep import IS_WHOLE, ONLY_WHOLE

PROGRAM = str(pathlib.Path(sys.argv[1] if len(sys.argv) > 1 else "build/release/tools/curvisplat").resolve())


def serve(root, mounted, control):
    """The file system; `control` has the number of the transfer that fails, or 0."""

    class Server(fusepy.Operations):
        def __init__(self):
            self.transfers = 0
            self.at = 0

        def __call__(self, op, path, *args):
            return super().__call__(op, root + path, *args)

        def fails(self):
            at = int(pathlib.Path(control).read_text() or 0)
            if at != self.at:
                self.at, self.transfers = at, 0
            self.transfers += 1
            if self.at and self.transfers >= self.at:
                raise fusepy.FuseOSError(errno.ESTALE)

        def access(self, path, mode):
            if not os.access(path, mode):
                raise fusepy.FuseOSError(errno.EACCES)

        def getattr(self, path, fh=None):
            status = os.lstat(path)
            return {key: getattr(status, key) for key in ("st_atime", "st_ctime", "st_gid", "st_mode", "st_mtime", "st_nlink",
                                                          "st_size", "st_uid", "st_ino")}

        def open(self, path, flags):
            if flags & os.O_DIRECT:
                raise fusepy.FuseOSError(errno.EINVAL)
            return os.open(path, flags)

        def create(self, path, mode, fi=None):
            return os.open(path, os.O_RDWR | os.O_CREAT | os.O_TRUNC, mode)

        def read(self, path, size, offset, fh):
            self.fails()
            # With direct_io a short read is not the end of the file. Linux 6.18 then gives io_uring wrong bytes of the right length.
            return os.pread(fh, max(1, size - size // 2), offset)

        def write(self, path, data, offset, fh):
            self.fails()
            return os.pwrite(fh, data[: max(1, len(data) - len(data) // 2)], offset)

        def truncate(self, path, length, fh=None):
            os.truncate(path, length)

        def fsync(self, path, datasync, fh):
            return os.fsync(fh)

        def fsyncdir(self, path, datasync, fh):
            return 0

        def flush(self, path, fh):
            return 0

        def release(self, path, fh):
            return os.close(fh)

        def readdir(self, path, fh):
            return [".", "..", *os.listdir(path)]

        def rename(self, old, new):
            return os.rename(old, root + new)

        def link(self, target, source):
            return os.link(root + source, target)

        def statfs(self, path):
            status = os.statvfs(path)
            return {key: getattr(status, key) for key in ("f_bavail", "f_bfree", "f_blocks", "f_bsize", "f_favail", "f_ffree",
                                                          "f_files", "f_flag", "f_frsize", "f_namemax")}

        chmod, mkdir, rmdir, unlink = (staticmethod(call) for call in (os.chmod, os.mkdir, os.rmdir, os.unlink))

        def utimens(self, path, times=None):
            return os.utime(path, times)

    fusepy.FUSE(Server(), mounted, foreground=True, nothreads=True, direct_io=True, attr_timeout=1, entry_timeout=1)


class Fuse(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.temporary = tempfile.TemporaryDirectory(prefix="curvisplat_fuse_")
        cls.folder = pathlib.Path(cls.temporary.name)
        for name in ("plain", "server", "mounted"):
            (cls.folder / name).mkdir()
        cls.control = cls.folder / "control"
        cls.control.write_text("0")
        cls.server = subprocess.Popen([sys.executable, __file__, "--serve", cls.folder / "server", cls.folder / "mounted", cls.control],
                                      stderr=subprocess.PIPE, text=True)
        end = time.monotonic() + 10
        while not os.path.ismount(cls.folder / "mounted"):
            if cls.server.poll() is not None or time.monotonic() > end:
                why = cls.server.communicate()[1] if cls.server.poll() is not None else "not mounted within 10 s"
                print(f"skipped: FUSE cannot be mounted here: {why.strip()[-200:]}", flush=True)
                cls.temporary.cleanup()
                os._exit(77)
            time.sleep(0.02)

    @classmethod
    def tearDownClass(cls):
        ctypes.CDLL(None).umount2(str(cls.folder / "mounted").encode(), 2)  # MNT_DETACH
        cls.server.send_signal(signal.SIGTERM)
        cls.server.wait(10)
        cls.temporary.cleanup()

    @staticmethod
    def run_in(folder, *words):
        return subprocess.run([PROGRAM, *words], cwd=folder, capture_output=True, text=True, check=False, timeout=300)

    def work(self, folder):
        for words in ("generate o-grid --size 12x10x8 -o o", "convert o.xyz o.fun -o o.splats", "convert o.xyz --add-scalar i --to o.splats",
                      "render o.splats -o a.png --size 64x48 --range 0.25,1.5", "info o.splats --verify"):
            result = self.run_in(folder, *words.split())
            self.assertEqual(result.returncode, 0, f"{words}: {result.stderr}")
        return {str(path.relative_to(folder)): hashlib.sha256(path.read_bytes()).hexdigest()
                for path in sorted(folder.rglob("*")) if path.is_file()}

    def test_1_makes_the_same_bytes(self):
        self.assertEqual(self.work(self.folder / "mounted"), self.work(self.folder / "plain"))

    def test_2_a_stale_handle_is_one_line(self):
        mounted = self.folder / "mounted"
        failures = 0
        for at in (1, 2, 3, 5, 8, 13, 21, 34, 55, 89, 144):
            for words in ("convert o.xyz o.fun -o new.splats", "render o.splats -o new.png --size 48x32"):
                with self.subTest(words, at=at):
                    self.control.write_text(str(at))
                    result = self.run_in(mounted, *words.split())
                    self.control.write_text("0")
                    self.assertIn(result.returncode, (0, 1), result.stderr)
                    if result.returncode == 1:
                        failures += 1
                        lines = [line for line in result.stderr.splitlines() if not line.startswith("curvisplat: note")]
                        self.assertEqual(len(lines), 1, result.stderr)
                        self.assertFalse((mounted / "new.splats").exists())
                        self.assertFalse((mounted / "new.png").exists())
                    # What is left is in nobody's way.
                    for name in ("new.splats", "new.png"):
                        subprocess.run(["rm", "-rf", mounted / name], check=True)
        self.assertEqual(self.run_in(mounted, *"convert o.xyz o.fun -o new.splats".split()).returncode, 0)
        print(f"{failures} ended with one line")
        self.assertGreater(failures, 5)


if __name__ == "__main__":
    if len(sys.argv) > 1 and sys.argv[1] == "--serve":
        serve(*map(str, sys.argv[2:5]))
    elif not IS_WHOLE:
        print(f"skipped: {ONLY_WHOLE}")
        sys.exit(77)
    elif not fusepy or not os.path.exists("/dev/fuse"):
        print("skipped: no /dev/fuse, or no fusepy (Debian: python3-fusepy)")
        sys.exit(77)
    else:
        sys.argv.pop(1)
        unittest.main()
