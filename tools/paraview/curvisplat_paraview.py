"""A ParaView plugin that reads splat caches: Tools > Manage Plugins > Load New, or LoadPlugin() in pvpython.

It needs the Python package `curvisplat` (python3-curvisplat, or PYTHONPATH). Two sources:

    curvisplat Image Data    value and density on a regular grid of a box, from a resolution and a level
    curvisplat Points        the splats of a level, with shape tensors for a Tensor Glyph

Open a cache by the file `manifest.json` in its folder NAME.splats, or name the folder. Time steps are those of the cache.
"""

import os

import numpy as np
from paraview.util.vtkAlgorithm import smdomain, smhint, smproperty, smproxy
from vtkmodules.util import numpy_support
from vtkmodules.util.vtkAlgorithm import VTKPythonAlgorithmBase
from vtkmodules.vtkCommonDataModel import vtkDataObject, vtkImageData, vtkPolyData
from vtkmodules.vtkCommonExecutionModel import vtkStreamingDemandDrivenPipeline

import curvisplat


def vtk_array(values, name):
    """A VTK array of its own of a numpy array."""
    array = numpy_support.numpy_to_vtk(np.ascontiguousarray(values), deep=1)
    array.SetName(name)
    return array


def square_roots(shapes):
    """The symmetric roots of shapes S: their eigenvalues are the half axes of the splats' ellipsoids."""
    squares, axes = np.linalg.eigh(shapes.astype(np.float64))
    return np.einsum("nij,nj,nkj->nik", axes, np.sqrt(np.maximum(squares, 0)), axes).astype(np.float32)


class CacheSource(VTKPythonAlgorithmBase):
    """What both sources share: the cache, its scalar, its steps, the box and the level."""

    def __init__(self, output):
        super().__init__(nInputPorts=0, nOutputPorts=1, outputType=output)
        self._path = None
        self._cache = None
        self._scalar = ""
        self._box = [0.0] * 6
        self._level = -1

    def _set(self, name, value):
        if getattr(self, name) != value:
            setattr(self, name, value)
            self.Modified()

    def SetFileName(self, path):
        if os.path.basename(path) == "manifest.json":
            path = os.path.dirname(path)
        if path != self._path:
            self._path, self._cache = path, None
            self.Modified()

    def SetScalar(self, name):
        self._set("_scalar", name or "")

    def SetBox(self, x0, x1, y0, y1, z0, z1):
        self._set("_box", [x0, x1, y0, y1, z0, z1])

    def SetLevel(self, level):
        self._set("_level", int(level))

    def cache(self):
        if self._cache is None:
            if not self._path or self._path == "None":
                raise curvisplat.UsageError("no cache was chosen")
            self._cache = curvisplat.open(self._path)
        return self._cache

    def box(self):
        """(x0, x1, y0, y1, z0, z1): the one chosen, or where that is empty the data's."""
        if all(self._box[2 * axis] < self._box[2 * axis + 1] for axis in range(3)):
            return list(self._box)
        lower, upper = self.cache().bounds
        return [float(end) for pair in zip(lower, upper) for end in pair]

    def level(self):
        return None if self._level < 0 else self._level

    def scalar(self):
        return self._scalar or self.cache().scalars[0].name

    def GetTimestepValues(self):
        try:
            times = self.cache().times
        except curvisplat.Error:
            return None
        return [float(time) for time in times] if len(times) > 1 else None

    def RequestInformation(self, request, inputs, outputs):
        information = outputs.GetInformationObject(0)
        times = self.GetTimestepValues()
        for key in (vtkStreamingDemandDrivenPipeline.TIME_STEPS(), vtkStreamingDemandDrivenPipeline.TIME_RANGE()):
            information.Remove(key)
        if times:
            for time in times:
                information.Append(vtkStreamingDemandDrivenPipeline.TIME_STEPS(), time)
            for time in (times[0], times[-1]):
                information.Append(vtkStreamingDemandDrivenPipeline.TIME_RANGE(), time)
        return 1

    def step(self, outputs):
        """The step whose time is nearest to the one that is asked for, and its time."""
        information = outputs.GetInformationObject(0)
        times = self.cache().times
        key = vtkStreamingDemandDrivenPipeline.UPDATE_TIME_STEP()
        if len(times) < 2 or not information.Has(key):
            return 0, float(times[0])
        step = int(np.argmin(np.abs(times - information.Get(key))))
        return step, float(times[step])

    def fail(self, error):
        """One line in ParaView's messages; the source has no data."""
        import sys
        print(f"curvisplat: {error}", file=sys.stderr)
        return 0


FILE_NAME = """
<StringVectorProperty name="FileName" command="SetFileName" number_of_elements="1" panel_visibility="default">
  <FileListDomain name="files"/>
  <Documentation>The cache: the file manifest.json in the folder NAME.splats, or the folder.</Documentation>
  <Hints><FileChooser extensions="json" file_description="Splat cache"/></Hints>
</StringVectorProperty>"""
SCALAR = """
<StringVectorProperty name="Scalar" command="SetScalar" number_of_elements="1" default_values="">
  <Documentation>The scalar's name; the first one where it is empty.</Documentation>
</StringVectorProperty>"""
BOX = """
<DoubleVectorProperty name="Box" command="SetBox" number_of_elements="6" default_values="0 0 0 0 0 0">
  <Documentation>x0 x1 y0 y1 z0 z1; all of the data where it is empty.</Documentation>
</DoubleVectorProperty>"""
LEVEL = """
<IntVectorProperty name="Level" command="SetLevel" number_of_elements="1" default_values="-1">
  <Documentation>{}</Documentation>
</IntVectorProperty>"""
TIMES = """
<DoubleVectorProperty name="TimestepValues" repeatable="1" information_only="1">
  <TimeStepsInformationHelper/>
</DoubleVectorProperty>"""


@smproxy.source(name="CurvisplatImageData", label="curvisplat Image Data")
@smhint.xml('<ShowInMenu category="curvisplat"/>')
class CurvisplatImageData(CacheSource):
    """Means of the scalar, and the density, over the boxes of a regular grid."""

    def __init__(self):
        super().__init__("vtkImageData")
        self._resolution = 64

    @smproperty.xml(FILE_NAME)
    def SetFileName(self, path):
        super().SetFileName(path)

    @smproperty.xml(SCALAR)
    def SetScalar(self, name):
        super().SetScalar(name)

    @smproperty.xml(BOX)
    def SetBox(self, x0, x1, y0, y1, z0, z1):
        super().SetBox(x0, x1, y0, y1, z0, z1)

    @smproperty.intvector(name="Resolution", default_values=64)
    @smdomain.intrange(min=2, max=512)
    def SetResolution(self, resolution):
        """Points along the longest side of the box."""
        self._set("_resolution", int(resolution))

    @smproperty.xml(LEVEL.format("The octree's level; -1: the coarsest whose detail is half a point's distance."))
    def SetLevel(self, level):
        super().SetLevel(level)

    @smproperty.xml(TIMES)
    def GetTimestepValues(self):
        return super().GetTimestepValues()

    def box(self):
        """Along an axis without extent, as z of planar data, two points' distances wide: an image needs two points."""
        box = super().box()
        distance = max(box[2 * axis + 1] - box[2 * axis] for axis in range(3)) / self._resolution
        for axis in range(3):
            if box[2 * axis] == box[2 * axis + 1]:
                box[2 * axis] -= distance
                box[2 * axis + 1] += distance
        return box

    def size(self):
        box = self.box()
        extent = [box[2 * axis + 1] - box[2 * axis] for axis in range(3)]
        return [max(2, int(np.ceil(self._resolution * side / max(extent) - 1e-6))) for side in extent]

    def RequestInformation(self, request, inputs, outputs):
        super().RequestInformation(request, inputs, outputs)
        try:
            size, box = self.size(), self.box()
        except curvisplat.Error as error:
            return self.fail(error)
        information = outputs.GetInformationObject(0)
        information.Set(vtkStreamingDemandDrivenPipeline.WHOLE_EXTENT(), 0, size[0] - 1, 0, size[1] - 1, 0, size[2] - 1)
        spacing = [(box[2 * axis + 1] - box[2 * axis]) / size[axis] for axis in range(3)]
        information.Set(vtkDataObject.SPACING(), spacing, 3)
        information.Set(vtkDataObject.ORIGIN(), [box[2 * axis] + spacing[axis] / 2 for axis in range(3)], 3)
        return 1

    def RequestData(self, request, inputs, outputs):
        try:
            step, time = self.step(outputs)
            samples = self.cache().sample(self.scalar(), size=tuple(self.size()), box=self.box(), level=self.level(), step=step)
        except curvisplat.Error as error:
            return self.fail(error)
        image = vtkImageData.GetData(outputs, 0)
        image.SetDimensions(*self.size())
        image.SetSpacing(*samples.spacing)
        image.SetOrigin(*samples.origin)
        data = image.GetPointData()
        data.AddArray(vtk_array(samples.value.ravel(), self.scalar()))
        data.AddArray(vtk_array(samples.density.ravel(), "density" if self.scalar() != "density" else "sample density"))
        data.SetActiveScalars(self.scalar())
        image.GetInformation().Set(vtkDataObject.DATA_TIME_STEP(), time)
        return 1


@smproxy.source(name="CurvisplatPoints", label="curvisplat Points")
@smhint.xml('<ShowInMenu category="curvisplat"/>')
class CurvisplatPoints(CacheSource):
    """The splats of a level as points: the scalar, the volume, and the tensor `shape` whose eigenvalues are the half axes."""

    def __init__(self):
        super().__init__("vtkPolyData")

    @smproperty.xml(FILE_NAME)
    def SetFileName(self, path):
        super().SetFileName(path)

    @smproperty.xml(SCALAR)
    def SetScalar(self, name):
        super().SetScalar(name)

    @smproperty.xml(BOX)
    def SetBox(self, x0, x1, y0, y1, z0, z1):
        super().SetBox(x0, x1, y0, y1, z0, z1)

    @smproperty.xml(LEVEL.format("The octree's level, 0 is the coarsest; -1: the finest."))
    def SetLevel(self, level):
        super().SetLevel(level)

    @smproperty.xml(TIMES)
    def GetTimestepValues(self):
        return super().GetTimestepValues()

    def RequestData(self, request, inputs, outputs):
        try:
            step, time = self.step(outputs)
            points = self.cache().points(self.scalar(), box=self.box(), level=self.level(), step=step)
        except curvisplat.Error as error:
            return self.fail(error)
        from vtkmodules.vtkCommonCore import vtkPoints
        from vtkmodules.vtkCommonDataModel import vtkCellArray
        output = vtkPolyData.GetData(outputs, 0)
        places = vtkPoints()
        places.SetData(vtk_array(points.positions, "Points"))
        output.SetPoints(places)
        vertices = vtkCellArray()
        count = len(points.values)
        vertices.SetData(1, numpy_support.numpy_to_vtkIdTypeArray(np.arange(count, dtype=np.int64), deep=1))
        output.SetVerts(vertices)
        data = output.GetPointData()
        data.AddArray(vtk_array(points.values, self.scalar()))
        data.AddArray(vtk_array(points.volumes, "volume" if self.scalar() != "volume" else "splat volume"))
        data.AddArray(vtk_array(square_roots(points.shapes).reshape(-1, 9), "shape"))
        data.SetActiveScalars(self.scalar())
        data.SetActiveTensors("shape")
        output.GetInformation().Set(vtkDataObject.DATA_TIME_STEP(), time)
        return 1
