#include "tools/commands/written_precision.h"

#include <fmt/format.h>

#include "stream/base/message.h"
#include "stream/cache/stored_precision.h"
#include "tools/output/print_line.h"

namespace curvisplat {

std::unique_ptr<CacheReader> openWritten(const std::filesystem::path& cache, uint64_t step) {
  try {
    return std::make_unique<CacheReader>(cache, step);
  } catch (const std::exception& error) {
    printMessage("warning: the cache is complete, but it cannot be read back: {}", error.what());
    return nullptr;
  }
}

void printStoredPrecision(const CacheReader& cache, std::string_view where) {
  const auto& variables = cache.manifest().variables;
  for (size_t n = 0; n < variables.size(); ++n)
    printLine("{}{}: {:.6g} .. {:.6g}{}, rounded within {:.1e}", variables[n].name, where, variables[n].min,
              variables[n].max, variables[n].unit.empty() ? "" : " " + variables[n].unit,
              storedWithin(cache, n));
}

}  // namespace curvisplat
