"""libcgns, called through ctypes (pyCGNS is not in Debian): writes unstructured zones as programs of the field do."""
import ctypes
import ctypes.util

import numpy as np

MODE_WRITE, ADF, HDF5 = 1, 1, 2
STRUCTURED, UNSTRUCTURED, VERTEX, CELL_CENTER, REAL_SINGLE, REAL_DOUBLE = 2, 3, 2, 3, 3, 4
TETRA_4, PYRA_5, PENTA_6, HEXA_8, HEXA_20, QUAD_4, TRI_3, MIXED, NGON, NFACE = 10, 12, 14, 17, 18, 7, 5, 20, 22, 23
BC_WALL, POINT_LIST, POINT_RANGE = 20, 2, 4


def library():
    name = ctypes.util.find_library("cgns")
    return name and ctypes.CDLL(name)


def copy_adf(path, to, layout):
    """The same nodes in a file of ADF's version B, whose pointers are binary: `layout` is IEEE_LITTLE_64, IEEE_BIG_64 ..."""
    lib, error = library(), ctypes.c_int()
    number, text, sizes = ctypes.c_int(), ctypes.create_string_buffer(64), (ctypes.c_int * 12)()

    def call(function, *words):
        getattr(lib, function)(*words, ctypes.byref(error))
        return error.value == -1

    def need(*words):
        if not call(*words):
            raise RuntimeError(f"{words[0]}: {error.value}")

    def copy(node, twin):
        need("ADF_Number_of_Children", node, ctypes.byref(number))
        names = ctypes.create_string_buffer(33 * number.value + 1)
        count = number.value
        if count:
            need("ADF_Children_Names", node, 1, count, 32, ctypes.byref(number), names)
        for n in range(count):
            name = names.raw[33 * n:33 * n + 32].split(b"\0")[0]
            child, other = ctypes.c_double(), ctypes.c_double()
            need("ADF_Get_Node_ID", node, name, ctypes.byref(child))
            need("ADF_Create", twin, name, ctypes.byref(other))
            need("ADF_Get_Label", child, text)
            need("ADF_Set_Label", other, text)
            need("ADF_Get_Data_Type", child, text)
            if text.value[:2] != b"MT":
                need("ADF_Get_Number_of_Dimensions", child, ctypes.byref(number))
                need("ADF_Get_Dimension_Values", child, sizes)
                data = ctypes.create_string_buffer(8 * int(np.prod(sizes[:number.value])))
                need("ADF_Read_All_Data", child, data)
                need("ADF_Put_Dimension_Information", other, text, number.value, sizes)
                need("ADF_Write_All_Data", other, data)
            copy(child, other)

    one, two = ctypes.c_double(), ctypes.c_double()
    need("ADF_Database_Open", str(path).encode(), b"READ_ONLY", b"", ctypes.byref(one))
    need("ADF_Database_Open", str(to).encode(), b"NEW", layout.encode(), ctypes.byref(two))
    copy(one, two)
    need("ADF_Database_Close", one)
    need("ADF_Database_Close", two)


class CgnsFile:
    """with CgnsFile(path) as file: file.base(); file.zone(...); ..."""

    def __init__(self, path, kind=HDF5):
        self.lib, self.path, self.kind, self.number = library(), str(path).encode(), kind, ctypes.c_int()

    def __enter__(self):
        self.check(self.lib.cg_set_file_type(self.kind))
        self.check(self.lib.cg_open(self.path, MODE_WRITE, ctypes.byref(self.number)))
        return self

    def __exit__(self, *_):
        self.check(self.lib.cg_close(self.number))

    def check(self, error):
        if error:
            self.lib.cg_get_error.restype = ctypes.c_char_p
            raise RuntimeError(self.lib.cg_get_error().decode())

    def call(self, function, *words):
        """A function of libcgns whose last argument takes a number, which is returned."""
        out = ctypes.c_int()
        self.check(getattr(self.lib, function)(self.number, *words, ctypes.byref(out)))
        return out

    @staticmethod
    def ints(values):
        return np.ascontiguousarray(values, "i4").ctypes.data_as(ctypes.c_void_p)

    @staticmethod
    def numbers(values):
        values = np.ascontiguousarray(values, "f8")
        return values.ctypes.data_as(ctypes.c_void_p), values

    def base(self, name="Base", cell_dimension=3):
        self.b = self.call("cg_base_write", name.encode(), cell_dimension, 3)

    def family(self, name):
        self.call("cg_family_write", self.b, name.encode())

    def zone(self, name, points, cells):
        self.z = self.call("cg_zone_write", self.b, name.encode(), self.ints([len(points), cells, 0]), UNSTRUCTURED)
        self.next = 1
        for axis in range(3):
            pointer, _kept = self.numbers(points[:, axis])
            self.call("cg_coord_write", self.b, self.z, REAL_DOUBLE, f"Coordinate{'XYZ'[axis]}".encode(), pointer)

    def block(self, name, places):
        """A structured zone. `places`: [axis, k, j, i]."""
        nodes = np.array(places.shape[:0:-1], "i4")
        self.z = self.call("cg_zone_write", self.b, name.encode(), self.ints([nodes, nodes - 1, 0 * nodes]), STRUCTURED)
        for axis in range(3):
            pointer, _kept = self.numbers(places[axis])
            self.call("cg_coord_write", self.b, self.z, REAL_DOUBLE, f"Coordinate{'XYZ'[axis]}".encode(), pointer)

    def hole(self, name, ranges, location=VERTEX):
        """An overset hole: [range][6], from 1."""
        self.call("cg_hole_write", self.b, self.z, name.encode(), location, POINT_RANGE, len(ranges), 2 * len(ranges), self.ints(ranges))

    def section(self, name, kind, elements, count=None, begins=None):
        """`elements`: numbers of nodes from 1, in rows or, with `begins`, in a list of `count` elements."""
        count = count or len(elements)
        at = [self.b, self.z, name.encode(), kind, self.next, self.next + count - 1, 0, self.ints(np.ravel(elements))]
        self.next += count
        if begins is None:
            return self.call("cg_section_write", *at)
        return self.call("cg_poly_section_write", *at, self.ints(begins))

    def parents(self, section, left, right):
        zeros = np.zeros(len(left), "i4")
        self.check(self.lib.cg_parent_data_write(self.number, self.b, self.z, section,
                                                 self.ints(np.concatenate([left, right, zeros, zeros]))))

    def solution(self, name, location, fields):
        s = self.call("cg_sol_write", self.b, self.z, name.encode(), location)
        for field, values in fields.items():
            pointer, _kept = self.numbers(values)
            self.call("cg_field_write", self.b, self.z, s, REAL_DOUBLE, field.encode(), pointer)

    def wall(self, name, points):
        self.call("cg_boco_write", self.b, self.z, name.encode(), BC_WALL, POINT_LIST, len(points), self.ints(points))
