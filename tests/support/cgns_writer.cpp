#include "tests/support/cgns_writer.h"

#include <cgnslib.h>

#include <stdexcept>

namespace curvisplat {
namespace {

void check(int result) {
  if (result != CG_OK) throw std::runtime_error(std::string("CgnsWriter: ") + cg_get_error());
}

template <typename Value>
std::vector<Value> valuesOf(const CgnsWriterField& field, const std::array<int, 3>& values,
                            const CgnsRind& rind) {
  std::vector<Value> all;
  for (int k = -rind[4]; k < values[2] + rind[5]; ++k)
    for (int j = -rind[2]; j < values[1] + rind[3]; ++j)
      for (int i = -rind[0]; i < values[0] + rind[1]; ++i)
        all.push_back(static_cast<Value>(field.value(i, j, k)));
  return all;
}

constexpr size_t kName = 32;

/// Names of 32 characters each.
std::string padded(const std::vector<std::string>& names) {
  std::string all;
  for (const std::string& name : names) all += name + std::string(kName - name.size(), ' ');
  return all;
}

/// Writes names at the node that was gone to, a name a column.
void writeNames(const char* array, const std::vector<std::string>& names) {
  const cgsize_t dims[2] = {kName, static_cast<cgsize_t>(names.size())};
  check(cg_array_write(array, CGNS_ENUMV(Character), 2, dims, padded(names).data()));
}

}  // namespace

CgnsWriter::CgnsWriter(const std::filesystem::path& path, CgnsFileType type) {
  check(cg_set_file_type(type == CgnsFileType::kAdf ? CG_FILE_ADF : CG_FILE_HDF5));
  check(cg_open(path.c_str(), CG_MODE_WRITE, &file_));
}

CgnsWriter::~CgnsWriter() {
  cg_close(file_);
}

void CgnsWriter::base(const std::string& name, int cell_dimension, int space_dimension) {
  check(cg_base_write(file_, name.c_str(), cell_dimension, space_dimension, &base_));
}

void CgnsWriter::family(const std::string& name) {
  int number = 0;
  check(cg_family_write(file_, base_, name.c_str(), &number));
}

void CgnsWriter::zone(const std::string& name, const std::array<int, 3>& nodes) {
  nodes_ = nodes;
  const cgsize_t sizes[9] = {nodes[0], nodes[1], nodes[2], nodes[0] - 1, nodes[1] - 1, nodes[2] - 1, 0, 0, 0};
  check(cg_zone_write(file_, base_, name.c_str(), sizes, CGNS_ENUMV(Structured), &zone_));
}

void CgnsWriter::unstructuredZone(const std::string& name) {
  const cgsize_t sizes[3] = {8, 1, 0};
  check(cg_zone_write(file_, base_, name.c_str(), sizes, CGNS_ENUMV(Unstructured), &zone_));
  const std::vector<double> zeros(8);
  for (const char* axis : {"CoordinateX", "CoordinateY", "CoordinateZ"}) {
    int number = 0;
    check(cg_coord_write(file_, base_, zone_, CGNS_ENUMV(RealDouble), axis, zeros.data(), &number));
  }
}

void CgnsWriter::writeArray(const std::string& name, const CgnsWriterField& field,
                            const std::array<int, 3>& values, const CgnsRind& rind) {
  const cgsize_t dims[3] = {values[0] + rind[0] + rind[1], values[1] + rind[2] + rind[3],
                            values[2] + rind[4] + rind[5]};
  switch (field.numbers) {
    case CgnsNumbers::kSinglePrecision:
      check(cg_array_write(name.c_str(), CGNS_ENUMV(RealSingle), 3, dims,
                           valuesOf<float>(field, values, rind).data()));
      break;
    case CgnsNumbers::kDoublePrecision:
      check(cg_array_write(name.c_str(), CGNS_ENUMV(RealDouble), 3, dims,
                           valuesOf<double>(field, values, rind).data()));
      break;
    case CgnsNumbers::kInteger:
      check(cg_array_write(name.c_str(), CGNS_ENUMV(Integer), 3, dims,
                           valuesOf<int>(field, values, rind).data()));
      break;
  }
}

void CgnsWriter::coordinates(const std::string& name, const std::vector<CgnsWriterField>& axes,
                             const CgnsRind& rind) {
  int grid = 0;
  check(cg_grid_write(file_, base_, zone_, name.c_str(), &grid));
  check(cg_goto(file_, base_, "Zone_t", zone_, "GridCoordinates_t", grid, "end"));
  if (rind != CgnsRind{}) check(cg_rind_write(rind.data()));
  for (const CgnsWriterField& axis : axes) writeArray(axis.name, axis, nodes_, rind);
}

void CgnsWriter::solution(const std::string& name, const std::string& location,
                          const std::vector<CgnsWriterField>& fields, const CgnsRind& rind) {
  auto place = CGNS_ENUMV(Vertex);
  std::array<int, 3> values = nodes_;
  if (location == "CellCenter") {
    place = CGNS_ENUMV(CellCenter);
    for (int& n : values) --n;
  } else if (location == "IFaceCenter") {
    place = CGNS_ENUMV(IFaceCenter);
    --values[1];
    --values[2];
  }
  check(cg_sol_write(file_, base_, zone_, name.c_str(), place, &solution_));
  check(cg_goto(file_, base_, "Zone_t", zone_, "FlowSolution_t", solution_, "end"));
  if (rind != CgnsRind{}) check(cg_rind_write(rind.data()));
  for (const CgnsWriterField& field : fields) writeArray(field.name, field, values, rind);
}

void CgnsWriter::dimensional() {
  check(cg_goto(file_, base_, "end"));
  check(cg_dataclass_write(CGNS_ENUMV(Dimensional)));
  check(cg_units_write(CGNS_ENUMV(Kilogram), CGNS_ENUMV(Meter), CGNS_ENUMV(Second), CGNS_ENUMV(Kelvin),
                       CGNS_ENUMV(Radian)));
}

void CgnsWriter::fieldUnits(int field, const std::vector<float>& exponents) {
  check(cg_goto(file_, base_, "Zone_t", zone_, "FlowSolution_t", solution_, "DataArray_t", field, "end"));
  if (exponents.empty())
    check(cg_dataclass_write(CGNS_ENUMV(NondimensionalParameter)));
  else
    check(cg_exponents_write(CGNS_ENUMV(RealSingle), exponents.data()));
}

void CgnsWriter::baseSteps(const std::vector<double>& times,
                           const std::vector<std::vector<std::string>>& zones, bool iterations) {
  check(cg_biter_write(file_, base_, "TimeSteps", static_cast<int>(times.size())));
  check(cg_goto(file_, base_, "BaseIterativeData_t", 1, "end"));
  const auto count = static_cast<cgsize_t>(times.size());
  if (iterations) {
    const std::vector<int> numbers(times.begin(), times.end());
    check(cg_array_write("IterationValues", CGNS_ENUMV(Integer), 1, &count, numbers.data()));
  } else {
    check(cg_array_write("TimeValues", CGNS_ENUMV(RealDouble), 1, &count, times.data()));
  }
  if (zones.empty()) return;
  std::string all;
  for (const auto& step : zones) all += padded(step);
  const cgsize_t dims[3] = {kName, static_cast<cgsize_t>(zones[0].size()), count};
  check(cg_array_write("ZonePointers", CGNS_ENUMV(Character), 3, dims, all.data()));
}

void CgnsWriter::zoneSteps(const std::vector<std::string>& solutions, const std::vector<std::string>& grids) {
  check(cg_ziter_write(file_, base_, zone_, "ZoneSteps"));
  check(cg_goto(file_, base_, "Zone_t", zone_, "ZoneIterativeData_t", 1, "end"));
  writeNames("FlowSolutionPointers", solutions);
  if (!grids.empty()) writeNames("GridCoordinatesPointers", grids);
}

void CgnsWriter::pointers(const std::string& name, const std::vector<std::string>& solutions) {
  check(cg_goto(file_, base_, "Zone_t", zone_, "ZoneIterativeData_t", 1, "end"));
  writeNames(name.c_str(), solutions);
}

void CgnsWriter::link(const std::string& name, const std::string& file, const std::string& node) {
  check(cg_goto(file_, base_, "Zone_t", zone_, "end"));
  check(cg_link_write(name.c_str(), file.c_str(), node.c_str()));
}

void CgnsWriter::boundary(const std::string& name, bool wall) {
  const std::array<cgsize_t, 6> range{1, 1, 1, nodes_[0], nodes_[1], 1};
  int condition = 0;
  check(cg_boco_write(file_, base_, zone_, name.c_str(), wall ? CGNS_ENUMV(BCWall) : CGNS_ENUMV(BCInflow),
                      CGNS_ENUMV(PointRange), 2, range.data(), &condition));
}

void CgnsWriter::hole(const std::string& name, bool cells, const std::vector<int>& indices, bool ranges) {
  const std::vector<cgsize_t> points(indices.begin(), indices.end());
  const int sets = ranges ? static_cast<int>(points.size() / 6) : 1;
  int hole = 0;
  check(cg_hole_write(file_, base_, zone_, name.c_str(), cells ? CGNS_ENUMV(CellCenter) : CGNS_ENUMV(Vertex),
                      ranges ? CGNS_ENUMV(PointRange) : CGNS_ENUMV(PointList), sets,
                      static_cast<cgsize_t>(ranges ? 2 * sets : points.size() / 3), points.data(), &hole));
}

}  // namespace curvisplat
