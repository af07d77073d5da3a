#include "preprocess/gradients/gradient_mesh.h"

#include <fmt/format.h>
#include <tbb/enumerable_thread_specific.h>
#include <glm/geometric.hpp>

#include <algorithm>
#include <bit>
#include <cmath>
#include <limits>

#include "preprocess/gather/cell_slopes.h"
#include "preprocess/gather/corner_gather.h"
#include "preprocess/gather/mesh_reader.h"
#include "preprocess/gather/point_numbers.h"
#include "preprocess/gather/point_sums.h"
#include "preprocess/shape/shape.h"
#include "stream/base/error.h"

namespace curvisplat {
namespace {

constexpr float kNone = std::numeric_limits<float>::quiet_NaN();
constexpr unsigned kGradients = kNeedsVelocityGradient | kNeedsPressureGradient;
constexpr size_t kRunSamples = 8192;  // that are written at once

/// A mesh with the flow as its scalars: density, velocity and pressure, those that are needed.
class FlowMesh final : public ForwardingMesh {
 public:
  FlowMesh(const MeshSource& source, const FlowInputs& inputs, const PerfectGas& gas,
           std::optional<float> blank_value, unsigned needs)
      : ForwardingMesh(source), inputs_(inputs), gas_(gas), blank_value_(blank_value) {
    needed_ = inputs.neededFor(needs);
    description_.scalars.clear();
    const auto add = [&](bool wanted, uint32_t field) {
      if (!wanted) return;
      GridScalar scalar;
      scalar.name = fmt::format("field {}", field);
      scalar.centring = inputs.centring;
      description_.scalars.push_back(scalar);
      fields_.push_back(field);
    };
    add((needs & kNeedsDensity) != 0, 0);
    for (uint32_t axis = 0; axis < 3; ++axis)
      add((needs & (kNeedsVelocity | kNeedsVelocityGradient)) != 0, 1 + axis);
    add((needs & (kNeedsPressure | kNeedsPressureGradient)) != 0, 4);
  }

  void readPoints(uint32_t piece, uint64_t first, uint64_t count, std::span<const uint32_t> scalars,
                  MeshPoints& out) const override {
    ForwardingMesh::readPoints(piece, first, count, sourceScalars(scalars), out);
    makeFlow(scalars, out.scalars);
  }
  void readCells(uint32_t piece, uint64_t first, uint64_t count, std::span<const uint32_t> scalars,
                 MeshCells& out) const override {
    ForwardingMesh::readCells(piece, first, count, sourceScalars(scalars), out);
    makeFlow(scalars, out.scalars);
  }

  /// The flow and its gradients from the values and gradients of the fields.
  void take(std::span<const double> values, std::span<const glm::dvec3> gradients, FlowState& flow,
            FlowGradients& of_flow) const {
    for (size_t n = 0; n < fields_.size(); ++n) {
      const auto axis = static_cast<int>(fields_[n]) - 1;
      if (fields_[n] == 0) {
        flow.density = values[n];
      } else if (axis < 3) {
        flow.velocity[axis] = values[n];
        of_flow.velocity[axis] = gradients[n];
      } else {
        flow.pressure = values[n];
        of_flow.pressure = gradients[n];
      }
    }
  }

 private:
  std::vector<uint32_t> sourceScalars(std::span<const uint32_t> scalars) const override {
    return scalars.empty() ? std::vector<uint32_t>{} : needed_;
  }

  void makeFlow(std::span<const uint32_t> scalars, std::vector<std::vector<float>>& values) const {
    if (scalars.empty()) return;
    const size_t count = values.empty() ? 0 : values[0].size();
    std::vector<std::vector<float>> flow(scalars.size(), std::vector<float>(count));
    for (size_t n = 0; n < count; ++n) {
      const auto input = [&](const std::optional<uint32_t>& scalar) -> double {
        const auto place = scalar ? std::find(needed_.begin(), needed_.end(), *scalar) : needed_.end();
        if (place == needed_.end()) return kNone;
        const float value = values[static_cast<size_t>(place - needed_.begin())][n];
        return blank_value_ && value == *blank_value_ ? kNone : value;
      };
      const FlowState state = flowFrom(inputs_, gas_, input);
      for (size_t s = 0; s < scalars.size(); ++s) {
        const uint32_t field = fields_[scalars[s]];
        flow[s][n] = static_cast<float>(field == 0   ? state.density
                                        : field == 4 ? state.pressure
                                                     : state.velocity[static_cast<int>(field) - 1]);
      }
    }
    values = std::move(flow);
  }

  const FlowInputs& inputs_;
  const PerfectGas& gas_;
  const std::optional<float> blank_value_;
  std::vector<uint32_t> needed_, fields_;
};

}  // namespace

/// One quantity of all samples, on disk. A hole of the file, which reads as zeros, is NaN: the bits are
/// stored that differ from NaN's.
class GradientMesh::Values {
 public:
  Values(const ScratchFiles& scratch, uint64_t samples) : file_(scratch) {
    if (samples > 0) put(samples - 1, std::vector<float>{kNone});
  }

  /// Any number of threads, of separate samples.
  void put(uint64_t first, std::vector<float> values) {
    for (float& value : values) value = std::bit_cast<float>(std::bit_cast<uint32_t>(value) ^ kBits);
    file_.out().writeAt(first * sizeof(float), std::as_bytes(std::span(values)));
  }
  void get(uint64_t first, std::span<float> values) const {
    file_.in().readAt(first * sizeof(float), values);
    for (float& value : values) value = std::bit_cast<float>(std::bit_cast<uint32_t>(value) ^ kBits);
  }
  /// Gives points that have become another one the value of that.
  void repeat(const PointNumbers& numbers, uint64_t points, const Progress& progress) {
    if (numbers.merged() == 0) return;
    std::vector<uint64_t> same_as;
    std::vector<float> run, others;
    uint64_t others_first = 0;
    for (uint64_t first = 0; first < points; first += kRunSamples) {
      progress.throwIfStopped();
      const auto count = static_cast<size_t>(std::min<uint64_t>(kRunSamples, points - first));
      same_as.resize(count);
      numbers.read(first, same_as);
      run.resize(count);
      get(first, run);
      for (size_t n = 0; n < count; ++n) {
        const uint64_t other = same_as[n];
        if (other >= first) {  // itself, or one that has its value by now
          run[n] = run[other - first];
          continue;
        }
        if (other < others_first || other >= others_first + others.size()) {
          others_first = other;
          others.resize(std::min<uint64_t>(kRunSamples, points - other));
          get(other, others);
        }
        run[n] = others[other - others_first];
      }
      put(first, run);
    }
  }

 private:
  static constexpr uint32_t kBits = std::bit_cast<uint32_t>(kNone);
  NamelessFile file_;
};

GradientMesh::GradientMesh(std::unique_ptr<MeshSource> source, const DerivedOptions& options,
                           std::filesystem::path folder)
    : ForwardingMesh(std::move(source)), scratch_(std::move(folder)) {
  GridDescription unchanged = description_;
  gas_ = gasOf(options, unchanged);
  if (options.blank_value) blank_value_ = static_cast<float>(*options.blank_value);
  inputs_ = findFlowInputs(description_);
  const size_t before = description_.scalars.size();
  for (const QuantityInfo& quantity : flowQuantities())
    if ((quantity.needs & kGradients) != 0 && offers(inputs_, quantity) &&
        addQuantity(quantity, inputs_.centring, before, description_))
      quantities_.push_back(quantity);
  uint64_t points = 0, cells = 0;
  for (const MeshPiece& piece : description_.pieces) {
    first_points_.push_back(points);
    first_cells_.push_back(cells);
    points += piece.points;
    cells += piece.cells;
  }
}

GradientMesh::~GradientMesh() = default;

std::vector<uint32_t> GradientMesh::sourceScalars(std::span<const uint32_t> scalars) const {
  std::vector<uint32_t> stored;
  for (const uint32_t scalar : scalars)
    if (scalar < source().description().scalars.size()) stored.push_back(scalar);
  return stored;
}

void GradientMesh::readPoints(uint32_t piece, uint64_t first, uint64_t count,
                              std::span<const uint32_t> scalars, MeshPoints& out) const {
  source().readPoints(piece, first, count, sourceScalars(scalars), out);
  insert(scalars, first_points_[piece] + first, count, out.scalars);
}

void GradientMesh::readCells(uint32_t piece, uint64_t first, uint64_t count,
                             std::span<const uint32_t> scalars, MeshCells& out) const {
  source().readCells(piece, first, count, sourceScalars(scalars), out);
  insert(scalars, first_cells_[piece] + first, count, out.scalars);
}

void GradientMesh::insert(std::span<const uint32_t> scalars, uint64_t first, uint64_t count,
                          std::vector<std::vector<float>>& values) const {
  const auto stored = static_cast<uint32_t>(source().description().scalars.size());
  for (size_t s = 0; s < scalars.size(); ++s) {
    if (scalars[s] < stored) continue;
    const Values& of_mesh = valuesOf(scalars[s] - stored);
    std::vector<float> here(count);
    of_mesh.get(first, here);
    values.insert(values.begin() + static_cast<ptrdiff_t>(s), std::move(here));
  }
}

void GradientMesh::prepare(std::span<const uint32_t> scalars, uint64_t memory_bytes,
                           const Progress& progress) const {
  ForwardingMesh::prepare(scalars, memory_bytes, progress);
  const auto stored = static_cast<uint32_t>(source().description().scalars.size());
  const MutexLock lock(mutex_);
  for (const uint32_t scalar : scalars) {
    if (scalar < stored) continue;
    std::unique_ptr<Values>& known = values_[scalar - stored];
    if (!known) known = compute(quantities_.at(scalar - stored), memory_bytes, progress);
  }
}

MeshSource::Preparation GradientMesh::preparationFor(std::span<const uint32_t> scalars) const {
  Preparation preparation = ForwardingMesh::preparationFor(scalars);
  preparation.centring = inputs_.centring;
  const auto stored = static_cast<uint32_t>(source().description().scalars.size());
  const MutexLock lock(mutex_);
  for (const uint32_t scalar : scalars) {
    if (scalar < stored || values_.contains(scalar - stored)) continue;
    const FlowMesh flow_mesh(source(), inputs_, gas_, blank_value_, quantities_.at(scalar - stored).needs);
    preparation.fields = std::max(preparation.fields, flow_mesh.description().scalars.size());
    ++preparation.values;
  }
  return preparation;
}

const GradientMesh::Values& GradientMesh::valuesOf(uint32_t quantity_number) const {
  const MutexLock lock(mutex_);
  const auto found = values_.find(quantity_number);
  CURVISPLAT_CHECK(found != values_.end() && found->second);
  return *found->second;
}

std::unique_ptr<GradientMesh::Values> GradientMesh::compute(const QuantityInfo& quantity,
                                                            uint64_t memory_bytes,
                                                            const Progress& outer_progress) const {
  const FlowMesh flow_mesh(source(), inputs_, gas_, blank_value_, quantity.needs);
  const size_t fields = flow_mesh.description().scalars.size();
  std::vector<uint32_t> all(fields);
  for (uint32_t n = 0; n < fields; ++n) all[n] = n;
  const MeshReader reader(flow_mesh, all, std::nullopt);
  const bool cells = inputs_.centring == Centring::kCell;
  auto values = std::make_unique<Values>(scratch_, cells ? reader.cells() : reader.points());
  Progress progress;  // the outer one counts samples of another pass
  progress.stopWith(outer_progress);
  const PointNumbers numbers(reader, memory_bytes / 2, scratch_, progress);

  struct Run {  // samples that follow one another
    uint64_t first = 0;
    std::vector<float> values;
  };
  tbb::enumerable_thread_specific<Run> runs;
  const TakeSplat take = [&](const NodeSplat& splat, std::span<const SplatScalar> of_fields) {
    std::vector<double> here(fields);
    std::vector<glm::dvec3> gradients(fields);
    for (size_t n = 0; n < fields; ++n) {
      gradients[n] = gradientOf(splat.splat, of_fields[n].slope);
      here[n] = of_fields[n].mean + glm::dot(gradients[n], splat.node_position - splat.splat.position);
    }
    FlowState flow;
    FlowGradients of_flow;
    flow_mesh.take(here, gradients, flow, of_flow);
    Run& run = runs.local();
    if (!run.values.empty() &&
        (run.first + run.values.size() != splat.node || run.values.size() == kRunSamples)) {
      values->put(run.first, std::move(run.values));
      run.values.clear();
    }
    if (run.values.empty()) run.first = splat.node;
    run.values.push_back(static_cast<float>(flowQuantity(quantity.quantity, flow, of_flow, gas_, 0)));
  };
  if (!chunk_bytes_) chunk_bytes_ = MeshReader(source(), {}, std::nullopt).largestChunk();
  const uint64_t half = halfBesideChunks(memory_bytes, *chunk_bytes_);
  CornerGather gather(reader, numbers, half, scratch_, progress);
  if (cells) {
    CellSlopes slopes(reader.cells(), fields, half, scratch_);
    gather.forEach([&](const GatheredCells& some) { slopes.add(some); });
    slopes.finish(take, SlabCells::kWhole, HangingNodes::kAsOthers, progress);
  } else {
    PointSums sums(reader.points(), reader.cells(), fields, half, scratch_);
    gather.forEach([&](const GatheredCells& some) { sums.add(some); });
    sums.finish(take, HangingNodes::kAsOthers, progress);
  }
  for (Run& run : runs)
    if (!run.values.empty()) values->put(run.first, std::move(run.values));
  if (!cells) values->repeat(numbers, reader.points(), progress);
  return values;
}

}  // namespace curvisplat
