// The values of a variable of EnSight Gold on the parts of a geometry.
#pragma once

#include <filesystem>
#include <vector>

#include "preprocess/formats/ensight/ensight_case.h"
#include "preprocess/formats/ensight/ensight_geometry.h"

namespace curvisplat {

/// Of a part: at its nodes one list; in its elements one for each of EnsightPart::elements, or of a structured part one. A
/// list has all values of a component, then those of the next. Empty lists: no values.
struct EnsightValues {
  std::vector<EnsightList> lists;
  std::vector<double> undefined;  // [list]: the value that means none; NaN where there is no such value
};

/// [part] of the geometry. Throws Error if the file is damaged or does not fit the geometry.
std::vector<EnsightValues> readEnsightValues(const EnsightVariable& variable, const EnsightGeometry& geometry,
                                             const std::filesystem::path& folder);

}  // namespace curvisplat
