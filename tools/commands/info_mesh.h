// `curvisplat info` of an unstructured grid, and the times and the estimate of a conversion to come, which `info` of a structured grid
// prints as well. The estimate is a formula; printMeshInfo() reads the whole mesh. For the main thread.
#pragma once

#include <nlohmann/json_fwd.hpp>

#include <cstdint>
#include <string>

#include "preprocess/convert/preflight.h"
#include "preprocess/mesh/mesh_source.h"

namespace curvisplat {

/// Cache size and time of a conversion on all cores, estimated from the number of splats.
class InfoEstimate {
 public:
  InfoEstimate() = default;
  InfoEstimate(uint64_t splats, SplatsOf what, std::span<const GridBlock> blocks = {});

  nlohmann::ordered_json toJson() const;
  /// "a cache of about 2.1 MiB with one scalar, ..."
  std::string toText() const;

 private:
  uint64_t splats_ = 0;
  unsigned threads_ = 1;
  ConversionEstimate needs_;
};

/// Prints the times of a grid's steps, if it has any, and which step was read.
void printTimes(const GridDescription& description);

/// Adds what printTimes() prints.
void addTimes(const GridDescription& description, nlohmann::ordered_json& json);

/// Reads the mesh and prints what is in it. Throws Error if its files are damaged.
void printMeshInfo(const MeshSource& source, const std::string& series, bool json);

}  // namespace curvisplat
