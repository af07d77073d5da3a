// Values in a file of Gmsh, in sections: at nodes, in elements, and at the nodes of each element.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "preprocess/formats/common/spool_file.h"
#include "preprocess/formats/gmsh/gmsh_reader.h"
#include "preprocess/formats/gmsh/gmsh_tags.h"
#include "preprocess/grid/grid_source.h"

namespace curvisplat {

struct GmshData {
  std::string name;
  Centring centring = Centring::kNode;
  bool at_nodes_of_elements = false;  // each element has values of its own at its nodes
  double time = 0, step = 0;
  uint64_t components = 1, count = 0, offset = 0;
};

/// Whether a section of this name ("NodeData") has values.
bool hasGmshData(const std::string& section);

/// Reads what the section is: names, real and whole numbers, in text. Values follow. Throws Error.
GmshData readGmshData(GmshReader& reader, const std::string& section);

/// The nodes and elements of a mesh by their numbers, and the file that their values are spooled to.
struct GmshSamples {
  std::shared_ptr<SpoolFile> spool;
  const GmshTags& nodes;
  const GmshTags& elements;
  std::function<std::span<const uint64_t>(uint64_t element)> nodesOf;  // by their indices
};

/// Spools the values of all nodes, or of all elements, in their order: NaN where the sections have none. A node has the mean of
/// what its elements have there. Throws Error.
SpooledNumbers spooledGmshData(GmshReader& reader, const std::vector<const GmshData*>& sections,
                               const GmshSamples& samples);

}  // namespace curvisplat
