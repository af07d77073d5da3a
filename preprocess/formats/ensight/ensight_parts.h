// The parts of an EnSight Gold geometry, and the values of variables on them: where their numbers are in the
// files.
//
// Reading passes through the headers of a binary file once, or through all of a text, whose numbers are
// spooled. Memory grows with the number of parts and types of elements alone. One thread reads a file; any
// number of threads may then read the lists.
#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "preprocess/formats/ensight/ensight_case.h"
#include "preprocess/formats/ensight/ensight_file.h"
#include "preprocess/mesh/mesh_source.h"

namespace curvisplat {

/// Elements of one type.
struct EnsightElements {
  std::string type;  // "hexa8"; "g_hexa8": ghosts
  CellKind kind = CellKind::kNone;
  bool ghosts = false;
  uint64_t count = 0, nodes_each = 0;  // nodes_each: 0 of polyhedra
  EnsightList nodes;
  // The faces of polyhedra: the first face of each polyhedron among all faces, and the first node of each
  // face among the nodes.
  SpooledNumbers first_face, first_node;  // [count + 1], [faces + 1]
};

struct EnsightPart {
  uint64_t number = 0;
  std::string name;
  bool structured = false;
  uint64_t points = 0, cells = 0;  // of an unstructured part: solid elements
  EnsightList coordinates;         // x of all points, then y, then z
  std::vector<EnsightElements> elements;

  // The kind of a structured part.
  enum class Kind { kCurvilinear, kRectilinear, kUniform } kind = Kind::kCurvilinear;
  std::array<uint64_t, 3> nodes{};
  std::array<std::vector<double>, 3> axes;  // of kRectilinear and kUniform
  EnsightList iblank;                       // empty: none
};

/// The parts of a geometry file, in its order.
struct EnsightGeometry {
  bool binary = false, swap = false;
  std::vector<EnsightPart> parts;
};

/// Reads the parts of a geometry file. Throws Error if it is damaged.
EnsightGeometry readEnsightGeometry(const EnsightPlace& place, const EnsightScratch& scratch);

/// The values of a variable on a part. Values at nodes have one list; values in elements have one for each
/// of EnsightPart::elements, or one for a structured part. A list has all values of a component, then those
/// of the next. Empty lists: the part has no values.
struct EnsightValues {
  std::vector<EnsightList> lists;
  std::vector<double> undefined;  // [list]: the value that means none; NaN where there is no such value
};

/// The values of a variable on each part of the geometry. Throws Error if the file is damaged or does not
/// fit the geometry.
std::vector<EnsightValues> readEnsightValues(const EnsightVariable& variable, const EnsightGeometry& geometry,
                                             const EnsightScratch& scratch);

}  // namespace curvisplat
