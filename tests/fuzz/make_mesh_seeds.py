#!/usr/bin/python3
"""make_mesh_seeds.py FOLDER writes the seeds of unstructured grids, of Tecplot's, XDMF's, VTKHDF's and NetCDF's structured ones, of surfaces
and curves of VTK, of grids that are compressed, of lists of time steps, of steps.bin and of records of parts: FOLDER/<target>/<seed>.

What others wrote: VTK (python3-vtk9), libnetcdf (python3-netcdf4) and libcgns. The other seeds are make_seeds's.
"""
import gzip
import json
import lzma
import pathlib
import struct
import sys
import tempfile

import netCDF4
import numpy as np
import vtk
from vtk.util.numpy_support import numpy_to_vtk

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent.parent / "end_to_end"))
from cgns_library import ADF, CELL_CENTER, HEXA_8, VERTEX, CgnsFile
from gmsh_files import PYRAMIDS, Msh, lattice_of
from tecplot_files import Binary, padded, write_text
from zarr_stores import Store

OUT = pathlib.Path(sys.argv[1])
POINTS = np.array([[i, j, k] for k in range(3) for j in range(2) for i in range(2)], "f8")
CELLS = np.array([[0, 1, 3, 2, 4, 5, 7, 6], [4, 5, 7, 6, 8, 9, 11, 10]])
FACES = [(0, 3, 2, 1), (4, 5, 6, 7), (0, 1, 5, 4), (1, 2, 6, 5), (2, 3, 7, 6), (3, 0, 4, 7)]


def put(target, name, data):
    (OUT / target).mkdir(parents=True, exist_ok=True)
    (OUT / target / name).write_bytes(data)


def grid():
    of = vtk.vtkUnstructuredGrid()
    points = vtk.vtkPoints()
    points.SetData(numpy_to_vtk(POINTS.astype("f4"), deep=True))
    of.SetPoints(points)
    of.InsertNextCell(vtk.VTK_HEXAHEDRON, 8, [int(p) for p in CELLS[0]])
    of.InsertNextCell(vtk.VTK_TETRA, 4, [4, 5, 6, 8])
    return of


def polyhedra():
    of = grid()
    faces = vtk.vtkIdList()
    faces.InsertNextId(6)
    for face in FACES:
        faces.InsertNextId(4)
        for corner in face:
            faces.InsertNextId(int(CELLS[1][corner]))
    of.InsertNextCell(vtk.VTK_POLYHEDRON, faces)
    return of


def with_values(of, ghosts=False):
    for data, count, name in ((of.GetPointData(), of.GetNumberOfPoints(), "p"), (of.GetCellData(), of.GetNumberOfCells(), "c")):
        values = numpy_to_vtk(np.arange(count, dtype="f4"), deep=True)
        values.SetName(name)
        data.AddArray(values)
        if ghosts:
            flags = numpy_to_vtk((np.arange(count) == 1).astype("u1"), deep=True)
            flags.SetName("vtkGhostType")
            data.AddArray(flags)
    return of


def vtk_seeds(folder):
    def written(writer, of, name):
        writer.SetFileName(str(folder / name))
        writer.SetInputData(of)
        writer.Write()
        return (folder / name).read_bytes()

    for mode in ("Ascii", "Binary", "Appended"):
        for packed in ("None", "ZLib", "LZ4", "LZMA"):
            if packed != "None" and mode == "Ascii":
                continue
            writer = vtk.vtkXMLUnstructuredGridWriter()
            getattr(writer, f"SetDataModeTo{mode}")()
            getattr(writer, f"SetCompressorTypeTo{packed}")()
            writer.SetEncodeAppendedData(packed in ("ZLib", "LZMA"))
            of = with_values(polyhedra(), ghosts=packed == "None")
            put("vtk_xml", f"mesh_{mode}_{packed}".lower(), written(writer, of, "a.vtu"))
    for version in (42, 51):
        for binary in (False, True):
            writer = vtk.vtkUnstructuredGridWriter()
            writer.SetFileVersion(version)
            writer.SetFileTypeToBinary() if binary else writer.SetFileTypeToASCII()
            of = with_values(polyhedra() if version == 42 else grid(), ghosts=True)
            put("vtk_legacy", f"mesh_{version}_{'binary' if binary else 'ascii'}", written(writer, of, "a.vtk"))


def curved_seeds(folder):
    """Cells of higher order, also rational ones of other orders along their axes."""
    for name, kind, count, orders in (("quadratic", vtk.VTK_QUADRATIC_TETRA, 10, None), ("lagrange", vtk.VTK_LAGRANGE_HEXAHEDRON, 18, (2, 2, 1)),
                                      ("bezier", vtk.VTK_BEZIER_WEDGE, 18, (2, 2, 2))):
        of, points = vtk.vtkUnstructuredGrid(), vtk.vtkPoints()
        points.SetData(numpy_to_vtk(np.random.default_rng(1).random((count, 3)), deep=True))
        of.SetPoints(points)
        of.InsertNextCell(kind, count, list(range(count)))
        with_values(of)
        if orders:
            degrees, weights = numpy_to_vtk(np.array([orders], "f8"), deep=True), numpy_to_vtk(np.linspace(1, 2, count), deep=True)
            of.GetCellData().SetHigherOrderDegrees(degrees)
            degrees.SetName("HigherOrderDegrees")
            of.GetPointData().SetRationalWeights(weights)
            weights.SetName("RationalWeights")
        writer = vtk.vtkXMLUnstructuredGridWriter()
        writer.SetDataModeToAscii()
        writer.SetFileName(str(folder / "a.vtu"))
        writer.SetInputData(of)
        writer.Write()
        put("vtk_xml", f"curved_{name}", (folder / "a.vtu").read_bytes())


def curve_seeds(folder):
    lines, vertices = vtk.vtkCellArray(), vtk.vtkCellArray()
    for corners in ((0, 1, 3, 2), (4, 5)):
        lines.InsertNextCell(len(corners), corners)
    vertices.InsertNextCell(1, [6])
    points, curves, mesh = vtk.vtkPoints(), vtk.vtkPolyData(), vtk.vtkUnstructuredGrid()
    points.SetData(numpy_to_vtk(POINTS.astype("f4"), deep=True))
    curves.SetPoints(points)
    curves.SetLines(lines)
    curves.SetVerts(vertices)
    mesh.SetPoints(points)
    for kind, corners in ((vtk.VTK_POLY_LINE, (0, 1, 3)), (vtk.VTK_LINE, (4, 5)), (vtk.VTK_TETRA, (4, 5, 6, 8))):
        mesh.InsertNextCell(kind, len(corners), list(corners))
    for of in (curves, mesh):
        values = numpy_to_vtk(np.arange(of.GetNumberOfCells() if of is mesh else len(POINTS), dtype="f4"), deep=True)
        values.SetName("p")
        (of.GetCellData() if of is mesh else of.GetPointData()).AddArray(values)
    for name, choice, writer, of in (("lines_legacy", 0, vtk.vtkPolyDataWriter(), curves), ("lines_xml", 1, vtk.vtkXMLPolyDataWriter(), curves),
                                     ("mesh_xml", 2, vtk.vtkXMLUnstructuredGridWriter(), mesh), ("points_xml", 17 + 32, vtk.vtkXMLPolyDataWriter(), curves),
                                     ("mesh_legacy", 3, vtk.vtkUnstructuredGridWriter(), mesh)):
        if hasattr(writer, "SetDataModeToAscii"):
            writer.SetDataModeToAscii()
        writer.SetFileName(str(folder / "a"))
        writer.SetInputData(of)
        writer.Write()
        put("vtk_curves", name, bytes([choice]) + (folder / "a").read_bytes())
    put("curve_text", "trajectories", b"\2x,y,z,p,id\n0,0,0,1,a\n1,0,0,2,a\n\n1,1,+1e2,,b # words\n2,2,2,nan,b\n")
    put("curve_text", "points", b"\1" + b"0 0 0\n1 0.5 -2\r\n")
    put("curve_text", "geojson", b"\4" + json.dumps({"type": "FeatureCollection", "features": [
        {"type": "Feature", "geometry": {"type": kind, "coordinates": places}} for kind, places in (
            ("Point", [5, 57]), ("MultiPoint", [[5, 57, 100], [6, 58]]), ("LineString", [[5, 57], [6, 57.2]]), ("MultiLineString", [[[179, 0], [181, 1]]]),
            ("Polygon", [[[0, 0], [1, 0], [0, 1], [0, 0]]]), ("MultiPolygon", [[[[0, 0], [1, 0], [0, 1], [0, 0]]]]))] + [
        {"type": "Feature", "geometry": {"type": "GeometryCollection", "geometries": [{"type": "Point", "coordinates": [7, 8]}]}},
        {"type": "Feature", "geometry": None}]}).encode())
    put("curve_text", "shapefile", b"\x08" + shapefile())


def shapefile():
    """Each kind of shape once."""
    def of_parts(kind, parts, places):
        return struct.pack("<i4d2i", kind, 0, 0, 1, 1, len(parts), len(places)) + struct.pack(f"<{len(parts)}i", *parts) + np.array(places, "<f8").tobytes()

    places = [[0, 0], [1, 0], [0, 1], [2, 2], [2.5, 3]]
    shapes = [struct.pack("<i", 0), struct.pack("<i2d", 1, 5, 57), of_parts(3, [0, 3], places), of_parts(5, [0], places[:3] + places[:1]),
              struct.pack("<i4di", 8, 0, 0, 1, 1, 2) + np.array(places[:2], "<f8").tobytes(), struct.pack("<i4d", 11, 5, 57, 3, 4)]
    records = b"".join(struct.pack(">2i", n + 1, len(shape) // 2) + shape for n, shape in enumerate(shapes))
    return struct.pack(">7i", 9994, 0, 0, 0, 0, 0, 50 + len(records) // 2) + struct.pack("<2i8d", 1000, 3, *[0] * 8) + records


def text(value):
    """For the targets that write objects by HDF5."""
    return bytes([len(value)]) + value.encode()


def numbers(values):
    kinds = {"<f4": 0, "f8": 1, "|u1": 3, "<i2": 4, "<i4": 5, "<i8": 6}
    values = np.asarray(values)
    values = values.astype("i8") if values.dtype.kind == "i" else values
    stored = values.astype(">f8") if values.dtype == "f8" else values
    return (bytes([kinds[values.dtype.str if values.dtype != "f8" else "f8"], values.ndim]) +
            struct.pack(f"<{values.ndim}H", *values.shape) + stored.tobytes())


def fluent_seeds():
    """Two cubes of 11 faces: all in one section, or in several; refined, with an interface."""
    faces = {}
    for n, cell in enumerate(CELLS, 1):
        for face in FACES:
            points = [int(cell[m]) for m in face]
            faces.setdefault(tuple(sorted(points)), [points]).append(n)
    faces = sorted((points, *cells, *[0] * (2 - len(cells))) for points, *cells in faces.values())
    faces.sort(key=lambda face: face[2] == 0)
    for name, parts in (("one", 1), ("three", 3)):
        objects = [b"\1" + text("/meshes/1") + text(key) + numbers([value]) for key, value in
                   dict(dimension=3, nodeCount=12, faceCount=len(faces), cellCount=2).items()]

        def add(path, some, values):
            ids = [b"\1" + text(path) + text(key) + numbers([value]) for key, value in (("minId", some[0] + 1), ("maxId", some[-1] + 1))]
            objects.extend([b"\0" + text(path) + numbers(values), *ids] if values is not None else ids)

        for n, some in enumerate(np.array_split(np.arange(12), parts), 1):
            add(f"/meshes/1/nodes/coords/{n}", some, POINTS[some])
        for n, some in enumerate(np.array_split(np.arange(len(faces)), parts), 1):
            add(f"/meshes/1/faces/nodes/{n}", some, None)
            objects.append(b"\0" + text(f"/meshes/1/faces/nodes/{n}/nnodes") + numbers([4] * len(some)))
            objects.append(b"\0" + text(f"/meshes/1/faces/nodes/{n}/nodes") + numbers([p + 1 for face in some for p in faces[face][0]]))
            add(f"/meshes/1/faces/c0/{n}", some, [faces[face][1] for face in some])
        add("/meshes/1/faces/c1/1", [0], [faces[0][2]])
        add("/results/1/phase-1/cells/SV_P/1", [0, 1], [1.0, 2])
        add("/results/1/phase-2/cells/SV_U/1", [0, 1], [[1.0, 2, 3], [4, 5, 6]])
        if parts > 1:
            add("/meshes/1/cells/tree/1", [1], None)
            objects += [b"\1" + text("/meshes/1/faces/interface") + text(key) + numbers([value]) for key, value in (("nData", 3), ("nZones", 1))]
            objects.append(b"\0" + text("/meshes/1/faces/interface/nciTopology") + numbers([7, 11, 11]))
        objects.append(b"\2" + text("/settings") + text("a") + text("b"))
        put("fluent", name, b"".join(objects))


def gmsh_seeds():
    of = grid()
    for version, order in ((4.1, "<"), (4.1, ""), (2.2, "<"), (2.2, ""), (4.1, ">")):
        file = Msh(of, version, order, tags=np.arange(12)[::-1] * 2 + 1 if order == ">" else np.arange(12) + 1).mesh()
        file.data("p", np.arange(12.0)).data("p", np.arange(12.0), time=1.0).data("v", np.arange(3 * of.GetNumberOfCells()).reshape(-1, 3) * 1.0, "Element")
        put("gmsh", f"{version}{order.replace('<', 'little').replace('>', 'big') or 'text'}", b"".join(file.out))
    for name, version, order, partition in (("4.0little", 4, "<", None), ("4.0text", 4, "", None), ("partition_little", 4.1, "<", (2, 3)), ("partition_text", 4.1, "", (1, 2))):
        put("gmsh", name, b"".join(Msh(of, version, order, partition=partition).mesh().data("p", np.arange(12.0)).out))
    pyramid = vtk.vtkUnstructuredGrid()
    pyramid.SetPoints(vtk.vtkPoints())
    for place in lattice_of(3, PYRAMIDS[3][1]):
        pyramid.GetPoints().InsertNextPoint(place)
    pyramid.InsertNextCell(vtk.VTK_LAGRANGE_PYRAMID, 30, list(range(30)))
    put("gmsh", "pyramid", b"".join(Msh(pyramid, kinds={vtk.VTK_LAGRANGE_PYRAMID: (PYRAMIDS[3][0], range(30))}).mesh().out))


def vtk_hdf_seeds():
    """Of objects that the target writes by HDF5."""
    def group(path, kind, arrays, version=(2, 0), **attributes):
        objects = [b"\2" + text(path) + text("Type") + text(kind), b"\1" + text(path) + text("Version") + numbers(version)]
        objects += [b"\1" + text(path) + text(name) + numbers(values) for name, values in attributes.items()]
        return b"".join(objects + [b"\0" + text(f"{path}/{name}") + numbers(values) for name, values in arrays.items()])

    b = SmallBlock
    image = {"PointData/p": b.p, "CellData/c": b.c, "PointData/v": np.moveaxis(b.places, 0, -1).astype("f8")}
    box = {"WholeExtent": [0, 3, 0, 2, 0, 1], "Origin": [0.0, 0, 0], "Spacing": [1.0, 1, 1]}
    put("vtk_hdf", "image", group("/VTKHDF", "ImageData", image, Direction=[0.0, -1, 0, 1, 0, 0, 0, 0, 1], **box))
    mesh = {"NumberOfPoints": [12], "NumberOfCells": [2], "NumberOfConnectivityIds": [16], "Points": POINTS, "Types": np.array([12, 12], "u1"),
            "Offsets": [0, 8, 16], "Connectivity": CELLS.ravel(), "PointData/p": np.arange(12.0), "CellData/c": np.arange(2.0)}
    put("vtk_hdf", "mesh", group("/VTKHDF", "UnstructuredGrid", mesh))
    twice = {name: np.concatenate([values, values]) for name, values in mesh.items()}
    steps = {"Values": [0.0, 1], "PartOffsets": [0, 1], "NumberOfParts": [1, 1], "PointOffsets": [0, 12], "CellOffsets": [0, 2],
             "ConnectivityIdOffsets": [0, 16], "PointDataOffsets/p": [0, 12], "CellDataOffsets/c": [0, 2]}
    put("vtk_hdf", "steps", group("/VTKHDF", "UnstructuredGrid", twice | {f"Steps/{name}": values for name, values in steps.items()}))
    corners = [[int(c) for c in np.array(cell)[list(face)]] for cell in CELLS for face in FACES]
    polyhedra = {"NumberOfFaces": [12], "NumberOfFaceConnectivityIds": [48], "NumberOfPolyhedronToFaceIds": [12], "FaceOffsets": np.arange(13) * 4,
                 "FaceConnectivity": np.ravel(corners), "PolyhedronOffsets": [0, 6, 12], "PolyhedronToFaces": np.arange(12)}
    put("vtk_hdf", "polyhedra", group("/VTKHDF", "UnstructuredGrid", mesh | polyhedra | {"Types": np.array([42, 42], "u1")}, version=(2, 5)))
    levels = b"".join(b"\1" + text(f"/VTKHDF/Level{n}") + text("Spacing") + numbers([0.5**n] * 3) + b"\0" + text(f"/VTKHDF/Level{n}/AMRBox") +
                      numbers([low + high]) + b"\0" + text(f"/VTKHDF/Level{n}/CellData/c") + numbers(np.arange(8.0))
                      for n, (low, high) in enumerate((([0, 1, 0], [1, 0, 1]), ([0, 1, 0], [1, 0, 1]))))
    put("vtk_hdf", "refined", group("/VTKHDF", "OverlappingAMR", {}, Origin=[0.0, 0, 0]) + levels)
    links = b"".join(b"\3" + text(f"/VTKHDF/Assembly/{name}") + text(f"/VTKHDF/{name}") for name in "ab")
    put("vtk_hdf", "set", group("/VTKHDF", "PartitionedDataSetCollection", {}) + group("/VTKHDF/a", "ImageData", image, **box) +
        group("/VTKHDF/b", "UnstructuredGrid", mesh) + links)


def surface_seeds(folder):
    points, polygons, strips = vtk.vtkPoints(), vtk.vtkCellArray(), vtk.vtkCellArray()
    points.SetData(numpy_to_vtk(POINTS.astype("f4"), deep=True))
    for cells, all_corners in ((polygons, [*FACES[:2], (0, 1, 8)]), (strips, [(4, 5, 6, 7, 8)])):
        for corners in all_corners:
            cells.InsertNextCell(len(corners), corners)
    of = vtk.vtkPolyData()
    of.SetPoints(points)
    of.SetPolys(polygons)
    of.SetStrips(strips)
    for mode, packed in (("Ascii", "None"), ("Binary", "None"), ("Appended", "ZLib"), ("Appended", "LZ4")):
        writer = vtk.vtkXMLPolyDataWriter()
        getattr(writer, f"SetDataModeTo{mode}")()
        getattr(writer, f"SetCompressorTypeTo{packed}")()
        writer.SetEncodeAppendedData(packed == "ZLib")
        writer.SetFileName(str(folder / "a.vtp"))
        writer.SetInputData(of)
        writer.Write()
        put("vtk_surface", f"{mode}_{packed}".lower(), (folder / "a.vtp").read_bytes())


def set_seeds():
    """.pvtu and AMR sets, of the pieces that the target vtk_set has."""
    head = '<VTKFile type="{}" version="{}" byte_order="LittleEndian">'
    put("vtk_set", "pieces.pvtu", (head.format("PUnstructuredGrid", "0.1") +
        '<PUnstructuredGrid GhostLevel="0"><PPointData><PDataArray type="Float32" Name="p"/></PPointData><PPoints>'
        '<PDataArray type="Float32" NumberOfComponents="3"/></PPoints><Piece Source="tetrahedron.vtu"/>'
        '<Piece Source="tetrahedron.vtu"/></PUnstructuredGrid></VTKFile>').encode())
    patches = ('<DataSet index="0" amr_box="0 4 0 3 0 5" file="ghosts_0.vti"/>', '<DataSet index="0" amr_box="2 6 2 6 2 7" file="ghosts_1.vti"/>')
    blocks = "".join(f'<Block level="{n}" spacing="{1 / 2**n} {1 / 2**n} {1 / 2**n}">{patch}</Block>' for n, patch in enumerate(patches))
    put("vtk_set", "patches.vthb", (head.format("vtkOverlappingAMR", "1.1") +
        f'<vtkOverlappingAMR origin="0 0 0" grid_description="XYZ">{blocks}</vtkOverlappingAMR></VTKFile>').encode())
    blocks = "".join(f'<Block level="{n}" refinement_ratio="2">{patch}</Block>' for n, patch in enumerate(patches))
    put("vtk_set", "patches.vth", (head.format("vtkHierarchicalBoxDataSet", "1.0") +
        f"<vtkHierarchicalBoxDataSet>{blocks}</vtkHierarchicalBoxDataSet></VTKFile>").encode())


def compressed_seeds():
    grid_text = b"# vtk DataFile Version 2.0\na\nASCII\nDATASET STRUCTURED_POINTS\nDIMENSIONS 2 2 2\nORIGIN 0 0 0\nSPACING 1 1 1\n"
    grid_text += b"POINT_DATA 8\nSCALARS p float\nLOOKUP_TABLE default\n1 2 3 4 5 6 7 8\n"
    full = grid_text.ljust(1 << 20, b"\n")  # exactly as long as the buffer
    for name, text in (("grid", grid_text), ("full", full)):
        put("unpacked_file", f"{name}.gz", gzip.compress(text, mtime=0))
        put("unpacked_file", f"{name}.xz", lzma.compress(text))
    put("unpacked_file", "members.gz", gzip.compress(grid_text[:40], mtime=0) + gzip.compress(grid_text[40:], mtime=0) + bytes(9))


def foam_seeds():
    number, faces, owner, neighbour = {}, [], [], {}
    for n, cell in enumerate(CELLS):
        for face in FACES:
            corners = [int(cell[corner]) for corner in face]
            key = tuple(sorted(corners))
            if key in number:
                neighbour[number[key]] = n
                continue
            number[key] = len(faces)
            faces.append(corners)
            owner.append(n)
    order = sorted(range(len(faces)), key=lambda face: face not in neighbour)
    faces, owner = [faces[f] for f in order], [owner[f] for f in order]
    beyond = list(neighbour.values())

    def head(kind, binary, arch):
        return f"FoamFile\n{{ format {'binary' if binary else 'ascii'}; {arch}class {kind}; }}\n// *\n".encode()

    def text(values):
        rows = (str(v) if np.ndim(v) == 0 else "(" + " ".join(map(str, v)) + ")" for v in values)
        return f"{len(values)}\n(\n{chr(10).join(rows)}\n)\n".encode()

    def binary(values, kind):
        return f"{len(values)}(".encode() + np.ascontiguousarray(values, kind).tobytes() + b")"

    def case(name, files):
        put("openfoam", name, b"".join(struct.pack("<H", len(f)) + f for f in files[:5]) + files[5])

    p = [1.5, -2.5]
    u = [[1, 2, 3], [4, 5, 6]]
    field = b"dimensions [0 2 -2 0 0 0 0];\ninternalField nonuniform List<scalar> "
    ending = b";\nboundaryField { }\n"
    of_faces = f"{len(faces)}\n(\n".encode() + b"".join(f"{len(f)}({' '.join(map(str, f))})\n".encode() for f in faces) + b")\n"
    case("ascii", [head("vectorField", False, "") + text(POINTS), head("faceList", False, "") + of_faces,
                   head("labelList", False, "") + text(owner), head("labelList", False, "") + text(beyond),
                   head("volScalarField", False, "") + field + text(p) + ending,
                   head("volVectorField", False, "") + b"internalField uniform (1 2 3);\n"])
    for bits, order_of in ((32, "LSB"), (64, "MSB")):
        arch = f'arch "{order_of};label={bits};scalar=64"; '
        mark = "<" if order_of == "LSB" else ">"
        label, scalar = f"{mark}i{bits // 8}", f"{mark}f8"
        ends = np.cumsum([0] + [len(f) for f in faces])
        case(f"binary_{bits}", [head("vectorField", True, arch) + binary(POINTS, scalar),
                                head("faceCompactList", True, arch) + binary(ends, label) + b"\n" + binary(sum(faces, []), label),
                                head("labelList", True, arch) + binary(owner, label),
                                head("labelList", True, arch) + binary(beyond, label),
                                head("volScalarField", True, arch) + field + binary(p, scalar) + ending,
                                head("volVectorField", True, arch) + b"internalField nonuniform List<vector> " +
                                b"2(" + np.array(u, scalar).tobytes() + b")" + ending])


def exodus_seeds(folder):
    for form in ("NETCDF3_CLASSIC", "NETCDF3_64BIT_OFFSET", "NETCDF3_64BIT_DATA"):
        path = folder / "a.exo"
        with netCDF4.Dataset(path, "w", format=form) as f:
            f.api_version, f.floating_point_word_size = np.float32(5.1), np.int32(8)
            for name, size in (("len_name", 5), ("time_step", None), ("num_dim", 3), ("num_nodes", 12), ("num_el_blk", 2),
                               ("e1", 2), ("n1", 8), ("e2", 1), ("n2", 4), ("num_nod_var", 1), ("num_elem_var", 1)):
                f.createDimension(name, size)
            f.createVariable("time_whole", "f8", ("time_step",))[:] = [0, 1]
            if form == "NETCDF3_CLASSIC":
                f.createVariable("coord", "f8", ("num_dim", "num_nodes"))[:] = POINTS.T
            else:
                for axis in range(3):
                    f.createVariable("coord" + "xyz"[axis], "f4", ("num_nodes",))[:] = POINTS[:, axis]
            for number, kind, cells in ((1, "HEX8", CELLS), (2, "TETRA4", CELLS[:1, :4])):
                connect = f.createVariable(f"connect{number}", "i4", (f"e{number}", f"n{number}"))
                connect.elem_type = kind
                connect[:] = cells + 1
            for prefix, name in (("nod", "temp"), ("elem", "dens")):
                names = f.createVariable(f"name_{prefix}_var", "S1", (f"num_{prefix}_var", "len_name"))
                names[0] = np.array(list(name.ljust(5, "\0")), "S1")
            f.createVariable("vals_nod_var1", "f8", ("time_step", "num_nodes"))[:] = np.arange(24).reshape(2, 12)
            f.createVariable("vals_elem_var1eb1", "f4", ("time_step", "e1"))[:] = [[1, 2], [3, 4]]
        put("exodus", form.lower(), path.read_bytes())


def su2_seeds():
    cells = "".join("12 " + " ".join(map(str, cell)) + f" {n}\n" for n, cell in enumerate(CELLS))
    points = "".join(" ".join(map(str, point)) + f" {n}\n" for n, point in enumerate(POINTS))
    zone = (f"% a mesh\nNDIME= 3\nNELEM= {len(CELLS)}\n{cells}NPOIN= {len(POINTS)}\n{points}"
            "NMARK= 1\nMARKER_TAG= wall\nMARKER_ELEMS= 1\n9 0 1 3 2\n")
    names, values = ["x", "y", "z", "Density"], np.column_stack([POINTS, np.arange(len(POINTS))])
    text = ",".join(f'"{name}"' for name in ["PointID", *names]) + "\n" + "".join(
        ",".join([str(n), *map(str, row)]) + "\n" for n, row in enumerate(values.tolist()))
    binary = (struct.pack("<5i", 535532, len(names), len(POINTS), 1, 8) +
              b"".join(name.encode().ljust(33, b"\0") for name in names) + values.astype("<f8").tobytes())
    for name, mesh, restart in (("mesh", zone, b""), ("csv", zone, text.encode()), ("binary", zone, binary),
                                ("zones", f"NZONE= 2\nIZONE= 1\n{zone}IZONE= 2\n{zone}", b"")):
        put("su2", name, struct.pack("<H", len(mesh)) + mesh.encode() + restart)


class SmallBlock:
    """Two zones' worth of numbers for Tecplot and XDMF."""
    shape = (2, 3, 4)
    places = np.stack(np.meshgrid(*map(np.arange, shape), indexing="ij")[::-1]).astype("f4")
    p = np.arange(24, dtype="f4").reshape(shape)
    c = np.arange(6, dtype="f4").reshape(1, 2, 3)


def tecplot_seeds():
    b = SmallBlock
    names, cells = ("X", "Y", "Z", "p", "c"), [0, 0, 0, 0, 1]
    for version in (104, 107, 112):
        file = Binary(names, version, "<" if version < 112 else ">")
        file.zone(b.shape, [*b.places, b.p, padded(b, b.c)], "a", strand=0, time=0.5, centrings=cells, auxiliary=[("key", "value")])
        file.zone(b.shape, [None, None, None, b.p, None], "b", strand=0, time=1.5, centrings=cells, shared=[0, 0, 0, -1, -1],
                  passive=[0, 0, 0, 0, 1])
        file.geometry()
        with tempfile.TemporaryDirectory() as folder:
            file.write(pathlib.Path(folder) / "a.plt")
            put("tecplot", f"binary_{version}", (pathlib.Path(folder) / "a.plt").read_bytes())
    with tempfile.TemporaryDirectory() as folder:
        path = pathlib.Path(folder) / "a.dat"
        write_text(path, [("T=a I=4 J=3 K=2 F=BLOCK VARLOCATION=([5]=CELLCENTERED) SOLUTIONTIME=0.5", "BLOCK", [*b.places, b.p, b.c]),
                          ("I=4 J=3 K=2 F=BLOCK VARSHARELIST=([1-3]=1) PASSIVEVARLIST=[5] DT=(SINGLE DOUBLE)", "BLOCK", [b.p])], names)
        put("tecplot", "text_blocks", path.read_bytes() + b"TEXT X=1 T=\"a\"\nZONE I=4 J=3 K=2 D=(1,2,3,4,5)\n")
        write_text(path, [("I=4, J=3, K=2", "POINT", [*b.places, b.p])], names[:4])
        put("tecplot", "text_points", path.read_bytes().replace(b"0.0 0.0", b"2*0"))
    at, nodes, bricks = list(POINTS.T.astype("f4")), np.arange(12, dtype="f4"), np.array([1, 2], "f4")
    rows = lambda values: "\n".join(" ".join(f"{v:g}" for v in np.ravel(row)) for row in values) + "\n"
    words = "N=12, E=2, ZONETYPE=FEBRICK, DATAPACKING=BLOCK, VARLOCATION=([5]=CELLCENTERED)"
    put("tecplot", "elements_text", ('VARIABLES = "X" "Y" "Z" "p" "c"\n' f"ZONE {words} SOLUTIONTIME=1\n" + rows([*at, nodes, bricks, *(CELLS + 1)]) +
        f"ZONE {words} SOLUTIONTIME=2 VARSHARELIST=([1-3]=1) CONNECTIVITYSHAREZONE=1\n" + rows([nodes, bricks]) +
        "ZONE N=12, E=1, F=FEPOINT, ET=TETRAHEDRON\n" + rows([*np.column_stack([*at, nodes, nodes]), [5, 6, 7, 9]])).encode())
    for version in (107, 112):
        file = Binary(names, version, "<" if version < 112 else ">")
        of_zone = {"centrings": cells, "zone_type": 5, "elements": CELLS, "strand": 0}
        file.zone(12, [*at, nodes, bricks], time=1.0, face_neighbours=version == 107, **of_zone)
        file.zone(12, [None] * 3 + [nodes, bricks], time=2.0, shared=[0, 0, 0, -1, -1], elements_of=0, **of_zone)
        with tempfile.TemporaryDirectory() as folder:
            file.write(pathlib.Path(folder) / "a.plt")
            put("tecplot", f"elements_{version}", (pathlib.Path(folder) / "a.plt").read_bytes())


def xdmf_seeds():
    b = SmallBlock
    words = lambda values: " ".join(f"{v:g}" for v in np.asarray(values).ravel())
    head = '<?xml version="1.0"?><Xdmf Version="3.0"><Domain>'
    item = '<DataItem Dimensions="{}" Format="XML">{}</DataItem>'
    places = item.format("2 3 4 3", words(np.moveaxis(b.places, 0, -1)))
    topology = '<Topology TopologyType="3DSMesh" Dimensions="2 3 4"/>'
    fields = f'<Attribute Name="p">{item.format("2 3 4", words(b.p))}</Attribute><Attribute Name="c" Center="Cell">{item.format("1 2 3", words(b.c))}</Attribute>'
    grid = f"<Grid>{topology}<Geometry>{places}</Geometry>{fields}</Grid>"
    put("xdmf", "inline", f"{head}{grid}</Domain></Xdmf>".encode())
    steps = f'<Grid GridType="Collection" CollectionType="Temporal"><Time TimeType="List">{item.format(2, "0 1")}</Time>{grid}{grid}</Grid>'
    put("xdmf", "steps", f"{head}{steps}</Domain></Xdmf>".encode())
    included = "".join(f'<xi:include xpointer="xpointer({pointer})"/>'
                       for pointer in ("//Grid[@Name='a']/*[self::Topology or self::Geometry]", "//Attribute[@Name='p']"))
    named, times = grid.replace("<Grid", '<Grid Name="a"'), f"<Grid>{included}</Grid>" * 2
    put("xdmf", "includes", f'{head}{named}<Grid GridType="Collection" CollectionType="Temporal">{times}</Grid></Domain></Xdmf>'.encode())
    binary = '<DataItem Dimensions="{}" Precision="4" Format="Binary" Seek="{}" Endian="Little">a.bin</DataItem>'
    axes = "".join(binary.format(n, 8 * n) for n in (4, 3, 2))
    put("xdmf", "axes", (f'{head}<Grid>{topology.replace("3DSMesh", "3DRectMesh")}<Geometry GeometryType="VXVYVZ">{axes}</Geometry>'
                         f'<Attribute Name="v" AttributeType="Vector">{binary.format("2 3 4 3", 0)}</Attribute></Grid></Domain></Xdmf>').encode())
    slab = f'<DataItem ItemType="HyperSlab" Dimensions="2 3 4">{item.format("3 3", "0 0 0 1 2 1 2 3 4")}{binary.format("2 6 4", 0)}</DataItem>'
    uniform = f'<Geometry GeometryType="ORIGIN_DXDYDZ">{item.format(3, "0 0 0")}{item.format(3, "1 1 1")}</Geometry>'
    put("xdmf", "slab", (f'{head}<Topology TopologyType="3DCoRectMesh" Dimensions="2 3 4"/><Grid><Topology Reference="/Xdmf/Domain/Topology"/>'
                         f'{uniform}<Attribute Name="p">{slab}</Attribute></Grid></Domain></Xdmf>').encode())
    mesh = lambda kind, count, numbers: (f'<Grid><Topology TopologyType="{kind}" NumberOfElements="{count}">{item.format(len(numbers), words(numbers))}</Topology>'
        f'<Geometry GeometryType="XYZ">{item.format("12 3", words(POINTS))}</Geometry><Attribute Name="p">{item.format(12, words(np.arange(12)))}</Attribute>'
        f'<Attribute Name="c" Center="Cell">{item.format(count, words(np.arange(count)))}</Attribute></Grid>')
    faces = [v for face in FACES for v in (4, *CELLS[0][list(face)])]
    put("xdmf", "mesh", f'{head}{mesh("Hexahedron", 2, np.ravel(CELLS))}{mesh("Tetrahedron_10", 1, np.arange(10))}</Domain></Xdmf>'.encode())
    degrees = lambda degree, each, parts: (f'<Attribute ItemType="FiniteElementFunction" ElementFamily="DG" ElementDegree="{degree}" ElementCell="tetrahedron" Name="d{degree}">'
        f'{item.format(f"{parts} {each}", words(np.arange(parts * each) % 11))}{item.format("11 1", words(np.arange(11)))}</Attribute>')
    tetrahedra = mesh("Tetrahedron", 2, [0, 1, 2, 4, 1, 3, 2, 4]).replace("</Grid>", degrees(0, 1, 2) + degrees(1, 4, 2) + degrees(2, 30, 2) + "</Grid>")
    put("xdmf", "functions", f"{head}{tetrahedra}</Domain></Xdmf>".encode())
    put("xdmf", "mixed_mesh", f'{head}{mesh("Mixed", 5, [9, *CELLS[0], 1, 2, 5, 6, 2, 3, 7, 8, 9, 6, 4, 5, 6, 8, 16, 6, *faces])}</Domain></Xdmf>'.encode())


def ensight_seeds():
    for name, order in (("ascii", ""), ("binary", "<"), ("big_endian", ">")):
        for block in (False, True):
            def text(*lines):
                return b"".join(line.encode().ljust(80) if order else line.encode() + b"\n" for line in lines)

            def numbers(values, kind):
                values = np.ravel(values)
                if order:
                    return values.astype(f"{order}{kind}4").tobytes()
                return "".join(f"{v:d}\n" if kind == "i" else f"{v:12.5e}\n" for v in values).encode()

            head = text(*(["C Binary"] if order else []), "a", "b", "node id off", "element id given", "part") + numbers([1], "i")
            if block:
                geometry = head + text("part", "block iblanked") + numbers([2, 2, 3], "i") + numbers(POINTS.T, "f") + numbers([1] * 12, "i")
                values = text("v", "part") + numbers([1], "i") + text("block") + numbers(np.arange(12.0), "f")
            else:
                faces = [[int(CELLS[1][corner]) + 1 for corner in face] for face in FACES]
                geometry = (head + text("part", "coordinates") + numbers([12], "i") + numbers(POINTS.T, "f") +
                            text("hexa8") + numbers([1, 1], "i") + numbers(CELLS[0] + 1, "i") + text("nfaced") + numbers([1, 2, 6], "i") +
                            numbers([4] * 6, "i") + numbers(faces, "i"))
                vectors = text("v", "part") + numbers([1], "i") + text("coordinates") + numbers(np.arange(36.0), "f")
                values = vectors[:-24 * len(numbers([1.0], "f"))]
            of_cells = text("v", "part") + numbers([1], "i") + text("hexa8") + numbers([1], "f") + text("nfaced undef") + numbers([9, 2], "f")
            for kind, file in ((0, values), (1, values if block else of_cells), (2, values if block else vectors)):
                if not (block and kind):
                    put("ensight", f"{name}_{'block' if block else 'mesh'}_{kind}",
                          bytes([kind]) + struct.pack("<H", len(geometry)) + geometry + file)


def ensight_case_seeds():
    head = "FORMAT\ntype: ensight gold\n"
    put("ensight_case", "one_step", (head + "GEOMETRY\nmodel: t.geo\nVARIABLE\nscalar per node: p t.p\n"
                                     "vector per node: 1 u t.u # words\nscalar per element: c t.c\n").encode())
    put("ensight_case", "steps", (head + "GEOMETRY\nmodel: 1 t.geo*\nVARIABLE\nscalar per node: 2 p \"t.p**\"\nconstant per case: k 3\n"
                                  "TIME\ntime set: 1\nnumber of steps: 2\nfilename start number: 0\nfilename increment: 1\n"
                                  "time values: 0.0 0.5\ntime set: 2\nnumber of steps: 2\nfilename numbers: 0\n1\ntime values:\n0\n0.5\n").encode())


def cf_seeds(folder):
    def write(name, dimensions, variables, **attributes):
        """variables: name, dimensions, values, attributes."""
        with netCDF4.Dataset(folder / name, "w", format="NETCDF3_CLASSIC") as f:
            f.setncatts(attributes)
            for dimension, length in dimensions.items():
                f.createDimension(dimension, length)
            for variable, along, values, words in variables:
                values = np.asarray(values)
                added = f.createVariable(variable, values.dtype, tuple(along.split()), fill_value=words.pop("_FillValue", None))
                added.setncatts(words)
                added.set_auto_maskandscale(False)
                added[...] = values
        return (folder / name).read_bytes().rstrip(b"\0") + bytes(8)  # the library pads files whose header has grown

    def put_grid(name, flags, first, second=b""):
        put("cf_grid", name, bytes([flags]) + struct.pack("<H", len(first)) + first + second)

    east, north = {"units": "degrees_east"}, {"units": "degrees_north"}
    height = ("z", "z", np.array([0, 100.0]), {"units": "m", "positive": "up"})

    def values(*shape):
        return np.arange(np.prod(shape), dtype="f4").reshape(shape)

    around = [("lon", "lon", np.arange(0, 360, 45.0), east), ("lat", "lat", np.linspace(-60, 60, 4), north)]
    put_grid("around", 0, write("a.nc", {"z": 2, "lat": 4, "lon": 8}, [*around, height, ("t", "z lat lon", values(2, 4, 8), {})]))
    packed = (values(2, 2, 4, 8).astype("i2"), {"scale_factor": 0.5, "add_offset": 3.0, "_FillValue": np.int16(5), "valid_range": np.array([1, 90], "i2")})
    mask = ("mask", "lat lon", np.tile([0, 1], (4, 4)).astype("i1"), {"flag_values": np.array([0, 1], "i1"), "flag_meanings": "land sea"})
    time = ("time", "time", np.array([0, 1.0]), {"units": "days since 2000-01-01"})
    put_grid("packed_and_masked", 2, write("a.nc", {"time": None, "z": 2, "lat": 4, "lon": 8}, [*around, height, time, mask, ("t", "time z lat lon", *packed)]))
    levels = [("lev", "lev", np.array([0.5, 1.0]), {"standard_name": "atmosphere_hybrid_sigma_pressure_coordinate", "formula_terms": "ap: a b: b ps: ps"}),
              ("a", "lev", np.array([1e4, 0.0]), {"units": "Pa"}), ("b", "lev", np.array([0.5, 1.0]), {}),
              ("ps", "lat lon", np.full((4, 8), 1e5, "f4"), {"units": "Pa"})]
    hybrid = write("a.nc", {"lev": 2, "lat": 4, "lon": 8}, [*around, *levels, ("t", "lev lat lon", values(2, 4, 8), {})])
    put_grid("hybrid_pressure", 0, hybrid)
    axes = [("x", "x", np.arange(3.0), {"units": "km", "standard_name": "projection_x_coordinate"}),
            ("y", "y", np.arange(3.0), {"units": "km", "standard_name": "projection_y_coordinate"})]
    lambert = {"grid_mapping_name": "lambert_conformal_conic", "standard_parallel": np.array([30.0, 60]), "longitude_of_central_meridian": 10.0,
               "latitude_of_projection_origin": 45.0}
    put_grid("projected", 0, write("a.nc", {"z": 2, "y": 3, "x": 3}, [*axes, height, ("crs", "", np.int32(0), lambert),
                                                                      ("t", "z y x", values(2, 3, 3), {"grid_mapping": "crs"})]))
    rotated = {"grid_mapping_name": "rotated_latitude_longitude", "grid_north_pole_latitude": 40.0, "grid_north_pole_longitude": 170.0}
    axes = [("rlon", "rlon", np.arange(3.0), {"units": "degrees", "standard_name": "grid_longitude"}),
            ("rlat", "rlat", np.arange(3.0), {"units": "degrees", "standard_name": "grid_latitude"})]
    put_grid("rotated_flat", 4, write("a.nc", {"z": 2, "rlat": 3, "rlon": 3}, [*axes, height, ("pole", "", np.int32(0), rotated),
                                                                             ("t", "z rlat rlon", values(2, 3, 3), {"grid_mapping": "pole"})]))
    # Faces of a cube: what lies beside them is 1 degree away.
    rows, columns = np.meshgrid(np.arange(3.0), np.arange(3.0), indexing="ij")
    faces = [("lons", "nf y x", np.stack([columns + 3 * n for n in (0, 1)]), east), ("lats", "nf y x", np.stack([rows] * 2), north)]
    put_grid("faces", 0, write("a.nc", {"z": 2, "nf": 2, "y": 3, "x": 3},
                               [*faces, height, ("t", "z nf y x", values(2, 2, 3, 3), {"coordinates": "lons lats"})]))
    tiles = [write("a.nc", {"z": 2, "grid_yt": 3, "grid_xt": 3},
                   [("grid_lont", "grid_yt grid_xt", columns + 3 * n, east), ("grid_latt", "grid_yt grid_xt", rows, north), height,
                    ("t", "z grid_yt grid_xt", values(2, 3, 3), {})]) for n in (0, 1)]
    put_grid("tiles", 1, *tiles)
    fine = np.meshgrid(np.arange(7.0), np.arange(7.0), indexing="ij")
    words = np.zeros((1, 8), "S1")
    words[0, :4] = list("b.nc")
    supergrid = write("b.nc", {"nyp": 7, "nxp": 7}, [("x", "nyp nxp", fine[1], {"units": "degrees"}), ("y", "nyp nxp", fine[0], {"units": "degrees"})])
    for named in (False, True):
        data = [height, ("t", "z yh xh", values(2, 3, 3), {})] + named * [("gridfiles", "ntiles string", words, {})]
        put_grid("mosaic" if named else "supergrid", 0 if named else 8,
                 write("a.nc", {"z": 2, "yh": 3, "xh": 3, "ntiles": 1, "string": 8}, data), supergrid)


def columns_seeds(folder):
    nodes = np.array([[0, 0], [1, 0], [2, 0], [0, 1], [1, 1], [2, 1.0]])
    faces = np.array([[0, 1, 4, 3], [1, 2, 5, 4]])
    for kind in ("ugrid", "icon", "mpas"):
        path = folder / "a.nc"
        with netCDF4.Dataset(path, "w", format="NETCDF3_CLASSIC") as f:
            for name, size in (("Time", None), ("layer", 2), ("level", 3), ("cell", 2), ("node", 6), ("corner", 4)):
                f.createDimension(name, size)
            longitude, latitude = {"ugrid": ("lon", "lat"), "icon": ("vlon", "vlat"), "mpas": ("lonVertex", "latVertex")}[kind]
            for name, axis in ((longitude, 0), (latitude, 1)):
                f.createVariable(name, "f8", ("node",))[:] = nodes[:, axis]
            if kind == "ugrid":
                mesh = f.createVariable("mesh", "i4")
                mesh.cf_role, mesh.topology_dimension = "mesh_topology", np.int32(2)
                mesh.node_coordinates, mesh.face_node_connectivity = "lon lat", "corners"
                f.createVariable("corners", "i4", ("cell", "corner"))[:] = faces
            elif kind == "icon":
                f.createVariable("vertex_of_cell", "i4", ("corner", "cell"))[:] = faces.T + 1
            else:
                f.createVariable("verticesOnCell", "i4", ("cell", "corner"))[:] = faces + 1
                f.createVariable("nEdgesOnCell", "i4", ("cell",))[:] = [4, 3]
                f.createVariable("zgrid", "f8", ("cell", "level"))[:] = [[0, 1, 2], [1, 2, 3]]
            layer = f.createVariable("layer", "f8", ("layer",))
            layer.units, layer.positive = "m", "up"
            layer[:] = [10, 20]
            f.createVariable("t", "f4", ("Time", "cell", "layer") if kind == "mpas" else ("Time", "layer", "cell"))[0] = [[1, 2], [3, 4]]
        put("columns", kind, path.read_bytes())


def adf_seeds(folder):
    for name, structured in (("blocks", True), ("mesh", False)):
        with CgnsFile(folder / "a.cgns", ADF) as file:
            file.base()
            if structured:
                file.block("zone", np.moveaxis(POINTS.reshape(3, 2, 2, 3), -1, 0))
                file.hole("hole", [[1, 1, 1, 2, 1, 1]])
            else:
                file.zone("zone", POINTS, 2)
                file.section("hexahedra", HEXA_8, CELLS + 1)
            file.solution("nodes", VERTEX, {"p": np.arange(12.0)})
            file.solution("cells", CELL_CENTER, {"c": np.arange(2.0)})
        put("cgns_adf", name, (folder / "a.cgns").read_bytes())


def lists_of_steps():
    files = [{"name": f"step{n}.vts", "time": n / 2} for n in (0, 1)]
    put("file_series", "two_steps", json.dumps({"file-series-version": "1.0", "files": files}).encode())
    put("file_series", "without_times", json.dumps({"files": [{"name": "step1.vts"}]}).encode())
    for variables, steps in ((1, 1), (2, 3)):
        data = b"CVSsteps" + struct.pack("<II", 1, variables)
        for step in range(steps):
            data += struct.pack("<dIIQQ", step / 4, step // 2, 0, 7 * (step // 2), 5)
            data += struct.pack("<ddQQ", -1, step, 100, 3) * variables
        put("steps", f"{steps}_of_{variables}", bytes([variables - 1]) + data)


def part_records():
    step = {"states_time": True, "sources": ["a.xyz", "a.fun"]}

    def record(steps, count):
        return json.dumps({"steps_of_series": steps, "steps": [step] * count}).encode()

    for name, first, second in (("one", record(6, 6), b""), ("nothing_to_do", record(6, 6), record(6, 0)), ("two", record(11, 6), record(11, 6))):
        put("part_record", name, struct.pack("<H", len(first)) + first + second)


def zarr_seeds(folder):
    codecs = {2: [("zlib",), ("blosc",), ("shuffle", "lz4")], 3: [("gzip", "crc32c"), ("zstd",), ("blosc",)]}
    for version, chains in codecs.items():
        for n, chain in enumerate(chains):
            store = Store(folder / f"{version}{n}.zarr", version, {"title": "a seed"})
            for name, units, length in (("lon", "degrees_east", 3), ("lat", "degrees_north", 4), ("depth", "m", 2)):
                store.add(name, name, np.arange(length) * 1.0, units=units)
            options = dict(shards=(2, 4, 2)) if (version, n) == (3, 1) else dict(order="F") if version == 2 and n == 1 else {}
            store.add("temp", "depth lat lon", np.arange(24).reshape(2, 4, 3), kind=["f4", ">i2", "f8"][n], chunks=(1, 2, 2), codecs=chain, **options)
            put("zarr", f"version{version}_{chain[0]}", store.zip().read_bytes())


with tempfile.TemporaryDirectory() as name:
    zarr_seeds(pathlib.Path(name))
    vtk_seeds(pathlib.Path(name))
    curved_seeds(pathlib.Path(name))
    curve_seeds(pathlib.Path(name))
    surface_seeds(pathlib.Path(name))
    cf_seeds(pathlib.Path(name))
    exodus_seeds(pathlib.Path(name))
    columns_seeds(pathlib.Path(name))
    adf_seeds(pathlib.Path(name))
vtk_hdf_seeds()
fluent_seeds()
gmsh_seeds()
set_seeds()
compressed_seeds()
foam_seeds()
su2_seeds()
ensight_seeds()
ensight_case_seeds()
tecplot_seeds()
xdmf_seeds()
lists_of_steps()
part_records()
