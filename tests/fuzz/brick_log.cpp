// What an interrupted conversion has left: its log of bricks and their streams. Checksums are made right
// here.
//
//   variables u8 | bytes of the log u16 | log without checksums | bytes of the files of streams
#include "stream/cache/brick_log.h"

#include <fmt/format.h>

#include "stream/base/checksum.h"
#include "stream/cache/cache_format.h"
#include "stream/cache/cache_writer.h"
#include "stream/cache/partial_folder.h"
#include "stream/cache/stream_file.h"
#include "tests/fuzz/fuzz_target.h"

namespace curvisplat {
namespace {

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

}  // namespace
}  // namespace curvisplat
