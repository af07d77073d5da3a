#!/usr/bin/env python3
"""Checks the recipes of tools/packaging, which no package manager has tried: that they parse, and that they name each library that CMake
looks for; and that all places that name the project's version name the same."""

import ast
import pathlib
import re
import sys

ROOT = pathlib.Path(__file__).resolve().parents[2]
# What CMake looks for: its package for conda and for Spack. None: the compiler's or the build's own.
PACKAGES = {
    "Threads": None, "PkgConfig": ("pkg-config", "pkgconfig"), "Python3": ("python", "python"),
    "TBB": ("tbb-devel", "tbb"), "glm": ("glm", "glm"), "fmt": ("fmt", "fmt"), "nlohmann_json": ("nlohmann_json", "nlohmann-json"),
    "PNG": ("libpng", "libpng"), "tinyexr": ("tinyexr", "tinyexr"), "hwy": ("libhwy", "highway"), "pugixml": ("pugixml", "pugixml"),
    "ZLIB": ("zlib", "zlib-api"), "CGNS": ("cgns", "cgns"), "HDF5": ("hdf5", "hdf5"), "libzstd": ("zstd", "zstd"), "liblz4": ("lz4-c", "lz4"),
    "liburing": ("liburing", "liburing"), "libxxhash": ("xxhash", "xxhash"), "netcdf": ("libnetcdf", "netcdf-c"), "proj": ("proj", "proj"),
    "liblzma": ("liblzma-devel", "xz"), "blosc": ("blosc", "c-blosc"), "cairo": ("cairo", "cairo"), "fontconfig": ("fontconfig", "fontconfig"),
    "OpenVDB": ("openvdb", "openvdb"), "CLI11": ("cli11", "cli11"), "glfw3": ("glfw", "glfw"), "imgui": ("imgui", "imgui"),
    "JPEG": ("libjpeg-turbo", "libjpeg-turbo"), "Boost": ("libboost-devel", "boost"), "pybind11": ("pybind11", "py-pybind11"),
    "MPI": (None, "mpi"),
}


def looked_for():
    """The names that find_package and pkg-config get in the project's build."""
    files = [ROOT / "tools/cmake/libraries.cmake", ROOT / "CMakeLists.txt"]
    files += [file for folder in ("stream", "preprocess", "render", "tools") for file in (ROOT / folder).rglob("CMakeLists.txt")]
    text = re.sub("#.*", "", "\n".join(file.read_text() for file in files))
    names = set(re.findall(r"(?:find_package|curvisplat_find)\((\w+)", text))
    return names | set(re.findall(r"(?:curvisplat_find_pkg\(\w+|pkg_check_modules\(\w+ .*?) ([a-z]\w*)\)", text))


def main():
    failures = []
    version = re.search(r"VERSION (\d+\.\d+\.\d+)", (ROOT / "CMakeLists.txt").read_text())[1]
    conda = (ROOT / "tools/packaging/conda/recipe.yaml").read_text()
    spack = (ROOT / "tools/packaging/spack/package.py").read_text()
    try:
        import yaml
        recipe = yaml.safe_load(conda)
        conda_version, conda_names = recipe["package"]["version"], recipe["requirements"]["build"] + recipe["requirements"]["host"]
    except ImportError:
        print("python3-yaml is not installed: the conda recipe is read by lines")
        conda_version, conda_names = re.search(r'version: "(.*)"', conda)[1], re.findall(r"^    - (\S.*)$", conda, re.MULTILINE)
    conda_names = {re.split(r"[ <>=]", name)[0] for name in conda_names}
    calls = [node for node in ast.walk(ast.parse(spack)) if isinstance(node, ast.Call) and isinstance(node.func, ast.Name)]
    spack_names = {re.split(r"[@+~]", call.args[0].value)[0] for call in calls if call.func.id in ("depends_on", "extends")}
    spack_version = next(call.args[0].value for call in calls if call.func.id == "version")

    cited = re.search(r"^version: (\S+)", (ROOT / "CITATION.cff").read_text(), re.MULTILINE)[1]
    changed = re.search(r"^## \[(\d\S*)\]", (ROOT / "CHANGELOG.md").read_text(), re.MULTILINE)[1]
    example = re.search(r"find_package\(curvisplat (\S+)", (ROOT / "tests/install/example/CMakeLists.txt").read_text())[1]
    for place, found in (("conda", conda_version), ("spack", spack_version), ("CITATION.cff", cited), ("CHANGELOG.md", changed),
                         ("tests/install/example", example + version[len(example):])):
        if found != version:
            failures.append(f"{place}: version {found}, CMakeLists.txt has {version}")
    for name in sorted(looked_for()):
        if name not in PACKAGES:
            failures.append(f"CMake looks for {name}, of which PACKAGES here and the recipes know nothing")
            continue
        for recipe, package, names in zip(("conda", "spack"), PACKAGES[name] or (None, None), (conda_names, spack_names)):
            if package and package not in names:
                failures.append(f"{recipe}: lacks {package}, which CMake looks for as {name}")
    for failure in failures:
        print(f"FAILED: {failure}")
    return bool(failures)


if __name__ == "__main__":
    sys.exit(main())
