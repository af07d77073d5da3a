#!/usr/bin/python3
"""messages_test.py CURVISPLAT

What the program prints of small faulty files and of requests that cannot be met: it has to name the file, what is wrong with it, and
what helps. And what it prints for copying can be pasted. Exit status 77 (skipped) without python3-numpy.
"""
import gzip
import importlib.util
import json
import os
import shlex
import subprocess
import unittest

from format_case import PROGRAM, FormatCase, np

try:
    import netCDF4
except ImportError:
    netCDF4 = None

NI, NJ, NK = 6, 5, 4
NODES, CELLS = NI * NJ * NK, (NI - 1) * (NJ - 1) * (NK - 1)


def numbers(values):
    return "\n".join(map(repr, np.asarray(values, float).ravel().tolist())) + "\n"


K, J, I = np.meshgrid(np.arange(NK), np.arange(NJ), np.arange(NI), indexing="ij")
POINTS = np.stack([I, J, K], -1)
VALUES = I + 10.0 * J + K * K


class Messages(FormatCase):
    def test_small_numbers_in_a_text(self):
        """Round-off of zero in ASCII: a text has neither byte order nor precision to doubt."""
        z = ["1.0-101"] * 12 + ["1.0"] * 12 + ["2.0"] * 12
        k, j, i = np.meshgrid(np.arange(3), np.arange(3), np.arange(4), indexing="ij")
        path = self.write("small.xyz", "1\n4 3 3\n" + numbers(i) + numbers(j) + " ".join(z) + "\n")
        info = self.info(path)
        self.assertEqual((info["nodes"], info["bounds"]["upper"]), (36, [3, 2, 2]))
        huge = self.write("huge.xyz", "1\n4 3 3\n" + numbers(i) + numbers(j) + " ".join(["1e200"] * 36) + "\n")
        self.assertNotIn("--byte-order", self.run_program("info", huge).stderr)

    def test_names_of_formats_that_are_not_read(self):
        head = lambda n: "".join(f"{key:8}= {value:>20}".ljust(80) for key, value in n).ljust(2880)
        files = {"a.fits": (head((("SIMPLE", "T"), ("BITPIX", "-32"), ("NAXIS", "3"))) + 2880 * "\0", "a FITS image"), "a.vdb": ("\x20BDV" + 60 * "\0", "an OpenVDB file"),
                 "a.fvuns": ("\3\2\1\0FIELDVIEW" + 200 * "\0", "a FieldView file"), "a.tar": ("x.nc".ljust(257, "\0") + "ustar" + 300 * "\0", "a tar archive"),
                 "a.nc": ("<!DOCTYPE html>\n<html></html>\n", "a web page"), "b.nc": ("Error {\n    code = 404;\n};\n", "an OPeNDAP server"),
                 "c.nc": ("netcdf x {\ndimensions:\n\tlon = 4 ;\n}\n", "ncgen"), "a.mesh": ("MFEM mesh v1.0\n\ndimension\n3\n", "an MFEM mesh"),
                 "a.dx": ("object 1 class gridpositions counts 2 2 2\n", "an OpenDX file"), "a.lammpstrj": ("ITEM: TIMESTEP\n0\n", "a dump of LAMMPS"),
                 "a.cube": ("title\ncomment\n 1 0 0 0\n 2 1 0 0\n 2 0 1 0\n 2 0 0 1\n 1 1 0 0 0\n 1 2 3 4\n", "a cube file of Gaussian"),
                 "a.hierarchy": ("\nGrid = 1\nGridRank          = 3\n", "of Enzo"), "a.unv": ("    -1\n   164\n  1  SI\n    -1\n", "a universal file"),
                 "a.obj": ("# Blender\nmtllib a.mtl\no Cube\nv 0 0 0\nv 1 0 0\nv 0 1 0\ns off\nf 1 2 3\n", "a surface without a volume"),
                 "a.stl": ("solid of exported".ljust(80, "\0") + "\2\0\0\0" + 100 * "\1", "a surface without a volume"),
                 "a.msh": ("(0 machine configuration:)\n(4 (60 0 0 1 2 4 4 4 8 4 8 4))\n(3010 (1 1 8 1 3)(\0\0\0\1" + 200 * "\0", "a Fluent mesh"),
                 "b.msh": ("$NOD\n4\n" + "1 0 0 0\n2 1 0 0\n3 0 1 0\n4 0 0 1\n" + "$ENDNOD\n$ELM\n1\n1 4 1 1 4 1 2 3 4\n$ENDELM\n", "a Gmsh mesh of version 1"),
                 "a.tec": ("\ufeffVARIABLES = x y z\nZONE I=2 J=2 K=2\n", "begins with a byte order mark"),
                 "a.vtk": ("# vtk DataFile Version 3.0\nt\nASCII\nFIELD FieldData 1\nx 1 3 float\n1 2 3\n", "has field data alone, without a grid; expected STRUCTURED_GRID"),
                 "b.vtk": ("# vtk DataFile Version 3.0\nt\nASCII\nDATASET FIELD FieldData 1\nx 1 3 float\n1 2 3\n", "has field data alone, without a grid; expected STRUCTURED_GRID"),
                 "CHGCAR": ("Si\n 1.0\n", "of VASP"), "d3plot": ("\1" * 300, "of LS-DYNA")}
        for name, (text, words) in files.items():
            with self.subTest(name):
                result = self.run_program("info", self.write(name, text))
                self.assertEqual((result.returncode, result.stderr.count("\n")), (1, 1), result.stderr)
                self.assertIn(words, result.stderr)
        table = self.write("table.txt", "points of a probe\nn x y z\n" + "".join(f"{n} {n} 0 0.5\n" for n in range(9)))
        self.assertNotIn("cube file", self.run_program("info", table).stderr)
        case = self.write("case/system/controlDict", "FoamFile\n{\n}\n").parent.parent
        for path, command in ((case, "info"), (self.write("case/case.foam", ""), "info"), (case, "render"), (case, "convert")):
            result = self.run_program(command, path, *([] if command == "info" else ["-o", self.folder / ("a.png" if command == "render" else "a.splats")]))
            self.assertEqual((result.returncode, result.stderr.count("\n")), (1, 1), result.stderr)
            self.assertIn("an OpenFOAM case without a mesh: there is no constant/polyMesh (blockMesh", result.stderr)
        self.write("case/constant/polyMesh/blockMeshDict", "FoamFile\n{\n}\n")
        self.assertIn("without a mesh: constant/polyMesh lacks the file faces (blockMesh", self.run_program("info", case).stderr)
        for name, words in (("plt00010/Header", "a plotfile of AMReX"), ("sim.bp/md.idx", "an ADIOS2 file")):
            (self.folder / "plt00010" / "Level_0").mkdir(parents=True, exist_ok=True)
            self.assertIn(words, self.run_program("info", self.write(name, "x").parent).stderr)
        self.write("a.dat", 'TITLE\n= "a"\nVARIABLES\n= "x" "y" "z" "p"\nZONE I=2 J=2 K=2 F=POINT\n'
                   + "".join(f"{i} {j} {k} {i}\n" for k in (0, 1) for j in (0, 1) for i in (0, 1)))
        self.assertEqual(self.info(self.folder / "a.dat")["nodes"], 8)

    @unittest.skipUnless(importlib.util.find_spec("h5py"), "no h5py")
    def test_a_grid_alone_is_drawn_by_what_is_computed_from_it(self):
        os.environ["XDG_CACHE_HOME"] = str(self.folder / "kept")
        self.addCleanup(os.environ.pop, "XDG_CACHE_HOME")
        grid = self.write("alone.xyz", f"1\n{NI} {NJ} {NK}\n" + "".join(numbers(POINTS[..., axis]) for axis in range(3)))
        picture = ("-o", self.folder / "a.png", "--size", "20x20")
        self.assertIn("give a Q or function file as well, or choose a derived one with --scalar", self.run_program("render", grid, *picture).stderr)
        for scalar in ("volume", "jacobian"):  # the second is added to the cache of the first
            result = self.run_program("render", grid, "--scalar", scalar, *picture)
            self.assertEqual((result.returncode, scalar in result.stdout), (0, True), result.stderr)

    def test_layouts_of_plot3d_are_refused_for_other_formats(self):
        grid = self.vti("a.vti", "p")
        for option in (("--ascii",), ("--records", "4"), ("--iblank", "no")):
            result = self.run_program("info", grid, *option)
            self.assertEqual(result.returncode, 2)
            self.assertIn("tell the layout of PLOT3D files; leave them out", result.stderr)

    def test_options_of_globes_are_refused_for_other_grids(self):
        grid = self.vti("a.vti", "p")
        for option in (("--vertical-scale", "3"), ("--flat",), ("--sphere=6000",)):
            result = self.run_program("convert", grid, *option, "-o", self.folder / "a.splats")
            self.assertEqual(result.returncode, 2)
            self.assertIn("has no longitudes and latitudes; leave out", result.stderr)

    def test_names_of_hdf5_files_that_are_not_read(self):
        import h5py
        for group, words in (("ENS_MAA/mesh", "a MED file"), ("settings", "a Fluent case"), ("_silolibinfo", "a Silo file"), ("sim info", "of FLASH"), ("tstt", "a MOAB mesh")):
            with h5py.File(self.folder / "a.h5", "w") as f:
                f.create_group(group)
            self.assertIn(words, self.run_program("info", self.folder / "a.h5").stderr)
        with h5py.File(self.folder / "a.h5", "w") as f:
            f.attrs["openPMD"] = "1.1.0"
        self.assertIn("an openPMD file", self.run_program("info", self.folder / "a.h5").stderr)
        with h5py.File(self.folder / "b.h5", "w") as f:
            f["p"] = [1.0, 2.0]
        self.assertIn("describe its arrays in an XDMF file", self.run_program("info", self.folder / "b.h5").stderr)
        for name in ("b.h5.xdmf", "b.xmf"):
            described = self.write(name, "<Xdmf/>")
            self.assertIn(f"give {described} instead, which may describe its arrays", self.run_program("info", self.folder / "b.h5").stderr)

    def write(self, name, text):
        path = self.folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text)
        return path

    def pack(self, path):
        """Replaces the file by a compressed one."""
        packed = path.with_name(path.name + ".gz")
        packed.write_bytes(gzip.compress(path.read_bytes()))
        path.unlink()
        return packed

    def vti(self, name, *scalars, nodes=VALUES):
        extent = f"0 {NI - 1} 0 {NJ - 1} 0 {NK - 1}"
        arrays = "".join(f'<DataArray type="Float64" Name="{scalar}" format="ascii">\n{numbers(nodes)}</DataArray>' for scalar in scalars)
        return self.write(name, f'<VTKFile type="ImageData"><ImageData WholeExtent="{extent}" Origin="0 0 0" Spacing="1 1 1">'
                                f'<Piece Extent="{extent}"><PointData>{arrays}</PointData></Piece></ImageData></VTKFile>\n')

    def legacy(self, name):
        """With values of nodes, T, and of cells, Tcell."""
        return self.write(name, f"# vtk DataFile Version 3.0\nt\nASCII\nDATASET STRUCTURED_POINTS\nDIMENSIONS {NI} {NJ} {NK}\n"
                                "ORIGIN 0 0 0\nSPACING 1 1 1\n"
                                f"POINT_DATA {NODES}\nSCALARS T double\nLOOKUP_TABLE default\n{numbers(VALUES)}"
                                f"CELL_DATA {CELLS}\nSCALARS Tcell double\nLOOKUP_TABLE default\n{numbers(np.arange(CELLS))}")

    def wedge(self, name, *scalars):
        """An unstructured grid of one cell."""
        data = "".join(f"SCALARS {scalar} double\nLOOKUP_TABLE default\n1 2 3 4 5 6\n" for scalar in scalars)
        return self.write(name, "# vtk DataFile Version 3.0\nt\nASCII\nDATASET UNSTRUCTURED_GRID\nPOINTS 6 double\n"
                                "0 0 0 1 0 0 0 1 0 0 0 1 1 0 1 0 1 1\nCELLS 1 7\n6 0 1 2 3 4 5\nCELL_TYPES 1\n13\n"
                                f"POINT_DATA 6\n{data}")

    def case(self, name, undefined=False, capitals=False, steps=1):
        """A case of EnSight Gold in ASCII."""
        geometry = f"a\nb\nnode id off\nelement id off\npart\n1\nPart\nblock\n{NI} {NJ} {NK}\n{numbers(POINTS.transpose(3, 0, 1, 2))}"
        values = VALUES.copy()
        values[0, 0, 0] = -999
        variable = f"T\npart\n1\nblock{' undef' if undefined else ''}\n{'-999' if undefined else ''}\n{numbers(values)}"
        for text, ending in ((geometry, "geo"), (variable, "T")):
            for word in ("node id off", "element id off", "part\n", "block undef", "block\n") if capitals else ():
                text = text.replace(word, word.upper())
            self.write(f"{name}.{ending}", text)
        times = f"TIME\ntime set: 1\nnumber of steps: {steps}\ntime values: {' '.join(map(str, range(steps)))}\n"
        return self.write(f"{name}.case", f"FORMAT\ntype: ensight gold\nGEOMETRY\nmodel: {name}.geo\nVARIABLE\n"
                                          f"scalar per node: T {name}.T\n{times if steps > 1 else ''}")

    def su2(self, name, element):
        return self.write(name, f"NDIME= 3\nNELEM= 1\n{element}\nNPOIN= 6\n0 0 0\n1 0 0\n0 1 0\n0 0 1\n1 0 1\n0 1 1\n")

    def tecplot(self, name, more="", head=f"I={NI} J={NJ} K={NK}", values=VALUES):
        rows = np.column_stack([POINTS.reshape(-1, 3), values.ravel()])
        text = "\n".join(" ".join(map(repr, row)) for row in rows.tolist())
        return self.write(name, f"VARIABLES = x y z T\nZONE {head} F=POINT\n{text}\n{more}")

    def expect_error(self, words, text, status=1):
        result = self.run_program(*words)
        self.assertEqual(result.returncode, status, result.stderr)
        self.assertEqual(result.stderr.count("\n"), 1, result.stderr)
        self.assertIn(text, result.stderr)
        return result.stderr

    def test_what_is_to_be_copied_can_be_pasted(self):
        cache, picture = self.folder / "a.splats", self.folder / "a.png"
        self.assertEqual(self.run_program("convert", self.vti("a.vti", "Temperature [K]", "it's"), "-o", cache).returncode, 0)
        chosen = "chosen from the data: "
        command = ["render", cache, "-o", picture, "--size", "40x30"]
        printed = self.run_program(*command).stdout
        self.assertIn("--scalar 'Temperature [K]' ", printed)
        once = picture.read_bytes()
        again = self.run_program(*command, *shlex.split(printed[printed.index(chosen) + len(chosen):]))
        self.assertEqual(again.returncode, 0, again.stderr)
        self.assertNotIn(chosen, again.stdout)
        self.assertEqual(picture.read_bytes(), once)

    def test_a_temporary_folder_that_is_not_there(self):
        grid = self.vti("a.vti", "T")
        for folder in ("/there/is/none", str(grid), "x" * 5000):
            done = subprocess.run([PROGRAM, "info", grid], env={**os.environ, "TMPDIR": folder}, capture_output=True, text=True, check=False)
            self.assertEqual(done.returncode, 1)
            self.assertRegex(done.stderr, f"^curvisplat: TMPDIR={folder}: .*; set TMPDIR to a directory for temporary files, or unset it\n$")

    def test_compressed_files_name_files_beside_them(self):
        steps = [self.vti(f"parts/{n}.vti", "p") for n in range(2)]
        pvd = "".join(f'<DataSet timestep="{n}" file="parts/{path.name}"/>' for n, path in enumerate(steps))
        np.asarray(VALUES, "<f8").tofile(self.folder / "values.bin")
        item = f'<DataItem Format="Binary" Precision="8" Dimensions="{NK} {NJ} {NI}">values.bin</DataItem>'
        geometry = ('<Geometry GeometryType="ORIGIN_DXDYDZ"><DataItem Dimensions="3">0 0 0</DataItem>'
                    '<DataItem Dimensions="3">1 1 1</DataItem></Geometry>')
        for path in (self.write("a.pvd", f'<VTKFile type="Collection"><Collection>{pvd}</Collection></VTKFile>'),
                     self.write("a.vtm", '<VTKFile type="vtkMultiBlockDataSet"><vtkMultiBlockDataSet>'
                                         '<DataSet index="0" file="parts/0.vti"/></vtkMultiBlockDataSet></VTKFile>'),
                     self.write("a.vti.series", '{"files": [{"name": "parts/0.vti", "time": 0}]}'),
                     self.write("a.xmf", f'<Xdmf><Domain><Grid><Topology TopologyType="3DCoRectMesh" Dimensions="{NK} {NJ} {NI}"/>'
                                         f'{geometry}<Attribute Name="p">{item}</Attribute></Grid></Domain></Xdmf>'),
                     self.case("a")):
            with self.subTest(path.name):
                plain = self.info(path)
                packed = self.pack(path)
                info = self.info(packed)
                self.assertEqual(info["scalars"], plain["scalars"])
                self.assertEqual(info["files"], [str(packed) if file == str(path) else file for file in plain["files"]])

    def test_missing_parts_are_named_with_the_file_that_names_them(self):
        cases = {self.write("a.pvd", '<VTKFile type="Collection"><Collection><DataSet timestep="0" file="no.vti"/></Collection></VTKFile>'):
                 "no.vti",
                 self.write("a.vtm", '<VTKFile type="vtkMultiBlockDataSet"><vtkMultiBlockDataSet>'
                                     '<DataSet index="0" file="no.vti"/></vtkMultiBlockDataSet></VTKFile>'): "no.vti",
                 self.case("a"): "a.geo"}
        (self.folder / "a.geo").unlink()
        for path, part in cases.items():
            self.expect_error(["info", path], f"{path}: names {self.folder / part}, which does not exist")
        self.pack(self.vti("no.vti", "p"))
        self.expect_error(["info", self.folder / "a.vtm"], "no.vti, which does not exist; decompress no.vti.gz")

    def test_names_that_lead_out_of_the_folder_are_not_followed(self):
        (self.folder / "in").mkdir()
        self.vti("secret.vti", "p")
        item = '<DataItem Dimensions="2 2 2" Format="{}">{}</DataItem>'
        for name in ("../secret.vti", str(self.folder / "secret.vti"), "below/../../secret.vti", "/proc/self/environ"):
            for path in (self.write("in/a.pvd", f'<VTKFile type="Collection"><Collection><DataSet timestep="0" file="{name}"/></Collection></VTKFile>'),
                         self.write("in/a.vtm", f'<VTKFile type="vtkMultiBlockDataSet"><vtkMultiBlockDataSet><DataSet index="0" file="{name}"/>'
                                                '</vtkMultiBlockDataSet></VTKFile>'),
                         self.write("in/a.pvti", f'<VTKFile type="PImageData"><PImageData WholeExtent="0 1 0 1 0 1"><Piece Extent="0 1 0 1 0 1" '
                                                 f'Source="{name}"/></PImageData></VTKFile>'),
                         self.write("in/a.vti.series", json.dumps({"files": [{"name": name, "time": 0}]})),
                         self.write("in/a.p3d", json.dumps({"filenames": [{"time": 0, "xyz": name}]})),
                         self.write("in/a.case", f"FORMAT\ntype: ensight gold\nGEOMETRY\nmodel: {name}\n"),
                         *(self.write(f"in/a{kind}.xmf", '<Xdmf><Domain><Grid><Topology TopologyType="3DCoRectMesh" Dimensions="2 2 2"/>'
                                                         '<Geometry GeometryType="ORIGIN_DXDYDZ"><DataItem Dimensions="3">0 0 0</DataItem>'
                                                         '<DataItem Dimensions="3">1 1 1</DataItem></Geometry>'
                                                         f'<Attribute Name="p">{item.format(kind, name + end)}</Attribute></Grid></Domain></Xdmf>')
                           for kind, end in (("Binary", ""), ("HDF", ":/p")))):
                with self.subTest(path.name, name=name):
                    self.expect_error(["info", path], f"names {name}, which lies outside its folder; put both into one folder and correct the name")
        self.vti("in/below.vti", "p")
        self.info(self.write("in/a.vti.series", json.dumps({"files": [{"name": str(self.folder / "in" / "below.vti"), "time": 0}]})))

    def test_unstructured_caches_have_no_faces(self):
        cache = self.convert([self.wedge("a.vtk", "p")], "p")
        self.expect_error(["render", cache, "-o", self.folder / "a.png", "--surface", "all"],
                          "the cache is of an unstructured grid, whose faces are not kept; name an STL, PLY, OBJ or VTP file")

    def test_scalars_of_the_other_centring(self):
        grid, kept = self.legacy("a b.vtk"), self.folder / "kept"
        result = self.run_program("convert", grid, "-o", self.folder / "a.splats")
        self.assertIn("note: left out: Tcell, cell-centred: this cache holds the node-centred scalars; convert the others to a second "
                      "cache with --scalar NAME,NAME", result.stderr)
        result = subprocess.run([PROGRAM, "render", grid, "-o", self.folder / "a.png", "--size", "40x30", "--scalar", "Tcell"],
                                capture_output=True, text=True, check=False, env={**os.environ, "XDG_CACHE_HOME": str(kept)})
        self.assertEqual(result.returncode, 1)
        message = result.stderr.splitlines()[-1]
        self.assertIn(f"{grid}: Tcell is cell-centred", message)
        self.assertNotIn(str(kept), message)
        # The command that it prints is right.
        command = shlex.split(message[message.index("curvisplat convert") + len("curvisplat"):])
        self.assertEqual(command[:2], ["convert", str(grid)])
        command[command.index("NAME.splats")] = str(self.folder / "b.splats")
        result = self.run_program(*command)
        self.assertEqual(result.returncode, 0, result.stderr)

    def test_pictures_of_sets_follow_their_parts(self):
        part, picture = self.vti("part.vti", "p"), self.folder / "a.png"
        packed = self.pack(self.write("a.vtm", '<VTKFile type="vtkMultiBlockDataSet"><vtkMultiBlockDataSet>'
                                               '<DataSet index="0" file="part.vti"/></vtkMultiBlockDataSet></VTKFile>'))
        case = self.case("a")
        for path, change in ((packed, lambda: self.vti(part.name, "p", nodes=VALUES[:, :, ::-1] ** 2)),
                             (case, lambda: (self.folder / "a.T").write_text((self.folder / "a.T").read_text().replace("10.0", "50.0")))):
            with self.subTest(path.name):
                pictures = []
                for _ in range(2):
                    result = subprocess.run([PROGRAM, "render", path, "-o", picture, "--size", "40x30"], capture_output=True, text=True,
                                            check=False, env={**os.environ, "XDG_CACHE_HOME": str(self.folder / "kept")})
                    self.assertEqual(result.returncode, 0, result.stderr)
                    pictures.append(picture.read_bytes())
                    change()
                self.assertNotEqual(*pictures)

    def test_series_are_offered_whole(self):
        result = self.run_program("convert", self.case("a", steps=3), "-o", self.folder / "a.splats")
        self.assertIn("3 time steps from 0 to 2; using the first: choose with --time-step 0..2, or all of them with --steps all",
                      result.stderr)
        whole = self.run_program("convert", self.folder / "a.case", "-o", self.folder / "b.splats", "--steps", "all")
        self.assertEqual(whole.returncode, 0, whole.stderr)

    def test_a_first_step_of_one_value_is_said(self):
        head = f"I={NI} J={NJ} K={NK} STRANDID=1 SOLUTIONTIME="
        second = self.tecplot("second.dat", head=head + "1").read_text().split("\n", 1)[1]
        steps = self.tecplot("steps.dat", more=second, head=head + "0", values=np.zeros_like(VALUES))
        note = "the first step has one value of T everywhere; --time-step 1 takes the last step"
        for options, said in (([], True), (["--time-step", "0"], False), (["--time-step", "1"], False)):
            result = self.run_program("convert", steps, "-o", self.folder / "a.splats", "--overwrite", *options)
            self.assertEqual(note in result.stderr, said, result.stderr)

    def test_a_missing_cache_is_taken_for_one_of_a_like_name(self):
        """Folders and endings are alike in all of them."""
        self.run_program("convert", self.case("flow"), "-o", self.folder / "flow.splats")
        for name, meant in (("flwo.splats", True), ("crab.splats", False), ("mug.splats", False)):
            text = self.expect_error(["render", self.folder / name, "-o", self.folder / "a.png"], "does not exist")
            self.assertEqual("did you mean" in text, meant, text)

    def test_empty_files_are_of_no_format(self):
        for name in ("a.vtk", "a.xyz", "a"):
            self.assertNotIn("PLOT3D", self.expect_error(["info", self.write(name, "")], f"{name}: is empty; expected a grid file"))

    def test_tecplot_says_what_is_wrong_with_the_numbers(self):
        self.info(self.tecplot("a.dat"))
        self.expect_error(["info", self.tecplot("a.dat", head=f"I={NI} J={NJ}")],
                          f"has {4 * NODES} numbers; expected {4 * NI * NJ}, for 4 variables of {NI}x{NJ}x1 nodes; I, J, K, the list of "
                          "variables or DATAPACKING is wrong")
        self.expect_error(["info", self.tecplot("a.dat", head=f"I={NI} J={NJ} K={NK + 1}")],
                          f"has {4 * NODES} numbers; expected {4 * (NODES + NI * NJ)}")
        path = self.tecplot("a.dat", head=f"I={NI} J={NJ} K={NK + 1}", more="1 2 abc 4\n")
        self.expect_error(["info", path], f'line {NODES + 3} has "abc" after {4 * NODES + 2} of the {4 * (NODES + NI * NJ)} numbers')
        self.expect_error(["info", self.tecplot("a.dat", head=f"I={NI} J={NJ} K={NK + 1}", more="ZONE I=2 J=2 K=2\n")], "is truncated")

    def test_ensight_names_undefined_values_and_reads_capitals(self):
        path = self.case("a", undefined=True, capitals=True)
        result = self.run_program("convert", path, "-o", self.folder / "a.splats")
        self.assertEqual(result.returncode, 0, result.stderr)
        self.assertIn("magnitude, or undefined: T = -999)", result.stderr)
        self.assertEqual(self.info(path)["scalars"], self.info(self.case("b", undefined=True))["scalars"])
        self.assertIn("undefined: T = -999", self.run_program("info", path).stdout)

    def test_su2_elements_have_their_points(self):
        good = self.su2("a.su2", "13 0 1 2 3 4 5 0")
        self.assertIn("1 wedge\n", self.run_program("info", good).stdout)
        self.expect_error(["info", self.su2("b.su2", "13 0 1 2 3 4 5 0 1 0")], "line 3: an element of type 13 has 9 numbers; "
                          "expected 6 points and at most its own number")
        message = self.expect_error(["convert", good, "-o", self.folder / "a.splats", "--scalar", "p"],
                                    "there is no scalar 'p'; give a restart file as well")
        self.assertNotIn("derived", message)

    def test_openfoam_names_the_plain_file(self):
        head = "FoamFile {{ format ascii; class {}; object {}; }}\n"
        mesh = "constant/polyMesh"
        (self.folder / "case/constant").mkdir(parents=True)
        for name, kind in (("faces", "faceList"), ("owner", "labelList"), ("neighbour", "labelList")):
            self.write(f"case/{mesh}/{name}", head.format(kind, name) + "0 ()\n")
        self.assertNotIn(".gz", self.expect_error(["info", self.folder / "case"], f"{mesh}/points: cannot be opened"))

    def test_short_arrays_of_xdmf_are_named(self):
        np.zeros(7).tofile(self.folder / "short.bin")
        geometry = ('<Geometry GeometryType="ORIGIN_DXDYDZ"><DataItem Dimensions="3">0 0 0</DataItem>'
                    '<DataItem Dimensions="3">1 1 1</DataItem></Geometry>')
        for item in (f'<DataItem Dimensions="{NK} {NJ} {NI}">1 2 3</DataItem>',
                     f'<DataItem Format="Binary" Precision="8" Dimensions="{NK} {NJ} {NI}">short.bin</DataItem>'):
            path = self.write("a.xmf", f'<Xdmf><Domain><Grid Name="g"><Topology TopologyType="3DCoRectMesh" '
                                       f'Dimensions="{NK} {NJ} {NI}"/>{geometry}<Attribute Name="p">{item}</Attribute></Grid></Domain>'
                                       "</Xdmf>")
            self.expect_error(["info", path], "a.xmf: DataItem of Attribute p: ")

    def test_zero_has_no_sign(self):
        printed = self.run_program("info", self.vti("a.vti", "p", nodes=-VALUES)).stdout
        self.assertIn("-47 .. 0\n".replace("-47", f"{-VALUES.max():g}"), printed)
        self.assertNotIn("-0\n", printed)

    def test_nan_has_no_sign(self):
        conditions, nodes = np.full(4, -np.nan, "<f4"), np.ones((5, NK, NJ, NI), "<f4")
        sizes = np.array([NI, NJ, NK], "<i4").tobytes()
        (self.folder / "a.xyz").write_bytes(sizes + np.moveaxis(POINTS, -1, 0).astype("<f4").tobytes())
        for n in (1, 2):
            (self.folder / f"{n}.q").write_bytes(sizes + conditions.tobytes() + nodes.tobytes())
        self.assertIn("Mach NaN, alpha NaN, Reynolds NaN, time NaN\n", self.run_program("info", self.folder / "a.xyz", self.folder / "1.q").stdout)
        self.expect_error(["convert", self.folder / "a.xyz", self.folder / "?.q", "-o", self.folder / "a.splats"], "its time is NaN; expected a finite number")

    @unittest.skipUnless(netCDF4, "without python3-netcdf4")
    def test_nan_in_netcdf_has_no_sign_and_is_no_bound(self):
        with netCDF4.Dataset(self.folder / "a.nc", "w") as file:
            for name, unit, count in (("time", "days since 2000-01-01", 2), ("lat", "degrees_north", NJ), ("lon", "degrees_east", NI)):
                file.createDimension(name, count)
                variable = file.createVariable(name, "f8", (name,))
                variable.units = unit
                variable[:] = np.full(count, -np.nan) if name == "time" else np.arange(count)
            file.createDimension("depth", NK)
            depth = file.createVariable("depth", "f8", ("depth",))
            depth.units, depth.positive, depth[:] = "m", "down", np.arange(NK)
            values = file.createVariable("temp", "f4", ("time", "depth", "lat", "lon"))
            values.valid_min, values.missing_value = np.float32(-np.nan), np.float32(-np.nan)
            values[:] = np.broadcast_to(VALUES, (2, NK, NJ, NI))
        printed = self.run_program("info", self.folder / "a.nc").stdout
        self.assertIn("times     2 steps, NaN days since 2000-01-01 .. NaN days since 2000-01-01\n", printed)
        self.assertNotIn("valid_min", printed)
        self.assertNotIn("-nan", printed + self.run_program("convert", self.folder / "a.nc", "-o", self.folder / "a.splats").stderr)

    def test_a_list_of_a_thousand_names_is_cut(self):
        values = "".join(f"v{n} 1 8 float\n0 1 2 3 4 5 6 7\n" for n in range(1000))
        path = self.write("many.vtk", "# vtk DataFile Version 3.0\nmany\nASCII\nDATASET STRUCTURED_POINTS\nDIMENSIONS 2 2 2\nORIGIN 0 0 0\n"
                          f"SPACING 1 1 1\nPOINT_DATA 8\nFIELD FieldData 1000\n{values}")
        printed = self.run_program("convert", path, "-o", self.folder / "many.splats").stderr
        self.assertRegex(printed, "left out: v16, v17, .*, v55 and 944 more, beyond the 16 that are converted unasked; "
                         "choose scalars with --scalar NAME,NAME")

    def legacy_arrays(self, name, points, cells=()):
        parts = [f"{part}_DATA {count}\nFIELD FieldData {len(names)}\n" + "".join(
            f"{array} {components} {count} float\n" + " ".join(str(n) for n in range(components * count)) + "\n" for array, components in names)
            for part, count, names in (("POINT", 8, points), ("CELL", 1, cells)) if names]
        return self.write(name, "# vtk DataFile Version 3.0\nmany\nASCII\nDATASET STRUCTURED_POINTS\nDIMENSIONS 2 2 2\nORIGIN 0 0 0\n"
                          "SPACING 1 1 1\n" + "".join(parts))

    def test_components_are_left_out_before_scalars(self):
        path = self.legacy_arrays("tensor.vtk", [("B", 9), ("W", 3), ("k", 1), ("nut", 1), ("nuTilda", 1), ("p", 1)])
        printed = self.run_program("convert", path, "-o", self.folder / "tensor.splats").stderr
        self.assertIn("note: left out: B:8, beyond the 16 that are converted unasked; choose scalars with", printed)
        names = [variable["name"] for variable in self.manifest(self.folder / "tensor.splats")["variables"]]
        self.assertEqual(names, [f"B:{n}" for n in range(8)] + ["W:mag", "W:x", "W:y", "W:z", "k", "nut", "nuTilda", "p"])

    def test_cells_that_are_not_drawn_are_counted(self):
        path = self.write("t.vtk", "# vtk DataFile Version 3.0\nt\nASCII\nDATASET UNSTRUCTURED_GRID\nPOINTS 4 float\n0 0 0 1 0 0 0 1 0 0 0 1\n"
                          "CELLS 3 13\n4 0 1 2 3\n3 0 1 2\n3 0 1 3\nCELL_TYPES 3\n10\n5\n5\nCELL_DATA 3\nSCALARS c float 1\nLOOKUP_TABLE default\n1 2 3\n")
        self.assertIn("cells     3: 1 tetrahedron, 2 not solid or blanked by the file\n", self.run_program("info", path).stdout)
        self.assertIn("2 samples are of cells that are not solid, or blanked by the file\n",
                      self.run_program("convert", path, "-o", self.folder / "t.splats").stderr)

    def rendered(self, path, *options):
        cache = self.convert([path], "all")
        return self.run_program("render", cache, "-o", self.folder / "a.png", "--size", "160x160", *options).stderr

    def test_a_constant_scalar_gets_advice_that_can_be_followed(self):
        head = "# vtk DataFile Version 3.0\nc\nASCII\nDATASET STRUCTURED_POINTS\nDIMENSIONS 2 2 2\nORIGIN 0 0 0\nSPACING 1 1 1\n"
        arrays = "POINT_DATA 8\nFIELD FieldData 2\na 1 8 float\n0 0 0 0 0 0 0 0\nb 1 8 float\n1 1 1 1 1 1 1 {}\n"
        constant, varying = self.write("c.vtk", head + arrays.format(1)), self.write("v.vtk", head + arrays.format(2))
        self.assertIn("a is 0 everywhere, or nearly so\n", self.rendered(constant))
        self.assertIn("a is 0 everywhere, or nearly so; choose another --scalar\n", self.rendered(varying, "--scalar", "a"))
        self.assertNotIn("nearly so", self.rendered(varying))

    def test_a_small_part_of_another_colour_is_enough(self):
        def picture(part):
            values = " ".join(str(int(i < part and j < part)) for k in range(2) for j in range(41) for i in range(41))
            return self.rendered(self.write("s.vtk", "# vtk DataFile Version 3.0\ns\nASCII\nDATASET STRUCTURED_POINTS\nDIMENSIONS 41 41 2\n"
                                            "ORIGIN 0 0 0\nSPACING 1 1 4\nPOINT_DATA 3362\nSCALARS s float 1\nLOOKUP_TABLE default\n" + values),
                                 "--view", "+z", "--range", "0,1", "--opacity", "0:1,1:1", "--tf", "viridis", "--opacity-unit", "0.1")
        self.assertNotIn("of one colour", picture(11))
        self.assertIn("of one colour", picture(4))

    def test_well_known_scalars_choose_the_centring(self):
        path = self.legacy_arrays("cells.vtk", [("Dof", 1)], [("Density1", 1), ("other", 1)])
        printed = self.run_program("convert", path, "-o", self.folder / "cells.splats").stderr
        self.assertIn("note: left out: Dof, node-centred: this cache holds the cell-centred scalars", printed)
        path = self.legacy_arrays("points.vtk", [("Dof", 1), ("p", 1)], [("Density1", 1)])
        printed = self.run_program("convert", path, "-o", self.folder / "points.splats").stderr
        self.assertIn("note: left out: Density1, cell-centred", printed)

    def test_wrong_usage_of_a_part_leaves_no_folder(self):
        self.run_program("generate", "wake", "--size", "5x4x3", "--steps", "2", "-o", self.folder / "w")
        before = sorted(self.folder.iterdir())
        done = subprocess.run([PROGRAM, "convert", "w.xyz", "w_%04d.fun", "-o", "w.splats", "--part", "1/2", "--gamma", "0"], cwd=self.folder,
                              capture_output=True, text=True)
        self.assertEqual(done.returncode, 2, done.stderr)
        self.assertEqual(sorted(self.folder.iterdir()), before)
        done = subprocess.run([PROGRAM, "convert", "w.xyz", "w_%04d.fun", "-o", "w.splats", "--part", "1/2", "--memory", "1"], cwd=self.folder,
                              capture_output=True, text=True)
        self.assertEqual(done.returncode, 1, done.stderr)
        self.assertIn("--memory", done.stderr)
        self.assertEqual(sorted(self.folder.iterdir()), before)

    def test_lists_of_names_are_cut_wherever_they_stand(self):
        markers = "".join(f"MARKER_TAG= wall{n}\nMARKER_ELEMS= 0\n" for n in range(1000))
        path = self.write("many.su2", "NDIME= 3\nNELEM= 1\n10 0 1 2 3 0\nNPOIN= 4\n0 0 0 0\n1 0 0 1\n0 1 0 2\n0 0 1 3\n"
                          f"NMARK= 1000\n{markers}")
        self.assertIn("wall39 and 960 more", self.run_program("info", path).stdout)
        self.run_program("generate", "wake", "--size", "5x4x3", "-o", self.folder / "w")
        self.run_program("convert", self.folder / "w.xyz", self.folder / "w.fun", "-o", self.folder / "w.splats")
        path = self.write("many.csv", "x,y,z," + ",".join(f"v{n}" for n in range(900)) + "\n0,0,0" + ",1" * 900 + "\n")
        refused = self.run_program("render", self.folder / "w.splats", "-o", self.folder / "w.png", "--lines", path, "--lines-by", "absent")
        self.assertEqual(refused.returncode, 1, refused.stderr)
        self.assertIn("v38, v39 and 860 more", refused.stderr)

    def test_reports_replace_files_of_json_alone(self):
        self.run_program("generate", "wake", "--size", "5x4x3", "-o", self.folder / "w")
        grid, report = self.folder / "other.xyz", self.folder / "report.json"
        grid.write_bytes((self.folder / "w.xyz").read_bytes())
        before = grid.read_bytes()
        cache = ["convert", self.folder / "w.xyz", self.folder / "w.fun", "--overwrite", "-o", self.folder / "w.splats"]
        self.assertEqual(self.run_program(*cache).returncode, 0)
        for command in (cache, ["render", self.folder / "w.splats", "-o", self.folder / "w.png", "--size", "16x12"]):
            for option in ("--stats", "--trace"):
                refused = self.run_program(*command, option, grid)
                self.assertEqual(refused.returncode, 1, refused.stderr)
                self.assertRegex(refused.stderr, f"^curvisplat: {option} .*other.xyz: exists and is not a JSON file; choose another name")
                self.assertEqual(grid.read_bytes(), before)
        for _ in range(2):
            for option in ("--stats", "--trace"):
                self.assertEqual(self.run_program(*cache, option, report).returncode, 0)

    def test_thousands_of_tetrahedra_on_one_another_are_converted(self):
        zone = "ZONE N=4, E=1, ZONETYPE=FETETRAHEDRON, DATAPACKING=POINT\n0 0 0 1\n1 0 0 1\n0 1 0 1\n0 0 1 1\n1 2 3 4\n"
        path = self.write("many.dat", 'VARIABLES="x" "y" "z" "p"\n' + zone * 13000)
        done = self.run_program("convert", path, "-o", self.folder / "many.splats")
        self.assertEqual(done.returncode, 0, done.stderr)


if __name__ == "__main__":
    unittest.main()
