#include "stream/codec/brick_codec.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "stream/base/checksum.h"
#include "stream/base/error.h"
#include "stream/base/threads.h"
#include "stream/codec/geometry_codec.h"
#include "stream/codec/prediction.h"
#include "stream/codec/values_codec.h"
#include "stream/model/border_code.h"
#include "stream/model/splats.h"

namespace curvisplat {
namespace {

float roundedUp(double value) {
  const float rounded = static_cast<float>(value);
  return rounded >= value ? rounded : std::nextafter(rounded, std::numeric_limits<float>::infinity());
}

DecodedGeometry& scratchGeometry() {
  static const PerThread<DecodedGeometry> scratch;
  return scratch.own();
}

void checkInput(const BrickSplats& brick) {
  CURVISPLAT_CHECK_OP(brick.size(), >=, 1u);
  CURVISPLAT_CHECK_OP(brick.size(), <=, size_t{kMaxBrickSplats});
  CURVISPLAT_CHECK_OP(brick.positions.size(), ==, brick.size());
  if (!brick.border_codes.empty()) CURVISPLAT_CHECK_OP(brick.border_codes.size(), ==, brick.size());
  if (!brick.growth_codes.empty()) CURVISPLAT_CHECK_OP(brick.growth_codes.size(), ==, brick.size());
  uint64_t nodes = 0;
  for (const NodeRun& run : brick.runs) {
    CURVISPLAT_CHECK_OP(run.count, >=, 1u);
    nodes += run.count;
  }
  if (!brick.runs.empty()) CURVISPLAT_CHECK_OP(nodes, ==, brick.size());
  bool fine = true;
  for (size_t n = 0; n < brick.size(); ++n) {
    const Splat& splat = brick.splats[n];
    for (int c = 0; c < 3; ++c)
      fine &= splat.axis[c] > 0 && std::isfinite(splat.axis[c]) && std::isfinite(splat.shear[c]);
    fine &= splat.weight >= 0 && std::isfinite(splat.weight) && brick.cell.contains(brick.positions[n]);
  }
  for (const auto& values : brick.variables) {
    CURVISPLAT_CHECK_OP(values.size(), ==, brick.size());
    for (const SplatScalar& value : values)
      fine &= std::isfinite(value.mean) && std::isfinite(value.slope.x) && std::isfinite(value.slope.y) &&
              std::isfinite(value.slope.z) && value.variance >= 0 && std::isfinite(value.variance);
  }
  CURVISPLAT_CHECK(fine && "every number is finite, axes are positive, positions are in the cell");
}

/// Fills position, shape and weight of every splat from the decoded arrays.
void fillGeometry(const RootCube& root, const DecodedGeometry& decoded, BrickSplats& brick) {
  for (size_t n = 0; n < brick.size(); ++n) {
    Splat& splat = brick.splats[n];
    for (int axis = 0; axis < 3; ++axis) {
      brick.positions[n].at[axis] = latticePosition(decoded.position[axis][n], decoded.position_bits,
                                                    brick.cell.level, brick.cell.at[axis]);
      splat.axis[axis] = decoded.axis[axis][n];
      splat.shear[axis] = decoded.shear[axis][n];
    }
    splat.weight = decoded.weight[n];
    splat.position = root.toWorld(brick.positions[n]);
  }
}

Brick summaryOf(const RootCube& root, const BrickSplats& splats) {
  Brick brick;
  brick.cell = splats.cell;
  brick.splats = static_cast<uint32_t>(splats.size());
  RootPosition lower = splats.positions.front(), upper = lower;
  for (const RootPosition& position : splats.positions) {
    ++brick.octant_splats[octantOf(position, splats.cell)];
    for (int axis = 0; axis < 3; ++axis) {
      lower.at[axis] = std::min(lower.at[axis], position.at[axis]);
      upper.at[axis] = std::max(upper.at[axis], position.at[axis]);
    }
  }
  brick.lower = root.toWorld(lower);
  brick.upper = root.toWorld(upper);
  brick.largest_radius = roundedUp(largestReach(splats.splats, splats.border_codes));
  return brick;
}

/// `border_codes` may be empty.
BrickVariable summaryOf(std::span<const SplatScalar> values, std::span<const uint32_t> border_codes) {
  BrickVariable summary;
  double lowest = std::numeric_limits<double>::infinity(), highest = -lowest, slope = 0, variance = 0;
  for (const SplatScalar& value : values) {
    lowest = std::min(lowest, value.mean);
    highest = std::max(highest, value.mean);
    slope = std::max(slope, glm::dot(value.slope, value.slope));
    variance = std::max(variance, value.variance);
  }
  slope = std::sqrt(slope);
  for (size_t n = 0; n < border_codes.size(); ++n)
    if (border_codes[n] != kNoBorder) slope = std::max(slope, drawnSlope(values[n].slope, border_codes[n]));
  summary.min = static_cast<float>(lowest);  // decoded means are floats
  summary.max = static_cast<float>(highest);
  summary.largest_slope = roundedUp(slope);
  summary.largest_deviation = roundedUp(std::sqrt(variance));
  return summary;
}

Extent extentOf(std::span<const std::byte> bytes) {
  return {0, static_cast<uint32_t>(bytes.size()), checksumOf(bytes)};
}

EncodedValues encodeInRows(std::span<const Row> rows, std::span<const uint32_t> border_codes,
                           std::span<SplatScalar> values, const TimeReferences& references,
                           const ValueCoding& coding) {
  EncodedValues encoded;
  encoded.bytes = encodeValuesStream(rows, values, references, coding);
  encoded.variable = summaryOf(values, border_codes);
  encoded.variable.values = extentOf(encoded.bytes);
  return encoded;
}

void checkCount(const Brick& brick) {
  const auto& at = brick.cell.at;
  if (brick.splats == 0 || brick.splats > kMaxBrickSplats || brick.cell.level > kMaxLevel)
    throw Error("the brick of level {}, cell {} {} {} has {} splats (expected 1 to {})", brick.cell.level,
                at[0], at[1], at[2], brick.splats, kMaxBrickSplats);
}

/// Calls `decode` and prefixes its errors with the brick's cell.
template <typename Decode>
void decodeNaming(const Brick& brick, const char* stream, Decode decode) {
  checkCount(brick);
  const auto& at = brick.cell.at;
  try {
    decode();
  } catch (const Error& error) {
    throw Error("the {} of the brick of level {}, cell {} {} {}, {} splats, cannot be decoded: {}", stream,
                brick.cell.level, at[0], at[1], at[2], brick.splats, error.what());
  }
}

/// Centres of the position intervals, relative to the cell's minimum corner. `inside`: the largest float
/// inside the cell, because rounding must not move a splat out of its cell.
void toCoordinates(const std::vector<uint32_t>& from, double interval, float inside, float* to) {
  const uint32_t* f = from.data();
  for (size_t n = 0; n < from.size(); ++n)
    to[n] = std::min(static_cast<float>((f[n] + 0.5) * interval), inside);
}

}  // namespace

EncodedBrick encodeBrick(const RootCube& root, BrickSplats& brick, std::span<const ValueCoding> codings) {
  checkInput(brick);
  DecodedGeometry& decoded = scratchGeometry();
  EncodedBrick encoded;
  encoded.geometry = encodeGeometryStream(root, brick, decoded);
  fillGeometry(root, decoded, brick);
  encoded.brick = summaryOf(root, brick);
  encoded.brick.geometry = extentOf(encoded.geometry);
  for (const Splat& splat : brick.splats) encoded.weight += splat.weight;
  for (size_t v = 0; v < brick.variables.size(); ++v) {
    EncodedValues of_variable = encodeInRows(decoded.rows, brick.border_codes, brick.variables[v], {},
                                             codings.empty() ? ValueCoding() : codings[v]);
    encoded.values.push_back(std::move(of_variable.bytes));
    encoded.variables.push_back(of_variable.variable);
  }
  return encoded;
}

EncodedValues encodeValues(std::span<const NodeRun> runs, std::span<const uint32_t> border_codes,
                           std::span<SplatScalar> values, const TimeReferences& references,
                           const ValueCoding& coding) {
  return encodeInRows(rowsOf(runs, values.size()), border_codes, values, references, coding);
}

void decodeGeometry(const RootCube& root, const Brick& brick, std::span<const std::byte> bytes,
                    const GeometryArrays<float>& out) {
  CURVISPLAT_CHECK_OP(out.size(), ==, brick.splats);
  DecodedPlaces& decoded = scratchGeometry();
  const ShapeArrays<float> shapes{
      {out.axis0, out.axis1, out.axis2}, {out.shear10, out.shear20, out.shear21}, out.weight};
  decodeNaming(brick, "geometry",
               [&] { decodeGeometryStream(brick.cell, brick.splats, bytes, decoded, shapes); });
  const double size = root.cellSize(brick.cell.level);
  const double interval = std::ldexp(size, -decoded.position_bits);
  const float rounded = static_cast<float>(size);
  const float inside = rounded < size ? rounded : std::nextafter(rounded, 0.0f);
  toCoordinates(decoded.position[0], interval, inside, out.x);
  toCoordinates(decoded.position[1], interval, inside, out.y);
  toCoordinates(decoded.position[2], interval, inside, out.z);
  std::copy(decoded.border_code.begin(), decoded.border_code.end(), out.border_code);
  std::copy(decoded.growth_code.begin(), decoded.growth_code.end(), out.growth_code);
}

void decodeGeometry(const RootCube& root, const Brick& brick, std::span<const std::byte> bytes,
                    SplatGeometry& out, std::vector<NodeRun>* runs) {
  checkCount(brick);
  out.resize(brick.splats);
  decodeGeometry(root, brick, bytes, arraysOf(out));
  if (runs) *runs = scratchGeometry().runs;
}

void decodeVariable(const Brick& brick, std::span<const std::byte> bytes, const VariableArrays<float>& out,
                    const TimeReferences& references) {
  CURVISPLAT_CHECK_OP(out.size(), ==, brick.splats);
  decodeNaming(brick, "values", [&] { decodeValuesStream(brick.splats, bytes, out, references); });
}

void decodeVariable(const Brick& brick, const BrickVariable&, std::span<const std::byte> bytes,
                    SplatVariable& out) {
  checkCount(brick);
  out.resize(brick.splats);
  decodeVariable(brick, bytes, arraysOf(out));
}

BrickSplats decodeForMerging(const RootCube& root, const Brick& brick, std::span<const std::byte> geometry,
                             std::span<const BrickVariable> variables,
                             std::span<const std::vector<std::byte>> values) {
  CURVISPLAT_CHECK_OP(variables.size(), ==, values.size());
  BrickSplats out;
  decodeForMerging(root, brick, geometry, out);
  SplatVariable variable;
  for (size_t v = 0; v < values.size(); ++v) {
    decodeVariable(brick, variables[v], values[v], variable);
    auto& to = out.variables.emplace_back(brick.splats);
    for (size_t n = 0; n < to.size(); ++n)
      to[n] = {variable.mean[n],
               {variable.slope0[n], variable.slope1[n], variable.slope2[n]},
               variable.variance[n]};
  }
  return out;
}

void decodeForMerging(const RootCube& root, const Brick& brick, std::span<const std::byte> geometry,
                      BrickSplats& out) {
  DecodedGeometry& decoded = scratchGeometry();
  decodeNaming(brick, "geometry", [&] { decodeGeometryStream(brick.cell, brick.splats, geometry, decoded); });
  out.cell = brick.cell;
  out.runs = decoded.runs;
  out.positions.resize(brick.splats);
  out.splats.resize(brick.splats);
  fillGeometry(root, decoded, out);
  out.border_codes = decoded.border_code;
  out.growth_codes = decoded.growth_code;
  out.variables.clear();
}

}  // namespace curvisplat
