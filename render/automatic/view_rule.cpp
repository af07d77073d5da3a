#include "render/automatic/view_rule.h"

#include <hwy/contrib/sort/vqsort.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <glm/mat4x4.hpp>
#include <glm/vec2.hpp>
#include <glm/vec4.hpp>
#include <glm/vector_relational.hpp>
#include <limits>
#include <numbers>
#include <numeric>
#include <span>
#include <utility>

#include "render/colour/function_parts.h"

namespace curvisplat {
namespace {

/// Numbers with weights, in bins by their size: a percentile sorts those of one bin alone.
class WeightedBins {
 public:
  /// Both must outlive it.
  WeightedBins(std::span<const double> numbers, std::span<const double> weights)
      : numbers_(numbers), weights_(weights) {
    const auto [least, most] = std::minmax_element(numbers_.begin(), numbers_.end());
    low_ = *least;
    high_ = *most;
    for (size_t n = 0; n < numbers_.size(); ++n) sums_[binOf(numbers_[n])] += weights_[n];
  }

  double low() const { return low_; }
  double high() const { return high_; }
  /// The number below which `part` of the weights lie.
  double percentile(double part) const {
    double left = part * std::accumulate(sums_.begin(), sums_.end(), 0.0);
    size_t bin = 0;
    while (bin + 1 < sums_.size() && sums_[bin] < left) left -= sums_[bin++];
    std::vector<std::pair<double, double>> weighted;
    for (size_t n = 0; n < numbers_.size(); ++n)
      if (binOf(numbers_[n]) == bin) weighted.emplace_back(numbers_[n], weights_[n]);
    std::sort(weighted.begin(), weighted.end());
    for (const auto& [number, weight] : weighted)
      if ((left -= weight) <= 0) return number;
    return weighted.empty() ? high_ : weighted.back().first;
  }

 private:
  size_t binOf(double number) const {
    const double place = (number - low_) / (high_ - low_) * static_cast<double>(sums_.size());
    return place < static_cast<double>(sums_.size()) ? static_cast<size_t>(place)
                                                     : sums_.size() - 1;  // of one number, 0 / 0, the last
  }

  std::span<const double> numbers_, weights_;
  double low_ = 0, high_ = 0;
  std::array<double, 1024> sums_{};
};

struct Bounds {
  glm::dvec3 lower{std::numeric_limits<double>::max()}, upper{-std::numeric_limits<double>::max()};

  explicit Bounds(const CoarseSamples& samples) {
    for (const glm::dvec3& position : samples.positions) {
      lower = glm::min(lower, position);
      upper = glm::max(upper, position);
    }
  }
};

/// Coarse samples as seen from one side, sorted into square pixels: what areas are measured with. Borrows the samples.
class PixelSums {
 public:
  static constexpr int kMaxPixels = 80;  // along the longer side
  /// About how many samples a pixel has: fewer samples are seen with larger pixels, without gaps.
  static constexpr int kSamplesPerPixel = 47;

  /// `view`: as Camera::named() knows it. `bounds`: of the samples, of which there are some.
  PixelSums(const CoarseSamples& samples, const Bounds& bounds, std::string_view view)
      : samples_(samples),
        pixels_(std::min(kMaxPixels, 1 + static_cast<int>(std::sqrt(samples.size() / kSamplesPerPixel)))),
        view_from_world_(Camera::named(view, bounds.lower, bounds.upper, {kMaxPixels, kMaxPixels},
                                       Projection::kOrthographic)
                             .viewFromWorld()) {
    glm::dvec2 lowest(std::numeric_limits<double>::max()), highest(-std::numeric_limits<double>::max());
    for (const glm::dvec3& position : samples.positions) {
      const glm::dvec2 place = placeOf(position);
      lowest = glm::min(lowest, place);
      highest = glm::max(highest, place);
    }
    lowest_ = lowest;
    width_ = std::max(highest.x - lowest.x, highest.y - lowest.y) / pixels_;
  }

  /// [pixel]: the sum of weightOf(n) over its samples n. All are 0 if the samples are one point.
  template <typename WeightOf>
  std::vector<double> of(const WeightOf& weightOf) const {
    const auto pixels = static_cast<size_t>(pixels_);
    std::vector<double> sums(pixels * pixels, 0);
    if (!(width_ > 0)) return sums;
    for (size_t n = 0; n < samples_.size(); ++n) {
      const glm::dvec2 place = (placeOf(samples_.positions[n]) - lowest_) / width_;
      const auto column = static_cast<size_t>(std::min(pixels_ - 1, static_cast<int>(place.x)));
      const auto row = static_cast<size_t>(std::min(pixels_ - 1, static_cast<int>(place.y)));
      sums[row * pixels + column] += weightOf(n);
    }
    return sums;
  }
  /// The area of the pixels whose sum is over `least`, world units squared.
  double areaOver(double least, const std::vector<double>& sums) const {
    return width_ * width_ * static_cast<double>(std::count_if(sums.begin(), sums.end(), [&](double sum) {
             return sum > least;
           }));
  }
  /// The area of the pixels with samples.
  double coveredArea() const {
    return areaOver(0, of([](size_t) { return 1.0; }));
  }
  double pixelArea() const { return width_ * width_; }

 private:
  glm::dvec2 placeOf(const glm::dvec3& p) const {
    const glm::dmat4& m = view_from_world_;
    return {m[0].x * p.x + m[1].x * p.y + (m[2].x * p.z + m[3].x),
            m[0].y * p.x + m[1].y * p.y + (m[2].y * p.z + m[3].y)};
  }

  const CoarseSamples& samples_;
  const int pixels_;
  const glm::dmat4 view_from_world_;
  glm::dvec2 lowest_{0};
  double width_ = 0;
};

// Another view than iso, or than the one found so far, has to be larger by this factor.
constexpr double kPreferIso = 1.3, kPreferEarlier = 1.03;
// The views that are compared. A silhouette is as large from the other side.
constexpr std::string_view kViews[] = {"iso", "+x", "+y", "+z"};

}  // namespace

Silhouette widestSilhouette(const CoarseSamples& samples) {
  if (samples.size() == 0) return {"iso", 0};
  const Bounds bounds(samples);
  Silhouette best{"iso", 0};
  for (const std::string_view view : kViews) {
    const double area = PixelSums(samples, bounds, view).coveredArea();
    if (view == "iso" || area > best.area * (best.view == "iso" ? kPreferIso : kPreferEarlier))
      best = {view, area};
  }
  return best;
}

double seenArea(const CoarseSamples& samples, std::string_view view, const std::vector<double>& depths) {
  constexpr double kSeenPart = 0.01;  // of the mean depth
  if (samples.size() == 0) return 0;
  const PixelSums pixels(samples, Bounds(samples), view);
  const double covered = pixels.coveredArea();
  if (!(covered > 0)) return 0;
  const auto sums = pixels.of([&](size_t n) { return depths[n]; });
  const double mean = std::accumulate(sums.begin(), sums.end(), 0.0) * pixels.pixelArea() / covered;
  return pixels.areaOver(kSeenPart * mean, sums);
}

namespace {

constexpr double kUnseenPart = 0.01;  // of the extinction, beyond either side of the zoomed box
// Heights of a picture over those of what it frames: of a part of the data, and of the whole.
constexpr double kZoomMargin = 1.25, kWholeMargin = 1.15;
constexpr double kWorthZooming = 0.9;   // zooms only to less than this share of the whole picture
constexpr double kMinZoomed = 0.25;     // and never to less than this one
constexpr double kWorthCropping = 0.5;  // what can be seen has less than this part of the whole data's height
constexpr int kPlaceDigits = 4;
// A view from below has to show much more, and another side than the first a little more.
constexpr double kPreferAbove = 1.5, kPreferFirst = 1.05;
constexpr glm::dvec3 kOctants[] = {{1, 1, 1},  {-1, 1, 1},  {-1, -1, 1},  {1, -1, 1},
                                   {1, 1, -1}, {-1, 1, -1}, {-1, -1, -1}, {1, -1, -1}};

/// Samples as a camera sees them: x right, y up, z towards the viewer.
struct SeenSamples {
  std::array<std::vector<double>, 3> places;
  const glm::dmat4 view_from_world, world_from_view;

  SeenSamples(const CoarseSamples& samples, const Camera& camera)
      : view_from_world(camera.viewFromWorld()), world_from_view(glm::inverse(view_from_world)) {
    for (std::vector<double>& along : places) along.resize(samples.size());
    for (size_t n = 0; n < samples.size(); ++n) {
      const glm::dvec4 place = view_from_world * glm::dvec4(samples.positions[n], 1);
      for (int axis = 0; axis < 3; ++axis) places[static_cast<size_t>(axis)][n] = place[axis];
    }
  }
  glm::dvec3 world(const glm::dvec3& place) const {
    return glm::dvec3(world_from_view * glm::dvec4(place, 1));
  }
};

/// A box in view space.
struct SeenBox {
  glm::dvec3 lower, upper;
  glm::dvec3 middle() const { return 0.5 * (lower + upper); }
  bool contains(const glm::dvec3& place) const {
    return glm::all(glm::lessThanEqual(lower, place)) && glm::all(glm::lessThanEqual(place, upper));
  }
  /// Half the height of a picture of this aspect that shows it.
  double halfHeight(double aspect) const {
    return 0.5 * std::max(upper.y - lower.y, (upper.x - lower.x) / aspect);
  }
};

/// The box that all samples lie in, and the one that has nearly all of what is seen.
struct SeenBoxes {
  SeenBox all, seen;

  SeenBoxes(const SeenSamples& samples, const std::vector<double>& depths) {
    for (int axis = 0; axis < 3; ++axis) {
      const WeightedBins bins(samples.places[static_cast<size_t>(axis)], depths);
      all.lower[axis] = bins.low();
      all.upper[axis] = bins.high();
      seen.lower[axis] = bins.percentile(kUnseenPart);
      seen.upper[axis] = bins.percentile(1 - kUnseenPart);
    }
  }
  /// Whether a picture shows `seen` alone: the rest of the data may be much larger.
  bool isCropped(double aspect) const {
    return kZoomMargin * seen.halfHeight(aspect) < kWorthCropping * kWholeMargin * all.halfHeight(aspect);
  }
};

}  // namespace

bool showsAPart(const CoarseSamples& samples, std::string_view view, const std::vector<double>& depths) {
  const Bounds bounds(samples);
  const Camera camera = Camera::named(view, bounds.lower, bounds.upper, {1, 1}, Projection::kOrthographic);
  return SeenBoxes(SeenSamples(samples, camera), depths).isCropped(1);
}

namespace {

/// Some of the samples, standing for all: enough to compare sides.
struct FewSamples {
  static constexpr size_t kSamples = 30'000;
  CoarseSamples samples;            // positions and values alone
  std::vector<double> depths;       // of what each stands for
  std::vector<double> extinctions;  // over the largest, 0..1

  FewSamples(const CoarseSamples& all, const std::vector<double>& all_depths) {
    const size_t stride = std::max<size_t>(1, all.size() / kSamples);
    double largest = 0;
    for (size_t n = 0; n < all.size(); n += stride) {
      if (!(all.volumes[n] > 0)) continue;
      samples.positions.push_back(all.positions[n]);
      samples.values.push_back(all.values[n]);
      depths.push_back(all_depths[n] * static_cast<double>(stride));
      extinctions.push_back(all_depths[n] / all.volumes[n]);
      largest = std::max(largest, extinctions.back());
    }
    for (double& one : extinctions) one /= largest > 0 ? largest : 1;
  }
};

/// Calls take(n, hidden), the samples nearest to a camera first. `hidden`: the area of the background that this sample hides and no
/// nearer one does.
template <typename Take>
void walkSeen(const FewSamples& few, const Camera& camera, const Take& take) {
  constexpr int kPixels = 48;  // of the longer side: a dozen samples for each
  const SeenSamples seen(few.samples, camera);
  std::array<double, 3> low, reach;
  for (size_t axis = 0; axis < 3; ++axis) {
    if (seen.places[axis].empty()) return;
    const auto [least, most] = std::minmax_element(seen.places[axis].begin(), seen.places[axis].end());
    low[axis] = *least;
    reach[axis] = *most - *least;
  }
  const double width = std::max(reach[0], reach[1]) / kPixels;
  if (!(width > 0)) return;
  std::vector<uint64_t> order;  // the distance in the upper half, n in the lower
  for (size_t n = 0; n < few.depths.size(); ++n) {
    const double away = reach[2] > 0 ? 1 - (seen.places[2][n] - low[2]) / reach[2] : 0;
    order.push_back(static_cast<uint64_t>(away * 0xffffffff) << 32 | n);
  }
  hwy::Sorter()(order.data(), order.size(), hwy::SortAscending());
  std::vector<double> through(size_t{kPixels} * kPixels, 1);
  for (const uint64_t key : order) {
    const auto n = static_cast<uint32_t>(key);
    const auto pixel = [&](size_t axis) {
      return std::min<size_t>(kPixels - 1, static_cast<size_t>((seen.places[axis][n] - low[axis]) / width));
    };
    double& left = through[pixel(1) * kPixels + pixel(0)];
    const double passed = std::exp(-few.depths[n] / (width * width));
    take(n, left * (1 - passed) * width * width);
    left *= passed;
  }
}

/// How much a camera sees of the rare values, which are the most opaque: the area that each sample hides, times its extinction.
double rareSeen(const FewSamples& few, const Camera& camera) {
  double sum = 0;
  walkSeen(few, camera, [&](size_t n, double hidden) { sum += hidden * few.extinctions[n]; });
  return sum;
}

/// A camera that looks from `from` at the data's middle, z up.
Camera obliqueCamera(const glm::dvec3& from, const glm::dvec3& lower, const glm::dvec3& upper) {
  Camera camera;
  camera.focal_point = 0.5 * (lower + upper);
  const double diagonal = glm::length(upper - lower);
  camera.position = camera.focal_point + (diagonal > 0 ? diagonal : 1) * glm::normalize(from);
  camera.view_up = {0, 0, 1};
  return camera;
}

}  // namespace

SeenValues seenValues(const CoarseSamples& samples, const std::vector<double>& depths,
                      const glm::dvec3& lower, const glm::dvec3& upper) {
  const FewSamples few(samples, depths);
  SeenValues seen{few.samples.values, std::vector<double>(few.samples.size(), 0)};
  for (const glm::dvec3& octant : kOctants)
    walkSeen(few, obliqueCamera(octant, lower, upper),
             [&](size_t n, double hidden) { seen.areas[n] += hidden; });
  return seen;
}

namespace {

/// Finds a camera that looks along -z and shows the points in perspective as large as it can. An edge of the picture is a plane through
/// the camera; moved in parallel until it touches the points from outside, it meets z = 0 at x = max(x + slope z) at the right, and at
/// x = -max(slope z - x) at the left. The planes of opposite edges meet in the camera; of the two pairs the farther one counts.
class PerspectiveFit {
 public:
  /// `margin`: the picture's size over that of the points.
  PerspectiveFit(double aspect, double margin)
      : slopes_{std::tan(kChosenViewAngle * std::numbers::pi / 360) / margin * aspect,
                std::tan(kChosenViewAngle * std::numbers::pi / 360) / margin} {}
  void add(const glm::dvec3& place) {
    for (int axis = 0; axis < 2; ++axis) {
      right_[axis] = std::max(right_[axis], place[axis] + slopes_[axis] * place.z);
      left_[axis] = std::max(left_[axis], slopes_[axis] * place.z - place[axis]);
    }
    nearest_ = std::max(nearest_, place.z);
  }
  glm::dvec3 position(double min_distance) const {
    const glm::dvec2 z = 0.5 * (right_ + left_) / slopes_, middle = 0.5 * (right_ - left_);
    return {middle, std::max({z.x, z.y, nearest_ + min_distance})};
  }

 private:
  glm::dvec2 slopes_;
  glm::dvec2 right_{-std::numeric_limits<double>::max()}, left_{-std::numeric_limits<double>::max()};
  double nearest_ = -std::numeric_limits<double>::max();
};

glm::dvec3 roundedPlace(const glm::dvec3& place, double scale) {
  glm::dvec3 rounded;
  for (int axis = 0; axis < 3; ++axis) rounded[axis] = roundedTo(place[axis], scale, kPlaceDigits);
  return rounded;
}

/// The view along the axis of `view`, "+x", "+y" or "+z", from the side from which more is seen: the deep end of an ocean's column
/// is not what one looks for.
std::string betterSide(const DrawnSamples& drawn, const std::string& view) {
  const FewSamples few(drawn.samples, drawn.depths);
  const auto worth = [&](const std::string& from) {
    return rareSeen(few, Camera::named(from, drawn.lower, drawn.upper, {1, 1}, Projection::kOrthographic));
  };
  const std::string other = "-" + view.substr(1);
  return worth(other) > (other == "-z" ? kPreferAbove : kPreferFirst) * worth(view) ? other : view;
}

/// The view along an axis, `whole`'s, nearer where that shows much more of what can be seen, or else as it is.
ViewChoice alongAxis(const DrawnSamples& drawn, ViewChoice choice, const Camera& whole, double aspect) {
  const SeenSamples seen(drawn.samples, whole);
  const SeenBoxes boxes(seen, drawn.depths);
  const bool cropped = boxes.isCropped(aspect);
  const SeenBox& box = cropped ? boxes.seen : boxes.all;
  const double needed = (cropped ? kZoomMargin : kWholeMargin) * box.halfHeight(aspect);
  if (!(needed < kWorthZooming * whole.parallel_scale)) return choice;
  const glm::dvec4 centre = whole.viewFromWorld() * glm::dvec4(whole.focal_point, 1);
  const glm::dvec3 middle = box.middle();
  choice.parallel_scale = std::max(needed, kMinZoomed * whole.parallel_scale);
  choice.focal_point = roundedPlace(seen.world({middle.x, middle.y, centre.z}), choice.parallel_scale);
  choice.parallel_scale = roundedTo(choice.parallel_scale, choice.parallel_scale, kPlaceDigits - 1);
  return choice;
}

}  // namespace

Camera cameraOf(const ViewChoice& choice, const glm::dvec3& lower, const glm::dvec3& upper, ImageSize size) {
  Camera camera = Camera::named(choice.view, lower, upper, size, Projection::kOrthographic);
  if (!choice.focal_point) return camera;
  if (!choice.position) {
    camera.position += *choice.focal_point - camera.focal_point;
    camera.focal_point = *choice.focal_point;
    camera.parallel_scale = choice.parallel_scale;
    return camera;
  }
  camera.position = *choice.position;
  camera.focal_point = *choice.focal_point;
  camera.view_up = {0, 0, 1};
  camera.projection = Projection::kPerspective;
  camera.view_angle_deg = kChosenViewAngle;
  camera.parallel_scale = camera.parallelScaleFor(lower, upper, size);
  return camera;
}

namespace {

/// The oblique side from which a camera sees most of the rare values.
glm::dvec3 bestOctant(const DrawnSamples& drawn) {
  const FewSamples few(drawn.samples, drawn.depths);
  double best = 0;
  glm::dvec3 from = kOctants[0];
  for (const glm::dvec3& octant : kOctants) {
    const double worth =
        rareSeen(few, obliqueCamera(octant, drawn.lower, drawn.upper)) / (octant.z < 0 ? kPreferAbove : 1);
    if (!(worth > best * (best > 0 ? kPreferFirst : 1))) continue;
    best = worth;
    from = octant;
  }
  return from;
}

/// The view in perspective that looks along `camera`, as near as it can show what is framed.
ViewChoice inPerspective(const DrawnSamples& drawn, const Camera& camera, double aspect, Framed framed) {
  const glm::dvec3 &lower = drawn.lower, &upper = drawn.upper;
  const SeenSamples seen(drawn.samples, camera);
  const SeenBoxes boxes(seen, drawn.depths);
  const bool cropped = framed == Framed::kSeen && boxes.isCropped(aspect);
  PerspectiveFit fit(aspect, cropped ? kZoomMargin : kWholeMargin);
  if (framed == Framed::kBox)
    for (int n = 0; n < 8; ++n) {
      const glm::dvec3 corner(n & 1 ? upper.x : lower.x, n & 2 ? upper.y : lower.y,
                              n & 4 ? upper.z : lower.z);
      fit.add(glm::dvec3(seen.view_from_world * glm::dvec4(corner, 1)));
    }
  else
    for (size_t n = 0; n < drawn.samples.size(); ++n) {
      const glm::dvec3 place(seen.places[0][n], seen.places[1][n], seen.places[2][n]);
      if (cropped && !(drawn.depths[n] > 0 && boxes.seen.contains(place))) continue;
      fit.add(place);
    }
  const double extent = glm::length(boxes.all.upper - boxes.all.lower);
  const glm::dvec3 position = fit.position(0.05 * extent);
  const glm::dvec3 focal(position.x, position.y, (cropped ? boxes.seen : boxes.all).middle().z);
  const double distance = position.z - focal.z;
  ViewChoice choice;
  choice.position = roundedPlace(seen.world(position), distance);
  choice.focal_point = roundedPlace(seen.world(focal), distance);
  return choice;
}

}  // namespace

ViewChoice chooseView(const DrawnSamples& drawn, ImageSize size, Framed framed) {
  ViewChoice choice{std::string(drawn.widest.view)};
  const double aspect = static_cast<double>(size.width) / size.height;
  const double total = std::accumulate(drawn.depths.begin(), drawn.depths.end(), 0.0);
  if (!(total > 0)) return choice;
  if (choice.view == "iso")
    return inPerspective(drawn, obliqueCamera(bestOctant(drawn), drawn.lower, drawn.upper), aspect, framed);
  choice.view = betterSide(drawn, choice.view);
  if (framed == Framed::kBox) return choice;
  const Camera whole = Camera::named(choice.view, drawn.lower, drawn.upper, size, Projection::kOrthographic);
  return alongAxis(drawn, choice, whole, aspect);
}

}  // namespace curvisplat
