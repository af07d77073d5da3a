#!/usr/bin/python3
"""mesh_fluent_test.py CURVISPLAT

Fluent's cases in HDF5, written here as Fluent writes them, against VTK's cells of the same mesh: sections, phases, refined cells, series.
Damaged files get one line. Exit status 77 (skipped) without python3-vtk9 or python3-h5py.
"""
import shutil
import sys
import unittest

try:
    import h5py
    import numpy as np
    import vtk
    from vtk.util.numpy_support import vtk_to_numpy

    from mesh_case import MeshCase
    from mesh_cubes import HEXAHEDRON_FACES, RANDOM, cube, hexahedra, lattice
    from sweep import some_of
except ModuleNotFoundError as error:
    print(f"skipped: {error}; install python3-vtk9, python3-h5py and python3-numpy")
    sys.exit(77)


def faces_of(cells):
    """Faces (their points, both cells from 1, 0 outside) of cells, each a list of faces: inner ones first, as Fluent has them."""
    faces = {}
    for n, cell in enumerate(cells, 1):
        for face in cell:
            faces.setdefault(tuple(sorted(face)), [list(face)]).append(n)
    inner = [face for face in faces.values() if len(face) == 3]
    return inner + [[*face, 0] for face in faces.values() if len(face) == 2], len(inner)


def faces_of_cell(grid, n):
    cell = grid.GetCell(n)
    ids = lambda face: [face.GetPointId(k) for k in range(face.GetNumberOfPoints())]
    return [ids(cell.GetFace(m)) for m in range(cell.GetNumberOfFaces())]


def hexahedron(corners):
    return [[int(corners[n]) for n in face] for face in HEXAHEDRON_FACES]


class Case:
    """A case; faces and points in sections of the given numbers."""

    def __init__(self, path, points, cells, sections=1, extra=()):
        faces, inner = faces_of(cells)
        faces += extra
        with h5py.File(path, "w") as f:
            f.create_group("settings")
            mesh = f.create_group("meshes/1")
            mesh.attrs.update(dimension=np.array([3], "i4"), nodeCount=np.array([len(points)], "u8"), nodeOffset=np.array([1], "u8"),
                              cellCount=np.array([len(cells)], "u8"), faceCount=np.array([len(faces)], "u8"))
            for n, some in enumerate(np.array_split(np.arange(len(points)), sections)):
                self.section(mesh, f"nodes/coords/{n + 5}", some, points[some])
            for n, some in enumerate(np.array_split(np.arange(len(faces)), sections), 1):
                group = mesh.create_group(f"faces/nodes/{n}")
                group.attrs.update(minId=np.array([some[0] + 1], "u8"), maxId=np.array([some[-1] + 1], "u8"))
                group["nnodes"] = np.array([len(faces[face][0]) for face in some], "i2")
                group["nodes"] = np.array([p + 1 for face in some for p in faces[face][0]], "u4")
            for side in (0, 1):
                for n, some in enumerate(np.array_split(np.arange(len(faces) if side == 0 else inner), sections), 1):
                    self.section(mesh, f"faces/c{side}/{n}", some, np.array([faces[face][1 + side] for face in some], "u4"))
            for kind, names in (("cells", "fluid;solid"), ("faces", "interior;inlet;wall")):
                mesh[f"{kind}/zoneTopology/name"] = np.array([names.encode()])
        self.path = path

    @staticmethod
    def section(group, name, numbers, values):
        group[name] = values
        group[name].attrs.update(minId=np.array([numbers[0] + 1], "u8"), maxId=np.array([numbers[-1] + 1], "u8"))

    def data(self, path, fields, phases=None, time=0.0, sections=1):
        with h5py.File(path, "w") as f:
            f["settings/Data Variables"] = np.array([f"((time-step 4)\n(flow-time {time})\n(iterations 7))".encode()])
            for n, values in enumerate([fields, *(phases or [])], 1):
                cells = f.create_group(f"results/1/phase-{n}/cells")
                cells["fields"] = np.array([";".join(values).encode()])
                for name, array in values.items():
                    for m, some in enumerate(np.array_split(np.arange(len(array)), sections), 1):
                        self.section(cells, f"{name}/{m}", some, array[some])
                    cells[name].attrs["nSections"] = np.array([sections], "u8")
        return path


class MeshFluent(MeshCase):
    def cubes(self, n=5):
        points, corners = lattice(n), hexahedra(n)
        return points, corners, [hexahedron(c) for c in corners]

    def scalars(self, *files):
        return {scalar["name"]: (scalar["min"], scalar["max"]) for scalar in self.info(*files)["scalars"]}

    def test_cells_of_all_kinds(self):
        grid = cube(kinds=("hexahedron", "tetrahedra", "wedges", "pyramids", "polyhedron"))
        points = vtk_to_numpy(grid.GetPoints().GetData())
        cells = [faces_of_cell(grid, n) for n in range(grid.GetNumberOfCells())]
        values = vtk_to_numpy(grid.GetCellData().GetArray("c"))
        for sections in (1, 3):
            case = Case(self.folder / "a.cas.h5", points, cells, sections)
            case.data(self.folder / "a.dat.h5", {"SV_P": values}, sections=sections)
            info = self.info(case.path)
            self.assertEqual((info["nodes"], info["cells"]["count"], info["unused_nodes"]), (len(points), len(cells), 0))
            self.assertEqual(self.scalars(case.path)["SV_P"], (np.float32(values.min()), np.float32(values.max())))
            self.assertIn("zones of cells: fluid, solid", info["notes"][0])
            self.assertAlmostEqual(self.volume(case.path, "SV_P"), 1, delta=5e-3)
            self.assertEqual(self.scalars(case.path), self.scalars(self.folder / "a.dat.h5"))

    def test_the_same_cache_as_of_polyhedra_of_vtk(self):
        grid = cube(kinds=("polyhedron",))
        points = vtk_to_numpy(grid.GetPoints().GetData())
        cells = [faces_of_cell(grid, n) for n in range(grid.GetNumberOfCells())]
        case = Case(self.folder / "a.cas.h5", points.astype("f8"), cells)
        case.data(self.folder / "a.dat.h5", {"c": vtk_to_numpy(grid.GetCellData().GetArray("c")).astype("f4")})
        writer = vtk.vtkXMLUnstructuredGridWriter()
        writer.SetFileName(str(self.folder / "a.vtu"))
        writer.SetInputData(grid)
        writer.Write()
        fluent, of_vtk = (self.manifest(self.convert([self.folder / name], "c")) for name in ("a.cas.h5", "a.vtu"))
        for key in ("volume", "splats", "bounds"):
            if key in of_vtk:
                self.assertEqual(fluent[key], of_vtk[key], key)

    def test_values(self):
        points, corners, cells = self.cubes()
        u, v, w = (RANDOM.random((3, len(cells))) * 9).round(3)
        vof, pair = RANDOM.random(len(cells)), RANDOM.random((len(cells), 3))
        case = Case(self.folder / "a.cas.h5", points, cells)
        solid = np.arange(len(cells)) >= 100
        case.data(self.folder / "a.dat.h5", {"SV_U": u, "SV_V": v, "SV_W": w, "SV_T": u[~solid], "SV_VEC": pair}, [{"SV_VOF": vof}], 0.25)
        scalars = self.scalars(case.path)
        magnitude = np.sqrt(u**2 + v**2 + w**2)
        for name, values in (("SV_U", u), ("SV_T", u[~solid]), ("phase-2:SV_VOF", vof), ("SV_VEC:mag", np.linalg.norm(pair, axis=1)),
                             ("SV_VEC:y", pair[:, 1])):
            np.testing.assert_allclose(scalars[name], (values.min(), values.max()), rtol=1e-6)
        info = self.info(case.path)
        self.assertIn("velocity_magnitude", str(info))
        self.assertEqual(info["times"]["values"] if isinstance(info["times"], dict) else info["times"], [0.25])
        manifest = self.manifest(self.convert([case.path], "velocity_magnitude"))
        of_cache = manifest["variables"][0]
        np.testing.assert_allclose((of_cache["min"], of_cache["max"]), (magnitude.min(), magnitude.max()), rtol=1e-6)

    def test_cells_that_adaption_has_divided(self):
        """The first cell is divided into two along x: the second half, its faces and the divided cell are at the end."""
        points = np.array([[i, j, k] for k in (0, 1) for j in (0, 1) for i in (0, 1, 2)], "f8")
        points = np.concatenate([points, [[0.5, j, k] for k in (0, 1) for j in (0, 1)]])
        at = lambda i, j, k: 6 * k + 3 * j + i
        box = lambda a, b: hexahedron([a[0], b[0], b[1], a[1], a[2], b[2], b[3], a[3]])
        side = lambda i: [at(i, 0, 0), at(i, 1, 0), at(i, 0, 1), at(i, 1, 1)]
        middle = [12, 13, 14, 15]
        cells = [box(side(0), middle), box(side(1), side(2)), box(middle, side(1))]
        whole = box(side(0), side(1))
        divided = [[face, 4, 0] for face in whole if not set(face) <= set(side(0)) and not set(face) <= set(side(1))]
        case = Case(self.folder / "a.cas.h5", points, cells, extra=divided)
        with h5py.File(case.path, "r+") as f:
            mesh = f["meshes/1"]
            mesh.attrs["cellCount"] = np.array([4], "u8")
            faces = int(mesh.attrs["faceCount"][0])
            for kind, first, last in (("cells", 4, 4), ("faces", faces - 3, faces)):
                tree = mesh.create_group(f"{kind}/tree/1")
                tree.attrs.update(minId=np.array([first], "u8"), maxId=np.array([last], "u8"))
        case.data(self.folder / "a.dat.h5", {"SV_P": np.array([1.0, 2, 3])})
        self.assertAlmostEqual(self.volume(case.path, "SV_P"), 2, delta=1e-6)
        self.assertEqual(self.scalars(case.path)["SV_P"], (1, 3))

    def test_a_series(self):
        points, _, cells = self.cubes()
        case = Case(self.folder / "run.cas.h5", points, cells)
        files = [case.data(self.folder / f"run-{10 * n:05}.dat.h5", {"SV_P": np.arange(len(cells)) * (n + 1.0)}, time=0.5 * (n + 1)) for n in range(3)]
        result = self.run_program("convert", case.path, *files, "-o", self.folder / "run.splats", "--scalar", "SV_P", "--steps", "all")
        self.assertEqual(result.returncode, 0, result.stderr)
        self.assertIn("1.5", self.run_program("info", self.folder / "run.splats", "--steps", "all").stdout)

    def test_damage(self):
        points, _, cells = self.cubes(3)

        def refused(words, *files):
            result = self.run_program("info", *files)
            self.assertEqual((result.returncode, result.stderr.count("\n")), (1, 1), result.stderr)
            self.assertIn(words, result.stderr)

        case, data = self.folder / "a.cas.h5", self.folder / "a.dat.h5"

        def write():
            Case(case, points, cells, 2).data(data, {"SV_P": np.arange(27.0)}, sections=2)

        changes = (("meshes/1", "cellCount", [26], "belongs to cell 27; expected up to 26"), ("meshes/1", "cellCount", [9999], "more than its"),
                   ("meshes/1", "faceCount", [50], "faces; expected 50"), ("meshes/1", "nodeCount", [65], "nodes; expected 65"),
                   ("meshes/1", "dimension", [2], "of 2 dimensions; expected 3"), ("meshes/1/faces/nodes/2", "minId", [3], "begins with face 3"),
                   ("meshes/1/faces/c0/1", "maxId", [3], "rows; expected 3"), ("meshes/1/nodes/coords/5", "minId", [0], "has the numbers 0 to"))
        for place, name, value, words in changes:
            write()
            with h5py.File(case, "r+") as f:
                f[place].attrs[name] = np.array(value, "u8")
            refused(words, case)
        for place, change, words in (("meshes/1/faces/nodes/1/nnodes", 9, "nodes; expected"), ("meshes/1/faces/nodes/1/nnodes", -1, "expected a count"),
                                     ("meshes/1/faces/nodes/1/nodes", 999, "refers to point"), ("meshes/1/faces/c0/1", 77, "belongs to cell 77")):
            write()
            with h5py.File(case, "r+") as f:
                f[place][3] = change
            refused(words, case)
        for place in ("meshes/1", "meshes/1/nodes", "meshes/1/faces/nodes/1/nodes"):
            write()
            with h5py.File(case, "r+") as f:
                del f[place]
            refused("a.cas.h5", case)
        write()
        with h5py.File(data, "r+") as f:
            f["results/1/phase-1/cells/SV_P/2"].attrs.update(minId=np.array([500], "u8"), maxId=np.array([512], "u8"))
        refused("belongs to another mesh", case)
        write()
        shutil.copy(data, self.folder / "other.h5")
        refused("give the case first", self.folder / "other.h5")
        self.assertEqual(self.scalars(self.folder / "other.h5", case), self.scalars(case))  # in any order
        whole = case.read_bytes()
        for cut in some_of(range(9, len(whole), max(1, len(whole) // 24))):
            case.write_bytes(whole[:cut])
            refused("a.cas.h5", case)


if __name__ == "__main__":
    unittest.main()
