"""What the tests of models' NetCDF files share: a file that netCDF4 writes, and what `curvisplat info` measures of it
(dimensions, ranges, blanked nodes, bounds and volume) against what numpy makes of the same arrays by the conventions' formulas.
"""
import json
import pathlib
import subprocess
import sys
import tempfile
import unittest

try:
    import netCDF4
    import numpy as np
except ModuleNotFoundError as error:
    print(f"skipped: {error}; install python3-netcdf4 and python3-numpy")
    sys.exit(77)

PROGRAM = sys.argv.pop(1)
RADIUS = 6371.0  # kilometres
RANDOM = np.random.default_rng(1)


def sphere(longitude, latitude, height_km):
    """World positions of broadcastable arrays, indexed (k, j, i)."""
    longitude, latitude, height_km = np.broadcast_arrays(longitude, latitude, height_km)
    east, north, r = np.radians(longitude), np.radians(latitude), RADIUS + height_km
    return np.stack([r * np.cos(north) * np.cos(east), r * np.cos(north) * np.sin(east), r * np.sin(north)], -1)


def volume(places):
    """The sum of the cells' volumes, each from six tetrahedra: exact to the cells' curvature."""
    c = [places[k : k - 1 or None, j : j - 1 or None, i : i - 1 or None] for k in (0, 1) for j in (0, 1) for i in (0, 1)]
    total = 0
    for a, b in ((1, 3), (3, 2), (2, 6), (6, 4), (4, 5), (5, 1)):
        total = total + np.einsum("...i,...i", c[a] - c[0], np.cross(c[b] - c[0], c[7] - c[0])) / 6
    return abs(total.sum())


def standard_altitude(pascals):
    """Kilometres: the barometric formula, integrated downwards from 0 to 90 km in steps of a metre."""
    h = np.arange(-2000.0, 90000.0)  # geopotential metres
    feet = [0, 11000, 20000, 32000, 47000, 51000, 71000]
    lapses = [-0.0065, 0, 0.001, 0.0028, 0, -0.0028, -0.002]
    lapse = np.select([h < foot for foot in feet[1:]], lapses[:-1], lapses[-1])
    temperature = np.concatenate([[288.15 + 0.0065 * 2000], 288.15 + 13 + np.cumsum(lapse[:-1])])
    middle = (temperature[1:] + temperature[:-1]) / 2
    log_pressure = np.concatenate([[0], np.cumsum(-9.80665 / (287.05287 * middle))])
    log_pressure += np.log(101325) - np.interp(0, h, log_pressure)
    geopotential = np.interp(-np.log(pascals), -log_pressure, h)
    return 1e-3 * 6356766 * geopotential / (6356766 - geopotential)


class File(netCDF4.Dataset):
    """A file with dimensions of the given lengths; a length of None is unlimited."""

    def __init__(self, path, dimensions, **options):
        super().__init__(path, "w", **options)
        for name, length in dimensions.items():
            self.createDimension(name, length)

    def add(self, name, dimensions, values, kind="f8", fill=None, **attributes):
        variable = self.createVariable(name, kind, tuple(dimensions.split()), fill_value=fill)
        variable.setncatts(attributes)
        variable.set_auto_maskandscale(False)
        variable[...] = values
        return variable


class ModelFileTest(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.folder = pathlib.Path(folder.name)

    def file(self, name="file.nc", **dimensions):
        return File(self.folder / name, dimensions)

    def info(self, *words, fails=False):
        words = [str(self.folder / word) if "." in str(word) else word for word in words or ("file.nc",)]
        done = subprocess.run([PROGRAM, "info", "--json", *words], capture_output=True, text=True)
        self.assertEqual(done.returncode != 0, fails, done.stderr)
        return done.stderr if fails else json.loads(done.stdout)

    def expect(self, info, places, values, near=1e-4, scalar=0):
        """`values`: NaN where a node is blanked."""
        there = ~np.isnan(values)
        block = info["blocks"][0]
        self.assertEqual((block["nk"], block["nj"], block["ni"]), values.shape)
        self.assertEqual(info["blanked"]["by_grid"], (~there).sum())
        self.assertEqual(info["blanked"]["not_finite"], 0)
        np.testing.assert_allclose(info["bounds"]["lower"], places[there].min(axis=0), atol=near)
        np.testing.assert_allclose(info["bounds"]["upper"], places[there].max(axis=0), atol=near)
        measured = info["scalars"][scalar]
        np.testing.assert_allclose([measured["min"], measured["max"]], [values[there].min(), values[there].max()], rtol=1e-6)
        if there.all():
            np.testing.assert_allclose(abs(block["volume"]), volume(places), rtol=0.01)

    def air(self, f, ni=12, nj=8):
        lon, lat = np.linspace(0, 33, ni), np.linspace(10, 31, nj)
        f.add("lon", "lon", lon, units="degrees_east")
        f.add("lat", "lat", lat, units="degrees_north")
        return lon, lat[:, None]
