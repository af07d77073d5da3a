#!/usr/bin/python3
"""mesh_su2_test.py CURVISPLAT

SU2's native meshes and restart files: mesh_formats.py says how. Exit status 77 (skipped) without python3-vtk9.
"""
import unittest

from sweep import some_of
from mesh_formats import Mesh, MeshFormats, np

try:
    import meshio
except ModuleNotFoundError:
    meshio = None


class Su2Meshes(MeshFormats):
    def setUp(self):
        super().setUp()
        self.path, self.restart = self.folder / "mesh.su2", self.folder / "restart_flow"

    def write(self, mesh, numbered=True, zones=1):
        kinds = {4: 10, 5: 14, 6: 13, 8: 12}
        with self.path.open("w") as out:
            if zones > 1:
                out.write(f"NZONE= {zones}\n")
            for zone in range(zones):
                of_zone = range(zone * len(mesh.cells) // zones, (zone + 1) * len(mesh.cells) // zones)
                out.write((f"IZONE= {zone + 1}\n" if zones > 1 else "") + "%\n% a comment\nNDIME= 3\n"
                          f"NELEM= {len(of_zone)}\n")
                for n in of_zone:
                    corners = " ".join(str(c) for c in mesh.cells[n])
                    out.write(f"{kinds[len(mesh.cells[n])]} {corners}{f' {n}' if numbered else ''}\n")
                out.write(f"NPOIN= {len(mesh.points)}{f' {len(mesh.points)}' if numbered else ''}\n")
                for n, point in enumerate(mesh.points.tolist()):
                    out.write(" ".join(map(repr, point)) + (f" {n}\n" if numbered else "\n"))
                out.write("NMARK= 2\nMARKER_TAG= lower\nMARKER_ELEMS= 1\n9 0 1 6 5\nMARKER_TAG= upper\nMARKER_ELEMS= 1\n9 1 2 7 6\n")

    def write_restart(self, mesh, how, order="<", variables=("p", "Momentum_x"), copies=1):
        names = ["x", "y", "z", *variables]
        table = np.column_stack([mesh.points] + [(n + 1) * mesh.p for n in range(len(variables))])
        table = np.concatenate([table + np.array([0, 0, 0] + [10 * n] * len(variables)) for n in range(copies)])
        if how == "binary":
            head = np.array([535532, len(names), len(table), 1, 8], order + "i4").tobytes()
            text = b"".join(name.encode().ljust(33, b"\0") for name in names)
            self.restart.write_bytes(head + text + table.astype(order + "f8").tobytes() + bytes(8 * 8 + 4))
            return
        between = ", " if how == "csv" else "\t"
        with self.restart.open("w") as out:
            out.write(between.join(f'"{name}"' for name in ["PointID", *names]) + "\n")
            for n, row in enumerate(table.tolist()):
                out.write(between.join([str(n), *map(repr, row)]) + "\n")
            out.write("EXT_ITER= 3\n" if how == "dat" else "")

    def test_meshes_and_restarts(self):
        mesh = Mesh()
        grid = mesh.vtk()
        for numbered, how, order in ((True, "csv", "<"), (False, "dat", "<"), (True, "binary", "<"), (False, "binary", ">")):
            with self.subTest(numbered=numbered, how=how, order=order):
                self.write(mesh, numbered)
                self.write_restart(mesh, how, order)
                info = self.info(self.path, self.restart)
                self.assertEqual([s["name"] for s in info["scalars"]], ["p", "Momentum_x"])
                self.assertEqual(info["cells"]["count"], len(mesh.cells))
                self.assertIn("boundaries: lower, upper", info["notes"])
                self.expect_same([self.path, self.restart], grid, {"c": None})

    def test_a_mesh_alone_is_drawn_and_asks_for_its_restart(self):
        mesh = Mesh(2)
        self.write(mesh)
        info = self.info(self.path)
        self.assertEqual([s["name"] for s in info["scalars"]], ["constant"])
        self.assertIn("SU2's scalars are in its restart file: give it as well", "".join(info["warnings"]))
        self.assertAlmostEqual(self.volume([self.path], "constant"), 1, delta=2e-3)
        result = self.run_program("convert", self.path, "-o", self.folder / "d.splats", "--scalar", "p")
        self.assertIn("there is no scalar 'p'; give a restart file as well; available: constant", result.stderr)

    def test_derived_scalars(self):
        mesh = Mesh(2)
        self.write(mesh)
        names = ["x", "y", "z", "Density", "Momentum_x", "Momentum_y", "Momentum_z", "Energy"]
        rho, energy = 1 + mesh.p, 20 + mesh.p
        table = np.column_stack([mesh.points, rho, rho * 2, rho, 0 * rho, energy])
        head = np.array([535532, len(names), len(table), 1, 8], "<i4").tobytes()
        text = b"".join(name.encode().ljust(33, b"\0") for name in names)
        self.restart.write_bytes(head + text + table.astype("<f8").tobytes())
        scalars = {s["name"]: s for s in self.info(self.path, self.restart)["scalars"]}
        pressure = 0.4 * (energy - 0.5 * rho * 5)
        self.assertAlmostEqual(scalars["pressure"]["max"], pressure.max(), places=5)
        self.assertAlmostEqual(scalars["mach_number"]["min"], np.sqrt(5 * rho / (1.4 * pressure)).min(), places=5)
        self.assertIn("vorticity_magnitude", scalars)
        self.assertAlmostEqual(self.volume([self.path, self.restart], "mach_number"), 1, delta=2e-3)

    def test_zones(self):
        mesh = Mesh()
        self.write(mesh, zones=2)
        self.write_restart(mesh, "binary")
        other = self.folder / "restart_other"
        other.write_bytes(self.restart.read_bytes())
        self.assertEqual(self.info(self.path, self.restart, other)["cells"]["count"], len(mesh.cells))
        self.assertAlmostEqual(self.volume([self.path, self.restart, other], "p"), 1, delta=2e-3)
        self.expect_line(self.path, self.restart, words="has 2 zones, but 1 restart files")
        # Names that differ in a number alone are steps elsewhere.
        numbered = [self.folder / "restart_0.dat", self.folder / "restart_1.dat"]
        for path in numbered:
            path.write_bytes(self.restart.read_bytes())
        self.assertAlmostEqual(self.volume([self.path, *numbered], "p"), 1, delta=2e-3)
        self.write(mesh)
        result = self.run_program("convert", self.path, *numbered, "-o", self.folder / "steps.splats", "--scalar", "p")
        self.assertEqual(result.returncode, 0, result.stderr)
        self.assertIn("2 steps, 2 of them converted now, 0 with a geometry of their own", result.stdout)

    def test_zones_behind_the_dimension(self):
        mesh = Mesh()
        self.write(mesh, zones=2)
        self.path.write_text("NDIME= 3\n" + self.path.read_text())
        self.write_restart(mesh, "binary")
        numbered = [self.folder / "restart_0.dat", self.folder / "restart_1.dat"]
        for path in numbered:
            path.write_bytes(self.restart.read_bytes())
        self.assertEqual(self.info(self.path, *numbered)["cells"]["count"], len(mesh.cells))
        self.assertAlmostEqual(self.volume([self.path, *numbered], "p"), 1, delta=2e-3)

    def test_zones_of_different_variables(self):
        mesh = Mesh()
        self.write(mesh, zones=2)
        files = [self.folder / "restart_0.dat", self.folder / "restart_1.dat"]
        for path, variables in zip(files, (("Pressure", "T"), ("T", "Density"))):
            self.write_restart(mesh, "binary", variables=variables)
            self.restart.rename(path)
        info = self.info(self.path, *files)
        self.assertEqual([s["name"] for s in info["scalars"]], ["T"])
        self.assertAlmostEqual(info["scalars"][0]["max"], 2 * mesh.p.max(), places=5)
        self.assertIn("left out: Pressure, Density: not in all of the zones", "".join(info["warnings"]))
        self.write_restart(mesh, "csv", variables=["Density"])
        self.assertIn("left out: T: not in all of the zones", "".join(self.info(self.path, files[1], self.restart)["warnings"]))
        self.write_restart(mesh, "csv", variables=["Pressure"])
        self.expect_line(self.path, files[1], self.restart, words="share no variable (found T, Density, Pressure)")

    def test_one_restart_of_several_zones(self):
        mesh = Mesh()
        self.write(mesh, zones=2)
        for how in ("csv", "dat", "binary"):  # the points of both zones
            self.write_restart(mesh, how, copies=2)
            info = self.info(self.path, self.restart)
            self.assertEqual(info["cells"]["count"], len(mesh.cells))
            self.assertAlmostEqual(info["scalars"][0]["max"], mesh.p.max() + 10, places=5)
        text = self.path.read_text().split("IZONE= 2")
        small = Mesh(2)
        self.write(small)
        self.path.write_text(text[0] + "IZONE= 2\n" + self.path.read_text())
        self.write_restart(small, "binary")  # those of the second alone
        info = self.info(self.path, self.restart)
        self.assertEqual(info["cells"]["count"], len(small.cells))
        self.assertIn("left out: zone 1 (", "".join(info["warnings"]))
        self.assertAlmostEqual(self.volume([self.path, self.restart], "p"), 1, delta=2e-3)

    @unittest.skipUnless(meshio, "no python3-meshio")
    def test_meshio_agrees(self):
        mesh = Mesh(kinds=(8, 4))
        cells = [("hexahedron" if run.shape[1] == 8 else "tetra", run) for run in mesh.runs()]
        meshio.write(self.path, meshio.Mesh(mesh.points, cells))
        self.write_restart(mesh, "csv")
        self.expect_same([self.path, self.restart], mesh.vtk(), {"c": None})
        self.write(mesh)
        read = meshio.read(self.path)
        np.testing.assert_array_equal(read.points, mesh.points)
        self.assertEqual(sum(len(b.data) for b in read.cells if b.type in ("hexahedron", "tetra")), len(mesh.cells))

    def test_damage(self):
        mesh = Mesh(2)
        self.write(mesh)
        self.assertGreater(self.expect_harmless(self.path, scalar="volume"), 1 / 3)
        for how in ("csv", "binary"):
            self.write_restart(mesh, how)
            data = self.restart.read_bytes()
            for n in some_of(range(1, 20)):
                self.restart.write_bytes(data[:len(data) * n // 24])
                self.expect_line(self.path, self.restart, scalar="p", words="restart_flow")
        text = self.path.read_text()
        for old, new, words in (("NDIME= 3", "NDIME= 2", "is a mesh of 2 dimensions"), ("NELEM= ", "NELEM= 1", "is not an element"),
                                ("\n12 ", "\n77 ", "is not an element"), ("NPOIN", "NPOINT", "has 0 points"),
                                ("\n12 0 ", "\n12 99999 ", "refers to point 99999"), ("NDIME= 3", "NDIME= -1", "the count")):
            self.write_restart(mesh, "csv")
            self.path.write_text(text.replace(old, new, 1))
            self.expect_line(self.path, *([self.restart] if "refers" in words else []), scalar="p", words=words)


if __name__ == "__main__":
    unittest.main()
