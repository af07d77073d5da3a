#!/usr/bin/python3
"""many_pieces_test.py CURVISPLAT

Grids of many pieces and of many variables, by a process that may have few open files: what the readers keep on disk is in few
files. And names that come many times, or that many grids lack.
"""
import json
import os
import pathlib
import resource
import subprocess
import sys
import tempfile
import unittest

PROGRAM = str(pathlib.Path(sys.argv.pop(1)).resolve())
FILES = 64  # may be open; the readers themselves keep a quarter of them
MANY = 90   # a file that is kept for each takes two descriptors
CUBE = [(x, y, z) for z in (0, 1) for y in (0, 1) for x in (0, 1)]
CORNERS = (0, 1, 3, 2, 4, 5, 7, 6)  # of a hexahedron
FACES = ((0, 2, 3, 1), (4, 5, 7, 6), (0, 1, 5, 4), (2, 6, 7, 3), (0, 4, 6, 2), (1, 3, 7, 5))


def words(values):
    return " ".join(map(str, values))


def lines(values, form="%12.5e"):
    return "".join(form % value + "\n" for value in values)


class ManyPieces(unittest.TestCase):
    def setUp(self):
        temporary = tempfile.TemporaryDirectory(prefix="curvisplat_pieces_")
        self.addCleanup(temporary.cleanup)
        self.folder = pathlib.Path(temporary.name)

    def write(self, name, text):
        path = self.folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text)
        return path

    def info(self, path):
        result = subprocess.run([PROGRAM, "info", path, "--json"], capture_output=True, text=True, check=False,
                                env={**os.environ, "TMPDIR": str(self.folder)},
                                preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_NOFILE, (FILES, FILES)))
        self.assertEqual(result.returncode, 0, result.stderr)
        return json.loads(result.stdout)

    def expect_ranges(self, path, ranges):
        scalars = {scalar["name"]: [scalar["min"], scalar["max"]] for scalar in self.info(path)["scalars"]}
        self.assertEqual(scalars, ranges)

    def test_variables_of_ensight(self):
        geometry = "a\nb\nnode id off\nelement id off\npart\n         1\ncube\ncoordinates\n         8\n"
        geometry += lines(point[axis] for axis in range(3) for point in CUBE) + "hexa8\n         1\n"
        self.write("a.geo", geometry + "".join("%10d" % (c + 1) for c in CORNERS) + "\n")
        for n in range(MANY):
            self.write(f"v{n}", "d\npart\n         1\ncoordinates\n" + lines(range(n, n + 8)))
        variables = "".join(f"scalar per node: s{n} v{n}\n" for n in range(MANY))
        case = self.write("a.case", f"FORMAT\ntype: ensight gold\nGEOMETRY\nmodel: a.geo\nVARIABLE\n{variables}")
        self.expect_ranges(case, {f"s{n}": [n, n + 7] for n in range(MANY)})

    def test_polyhedra_in_parts_of_ensight(self):
        """And parts without volumes between the others."""
        geometry, values = "a\nb\nnode id off\nelement id off\n", "d\n"
        for n in range(MANY):
            geometry += f"part\n{n + 1:10}\ncube\ncoordinates\n         8\n"
            geometry += lines(point[axis] + (2 * n if axis == 0 else 0) for axis in range(3) for point in CUBE)
            values += f"part\n{n + 1:10}\ncoordinates\n" + lines(range(n, n + 8))
            if n % 3 == 0:
                geometry += "quad4\n         1\n         1         2         4         3\n"
            else:
                geometry += "nfaced\n         1\n         6\n" + lines([4] * 6, "%10d")
                geometry += "".join("".join("%10d" % (c + 1) for c in face) + "\n" for face in FACES)
        self.write("a.geo", geometry)
        self.write("v", values)
        case = self.write("a.case", "FORMAT\ntype: ensight gold\nGEOMETRY\nmodel: a.geo\nVARIABLE\nscalar per node: s v\n")
        found = self.info(case)
        self.assertEqual([piece["name"] for piece in found["pieces"]], ["cube"] * (MANY - MANY // 3))
        self.assertEqual([found["scalars"][0]["min"], found["scalars"][0]["max"]], [1, MANY + 6])

    def test_zones_of_su2(self):
        text = f"NZONE= {MANY}\n"
        for n in range(MANY):
            text += f"IZONE= {n + 1}\nNDIME= 3\nNELEM= 1\n12 {words(CORNERS)} 0\nNPOIN= 8\n"
            text += "".join(f"{x + 2 * n} {y} {z} {k}\n" for k, (x, y, z) in enumerate(CUBE)) + "NMARK= 0\n"
        restarts = [self.write(f"r{n}.csv", '"PointID","x","y","z","s"\n'
                               + "".join(f"{k}, {x + 2 * n}, {y}, {z}, {n + k}\n" for k, (x, y, z) in enumerate(CUBE))) for n in range(MANY)]
        mesh = self.write("a.su2", text)
        result = subprocess.run([PROGRAM, "info", mesh, *restarts, "--json"], capture_output=True, text=True, check=False,
                                preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_NOFILE, (FILES, FILES)))
        self.assertEqual(result.returncode, 0, result.stderr)
        scalar = json.loads(result.stdout)["scalars"][0]
        self.assertEqual([scalar["min"], scalar["max"]], [0, MANY + 6])

    def grid(self, n, topology, attributes):
        points = words(value + (2 * n if axis == 0 else 0) for point in CUBE for axis, value in enumerate(point))
        text = f'<Grid Name="g{n}"><Topology {topology}</Topology>'
        text += f'<Geometry GeometryType="XYZ"><DataItem Dimensions="8 3" Format="XML">{points}</DataItem></Geometry>'
        for name in attributes:
            text += f'<Attribute Name="{name}"><DataItem Dimensions="8" Format="XML">{words(range(n, n + 8))}</DataItem></Attribute>'
        return text + "</Grid>"

    def xdmf(self, grids):
        grids = '<Grid GridType="Collection" CollectionType="Spatial">' + "".join(grids) + "</Grid>"
        return self.write("a.xmf", f'<Xdmf Version="3.0"><Domain>{grids}</Domain></Xdmf>')

    def test_mixed_grids_of_xdmf(self):
        cells = f'TopologyType="Mixed"><DataItem Dimensions="9" Format="XML">9 {words(CORNERS)}</DataItem>'
        self.expect_ranges(self.xdmf(self.grid(n, cells, ["s"]) for n in range(MANY)), {"s": [0, MANY + 6]})

    def test_names_that_few_grids_have(self):
        """Scalars come in the order in which they are first met; each warning tells how many grids lack one."""
        cells = 'TopologyType="3DSMesh" Dimensions="2 2 2">'
        path = self.xdmf(self.grid(n, cells, ["all", f"z{n // 2}", "all"]) for n in range(6))
        found = self.info(path)
        self.assertEqual([scalar["name"] for scalar in found["scalars"]], ["all", "z0", "z1", "z2"])
        self.assertEqual([[scalar["min"], scalar["max"]] for scalar in found["scalars"]], [[0, 12], [0, 8], [2, 10], [4, 12]])
        self.assertEqual(sum("4 of 6 grids have no attribute z" in warning for warning in found["warnings"]), 3)
        self.assertEqual(sum("second attribute all" in warning for warning in found["warnings"]), 1)

    def test_topology_that_all_grids_refer_to(self):
        first = self.grid(0, 'TopologyType="3DSMesh" Dimensions="2 2 2">', ["s"])
        reference = 'Reference="XML">/Xdmf/Domain/Grid/Grid[@Name="g0"]/Topology'
        path = self.xdmf([first, *(self.grid(n, reference, ["s"]) for n in range(1, 5))])
        self.expect_ranges(path, {"s": [0, 11]})

    def test_curved_pieces_of_vtk(self):
        tetrahedron = [(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1), (.5, 0, 0), (.5, .5, 0), (0, .5, 0), (0, 0, .5), (.5, 0, .5), (0, .5, .5)]

        def array(name, kind, values, more=""):
            return f'<DataArray type="{kind}" Name="{name}" format="ascii" {more}>{words(values)}</DataArray>'

        text = ""
        for n in range(MANY):
            points = [value + (2 * n if axis == 0 else 0) for point in tetrahedron for axis, value in enumerate(point)]
            text += '<Piece NumberOfPoints="10" NumberOfCells="1"><PointData>' + array("s", "Float32", range(n, n + 10)) + "</PointData>"
            text += "<Points>" + array("p", "Float32", points, 'NumberOfComponents="3"') + "</Points><Cells>"
            text += array("connectivity", "Int32", range(10)) + array("offsets", "Int32", [10]) + array("types", "UInt8", [24]) + "</Cells></Piece>"
        path = self.write("a.vtu", f'<VTKFile type="UnstructuredGrid" version="0.1"><UnstructuredGrid>{text}</UnstructuredGrid></VTKFile>')
        self.expect_ranges(path, {"s": [0, MANY + 8]})

    def test_files_of_vtk(self):
        points = words(value for point in CUBE for value in point)
        for n in range(MANY):
            data = f'<PointData><DataArray type="Float32" Name="s" format="ascii">{words(range(n, n + 8))}</DataArray></PointData>'
            data += f'<Points><DataArray type="Float32" NumberOfComponents="3" format="ascii">{points}</DataArray></Points>'
            piece = f'<Piece Extent="0 1 0 1 {n} {n + 1}">{data}</Piece>'
            self.write(f"p{n}.vts", '<VTKFile type="StructuredGrid" version="0.1" byte_order="LittleEndian">'
                       f'<StructuredGrid WholeExtent="0 1 0 1 {n} {n + 1}">{piece}</StructuredGrid></VTKFile>')
        blocks = "".join(f'<DataSet index="{n}" file="p{n}.vts"/>' for n in range(MANY))
        path = self.write("a.vtm", f'<VTKFile type="vtkMultiBlockDataSet" version="1.0"><vtkMultiBlockDataSet>{blocks}</vtkMultiBlockDataSet></VTKFile>')
        self.expect_ranges(path, {"s": [0, MANY + 6]})

    def test_processors_of_openfoam(self):
        def file(kind, name, text):
            return f"FoamFile{{version 2.0;format ascii;class {kind};object {name};}}\n{text}\n"

        self.write("case/system/controlDict", file("dictionary", "controlDict", ""))
        for n in range(MANY):
            place = f"case/processor{n}/constant/polyMesh"
            points = "".join(f"({x + 2 * n} {y} {z})" for x, y, z in CUBE)
            faces = "".join(f"4({words(face)})" for face in FACES)
            self.write(f"{place}/points", file("vectorField", "points", f"8({points})"))
            self.write(f"{place}/faces", file("faceList", "faces", f"6({faces})"))
            self.write(f"{place}/owner", file("labelList", "owner", "6(0 0 0 0 0 0)"))
            self.write(f"{place}/neighbour", file("labelList", "neighbour", "0()"))
            self.write(f"{place}/boundary", file("polyBoundaryMesh", "boundary", "1(walls{type wall;nFaces 6;startFace 0;})"))
            self.write(f"case/processor{n}/0/s", file("volScalarField", "s", f"dimensions [0 0 0 0 0 0 0];\ninternalField uniform {n};\nboundaryField{{}}"))
        self.expect_ranges(self.folder / "case", {"s": [0, MANY - 1]})


if __name__ == "__main__":
    unittest.main()
