// Plots in a build without Cairo: there are none, and asking for one is an error.
#include "stream/base/error.h"
#include "tools/throughput/plot.h"

namespace curvisplat {

void requirePlots() {
  throw UsageError("--plot: this program was built without plots (CMake's option CURVISPLAT_ANNOTATIONS)");
}

std::vector<std::byte> drawPlot(const std::vector<LinePanel>& /*panels*/) {
  return {};
}

std::vector<std::byte> drawPlot(const std::vector<BarPanel>& /*panels*/) {
  return {};
}

}  // namespace curvisplat
