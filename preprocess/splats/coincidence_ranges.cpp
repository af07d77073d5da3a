#include "preprocess/splats/coincidence_ranges.h"

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <limits>

namespace curvisplat {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();

/// Takes nodes in the order of the sweep, and finds a place from `least` on that parts no two which may coincide.
class CutSearch {
 public:
  CutSearch(double least, int coordinate_bytes) : least_(least), coordinate_bytes_(coordinate_bytes) {}

  /// Returns whether more nodes are needed.
  bool add(const SweptNode& node) {
    const double along = node.sweep.along;
    std::erase_if(before_, [&](const Reaching& other) { return other.until < along; });
    const Reaching added{node.position, along, along + reachOf(node, coordinate_bytes_)};
    if (along < least_ || std::any_of(before_.begin(), before_.end(),
                                      [&](const Reaching& other) { return mayCoincide(other, added); })) {
      before_.insert(before_.end(), behind_.begin(), behind_.end());
      behind_.clear();
      before_.push_back(added);
    } else {
      behind_.push_back(added);
    }
    found_ = before_.empty();
    return !found_ && before_.size() + behind_.size() < kMaxNodes;
  }

  /// Infinite if there is none.
  double cut() const { return found_ ? behind_.front().along : kInfinity; }

 private:
  static constexpr size_t kMaxNodes = 4096;  // that are looked at together

  struct Reaching {
    glm::dvec3 position;
    double along, until;
  };

  static bool mayCoincide(const Reaching& a, const Reaching& b) {
    const double reach = std::max(a.until - a.along, b.until - b.along);
    return a.along == b.along || glm::distance(a.position, b.position) <= reach;
  }

  const double least_;
  const int coordinate_bytes_;
  std::vector<Reaching> before_, behind_;  // of the cut; those before it that may still reach behind it
  bool found_ = false;
};

}  // namespace

void LargestReach::add(const glm::dvec3& position, double spacing) {
  coordinate_ = std::max({coordinate_, std::abs(position.x), std::abs(position.y), std::abs(position.z)});
  spacing_ = std::max(spacing_, spacing);
}

void LargestReach::add(const LargestReach& other) {
  coordinate_ = std::max(coordinate_, other.coordinate_);
  spacing_ = std::max(spacing_, other.spacing_);
}

double LargestReach::of(int coordinate_bytes) const {
  return reachOf({{}, glm::dvec3(coordinate_), spacing_}, coordinate_bytes);
}

std::vector<SweepRange> coincidenceRanges(const RecordSorter& sorted, size_t parts, const SweptOf& swept_of,
                                          const LargestReach& reach, int coordinate_bytes) {
  std::vector<SweepRange> ranges;
  double from = -kInfinity;
  for (const double least : sorted.cutsInto(parts)) {
    if (least <= from) continue;
    CutSearch search(least, coordinate_bytes);
    sorted.visit(std::max(from, least - reach.of(coordinate_bytes)), kInfinity,
                 [&](const double* record) { return search.add(swept_of(record)); });
    if (search.cut() == kInfinity) continue;
    ranges.push_back({from, search.cut()});
    from = search.cut();
  }
  ranges.push_back({from, kInfinity});
  return ranges;
}

}  // namespace curvisplat
