#!/usr/bin/python3
"""hostile_test.py

What hostile scripts do to the Python package: arrays that are not what they seem, functions that raise or answer nonsense, names
that files cannot have, Ctrl-C at any moment, processes that fork, and interpreters that end while threads draw and convert. Each
attempt is a process of its own: no signal, no hang, an exception of one line, and no file left. The package is found by
PYTHONPATH.
"""

import os
import subprocess
import sys
import tempfile
import textwrap
import unittest

PREAMBLE = """
import os, shutil, signal, sys, threading, time, warnings
import numpy as np, curvisplat
from curvisplat import Block
warnings.simplefilter("ignore")  # of empty pictures

def grid(n=8, kind=np.float32):
    k, j, i = np.meshgrid(*3 * [np.linspace(0, 1, n, dtype=kind)], indexing="ij")
    return i.copy(), j.copy(), k.copy(), (i + j).astype(np.float32)

def convert(*arrays, scalars=None, blank=None, **options):
    x, y, z, s = arrays or grid()
    scalars = {"s": s} if scalars is None else scalars
    return curvisplat.convert_arrays("o.splats", Block(x, y, z, scalars, blank=blank), overwrite=True, **options)

def reader(n=32):
    x, y, z, s = grid(n)
    def read(block, k0, k1, j0, j1, names):
        part = np.s_[k0:k1, j0:j1]
        return x[part], y[part], z[part], [s[part]] * len(names), None
    return read

def call(read, shapes=((32, 32, 32),), names=("s",), **options):
    return curvisplat.convert_callable("o.splats", shapes, read, names, overwrite=True, **options)

def expect(kind, saying, attempt):
    try:
        attempt()
    except kind as error:
        line = str(error)
        assert saying in line and "\\n" not in line, line
    else:
        raise AssertionError("no " + saying)
"""


class HostileTest(unittest.TestCase):
    def attempt(self, code):
        with tempfile.TemporaryDirectory() as folder:
            run = subprocess.run([sys.executable, "-c", PREAMBLE + textwrap.dedent(code)], cwd=folder, capture_output=True, text=True,
                                 errors="replace", timeout=120)
            self.assertEqual(run.returncode, 0, run.stderr)
            self.assertEqual(run.stderr, "")
            self.assertEqual([name for name in os.listdir(folder) if not name.endswith(".splats")], [])

    def test_arrays_of_any_layout(self):
        self.attempt("""
            x, y, z, s = grid()
            packed = np.zeros(x.shape, [("mark", "u1"), ("x", "f8"), ("y", "f4"), ("z", "f8"), ("s", "f4")])
            for name, array in (("x", x), ("y", y), ("z", z), ("s", s)):
                packed[name] = array
            expected = convert()
            assert convert(*(packed[name] for name in "xyzs")) == expected._replace(bytes=convert(*(packed[name] for name in "xyzs")).bytes)
            like = np.dtype("f4", metadata={"a": 1})
            assert convert(x.astype(like), y, z, s) == expected
            turned = np.s_[::-1, ::-1, ::-1]
            assert convert(x[turned], y[turned], z[turned], s[turned]).splats == expected.splats
            class Strange(np.ndarray):
                pass
            assert convert(x.view(Strange), y, z, s) == expected
            """)

    def test_arrays_of_other_types_and_shapes(self):
        self.attempt("""
            x, y, z, s = grid()
            for kind in (">f4", "f2", "c8", object, str, int):
                expect(curvisplat.UsageError, "expected float32 or float64", lambda: convert(x, y, z, s.astype(kind)))
            for arrays in ((x[0], y[0], z[0], s[0]), (x[None], y[None], z[None], s[None])):
                expect(curvisplat.UsageError, "expected three, (k, j, i)", lambda: convert(*arrays))
            for shape in ((0, 5, 5), (5, 0, 5), (5, 5, 0)):
                expect(curvisplat.UsageError, "expected at least one node", lambda: convert(*4 * [np.zeros(shape, "f4")]))
            expect(curvisplat.Error, "nothing to draw", lambda: convert(x * np.nan, y, z, s))
            expect(curvisplat.Error, "units long", lambda: convert(x.astype("f8") * 1e300, y, z, s))
            """)

    def test_every_byte_of_a_bool_but_0_is_true(self):
        self.attempt("""
            marks = np.zeros((8, 8, 8), "u1")
            marks[0], marks[1], marks[2] = 1, 2, 254
            assert convert(blank=marks.view(bool)).blanked == 3 * 64
            curvisplat.open("o.splats").render("s", size=(8, 8))
            def read(*box):
                answer = reader()(*box)
                return answer[:4] + (np.full(answer[0].shape, 255, "u1").view(bool),)
            expect(curvisplat.Error, "all 32768 samples are blanked", lambda: call(read))
            for blank in (np.full, lambda shape, value: np.full(shape, 2.5)):
                expect(curvisplat.UsageError, "blank: its values are", lambda: call(lambda *box: reader()(*box)[:4] + (blank((32, 32, 32), 1),)))
            """)

    def test_names_and_numbers(self):
        self.attempt("""
            x, y, z, s = grid()
            for name in (3, None, "a\\udc80"):
                expect(curvisplat.UsageError, "scalars: ", lambda: convert(scalars={name: s}))
                expect(curvisplat.UsageError, "scalars: ", lambda: call(reader(), names=[name]))
            expect(curvisplat.UsageError, "name: ", lambda: curvisplat.convert_arrays("o.splats", Block(x, y, z, {"s": s}, name=5)))
            expect(curvisplat.UsageError, "title: ", lambda: convert(title="\\udc80"))
            expect(curvisplat.UsageError, "null character", lambda: curvisplat.convert_arrays("o\\0", Block(x, y, z, {"s": s})))
            expect(curvisplat.UsageError, "null character", lambda: curvisplat.open(b"o\\0"))
            for time_of_step in (float("nan"), float("inf")):
                expect(curvisplat.UsageError, "expected a finite number", lambda: convert(time=time_of_step))
            expect(curvisplat.UsageError, "progress: int is not callable", lambda: convert(progress=5))
            for shape in ((4, 2), (4.5, 2, 2), (-1, 2, 2), (0, 2, 2), (2**64, 2, 2), "abc", 5):
                expect(curvisplat.UsageError, "three whole numbers above zero", lambda: call(reader(), [shape]))
            for shape in ((2**40,) * 3, (2**32, 2**32, 1), (2**62, 2, 2)):
                expect(curvisplat.UsageError, "too many nodes", lambda: call(reader(), [shape]))
            convert(scalars={"\\x1b[2J\\0": s}, title="\\x1b[2J")
            curvisplat.open("o.splats").render(size=(8, 8))
            """)

    def test_pictures_of_any_size(self):
        self.attempt("""
            convert()
            p = curvisplat.open("o.splats").render(size=(32, 24))
            for array in (p[:0], p[:, :0], np.tile(p, (3000, 1, 1))):
                for ending in ("png", "exr", "pfm"):
                    expect(curvisplat.UsageError, "expected 1 to 65536 on each side", lambda: array.save("a." + ending))
                assert array._repr_png_() is None
            for array in (p[..., 0], p[0, 0], p[..., :3]):
                expect(curvisplat.UsageError, "a picture is an array of shape", lambda: array.save("a.png"))
            assert not os.path.exists("a.png")
            """)

    def test_arguments_of_other_types(self):
        self.attempt("""
            convert()
            cache = curvisplat.open("o.splats")
            for attempt in (lambda: cache.sample(5), lambda: cache.points(None, level=2), lambda: cache.histogram(5),
                            lambda: cache.render(5, size=(8, 8)), lambda: cache.sample(step=2**31)):
                expect(curvisplat.UsageError, "", attempt)
            """)

    def test_paths_that_are_too_long(self):
        self.attempt("""
            x, y, z, s = grid()
            convert()
            p = curvisplat.open("o.splats").render(size=(32, 24))
            long = "x" * 5000
            for attempt in (lambda: curvisplat.open(long), lambda: curvisplat.convert_arrays(long, Block(x, y, z, {"s": s})),
                            lambda: curvisplat.convert("o.splats", long), lambda: curvisplat.convert(long, "a.splats"),
                            lambda: curvisplat.append_arrays(long, Block(x, y, z, {"s": s})), lambda: p.save(long + ".png"),
                            lambda: curvisplat.convert_callable(long, ((4, 4, 4),), reader(), ("s",)),
                            lambda: curvisplat.open("o.splats").render(colours=long), lambda: curvisplat.append("o.splats", long)):
                expect(curvisplat.Error, "", attempt)
            """)

    def test_paths_that_are_no_text(self):
        self.attempt("""
            x, y, z, s = grid()
            name = b"o\\xff.splats"
            curvisplat.convert_arrays(name, Block(x, y, z, {"s": s}))
            cache = curvisplat.open(name)
            assert os.fsencode(cache.path) == name, cache.path
            expect(curvisplat.Error, "o\\\\xff.splats: the cache has no scalar 'none'", lambda: cache.render("none"))
            expect(curvisplat.Error, "none\\\\xff: does not exist", lambda: curvisplat.open(b"none\\xff"))
            shutil.rmtree(name)
            """)

    def test_functions_that_answer_nonsense(self):
        self.attempt("""
            read = reader()
            expect(curvisplat.Error, "read() returned NoneType", lambda: call(lambda *box: None))
            expect(curvisplat.Error, "read() returned 3 items", lambda: call(lambda *box: (1, 2, 3)))
            expect(curvisplat.Error, "read(): values: NoneType", lambda: call(lambda *box: read(*box)[:3] + (None, None)))
            expect(curvisplat.UsageError, "read(): x", lambda: call(lambda *box: ([], [], [], [], [])))
            expect(ZeroDivisionError, "division", lambda: call(lambda *box: 1 / 0))
            expect(SystemExit, "7", lambda: call(lambda *box: sys.exit(7)))
            def recursive(*box):
                return recursive(*box)
            expect(RecursionError, "recursion", lambda: call(recursive))
            nothing = lambda *box: tuple(a * np.nan for a in read(*box)[:3]) + read(*box)[3:]
            expect(curvisplat.Error, "nothing to draw", lambda: call(nothing))
            def again(*box):
                return call(read) and read(*box)
            expect(curvisplat.Error, "another conversion to this output", lambda: call(again, refine=1))
            assert not os.listdir(), os.listdir()
            """)

    def test_data_that_changes_meanwhile(self):
        """Other pictures, but no crash: the cache opens, or the error is of one line."""
        self.attempt("""
            x, y, z, s = grid(32, np.float64)
            end = []
            def change():
                while not end:
                    x[:] = 1e300; s[:] = np.nan; y[::2] = np.nan; x[:] = np.random.random(x.shape); y[:] = x[::-1]; s[::2] = 1e30
            thread = threading.Thread(target=change, daemon=True)
            thread.start()
            for _ in range(4):
                try:
                    convert(x, y, z, s)
                    curvisplat.open("o.splats").render("s", size=(8, 8))
                except curvisplat.Error as error:
                    assert "\\n" not in str(error)
            end.append(1)
            thread.join()
            seen = set()
            def far_away(block, k0, k1, j0, j1, names):
                x, y, z, values, blank = reader()(block, k0, k1, j0, j1, names)
                again = (k0, j0) in seen
                seen.add((k0, j0))
                return x * 1e300 if again else x, y, z, values, blank
            expect(curvisplat.Error, "something changes it while it is converted", lambda: call(far_away, refine=1))
            rounds = iter(range(1_000_000))
            def different(block, k0, k1, j0, j1, names):
                random = np.random.default_rng(next(rounds))
                part = lambda: random.random((k1 - k0, j1 - j0, 32)) * 10.0 ** random.integers(-3, 4)
                return part(), part(), part(), [part() for _ in names], random.random((k1 - k0, j1 - j0, 32)) < 0.5
            for _ in range(4):
                try:
                    call(different)
                    curvisplat.open("o.splats").render("s", size=(8, 8))
                except curvisplat.Error as error:
                    assert "\\n" not in str(error)
            """)

    def test_ctrl_c_in_any_pass_leaves_nothing(self):
        self.attempt("""
            stopped = []
            # Progress is shown ten times a second: a short pass may end without. "build" has to be met once, so its grids grow.
            for phase, nodes in (("scan", 96), ("count", 96), ("scatter", 96), ("seams", 96), ("faces", 96),
                                 ("build", 128), ("build", 160), ("build", 224)):
                if "build" in stopped:
                    break
                def report(now, *state):
                    if now == phase:
                        raise KeyboardInterrupt
                try:
                    convert(*grid(nodes), progress=report)
                    shutil.rmtree("o.splats")  # the pass is done before anyone looks
                except KeyboardInterrupt:
                    if os.path.exists("o.splats"):  # the work was done before the exception could stop it
                        curvisplat.open("o.splats").render("s", size=(8, 8))
                        shutil.rmtree("o.splats")
                    else:
                        stopped.append(phase)
                assert not os.listdir(), (phase, os.listdir())
            assert "build" in stopped, stopped  # after which the command could go on
            """)

    def test_an_interpreter_that_ends_meanwhile(self):
        for work in ("cache.render('s', size=(200, 200))", "cache.histogram('s', bins=64)", "cache.sample('s', size=32)",
                     "curvisplat.convert_arrays(own, Block(*arrays[:3], {'s': arrays[3]}), overwrite=True)",
                     "curvisplat.convert_callable(own, [(64, 64, 64)], reader(64), ['s'], overwrite=True)"):
            with self.subTest(work=work):
                self.attempt(f"""
                    convert()
                    arrays = grid(64)
                    begun = threading.Barrier(3)
                    threading.excepthook = lambda *_: None
                    def work():
                        cache = curvisplat.open("o.splats")
                        own = f"{{threading.get_ident()}}.splats"
                        begun.wait()
                        while True:
                            {work}
                    for _ in range(2):
                        threading.Thread(target=work, daemon=True).start()
                    begun.wait()
                    time.sleep(0.3)
                    """)

    def test_processes_that_fork(self):
        self.attempt("""
            convert()
            cache = curvisplat.open("o.splats")
            cache.render("s", size=(32, 32))
            for attempt in ("cache.render('s', size=(8, 8))", "cache.sample('s', size=4)", "cache.close()"):
                child = os.fork()
                if child == 0:
                    signal.alarm(30)
                    expect(curvisplat.UsageError, "before this process was forked", lambda: eval(attempt))
                    del cache  # without waiting for its parent's threads
                    os._exit(0)
                assert os.waitpid(child, 0)[1] == 0
            child = os.fork()
            if child == 0:
                signal.alarm(30)
                curvisplat.open("o.splats").render("s", size=(32, 32))
                os._exit(0)  # as multiprocessing does
            assert os.waitpid(child, 0)[1] == 0
            cache.render("s", size=(32, 32))
            """)

    def test_threads_that_share_a_cache(self):
        """One gets what it asks for, the others are refused: data is not read while render() goes to another step."""
        self.attempt("""
            x, y, z, s = grid()
            convert(time=0)
            for step in range(1, 4):
                curvisplat.append_arrays("o.splats", Block(x, y, z, {"s": s + step}))
            cache = curvisplat.open("o.splats")
            end = time.time() + 3
            errors, done = set(), []
            def work(what):
                number = 0
                while time.time() < end:
                    number += 1
                    try:
                        what(number)
                        done.append(1)
                    except curvisplat.UsageError as error:
                        errors.add(str(error))
            def draw(number):
                cache.close()
                cache.render("s", size=(8, 8), step=number % 4)
            works = [draw, draw, lambda n: cache.sample("s", size=8), lambda n: cache.histogram("s"), lambda n: cache.points("s")]
            threads = [threading.Thread(target=work, args=(what,)) for what in works]
            for thread in threads: thread.start()
            for thread in threads: thread.join()
            assert done and all("is in use by another thread" in error for error in errors), errors
            """)

    def test_scalars_with_blanks_of_their_own_are_opened_by_several_threads(self):
        self.attempt("""
            x, y, z, s = grid()
            scalars = {f"s{n}": s.copy() for n in range(12)}
            for n, values in enumerate(scalars.values()):
                values[n % 8, 3 * n % 8] = np.nan
            convert(scalars=scalars)
            refused = []
            for number in range(100):
                cache = curvisplat.open("o.splats")
                begun = threading.Barrier(8)
                def work(what):
                    begun.wait()
                    try:
                        what()
                    except curvisplat.UsageError as error:
                        refused.append(str(error))
                draws = lambda: [cache.render("s5", size=(8, 8)), cache.close()] if number % 50 == 0 else repr(cache)
                works = [draws, cache.close, lambda: cache.histogram("s9"), *5 * [lambda: cache.scalars]]
                threads = [threading.Thread(target=work, args=(what,)) for what in works]
                for thread in threads: thread.start()
                for thread in threads: thread.join()
                assert sorted(scalar.name for scalar in cache.scalars) == sorted(scalars)
            assert all("is in use by another thread" in error for error in refused), refused
            child = os.fork()
            if child == 0:
                signal.alarm(30)
                assert len(cache.scalars) == 12  # they are open
                os._exit(0)
            assert os.waitpid(child, 0)[1] == 0
            cache = curvisplat.open("o.splats")
            child = os.fork()
            if child == 0:
                signal.alarm(30)
                expect(curvisplat.UsageError, "before this process was forked", lambda: cache.scalars)
                os._exit(0)
            assert os.waitpid(child, 0)[1] == 0
            """)

    def test_a_function_for_progress_uses_the_cache_that_is_drawn(self):
        """It reads what is known of the step before, and may not use what is in use."""
        self.attempt("""
            arrays = grid(24)
            convert(*arrays, time=0)
            curvisplat.append_arrays("o.splats", Block(*arrays[:3], {"s": arrays[3] + 7}))
            cache = curvisplat.open("o.splats")
            seen = []
            def look(*state):
                seen.append((cache.scalars[0].min, repr(cache), cache.bounds[1].tolist(), cache.blocks, len(cache.orbit(frames=2))))
                for attempt in (cache.close, cache.histogram, cache.sample, cache.points, lambda: cache.probe((0, 0, 0)), lambda: cache.render("s")):
                    expect(curvisplat.UsageError, "is in use by another thread, or by the call", attempt)
            for tries in range(20):
                cache.render("s", size=(1500, 1500), shade=True, threads=1, step=1, progress=look)
                assert cache.scalars[0].min == 7, cache.scalars
                if seen:
                    break
                cache = curvisplat.open("o.splats")
            assert seen and all(one[0] == 0 for one in seen), seen
            """)


if __name__ == "__main__":
    unittest.main()
