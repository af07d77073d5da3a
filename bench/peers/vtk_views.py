#!/usr/bin/env python3
"""Draws the tetrahedra of one grid from several views with VTK.

    xvfb-run vtk_views.py TECHNIQUE JOB.json

JOB.json is written by `curvisplat_real_grids --for-vtk`. TECHNIQUE is ray-cast or projected-tetrahedra (vtk_render.py has their
settings). Each view is drawn as a uniform medium, and with the "smooth" function unless the scalar is one of cells. Pictures that
exist are kept. Needs Debian's python3-vtk9, or any Python with VTK 9.
"""
import json
import os
import pathlib
import sys

import vtk

import vtk_render

SMOOTH = pathlib.Path(__file__).resolve().parent.parent.parent / "tests/data/half_annulus_smooth.json"


def stretched(points, width, value_range):
    low, high = value_range
    return [[low + points[at] * (high - low), *points[at + 1:at + width]] for at in range(0, len(points), 4)]


def function_of(job, name):
    """Colours, opacities and their unit, as vtk_render.volume_property() takes them."""
    if name == "uniform":
        return job["uniform"]
    preset = json.loads(SMOOTH.read_text())[0]
    return {"colours": stretched(preset["RGBPoints"], 4, job["range"]),
            "opacities": stretched(preset["Points"], 2, job["range"]),
            "opacity_unit": preset["ScalarOpacityUnitDistance"] * job["length"]}


def main():
    technique, path = sys.argv[1:]
    job = json.loads(pathlib.Path(path).read_text())
    pictures = [(view["camera"], name, picture) for view in job["views"] for name, picture in view["pictures"].items()]
    pictures = sorted((entry for entry in pictures if not os.path.exists(entry[2])), key=lambda entry: entry[1])
    if not pictures:
        return
    reader = vtk.vtkUnstructuredGridReader()
    reader.SetFileName(job["grid"])
    reader.Update()
    mapper = vtk_render.mapper_of(technique, reader.GetOutput())
    window = volume = None
    for camera, name, picture in pictures:
        if window is None:
            window, _, renderer = vtk_render.scene_of({**job, **function_of(job, name), "technique": technique,
                                                       "camera": camera}, mapper)
            volume = renderer.GetVolumes().GetLastProp()
        volume.SetProperty(vtk_render.volume_property({**function_of(job, name), "technique": technique}))
        vtk_render.place(renderer, camera)
        window.Render()
        window.WaitForCompletion()
        unfinished = f"{picture}.unfinished"
        vtk_render.write_picture(window, unfinished)
        os.replace(unfinished, picture)


if __name__ == "__main__":
    main()
