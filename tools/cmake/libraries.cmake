# Finds what the libraries of stream/, preprocess/ and render/ link, for the build and for projects that use the
# installed package. Whoever includes this has defined
#   curvisplat_find(PACKAGE ...)       as find_package
#   curvisplat_find_pkg(NAME MODULE)   as pkg_check_modules, with the target PkgConfig::NAME
# and has CURVISPLAT_ANNOTATIONS and CURVISPLAT_PORTABLE set.
list(APPEND CMAKE_MODULE_PATH "${CMAKE_CURRENT_LIST_DIR}")
curvisplat_find(Threads)
curvisplat_find(TBB)
curvisplat_find(glm)
curvisplat_find(fmt)
curvisplat_find(nlohmann_json)
curvisplat_find(PNG)
curvisplat_find(tinyexr)
curvisplat_find(hwy)
curvisplat_find(pugixml)
curvisplat_find(ZLIB)
curvisplat_find(CGNS)
# The serial one, which libcgns and libnetcdf stand on: one process must not have two.
curvisplat_find(HDF5 COMPONENTS C)
curvisplat_find(PkgConfig)
curvisplat_find_pkg(ZSTD libzstd)
curvisplat_find_pkg(LZ4 liblz4)
curvisplat_find_pkg(XXHASH libxxhash)
curvisplat_find_pkg(NETCDF netcdf)
curvisplat_find_pkg(PROJ proj)
curvisplat_find_pkg(BLOSC blosc)
curvisplat_find_pkg(LZMA liblzma)
if(NOT CURVISPLAT_PORTABLE)
  curvisplat_find_pkg(URING liburing)
endif()
if(CURVISPLAT_ANNOTATIONS)
  curvisplat_find_pkg(CAIRO cairo)
  curvisplat_find_pkg(FONTCONFIG fontconfig)
endif()
