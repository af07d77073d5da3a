// What processes have noted of their parts of a series, which join_series joins: one record, or two of them, beside caches that are
// as they should be.
//
//   length u16 | record of part 1 | record of part 2, if there is more
#include <fmt/format.h>

#include <string>

#include "preprocess/addition/join_series.h"
#include "stream/base/check.h"
#include "stream/base/error.h"
#include "stream/cache/cache_reader.h"
#include "tests/fuzz/fuzz_target.h"

namespace curvisplat {
namespace {

namespace fs = std::filesystem;

fs::path foldersOfParts(uint64_t parts) {
  return fuzzFolder() / fmt::format("a{}.parts", parts);
}

/// Folders of one part and of two. Each part is the whole series.
bool copyCaches() {
  const fs::path from = fs::path(CURVISPLAT_TEST_DATA) / "caches" / "version_2" / "series.splats";
  for (const uint64_t parts : {1, 2}) {
    fs::create_directory(foldersOfParts(parts));
    for (uint64_t n = 0; n < parts; ++n)
      fs::copy(from, partCache(foldersOfParts(parts), {n, parts}), fs::copy_options::recursive);
  }
  return true;
}

void fuzzPartRecord(std::span<const std::byte> bytes) {
  [[maybe_unused]] static const bool copied = copyCaches();
  FuzzInput input(bytes);
  const auto first = input.takeBytes(input.take<uint16_t>());
  const std::string folder = foldersOfParts(input.rest().empty() ? 1 : 2).filename().string();
  fuzzFile(folder + (input.rest().empty() ? "/1of1.json" : "/1of2.json"), first);
  if (!input.rest().empty()) fuzzFile(folder + "/2of2.json", input.rest());
  const fs::path joined = fuzzFolder() / "joined.splats";
  Progress progress;
  const JoinReport report = joinParts({fuzzFolder() / folder, joined, true}, progress);
  CURVISPLAT_CHECK_OP(CacheReader(joined).series().steps.size(), ==, report.steps);
}

const RegisteredFuzzTarget part_record_target("part_record", fuzzPartRecord);

}  // namespace
}  // namespace curvisplat
