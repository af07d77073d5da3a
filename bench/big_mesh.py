#!/usr/bin/env python3
"""Writes a cube of hexahedra, or of tetrahedra, as .vtu (raw, appended), plane by plane: any size, little memory.

    bench/big_mesh.py OUT.vtu --size 216 [--tetrahedra] [--second] [--shuffled]

SIZE x SIZE x SIZE cubes, each of them a hexahedron or six tetrahedra; a scalar "f" at points and one "c" in cells, both smooth; a
second one at points, "g", with --second. Inner points are moved by up to a tenth of a cube. --shuffled puts the cells into a random
order, in memory. Needs numpy.
"""
import argparse
import sys

import numpy as np

CORNERS = [0, 1, 3, 2, 4, 5, 7, 6]  # VTK's order, of x + 2 y + 4 z
# Of a cube's corners x + 2 y + 4 z: around the diagonal 0 to 7.
TETRAHEDRA = [(0, 1, 3, 7), (0, 3, 2, 7), (0, 2, 6, 7), (0, 6, 4, 7), (0, 4, 5, 7), (0, 5, 1, 7)]


def field(x, y, z):
    return (np.sin(7 * x) * np.cos(5 * y) + np.sin(6 * z + x)).astype("f4")


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("out")
    parser.add_argument("--size", type=int, default=64)
    parser.add_argument("--tetrahedra", action="store_true")
    parser.add_argument("--second", action="store_true")
    parser.add_argument("--shuffled", action="store_true")
    arguments = parser.parse_args()
    n, m = arguments.size, arguments.size + 1
    shapes = TETRAHEDRA if arguments.tetrahedra else [CORNERS]
    corners = len(shapes[0])
    cells = n ** 3 * len(shapes)
    arrays = [("f", "Float32", 1, 4 * m ** 3), ("c", "Float32", 1, 4 * cells), ("points", "Float64", 3, 24 * m ** 3),
              ("connectivity", "Int64", 1, 8 * corners * cells), ("offsets", "Int64", 1, 8 * cells), ("types", "UInt8", 1, cells)]
    if arguments.second:
        arrays.append(("g", "Float32", 1, 4 * m ** 3))
    offset, entries = 0, {}
    for name, kind, components, length in arrays:
        entries[name] = (f'<DataArray type="{kind}" Name="{name}" NumberOfComponents="{components}" format="appended" '
                         f'offset="{offset}"/>')
        offset += 8 + length
    head = (f'<VTKFile type="UnstructuredGrid" version="1.0" byte_order="LittleEndian" header_type="UInt64"><UnstructuredGrid>'
            f'<Piece NumberOfPoints="{m ** 3}" NumberOfCells="{cells}"><PointData>{entries["f"]}{entries.get("g", "")}</PointData>'
            f'<CellData>{entries["c"]}</CellData><Points>{entries["points"]}</Points><Cells>{entries["connectivity"]}'
            f'{entries["offsets"]}{entries["types"]}</Cells></Piece></UnstructuredGrid><AppendedData encoding="raw">_')
    along = np.arange(m)
    y, x = [a.ravel() / n for a in np.meshgrid(along, along, indexing="ij")]

    def plane(k):
        points = np.stack([x, y, np.full(m * m, k / n)], 1)
        shift = np.random.default_rng(k).uniform(-0.1 / n, 0.1 / n, points.shape)
        return np.where((points > 0) & (points < 1), points + shift, points)

    i, j = [a.ravel() for a in np.meshgrid(np.arange(n), np.arange(n), indexing="xy")]
    lowest = i + m * j
    steps = np.array([a + m * b + m * m * c for c in (0, 1) for b in (0, 1) for a in (0, 1)])
    pattern = steps[np.array(shapes)].reshape(1, -1)

    def ordered(planes):
        if not arguments.shuffled:
            return planes
        return [np.concatenate(list(planes))[np.random.default_rng(0).permutation(cells)]]

    with open(arguments.out, "wb") as out:
        out.write(head.encode())

        def put(length, parts):
            out.write(np.uint64(length).tobytes())
            for part in parts:
                out.write(np.ascontiguousarray(part).tobytes())

        put(arrays[0][3], (field(*plane(k).T) for k in range(m)))
        put(arrays[1][3], ordered(np.repeat(field((i + 0.5) / n, (j + 0.5) / n, (k + 0.5) / n), len(shapes)) for k in range(n)))
        put(arrays[2][3], (plane(k) for k in range(m)))
        put(arrays[3][3], ordered((lowest[:, None] + m * m * k + pattern).astype("i8").reshape(-1, corners) for k in range(n)))
        ends = np.arange(1, n * n * len(shapes) + 1) * corners
        put(arrays[4][3], (ends + k * n * n * len(shapes) * corners for k in range(n)))
        put(arrays[5][3], (np.full(n * n * len(shapes), 10 if arguments.tetrahedra else 12, "u1") for k in range(n)))
        if arguments.second:
            put(arrays[6][3], (field(*plane(k)[:, ::-1].T) for k in range(m)))
        out.write(b"</AppendedData></VTKFile>\n")


if __name__ == "__main__":
    sys.exit(main())
