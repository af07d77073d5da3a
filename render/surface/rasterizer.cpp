#include "render/surface/rasterizer.h"

#include <algorithm>
#include <cmath>
#include <utility>
#include <vector>

#include "render/mesh/curve_set.h"

namespace curvisplat {
namespace {

constexpr int kGrid = 16;  // to a pixel
// Pixels: triangles that reach beyond are clipped there, so that double is exact.
constexpr float kGuard = 1e5f;
constexpr size_t kAtOnce = 1024;
constexpr uint32_t kReach = 16;  // capsules of a line that may lie in one another

/// To even where it lies between two. (Without SSE4 the library's function is a call.)
int nearestWhole(float value) {
  constexpr double kMagic = 6755399441055744.0;  // 1.5 * 2^52
  return static_cast<int>((static_cast<double>(value) + kMagic) - kMagic);
}

/// The part of a polygon where sign * (x or y) <= kGuard.
void clipToGuard(std::vector<ScreenVertex>& polygon, float ScreenVertex::*axis, float sign) {
  std::vector<ScreenVertex> kept;
  for (size_t n = 0; n < polygon.size(); ++n) {
    const ScreenVertex &a = polygon[n], &b = polygon[(n + 1) % polygon.size()];
    const bool a_in = sign * a.*axis <= kGuard, b_in = sign * b.*axis <= kGuard;
    if (a_in) kept.push_back(a);
    if (a_in == b_in) continue;
    const float part = (sign * kGuard - a.*axis) / (b.*axis - a.*axis);
    ScreenVertex cut{std::lerp(a.x, b.x, part), std::lerp(a.y, b.y, part), std::lerp(a.value, b.value, part)};
    cut.*axis = sign * kGuard;
    kept.push_back(cut);
  }
  polygon = std::move(kept);
}

}  // namespace

bool SampleTile::draw(const SceneTriangles& triangles, const TriangleBins& bins, int column, int row,
                      const SampleTile* before, const std::function<void()>& throw_if_stopped) {
  x0_ = column * kSampleTileWidth;
  y0_ = row * kSampleTileHeight;
  x1_ = std::min(x0_ + kSampleTileWidth, triangles.view().size.width) - 1;
  y1_ = std::min(y0_ + kSampleTileHeight, triangles.view().size.height) - 1;
  before_ = before;
  capsules_.clear();
  bool cleared = false;
  size_t last = 0;  // surface
  std::array<uint32_t, kAtOnce> numbers;
  const bool any = bins.forTile(column, row, [&](size_t surface, std::span<const TriangleRun> seen) {
    if (!std::exchange(cleared, true)) {
      PixelSamples nothing;
      nothing.values.fill(INFINITY);
      nothing.numbers.fill(PixelSamples::kNothing);
      std::fill(samples_.begin(), samples_.end(), nothing);
      depths_.clear();
    }
    if (std::exchange(last, surface) != surface) drawTaken(triangles, throw_if_stopped);
    size_t taken = 0;
    const auto takeNumbers = [&] {
      const std::span<const uint32_t> of_surface = std::span(numbers).first(std::exchange(taken, 0));
      if (!triangles.isCurve(surface)) {
        if (throw_if_stopped) throw_if_stopped();
        drawSurface(triangles, surface, of_surface);
        return;
      }
      takeCapsules(triangles, surface, of_surface);
      if (capsules_.size() > CapsuleQueue::kMaxSize - kAtOnce) drawTaken(triangles, throw_if_stopped);
    };
    for (const TriangleRun& run : seen)
      for (uint32_t n = 0; n < run.count; ++n) {
        numbers[taken++] = run.first + n;
        if (taken == kAtOnce) takeNumbers();
      }
    if (taken > 0) takeNumbers();
  });
  drawTaken(triangles, throw_if_stopped);
  // All of it may lie before what is asked for.
  return any && (!before || std::any_of(samples_.begin(), samples_.end(), [](const PixelSamples& pixel) {
           return std::any_of(pixel.numbers.begin(), pixel.numbers.end(),
                              [](uint32_t number) { return number != PixelSamples::kNothing; });
         }));
}

SampleBox SampleTile::box() {
  return {samples_.data(), before_ ? before_->samples_.data() : nullptr, x0_, y0_, x1_, y1_};
}

void SampleTile::drawSurface(const SceneTriangles& triangles, size_t surface,
                             std::span<const uint32_t> numbers) {
  const TriangleMesh& mesh = *triangles.scene().surfaces[surface].mesh;
  const std::vector<ScreenVertex>& vertices = triangles.verticesOf(surface);
  std::array<uint32_t, kAtOnce> left;
  const size_t count = drawSmallTriangles(
      {vertices.data(), mesh.triangles.data(), numbers, triangles.firstOf(surface)}, box(), left.data());
  for (size_t n = 0; n < count; ++n) {
    const auto& corners = mesh.triangles[left[n]];
    const uint32_t number = triangles.firstOf(surface) + left[n];
    const std::array<ScreenVertex, 3> at{vertices[corners[0]], vertices[corners[1]], vertices[corners[2]]};
    if (!std::isnan(at[0].value + at[1].value + at[2].value)) {
      drawTriangle(at, number);
      continue;
    }
    const NearPolygon polygon = triangles.behindNear(surface, corners);
    for (size_t v = 2; v < polygon.count; ++v)
      drawTriangle({polygon.vertices[0], polygon.vertices[v - 1], polygon.vertices[v]}, number);
  }
}

std::span<const CapsuleQueue::Entry> CapsuleQueue::sorted() {
  constexpr size_t kBins = 1024;
  const auto valueOf = [](const Entry& entry) {
    return std::min(entry.capsule.a.value, entry.capsule.b.value);
  };
  float least = INFINITY, most = -INFINITY;
  for (const Entry& entry : entries_) {
    least = std::min(least, valueOf(entry));
    most = std::max(most, valueOf(entry));
  }
  const float per_value = most > least ? (kBins - 1) / (most - least) : 0;
  const auto binOf = [&](const Entry& entry) {
    return static_cast<size_t>(std::clamp((valueOf(entry) - least) * per_value, 0.0f, float{kBins - 1}));
  };
  std::array<uint32_t, kBins + 1> begins{};
  for (const Entry& entry : entries_) ++begins[binOf(entry) + 1];
  for (size_t bin = 1; bin < kBins; ++bin) begins[bin] += begins[bin - 1];
  sorted_.resize(entries_.size());
  for (const Entry& entry : entries_) sorted_[begins[binOf(entry)]++] = entry;
  return sorted_;
}

void SampleTile::takeCapsules(const SceneTriangles& triangles, size_t curve,
                              std::span<const uint32_t> points) {
  const std::vector<uint32_t>& lines = triangles.curvesOf(curve).set->begins;
  const uint32_t first = triangles.firstOf(curve);
  auto line_end = lines.begin();
  for (const uint32_t point : points) {
    const uint32_t begin = triangles.beginOf(curve, point);
    if (begin == SceneTriangles::kNoCapsule) continue;
    const Capsule capsule = triangles.capsuleOf(curve, point);
    if (std::isnan(capsule.a.value + capsule.b.value)) continue;
    NumberRange inside{};
    if (before_) {
      if (!(point < *line_end)) line_end = std::upper_bound(line_end, lines.end(), point);
      const uint32_t reach = kReach * (point - begin + 1), line = *(line_end - 1);
      inside = {first + (point - line > reach ? point - reach : line),
                first + std::min(point + reach, *line_end - 1)};
    }
    capsules_.add({capsule, first + point, inside});
  }
}

/// Draws the capsules that were taken, of the curve that has the first one.
void SampleTile::drawTaken(const SceneTriangles& triangles, const std::function<void()>& throw_if_stopped) {
  if (capsules_.size() == 0) return;
  const std::span<const CapsuleQueue::Entry> entries = capsules_.sorted();
  const size_t curve = triangles.placeOf(entries.front().number).surface;
  std::array<Capsule, kAtOnce> capsules;
  std::array<uint32_t, kAtOnce> numbers;
  std::array<NumberRange, kAtOnce> insides;
  for (size_t begin = 0; begin < entries.size(); begin += kAtOnce) {
    const size_t count = std::min(kAtOnce, entries.size() - begin);
    for (size_t n = 0; n < count; ++n) {
      capsules[n] = entries[begin + n].capsule;
      numbers[n] = entries[begin + n].number;
      insides[n] = entries[begin + n].inside;
    }
    if (throw_if_stopped) throw_if_stopped();
    drawCapsules({std::span(capsules).first(count), numbers.data(), insides.data(), depths_},
                 triangles.lookOf(curve), box());
  }
  capsules_.clear();
}

/// Coordinates in 1/16 pixel.
struct SampleTile::Setup {
  std::array<double, 3> x, y;  // turning so that the inside is positive
  int x0, y0, x1, y1;          // pixels, the last included
  double value, by_x, by_y;    // at the centre of pixel (x0, y0), and a pixel
};

void SampleTile::drawTriangle(const std::array<ScreenVertex, 3>& corners, uint32_t number) {
  float farthest = 0;
  for (const ScreenVertex& corner : corners)
    farthest = std::max({farthest, std::abs(corner.x), std::abs(corner.y)});
  if (!(farthest < INFINITY)) return;
  if (farthest <= kGuard) return drawGuarded(corners, number);
  std::vector<ScreenVertex> polygon(corners.begin(), corners.end());
  for (const auto axis : {&ScreenVertex::x, &ScreenVertex::y})
    for (const float sign : {-1.0f, 1.0f}) clipToGuard(polygon, axis, sign);
  for (size_t n = 2; n < polygon.size(); ++n) drawGuarded({polygon[0], polygon[n - 1], polygon[n]}, number);
}

void SampleTile::drawGuarded(const std::array<ScreenVertex, 3>& corners, uint32_t number) {
  Setup setup;
  std::array<int, 3> grid_x, grid_y;
  for (size_t n = 0; n < 3; ++n) {
    grid_x[n] = nearestWhole(corners[n].x * float{kGrid});
    grid_y[n] = nearestWhole(corners[n].y * float{kGrid});
    setup.x[n] = grid_x[n];
    setup.y[n] = grid_y[n];
  }
  // The outermost samples are 7/16 from the centre.
  constexpr int kGridBits = 4;
  static_assert(1 << kGridBits == kGrid);
  setup.x0 = std::max(x0_, (std::min({grid_x[0], grid_x[1], grid_x[2]}) - 1) >> kGridBits);
  setup.x1 = std::min(x1_, std::max({grid_x[0], grid_x[1], grid_x[2]}) >> kGridBits);
  setup.y0 = std::max(y0_, (std::min({grid_y[0], grid_y[1], grid_y[2]}) - 1) >> kGridBits);
  setup.y1 = std::min(y1_, std::max({grid_y[0], grid_y[1], grid_y[2]}) >> kGridBits);
  if (setup.x0 > setup.x1 || setup.y0 > setup.y1) return;

  const double area = (setup.x[1] - setup.x[0]) * (setup.y[2] - setup.y[0]) -
                      (setup.y[1] - setup.y[0]) * (setup.x[2] - setup.x[0]);
  if (area == 0) return;
  // The value's plane is the exact triangle's, where that has an area.
  const double dx1 = static_cast<double>(corners[1].x) - static_cast<double>(corners[0].x);
  const double dy1 = static_cast<double>(corners[1].y) - static_cast<double>(corners[0].y);
  const double dx2 = static_cast<double>(corners[2].x) - static_cast<double>(corners[0].x);
  const double dy2 = static_cast<double>(corners[2].y) - static_cast<double>(corners[0].y);
  const double exact_area = dx1 * dy2 - dy1 * dx2;
  const double dv1 = static_cast<double>(corners[1].value) - static_cast<double>(corners[0].value);
  const double dv2 = static_cast<double>(corners[2].value) - static_cast<double>(corners[0].value);
  const double per_area = exact_area != 0 ? 1 / exact_area : 0;
  setup.by_x = (dv1 * dy2 - dv2 * dy1) * per_area;
  setup.by_y = (dv2 * dx1 - dv1 * dx2) * per_area;
  setup.value = static_cast<double>(corners[0].value) +
                setup.by_x * (setup.x0 + 0.5 - static_cast<double>(corners[0].x)) +
                setup.by_y * (setup.y0 + 0.5 - static_cast<double>(corners[0].y));
  if (area < 0) {
    std::swap(setup.x[1], setup.x[2]);
    std::swap(setup.y[1], setup.y[2]);
  }
  fill(setup, number);
}

/// Edge functions: positive on the inner side, and on the edge itself for top and left edges.
void SampleTile::fill(const Setup& setup, uint32_t number) {
  double by_x[3], by_y[3], row_start[3], reach[3];
  double offsets[3][kSamples];
  for (size_t edge = 0; edge < 3; ++edge) {
    const size_t a = edge, b = (edge + 1) % 3;
    by_x[edge] = -(setup.y[b] - setup.y[a]);
    by_y[edge] = setup.x[b] - setup.x[a];
    const bool takes_edge = by_x[edge] > 0 || (by_x[edge] == 0 && by_y[edge] > 0);
    const double from_x = kGrid * setup.x0 + kGrid / 2 - setup.x[a];
    const double from_y = kGrid * setup.y0 + kGrid / 2 - setup.y[a];
    row_start[edge] = by_x[edge] * from_x + by_y[edge] * from_y + (takes_edge ? 0 : -0.5);
    for (size_t s = 0; s < kSamples; ++s)
      offsets[edge][s] = by_x[edge] * kSampleOffsets[s][0] + by_y[edge] * kSampleOffsets[s][1];
    // No sample's offset is more.
    reach[edge] = (kGrid / 2 - 1) * (std::abs(by_x[edge]) + std::abs(by_y[edge]));
    by_x[edge] *= kGrid;
    by_y[edge] *= kGrid;
  }
  std::array<float, kSamples> of_sample;
  for (size_t s = 0; s < kSamples; ++s)
    of_sample[s] =
        static_cast<float>((setup.by_x * kSampleOffsets[s][0] + setup.by_y * kSampleOffsets[s][1]) / kGrid);
  for (int y = setup.y0; y <= setup.y1; ++y) {
    PixelSamples* pixel =
        &samples_[static_cast<size_t>(y - y0_) * kSampleTileWidth + static_cast<size_t>(setup.x0 - x0_)];
    double at[3] = {row_start[0], row_start[1], row_start[2]};
    for (int x = setup.x0; x <= setup.x1; ++x, ++pixel) {
      if (at[0] + reach[0] >= 0 && at[1] + reach[1] >= 0 && at[2] + reach[2] >= 0) {
        const bool whole = at[0] >= reach[0] && at[1] >= reach[1] && at[2] >= reach[2];
        const auto value =
            static_cast<float>(setup.value + setup.by_x * (x - setup.x0) + setup.by_y * (y - setup.y0));
        for (size_t s = 0; s < kSamples; ++s) {
          if (!whole &&
              !(at[0] + offsets[0][s] >= 0 && at[1] + offsets[1][s] >= 0 && at[2] + offsets[2][s] >= 0))
            continue;
          const float here = value + of_sample[s];
          if (before_) {
            const PixelSamples& nearer = before_->at(x, y);
            if (here < nearer.values[s] || (here == nearer.values[s] && number <= nearer.numbers[s]))
              continue;
          }
          if (here > pixel->values[s] || (here == pixel->values[s] && number >= pixel->numbers[s])) continue;
          pixel->values[s] = here;
          pixel->numbers[s] = number;
        }
      }
      for (size_t edge = 0; edge < 3; ++edge) at[edge] += by_x[edge];
    }
    for (size_t edge = 0; edge < 3; ++edge) row_start[edge] += by_y[edge];
  }
}

}  // namespace curvisplat
