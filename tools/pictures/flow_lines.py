"""Lines and points that make_pictures.py and around_pairs.py put into volumes, computed by VTK, and a torus with field lines in closed
form. Each function writes files into a folder and returns their names. Needs Debian's python3-vtk9."""
import pathlib

import numpy as np
import vtk
from vtk.util.numpy_support import numpy_to_vtk, vtk_to_numpy

import vtk_grids


def write(data, path):
    writer = vtk.vtkXMLPolyDataWriter() if isinstance(data, vtk.vtkPolyData) else vtk.vtkXMLStructuredGridWriter()
    writer.SetFileName(str(path))
    writer.SetInputData(data)
    writer.Write()
    return path


def with_array(data, name, values):
    array = numpy_to_vtk(np.ascontiguousarray(values, np.float32), deep=True)
    array.SetName(name)
    data.GetPointData().AddArray(array)
    return data


def polydata(lines, arrays):
    """Lines of points ([points][3] each; of one point: a vertex), and arrays of all their points."""
    data, points, cells, vertices = vtk.vtkPolyData(), vtk.vtkPoints(), vtk.vtkCellArray(), vtk.vtkCellArray()
    points.SetData(numpy_to_vtk(np.concatenate(lines).astype(np.float32), deep=True))
    begin = 0
    for line in lines:
        (cells if len(line) > 1 else vertices).InsertNextCell(len(line), range(begin, begin + len(line)))
        begin += len(line)
    data.SetPoints(points)
    data.SetLines(cells)
    data.SetVerts(vertices)
    for name, values in arrays.items():
        with_array(data, name, values)
    return data


def traced(grid, vectors, seeds, length, both=False):
    tracer = vtk.vtkStreamTracer()
    tracer.SetInputData(grid)
    tracer.SetSourceData(polydata([np.array([seed]) for seed in seeds], {}))
    tracer.SetInputArrayToProcess(0, 0, 0, 0, vectors)
    tracer.SetIntegratorTypeToRungeKutta45()
    tracer.SetIntegrationDirection(tracer.BOTH if both else tracer.FORWARD)
    tracer.SetMaximumPropagation(length)
    tracer.SetMaximumNumberOfSteps(20000)
    tracer.SetInitialIntegrationStep(0.3)
    tracer.SetMaximumIntegrationStep(0.5)
    tracer.SetTerminalSpeed(1e-6)
    tracer.Update()
    return tracer.GetOutput()


def wing(data, folder):
    """Vortex lines, along the vorticity, through the core of the delta wing's vortex; and streamlines from its leading edge."""
    grid = vtk_grids.blocks_of([next(pathlib.Path(data).rglob("delta_vertex.cgns"))])[0]
    arrays = grid.GetPointData()
    velocity = vtk_to_numpy(arrays.GetArray("Momentum")) / vtk_to_numpy(arrays.GetArray("Density"))[:, None]
    gradient = vtk.vtkGradientFilter()
    gradient.SetInputData(with_array(grid, "velocity", velocity))
    gradient.SetInputArrayToProcess(0, 0, 0, 0, "velocity")
    gradient.SetComputeGradient(False)
    gradient.SetComputeVorticity(True)
    gradient.SetVorticityArrayName("vorticity")
    gradient.Update()
    flow = gradient.GetOutput()
    with_array(flow, "speed", np.linalg.norm(velocity, axis=1))
    # In the plane across the flow at two thirds of the wing, the core is where the density is least, off the wall.
    dims = flow.GetDimensions()
    places = vtk_to_numpy(flow.GetPoints().GetData()).reshape(*dims[::-1], 3)[4:, :, 16]
    density = vtk_to_numpy(arrays.GetArray("Density")).reshape(dims[::-1])[4:, :, 16]
    core = places[np.unravel_index(density.argmin(), density.shape)]
    around = [core + r * np.array([0, np.cos(a), np.sin(a)]) for r in (0.004, 0.010, 0.018, 0.026)
              for a in np.linspace(0, 2 * np.pi, 8, endpoint=False)]
    edge = [(x, 0.26795 * x + 0.002, 0.002) for x in np.linspace(0.03, 0.95, 36)]
    return [write(traced(flow, "vorticity", around, 4, both=True), folder / "wing_vortex_lines.vtp"),
            write(traced(flow, "velocity", edge, 6), folder / "wing_streamlines.vtp")]


def sea(data, folder):
    """The coast, where the grid's surface is blanked; and points at depths of about 1 km, with the current there."""
    files = [next(pathlib.Path(data).rglob(name)) for name in ("nemo_northsea_u.xyz", "nemo_northsea_u.fun")]
    grid = vtk_grids.blocks_of(files)[0]
    shape = grid.GetDimensions()[::-1]
    drawn, current = (vtk_to_numpy(grid.GetPointData().GetArray(name)).reshape(shape) for name in ("IBlank", "Function0"))
    drawn = drawn != 0
    places = vtk_to_numpy(grid.GetPoints().GetData()).reshape(*shape, 3)
    surface, coast, lines = vtk.vtkStructuredGrid(), vtk.vtkContourFilter(), vtk.vtkStripper()
    points = vtk.vtkPoints()
    points.SetData(numpy_to_vtk(places[0].reshape(-1, 3), deep=True))
    surface.SetDimensions(shape[2], shape[1], 1)
    surface.SetPoints(points)
    with_array(surface, "drawn", drawn[0].ravel()).GetPointData().SetActiveScalars("drawn")
    coast.SetInputData(surface)
    coast.SetValue(0, 0.5)
    lines.SetInputConnection(coast.GetOutputPort())
    lines.Update()
    # Depths are 50 times as large.
    depth = (6371 - np.linalg.norm(places[:, 0, 0], axis=-1)) / 50
    level = np.abs(depth - 1).argmin()
    wet = drawn[level, 3::7, 3::7]
    floats = polydata([place[None] for place in places[level, 3::7, 3::7][wet]], {"uo": current[level, 3::7, 3::7][wet]})
    return [write(lines.GetOutput(), folder / "sea_coast.vtp"), write(floats, folder / "sea_points.vtp")]


def torus_shape(rho, theta, phi):
    """A torus of radius 3 whose elliptic cross-section turns by half a turn in two fifths of the way around."""
    across, along, turn = 0.62 * rho * np.cos(theta), 1.05 * rho * np.sin(theta), 2.5 * phi
    outwards = across * np.cos(turn) - along * np.sin(turn)
    upwards = across * np.sin(turn) + along * np.cos(turn)
    radius = 3 + outwards
    return np.stack([radius * np.cos(phi), radius * np.sin(phi), upwards], axis=-1)


def torus(_, folder):
    """The plasma of a stellarator, a grid of 65x17x193 nodes with its pressure; lines of its field on one surface; a floor."""
    phi, rho, theta = np.meshgrid(np.linspace(0, 2 * np.pi, 193), np.linspace(0, 1, 17), np.linspace(0, 2 * np.pi, 65), indexing="ij")
    grid, points = vtk.vtkStructuredGrid(), vtk.vtkPoints()
    points.SetData(numpy_to_vtk(torus_shape(rho, theta, phi).reshape(-1, 3).astype(np.float32), deep=True))
    grid.SetDimensions(65, 17, 193)
    grid.SetPoints(points)
    with_array(grid, "pressure", ((1 - rho**2)**2).ravel())
    way = np.linspace(0, 2 * np.pi, 1000)
    # After a turn, with which the cross-section is upside down, each line goes on where another one began.
    floor = vtk.vtkPlaneSource()
    floor.SetOrigin(-6, -6, -1.35)
    floor.SetPoint1(6, -6, -1.35)
    floor.SetPoint2(-6, 6, -1.35)
    floor.Update()
    lines = [torus_shape(0.75, start + 12 / 14 * way, way) for start in np.linspace(0, 2 * np.pi, 14, endpoint=False)]
    strength = 3 / np.hypot(*np.concatenate(lines)[:, :2].T)
    return [write(grid, folder / "torus.vts"), write(polydata(lines, {"B": strength}), folder / "torus_lines.vtp"),
            write(floor.GetOutput(), folder / "torus_floor.vtp")]
