// The editor of the transfer function: a histogram with the opacity points over it, and the colours below.
#pragma once

#include <future>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "stream/cache/cache_reader.h"
#include "tools/viewer/edited_function.h"

namespace curvisplat {

class FunctionPanel {
 public:
  explicit FunctionPanel(const CacheReader& cache) : cache_(cache) {}

  /// Draws into the current Dear ImGui window. Returns true if the function changed. `variable`: position in
  /// the manifest's variables.
  bool draw(EditedFunction& function, size_t variable);
  /// Whether a point is being dragged.
  bool isDragging() const { return dragged_.has_value(); }

 private:
  bool drawCurve(EditedFunction& function);
  bool drawRange(EditedFunction& function, const VariableInfo& variable);
  bool drawFile(EditedFunction& function);
  /// Takes the finished histogram, and starts computing another one if the function's range has changed.
  /// Throws what reading throws.
  void updateHistogram(const EditedFunction& function, size_t variable);

  const CacheReader& cache_;
  std::optional<size_t> dragged_;
  std::vector<double> histogram_;
  struct HistogramOf {
    size_t variable;
    std::pair<double, double> range;
    bool log_scale;
    bool operator==(const HistogramOf&) const = default;
  };
  std::optional<HistogramOf> histogram_of_;             // shown or being computed
  std::future<std::vector<double>> pending_histogram_;  // on another thread, because it reads the cache
  std::string file_ = "function.json";
  std::string message_;  // about the last load or save
};

}  // namespace curvisplat
