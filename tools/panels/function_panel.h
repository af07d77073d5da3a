// The editor of the transfer function: a histogram with the opacity points over it, the colours below, and
// numbers on both axes.
#pragma once

#include <future>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "stream/cache/cache_reader.h"
#include "tools/view/edited_function.h"
#include "tools/window/widgets.h"

namespace curvisplat {

class FunctionPanel {
 public:
  explicit FunctionPanel(const CacheReader& cache) : cache_(cache) {}

  /// The aspects of its function that a panel shows. In a picture of two scalars, each function gives only
  /// colours or only opacities.
  enum class Shows { kAll, kColours, kOpacities };
  struct Result {
    bool changed = false;
    bool automatic = false;            // the user asked for a function that is chosen from the data
    bool automatic_opacities = false;  // the same, but the colours stay
    bool dragging = false;             // a point is being dragged
    bool load = false, save = false;   // the user asked to load a function, or to save this one
    std::string error;                 // of reading the histogram, or why what the user asked for cannot be
  };
  /// Draws into the current Dear ImGui window. `variable`: position in the manifest's variables. `step`: the
  /// one that is shown. `marked`: scalars that the curve marks by lines.
  Result draw(EditedFunction& function, size_t variable, Shows shows, uint64_t step,
              std::span<const double> marked = {});

 private:
  bool drawCurve(EditedFunction& function, std::span<const double> marked, bool has_colours);
  bool drawPoints(EditedFunction& function);
  bool drawMaps(EditedFunction& function, Result& result);
  bool drawColours(EditedFunction& function);
  void drawRange(EditedFunction& function, size_t variable, uint64_t step, Result& result);
  static void drawOpacities(EditedFunction& function, Result& result);
  void drawUnit(EditedFunction& function, Result& result);
  /// Takes the finished histogram, and starts computing another one if the function's range has changed.
  /// Returns why it cannot be read, once; the one before is kept then.
  std::string updateHistogram(const EditedFunction& function, size_t variable);

  const CacheReader& cache_;
  std::optional<size_t> dragged_;
  TypedNumbers typed_;
  std::vector<double> histogram_;
  struct HistogramOf {
    size_t variable;
    std::pair<double, double> range;
    bool log_scale, asinh_scale;
    bool operator==(const HistogramOf&) const = default;
  };
  std::optional<HistogramOf> histogram_of_;             // shown or being computed
  std::future<std::vector<double>> pending_histogram_;  // on another thread, because it reads the cache
};

}  // namespace curvisplat
