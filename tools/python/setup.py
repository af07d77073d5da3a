"""Builds the package with CMake: pip install --no-build-isolation tools/python.

CURVISPLAT_BUILD names a build folder that was configured with -DCURVISPLAT_PYTHON=ON, whose module is then taken; without it
one is configured in pip's temporary folder, which takes minutes.
"""

import os
import pathlib
import re
import subprocess

from setuptools import Extension, setup
from setuptools.command.build_ext import build_ext

ROOT = pathlib.Path(__file__).resolve().parent.parent.parent


class CMakeBuild(build_ext):
    def build_extension(self, extension):
        folder = os.environ.get("CURVISPLAT_BUILD")
        if folder is None:
            folder = str(pathlib.Path(self.build_temp).resolve())
            off = [f"-DCURVISPLAT_{part}=OFF" for part in ("TESTS", "WINDOW", "ANNOTATIONS", "THROUGHPUT", "SERVER")]
            subprocess.run(["cmake", "-S", ROOT, "-B", folder, "-G", "Ninja", "-DCURVISPLAT_PYTHON=ON", *off], check=True)
        subprocess.run(["cmake", "--build", folder, "--target", "curvisplat_python"], check=True)
        (module,) = (pathlib.Path(folder) / "tools/python/curvisplat").glob("_core*.so")
        self.copy_file(str(module), self.get_ext_fullpath(extension.name))


version = re.search(r"VERSION (\d+\.\d+\.\d+)", (ROOT / "CMakeLists.txt").read_text()).group(1)
setup(version=version, packages=["curvisplat"], package_data={"curvisplat": ["py.typed", "*.pyi"]},
      ext_modules=[Extension("curvisplat._core", [])], cmdclass={"build_ext": CMakeBuild})
