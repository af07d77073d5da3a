#!/usr/bin/python3
"""Runs the examples "From your tools" of tools/python/README.md, as they stand, on what those tools hold or write.

    from_tools_test.py    the package is found by PYTHONPATH

Exit status 77 (skipped) without python3-vtk9, python3-netcdf4 or python3-xarray. PyVista and ParaView are not needed: they write files by
VTK's writers, which are called here.
"""
import os
import pathlib
import re
import sys
import tempfile
import types

ROOT = pathlib.Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "tests/end_to_end"))
try:
    import numpy as np
    import vtk
    import xarray
    sys.argv += ["no program", "no program"]  # which modules of other tests take from there
    from mesh_cubes import cube, hexahedra, lattice
    from mesh_foam_test import FoamCase
    from model_files import File
except ModuleNotFoundError as missing:
    print(f"skipped: {missing}; install python3-vtk9, python3-netcdf4, python3-xarray and python3-numpy")
    sys.exit(77)

import curvisplat


class Mesh(vtk.vtkUnstructuredGrid):
    """A mesh of PyVista, which inherits from VTK's in the same way, where PyVista is not installed."""

    def save(self, name):
        write(vtk.vtkXMLUnstructuredGridWriter, name, self)


def write(writer, name, data):
    writer = writer()
    writer.SetFileName(name)
    writer.SetInputData(data)
    assert writer.Write() == 1, name


def make_ocean():
    """A terrain-following history file and its grid file, as ROMS writes them."""
    lon, lat = np.meshgrid(np.linspace(-10, 0, 12), np.linspace(40, 48, 10))
    s = (np.arange(6) + 0.5) / 6 - 1
    with File("ocean_his.nc", dict(xi_rho=12, eta_rho=10, s_rho=6, ocean_time=None)) as file:
        file.add("s_rho", "s_rho", s, standard_name="ocean_s_coordinate_g2", positive="up",
                 formula_terms="s: s_rho C: Cs_r eta: zeta depth: h depth_c: hc")
        file.add("Cs_r", "s_rho", -s * s)
        file.add("hc", "", 20.0)
        file.add("zeta", "ocean_time eta_rho xi_rho", np.zeros((1, 10, 12)), units="meter")
        file.add("ocean_time", "ocean_time", [0.0], units="seconds since 2001-01-01")
        file.add("temp", "ocean_time s_rho eta_rho xi_rho", 20 + 15 * s[None, :, None, None] + np.sin(lon), "f4", units="Celsius")
    with File("ocean_grid.nc", dict(xi_rho=12, eta_rho=10)) as file:
        file.add("lon_rho", "eta_rho xi_rho", lon, units="degree_east")
        file.add("lat_rho", "eta_rho xi_rho", lat, units="degree_north")
        file.add("h", "eta_rho xi_rho", 1000 + 100 * lon, units="meter")


def make_storm():
    """Two times, as WRF writes them."""
    z = np.linspace(0, 5000, 7)[:, None, None] + np.zeros((10, 12))
    lon, lat = np.meshgrid(np.linspace(0, 11, 12), np.linspace(40, 49, 10))
    sizes = dict(Time=None, DateStrLen=19, bottom_top=6, bottom_top_stag=7, south_north=10, west_east=12)
    with File("wrfout_d01.nc", sizes) as file:
        file.add("Times", "Time DateStrLen", np.array([list(f"2001-01-01_0{hour}:00:00") for hour in (0, 6)], "S1"), "S1")
        for name, values, unit in (("XLONG", lon, "degree_east"), ("XLAT", lat, "degree_north")):
            file.add(name, "Time south_north west_east", np.stack([values] * 2), units=unit)
        for name, part in (("PH", 0.1), ("PHB", 0.9)):
            file.add(name, "Time bottom_top_stag south_north west_east", np.stack([9.81 * part * z] * 2), "f4", units="m2 s-2")
        file.add("T", "Time bottom_top south_north west_east", np.stack([np.sin(lon + hour) + 1e-3 * z[:-1] for hour in (0, 1)]), "f4", units="K")


def make_tools_data():
    """What the examples "From your tools" begin with: their names, and files."""
    points, cells = lattice(6), hexahedra(6)
    case = FoamCase(pathlib.Path("motorBike"))
    case.write_mesh(case.folder / "constant", points, cells)
    case.write_field(case.folder / "100", "p", points[cells].mean(1).sum(1))
    make_ocean()
    make_storm()
    x, y, z = (axis.transpose(2, 1, 0) for axis in np.meshgrid(range(9), range(8), range(7), indexing="ij"))
    dimensions = ("level", "y", "x")
    dataset = xarray.Dataset({"wind": (dimensions, np.sin(x) + z)},
                             {"x": np.arange(9.0), "y": np.arange(8.0), "z": (dimensions, z + 0.1 * x)})
    mesh = Mesh()
    mesh.DeepCopy(cube(4, ("hexahedron", "tetrahedra")))
    # ParaView's SaveData() calls VTK's writers, in parallel form for .pvtu.
    simple = types.SimpleNamespace(SaveData=lambda name, source: write(vtk.vtkXMLPUnstructuredGridWriter, name, source))
    return {"mesh": mesh, "source": mesh, "dataset": dataset, "paraview": types.SimpleNamespace(simple=simple)}


def main():
    page = (ROOT / "tools/python/README.md").read_text(encoding="utf-8")
    section = re.search("^## From your tools\n(.*?)^## ", page, re.MULTILINE | re.DOTALL)[1]
    examples = re.findall(r"^```python\n(.*?)^```", section, re.MULTILINE | re.DOTALL)
    assert len(examples) == 6, f"{len(examples)} examples; is the page laid out differently?"
    with tempfile.TemporaryDirectory() as folder:
        os.chdir(folder)
        data = make_tools_data()
        for example in examples:
            assert example.count("\n") == 3, f"three lines: {example}"
            exec(compile(example, "README.md", "exec"), {"curvisplat": curvisplat, **data})
            picture = re.search(r'save\("(\w+\.png)"\)', example)[1]
            # A white picture of 600x600 pixels takes 1.5 kB.
            assert os.path.getsize(picture) > 5000, f"{picture} is empty"
        # What the pictures are of.
        expected = {"mesh": (125, 1, "p"), "flow": (125, 1, "p"), "wind": (504, 1, "wind"), "bike": (216, 1, "p"), "ocean": (720, 1, "temp"),
                    "storm": (720, 2, "T")}
        for name, of in expected.items():
            with curvisplat.open(f"{name}.splats") as cache:
                found = cache.samples, len(cache.times), cache.scalars[0].name
            is_cut = name in ("ocean", "storm", "mesh", "flow") and found[0] > of[0]  # few cells around the Earth, or of two sizes
            assert found[1:] == of[1:] and (is_cut or found[0] == of[0]), f"{name}.splats: {found}, not {of}"
        os.chdir(ROOT)


if __name__ == "__main__":
    main()
