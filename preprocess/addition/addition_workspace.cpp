#include "preprocess/addition/addition_workspace.h"

#include <fmt/format.h>

#include <algorithm>
#include <span>
#include <system_error>

#include "preprocess/convert/conversion_workspace.h"
#include "stream/base/checksum.h"
#include "stream/base/error.h"
#include "stream/base/file.h"
#include "stream/base/name_list.h"
#include "stream/base/text.h"

namespace curvisplat {

AdditionWorkspace::AdditionWorkspace(const std::filesystem::path& cache,
                                     const std::filesystem::path& temporary_folder, Ranks& ranks) {
  if (ranks.isFirst()) {
    lock_.emplace(cache);
    folder_ =
        std::make_unique<ScratchFolder>(newScratch(cache, temporary_folder), ScratchFolder::Folder::kMake);
    shared_ = folder_->path();
  }
  shared_ = sharedFolder(shared_, ranks);
  own_ = makeFolderOfRank(shared_, ranks);
}

AdditionWorkspace::~AdditionWorkspace() {
  if (!folder_) removeFolderOfRank(own_, shared_);
}

namespace {

/// The name of an addition's temporary folder, up to its process: for this cache alone, wherever it is.
std::string scratchName(const std::filesystem::path& cache) {
  const std::string place = std::filesystem::canonical(cache).string();
  return fmt::format("{}.add-{:016x}", ScratchFolder::beginOfName(cache),
                     checksumOf(std::as_bytes(std::span(place))));
}

constexpr size_t kNamesListed = 3;

/// Names in `some` that are not in `others`: " (without A, B and 2 more)"; empty if there are none.
template <typename Some, typename Others>
std::string lacking(const char* words, const std::vector<Some>& some, const std::vector<Others>& others) {
  std::vector<std::string> names;
  for (const Some& one : some)
    if (std::none_of(others.begin(), others.end(),
                     [&](const Others& other) { return other.name == one.name; }))
      names.push_back(one.name);
  if (names.empty()) return "";
  return fmt::format(" ({}{})", words, listed(names, kNamesListed));
}

}  // namespace

void checkBlocksOfStep(const std::vector<GridBlock>& grid, const Manifest& series) {
  const std::vector<BlockInfo>& blocks = series.blocks;
  constexpr const char* kAdvice =
      "a cache holds steps of the same blocks: convert the others to a cache of their own";
  if (grid.size() != blocks.size())
    throw Error("it has {}{}; the steps before it have {}{}; {}", countText(grid.size(), "block"),
                lacking("new: ", grid, blocks), blocks.size(), lacking("now gone: ", blocks, grid), kAdvice);
  for (size_t n = 0; n < blocks.size(); ++n) {
    const GridBlock& found = grid[n];
    const BlockInfo& expected = blocks[n];
    if (found.ni != expected.ni || found.nj != expected.nj || found.nk != expected.nk)
      throw Error("its block {} ({}) has {}x{}x{} nodes; in the steps before it {}x{}x{}; {}", n + 1,
                  found.name, found.ni, found.nj, found.nk, expected.ni, expected.nj, expected.nk, kAdvice);
  }
}

void checkBlocks(const std::vector<GridBlock>& grid, const CacheReader& cache) {
  const std::vector<BlockInfo>& blocks = cache.manifest().blocks;
  if (grid.size() != blocks.size())
    throw Error("{}: was made from a grid of {}; this grid has {} and is not the one the cache was made from",
                cache.path().string(), countText(blocks.size(), "block"), grid.size());
  for (size_t n = 0; n < blocks.size(); ++n) {
    const GridBlock& found = grid[n];
    const BlockInfo& expected = blocks[n];
    if (found.nj == 1 && expected.nj == 1 && found.nk == expected.nk && found.ni != expected.ni)
      throw Error(
          "{}: was made from a grid of {} {}; this grid has {} and is not the one the cache was made from",
          cache.path().string(), expected.ni, expected.name, found.ni);
    if (found.ni != expected.ni || found.nj != expected.nj || found.nk != expected.nk)
      throw Error(
          "{}: block {} had {}x{}x{} nodes when the cache was made; in this grid it has {}x{}x{}, so it is "
          "not the "
          "one the cache was made from",
          cache.path().string(), n + 1, expected.ni, expected.nj, expected.nk, found.ni, found.nj, found.nk);
  }
}

std::vector<BlockOverlap> overlapsFor(const Manifest& cache, const GridSource& grid,
                                      const OverlapMemory& memory, const Progress& progress, Ranks& ranks) {
  if (cache.overlap != kOverlapOwner) return {};
  std::vector<BlockOverlap> overlaps;
  if (ranks.isFirst()) overlaps = findOverlaps(grid, memory, progress);
  return fromBytes<BlockOverlap>(ranks.broadcast(toBytes(overlaps)));
}

std::filesystem::path newScratch(const std::filesystem::path& cache, const std::filesystem::path& folder) {
  const std::string name = scratchName(cache);
  // The cache is locked, so none of the additions that these belong to lives.
  for (const auto& entry : std::filesystem::directory_iterator(folder))
    if (ScratchFolder::isOne(entry.path(), name)) removeAll(entry.path());
  return ScratchFolder::newPath(folder, name);
}

}  // namespace curvisplat
