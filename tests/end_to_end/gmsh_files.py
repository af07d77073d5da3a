"""Writes meshes of Gmsh (.msh), as its manual describes them, of VTK's grids: versions 4.1 and 2.2, text and binary."""
import struct

import numpy as np
import vtk
from vtk.util.numpy_support import vtk_to_numpy

# Gmsh's type of each of VTK's, and VTK's node for each of Gmsh's.
TYPES = {vtk.VTK_TETRA: (4, range(4)), vtk.VTK_HEXAHEDRON: (5, range(8)), vtk.VTK_WEDGE: (6, range(6)), vtk.VTK_PYRAMID: (7, range(5)),
         vtk.VTK_QUAD: (3, range(4)), vtk.VTK_QUADRATIC_HEXAHEDRON: (17, np.argsort(
             [0, 1, 2, 3, 4, 5, 6, 7, 8, 11, 13, 9, 16, 18, 19, 17, 10, 12, 14, 15]))}

# Where Gmsh has the nodes of a cell, times its order: read from meshes that Gmsh 4.8 wrote. By Gmsh's type, with VTK's and the order.
LATTICES = {31: (vtk.VTK_LAGRANGE_TETRAHEDRON, 5, """
000 500 050 005 100 200 300 400 410 320 230 140 040 030 020 010 004 003 002 001 014 023 032 041 104 203 302 401 110 130 310 120 220
210 101 301 103 201 202 102 011 013 031 012 022 021 113 311 131 212 221 122 111 211 121 112"""), 93: (vtk.VTK_LAGRANGE_HEXAHEDRON, 4, """
000 400 440 040 004 404 444 044 100 200 300 010 020 030 001 002 003 410 420 430 401 402 403 340 240 140 441 442 443 041 042 043 104
204 304 014 024 034 414 424 434 344 244 144 110 130 330 310 120 230 320 210 220 101 301 303 103 201 302 203 102 202 011 013 033 031
012 023 032 021 022 411 431 433 413 421 432 423 412 422 341 141 143 343 241 142 243 342 242 114 314 334 134 214 324 234 124 224 111
311 331 131 113 313 333 133 211 121 112 321 312 231 332 132 213 123 323 233 221 212 122 322 232 223 222"""), 106: (vtk.VTK_LAGRANGE_WEDGE, 5, """
000 500 050 005 505 055 100 200 300 400 010 020 030 040 001 002 003 004 410 320 230 140 501 502 503 504 051 052 053 054 105 205 305
405 015 025 035 045 415 325 235 145 110 130 310 120 220 210 115 315 135 215 225 125 101 401 404 104 201 301 402 403 304 204 103 102
202 302 303 203 011 014 044 041 012 013 024 034 043 042 031 021 022 023 033 032 411 141 144 414 321 231 142 143 234 324 413 412 322
232 233 323 111 114 112 113 311 314 312 313 131 134 132 133 211 214 212 213 221 224 222 223 121 124 122 123""")}


# Of pyramids, which VTK does not have: by the order Gmsh's type and the nodes.
PYRAMIDS = {3: (118, """
000 300 330 030 003 100 200 010 020 001 002 310 320 201 102 230 130 221 112 021 012 101 011 211 121 110 120 220 210 111"""), 4: (119, """
000 400 440 040 004 100 200 300 010 020 030 001 002 003 410 420 430 301 202 103 340 240 140 331 222 113 031 022 013 101 201 102 021 011
012 311 321 212 231 131 122 110 130 330 310 120 230 320 210 220 111 211 221 121 112"""), 5: (120, """
000 500 550 050 005 100 200 300 400 010 020 030 040 001 002 003 004 510 520 530 540 401 302 203 104 450 350 250 150 441 332 223 114 041
032 023 014 101 301 103 201 202 102 031 011 013 021 012 022 411 431 213 421 322 312 341 141 123 241 132 232 110 140 440 410 120 130 240
340 430 420 310 210 220 230 330 320 111 311 331 131 113 211 121 112 321 212 231 222 122 221""")}


def lattice_of(order, text):
    return np.array([[int(digit) for digit in node] for node in text.split()]) / order


class Msh:
    """The text or bytes of a file. `tags`, `element_tags`: the numbers of nodes and elements; `kinds`: as TYPES. `groups`: how many
    physical groups of version 2 each element is in; it is there as often, with numbers of its own."""

    def __init__(self, grid, version=4.1, order="<", **tags):
        self.version, self.order = version, order
        self.points = vtk_to_numpy(grid.GetPoints().GetData()).astype("f8")
        self.cells = []
        for n in range(grid.GetNumberOfCells()):
            kind, nodes = tags.get("kinds", TYPES)[grid.GetCellType(n)]
            points = vtk.vtkIdList()
            grid.GetCellPoints(n, points)
            ids = [points.GetId(k) for k in range(points.GetNumberOfIds())]
            self.cells.append((kind, [ids[k] for k in nodes]))
        self.tags = np.asarray(tags.get("tags", np.arange(len(self.points)) + 1))
        self.groups, self.partition = tags.get("groups", 1), tags.get("partition")  # its number, and how many files there are
        self.element_tags = np.asarray(tags.get("element_tags", (np.arange(len(self.cells)) + 1) * self.groups))
        self.out = [b"$MeshFormat\n%g %d 8\n" % (version, bool(order)) + (struct.pack(order + "i", 1) + b"\n" if order else b"") + b"$EndMeshFormat\n"]

    def numbers(self, kinds, *values):
        """`kinds`: as struct's; N is the number of a node or element, C a size."""
        if not self.order:
            return (" ".join(repr(float(v)) if kind == "d" else str(int(v)) for kind, v in zip(kinds, values)) + "\n").encode()
        return struct.pack(self.order + kinds.replace("N", "q" if self.version > 4 else "i").replace("C", "q" if self.version >= 4 else "i"), *values)

    def section(self, name, *parts):
        self.out.append(f"${name}\n".encode() + b"".join(parts) + (b"\n" if self.order else b"") + f"$End{name}\n".encode())

    def mesh(self, parametric=False):
        tags, n = self.tags, len(self.tags)
        self.section("PhysicalNames", b'1\n3 1 "$a $volume"\n')
        if self.version < 4:
            extra = [("ii" + "d" * (k % 3), [k, 7] + [0.5] * (k % 3)) if parametric else ("", []) for k in np.arange(n) % 4]
            self.section("Parametric" * parametric + "Nodes", b"%d\n" % n,
                         *(self.numbers("Nddd" + kinds, tag, *place, *more) for tag, place, (kinds, more) in zip(tags, self.points, extra)))
            parts = [b"%d\n" % (len(self.cells) * self.groups)]
            for tag, (kind, nodes) in ((tag - k, cell) for tag, cell in zip(self.element_tags, self.cells) for k in reversed(range(self.groups))):
                head = self.numbers("iii", kind, 1, 2) + self.numbers("N", tag) if self.order else b"%d %d 2 " % (tag, kind)
                parts.append(head + self.numbers("ii" + "N" * len(nodes), 1, 1, *tags[nodes]))
            self.section("Elements", *parts)
            return self
        if self.partition:
            of_volume = self.numbers("iiiCi", 1, 3, 1, 1, self.partition[0])
            of_volume += self.numbers("ddddddCC", 0, 0, 0, 1, 1, 1, 0, 0)
            self.section("PartitionedEntities", self.numbers("CCCCCC", self.partition[1], 0, 0, 0, 0, 1), of_volume)
        half = n // 2  # one entity has coordinates of its own
        if self.version == 4:  # numbers stand before their places, and an entity's before its dimension
            parts = [self.numbers("CC", 2, n)]
            for dimension, parametric, some in ((2, 1, slice(half)), (3, 0, slice(half, n))):
                parts.append(self.numbers("iiiC", 1, dimension, parametric, len(tags[some])))
                parts += [self.numbers("Nddd" + "dd" * parametric, tag, *place, *[0.5, 0.25] * parametric) for tag, place in zip(tags[some], self.points[some])]
            self.section("Nodes", *parts)
            parts = [self.numbers("CC", len(self.cells), len(self.cells))]
            for tag, (kind, nodes) in zip(self.element_tags, self.cells):
                parts.append(self.numbers("iiiC", 1, 3, kind, 1) + self.numbers("N" * (1 + len(nodes)), tag, *tags[nodes]))
            self.section("Elements", *parts)
            return self
        parts = [self.numbers("NNNN", 2, n, tags.min(), tags.max())]
        for dimension, parametric, some in ((2, 1, slice(half)), (3, 0, slice(half, n))):
            parts.append(self.numbers("iiiN", dimension, 1, parametric, len(tags[some])))
            parts += [self.numbers("N", tag) for tag in tags[some]]
            parts += [self.numbers("ddd" + "dd" * parametric, *place, *[0.5, 0.25] * parametric) for place in self.points[some]]
        self.section("Nodes", *parts)
        runs = []
        for n, (kind, _) in enumerate(self.cells):
            runs.append([n]) if not runs or self.cells[runs[-1][0]][0] != kind else runs[-1].append(n)
        parts = [self.numbers("NNNN", len(runs), len(self.cells), self.element_tags.min(), self.element_tags.max())]
        for run in runs:
            parts.append(self.numbers("iiiN", 3, 1, self.cells[run[0]][0], len(run)))
            parts += [self.numbers("N" * (1 + len(self.cells[n][1])), self.element_tags[n], *tags[self.cells[n][1]]) for n in run]
        self.section("Elements", *parts)
        return self

    def data(self, name, values, of="Node", time=0.0, step=0, some=None):
        values, tags = np.asarray(values), self.tags if of == "Node" else self.element_tags
        values = values.reshape(len(values), -1)
        some = range(len(values)) if some is None else some
        head = f'1\n"{name}"\n1\n{time!r}\n3\n{step}\n{values.shape[1]}\n{len(some)}\n'
        self.section(f"{of}Data", head.encode(), *(self.numbers("i" + "d" * values.shape[1], tags[n], *values[n]) for n in some))
        return self

    def data_at_nodes(self, name, values):
        """Values of each element at its nodes: values(element, node), by their indices."""
        head = f'1\n"{name}"\n1\n0.0\n3\n0\n1\n{len(self.cells)}\n'
        self.section("ElementNodeData", head.encode(),
                     *(self.numbers("ii" + "d" * len(nodes), self.element_tags[n], len(nodes), *(values(n, node) for node in nodes))
                       for n, (_, nodes) in enumerate(self.cells)))
        return self

    def write(self, path):
        path.write_bytes(b"".join(self.out))
        return path
