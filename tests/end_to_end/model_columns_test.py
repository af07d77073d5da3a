#!/usr/bin/python3
"""model_columns_test.py CURVISPLAT

Heights of the layers of unstructured maps, as Delft3D FM, SCHISM, ICON and MPAS' ocean write them: volumes and bounds against the numbers
of this script. model_files.py says how. Exit status 77 (skipped) without python3-netcdf4.
"""
import json
import subprocess
import unittest

from model_files import PROGRAM, File, ModelFileTest, netCDF4, np

X, Y = np.array([0, 1000, 2000, 0, 1000, 2000, 3000.0]), np.array([0, 0, 0, 1000, 1000, 1000, 500.0])
FACES = np.array([[0, 1, 4, 3], [1, 2, 5, 4], [2, 6, 5, -1]])  # 2.5 km2
SIZES = {"node": 7, "face": 3, "corner": 4, "layer": 4, "interface": 5, "time": None}
BOTTOM = -20.0
LEVELS = np.array([BOTTOM, -12, -7, -3, 0])
MIDDLES = (LEVELS[1:] + LEVELS[:-1]) / 2


class Columns(ModelFileTest):
    def mesh(self, name="file.nc", at="face", layers="layer"):
        f = File(self.folder / name, SIZES)
        f.add("mesh", "", 0, "i4", cf_role="mesh_topology", topology_dimension=np.int32(2), node_coordinates="x y", face_node_connectivity="faces")
        for name, values in (("x", X), ("y", Y)):
            f.add(name, "node", values, units="m", standard_name=f"projection_{name}_coordinate")
        f.add("faces", "face corner", FACES, "i4", -1, cf_role="face_node_connectivity")
        if at:
            self.field(f, at, layers)
        return f

    def field(self, f, at, layers):
        n = SIZES[layers]
        f.add("t", f"time {at} {layers}", np.broadcast_to(np.arange(float(n)), (1, SIZES[at], n)), "f4", mesh="mesh", location=at)

    def expect(self, words, *files, bottom=BOTTOM, near=1e-6):
        info = self.info(*files)
        self.assertEqual([s["name"] for s in info["scalars"]], ["t"])
        self.assertIn(f"heights of {words}", info["format"])
        np.testing.assert_allclose(info["bounds"]["lower"], [0, 0, bottom / 1000], atol=near)
        np.testing.assert_allclose(info["bounds"]["upper"], [3, 1, 0], atol=near)
        cache = self.folder / "a.splats"
        paths = [self.folder / name for name in files or ("file.nc",)]
        subprocess.run([PROGRAM, "convert", *paths, "-o", cache, "--overwrite"], check=True, capture_output=True)
        self.assertAlmostEqual(json.loads((cache / "manifest.json").read_text())["volume"], -2.5 * bottom / 1000, delta=1e-5)

    def test_sigma_of_delft3d(self):
        """With and without the sigma of the interfaces; at nodes, the values' own."""
        for interfaces, at in ((True, "face"), (False, "face"), (True, "node")):
            with self.mesh(at=at, layers="layer" if at == "face" else "interface") as f:
                for name, dim, sigma in (("layer_sigma", "layer", MIDDLES / 20), ("interface_sigma", "interface", LEVELS / 20)):
                    if interfaces or dim == "layer":
                        f.add(name, dim, sigma, standard_name="ocean_sigma_coordinate", units="", formula_terms=f"sigma: {name} eta: s1 depth: bldepth")
                f.add("s1", f"time {at}", np.zeros((1, SIZES[at])), units="m", mesh="mesh", location=at)
                f.add("bldepth", at, [20.0] * SIZES[at], units="m", mesh="mesh", location=at)
            # Without the interfaces, the outer layers end as far beyond their middles as their neighbours are.
            low = MIDDLES[0] - (MIDDLES[1] - MIDDLES[0]) / 2
            if interfaces:
                self.expect("ocean_sigma_coordinate of interface_sigma")
            else:
                self.assertAlmostEqual(self.info()["bounds"]["lower"][2], low / 1000)

    def test_times_with_another_name_than_their_dimension(self):
        """Of a dimension that has no coordinate and no limit; MPAS' dates, in a calendar without leap days."""
        dates = ["2004-02-28_12:00:00", "2004-03-01_12:00:00", "2005-02-28_12:00:01"]
        for name, dim, values, times in (("time", "nt", [0.1, 0.25, 0.7], [0.1, 0.25, 0.7]), ("xtime", "Time width", [list(date.ljust(64)) for date in dates], [0, 86400, 365 * 86400 + 1])):
            with self.mesh(at=None) as f:
                f.config_calendar_type = "gregorian_noleap"
                for further, length in (("nt", 3), ("Time", None), ("width", 64)):
                    f.createDimension(further, length)
                f.add("layer", "layer", MIDDLES, units="m", positive="up")
                kind, units = ("f8", "days since 2000-01-01") if name == "time" else ("S1", "")
                f.add(name, dim, np.array(values, kind), kind, units=units)
                f.add("t", f"{dim.split()[0]} face layer", np.zeros((3, 3, 4)), "f4", mesh="mesh", location="face")
            info = self.info("file.nc", "--time-step", "1")
            self.assertEqual((info["times"], info["date"]), (times, "2000-01-01 06:00:00" if name == "time" else "2004-03-01 12:00:00"))

    def test_a_formula_that_lacks_a_term_is_named(self):
        with self.mesh() as f:
            f.add("layer_sigma", "layer", MIDDLES / 20, standard_name="ocean_sigma_coordinate", formula_terms="sigma: layer_sigma eta: s1 depth: nowhere")
        self.assertIn("the formula of layer_sigma has no term 'depth", self.info(fails=True))

    def test_heights_in_faces(self):
        """Of interfaces, or of the middles of layers."""
        uniform = np.linspace(BOTTOM, 0, 5)
        for name, dim, values, attributes in (
                ("mesh_flowelem_zw", "interface", LEVELS, {"long_name": "Vertical coordinate of layer interfaces at pressure points"}),
                ("mesh_flowelem_zcc", "layer", (uniform[1:] + uniform[:-1]) / 2, {}), ("z_mc", "layer", (uniform[1:] + uniform[:-1]) / 2, {}),
                ("zMid", "layer", (uniform[1:] + uniform[:-1]) / 2, {}), ("depths", "interface", -LEVELS, {"standard_name": "depth", "positive": "down"})):
            with self.mesh() as f:
                f.add(name, f"time face {dim}", np.broadcast_to(values, (1, 3, len(values))), units="m", **attributes)
            self.expect(name)

    def test_layers_that_end_at_the_ground(self):
        """Delft3D's z-layers: below the ground, values are missing; a node is as deep as the deepest face around it."""
        heights = np.broadcast_to(LEVELS, (1, 3, 5)).copy()
        heights[0, 2, 0] = np.nan
        with self.mesh() as f:
            f.add("zw_zw", "time face interface", heights, units="m")
        self.assertAlmostEqual(self.info()["bounds"]["lower"][2], -0.02)

    def test_schism_in_files_of_variables(self):
        """Its zCoordinates have no unit."""
        self.mesh("out2d_1.nc", at=None).close()
        for name in ("temperature_1.nc", "zCoordinates_1.nc"):
            with File(self.folder / name, SIZES) as f:
                if name.startswith("z"):
                    f.add("zCoordinates", "time node interface", np.broadcast_to(LEVELS, (1, 7, 5)), "f4", mesh="mesh", location="node")
                else:
                    self.field(f, "node", "interface")
        self.expect("zCoordinates", "out2d_1.nc", "temperature_1.nc", "zCoordinates_1.nc")
        # Values in faces between the same levels.
        with File(self.folder / "temperature_1.nc", SIZES) as f:
            self.field(f, "face", "layer")
        self.expect("zCoordinates", "out2d_1.nc", "temperature_1.nc", "zCoordinates_1.nc")

    def test_nodes_that_are_counted_otherwise_than_stated(self):
        """From 1 without a start_index, or from 0 with one of 1; but a fill value of 0 is none of the nodes."""
        for shift, start, said in ((1, None, "faces has the nodes 1 to 7, which are counted from 1; its start_index is missing"),
                                   (1, 0, "faces has the nodes 1 to 7, which are counted from 1; its start_index is 0"),
                                   (0, 1, "faces has the nodes 0 to 6, which are counted from 0; its start_index is 1"), (1, 1, None), (0, 0, None)):
            for fill in (-1, 0) if shift == 1 and start == 1 else (-1,):
                with self.subTest(shift=shift, start=start, fill=fill):
                    with self.mesh() as f:
                        f["faces"][:] = np.where(FACES < 0, -1 if fill else 0, FACES + shift)
                        if start is not None:
                            f["faces"].start_index = np.int32(start)
                        f.add("depths", "time face interface", np.broadcast_to(-LEVELS, (1, 3, 5)), units="m", standard_name="depth", positive="down")
                    self.expect("depths")
                    self.assertEqual([line for line in self.info()["warnings"] if "start_index" in line], [said] if said else [])
        with self.mesh() as f:
            f["faces"][:] = np.where(FACES < 0, -1, FACES + 2)
            f.add("layer", "layer", MIDDLES, units="m", positive="up")
        self.assertIn("face 1 has the node 7; expected 0 to 6; the file is damaged", self.info(fails=True))

    def test_what_lacks_is_said(self):
        self.mesh(at=None).close()
        self.assertIn("is a grid of UGRID, and no scalar lies at its faces or nodes; give the file with its scalars before it", self.info(fails=True))
        with self.mesh(at=None) as f:
            f.add("h", "time face", np.ones((1, 3)), "f4")
        self.assertIn("is a grid of UGRID, but no scalar has layers: no part of it has a volume (found h)", self.info(fails=True))
        with File(self.folder / "file.nc", {"nodeCount": 7, "elementCount": 3, "maxNodePElement": 4, "coordDim": 2}) as f:
            f.add("nodeCoords", "nodeCount coordDim", np.stack([X, Y], -1) / 1e4, units="degrees")
            f.add("elementConn", "elementCount maxNodePElement", FACES + 1, "i4", -1)
        self.assertIn("is a mesh of ESMF, whose faces have neither layers nor scalars", self.info(fails=True))

    def test_places_without_units(self):
        """The standard_name says that they are lengths; numbers that are no degrees are refused."""
        def write(**attributes):
            with self.mesh() as f:
                for name in "xy":
                    f[name].delncattr("units")
                    f[name].setncatts(attributes)
                f.add("layer", "layer", MIDDLES, units="m", positive="up")

        write()
        info = self.info()
        self.assertIn("x and y have no unit of length; metres are assumed", info["warnings"])
        np.testing.assert_allclose(info["bounds"]["upper"][:2], [3, 1])
        write(standard_name="place")
        self.assertIn("x is 0 .. 3000 and y is 0 .. 1000 degrees, which are no longitudes and latitudes", self.info(fails=True))

    def test_nodes_at_no_place_on_the_earth(self):
        """A fill value that no attribute names."""
        self.globe(1)
        with netCDF4.Dataset(self.folder / "file.nc", "a") as f:
            f["y"][3] = -999
        info = self.info()
        self.assertEqual(info["blanked"]["not_finite"], 5)

    def test_fesom_without_attributes(self):
        """Its mesh files were once without those of UGRID, and without units; outputs have points or layers first."""
        nodes = {"nod2": 5, "elem": 4, "n3": 3, "nz": 4, "nz1": 3, "time": None}
        with File(self.folder / "fesom.mesh.diag.nc", nodes) as f:
            f.add("lon", "nod2", [0.0, 2, 2, 0, 1])
            f.add("lat", "nod2", [-1.0, -1, 1, 1, 0])
            f.add("elements", "n3 elem", np.array([[1, 2, 5], [2, 3, 5], [3, 4, 5], [4, 1, 5]]).T, "i4")
            f.add("nz", "nz", [0.0, -100, -300, -600])
            f.add("nz1", "nz1", [-50.0, -200, -450])
            f.add("nlevels", "elem", [4, 4, 4, 4], "i4")
            f.add("nlevels_nod2D", "nod2", [4] * 5, "i4")
            f.add("nod_area", "nz nod2", np.ones((4, 5)))
        with File(self.folder / "u.nc", nodes) as f:
            f.add("u", "time nz1 elem", np.ones((1, 3, 4)), "f4")
        with File(self.folder / "temp.nc", nodes) as f:
            f.add("temp", "time nod2 nz1", np.ones((1, 5, 3)), "f4")
        with File(self.folder / "sst.nc", nodes) as f:
            f.add("sst", "time nod2", np.ones((1, 5)), "f4")
        degree = np.pi / 180 * 6371
        for name, depth in (("u", 0.6), ("temp", 0.4)):
            cache = self.folder / "a.splats"
            subprocess.run([PROGRAM, "convert", self.folder / f"{name}.nc", self.folder / "fesom.mesh.diag.nc", "-o", cache, "--flat",
                            "--scalar", name, "--overwrite"], check=True, capture_output=True)
            self.assertAlmostEqual(json.loads((cache / "manifest.json").read_text())["volume"] / (4 * degree**2 * depth), 1, delta=1e-4)
        self.assertIn("give its mesh file (fesom.mesh.diag.nc) after it", self.info("temp.nc", fails=True))
        self.assertIn("left out: sst, without layers", " ".join(self.info("sst.nc", "fesom.mesh.diag.nc")["warnings"]))
        self.assertNotIn("left out", " ".join(self.info("temp.nc", "fesom.mesh.diag.nc")["warnings"]))
        refused = subprocess.run([PROGRAM, "convert", self.folder / "sst.nc", self.folder / "fesom.mesh.diag.nc", "-o", cache, "--overwrite",
                                  "--scalar", "sst"], check=False, capture_output=True, text=True)
        self.assertIn("sst has no layers, and so no volume", refused.stderr)

    def globe(self, scale):
        """Eight faces of 45 x 20 degrees around the Earth, the fourth across the date line; layers of 10 m and more, times `scale`."""
        with File(self.folder / "file.nc", {"node": 16, "face": 8, "corner": 4, "layer": 4, "interface": 5, "time": None}) as f:
            f.add("mesh", "", 0, "i4", cf_role="mesh_topology", topology_dimension=np.int32(2), node_coordinates="x y", face_node_connectivity="faces")
            east = np.arange(8)
            f.add("x", "node", np.tile(np.where(east * 45 + 22.5 > 180, east * 45 - 337.5, east * 45 + 22.5), 2), units="degrees_east", standard_name="longitude")
            f.add("y", "node", np.repeat([-10.0, 10.0], 8), units="degrees_north", standard_name="latitude")
            f.add("faces", "face corner", np.stack([east, (east + 1) % 8, (east + 1) % 8 + 8, east + 8], -1), "i4", -1, cf_role="face_node_connectivity")
            f.add("zw_zw", "time face interface", np.broadcast_to(scale * np.array([0, 10.0, 30, 60, 100]), (1, 8, 5)), units="m")
            f.add("t", "time face layer", np.ones((1, 8, 4)), "f4", mesh="mesh", location="face")

    def test_faces_across_the_edge_of_a_flat_map(self):
        self.globe(1)
        info = self.info("file.nc", "--flat")
        self.assertIn("1 of 8 faces lie across the edge of the flat map", " ".join(info["warnings"]))
        cache = self.folder / "a.splats"
        subprocess.run([PROGRAM, "convert", self.folder / "file.nc", "-o", cache, "--flat", "--overwrite"], check=True, capture_output=True)
        degree = np.pi / 180 * 6371
        self.assertAlmostEqual(json.loads((cache / "manifest.json").read_text())["volume"] / (7 * 45 * 20 * degree**2 * 0.1), 1, delta=1e-5)

    def test_flat_cells_far_below_the_sphere(self):
        """The corners' mean is nearer to the Earth's middle: by the cosines of half of the sides."""
        self.globe(1)
        depth = 6371 * (1 - np.cos(np.radians(22.5)) * np.cos(np.radians(10)))
        self.assertIn(f"lie up to {depth:.3g} km below the sphere, {depth / 0.01:.3g} times the thickness", " ".join(self.info()["warnings"]))
        self.globe(2e5)
        self.assertNotIn("below the sphere", " ".join(self.info()["warnings"]))

    def test_structured_cells_far_below_the_sphere(self):
        """The corners' mean of the cells beside the equator, which are the widest."""
        depth = 6371 * (1 - np.cos(np.radians(10)) * np.cos(np.radians(5)))
        for scale, said in ((0.5, True), (500, False)):
            with File(self.folder / "file.nc", {"lon": 5, "lat": 4, "alt": 3}) as f:
                f.add("lon", "lon", 20.0 * np.arange(5), units="degrees_east")
                f.add("lat", "lat", -15.0 + 10 * np.arange(4), units="degrees_north")
                f.add("alt", "alt", scale * np.arange(3.0) ** 2, units="km", standard_name="altitude")
                f.add("T", "alt lat lon", np.ones((3, 4, 5)), "f4")
            warning = f"lie up to {depth:.3g} km below the sphere, {depth / 0.5:.3g} times the thickness"
            self.assertEqual(warning in " ".join(self.info()["warnings"]), said)
            self.assertNotIn("below the sphere", " ".join(self.info("file.nc", "--flat")["warnings"]))
            self.assertNotIn("below the sphere", " ".join(self.info("file.nc", "--vertical-scale", "1000")["warnings"]))

    def test_thicknesses_of_layers(self):
        """MPAS' ocean: below the surface, which is not at 0; below the ground there are none."""
        thickness = np.array([[1.0, 3, 6, 10], [1, 4, 0, 0]])
        for surface, fill in ((None, 0), (0.5, 0), (-0.5, -1e34)):
            with self.file(nCells=2, nVertices=6, maxEdges=6, nVertLevels=4, Time=None) as f:
                f.on_a_sphere, f.sphere_radius = "NO", 0.0
                for name, values in (("xVertex", [0, 1e3, 2e3, 0, 1e3, 2e3]), ("yVertex", [0, 0, 0, 1e3, 1e3, 1e3])):
                    f.add(name, "nVertices", values, units="m")
                f.add("nEdgesOnCell", "nCells", [4, 4], "i4")
                f.add("verticesOnCell", "nCells maxEdges", [[1, 2, 5, 4, 0, 0], [2, 3, 6, 5, 0, 0]], "i4")
                f.add("maxLevelCell", "nCells", [4, 2], "i4")
                f.add("layerThickness", "Time nCells nVertLevels", np.where(thickness > 0, thickness, fill)[None], "f8", -1e34, units="m")
                f.add("temperature", "Time nCells nVertLevels", np.ones((1, 2, 4)), "f4")
                if surface is not None:
                    f.add("ssh", "Time nCells", [[surface] * 2], units="m")
            info = self.info("file.nc", "--flat")
            np.testing.assert_allclose([info["bounds"]["lower"][2], info["bounds"]["upper"][2]], np.array([-20, 0]) / 1000 + (surface or 0) / 1000, atol=1e-9)
            self.assertEqual([s["name"] for s in info["scalars"]], ["temperature", "layerThickness"])
            self.assertEqual("below a surface at 0" in info["format"], surface is None)


if __name__ == "__main__":
    unittest.main()
