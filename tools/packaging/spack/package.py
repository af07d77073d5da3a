# A recipe for Spack: copy this file to packages/curvisplat/ of a repository of packages of your own, then in a clone of the project
# `spack dev-build curvisplat@1.0.0`.
# Untested: no Spack is at hand where this was written. tests/structure/check_recipes.py checks its syntax, its version, and that each
# library that the build looks for is named; a package may have another name than here.
from spack.package import *


class Curvisplat(CMakePackage):
    """Volume rendering of curvilinear simulation grids that are larger than memory."""

    manual_download = True  # from a clone: dev-build
    license("Apache-2.0")
    version("1.0.0")

    variant("window", default=True, description="The window, curvisplat view")
    variant("server", default=True, description="Pictures in a browser, curvisplat serve")
    variant("mpi", default=True, description="Several processes")
    variant("python", default=False, description="The Python package")

    depends_on("c", type="build")
    depends_on("cxx", type="build")
    depends_on("cmake@3.21:", type="build")
    depends_on("ninja", type="build")
    depends_on("pkgconfig", type="build")
    depends_on("boost+iostreams")
    depends_on("cairo+ft+fc")
    depends_on("cgns+hdf5~mpi")
    depends_on("cli11", type="build")
    depends_on("egl")
    depends_on("fmt")
    depends_on("fontconfig")
    depends_on("glm")
    depends_on("hdf5~mpi")
    depends_on("highway")
    depends_on("libpng")
    depends_on("liburing")
    depends_on("lz4")
    depends_on("netcdf-c~mpi")
    depends_on("nlohmann-json")
    depends_on("openvdb")
    depends_on("proj")
    depends_on("pugixml")
    depends_on("tbb")
    depends_on("tinyexr")
    depends_on("xxhash")
    depends_on("c-blosc")
    depends_on("xz")
    depends_on("zlib-api")
    depends_on("zstd")
    depends_on("glfw", when="+window")
    depends_on("imgui", when="+window")
    depends_on("libjpeg-turbo", when="+server")
    depends_on("mpi", when="+mpi")
    extends("python", when="+python")
    depends_on("py-pybind11", type="build", when="+python")
    depends_on("py-numpy", type=("build", "run"), when="+python")

    conflicts("platform=darwin", msg="Linux alone: io_uring, O_DIRECT")
    conflicts("platform=windows", msg="Linux alone: io_uring, O_DIRECT")

    generator("ninja")

    def cmake_args(self):
        args = [self.define("CURVISPLAT_TESTS", False), self.define("CURVISPLAT_MPI", "ON" if "+mpi" in self.spec else "OFF")]
        args += [self.define_from_variant(f"CURVISPLAT_{part.upper()}", part) for part in ("window", "server", "python")]
        if "+python" in self.spec:
            args.append(self.define("CURVISPLAT_PYTHON_DIR", python_platlib))
        return args
