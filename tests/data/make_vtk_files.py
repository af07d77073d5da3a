#!/usr/bin/env python3
"""Writes small files with VTK's own writers into vtk/ beside itself, and what VTK's own readers find in them into
vtk/expected.json: dimensions, ranges, and CRC-32 of the coordinates (as doubles) and of each scalar (as floats), i
fastest. With the folder of the real grids as argument, writes vtk/expected_real.json of its VTK files, too.

Needs VTK's Python module (Debian: python3-vtk9; the files here are by version 9.1)."""

import json
import math
import pathlib
import sys
import zlib

import numpy as np
import vtk
from vtk.util.numpy_support import numpy_to_vtk, vtk_to_numpy

FOLDER = pathlib.Path(__file__).resolve().parent / "vtk"
XML_READERS = {
    "vts": vtk.vtkXMLStructuredGridReader, "vtr": vtk.vtkXMLRectilinearGridReader,
    "vti": vtk.vtkXMLImageDataReader, "pvts": vtk.vtkXMLPStructuredGridReader,
    "pvti": vtk.vtkXMLPImageDataReader, "vtm": vtk.vtkXMLMultiBlockDataReader,
}


def array(name, values, component_names=()):
    made = numpy_to_vtk(np.ascontiguousarray(values), deep=1)
    made.SetName(name)
    for n, component in enumerate(component_names):
        made.SetComponentName(n, component)
    return made


def nodes_of(ni, nj, nk, shift=0.0):
    """A quarter of an annulus, bent along k."""
    k, j, i = np.meshgrid(np.arange(nk), np.arange(nj), np.arange(ni), indexing="ij")
    u, v, w = 0.2 * i.ravel(), 1 + 0.25 * j.ravel(), 0.5 * k.ravel() + shift
    return np.stack([-v * np.sin(u), v * np.cos(u), w + 0.1 * u * v], axis=1)


def add_arrays(grid, time=0.0):
    points, cells = grid.GetNumberOfPoints(), grid.GetNumberOfCells()
    n, c = np.arange(points), np.arange(cells)
    point_data, cell_data = grid.GetPointData(), grid.GetCellData()
    point_data.AddArray(array("wall distance", np.sqrt(n + 0.5).astype("f4") + np.float32(time)))
    point_data.AddArray(array("p", np.cos(0.1 * n) + time))
    point_data.AddArray(array("U", np.stack([np.sin(n), n / 7.0, -n * 0.3], axis=1).astype("f4"), "uvw"))
    point_data.AddArray(array("flat", np.stack([n, n * n], axis=1).astype("f8")))
    point_data.AddArray(array("stress", (n[:, None] + 0.01 * np.arange(9)[None, :]).astype("f4")))
    point_data.AddArray(array("id", (n * 3 - 20).astype("i4")))
    point_data.AddArray(array("wide", (n * 1000000007).astype("i8")))
    point_data.AddArray(array("short", (n * 31 - 900).astype("i2")))
    point_data.AddArray(array("flags", (n % 251).astype("u1")))
    point_data.SetActiveScalars("p")
    cell_data.AddArray(array("p", (c * 0.125).astype("f4")))
    cell_data.AddArray(array("flux", np.stack([c, -c, 2 * c], axis=1).astype("f8")))
    return grid


def structured(ni=5, nj=4, nk=3, shift=0.0, time=0.0, double=False):
    grid = vtk.vtkStructuredGrid()
    grid.SetDimensions(ni, nj, nk)
    points = vtk.vtkPoints()
    points.SetData(array("Points", nodes_of(ni, nj, nk, shift).astype("f8" if double else "f4")))
    grid.SetPoints(points)
    return add_arrays(grid, time)


def rectilinear():
    grid = vtk.vtkRectilinearGrid()
    grid.SetDimensions(4, 3, 5)
    grid.SetXCoordinates(array("x", np.array([0, 0.5, 2, 4], "f4")))
    grid.SetYCoordinates(array("y", np.array([-1, 0.1, 1], "f4")))
    grid.SetZCoordinates(array("z", np.array([0, 1, 3, 7, 15], "f4")))
    return add_arrays(grid)


def uniform(turned):
    grid = vtk.vtkImageData()
    grid.SetExtent(2, 5, -1, 2, 0, 2) if turned else grid.SetDimensions(4, 4, 3)
    grid.SetOrigin(1, 2, 3)
    grid.SetSpacing(0.5, 0.25, 2)
    if turned:
        grid.SetDirectionMatrix([0, -1, 0, 1, 0, 0, 0, 0, 1])
    return add_arrays(grid)


def write_legacy(grid, name, binary, version=51):
    writer = vtk.vtkDataSetWriter()
    writer.SetInputData(grid)
    writer.SetFileName(str(FOLDER / name))
    writer.SetFileTypeToBinary() if binary else writer.SetFileTypeToASCII()
    writer.SetFileVersion(version)
    assert writer.Write()


def write_xml(writer, grid, name, mode, compressor=None, *, encoded=False, block=1 << 15, bits=32, big=False):
    if grid is not None:
        writer.SetInputData(grid)
    writer.SetFileName(str(FOLDER / name))
    getattr(writer, "SetDataModeTo" + mode)()
    writer.SetEncodeAppendedData(encoded)
    writer.SetCompressorTypeToNone() if compressor is None else getattr(
        writer, "SetCompressorTypeTo" + compressor)()
    writer.SetBlockSize(block)
    writer.SetHeaderTypeToUInt64() if bits == 64 else writer.SetHeaderTypeToUInt32()
    writer.SetByteOrderToBigEndian() if big else writer.SetByteOrderToLittleEndian()
    assert writer.Write()


def write_parallel():
    """Four pieces with a layer of ghosts, as a parallel run writes them."""
    source = vtk.vtkRTAnalyticSource()
    source.SetWholeExtent(0, 8, 0, 7, 0, 6)
    to_cells = vtk.vtkPointDataToCellData()
    to_cells.SetInputConnection(source.GetOutputPort())
    to_cells.PassPointDataOn()
    points = vtk.vtkImageDataToPointSet()
    points.SetInputConnection(to_cells.GetOutputPort())
    for writer, tail, name in ((vtk.vtkXMLPStructuredGridWriter(), points, "ghosts.pvts"),
                               (vtk.vtkXMLPImageDataWriter(), to_cells, "ghosts.pvti")):
        writer.SetInputConnection(tail.GetOutputPort())
        writer.SetNumberOfPieces(4)
        writer.SetStartPiece(0)
        writer.SetEndPiece(3)
        writer.SetGhostLevel(1)
        write_xml(writer, None, name, "Appended", "ZLib")


def write_all():
    FOLDER.mkdir(exist_ok=True)
    for old in FOLDER.rglob("*.*"):
        if old.is_file():
            old.unlink()
    vts = vtk.vtkXMLStructuredGridWriter
    write_legacy(structured(), "structured_ascii.vtk", False)
    write_legacy(structured(double=True), "structured_binary.vtk", True)
    write_legacy(structured(), "structured_binary_42.vtk", True, 42)
    write_legacy(rectilinear(), "rectilinear_ascii.vtk", False)
    write_legacy(rectilinear(), "rectilinear_binary.vtk", True)
    write_legacy(uniform(False), "uniform_ascii.vtk", False)
    write_legacy(uniform(False), "uniform_binary.vtk", True)
    write_xml(vts(), structured(), "ascii.vts", "Ascii")
    write_xml(vts(), structured(), "inline.vts", "Binary")
    write_xml(vts(), structured(), "inline_zlib_big.vts", "Binary", "ZLib", block=64, big=True)
    write_xml(vts(), structured(double=True), "raw_lz4_64.vts", "Appended", "LZ4", block=128, bits=64)
    write_xml(vts(), structured(), "base64_zlib.vts", "Appended", "ZLib", encoded=True, block=96)
    write_xml(vts(), structured(), "base64_64_big.vts", "Appended", encoded=True, bits=64, big=True)
    write_xml(vtk.vtkXMLRectilinearGridWriter(), rectilinear(), "rectilinear.vtr", "Appended", "ZLib")
    write_xml(vtk.vtkXMLImageDataWriter(), uniform(True), "turned.vti", "Appended")

    blanked = structured()
    for point in (0, 17, 23):
        blanked.BlankPoint(point)
    for cell in (0, 1, 4, 5, 12, 13, 16, 17):
        blanked.BlankCell(cell)
    write_xml(vts(), blanked, "blanked.vts", "Appended")

    blocks = vtk.vtkMultiBlockDataSet()
    sphere = vtk.vtkSphereSource()
    sphere.SetThetaResolution(3)
    sphere.Update()
    for n, (name, block) in enumerate((("inlet", structured()), ("ball", sphere.GetOutput()),
                                       ("outlet", structured(3, 4, 5, 9.0)))):
        blocks.SetBlock(n, block)
        blocks.GetMetaData(n).Set(vtk.vtkCompositeDataSet.NAME(), name)
    write_xml(vtk.vtkXMLMultiBlockDataWriter(), blocks, "blocks.vtm", "Appended")

    series = ['<?xml version="1.0"?>', '<VTKFile type="Collection" version="0.1">', "<Collection>"]
    for step, time in reversed(list(enumerate((0.5, 1.25, 4.0)))):
        write_xml(vts(), structured(time=time), f"step{step}.vts", "Appended", "ZLib")
        series.append(f'<DataSet timestep="{time}" group="" part="0" file="step{step}.vts"/>')
    (FOLDER / "series.pvd").write_text("\n".join(series + ["</Collection>", "</VTKFile>", ""]))
    write_parallel()


def read(path):
    if path.suffix == ".vtk":
        reader = vtk.vtkDataSetReader()
        for kind in ("Scalars", "Vectors", "Normals", "Tensors", "TCoords", "Fields", "ColorScalars"):
            getattr(reader, f"ReadAll{kind}On")()
    else:
        reader = XML_READERS[path.suffix[1:]]()
    reader.SetFileName(str(path))
    reader.Update()
    return reader.GetOutput()


def crc(values):
    return zlib.crc32(np.ascontiguousarray(values).tobytes())


def coordinates_of(grid):
    if isinstance(grid, vtk.vtkStructuredGrid):
        return vtk_to_numpy(grid.GetPoints().GetData()).astype("f8")
    return np.array([grid.GetPoint(n) for n in range(grid.GetNumberOfPoints())])


def scalars_of(data):
    for n in range(data.GetNumberOfArrays()):
        stored = data.GetArray(n)
        if stored is None or stored.GetName() == "vtkGhostType":
            continue
        values = vtk_to_numpy(stored)
        values = values[:, None] if values.ndim == 1 else values
        components = values.shape[1]
        if components == 1:
            yield stored.GetName(), values[:, 0].astype("f4")
            continue
        if components <= 3:
            squares = sum(values[:, c].astype("f8") ** 2 for c in range(components))
            yield stored.GetName() + ":mag", np.sqrt(squares).astype("f4")
        for c in range(components):
            yield f"{stored.GetName()}:{'xyz'[c] if components <= 3 else c}", values[:, c].astype("f4")


def expected_of(grid):
    xyz = coordinates_of(grid)
    expected = {"dimensions": list(grid.GetDimensions()), "xyz": [crc(xyz[:, axis]) for axis in range(3)],
                "lower": xyz.min(axis=0).tolist(), "upper": xyz.max(axis=0).tolist(), "scalars": []}
    for centring, data in (("node", grid.GetPointData()), ("cell", grid.GetCellData())):
        for name, values in scalars_of(data):
            expected["scalars"].append({"name": name, "centring": centring, "min": float(values.min()),
                                        "max": float(values.max()), "crc": crc(values)})
    return expected


def expected_of_whole(grid):
    """Of a grid that is read in pieces: its nodes in no order, and sums over its cells."""
    xyz = coordinates_of(grid)
    name, values = next(scalars_of(grid.GetPointData()))
    nodes = np.unique(np.concatenate([xyz, values[:, None].astype("f8")], axis=1), axis=0)
    cells = dict(scalars_of(grid.GetCellData()))[name].astype("f8")
    return {"nodes": len(nodes), "cells": len(cells), "crc": crc(nodes), "cell_sum": math.fsum(cells)}


def expected_in(paths):
    expected = {}
    for path in paths:
        grid = read(path)
        if isinstance(grid, vtk.vtkMultiBlockDataSet):
            blocks = [grid.GetBlock(n) for n in range(grid.GetNumberOfBlocks())]
            expected[path.name] = [expected_of(b) for b in blocks if isinstance(b, vtk.vtkStructuredGrid)]
        elif path.suffix.startswith(".p"):
            expected[path.name] = expected_of_whole(grid)
        else:
            expected[path.name] = [expected_of(grid)]
    return expected


def readable(folder):
    return sorted(p for p in folder.iterdir()
                  if p.suffix[1:] in XML_READERS or p.suffix == ".vtk")


def write_json(name, expected):
    lines = [f"{json.dumps(file)}: {json.dumps(found)}" for file, found in expected.items()]
    (FOLDER / name).write_text("{\n" + ",\n".join(lines) + "\n}\n")


def main():
    write_all()
    alone = [p for p in readable(FOLDER) if not p.name.startswith("ghosts_")]
    write_json("expected.json", expected_in(alone))
    if len(sys.argv) > 1:
        real = pathlib.Path(sys.argv[1])
        paths = readable(real / "vtk") + readable(real / "vts_encodings")
        write_json("expected_real.json", expected_in(paths))


if __name__ == "__main__":
    main()
