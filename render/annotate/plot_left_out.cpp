// Plots in a build without Cairo: there are none, and asking for one is an error.
#include "render/annotate/plot.h"
#include "stream/base/error.h"

namespace curvisplat {

void requirePlots() {
  throw UsageError("this program was built without plots (CMake's option CURVISPLAT_ANNOTATIONS)");
}

std::vector<std::byte> drawPlot(const std::vector<LinePanel>& /*panels*/) {
  return {};
}

std::vector<std::byte> drawPlot(const std::vector<BarPanel>& /*panels*/) {
  return {};
}

}  // namespace curvisplat
