// The plug-in curvisplat-formats.so, which has no code of its own: it links HDF5, NetCDF, CGNS, PROJ and Blosc for the program
// (preprocess/formats/common/data_libraries.h).
