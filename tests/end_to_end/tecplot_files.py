"""Writes Tecplot files from Tecplot's Data Format Guide alone: the reader under test shares nothing with it."""
import struct

import numpy as np

TYPES = {"f4": 1, "f8": 2, "i4": 3, "i2": 4, "u1": 5}


def flat(values):
    return np.asarray(values).ravel()  # (k, j, i): i is the fastest, as in Tecplot


def write_text(path, zones, variables=("X", "Y", "Z", "p"), title="jet"):
    """`zones`: (words of the header, packing, arrays); an array of None is not written."""
    lines = [f'TITLE = "{title}"', "VARIABLES = " + " ".join(f'"{v}"' for v in variables)]
    for words, packing, arrays in zones:
        lines += [f"ZONE {words}", "# a comment"]
        values = [flat(a) for a in arrays if a is not None]
        if packing == "POINT":
            values = [np.stack(values, -1).ravel()]
        for array in values:
            lines += [" ".join(repr(float(v)) for v in array[n:n + 7]) for n in range(0, len(array), 7)]
    path.write_text("\n".join(lines) + "\n")


def padded(block, values, last_plane=False):
    """Values of cells with the rows and columns of the nodes."""
    full = np.zeros(block.shape, values.dtype)
    full[:-1, :-1, :-1] = values
    return full if last_plane else full[:-1]


class Binary:
    """A file of version 112, or an older one."""

    def __init__(self, variables, version=112, order="<", has_packing=None):
        self.variables, self.version, self.order = variables, version, order
        self.has_packing = version < 112 if has_packing is None else has_packing
        self.head, self.data = b"", b""
        self.zones = 0

    def ints(self, *values):
        return struct.pack(f"{self.order}{len(values)}i", *values)

    def real(self, value, kind="f"):
        return struct.pack(self.order + kind, value)

    def text(self, words):
        return self.ints(*words.encode(), 0)

    def geometry(self):
        """A line of two points, a label, a text and auxiliary data, as Tecplot saves them with a layout."""
        self.head += self.real(399) + self.ints(0, 0, 0) + struct.pack(self.order + "3d", 0, 0, 0)
        self.head += self.ints(0, 1, 1, 0, 0, 0) + struct.pack(self.order + "2d", 1, 1) + self.ints(2, 0, 0)
        self.head += struct.pack(self.order + "2d", 1, 1) + self.text("") + self.ints(1, 0)
        self.head += self.ints(1, 2) + struct.pack(self.order + "4f", 0, 1, 0, 1)
        self.head += self.real(499) + self.ints(0, 0) + struct.pack(self.order + "3d", 0, 0, 0) + self.ints(0, 0)
        self.head += self.real(1, "d") + self.ints(0) + struct.pack(self.order + "2d", 1, 1) + self.ints(0, 0)
        self.head += struct.pack(self.order + "2d", 0, 1) + self.ints(0, 0, 0) + self.text("") + self.ints(0) + self.text("a")
        self.head += self.real(599) + self.ints(2) + self.text("one") + self.text("two")
        self.head += self.real(799) + self.text("name") + self.ints(0) + self.text("value")
        self.head += self.real(899) + self.ints(0) + self.text("name") + self.ints(0) + self.text("value")

    OPTIONS = {"strand": -1, "time": 0.0, "centrings": None, "shared": None, "passive": None, "point": False, "zone_type": 0,
               "auxiliary": (), "elements": None, "elements_of": -1, "face_neighbours": False, "faces": None}

    def zone(self, shape, arrays, name="", **options):
        """`shape`: of the nodes, (k, j, i). `arrays`: of each variable, None if it is shared or passive. `options`: of OPTIONS.
        Of finite elements `shape` is the number of nodes, `elements` their nodes, from 0. `faces`: their corners, elements on the left
        and right, and whether some are connected to other zones; of polygons `faces` are lines."""
        strand, time, centrings, shared, passive, point, zone_type, auxiliary, elements, elements_of, face_neighbours, faces = {
            **self.OPTIONS, **options}.values()
        count = len(self.variables)
        self.head += self.real(299) + self.text(name)
        if self.version >= 107:
            self.head += self.ints(-1)
        self.head += self.ints(strand) + self.real(time, "d") + self.ints(-1, zone_type)
        if self.has_packing:
            self.head += self.ints(int(point))
        self.head += self.ints(1, *centrings) if centrings else self.ints(0)
        self.head += self.ints(int(face_neighbours), 0) if self.version >= 108 else self.ints(int(face_neighbours))
        self.head += self.ints(*shape[::-1]) if elements is None else self.ints(
            shape, *((len(faces[0]), sum(map(len, faces[0])), *(faces[3:] or (0, 0))) if faces else ()), len(elements), 0, 0, 0)
        for key, value in auxiliary:
            self.head += self.ints(1) + self.text(key) + self.ints(0) + self.text(value)
        self.head += self.ints(0)

        self.data += self.real(299)
        self.data += self.ints(*[1 if a is None else TYPES[a.dtype.str[1:]] for a in arrays])
        self.data += self.ints(1, *passive) if passive else self.ints(0)
        self.data += self.ints(1, *shared) if shared else self.ints(0)
        self.data += self.ints(elements_of)
        stored = [a for a in arrays if a is not None]
        for a in stored:
            self.data += struct.pack(self.order + "2d", a.min(), a.max())
        if point:
            rows = np.stack([flat(a) for a in stored], -1)
            self.data += rows.astype(rows.dtype.newbyteorder(self.order)).tobytes()
        else:
            for a in stored:
                self.data += flat(a).astype(a.dtype.newbyteorder(self.order)).tobytes()
        if elements is not None and elements_of < 0:
            if faces:
                corners, left, right, *connected = faces
                ends = np.cumsum([0] + [len(face) for face in corners])
                self.data += self.ints(*(ends if zone_type == 7 else ()), *np.concatenate(corners), *left, *right)
                if connected:
                    self.data += self.ints(*range(connected[0] + 1), *[0] * connected[1]) + struct.pack(f"{self.order}{connected[1]}h", *[1] * connected[1])
            else:
                self.data += self.ints(*np.ravel(elements))
            if face_neighbours:
                self.data += self.ints(*[-1] * (len(elements) * {2: 2, 3: 3, 4: 4, 8: 6}[len(elements[0])]))
        self.zones += 1
        assert len(arrays) == count

    def write(self, path, file_type=0, title="jet"):
        begin = f"#!TDV{self.version}".encode() + self.ints(1)
        if self.version >= 111:
            begin += self.ints(file_type)
        begin += self.text(title) + self.ints(len(self.variables))
        for name in self.variables:
            begin += self.text(name)
        path.write_bytes(begin + self.head + self.real(357) + self.data)
