// Files that conversions leave on disk: journals, records of the parts of a series, and lists of thin walls.
#include <fmt/format.h>

#include <array>
#include <set>
#include <string>
#include <vector>

#include "preprocess/addition/join_series.h"
#include "preprocess/convert/conversion_journal.h"
#include "preprocess/seams/thin_walls.h"
#include "stream/base/checksum.h"
#include "stream/base/error.h"
#include "stream/cache/cache_reader.h"
#include "tests/fuzz/fuzz_target.h"

namespace curvisplat {
namespace {

namespace fs = std::filesystem;

// The journal of an unfinished conversion; its checksum is made right here.
void fuzzJournal(std::span<const std::byte> bytes) {
  std::string text(textOf(bytes));
  std::erase(text, '\n');
  text += "\n";
  text += fmt::format("{:016x}\n", checksumOf(std::as_bytes(std::span(text))));
  fuzzFile(kJournalName, std::as_bytes(std::span(text)));
  const std::optional<ConversionJournal> journal = readJournal(fuzzFolder());
  if (!journal || !journal->splats) return;
  const BucketTree& tree = journal->splats->tree;
  for (const uint32_t leaf : tree.leavesBelow(0)) CURVISPLAT_CHECK_OP(tree.nodeOf(tree[leaf].cell), ==, leaf);
  for (const uint64_t at : {uint64_t{0}, uint64_t{1} << 47, (uint64_t{1} << 48) - 1})
    CURVISPLAT_CHECK_OP(tree.leafOf({{at, at / 2, at / 3}}), <, tree.size());
}

const RegisteredFuzzTarget journal_target("journal", fuzzJournal);

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

// Notes of processes about their parts of a series, which join_series joins: one record, or two of them,
// beside caches that are as they should be.
//
//   length u16 | record of part 1 | record of part 2, if there is more
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

// walls.bin, the sides of thin walls, of a grid of one to three blocks. Each node has the side of a box that it lies in.
//
//   blocks u8 | ni nj nk u8 of each | the file
void fuzzThinWalls(std::span<const std::byte> bytes) {
  FuzzInput input(bytes);
  std::vector<GridBlock> blocks(1 + input.take<uint8_t>() % 3);
  for (GridBlock& block : blocks)
    for (uint64_t* const count : {&block.ni, &block.nj, &block.nk}) *count = 2 + input.take<uint8_t>() % 6;
  const ThinWalls walls = ThinWalls::read(input.rest(), blocks, "walls.bin");
  std::vector<WallSide> boxes(input.rest().size() / sizeof(WallSide));
  for (WallSide& box : boxes) box = input.take<WallSide>();
  uint64_t node = 0;
  for (uint32_t block = 0; block < blocks.size(); ++block)
    for (uint64_t n = 0; n < blocks[block].nodes(); ++n, ++node) {
      const uint64_t row = n / blocks[block].ni;
      const std::array<uint64_t, 3> at{n % blocks[block].ni, row % blocks[block].nj, row / blocks[block].nj};
      std::set<uint32_t> sides;
      for (const WallSide& box : boxes)
        if (box.block == block && at[0] >= box.first[0] && at[0] <= box.last[0] && at[1] >= box.first[1] &&
            at[1] <= box.last[1] && at[2] >= box.first[2] && at[2] <= box.last[2])
          sides.insert(box.side);
      CURVISPLAT_CHECK(sides.empty() ? walls.sideOf(node) == 0 : sides.contains(walls.sideOf(node)));
    }
}

const RegisteredFuzzTarget thin_walls_target("thin_walls", fuzzThinWalls);

}  // namespace
}  // namespace curvisplat
