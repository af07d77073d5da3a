#!/usr/bin/python3
"""model_faces_test.py CURVISPLAT

NetCDF files of grids of several faces: cubed spheres as GEOS and MITgcm write them, and tiles of the lat-lon-cap kind. The faces' values
are at the centres of cells; what `info` and `convert` measure is compared with the shell of a sphere that the model's cells fill.
model_files.py says how. Exit status 77 (skipped) without python3-netcdf4.
"""
import json
import subprocess
import unittest

from model_files import PROGRAM, RADIUS, RANDOM, ModelFileTest, np, volume
from sweep import IS_WHOLE

BOTTOM, TOP = 0.0, 500.0  # kilometres
SHELL = 4 / 3 * np.pi * ((RADIUS + TOP) ** 3 - (RADIUS + BOTTOM) ** 3)
X, Y, Z = np.eye(3)
# The centre of each face, and the directions of i and j there: faces 1, 3 and 5 continue at their last i on the first i of the next,
# faces 2, 4 and 6 at their last j on the first j of the next (MITgcm's and FV3's order).
CUBE = [(X, Y, Z), (Y, -X, Z), (Z, -X, -Y), (-X, -Z, -Y), (-Y, -Z, X), (-Z, Y, X)]


def on_face(face, a, b):
    """Unit vectors at angles a (along i) and b (along j), in degrees from the face's centre, indexed (j, i)."""
    centre, i, j = CUBE[face]
    a, b = np.broadcast_arrays(np.tan(np.radians(a)), np.tan(np.radians(np.asarray(b)))[:, None])
    points = centre + a[..., None] * i + b[..., None] * j
    return points / np.linalg.norm(points, axis=-1, keepdims=True)


def degrees(points):
    return np.degrees(np.arctan2(points[..., 1], points[..., 0])) % 360, np.degrees(np.arcsin(points[..., 2]))


class ModelFaces(ModelFileTest):
    def cube(self, n):
        middles = (np.arange(n) + 0.5) * 90 / n - 45
        return np.stack([on_face(face, middles, middles) for face in range(6)])

    def write(self, points, values, face="face", rows=("j", "i"), **attributes):
        """points[face, j, i], values[level, face, j, i]."""
        faces, nj, ni = points.shape[:3]
        lon, lat = degrees(points)
        with self.file(time=None, k=len(values), **{face: faces, rows[0]: nj, rows[1]: ni}) as f:
            plane = f"{face} {rows[0]} {rows[1]}"
            f.add("XC", plane, lon, units="degrees_east", standard_name="longitude")
            f.add("YC", plane, lat, units="degrees_north", standard_name="latitude")
            f.add("Z", "k", np.linspace(BOTTOM, TOP, len(values)), units="km", positive="up", standard_name="height")
            f.add("THETA", f"time k {plane}", values[None], "f4", coordinates="XC YC Z", **attributes)

    def measured_volume(self, info):
        return sum(abs(block["volume"]) for block in info["blocks"])

    def converted(self, *options):
        """The manifest of the file's cache."""
        cache = self.folder / "a.splats"
        done = subprocess.run([PROGRAM, "convert", str(self.folder / "file.nc"), "-o", str(cache), "--overwrite", "--scalar", "THETA",
                               *options], capture_output=True, text=True, check=False)
        self.assertEqual(done.returncode, 0, done.stderr)
        return json.loads((cache / "manifest.json").read_text()), done.stderr

    def test_a_cubed_sphere_fills_the_shell(self):
        values = RANDOM.random((3, 6, 16, 16)).astype("f4")
        self.write(self.cube(16), values)
        info = self.info()
        self.assertEqual([(b["ni"], b["nj"], b["nk"]) for b in info["blocks"]],
                         6 * [(16, 16, 3)] + 12 * [(2, 16, 3)] + 8 * [(2, 2, 3)])
        self.assertIn("6 faces joined at 12 edges and 8 corners", info["format"])
        self.assertEqual(info["blocks"][0]["name"], "face 1")
        self.assertAlmostEqual(self.measured_volume(info) / SHELL, 1, delta=0.005)
        self.assertAlmostEqual(info["scalars"][0]["min"], values.min(), places=6)
        self.assertAlmostEqual(info["scalars"][0]["max"], values.max(), places=6)
        self.assertEqual(info["blanked"]["by_grid"], 0)
        manifest, messages = self.converted()
        self.assertAlmostEqual(manifest["volume"] / SHELL, 1, delta=0.005)
        self.assertNotIn("overlap", messages)
        self.assertNotIn("inverted", messages)

    def test_faces_in_any_order_and_direction(self):
        points = self.cube(12)
        for trial in range(4):
            turned = []
            for face in RANDOM.permutation(6):
                one = np.rot90(points[face], RANDOM.integers(4))
                turned.append(one[::-1] if trial % 2 else one)
            self.write(np.stack(turned), RANDOM.random((2, 6, 12, 12)).astype("f4"), "tile")
            info = self.info()
            self.assertIn("joined at 12 edges and 8 corners", info["format"])
            self.assertAlmostEqual(self.measured_volume(info) / SHELL, 1, delta=0.01)
            self.assertLess(max(block["inverted"] for block in info["blocks"]), 1)

    def test_tiles_with_an_open_end(self):
        """Four sides of the cube and its northern face, each of 2 x 2 tiles; two of the sides with i and j exchanged."""
        n = 16
        middles = (np.arange(n) + 0.5) * 90 / n - 45
        sides = {0: False, 1: False, 3: True, 4: True, 2: False}
        tiles = []
        for face, exchanged in sides.items():
            whole = on_face(face, middles, middles)
            whole = whole.swapaxes(0, 1)[:, ::-1] if exchanged else whole
            tiles += [whole[j : j + n // 2, i : i + n // 2] for j in (0, n // 2) for i in (0, n // 2)]
        values = RANDOM.random((2, len(tiles), n // 2, n // 2)).astype("f4")
        values[:, 3, 1, 2] = np.nan
        self.write(np.stack(tiles), values, "tile")
        info = self.info()
        # Of the 5 x 4 tiles, each face has 4 joints within it; 8 edges of the cube with 2 each are between faces.
        # Within a face there is one hole, and one on each of those 8 edges; 4 corners of the cube.
        self.assertIn("20 faces joined at 36 edges and 17 corners", info["format"])
        self.assertEqual(info["blanked"]["by_grid"], 2)
        south = 90 / n / 2 - 45
        fine = np.linspace(-45, 45, 60)

        def shell(points):
            return volume(np.stack([points * (RADIUS + BOTTOM), points * (RADIUS + TOP)]))

        expected = 4 * shell(on_face(0, fine, np.linspace(south, 45, 60))) + shell(on_face(2, fine, fine))
        self.assertAlmostEqual(self.measured_volume(info) / expected, 1, delta=0.01)

    def test_geos(self):
        """Levels of pressure, coordinates for GrADS along the dimensions, and tables of contacts and corners."""
        n = 8
        lon, lat = degrees(self.cube(n))
        t = RANDOM.random((1, 3, 6, n, n)).astype("f4")
        t[0, 2, 4, 3, 5] = 1e15
        with self.file(time=None, lev=3, nf=6, Ydim=n, Xdim=n, YCdim=n + 1, XCdim=n + 1, ncontact=4, orientationStrLen=5) as f:
            f.add("Xdim", "Xdim", lon[0, 0], long_name="Fake Longitude for GrADS Compatibility", units="degrees_east")
            f.add("Ydim", "Ydim", lat[0, :, 0], long_name="Fake Latitude for GrADS Compatibility", units="degrees_north")
            f.add("nf", "nf", np.arange(1, 7), "i4", long_name="cubed-sphere face", axis="e", grads_dim="e")
            f.add("ncontact", "ncontact", np.arange(1, 5), "i4", long_name="number of contact points")
            f.add("contacts", "nf ncontact", np.ones((6, 4)), "i4", long_name="adjacent face starting from left side going clockwise")
            f.add("anchor", "nf ncontact ncontact", np.ones((6, 4, 4)), "i4", long_name="anchor point")
            f.add("lons", "nf Ydim Xdim", lon, units="degrees_east", long_name="longitude")
            f.add("lats", "nf Ydim Xdim", lat, units="degrees_north", long_name="latitude")
            f.add("corner_lons", "nf YCdim XCdim", np.zeros((6, n + 1, n + 1)), units="degrees_east")
            f.add("corner_lats", "nf YCdim XCdim", np.zeros((6, n + 1, n + 1)), units="degrees_north")
            f.add("lev", "lev", [1000.0, 500, 100], units="hPa", positive="down", long_name="vertical level")
            f.add("time", "time", [30.0], units="minutes since 2020-01-01 00:30:00")
            f.add("T", "time lev nf Ydim Xdim", t, "f4", fill=1e15, units="K", coordinates="lons lats", grid_mapping="cubed_sphere")
            f.add("PS", "time nf Ydim Xdim", t[:, 0], "f4", units="Pa", coordinates="lons lats")
        info = self.info()
        self.assertEqual([s["name"] for s in info["scalars"]], ["T"])
        self.assertIn("joined at 12 edges and 8 corners", info["format"])
        self.assertEqual(info["blocks"][0]["name"], "nf 1")
        self.assertEqual(info["blanked"]["by_grid"], 1)
        self.assertEqual([warning for warning in info["warnings"] if "below the sphere" not in warning], [])
        good = t[t < 1e10]
        self.assertAlmostEqual(info["scalars"][0]["max"], good.max(), places=6)

    def test_pictures_have_no_seams(self):
        """A shell of even density over the sphere, from a corner of the cube: darkest along the limb, and even elsewhere."""
        self.write(self.cube(24), np.ones((3, 6, 24, 24), "f4"))
        self.converted()
        picture = self.folder / "a.pfm"
        done = subprocess.run([PROGRAM, "render", str(self.folder / "a.splats"), "-o", str(picture), "--size", "200x200", "--position",
                               "20000,20000,20000", "--focal-point", "0,0,0", "--parallel-scale", "7500", "--range", "0,2", "--opacity",
                               "0:0.3,1:0.3", "--opacity-unit", "500", "--background", "black"], capture_output=True, text=True, check=False)
        self.assertEqual(done.returncode, 0, done.stderr)
        kind, size, _, data = picture.read_bytes().split(b"\n", 3)
        width, height = map(int, size.split())
        light = np.frombuffer(data, "<f4").reshape(height, width, -1)[..., :3].sum(-1)
        y, x = np.mgrid[:height, :width]
        r = np.hypot(x - (width - 1) / 2, y - (height - 1) / 2) * 2 * 7500 / height
        for ring in range(0, 5000, 500):
            on_ring = light[(r >= ring) & (r < ring + 150)]
            self.assertLess(on_ring.std() / on_ring.mean(), 0.02, ring)

    def test_damage(self):
        """Coordinates that are missing leave the faces apart; those that are all alike are refused."""
        points = self.cube(8)
        points[2] = np.nan
        self.write(points, np.ones((2, 6, 8, 8), "f4"))
        info = self.info()
        self.assertIn("6 faces joined at 8 edges and 4 corners", info["format"])
        self.write(np.ones((6, 8, 8, 3)) / np.sqrt(3), np.ones((2, 6, 8, 8), "f4"))
        self.assertIn("are no longitudes and latitudes of a grid", self.info(fails=True))

    def test_edges_of_more_than_a_million_points(self):
        """Edges are compared in memory: faces with too many points along them stay apart, and a line says so."""
        for nodes, joined in ((87_378, True), (87_380, False)):  # 2 x 6 x (nodes + 2) points; 2^20 are compared
            step = 90 / nodes
            along = (np.arange(nodes) + 0.5) * step - 45  # bands of square cells
            points = np.stack([on_face(face, along, np.array([-step, 0])) for face in range(6)])
            self.write(points, np.broadcast_to(np.float32(1), (2, 6, 2, nodes)))
            info = self.info()
            self.assertEqual("joined at" in info["format"], joined)
            line = f"the faces are not joined: their edges have {12 * (nodes + 2)} points; at most 1048576 are compared"
            self.assertEqual(info["warnings"].count(line), not joined, info["warnings"])
        if IS_WHOLE:  # two million nodes; model_dialects_test.py has a smaller file that `convert` warns of
            self.assertEqual(self.converted()[1].count(line), 1)


if __name__ == "__main__":
    unittest.main()
