#include "stream/codec/face_codec.h"

#include <algorithm>
#include <cmath>
#include <cstring>

#include "stream/base/error.h"
#include "stream/codec/prediction.h"

namespace curvisplat {
namespace {

constexpr double kScalarSteps = 65535;

/// Each row of nodes has the one before it above.
std::vector<Row> latticeRows(uint32_t columns, uint32_t rows) {
  std::vector<Row> out;
  for (uint32_t v = 0; v < rows; ++v)
    out.push_back({v * columns, columns, v == 0 ? kNoRow : (v - 1) * columns});
  return out;
}

ArrayCode add(PlaneWriter& planes, std::span<const Row> rows, std::span<const uint32_t> values) {
  ArrayCode code;
  code.predictor = bestPredictor(rows, values).predictor;
  std::vector<uint32_t> residuals(values.size());
  predictRows(code.predictor, rows, values.data(), [&](uint32_t n, uint32_t predicted) {
    residuals[n] = zigzag(values[n] - predicted);
    return values[n];
  });
  code.planes = planes.add(residuals);
  return code;
}

void take(PlaneReader& planes, ArrayCode code, std::span<const Row> rows, std::span<uint32_t> values) {
  std::vector<uint32_t> residuals(values.size());
  planes.values(code.planes, residuals);
  predictRows(code.predictor, rows, values.data(),
              [&](uint32_t n, uint32_t predicted) { return values[n] = unzigzag(residuals[n]) + predicted; });
}

size_t quadBytes(size_t quads) {
  return (quads + 7) / 8;
}

}  // namespace

std::vector<std::byte> encodePatch(const PatchLattice& patch) {
  const size_t nodes = size_t{patch.columns} * patch.rows;
  const size_t quads = size_t{patch.columns - 1u} * (patch.rows - 1u);
  CURVISPLAT_CHECK_OP(patch.quads.size(), ==, quads);
  const std::vector<Row> rows = latticeRows(patch.columns, patch.rows);
  PlaneWriter planes;
  std::vector<std::byte> bits(quadBytes(quads));
  for (size_t n = 0; n < quads; ++n)
    if (patch.quads[n]) bits[n / 8] |= std::byte{1} << (n % 8);
  planes.addBytes(bits);
  PatchHeader header;
  header.nodes_u = patch.columns;
  header.nodes_v = patch.rows;
  header.variables = static_cast<uint32_t>(patch.scalars.size());
  for (size_t axis = 0; axis < 3; ++axis) {
    CURVISPLAT_CHECK_OP(patch.codes[axis].size(), ==, nodes);
    header.arrays[axis] = add(planes, rows, patch.codes[axis]);
  }
  std::vector<PatchScalar> scalars;
  std::vector<uint32_t> codes(nodes);
  for (const std::vector<float>& values : patch.scalars) {
    const auto [lower, upper] = std::minmax_element(values.begin(), values.end());
    PatchScalar& scalar = scalars.emplace_back(PatchScalar{*lower, *upper, {}, 0});
    const double width = double{*upper} - double{*lower};
    for (size_t n = 0; n < nodes; ++n)
      codes[n] = width > 0 ? static_cast<uint32_t>(
                                 std::lround((double{values[n]} - double{*lower}) / width * kScalarSteps))
                           : 0;
    scalar.array = add(planes, rows, codes);
  }
  std::vector<std::byte> before(sizeof header + scalars.size() * sizeof(PatchScalar));
  std::memcpy(before.data(), &header, sizeof header);
  if (!scalars.empty())
    std::memcpy(before.data() + sizeof header, scalars.data(), scalars.size() * sizeof(PatchScalar));
  return planes.compress(before);
}

PatchNodes decodePatch(const FacePatch& patch, size_t variables, const FaceBox& box,
                       std::span<const std::byte> bytes) {
  const size_t nodes = patch.nodeCount(), quads = patch.quadCount();
  const size_t before = sizeof(PatchHeader) + variables * sizeof(PatchScalar);
  if (bytes.size() < before)
    throw Error("a patch's stream is truncated (found {} bytes, expected at least {})", bytes.size(), before);
  PatchHeader header;
  std::memcpy(&header, bytes.data(), sizeof header);
  std::vector<PatchScalar> scalars(variables);
  if (variables > 0)
    std::memcpy(scalars.data(), bytes.data() + sizeof header, variables * sizeof(PatchScalar));
  if (header.nodes_u != patch.nodes[0] || header.nodes_v != patch.nodes[1] || header.variables != variables)
    throw Error("a patch's stream has {} x {} nodes and {} scalars; expected {} x {} and {}", header.nodes_u,
                header.nodes_v, header.variables, patch.nodes[0], patch.nodes[1], variables);
  bool possible = std::all_of(header.arrays.begin(), header.arrays.end(), isPossible);
  size_t planes_in_all = 0;
  for (const ArrayCode& code : header.arrays) planes_in_all += code.planes;
  for (const PatchScalar& scalar : scalars) {
    possible = possible && isPossible(scalar.array) && std::isfinite(scalar.lower) &&
               std::isfinite(scalar.upper) && scalar.lower <= scalar.upper;
    planes_in_all += scalar.array.planes;
  }
  if (!possible) throw Error("a patch's stream has an invalid array code or range");

  PlaneReader planes(bytes.subspan(before), quadBytes(quads) + planes_in_all * nodes);
  PatchNodes out;
  const std::span<const std::byte> bits = planes.bytes(quadBytes(quads));
  out.quads.resize(quads);
  for (size_t n = 0; n < quads; ++n)
    out.quads[n] = static_cast<uint8_t>(static_cast<unsigned>(bits[n / 8]) >> (n % 8) & 1u);
  const std::vector<Row> rows = latticeRows(patch.nodes[0], patch.nodes[1]);
  std::array<std::vector<uint32_t>, 3> codes;
  for (size_t axis = 0; axis < 3; ++axis) {
    codes[axis].resize(nodes);
    take(planes, header.arrays[axis], rows, codes[axis]);
  }
  out.positions.reserve(nodes);
  for (size_t n = 0; n < nodes; ++n) {
    if (std::max({codes[0][n], codes[1][n], codes[2][n]}) > FaceBox::kSteps)
      throw Error("a patch's stream has a node outside of the faces' box");
    out.positions.push_back(box.at({codes[0][n], codes[1][n], codes[2][n]}));
  }
  std::vector<uint32_t> values(nodes);
  for (const PatchScalar& scalar : scalars) {
    take(planes, scalar.array, rows, values);
    std::vector<float>& of_variable = out.scalars.emplace_back(nodes);
    const double width = double{scalar.upper} - double{scalar.lower};
    for (size_t n = 0; n < nodes; ++n)
      of_variable[n] = static_cast<float>(double{scalar.lower} +
                                          width * std::min<double>(values[n], kScalarSteps) / kScalarSteps);
  }
  return out;
}

}  // namespace curvisplat
