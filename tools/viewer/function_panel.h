// The transfer function's editor: a histogram with opacity points over it, the colours under it.
#pragma once

#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "stream/cache_reader.h"
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
  void updateHistogram(const EditedFunction& function, size_t variable);

  const CacheReader& cache_;
  std::optional<size_t> dragged_;
  std::vector<double> histogram_;
  std::optional<std::pair<size_t, std::pair<double, double>>> histogram_of_;  // variable and range
  bool histogram_log_ = false;
  std::string file_ = "function.json";
  std::string said_;  // of the last load or save
};

}  // namespace curvisplat
