#!/usr/bin/python3
"""several_files_test.py CURVISPLAT

Grids in several VTK or NetCDF files, and in files compressed as a whole. VTK and netCDF4 write them; what `curvisplat info`
measures of several files is compared with the arrays, and what it measures of compressed files with what it measures of the
files themselves. Exit status 77 (skipped) without python3-vtk9, python3-netcdf4 or the programs that compress.
"""
import gzip
import json
import lzma
import os
import pathlib
import shutil
import subprocess
import sys
import tempfile
import time
import types
import unittest

from cgns_layout import CgnsLayout
from sweep import some_of

try:
    import netCDF4
    import numpy as np
    from vtkmodules.util.numpy_support import numpy_to_vtk
    from vtkmodules.vtkCommonCore import vtkPoints
    from vtkmodules.vtkCommonDataModel import vtkStructuredGrid
    from vtkmodules.vtkIOXML import vtkXMLStructuredGridWriter
except ModuleNotFoundError as error:
    print(f"skipped: {error}; install python3-vtk9, python3-netcdf4 and python3-numpy")
    sys.exit(77)

PROGRAM = str(pathlib.Path(sys.argv.pop(1)).resolve())
RANDOM = np.random.default_rng(1)
NI, NJ, NK = 9, 7, 5


def write_vts(path, shift, **arrays):
    k, j, i = np.meshgrid(np.arange(NK), np.arange(NJ), np.arange(NI), indexing="ij")
    grid, points = vtkStructuredGrid(), vtkPoints()
    points.SetData(numpy_to_vtk(np.stack([i + shift + 0.1 * j, j, k], -1).reshape(-1, 3).astype("f4"), deep=True))
    grid.SetDimensions(NI, NJ, NK)
    grid.SetPoints(points)
    for name, values in arrays.items():
        array = numpy_to_vtk(values.ravel(), deep=True)
        array.SetName(name)
        grid.GetPointData().AddArray(array)
    writer = vtkXMLStructuredGridWriter()
    writer.SetFileName(str(path))
    writer.SetInputData(grid)
    writer.Write()


def write_netcdf(path, form, nodes=20):
    with netCDF4.Dataset(path, "w", format=form) as f:
        for name in ("lon", "lat", "depth"):
            f.createDimension(name, nodes)
            f.createVariable(name, "f8", (name,))[:] = np.arange(nodes)
        f["lon"].units, f["lat"].units, f["depth"].units = "degrees_east", "degrees_north", "m"
        f.createVariable("t", "f4", ("depth", "lat", "lon"))[:] = RANDOM.random((nodes, nodes, nodes))


def zstd(data):
    return subprocess.run(["zstd", "-q", "-c"], input=data, capture_output=True, check=True).stdout


COMPRESSIONS = {"gz": lambda data: gzip.compress(data, 1), "xz": lambda data: lzma.compress(data, preset=0), "zst": zstd}
if not shutil.which("zstd"):
    del COMPRESSIONS["zst"]


class SeveralFiles(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.folder = pathlib.Path(folder.name)

    def run_program(self, command, *words):
        return subprocess.run([PROGRAM, command, *map(str, words)], capture_output=True, text=True, cwd=self.folder)

    def info(self, *files):
        done = self.run_program("info", "--json", *files)
        self.assertEqual(done.returncode, 0, done.stderr)
        return json.loads(done.stdout)

    def fields(self, count):
        return [RANDOM.random((NK, NJ, NI)).astype("f4") for _ in range(count)]

    def range_of(self, info, name):
        return next([s["min"], s["max"]] for s in info["scalars"] if s["name"] == name)

    def test_fields_of_the_same_nodes(self):
        p, q, r = self.fields(3)
        write_vts(self.folder / "grid.vts", 0)
        write_vts(self.folder / "p.vts", 0, p=p)
        write_vts(self.folder / "q.vts", 0, q=q, r=r)
        info = self.info("grid.vts", "p.vts", "q.vts")
        self.assertEqual((len(info["blocks"]), len(info["files"])), (1, 3))
        for name, values in (("p", p), ("q", q), ("r", r)):
            np.testing.assert_allclose(self.range_of(info, name), [values.min(), values.max()], rtol=1e-6)
        done = self.run_program("convert", "grid.vts", "p.vts", "q.vts", "-o", "all.splats")
        self.assertEqual(done.returncode, 0, done.stderr)
        again = self.run_program("info", "p.vts", "p.vts")
        self.assertEqual(again.returncode, 1)
        self.assertIn("no further scalar", again.stderr)

    def test_names_of_any_script(self):
        p = self.fields(1)[0]
        write_vts(self.folder / "Änderung 時.vts", 0, **{"Température [°C]": p, "密度": p + 1})
        names = [s["name"] for s in self.info("Änderung 時.vts")["scalars"]]
        self.assertEqual(names, ["Température [°C]", "密度"])

    def test_blocks_in_several_files(self):
        p, q, r = self.fields(3)
        write_vts(self.folder / "left.vts", 0, p=p)
        write_vts(self.folder / "right.vts", NI - 1, p=q, r=r)
        info = self.info("left.vts", "right.vts")
        self.assertEqual([block["name"] for block in info["blocks"]], ["left", "right"])
        self.assertEqual([s["name"] for s in info["scalars"]], ["p"])
        both = np.stack([p, q])
        np.testing.assert_allclose(self.range_of(info, "p"), [both.min(), both.max()], rtol=1e-6)
        self.assertEqual(info["bounds"]["upper"][0], np.float32(2 * (NI - 1) + 0.1 * (NJ - 1)))
        self.assertIn("left out: r", " ".join(info["warnings"]))

    def write_cgns(self, name, shift, **solutions):
        """Coordinates as write_vts has them, by h5py. `solutions`: of nodes."""
        k, j, i = np.meshgrid(np.arange(NK), np.arange(NJ), np.arange(NI), indexing="ij")
        block = types.SimpleNamespace(shape=(NK, NJ, NI), places=np.stack([i + shift + 0.1 * j, j, k]).astype("f4"))
        file = CgnsLayout(self.folder / name)
        base = file.node(file.file, "Base", "CGNSBase_t", np.array([3, 3], "i4"))
        zone = file.block(base, name.split(".")[0], block)
        for field, values in solutions.items():
            solution = file.node(zone, f"of {field}", "FlowSolution_t")
            file.node(solution, "GridLocation", "GridLocation_t", "Vertex")
            file.node(solution, field, "DataArray_t", values)
        file.file.close()

    def test_fields_and_blocks_of_cgns(self):
        p, q = self.fields(2)
        self.write_cgns("left.cgns", 0, p=p)
        self.write_cgns("fields.cgns", 0, q=q)
        info = self.info("left.cgns", "fields.cgns")
        self.assertEqual((len(info["blocks"]), len(info["files"])), (1, 2))
        for name, values in (("p", p), ("q", q)):
            np.testing.assert_allclose(self.range_of(info, name), [values.min(), values.max()], rtol=1e-6)
        self.write_cgns("right.cgns", NI - 1, p=q)
        info = self.info("left.cgns", "right.cgns")
        self.assertEqual([(b["ni"], b["nj"], b["nk"]) for b in info["blocks"]], 2 * [(NI, NJ, NK)])
        both = np.stack([p, q])
        np.testing.assert_allclose(self.range_of(info, "p"), [both.min(), both.max()], rtol=1e-6)
        self.assertEqual(info["bounds"]["upper"][0], np.float32(2 * (NI - 1) + 0.1 * (NJ - 1)))

    def files(self):
        write_netcdf(self.folder / "three.nc", "NETCDF3_CLASSIC")
        write_netcdf(self.folder / "four.nc", "NETCDF4")
        write_vts(self.folder / "grid.vts", 0, p=self.fields(1)[0])
        x = np.stack(np.meshgrid(np.arange(5.0), np.arange(4.0), np.arange(3.0))).astype("f4")
        (self.folder / "grid.xyz").write_bytes(np.array(x.shape[:0:-1], "i4").tobytes() + x.tobytes())
        self.write_cgns("grid.cgns", 0, p=self.fields(1)[0])
        return ["three.nc", "four.nc", "grid.vts", "grid.xyz", "grid.cgns"]

    def test_compressed_files_are_those_files(self):
        for name in self.files():
            plain = self.info(name)
            for suffix, compress in COMPRESSIONS.items():
                with self.subTest(name, suffix=suffix):
                    (self.folder / f"{name}.{suffix}").write_bytes(compress((self.folder / name).read_bytes()))
                    info = self.info(f"{name}.{suffix}")
                    self.assertEqual(info.pop("files"), [f"{name}.{suffix}"])
                    self.assertEqual(info.pop("format"), plain["format"] + ", decompressed")
                    self.assertEqual({k: v for k, v in info.items() if k != "estimate"},
                                     {k: v for k, v in plain.items() if k not in ("files", "format", "estimate")})
        # Members and frames that follow one another are one file.
        data = (self.folder / "three.nc").read_bytes()
        for suffix, compress in COMPRESSIONS.items():
            (self.folder / f"parts.{suffix}").write_bytes(compress(data[:999]) + compress(data[999:]))
            self.assertEqual(self.info(f"parts.{suffix}")["scalars"], self.info("three.nc")["scalars"])
        self.assertEqual([path.name for path in self.folder.iterdir() if "unpacked" in path.name], [])

    def test_files_that_fill_the_buffer_to_its_end(self):
        """Files are decompressed by the MiB. What ends with one is complete, whatever the buffer of the compressed bytes holds."""
        mib, nodes = 1 << 20, 64**3
        head = (f"# vtk DataFile Version 2.0\na\nBINARY\nDATASET STRUCTURED_POINTS\nDIMENSIONS 64 64 64\nORIGIN 0 0 0\nSPACING 1 1 1\n"
                f"POINT_DATA {nodes}\nSCALARS p double\nLOOKUP_TABLE default\n").encode()
        data = head + RANDOM.random(nodes).astype(">f8").tobytes()
        (self.folder / "grid.vtk").write_bytes(data)
        plain = self.info("grid.vtk")["scalars"]
        for suffix, compress in COMPRESSIONS.items():
            for name, packed in (("whole", compress(data.ljust(3 * mib, b"\n"))), ("parts", compress(data) + compress(b"\n" * mib))):
                with self.subTest(name, suffix=suffix):
                    (self.folder / f"{name}.vtk.{suffix}").write_bytes(packed)
                    self.assertEqual(self.info(f"{name}.vtk.{suffix}")["scalars"], plain)

    @unittest.skipUnless(shutil.which("zstd"), "without zstd")
    def test_zstd_of_a_large_window_is_not_called_damaged(self):
        (self.folder / "a").write_bytes(subprocess.run(["zstd", "-q", "-c", "--long=31"], input=b"1 2 3", capture_output=True, check=True).stdout)
        self.assertEqual(self.run_program("info", "a").stderr, "curvisplat: a: cannot be decompressed as zstd: it needs more than "
                                                               "128 MiB of memory; compress it again without --long\n")

    def test_damaged_compressed_files_are_refused(self):
        data = (self.folder / self.files()[0]).read_bytes()[:3000]
        before = list(pathlib.Path(tempfile.gettempdir()).glob("curvisplat.*.unpacked"))
        for suffix, compress in COMPRESSIONS.items():
            packed = compress(data)
            self.assertEqual(compress(b""), compress(b""))
            for size in some_of([*range(7, 40, 3), *range(40, len(packed), len(packed) // 25)], 11):
                (self.folder / "cut").write_bytes(packed[:size])
                done = self.run_program("info", "cut")
                self.assertEqual(done.returncode, 1, f"{suffix} cut at {size}")
                self.assertRegex(done.stderr, r"^curvisplat: cut: .*\n$")
            for place in some_of(range(10, len(packed), len(packed) // 40), 11):
                wrong = bytearray(packed)
                wrong[place] ^= 0x55
                (self.folder / "wrong").write_bytes(wrong)
                done = self.run_program("info", "wrong")
                self.assertEqual(done.returncode, 1, f"{suffix} wrong at {place}")
                self.assertRegex(done.stderr, r"^curvisplat: wrong: .*\n$")
        self.assertEqual(list(pathlib.Path(tempfile.gettempdir()).glob("curvisplat.*.unpacked")), before)

    def test_what_a_killed_program_has_unpacked_is_removed_by_the_next(self):
        grid = self.files()[0]
        (self.folder / "large.gz").write_bytes(gzip.compress(bytes(1 << 28), 1))  # a second of unpacking
        (self.folder / f"{grid}.gz").write_bytes(gzip.compress((self.folder / grid).read_bytes()))
        with tempfile.TemporaryDirectory() as temporary:
            environment = dict(os.environ, TMPDIR=temporary)
            unpacked = lambda: list(pathlib.Path(temporary).glob("curvisplat.*.unpacked"))
            words = dict(cwd=self.folder, env=environment, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
            killed = subprocess.Popen([PROGRAM, "info", "large.gz"], **words)
            while not unpacked() and killed.poll() is None:
                time.sleep(0.001)
            killed.kill()
            killed.wait()
            self.assertEqual(len(unpacked()), 1)
            subprocess.run([PROGRAM, "info", f"{grid}.gz"], **words)
            self.assertEqual(unpacked(), [])

    def peak_mebibytes(self, name):
        script = "import resource, subprocess, sys; subprocess.run(sys.argv[1:], check=True, stdout=subprocess.DEVNULL, " \
            "stderr=subprocess.DEVNULL); print(resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss)"
        words = [PROGRAM, "convert", name, "-o", name + ".splats", "--memory", "256M", "--refine", "1", "--no-surfaces"]
        done = subprocess.run([sys.executable, "-c", script, *words], capture_output=True, text=True, cwd=self.folder)
        self.assertEqual(done.returncode, 0, done.stderr)
        return int(done.stdout) / 1024

    def test_memory_is_bounded(self):
        write_netcdf(self.folder / "large.nc", "NETCDF3_CLASSIC", nodes=60)
        plain = self.peak_mebibytes("large.nc")
        for suffix, compress in {**COMPRESSIONS, "xz": lzma.compress}.items():  # with a dictionary of 8 MiB
            (self.folder / f"large.nc.{suffix}").write_bytes(compress((self.folder / "large.nc").read_bytes()))
            peak = self.peak_mebibytes(f"large.nc.{suffix}")
            print(f"peak memory {peak:.0f} MiB compressed by {suffix}, {plain:.0f} MiB not compressed, of 256 MiB")
            self.assertLess(peak, plain + 16)
        # A file that asks for more memory than is given is refused: a dictionary of 512 MiB.
        filters = [{"id": lzma.FILTER_LZMA2, "preset": 0, "dict_size": 512 << 20}]
        header = lzma.compress(bytes(100), format=lzma.FORMAT_XZ, filters=filters)
        (self.folder / "greedy.xz").write_bytes(header)
        done = self.run_program("info", "greedy.xz")
        self.assertEqual(done.returncode, 1)
        self.assertIn("needs more than 128 MiB", done.stderr)


if __name__ == "__main__":
    unittest.main()
