# `cmake --install`, and the Debian packages of `cpack -G DEB`. Components: the program; the libraries with their
# headers for other projects, find_package(curvisplat); and the Python package, if it is built.
include(GNUInstallDirs)
include(CMakePackageConfigHelpers)

set(package_dir ${CMAKE_INSTALL_LIBDIR}/cmake/curvisplat)
install(TARGETS curvisplat_options ${installed_libraries} EXPORT curvisplat
  ARCHIVE COMPONENT development
  INCLUDES DESTINATION ${CMAKE_INSTALL_INCLUDEDIR}/curvisplat)
install(EXPORT curvisplat FILE curvisplat-targets.cmake NAMESPACE curvisplat:: DESTINATION ${package_dir}
  COMPONENT development)
install(DIRECTORY stream preprocess render DESTINATION ${CMAKE_INSTALL_INCLUDEDIR}/curvisplat COMPONENT development
  FILES_MATCHING PATTERN *.h)
configure_package_config_file(${CMAKE_CURRENT_LIST_DIR}/curvisplat-config.cmake.in curvisplat-config.cmake
  INSTALL_DESTINATION ${package_dir} NO_SET_AND_CHECK_MACRO NO_CHECK_REQUIRED_COMPONENTS_MACRO)
# The libraries' interfaces may change with every minor version.
write_basic_package_version_file(curvisplat-config-version.cmake COMPATIBILITY SameMinorVersion)
install(FILES
  ${PROJECT_BINARY_DIR}/curvisplat-config.cmake ${PROJECT_BINARY_DIR}/curvisplat-config-version.cmake
  ${PROJECT_SOURCE_DIR}/tools/cmake/libraries.cmake ${PROJECT_SOURCE_DIR}/tools/cmake/FindCGNS.cmake
  DESTINATION ${package_dir} COMPONENT development)

install(TARGETS curvisplat RUNTIME COMPONENT program)
install(TARGETS curvisplat_vdb curvisplat_formats LIBRARY DESTINATION ${CMAKE_INSTALL_LIBDIR}/curvisplat COMPONENT program)
install(DIRECTORY ${PROJECT_BINARY_DIR}/tools/manual/ DESTINATION ${CMAKE_INSTALL_MANDIR}/man1 COMPONENT program
  FILES_MATCHING PATTERN *.1)
install(FILES ${PROJECT_BINARY_DIR}/tools/manual/curvisplat.bash RENAME curvisplat
  DESTINATION ${CMAKE_INSTALL_DATAROOTDIR}/bash-completion/completions COMPONENT program)
install(FILES README.md DESTINATION ${CMAKE_INSTALL_DOCDIR} COMPONENT program)
install(FILES LICENSE DESTINATION ${CMAKE_INSTALL_DOCDIR} RENAME copyright COMPONENT program)
install(FILES LICENSE DESTINATION ${CMAKE_INSTALL_DATAROOTDIR}/doc/libcurvisplat-dev RENAME copyright
  COMPONENT development)

set(CPACK_GENERATOR DEB)
set(CPACK_PACKAGE_NAME curvisplat)
set(CPACK_PACKAGE_VENDOR "the curvisplat authors")
set(CPACK_PACKAGE_CONTACT "curvisplat maintainers <maintainers@curvisplat.invalid>" CACHE STRING
  "Name and address of whoever builds packages")
set(CPACK_PACKAGING_INSTALL_PREFIX /usr)
set(CPACK_STRIP_FILES ON)
set(CPACK_COMPONENTS_ALL program development)
set(CPACK_DEB_COMPONENT_INSTALL ON)
set(CPACK_DEBIAN_FILE_NAME DEB-DEFAULT)
set(CPACK_DEBIAN_PACKAGE_CONTROL_STRICT_PERMISSION ON)

set(CPACK_DEBIAN_PROGRAM_DESCRIPTION "Converts curvilinear and unstructured simulation grids (PLOT3D, VTK, CGNS,
NetCDF, OpenFOAM and others) once to a cache of splats, and draws pictures and
a window from it within a fixed amount of memory, whatever the size of the grid.")
set(CPACK_DEBIAN_PROGRAM_PACKAGE_NAME curvisplat)
set(CPACK_DEBIAN_PROGRAM_PACKAGE_SECTION science)
set(CPACK_DEBIAN_PROGRAM_PACKAGE_SHLIBDEPS ON)
# What is opened while the program runs: OpenGL, the font of annotations, the encoder of movies.
set(CPACK_DEBIAN_PROGRAM_PACKAGE_RECOMMENDS "fonts-dejavu-core, libegl1, libosmesa6")
set(CPACK_DEBIAN_PROGRAM_PACKAGE_SUGGESTS ffmpeg)

set(CPACK_DEBIAN_DEVELOPMENT_DESCRIPTION "Static libraries, headers and the CMake package 'curvisplat', for programs that
convert grids from arrays of their own and draw them.")
set(CPACK_DEBIAN_DEVELOPMENT_PACKAGE_NAME libcurvisplat-dev)
set(CPACK_DEBIAN_DEVELOPMENT_PACKAGE_SECTION libdevel)
# Its module for OpenVDB.
set(CPACK_DEBIAN_DEVELOPMENT_PACKAGE_RECOMMENDS curvisplat)
set(development_packages
  libblosc-dev libcgns-dev libfmt-dev libgl-dev libglm-dev libhdf5-dev libhwy-dev liblz4-dev liblzma-dev libnetcdf-dev
  libpng-dev libproj-dev libpugixml-dev libtbb-dev libtinyexr-dev liburing-dev libxxhash-dev libzstd-dev
  nlohmann-json3-dev pkg-config zlib1g-dev)
if(CURVISPLAT_ANNOTATIONS)
  list(APPEND development_packages libcairo2-dev)
endif()
if(CURVISPLAT_SERVER)
  list(APPEND development_packages libjpeg-dev)
endif()
if(CURVISPLAT_PYTHON)
  list(APPEND CPACK_COMPONENTS_ALL python)
  set(CPACK_DEBIAN_PYTHON_DESCRIPTION "The Python package curvisplat: grids from files or numpy arrays become caches,
and caches become pictures, as arrays.")
  set(CPACK_DEBIAN_PYTHON_PACKAGE_NAME python3-curvisplat)
  set(CPACK_DEBIAN_PYTHON_PACKAGE_SECTION python)
  set(CPACK_DEBIAN_PYTHON_PACKAGE_SHLIBDEPS ON)
  set(CPACK_DEBIAN_PYTHON_PACKAGE_DEPENDS "python3, python3-numpy")
  set(CPACK_DEBIAN_PYTHON_PACKAGE_RECOMMENDS "curvisplat")
  install(FILES LICENSE DESTINATION ${CMAKE_INSTALL_DATAROOTDIR}/doc/python3-curvisplat RENAME copyright
    COMPONENT python)
endif()
if(TARGET curvisplat_mpi)
  install(TARGETS curvisplat_mpi LIBRARY DESTINATION ${CMAKE_INSTALL_LIBDIR}/curvisplat COMPONENT mpi)
  list(APPEND CPACK_COMPONENTS_ALL mpi)
  set(CPACK_DEBIAN_MPI_DESCRIPTION "The plug-in with which curvisplat convert and render run as several processes,
started by mpirun or srun.")
  set(CPACK_DEBIAN_MPI_PACKAGE_NAME curvisplat-mpi)
  set(CPACK_DEBIAN_MPI_PACKAGE_SECTION science)
  set(CPACK_DEBIAN_MPI_PACKAGE_SHLIBDEPS ON)
  set(CPACK_DEBIAN_MPI_PACKAGE_DEPENDS "curvisplat (= ${PROJECT_VERSION})")
  install(FILES LICENSE DESTINATION ${CMAKE_INSTALL_DATAROOTDIR}/doc/curvisplat-mpi RENAME copyright COMPONENT mpi)
endif()
list(JOIN development_packages ", " CPACK_DEBIAN_DEVELOPMENT_PACKAGE_DEPENDS)
include(CPack)
