#!/usr/bin/python3
"""mesh_bytes_test.py CURVISPLAT

Unstructured grids of every format, larger than the chunks in which they are read: the caches have the same bytes for any number
of threads and of ranks, and any memory. Usually OpenFOAM and UGRID, all with CURVISPLAT_WHOLE (tools/test.sh --whole). Exit status 77
(skipped) without python3-vtk9.
"""
import hashlib
import json
import subprocess
import unittest

from mesh_formats import PROGRAM, Mesh, MeshFormats, np, vtk, write_xml

import cgns_library as cg
import gmsh_files
import mesh_cgns_test
import mesh_curved_test
import mesh_ensight_test
import mesh_files_test
import mesh_fluent_test
import mesh_foam_test
import mesh_formats_test
import mesh_su2_test
import mesh_tecplot_test
import mesh_xdmf_test
import vtkhdf_test
from sweep import IS_WHOLE, ONLY_WHOLE, mpirun, some_of

CELLS_OF_A_CHUNK = 16384  # preprocess/gather/mesh_reader.cpp
SIDE = 26  # 17,576 cubes


class MeshBytes(MeshFormats):
    def writer(self, kind):
        """A test case of another module, for its writers."""
        case = kind("run_program")
        case.setUp()
        self.addCleanup(case.doCleanups)
        return case

    def bytes_of(self, paths, scalar, start=(), options=()):
        cache = self.folder / "a.splats"
        done = subprocess.run([*start, PROGRAM, "convert", *map(str, paths), "-o", str(cache), "--scalar", scalar, "--overwrite",
                               *options], capture_output=True, text=True, check=False)
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertGreater(json.loads((cache / "manifest.json").read_text())["splats"], 0)
        return {str(p.relative_to(cache)): hashlib.sha256(p.read_bytes()).hexdigest() for p in cache.rglob("*") if p.is_file()}

    def expect_same_bytes(self, *paths, scalars):
        self.assertGreater(self.info(*paths)["cells"]["count"], CELLS_OF_A_CHUNK)
        for scalar in scalars:
            with self.subTest(scalar=scalar):
                first = self.bytes_of(paths, scalar, options=("--threads", "1", "--memory", "192M"))
                self.assertEqual(self.bytes_of(paths, scalar, options=("--threads", "4", "--memory", "1G")), first)
                if mpirun(PROGRAM):
                    self.assertEqual(self.bytes_of(paths, scalar, mpirun(PROGRAM), ("--memory", "256M")), first)

    def test_openfoam(self):
        writer = self.writer(mesh_foam_test.MeshFoam)
        for parts in some_of((3, 1), 2):
            case = writer.foam_case(SIDE, parts, binary=True)[0]
            self.expect_same_bytes(case / "case.foam", scalars=("p",))

    @unittest.skipUnless(IS_WHOLE, ONLY_WHOLE)
    def test_gmsh(self):
        grid = Mesh(SIDE, (8,)).vtk()
        shuffled = np.random.default_rng(2).permutation(grid.GetNumberOfPoints()) + 1
        file = gmsh_files.Msh(grid, tags=shuffled).mesh()
        for data, of in ((grid.GetPointData(), "Node"), (grid.GetCellData(), "Element")):
            file.data("pc"[of == "Element"], gmsh_files.vtk_to_numpy(data.GetArray("pc"[of == "Element"])), of)
        self.expect_same_bytes(file.write(self.folder / "a.msh"), scalars=("p", "c"))

    @unittest.skipUnless(IS_WHOLE, ONLY_WHOLE)
    def test_fluent(self):
        points, corners = mesh_fluent_test.lattice(SIDE), mesh_fluent_test.hexahedra(SIDE)
        case = mesh_fluent_test.Case(self.folder / "a.cas.h5", points, list(map(mesh_fluent_test.hexahedron, corners)), 2)
        case.data(self.folder / "a.dat.h5", {"SV_P": np.arange(len(corners)) ** 0.5}, sections=3)
        self.expect_same_bytes(case.path, scalars=("SV_P",))

    @unittest.skipUnless(IS_WHOLE, ONLY_WHOLE)
    @unittest.skipUnless(cg.library(), "no libcgns")
    def test_cgns(self):
        writer = self.writer(mesh_cgns_test.CgnsMeshes)
        mesh = Mesh(SIDE, (8,))
        writer.write_polyhedra(mesh)
        self.expect_same_bytes(writer.path, scalars=("p", "c"))
        writer.write_sections(Mesh(20))
        self.expect_same_bytes(writer.path, scalars=("p", "c"))

    @unittest.skipUnless(IS_WHOLE, ONLY_WHOLE)
    def test_ensight(self):
        writer = self.writer(mesh_ensight_test.EnsightCases)
        writer.write(writer.rounded(Mesh(20)), "<")
        self.expect_same_bytes(writer.path, scalars=("p", "c"))

    @unittest.skipUnless(IS_WHOLE, ONLY_WHOLE)
    def test_su2(self):
        writer = self.writer(mesh_su2_test.Su2Meshes)
        mesh = Mesh(20)
        writer.write(mesh)
        writer.write_restart(mesh, "binary")
        self.expect_same_bytes(writer.path, writer.restart, scalars=("p",))

    @unittest.skipUnless(IS_WHOLE, ONLY_WHOLE)
    def test_exodus(self):
        writer = self.writer(mesh_files_test.MeshFiles)
        writer.write_exodus(self.folder / "mesh.e", n=20)
        self.expect_same_bytes(self.folder / "mesh.e", scalars=("pressure", "density"))

    @unittest.skipUnless(IS_WHOLE, ONLY_WHOLE)
    def test_vtkhdf(self):
        writer = self.writer(vtkhdf_test.VtkHdf)
        for count, faces in ((3, False), (1, True)):
            with writer.file() as f:
                vtkhdf_test.write_mesh(f.create_group("VTKHDF"), vtkhdf_test.parts_of(Mesh(20), count), faces)
            self.expect_same_bytes(writer.path, scalars=("p", "c"))

    @unittest.skipUnless(IS_WHOLE, ONLY_WHOLE)
    def test_xdmf(self):
        writer = self.writer(mesh_xdmf_test.XdmfMeshes)
        mesh = Mesh(20)
        self.expect_same_bytes(writer.write(writer.grid(mesh, writer.mixed(mesh))), scalars=("p", "c"))
        mesh, _, bare = writer.tetrahedra(8)
        ten = writer.ten_points(mesh)
        functions = writer.function("p", 2, "DG", writer.by_ufc(ten.sum(2))) + writer.function("c", 0, "DG", mesh.c[:, None, None])
        self.expect_same_bytes(writer.write(bare + functions + "</Grid>"), scalars=("p", "c"))

    @unittest.skipUnless(IS_WHOLE, ONLY_WHOLE)
    def test_tecplot(self):
        writer = self.writer(mesh_tecplot_test.TecplotMeshes)
        mesh = Mesh(SIDE, (8,))
        self.expect_same_bytes(writer.write_text([(writer.words(mesh, 8), writer.blocks(mesh))]), scalars=("p", "c"))

    @unittest.skipUnless(IS_WHOLE, ONLY_WHOLE)
    def test_curved_cells(self):
        path = self.folder / "shell.vtu"
        points, cells = mesh_curved_test.shell(7, 3)
        write_xml(mesh_curved_test.grid_of(vtk.VTK_LAGRANGE_HEXAHEDRON, points, cells), path)
        self.expect_same_bytes(path, scalars=("p", "c"))
        write_xml(mesh_curved_test.grid_of(vtk.VTK_BEZIER_HEXAHEDRON, points, cells), path)
        self.expect_same_bytes(path, scalars=("p", "c"))

    def columns(self):
        """A writer of 60 x 40 quadrangles, or triangles, in 8 layers."""
        writer = self.writer(mesh_formats_test.Columns)
        writer.LAYERS, wide, high = 8, 60, 40
        y, x = np.meshgrid(np.arange(high + 1.0), np.arange(wide + 1.0), indexing="ij")
        writer.nodes = np.stack([x.ravel() + 0.1 * y.ravel(), y.ravel()], 1)
        first = [(wide + 1) * j + i for j in range(high) for i in range(wide)]
        writer.faces = [[n, n + 1, n + wide + 2, n + wide + 1] for n in first]
        writer.levels = np.linspace(0, 800, writer.LAYERS + 1)
        writer.t = mesh_formats_test.RANDOM.random((writer.LAYERS, len(writer.faces))).astype("f4")
        return writer

    @unittest.skipUnless(mesh_formats_test.netCDF4, "no python3-netcdf4")
    def test_ugrid(self):
        for column_by_column in some_of((False, True), 2):
            writer = self.columns()
            writer.write_ugrid(column_by_column=column_by_column)
            self.expect_same_bytes(writer.path, scalars=("t",))

    @unittest.skipUnless(IS_WHOLE, ONLY_WHOLE)
    @unittest.skipUnless(mesh_formats_test.netCDF4, "no python3-netcdf4")
    def test_icon(self):
        writer = self.columns()
        writer.write_icon()
        self.expect_same_bytes(writer.path, writer.folder / "icon_grid.nc", scalars=("t",))

    @unittest.skipUnless(IS_WHOLE, ONLY_WHOLE)
    @unittest.skipUnless(mesh_formats_test.netCDF4, "no python3-netcdf4")
    def test_mpas(self):
        writer = self.columns()
        heights = np.repeat(writer.levels[:, None], len(writer.faces), 1)
        for ocean in (False, True):
            writer.write_mpas(writer.nodes, writer.faces, heights, ocean)
            self.expect_same_bytes(writer.path, scalars=("t",))


if __name__ == "__main__":
    unittest.main()
