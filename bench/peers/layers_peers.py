#!/usr/bin/python3
"""Draws layers with curvisplat and with VTK, in one run, against the integrals of bench/layered.py.

    bench/peers/layers_peers.py FOLDER [--cell 0.006] [--angles 0,30,60,80] [--techniques projected-tetrahedra,ray-cast]

The scenes "closed" of bench/layered.py: slab, shell, boundary layer and ocean, by parallel rays over white. VTK's settings are those of
compare_peers.py (vtk_render.py). Prints a table of mean error and rms in the middle of the picture, of the worst channel. Needs
Debian's python3-vtk9 and python3-numpy.
"""
import argparse
import json
import pathlib
import sys

import numpy as np
import vtk
from vtk.util.numpy_support import vtk_to_numpy

HERE = pathlib.Path(__file__).resolve().parent
sys.path.insert(0, str(HERE.parent))
import compare_peers
import layered
import results

PIXELS = 200


def read_picture(path):
    reader = vtk.vtkPNGReader()
    reader.SetFileName(str(path))
    reader.Update()
    return vtk_to_numpy(reader.GetOutput().GetPointData().GetScalars()).reshape(PIXELS, PIXELS, -1) / 255.0  # the lowest row first


def function_of(scene):
    f = np.linspace(0, 1, 1025)
    if scene.wall:
        return {"colours": np.stack([f, *layered.colours(f)], 1).tolist(), "opacity_unit": 0.05 * layered.LENGTH,
                "opacities": np.stack([f, 1 - np.exp(-layered.FUNCTIONS["smooth"](f) * 0.05)], 1).tolist()}
    return {"colours": [[0, 0, 0, 0], [1, 1, 1, 1]], "opacities": [[0, 0.5], [1, 0.5]],
            "opacity_unit": np.log(2) * scene.depth / layered.CROSS}


def drawn_by_vtk(folder, scene, technique, camera):
    picture, job = folder / "vtk.png", folder / "job.json"
    job.write_text(json.dumps({
        "grid": str(folder / (scene.name + ".xyz")), "solution": str(folder / (scene.name + ".fun")), "solution_kind": "function",
        "array": "Function0", "technique": technique, "camera": camera, "size": [PIXELS, PIXELS], "frames": 0, "seconds": 0,
        "picture": str(picture), **function_of(scene)}))
    results.run([sys.executable, HERE / "vtk_render.py", job])
    return read_picture(picture)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=pathlib.Path)
    parser.add_argument("--cell", type=float, default=0.006)
    parser.add_argument("--angles", default="0,30,60,80")
    parser.add_argument("--techniques", default="projected-tetrahedra,ray-cast")
    parser.add_argument("--program", default=compare_peers.ROOT / "build/release/tools/curvisplat", type=pathlib.Path)
    parser.add_argument("--display", help="display to draw on (default: a virtual one)")
    options = parser.parse_args()
    options.folder.mkdir(parents=True, exist_ok=True)
    angles, techniques = [int(text) for text in options.angles.split(",")], options.techniques.split(",")
    program = layered.Program(options.program, options.folder.resolve(), "cpu")
    print(f"| scene, drawn by | {' | '.join(f'{angle} degrees' for angle in angles)} |\n|---|{'---|' * len(angles)}")
    with compare_peers.display(options.display):
        for scene in layered.closed_scenes(options.cell):
            scene.background = 1.0
            scene.convert(program)
            for name in ("curvisplat", *techniques):
                row = []
                for angle in angles:
                    drawn, truth, window, camera = scene.draw(program, angle, False, 0)
                    if name != "curvisplat":
                        drawn = drawn_by_vtk(program.folder, scene, name, camera)[window, window].reshape(len(truth), -1)
                    error = drawn[:, :truth.shape[1]] - truth
                    worst = np.abs(error.mean(0)).argmax()
                    row.append(f"{error[:, worst].mean():+.3f}, {error[:, worst].std():.3f}")
                print(f"| {scene.name}, {compare_peers.NAMES.get(name, name)} | {' | '.join(row)} |", flush=True)


if __name__ == "__main__":
    main()
