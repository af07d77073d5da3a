// What a CGNS file's nodes mean to us: its structured zones, and at one time step their coordinates and the
// solutions on them. Reads names and sizes only, no values of nodes or cells.
//
// Time steps are those of BaseIterativeData, whose zones then tell which solution and which coordinates
// belong to each (ZoneIterativeData). Where they do not, a zone's solutions follow one another: each goes to
// the first step that has none of its fields yet, so that two solutions of different fields, or one of the
// nodes and one of the cells, are of one time.
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "preprocess/formats/cgns/cgns_file.h"
#include "preprocess/grid/grid_source.h"

namespace curvisplat {

/// An array on a zone. Its element `rind` is the zone's own first: planes before that, and behind the zone's
/// last, are copies of neighbours' values.
struct CgnsArray {
  CgnsNode node;
  CgnsShape shape;
  std::array<uint64_t, 3> rind{};
};

struct CgnsField {
  std::string name, unit;
  Centring centring = Centring::kNode;
  CgnsArray array;
};

struct CgnsZone {
  std::string base, name;
  std::array<uint64_t, 3> nodes{};       // along i, j, k
  std::array<CgnsArray, 3> coordinates;  // x, y, z
  std::vector<CgnsField> fields;
};

struct CgnsTree {
  std::vector<CgnsZone> zones;  // at least one
  size_t bases = 0;             // that these are of
  std::vector<double> times;    // of every step; numbers from 0 where the file tells none; empty: no steps
  std::vector<std::string> warnings;
};

/// Throws Error where nothing can be drawn (surfaces, unstructured zones), where coordinates are not
/// Cartesian, where there is no step `step`, and where the file contradicts itself.
CgnsTree readCgnsTree(const CgnsFile& file, uint32_t step);

}  // namespace curvisplat
