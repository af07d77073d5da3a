"""An AMR set of VTK's, for the tests of formats that hold such sets."""
import vtk


def pulse(width=0.5):
    source = vtk.vtkAMRGaussianPulseSource()
    source.SetDimension(3)
    source.SetRootSpacing(0.25)
    source.SetXPulseWidth(width)
    source.Update()
    return source.GetOutputDataObject(0)
