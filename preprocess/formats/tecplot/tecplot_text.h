// Tecplot's text files (.dat, .tec): headers, which are parsed when the file is opened, and numbers, which are counted then
// and spooled when a zone is first read.
//
//   TITLE = "jet"
//   VARIABLES = "X" "Y" "Z" "p"
//   ZONE T="inlet", I=3, J=4, K=5, DATAPACKING=BLOCK, VARLOCATION=([4]=CELLCENTERED), SOLUTIONTIME=0.5, STRANDID=1
//   numbers, separated by white space or commas: 3*1.5 is 1.5 three times
//
// A zone's values are in blocks (all values of a variable, then those of the next), or by points (all variables of a node).
// Without a word for it: by points, as in the first Tecplot, or in blocks if some values belong to cells.
#pragma once

#include <filesystem>
#include <memory>

#include "preprocess/formats/common/open_files.h"
#include "preprocess/formats/tecplot/tecplot_data.h"

namespace curvisplat {

/// Whether the file is a text that begins with a record of Tecplot.
bool isTecplotText(const InputFile& file);

/// Throws Error with the byte. Spool files are in `folder`.
TecplotData readTecplotText(const std::shared_ptr<const PooledFile>& file,
                            const std::filesystem::path& folder);

}  // namespace curvisplat
