#include "tools/python/cache_arrays.h"

#include <tbb/info.h>

#include <algorithm>
#include <cmath>
#include <glm/mat3x3.hpp>
#include <glm/matrix.hpp>
#include <limits>
#include <memory>
#include <utility>
#include <vector>

#include "render/export/field_sampler.h"
#include "stream/base/error.h"
#include "tools/options/point_values.h"
#include "tools/output/start_checks.h"
#include "tools/python/interruptible.h"

namespace py = pybind11;

namespace curvisplat::python {
namespace {

constexpr uint64_t kMaxPoints = uint64_t{1} << 31;
constexpr uint32_t kMaxSlab = 4;          // planes
constexpr uint64_t kReturnedBytes = 8;    // of a point
constexpr uint64_t kMinBytes = 64 << 20;  // that sampling may take; or a quarter of what is returned

/// A numpy array that owns the values.
template <typename T>
py::array_t<T> arrayOf(std::vector<T> values, std::vector<py::ssize_t> shape) {
  auto kept = std::make_unique<std::vector<T>>(std::move(values));
  const py::capsule owner(kept.get(), [](void* at) { delete static_cast<std::vector<T>*>(at); });
  const T* data = kept.release()->data();
  return py::array_t<T>(std::move(shape), data, owner);
}

CacheReader openedAt(const CacheReader& cache, uint64_t step) {
  const size_t steps = cache.series().steps.size();
  if (step >= steps)
    throw UsageError("{}: there is no step {}; the last one is {}", cache.cachePath().string(), step,
                     steps - 1);
  return cache.atStep(step);
}

SampleLattice latticeOf(const DataChoice& choice, const std::array<uint32_t, 3>& size) {
  SampleLattice lattice;
  lattice.size = size;
  uint64_t points = 1;
  for (int axis = 0; axis < 3; ++axis) {
    const auto n = static_cast<size_t>(axis);
    if (size[n] == 0 || size[n] > kMaxPoints) throw UsageError("a size of {}: expected at least 1", size[n]);
    points = std::min(kMaxPoints + 1, points * size[n]);
    const double extent = choice.upper[n] - choice.lower[n];
    if (!(extent > 0 && std::isfinite(extent)))
      throw UsageError("a box from {} to {} is empty", choice.lower[n], choice.upper[n]);
    lattice.spacing[axis] = extent / size[n];
    lattice.origin[axis] = choice.lower[n] + 0.5 * lattice.spacing[axis];
  }
  if (points > kMaxPoints) throw UsageError("a lattice of more than {} points", kMaxPoints);
  return lattice;
}

struct SweepPlan {
  uint32_t slab = 1;
  unsigned threads = 1;
};

/// Thick slabs on all threads read a brick seldom and fast; what they take is kept small beside what is returned, or
/// to a plane at a time.
SweepPlan sweepPlanOf(const SampleLattice& lattice) {
  const uint64_t returned = kReturnedBytes * lattice.planePoints() * lattice.size[2];
  const uint64_t bytes = std::max(kMinBytes, returned / 4);
  const auto wanted = static_cast<unsigned>(tbb::info::default_concurrency());
  for (uint32_t slab = kMaxSlab; slab > 1; slab /= 2)
    if (FieldSampler::threadsWithin(bytes, lattice, slab, wanted) == wanted) return {slab, wanted};
  return {1, std::max(1u, FieldSampler::threadsWithin(bytes, lattice, 1, wanted))};
}

/// The splats of a level, as they come.
struct Points {
  std::vector<double> positions;
  std::vector<float> values, volumes, shapes;

  void add(const glm::dvec3& at, float value, float volume, const glm::dmat3& shape) {
    for (int axis = 0; axis < 3; ++axis) positions.push_back(at[axis]);
    values.push_back(value);
    volumes.push_back(volume);
    for (int column = 0; column < 3; ++column)
      for (int row = 0; row < 3; ++row) shapes.push_back(static_cast<float>(shape[column][row]));
  }
};

void addBrick(const CacheReader& cache, uint32_t brick, size_t variable, const DataChoice& choice,
              Points& out) {
  SplatGeometry g;
  SplatVariable v;
  cache.readGeometry(brick, g);
  cache.readVariable(brick, variable, v);
  const glm::dvec3 corner = cache.manifest().root.cellMin(cache.bricks()[brick].cell);
  for (size_t n = 0; n < g.size(); ++n) {
    const glm::dvec3 at = corner + glm::dvec3(g.x[n], g.y[n], g.z[n]);
    bool inside = true;
    for (int axis = 0; axis < 3; ++axis)
      inside = inside && at[axis] >= choice.lower[static_cast<size_t>(axis)] &&
               at[axis] <= choice.upper[static_cast<size_t>(axis)];
    if (!inside) continue;
    Splat splat;
    splat.axis = {g.axis0[n], g.axis1[n], g.axis2[n]};
    splat.shear = {g.shear10[n], g.shear20[n], g.shear21[n]};
    const glm::dmat3 a = splat.factor();
    out.add(at, v.mean[n], g.weight[n], a * glm::transpose(a));
  }
}

}  // namespace

py::tuple sampledArrays(const CacheReader& cache, const DataChoice& choice,
                        const std::array<uint32_t, 3>& size, const py::object& progress) {
  const SampleLattice lattice = latticeOf(choice, size);
  FieldSamples all;
  requireThreads();
  runInterruptibly(progress, [&](Progress& of_work) {
    const CacheReader at_step = openedAt(cache, choice.step);
    const double widest = std::max({lattice.spacing.x, lattice.spacing.y, lattice.spacing.z});
    std::vector<uint32_t> bricks =
        choice.level ? bricksOfLevel(at_step, *choice.level) : bricksOfDetail(at_step, 0.5 * widest);
    const FieldSampler sampler(at_step, at_step.variableNamed(choice.scalar), std::move(bricks), lattice);
    all.value.reserve(lattice.planePoints() * lattice.size[2]);
    all.density.reserve(all.value.capacity());
    const SweepPlan plan = sweepPlanOf(lattice);
    sampler.sweep(plan.slab, plan.threads, of_work, [&](uint32_t, uint32_t, const FieldSamples& planes) {
      all.value.insert(all.value.end(), planes.value.begin(), planes.value.end());
      all.density.insert(all.density.end(), planes.density.begin(), planes.density.end());
    });
  });
  const std::vector<py::ssize_t> shape{size[2], size[1], size[0]};
  return py::make_tuple(arrayOf(std::move(all.value), shape), arrayOf(std::move(all.density), shape));
}

py::tuple pointArrays(const CacheReader& cache, const DataChoice& choice, const py::object& progress) {
  Points points;
  runInterruptibly(progress, [&](Progress& of_work) {
    const CacheReader at_step = openedAt(cache, choice.step);
    const size_t variable = at_step.variableNamed(choice.scalar);
    const uint32_t level = choice.level.value_or(at_step.manifest().levels - 1);
    const glm::dvec3 lower(choice.lower[0], choice.lower[1], choice.lower[2]),
        upper(choice.upper[0], choice.upper[1], choice.upper[2]);
    const auto bricks = bricksInBox(at_step, bricksOfLevel(at_step, level), lower, upper);
    of_work.begin("reading", bricks.size(), "bricks");
    for (const uint32_t brick : bricks) {
      addBrick(at_step, brick, variable, choice, points);
      of_work.advance(1);
    }
    of_work.end();
  });
  const auto count = static_cast<py::ssize_t>(points.values.size());
  return py::make_tuple(
      arrayOf(std::move(points.positions), {count, 3}), arrayOf(std::move(points.values), {count}),
      arrayOf(std::move(points.volumes), {count}), arrayOf(std::move(points.shapes), {count, 3, 3}));
}

py::tuple probedArrays(const std::vector<std::shared_ptr<const CacheReader>>& sets,
                       const std::vector<std::array<double, 3>>& points,
                       const std::optional<std::vector<std::filesystem::path>>& source) {
  std::vector<glm::dvec3> at;
  at.reserve(points.size());
  for (const std::array<double, 3>& point : points) at.emplace_back(point[0], point[1], point[2]);
  std::vector<SetValues> of_sets;
  std::vector<std::string> names;
  PointSource from;
  const PointSource* const exact = source ? &from : nullptr;
  std::optional<UnlockedWork> unlocked(std::in_place);
  if (source) setSource(*sets.front(), *source, from.grid);
  std::vector<CacheReader> at_step;
  at_step.reserve(sets.size());
  for (const auto& set : sets) {
    const StepPosition& position = sets.front()->position();
    const bool has_ended = position.step >= set->series().steps.size();
    at_step.push_back(set->at(has_ended ? set->position() : position));
    SetValues of_set{&at_step.back(), exact, {}, has_ended};
    of_set.found.resize(at.size());
    if (!has_ended) of_set.found = valuesAt(*of_set.reader, at, exact);
    of_sets.push_back(std::move(of_set));
    for (const VariableInfo& variable : set->manifest().variables) names.push_back(variable.name);
  }
  const auto found = sets.size() == 1 ? std::move(of_sets.front().found) : joinedValues(of_sets);
  unlocked.reset();
  const auto count = static_cast<py::ssize_t>(at.size());
  py::array_t<uint32_t> block(count);
  py::array_t<uint64_t> index({count, py::ssize_t{3}});
  py::array_t<double> place({count, py::ssize_t{3}});
  constexpr double kNone = std::numeric_limits<double>::quiet_NaN();
  py::dict values, sample_values;
  for (size_t v = 0; v < names.size(); ++v) {
    py::array_t<double> here(count), there(count);
    for (size_t n = 0; n < at.size(); ++n) {
      here.mutable_data()[n] = found[n] ? found[n]->values[v] : kNone;
      there.mutable_data()[n] = found[n] ? found[n]->sample[v] : kNone;
    }
    const py::str name(names[v]);
    values[name] = here;
    sample_values[name] = there;
  }
  for (size_t n = 0; n < at.size(); ++n) {
    const PointValues one = found[n].value_or(PointValues());
    block.mutable_data()[n] = found[n] ? one.block + 1 : 0;
    const std::array<uint64_t, 3> of_sample{one.i, one.j, one.k};
    for (int axis = 0; axis < 3; ++axis) {
      const auto a = static_cast<size_t>(axis);
      index.mutable_data()[3 * n + a] = of_sample[a];
      place.mutable_data()[3 * n + a] = found[n] ? one.place[axis] : kNone;
    }
  }
  return py::make_tuple(values, block, index, place, sample_values);
}

}  // namespace curvisplat::python
