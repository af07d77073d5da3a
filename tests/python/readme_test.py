#!/usr/bin/python3
"""Runs the examples in Python that README.md and tools/python/README.md show, one after the other, as they stand.

    readme_test.py    the package is found by PYTHONPATH
"""
import os
import pathlib
import re
import shutil
import sys
import tempfile

import curvisplat

ROOT = pathlib.Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "tests/end_to_end"))
import readme_commands_test  # noqa: E402


def make_inputs():
    """The grid wing.xyz with the solution wing.q, and their cache."""
    readme_commands_test.write_plot3d(".")
    shutil.move("bluntfinxyz.bin", "wing.xyz")
    shutil.move("bluntfinq.bin", "wing.q")
    curvisplat.convert("wing.splats", "wing.xyz", ["wing.q"])


def main():
    with tempfile.TemporaryDirectory() as folder:
        os.chdir(folder)
        make_inputs()
        for page in ("README.md", "tools/python/README.md"):
            text = re.sub("^## From your tools\n.*?(?=^## )", "", (ROOT / page).read_text(encoding="utf-8"), flags=re.MULTILINE | re.DOTALL)
            examples = re.findall(r"^```python\n(.*?)^```", text, re.MULTILINE | re.DOTALL)  # from_tools_test.py runs those
            assert examples, f"{page} has no example; is it laid out differently?"
            for example in examples:
                pathlib.Path("wing.png").unlink(missing_ok=True)
                if "curvisplat.convert(" in example:
                    shutil.rmtree("wing.splats")
                names = {"curvisplat": curvisplat}
                if "curvisplat.open(" in example:
                    exec(compile(example, page, "exec"), names)
                    assert pathlib.Path("wing.png").stat().st_size > 1000, f"{page}: the picture is empty"
                else:  # goes on with an open cache
                    with curvisplat.open("wing.splats") as names["cache"]:
                        exec(compile(example, page, "exec"), names)
                    assert len(list(pathlib.Path().glob("frame_*.png"))) == 90, f"{page}: frames are missing"
        os.chdir(ROOT)


if __name__ == "__main__":
    main()
