"""CGNS by h5py alone, as pyCGNS and others lay it out."""
import importlib
import unittest

import numpy as np


def library(name):
    try:
        return importlib.import_module(name)
    except ModuleNotFoundError:
        raise unittest.SkipTest(f"{name} is not installed") from None


class CgnsLayout:
    """CGNS by h5py alone: groups with a name, a label and a type, and data sets named " data" in the order of C."""

    def __init__(self, path):
        self.file = library("h5py").File(path, "w")
        self.label(self.file, "HDF5 MotherNode", "Root Node of HDF5 File", "MT")
        self.node(self.file, "CGNSLibraryVersion", "CGNSLibraryVersion_t", np.array([4.2], "f4"))

    @staticmethod
    def label(group, name, label, kind):
        for key, text, size in (("name", name, 33), ("label", label, 33), ("type", kind, 3)):
            group.attrs.create(key, np.array(text.encode(), f"S{size}"))

    def node(self, parent, name, label, data=None):
        group = parent.create_group(name)
        kinds = {"f4": "R4", "f8": "R8", "i4": "I4", "i8": "I8", "i1": "C1"}
        if isinstance(data, str):
            data = np.frombuffer(data.encode(), "i1")
        self.label(group, name, label, "MT" if data is None else kinds[data.dtype.str[1:]])
        if data is not None:
            group.create_dataset(" data", data=data)
        return group

    def table(self, parent, name, texts):
        """Names of 32 characters, filled with blanks, as libcgns writes them."""
        self.node(parent, name, "DataArray_t", np.array([list(text.ljust(32).encode()) for text in texts], "i1"))

    def block(self, base, name, block):
        """A structured zone with its coordinates."""
        shape = np.array(block.shape[::-1])
        zone = self.node(base, name, "Zone_t", np.array([shape, shape - 1, 0 * shape], "i4"))
        self.node(zone, "ZoneType", "ZoneType_t", "Structured")
        coordinates = self.node(zone, "GridCoordinates", "GridCoordinates_t")
        for axis, values in zip("XYZ", block.places):
            self.node(coordinates, f"Coordinate{axis}", "DataArray_t", values)
        return zone

    def zone(self, base, name, block):
        zone = self.block(base, name, block)
        for kind, location, values in (("nodes", "Vertex", block.p), ("cells", "CellCenter", block.c)):
            solution = self.node(zone, kind, "FlowSolution_t")
            self.node(solution, "GridLocation", "GridLocation_t", location)
            self.node(solution, "p" if location == "Vertex" else "c", "DataArray_t", values)
        return zone
