#include "preprocess/survey/grid_survey.h"

#include <fmt/format.h>
#include <tbb/blocked_range.h>
#include <glm/common.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <functional>
#include <limits>
#include <optional>
#include <span>

#include "preprocess/grid/float_offset.h"
#include "preprocess/grid/hexahedron.h"
#include "preprocess/grid/parallel.h"
#include "preprocess/grid/slabs.h"
#include "preprocess/mesh/mesh_source.h"
#include "stream/base/checksum.h"
#include "stream/base/mutex.h"
#include "stream/base/name_list.h"
#include "stream/base/trace.h"

namespace curvisplat {

namespace {

constexpr double kFewSteps = 100;  // of single precision

/// The distance of floats of this size.
double stepOf(double size) {
  return double{std::nextafter(static_cast<float>(size), std::numeric_limits<float>::max())} - size;
}

/// Some of a scalar's values, from all parts of the source, in the same order each time.
std::vector<float> someValues(const DataSource& source, uint32_t scalar) {
  constexpr uint64_t kParts = 8, kAtATime = 4096;
  const GridDescription& description = source.description();
  std::vector<float> values;
  const auto add = [&](const std::vector<float>& more) {
    values.insert(values.end(), more.begin(), more.end());
  };
  const auto* const grid = dynamic_cast<const GridSource*>(&source);
  const auto* const mesh = dynamic_cast<const MeshSource*>(&source);
  const uint64_t parts = grid ? description.blocks.size() : description.pieces.size();
  NodeArrays nodes;
  MeshPoints points;
  MeshCells cells;
  const bool of_cells = description.scalars[scalar].centring == Centring::kCell;
  for (uint64_t part = 0; part < parts; part += parts / kParts + 1) {
    const auto number = static_cast<uint32_t>(part);
    if (grid) {
      const GridBlock& block = description.blocks[number];
      const uint64_t rows = block.nj * block.nk;
      for (uint64_t row = 0; row < rows; row += rows / kParts + 1) {
        const uint64_t j = row % block.nj, k = row / block.nj;
        readBox(*grid, number, {j, j + 1, k, k + 1, 0, std::min(block.ni, kAtATime)}, {&scalar, 1}, nodes);
        add(nodes.scalars[0]);
      }
      continue;
    }
    const MeshPiece& piece = description.pieces[number];
    const uint64_t samples = of_cells ? piece.cells : piece.points;
    for (uint64_t first = 0; first < samples; first += samples / kParts + 1) {
      const uint64_t count = std::min(kAtATime, samples - first);
      if (of_cells)
        mesh->readCells(number, first, count, {&scalar, 1}, cells);
      else
        mesh->readPoints(number, first, count, {&scalar, 1}, points);
      add(of_cells ? cells.scalars[0] : points.scalars[0]);
    }
  }
  return values;
}

/// The range of these values of a scalar whose range is a few steps of single precision, if that loses digits of them.
std::optional<ScalarRange> rangeThatIsLost(const DataSource& source, uint32_t scalar, double offset) {
  const std::vector<float> rounded = someValues(source, scalar);
  const FloatOffset subtracted(offset);
  const std::vector<float> rest = someValues(source, scalar);
  ScalarRange range;
  bool lost = false;
  for (size_t n = 0; n < std::min(rest.size(), rounded.size()); ++n) {
    if (!std::isfinite(rest[n]) || !std::isfinite(rounded[n])) continue;
    // Values that mark none are far away, and blanked; floats and magnitudes had nothing subtracted.
    const double near = kFewSteps * stepOf(std::abs(offset));
    if (std::abs(double{rounded[n]} - offset) > near || std::abs(rest[n]) > near) continue;
    lost = lost || double{rest[n]} != double{rounded[n]} - offset;
    range.min = std::min(range.min, offset + double{rest[n]});
    range.max = std::max(range.max, offset + double{rest[n]});
  }
  if (!lost || !(range.min < range.max)) return std::nullopt;
  return range;
}

/// PLOT3D's functions that hold for absolute pressures. The first three, temperature, enthalpy and internal energy, have its sign.
constexpr std::array<uint32_t, 7> kOfGas{120, 130, 140, 112, 113, 163, 170};

/// A warning of derived ones among the scalars where the pressure is negative somewhere; may be empty.
std::string warningOfGaugePressure(const DataSource& source, std::span<const uint32_t> scalars) {
  const auto isOfFirst = [](const GridScalar& scalar, size_t count) {
    const auto end = kOfGas.begin() + static_cast<ptrdiff_t>(count);
    return scalar.derived && std::find(kOfGas.begin(), end, scalar.function) != end;
  };
  const std::vector<GridScalar>& all = source.description().scalars;
  std::vector<std::string> wrong;
  for (const uint32_t scalar : scalars)
    if (isOfFirst(all[scalar], kOfGas.size())) wrong.push_back(all[scalar].name);
  // It has no value where the pressure is blanked.
  const auto signed_one = std::ranges::find_if(all, [&](const auto& scalar) { return isOfFirst(scalar, 3); });
  if (wrong.empty() || signed_one == all.end()) return "";
  const auto values = someValues(source, static_cast<uint32_t>(signed_one - all.begin()));
  if (std::ranges::none_of(values, [](float value) { return value < 0; })) return "";
  return fmt::format(
      "{}: computed from an absolute pressure, but the pressure is negative at some samples, as a gauge "
      "pressure is; the values are wrong",
      listed(wrong));
}

}  // namespace

std::vector<std::string> warningsOfRanges(const DataSource& source, std::span<const uint32_t> scalars,
                                          std::span<const ScalarRange> ranges) {
  constexpr double kMinNormal = std::numeric_limits<float>::min();
  std::vector<std::string> sentences;
  if (std::string warning = warningOfGaugePressure(source, scalars); !warning.empty())
    sentences.push_back(std::move(warning));
  for (size_t n = 0; n < scalars.size(); ++n) {
    const GridScalar& scalar = source.description().scalars[scalars[n]];
    const double largest = std::max(std::abs(ranges[n].min), std::abs(ranges[n].max));
    if (largest > 0 && largest < kMinNormal)
      sentences.push_back(
          fmt::format("{}: its values are smaller than {:.1e} in magnitude, too small for single precision: "
                      "pictures cannot show them; multiply them by a power of ten",
                      scalar.name, kMinNormal));
    if (!(largest >= kMinNormal && ranges[n].max - ranges[n].min < kFewSteps * stepOf(largest)) ||
        scalar.derived)
      continue;
    const double offset = ranges[n].min;
    if (const auto lost = rangeThatIsLost(source, scalars[n], offset))
      sentences.push_back(fmt::format(
          "{}: its values differ by about {:.2g}, which single precision loses: it has steps of {:.2g} at "
          "{:.9g}; subtract {:.9g} from them",
          scalar.name, lost->max - lost->min, stepOf(largest), largest, offset));
  }
  return sentences;
}

GridSurvey unitedSurvey(GridSurvey a, const GridSurvey& b) {
  a.nodes += b.nodes;
  a.blanked += b.blanked;
  a.grid_checksum += b.grid_checksum;
  a.lower = glm::min(a.lower, b.lower);
  a.upper = glm::max(a.upper, b.upper);
  for (size_t scalar = 0; scalar < a.ranges.size(); ++scalar) {
    a.ranges[scalar].min = std::min(a.ranges[scalar].min, b.ranges[scalar].min);
    a.ranges[scalar].max = std::max(a.ranges[scalar].max, b.ranges[scalar].max);
  }
  return a;
}

namespace {

/// 0 .. count - 1, evenly spread, from the number of a row's first node: rows that lie side by side begin
/// apart.
uint64_t phaseOf(uint64_t node, uint64_t count) {
  uint64_t bits = node * 0x9e3779b97f4a7c15;
  bits = (bits ^ bits >> 32) * 0xd6e8feb86659fd93;
  return (bits ^ bits >> 32) % count;
}

}  // namespace

PositionSample::PositionSample(uint64_t nodes, uint64_t most)
    // A row begins anywhere, so there may be one more of each; a little room is for that.
    : nodes_each_(static_cast<uint32_t>(nodes / (most - most / 16) + 1)) {
  positions_.reserve(std::min(nodes / nodes_each_ + nodes / nodes_each_ / 16 + 64, most));
}

void PositionSample::add(const LoadedSlab& loaded, const GridBlock& block) {
  const auto& [slab, nodes, ignored] = loaded;
  const WindowStrides strides(slab.window, block.ni);
  for (uint64_t k = slab.box.k0; k < slab.box.k1; ++k)
    for (uint64_t j = slab.box.j0; j < slab.box.j1; ++j) {
      const uint64_t phase = phaseOf(slab.first_node + (k * block.nj + j) * block.ni, nodes_each_);
      // The first i >= i0 with i % nodes_each_ == phase.
      uint64_t i = slab.box.i0 + (phase + nodes_each_ - slab.box.i0 % nodes_each_) % nodes_each_;
      for (; i < slab.box.endOfRow(block.ni); i += nodes_each_)
        if (const size_t at = strides.at(i, j, k); !nodes.blank[at])
          positions_.emplace_back(nodes.x[at], nodes.y[at], nodes.z[at]);
    }
}

namespace {

constexpr uint64_t kNodesOfTask = 16384;

/// The checksum of x, y, z and blank of a row.
uint64_t checksumOfRow(uint32_t block, uint64_t j, uint64_t k, const std::array<uint64_t, 4>& arrays) {
  const std::array<uint64_t, 7> parts{block, j, k, arrays[0], arrays[1], arrays[2], arrays[3]};
  return checksumOf(std::as_bytes(std::span(parts)));
}

}  // namespace

void GridChecksum::add(const LoadedSlab& loaded, const GridBlock& block) {
  const Slab& slab = loaded.slab;
  const NodeArrays& nodes = loaded.nodes;
  const WindowStrides strides(slab.window, block.ni);
  const uint64_t width = slab.box.j1 - slab.box.j0, row_nodes = slab.box.rowNodes(block.ni);
  const bool whole = slab.box.hasWholeRows(block.ni);
  if (!whole && slab.box.i0 == 0) rows_ = std::vector<Row>(rowsOf(slab.box));
  const auto of_row = [&](uint64_t row) {
    const uint64_t j = slab.box.j0 + row % width, k = slab.box.k0 + row / width;
    if (!whole) return ofParts(rows_[row], loaded, block, j, k);
    const size_t first = strides.at(0, j, k);
    const auto of = [&](const auto& values) {
      return checksumOf(std::as_bytes(std::span(values).subspan(first, block.ni)));
    };
    return checksumOfRow(slab.block, j, k, {of(nodes.x), of(nodes.y), of(nodes.z), of(nodes.blank)});
  };
  sum_ += parallelReduce(
      tbb::blocked_range<uint64_t>(0, rowsOf(slab.box), kNodesOfTask / row_nodes + 1), uint64_t{0},
      [&](const tbb::blocked_range<uint64_t>& range, uint64_t sum) {
        const TraceScope trace("checksum");
        for (uint64_t row = range.begin(); row < range.end(); ++row) sum += of_row(row);
        return sum;
      },
      std::plus<>());
}

/// The row's checksum if the slab has its last part, else 0.
uint64_t GridChecksum::ofParts(Row& row, const LoadedSlab& loaded, const GridBlock& block, uint64_t j,
                               uint64_t k) const {
  const Slab& slab = loaded.slab;
  const NodeArrays& nodes = loaded.nodes;
  const size_t first = WindowStrides(slab.window, block.ni).at(slab.box.i0, j, k);
  const size_t count = slab.box.rowNodes(block.ni);
  const auto add = [&](const auto& values, Checksum& to) {
    to.add(std::as_bytes(std::span(values).subspan(first, count)));
  };
  add(nodes.x, row.x);
  add(nodes.y, row.y);
  add(nodes.z, row.z);
  add(nodes.blank, row.blank);
  if (slab.box.i1 < block.ni) return 0;
  return checksumOfRow(slab.block, j, k, {row.x.value(), row.y.value(), row.z.value(), row.blank.value()});
}

namespace {

constexpr size_t kNodesPerTask = 16384;

/// Adds a cell to the survey. Returns whether the cell is drawn.
bool addCell(const NodeArrays& nodes, size_t at, const WindowStrides& strides,
             std::optional<double> blank_value, GridSurvey& survey) {
  const size_t row_stride = strides.row, plane_stride = strides.plane;
  ++survey.nodes;
  const uint8_t own = nodes.blank[at];
  const bool corners = (cornerMarks(nodes.blank.data(), at, row_stride, plane_stride) & kNoNode) == 0;
  if (own != 0 && corners && nodes.scalars.size() > 1)
    survey.blanked.addLost(nodes.scalars, at, idOfPosition(nodes.x[at], nodes.y[at], nodes.z[at]),
                           blank_value);
  if (!corners || (own & kNoValue)) {
    ++survey.blanked.by_grid;
    return false;
  }
  if (own & kBlankValue) {
    ++survey.blanked.by_value;
    return false;
  }
  if (own & kValueNotFinite) {
    ++survey.blanked.not_finite;
    return false;
  }
  for (const glm::dvec3& corner :
       cornersAt(nodes.x.data(), nodes.y.data(), nodes.z.data(), at, row_stride, plane_stride)) {
    survey.lower = glm::min(survey.lower, corner);
    survey.upper = glm::max(survey.upper, corner);
  }
  for (size_t scalar = 0; scalar < survey.ranges.size(); ++scalar) {
    const double value = nodes.scalars[scalar][at];
    if (!std::isfinite(value)) continue;
    survey.ranges[scalar].min = std::min(survey.ranges[scalar].min, value);
    survey.ranges[scalar].max = std::max(survey.ranges[scalar].max, value);
  }
  return true;
}

}  // namespace

GridSurvey surveyCells(const NodeReader& reader, uint64_t slab_bytes, const SurveyExtras& extras,
                       Progress& progress) {
  AbuttingFaces* const faces = extras.faces;
  Mutex adding_faces;  // guards *faces
  GridSurvey nothing;
  nothing.ranges.resize(reader.scalars());
  GridSurvey survey = nothing;
  GridChecksum checksum;
  SlabStream slabs(reader, slab_bytes, kCornerHalo);
  while (const LoadedSlab* loaded = slabs.next()) {
    const Slab& slab = loaded->slab;
    const NodeArrays& nodes = loaded->nodes;
    const GridBlock& block = reader.source().description().blocks[slab.block];
    const WindowStrides strides(slab.window, block.ni);
    const uint64_t rows = slab.box.j1 - slab.box.j0, row_nodes = slab.box.rowNodes(block.ni);
    const auto add_ends = [&](const std::array<uint64_t, 3>& cell, size_t at,
                              std::vector<AbuttingFaces::Centre>& ends) {
      for (int axis = 0; axis < 3; ++axis)
        for (const bool upper : {false, true})
          if (const CellFace face{slab.block, cell, axis, upper}; faces->isAtEnd(face))
            ends.push_back(faces->centreOf(face, cornersAt(nodes.x.data(), nodes.y.data(), nodes.z.data(), at,
                                                           strides.row, strides.plane)));
    };
    const auto add_row = [&](size_t row, GridSurvey& to, std::vector<AbuttingFaces::Centre>& ends) {
      const uint64_t j = slab.box.j0 + row % rows, k = slab.box.k0 + row / rows;
      if (j + 1 == block.nj || k + 1 == block.nk) return;
      const bool row_at_end = j == 0 || j + 2 == block.nj || k == 0 || k + 2 == block.nk;
      size_t at = strides.at(slab.box.i0, j, k);
      for (uint64_t i = slab.box.i0; i < slab.box.i1 && i + 1 < block.ni; ++i, ++at) {
        const bool is_there = addCell(nodes, at, strides, reader.blankValue(), to);
        const bool at_end = row_at_end || i == 0 || i + 2 == block.ni;
        if (faces && is_there && at_end) add_ends({i, j, k}, at, ends);
      }
    };
    // Counts, minima and maxima do not depend on how the work is divided.
    survey = unitedSurvey(
        std::move(survey),
        parallelReduce(
            tbb::blocked_range<size_t>(0, rowsOf(slab.box), kNodesPerTask / row_nodes + 1), nothing,
            [&](const tbb::blocked_range<size_t>& range, GridSurvey of_range) {
              const TraceScope trace("scan cells");
              std::vector<AbuttingFaces::Centre> ends;
              for (size_t row = range.begin(); row < range.end(); ++row) add_row(row, of_range, ends);
              if (!ends.empty()) {
                const MutexLock lock(adding_faces);
                faces->add(ends);
              }
              return of_range;
            },
            unitedSurvey));
    checksum.add(*loaded, block);
    if (extras.sample) extras.sample->add(*loaded, block);
    progress.advance(rowsOf(slab.box) * row_nodes);
  }
  survey.grid_checksum = checksum.value();
  return survey;
}

}  // namespace curvisplat
