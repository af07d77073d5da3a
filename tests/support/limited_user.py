"""Runs programs as a user who may have few processes and threads (ulimit -u)."""
import os
import pathlib
import resource
import tempfile
import unittest

USER = 0x5EED0000 | os.getpid() & 0xFFFF  # has no other process


def become_limited(processes):
    """In a child, before it runs a program: becomes USER, with so many processes and threads. The limit does not bind root."""
    resource.setrlimit(resource.RLIMIT_NPROC, (processes, processes))
    os.setgroups([])
    os.setgid(USER)
    os.setuid(USER)


class LimitedUserTest(unittest.TestCase):
    """Tests in a folder that USER may enter; skipped without the right to become another user."""

    @classmethod
    def setUpClass(cls):
        if os.geteuid() != 0:
            raise unittest.SkipTest("needs the right to become another user")
        cls.temporary = tempfile.TemporaryDirectory(prefix="curvisplat_threads_")
        cls.addClassCleanup(cls.temporary.cleanup)
        cls.folder = pathlib.Path(cls.temporary.name)
        cls.folder.chmod(0o755)
