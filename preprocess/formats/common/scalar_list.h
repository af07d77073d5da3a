// ScalarList gives the scalars of a file names that differ, where the reader offers enough names. An array of
// several components gives several scalars. For one thread: readers use it in their constructors.
#pragma once

#include <fmt/format.h>

#include <cstdint>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "preprocess/grid/grid_source.h"

namespace curvisplat {

/// The number that stands for a vector's magnitude where a component is asked for.
inline constexpr int kMagnitude = -1;

/// Adds scalars to a description, which must outlive the list.
class ScalarList {
 public:
  explicit ScalarList(GridDescription& description) : description_(description) {
    for (const GridScalar& scalar : description.scalars) taken_.insert(scalar.name);
  }

  /// Adds a scalar under the first of `names` that no other scalar has, or under the last of them, even if
  /// that is taken. The result is valid until the next call.
  GridScalar& add(const std::vector<std::string>& names, Centring centring) {
    size_t n = 0;
    while (n + 1 < names.size() && taken_.count(names[n]) > 0) ++n;
    taken_.insert(names[n]);
    GridScalar& scalar = description_.scalars.emplace_back();
    scalar.name = names[n];
    scalar.centring = centring;
    return scalar;
  }

 private:
  GridDescription& description_;
  std::set<std::string> taken_;
};

/// Names for a component of an array, from which ScalarList::add() chooses: `name` and `suffix` joined; in
/// cells also with ":cell" between them; and the last of these with ":" and `number` behind it.
inline std::vector<std::string> namesOfComponent(const std::string& name, const std::string& suffix,
                                                 Centring centring, size_t number) {
  std::vector<std::string> names{name + suffix};
  if (centring == Centring::kCell) names.push_back(name + ":cell" + suffix);
  names.push_back(fmt::format("{}:{}", names.back(), number));
  return names;
}

/// Calls use(suffix, component) for each scalar that an array gives. One component gives the suffix ""; two
/// or three give ":mag" (component kMagnitude), then ":x", ":y", ":z"; more give ":0", ":1", ...
template <typename Use>
void forEachComponent(uint64_t components, const Use& use) {
  if (components == 1) return use(std::string(), 0);
  const bool vector = components <= 3;
  if (vector) use(std::string(":mag"), kMagnitude);
  for (uint64_t c = 0; c < components; ++c)
    use(vector ? fmt::format(":{}", "xyz"[c]) : fmt::format(":{}", c), static_cast<int>(c));
}

}  // namespace curvisplat
