#include "preprocess/formats/cgns/cgns_boundary.h"

#include <algorithm>
#include <string>

namespace curvisplat {
namespace {

/// The axis of the faces that a GridLocation counts; 3: nodes, or faces of the axis along which the range is flat.
size_t axisOf(const std::string& location) {
  if (location == "IFaceCenter") return 0;
  if (location == "JFaceCenter") return 1;
  if (location == "KFaceCenter") return 2;
  return 3;
}

}  // namespace

std::optional<GridBoundary> cgnsBoundary(const CgnsFile& file, const std::vector<CgnsNode>& details,
                                         const std::array<uint64_t, 3>& nodes) {
  std::string location = "Vertex";
  const CgnsNode* range = nullptr;
  for (const CgnsNode& detail : details) {
    if (detail.label == "GridLocation_t") location = file.text(detail);
    if (detail.label == "IndexRange_t" && (detail.name == "PointRange" || detail.name == "ElementRange"))
      range = &detail;
  }
  if (!range || file.shape(*range).count() != 6) return std::nullopt;
  const std::vector<double> ends = file.numbers(*range);
  const bool of_faces = location.ends_with("FaceCenter");
  size_t normal = axisOf(location);
  for (size_t axis = 0; axis < 3 && normal == 3; ++axis)
    if (ends[axis] == ends[axis + 3] && nodes[axis] > 1) normal = axis;
  if (normal == 3 || ends[normal] != ends[normal + 3]) return std::nullopt;
  GridBoundary boundary;
  for (size_t axis = 0; axis < 3; ++axis) {
    const auto [low, high] = std::minmax(ends[axis], ends[axis + 3]);
    const double last = high + (of_faces && axis != normal ? 1 : 0);
    if (!(low >= 1 && last <= static_cast<double>(nodes[axis]))) return std::nullopt;
    boundary.first[axis] = static_cast<uint64_t>(low) - 1;
    boundary.last[axis] = static_cast<uint64_t>(last) - 1;
  }
  return boundary;
}

}  // namespace curvisplat
