#include "preprocess/formats/netcdf/cf_term.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <sstream>
#include <utility>

#include "preprocess/formats/netcdf/cf_coordinates.h"
#include "stream/base/text.h"

namespace curvisplat {
namespace {

/// Linear weights of two neighbouring points of a term at a node.
struct Between {
  uint64_t first;  // index of the first of the two points
  double weight_first, weight_next;
};

/// The points of a term along an axis that has one node more or fewer: -1, or 1 if there are more points.
struct TermPoints {
  uint64_t length;
  int longer;
};

/// Weights at the block's node `n`.
Between between(uint64_t n, const TermPoints& points) {
  const uint64_t length = points.length;
  if (points.longer > 0) return {n, 0.5, 0.5};
  if (length < 2) return {0, 1, 0};
  if (n == 0) return {0, 1.5, -0.5};
  if (n == length) return {length - 2, -0.5, 1.5};
  return {n - 1, 0.5, 0.5};
}

/// Interpolates along `axis` to the nodes [begin, end). `from` has the term's values from point `point` on.
CfValues resampled(const CfValues& from, size_t axis, uint64_t begin, uint64_t end, uint64_t point,
                   const TermPoints& points) {
  CfValues to;
  to.count = from.count;
  to.count[axis] = end - begin;
  const std::array<uint64_t, 3> strides{1, from.count[0], from.count[0] * from.count[1]};
  for (uint64_t k = 0; k < to.count[2]; ++k)
    for (uint64_t j = 0; j < to.count[1]; ++j)
      for (uint64_t i = 0; i < to.count[0]; ++i) {
        std::array<uint64_t, 3> index{i, j, k};
        const Between weights = between(begin + index[axis], points);
        index[axis] = weights.first - point;
        const uint64_t n = index[0] + strides[1] * index[1] + strides[2] * index[2];
        const uint64_t next = index[axis] + 1 < from.count[axis] ? n + strides[axis] : n;
        to.values.push_back(weights.weight_first * from.values[n] + weights.weight_next * from.values[next]);
      }
  return to;
}

}  // namespace

std::optional<CfTerm> CfTerm::of(const NetcdfFiles& file, const NetcdfVariable& variable,
                                 const CfDimensions& block) {
  CfTerm term;
  term.variable_ = &variable;
  term.start_.assign(variable.dims.size(), 0);
  const auto lengthOf = [&](size_t dim) {
    return dim == CfDimensions::kNoDimension ? 0 : file.dimensions()[dim].length;
  };
  std::vector<size_t> unknown;
  for (size_t d = 0; d < variable.dims.size(); ++d) {
    const size_t dim = variable.dims[d];
    const auto axis = std::find(block.axes.begin(), block.axes.end(), dim);
    if (block.time && dim == *block.time) {
      term.start_[d] = block.time_step;
    } else if (block.face && dim == *block.face) {
      if (term.face_) return std::nullopt;
      term.face_ = d;
    } else if (axis != block.axes.end()) {
      std::optional<size_t>& along = term.along_[static_cast<size_t>(axis - block.axes.begin())];
      if (along) return std::nullopt;
      along = d;
    } else if (lengthOf(dim) != 1) {
      unknown.push_back(d);
    }
  }
  term.exact_ = unknown.empty();
  // Matched from the last dimension (i) to the first, as in the block, skipping axes that are taken.
  for (auto d = unknown.rbegin(); d != unknown.rend(); ++d) {
    const bool alone = block.levels && unknown.size() == 1 && term.axes() == 0;
    const size_t axis =
        alone ? *block.levels : variable.dims.size() - 1 - *d - (term.face_ && *term.face_ > *d ? 1 : 0);
    if (axis > 2 || term.along_[axis]) return std::nullopt;
    const uint64_t length = lengthOf(variable.dims[*d]), wanted = lengthOf(block.axes[axis]);
    if (length + 1 < wanted || length > wanted + 1) return std::nullopt;
    term.along_[axis] = *d;
    term.longer_[axis] = static_cast<int>(length > wanted) - static_cast<int>(length < wanted);
    term.length_[axis] = length;
  }
  return term;
}

std::optional<CfTerm> CfTerm::ofSupergrid(const NetcdfFiles& file, const NetcdfVariable& variable,
                                          const CfDimensions& block) {
  if (variable.dims.size() != 2) return std::nullopt;
  CfTerm term;
  term.variable_ = &variable;
  term.start_.assign(2, 0);
  term.exact_ = false;
  for (size_t axis = 0; axis < 2; ++axis) {
    const size_t dim = 1 - axis;
    const uint64_t points = file.dimension(variable, dim).length,
                   nodes = file.dimensions()[block.axes[axis]].length;
    if (points != 2 * nodes + 1 && points + 1 != 2 * nodes) return std::nullopt;
    term.along_[axis] = dim;
    term.step_[axis] = 2;
    term.first_[axis] = points > 2 * nodes ? 1 : 0;
  }
  return term;
}

namespace {

const NetcdfVariable& noVariable() {
  static const NetcdfVariable index = [] {
    NetcdfVariable variable;
    variable.name = "index";
    variable.value_bytes = sizeof(float);
    variable.attributes["units"].text.push_back('m');
    return variable;
  }();
  return index;
}

}  // namespace

CfTerm CfTerm::ofIndex(size_t axis, double metres) {
  CfTerm term;
  term.variable_ = &noVariable();
  term.along_[axis] = 0;
  term.index_metres_ = metres;
  return term;
}

std::optional<CfTerm> CfTerm::ofNumbers(const NetcdfFiles& file, std::vector<double> numbers,
                                        const CfDimensions& block) {
  CfTerm term;
  term.variable_ = &noVariable();
  if (numbers.size() > 1) {
    if (!block.levels) return std::nullopt;
    const uint64_t levels = file.dimensions()[block.axes[*block.levels]].length;
    if (numbers.size() != levels && numbers.size() != levels + 1) return std::nullopt;
    if (numbers.size() > levels)
      for (size_t n = 0; n < levels; ++n) numbers[n] = (numbers[n] + numbers[n + 1]) / 2;
    term.along_[*block.levels] = 0;
  }
  if (numbers.empty()) return std::nullopt;
  term.numbers_ = std::move(numbers);
  return term;
}

bool CfTerm::ofNodes() const {
  return index_metres_ == 0 && numbers_.empty() && exact_ && axes() == 3 && *along_[2] < *along_[1] &&
         *along_[1] < *along_[0];
}

NetcdfBox CfTerm::boxOf(const CfRange& range) const {
  NetcdfBox box{start_, std::vector<size_t>(start_.size(), 1)};
  for (size_t axis = 0; axis < 3; ++axis) {
    if (!along_[axis]) continue;
    uint64_t begin = range.begin[axis], end = range.end[axis];
    if (longer_[axis] != 0) {
      const TermPoints points{length_[axis], longer_[axis]};
      begin = between(begin, points).first;
      end = std::min(between(end - 1, points).first + 2, points.length);
    }
    box.start[*along_[axis]] = first_[axis] + step_[axis] * begin;
    box.count[*along_[axis]] = step_[axis] * (end - begin - 1) + 1;
  }
  return box;
}

void CfTerm::setDegrees() {
  scale_ = degreesOf(variable_->text("units"));
}

CfValues CfTerm::read(const NetcdfFiles& file, const CfRange& range) const {
  if (!numbers_.empty() && axes() == 0) return {{1, 1, 1}, numbers_};
  if (index_metres_ > 0 || !numbers_.empty()) {
    CfValues indices;
    for (size_t axis = 0; axis < 3; ++axis) {
      if (!along_[axis]) continue;
      indices.count[axis] = range.end[axis] - range.begin[axis];
      for (uint64_t n = range.begin[axis]; n < range.end[axis]; ++n)
        indices.values.push_back(numbers_.empty() ? index_metres_ * static_cast<double>(n) : numbers_[n]);
    }
    return indices;
  }
  const NetcdfBox box = boxOf(range);
  std::vector<double> stored(box.values());
  file.read(*variable_, box, stored);

  CfValues values;
  std::array<uint64_t, 3> strides{};
  for (size_t axis = 0; axis < 3; ++axis) {
    if (!along_[axis]) continue;
    values.count[axis] = (box.count[*along_[axis]] - 1) / step_[axis] + 1;
    strides[axis] = step_[axis];
    for (size_t d = *along_[axis] + 1; d < box.count.size(); ++d) strides[axis] *= box.count[d];
  }
  values.values.reserve(values.count[0] * values.count[1] * values.count[2]);
  for (uint64_t k = 0; k < values.count[2]; ++k)
    for (uint64_t j = 0; j < values.count[1]; ++j)
      for (uint64_t i = 0; i < values.count[0]; ++i)
        values.values.push_back(scale_ * stored[i * strides[0] + j * strides[1] + k * strides[2]]);
  for (size_t axis = 0; axis < 3; ++axis)
    if (longer_[axis] != 0)
      values = resampled(values, axis, range.begin[axis], range.end[axis], box.start[*along_[axis]],
                         {length_[axis], longer_[axis]});
  return values;
}

namespace {

bool isWaterMask(const std::string& name, const std::string& standard_name) {
  return standard_name == "sea_binary_mask" || name.starts_with("mask_") || name.starts_with("hfac") ||
         isOneOf(name, {"tmask", "umask", "vmask", "wmask", "fmask", "tmaskutil", "umaskutil", "vmaskutil",
                        "maskc", "maskw", "masks", "wet", "wet_c", "wet_t", "wet_u", "wet_v"});
}

/// The flag values whose meanings say that there is nothing. `ocean`: as CfMask::of().
std::vector<double> hiddenFlags(const NetcdfVariable& variable, bool ocean) {
  const auto values = variable.attributes.find("flag_values");
  if (values == variable.attributes.end()) return {};
  std::vector<double> hidden;
  std::istringstream meanings(lowerCase(variable.text("flag_meanings")));
  std::string meaning;
  for (size_t n = 0; n < values->second.numbers.size() && meanings >> meaning; ++n) {
    const bool nothing = isOneOf(meaning, {"hole", "blank", "blanked", "solid", "masked", "outside",
                                           "missing", "no_data", "nodata", "invalid"});
    if (nothing || (ocean && isOneOf(meaning, {"land", "dry", "dry_land", "ground"})))
      hidden.push_back(values->second.numbers[n]);
  }
  return hidden;
}

/// A file of NEMO's masks has those of all points on the same dimensions. The point (t, u, v or w) is in the
/// name of the levels: deptht, depthu.
char nemoPoint(const NetcdfFiles& files, const CfDimensions& block, size_t levels) {
  const std::string& name = files.dimensions()[block.axes[levels]].name;
  return name.size() == 6 && name.starts_with("depth") && isOneOf(name.substr(5), {"t", "u", "v", "w"})
             ? name[5]
             : 't';
}

bool ofAnotherPoint(const std::string& name, char point) {
  if (name.size() < 5 || name.substr(1, 4) != "mask" ||
      !isOneOf(name.substr(0, 1), {"t", "u", "v", "w", "f"}))
    return false;
  return name[0] != point && !(name[0] == 't' && point == 'w');
}

}  // namespace

std::optional<CfMask::Rule> CfMask::ruleOf(const NetcdfVariable& variable, bool ocean) {
  const std::string name = lowerCase(variable.name),
                    standard_name = lowerCase(variable.text("standard_name"));
  if (!variable.numeric) return std::nullopt;
  if (!hiddenFlags(variable, ocean).empty()) return Rule::kFlags;
  if (isWaterMask(name, standard_name)) return ocean ? std::optional(Rule::kZero) : std::nullopt;
  if (standard_name == "land_binary_mask" || isOneOf(name, {"landmask", "land_mask"}))
    return ocean ? std::optional(Rule::kNotZero) : std::nullopt;
  if (isOneOf(name, {"kmt", "kmu"})) return Rule::kLevels;
  return std::nullopt;
}

bool CfMask::isMask(const NetcdfVariable& variable) {
  return ruleOf(variable, true).has_value();
}

std::optional<CfMask> CfMask::of(const NetcdfFiles& files, const NetcdfVariable& variable,
                                 const CfDimensions& block, size_t levels, bool ocean) {
  const char point = nemoPoint(files, block, levels);
  std::optional<CfMask> best;
  int best_rank = 0;
  for (const NetcdfVariable& candidate : files.variables()) {
    if (candidate.name == variable.name || ofAnotherPoint(lowerCase(candidate.name), point)) continue;
    const auto rule = ruleOf(candidate, ocean);
    if (!rule) continue;
    const auto term = CfTerm::of(files, candidate, block);
    if (!term || !term->onNodes() || term->axes() < 2) continue;
    if (rule == Rule::kLevels && term->varies(levels)) continue;
    // Masks of all levels before those of the surface, though NEMO's have levels of another name (nav_lev); then its own
    // dimensions before dimensions of their lengths.
    const int rank = 1 + (term->axes() == 3 ? 2 : 0) + (term->exact() ? 1 : 0);
    if (rank <= best_rank) continue;
    best_rank = rank;
    CfMask mask;
    mask.term_ = *term;
    mask.rule_ = *rule;
    mask.levels_ = levels;
    mask.hidden_ = hiddenFlags(candidate, ocean);
    const std::string words = rule == Rule::kZero      ? "is 0"
                              : rule == Rule::kNotZero ? "is not 0"
                              : rule == Rule::kLevels
                                  ? "counts fewer levels"
                                  : fmt::format("is {:g}", fmt::join(mask.hidden_, " or "));
    mask.description_ = fmt::format("{} {}", candidate.name, words);
    best = std::move(mask);
  }
  return best;
}

bool CfMask::hides(double value, uint64_t level) const {
  switch (rule_) {
    case Rule::kZero:
      return value == 0 || std::isnan(value);
    case Rule::kNotZero:
      return value != 0;
    case Rule::kLevels:
      return !(value > static_cast<double>(level));
    case Rule::kFlags:
      return std::isnan(value) || std::find(hidden_.begin(), hidden_.end(), value) != hidden_.end();
  }
  return false;
}

void CfMask::apply(const NetcdfFiles& files, const CfRange& range, std::span<uint8_t> blank) const {
  const CfValues values = term_.read(files, range);
  size_t n = 0;
  for (uint64_t k = 0; k < range.end[2] - range.begin[2]; ++k)
    for (uint64_t j = 0; j < range.end[1] - range.begin[1]; ++j)
      for (uint64_t i = 0; i < range.end[0] - range.begin[0]; ++i, ++n) {
        const std::array<uint64_t, 3> at{i, j, k};
        blank[n] |= hides(values.at(i, j, k), range.begin[levels_] + at[levels_]);
      }
}

}  // namespace curvisplat
