#include "render/surface/iso_splats.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <glm/matrix.hpp>
#include <numeric>

#include "render/project/footprint.h"
#include "render/project/splat_pieces.h"
#include "render/project/tile_set.h"

namespace curvisplat {
namespace {

constexpr auto kSupport = static_cast<float>(kKernelSupport);
constexpr float kMaxRatio = 1000;  // of V to √det S: beyond it a splat is degenerate
// A neighbour whose linear field just misses the value has a part in the mean of all as well.
constexpr float kMargin = 1.25f, kDeviations = 2;

glm::mat3 factorOf(const Shape& s) {
  return {s.axis0, s.axis0 * s.shear10, s.axis0 * s.shear20, 0, s.axis1, s.axis1 * s.shear21, 0, 0, s.axis2};
}

/// A⁻¹ x.
glm::dvec3 inFrame(const Shape& s, const glm::dvec3& x) {
  const double u0 = x.x / s.axis0, u1 = (x.y - double{s.axis0} * s.shear10 * u0) / s.axis1;
  return {u0, u1, (x.z - double{s.axis0} * s.shear20 * u0 - double{s.axis1} * s.shear21 * u1) / s.axis2};
}

glm::vec3 vectorOf(const Slope& w) {
  return {w.w0, w.w1, w.w2};
}

}  // namespace

IsoSplats::IsoSplats(const Settings& settings, size_t parts)
    : settings_(settings),
      columns_((static_cast<size_t>(settings.view.size.width) + kTileSide - 1) / kTileSide),
      parts_(parts) {}

void IsoSplats::add(size_t part, const glm::dvec3& cell_min, const GeometryArrays<const float>& geometry,
                    const VariableArrays<const float>& variable, const VariableArrays<const float>* other,
                    std::span<const SplatRange> ranges) {
  if (overflowed()) return;
  const auto wholeOf = [&](const VariableArrays<const float>& values, size_t i) {
    return SplatPiece{{geometry.x[i], geometry.y[i], geometry.z[i]},
                      shapeOf(geometry, i),
                      slopeOf(values, i),
                      values.mean[i],
                      geometry.weight[i]};
  };
  Part& out = parts_[part];
  BorderPieces pieces, others;
  for (const SplatRange& range : ranges)
    for (size_t i = range.begin; i < range.end; ++i) {
      const uint32_t border_code = geometry.border_code[i];
      const float deviation = std::sqrt(std::max(variable.variance[i], 0.0f));
      const bool plain = border_code == kNoBorder;
      const SplatPiece whole = wholeOf(variable, i);
      if (!mayHold(whole, kSupport + (plain ? 0 : static_cast<float>(kMergedReach)), deviation)) continue;
      size_t count = 1;
      pieces[0] = whole;
      if (other) others[0] = wholeOf(*other, i);
      if (!plain) {
        count = partsAtBorder(whole, border_code, settings_.borders, pieces);
        if (other) partsAtBorder(others[0], border_code, settings_.borders, others);
      }
      for (size_t n = 0; n < count; ++n)
        addPiece(out, cell_min, pieces[n], other ? &others[n] : nullptr, deviation);
    }
}

bool IsoSplats::mayHold(const SplatPiece& piece, float reach, float deviation) const {
  const double spread = kMargin * reach * glm::length(vectorOf(piece.slope)) + kDeviations * deviation;
  return std::any_of(settings_.values.begin(), settings_.values.end(),
                     [&](double value) { return std::abs(piece.mean - value) <= spread; });
}

void IsoSplats::addPiece(Part& part, const glm::dvec3& cell_min, const SplatPiece& piece,
                         const SplatPiece* other, float deviation) {
  if (!mayHold(piece, kSupport, deviation)) return;
  const Shape& s = piece.shape;
  const float ratio = piece.weight / (s.axis0 * s.axis1 * s.axis2);
  if (!(ratio > 0 && std::isfinite(ratio))) return;
  IsoSplat splat;
  splat.weight = std::min(ratio, kMaxRatio);
  if (!place(cell_min + glm::dvec3(piece.position), s, splat)) return;
  const size_t tiles = forTiles(splat, [](size_t) {});
  if (tiles == 0) return;
  splat.mean = static_cast<float>(piece.mean - base());
  splat.slope = vectorOf(piece.slope);
  splat.other_mean = other ? other->mean : piece.mean;
  splat.other_slope = vectorOf(other ? other->slope : piece.slope);
  splat.first_face = static_cast<uint32_t>(part.faces.size());
  splat.faces = static_cast<uint32_t>(piece.faces.count);
  part.faces.insert(part.faces.end(), piece.faces.begin(), piece.faces.end());
  bytes_.fetch_add(sizeof(IsoSplat) + splat.faces * sizeof(CutFace) + tiles * sizeof(Placed),
                   std::memory_order_relaxed);
  if (!overflowed()) part.splats.push_back(splat);
}

/// Finds the place of a splat; false if no pixel can see it.
bool IsoSplats::place(const glm::dvec3& centre, const Shape& shape, IsoSplat& splat) const {
  const ScreenView& view = settings_.view;
  splat.centre = view.viewFromData(centre);
  const glm::dvec3 axes[3] = {view.right, view.down, view.forward};
  glm::vec3* const moves[3] = {&splat.by_right, &splat.by_down, &splat.by_forward};
  glm::dvec3 reach;
  const glm::mat3 factor = factorOf(shape);
  for (int n = 0; n < 3; ++n) {
    *moves[n] = glm::vec3(inFrame(shape, axes[n] / view.scale));
    reach[n] =
        kKernelSupport * glm::length(glm::dvec3(glm::transpose(factor) * glm::vec3(view.scale * axes[n])));
    if (!std::isfinite(glm::dot(*moves[n], *moves[n])) || !std::isfinite(reach[n])) return false;
  }
  glm::dvec2 lower, upper;
  const glm::dvec2 middle(0.5 * view.size.width, 0.5 * view.size.height);
  if (view.projection == Projection::kPerspective) {
    const double near = splat.centre.z - reach.z, far = splat.centre.z + reach.z;
    if (far <= view.near) return false;
    const double nearest = std::max(near, view.near);
    for (int n = 0; n < 2; ++n) {
      const double from = splat.centre[n] - reach[n], to = splat.centre[n] + reach[n];
      lower[n] = middle[n] + view.focal_px * std::min(from / nearest, from / far);
      upper[n] = middle[n] + view.focal_px * std::max(to / nearest, to / far);
    }
  } else {
    lower = middle + view.focal_px * (glm::dvec2(splat.centre) - glm::dvec2(reach));
    upper = middle + view.focal_px * (glm::dvec2(splat.centre) + glm::dvec2(reach));
    splat.centre.z -= settings_.depth_origin;
  }
  if (!(upper.x >= 0 && upper.y >= 0 && lower.x <= view.size.width && lower.y <= view.size.height))
    return false;
  splat.near = static_cast<float>(splat.centre.z - reach.z);
  splat.x0 = static_cast<float>(lower.x);
  splat.y0 = static_cast<float>(lower.y);
  splat.x1 = static_cast<float>(upper.x);
  splat.y1 = static_cast<float>(upper.y);
  return true;
}

IsoSplats::TileBox IsoSplats::tilesOf(const IsoSplat& splat) const {
  const ImageSize size = settings_.view.size;
  const auto tileAt = [](float at, int pixels) {
    return static_cast<size_t>(std::clamp(at, 0.0f, static_cast<float>(pixels - 1))) / kTileSide;
  };
  return {tileAt(splat.x0 - 1, size.width), tileAt(splat.y0 - 1, size.height),
          tileAt(splat.x1 + 1, size.width), tileAt(splat.y1 + 1, size.height)};
}

/// Calls take(tile) for those of the range; how many.
template <typename Take>
size_t IsoSplats::forTiles(const IsoSplat& splat, const Take& take) const {
  const TileBox box = tilesOf(splat);
  const TileRange& range = settings_.tiles;
  size_t count = 0;
  for (size_t row = box.y0; row <= box.y1; ++row) {
    const size_t begin = std::max(row * columns_ + box.x0, range.begin);
    const size_t end = std::min(row * columns_ + box.x1 + 1, range.end);
    for (size_t tile = begin; tile < end; ++tile, ++count) take(tile - range.begin);
  }
  return count;
}

void IsoSplats::sort() {
  begins_.assign(settings_.tiles.count() + 1, 0);
  for (const Part& part : parts_)
    for (const IsoSplat& splat : part.splats) forTiles(splat, [&](size_t tile) { ++begins_[tile + 1]; });
  for (size_t tile = 1; tile < begins_.size(); ++tile) begins_[tile] += begins_[tile - 1];
  std::vector<size_t> ends(begins_.begin(), begins_.end() - 1);
  placed_.resize(begins_.back());
  for (const Part& part : parts_)
    for (const IsoSplat& splat : part.splats)
      forTiles(splat, [&](size_t tile) {
        placed_[ends[tile]++] = {&splat, std::span(part.faces).subspan(splat.first_face, splat.faces)};
      });
  tbb::parallel_for(size_t{0}, settings_.tiles.count(), [&](size_t n) {
    const auto at = [&](size_t place) { return placed_.begin() + static_cast<std::ptrdiff_t>(place); };
    // By their places where they are equal: those of a part lie one after the other.
    std::stable_sort(at(begins_[n]), at(begins_[n + 1]),
                     [](const Placed& a, const Placed& b) { return a.splat->near < b.splat->near; });
  });
}

uint64_t IsoSplats::count() const {
  return std::accumulate(parts_.begin(), parts_.end(), uint64_t{0},
                         [](uint64_t sum, const Part& part) { return sum + part.splats.size(); });
}

std::span<const IsoSplats::Placed> IsoSplats::inTile(size_t tile) const {
  const size_t n = tile - settings_.tiles.begin;
  return std::span(placed_).subspan(begins_[n], begins_[n + 1] - begins_[n]);
}

}  // namespace curvisplat
