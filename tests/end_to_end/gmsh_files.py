"""Writes meshes of Gmsh (.msh), as its manual describes them, of VTK's grids: versions 4.1 and 2.2, text and binary."""
import struct

import numpy as np
import vtk
from vtk.util.numpy_support import vtk_to_numpy

# Gmsh's type of each of VTK's, and VTK's node for each of Gmsh's.
TYPES = {vtk.VTK_TETRA: (4, range(4)), vtk.VTK_HEXAHEDRON: (5, range(8)), vtk.VTK_WEDGE: (6, range(6)), vtk.VTK_PYRAMID: (7, range(5)),
         vtk.VTK_QUAD: (3, range(4)), vtk.VTK_QUADRATIC_HEXAHEDRON: (17, np.argsort(
             [0, 1, 2, 3, 4, 5, 6, 7, 8, 11, 13, 9, 16, 18, 19, 17, 10, 12, 14, 15]))}


class Msh:
    """The text or bytes of a file. `tags`, `element_tags`: the numbers of nodes and elements."""

    def __init__(self, grid, version=4.1, order="<", **tags):
        self.version, self.order = version, order
        self.points = vtk_to_numpy(grid.GetPoints().GetData()).astype("f8")
        self.cells = []
        for n in range(grid.GetNumberOfCells()):
            kind, nodes = TYPES[grid.GetCellType(n)]
            ids = [grid.GetCell(n).GetPointId(k) for k in range(grid.GetCell(n).GetNumberOfPoints())]
            self.cells.append((kind, [ids[k] for k in nodes]))
        self.tags = np.asarray(tags.get("tags", np.arange(len(self.points)) + 1))
        self.element_tags = np.asarray(tags.get("element_tags", np.arange(len(self.cells)) + 1))
        self.out = [b"$MeshFormat\n%g %d 8\n" % (version, bool(order)) + (struct.pack(order + "i", 1) + b"\n" if order else b"") + b"$EndMeshFormat\n"]

    def numbers(self, kinds, *values):
        """`kinds`: as struct's; N is a size or the number of a node or element."""
        if not self.order:
            return (" ".join(repr(float(v)) if kind == "d" else str(int(v)) for kind, v in zip(kinds, values)) + "\n").encode()
        return struct.pack(self.order + kinds.replace("N", "q" if self.version > 4 else "i"), *values)

    def section(self, name, *parts):
        self.out.append(f"${name}\n".encode() + b"".join(parts) + (b"\n" if self.order else b"") + f"$End{name}\n".encode())

    def mesh(self):
        tags, n = self.tags, len(self.tags)
        self.section("PhysicalNames", b'1\n3 1 "$a $volume"\n')
        if self.version < 4:
            self.section("Nodes", b"%d\n" % n, *(self.numbers("Nddd", tag, *place) for tag, place in zip(tags, self.points)))
            parts = [b"%d\n" % len(self.cells)]
            for tag, (kind, nodes) in zip(self.element_tags, self.cells):
                head = self.numbers("iii", kind, 1, 2) + self.numbers("N", tag) if self.order else b"%d %d 2 " % (tag, kind)
                parts.append(head + self.numbers("ii" + "N" * len(nodes), 1, 1, *tags[nodes]))
            self.section("Elements", *parts)
            return self
        half = n // 2  # one entity has coordinates of its own
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

    def write(self, path):
        path.write_bytes(b"".join(self.out))
        return path
