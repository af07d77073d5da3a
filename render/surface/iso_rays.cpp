#include "render/surface/iso_rays.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <glm/geometric.hpp>

namespace curvisplat {
namespace {

constexpr size_t kMaxSteps = 4096;   // of a packet
constexpr float kMinWeight = 0.02f;  // below it there is no field
// The least weight inside the data, where weights add up to about 1, less what the neighbours have that do
// not hold the value.
constexpr float kMinInside = 0.15f;
constexpr float kHidden = 1.0f / 4096, kClear = 1.0f / 1024;
constexpr int kRefinements = 4;
constexpr float kNearTurn = 0.8f;  // of the nearest place's distance to the value: nearer turns are looked at

}  // namespace

IsoRays::IsoRays(const IsoSplats::Settings& settings) : settings_(settings) {
  fan_.perspective = settings.view.projection == Projection::kPerspective;
}

/// The place of a ray in view axes; in perspective at the depth 1.
glm::dvec2 IsoRays::acrossAt(const IsoPacket& packet, size_t ray) const {
  const ScreenView& view = settings_.view;
  return {(double{packet.x[ray]} - 0.5 * view.size.width) / view.focal_px,
          (double{packet.y[ray]} - 0.5 * view.size.height) / view.focal_px};
}

void IsoRays::makeRoom(size_t splats) {
  if (splats <= crossed_.capacity()) return;
  crossed_ = {};  // not beside the new one
  waiting_ = {};
  active_ = {};
  crossed_.reserve(splats);
  waiting_.reserve(splats);
  active_.reserve(splats);
}

void IsoRays::begin(const IsoPacket& packet, Ahead& ahead) {
  for (size_t ray = 0; ray < kRays; ++ray) {
    hits_[ray].count = 0;
    through_[ray] = ray < packet.count ? 1.0f : 0.0f;
  }
  const auto x = std::minmax_element(packet.x.begin(), packet.x.begin() + packet.count);
  const auto y = std::minmax_element(packet.y.begin(), packet.y.begin() + packet.count);
  ahead.x0 = *x.first;
  ahead.x1 = *x.second;
  ahead.y0 = *y.first;
  ahead.y1 = *y.second;
  fan_.corner = acrossAt(packet, 0);
  for (size_t ray = 0; ray < kRays; ++ray) {
    const glm::dvec2 off = acrossAt(packet, std::min(ray, packet.count - 1)) - fan_.corner;
    fan_.x[ray] = static_cast<float>(off.x);
    fan_.y[ray] = static_cast<float>(off.y);
  }
  crossed_.clear();
  waiting_.clear();
  active_.clear();
  fan_.base_depth = ahead.splats.empty() ? 0 : double{ahead.splats[0].splat->near};
  first_ = INFINITY;
  least_step_ = 0;
}

/// Crosses the splats that may begin before a depth.
void IsoRays::crossBefore(Ahead& ahead, float depth) {
  const double before = fan_.base_depth + double{depth};
  while (!ahead.splats.empty() && double{ahead.splats[0].splat->near} < before) crossNext(ahead);
}

void IsoRays::crossNext(Ahead& ahead) {
  const IsoSplats::Placed& placed = ahead.splats[0];
  ahead.splats = ahead.splats.subspan(1);
  const IsoSplat& s = *placed.splat;
  if (!(s.x1 >= ahead.x0 && s.x0 <= ahead.x1 && s.y1 >= ahead.y0 && s.y0 <= ahead.y1)) return;
  crossed_.emplace_back();
  if (crossSplat(placed, fan_, crossed_.back()))
    waiting_.push_back(&crossed_.back());
  else
    crossed_.pop_back();
}

float IsoRays::firstBegin() const {
  float first = INFINITY;
  for (const IsoCrossed* const s : waiting_) first = std::min(first, s->begin);
  return first;
}

/// Activates the splats that begin within a step from `at`, and returns where the step ends, so that none is
/// stepped over.
float IsoRays::activate(float at, float step) {
  float to = at + std::max(step, least_step_);
  size_t kept = 0;
  for (const IsoCrossed* const s : waiting_) {
    if (!(s->begin < to)) {
      waiting_[kept++] = s;
      continue;
    }
    active_.push_back(s);
    least_step_ = std::max(least_step_, (s->end - first_) / kMaxSteps);
    to = std::min(to, std::max(s->begin + s->step, at + least_step_));
  }
  waiting_.resize(kept);
  return to;
}

/// Finds for each ray the splat that weighs most there, which stands in for the common field.
void IsoRays::heaviestAt(Place& place) const {
  place.field = {};
  for (const IsoCrossed* splat : active_)
    for (size_t ray = 0; ray < kRays; ++ray) {
      const float w = isoWeight(*splat, ray, place.z[ray]);
      if (w <= place.field.weight[ray]) continue;
      place.field.weight[ray] = w;
      place.field.value[ray] = splat->mean[ray] + splat->change[ray] * (place.z[ray] - splat->middle[ray]);
    }
}

void IsoRays::fieldAt(Place& place) const {
  if (!corrections_.common_field) return heaviestAt(place);
  sumField(active_, place.z, place.field);
}

/// Refines a crossing between begin and end, where the field is on either side of the value. `rays`: bits.
void IsoRays::refine(float value, const Place& begin, const Place& end, unsigned rays, Row& z) const {
  Row low = begin.z, high = end.z, below{}, above{};
  for (size_t ray = 0; ray < kRays; ++ray) {
    below[ray] = begin.field.value[ray] - value;
    above[ray] = end.field.value[ray] - value;
  }
  std::array<int8_t, kRays> kept{};  // which end has stayed
  Place at_guess;
  const auto guess = [&] {
    for (size_t ray = 0; ray < kRays; ++ray) {
      const float change = below[ray] - above[ray];
      const float part = (rays >> ray & 1) != 0 && change != 0 ? below[ray] / change : 0.0f;
      z[ray] = low[ray] + std::clamp(part, 0.0f, 1.0f) * (high[ray] - low[ray]);
    }
  };
  for (int n = 0; n < kRefinements; ++n) {
    guess();
    at_guess.z = z;
    fieldAt(at_guess);
    for (size_t ray = 0; ray < kRays; ++ray) {
      const float at = at_guess.field.value[ray] - value;
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
  const double along = at.z + (fan_.perspective ? 0 : settings_.depth_origin);
  const glm::dvec3 world =
      (view.eye + at.x * view.right + at.y * view.down + along * view.forward) / view.scale;
  return std::any_of(settings_.clip_planes.begin(), settings_.clip_planes.end(),
                     [&](const ClipPlane& plane) { return glm::dot(plane.normal, world - plane.point) < 0; });
}

/// The other scalar at a point.
float IsoRays::otherAt(size_t ray, float z, const glm::dvec3& at) const {
  float sum = 0, weights = 0;
  for (const IsoCrossed* crossed : active_) {
    const float w = isoWeight(*crossed, ray, z);
    if (!(w > 0)) continue;
    const IsoSplat& s = *crossed->splat->splat;
    const glm::vec3 off(at - s.centre);
    const glm::vec3 u = off.x * s.by_right + off.y * s.by_down + off.z * s.by_forward;
    sum += w * (s.other_mean + glm::dot(s.other_slope, u));
    weights += w;
  }
  return sum / weights;
}

/// Whether most of the weight at a point is behind borders' faces.
bool IsoRays::isOutside(size_t ray, float z, const glm::dvec3& at, float weight) const {
  if (!corrections_.ended) return false;
  float outside = 0;
  for (const IsoCrossed* crossed : active_) {
    if (crossed->splat->faces.empty()) continue;
    const float w = isoWeight(*crossed, ray, z);
    if (!(w > 0)) continue;
    const IsoSplat& s = *crossed->splat->splat;
    const glm::vec3 off(at - s.centre);
    const glm::vec3 u = off.x * s.by_right + off.y * s.by_down + off.z * s.by_forward;
    if (std::any_of(crossed->splat->faces.begin(), crossed->splat->faces.end(),
                    [&](const CutFace& face) { return glm::dot(face.inward, u) + face.distance < 0; }))
      outside += w;
  }
  return outside > 0.5f * weight;
}

void IsoRays::take(const IsoPacket& packet, const Row& z, size_t value, unsigned rays) {
  IsoSlopes slopes;
  sumSlopes(active_, z, slopes);
  for (size_t ray = 0; ray < packet.count; ++ray) {
    if ((rays >> ray & 1) == 0 || !(slopes.weight[ray] > kMinInside)) continue;
    const double depth = fan_.base_depth + double{z[ray]};
    if (fan_.perspective && depth < settings_.view.near) continue;
    const glm::dvec3 at(acrossAt(packet, ray) * (fan_.perspective ? depth : 1.0), depth);
    if (isClipped(at) || isOutside(ray, z[ray], at, slopes.weight[ray])) continue;
    const auto scalar = static_cast<float>(settings_.values[value]);
    addHit(ray,
           {depth,
            {slopes.x[ray], slopes.y[ray], slopes.z[ray]},
            scalar,
            settings_.two_scalars ? otherAt(ray, z[ray], at) : scalar,
            static_cast<uint32_t>(value)},
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

/// Bits of the rays that see what lies ahead.
unsigned IsoRays::openRays() const {
  unsigned open = 0;
  for (size_t ray = 0; ray < kRays; ++ray) open |= static_cast<unsigned>(through_[ray] > kHidden) << ray;
  return open;
}

void IsoRays::takeBetween(const IsoPacket& packet, const Place& begin, const Place& end, size_t value,
                          unsigned rays) {
  Row found{};
  refine(wanted(value), begin, end, rays, found);
  take(packet, found, value, rays);
}

void IsoRays::findCrossings(const IsoPacket& packet, const Place& begin, const Place& end) {
  for (size_t value = 0; value < settings_.values.size(); ++value) {
    const unsigned rays = openRays() & crossedRays(begin.field, end.field, wanted(value), kMinWeight);
    if (rays != 0) takeBetween(packet, begin, end, value, rays);
  }
}

/// Finds turns by the parabola through three places: where the field comes near a value and turns back, it
/// may have crossed it twice.
void IsoRays::findTurns(const IsoPacket& packet, const Place& first, const Place& second,
                        const Place& third) {
  for (size_t value = 0; value < settings_.values.size(); ++value) {
    const unsigned candidates =
        openRays() & turnedRays({&first.field, &second.field, &third.field}, wanted(value), kMinWeight);
    if (candidates == 0) continue;
    Place turn = second, begin = second, end = second;
    unsigned rays = 0;
    for (unsigned left = candidates; left != 0; left &= left - 1) {
      const auto ray = static_cast<size_t>(std::countr_zero(left));
      const float a = first.field.value[ray] - wanted(value), b = second.field.value[ray] - wanted(value),
                  c = third.field.value[ray] - wanted(value);
      const float before = second.z[ray] - first.z[ray], after = third.z[ray] - second.z[ray];
      const float to = (b - a) / before, from = (c - b) / after;
      const float bend = (from - to) / (before + after);
      const float slope = (to * after + from * before) / (before + after);
      const float move = -0.5f * slope / bend, side = b < 0 ? -1.0f : 1.0f;
      if (!(side * (b + 0.5f * slope * move) < kNearTurn * side * b)) continue;
      rays |= 1u << ray;
      turn.z[ray] = second.z[ray] + std::clamp(move, -before, after);
      const bool sooner = turn.z[ray] < second.z[ray];
      const Place &from_place = sooner ? first : second, &to_place = sooner ? second : third;
      begin.z[ray] = from_place.z[ray];
      begin.field.value[ray] = from_place.field.value[ray];
      end.z[ray] = to_place.z[ray];
      end.field.value[ray] = to_place.field.value[ray];
    }
    if (rays == 0) continue;
    fieldAt(turn);
    rays &= crossedRays(second.field, turn.field, wanted(value), kMinWeight);
    if (rays == 0) continue;
    takeBetween(packet, begin, turn, value, rays);
    takeBetween(packet, turn, end, value, rays);
  }
}

void IsoRays::trace(const IsoPacket& packet, std::span<const IsoSplats::Placed> splats) {
  Ahead ahead{splats, 0, 0, 0, 0};
  begin(packet, ahead);
  std::array<Place, 3> places;  // the last ones, in turn
  size_t known = 0;             // of them
  float at = 0, last = 0;
  while (openRays() != 0) {
    // Those that end after the place before the last one: what turns there is found in the next step.
    float step = INFINITY;
    size_t kept = 0;
    for (const IsoCrossed* const s : active_)
      if (!(s->end < last)) {
        active_[kept++] = s;
        if (!(s->end < at)) step = std::min(step, s->step);
      }
    active_.resize(kept);
    if (step == INFINITY) {  // all have ended
      active_.clear();
      known = 0;
      while (!ahead.splats.empty() && waiting_.empty()) crossNext(ahead);
      crossBefore(ahead, firstBegin());
      if (waiting_.empty()) break;
      at = firstBegin();
      first_ = std::min(first_, at);
      step = 0;
      for (const IsoCrossed* const s : waiting_)
        if (s->begin == at) step = s->step;
    }
    crossBefore(ahead, at + std::max(step, least_step_));
    std::rotate(places.begin(), places.begin() + 1, places.end());
    last = at;
    at = std::max(activate(at, step), std::nextafter(at, INFINITY));
    places[2].z.fill(at);
    fieldAt(places[2]);
    if (known >= 2) findTurns(packet, places[0], places[1], places[2]);
    if (known >= 1) findCrossings(packet, places[1], places[2]);
    known = std::min<size_t>(known + 1, 2);
  }
}

}  // namespace curvisplat
