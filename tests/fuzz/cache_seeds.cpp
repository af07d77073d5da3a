#include "tests/fuzz/seeds.h"

#include <fmt/format.h>
#include <zstd.h>

#include <array>
#include <random>
#include <tuple>
#include <utility>

#include "preprocess/convert/conversion_journal.h"
#include "stream/cache/cache_format.h"
#include "stream/cache/faces_file.h"
#include "stream/cache/partial_folder.h"
#include "stream/cache/series.h"
#include "stream/codec/face_codec.h"
#include "stream/codec/geometry_codec.h"
#include "stream/codec/values_codec.h"
#include "stream/model/border_code.h"
#include "stream/model/thin_walls.h"
#include "tests/support/temporary_folder.h"
#include "tests/support/test_caches.h"
namespace curvisplat {
namespace {

namespace fs = std::filesystem;

/// A stream's header, and what its zstd frame holds.
std::string unpacked(std::span<const std::byte> stream, size_t header_bytes) {
  const auto frame = stream.subspan(header_bytes);
  std::string out(ZSTD_getFrameContentSize(frame.data(), frame.size()), '\0');
  ZSTD_decompress(out.data(), out.size(), frame.data(), frame.size());
  return std::string(reinterpret_cast<const char*>(stream.data()), header_bytes) + out;
}

const glm::dvec3 kInward[] = {{0, 0.6, 0.8}, {1, 0, 0}, {0, 0.8, -0.6}};

void addHalfCells(BrickSplats& brick) {
  brick.border_codes.assign(brick.size(), kNoBorder);
  for (size_t n = 0; n < brick.size(); n += 3)
    brick.border_codes[n] = packBorderCode({kInward, 1 + n / 3 % 3});
}

void writeStreams(const Seeds& seeds) {
  const RootCube root{{-1, 2, 3}, 4};
  struct Kind {
    const char* name;
    RandomBrick like;
    uint8_t level;
  };
  RandomBrick leaf{.splats = 40, .unit = 4, .axis = 0.1};
  RandomBrick inner{.splats = 24, .unit = 4, .leaf = false};
  RandomBrick thin{.splats = 30, .unit = 4, .axis = 0.1, .aspect = 1e6};
  RandomBrick huge{.splats = 12, .unit = 4, .axis = 1e-200, .aspect = 1e100, .value = 1e30};
  for (const Kind& kind :
       {Kind{"leaf", leaf, 1}, {"inner", inner, 0}, {"thin", thin, 3}, {"raw", huge, 24}}) {
    const Cell cell{kind.level, {}};
    BrickSplats brick = randomBrick(kind.like, cell, 5);
    if (kind.like.leaf) addHalfCells(brick);
    const EncodedBrick encoded = encodeBrick(root, brick);
    const auto splats = static_cast<uint16_t>(kind.like.splats - 1);
    const auto whole = [&](uint8_t level, std::span<const std::byte> stream) {
      return Seed().add(splats).add(level).bytes(stream).whole();
    };
    seeds.write("packed_stream", fmt::format("geometry_{}", kind.name), whole(kind.level, encoded.geometry));
    seeds.write("packed_stream", fmt::format("values_{}", kind.name), whole(0x80, encoded.values.front()));
    seeds.write(
        "geometry_stream", kind.name,
        Seed().add(splats).add(kind.level).text(unpacked(encoded.geometry, sizeof(GeometryHeader))).whole());
    seeds.write("values_stream", kind.name,
                Seed().add(splats).text(unpacked(encoded.values.front(), sizeof(ValuesHeader))).whole());
  }
}

/// Writes values of a scalar that grows from step to step, as the second and third of a group are coded.
void writeValuesInTime(const Seeds& seeds) {
  constexpr uint16_t kSplats = 20;
  const auto valuesAt = [](double time) {
    std::vector<SplatScalar> values(kSplats);
    for (size_t n = 0; n < values.size(); ++n) {
      const auto at = static_cast<double>(n * n % 11);
      values[n] = {at + 0.1 * time, {at, 2 * at, 3 - time}, at * time};
    }
    return values;
  };
  std::array<std::string, 2> streams;
  std::array<SplatVariable, 2> decoded;
  TimeReferences references;
  Brick brick;
  brick.splats = kSplats;
  for (size_t n = 0; n < 2; ++n) {
    auto values = valuesAt(static_cast<double>(2 - n));
    const EncodedValues encoded = encodeValues({}, {}, values);
    streams[n] = unpacked(encoded.bytes, sizeof(ValuesHeader));
    decodeVariable(brick, encoded.variable, encoded.bytes, decoded[n]);
    references.values[n] = arraysOf(std::as_const(decoded[n]));
  }
  const auto length = [&](size_t n) { return static_cast<uint16_t>(streams[n].size()); };
  for (const ValuePrecision precision : {ValuePrecision::kNormal, ValuePrecision::kFine})
    for (const bool two : {false, true}) {
      references.steps_back = {1, static_cast<uint8_t>(two ? 2 : 0)};
      auto values = valuesAt(3);
      const EncodedValues encoded = encodeValues({}, {}, values, references, {precision});
      Seed seed;
      seed.add(static_cast<uint16_t>(kSplats - 1)).add(length(0)).add(two ? length(1) : uint16_t{0});
      seed.text(streams[0]).text(two ? streams[1] : "").text(unpacked(encoded.bytes, sizeof(ValuesHeader)));
      seeds.write(
          "values_in_time",
          fmt::format("{}_{}", two ? "two" : "one", precision == ValuePrecision::kFine ? "fine" : "normal"),
          seed.whole());
    }
}

void writeTables(const Seeds& seeds) {
  const TemporaryFolder folder;
  const fs::path path = folder / "small.splats";
  SmallCache cache;
  cache.write(path);
  seeds.write("manifest", "small", bytesOfFile(path / "manifest.json"));
  Manifest with_own_blanks = readManifest(path);
  with_own_blanks.requirements.push_back(kOwnBlanks);
  with_own_blanks.own_blanks = {{{"half", "quarter"}, 1}, {{"none"}, 2}};
  seeds.write("manifest", "own_blanks", with_own_blanks.toJson());
  with_own_blanks.requirements.insert(with_own_blanks.requirements.end(), {kOwnBlanksOfSteps, kSteps});
  seeds.write("manifest", "own_blanks_of_steps", with_own_blanks.toJson());
  const std::string bricks = bytesOfFile(path / "bricks.bin"), values = bytesOfFile(path / "var.0.bin");
  const size_t count = (bricks.size() - sizeof(BricksHeader)) / sizeof(BrickRecord);
  const size_t table = values.size() - count * sizeof(VariableRecord);
  std::string records;
  for (size_t n = 0; n < count; ++n)
    records += bricks.substr(sizeof(BricksHeader) + n * sizeof(BrickRecord), sizeof(BrickRecord)) +
               values.substr(table + n * sizeof(VariableRecord), sizeof(VariableRecord));
  for (const uint8_t flags : {2, 3, 6, 10, 14, 26, 18}) {
    Seed seed;
    seed.add(flags).add(cache.root.min).add(cache.root.size).add(uint32_t{1 << 19});
    if (flags & 1) seed.text(bricks.substr(0, sizeof(BricksHeader)));
    seeds.write("brick_table", fmt::format("flags_{}", flags), seed.text(records).whole());
  }
}

/// A face of 5 x 3 nodes in two levels, with a hole, two scalars and a name.
void writeFaces(const Seeds& seeds) {
  const TemporaryFolder folder;
  const fs::path path = folder / "faces.bin";
  FacesWriter writer(path, FaceBox::of(glm::dvec3(-1), glm::dvec3(1)), {0, 3});
  std::vector<FacePatch> patches;
  for (const auto& [stride, columns, first] : {std::tuple(2u, 3u, 0u), {1u, 3u, 0u}, {1u, 3u, 2u}}) {
    FacePatch patch;
    patch.first = {first, 0};
    patch.stride = {stride, 1};
    patch.nodes = {static_cast<uint16_t>(columns), 3};
    patch.lower = glm::dvec3(-1);
    patch.upper = glm::dvec3(1);
    PatchLattice lattice;
    lattice.columns = static_cast<uint16_t>(columns);
    lattice.rows = 3;
    lattice.scalars.resize(2);
    for (uint32_t v = 0; v < 3; ++v)
      for (uint32_t u = 0; u < columns; ++u) {
        const uint32_t at = first + u * stride;
        lattice.codes[0].push_back(at * (FaceBox::kSteps / 4));
        lattice.codes[1].push_back(v * (FaceBox::kSteps / 2));
        lattice.codes[2].push_back(at * v * 1000);
        lattice.scalars[0].push_back(static_cast<float>(at) + 0.25f * static_cast<float>(v));
        lattice.scalars[1].push_back(7);
      }
    lattice.quads.assign(4, 1);
    lattice.quads[1] = 0;
    patch.extent = writer.append(encodePatch(lattice));
    patches.push_back(patch);
  }
  patches[0].first_child = 1;
  patches[0].child_count = 2;
  patches[0].error = 1;
  GridFace face;
  face.nodes = {5, 3};
  face.root = 0;
  const FaceRegion region{0, {1, 0}, {3, 2}, "Wing", "BCWall"};
  writer.finish({&face, 1}, {&patches, 1}, {&region, 1});
  seeds.write("faces", "two_levels", bytesOfFile(path));
}

void writeBrickLog(const Seeds& seeds) {
  const RootCube root{{-1, 2, 3}, 4};
  for (const uint8_t variables : {0, 2}) {
    std::string log, streams;
    for (int octant = 0; octant < 2; ++octant) {
      BrickSplats brick =
          randomBrick({.splats = 6, .unit = 4, .variables = variables}, Cell{}.child(octant), 7);
      EncodedBrick encoded = encodeBrick(root, brick);
      const auto place = [&](Extent& extent, const std::vector<std::byte>& bytes) {
        extent.offset = streams.size();
        streams += Seed().bytes(bytes).whole();
      };
      place(encoded.brick.geometry, encoded.geometry);
      Seed entry;
      entry.add(recordOf(encoded.brick)).add(encoded.weight);
      for (size_t v = 0; v < variables; ++v) {
        place(encoded.variables[v].values, encoded.values[v]);
        entry.add(recordOf(encoded.variables[v]));
      }
      log += entry.whole();
    }
    const auto log_bytes = static_cast<uint16_t>(log.size());
    seeds.write("brick_log", fmt::format("variables_{}", variables),
                Seed().add(variables).add(log_bytes).text(log).text(streams).whole());
  }
}

void writeJournals(const Seeds& seeds) {
  const TemporaryFolder folder;
  ConversionJournal journal{
      {{"the program", "test"}, {"file 1", "a b%\xff.xyz"}}, "/tmp/a.tmp.1", std::nullopt};
  const auto write = [&](const char* name) {
    writeJournal(folder.path(), journal);
    const std::string bytes = bytesOfFile(folder / kJournalName);
    seeds.write("journal", name, bytes.substr(0, bytes.find('\n')));
  };
  write("begun");
  ScatteredSplats splats;
  splats.survey = {24, {1, 2, 3, {}}, {0, 0, 0}, {1, 2, 3}, {{0, 1}}};
  splats.tree.split(
      0, [](const Cell& cell) { return cell.at[0] == 0 ? 100 : 1; }, 50, 2);
  const auto leaves = splats.tree.leavesBelow(0);
  const uint32_t buckets = splats.tree.assignBuckets(
      leaves, [](uint32_t) { return 10; }, 40);
  std::vector<CellContents> contents(splats.tree.size());
  contents[leaves.front()].add({{1, 2, 3}});
  splats.tree.setContents(leaves, contents);
  splats.buckets = {4096, 8192, {{{0, 4096, UINT64_MAX, UINT64_MAX}, 100}, {{8192}, 200}}};
  splats.buckets.chains.resize(buckets);
  journal.splats = splats;
  write("scattered");
}

void writeThinWalls(const Seeds& seeds) {
  const auto write = [&](const char* name, const std::vector<std::array<uint8_t, 3>>& blocks,
                         const std::vector<WallSide>& boxes) {
    Seed seed;
    seed.add(static_cast<uint8_t>(blocks.size() - 1));
    for (const auto& dims : blocks)
      for (const uint8_t n : dims) seed.add(static_cast<uint8_t>(n - 2));
    seeds.write("thin_walls", name, seed.bytes(std::as_bytes(std::span(boxes))).whole());
  };
  write("plate", {{7, 5, 4}}, {{0, 1, {2, 0, 0}, {5, 0, 3}}});
  write("overlapping", {{7, 5, 4}, {3, 3, 3}},
        {{0, 1, {0, 0, 0}, {4, 1, 1}}, {0, 2, {2, 1, 1}, {6, 2, 3}}, {1, 3, {0, 0, 0}, {0, 2, 2}}});
  write("beyond", {{4, 4, 4}}, {{0, 1, {2, 2, 2}, {UINT64_MAX, UINT64_MAX, UINT64_MAX}}});
}

void writeSplats(const Seeds& seeds) {
  std::mt19937 random(3);
  std::uniform_real_distribution<float> unit(0, 1);
  for (const uint8_t flags : {0, 1, 2, 5, 16, 53}) {
    Seed seed;
    seed.add(flags).add(glm::dvec3(-1, 2, 3)).add(glm::dvec3(1, 1, flags == 5 ? 50 : 1)).add(4.0);
    for (int n = 0; n < 12; ++n) {
      for (int c = 0; c < 3; ++c) seed.add(4 * unit(random));
      for (int c = 0; c < 3; ++c) seed.add(0.3f * unit(random));
      for (int c = 0; c < 3; ++c) seed.add(unit(random) - 0.5f);
      seed.add(0.1f * unit(random));
      const uint32_t face = flags >= 16 ? 1 : 0;  // the first border is one to cut at
      seed.add(n % 3 == 0 ? packBorderCode({&kInward[0], 1 + static_cast<size_t>(n) / 3 % 3}, face)
                          : kNoBorder);
      seed.add(unit(random));
      for (int c = 0; c < 3; ++c) seed.add(0.1f * unit(random));
      seed.add(0.01f * unit(random));
    }
    seeds.write("picture", fmt::format("flags_{}", flags), seed.whole());
  }
}

}  // namespace

void writeCacheSeeds(const Seeds& seeds) {
  writeStreams(seeds);
  writeValuesInTime(seeds);
  writeTables(seeds);
  writeFaces(seeds);
  writeBrickLog(seeds);
  writeJournals(seeds);
  writeThinWalls(seeds);
  writeSplats(seeds);
}

}  // namespace curvisplat
