// Chooses from where data is looked at, and how much of it a picture shows: from coarse samples, seen from sides as areas
// of square pixels. DESIGN.md, "The first picture". Pure functions; any thread.
#pragma once

#include <glm/vec3.hpp>

#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "render/automatic/coarse_samples.h"
#include "render/camera/camera.h"

namespace curvisplat {

/// The area that the data covers when it is looked at from a side.
struct Silhouette {
  std::string_view view;  // as Camera::named() knows it
  double area = 0;        // world units squared
};

/// The silhouette from iso, unless a view along an axis shows more than 1.3 times its area, as of thin data. All samples
/// count, whatever their values: the box that the data lies in says nothing about a thin shell.
Silhouette widestSilhouette(const CoarseSamples& samples);

/// The area, in world units squared, in which a function shows something of the data from `view` (as
/// Camera::named() knows it): the parts of the silhouette whose optical depth is over 1 % of its mean.
/// `depths` [sample]: volume times extinction, not negative; the unit does not matter. 0 if all are 0.
double seenArea(const CoarseSamples& samples, std::string_view view, const std::vector<double>& depths);

/// Whether a square picture from `view` shows only the small part of the data in which there is something to be seen (chooseView()).
/// Requires one or more samples.
bool showsAPart(const CoarseSamples& samples, std::string_view view, const std::vector<double>& depths);

/// Values of some of the samples, and the area that each hides from the eight oblique sides together; the unit does not matter.
struct SeenValues {
  std::vector<float> values;
  std::vector<double> areas;
};
/// `depths` [sample]: volume times extinction, an area. `lower`, `upper`: the data's box.
SeenValues seenValues(const CoarseSamples& samples, const std::vector<double>& depths,
                      const glm::dvec3& lower, const glm::dvec3& upper);

/// A view as options state it, with few digits.
struct ViewChoice {
  std::string view = "iso";                              // as Camera::named() knows it
  std::optional<glm::dvec3> focal_point = std::nullopt;  // nullopt: the whole data is shown
  double parallel_scale = 0;                             // with a focal point, unless there is a position
  /// The eye of a view in perspective, z up; `view` does not count then. Takes a focal point.
  std::optional<glm::dvec3> position = std::nullopt;
};
constexpr double kChosenViewAngle = 30;  // degrees, of a view in perspective

/// `lower`, `upper`: the box that the camera shows where it shows all.
Camera cameraOf(const ViewChoice& choice, const glm::dvec3& lower, const glm::dvec3& upper, ImageSize size);

/// The part of the data that a picture shows, apart from what can be seen in it.
enum class Framed {
  kSeen,  // all samples, or the small part of them in which there is something to be seen
  kBox    // the box of the data, which is drawn
};

/// The samples that are drawn; borrows all.
struct DrawnSamples {
  const CoarseSamples& samples;
  const std::vector<double>& depths;  // [sample]: volume times extinction, an area
  const Silhouette& widest;
  glm::dvec3 lower, upper;  // the data's box
};

/// The view for a picture of `size`: along an axis, from either side, if the widest silhouette is, else in perspective from that of
/// eight oblique sides from which most of what the function makes opaque is seen.
ViewChoice chooseView(const DrawnSamples& drawn, ImageSize size, Framed framed);

}  // namespace curvisplat
