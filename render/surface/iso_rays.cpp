#include "render/surface/iso_rays.h"

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <limits>
#include <numeric>

#include "render/project/footprint.h"

namespace curvisplat {
namespace {

constexpr auto kSupport = static_cast<float>(kKernelSupport);
// K in x = 1 - (r / support)²: x² times this, fitted by least squares.
constexpr float kKernel[] = {0.0451566f, 0.2057787f, -0.2786960f, 0.7582452f, -0.1769623f};
constexpr float kStep = 0.35f;       // of half the support of the shortest splat
constexpr size_t kMaxSteps = 4096;   // of a packet
constexpr float kMinWeight = 0.02f;  // below it there is no field
// Inside the data the weights add up to about 1, less what the neighbours have that do not hold the value.
constexpr float kMinInside = 0.15f;
constexpr float kHidden = 1.0f / 4096, kClear = 1.0f / 1024;
constexpr int kRefinements = 4;

float kernelOf(float x) {
  return x * x * (kKernel[0] + x * (kKernel[1] + x * (kKernel[2] + x * (kKernel[3] + x * kKernel[4]))));
}

}  // namespace

IsoRays::IsoRays(const IsoSplats::Settings& settings)
    : settings_(settings), perspective_(settings.view.projection == Projection::kPerspective) {}

/// Of a ray: where it is in view axes; in perspective at the depth 1.
glm::dvec2 IsoRays::acrossAt(const IsoPacket& packet, size_t ray) const {
  const ScreenView& view = settings_.view;
  return {(double{packet.x[ray]} - 0.5 * view.size.width) / view.focal_px,
          (double{packet.y[ray]} - 0.5 * view.size.height) / view.focal_px};
}

bool IsoRays::crossOne(const IsoSplats::Placed& placed, Crossed& out) const {
  const IsoSplat& splat = *placed.splat;
  out.weight = splat.weight;
  const glm::vec3 r = splat.by_right, d = splat.by_down, f = splat.by_forward;
  const glm::dvec2 centre(splat.centre);
  const double distance = perspective_ ? splat.centre.z : 1;
  const float s_r = glm::dot(splat.slope, r), s_d = glm::dot(splat.slope, d), s_f = glm::dot(splat.slope, f);
  const float from_base = static_cast<float>(splat.centre.z - base_depth_);
  // Of perspective alone: how much a ray leans.
  const float leans = perspective_ ? 1.0f : 0.0f;
  Row nearest;
  for (size_t ray = 0; ray < kRays; ++ray) {
    // At the centre's depth the ray is at `base` in the frame of A, and it moves by `along`.
    const auto x = static_cast<float>(across_x_[ray] * distance - centre.x);
    const auto y = static_cast<float>(across_y_[ray] * distance - centre.y);
    const float lean_x = leans * static_cast<float>(across_x_[ray]);
    const float lean_y = leans * static_cast<float>(across_y_[ray]);
    const float base0 = x * r.x + y * d.x, base1 = x * r.y + y * d.y, base2 = x * r.z + y * d.z;
    const float along0 = f.x + lean_x * r.x + lean_y * d.x, along1 = f.y + lean_x * r.y + lean_y * d.y,
                along2 = f.z + lean_x * r.z + lean_y * d.z;
    const float apart0 = base1 * along2 - base2 * along1, apart1 = base2 * along0 - base0 * along2,
                apart2 = base0 * along1 - base1 * along0;
    const float length2 = along0 * along0 + along1 * along1 + along2 * along2;
    constexpr float kPerSupport2 = 1 / (kSupport * kSupport);
    const float to_nearest = -(base0 * along0 + base1 * along1 + base2 * along2) / length2;
    const float change = s_f + lean_x * s_r + lean_y * s_d;
    out.by[ray] = length2 * kPerSupport2;
    out.from[ray] = 1 - (apart0 * apart0 + apart1 * apart1 + apart2 * apart2) / length2 * kPerSupport2;
    nearest[ray] = to_nearest;
    out.mean[ray] = splat.mean + x * s_r + y * s_d + to_nearest * change;
    out.change[ray] = change;
  }
  float shortest = out.by[0], longest = out.by[0], most = out.from[0];
  float begin = nearest[0], end = nearest[0];
  for (size_t ray = 0; ray < kRays; ++ray) {
    out.middle[ray] = from_base + nearest[ray];
    shortest = std::max(shortest, out.by[ray]);
    longest = std::min(longest, out.by[ray]);
    most = std::max(most, out.from[ray]);
    begin = std::min(begin, nearest[ray]);
    end = std::max(end, nearest[ray]);
  }
  if (!(most > 0)) return false;
  const float half = std::sqrt(most / longest);
  out.begin = from_base + begin - half;
  out.end = from_base + end + half;
  out.step = kStep / std::sqrt(shortest);
  out.splat = &placed;
  return out.begin < out.end && std::isfinite(out.end - out.begin) && out.step > 0;
}

/// Without the old memory beside the new.
void IsoRays::makeRoom(size_t splats) {
  if (splats <= crossed_.capacity()) return;
  crossed_ = {};
  order_ = {};
  active_ = {};
  crossed_.reserve(splats);
  order_.reserve(splats);
  active_.reserve(splats);
}

void IsoRays::cross(const IsoPacket& packet, std::span<const IsoSplats::Placed> splats) {
  const auto x = std::minmax_element(packet.x.begin(), packet.x.begin() + packet.count);
  const auto y = std::minmax_element(packet.y.begin(), packet.y.begin() + packet.count);
  for (size_t ray = 0; ray < kRays; ++ray) {
    const glm::dvec2 across = acrossAt(packet, std::min(ray, packet.count - 1));
    across_x_[ray] = across.x;
    across_y_[ray] = across.y;
  }
  const auto touches = [&](const IsoSplats::Placed& placed) {
    const IsoSplat& s = *placed.splat;
    return s.x1 >= *x.first && s.x0 <= *x.second && s.y1 >= *y.first && s.y0 <= *y.second;
  };
  crossed_.clear();
  makeRoom(static_cast<size_t>(std::count_if(splats.begin(), splats.end(), touches)));
  for (const IsoSplats::Placed& placed : splats) {
    if (!touches(placed)) continue;
    if (crossed_.empty()) base_depth_ = placed.splat->centre.z;
    crossed_.emplace_back();
    if (!crossOne(placed, crossed_.back())) crossed_.pop_back();
  }
  order_.resize(crossed_.size());
  std::iota(order_.begin(), order_.end(), 0u);
  std::sort(order_.begin(), order_.end(), [this](uint32_t a, uint32_t b) {
    return crossed_[a].begin < crossed_[b].begin || (crossed_[a].begin == crossed_[b].begin && a < b);
  });
}

/// Without the common field: of each ray the splat that weighs most there.
void IsoRays::heaviestAt(const Row& z, Field& field) const {
  field = {};
  for (const Crossed* splat : active_)
    for (size_t ray = 0; ray < kRays; ++ray) {
      const float t = z[ray] - splat->middle[ray];
      const float w = splat->weight * kernelOf(std::max(splat->from[ray] - splat->by[ray] * t * t, 0.0f));
      if (w <= field.weight[ray]) continue;
      field.weight[ray] = w;
      field.value[ray] = splat->mean[ray] + splat->change[ray] * t;
    }
}

void IsoRays::fieldAt(const Row& z, Field& field) const {
  if (!settings_.corrections.common_field) return heaviestAt(z, field);
  Row weight{}, sum{};
  for (const Crossed* splat : active_) {
    const Crossed& s = *splat;
    for (size_t ray = 0; ray < kRays; ++ray) {
      const float t = z[ray] - s.middle[ray];
      const float inside = s.from[ray] - s.by[ray] * t * t;
      const float x = inside > 0 ? inside : 0.0f;
      const float w = s.weight * kernelOf(x);
      weight[ray] += w;
      sum[ray] += w * (s.mean[ray] + s.change[ray] * t);
    }
  }
  field.weight = weight;
  for (size_t ray = 0; ray < kRays; ++ray) field.value[ray] = sum[ray] / std::max(weight[ray], 1e-20f);
}

/// Between begin and end, where the field is on either side of the value. `rays`: bits.
void IsoRays::refine(float value, const Place& begin, const Place& end, unsigned rays, Row& z) const {
  Row low = begin.z, high = end.z, below{}, above{};
  for (size_t ray = 0; ray < kRays; ++ray) {
    below[ray] = begin.field.value[ray] - value;
    above[ray] = end.field.value[ray] - value;
  }
  std::array<int8_t, kRays> kept{};  // which end has stayed
  Field field;
  const auto guess = [&] {
    for (size_t ray = 0; ray < kRays; ++ray) {
      const float change = below[ray] - above[ray];
      const float part = (rays >> ray & 1) != 0 && change != 0 ? below[ray] / change : 0.0f;
      z[ray] = low[ray] + std::clamp(part, 0.0f, 1.0f) * (high[ray] - low[ray]);
    }
  };
  for (int n = 0; n < kRefinements; ++n) {
    guess();
    fieldAt(z, field);
    for (size_t ray = 0; ray < kRays; ++ray) {
      const float at = field.value[ray] - value;
      if ((at < 0) == (below[ray] < 0)) {
        low[ray] = z[ray];
        below[ray] = at;
        if (kept[ray] == 1) above[ray] *= 0.5f;
        kept[ray] = 1;
      } else {
        high[ray] = z[ray];
        above[ray] = at;
        if (kept[ray] == 2) below[ray] *= 0.5f;
        kept[ray] = 2;
      }
    }
  }
  guess();
}

/// Whether clip planes take away a point in view axes.
bool IsoRays::isClipped(const glm::dvec3& at) const {
  if (settings_.clip_planes.empty()) return false;
  const ScreenView& view = settings_.view;
  const double along = at.z + (perspective_ ? 0 : settings_.depth_origin);
  const glm::dvec3 world =
      (view.eye + at.x * view.right + at.y * view.down + along * view.forward) / view.scale;
  return std::any_of(settings_.clip_planes.begin(), settings_.clip_planes.end(),
                     [&](const ClipPlane& plane) { return glm::dot(plane.normal, world - plane.point) < 0; });
}

/// What the splats have at a crossing.
struct IsoRays::Point {
  glm::vec3 gradient{0.0f};
  float weight = 0, other = 0, outside = 0;
};

void IsoRays::take(const IsoPacket& packet, const Row& z, size_t value, unsigned rays) {
  for (size_t ray = 0; ray < packet.count; ++ray) {
    if ((rays >> ray & 1) == 0) continue;
    const glm::dvec2 across = acrossAt(packet, ray);
    const double depth = base_depth_ + double{z[ray]};
    if (perspective_ && depth < settings_.view.near) continue;
    const glm::dvec3 at(across * (perspective_ ? depth : 1.0), depth);
    if (isClipped(at)) continue;
    Point point;
    for (const Crossed* crossed : active_) {
      const IsoSplat& s = *crossed->splat->splat;
      const float t = z[ray] - crossed->middle[ray];
      const float x = crossed->from[ray] - crossed->by[ray] * t * t;
      if (!(x > 0)) continue;
      const float w = s.weight * kernelOf(x);
      const glm::vec3 off(at - s.centre);
      const glm::vec3 u = off.x * s.by_right + off.y * s.by_down + off.z * s.by_forward;
      point.weight += w;
      point.gradient += w * glm::vec3(glm::dot(s.slope, s.by_right), glm::dot(s.slope, s.by_down),
                                      glm::dot(s.slope, s.by_forward));
      point.other += w * (s.other_mean + glm::dot(s.other_slope, u));
      const bool outside =
          settings_.corrections.ended &&
          std::any_of(crossed->splat->faces.begin(), crossed->splat->faces.end(),
                      [&](const CutFace& face) { return glm::dot(face.inward, u) + face.distance < 0; });
      if (outside) point.outside += w;
    }
    if (!(point.weight > kMinInside) || point.outside > 0.5f * point.weight) continue;
    addHit(ray,
           {depth, point.gradient / point.weight, static_cast<float>(settings_.values[value]),
            point.other / point.weight},
           packet.opacity);
  }
}

void IsoRays::addHit(size_t ray, const IsoHit& hit, const IsoOpacity& opacity) {
  Hits& hits = hits_[ray];
  const float alpha = opacity.at(hit);
  if (alpha < kClear || hits.count == kMaxHits) return;
  size_t n = hits.count++;
  for (; n > 0 && hits.hit[n - 1].depth > hit.depth; --n) hits.hit[n] = hits.hit[n - 1];
  hits.hit[n] = hit;
  through_[ray] *= 1 - alpha;
  if (hits.count == kMaxHits) through_[ray] = 0;
}

void IsoRays::trace(const IsoPacket& packet, std::span<const IsoSplats::Placed> splats) {
  for (size_t ray = 0; ray < kRays; ++ray) {
    hits_[ray].count = 0;
    through_[ray] = ray < packet.count ? 1.0f : 0.0f;
  }
  cross(packet, splats);
  active_.clear();
  Place now, before;
  size_t next = 0;
  bool fresh = true;  // nothing is known of what lies before
  float least_step = 0;
  if (!order_.empty()) {
    now.z.fill(crossed_[order_[0]].begin);
    for (const Crossed& s : crossed_) least_step = std::max(least_step, (s.end - now.z[0]) / kMaxSteps);
  }
  while (true) {
    float at = now.z[0];
    std::erase_if(active_, [&](const Crossed* s) { return s->end < at; });
    float step = std::numeric_limits<float>::infinity();
    for (const Crossed* s : active_) step = std::min(step, s->step);
    if (active_.empty()) {
      if (next == order_.size()) break;
      at = crossed_[order_[next]].begin;
      fresh = true;
      step = crossed_[order_[next]].step;
    }
    float to = at + std::max(step, least_step);
    for (; next < order_.size() && crossed_[order_[next]].begin < to; ++next) {
      const Crossed& s = crossed_[order_[next]];
      active_.push_back(&s);
      to = std::min(to, std::max(s.begin + s.step, at + least_step));
    }
    before = now;
    now.z.fill(std::max(to, std::nextafter(at, std::numeric_limits<float>::infinity())));
    fieldAt(now.z, now.field);
    if (!fresh) {
      unsigned open = 0;
      for (size_t ray = 0; ray < packet.count; ++ray)
        open |= static_cast<unsigned>(through_[ray] > kHidden && before.field.weight[ray] > kMinWeight &&
                                      now.field.weight[ray] > kMinWeight)
                << ray;
      for (size_t value = 0; value < settings_.values.size(); ++value) {
        const auto wanted = static_cast<float>(settings_.values[value] - settings_.values.front());
        unsigned rays = 0;
        for (size_t ray = 0; ray < packet.count; ++ray)
          rays |= static_cast<unsigned>((before.field.value[ray] < wanted) != (now.field.value[ray] < wanted))
                  << ray;
        rays &= open;
        if (rays == 0) continue;
        Row found{};
        refine(wanted, before, now, rays, found);
        take(packet, found, value, rays);
      }
      if (std::none_of(through_.begin(), through_.end(), [](float part) { return part > kHidden; })) break;
    }
    fresh = false;
  }
}

}  // namespace curvisplat
