#!/usr/bin/python3
"""arguments_test.py

Odd values for each argument of each public function and class: what they lead to is a result, or an exception of one short line that
names the argument or the value. The package is found by PYTHONPATH.
"""

import importlib.util
import inspect
import os
import re
import tempfile
import unittest
import warnings

import numpy as np

import curvisplat
from curvisplat import Block, Cache, Camera, Picture, TransferFunction, View

LONGEST = 900  # characters


class Raises:
    """Has no text, and raises whatever is asked of it."""

    def __repr__(self):
        raise RuntimeError("no text\nat all")

    __str__ = __len__ = __iter__ = __float__ = __index__ = __array__ = __fspath__ = __repr__


class Long:
    def __repr__(self):
        return TEN_MEGABYTES


TEN_MEGABYTES = "long\n" * (2 << 20)
ODD = (None, "odd", 7, 1.5, float("nan"), 10**400, b"odd\xff", "odd\udc80", "9" * 100_000, [], [1, "odd", None], {"odd": [1]}, np.zeros((50, 50)), object, Raises(),
       Long())

GRID = """# vtk DataFile Version 3.0
a grid
ASCII
DATASET STRUCTURED_POINTS
DIMENSIONS 3 3 3
ORIGIN 0 0 0
SPACING 1 1 1
POINT_DATA 27
SCALARS s float
LOOKUP_TABLE default
""" + " ".join(map(str, range(27)))


class Arguments(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        folder = tempfile.TemporaryDirectory()
        cls.addClassCleanup(folder.cleanup)
        cls.addClassCleanup(os.chdir, os.getcwd())
        os.chdir(folder.name)
        k, j, i = np.meshgrid(*3 * [np.linspace(0, 1, 5, dtype="f4")], indexing="ij")
        cls.block = {"x": i.copy(), "y": j.copy(), "z": k.copy(), "scalars": {"s": i + j}}
        with open("grid.vtk", "w", encoding="ascii") as file:
            file.write(GRID)
        curvisplat.convert_arrays("o.splats", Block(**cls.block), time=0)
        cls.cache = curvisplat.open("o.splats")
        cls.picture = cls.cache.render(size=(8, 8))

    def attempts(self):
        """The parameters of (a name), a function of them, and arguments that it takes."""
        cache, camera, block = self.cache, Camera((3, 3, 3)), Block(**self.block)

        def read(number, k0, k1, j0, j1, names):
            part = np.s_[k0:k1, j0:j1]
            return *(self.block[axis][part] for axis in "xyz"), [self.block["scalars"]["s"][part]] * len(names), None

        def converted(function, *arguments, **fixed):
            def call(**named):
                own = [named.pop(name) for name in arguments]
                return function(*own, **{**fixed, **named})
            return call

        files = {"output": "f.splats", "grid": "grid.vtk", "overwrite": True, "threads": 1}
        arrays = {"output": "a.splats", "blocks": block, "overwrite": True, "threads": 1}
        attempts = [
            ("Block", lambda **own: curvisplat.convert_arrays("b.splats", Block(**own), overwrite=True, threads=1), self.block),
            ("Cache", Cache, {"path": "o.splats"}), ("Camera", lambda **own: cache.render(size=(8, 8), camera=Camera(**own)), {"position": (3, 3, 3)}),
            ("TransferFunction", lambda **own: cache.render(size=(8, 8), function=TransferFunction(**own)), {}),
            ("View", View, {"path": "o.splats", "program": "/bin/true"}), ("append", curvisplat.append, {"cache": "none.splats", "grid": "grid.vtk"}),
            ("append_arrays", converted(curvisplat.append_arrays, "cache", "blocks"), {"cache": "o.splats", "blocks": block, "threads": 1}),
            ("convert", curvisplat.convert, files), ("convert_arrays", converted(curvisplat.convert_arrays, "output", "blocks"), arrays),
            ("convert_callable", curvisplat.convert_callable,
             {"output": "c.splats", "shapes": [(5, 5, 5)], "read": read, "scalars": ["s"], "overwrite": True, "threads": 1}),
            ("open", curvisplat.open, {"path": "o.splats"}), ("orbit", curvisplat.orbit, {"camera": camera, "frames": 2}),
            ("Cache.render", cache.render, {"size": (8, 8)}), ("Cache.sample", cache.sample, {"size": 4}), ("Cache.points", cache.points, {}),
            ("Cache.histogram", cache.histogram, {}), ("Cache.probe", cache.probe, {"point": (0.5, 0.5, 0.5)}), ("Cache.orbit", cache.orbit, {"frames": 2}),
            ("Cache.camera", cache.camera, {}), ("Cache.view", cache.view, {"program": "/bin/true"}), ("Camera.turned", camera.turned, {}),
            ("Picture.save", self.picture.save, {"path": "p.png"})]
        if importlib.util.find_spec("xarray"):
            import xarray
            data = xarray.Dataset({name: (("k", "j", "i"), value) for name, value in {**self.block, **self.block["scalars"]}.items() if name != "scalars"})
            attempts.append(("from_xarray", curvisplat.from_xarray, {"dataset": data}))
        return attempts

    def test_all_public_functions_are_tried(self):
        tried = {name for name, *_ in self.attempts()}
        # Without arguments, or what results are.
        others = {"Error", "UsageError", "Picture", "Points", "Report", "Samples", "Scalar", "colour_maps", "program", "from_xarray", "Cache.close",
                  "TransferFunction.options", "TransferFunction.replaced", "Camera.options", "View.close"}
        public = {name for name in curvisplat.__all__ if callable(getattr(curvisplat, name))}
        for kind in (Cache, Camera, Picture, TransferFunction, View):
            public |= {f"{kind.__name__}.{name}" for name, value in vars(kind).items() if callable(value) and not name.startswith("_")}
        self.assertEqual(public - others, tried - others)

    def test_odd_values_are_refused_in_one_short_line(self):
        for name, function, arguments in self.attempts():
            target = curvisplat
            for part in name.split("."):
                target = getattr(target, part)
            parameters = set(inspect.signature(target).parameters) - {"self"}
            for parameter in sorted(parameters):
                for value in ODD:
                    # A function of the caller's may raise what it likes.
                    if value is not object or parameter not in ("read", "progress"):
                        self.attempt(f"{name}({parameter})", function, {**arguments, parameter: value}, parameter, parameters)
        self.assertEqual(np.asarray(self.cache.render(size=(8, 8))).shape, (8, 8, 4))

    def attempt(self, what, function, arguments, parameter, parameters):
        value = arguments[parameter]
        try:
            shown = repr(value)[:30]
        except RuntimeError:
            shown = "Raises"
        with self.subTest(f"{what}: {type(value).__name__} {shown}"), warnings.catch_warnings():
            warnings.simplefilter("ignore")
            try:
                function(**arguments)
            except curvisplat.Error as error:
                line = str(error)
                self.assertNotIn("\n", line)
                self.assertLess(len(line), LONGEST)
                self.assertNotRegex(line, r"std::|C\+\+|\(arg0|--(tf|iso)\b")
                # Not in commands that it proposes.
                options = re.findall(r"--([a-z-]+)", re.sub("`.*?`|curvisplat convert .*", "", line))
                self.assertEqual([option for option in options if {option.replace("-", "_"), option + "s"} & set(parameters)], [], line)
                if isinstance(error, curvisplat.UsageError):
                    given = value if isinstance(value, dict) else [value] if isinstance(value, (str, bytes)) else []
                    names = [parameter.rstrip("s"), *(str(one).strip("b'")[:3] for one in given)]
                    self.assertTrue(any(name in line for name in names), line)
                else:
                    self.assertTrue(line)


if __name__ == "__main__":
    unittest.main()
