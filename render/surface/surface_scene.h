// A scene in a volume, or in its place: surfaces of triangles, slices and isosurfaces that have the scalar's
// colours.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <glm/vec3.hpp>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "render/colour/classification.h"
#include "render/mesh/triangle_mesh.h"
#include "render/project/plane_cuts.h"
#include "stream/cache/faces_file.h"

namespace curvisplat {

inline constexpr size_t kMaxSlices = 8;

/// How much of what lies behind a surface or a slice it hides.
struct SheetOpacity {
  double factor = 1;
  // Times the opacity that the transfer function of its colours has for the scalar; of two scalars, that of the
  // opacities for the other.
  bool by_function = false;

  bool opaque() const { return factor >= 1 && !by_function; }
};

struct PlacedMap;

/// Lit, from both sides. In data coordinates.
struct Surface {
  std::shared_ptr<const TriangleMesh> mesh;
  glm::vec3 colour{0.7f, 0.7f, 0.7f};
  // The transfer function's colours for the mesh's scalars; `colour` where it has none.
  bool by_scalar = false;
  std::shared_ptr<const ColourTable> colours = nullptr;  // in place of those of the picture's function
  SheetOpacity opacity = {};  // by_function: where `by_scalar`, or the mesh has opacity_scalars
  // The image replaces `colour`; the picture's light alone lights it (render/surface/map_image.h).
  std::shared_ptr<const PlacedMap> map = nullptr;
  bool own_colour = false;  // `colour`, also by_scalar: the scalars are values of pixels alone
};

/// Faces of the grid from its cache, drawn as a Surface at a level of detail that depends on the view.
struct GridSurface {
  /// The quads between nodes [first, last] of a face's lattice.
  struct Part {
    uint32_t face = 0;
    std::array<uint64_t, 2> first{}, last{};
    bool operator==(const Part&) const = default;
  };
  std::shared_ptr<const FacesReader> faces;
  std::vector<Part> parts;
  glm::vec3 colour{0.7f, 0.7f, 0.7f};
  std::optional<size_t> scalar;                                // among those of the faces; none: `colour`
  std::shared_ptr<const ColourTable> colours = nullptr;        // as Surface
  std::shared_ptr<const TransferFunction> function = nullptr;  // that `colours` are of
  SheetOpacity opacity = {};
  // by_function: the scalar of the picture's opacities, among those of `opacity_faces`, which are the same faces, perhaps
  // in another file; none: `scalar` has the opacities as well.
  std::shared_ptr<const FacesReader> opacity_faces = nullptr;
  std::optional<size_t> opacity_scalar = std::nullopt;
  std::string opacity_name = {};                   // in the cache
  std::shared_ptr<const PlacedMap> map = nullptr;  // as Surface, where it has no scalar
  bool own_colour = false;                         // as Surface

  /// Takes what does not change the mesh: colours and opacities' factors.
  void takeLookOf(const GridSurface& other) {
    colour = other.colour;
    colours = other.colours;
    function = other.function;
    opacity = other.opacity;
    map = other.map;
    own_colour = other.own_colour;
  }
  /// Whether the same patches make the same mesh.
  bool hasMeshOf(const GridSurface& other) const {
    return faces == other.faces && parts == other.parts && scalar == other.scalar &&
           opacity_faces == other.opacity_faces && opacity_scalar == other.opacity_scalar;
  }
};

struct CurveSet;

/// Lines and points, drawn as lit tubes and spheres: capsule by capsule (render/surface/capsule.h).
struct Curves {
  std::shared_ptr<const CurveSet> set;  // render/mesh/curve_set.h
  double width = 3;
  bool in_pixels = true;               // else `width` is in world units, after the scale factors
  glm::vec3 colour{0.7f, 0.7f, 0.7f};  // where the set has no value
  std::shared_ptr<const ColourTable> colours = nullptr;        // of its values, as Surface
  std::shared_ptr<const TransferFunction> function = nullptr;  // that `colours` are of
  std::string title = {};                                      // of the values
  double opacity = 1;
  // The whole trajectories, of which `set` is what a time shows (curvesAt() in curve_times.h); null: the set is the same at
  // all times.
  std::shared_ptr<const CurveSet> whole = nullptr;
  std::optional<double> tail = std::nullopt;  // of the part, in time; none: all before that time
  bool places = false;                        // points: where each is at that time
};

/// Isosurfaces of a scalar of the cache that gives the picture neither colours nor opacities, or of the other one of its two.
struct FurtherIsosurfaces {
  size_t variable = 0;
  std::vector<double> values = {};
  std::vector<std::optional<glm::vec3>> own_colours = {};  // as `values`, or empty; none: the function's
};

/// The surfaces, slices, isosurfaces and curves of a picture, and whether the volume is drawn.
struct SurfaceScene {
  std::vector<Surface> surfaces;
  std::vector<GridSurface> grid_surfaces;
  std::vector<ClipPlane> slices;  // planes; either side
  double slice_opacity = 1;
  bool slices_by_function = false;  // times the function's opacity; of two scalars, of that of the opacities
  std::vector<double> isovalues;    // of the picture's scalar; of two, of that of the opacities
  std::vector<std::optional<glm::vec3>> iso_colours = {};  // as `isovalues`, or empty; none: the function's
  std::vector<FurtherIsosurfaces> further_isosurfaces = {};
  SheetOpacity iso_opacity = {};  // by_function: the picture's opacities
  bool volume = true;             // false: what else there is alone
  std::vector<Curves> curves = {};

  bool hasIsosurfaces() const { return !isovalues.empty() || !further_isosurfaces.empty(); }
  /// Whether it has nothing that makes layers.
  bool empty() const {
    return surfaces.empty() && grid_surfaces.empty() && slices.empty() && !hasIsosurfaces() && curves.empty();
  }
  /// Whether any opacity is that of the picture's function.
  bool usesOpacities() const {
    return slices_by_function || iso_opacity.by_function ||
           std::any_of(grid_surfaces.begin(), grid_surfaces.end(),
                       [](const GridSurface& surface) { return surface.opacity_scalar.has_value(); });
  }
};

}  // namespace curvisplat
