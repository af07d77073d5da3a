#include "tools/options/default_scalars.h"

#include <fmt/format.h>

#include <algorithm>
#include <climits>
#include <functional>
#include <iterator>
#include <set>
#include <string>
#include <string_view>

#include "stream/base/component_name.h"
#include "stream/base/error.h"
#include "stream/base/name_list.h"
#include "stream/base/text.h"

namespace curvisplat {
namespace {

/// Scalars that are not converted unasked, by the reason.
struct LeftOut {
  std::vector<std::string> other_centring, same_name, beyond_limit;

  void sayNotes(Centring centring, const std::function<void(const std::string&)>& say) const {
    const auto sayOf = [&](const std::vector<std::string>& names, const std::string& why) {
      if (!names.empty()) say(fmt::format("left out: {}{}", listed(names), why));
    };
    const bool cells = centring == Centring::kCell;
    sayOf(other_centring,
          fmt::format(", {}-centred: this cache holds the {}-centred scalars; convert the others to a second "
                      "cache with --scalar NAME,NAME",
                      cells ? "node" : "cell", cells ? "cell" : "node"));
    sayOf(same_name, ", a name that an earlier scalar has");
    sayOf(beyond_limit,
          fmt::format(", beyond the {} that are converted unasked; choose scalars with --scalar NAME,NAME",
                      kMaxDefaultScalars));
  }
};

/// Whether it is named as a quantity that most flow solvers compute, with any number behind it.
bool isWellKnown(const GridScalar& scalar) {
  constexpr std::string_view kNames[] = {
      "density", "pressure", "temperature", "velocity", "velocitymagnitude", "mach", "p", "t", "u", "rho"};
  std::string name = lowerCase(scalar.name);
  if (const std::string_view vector = vectorOf(scalar.name); !vector.empty()) name = lowerCase(vector);
  name.resize(name.find_last_not_of("0123456789") + 1);
  return std::find(std::begin(kNames), std::end(kNames), name) != std::end(kNames);
}

/// How late a scalar is chosen where there are more than kMaxDefaultScalars: well-known ones first, then other scalars and magnitudes,
/// then components of vectors, then those of tensors, which have no magnitude.
int lateness(const GridScalar& scalar, const std::set<std::string>& names) {
  if (isWellKnown(scalar)) return 0;
  const std::string vector(vectorOf(scalar.name));
  if (vector.empty() || scalar.name == vector + ":mag") return 1;
  return names.count(vector + ":mag") > 0 ? 2 : 3;
}

/// The centring of the first scalar, unless the best of the other is better: well known, or of a better kind.
Centring defaultCentring(const GridDescription& description, const std::vector<uint32_t>& stored) {
  const auto bestOf = [&](bool is_first) {
    int best = INT_MAX;
    for (const uint32_t n : stored) {
      const GridScalar& scalar = description.scalars[n];
      if ((scalar.centring == description.scalars[stored.front()].centring) == is_first)
        best = std::min(best, isWellKnown(scalar) ? -1 : static_cast<int>(kindOf(scalar.name)));
    }
    return best;
  };
  const Centring first = description.scalars[stored.front()].centring;
  if (bestOf(true) <= bestOf(false)) return first;
  return first == Centring::kNode ? Centring::kCell : Centring::kNode;
}

}  // namespace

std::vector<uint32_t> defaultScalars(const GridDescription& description,
                                     const std::set<std::string>& unusable,
                                     const std::function<void(const std::string&)>& say) {
  std::vector<uint32_t> stored, positions;
  for (uint32_t n = 0; n < description.scalars.size(); ++n)
    if (!description.scalars[n].derived && !unusable.contains(description.scalars[n].name))
      stored.push_back(n);
  if (stored.empty()) return {};
  const Centring centring = defaultCentring(description, stored);
  LeftOut left_out;
  std::set<std::string> names;
  for (const uint32_t n : stored) {
    const GridScalar& scalar = description.scalars[n];
    if (scalar.centring != centring)
      left_out.other_centring.push_back(scalar.name);
    else if (!names.insert(scalar.name).second)
      left_out.same_name.push_back(scalar.name);
    else
      positions.push_back(n);
  }
  if (positions.size() > kMaxDefaultScalars) {
    std::stable_sort(positions.begin(), positions.end(), [&](uint32_t a, uint32_t b) {
      return lateness(description.scalars[a], names) < lateness(description.scalars[b], names);
    });
    std::sort(positions.begin(), positions.begin() + kMaxDefaultScalars);
    for (size_t n = kMaxDefaultScalars; n < positions.size(); ++n)
      left_out.beyond_limit.push_back(description.scalars[positions[n]].name);
    positions.resize(kMaxDefaultScalars);
  }
  left_out.sayNotes(centring, say);
  return positions;
}

}  // namespace curvisplat
