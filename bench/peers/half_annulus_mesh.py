#!/usr/bin/env python3
"""Writes the half-annulus scene in tetrahedra of a body-centred lattice as .vtu: the mesh of tests/reference/array_mesh.h.

    bench/peers/half_annulus_mesh.py OUT.vtu --cubes 50x25x25 [--cells]

The corners and the centres of so many cubes are the points, and each face of a cube is the middle of four tetrahedra. The field is
"scalar", at the points or, with --cells, in the cells at the mean of their corners. Needs numpy.
"""
import argparse
import sys

import numpy as np

CLUSTERING = 2.5


def position(u, v, w):
    radius = 0.3 + 0.7 * np.expm1(CLUSTERING * v) / np.expm1(CLUSTERING)
    angle = np.pi * u
    return np.stack([-radius * np.sin(angle), radius * np.cos(angle), w + 0.15 * radius * np.sin(3 * angle)], -1)


def field(at):
    """As preprocess/scenes/scenes.cpp has it."""
    x, y, z = at.T
    wide = (x + 0.5)**2 + (y - 0.3)**2 + (z - 0.5)**2
    narrow = (x + 0.4)**2 + (y + 0.4)**2 + (z - 0.3)**2
    value = 0.2 + np.exp(-8 * wide) + 0.8 * np.exp(-20 * narrow) + 0.06 * np.sin(9 * x) * np.cos(8 * y + 2 * z)
    return np.clip(value, 0, 1)


def lattice(size, shift):
    """Points of a lattice of cubes, moved by `shift` cubes; u fastest."""
    along = [np.arange(n + (shift == 0)) + shift for n in size]
    w, v, u = np.meshgrid(along[2], along[1], along[0], indexing="ij")
    return position((u / size[0]).ravel(), (v / size[1]).ravel(), (w / size[2]).ravel())


def tetrahedra(size):
    """Four around each inner face of a cube, two on each outer one."""
    nu, nv, nw = size
    corners = np.arange((nu + 1) * (nv + 1) * (nw + 1)).reshape(nw + 1, nv + 1, nu + 1)
    centres = corners.size + np.arange(nu * nv * nw).reshape(nw, nv, nu)
    cells = []
    for axis in range(3):  # of the arrays: k, j, i
        at = np.moveaxis(corners, axis, 0)
        inside = np.moveaxis(centres, axis, 0)
        face = np.stack([at[:, :-1, :-1], at[:, 1:, :-1], at[:, 1:, 1:], at[:, :-1, 1:]], -1)
        for m in range(4):
            a, b = face[1:-1, ..., m], face[1:-1, ..., (m + 1) % 4]
            cells.append(np.stack([inside[:-1], inside[1:], a, b], -1).reshape(-1, 4))
        for outer, beside in ((face[0], inside[0]), (face[-1], inside[-1])):
            for three in ((0, 1, 2), (0, 2, 3)):
                cells.append(np.concatenate([outer[..., three], beside[..., None]], -1).reshape(-1, 4))
    return np.concatenate(cells)


def write(path, points, cells, values, of_cells):
    scalar = f'<DataArray type="Float32" Name="scalar" format="appended" offset="0"/>'
    arrays = [values.astype("f4"), points.astype("f8"), cells.astype("i8"), 4 * np.arange(1, len(cells) + 1, dtype="i8"),
              np.full(len(cells), 10, "u1")]
    offsets = np.cumsum([0, *(8 + array.nbytes for array in arrays)])
    with open(path, "wb") as out:
        out.write((f'<VTKFile type="UnstructuredGrid" version="1.0" byte_order="LittleEndian" header_type="UInt64"><UnstructuredGrid>'
                   f'<Piece NumberOfPoints="{len(points)}" NumberOfCells="{len(cells)}">'
                   f'<PointData>{"" if of_cells else scalar}</PointData><CellData>{scalar if of_cells else ""}</CellData>'
                   f'<Points><DataArray type="Float64" NumberOfComponents="3" format="appended" offset="{offsets[1]}"/></Points>'
                   f'<Cells><DataArray type="Int64" Name="connectivity" format="appended" offset="{offsets[2]}"/>'
                   f'<DataArray type="Int64" Name="offsets" format="appended" offset="{offsets[3]}"/>'
                   f'<DataArray type="UInt8" Name="types" format="appended" offset="{offsets[4]}"/></Cells></Piece>'
                   f'</UnstructuredGrid><AppendedData encoding="raw">_').encode())
        for array in arrays:
            out.write(np.uint64(array.nbytes).tobytes() + np.ascontiguousarray(array).tobytes())
        out.write(b"</AppendedData></VTKFile>\n")


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("out")
    parser.add_argument("--cubes", default="50x25x25")
    parser.add_argument("--cells", action="store_true", help="the field in the cells")
    arguments = parser.parse_args()
    size = [int(n) for n in arguments.cubes.split("x")]
    points = np.concatenate([lattice(size, 0), lattice(size, 0.5)])
    cells = tetrahedra(size)
    at = points[cells].mean(1) if arguments.cells else points
    write(arguments.out, points, cells, field(at), arguments.cells)


if __name__ == "__main__":
    sys.exit(main())
