#!/usr/bin/python3
"""vtkhdf_test.py CURVISPLAT

VTKHDF files, written by h5py as VTK's documentation describes them, against VTK's XML files of the same grids: the caches are equal
byte by byte. VTK's own reader is asked, too, where this version of it reads the data set. Exit status 77 (skipped) without
python3-vtk9 or python3-h5py.
"""
import json
import os
import struct
import subprocess
import sys
import unittest

from format_case import PROGRAM
from mesh_formats import Mesh, MeshFormats, np, vtk, write_xml
from sweep import some_of

try:
    import h5py
    from amr_sets import pulse
    from vtk.util.numpy_support import numpy_to_vtk, vtk_to_numpy
except ModuleNotFoundError as error:
    print(f"skipped: {error}; install python3-h5py")
    sys.exit(77)

RANDOM = np.random.default_rng(5)


class Image:
    """A box of nodes, indexed (k, j, i), with a scalar and a vector of the nodes and a scalar of the cells."""

    def __init__(self, shape=(5, 4, 6), kind="f8", first=(2, -1, 0)):
        self.shape, self.first = shape, first
        self.p, self.v = RANDOM.random(shape).astype(kind), RANDOM.random((*shape, 3)).astype(kind)
        self.c = RANDOM.random([n - 1 for n in shape]).astype(kind)
        self.origin, self.spacing, self.direction = (1.0, 2.0, -3.0), (0.5, 0.25, 2.0), (0, -1, 0, 1, 0, 0, 0, 0, 1)

    def extent(self):
        return [e for low, n in zip(self.first, self.shape[::-1]) for e in (low, low + n - 1)]

    def write(self, group, **options):
        head(group, "ImageData", WholeExtent=self.extent(), Origin=self.origin, Spacing=self.spacing, Direction=self.direction)
        for data, name in (("PointData", "p"), ("PointData", "v"), ("CellData", "c")):
            group.create_dataset(f"{data}/{name}", data=getattr(self, name), **options)

    def vtk(self):
        image = vtk.vtkImageData()
        image.SetExtent(*self.extent())
        image.SetOrigin(*self.origin)
        image.SetSpacing(*self.spacing)
        image.SetDirectionMatrix(*self.direction)
        for data, name in ((image.GetPointData(), "p"), (image.GetPointData(), "v"), (image.GetCellData(), "c")):
            values = getattr(self, name)
            array = numpy_to_vtk(values.reshape(-1, 3) if name == "v" else values.ravel(), deep=True)
            array.SetName(name)
            data.AddArray(array)
        return image


def head(group, kind, version=(2, 0), **attributes):
    group.attrs["Version"] = version
    group.attrs.create("Type", kind.encode(), dtype=h5py.string_dtype("ascii", len(kind)))
    for name, values in attributes.items():
        group.attrs[name] = values


def lists_of(meshes, faces=False):
    """The lists of an UnstructuredGrid, a part for each mesh."""
    kinds = {4: 10, 5: 14, 6: 13, 8: 12}
    lists = {name: [] for name in ("NumberOfPoints", "NumberOfCells", "NumberOfConnectivityIds", "Points", "Types", "Offsets",
                                   "Connectivity", "PointData/p", "CellData/c")}
    if faces:
        lists.update({name: [] for name in ("NumberOfFaces", "NumberOfFaceConnectivityIds", "NumberOfPolyhedronToFaceIds",
                                            "FaceOffsets", "FaceConnectivity", "PolyhedronOffsets", "PolyhedronToFaces")})

    def offsets(parts):
        return np.cumsum([0] + [len(part) for part in parts])

    for mesh in meshes:
        added = {"NumberOfPoints": [len(mesh.points)], "NumberOfCells": [len(mesh.cells)],
                 "NumberOfConnectivityIds": [sum(map(len, mesh.cells))], "Points": mesh.points,
                 "Types": [42 if faces else kinds[len(cell)] for cell in mesh.cells], "Offsets": offsets(mesh.cells),
                 "Connectivity": np.concatenate(mesh.cells), "PointData/p": mesh.p, "CellData/c": mesh.c}
        if faces:
            of_mesh, _, of_cells = mesh.faces()
            of_cells = [[number for number, _ in cell] for cell in of_cells]
            added |= {"NumberOfFaces": [len(of_mesh)], "NumberOfFaceConnectivityIds": [sum(map(len, of_mesh))],
                      "NumberOfPolyhedronToFaceIds": [sum(map(len, of_cells))], "FaceOffsets": offsets(of_mesh),
                      "FaceConnectivity": np.concatenate(of_mesh), "PolyhedronOffsets": offsets(of_cells),
                      "PolyhedronToFaces": np.concatenate(of_cells)}
        for name, values in added.items():
            lists[name].append(values)
    lists = {name: np.concatenate(values) for name, values in lists.items()}
    return lists | {"Types": lists["Types"].astype("u1")}


def write_mesh(group, meshes, faces=False, version=(2, 0), **options):
    head(group, "UnstructuredGrid", version)
    for name, values in lists_of(meshes, faces).items():
        group.create_dataset(name, data=values, **options)


def parts_of(mesh, count):
    """The mesh in parts with points of their own."""
    parts = []
    for n in range(count):
        part = Mesh.__new__(Mesh)
        chosen = range(n * len(mesh.cells) // count, (n + 1) * len(mesh.cells) // count)
        used = np.unique(np.concatenate([mesh.cells[c] for c in chosen]))
        part.points, part.p, part.c = mesh.points[used], mesh.p[used], mesh.c[list(chosen)]
        part.cells = [np.searchsorted(used, mesh.cells[c]) for c in chosen]
        parts.append(part)
    return parts


class VtkHdf(MeshFormats):
    def setUp(self):
        super().setUp()
        self.path = self.folder / "a.vtkhdf"

    def file(self):
        return h5py.File(self.path, "w", track_order=True)

    def vti(self, image, name="expected.vti"):
        writer = vtk.vtkXMLImageDataWriter()
        writer.SetFileName(str(self.folder / name))
        writer.SetInputData(image.vtk())
        writer.Write()
        return self.folder / name

    def read_by_vtk(self):
        reader = vtk.vtkHDFReader()
        reader.SetFileName(str(self.path))
        reader.UpdateInformation()
        reader.GetCellDataArraySelection().DisableAllArrays()  # VTK 9.1 expects as many cells as points in an image
        reader.Update()
        return reader.GetOutputDataObject(0)

    def test_images(self):
        cases = [(kind, options, version) for kind in ("f4", "f8", ">f4")
                 for options, version in (({}, (1, 0)), ({"chunks": (2, 3, 4), "compression": "gzip", "shuffle": True}, (2, 0)))]
        for kind, options, version in some_of(cases, 2):
            image = Image(kind=kind, first=(0, 0, 0))  # VTK 9.1 looks for the others in the wrong place
            image.v = image.v.astype("f4")
            with self.file() as f:
                group = f.create_group("VTKHDF")
                image.write(group)
                group.attrs["Version"] = version
                if options:
                    for place in ("PointData/p", "CellData/c"):
                        values = group[place][...]
                        del group[place]
                        group.create_dataset(place, data=values, **options)
            found = self.read_by_vtk()
            np.testing.assert_array_equal(vtk_to_numpy(found.GetPointData().GetArray("p")), image.p.ravel())
            image.p, image.c = image.p.astype("f8"), image.c.astype("f8")
            self.expect_same_caches([self.path], self.vti(image))
            info = self.info(self.path)
            self.assertEqual([s["name"] for s in info["scalars"][:5]], ["p", "v:mag", "v:x", "v:y", "v:z"])
            self.assertIn("VTKHDF ImageData, 1 block", info["format"])

    def test_rectilinear_and_curvilinear_grids(self):
        """As version 2.7 has them: one after another in a series, or with places that stay."""
        image, steps = Image(first=(0, 0, 0), kind="f4"), 3
        axes = [np.cumsum(RANDOM.random((steps, n)) + 0.1, axis=1) for n in image.shape[::-1]]
        z, y, x = np.meshgrid(*(axis[0] for axis in axes[::-1]), indexing="ij")
        points = np.stack([np.stack([x + 0.1 * n * y, y, z + 0.1 * x], -1) for n in range(steps)])

        def expected(kind, step):
            grid, writer = (vtk.vtkRectilinearGrid(), vtk.vtkXMLRectilinearGridWriter()) if kind == "RectilinearGrid" else (
                vtk.vtkStructuredGrid(), vtk.vtkXMLStructuredGridWriter())
            grid.SetDimensions(*image.shape[::-1])
            if kind == "RectilinearGrid":
                for letter, axis in zip("XYZ", axes):
                    getattr(grid, f"Set{letter}Coordinates")(numpy_to_vtk(axis[step], deep=True))
            else:
                of_grid = vtk.vtkPoints()
                of_grid.SetData(numpy_to_vtk(points[step].reshape(-1, 3), deep=True))
                grid.SetPoints(of_grid)
            for data, name in ((grid.GetPointData(), "p"), (grid.GetCellData(), "c")):
                array = numpy_to_vtk(getattr(image, name).ravel() + np.float32(step), deep=True)
                array.SetName(name)
                data.AddArray(array)
            path = self.folder / f"expected.{'vtr' if kind == 'RectilinearGrid' else 'vts'}"
            writer.SetFileName(str(path))
            writer.SetInputData(grid)
            writer.Write()
            return path

        for kind in ("RectilinearGrid", "StructuredGrid"):
            for count, moving in ((0, False), (steps, True), (steps, False)):
                with self.file() as f:
                    group = f.create_group("VTKHDF")
                    head(group, kind, (2, 7), WholeExtent=image.extent())
                    for data, name in (("PointData", "p"), ("CellData", "c")):
                        values = getattr(image, name)
                        group[f"{data}/{name}"] = np.stack([values + np.float32(n) for n in range(count)]) if count else values
                    places = slice(None, steps) if moving else 0
                    if kind == "StructuredGrid":
                        group["Points"] = points[places]
                    else:
                        for letter, axis in zip("XYZ", axes):
                            group[f"{letter}Coordinates"] = axis[places].ravel()
                    if count:
                        group["Steps/Values"] = np.arange(count) * 0.5
                        group["Steps/PointOffsets"] = np.arange(count) * moving
                        for letter, axis in zip("XYZ", axes):
                            group[f"Steps/{letter}CoordinatesOffsets"] = np.arange(count) * moving * axis.shape[1]
                for step in range(max(1, count)):
                    if step == 0 or moving:
                        self.expect_same_caches([self.path], expected(kind, step), options=("--time-step", step) if count else ())
                info = self.info(self.path)
                self.assertIn(f"VTKHDF {kind}, 1 block", info["format"])
            with h5py.File(self.path, "r+") as f:
                place = "VTKHDF/Points" if kind == "StructuredGrid" else "VTKHDF/YCoordinates"
                values = f[place][...]
                del f[place]
                f[place] = values[:2]
            self.expect_line(self.path, words="expected")

    def test_meshes(self):
        mesh = Mesh()
        for options in ({}, {"chunks": (7,)}):
            with self.file() as f:
                write_mesh(f.create_group("VTKHDF"), [mesh], version=(1, 0))
                if options:
                    for name in ("Connectivity", "Offsets", "Types", "PointData/p"):
                        values = f["VTKHDF"][name][...]
                        del f["VTKHDF"][name]
                        f["VTKHDF"].create_dataset(name, data=values, chunks=(7,), compression="gzip")
            found = self.read_by_vtk()
            self.assertEqual(found.GetNumberOfCells(), len(mesh.cells))
            np.testing.assert_array_equal(vtk_to_numpy(found.GetPointData().GetArray("p")), mesh.p)
            self.expect_same([self.path], mesh.vtk())
        # Prototypes of the format (the can's among VTK's own examples) do not state the type.
        with h5py.File(self.path, "a") as f:
            del f["VTKHDF"].attrs["Type"]
        self.assertEqual(self.read_by_vtk().GetNumberOfCells(), len(mesh.cells))
        self.expect_same([self.path], mesh.vtk())

    def test_parts(self):
        mesh = Mesh()
        with self.file() as f:
            write_mesh(f.create_group("VTKHDF"), parts_of(mesh, 3))
        info = self.info(self.path)
        self.assertIn("VTKHDF UnstructuredGrid, 3 pieces", info["format"])
        collection = vtk.vtkMultiBlockDataSet()
        for n, part in enumerate(parts_of(mesh, 3)):
            collection.SetBlock(n, part.vtk())
        writer = vtk.vtkXMLMultiBlockDataWriter()
        writer.SetFileName(str(self.folder / "expected.vtm"))
        writer.SetInputData(collection)
        writer.Write()
        self.expect_same_caches([self.path], self.folder / "expected.vtm")

    def test_polyhedra(self):
        mesh = Mesh()
        faces, _, of_cells = mesh.faces()
        turned = [[faces[number] for number, _ in cell] for cell in of_cells]
        with self.file() as f:
            write_mesh(f.create_group("VTKHDF"), [mesh], faces=True, version=(2, 5))
        self.expect_same([self.path], mesh.vtk(turned))
        with self.file() as f:
            write_mesh(f.create_group("VTKHDF"), parts_of(mesh, 3), faces=True, version=(2, 5))
        self.assertAlmostEqual(self.volume([self.path], "p"), 1, delta=2e-3)
        # A mixed part: the first cells are no polyhedra.
        lists = lists_of([mesh], faces=True)
        first = 5
        removed = lists["PolyhedronOffsets"][first]
        lists["Types"][:first] = lists_of([mesh])["Types"][:first]
        lists["PolyhedronOffsets"] = np.maximum(lists["PolyhedronOffsets"].astype("i8") - removed, 0)
        lists["PolyhedronToFaces"] = lists["PolyhedronToFaces"][removed:]
        lists["NumberOfPolyhedronToFaceIds"] -= removed
        with self.file() as f:
            head(f.create_group("VTKHDF"), "UnstructuredGrid")
            for name, values in lists.items():
                f["VTKHDF"][name] = values
        self.assertAlmostEqual(self.volume([self.path], "c"), 1, delta=2e-3)
        for name, at, wrong, told in (("PolyhedronToFaces", 3, 10**6, "refers to face 1000000"), ("FaceOffsets", 60, 10**12, "face 59 ends"),
                                      ("PolyhedronOffsets", 8, 10**12, "ends at place 1000000000000"), ("FaceOffsets", 0, 1, "expected 0")):
            with h5py.File(self.path, "r+") as f:
                right = f["VTKHDF"][name][at]
                f["VTKHDF"][name][at] = wrong
            self.expect_line(self.path, scalar="c", words=told)
            with h5py.File(self.path, "r+") as f:
                f["VTKHDF"][name][at] = right

    def test_steps_of_meshes(self):
        """Points that move and a mesh that changes; and one that stays, with values that change."""
        series = [[Mesh(2)], parts_of(Mesh(3), 2), [Mesh(4)]]
        for faces in some_of((False, True), 1):
            with self.file() as f:
                group = f.create_group("VTKHDF")
                write_mesh(group, [part for parts in series for part in parts], faces)
                steps = group.create_group("Steps")
                steps.attrs["NSteps"] = len(series)
                steps["Values"] = [0.0, 0.5, 2.0]
                steps["NumberOfParts"] = [len(parts) for parts in series]
                before = lambda of: np.cumsum([0] + [sum(of(part) for part in parts) for parts in series[:-1]])
                steps["PartOffsets"] = before(lambda part: 1)
                steps["PointOffsets"] = before(lambda part: len(part.points))
                steps["CellOffsets"] = before(lambda part: len(part.cells))[:, None]
                steps["ConnectivityIdOffsets"] = before(lambda part: sum(map(len, part.cells)))[:, None]
            self.assertEqual(self.info(self.path)["times"], [0, 0.5, 2])
            for n, parts in enumerate(series):
                self.assertEqual(self.info(self.path, "--time-step", n)["cells"]["count"], sum(len(part.cells) for part in parts))
                found = self.cache([self.path], "p", "--time-step", n)
                with h5py.File(self.folder / "one.vtkhdf", "w") as f:
                    write_mesh(f.create_group("VTKHDF"), parts, faces)
                self.assertEqual(found, self.cache([self.folder / "one.vtkhdf"], "p"))
        mesh, values = Mesh(2, (8,)), RANDOM.random((3, 27))
        with self.file() as f:
            group = f.create_group("VTKHDF")
            write_mesh(group, [mesh])
            del group["PointData/p"]
            group["PointData/p"] = values.ravel()
            steps = group.create_group("Steps")
            steps["Values"] = [0.0, 1.0, 2.0]
            for name in ("PartOffsets", "PointOffsets", "CellOffsets", "ConnectivityIdOffsets"):
                steps[name] = [0, 0, 0]
            steps["NumberOfParts"] = [1, 1, 1]
            steps["PointDataOffsets/p"] = [0, 27, 54]
        for n in range(3):
            mesh.p = values[n]
            self.expect_same([self.path], mesh.vtk(), {"c": None}, ["--time-step", n])
        told = self.run_program("info", self.convert([self.path], "p", "--steps", "all"), "--json").stdout
        self.assertEqual(len(json.loads(told)["steps"]), 3)

    def test_steps_of_images(self):
        images = [Image() for _ in range(3)]
        with self.file() as f:
            group = f.create_group("VTKHDF")
            images[0].write(group)
            for place, name in (("PointData/p", "p"), ("PointData/v", "v"), ("CellData/c", "c")):
                del group[place]
                group[place] = np.stack([getattr(image, name) for image in images])
            del group["CellData/c"]
            group["CellData/c"] = np.stack([images[n].c for n in (2, 0, 1)])
            group["Steps/Values"] = [1.0, 2.0, 3.0]
            group["Steps/CellDataOffsets/c"] = [1, 2, 0]
        for n, image in enumerate(images):
            self.expect_same_caches([self.path], self.vti(image), options=["--time-step", n])

    def test_sets(self):
        """Images and meshes in a tree, one of them named twice, one that the tree leaves out, an empty one and a surface."""
        images, mesh = [Image(first=(20 * n, 0, 0)) for n in range(3)], Mesh(2)
        for kind in ("MultiBlockDataSet", "PartitionedDataSetCollection"):
            for with_images in (True, False):
                with self.file() as f:
                    root = f.create_group("VTKHDF", track_order=True)
                    head(root, kind, (2, 1))
                    if with_images:
                        for n, image in enumerate(images):
                            image.write(root.create_group(f"image{n}"))
                    write_mesh(root.create_group("mesh"), [mesh])
                    head(root.create_group("surface"), "PolyData")
                    root.create_group("empty")
                    tree = root.create_group("Assembly", track_order=True)
                    if with_images:
                        tree["z"] = h5py.SoftLink("/VTKHDF/image0")
                        tree.create_group("group", track_order=True)["b"] = h5py.SoftLink("/VTKHDF/image1")
                        tree["group"]["a"] = h5py.SoftLink("/VTKHDF/image0")
                    tree["c"] = h5py.SoftLink("/VTKHDF/mesh")
                    tree["d"] = h5py.SoftLink("/VTKHDF/empty")
                    tree["e"] = h5py.SoftLink("/VTKHDF/nothing")
                info = self.info(self.path)
                told = " ".join(info["warnings"])
                if not with_images:
                    self.assertIn(f"VTKHDF {kind} of UnstructuredGrid, 1 piece", info["format"])
                    self.assertIn("surface is of type PolyData", told)
                    self.expect_same([self.path], mesh.vtk())
                    continue
                self.assertEqual([b["name"] for b in info["blocks"]], ["z", "group/b", "image2"])
                self.assertIn("2 data sets without structured grids are left out", told)
                collection = vtk.vtkMultiBlockDataSet()
                for n, image in enumerate(images):
                    collection.SetBlock(n, image.vtk())
                writer = vtk.vtkXMLMultiBlockDataWriter()
                writer.SetFileName(str(self.folder / "expected.vtm"))
                writer.SetInputData(collection)
                writer.Write()
                self.expect_same_caches([self.path], self.folder / "expected.vtm")

    def write_amr(self, sets):
        """The sets are steps. Each array begins with a tuple of a step that there is not."""
        origin = sets[0].GetDataSet(0, 0).GetOrigin()
        with self.file() as f:
            root = f.create_group("VTKHDF")
            head(root, "OverlappingAMR", GridDescription="XYZ", Origin=origin)
            root["Steps/Values"] = np.arange(len(sets)) / 4
            for level in range(sets[0].GetNumberOfLevels()):
                spacing = [0.0] * 3
                sets[0].GetSpacing(level, spacing)
                group, steps = root.create_group(f"Level{level}"), root.create_group(f"Steps/Level{level}")
                group.attrs["Spacing"] = spacing
                boxes, values, box_begins, value_begins = [], [], [], []
                for amr in sets:
                    box_begins.append(len(boxes))
                    value_begins.append(sum(map(len, values)))
                    for n in range(amr.GetNumberOfDataSets(level)):
                        patch = amr.GetDataSet(level, n)
                        low = np.rint((np.array(patch.GetOrigin()) - origin) / spacing).astype(int)
                        high = low + patch.GetDimensions() - 2
                        boxes.append([e for pair in zip(low, high) for e in pair])
                        values.append(vtk_to_numpy(patch.GetCellData().GetArray("Gaussian-Pulse")))
                group["AMRBox"] = boxes
                group["CellData/pulse"] = np.concatenate(values)
                steps["AMRBoxOffsets"], steps["CellDataOffsets/pulse"] = box_begins, value_begins
                steps["NumberOfAMRBoxes"] = [amr.GetNumberOfDataSets(level) for amr in sets]

    def test_refined_sets(self):
        sets = [pulse(), pulse(0.3)]
        self.write_amr(sets)
        for n, amr in enumerate(sets):
            writer = vtk.vtkXMLUniformGridAMRWriter()
            writer.SetFileName(str(self.folder / "expected.vthb"))
            writer.SetInputData(amr)
            writer.Write()
            found, expected = (self.cache(*words) for words in (([self.path], "pulse", "--time-step", n),
                                                                ([self.folder / "expected.vthb"], "Gaussian-Pulse")))
            self.assertEqual(found, expected)

    def test_ghosts_types_and_attributes(self):
        mesh = Mesh(2)
        with self.file() as f:
            group = f.create_group("VTKHDF")
            write_mesh(group, [mesh])
            flags = np.zeros(len(mesh.cells), "u1")
            flags[3] = 32
            group["CellData/vtkGhostType"] = flags
            group["PointData/density"] = np.arange(len(mesh.points), dtype="u2")
            group["PointData/words"] = np.array([b"a"] * len(mesh.points))
            group["PointData"].attrs["Scalars"] = "density"
        info = self.info(self.path)
        self.assertEqual(info["scalars"][0]["name"], "density")
        self.assertIn("words: has values of strings", " ".join(info["warnings"]))
        grid = mesh.vtk()
        array = numpy_to_vtk(flags, deep=True)
        array.SetName("vtkGhostType")
        grid.GetCellData().AddArray(array)
        write_xml(grid, self.folder / "expected.vtu")
        self.expect_same_caches([self.path], self.folder / "expected.vtu")

    def test_derived_scalars(self):
        mesh = Mesh(2)
        rho, energy = 1 + mesh.p, 20 + mesh.p
        with self.file() as f:
            write_mesh(f.create_group("VTKHDF"), [mesh])
            f["VTKHDF/PointData/Density"], f["VTKHDF/PointData/Energy"] = rho, energy
            f["VTKHDF/PointData/Momentum"] = np.stack([2 * rho, rho, 0 * rho], 1)
        scalars = {s["name"]: s for s in self.info(self.path)["scalars"]}
        self.assertAlmostEqual(scalars["pressure"]["max"], (0.4 * (energy - 2.5 * rho)).max(), places=5)

    def test_what_is_refused(self):
        mesh, image = Mesh(2, (8,)), Image()

        def change(place, values, attribute=None):
            with self.file() as f:
                group = f.create_group("VTKHDF")
                (image.write(group) if place.startswith("image:") else write_mesh(group, [mesh]))
                place = place.removeprefix("image:")
                if attribute:
                    group.attrs[attribute] = values
                    return
                del group[place]
                if values is not None:
                    group[place] = values

        lists = lists_of([mesh])
        huge = 1 << 40
        for place, values, attribute, told in (
                ("", "PolyData", "Type", "is of type"), ("", "HyperTreeGrid", "Type", "expected ImageData"), ("", [3, 0], "Version", "version 3"),
                ("", [1.0] * 3, "Version", "expected 2 numbers"), ("", "x" * 9000, "Type", "is of type"), ("", 7, "Type", "expected a text"),
                ("image:", [0, 5, 0], "WholeExtent", "expected 6 numbers"), ("image:", [0, huge] * 3, "WholeExtent", "expected the first and last"),
                ("image:", [0, 9, 0, 9, 0, 9], "WholeExtent", "expected the points of an image of 10x10x10"),
                ("image:", [0, 5, 0, -3, 0, 1], "WholeExtent", "expected the first and last"), ("image:", "abc", "Spacing", "expected 3 numbers"),
                ("Points", None, None, "is missing"), ("Points", lists["Points"][:-1], None, "expected 27 from number 0"),
                ("Points", lists["Points"][:, :2], None, "has 2 components"), ("Types", lists["Types"][:5], None, "expected"),
                ("NumberOfPoints", [huge], None, "expected 1099511627776"), ("NumberOfCells", [-3], None, "has -3; expected a count"),
                ("NumberOfCells", [2.0**62], None, "expected a count"), ("NumberOfConnectivityIds", [huge], None, "expected 1099511627776"),
                ("NumberOfPoints", [27] * 2, None, "NumberOfCells: has 1 numbers"), ("Offsets", lists["Offsets"] + 1, None, "expected 0"),
                ("Offsets", lists["Offsets"] * huge, None, "ends at place"), ("Connectivity", lists["Connectivity"] + 27, None, "refers to point"),
                ("Types", lists["Types"] + 100, None, "not one of VTK's types"), ("PointData/p", mesh.p[:-1], None, "has 26 tuples"),
                ("Points", ["a"] * 27, None, "has values of strings")):
            change(place, values, attribute)
            with self.subTest(place=place, attribute=attribute, told=told):
                self.expect_line(self.path, scalar="p", words=told)
        # Numbers that were never written, more than memory holds.
        change("Points", None)
        with h5py.File(self.path, "r+") as f:
            f["VTKHDF"].create_dataset("Points", shape=(huge, 3), dtype="f8", chunks=(1 << 20, 3))
            f["VTKHDF/NumberOfPoints"][0] = huge
        self.expect_line(self.path, scalar="p", words="more than its 0 bytes can hold")
        # Steps that lie.
        for name, values, told in (("Values", [], "0 time values"), ("PartOffsets", [5], "expected 1 from number 5"), ("NumberOfParts", [huge], "more than"),
                                   ("PointOffsets", [1], "expected 27 from number 1"), ("CellOffsets", [-1], "expected a count"),
                                   ("PointDataOffsets/p", [huge], "expected 27 from number 1099511627776")):
            change("Types", lists["Types"])
            with h5py.File(self.path, "r+") as f:
                f["VTKHDF/Steps/Values"] = [0.0]
                if name == "Values":
                    del f["VTKHDF/Steps/Values"]
                f[f"VTKHDF/Steps/{name}"] = np.array(values, "f8" if name == "Values" else "i8")
            with self.subTest(name=name):
                self.expect_line(self.path, scalar="p", words=told)

    def test_where_links_lead(self):
        mesh = Mesh(2)
        (self.folder / "in").mkdir()
        self.path = self.folder / "in" / "a.vtkhdf"
        with h5py.File(self.folder / "out.h5", "w") as f:
            f["Points"] = mesh.points
        for name, told in (("b.h5", None), ("../out.h5", "lies outside the folder")):
            with self.file() as f:
                write_mesh(f.create_group("VTKHDF"), [mesh])
                del f["VTKHDF/Points"]
                f["VTKHDF/Points"] = h5py.ExternalLink(name, "Points")
            (self.folder / "in" / "b.h5").write_bytes((self.folder / "out.h5").read_bytes())
            if told:
                self.expect_line(self.path, scalar="p", words=told)
            else:
                self.expect_same([self.path], mesh.vtk())
        # Nowhere.
        for write in (lambda group: write_mesh(group, [mesh]), Image().write):
            with self.file() as f:
                write(f.create_group("VTKHDF"))
                f["VTKHDF/PointData/q"] = h5py.SoftLink("/none")
            self.expect_line(self.path, scalar="p", words="PointData/q: is missing")
        # A tree that contains itself.
        with self.file() as f:
            root = f.create_group("VTKHDF")
            head(root, "MultiBlockDataSet")
            write_mesh(root.create_group("mesh"), [mesh])
            root.create_group("Assembly")["again"] = h5py.SoftLink("/VTKHDF")
            root["Assembly/loop"] = h5py.SoftLink("/VTKHDF/Assembly")
        self.expect_same([self.path], mesh.vtk())

    def test_kept_cache_of_a_file_whose_link_leads_to_new_values(self):
        mesh = Mesh(2)
        with self.file() as f:
            write_mesh(f.create_group("VTKHDF"), [mesh])
            p = np.array(f["VTKHDF/PointData/p"])
            del f["VTKHDF/PointData/p"]
            f["VTKHDF/PointData/p"] = h5py.ExternalLink("values.h5", "p")
        environment = {**os.environ, "XDG_CACHE_HOME": str(self.folder / "kept")}

        def ranges(values):
            """The range of p in each kept cache after the file was drawn twice, linked to these values."""
            with h5py.File(self.folder / "values.h5", "w") as f:
                f["p"] = values
            for _ in range(2):
                subprocess.run([PROGRAM, "render", self.path, "-o", self.folder / "a.png", "--size", "20x20", "--scalar", "p"],
                               check=True, capture_output=True, env=environment)
            manifests = [json.loads(path.read_text()) for path in (self.folder / "kept").glob("*/*/*.splats/manifest.json")]
            return sorted(float(np.float32(variable["max"])) for manifest in manifests for variable in manifest["variables"] if variable["name"] == "p")

        first, second = (float(np.float32(largest)) for largest in (p.max(), 2 * p.max()))
        self.assertEqual(ranges(p), [first])
        self.assertEqual(ranges(2 * p), [first, second])
        self.assertEqual(ranges(p), [first, second])

    def test_damage(self):
        with self.file() as f:
            write_mesh(f.create_group("VTKHDF"), parts_of(Mesh(2), 2), faces=True)
        self.assertGreater(self.expect_harmless(self.path), 0.3)
        self.write_amr([pulse()])
        self.assertGreater(self.expect_harmless(self.path, scalar="pulse"), 0.3)

    def test_chunk_of_a_gigabyte(self):
        """That is what its size in the file says. HDF5 has it allocated before it finds that the file is shorter."""
        with self.file() as f:
            write_mesh(f.create_group("VTKHDF"), [Mesh(2)], chunks=True, compression="gzip")
            chunk = f["VTKHDF/CellData/c"].id.get_chunk_info(0)
        data = bytearray(self.path.read_bytes())
        child = data.index(struct.pack("<QQQ", 0, 0, chunk.byte_offset)) - 8  # after the size and the filters
        self.assertEqual(struct.unpack_from("<II", data, child), (chunk.size, 0))
        struct.pack_into("<I", data, child, chunk.size | 1 << 30)
        self.path.write_bytes(data)
        pid = os.spawnv(os.P_NOWAIT, PROGRAM, [PROGRAM, "info", str(self.path)])
        _, status, used = os.wait4(pid, 0)
        self.assertEqual(os.waitstatus_to_exitcode(status), 1)
        if "CURVISPLAT_SANITIZED" not in os.environ:
            self.assertLess(used.ru_maxrss >> 10, 700)  # MiB, also of the process that tries the file


if __name__ == "__main__":
    unittest.main()
