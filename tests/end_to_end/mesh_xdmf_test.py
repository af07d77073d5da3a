#!/usr/bin/python3
"""mesh_xdmf_test.py CURVISPLAT

XDMF's unstructured grids, by h5py, in binary files and in the XML, and as meshio writes them: mesh_formats.py says how. Exit status
77 (skipped) without python3-vtk9 or python3-h5py.
"""
import os
import sys
import unittest

from mesh_formats import HEXAHEDRON_FACES, Mesh, MeshFormats, np, numpy_to_vtk, vtk, write_xml

try:
    import h5py
except ModuleNotFoundError as error:
    print(f"skipped: {error}; install python3-h5py")
    sys.exit(77)
try:
    import meshio
except ModuleNotFoundError:
    meshio = None

TYPES = {4: ("Tetrahedron", 6), 5: ("Pyramid", 7), 6: ("Wedge", 8), 8: ("Hexahedron", 9)}


class XdmfMeshes(MeshFormats):
    def setUp(self):
        super().setUp()
        self.path, self.count = self.folder / "a.xmf", 0

    def item(self, values, kind="HDF"):
        values = np.asarray(values)
        number = {"f": "Float", "i": "Int"}[values.dtype.kind]
        head = f'<DataItem Dimensions="{" ".join(map(str, values.shape))}" NumberType="{number}" Precision="8" Format="{kind}"'
        if kind == "XML":
            return head + ">" + " ".join(map(repr, values.ravel().tolist())) + "</DataItem>"
        with h5py.File(self.folder / "a.h5", "a") as f:
            self.count += 1
            f[str(self.count)] = values
        return f"{head}>a.h5:/{self.count}</DataItem>"

    def grid(self, mesh, topology, kind="HDF", separate=False):
        """`topology`: the name, the number of elements and the numbers."""
        name, elements, numbers = topology
        places = "".join(self.item(axis.copy(), kind) for axis in mesh.points.T) if separate else self.item(mesh.points, kind)
        fields = "".join(f'<Attribute Name="{n}" Center="{c}">{self.item(v, kind)}</Attribute>' for n, c, v in (("p", "Node", mesh.p), ("c", "Cell", mesh.c)))
        return (f'<Grid><Topology TopologyType="{name}" NumberOfElements="{elements}">{self.item(numbers, kind)}</Topology>'
                f'<Geometry GeometryType="{"X_Y_Z" if separate else "XYZ"}">{places}</Geometry>{fields}</Grid>')

    def write(self, text):
        self.path.write_text(f'<Xdmf Version="3.0"><Domain>{text}</Domain></Xdmf>')
        return self.path

    def mixed(self, mesh, faces=False):
        numbers = []
        for cell in mesh.cells:
            of_cell = [16, 6, *(w for face in HEXAHEDRON_FACES for w in (4, *cell[list(face)]))] if faces else [TYPES[len(cell)][1], *cell]
            numbers += map(int, of_cell)
        return "Mixed", len(mesh.cells), np.array(numbers)

    def test_mixed_cells(self):
        mesh = Mesh()
        for kind, separate in (("HDF", True), ("XML", False)):
            self.expect_same([self.write(self.grid(mesh, self.mixed(mesh), kind, separate))], mesh.vtk())
        # Vertices, lines and polygons have no volume.
        name, elements, numbers = self.mixed(mesh)
        more = np.array([1, 2, 5, 6, 2, 3, 7, 8, 9, 3, 4, 0, 1, 2, 3, 4, 0, 1, 2])
        mesh.c = np.concatenate([[0.1, 0.2, 0.3, 0.4], mesh.c])
        text = self.grid(mesh, (name, elements + 4, np.concatenate([more, numbers])))
        self.assertAlmostEqual(self.volume([self.write(text)], "c"), 1, delta=2e-3)

    def test_cells_of_one_kind(self):
        for kind in TYPES:
            mesh = Mesh(2, (kind,))
            text = self.grid(mesh, (TYPES[kind][0], len(mesh.cells), np.array(mesh.cells)))
            self.expect_same([self.write(text)], mesh.vtk())

    def test_polyhedra(self):
        mesh = Mesh(3, (8,))
        faces = [[cell[list(face)] for face in HEXAHEDRON_FACES] for cell in mesh.cells]
        self.expect_same([self.write(self.grid(mesh, self.mixed(mesh, faces=True)))], mesh.vtk(faces))

    def test_numbers_of_points_from_one(self):
        """BaseOffset, as Badlands and LifeV write it; of a polyhedron the counts stay."""
        mesh = Mesh(2)
        for faces in (False, True):
            name, elements, numbers = self.mixed(mesh) if not faces else self.mixed(mesh := Mesh(2, (8,)), faces=True)
            shifted, at = numbers.copy(), 0
            for cell in mesh.cells:
                if faces:
                    at += 2
                    for _ in range(6):
                        shifted[at + 1:at + 5] += 1
                        at += 5
                else:
                    shifted[at + 1:at + 1 + len(cell)] += 1
                    at += 1 + len(cell)
            text = self.grid(mesh, (name, elements, shifted)).replace("<Topology ", '<Topology BaseOffset="1" ')
            self.expect_same([self.write(text)], mesh.vtk([[cell[list(face)] for face in HEXAHEDRON_FACES] for cell in mesh.cells] if faces else None))
        mesh = Mesh(2, (8,))
        text = self.grid(mesh, ("Hexahedron", 8, np.array(mesh.cells) + 1)).replace("<Topology ", '<Topology BaseOffset="1" Order="0 1 2 3 4 5 6 7" ')
        self.expect_same([self.write(text)], mesh.vtk())
        self.expect_line(self.write(text.replace("6 7", "7 6")), words="in the Order 0 1 2 3 4 5 7 6, which is not read")
        self.expect_line(self.write(text.replace('BaseOffset="1"', 'BaseOffset="2"')), words="refers to point")

    def test_several_grids_and_times(self):
        meshes = [Mesh(2), Mesh(3)]
        grids = [self.grid(mesh, self.mixed(mesh)).replace("<Grid>", f'<Grid><Time Value="{n}"/>') for n, mesh in enumerate(meshes)]
        self.write(f'<Grid GridType="Collection" CollectionType="Temporal">{"".join(grids)}</Grid>')
        self.assertEqual(self.info(self.path)["times"], [0, 1])
        for n, mesh in enumerate(meshes):
            self.expect_same([self.path], mesh.vtk(), options=["--time-step", n])
        self.write("".join(self.grid(mesh, self.mixed(mesh)) for mesh in meshes))
        self.assertEqual(len(self.info(self.path)["pieces"]), 2)

    @unittest.skipUnless(meshio, "no meshio")
    def test_meshio_agrees(self):
        mesh = Mesh(2, (8, 4))
        path = self.folder / "m.xdmf"
        names = {4: "tetra", 8: "hexahedron"}
        runs = [(names[run.shape[1]], run) for run in mesh.runs()]
        ends = np.cumsum([0] + [len(run) for _, run in runs])
        meshio.write(path, meshio.Mesh(mesh.points, runs, {"p": mesh.p}, {"c": [mesh.c[a:b] for a, b in zip(ends, ends[1:])]}))
        self.expect_same([path], mesh.vtk())

    def included(self, mesh, head, prefix, pointer):
        """A mesh as a grid of its own, which both of its steps include; at the second one p is twice as large."""
        name, elements, numbers = self.mixed(mesh)
        parts = (f'<Topology TopologyType="{name}" NumberOfElements="{elements}">{self.item(numbers)}</Topology>'
                 f'<Geometry GeometryType="XYZ">{self.item(mesh.points)}</Geometry>')
        steps = "".join(f'''<Grid Name="u" GridType="Uniform">
          <{prefix}:include xpointer="{pointer}" />
          <Time Value="{n}" />
          <Attribute Name="p" AttributeType="Scalar" Center="Node">{self.item(mesh.p * (n + 1))}</Attribute></Grid>''' for n in range(2))
        grids = [f'<Grid Name="mesh" GridType="Uniform">{parts}</Grid>',
                 f'<Grid Name="u" GridType="Collection" CollectionType="Temporal">{steps}</Grid>']
        self.path.write_text(f'<?xml version="1.0"?>\n<!DOCTYPE Xdmf SYSTEM "Xdmf.dtd" []>\n<Xdmf {head}>\n<Domain>'
                             f'{"".join(grids if prefix == "xi" else reversed(grids))}</Domain></Xdmf>')
        return self.path

    def test_meshes_that_steps_include(self):
        """As dolfinx writes functions, as legacy FEniCS does, and as meshio's TimeSeriesWriter does with its odd prefix."""
        mesh = Mesh(2)
        parts = "*[self::Topology or self::Geometry]"
        for head, prefix, pointer in (
                ('Version="3.0" xmlns:xi="https://www.w3.org/2001/XInclude"', "xi", f"xpointer(/Xdmf/Domain/Grid[@GridType='Uniform'][1]/{parts})"),
                ('Version="3.0" xmlns:xi="http://www.w3.org/2001/XInclude"', "xi", f"xpointer(/Xdmf/Domain/Grid[@Name=&quot;mesh&quot;]/{parts})"),
                ('xmlns:ns0="http://www.w3.org/2003/XInclude" Version="3.0"', "ns0", f"xpointer(//Grid[@Name=&quot;mesh&quot;]/{parts})")):
            self.included(mesh, head, prefix, pointer)
            info = self.info(self.path)
            self.assertEqual((info["times"], len(info["pieces"]), info["cells"]["count"]), ([0, 1], 1, len(mesh.cells)))
            self.expect_same([self.path], mesh.vtk(), {"c": None})
            self.assertAlmostEqual(self.info(self.path, "--time-step", 1)["scalars"][0]["max"], 2 * mesh.p.max(), places=5)
        for pointer, told in (("xpointer(/Xdmf/Domain/Grid[@Name='fish']/Topology)", "does not have"), ("element(/1/1)", "is not read"),
                              ("xpointer(count(//*))", "is not read"), ("xpointer(//Grid[@Name='mesh']/Topology[", "includes xpointer")):
            self.expect_line(self.included(mesh, 'Version="3.0"', "xi", pointer), words=told)

    def test_blocks_whose_points_are_included(self):
        """They are two, although their texts are alike."""
        mesh = Mesh(2)
        whole = self.grid(mesh, self.mixed(mesh))
        items = [f'<DataItem Name="{name}" Dimensions="{len(points)} 3">{" ".join(map(str, points.ravel()))}</DataItem>'
                 for name, points in (("a", mesh.points), ("b", mesh.points + [9, 0, 0]))]
        start = whole.index("<Geometry")
        grids = [whole[:start] + f"""<Geometry GeometryType="XYZ"><xi:include xpointer="xpointer(/Xdmf/Domain/DataItem[@Name='{name}'])"/>"""
                 + whole[whole.index("</Geometry>"):] for name in "ab"]
        self.assertEqual(self.info(self.write("".join(items + grids)))["cells"]["count"], 2 * len(mesh.cells))

    def test_functions_and_steps_of_one_mesh(self):
        """dolfinx writes each function as a collection of its own, whose steps include one mesh; other programs repeat it, or a step."""
        mesh = Mesh(2)
        whole = self.grid(mesh, self.mixed(mesh))
        head, attributes = whole[6:].split("<Attribute", 1)[0], {n: "<Attribute" + a for n, a in zip("pc", whole[:-7].split("<Attribute")[1:])}
        include = """<xi:include xpointer="xpointer(/Xdmf/Domain/Grid[@Name='mesh']/*[self::Topology or self::Geometry])"/>"""

        def steps(name, parts):
            return (f'<Grid Name="{name}" GridType="Collection" CollectionType="Temporal">'
                    + "".join(f'<Grid><Time Value="{n}"/>{parts}{attributes[name]}</Grid>' for n in (0, 0.5)) + "</Grid>")

        for text in (f'<Grid Name="mesh">{head}</Grid>{steps("p", include)}{steps("c", include)}', steps("p", head) + steps("c", head)):
            info = self.info(self.write(text))
            self.assertEqual((info["times"], info["cells"]["count"], info["warnings"]), ([0, 0.5], len(mesh.cells), []))
            self.expect_same([self.path], mesh.vtk())
        # The second time was written by a run that ended, and again by the one that went on from the step before.
        again = self.item(mesh.p + 1)
        text = steps("p", head)[:-7] + f'<Grid><Time Value="0.5"/>{head}<Attribute Name="p" Center="Node">{again}</Attribute></Grid></Grid>'
        info = self.info(self.write(text), "--time-step", 1)
        self.assertEqual((info["cells"]["count"], info["times"]), (len(mesh.cells), [0, 0.5]))
        self.assertEqual(info["warnings"], ["several grids of one mesh have the attribute p at time 0.5; the last one is read"])
        self.assertAlmostEqual(info["scalars"][0]["max"], mesh.p.max() + 1, places=5)

    @unittest.skipUnless(meshio, "no meshio")
    def test_series_by_meshio(self):
        mesh = Mesh(2, (8,))
        path = self.folder / "m.xdmf"
        os.chdir(self.folder)
        with meshio.xdmf.TimeSeriesWriter("m.xdmf") as writer:
            writer.write_points_cells(mesh.points, [("hexahedron", np.array(mesh.cells))])
            for time in (0.0, 0.5):
                writer.write_data(time, point_data={"p": mesh.p}, cell_data={"c": [mesh.c]})
        self.assertEqual(self.info(path)["times"], [0, 0.5])
        self.expect_same([path], mesh.vtk())

    def test_quadratic_cells(self):
        points = np.array(vtk.vtkGenericCell.InstantiateCell(vtk.VTK_QUADRATIC_HEXAHEDRON).GetParametricCoords()[:60]).reshape(-1, 3)
        mesh = Mesh(1, (8,))
        mesh.points, mesh.p = points, points[:, 0].copy()
        info = self.info(self.write(self.grid(mesh, ("Hexahedron_20", 1, np.arange(20)[None]))))
        self.assertEqual(info["cells"]["count"], 9)

    def function(self, name, degree, family, per_cell, kind="Scalar"):
        """A function as FEniCS's write_checkpoint writes it. per_cell: [cell, component, degree of freedom]; equal values of a continuous
        function are stored once."""
        values, numbers = np.unique(per_cell.ravel(), return_inverse=True) if family == "CG" else (per_cell.ravel(), np.arange(per_cell.size))
        order = self.RANDOM.permutation(len(values))  # where each value is stored
        stored = np.empty(len(values))
        stored[order] = values
        cells = len(per_cell)
        items = (order[numbers].reshape(-1, 1), stored.reshape(-1, 1), np.arange(cells + 1).reshape(-1, 1) * per_cell[0].size, np.arange(cells).reshape(-1, 1))
        return (f'<Attribute ItemType="FiniteElementFunction" ElementFamily="{family}" ElementDegree="{degree}" ElementCell="tetrahedron" Name="{name}" '
                f'Center="Other" AttributeType="{kind}">{"".join(map(self.item, items))}</Attribute>')

    def apart(self, mesh, points, values, kind):
        """VTK's grid of cells with points of their own."""
        grid = vtk.vtkUnstructuredGrid()
        grid.Allocate(1)
        each = points.shape[1]
        for n in range(len(points)):
            grid.InsertNextCell(kind, each, list(range(n * each, (n + 1) * each)))
        at = vtk.vtkPoints()
        at.SetData(numpy_to_vtk(points.reshape(-1, 3), deep=True))
        grid.SetPoints(at)
        for data, name, array in ((grid.GetPointData(), "p", values.ravel()), (grid.GetCellData(), "c", mesh.c)):
            array = numpy_to_vtk(array, deep=True)
            array.SetName(name)
            data.AddArray(array)
        return grid

    # The edges as VTK has them, and where UFC, by which FEniCS numbers, has the degrees of freedom of a cell's ten points.
    EDGES = ((0, 1), (1, 2), (2, 0), (0, 3), (1, 3), (2, 3))
    UFC = [0, 1, 2, 3, 9, 6, 8, 7, 5, 4]

    def ten_points(self, mesh):
        """Of each cell its corners and the middles of its edges."""
        corners = mesh.points[np.array(mesh.cells)]
        return np.concatenate([corners, np.stack([(corners[:, a] + corners[:, b]) / 2 for a, b in self.EDGES], 1)], 1)

    def by_ufc(self, values):
        degrees = np.empty_like(values)
        degrees[:, self.UFC] = values
        return degrees[:, None, :]

    def tetrahedra(self, n=3):
        mesh = Mesh(n, (4,))
        cells = np.array(mesh.cells)
        grid = self.grid(mesh, ("Tetrahedron", len(cells), cells))
        return mesh, cells, grid[:grid.index("<Attribute")]

    def test_functions_of_finite_elements(self):
        mesh, cells, bare = self.tetrahedra()
        self.assertEqual(cells.shape[1], 4)
        at_corners = mesh.p[cells][:, None, :]
        functions = self.function("p", 1, "CG", at_corners) + self.function("c", 0, "DG", mesh.c[:, None, None])
        self.expect_same([self.write(bare + functions + "</Grid>")], mesh.vtk())
        vector = self.RANDOM.random((len(mesh.points), 3))
        self.write(bare + self.function("v", 1, "CG", vector[cells].swapaxes(1, 2), "Vector") + "</Grid>")
        info = {scalar["name"]: scalar for scalar in self.info(self.path)["scalars"]}
        for axis, name in enumerate("xyz"):
            self.assertEqual(info[f"v:{name}"]["max"], np.float32(vector[:, axis].max()))
        # Values of the cells' own, which jump.
        jumps = self.RANDOM.random((len(cells), 1, 4))
        functions = self.function("p", 1, "DG", jumps) + self.function("c", 0, "DG", mesh.c[:, None, None])
        self.expect_same([self.write(bare + functions + "</Grid>")], self.apart(mesh, mesh.points[cells], jumps, vtk.VTK_TETRA))
        for family, degree in (("RT", 1), ("CG", 3)):
            info = self.info(self.write(bare + self.function("q", degree, family, at_corners) + "</Grid>"))
            self.assertIn(f"attribute q is a function of finite elements ({family} of degree {degree})", info["warnings"][0])
        self.expect_line(self.write(bare + self.function("q", 2, "CG", at_corners) + "</Grid>"), words="expected 10 in each")
        text = bare + self.function("p", 1, "CG", at_corners) + "</Grid>"
        with h5py.File(self.folder / "a.h5", "a") as f:
            f[str(self.count - 3)][5] = 10**6
        self.expect_line(self.write(text), scalar="p", words="has the degree of freedom 1000000")

    def test_functions_of_second_degree(self):
        """Cells are cut into eight, with values at the middles of their edges; functions of lower degree have theirs there, too."""
        mesh, cells, bare = self.tetrahedra()
        ten = self.ten_points(mesh)
        rest = self.function("c", 0, "DG", mesh.c[:, None, None]) + self.function("r", 1, "CG", mesh.p[cells][:, None, :])
        for family, values in (("CG", (ten**2).sum(2) - ten[:, :, 0] * ten[:, :, 1]), ("DG", self.RANDOM.random(ten.shape[:2]))):
            with self.subTest(family=family):
                path = self.write(bare + self.function("p", 2, family, self.by_ufc(values)) + rest + "</Grid>")
                self.expect_same([path], self.apart(mesh, ten, values, vtk.VTK_QUADRATIC_TETRA))
                info = self.info(path)
                self.assertEqual((info["cells"]["count"], info["nodes"]), (8 * len(cells), 10 * len(cells)))
        linear = mesh.points @ (1, 2, 3)
        at_nodes = f'<Attribute Name="n" Center="Node">{self.item(linear)}</Attribute>'
        self.write(bare + self.function("p", 2, "CG", self.by_ufc(ten @ (1.0, 2.0, 3.0))) + at_nodes + "</Grid>")
        self.assertEqual(self.cache([self.path], "p"), self.cache([self.path], "n"))

    def test_a_polynomial_of_second_degree(self):
        """Probed at corners and at the middles of edges, where its own values are: those of the closed form, and not those of corners."""
        mesh, cells, bare = self.tetrahedra(2)
        field = lambda p: 3 * p[..., 0]**2 - 2 * p[..., 0] * p[..., 1] + p[..., 2]**2 + 5 * p[..., 1] * p[..., 2] + p[..., 2] + 1
        ten = self.ten_points(mesh)
        vector = np.stack([self.by_ufc(field(ten))[:, 0], self.by_ufc(ten[:, :, 0]**2)[:, 0]], 1)
        self.write(bare + self.function("p", 2, "CG", self.by_ufc(field(ten))) + self.function("v", 2, "CG", vector, "Vector") + "</Grid>")
        inside = ten.reshape(-1, 3)[(ten.reshape(-1, 3) > 0).all(1) & (ten.reshape(-1, 3) < 1).all(1)]
        points = self.folder / "points.txt"
        np.savetxt(points, inside, delimiter=",")
        for name, exact in (("p", field(inside)), ("v:y", inside[:, 0]**2)):
            cache = self.convert([self.path], name)
            result = self.run_program("info", cache, "--probe", points, "--source", self.path)
            self.assertEqual(result.returncode, 0, result.stderr)
            found = np.array([[float(word) for word in line.split(",")] for line in result.stdout.splitlines()[1:]])
            np.testing.assert_allclose(found[:, 3], exact, atol=1e-6)

    def test_functions_in_curved_tetrahedra(self):
        """A mesh of degree 2: its own ten points are taken."""
        mesh, cells, _ = self.tetrahedra(2)
        ten = self.ten_points(mesh)
        flat, numbers = np.unique(ten.reshape(-1, 3).round(9), axis=0, return_inverse=True)
        bent = flat + 0.05 * np.sin(9 * flat[:, [1, 2, 0]]) * np.isin(flat, (0.25, 0.75)).any(1)[:, None]
        curved = Mesh(2, (4,))
        curved.points, curved.cells, curved.c, curved.p = bent, list(numbers.reshape(-1, 10)), mesh.c, bent[:, 0]
        grid = self.grid(curved, ("Tetrahedron_10", len(cells), np.array(curved.cells)))
        values = bent[np.array(curved.cells)] @ (1.0, -2.0, 1.0)
        path = self.write(grid[:grid.index("<Attribute")] + self.function("p", 2, "DG", self.by_ufc(values)) + "</Grid>")
        expected = self.folder / "expected.vtu"
        write_xml(self.apart(mesh, bent[np.array(curved.cells)], values, vtk.VTK_QUADRATIC_TETRA), expected)
        self.expect_same_caches([path], expected, {"c": None})

    def test_what_is_refused(self):
        mesh = Mesh(2, (8,))
        name, elements, numbers = self.mixed(mesh)
        changed = lambda at, value: (name, elements, np.concatenate([numbers[:at], [value], numbers[at + 1:]]))
        for topology, told in ((("Hexahedron", 9, np.array(mesh.cells)), "expected 9"), ((name, elements + 1, numbers), "expected 9"),
                               (changed(0, 77), "is of type 77"), (changed(3, 99), "refers to point 99"), (changed(0, -1), "the number -1"),
                               (changed(63, 3), "points; expected"), ((name, elements, numbers[:-1]), "expected"),
                               (("Triangle", 4, np.arange(12).reshape(4, 3)), "no grid with volume")):
            with self.subTest(told=told):
                self.expect_line(self.write(self.grid(mesh, topology)), words=told)

    def test_a_filter_that_hdf5_lacks(self):
        mesh = Mesh(2, (8,))
        text = self.grid(mesh, ("Hexahedron", 8, np.array(mesh.cells)))
        with h5py.File(self.folder / "a.h5", "a") as f:
            number = next(name for name in f if f[name].shape == mesh.points.shape)
            del f[number]
            f.create_dataset(number, data=mesh.points, chunks=True, compression="lzf")  # h5py's own
        self.expect_line(self.write(text), words="is compressed by the HDF5 filter 'lzf', which is not installed; write it with gzip")

    def test_damage(self):
        mesh = Mesh(2)
        self.write(self.grid(mesh, self.mixed(mesh), "XML"))
        self.assertGreater(self.expect_harmless(self.path), 0.3)


if __name__ == "__main__":
    unittest.main()
