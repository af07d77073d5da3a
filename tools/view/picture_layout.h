// A picture and its pixels: how it is divided and annotated, as `render` does it, which point of the data is
// seen at a pixel, and what the data are at that point. Only PointProbe reads the cache, on another thread;
// it is for the window's thread. The other functions are pure, for any thread.
#pragma once

#include <glm/vec2.hpp>
#include <glm/vec3.hpp>

#include <cstdint>
#include <future>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "render/annotate/annotations.h"
#include "stream/cache/cache_reader.h"
#include "stream/cache/manifest.h"
#include "stream/cache/probe.h"
#include "stream/model/globe.h"
#include "tools/view/frame_loop.h"
#include "tools/view/view_state.h"

namespace curvisplat {

/// A state's functions, ready to be drawn and annotated. It must outlive the results of its members.
class ShownFunctions {
 public:
  ShownFunctions(const ViewState& state, const Manifest& manifest);

  DrawnScalars scalars(const CacheReader& cache, const ViewState& state) const;
  std::vector<ShownFunction> bars() const;

 private:
  TransferFunction colours_;
  std::optional<TransferFunction> opacities_, of_faces_;  // of faces that have a scalar of their own
  std::shared_ptr<const TransferFunction> of_curves_;     // of values other than the picture's
  std::string title_, opacity_title_, faces_title_, curves_title_;
  bool shows_colours_, shows_opacities_;  // of colours_
};

/// The part of a picture that shows the data.
ImageSize dataSizeOf(const ViewState& state, const Manifest& manifest, ImageSize picture);

/// The box of the axes grid of data on a globe, found once a picture has that grid and kept for a cache.
class GlobeGrid {
 public:
  /// nullopt if the picture has no axes grid, or the data no longitudes and latitudes, or if they cannot be read,
  /// which the picture says.
  const std::optional<AnnotatedScene::OnGlobe>& boxOf(const ViewState& state, const CacheReader& cache);

 private:
  bool is_found_ = false;
  std::optional<AnnotatedScene::OnGlobe> box_;
};

/// The annotations of pictures that are saved: markers, too, which the window and the page show by signs of their own.
Annotations savedAnnotations(const ViewState& state);

/// The scene of a frame that was drawn for this state; `box`: GlobeGrid::boxOf().
AnnotatedScene sceneOf(const ViewState& state, const ShownFunctions& functions, const ShownFrame& frame,
                       ImageSize picture, const std::optional<AnnotatedScene::OnGlobe>& box);

/// A point of the data as people read it: "4.250°E, 52.100°N, depth 120 m" on a globe, elsewhere its coordinates.
std::string placeText(const glm::dvec3& point, const std::optional<Globe>& globe);

/// The point, in data coordinates, where the ray through `pixel` of a picture of `size` has half of its
/// opacity. nullopt where nothing is seen.
std::optional<glm::dvec3> pointSeenAt(const ShownValues& shown, const Manifest& manifest,
                                      const glm::dvec2& pixel, ImageSize size);

/// Finds the values of the data at a point on another thread. It answers the newest question and drops older
/// ones.
class PointProbe {
 public:
  /// `cache` must outlive it.
  explicit PointProbe(const CacheReader& cache) : cache_(cache) {}

  struct Question {
    glm::dvec3 point{0.0};  // data coordinates
    size_t variable = 0;
    StepPosition at;
    bool operator==(const Question&) const = default;
  };
  struct Answer {
    Question question;
    std::optional<ProbeResult> found;  // nullopt: outside of the data
  };

  /// Asks a question. No effect if it is the newest question already, unless `again`.
  void ask(const Question& question, bool again = false);
  /// An answer that has come since the last call. Throws what reading throws. Call it often: it also begins
  /// to answer the next question.
  std::optional<Answer> poll();
  bool busy() const { return answering_.valid() || next_; }

 private:
  const CacheReader& cache_;
  std::optional<Question> asked_, next_;
  std::future<Answer> answering_;
};

}  // namespace curvisplat
