// The parts of an EnSight Gold geometry file: where their numbers are.
#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "preprocess/formats/ensight/ensight_file.h"
#include "preprocess/mesh/mesh_cells.h"

namespace curvisplat {

/// Elements of one type.
struct EnsightElements {
  std::string type;  // "hexa8"; "g_hexa8": ghosts
  CellKind kind = CellKind::kNone;
  bool ghosts = false;
  uint64_t count = 0, nodes_each = 0;  // nodes_each: 0 of polyhedra
  EnsightList nodes;
  // Of polyhedra: faces of each, nodes of each face; where each begins among the faces and the nodes.
  SpooledNumbers first_face, first_node;  // [count + 1], [faces + 1]
};

struct EnsightPart {
  uint64_t number = 0;
  std::string name;
  bool structured = false;
  uint64_t points = 0, cells = 0;  // of an unstructured part: solid elements
  EnsightList coordinates;         // x of all points, then y, then z
  std::vector<EnsightElements> elements;

  // Of a structured part.
  enum class Kind { kCurvilinear, kRectilinear, kUniform } kind = Kind::kCurvilinear;
  std::array<uint64_t, 3> nodes{};
  std::array<std::vector<double>, 3> axes;  // of kRectilinear and kUniform
  EnsightList iblank;                       // empty: none
};

struct EnsightGeometry {
  bool binary = false, swap = false;
  std::vector<EnsightPart> parts;
};

/// Passes through the headers of a binary file, or all of a text. Throws Error if it is damaged.
EnsightGeometry readEnsightGeometry(const std::filesystem::path& path, const std::filesystem::path& folder);

/// The kind and number of nodes of a type of elements; nodes_each is 0 if there is no such type.
EnsightElements ensightElementsOf(const std::string& type);

}  // namespace curvisplat
