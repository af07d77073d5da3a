#!/usr/bin/python3
"""hdf5_attributes_test.py CURVISPLAT

HDF5 files of every format that is HDF5 inside, with attributes of every HDF5 type and extent under the names that readers and
libraries look for: `info` and `convert` read the file or refuse it by one line. In a build with sanitizers this is the check that
none of them reaches beyond a buffer. Exit status 77 (skipped) without python3-h5py or python3-netcdf4.
"""
import itertools
import sys
import unittest

from structured_formats import RANDOM, Block, StructuredFormats, np
from sweep import some_of

try:
    import h5py
    import netCDF4
except ModuleNotFoundError as error:
    print(f"skipped: {error}; install python3-h5py and python3-netcdf4")
    sys.exit(77)

from round_trips_test import CgnsLayout

TEXT = "a text that is longer than any buffer " * 30
NAMES = ["type", "name", "label", "version", "format", "Conventions", "units", "standard_name", "coordinates", "formula_terms",
         "flag_values", "flag_meanings", "_FillValue", "missing_value", "valid_range", "scale_factor", "add_offset", "positive",
         "grid_mapping", "cf_role", "calendar", "CLASS", "NAME", "DIMENSION_LIST", "REFERENCE_LIST", "_NCProperties",
         "_Netcdf4Dimid", "_Netcdf4Coordinates", "_nc3_strict", "_NCCOPY", "api_version", "floating_point_word_size", "title",
         "Version", "Type", "WholeExtent", "Origin", "Direction", "Scalars", "Attribute"]


def put(holder, name, kind):
    """Adds the attribute; it replaces one of that name."""
    if name in holder.attrs:
        del holder.attrs[name]
    space = {"null": h5py.h5s.create(h5py.h5s.NULL), "scalar": h5py.h5s.create(h5py.h5s.SCALAR),
             "list": h5py.h5s.create_simple((3,)), "empty": h5py.h5s.create_simple((0,)),
             "matrix": h5py.h5s.create_simple((2, 2)), "long": h5py.h5s.create_simple((5000,))}
    extent, _, element = kind.partition(" ")
    makers = {
        "i1": lambda: h5py.h5t.STD_I8LE, "u8": lambda: h5py.h5t.STD_U64BE, "i4": lambda: h5py.h5t.STD_I32LE,
        "f4": lambda: h5py.h5t.IEEE_F32BE, "f8": lambda: h5py.h5t.IEEE_F64LE, "bits": lambda: h5py.h5t.STD_B8LE,
        "text": lambda: string(len(TEXT)), "letter": lambda: string(1), "variable": lambda: h5py.h5t.py_create(h5py.string_dtype()),
        "opaque": lambda: h5py.h5t.create(h5py.h5t.OPAQUE, 700), "enum": lambda: h5py.h5t.py_create(h5py.enum_dtype({"A": 1, "B": 2})),
        "compound": lambda: h5py.h5t.py_create(np.dtype([("a", "f8"), ("b", "i4", (40,))])),
        "array": lambda: h5py.h5t.array_create(h5py.h5t.IEEE_F64LE, (100,)),
        "lists": lambda: h5py.h5t.py_create(h5py.vlen_dtype(np.dtype("f8"))),
        "reference": lambda: h5py.h5t.STD_REF_OBJ, "region": lambda: h5py.h5t.STD_REF_DSETREG}
    attribute = h5py.h5a.create(holder.id, name.encode(), makers[element](), space[extent])
    if element in ("variable", "lists") or extent in ("null", "empty"):
        return  # as created: null pointers
    kind_of = attribute.get_type()
    count = int(np.prod(attribute.shape)) if attribute.shape else 1
    data = (TEXT.encode() * (count * kind_of.get_size() // len(TEXT) + 1))[:count * kind_of.get_size()]
    if element in ("reference", "region"):
        data = bytes(len(data))
    attribute.write(np.frombuffer(data, np.dtype(f"V{kind_of.get_size()}")).reshape(attribute.shape or ()), mtype=kind_of)


def string(size):
    kind = h5py.h5t.C_S1.copy()
    kind.set_size(size)
    return kind


KINDS = [f"{extent} {element}" for extent, element in itertools.product(
    ("null", "scalar", "list", "empty", "matrix", "long"),
    ("i1", "u8", "i4", "f4", "f8", "bits", "text", "letter", "variable", "opaque", "enum", "compound", "array", "lists", "reference",
     "region")) if not (extent == "long" and element in ("text", "opaque", "compound", "array"))]


class HostileAttributes(StructuredFormats):
    def cgns(self):
        path = self.folder / "grid.cgns"
        file = CgnsLayout(path)
        base = file.node(file.file, "Base", "CGNSBase_t", np.array([3, 3], "i4"))
        file.zone(base, "Zone", Block((3, 4, 5)))
        file.file.close()
        return path, ["/", "/CGNSLibraryVersion", "/Base", "/Base/Zone", "/Base/Zone/ZoneType", "/Base/Zone/GridCoordinates/CoordinateX",
                      "/Base/Zone/GridCoordinates/CoordinateX/ data", "/Base/Zone/nodes/p"]

    def netcdf(self):
        path = self.folder / "ocean.nc"
        with netCDF4.Dataset(path, "w") as f:
            for key, n, units in (("depth", 4, "m"), ("lat", 5, "degrees_north"), ("lon", 6, "degrees_east")):
                f.createDimension(key, n)
                f.createVariable(key, "f8", (key,))[:] = np.arange(n)
                f[key].units = units
            f.createVariable("p", "f4", ("depth", "lat", "lon"))[:] = RANDOM.random((4, 5, 6))
        return path, ["/", "/depth", "/lat", "/p"]

    def exodus(self):
        path = self.folder / "mesh.exo"
        with netCDF4.Dataset(path, "w") as f:
            for key, n in (("num_dim", 3), ("num_nodes", 8), ("num_elem", 1), ("num_el_blk", 1), ("num_el_in_blk1", 1), ("num_nod_per_el1", 8),
                           ("time_step", None)):
                f.createDimension(key, n)
            f.api_version, f.floating_point_word_size = np.float32(8.03), np.int32(8)
            for axis, bit in zip("xyz", (1, 2, 4)):
                f.createVariable(f"coord{axis}", "f8", ("num_nodes",))[:] = [float(n // bit % 2) for n in (0, 1, 3, 2, 4, 5, 7, 6)]
            connect = f.createVariable("connect1", "i4", ("num_el_in_blk1", "num_nod_per_el1"))
            connect.elem_type = "HEX8"
            connect[:] = np.arange(1, 9)[None]
        return path, ["/", "/connect1", "/coordx"]

    def plain(self):
        path = self.folder / "plain.h5"
        with h5py.File(path, "w") as f:
            f["a/b"] = np.zeros((3, 4, 5))
        return path, ["/", "/a", "/a/b"]

    def xdmf(self):
        path, holders = self.plain()
        item = '<DataItem Dimensions="3 4 5" Format="HDF">plain.h5:/a/b</DataItem>'
        xmf = self.folder / "grid.xmf"
        xmf.write_text(f'<Xdmf><Domain><Grid><Topology TopologyType="3DSMesh" Dimensions="3 4 5"/><Geometry GeometryType="X_Y_Z">{item * 3}'
                       f'</Geometry><Attribute Name="p">{item}</Attribute></Grid></Domain></Xdmf>')
        return path, holders, xmf

    def vtkhdf(self):
        path = self.folder / "image.vtkhdf"
        with h5py.File(path, "w") as f:
            group = f.create_group("VTKHDF")
            group.attrs["Version"] = (2, 0)
            group.attrs["Type"] = "ImageData"
            for name, values in (("WholeExtent", (0, 4, 0, 3, 0, 2)), ("Origin", (0.0,) * 3), ("Spacing", (1.0,) * 3)):
                group.attrs[name] = values
            group["PointData/p"] = RANDOM.random((3, 4, 5))
        return path, ["/VTKHDF", "/VTKHDF/PointData", "/VTKHDF/PointData/p"]

    def attack(self, make):
        path, holders, *opened = make()
        whole = path.read_bytes()
        cases = [(holder, name, kind) for holder in holders for name in NAMES for kind in KINDS]
        tried = [cases[n] for n in RANDOM.permutation(len(cases))[:len(some_of(range(120), 10))]]
        for n, case in enumerate(tried):
            path.write_bytes(whole)
            # The library that h5py has writes some of them, too; what it cannot write is not tried.
            with h5py.File(path, "r+") as f:
                try:
                    put(f[case[0]], *case[1:])
                except (OSError, ValueError, RuntimeError, TypeError, KeyError):
                    continue
            words = ("info",) if n % 2 else ("convert", "-o", self.folder / "o.splats", "--overwrite")
            done = self.run_program(words[0], *(opened or [path]), *words[1:])
            self.assertIn(done.returncode, (0, 1, 2), (case, done.stderr))
            errors = [line for line in done.stderr.splitlines() if not line.startswith(("curvisplat: note", "curvisplat: warning"))]
            self.assertEqual(len(errors), int(done.returncode != 0), (case, done.stderr))

    def test_cgns(self):
        self.attack(self.cgns)

    def test_netcdf(self):
        self.attack(self.netcdf)

    def test_exodus(self):
        self.attack(self.exodus)

    def test_plain_hdf5(self):
        self.attack(self.plain)

    def test_xdmf(self):
        self.attack(self.xdmf)

    def test_vtkhdf(self):
        self.attack(self.vtkhdf)

    def test_every_kind_under_the_name_that_overflowed(self):
        """`type` of the root, whatever it holds."""
        for make in (self.cgns, self.netcdf, self.plain):
            path, _ = make()
            whole = path.read_bytes()
            for kind in some_of(KINDS, 12):
                path.write_bytes(whole)
                with h5py.File(path, "r+") as f:
                    try:
                        put(f["/"], "type", kind)
                    except (OSError, ValueError, RuntimeError, TypeError):
                        continue
                done = self.run_program("info", path)
                self.assertIn(done.returncode, (0, 1), (kind, done.stderr))


if __name__ == "__main__":
    unittest.main(verbosity=2)
