// Files of a cache: its manifest, its time steps, the log of a conversion that was interrupted, and its
// faces.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstring>

#include "stream/base/checksum.h"
#include "stream/base/error.h"
#include "stream/cache/cache_format.h"
#include "stream/cache/cache_writer.h"
#include "stream/cache/faces_file.h"
#include "stream/cache/manifest.h"
#include "stream/cache/partial_folder.h"
#include "stream/cache/series.h"
#include "stream/cache/stream_file.h"
#include "tests/fuzz/fuzz_target.h"

namespace curvisplat {
namespace {

// manifest.json. What is read is written and read again as the same.
void fuzzManifest(std::span<const std::byte> bytes) {
  const Manifest manifest = Manifest::fromJson(std::string(textOf(bytes)), "manifest.json");
  const std::string text = manifest.toJson();
  const std::string again = Manifest::fromJson(text, "again.json").toJson();
  CURVISPLAT_CHECK(text == again);
}

const RegisteredFuzzTarget manifest_target("manifest", fuzzManifest);

// steps.bin, the time steps of a cache; the manifest's entry of it is made right here. A byte with the number of
// variables, and the file. What is read is in the order of time, and each step's geometry is there.
void fuzzSteps(std::span<const std::byte> bytes) {
  FuzzInput input(bytes);
  Manifest manifest;
  manifest.variables.resize(1 + input.take<uint8_t>() % 4);
  fuzzFile(kStepsFileName, input.rest());
  manifest.files.push_back({kStepsFileName, input.rest().size(), checksumOf(input.rest())});
  manifest.requirements = {"steps"};
  const Series series = readSeries(fuzzFolder(), manifest);
  for (size_t step = 0; step < series.steps.size(); ++step) {
    const SeriesStep& of = series.steps[step];
    CURVISPLAT_CHECK(of.geometry < series.geometries());
    CURVISPLAT_CHECK(std::isfinite(of.time));
    if (step > 0) CURVISPLAT_CHECK(of.time > series.steps[step - 1].time);
    CURVISPLAT_CHECK_OP(series.nearest(of.time), <, series.steps.size());
    CURVISPLAT_CHECK(!stepValuesName(series, step, 0).empty());
  }
}

const RegisteredFuzzTarget steps_target("steps", fuzzSteps);

uint64_t checksumIn(std::span<const std::byte> file, uint64_t offset, uint64_t length) {
  if (offset > file.size() || length > file.size() - offset) return 0;
  return checksumOf(file.subspan(offset, length));
}

std::vector<std::byte> logOf(std::span<const std::byte> bytes, size_t variables,
                             std::span<const std::byte> streams) {
  std::vector<std::byte> log;
  FuzzInput input(bytes);
  while (!input.rest().empty()) {
    const size_t begin = log.size();
    const auto put = [&](const auto& value) {
      const auto added = bytesOf(value);
      log.insert(log.end(), added.begin(), added.end());
    };
    auto brick = input.take<BrickRecord>();
    brick.geometry_checksum = checksumIn(streams, brick.geometry_offset, brick.geometry_length);
    put(brick);
    put(input.take<double>());
    for (size_t v = 0; v < variables; ++v) {
      auto values = input.take<VariableRecord>();
      values.checksum = checksumIn(streams, values.offset, values.length);
      put(values);
    }
    put(checksumOf(std::span(log).subspan(begin)));
  }
  return log;
}

// The leavings of an interrupted conversion: its log of bricks and their streams. Checksums are made right
// here.
//
//   variables u8 | bytes of the log u16 | log without checksums | bytes of the files of streams
void fuzzBrickLog(std::span<const std::byte> bytes) {
  FuzzInput input(bytes);
  const size_t variables = input.take<uint8_t>() % 3;
  const auto entries = input.takeBytes(input.take<uint16_t>());
  const std::filesystem::path target = fuzzFolder() / "a.splats";
  std::filesystem::create_directories(target.string() + ".partial");
  fuzzFile(fmt::format("a.splats.partial/{}", kPartialLock), std::as_bytes(std::span(kPartialMark)));
  fuzzFile("a.splats.partial/bricks.log", logOf(entries, variables, input.rest()));
  fuzzFile("a.splats.partial/geometry.bin", input.rest());
  std::vector<VariableInfo> infos;
  for (uint32_t v = 0; v < variables; ++v) {
    infos.push_back({v, fmt::format("f{}", v), "", 0, 1});
    fuzzFile(fmt::format("a.splats.partial/var.{}.bin", v), input.rest());
  }

  PartialFolder folder(target, false, PartialFolder::Rest::kKeep);
  Progress progress;
  const CacheWriter writer(folder, {{-1, 2, 3}, 4}, infos, progress);
  for (uint64_t id = 0; id < writer.bricks().size(); ++id) writer.readBack(id);
}

const RegisteredFuzzTarget brick_log_target("brick_log", fuzzBrickLog);

/// The checksum that a manifest would have; 0 where there is no table. Puts those of streams into the table.
uint64_t makeRight(std::vector<std::byte>& file) {
  FacesHeader header;
  if (file.size() < sizeof header) return 0;
  std::memcpy(&header, file.data(), sizeof header);
  if (header.table_offset > file.size()) return 0;
  const uint64_t patches = header.table_offset + uint64_t{header.variables} * sizeof(uint32_t) +
                           uint64_t{header.faces} * sizeof(FaceRecord);
  for (uint64_t n = 0; n < header.patches; ++n) {
    const uint64_t at = patches + n * sizeof(PatchRecord);
    if (at + sizeof(PatchRecord) > file.size()) break;
    PatchRecord record;
    std::memcpy(&record, file.data() + at, sizeof record);
    if (record.offset > file.size() || record.length > file.size() - record.offset) continue;
    record.checksum = checksumOf(std::span(file).subspan(record.offset, record.length));
    std::memcpy(file.data() + at, &record, sizeof record);
  }
  Checksum checksum;
  checksum.add(std::span(file).first(sizeof header));
  checksum.add(std::span(file).subspan(header.table_offset));
  return checksum.value();
}

// A file of faces: the bytes of faces.bin. Checksums are made right here, of the table and of the streams
// that it names.
void fuzzFaces(std::span<const std::byte> bytes) {
  std::vector<std::byte> file(bytes.begin(), bytes.end());
  const uint64_t checksum = makeRight(file);
  Manifest manifest;
  manifest.files = {{kFacesFileName, file.size(), checksum}};
  fuzzFile(kFacesFileName, file);
  const auto faces = FacesReader::open(fuzzFolder(), manifest);
  for (uint32_t n = 0; n < faces->patches().size(); ++n) {
    const FacePatch& patch = faces->patches()[n];
    const PatchNodes nodes = faces->read(n);
    CURVISPLAT_CHECK_OP(nodes.positions.size(), ==, patch.nodeCount());
    CURVISPLAT_CHECK_OP(nodes.quads.size(), ==, patch.quadCount());
    for (const glm::dvec3& at : nodes.positions)
      CURVISPLAT_CHECK(std::isfinite(at.x) && std::isfinite(at.y) && std::isfinite(at.z));
    for (const std::vector<float>& scalar : nodes.scalars)
      for (const float value : scalar) CURVISPLAT_CHECK(std::isfinite(value));
  }
}

const RegisteredFuzzTarget faces_target("faces", fuzzFaces);

}  // namespace
}  // namespace curvisplat
