// Scalars of a file and their names: an array of several components gives several, and no two have the same name.
#pragma once

#include <fmt/format.h>

#include <cstdint>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "preprocess/grid/grid_source.h"

namespace curvisplat {

/// The place of a vector's magnitude among its components.
inline constexpr int kMagnitude = -1;

/// Adds scalars to a description that outlives it.
class ScalarList {
 public:
  explicit ScalarList(GridDescription& description) : description_(description) {
    for (const GridScalar& scalar : description.scalars) taken_.insert(scalar.name);
  }

  /// Adds a scalar under the first of these names that no other has, or under the last. The result is valid
  /// until the next one is added.
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

/// The names that ScalarList::add() may choose from for a component of an array: NAME SUFFIX; if it is in
/// cells NAME:cell SUFFIX; and the last of them with `number`.
inline std::vector<std::string> namesOfComponent(const std::string& name, const std::string& suffix,
                                                 Centring centring, size_t number) {
  std::vector<std::string> names{name + suffix};
  if (centring == Centring::kCell) names.push_back(name + ":cell" + suffix);
  names.push_back(fmt::format("{}:{}", names.back(), number));
  return names;
}

/// Calls use(suffix, component) for the scalars that an array gives: of one component ""; of two or three
/// ":mag" (component kMagnitude), ":x", ":y", ":z"; of more ":0", ":1", ...
template <typename Use>
void forEachComponent(uint64_t components, const Use& use) {
  if (components == 1) return use(std::string(), 0);
  const bool vector = components <= 3;
  if (vector) use(std::string(":mag"), kMagnitude);
  for (uint64_t c = 0; c < components; ++c)
    use(vector ? fmt::format(":{}", "xyz"[c]) : fmt::format(":{}", c), static_cast<int>(c));
}

}  // namespace curvisplat
