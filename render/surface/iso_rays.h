// Finds where rays meet isosurfaces. Along a ray, with w = V K(|u|) / √det S at the depth z,
//
//     F(z) = Σ w (f + slope · u) / Σ w
//
// is the scalar of all splats that reach there, which is smooth where that of one splat ends at its rim. It is looked
// at in steps that are short beside the splats; where it passes an isovalue, the crossing is found by false position,
// and the gradient there is Σ w ∇f / Σ w. DESIGN.md, "Isosurfaces".
//
// Where it comes near and turns back between two steps, as at outlines, the place where it turns is looked at as well.
// Sixteen rays at a time, in the order of the splats: the bits depend on nothing else. K is a polynomial in
// 1 - (|u| / support)², within 0.004: weights need no more.
#pragma once

#include <array>
#include <cstdint>
#include <glm/vec3.hpp>
#include <span>
#include <vector>

#include "render/colour/classification.h"
#include "render/surface/iso_field.h"
#include "render/surface/iso_splats.h"
#include "stream/model/corrections.h"

namespace curvisplat {

/// A crossing of a ray.
struct IsoHit {
  double depth;        // along the view, as IsoSplat::centre
  glm::vec3 gradient;  // in view axes, of a stretched unit
  float scalar;        // the isovalue
  float other_scalar;  // that of the picture's other scalar; of one scalar, the same
  uint32_t surface;    // its place among the isovalues
};

/// The opacity of crossings. Those that are nearly clear are not there.
struct IsoOpacity {
  double factor = 1;
  const ColourTable* function = nullptr;  // none: 1
  bool of_other = false;                  // the function is of the other scalar

  float at(const IsoHit& hit) const {
    if (!function) return static_cast<float>(factor);
    return static_cast<float>(factor) * function->opacityAt(double{of_other ? hit.other_scalar : hit.scalar});
  }
};

/// Rays that lie close together: points of the picture.
struct IsoPacket {
  static constexpr size_t kRays = kIsoRays;

  IsoRow x{}, y{};
  size_t count = 0;
  IsoOpacity opacity;  // what lies behind crossings that hide it need not be found
};

class IsoRays {
 public:
  static constexpr size_t kMaxHits = 6;
  struct Hits {
    std::array<IsoHit, kMaxHits> hit;
    size_t count = 0;

    std::span<const IsoHit> all() const { return {hit.data(), count}; }
  };

  /// Traces rays in one thread; `settings` as the splats'.
  explicit IsoRays(const IsoSplats::Settings& settings);

  /// Reserves memory for packets of rays that meet at most `splats` splats.
  void makeRoom(size_t splats);
  /// Traces the rays through `splats`, in the order of IsoSplats::inTile(); those that touch none of the rays do no harm.
  /// Overwrites hits() of the packet's rays, from the nearest on.
  void trace(const IsoPacket& packet, std::span<const IsoSplats::Placed> splats);
  const Hits& hits(size_t ray) const { return hits_[ray]; }

  /// The bytes that makeRoom() takes.
  static constexpr uint64_t bytes(size_t splats) {
    return splats * (sizeof(IsoCrossed) + 2 * sizeof(const IsoCrossed*));
  }

 private:
  static constexpr size_t kRays = IsoPacket::kRays;
  using Row = IsoRow;

  /// A point of each ray.
  struct Place {
    Row z{};
    IsoField field;
  };
  /// Splats that are yet to be crossed, and the pixels of the packet.
  struct Ahead {
    std::span<const IsoSplats::Placed> splats;
    float x0, y0, x1, y1;
  };

  void begin(const IsoPacket& packet, Ahead& ahead);
  void crossNext(Ahead& ahead);
  void crossBefore(Ahead& ahead, float depth);
  float firstBegin() const;
  float activate(float at, float step);
  glm::dvec2 acrossAt(const IsoPacket& packet, size_t ray) const;
  void fieldAt(Place& place) const;
  void heaviestAt(Place& place) const;
  void findCrossings(const IsoPacket& packet, const Place& begin, const Place& end);
  void findTurns(const IsoPacket& packet, const Place& first, const Place& second, const Place& third);
  void takeBetween(const IsoPacket& packet, const Place& begin, const Place& end, size_t value,
                   unsigned rays);
  void refine(float value, const Place& begin, const Place& end, unsigned rays, Row& z) const;
  void take(const IsoPacket& packet, const Row& z, size_t value, unsigned rays);
  float otherAt(size_t ray, float z, const glm::dvec3& at) const;
  bool isOutside(size_t ray, float z, const glm::dvec3& at, float weight) const;
  void addHit(size_t ray, const IsoHit& hit, const IsoOpacity& opacity);
  bool isClipped(const glm::dvec3& at) const;
  float wanted(size_t value) const {
    return static_cast<float>(settings_.values[value] - settings_.values.front());
  }
  unsigned openRays() const;

  const IsoSplats::Settings settings_;
  const IsoCorrections corrections_ = correctionsToMake().isosurfaces;
  IsoFan fan_;
  std::vector<IsoCrossed> crossed_;
  std::vector<const IsoCrossed*> waiting_, active_;  // that begin ahead; that the last two places may touch
  float first_ = 0, least_step_ = 0;                 // where the packet begins; of kMaxSteps steps
  std::array<Hits, kRays> hits_;
  Row through_{};
};

}  // namespace curvisplat
