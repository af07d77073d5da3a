#include "preprocess/formats/netcdf/cf_nodes.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <glm/trigonometric.hpp>

#include "preprocess/formats/netcdf/cf_coordinates.h"
#include "stream/base/error.h"

namespace curvisplat {
namespace {

// Positions are computed for this many nodes at a time, which bounds the buffers.
constexpr uint64_t kNodesAtATime = 1 << 16;
// The mask variable, if it is not requested itself, is read for this many nodes at a time.
constexpr uint64_t kMaskNodesAtATime = 1 << 20;

uint64_t lengthOf(const CfRange& range, size_t axis) {
  return range.end[axis] - range.begin[axis];
}

uint64_t nodesOf(const CfRange& range) {
  return lengthOf(range, 0) * lengthOf(range, 1) * lengthOf(range, 2);
}

/// Calls `each` for pieces of a box that are contiguous in it, of about `nodes` nodes or a row.
template <typename Each>
void forEachPiece(const CfRange& box, uint64_t nodes, const Each& each) {
  const uint64_t ni = lengthOf(box, 0), nj = lengthOf(box, 1);
  const uint64_t rows = std::clamp<uint64_t>(nodes / ni, 1, nj);
  const uint64_t planes = rows < nj ? 1 : std::clamp<uint64_t>(nodes / (ni * rows), 1, lengthOf(box, 2));
  for (uint64_t k = box.begin[2]; k < box.end[2]; k += planes)
    for (uint64_t j = box.begin[1]; j < box.end[1]; j += rows)
      each(CfRange{{box.begin[0], j, k},
                   {box.end[0], std::min(j + rows, box.end[1]), std::min(k + planes, box.end[2])}});
}

}  // namespace

CfNodes::CfNodes(const NetcdfFiles& files, CfGrid grid, const Globe& globe, size_t mask)
    : files_(files),
      grid_(std::move(grid)),
      globe_(globe),
      mask_(mask),
      length_(kilometresOf(grid_.longitude.variable().text("units")).value_or(1e-3)) {}

void CfNodes::read(const CfRange& range, std::span<const uint32_t> scalars, NodeArrays& out) const {
  const size_t nodes = nodesOf(range);
  for (std::vector<double>* axis : {&out.x, &out.y, &out.z}) axis->resize(nodes);
  readPlaces(range, out);
  out.blank.assign(nodes, 0);
  out.scalars.resize(scalars.size());
  const std::vector<float>* mask = nullptr;
  for (size_t n = 0; n < scalars.size(); ++n) {
    CURVISPLAT_CHECK_OP(scalars[n], <, grid_.variables.size());
    out.scalars[n].resize(nodes);
    readScalar(range, scalars[n], out.scalars[n]);
    if (scalars[n] == mask_) mask = &out.scalars[n];
  }
  if (mask)
    for (size_t n = 0; n < nodes; ++n) out.blank[n] = std::isnan((*mask)[n]);
  else
    readBlank(range, out.blank);
  if (grid_.mask) applyMask(range, out.blank);
  if (grid_.surface_first && range.begin[grid_.levels] == 0) blankFirstLevel(range, out.blank);
}

void CfNodes::blankFirstLevel(const CfRange& range, std::vector<uint8_t>& blank) const {
  size_t n = 0;
  std::array<uint64_t, 3> at{};
  for (at[2] = range.begin[2]; at[2] < range.end[2]; ++at[2])
    for (at[1] = range.begin[1]; at[1] < range.end[1]; ++at[1])
      for (at[0] = range.begin[0]; at[0] < range.end[0]; ++at[0], ++n)
        if (at[grid_.levels] == 0) blank[n] = 1;
}

void CfNodes::applyMask(const CfRange& range, std::vector<uint8_t>& blank) const {
  size_t n = 0;
  forEachPiece(range, kNodesAtATime, [&](const CfRange& piece) {
    const size_t nodes = nodesOf(piece);
    grid_.mask->apply(files_, piece, {&blank[n], nodes});
    n += nodes;
  });
}

void CfNodes::readBlank(const CfRange& range, std::vector<uint8_t>& blank) const {
  std::vector<float> values;
  size_t n = 0;
  forEachPiece(range, kMaskNodesAtATime, [&](const CfRange& piece) {
    values.resize(nodesOf(piece));
    readScalar(piece, mask_, values);
    for (const float value : values) blank[n++] = std::isnan(value);
  });
}

/// The columns of the box's nodes; those of its first plane only where one column serves all levels.
void CfNodes::readColumns(const CfRange& range, std::vector<glm::dvec3>& columns) const {
  if (grid_.degrees && grid_.longitude.ofCorners() && grid_.latitude.ofCorners())
    return readMiddles(range, columns);
  const CfValues east = grid_.longitude.read(files_, range), north = grid_.latitude.read(files_, range);
  const double scale = !grid_.degrees && !projects() ? length_ : 1;
  const bool upright = !grid_.longitude.varies(2) && !grid_.latitude.varies(2);
  const uint64_t planes = upright ? 1 : lengthOf(range, 2);
  std::vector<double> x, y;
  for (uint64_t k = 0; k < planes; ++k)
    for (uint64_t j = 0; j < lengthOf(range, 1); ++j)
      for (uint64_t i = 0; i < lengthOf(range, 0); ++i) {
        const double longitude = east.at(i, j, k), latitude = north.at(i, j, k);
        const bool nowhere = (grid_.degrees && !grid_.projection && !isOnEarth(longitude, latitude)) ||
                             grid_.nowhere == std::array{longitude, latitude};
        x.push_back(nowhere ? std::nan("") : scale * longitude);
        y.push_back(nowhere ? std::nan("") : scale * latitude);
      }
  if (projects()) {
    if (!grid_.degrees)  // PROJ's lengths are metres
      for (std::vector<double>* axis : {&x, &y})
        for (double& value : *axis) value *= 1e3 * length_;
    grid_.projection->toGeographic(x, y);
  }
  columns.clear();
  for (size_t n = 0; n < x.size(); ++n) columns.push_back(globe_.column(x[n], y[n]));
}

/// Columns in the middle of their cells' corners: on the sphere, since longitudes have no mean around a pole.
void CfNodes::readMiddles(const CfRange& range, std::vector<glm::dvec3>& columns) const {
  const NetcdfBox box = grid_.longitude.boxOf(range);
  std::vector<double> longitudes(box.values()), latitudes(box.values());
  files_.read(grid_.longitude.variable(), box, longitudes);
  files_.read(grid_.latitude.variable(), grid_.latitude.boxOf(range), latitudes);
  const double of_longitude = glm::radians(degreesOf(grid_.longitude.variable().text("units"))),
               of_latitude = glm::radians(degreesOf(grid_.latitude.variable().text("units")));
  const uint64_t row = lengthOf(range, 0) + 1;
  std::vector<glm::dvec3> corners;
  for (size_t n = 0; n < longitudes.size(); ++n) {
    const double east = of_longitude * longitudes[n], north = of_latitude * latitudes[n];
    corners.push_back({std::cos(north) * std::cos(east), std::cos(north) * std::sin(east), std::sin(north)});
  }
  columns.clear();
  for (uint64_t j = 0; j < lengthOf(range, 1); ++j)
    for (uint64_t i = 0; i < lengthOf(range, 0); ++i) {
      const size_t n = i + row * j;
      const glm::dvec3 middle = corners[n] + corners[n + 1] + corners[n + row] + corners[n + row + 1];
      columns.push_back(globe_.column(glm::degrees(std::atan2(middle.y, middle.x)),
                                      glm::degrees(std::atan2(middle.z, std::hypot(middle.x, middle.y)))));
    }
}

std::vector<glm::dvec3> CfNodes::points(const CfRange& range) const {
  std::vector<glm::dvec3> columns;
  readColumns(range, columns);
  return columns;
}

void CfNodes::readPlaces(const CfRange& range, NodeArrays& out) const {
  std::vector<glm::dvec3> columns;
  const bool read = grid_.vertical.readNodes(files_, range, out.z);
  CfValues height;
  size_t n = 0;
  forEachPiece(range, kNodesAtATime, [&](const CfRange& piece) {
    readColumns(piece, columns);
    if (!read) height = grid_.vertical.heights(files_, piece);
    size_t column = 0;
    for (uint64_t k = 0; k < lengthOf(piece, 2); ++k)
      for (uint64_t j = 0; j < lengthOf(piece, 1); ++j)
        for (uint64_t i = 0; i < lengthOf(piece, 0); ++i, ++n, ++column) {
          if (column == columns.size()) column = 0;
          const double own = read ? out.z[n] : height.at(i, j, k);
          const glm::dvec3 place = globe_.place(
              columns[column], !globe_.degrees() || std::abs(own) <= kMaxHeight ? own : std::nan(""));
          out.x[n] = place.x;
          out.y[n] = place.y;
          out.z[n] = place.z;
        }
  });
}

void CfNodes::readScalar(const CfRange& range, size_t scalar, std::span<float> to) const {
  const NetcdfVariable& variable = *grid_.variables[scalar];
  const CfDimensions& dims = grid_.dims;
  NetcdfBox part{std::vector<size_t>(variable.dims.size(), 0), std::vector<size_t>(variable.dims.size(), 1)};
  for (size_t d = 0; d < variable.dims.size(); ++d) {
    if (dims.time && variable.dims[d] == *dims.time) part.start[d] = dims.time_step;
    if (dims.face && variable.dims[d] == *dims.face) part.start[d] = grid_.face;
    for (size_t axis = 0; axis < 3; ++axis)
      if (variable.dims[d] == dims.axes[axis]) {
        part.start[d] = range.begin[axis];
        part.count[d] = lengthOf(range, axis);
      }
  }
  files_.read(variable, part, to);
}

}  // namespace curvisplat
