#!/usr/bin/python3
"""amr_files_test.py CURVISPLAT

AMR sets as VTK writes them: the leaf cells, their values and their volume are VTK's. Exit status 77 (skipped) without
python3-vtk9.
"""
import json
import pathlib
import subprocess
import sys
import tempfile
import unittest

try:
    import numpy as np
    import vtk
    from vtk.util.numpy_support import vtk_to_numpy

    from amr_sets import pulse
except ModuleNotFoundError as missing:
    print(f"skipped: {missing}")
    sys.exit(77)

PROGRAM = str(pathlib.Path(sys.argv.pop(1)).resolve())


def leaf_cells(amr, name):
    """Values and volumes of the cells that no finer one covers, by VTK's own marks."""
    values, volumes = [], []
    for level in range(amr.GetNumberOfLevels()):
        for number in range(amr.GetNumberOfDataSets(level)):
            image = amr.GetDataSet(level, number)
            ghosts = image.GetCellData().GetArray("vtkGhostType")
            there = np.ones(image.GetNumberOfCells(), bool) if ghosts is None else vtk_to_numpy(ghosts) & 8 == 0
            values.append(vtk_to_numpy(image.GetCellData().GetArray(name))[there])
            volumes.append(np.full(there.sum(), np.prod(image.GetSpacing())))
    return np.concatenate(values), np.concatenate(volumes)


class AmrFiles(unittest.TestCase):
    def setUp(self):
        self.temporary = tempfile.TemporaryDirectory()
        self.folder = pathlib.Path(self.temporary.name)
        self.path = self.folder / "pulse.vthb"

    def tearDown(self):
        self.temporary.cleanup()

    def run_program(self, *words):
        result = subprocess.run([PROGRAM, *map(str, words)], capture_output=True, text=True)
        self.assertEqual(result.returncode, 0, result.stderr)
        return result.stdout

    def test_leaf_cells_are_those_of_vtk(self):
        amr = pulse()
        for compressor in (vtk.vtkZLibDataCompressor(), None):
            for mode in ("SetDataModeToAscii", "SetDataModeToBinary", "SetDataModeToAppended"):
                with self.subTest(mode=mode, compressed=compressor is not None):
                    writer = vtk.vtkXMLUniformGridAMRWriter()
                    writer.SetFileName(str(self.path))
                    getattr(writer, mode)()
                    writer.SetCompressor(compressor)
                    writer.SetInputData(amr)
                    self.assertEqual(writer.Write(), 1)
                    values, volumes = leaf_cells(amr, "Gaussian-Pulse")
                    told = json.loads(self.run_program("info", self.path, "--json"))
                    scalar = next(s for s in told["scalars"] if s["name"] == "Gaussian-Pulse")
                    self.assertAlmostEqual(scalar["max"], values.max(), delta=1e-5 * values.max())
                    self.assertAlmostEqual(scalar["min"], values.min(), delta=1e-5 * values.max())
                    statistics = self.folder / "statistics.json"
                    self.run_program("convert", self.path, "-o", self.folder / "pulse.splats", "--overwrite", "--scalar",
                                     "Gaussian-Pulse", "--stats", statistics)
                    converted = json.loads(statistics.read_text())
                    self.assertEqual(converted["splats"], len(values))
                    self.assertAlmostEqual(converted["volume"], volumes.sum(), delta=1e-3 * volumes.sum())

    def test_the_first_version(self):
        """vtkHierarchicalBoxDataSet 0.1, in a file .vtm: no blocks, but groups; as VTK 5 wrote chombo's example."""
        amr = pulse()
        writer = vtk.vtkXMLUniformGridAMRWriter()
        writer.SetFileName(str(self.path))
        writer.SetInputData(amr)
        self.assertEqual(writer.Write(), 1)
        text, ratio = self.path.read_text(), amr.GetRefinementRatio(0)
        sets, level = [], -1
        for line in text.splitlines():
            if "<Block" in line:
                level += 1
            if "<DataSet" in line:
                sets.append(line.replace("<DataSet index=", f'<DataSet group="{level}" dataset=').replace('">', '"/>'))
        ratios = "\n".join(f'    <RefinementRatio level="{n}" refinement="{ratio}"/>' for n in range(level))
        old = self.folder / "pulse.vtm"
        old.write_text('<?xml version="1.0"?>\n<VTKFile type="vtkHierarchicalBoxDataSet" version="0.1" byte_order="LittleEndian" '
                       'compressor="vtkZLibDataCompressor">\n  <vtkHierarchicalBoxDataSet>\n' + ratios + "\n" + "\n".join(sets)
                       + "\n  </vtkHierarchicalBoxDataSet>\n</VTKFile>\n")
        values, volumes = leaf_cells(amr, "Gaussian-Pulse")
        statistics = self.folder / "statistics.json"
        self.run_program("convert", old, "-o", self.folder / "pulse.splats", "--scalar", "Gaussian-Pulse", "--stats", statistics)
        converted = json.loads(statistics.read_text())
        self.assertEqual(converted["splats"], len(values))
        self.assertAlmostEqual(converted["volume"], volumes.sum(), delta=1e-3 * volumes.sum())


if __name__ == "__main__":
    unittest.main()
