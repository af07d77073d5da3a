// Tecplot's binary files (.plt), versions 104 to 113, in either byte order.
//
//   header                                                   numbers: 32 bits; texts: 32 bits a character, ended by 0
//     "#!TDV112", 1 (byte order), file type (from 111), title, variables, their names
//     299.0  a zone: name, parent (from 107), strand, time (64 bits), colour, type, packing (before 112), centring,
//            face neighbours, dimensions, auxiliary data
//     399.0  a geometry; 499.0 a text; 599.0 labels; 699.0 user record; 799.0, 899.0 auxiliary data
//     357.0  its end
//   data, for each zone
//     299.0, types, passive variables, shared variables, connectivity; minimum and maximum of each stored variable;
//     values of each variable (block) or of each node (point); face neighbours
//
// Values of cells have the rows and columns of the nodes, but not their last plane. Some writers keep that, too, and some
// write the packing in version 112: what fits the file counts.
// Sources: Tecplot's Data Format Guide, and VisIt's reader for the versions before 112.
#pragma once

#include <memory>

#include "preprocess/formats/common/open_files.h"
#include "preprocess/formats/tecplot/tecplot_data.h"

namespace curvisplat {

bool isTecplotBinary(const InputFile& file);

/// Reads the headers; values are read by position later. Throws Error.
TecplotData readTecplotBinary(const std::shared_ptr<const PooledFile>& file);

}  // namespace curvisplat
