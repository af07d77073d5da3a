#!/usr/bin/python3
"""mesh_formats_test.py CURVISPLAT

Unstructured grids of further formats: mesh_formats.py says how. Exit status 77 (skipped) without python3-vtk9.
"""
import unittest

from mesh_formats import RANDOM, MeshFormats, np, numpy_to_vtk, vtk, write_xml

try:
    import netCDF4
except ModuleNotFoundError:
    netCDF4 = None


@unittest.skipUnless(netCDF4, "no python3-netcdf4")
class Columns(MeshFormats):
    """UGRID, ICON and MPAS: prisms over the faces of a map. The map is a plane or a patch of the globe, with quadrangles and
    triangles, and hexagons where the format has them."""

    LAYERS = 3

    def setUp(self):
        super().setUp()
        self.path = self.folder / "grid.nc"
        # A patch of 3 x 2 quadrangles, the last of them cut into triangles.
        y, x = np.meshgrid(np.arange(3.0), np.arange(4.0), indexing="ij")
        self.nodes = np.stack([x.ravel() + 0.1 * y.ravel(), y.ravel()], 1)
        quads = [[4 * j + i, 4 * j + i + 1, 4 * j + i + 5, 4 * j + i + 4] for j in range(2) for i in range(3)]
        self.faces = [*quads[:5], quads[5][:3], [quads[5][k] for k in (0, 2, 3)]]
        self.levels = np.array([0.0, 100.0, 300.0, 600.0])
        self.t = RANDOM.random((self.LAYERS, len(self.faces))).astype("f4")

    def place(self, longitude, latitude, height, sphere=True):
        if not sphere:
            return [longitude, latitude, height]
        east, north, r = np.radians(longitude), np.radians(latitude), 6371 + height
        return [r * np.cos(north) * np.cos(east), r * np.cos(north) * np.sin(east), r * np.sin(north)]

    def expected(self, column_by_column=False, heights=None, sphere=True, faces=None, nodes=None):
        """VTK's grid of the same prisms. `heights`: [level][node], in kilometres."""
        faces, nodes = faces or self.faces, self.nodes if nodes is None else nodes
        levels, columns = self.LAYERS + 1, len(nodes)
        heights = np.repeat(self.levels[:, None] / 1000, columns, 1) if heights is None else heights
        points = np.zeros((levels * columns, 3))
        number = lambda level, node: node * levels + level if column_by_column else level * columns + node
        for level in range(levels):
            for node in range(columns):
                points[number(level, node)] = self.place(*nodes[node], heights[level][node], sphere)
        grid = vtk.vtkUnstructuredGrid()
        grid.Allocate(1)
        order = [(l, f) for f in range(len(faces)) for l in range(self.LAYERS)] if column_by_column else \
            [(l, f) for l in range(self.LAYERS) for f in range(len(faces))]
        kinds = {3: vtk.VTK_WEDGE, 4: vtk.VTK_HEXAHEDRON, 5: vtk.VTK_PENTAGONAL_PRISM, 6: vtk.VTK_HEXAGONAL_PRISM}
        for layer, face in order:
            ids = [int(number(level, node)) for level in (layer, layer + 1) for node in faces[face]]
            grid.InsertNextCell(kinds[len(faces[face])], len(ids), ids)
        of = vtk.vtkPoints()
        of.SetData(numpy_to_vtk(points, deep=True))
        grid.SetPoints(of)
        array = numpy_to_vtk(np.array([self.t[l, f] for l, f in order]), deep=True)
        array.SetName("c")
        grid.GetCellData().AddArray(array)
        return grid

    def expect_columns(self, paths, grid, name="t"):
        """Positions are computed by two programs: the caches agree in what `info` says and in volume, to rounding."""
        vtu = self.folder / "expected.vtu"
        write_xml(grid, vtu)
        found, expected = self.info(*paths), self.info(vtu)
        self.assertEqual(found["cells"], expected["cells"])
        self.assertEqual(found["nodes"], expected["nodes"])
        for end in ("lower", "upper"):
            np.testing.assert_allclose(found["bounds"][end], expected["bounds"][end], rtol=1e-9, atol=1e-9)
        scalar = next(s for s in found["scalars"] if s["name"] == name)
        self.assertAlmostEqual(scalar["min"], float(self.t.min()), places=6)
        self.assertAlmostEqual(scalar["max"], float(self.t.max()), places=6)
        volumes = [self.volume(paths, name), self.volume([vtu], "c")]
        self.assertAlmostEqual(volumes[0] / volumes[1], 1, delta=1e-5)
        drawn = []
        for words, scalar in ((paths, name), ([vtu], "c")):
            cache = self.folder / "b.splats"
            self.run_program("convert", *words, "-o", cache, "--scalar", scalar, "--overwrite")
            result = self.run_program("render", cache, "-o", self.folder / "b.pfm", "--size", "64x64", "--range", "0,1")
            self.assertEqual(result.returncode, 0, result.stderr)
            drawn.append(np.frombuffer((self.folder / "b.pfm").read_bytes().split(b"\n", 3)[3], "<f4"))
        np.testing.assert_allclose(*drawn, atol=1e-3, rtol=0)

    def write_ugrid(self, form="NETCDF4", start=0, column_by_column=False, unit="m", at_nodes=False):
        with netCDF4.Dataset(self.path, "w", format=form) as f:
            f.Conventions = "CF-1.8 UGRID-1.0"
            for name, size in (("time", None), ("layer", self.LAYERS), ("two", 2), ("face", len(self.faces)), ("node", len(self.nodes)),
                               ("corner", 4)):
                f.createDimension(name, size)
            mesh = f.createVariable("mesh", "i4")
            mesh.cf_role, mesh.topology_dimension = "mesh_topology", np.int32(2)
            mesh.node_coordinates, mesh.face_node_connectivity = "lon lat", "corners"
            for name, axis in (("lon", 0), ("lat", 1)):
                v = f.createVariable(name, "f8", ("node",))
                v.units = "degrees_east" if axis == 0 else "degrees_north"
                v.standard_name = "longitude" if axis == 0 else "latitude"
                v[:] = self.nodes[:, axis]
            corners = f.createVariable("corners", "i4", ("face", "corner"), fill_value=-999)
            corners.start_index = np.int32(start)
            corners[:] = [[n + start for n in face] + [-999] * (4 - len(face)) for face in self.faces]
            layer = f.createVariable("layer", "f8", ("layer",))
            layer.units, layer.positive, layer.bounds = unit, "up", "bounds"
            layer[:] = (self.levels[1:] + self.levels[:-1]) / 2
            f.createVariable("bounds", "f8", ("layer", "two"))[:] = np.stack([self.levels[:-1], self.levels[1:]], 1)
            time = f.createVariable("time", "f8", ("time",))
            time.units = "days since 2000-01-01"
            time[:] = [1, 2]
            where = "node" if at_nodes else "face"
            dims = ("time", where, "layer") if column_by_column else ("time", "layer", where)
            t = f.createVariable("t", "f4", dims)
            t.mesh, t.location, t.units = "mesh", where, "K"
            values = self.t if not at_nodes else np.arange(self.LAYERS * len(self.nodes), dtype="f4").reshape(self.LAYERS, -1)
            t[0], t[1] = (values.T, values.T + 1) if column_by_column else (values, values + 1)

    def test_ugrid(self):
        for form, start, column_by_column in (("NETCDF4", 0, False), ("NETCDF3_CLASSIC", 1, False), ("NETCDF4", 1, True)):
            with self.subTest(form=form, start=start, column_by_column=column_by_column):
                self.write_ugrid(form, start, column_by_column)
                self.expect_columns([self.path], self.expected(column_by_column))
        info = self.info(self.path)
        self.assertEqual(info["cells"]["count"], self.LAYERS * len(self.faces))
        self.assertEqual(len(info["times"]), 2)
        for step in range(2):
            scalar = self.info(self.path, "--time-step", step)["scalars"][0]
            self.assertAlmostEqual(scalar["max"], float(self.t.max()) + step, places=6)

    def test_ugrid_at_nodes(self):
        self.write_ugrid(at_nodes=True)
        info = self.info(self.path)
        self.assertEqual(info["nodes"], self.LAYERS * len(self.nodes))
        self.assertEqual(info["cells"]["count"], (self.LAYERS - 1) * len(self.faces))
        self.assertEqual(info["scalars"][0]["max"], self.LAYERS * len(self.nodes) - 1)
        self.assertGreater(self.volume([self.path], "t"), 0)

    def test_ugrid_with_heights_at_its_nodes(self):
        """SCHISM: zCoordinates(time, node, layer); NCAR's mesh_depth(layer, node) grows downwards."""
        bottom = 20 + 30 * RANDOM.random(4)
        heights = -bottom[:, None] * np.array([1.0, 0.6, 0.3, 0])  # [node, level]
        for name, order, values in (("zCoordinates", "time node layer", heights[None]), ("mesh_depth", "layer node", -heights.T)):
            with netCDF4.Dataset(self.path, "w") as f:
                for dim, size in (("node", 4), ("face", 1), ("corner", 4), ("layer", 4), ("time", 1)):
                    f.createDimension(dim, size)
                mesh = f.createVariable("mesh", "i4")
                mesh.setncatts({"cf_role": "mesh_topology", "topology_dimension": np.int32(2), "node_coordinates": "x y", "face_node_connectivity": "corners",
                                "face_coordinates": "fx fy"})
                def add(called, dims, what, kind="f8", **attributes):
                    v = f.createVariable(called, kind, tuple(dims.split()))
                    v.setncatts(attributes)
                    v[:] = what
                add("x", "node", [0, 1000, 1000, 0], units="m", standard_name="projection_x_coordinate")
                add("y", "node", [0, 0, 1000, 1000], units="m", standard_name="projection_y_coordinate")
                add("corners", "face corner", [[1, 2, 3, 4]], "i4", start_index=np.int32(1))
                add("fx_bnd", "face corner", [[0, 1000, 1000, 0]], units="m", mesh="mesh", location="face")
                add("fx", "face", [500], units="m", bounds="fx_bnd", mesh="mesh", location="face")
                add(name, order, values, units="m", mesh="mesh", location="node")
                add("S", order, np.broadcast_to(np.arange(4.0), heights.shape)[None] if order.startswith("time") else np.arange(4.0)[:, None] + np.zeros((4, 4)), "f4",
                    mesh="mesh", location="node")
            info = self.info(self.path)
            self.assertEqual([s["name"] for s in info["scalars"]], ["S"])
            np.testing.assert_allclose(info["bounds"]["lower"], [0, 0, heights.min() / 1000], atol=1e-9)
            np.testing.assert_allclose(info["bounds"]["upper"], [1, 1, 0], atol=1e-9)
            self.assertAlmostEqual(self.volume([self.path], "S"), bottom.mean() / 1000, delta=1e-4)

    def test_ugrid_of_which_only_fields_tell_the_faces(self):
        """GNOME: connectivity (corner, face) without face_dimension; face_links are no field, whatever their dimensions."""
        self.write_ugrid()
        expected = self.info(self.path)
        other = self.folder / "b.nc"
        with netCDF4.Dataset(self.path) as f, netCDF4.Dataset(other, "w") as to:
            for name, dim in f.dimensions.items():
                to.createDimension(name, None if dim.isunlimited() else len(dim))
            for name, v in f.variables.items():
                v.set_auto_mask(False)
                turned = v.dimensions[::-1] if name == "corners" else v.dimensions
                copy = to.createVariable(name, v.dtype, turned, fill_value=getattr(v, "_FillValue", None))
                copy.setncatts({a: v.getncattr(a) for a in v.ncattrs() if a not in ("_FillValue", "face_dimension")})
                if v.shape:
                    copy[:] = v[:].T if name == "corners" else v[:]
            links = to.createVariable("links", "i4", ("layer", "face"))
            links.cf_role = "face_face_connectivity"
            links[:] = 0
        info = self.info(other)
        self.assertEqual([s["name"] for s in info["scalars"]], ["t"])
        for key in ("cells", "nodes", "bounds"):
            self.assertEqual(info[key], expected[key])

    def test_fesom_ends_at_its_bottom(self):
        """FESOM: data at layers nz1 between levels nz, 0 below nlevels and nlevels_nod2D, which count levels; two triangles."""
        levels, numbers, of_nodes = np.array([0, 5, 10, 30, 100.0]), np.array([5, 3]), np.array([5, 5, 4, 3])
        faces = np.array([[0, 1, 2], [0, 2, 3]])
        below = np.arange(4)[:, None] >= numbers - 1, np.arange(4)[:, None] >= of_nodes - 1
        mesh = self.folder / "fesom.mesh.diag.nc"
        with netCDF4.Dataset(self.path, "w") as data, netCDF4.Dataset(mesh, "w") as f:
            for file in (data, f):
                for dim, size in (("nod2", 4), ("elem", 2), ("nz1", 4), ("nz", 5), ("n3", 3), ("time", None)):
                    file.createDimension(dim, size)
            def add(file, called, dims, what, kind="f8", **attributes):
                v = file.createVariable(called, kind, tuple(dims.split()))
                v.setncatts(attributes)
                v[:] = what
            add(data, "nz1", "nz1", (levels[1:] + levels[:-1]) / 2, units="m", positive="down", axis="Z", long_name="depth at layer midpoint")
            add(data, "time", "time", [0], units="seconds since 1948-01-01 0:0:0", standard_name="time", axis="T")
            add(data, "u", "time nz1 elem", np.where(below[0], 0, 7)[None], location="elem", mesh="fesom_mesh")
            add(data, "temp", "time nz1 nod2", np.where(below[1], 0, 9)[None], location="node", mesh="fesom_mesh")
            f.createVariable("fesom_mesh", "i4").setncatts({"cf_role": "mesh_topology", "topology_dimension": np.int32(2), "node_coordinates": "lon lat",
                                                            "face_node_connectivity": "face_nodes", "face_dimension": "elem"})
            add(f, "nz", "nz", levels, units="meters", positive="down", long_name="depth of levels")
            add(f, "nlevels", "elem", numbers, "i4", long_name="number of levels below elements")
            add(f, "nlevels_nod2D", "nod2", of_nodes, "i4", long_name="number of levels below nodes")
            add(f, "lon", "nod2", [0, 1, 1, 0], units="degrees_east", standard_name="longitude")
            add(f, "lat", "nod2", [-0.5, -0.5, 0.5, 0.5], units="degrees_north", standard_name="latitude")
            add(f, "face_nodes", "n3 elem", faces.T + 1, "i4", start_index=np.int32(1))
        self.assertEqual([self.info(self.path, mesh)["scalars"][0][word] for word in ("name", "min", "max")], ["u", 7, 7])
        area = 6371 ** 2 * np.radians(1) * 2 * np.sin(np.radians(0.5)) / 2  # of a triangle, to a permille
        self.assertAlmostEqual(self.volume([self.path, mesh], "u") / (area * (100 + 10) / 1000), 1, delta=2e-3)
        manifest = self.manifest(self.convert([self.path, mesh], "temp", "--vertical-scale", "100", "--refine", "1"))
        # 16 points, of which 3 are below the bottom and 2 in no cell above it.
        self.assertEqual((manifest["splats"], manifest["blanked_nodes"], manifest["variables"][0]["min"]), (11, 3, 9))

    def test_ugrid_beside_a_structured_grid(self):
        self.write_ugrid()
        values = RANDOM.random((3, 4, 5)).astype("f4")
        with netCDF4.Dataset(self.path, "a") as f:
            for name, size, unit in (("height", 3, "m"), ("latitude", 4, "degrees_north"), ("longitude", 5, "degrees_east")):
                f.createDimension(name, size)
                v = f.createVariable(name, "f8", (name,))
                v.units = unit
                v[:] = np.arange(size) * 10.0
            f["height"].standard_name = "height"
            f.createVariable("salt", "f4", ("height", "latitude", "longitude"))[:] = values
        info = self.info(self.path)
        self.assertIn("left out: salt, on a structured grid; choose it with --scalar salt", info["warnings"])
        self.assertEqual(info["cells"]["count"], self.LAYERS * len(self.faces))
        manifest = self.manifest(self.convert([self.path], "salt", "--refine", "1"))
        self.assertEqual([[b["ni"], b["nj"], b["nk"]] for b in manifest["blocks"]], [[5, 4, 3]])
        self.assertAlmostEqual(manifest["variables"][0]["max"], float(values.max()), places=6)

    def write_icon(self, cells="cell"):
        """`cells`: the data's name of the cells. Returns the triangles, and their heights at the levels in metres. The grid is in a second file, icon_grid.nc."""
        triangles = [t for face in self.faces for t in ([face] if len(face) == 3 else [face[:3], [face[k] for k in (0, 2, 3)]])]
        self.t = RANDOM.random((self.LAYERS, len(triangles))).astype("f4")
        heights = RANDOM.random(len(triangles))[None] * 50 + self.levels[::-1, None]
        with netCDF4.Dataset(self.folder / "icon_grid.nc", "w") as f:
            for name, size in (("cell", len(triangles)), ("vertex", len(self.nodes)), ("nv", 3)):
                f.createDimension(name, size)
            for name, axis in (("vlon", 0), ("vlat", 1)):
                v = f.createVariable(name, "f8", ("vertex",))
                v.units = "radian"
                v[:] = np.radians(self.nodes[:, axis])
            f.createVariable("vertex_of_cell", "i4", ("nv", "cell"))[:] = np.array(triangles).T + 1
        with netCDF4.Dataset(self.path, "w") as f:
            f.number_of_grid_used = 24
            for name, size in (("time", None), ("height", self.LAYERS), ("height_2", self.LAYERS + 1), (cells, len(triangles))):
                f.createDimension(name, size)
            f.createVariable("time", "f8", ("time",))[:] = [0]
            f.createVariable("t", "f4", ("time", "height", cells))[0] = self.t
            z = f.createVariable("z_ifc", "f8", ("height_2", cells))
            z.units = "m"
            z[:] = heights
        return triangles, heights

    def test_icon_with_its_grid_in_a_second_file(self):
        for cells in ("cell", "ncells"):  # ICON itself writes data with the second
            triangles, heights = self.write_icon(cells)
            of_nodes = np.array([[np.mean([heights[l, n] for n, face in enumerate(triangles) if node in face])
                                  for node in range(len(self.nodes))] for l in range(self.LAYERS + 1)]) / 1000
            self.expect_columns([self.path, self.folder / "icon_grid.nc"], self.expected(heights=of_nodes, faces=triangles))
        self.expect_line(self.path, scalar="t", words="ICON")
        # Without heights, their absence is reported, not that of a field: the grid file has variables of cells and their corners.
        with netCDF4.Dataset(self.path) as f, netCDF4.Dataset(self.folder / "b.nc", "w") as to:
            for name, dim in f.dimensions.items():
                to.createDimension(name, len(dim))
            for name in ("t", "u"):
                to.createVariable(name, "f4", ("time", "height", "ncells"))[:] = f["t"][:]
        with netCDF4.Dataset(self.folder / "icon_grid.nc", "a") as f:
            f.createVariable("edge_of_cell", "i4", ("nv", "cell"))[:] = 1
        self.expect_line(self.folder / "b.nc", self.folder / "icon_grid.nc", scalar="t", words="the layers of ICON (height) have no heights")

    def write_mpas(self, nodes, faces, heights, ocean):
        """`heights`: [level][face], in metres."""
        count, most = len(faces), 7
        with netCDF4.Dataset(self.path, "w", format="NETCDF3_64BIT_OFFSET") as f:
            for name, size in (("Time", None), ("nCells", count), ("nVertices", len(nodes)), ("maxEdges", most),
                               ("nVertLevels", self.LAYERS), ("nVertLevelsP1", self.LAYERS + 1)):
                f.createDimension(name, size)
            f.on_a_sphere = "YES             "
            for name, axis in (("lonVertex", 0), ("latVertex", 1)):
                f.createVariable(name, "f8", ("nVertices",))[:] = np.radians(nodes[:, axis])
            f.createVariable("verticesOnCell", "i4", ("nCells", "maxEdges"))[:] = \
                [[n + 1 for n in face] + [0] * (most - len(face)) for face in faces]
            f.createVariable("nEdgesOnCell", "i4", ("nCells",))[:] = [len(face) for face in faces]
            if ocean:
                depth = f.createVariable("refBottomDepth", "f8", ("nVertLevels",))
                depth.units = "m"
                depth[:] = self.levels[1:]
                f.createVariable("maxLevelCell", "i4", ("nCells",))[:] = [self.LAYERS] + [1] * (count - 1)
            else:
                z = f.createVariable("zgrid", "f8", ("nCells", "nVertLevelsP1"))
                z.units = "m"
                z[:] = heights.T
            f.createVariable("t", "f4", ("Time", "nCells", "nVertLevels"))[0] = self.t.T

    def test_mpas(self):
        # Two hexagons and two triangles between them.
        nodes = np.array([[np.cos(a) + dx, np.sin(a)] for dx in (0, np.sqrt(3)) for a in np.pi / 6 + np.arange(6) * np.pi / 3])
        nodes, first = np.unique(nodes.round(9), axis=0, return_inverse=True)
        faces = [list(map(int, first[:6])), list(map(int, first[6:]))]
        self.t = RANDOM.random((self.LAYERS, 2)).astype("f4")
        heights = np.stack([self.levels, self.levels + 30], 1)
        for ocean in (False, True):
            self.write_mpas(nodes, faces, heights, ocean)
            if ocean:
                info = self.info(self.path)
                self.assertEqual(info["cells"]["count"], 2 * self.LAYERS)
                whole = self.expected(True, faces=faces, nodes=nodes, heights=-np.repeat(self.levels[:, None] / 1000, len(nodes), 1))
                write_xml(whole, self.folder / "whole.vtu")
                share = self.volume([self.path], "t") / self.volume([self.folder / "whole.vtu"], "c")
                self.assertAlmostEqual(share, (600 + 100) / 1200, delta=2e-3)  # the hidden ones are not counted
                continue
            of_nodes = np.array([[np.mean([heights[l, n] for n, face in enumerate(faces) if node in face])
                                  for node in range(len(nodes))] for l in range(self.LAYERS + 1)]) / 1000
            self.expect_columns([self.path], self.expected(True, of_nodes, faces=faces, nodes=nodes))

    def test_damage(self):
        for form in ("NETCDF3_CLASSIC", "NETCDF4"):
            self.write_ugrid(form)
            self.assertGreater(self.expect_harmless(self.path, 20, "t"), 1 / 6)
        self.write_ugrid()
        with netCDF4.Dataset(self.path, "r+") as f:
            f["corners"][3, 1] = 99
        self.expect_line(self.path, scalar="t", words="face 3 has the node 99")
        self.write_ugrid(unit="1")
        self.expect_line(self.path, scalar="t", words="have no heights")


if __name__ == "__main__":
    unittest.main()
