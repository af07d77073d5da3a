// Everything that defines a picture: camera, scalar, transfer function, cuts, surfaces, detail. States are
// saved as JSON between windows, and translated to a `curvisplat render` command (saved_views.h). Value types:
// one thread at a time may use an object.
#pragma once

#include <glm/vec3.hpp>

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "render/annotate/annotated_scene.h"
#include "render/annotate/annotations.h"
#include "render/automatic/stored_steps.h"
#include "render/camera/camera.h"
#include "render/frame/frame.h"
#include "stream/cache/manifest.h"
#include "tools/view/edited_function.h"
#include "tools/view/frame_loop.h"

namespace curvisplat {

inline constexpr size_t kMaxSurfaces = 64;  // of files and of the grid

/// Movies, where nothing else is chosen: as `render` draws them.
inline constexpr double kFramesPerSecond = 25;
inline constexpr uint64_t kTurnFrames = 90;

/// A surface of a file, which loadSurfaces() reads.
struct SurfaceFile {
  std::filesystem::path path;
  glm::vec3 colour{0.7f, 0.7f, 0.7f};
  std::shared_ptr<const TriangleMesh> mesh = nullptr;
  double opacity = 1;
  bool visible = true;
};

/// Faces of the grid, by a name that --surface takes.
struct NamedFaces {
  std::string name;
  glm::vec3 colour{0.7f, 0.7f, 0.7f};
  SheetOpacity opacity = {};
  bool visible = true;
  bool tinted = false;  // by `colour`, where all have a scalar's; never saved
};

/// A clip plane or a slice.
struct ListedPlane : ClipPlane {
  bool visible = true;
};

/// A number that no other call of this process returns.
uint64_t nextIsosurfaceId();

struct Isosurface {
  std::string scalar;
  double value = 0;
  bool visible = true;
  std::optional<glm::vec3> colour = std::nullopt;  // none: the function's
  uint64_t id = nextIsosurfaceId();  // copies have it, too: the list may change meanwhile; never saved
};

/// The scalar that colours the grid's faces, and the function that gives them colours where the picture
/// shows another scalar.
struct FacesScalar {
  std::string variable;
  EditedFunction function;
};

/// A place in the data that was clicked, and what was found there.
struct Marker {
  std::string name;
  glm::dvec3 point{0.0};  // data coordinates
  std::string scalar, unit;
  double value = 0;
  uint32_t block = 0;  // of the nearest node or cell; block, i, j and k count from 0
  uint64_t i = 0, j = 0, k = 0;
};

/// The text beside a marker in a picture that shows `scalar`: "1: 1.45 kg/m3"; the value of another scalar has its name.
std::string signOf(const Marker& marker, const std::string& scalar);

/// The scalar whose opacities are drawn, where it is not the one that gives the colours.
struct OpacityScalar {
  std::string variable;
  EditedFunction function;
};

/// Has what the command line shows beside the lists of the window, which neither change nor save it.
struct GivenSheets {
  std::vector<Curves> curves;
  std::optional<Surface> earth;
  std::string faces_with_map;                                // NamedFaces that show the Earth's image
  std::vector<std::pair<std::string, std::string>> options;  // of `render`, which show the same
  std::optional<AnnotatedScene::OnGlobe> above =
      std::nullopt;  // data around the Earth, which the first view looks down at
};

struct ViewState {
  static constexpr double kLightStrength = 0.7;
  static constexpr uint64_t kMemoryBytes = 512 << 20;

  std::string variable;
  Camera camera;
  EditedFunction function;
  double lod_pixels = 1;
  uint64_t memory_bytes = kMemoryBytes;
  Classification classification = Classification::kPixel;
  glm::dvec3 scale{1.0};
  std::optional<WorldBox> clip_box = std::nullopt;
  std::vector<ListedPlane> clip_planes = {};
  std::vector<SurfaceFile> surfaces = {};
  std::vector<NamedFaces> faces = {};
  std::optional<FacesScalar> faces_by = std::nullopt;  // none: each has its colour
  std::vector<ListedPlane> slices = {};
  SheetOpacity slice_opacity = {};
  std::vector<Isosurface> isosurfaces = {};
  SheetOpacity iso_opacity = {};
  bool volume = true;  // with a slice or a surface it may be left out
  bool lit = false;
  double shadow = 0, ambient_occlusion = 0;  // Light's, where lit
  double light_strength = kLightStrength;    // the light's part of what one sees; the rest is ambient
  std::optional<glm::dvec3> light_direction = std::nullopt;  // towards the light; none: as Light's
  std::vector<OpacityPoint> gradient_opacity = {};           // FrameOptions'
  bool dark = true;                                          // background
  Annotations annotations{.scalar_bar = true, .axes = true};
  std::string title = {};  // above the data, as it is; set by setTitle()
  std::optional<OpacityScalar> opacity_by = std::nullopt;
  std::vector<Marker> markers = {};
  std::shared_ptr<const GivenSheets> given = nullptr;

  /// Sets the title above the data, in UTF-8; cuts one of more than kLongestTitle bytes.
  void setTitle(std::string text);
  static constexpr size_t kLongestTitle = 200;
  glm::vec4 background() const { return dark ? kDefaultBackground : glm::vec4(1); }
  /// Suits all functions to the background (EditedFunction::suitBackground()).
  void suitBackground();
  const std::string& opacityScalar() const { return opacity_by ? opacity_by->variable : variable; }
  /// The isosurfaces that are drawn, by scalar: those of the opacities' scalar first.
  std::vector<std::vector<Isosurface>> drawnIsosurfaces() const;
  /// Whether anything but the volume is drawn, or would be without it.
  bool hasSheets() const;
  /// Whether slices or faces have the colours of the scalar's function.
  bool coloursSheets() const;
  /// Whether the volume is drawn: always if there is nothing else, whatever `volume` says.
  bool drawsVolume() const { return volume || !hasSheets(); }
  /// The direction towards the light, where lit; nullopt: the viewer. Shadows need a direction.
  std::optional<glm::dvec3> lightFrom() const;
  /// The opacity of faces as they are drawn: without a scalar there is no function.
  SheetOpacity opacityOf(const NamedFaces& named) const;
  FaceNames faceNames() const;
  /// Returns this state with the faces of a name tinted, listed or not: those that the mouse points at in a list.
  ViewState withTinted(const std::string& faces_name) const;
  /// The factor by which heights are exaggerated: z, and on a flat map what the cache was converted with as well.
  double verticalScale(const std::optional<Globe>& globe) const;
  /// Changes it, and keeps the same place in focus.
  void setVerticalScale(double factor, const std::optional<Globe>& globe);
  /// The differences of scalars that its functions and isosurfaces ask for, of a cache that has them.
  AskedDifferences askedDifferences(const CacheReader& cache) const;
  /// The options of a frame whose grid surfaces have their look; their faces are found by faceNames().
  FrameOptions frameOptions(ImageSize size, const Manifest& manifest) const;
};

/// Returns those that are not hidden.
std::vector<ClipPlane> visiblePlanes(const std::vector<ListedPlane>& planes);

/// The initial state without a look at the data: the first scalar that varies with a preset, and the data
/// fitted into the picture beside the scalar bar. Throws Error if the cache has no scalar.
ViewState firstViewOf(const Manifest& manifest, ImageSize picture);

/// Reads the surfaces that have no mesh yet. Throws Error for one that cannot be read.
void loadSurfaces(ViewState& state);

/// Selects another scalar and fits the transfer function to its range. Throws UsageError that lists the
/// scalars if there is none of this name.
void chooseVariable(ViewState& state, const Manifest& manifest, const std::string& name);
/// Removes opacities and colours of faces by scalars that a cache does not have, and hides isosurfaces of them: `manifest`
/// is of another cache of the same grid, which is shown next. `shown`: the scalar that is shown if the present one is not there.
void leaveOtherScalars(ViewState& state, const Manifest& manifest, const std::string& shown);

std::string toJson(const ViewState& state);
/// `path` names the file in messages. Throws Error with the path and the field that is missing or out of
/// range, or the scalar that the cache lacks.
ViewState viewStateFromJson(const std::string& text, const std::filesystem::path& path,
                            const Manifest& manifest);

/// The name of the scalar that the state shows. Throws Error as above.
std::string scalarOfViewState(const std::string& text, const std::filesystem::path& path);

}  // namespace curvisplat
