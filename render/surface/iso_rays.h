// Where rays meet isosurfaces. Along a ray, with w = V K(|u|) / √det S at the depth z,
//
//     F(z) = Σ w (f + slope · u) / Σ w
//
// is the scalar of all splats that reach there, which is smooth where that of one splat ends at its rim. It is looked
// at in steps that are short beside the splats; where it passes an isovalue, the crossing is found by false position,
// and the gradient there is Σ w ∇f / Σ w. DESIGN.md, "Isosurfaces".
//
// Sixteen rays at a time, in the order of the splats: the bits depend on nothing else. K is a polynomial in
// 1 - (|u| / support)², within 0.004: weights need no more.
#pragma once

#include <array>
#include <cstdint>
#include <glm/vec2.hpp>
#include <glm/vec3.hpp>
#include <span>
#include <vector>

#include "render/colour/classification.h"
#include "render/surface/iso_splats.h"

namespace curvisplat {

/// A crossing of a ray.
struct IsoHit {
  double depth;        // along the view, as IsoSplat::centre
  glm::vec3 gradient;  // in view axes, of a stretched unit
  float scalar;        // the isovalue
  float other_scalar;  // that of the picture's other scalar; of one scalar, the same
};

/// Of crossings. Those that are nearly clear are not there.
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
  static constexpr size_t kRays = 16;

  std::array<float, kRays> x{}, y{};
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

  /// For one thread; `settings` as the splats'.
  explicit IsoRays(const IsoSplats::Settings& settings);

  /// Traces the rays through `splats`, each of which has to touch one of them; others do no harm. Overwrites hits()
  /// of the packet's rays, from the nearest on.
  void trace(const IsoPacket& packet, std::span<const IsoSplats::Placed> splats);
  const Hits& hits(size_t ray) const { return hits_[ray]; }

  /// The most memory that trace() takes for `splats` splats, in bytes.
  static constexpr uint64_t bytes(size_t splats) {
    return splats * (sizeof(Crossed) + sizeof(uint32_t) + sizeof(const Crossed*));
  }

 private:
  static constexpr size_t kRays = IsoPacket::kRays;
  using Row = std::array<float, kRays>;

  /// A splat along the rays, with t = z - middle: 1 - (|u| / support)² = from - by t², f = mean + change t.
  struct alignas(64) Crossed {
    Row middle, from, by, mean, change;
    float weight;
    float begin, end;  // what any ray has of its support lies between them
    float step;        // half its length along the rays
    const IsoSplats::Placed* splat;
  };
  struct Field {
    Row weight{}, value{};  // Σ w, and F
  };
  /// A point of each ray.
  struct Place {
    Row z{};
    Field field;
  };
  struct Point;

  void makeRoom(size_t splats);
  void cross(const IsoPacket& packet, std::span<const IsoSplats::Placed> splats);
  bool crossOne(const IsoSplats::Placed& placed, Crossed& out) const;
  glm::dvec2 acrossAt(const IsoPacket& packet, size_t ray) const;
  void fieldAt(const Row& z, Field& field) const;
  void heaviestAt(const Row& z, Field& field) const;
  void refine(float value, const Place& begin, const Place& end, unsigned rays, Row& z) const;
  void take(const IsoPacket& packet, const Row& z, size_t value, unsigned rays);
  void addHit(size_t ray, const IsoHit& hit, const IsoOpacity& opacity);
  bool isClipped(const glm::dvec3& at) const;

  const IsoSplats::Settings settings_;
  const bool perspective_;
  double base_depth_ = 0;
  std::array<double, kRays> across_x_{}, across_y_{};  // in view axes; perspective: at the depth 1
  std::vector<Crossed> crossed_;
  std::vector<uint32_t> order_;  // of crossed_, by begin
  std::vector<const Crossed*> active_;
  std::array<Hits, kRays> hits_;
  Row through_{};
};

}  // namespace curvisplat
