// Writes small CGNS files by libcgns' upper layer, the one that the programs of others write with (the reader
// stands on the lower one). Values are functions of a node's place, so that tests know them.
#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <string>
#include <vector>

namespace curvisplat {

enum class CgnsFileType { kAdf, kHdf5 };
enum class CgnsNumbers { kSinglePrecision, kDoublePrecision, kInteger };

/// A function of indices from 0 in the zone itself; negative, or beyond the zone, on rind planes.
using CgnsFunction = std::function<double(int64_t i, int64_t j, int64_t k)>;
using CgnsRind = std::array<int, 6>;  // planes before and behind along i, j, k

struct CgnsWriterField {
  std::string name;
  CgnsFunction value;
  CgnsNumbers numbers = CgnsNumbers::kDoublePrecision;
};

/// Writes CGNS files. Each call adds to what the last one began: a zone to the last base, a solution to the
/// last zone.
class CgnsWriter {
 public:
  CgnsWriter(const std::filesystem::path& path, CgnsFileType type);
  ~CgnsWriter();  // closes the file
  CgnsWriter(const CgnsWriter&) = delete;
  CgnsWriter& operator=(const CgnsWriter&) = delete;

  void base(const std::string& name, int cell_dimension = 3, int space_dimension = 3);
  void family(const std::string& name);
  void zone(const std::string& name, const std::array<int, 3>& nodes);
  void unstructuredZone(const std::string& name);
  /// `name`: "GridCoordinates" for the first.
  void coordinates(const std::string& name, const std::vector<CgnsWriterField>& axes,
                   const CgnsRind& rind = {});
  /// `location`: Vertex, CellCenter, IFaceCenter.
  void solution(const std::string& name, const std::string& location,
                const std::vector<CgnsWriterField>& fields, const CgnsRind& rind = {});

  /// Units of kilogram, meter, second, Kelvin, radian, for all of the base.
  void dimensional();
  /// The exponents of a field of the last solution; it is dimensionless if `exponents` are empty.
  void fieldUnits(int field, const std::vector<float>& exponents);

  /// `zones`: the names of those that there are at each step, as many at each; empty: not told. Where
  /// `iterations`, times are told as whole numbers of those.
  void baseSteps(const std::vector<double>& times, const std::vector<std::vector<std::string>>& zones = {},
                 bool iterations = false);
  /// Writes for each step the name of a solution and, unless `grids` is empty, of coordinates.
  void zoneSteps(const std::vector<std::string>& solutions, const std::vector<std::string>& grids = {});
  /// A further table of solutions for each step, such as IOSS' CellCenterSolutionPointers; after zoneSteps().
  void pointers(const std::string& name, const std::vector<std::string>& solutions);
  /// A node of the last zone that is another file's.
  void link(const std::string& name, const std::string& file, const std::string& node);
  /// A wall or an inflow on the lowest plane of the last zone.
  void boundary(const std::string& name, bool wall);
  /// An overset hole of the last zone, of nodes or of cells: ranges of 6 indices from 1 each, or else points of 3.
  void hole(const std::string& name, bool cells, const std::vector<int>& indices, bool ranges);

 private:
  void writeArray(const std::string& name, const CgnsWriterField& field, const std::array<int, 3>& values,
                  const CgnsRind& rind);

  int file_ = 0, base_ = 0, zone_ = 0, solution_ = 0;
  std::array<int, 3> nodes_{};
};

}  // namespace curvisplat
