#!/usr/bin/python3
"""make_cgns_file.py: writes cgns/flow.cgns, a bent block with density, velocity and pressure at its vertices.

Needs python3-h5py. CGNS is HDF5 with a group for each node of its tree: attributes name, label, type and flags, and a dataset
" data" (cgns.github.io, "CGNS/HDF5 File Mapping").
"""
import math
import pathlib

import h5py
import numpy as np

FOLDER = pathlib.Path(__file__).resolve().parent / "cgns"
NI, NJ, NK = 12, 10, 8


def text(value, length=33):
    return np.array(value.encode().ljust(length, b"\0"), dtype=f"S{length}")


def node(parent, name, label, data=None):
    group = parent.create_group(name, track_order=True)
    kind = "MT"
    if isinstance(data, str):
        data, kind = np.frombuffer(data.encode(), np.int8), "C1"
    elif data is not None:
        kind = {"float32": "R4", "float64": "R8", "int32": "I4"}[str(data.dtype)]
    if data is not None:
        group.create_dataset(" data", data=data)
    for key, value, length in (("name", name, 33), ("label", label, 33), ("type", kind, 3)):
        group.attrs[key] = text(value, length)
    group.attrs["flags"] = np.array([1], np.int32)
    return group


def main():
    FOLDER.mkdir(exist_ok=True)
    k, j, i = np.meshgrid(np.arange(NK), np.arange(NJ), np.arange(NI), indexing="ij")
    angle, radius = math.pi * i / (NI - 1), 1 + 3 * j / (NJ - 1)
    x, y, z = 4 - radius * np.cos(angle), radius * np.sin(angle), 5 * k / (NK - 1)
    density = 1 + 0.5 * np.sin(x + y)
    with h5py.File(FOLDER / "flow.cgns", "w", track_order=True, libver=("earliest", "v110")) as root:
        for key, value, length in (("name", "HDF5 MotherNode", 33), ("label", "Root Node of HDF5 File", 33), ("type", "MT", 3)):
            root.attrs[key] = text(value, length)
        root.create_dataset(" format", data=np.frombuffer(b"IEEE_LITTLE_32\0", np.int8))
        root.create_dataset(" hdf5version", data=np.frombuffer(b"HDF5 Version 1.10.8".ljust(33, b"\0"), np.int8))
        node(root, "CGNSLibraryVersion", "CGNSLibraryVersion_t", np.array([3.1], np.float32))
        base = node(root, "Base", "CGNSBase_t", np.array([3, 3], np.int32))
        zone = node(base, "Zone 1", "Zone_t", np.array([[NI, NJ, NK], [NI - 1, NJ - 1, NK - 1], [0, 0, 0]], np.int32))
        node(zone, "ZoneType", "ZoneType_t", "Structured")
        grid = node(zone, "GridCoordinates", "GridCoordinates_t")
        for name, values in (("CoordinateX", x), ("CoordinateY", y), ("CoordinateZ", z)):
            node(grid, name, "DataArray_t", values.astype(np.float32))
        flow = node(zone, "FlowSolution", "FlowSolution_t")
        node(flow, "GridLocation", "GridLocation_t", "Vertex")
        for name, values in (("Density", density), ("VelocityX", 2 + 0 * x), ("VelocityY", 0.1 * x), ("VelocityZ", 0 * x),
                             ("Pressure", 0.7 + 0.2 * np.cos(x) * density)):
            node(flow, name, "DataArray_t", values.astype(np.float32))


if __name__ == "__main__":
    main()
