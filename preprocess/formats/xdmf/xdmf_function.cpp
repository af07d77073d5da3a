#include "preprocess/formats/xdmf/xdmf_function.h"

#include <algorithm>
#include <array>
#include <limits>
#include <numeric>
#include <span>
#include <utility>
#include <vector>

#include "preprocess/formats/common/element_source.h"
#include "stream/base/error.h"

namespace curvisplat {
namespace {

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();
constexpr uint64_t kCorners = 4;
constexpr uint64_t kSamplesAtOnce = 1 << 20, kNumbersAtOnce = 1 << 18, kMaxGap = 512;

/// The ends of the edges in VTK's order, and where UFC, by which FEniCS numbers, has the degrees of freedom of all ten points.
constexpr std::array<std::array<size_t, 2>, 6> kEdges{{{0, 1}, {1, 2}, {2, 0}, {0, 3}, {1, 3}, {2, 3}}};
constexpr std::array<size_t, 10> kDegreeOfPoint{0, 1, 2, 3, 9, 6, 8, 7, 5, 4};

/// Replaces indices of the values by these values.
void look(const XdmfCellNumbers& of, std::vector<double>& indices) {
  std::vector<size_t> order(indices.size());
  std::iota(order.begin(), order.end(), size_t{0});
  std::sort(order.begin(), order.end(), [&](size_t a, size_t b) { return indices[a] < indices[b]; });
  const auto indexAt = [&](size_t n) {
    const uint64_t index = pointNumber(indices[order[n]]);
    if (index >= of.values->size())
      throw Error("{} has the {} {}; expected one below {}; the file is damaged", of.where,
                  of.of_nodes ? "coordinate or value" : "degree of freedom", indices[order[n]],
                  of.values->size());
    return index;
  };
  std::vector<double> run;
  for (size_t from = 0; from < order.size();) {
    const uint64_t begin = indexAt(from);
    uint64_t end = begin + 1;
    size_t to = from + 1;
    for (; to < order.size() && indexAt(to) - end < kMaxGap; ++to) end = indexAt(to) + 1;
    run.resize(end - begin);
    of.values->read(begin, run);
    for (; from < to; ++from) indices[order[from]] = run[indexAt(from) - begin];
  }
}

/// Numbers of the file that a cell has.
uint64_t numbersOfCell(const XdmfCellNumbers& of) {
  return of.of_nodes ? of.given : of.given * of.components;
}

uint64_t cellsAtOnce(const XdmfCellNumbers& of) {
  return std::max<uint64_t>(1, kNumbersAtOnce / (of.given * of.components));
}

/// The values of some cells, [cell][component][given].
std::vector<double> readCells(const XdmfCellNumbers& of, uint64_t first, uint64_t count) {
  std::vector<double> indices(count * numbersOfCell(of));
  of.numbers->read(first * numbersOfCell(of), indices);
  if (of.of_nodes) {
    std::vector<double> of_tuples;
    const auto components = static_cast<double>(of.components);
    for (uint64_t cell = 0; cell < count; ++cell)
      for (double c = 0; c < components; ++c)
        for (uint64_t n = 0; n < of.given; ++n)
          of_tuples.push_back((indices[cell * of.given + n] - of.first_node) * components + c);
    indices.swap(of_tuples);
  }
  look(of, indices);
  return indices;
}

/// Values that are computed at the first read.
class SpooledValues : public XdmfValues {
 public:
  int valueBytes() const override { return of_.values->valueBytes(); }
  void read(uint64_t first, std::span<double> to) const override {
    bytes_.readAt(first * sizeof(double), std::as_writable_bytes(to));
  }

 protected:
  SpooledValues(const XdmfCellNumbers& of, uint64_t samples, const std::shared_ptr<SpoolFile>& spool)
      : XdmfValues({samples, of.components}, of.where),
        of_(of),
        bytes_(spool, size() * sizeof(double), [this](const SpoolFile::Sink& sink) { write(sink); }) {}
  virtual void write(const SpoolFile::Sink& sink) const = 0;

  const XdmfCellNumbers of_;

 private:
  const SpooledBytes bytes_;
};

class ValuesOfCells final : public SpooledValues {
 public:
  ValuesOfCells(const XdmfCellNumbers& of, uint64_t points, const std::shared_ptr<SpoolFile>& spool)
      : SpooledValues(of, of.cells * points, spool), points_(points) {}

 private:
  void write(const SpoolFile::Sink& sink) const override {
    std::vector<double> out;
    for (uint64_t first = 0; first < of_.cells; first += cellsAtOnce(of_)) {
      const uint64_t count = std::min(cellsAtOnce(of_), of_.cells - first);
      const std::vector<double> values = readCells(of_, first, count);
      out.clear();
      for (uint64_t cell = 0; cell < count; ++cell)
        for (size_t point = 0; point < points_; ++point)
          for (uint64_t c = 0; c < of_.components; ++c)
            out.push_back(
                at(std::span(values).subspan((cell * of_.components + c) * of_.given, of_.given), point));
      sink(std::as_bytes(std::span(out)));
    }
  }

  double at(std::span<const double> of_cell, size_t point) const {
    if (of_.given == kDegreeOfPoint.size()) return of_cell[of_.of_nodes ? point : kDegreeOfPoint[point]];
    if (point < of_.given) return of_cell[point];
    const auto& [a, b] = kEdges[point - kCorners];
    return (of_cell[a] + of_cell[b]) / 2;  // with the same bits from all cells at the edge
  }

  const uint64_t points_;
};

class ValuesAtNodes final : public SpooledValues {
 public:
  ValuesAtNodes(const XdmfCellNumbers& of, uint64_t nodes, std::shared_ptr<const XdmfValues> corners,
                const std::shared_ptr<SpoolFile>& spool)
      : SpooledValues(of, nodes, spool), corners_(std::move(corners)) {}

 private:
  void write(const SpoolFile::Sink& sink) const override {
    const uint64_t nodes = dims()[0], components = of_.components;
    std::vector<double> part, corners;
    for (uint64_t begin = 0; begin < nodes; begin += kSamplesAtOnce) {
      const uint64_t end = std::min(begin + kSamplesAtOnce, nodes);
      part.assign((end - begin) * components, kNaN);
      for (uint64_t first = 0; first < of_.cells; first += cellsAtOnce(of_)) {
        const uint64_t count = std::min(cellsAtOnce(of_), of_.cells - first);
        corners.resize(count * kCorners);
        corners_->read(first * kCorners, corners);
        const std::vector<double> values = readCells(of_, first, count);
        for (size_t n = 0; n < corners.size(); ++n) {
          const uint64_t node = pointNumber(corners[n], of_.first_node);
          for (uint64_t c = 0; node >= begin && node < end && c < components; ++c)
            part[(node - begin) * components + c] =
                values[(n / kCorners * components + c) * kCorners + n % kCorners];
        }
      }
      sink(std::as_bytes(std::span(part)));
    }
  }

  const std::shared_ptr<const XdmfValues> corners_;
};

}  // namespace

std::shared_ptr<const XdmfValues> xdmfOfCells(const XdmfCellNumbers& cells, uint64_t points,
                                              const std::shared_ptr<SpoolFile>& spool) {
  return std::make_shared<ValuesOfCells>(cells, points, spool);
}

std::shared_ptr<const XdmfValues> xdmfAtNodes(const XdmfCellNumbers& cells, uint64_t nodes,
                                              const std::shared_ptr<const XdmfValues>& corners,
                                              const std::shared_ptr<SpoolFile>& spool) {
  return std::make_shared<ValuesAtNodes>(cells, nodes, corners, spool);
}

}  // namespace curvisplat
