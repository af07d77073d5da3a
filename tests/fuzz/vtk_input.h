// What the VTK targets share.
#pragma once

#include "preprocess/formats/vtk/vtk_legacy.h"
#include "preprocess/formats/vtk/vtk_xml.h"
#include "tests/fuzz/fuzz_target.h"
#include "tests/fuzz/grid_reading.h"

namespace curvisplat {

inline void readVtk(std::string_view name, std::span<const std::byte> bytes) {
  OpenGridOptions options;
  options.grid = fuzzFile(name, bytes);
  options.temporary_folder = fuzzFolder();
  if (isVtkXml(InputFile(options.grid)))
    readData(*openVtkXml(options));
  else if (isVtkLegacy(InputFile(options.grid)))
    readData(*openVtkLegacy(options));
}

}  // namespace curvisplat
