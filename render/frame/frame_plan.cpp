#include "render/frame/frame_plan.h"

#include <tbb/info.h>
#include <tbb/task_arena.h>

#include <glm/common.hpp>
#include <glm/geometric.hpp>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <span>
#include <utility>

#include "render/project/footprint.h"
#include "render/project/screen_view.h"
#include "render/ranks/picture_shares.h"
#include "render/sweep/hidden_bricks.h"
#include "stream/base/error.h"
#include "stream/base/threads.h"
#include "stream/cache/manifest.h"

namespace curvisplat {
namespace {

// The distance of the perspective near plane, in diagonals of the data. Nearer splats would fill the image
// many times over and be cut into very many pieces.
constexpr double kNearInDiagonals = 1e-4;
// Memory that the cut and the source take for their notes about one brick.
constexpr uint64_t kFrameBytesABrick = 160;

ClassificationTable tableFor(const CacheReader& cache, size_t variable,
                             const TransferFunction& transfer_function) {
  const VariableInfo& info = cache.manifest().variables.at(variable);
  return ClassificationTable::of(transfer_function, info.min, info.max);
}

std::optional<ClassificationTable> colourClassesFor(const CacheReader& cache,
                                                    const std::optional<DrawnScalar>& scalar) {
  if (!scalar) return std::nullopt;
  const VariableInfo& info = cache.manifest().variables.at(scalar->variable);
  return ClassificationTable::ofColours(scalar->function, info.min, info.max);
}

/// n · (x - p) = n/scale · (scale x - scale p).
CutView::Plane cutPlane(const ClipPlane& plane, const ScreenView& view) {
  const glm::dvec3 normal = glm::normalize(plane.normal / view.scale);
  return {normal, -glm::dot(normal, view.scale * plane.point)};
}

/// The scalars that splats with these bounds can have.
std::pair<double, double> spreadOf(const ValueBounds& bounds, double reach) {
  const double deviation = std::hypot(kKernelSigma * bounds.largest_slope, bounds.largest_deviation);
  const double spread = 1.001 * (reach * bounds.largest_slope + ScreenCut::kReach * deviation);
  return {bounds.min - spread, bounds.max + spread};
}

/// The values of a brick's splats, as far as their slopes reach within a kernel's radius.
std::pair<float, float> reachedBy(const BrickVariable& values) {
  return {values.min - values.largest_slope, values.max + values.largest_slope};
}

CutOptions limitsOf(const FrameOptions& options) {
  CutOptions limits;
  limits.lod_pixels = options.lod_pixels;
  limits.max_splats = options.max_splats.value_or(CutOptions::kNoLimit);
  return limits;
}

/// The pixels that a stretched unit takes at the nearest point of a brick; infinite around the eye.
double largestPixels(const Brick& brick, const CutView& view) {
  if (!view.perspective) return view.pixels;
  const glm::dvec3 nearest = glm::clamp(view.eye, view.scale * brick.lower, view.scale * brick.upper);
  return view.pixels / glm::length(view.eye - nearest);
}

std::vector<ValueBounds> subtreesOf(const CacheReader& cache, size_t variable) {
  return subtreeBounds(cache.bricks(), cache.brickVariables(variable));
}

}  // namespace

FramePlanner::FramePlanner(const CacheReader& cache, const DrawnScalars& scalars)
    : cache_(cache),
      variable_(scalars.opacity.variable),
      transfer_function_(scalars.opacity.function),
      table_(tableFor(cache, variable_, transfer_function_)),
      coloured_by_(scalars.colour),
      colours_(coloured_by_ ? coloured_by_->function : transfer_function_),
      colour_classes_(colourClassesFor(cache, coloured_by_)),
      change_(table_),
      scalar_range_(transfer_function_.range()),
      subtrees_(subtreesOf(cache, variable_)),
      colour_subtrees_(coloured_by_ ? subtreesOf(cache, coloured_by_->variable)
                                    : std::vector<ValueBounds>()) {
  if (colour_classes_) colour_change_.emplace(*colour_classes_);
}

uint64_t FramePlanner::bytes(const FrameOptions& options) const {
  // Isosurfaces of further scalars are planned one scalar after the other.
  const bool has_third = options.scene && !options.scene->further_isosurfaces.empty();
  const uint64_t bounds = 1 + (coloured_by_ ? 1 : 0) + (has_third ? 1 : 0);
  return cache_.bricks().size() *
         (sizeof(Brick) + cache_.manifest().variables.size() * sizeof(BrickVariable) +
          bounds * sizeof(ValueBounds) + kFrameBytesABrick);
}

uint64_t FramePlanner::mostSplats() const {
  uint64_t splats = 0;
  for (const Brick& brick : cache_.bricks())
    if (brick.isLeaf()) splats += brick.splats + SweepBuffer::kPageSplats;
  return splats + splats / 4;
}

void FramePlanner::stepChanged() {
  table_ = tableFor(cache_, variable_, transfer_function_);
  colour_classes_ = colourClassesFor(cache_, coloured_by_);
  change_ = ClassificationChange(table_);
  if (colour_classes_) colour_change_.emplace(*colour_classes_);
  forgetFunctions();
  subtrees_ = subtreesOf(cache_, variable_);
  if (coloured_by_) colour_subtrees_ = subtreesOf(cache_, coloured_by_->variable);
}

void FramePlanner::setTransferFunction(const TransferFunction& transfer_function) {
  transfer_function_ = transfer_function;
  table_ = tableFor(cache_, variable_, transfer_function);
  change_ = ClassificationChange(table_);
  if (!coloured_by_) colours_ = ColourTable(transfer_function);
  scalar_range_ = transfer_function.range();
  forgetFunctions();
}

/// Forgets what was made of the functions that the pictures had.
void FramePlanner::forgetFunctions() {
  const MutexLock lock(mutex_);
  mergings_ = LayerMergings();
  shadows_ = {};
}

void runOnThreadsOf(const FrameOptions& options, const std::function<void()>& work) {
  tbb::task_arena arena(
      std::min(static_cast<int>(threadsOrCores(options.threads)), tbb::info::default_concurrency()));
  arena.execute(work);
}

ScreenView screenViewOf(const Manifest& manifest, const Camera& camera, const FrameOptions& options,
                        ImageSize size) {
  const double diagonal = glm::length(options.scale * (manifest.upper - manifest.lower));
  const double near = kNearInDiagonals * (diagonal > 0 ? diagonal : manifest.root.size);
  return ScreenView::of(camera, size, options.scale, options.low_pass_px2, near);
}

std::shared_ptr<const GradientOpacity> FramePlanner::gradientOf(const FrameOptions& options) const {
  if (options.gradient_opacity.empty()) return nullptr;
  const MutexLock lock(mutex_);
  if (!gradients_.percentiles || gradients_.scale != options.scale)
    gradients_ = {options.scale,
                  std::make_unique<const GradientPercentiles>(cache_, variable_, options.scale)};
  return std::make_shared<const GradientOpacity>(options.gradient_opacity, *gradients_.percentiles);
}

std::shared_ptr<const ShadowGrid> FramePlanner::shadowsOf(const ProjectionSettings& settings,
                                                          const FrameOptions& options) const {
  if (!options.light || !options.light->hasShadows()) return nullptr;
  const ShadowScene scene{*options.light, options.scale, settings.clip_planes, settings.gradient.get(),
                          options.keep_going};
  std::vector<double> key = ShadowGrid::keyOf(scene);
  for (const OpacityPoint& point : options.gradient_opacity)
    for (const double of : {point.x, point.opacity, point.midpoint, point.sharpness}) key.push_back(of);
  const MutexLock lock(mutex_);
  if (!shadows_.grid || shadows_.key != key) {
    shadows_ = {};
    std::shared_ptr<const ShadowGrid> grid;
    runOnThreadsOf(options,
                   [&] { grid = std::make_shared<const ShadowGrid>(cache_, variable_, table_, scene); });
    shadows_ = {std::move(key), std::move(grid)};
  }
  return shadows_.grid;
}

ProjectionSettings FramePlanner::settingsFor(const Camera& camera, const FrameOptions& options,
                                             ImageSize size) const {
  ProjectionSettings settings{screenView(camera, options, size),
                              options.classification == Classification::kPixel,
                              clipPlanesOf(options.clip_planes, options.clip_box), options.light};
  settings.borders = borderStyleOf(cache_.manifest());
  settings.gradient = gradientOf(options);
  settings.shadows = shadowsOf(settings, options);
  const double diagonal = glm::length(options.scale * (cache_.manifest().upper - cache_.manifest().lower));
  const double range = std::abs(scalar_range_.second - scalar_range_.first);
  if (diagonal > 0 && range > 0) settings.light_g0 = range / diagonal;
  return settings;
}

/// Returns a test of a brick's value bounds: whether every scalar that its pixels can have is without extinction.
TransparentBounds FramePlanner::transparentIn(const ProjectionSettings& settings) const {
  const double reach = settings.per_pixel ? largestReach(settings.view.low_pass_px2) : 1;
  return [this, reach](const ValueBounds& bounds) {
    const auto [low, high] = spreadOf(bounds, reach);
    return table_.fullyTransparent(static_cast<float>(low), static_cast<float>(high));
  };
}

CutView FramePlanner::cutViewOf(const ProjectionSettings& settings) const {
  CutView view = settings.view.cutView();
  for (const ClipPlane& plane : settings.clip_planes) view.planes.push_back(cutPlane(plane, settings.view));
  return view;
}

/// One cut for each slice, of the bricks on both of its sides. What is transparent in the volume is not there.
std::vector<SlicePlan> FramePlanner::planSlices(const ProjectionSettings& settings,
                                                const FrameOptions& options, const CutOptions& limits) const {
  std::vector<SlicePlan> slices;
  if (!options.scene) return slices;
  const CutTree tree{cache_.manifest().root, cache_.bricks(), cache_.brickVariables(variable_), subtrees_};
  for (const ClipPlane& plane : options.scene->slices) {
    CutView view = cutViewOf(settings);
    view.planes.push_back(cutPlane(plane, settings.view));
    view.planes.push_back(cutPlane({plane.point, -plane.normal}, settings.view));
    Cut cut = curvisplat::chooseCut(
        tree, view, [](const ValueBounds&) { return false; }, limits);
    slices.push_back({plane, std::move(cut.parts), cut.complete});
  }
  return slices;
}

/// Plans the bricks for isosurfaces of one scalar, with those that are transparent in the volume. In the order of the
/// bricks, which is the same for all painters.
std::vector<BrickPart> FramePlanner::isoParts(const IsoGroup& group, const CutOptions& limits,
                                              FramePlan& plan) const {
  std::vector<ValueBounds> of_third;
  const bool of_colours = coloured_by_ && group.variable == coloured_by_->variable;
  if (!of_colours && group.variable != variable_) of_third = subtreesOf(cache_, group.variable);
  const std::span<const ValueBounds> own = of_colours ? colour_subtrees_ : subtrees_;
  const CutTree tree{cache_.manifest().root, cache_.bricks(), cache_.brickVariables(group.variable),
                     of_third.empty() ? own : of_third};
  const double reach = largestReach(plan.settings.view.low_pass_px2);
  const auto has_none = [&](const ValueBounds& bounds) {
    const std::pair<double, double> spread = spreadOf(bounds, reach);
    return std::none_of(group.values.begin(), group.values.end(),
                        [&](double v) { return v >= spread.first && v <= spread.second; });
  };
  Cut cut = curvisplat::chooseCut(tree, cutViewOf(plan.settings), has_none, limits);
  plan.iso_complete &= cut.complete;
  std::sort(cut.parts.begin(), cut.parts.end(),
            [](const BrickPart& a, const BrickPart& b) { return a.brick < b.brick; });
  return std::move(cut.parts);
}

void FramePlanner::planIsosurfaces(const FrameOptions& options, const CutOptions& limits,
                                   FramePlan& plan) const {
  if (!options.scene) return;
  const auto colours = coloured_by_ ? std::optional(coloured_by_->variable) : std::nullopt;
  for (const IsoGroup& group : isoGroups(*options.scene, {variable_, colours}))
    plan.iso_parts.push_back(isoParts(group, limits, plan));
}

/// Null where all errors count: light and the gradient's opacity show the splats themselves.
std::function<double(uint32_t)> FramePlanner::errorWeightIn(const ProjectionSettings& settings,
                                                            const CutView& view, double lod_pixels) const {
  const double least = leastErrorWeight(lod_pixels);
  if (least >= 1 || settings.lit() || settings.gradient || !settings.per_pixel) return nullptr;
  const double scale = std::max({view.scale.x, view.scale.y, view.scale.z});
  const double whole = glm::length(view.scale * (cache_.manifest().upper - cache_.manifest().lower));
  return [this, view, least, scale, whole](uint32_t id) {
    const Brick& brick = cache_.bricks()[id];
    const BrickVariable& values = cache_.brickVariables(variable_)[id];
    const double voxel = brick.error * scale;
    const auto [low, high] = reachedBy(values);
    const double extinction =
        change_.largestExtinction(low - values.largest_deviation, high + values.largest_deviation);
    double change = change_.largestChange(low, high, values.largest_deviation);
    if (colour_change_) {
      const BrickVariable& colours = cache_.brickVariables(coloured_by_->variable)[id];
      const auto [first, last] = reachedBy(colours);
      change += extinction * colour_change_->largestChange(first, last, colours.largest_deviation);
    }
    return errorWeight(
        {change * voxel, extinction * lengthInStep(brick, view, voxel, whole), whole > 0 ? voxel / whole : 1},
        least);
  };
}

Cut FramePlanner::chooseCut(const ProjectionSettings& settings, const FrameOptions& options,
                            const CutOptions& limits) const {
  const CutView view = cutViewOf(settings);
  CutOptions weighted = limits;
  weighted.error_weight = errorWeightIn(settings, view, limits.lod_pixels);
  const CutTree tree{cache_.manifest().root, cache_.bricks(), cache_.brickVariables(variable_), subtrees_};
  Cut cut = curvisplat::chooseCut(tree, view, transparentIn(settings), weighted);
  if (options.max_splats && cut.splats > *options.max_splats)
    throw UsageError(
        "--max-splats {} is less than the coarsest picture of this cache takes ({} splats); give at least "
        "that",
        *options.max_splats, cut.splats);
  return cut;
}

SweptPart sweptPart(const BrickPart& part, const Brick& brick, const DepthKeys& keys) {
  return {part, keys.rangeOf(brick)};
}

FramePlan FramePlanner::planOf(const ProjectionSettings& settings, Cut cut) const {
  FramePlan plan{settings, std::move(cut), DepthKeys(settings.view, cache_.manifest().root), {}};
  plan.parts.reserve(plan.cut.parts.size());
  for (const BrickPart& part : plan.cut.parts)
    plan.parts.push_back(sweptPart(part, cache_.bricks()[part.brick], plan.keys));
  std::sort(plan.parts.begin(), plan.parts.end(),
            [](const SweptPart& a, const SweptPart& b) { return a.begin() < b.begin(); });
  return plan;
}

/// Has layers merged that are too thin to be seen in a picture of these settings. Not where light, the gradient's opacity or one
/// colour a splat show the splats themselves.
void FramePlanner::mergeLayers(const ProjectionSettings& settings, double lod_pixels, FramePlan& plan) const {
  if (!(lod_pixels > 0) || settings.lit() || settings.gradient || !settings.per_pixel) return;
  const CutView view = settings.view.cutView();
  const MutexLock lock(mutex_);
  const LayerMergings::Functions functions{table_, colourClasses(), view.scale};
  for (SweptPart& part : plan.parts) {
    const Brick& brick = cache_.bricks()[part.part.brick];
    if (!brick.isLeaf()) continue;
    const auto merging = mergings_.of(lod_pixels / largestPixels(brick, view), functions);
    if (!merging) continue;
    const auto known = std::find(plan.mergings.begin(), plan.mergings.end(), merging);
    part.part.merging = static_cast<uint16_t>(known - plan.mergings.begin() + 1);
    if (known == plan.mergings.end()) plan.mergings.push_back(merging);
  }
}

FramePlan FramePlanner::plan(const Camera& camera, const FrameOptions& options) const {
  const ProjectionSettings settings = settingsFor(camera, options, options.size);
  const CutOptions limits = limitsOf(options);
  FramePlan plan = planOf(settings, chooseCut(settings, options, limits));
  mergeLayers(settings, options.lod_pixels, plan);
  plan.slices = planSlices(settings, options, limits);
  planIsosurfaces(options, limits, plan);
  return plan;
}

void FramePlanner::share(FramePlan& plan, const FrameOptions& options) const {
  Ranks& ranks = *options.ranks;
  if (ranks.alone()) return;
  SharedParts& shared = plan.shared;
  shared.parts = plan.parts;
  shared.elements = BrickProjector::kMaxSplats + (coloured_by_ ? kMaxBrickSplats : 0);
  shared.size = options.size;
  if (ranks.isFirst()) {
    const std::vector<PartCost> costs =
        partCosts(plan.parts, cache_.bricks(), cache_.brickVariables(variable_), plan.settings.view);
    PictureShares shares = sharePicture(costs, options.size, ranks.count());
    shared.owners = std::move(shares.owners);
    shared.preparers = std::move(shares.preparers);
  }
  shared.owners = fromBytes<uint32_t>(ranks.broadcast(toBytes(shared.owners)));
  shared.preparers = fromBytes<uint32_t>(ranks.broadcast(toBytes(shared.preparers)));
  plan.tiles = std::make_shared<TileSet>(options.size, shared.owners, ranks.rank());
  if (options.keep_going) return;  // an ancestor that replaces a damaged brick reaches out of its box
  plan.parts_elsewhere = std::erase_if(plan.parts, [&](const SweptPart& part) {
    return !plan.tiles->touches(screenBoxOf(cache_.bricks()[part.part.brick], plan.settings.view));
  });
}

void FramePlanner::addLayers(FramePlan& plan, std::shared_ptr<const PixelLayers> layers,
                             const FrameOptions& options) const {
  plan.layers = std::move(layers);
  plan.settings.layers = plan.layers.get();
  const bool volume = options.scene->volume;
  if (volume && options.keep_going)
    return;  // an ancestor that replaces a damaged brick reaches out of its box
  plan.parts_hidden = std::erase_if(plan.parts, [&](const SweptPart& part) {
    if (!volume) return true;
    const Brick& brick = cache_.bricks()[part.part.brick];
    const PixelLayers::Bounds bounds = plan.layers->boundsOver(screenBoxOf(brick, plan.settings.view));
    return nearestDepthOf(brick, plan.settings.view) - plan.layers->depthOrigin() >= double{bounds.hidden};
  });
}

QuickPlan FramePlanner::planQuick(const Camera& camera, const FrameOptions& options,
                                  const QuickLimits& quick_limits) const {
  const ProjectionSettings settings = settingsFor(camera, options, options.size);
  CutOptions limits = limitsOf(options);
  limits.max_splats = std::min(limits.max_splats, quick_limits.max_splats);
  limits.max_bytes = std::min(limits.max_bytes, quick_limits.max_bytes);
  Cut cut = chooseCut(settings, options, limits);
  const ReducedSize size(options.size,
                         std::max(quick_limits.detail_px, cut.complete ? 0 : cut.largest_error_px));
  ProjectionSettings reduced = size.isWhole() ? settings : settingsFor(camera, options, size.size());
  FramePlan plan = planOf(reduced, std::move(cut));
  mergeLayers(settings, options.lod_pixels,
              plan);  // of the whole picture's pixels: it will find them in memory
  plan.slices = planSlices(plan.settings, options, limits);
  planIsosurfaces(options, limits, plan);
  return {std::move(plan), size};
}

namespace {

constexpr double kMaxHiddenPixels = 4;
constexpr double kMinWeight = 0.25;
// The opacity of the optical depth that counts as shown (bench/README.md, "Rendering from growing caches").
constexpr double kShownChange = 0.05;
constexpr double kShownRipple = 1;
constexpr double kMaxShare = 1.0 / 48;

/// The least |d_i| of the directions d from the eye to the points of a box, along any axis.
double leastComponent(const Brick& brick, const CutView& view) {
  double least = 1;
  if (!view.perspective) {
    const glm::dvec3 d = glm::abs(glm::normalize(view.towards_viewer));
    return std::min({d.x, d.y, d.z});
  }
  const glm::dvec3 lower = view.scale * brick.lower, upper = view.scale * brick.upper;
  const double farthest = glm::length(glm::max(glm::abs(lower - view.eye), glm::abs(upper - view.eye)));
  for (int axis = 0; axis < 3; ++axis) {
    const double apart = std::max({lower[axis] - view.eye[axis], view.eye[axis] - upper[axis], 0.0});
    least = std::min(least, farthest > 0 ? apart / farthest : 0);
  }
  return least;
}

}  // namespace

double leastErrorWeight(double lod_pixels) {
  return lod_pixels > 0 ? std::clamp(lod_pixels / kMaxHiddenPixels, kMinWeight, 1.0) : 1.0;
}

double errorWeight(const VoxelLoss& loss, double least) {
  if (loss.share > kMaxShare) return 1;
  const double shown =
      std::max(-std::expm1(-loss.changed) / kShownChange, -std::expm1(-loss.rippling) / kShownRipple);
  return std::clamp(shown, least, 1.0);
}

double lengthInStep(const Brick& brick, const CutView& view, double voxel, double whole) {
  const double component = leastComponent(brick, view);
  return component * whole * std::numbers::pi > voxel ? voxel / (component * std::numbers::pi) : whole;
}

}  // namespace curvisplat
