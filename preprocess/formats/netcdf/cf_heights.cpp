// The heights of cf_vertical.h, once their terms are found.
#include <algorithm>
#include <array>
#include <cmath>
#include <iterator>
#include <optional>

#include "preprocess/formats/netcdf/cf_coordinates.h"
#include "preprocess/formats/netcdf/cf_vertical.h"

namespace curvisplat {

/// Source: CF conventions 1.10, appendix D.
double CfVertical::formula(const AtNode& node) const {
  const auto [s, c, eta, depth, c2, depth2, level_number] = node;
  switch (kind_) {
    case Kind::kHybridHeight:
      return s + c * depth;
    case Kind::kSleve:
      return s * a_ + c * depth + c2 * depth2;
    case Kind::kLogPressure:
      return a_ * std::exp(-s);
    case Kind::kSigmaPressure:
      return a_ + s * (depth - a_);
    case Kind::kHybridPressure:
      return s * a_ + c * depth;
    case Kind::kSigma:
      return eta + s * (depth + eta);
    case Kind::kSigmaZ:
      // Each level has one of the two.
      if (std::isfinite(s) && static_cast<double>(level_number) < levels_of_sigma_)
        return eta + s * (std::min(depth_c_, depth) + eta);
      return c;
    case Kind::kDoubleSigma: {
      const double half = 0.5 * (z1_ - z2_);
      const double middle = 0.5 * (z1_ + z2_) + half * std::tanh(a_ / half * (depth - depth_c_));
      if (static_cast<double>(level_number) < levels_of_sigma_) return s * middle;
      return middle + (s - 1) * (depth - middle);
    }
    case Kind::kS: {
      const double stretched = (1 - b_) * std::sinh(a_ * s) / std::sinh(a_) +
                               b_ * (std::tanh(a_ * (s + 0.5)) / (2 * std::tanh(0.5 * a_)) - 0.5);
      return eta * (1 + s) + depth_c_ * s + (depth - depth_c_) * stretched;
    }
    case Kind::kSG1: {
      const double level = depth_c_ * s + (depth - depth_c_) * c;
      return level + eta * (1 + level / depth);
    }
    default: {
      const double level = (depth_c_ * s + depth * c) / (depth_c_ + depth);
      return eta + (eta + depth) * level;
    }
  }
}

void CfVertical::setFace(uint64_t face) {
  for (CfTerm& term : terms_) term.setFace(face);
  for (std::optional<CfTerm>* term : {&s_, &c_, &eta_, &depth_, &c2_, &depth2_})
    if (*term) (*term)->setFace(face);
}

bool CfVertical::varies(size_t axis) const {
  const auto does = [&](const CfTerm& term) { return term.varies(axis); };
  const std::optional<CfTerm>* const terms[] = {&s_, &c_, &eta_, &depth_, &c2_, &depth2_};
  return std::any_of(terms_.begin(), terms_.end(), does) ||
         std::any_of(std::begin(terms), std::end(terms),
                     [&](const auto* term) { return *term && does(**term); });
}

bool CfVertical::uses(const NetcdfVariable& variable) const {
  const auto is = [&](const CfTerm& term) { return &term.variable() == &variable; };
  const std::optional<CfTerm>* const terms[] = {&s_, &c_, &eta_, &depth_, &c2_, &depth2_};
  return std::any_of(terms_.begin(), terms_.end(), is) ||
         std::any_of(std::begin(terms), std::end(terms),
                     [&](const auto* term) { return *term && is(**term); });
}

bool CfVertical::readNodes(const NetcdfFiles& file, const CfRange& range, std::span<double> to) const {
  if (kind_ != Kind::kLevels || !terms_[0].ofNodes()) return false;
  const NetcdfBox box = terms_[0].boxOf(range);
  file.read(terms_[0].variable(), box, to);
  for (double& value : to.first(box.values())) value = scale_ * value + offset_;
  return true;
}

CfValues CfVertical::heights(const NetcdfFiles& file, const CfRange& range) const {
  if (kind_ == Kind::kThickness) return thicknessHeights(file, range);
  if (!terms_.empty()) {
    CfValues heights = terms_[0].read(file, range);
    for (size_t n = 1; n < terms_.size(); ++n) {
      const CfValues more = terms_[n].read(file, range);
      for (size_t v = 0; v < heights.values.size(); ++v) heights.values[v] += more.values[v];
    }
    for (double& value : heights.values)
      value = kind_ == Kind::kPressure      ? 1e-3 * standardAltitude(scale_ * value)
              : kind_ == Kind::kSeaPressure ? -1e-3 * depthOfSeaPressure(scale_ * value)
                                            : scale_ * value + offset_;
    return heights;
  }
  return formulaHeights(file, range);
}

/// The layers above are read too, so pieces of a column read more than its height.
CfValues CfVertical::thicknessHeights(const NetcdfFiles& file, const CfRange& range) const {
  CfRange above = range;
  if (from_bottom_)
    above.end[axis_] = layers_;
  else
    above.begin[axis_] = 0;
  const CfValues thickness = terms_[0].read(file, above);
  CfValues heights;
  for (size_t axis = 0; axis < 3; ++axis) heights.count[axis] = range.end[axis] - range.begin[axis];
  heights.values.resize(heights.count[0] * heights.count[1] * heights.count[2]);
  const uint64_t layers = above.end[axis_] - above.begin[axis_];
  std::array<uint64_t, 3> columns = heights.count;
  columns[axis_] = 1;
  for (uint64_t k = 0; k < columns[2]; ++k)
    for (uint64_t j = 0; j < columns[1]; ++j)
      for (uint64_t i = 0; i < columns[0]; ++i) {
        double depth = 0;
        for (uint64_t n = 0; n < layers; ++n) {
          std::array<uint64_t, 3> at{i, j, k};
          at[axis_] = from_bottom_ ? layers - 1 - n : n;
          const double own = thickness.at(at[0], at[1], at[2]);
          const uint64_t layer = above.begin[axis_] + at[axis_];
          if (layer >= range.begin[axis_] && layer < range.end[axis_]) {
            at[axis_] = layer - range.begin[axis_];
            heights.values[at[0] + heights.count[0] * (at[1] + heights.count[1] * at[2])] =
                -scale_ * (depth + own / 2);
          }
          if (std::isfinite(own)) depth += own;
        }
      }
  return heights;
}

CfValues CfVertical::formulaHeights(const NetcdfFiles& file, const CfRange& range) const {
  const CfValues none{{1, 1, 1}, {0.0}};
  const bool pressure = ofPressure();
  CfValues heights;
  const CfValues s = s_->read(file, range);
  CfValues depth = depth_ ? depth_->read(file, range) : none;
  if (pressure)
    for (double& value : depth.values)
      // Programs that take the exponential keep the name of the logarithm, which is below 12.
      value = log_surface_ && value < 20 ? std::exp(value) : depth_ ? depth_c_ * value : kSeaLevelPressure;
  const CfValues c = c_ ? c_->read(file, range) : none, eta = eta_ ? eta_->read(file, range) : none;
  const CfValues c2 = c2_ ? c2_->read(file, range) : none,
                 depth2 = depth2_ ? depth2_->read(file, range) : none;
  for (size_t axis = 0; axis < 3; ++axis) heights.count[axis] = range.end[axis] - range.begin[axis];
  for (uint64_t k = 0; k < heights.count[2]; ++k)
    for (uint64_t j = 0; j < heights.count[1]; ++j)
      for (uint64_t i = 0; i < heights.count[0]; ++i) {
        // On land the elevation is missing, but the depth may be known.
        const double elevation = eta.at(i, j, k);
        const std::array<uint64_t, 3> at{i, j, k};
        const double value =
            formula({s.at(i, j, k), c.at(i, j, k), std::isfinite(elevation) ? elevation : 0,
                     depth.at(i, j, k), c2.at(i, j, k), depth2.at(i, j, k), range.begin[axis_] + at[axis_]});
        heights.values.push_back(pressure ? 1e-3 * standardAltitude(value) : scale_ * value);
      }
  return heights;
}

}  // namespace curvisplat
