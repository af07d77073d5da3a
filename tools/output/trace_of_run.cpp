#include "tools/output/trace_of_run.h"

#include <fmt/format.h>

#include "stream/base/error.h"
#include "stream/base/trace.h"
#include "tools/output/launched_ranks.h"
#include "tools/output/output_paths.h"

namespace curvisplat {

TraceOfRun::TraceOfRun(const std::filesystem::path& path, const std::vector<std::filesystem::path>& others) {
  if (path.empty()) return;
  const Ranks& ranks = launchedRanks();
  std::filesystem::path own = path;
  if (!ranks.alone())
    own.replace_filename(
        fmt::format("{}.{}{}", path.stem().string(), ranks.rank(), path.extension().string()));
  checkOutputFile("--trace", own, others);
  Trace::begin(own, ranks.rank());
}

TraceOfRun::~TraceOfRun() {
  try {
    end();
  } catch (const Error&) {  // what ended the command is reported
  }
}

void TraceOfRun::end() {
  Trace::end();
}

}  // namespace curvisplat
