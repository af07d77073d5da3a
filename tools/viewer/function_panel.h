// The transfer function's editor: a histogram with opacity points over it, the colours under it.
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

  /// Draws it into the present window of Dear ImGui; true if the function changed. `variable` is a position
  /// in the manifest's.
  bool draw(EditedFunction& function, size_t variable);
  /// Whether a point is being dragged.
  bool isDragging() const { return dragged_.has_value(); }

 private:
  bool drawCurve(EditedFunction& function);
  bool drawRange(EditedFunction& function, const VariableInfo& variable);
  bool drawFile(EditedFunction& function);
  /// Takes the histogram that is wanted, once it is there, and begins to make it if nobody has. Throws what
  /// reading throws.
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
  std::optional<HistogramOf> histogram_of_;         // what is shown, or on its way
  std::future<std::vector<double>> in_the_making_;  // of another thread: it reads
  std::string file_ = "function.json";
  std::string said_;  // of the last load or save
};

}  // namespace curvisplat
