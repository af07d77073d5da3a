// Conversions and additions in the test's own process, and what must not change a byte of their caches:
// threads, memory, the sizes of buckets and slabs, ranks. A failure names the file and the variation, and
// prints no bytes.
#pragma once

#include <cstdint>
#include <filesystem>
#include <initializer_list>
#include <optional>
#include <string_view>
#include <vector>

#include "preprocess/addition/add_scalar.h"
#include "preprocess/convert/convert.h"
#include "tests/support/temporary_folder.h"

namespace curvisplat {

/// Converts without showing progress.
ConvertReport converted(const DataSource& source, const ConvertOptions& options);
/// Converts by several ranks, which are threads; the report of the first.
ConvertReport convertedByRanks(unsigned ranks, const DataSource& source, const ConvertOptions& options);

/// Adds without showing progress.
AddScalarReport added(const DataSource& source, const AddScalarOptions& options);
AddScalarReport addedByRanks(unsigned ranks, const DataSource& source, const AddScalarOptions& options);

/// Expects the same files with the same bytes, and no others. What `but` names is not compared.
void expectSameFiles(const Files& found, const Files& expected,
                     std::initializer_list<std::string_view> but = {});

/// A variation that must not change a byte. Fields that are left out are as in the options.
struct Variation {
  std::optional<unsigned> threads = {};
  std::optional<uint64_t> memory_bytes = {};
  std::optional<uint64_t> bucket_splats = {}, slab_bytes = {};
  std::optional<uint64_t> mesh_bytes = {}, owner_bytes = {};  // of conversions
  std::optional<uint32_t> most_buckets = {};                  // of additions
  unsigned ranks = 1;
};

/// Converts `source` as `options` say, and again with each variation over the same output. Expects the same
/// files, a report of the same numbers, and nothing else beside the output. Returns the first report; the
/// output is that of the last conversion.
ConvertReport expectSameCaches(const DataSource& source, ConvertOptions options,
                               const std::vector<Variation>& variations);

/// The same of additions, each time to a copy of the cache `first`, at adding.cache.
AddScalarReport expectSameAdditions(const DataSource& source, const std::filesystem::path& first,
                                    const AddScalarOptions& adding, const std::vector<Variation>& variations);

}  // namespace curvisplat
