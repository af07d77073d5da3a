#!/usr/bin/python3
"""Runs the example notebooks without a browser, and looks at what they show.

    notebooks_test.py [FOLDER]    FOLDER: keeps their pictures there
"""
import base64
import os
import pathlib
import shutil
import subprocess
import sys
import tempfile

try:
    import matplotlib  # noqa: F401
    import nbformat
    from nbconvert.preprocessors import ExecutePreprocessor
    import ipykernel  # noqa: F401
    import netCDF4  # noqa: F401
except ImportError as error:
    print(f"skipped: {error}")
    sys.exit(77)

ROOT = pathlib.Path(__file__).resolve().parents[2]
EXAMPLES = ROOT / "tools" / "python" / "examples"
GRID = ROOT.parent / "shared" / "data" / "bluntfin"
kept = pathlib.Path(sys.argv[1]) if len(sys.argv) > 1 else None

with tempfile.TemporaryDirectory() as folder:
    # A kernel of this interpreter, whatever others are installed.
    kernels = pathlib.Path(folder, "jupyter")
    subprocess.run([sys.executable, "-m", "ipykernel", "install", "--prefix", str(kernels), "--name", "python3"], check=True, capture_output=True)
    os.environ["JUPYTER_PATH"] = str(kernels / "share" / "jupyter")
    os.environ["IPYTHONDIR"] = os.environ["JUPYTER_RUNTIME_DIR"] = folder
    skipped = []
    for path in sorted(EXAMPLES.glob("*.ipynb")):
        if path.stem == "blunt_fin":
            if not GRID.is_dir():
                skipped.append(path.stem)
                continue
            for file in GRID.glob("*.bin"):
                shutil.copy(file, folder)
        notebook = nbformat.read(path, as_version=4)
        assert not any(cell.get("outputs") for cell in notebook.cells), f"{path.name} has outputs: save it without"
        ExecutePreprocessor(timeout=300, kernel_name="python3").preprocess(notebook, {"metadata": {"path": folder}})
        outputs = [output.get("data", {}) for cell in notebook.cells if cell.cell_type == "code" for output in cell.outputs]
        pictures = [base64.b64decode(output["image/png"]) for output in outputs if "image/png" in output]
        pages = [output["text/html"] for output in outputs if "<iframe" in output.get("text/html", "")]
        print(f"{path.stem}: {len(pictures)} pictures of {sum(map(len, pictures))} bytes, {len(pages)} pages")
        assert len(pictures) == {"blunt_fin": 4, "ocean": 3, "time_series": 2}[path.stem], pictures
        assert all(len(picture) > 5000 for picture in pictures), "a picture is empty"
        assert len(pages) == (1 if path.stem == "blunt_fin" else 0)
        for n, picture in enumerate(pictures if kept else ()):
            kept.mkdir(parents=True, exist_ok=True)
            (kept / f"{path.stem}_{n}.png").write_bytes(picture)
    if skipped:
        print("skipped, their data is not here:", *skipped)
