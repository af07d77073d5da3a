// bricks.bin and a var.<n>.bin, with the cut through what they say. Sums and checksums, which whoever makes a
// cache can compute, are made right here.
//
//   flags u8 | lowest corner and size of the root, doubles | size of geometry.bin u32 | [header of
//   bricks.bin] | (BrickRecord, VariableRecord) x bricks
#include <cmath>
#include <fstream>

#include "render/project/screen_view.h"
#include "stream/base/checksum.h"
#include "stream/base/error.h"
#include "stream/cache/cache_format.h"
#include "stream/cache/cache_index.h"
#include "stream/cache/stream_file.h"
#include "stream/paging/cut.h"
#include "tests/fuzz/fuzz_target.h"

namespace curvisplat {
namespace {

enum TableFlags : uint8_t { kOwnHeader = 1, kDisjoint = 2, kFullOctants = 4, kPerspective = 8, kLimits = 16 };

struct Tables {
  std::vector<BrickRecord> bricks;
  std::vector<VariableRecord> variables;
};

/// Links and cells are left to the input; these would hardly ever be right.
void mend(Tables& tables, uint8_t flags) {
  uint64_t geometry = 0, values = sizeof(VariableHeader);
  for (size_t n = 0; n < tables.bricks.size(); ++n) {
    BrickRecord& brick = tables.bricks[n];
    if (flags & kFullOctants) {
      brick.splats = 1 + (brick.splats - 1) % kMaxBrickSplats;
      uint32_t left = brick.splats;
      for (uint32_t& octant : brick.octant_splats) left -= octant = std::min(octant, left);
      brick.octant_splats[7] += left;
    }
    if (flags & kDisjoint) {
      brick.geometry_length = 1 + brick.geometry_length % 999;
      brick.geometry_offset = std::exchange(geometry, geometry + brick.geometry_length);
      tables.variables[n].length = 1 + tables.variables[n].length % 999;
      tables.variables[n].offset = std::exchange(values, values + tables.variables[n].length);
    }
  }
}

/// A manifest that fits these tables.
Manifest manifestOf(const Tables& tables, const RootCube& root, uint64_t bricks) {
  Manifest manifest;
  manifest.root = root;
  manifest.bricks = bricks;
  for (const BrickRecord& brick : tables.bricks) manifest.splats += brick.child_count == 0 ? brick.splats : 0;
  if (!tables.bricks.empty()) manifest.levels = tables.bricks.back().level + 1;
  manifest.variables = {{0, "f", "", 0, 1}};
  manifest.steps = {{0, "geometry.bin", {0}}};
  return manifest;
}

void writeTables(const Tables& tables, const BricksHeader& header, uint64_t geometry_bytes,
                 Manifest& manifest) {
  Checksum of_bricks, of_variables, of_geometry;
  const auto write = [](const char* name, Checksum& checksum, const auto& head, const auto& records,
                        uint64_t table_offset) {
    checksum.add(bytesOf(head));
    checksum.add(bytesOf(records));
    std::vector<std::byte> bytes(table_offset);
    std::memcpy(bytes.data(), &head, sizeof head);
    const auto table = bytesOf(records);
    bytes.insert(bytes.end(), table.begin(), table.end());
    fuzzFile(name, bytes);
    return FileInfo{name, bytes.size(), checksum.value()};
  };
  manifest.files.push_back(write("bricks.bin", of_bricks, header, tables.bricks, sizeof header));
  VariableHeader values;
  values.record_bytes = sizeof(VariableRecord);
  values.bricks = tables.variables.size();
  values.table_offset = sizeof values;
  for (const VariableRecord& record : tables.variables)
    if (record.length < 1000) values.table_offset += record.length;
  manifest.files.push_back(write("var.0.bin", of_variables, values, tables.variables, values.table_offset));
  fuzzFile("geometry.bin", {});
  std::filesystem::resize_file(fuzzFolder() / "geometry.bin", geometry_bytes);
  std::vector<Brick> bricks;
  for (const BrickRecord& record : tables.bricks) bricks.push_back(brickOf(record));
  manifest.files.push_back({"geometry.bin", geometry_bytes, geometryChecksum(bricks)});
}

void checkCut(const CutTree& tree, const CutView& view, const CutOptions& options) {
  const auto opaque = [](const ValueBounds& values) { return values.max < 0; };
  const Cut cut = chooseCut(tree, view, opaque, options);
  uint64_t splats = 0;
  for (const BrickPart& part : cut.parts) {
    CURVISPLAT_CHECK_OP(part.brick, <, tree.bricks.size());
    splats += SplatRanges(tree.bricks[part.brick], part.octants).splats();
  }
  CURVISPLAT_CHECK_OP(splats, ==, cut.splats);
}

void fuzzBrickTable(std::span<const std::byte> bytes) {
  FuzzInput input(bytes);
  const auto flags = input.take<uint8_t>();
  RootCube root;
  for (int axis = 0; axis < 3; ++axis) root.min[axis] = input.take<double>();
  root.size = input.take<double>();
  constexpr double kLargest = 1e100;
  const bool possible = std::abs(root.min.x) <= kLargest && std::abs(root.min.y) <= kLargest &&
                        std::abs(root.min.z) <= kLargest && root.size > 0 && root.size <= kLargest;
  if (!possible) return;  // the manifest's affair
  const uint64_t geometry_bytes = input.take<uint32_t>() % (1 << 20);
  BricksHeader header;
  if (flags & kOwnHeader) header = input.take<BricksHeader>();
  Tables tables;
  while (input.rest().size() >= sizeof(BrickRecord)) {
    tables.bricks.push_back(input.take<BrickRecord>());
    tables.variables.push_back(input.take<VariableRecord>());
  }
  if (!(flags & kOwnHeader)) {
    header.record_bytes = sizeof(BrickRecord);
    header.bricks = tables.bricks.size();
  }
  mend(tables, flags);
  Manifest manifest = manifestOf(tables, root, header.bricks);
  if (manifest.bricks == 0) return;  // so too
  writeTables(tables, header, geometry_bytes, manifest);

  const std::vector<Brick> bricks = readBricks(fuzzFolder(), manifest);
  const InputFile values(fuzzFolder() / "var.0.bin");
  const std::vector<BrickVariable> variables = readVariableTable(values, checkFile(values, manifest), bricks);
  const std::vector<ValueBounds> subtrees = subtreeBounds(bricks, variables);
  const CutTree tree{root, bricks, variables, subtrees};
  const Camera camera =
      Camera::named("iso", root.min, root.min + root.size, {40, 30},
                    flags & kPerspective ? Projection::kPerspective : Projection::kOrthographic);
  const CutView view = ScreenView::of(camera, {40, 30}, glm::dvec3(1), kLowPass, 1e-4 * root.size).cutView();
  checkCut(tree, view, {});
  if (flags & kLimits) checkCut(tree, view, {.lod_pixels = 0, .max_splats = 200, .max_bytes = 3000});
}

const RegisteredFuzzTarget brick_table_target("brick_table", fuzzBrickTable);

}  // namespace
}  // namespace curvisplat
