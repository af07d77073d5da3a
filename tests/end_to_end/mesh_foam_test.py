#!/usr/bin/python3
"""mesh_foam_test.py CURVISPLAT

Cases of OpenFOAM, written here as it writes them, against VTK's cells of the same mesh: ASCII and binary, packed, with
several processors, moving. Damaged cases get one line. Exit status 77 (skipped) without python3-vtk9.
"""
import gzip
import json
import os
import shutil
import sys
import unittest

try:
    import numpy as np
    import vtk
    from vtk.util.numpy_support import vtk_to_numpy

    from mesh_case import MeshCase
    from mesh_cubes import HEXAHEDRON_FACES, RANDOM, hexahedra, lattice
except ModuleNotFoundError as error:
    print(f"skipped: {error}; install python3-vtk9 and python3-numpy")
    sys.exit(77)


class FoamCase:
    """A case of hexahedra, as OpenFOAM writes it."""

    def __init__(self, folder, binary=False, packed=False, label_bytes=4, scalar_bytes=8, arch=True):
        self.folder, self.binary, self.packed, self.arch = folder, binary, packed, arch
        self.label_bytes, self.scalar_bytes = label_bytes, scalar_bytes

    def write(self, path, kind, *parts):
        arch = f'arch "LSB;label={8 * self.label_bytes};scalar={8 * self.scalar_bytes}";'
        head = (f"/*--- a comment ---*/\nFoamFile\n{{\n    version 2.0;\n    format {'binary' if self.binary else 'ascii'};\n"
                f"    {arch if self.binary and self.arch else ''}\n    class {kind};\n    object {path.name};\n}}\n// * * //\n\n")
        data = head.encode() + b"".join(part if isinstance(part, bytes) else part.encode() for part in parts) + b"\n"
        path.parent.mkdir(parents=True, exist_ok=True)
        if self.packed:
            path.with_name(path.name + ".gz").write_bytes(gzip.compress(data))
        else:
            path.write_bytes(data)

    def labels(self, values):
        values = np.asarray(values)
        if self.binary:
            return f"\n{len(values)}\n".encode() + self.raw(values.astype(f"<i{self.label_bytes}"))
        if len(values) > 1 and (values == values[0]).all():
            return f"{len(values)}{{{values[0]}}}"
        return f"{len(values)}\n(\n" + "\n".join(map(str, values)) + "\n)\n"

    def raw(self, values):
        """As UList::writeList: of an empty list nothing follows the count."""
        return b"(" + values.tobytes() + b")" if len(values) else b""

    def numbers(self, values):
        if self.binary:
            return f"\n{len(values)}\n".encode() + self.raw(np.ascontiguousarray(values, f"<f{self.scalar_bytes}"))
        values = np.asarray(values)
        row = lambda v: repr(float(v)) if np.ndim(v) == 0 else "(" + " ".join(repr(float(x)) for x in v) + ")"
        if len(values) > 1 and (values == values[0]).all():
            return f"{len(values)}{{{row(values[0])}}}"
        return f"{len(values)}\n(\n" + "\n".join(map(row, values)) + "\n)\n"

    def write_mesh(self, where, points, cells):
        faces, owner, neighbour, number = [], [], {}, {}
        for n, c in enumerate(cells):
            for f in HEXAHEDRON_FACES:
                ids = [int(c[m]) for m in f]
                key = tuple(sorted(ids))
                if key in number:
                    neighbour[number[key]] = n
                else:
                    number[key] = len(faces)
                    faces.append(ids)
                    owner.append(n)
        # Internal faces come first.
        order = sorted(range(len(faces)), key=lambda f: (f not in neighbour, owner[f], neighbour.get(f, 0)))
        mesh = where / "polyMesh"
        self.write(mesh / "points", "vectorField", self.numbers(points))
        if self.binary:
            ends = np.cumsum([0] + [len(faces[f]) for f in order])
            self.write(mesh / "faces", "faceCompactList", self.labels(ends), "\n",
                       self.labels([p for f in order for p in faces[f]]))
        else:
            self.write(mesh / "faces", "faceList", f"{len(order)}\n(\n",
                       "".join(f"{len(faces[f])}({' '.join(map(str, faces[f]))})\n" for f in order), ")\n")
        self.write(mesh / "owner", "labelList", self.labels([owner[f] for f in order]))
        self.write(mesh / "neighbour", "labelList", self.labels([neighbour[f] for f in order if f in neighbour]))
        patches = (f"1\n(\n    walls\n    {{\n        type wall;\n        nFaces {len(order) - len(neighbour)};\n"
                   f"        startFace {len(neighbour)};\n    }}\n)\n")
        binary, self.binary = self.binary, False
        self.write(mesh / "boundary", "polyBoundaryMesh", patches)
        self.binary = binary

    def write_field(self, time, name, values):
        kind, of = (("volScalarField", "scalar") if np.ndim(values) < 2 else ("volVectorField", "vector"))
        what = f"uniform {values};" if np.ndim(values) == 0 else None
        of = f"List<{of}> " if len(np.atleast_1d(values)) else ""
        parts = ([what] if what else [f"nonuniform {of}", self.numbers(values), ";"])
        self.write(time / name, kind, "dimensions [0 2 -2 0 0 0 0];\n\ninternalField   ", *parts,
                   "\n\nboundaryField\n{\n    walls { type zeroGradient; }\n}\n")


class MeshFoam(MeshCase):
    def foam_case(self, n=4, parts=1, **how):
        case = self.folder / "case"
        shutil.rmtree(case, ignore_errors=True)
        writer = FoamCase(case, **how)
        points, cells = lattice(n), hexahedra(n)
        middles = points[cells].mean(1)
        p, u = middles @ [1.0, 2.0, 3.0], np.stack([middles[:, 1], -middles[:, 0], 0 * middles[:, 2] + 2], 1)
        for part in range(parts):
            mine = np.arange(len(cells)) % 7 % parts == part if parts > 1 else np.ones(len(cells), bool)
            used, local = np.unique(cells[mine], return_inverse=True)
            folder = case / f"processor{part}" if parts > 1 else case
            writer.write_mesh(folder / "constant", points[used], local.reshape(-1, 8))
            for time in ("0", "0.5"):
                writer.write_field(folder / time, "p", p[mine] + float(time))
                writer.write_field(folder / time, "U", u[mine])
                writer.write_field(folder / time, "T", 300)
        (case / "case.foam").write_text("")
        return case, p, u

    def test_openfoam_cases(self):
        for how in ({}, {"binary": True}, {"binary": True, "label_bytes": 8}, {"packed": True},
                    {"binary": True, "packed": True}, {"binary": True, "label_bytes": 8, "scalar_bytes": 4, "arch": False}):
            with self.subTest(**how):
                case, p, u = self.foam_case(**how)
                for path in (case, case / "case.foam"):
                    info = self.info(path)
                    self.assertEqual(info["nodes"], 125)
                    self.assertEqual(info["cells"]["polyhedra"], 64)
                    self.assertEqual(info["times"], [0, 0.5])
                    scalars = {scalar["name"]: scalar for scalar in info["scalars"]}
                    self.assertEqual(sorted(scalars), ["T", "U:mag", "U:x", "U:y", "U:z", "p"])
                    self.assertAlmostEqual(scalars["p"]["max"], p.max(), places=5)
                    self.assertAlmostEqual(scalars["U:mag"]["min"], np.linalg.norm(u, axis=1).min(), places=5)
                    self.assertEqual(scalars["T"]["min"], 300)
                    self.assertAlmostEqual(self.volume(path, "p"), 1, delta=2e-3)
                # VTK's own reader knows the case, too.
                if not how.get("packed") and how.get("label_bytes", 4) == 4:
                    reader = vtk.vtkOpenFOAMReader()
                    reader.SetFileName(str(case / "case.foam"))
                    reader.Update()
                    block = reader.GetOutput().GetBlock(0)
                    self.assertEqual(block.GetNumberOfCells(), 64)
                    np.testing.assert_allclose(vtk_to_numpy(block.GetCellData().GetArray("p")), p, rtol=1e-6)

    def test_exact_values_without_the_name_of_the_case(self):
        for how in ({}, {"packed": True}, {"parts": 2}):
            with self.subTest(**how):
                case, p, _ = self.foam_case(**how)
                at = ",".join(map(str, lattice(4)[hexahedra(4)[5]].mean(0)))
                for step, added in (("0", 0), ("1", 0.5)):
                    cache = self.convert([case], "p", "--time-step", step)
                    told = self.run_program("info", cache, f"--probe={at}", "--source", "--json")
                    self.assertEqual(told.returncode, 0, told.stderr)
                    value = json.loads(told.stdout)["probe"]["values"][0]["value"]
                    self.assertAlmostEqual(value, p[5] + added, places=5)

    def test_openfoam_times_and_moving_meshes(self):
        case, p, _ = self.foam_case()
        result = self.run_program("info", case, "--json", "--time-step", "1")
        scalars = {scalar["name"]: scalar for scalar in json.loads(result.stdout)["scalars"]}
        self.assertAlmostEqual(scalars["p"]["max"], p.max() + 0.5, places=5)
        for name in ("nan", "inf"):
            (case / name).mkdir()
        self.assertEqual(self.info(case)["times"], [0, 0.5])
        FoamCase(case).write(case / "0.5" / "polyMesh" / "points", "vectorField",
                             FoamCase(case).numbers(2 * lattice(4)))
        result = self.run_program("info", case, "--json", "--time-step", "1")
        self.assertEqual(json.loads(result.stdout)["bounds"]["upper"], [2, 2, 2])
        self.assertEqual(self.info(case)["bounds"]["upper"], [1, 1, 1])

    def test_decomposed_openfoam_cases_are_one_mesh(self):
        RANDOM.bit_generator.state = np.random.default_rng(3).bit_generator.state
        case, _, _ = self.foam_case()
        expected = self.volume(case, "p")
        RANDOM.bit_generator.state = np.random.default_rng(3).bit_generator.state
        case, _, _ = self.foam_case(parts=3)
        info = self.info(case)
        self.assertEqual([piece["name"] for piece in info["pieces"]], ["processor0", "processor1", "processor2"])
        self.assertAlmostEqual(self.volume(case, "p"), expected, delta=1e-6)

    def test_what_cannot_be_looked_at_is_not_missing(self):
        case, p, _ = self.foam_case(parts=3)
        told = lambda *options: self.run_program("info", case, *options).stderr
        (case / "processor1").rename(case / "kept")
        self.assertIn("processor1: is missing; the case has processors up to processor2", told())
        (case / "processor1").symlink_to("processor1")
        self.assertIn("processor1", told())
        (case / "processor1").unlink()
        (case / "processor1").mkdir()
        self.assertIn("processor1: has no mesh", told())
        for at_fault in ("polyMesh", "polyMesh/points"):
            case, p, _ = self.foam_case()
            path = case / "0.5" / at_fault
            path.parent.mkdir(exist_ok=True)
            for target, words in ((path.name, "cannot be looked at"), ("none", "is a link to none")):
                path.symlink_to(target)
                self.assertIn(words, told("--time-step", "1"))
                path.unlink()
        case, p, _ = self.foam_case()
        for name in ("loop", "7"):
            (case / name).symlink_to(name)
            if name == "loop":
                self.assertEqual(self.info(case)["times"], [0, 0.5])
        self.assertIn("7: cannot be looked at", told())
        (case / "7").unlink()
        (case / "0" / "p").unlink()
        (case / "0" / "p").symlink_to("p")
        self.assertIn("cannot be looked at: Too many levels of symbolic links; p is left out", "".join(self.info(case)["warnings"]))

    def test_includes_stay_in_the_case_and_are_few(self):
        case, _, _ = self.foam_case()
        (case / "system").mkdir()
        (self.folder / "outside").write_text("secret 5;\n")
        field = "dimensions [0 2 -2 0 0 0 0];\ninternalField uniform $secret;\n"
        for name in ("../../outside", str(self.folder / "outside"), "$FOAM_CASE/../outside"):
            FoamCase(case).write(case / "0" / "p", "volScalarField", f'#include "{name}"\n', field)
            self.assertIn(f'includes "{name}", which lies outside the case', "".join(self.info(case)["warnings"]))
        FoamCase(case).write(case / "0" / "p", "volScalarField", '#include "a"\n', field)
        (case / "0" / "a").write_text('#include "a"\n' * 30)
        self.assertIn("includes more than 100 files", "".join(self.info(case)["warnings"]))

    def test_collated_files_hold_all_processors(self):
        """As decomposedBlockData::writeBlockEntry; the first part has the header of the file that it stands for."""
        for binary in (False, True):
            for name in ("processors3", "processors"):
                RANDOM.bit_generator.state = np.random.default_rng(3).bit_generator.state
                case, p, _ = self.foam_case(parts=3, binary=binary)
                expected = self.volume(case, "p")
                for path in sorted((case / "processor0").rglob("*")):
                    if not path.is_file() or path.name == "boundary":
                        continue
                    inside = path.relative_to(case / "processor0")
                    parts = [(case / f"processor{n}" / inside).read_bytes() for n in range(3)]
                    parts[1:] = [part[part.index(b"// * * //") + 9:] for part in parts[1:]]
                    (case / name / inside).parent.mkdir(parents=True, exist_ok=True)
                    (case / name / inside).write_bytes(
                        b"FoamFile\n{\n    version     2.0;\n    format      binary;\n    class       decomposedBlockData;\n"
                        b'    arch        "LSB;label=32;scalar=64";\n    note        "no meaning";\n    object      x;\n}\n// * //\n'
                        + b"".join(b"\n// Processor%d\n\n%d\n(" % (n, len(part)) + part + b")\n" for n, part in enumerate(parts)))
                for n in range(3):
                    shutil.rmtree(case / f"processor{n}")
                info = self.info(case)
                self.assertEqual(len(info["pieces"]), 3)
                self.assertEqual(info["times"], [0, 0.5])
                self.assertAlmostEqual({s["name"]: s for s in info["scalars"]}["p"]["max"], p.max(), places=5)
                self.assertAlmostEqual(self.volume(case, "p"), expected, delta=1e-6)
                faces = case / name / "constant" / "polyMesh" / "faces"
                faces.write_bytes(faces.read_bytes()[:-500])
                self.assertIn("is truncated", self.run_program("info", case).stderr)

    def test_a_case_with_a_mesh_of_its_own_and_processors(self):
        case, p, _ = self.foam_case()
        shutil.copytree(case, self.folder / "processor0")
        shutil.move(self.folder / "processor0", case)
        self.assertEqual(len(self.info(case)["pieces"]), 1)
        FoamCase(case).write_field(case / "processor0" / "200", "p", p + 200)
        info = self.info(case)
        self.assertEqual(info["times"], [0, 0.5, 200])
        self.assertIn("those in its own folder end at 0.5", "".join(info["notes"]))
        shutil.rmtree(case / "0.5")
        FoamCase(case).write_field(case / "200", "p", p + 200)
        info = self.info(case)
        self.assertEqual(info["times"], [0, 200])
        self.assertIn("its processors have 3", "".join(info["notes"]))

    def test_values_that_other_entries_define(self):
        """As the tutorials' 0/p: `#include "include/initialConditions"`, `internalField uniform $pressure;`."""
        case, _, _ = self.foam_case()
        (case / "0" / "include").mkdir()
        (case / "0" / "include" / "initialConditions").write_text(
            "/* */\nflowVelocity         (20 0 0);\npressure             3;\n#inputMode           merge\n\n// ** //\n")
        head = "dimensions [0 2 -2 0 0 0 0];\n"
        writer = FoamCase(case)
        writer.write(case / "0" / "p", "volScalarField", '#include        "include/initialConditions"\n', head, "internalField   uniform $pressure;\n")
        writer.write(case / "0" / "U", "volVectorField", '#include "include/initialConditions"\n', head, "all uniform ${flowVelocity};\ninternalField   $all;\n")
        writer.write(case / "0" / "V", "volScalarField::Internal", head, "value nonuniform List<scalar> 64{0.5};\n")
        for name, value in (("a", "uniform $unknown"), ("b", "#codeStream { code #{ 1 #}; }"), ("loop", "uniform $loop"), ("d", "uniform #calc \"1\"")):
            writer.write(case / "0" / name, "volScalarField", head, f"loop $loop;\ninternalField {value};\n")
        info = self.info(case)
        scalars = {scalar["name"]: scalar for scalar in info["scalars"]}
        self.assertEqual(sorted(scalars), ["T", "U:mag", "U:x", "U:y", "U:z", "V", "p"])
        self.assertEqual([scalars[name]["max"] for name in ("p", "U:x", "U:y", "V")], [3, 20, 0, 0.5])
        for name in ("a", "b", "loop", "d"):
            self.assertIn(f"{name} is left out", "".join(info["warnings"]))
        self.assertIn("foamDictionary -expand", "".join(info["warnings"]))

    def test_entries_that_replace_others_and_conditions(self):
        """The last entry of a name counts, also across files. What follows #if, #ifeq and #else is read where it holds."""
        case, _, _ = self.foam_case()
        (case / "0" / "values").write_text("inner $outer;\ntwice 2;\n")
        head = "dimensions [0 2 -2 0 0 0 0];\n"
        writer = FoamCase(case)
        fields = {"a": ('twice 1;\n#include "values"\n', "$twice", 2), "b": ('#include "values"\ntwice 3;\n', "$twice", 3),
                  "c": ('outer 5;\n#include "values"\nouter 6;\n', "$inner", 5),
                  "d": ("k x;\nv 1;\n#ifeq $k x\nv 2;\n#else\nv 3;\n#endif\n", "$v", 2),
                  "e": ("k x;\n#ifeq $k y\n#if 1\nv 1;\n#else\nv 4;\n#endif\nv 2;\n#else\nv 3;\n#endif\n", "$v", 3),
                  "f": ("v 1;\n#if off\nv 2;\n#endif\n", "$v", 1), "g": ("v 1;\n#if true\nv 2;\n#endif\n", "$v", 2),
                  "i": ("v 1;\n#ifeq 1 1.0\nv 2;\n#endif\n", "$v", 2), "j": ("k x;\nv 1;\n#ifeq ($k x)\nv 2;\n#endif\n", "$v", 2)}
        for name, (entries, value, _) in fields.items():
            writer.write(case / "0" / name, "volScalarField", entries, head, f"internalField uniform {value};\n")
        for name, condition in (("h", "#if $unknown"), ("l", "#if 0\nv 3;\n#elif 1")):
            writer.write(case / "0" / name, "volScalarField", f"v 1;\n{condition}\nv 2;\n#endif\n", head, "internalField uniform $v;\n")
        info = self.info(case)
        scalars = {scalar["name"]: scalar["max"] for scalar in info["scalars"]}
        self.assertEqual({name: scalars.get(name) for name in fields}, {name: value for name, (_, _, value) in fields.items()})
        self.assertIn('has "$unknown" in the place of a word of #if', "".join(info["warnings"]))
        self.assertIn('has "#elif" in the place of #else or #endif', "".join(info["warnings"]))
        self.assertFalse({"h", "l"} & set(scalars))

    def test_spherical_tensors_and_fields_without_boundaries_of_old_versions(self):
        case, p, _ = self.foam_case()
        writer = FoamCase(case)
        head = "dimensions [0 2 -2 0 0 0 0];\n"
        rows = "\n".join(f"({value!r})" for value in p.tolist())
        writer.write(case / "0" / "a", "volSphericalTensorField", head, f"internalField nonuniform List<sphericalTensor> 64\n(\n{rows}\n);\n")
        writer.write(case / "0" / "b", "volSphericalTensorField", head, "internalField uniform (4);\n")
        writer.write(case / "0" / "c", "volScalarField::DimensionedInternalField", head, "value nonuniform List<scalar> 64{0.5};\n")
        scalars = {scalar["name"]: scalar["max"] for scalar in self.info(case)["scalars"]}
        self.assertEqual([round(scalars.get(name, 0), 5) for name in "abc"], [round(p.max(), 5), 4, 0.5])

    def test_a_field_of_another_mesh_is_left_out(self):
        for binary in (False, True):
            with self.subTest(binary=binary):
                case, p, _ = self.foam_case(binary=binary)
                FoamCase(case, binary=binary).write_field(case / "0", "a", p[:10])
                info = self.info(case)
                self.assertEqual(info["cells"]["polyhedra"], 64)
                self.assertEqual([s["name"] for s in info["scalars"]], ["T", "U:mag", "U:x", "U:y", "U:z", "p"])
                self.assertIn("a: has 10 values; expected 64, one for each cell; a is left out", "".join(info["warnings"]))
                self.assertAlmostEqual(self.volume(case, "p"), 1, delta=2e-3)

    def test_scoped_macros_and_files_of_the_case(self):
        """As the tutorials' `uniform $:Uinf;`, `$dictionary.entry` and `#include "$FOAM_CASE/system/values"`."""
        case, _, _ = self.foam_case()
        (case / "system").mkdir()
        (case / "system" / "values").write_text("inlet { p 7; deep { q 8; } }\n")
        writer = FoamCase(case)
        head = "dimensions [0 2 -2 0 0 0 0];\n"
        writer.write(case / "0" / "U", "volVectorField", head, "Uinf (1 2 2);\ninternalField uniform $:Uinf;\n")
        for name, value in (("p", "$inlet.p"), ("q", "${inlet.deep.q}"), ("r", "$:inlet/deep/q")):
            writer.write(case / "0" / name, "volScalarField", '#include "$FOAM_CASE/system/values"\n', head, f"internalField uniform {value};\n")
        writer.write(case / "0" / "s", "volVectorField", '#include "<case>/none"\n', head, "internalField uniform $inlet.s;\n")
        info = self.info(case)
        scalars = {scalar["name"]: scalar["max"] for scalar in info["scalars"]}
        self.assertEqual([scalars[name] for name in ("U:mag", "p", "q", "r")], [3, 7, 8, 8])
        self.assertIn('has "$inlet.s" in the place of', info["warnings"][0])
        self.assertIn('its #include "<case>/none" is not found', info["warnings"][0])

    def test_fields_of_later_times(self):
        case, p, u = self.foam_case()
        writer = FoamCase(case)
        for time in ("0.5", "2"):
            writer.write_field(case / time, "yPlus", p)
            writer.write_field(case / time, "UMean", u)
        writer.write_field(case / "2", "k", p)
        writer.write(case / "0" / "p", "volScalarField", "dimensions [0 2 -2 0 0 0 0];\ninternalField #calc \"1\";\n")
        expected = ["UMean, p, yPlus are read from time 0.5 on, not at time 0: convert with --time-step 1, or with --steps 1:2 for a series",
                    "k is read from time 2 on, not at time 0: convert with --time-step 2, or with --steps 2:2 for a series"]
        self.assertEqual(self.info(case)["warnings"][1:], expected)
        result = self.run_program("convert", case, "--steps", "all", "--scalar", "T", "-o", self.folder / "s.splats")
        self.assertIn(expected[0], result.stderr)
        result = self.run_program("convert", case, "--steps", "1:", "--scalar", "yPlus", "-o", self.folder / "s.splats", "--overwrite")
        self.assertEqual(result.returncode, 0, result.stderr)
        self.assertIn("2 steps", result.stdout)

    def test_fields_that_not_all_times_have(self):
        """As usual: what only the initial time has, or some of the later ones, is left out of a series that names no scalar."""
        case, p, _ = self.foam_case()
        writer = FoamCase(case)
        for time in ("1", "2"):
            for name in ("p", "T"):
                writer.write_field(case / time, name, p + float(time))
        writer.write_field(case / "0", "epsilon", p)
        for time in ("0", "0.5", "2"):
            writer.write_field(case / time, "nut", p)
        for steps, kept in (("all", ["T", "p"]), ("0:3:3", ["T", "nut", "p"])):
            result = self.run_program("convert", case, "--steps", steps, "-o", self.folder / "s.splats", "--overwrite")
            self.assertEqual(result.returncode, 0, result.stderr)
            self.assertIn("left out: ", result.stderr)
            manifest = self.manifest(self.folder / "s.splats")
            self.assertEqual(sorted(variable["name"] for variable in manifest["variables"]), kept)
        result = self.run_program("convert", case, "--steps", "all", "--scalar", "epsilon", "-o", self.folder / "s.splats", "--overwrite")
        self.assertIn("has no scalar 'epsilon'", result.stderr)

    def test_a_picture_reads_and_notes_the_first_time_alone(self):
        os.environ["XDG_CACHE_HOME"] = str(self.folder / "kept")
        self.addCleanup(os.environ.pop, "XDG_CACHE_HOME")
        case, p, _ = self.foam_case()
        kept = self.folder / "kept" / "curvisplat"

        def caches_after_a_picture(path):
            result = self.run_program("render", path, "--scalar", "p", "-o", self.folder / "p.png", "--size", "20x20")
            self.assertEqual(result.returncode, 0, result.stderr)
            return len(list(kept.glob("*/*.splats")))

        self.assertEqual(caches_after_a_picture(case), 1)
        read = [path for path in case.rglob("*") if path.is_file() and path.parent.name != "0.5"]
        self.assertEqual(len(list((kept / "known").iterdir())), len(read))
        writer = FoamCase(case)
        writer.write_field(case / "0.5", "p", p + 7)
        self.assertEqual(caches_after_a_picture(case), 1)
        writer.write_field(case / "0", "p", p + 7)
        self.assertEqual(caches_after_a_picture(case), 2)
        # The file that stands for a case is empty, and has one name in all of them.
        self.assertEqual(caches_after_a_picture(case / "case.foam"), 3)
        writer.write_field(case / "0", "p", p + 8)
        self.assertEqual(caches_after_a_picture(case / "case.foam"), 4)
        known = len(list((kept / "known").iterdir()))
        for folder in ("postProcessing", "results"):
            (case / folder).mkdir()
            with open(case / folder / "huge", "wb") as huge:
                huge.truncate(5 << 20)
        self.assertEqual(caches_after_a_picture(case / "case.foam"), 4)
        self.assertEqual(len(list((kept / "known").iterdir())), known)
        (case / "results" / "included").write_text("a 1;")
        self.assertEqual(caches_after_a_picture(case / "case.foam"), 5)

    def test_regions(self):
        """As chtMultiRegionFoam: two cubes side by side, of which one alone has U."""
        def write(where):
            writer, points, cells = FoamCase(where), np.stack(np.meshgrid([0, 1], [0, 1], [0, 1], indexing="ij"), -1)[..., ::-1].reshape(-1, 3) * 1.0, [[0, 1, 3, 2, 4, 5, 7, 6]]
            for x, region in enumerate(("fluid", "solid")):
                writer.write_mesh(where / "constant" / region, points + [x, 0, 0], cells)
                writer.write_field(where / "0" / region, "T", 300 + x)
            writer.write(where / "0" / "fluid" / "U", "volVectorField", "internalField uniform (3 0 4);\n")
            return where

        case = write(self.folder / "cht")
        (case / "case.foam").write_text("")
        for path in (case, case / "case.foam"):
            info = self.info(path)
            scalars = {scalar["name"]: (scalar["min"], scalar["max"]) for scalar in info["scalars"]}
            self.assertEqual(([piece["name"] for piece in info["pieces"]], scalars["T"], scalars["U:mag"]), (["fluid", "solid"], (300, 301), (5, 5)))
            self.assertIn("1 of 2 regions have no U", info["warnings"][0])
            self.assertIn("constant/fluid gives one of them", info["notes"][0])
            self.assertAlmostEqual(self.volume(path, "T"), 2, delta=4e-3)
        faces = case / "constant" / "solid" / "polyMesh" / "faces"
        faces.rename(faces.with_name("kept"))
        info = self.info(case)
        self.assertEqual([piece["name"] for piece in info["pieces"]], ["fluid"])
        self.assertIn("the file 'faces' is missing in constant/solid/polyMesh: what lies there is left out", info["warnings"])
        self.assertEqual(self.info(case / "constant" / "fluid")["warnings"], [])
        faces.with_name("kept").rename(faces)
        info = self.info(case / "constant" / "solid")
        self.assertEqual(([piece["name"] for piece in info["pieces"]], info["scalars"][0]["max"]), (["solid"], 301))
        # A mesh outside of regions is read alone, and so are the regions of processors.
        FoamCase(case).write_mesh(case / "constant", lattice(4), hexahedra(4))
        info = self.info(case)
        self.assertEqual(info["nodes"], 125)
        self.assertIn("the regions fluid, solid have meshes of their own", info["warnings"][0])
        write(self.folder / "split" / "processor0")
        self.assertEqual([piece["name"] for piece in self.info(self.folder / "split")["pieces"]], ["fluid, processor0", "solid, processor0"])
        for inside in ("0", "constant"):
            result = self.run_program("info", case / inside)
            self.assertIn("is a folder within an OpenFOAM case", result.stderr)

    def test_damaged_openfoam_cases_get_one_line(self):
        def expect_line(case, name):
            result = self.run_program("convert", case, "-o", self.folder / "d.splats", "--overwrite", "--scalar", "p")
            self.assertEqual(result.returncode, 1, (name, result.stderr))
            self.assertEqual(result.stderr.count("\n"), 1, result.stderr)
            self.assertIn("case", result.stderr)

        for binary in (False, True):
            for name in ("points", "faces", "owner", "neighbour", "p"):
                case, _, _ = self.foam_case(binary=binary)
                path = case / "0" / name if name == "p" else case / "constant" / "polyMesh" / name
                data = path.read_bytes()
                # Behind the values of a field nothing is read.
                for length in (10, 60, len(data) // 2, len(data) - (120 if name == "p" else 3)):
                    with self.subTest(binary=binary, name=name, length=length):
                        path.write_bytes(data[:length])
                        expect_line(case, name)
        case, _, _ = self.foam_case()
        for name, old, new in (("owner", "\n0\n", "\n999999\n"), ("owner", "\n0\n", "\n-5\n"),
                               ("faces", "4(", "9("), ("faces", "(0 ", "(99999 "), ("points", "(0.0", "(nope")):
            path = case / "constant" / "polyMesh" / name
            text = path.read_text()
            path.write_text(text.replace(old, new, 1))
            with self.subTest(name=name, new=new):
                expect_line(case, name)
            path.write_text(text)
        (case / "constant" / "polyMesh" / "points").unlink()
        expect_line(case, "points")


if __name__ == "__main__":
    unittest.main()
