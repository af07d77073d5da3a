#include "preprocess/formats/netcdf/cf_term.h"

#include <algorithm>

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
  const auto lengthOf = [&](size_t dim) { return file.dimensions()[dim].length; };
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
    const size_t axis = variable.dims.size() - 1 - *d - (term.face_ && *term.face_ > *d ? 1 : 0);
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

CfTerm CfTerm::ofIndex(size_t axis, double metres) {
  static const NetcdfVariable index = [] {
    NetcdfVariable variable;
    variable.name = "index";
    variable.value_bytes = sizeof(float);
    variable.attributes["units"].text.push_back('m');
    return variable;
  }();
  CfTerm term;
  term.variable_ = &index;
  term.along_[axis] = 0;
  term.index_metres_ = metres;
  return term;
}

bool CfTerm::ofNodes() const {
  return index_metres_ == 0 && exact_ && axes() == 3 && *along_[2] < *along_[1] && *along_[1] < *along_[0];
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

CfValues CfTerm::read(const NetcdfFiles& file, const CfRange& range) const {
  if (index_metres_ > 0) {
    CfValues indices;
    for (size_t axis = 0; axis < 3; ++axis) {
      if (!along_[axis]) continue;
      indices.count[axis] = range.end[axis] - range.begin[axis];
      for (uint64_t n = range.begin[axis]; n < range.end[axis]; ++n)
        indices.values.push_back(index_metres_ * static_cast<double>(n));
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
        values.values.push_back(stored[i * strides[0] + j * strides[1] + k * strides[2]]);
  for (size_t axis = 0; axis < 3; ++axis)
    if (longer_[axis] != 0)
      values = resampled(values, axis, range.begin[axis], range.end[axis], box.start[*along_[axis]],
                         {length_[axis], longer_[axis]});
  return values;
}

}  // namespace curvisplat
