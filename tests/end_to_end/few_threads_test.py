#!/usr/bin/python3
"""few_threads_test.py CURVISPLAT

Each command as a user who may have few processes and threads (ulimit -u): it works, or ends with one line and status 1, and
leaves nothing. The limit does not bind root, so that the test needs the right to become another user.
"""
import contextlib
import importlib.util
import os
import pathlib
import shutil
import signal
import socket
import subprocess
import sys
import unittest

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent.parent / "support"))
from sweep import some_of  # noqa: E402
from limited_user import USER, LimitedUserTest, become_limited  # noqa: E402

PROGRAM = str(pathlib.Path(sys.argv.pop(1)).resolve())
MOST_SECONDS = 120  # until the program counts as stuck


class FewThreads(LimitedUserTest):
    @classmethod
    def setUpClass(cls):
        if "CURVISPLAT_SANITIZED" in os.environ:
            raise unittest.SkipTest("the leak sanitizer starts a process of its own")
        super().setUpClass()
        (cls.folder / "work").mkdir()
        os.chown(cls.folder / "work", USER, USER)
        for words in (["generate", "o-grid", "--size", "20x15x10", "-o", "o"], ["convert", "o.xyz", "o.fun", "-o", "o.splats"]):
            subprocess.run([PROGRAM, *words], cwd=cls.folder, capture_output=True, check=True)

    def limited(self, words, processes):
        """The program with so many processes and threads; stopped once it has printed, if it does not end by itself."""
        work = self.folder / "work"
        environment = {"PATH": os.environ["PATH"], "HOME": str(work), "TMPDIR": str(work)}
        try:
            program = subprocess.Popen([PROGRAM, *words], cwd=work, env=environment, stdout=subprocess.PIPE, stderr=subprocess.PIPE,
                                       text=True, preexec_fn=lambda: become_limited(processes))
        except (PermissionError, subprocess.SubprocessError) as error:
            self.skipTest(f"another user cannot run the program here: {error}")
        self.addCleanup(program.kill)
        if words[0] == "serve":
            if program.stdout.readline():
                program.send_signal(signal.SIGTERM)
        message = program.communicate(timeout=MOST_SECONDS)[1]
        return program.returncode, message

    def test_every_command_works_or_ends_with_one_line(self):
        commands = (["info", "../o.splats"], ["info", "../o.xyz", "../o.fun"], ["convert", "../o.xyz", "../o.fun", "-o", "a.splats"],
                    ["render", "../o.splats", "-o", "a.png", "--size", "64x48"],
                    ["render", "../o.xyz", "../o.fun", "-o", "a.png", "--size", "64x48"], ["export", "../o.splats", "-o", "a.ply"],
                    ["serve", "../o.splats", "--port", "0"])
        for n, command in enumerate(commands):
            succeeded = False
            for processes in (*some_of(range(23), 5, turn=n), 23):
                with self.subTest(" ".join(command), processes=processes):
                    status, message = self.limited(command, processes)
                    made = sorted(path.name for path in (self.folder / "work").iterdir() if path.name != ".cache")
                    for name in made:
                        path = self.folder / "work" / name
                        shutil.rmtree(path) if path.is_dir() else path.unlink()
                    shutil.rmtree(self.folder / "work" / ".cache", ignore_errors=True)
                    succeeded = status in (0, 128 + signal.SIGTERM)
                    if not succeeded:
                        self.assertEqual(status, 1, message)
                        self.assertEqual(message.count("\n"), 1, message)
                        self.assertIn("thread", message)
                        self.assertEqual(made, [])
                if succeeded:
                    break
            # On machines of many cores more threads are needed.
            self.assertTrue(succeeded or os.cpu_count() > 8, command)

    def test_a_viewer_too_many_for_the_threads_is_refused_and_the_others_go_on(self):
        sys.path.append(str(pathlib.Path(__file__).resolve().parent.parent / "serve"))
        if importlib.util.find_spec("websocket") is None:
            self.skipTest("python3-websocket is not installed")
        from serving import Viewer, serving, websocket

        class RefusedError(Exception):
            pass

        class OneTry:
            def socket(self):
                line = server.socket()
                if line.sock.recv(1, socket.MSG_PEEK)[0] & 15 == websocket.ABNF.OPCODE_CLOSE:
                    with contextlib.closing(line.sock):
                        raise RefusedError(line.sock.recv(200)[4:].decode())
                return line

        def draws(viewer):
            viewer.open()
            viewer.view()
            return viewer.picture()

        def limit(threads):
            # As the server's user: others need a further right.
            change = f"import resource; resource.prlimit({server.process.pid}, resource.RLIMIT_NPROC, ({threads}, {many}))"
            subprocess.run([sys.executable, "-c", change], check=True, cwd=self.folder, preexec_fn=lambda: become_limited(many))

        many, places = 4096, 6
        with contextlib.ExitStack() as stack:
            try:
                server = stack.enter_context(
                    serving(PROGRAM, ["o.splats"], "--viewer-memory", "64M", "--memory", f"{places * 64}M", "--backend", "cpu", cwd=self.folder,
                            env={"HOME": str(self.folder / "work")}, preexec_fn=lambda: become_limited(many)))
            except (PermissionError, subprocess.SubprocessError) as error:
                self.skipTest(f"another user cannot run the program here: {error}")
            viewers = [Viewer(OneTry()) for _ in range(2)]
            limit(server.threads())
            for _ in range(places):
                with self.assertRaisesRegex(RefusedError, "no threads"):
                    Viewer(OneTry())
            self.assertIn("a viewer is refused: cannot start", server.messages())
            self.assertRegex(draws(viewers[0]), "cannot start .* threads")
            limit(many)
            viewers += [Viewer(OneTry()) for _ in range(places - len(viewers))]  # none is counted that was refused
            for viewer in viewers:
                self.assertIsInstance(draws(viewer), bytes)
                viewer.socket.close()
            self.assertEqual(server.stop(), 130)

    def test_the_window_ends_with_one_line_before_it_opens(self):
        most = 3 + os.cpu_count()
        for processes in (*some_of(range(most), 3), most):
            with self.subTest(processes=processes):
                status, message = self.limited(["view", "../o.splats"], processes)
                self.assertEqual(status, 1, message)
                self.assertEqual(message.count("\n"), 1, message)
                self.assertIn("thread", message)


if __name__ == "__main__":
    unittest.main()
