// The zones of a CGNS file, with their coordinates and solutions at one time step. Reads names and sizes only, no
// samples. Structured zones, or if there are none the unstructured ones.
//
// The time steps are those of BaseIterativeData; ZoneIterativeData assigns solutions and coordinates to them.
// Where it is missing, a zone's solutions are consecutive steps: each is assigned to the first step that has
// none of its fields yet, so that two solutions with different fields, or a node-centred and a cell-centred
// one, share a step.
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "preprocess/formats/cgns/cgns_file.h"
#include "preprocess/formats/cgns/cgns_patches.h"
#include "preprocess/grid/grid_source.h"

namespace curvisplat {

/// An array on a zone. The zone's first sample is at index `rind`: the planes before it, and those after the
/// zone's last sample, are copies of the neighbours' values.
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
  std::vector<GridBoundary> boundaries;  // block: not set
  std::array<uint64_t, 3> nodes{};       // along i, j, k; of an unstructured zone all, 1, 1
  uint64_t cells = 0;                    // of an unstructured zone, as it declares them
  std::vector<CgnsNode> sections;        // of an unstructured zone: Elements_t
  std::array<CgnsArray, 3> coordinates;  // x, y, z
  std::vector<CgnsField> fields;
  CgnsHoles holes;  // of a structured zone
};

struct CgnsTree {
  std::vector<CgnsZone> zones;  // at least one; all structured or all unstructured
  bool unstructured = false;
  size_t bases = 0;           // number of bases that the zones belong to
  std::vector<double> times;  // [step]; 0, 1, ... if the file stores no times; empty: no time steps
  std::vector<std::string> warnings;
  std::vector<std::string> notes;  // boundary conditions, families, units
};

/// Throws Error if the file has nothing to draw (only surfaces), if its coordinates are
/// not Cartesian, if it has no step `step`, or if it is inconsistent.
CgnsTree readCgnsTree(const CgnsFile& file, uint32_t step);

}  // namespace curvisplat
