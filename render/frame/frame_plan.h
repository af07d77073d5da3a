// The stage "plan" of a frame: which parts of which bricks the view needs, the order in which they are
// swept, and how their splats are projected. It reads the octree only, and no bricks but those that
// gradients are measured in and shadows are made from, once.
//
// The cut is chosen by the error that bricks have on the screen, weighted by what the transfer function
// shows of it (errorWeight()). The same cache, view and options give the same plan. Any number of threads
// may plan at a time.
#pragma once

#include <algorithm>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <utility>
#include <vector>

#include "render/camera/camera.h"
#include "render/colour/classification.h"
#include "render/frame/first_picture.h"
#include "render/frame/frame_options.h"
#include "render/frame/layer_mergings.h"
#include "render/project/depth_sort.h"
#include "render/project/gradient_opacity.h"
#include "render/project/projection.h"
#include "render/project/shadow_grid.h"
#include "render/project/tile_set.h"
#include "render/ranks/splat_exchange.h"
#include "render/surface/iso_groups.h"
#include "render/sweep/sweep_buffer.h"
#include "stream/base/mutex.h"
#include "stream/cache/cache_reader.h"
#include "stream/model/octree.h"
#include "stream/paging/brick_source.h"
#include "stream/paging/cut.h"

namespace curvisplat {

/// Runs work that is parallel by TBB, with as many threads as the options say. Waits for it.
void runOnThreadsOf(const FrameOptions& options, const std::function<void()>& work);

/// The projection for a frame of `size` pixels of a cache with this manifest. Throws UsageError as
/// ScreenView::of() does.
ScreenView screenViewOf(const Manifest& manifest, const Camera& camera, const FrameOptions& options,
                        ImageSize size);

/// The bricks that a slice of the scene crosses.
struct SlicePlan {
  ClipPlane plane;
  std::vector<BrickPart> parts;
  bool complete = true;  // as Cut's
};

struct FramePlan {
  ProjectionSettings settings;  // the picture has the size of settings.view
  Cut cut;
  DepthKeys keys;
  std::vector<SweptPart> parts;  // of the cut, in the sweep's order
  std::vector<SlicePlan> slices = {};
  std::vector<std::vector<BrickPart>> iso_parts = {};   // [isoGroups()] that may have its isosurfaces
  bool iso_complete = true;                             // as Cut's
  std::shared_ptr<const PixelLayers> layers = nullptr;  // those of settings, where there are some
  uint64_t parts_hidden = 0;                            // of the cut, behind opaque layers: not in `parts`
  std::shared_ptr<const TileSet> tiles = nullptr;       // of this rank; null: all
  SharedParts shared = {};                              // with other ranks; empty where there are none
  uint64_t parts_elsewhere = 0;                         // of the cut, in others' tiles: not in `parts`
  BrickSource::Mergings mergings = {};                  // of the parts: BrickPart::merging
};

/// A part of the cut with its range of depth keys, as the sweep needs it.
SweptPart sweptPart(const BrickPart& part, const Brick& brick, const DepthKeys& keys);

/// The plan of a picture that must appear quickly.
struct QuickPlan {
  FramePlan plan;
  ReducedSize size;

  /// Whether the picture is the final one: no brick is left to refine, and it has all pixels.
  bool isFinal() const {
    return plan.cut.complete && plan.iso_complete && size.isWhole() &&
           std::all_of(plan.slices.begin(), plan.slices.end(), [](const SlicePlan& s) { return s.complete; });
  }
};

/// Plans frames of one variable, or two, of one cache, which must outlive it.
class FramePlanner {
 public:
  FramePlanner(const CacheReader& cache, const DrawnScalars& scalars);

  /// Throws UsageError for an invalid view, and if options.max_splats is too small.
  FramePlan plan(const Camera& camera, const FrameOptions& options) const;
  /// Plans the best picture within `limits`. Throws as plan() does.
  QuickPlan planQuick(const Camera& camera, const FrameOptions& options, const QuickLimits& limits) const;

  /// The cache is at another step of the same geometry. Nothing may be planned or drawn meanwhile.
  void stepChanged();
  /// Takes effect with the next plan. Nothing may be planned or drawn meanwhile.
  void setTransferFunction(const TransferFunction& transfer_function);
  ScreenView screenView(const Camera& camera, const FrameOptions& options, ImageSize size) const {
    return screenViewOf(cache_.manifest(), camera, options, size);
  }

  /// Deals the picture and the parts to be prepared out to options.ranks, and leaves out of plan.parts what
  /// lies in the tiles of others. Nothing is left out if `keep_going`. All ranks have to call it; one
  /// alone keeps all.
  void share(FramePlan& plan, const FrameOptions& options) const;

  /// Puts the layers of its scene into a plan. Leaves out the parts that lie behind opaque layers at all of
  /// their pixels, unless `keep_going`; without a volume, all parts.
  void addLayers(FramePlan& plan, std::shared_ptr<const PixelLayers> layers,
                 const FrameOptions& options) const;

  const ClassificationTable& table() const { return table_; }
  /// PixelShading::colours of pictures of two scalars; null for one scalar.
  const ClassificationTable* colourClasses() const { return colour_classes_ ? &*colour_classes_ : nullptr; }
  const ColourTable& colours() const { return colours_; }
  /// The function of the opacities.
  const TransferFunction& transferFunction() const { return transfer_function_; }
  /// Memory in bytes of the octree, and of what plans of such frames and the later stages note about its bricks.
  uint64_t bytes(const FrameOptions& options) const;
  /// The most splats that any picture can have: those of the cache's finest level, with their border parts.
  uint64_t mostSplats() const;

 private:
  TransparentBounds transparentIn(const ProjectionSettings& settings) const;
  std::function<double(uint32_t)> errorWeightIn(const ProjectionSettings& settings, const CutView& view,
                                                double lod_pixels) const;
  void planIsosurfaces(const FrameOptions& options, const CutOptions& limits, FramePlan& plan) const;
  std::vector<BrickPart> isoParts(const IsoGroup& group, const CutOptions& limits, FramePlan& plan) const;
  void forgetFunctions();
  std::shared_ptr<const GradientOpacity> gradientOf(const FrameOptions& options) const;
  std::shared_ptr<const ShadowGrid> shadowsOf(const ProjectionSettings& settings,
                                              const FrameOptions& options) const;
  ProjectionSettings settingsFor(const Camera& camera, const FrameOptions& options, ImageSize size) const;
  CutView cutViewOf(const ProjectionSettings& settings) const;
  Cut chooseCut(const ProjectionSettings& settings, const FrameOptions& options,
                const CutOptions& limits) const;
  std::vector<SlicePlan> planSlices(const ProjectionSettings& settings, const FrameOptions& options,
                                    const CutOptions& limits) const;
  FramePlan planOf(const ProjectionSettings& settings, Cut cut) const;
  void mergeLayers(const ProjectionSettings& settings, double lod_pixels, FramePlan& plan) const;

  const CacheReader& cache_;
  const size_t variable_;
  TransferFunction transfer_function_;
  ClassificationTable table_;
  const std::optional<DrawnScalar> coloured_by_;
  ColourTable colours_;
  std::optional<ClassificationTable> colour_classes_;
  ClassificationChange change_;
  std::optional<ClassificationChange> colour_change_;  // of colour_classes_
  std::pair<double, double> scalar_range_;             // of the transfer function
  std::vector<ValueBounds> subtrees_;
  std::vector<ValueBounds> colour_subtrees_;  // of the scalar of the colours, if there is one

  /// The percentiles of the last picture, which take long to find.
  struct Gradients {
    glm::dvec3 scale{1.0};
    std::unique_ptr<const GradientPercentiles> percentiles;
  };
  mutable Mutex mutex_;
  mutable Gradients gradients_ GUARDED_BY(mutex_);
  mutable LayerMergings mergings_ GUARDED_BY(mutex_);
  struct Shadows {
    std::vector<double> key;
    std::shared_ptr<const ShadowGrid> grid;
  };
  mutable Shadows shadows_ GUARDED_BY(mutex_);
};

/// The least weight, for this error allowed on the screen. The detail of bricks that count least is at most
/// 4 pixels: borders show with any function. At 4 pixels and more, and at 0, everything counts (1).
double leastErrorWeight(double lod_pixels);

/// The loss by merging into one voxel. The scalar inside a voxel is known only to within the deviation that
/// its slope leaves, so the transfer function is wrong by at most its change within that deviation. And
/// merged kernels do not add up to one: they ripple with the voxels' lattice, which shows where a ray passes
/// many voxels at the same place.
struct VoxelLoss {
  double changed = 0;   // the optical depth that its unknown scalar changes
  double rippling = 0;  // the optical depth that rays pass in step with the lattice
  double share = 0;     // its length, of the data's
};

/// How much of a brick's error on the screen counts towards the cut (stream/paging/cut.h): all of it, down
/// to a quarter where nothing that merging loses can be seen. DESIGN.md, "The cut". In [least, 1]. Voxels
/// longer than 1/48 of the data count whole: in so few, borders are most of the picture.
double errorWeight(const VoxelLoss& loss, double least);

/// The stretched length over which rays pass the voxels of a lattice at the same place: voxels of the length
/// `voxel` along the axes, seen by `view` anywhere in the brick's box. At most `whole`, the data's length. For a
/// ray with the direction d it is voxel / (π |d_i|), where |d_i| is the smallest of d's components.
double lengthInStep(const Brick& brick, const CutView& view, double voxel, double whole);

}  // namespace curvisplat
