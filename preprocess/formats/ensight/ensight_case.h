// The case file of EnSight Gold: a text that names the files of a geometry and of its variables, and their times.
//
//    FORMAT              GEOMETRY               VARIABLE                              TIME
//    type: ensight gold  model: 1 mesh.***.geo  scalar per node: 1 p pressure.***     time set: 1
//                                                                                     number of steps: 2
//                                                                                     filename start number: 0
//                                                                                     filename increment: 1
//                                                                                     time values: 0.0 0.5
//
// A second number before a name ("model: 1 1 mesh.geo") is that of a file set: the file has several steps, as many as
// the section FILE says.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "preprocess/grid/grid_source.h"
#include "stream/base/file.h"

namespace curvisplat {

/// Whether the text begins with FORMAT and a type of EnSight.
bool isEnsightCase(const InputFile& file);

/// A file, or a step of a file set's.
struct EnsightPlace {
  std::filesystem::path file;
  std::optional<uint64_t> step;  // in the file; nullopt: the file is of one step
  uint64_t steps = 0;            // of the file
};

struct EnsightVariable {
  std::string name;
  size_t components = 1;  // 1 or 3
  Centring centring = Centring::kNode;
  EnsightPlace place;  // of the open step
};

struct EnsightCase {
  EnsightPlace geometry;  // of the open step
  std::vector<EnsightVariable> variables;
  std::vector<double> times;
  uint32_t time_step = 0;
  std::vector<std::string> warnings;
};

/// Names are relative to `folder`. Throws Error if the case is damaged, of another version than Gold, or names a file that
/// does not exist.
EnsightCase readEnsightCase(const std::filesystem::path& path, const std::filesystem::path& folder,
                            std::optional<uint32_t> step);

}  // namespace curvisplat
