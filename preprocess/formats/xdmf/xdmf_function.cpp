#include "preprocess/formats/xdmf/xdmf_function.h"

#include <algorithm>
#include <limits>
#include <numeric>
#include <span>
#include <vector>

#include "preprocess/formats/common/element_source.h"
#include "stream/base/error.h"

namespace curvisplat {
namespace {

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();
constexpr uint64_t kCorners = 4, kMaxComponents = 9;
constexpr uint64_t kSamplesAtOnce = 1 << 20, kNumbersAtOnce = 1 << 18, kMaxGap = 512;

uint64_t degreesOf(uint64_t degree) {
  return (degree + 1) * (degree + 2) * (degree + 3) / 6;
}

/// Replaces indices of `values` by these values.
void look(const XdmfFunction& function, std::vector<double>& indices) {
  std::vector<size_t> order(indices.size());
  std::iota(order.begin(), order.end(), size_t{0});
  std::sort(order.begin(), order.end(), [&](size_t a, size_t b) { return indices[a] < indices[b]; });
  const auto indexAt = [&](size_t n) {
    const uint64_t index = pointNumber(indices[order[n]]);
    if (index >= function.values->size())
      throw Error("{} has the degree of freedom {}; expected one below {}; the file is damaged",
                  function.where, indices[order[n]], function.values->size());
    return index;
  };
  std::vector<double> run;
  for (size_t from = 0; from < order.size();) {
    const uint64_t begin = indexAt(from);
    uint64_t end = begin + 1;
    size_t to = from + 1;
    for (; to < order.size() && indexAt(to) - end < kMaxGap; ++to) end = indexAt(to) + 1;
    run.resize(end - begin);
    function.values->read(begin, run);
    for (; from < to; ++from) indices[order[from]] = run[indexAt(from) - begin];
  }
}

class FunctionValues final : public XdmfValues {
 public:
  FunctionValues(const XdmfFunction& function, uint64_t components, const std::shared_ptr<SpoolFile>& spool)
      : XdmfValues({function.degree == 0 ? function.cells : function.nodes, components}, function.where),
        function_(function),
        bytes_(spool, size() * sizeof(double), [this](const SpoolFile::Sink& sink) { write(sink); }) {}

  int valueBytes() const override { return function_.values->valueBytes(); }
  void read(uint64_t first, std::span<double> to) const override {
    bytes_.readAt(first * sizeof(double), std::as_writable_bytes(to));
  }

 private:
  /// A part of the samples: sums of what cells have there.
  struct Part {
    uint64_t first = 0, count = 0;
    std::vector<double> sums;
    std::vector<uint32_t> added;
  };

  void write(const SpoolFile::Sink& sink) const {
    const uint64_t samples = dims()[0], components = dims()[1], cells = function_.cells;
    const uint64_t at_once = std::max<uint64_t>(1, kNumbersAtOnce / (function_.degrees->size() / cells));
    Part part;
    for (; part.first < samples; part.first += part.count) {
      part.count = std::min(kSamplesAtOnce, samples - part.first);
      part.sums.assign(part.count * components, kNaN);
      part.added.assign(part.count, 0);
      for (uint64_t cell = 0; cell < cells; cell += at_once)
        addCells(cell, std::min(at_once, cells - cell), part);
      for (size_t n = 0; n < part.sums.size(); ++n) part.sums[n] /= std::max(1U, part.added[n / components]);
      sink(std::as_bytes(std::span(part.sums)));
    }
  }

  void addCells(uint64_t first, uint64_t count, Part& part) const {
    const uint64_t components = dims()[1], each = function_.degrees->size() / function_.cells;
    const uint64_t corners = function_.degree == 0 ? 1 : kCorners, of_component = each / components;
    std::vector<double> nodes(count * kCorners), degrees(count * each), values;
    if (function_.degree > 0) function_.corners->read(first * kCorners, nodes);
    function_.degrees->read(first * each, degrees);
    std::vector<uint64_t> samples;  // of the part; each has a value of each component
    for (uint64_t cell = 0; cell < count; ++cell)
      for (uint64_t corner = 0; corner < corners; ++corner) {
        const uint64_t sample = function_.degree == 0
                                    ? first + cell
                                    : pointNumber(nodes[cell * kCorners + corner], function_.first_node);
        if (sample < part.first || sample - part.first >= part.count) continue;
        samples.push_back(sample - part.first);
        for (uint64_t component = 0; component < components; ++component)
          values.push_back(degrees[cell * each + component * of_component + corner]);
      }
    look(function_, values);
    for (size_t n = 0; n < samples.size(); ++n) {
      uint32_t& added = part.added[samples[n]];
      if (function_.continuous && added > 0) continue;  // all cells have the same there
      for (uint64_t component = 0; component < components; ++component) {
        double& sum = part.sums[samples[n] * components + component];
        sum = values[n * components + component] + (added == 0 ? 0 : sum);
      }
      ++added;
    }
  }

  const XdmfFunction function_;
  const SpooledBytes bytes_;
};

}  // namespace

std::shared_ptr<const XdmfValues> xdmfFunctionValues(const XdmfFunction& function,
                                                     const std::shared_ptr<SpoolFile>& spool) {
  const uint64_t each = function.cells == 0 ? 0 : function.degrees->size() / function.cells,
                 components = each / degreesOf(function.degree);
  if (components == 0 || components > kMaxComponents ||
      components * degreesOf(function.degree) * function.cells != function.degrees->size())
    throw Error("{} has {} degrees of freedom in {} cells; expected {} in each, or some times as many",
                function.where, function.degrees->size(), function.cells, degreesOf(function.degree));
  return std::make_shared<FunctionValues>(function, components, spool);
}

}  // namespace curvisplat
