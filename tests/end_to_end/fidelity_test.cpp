// The whole program against the specification: generate, convert and render the half-annulus of DESIGN.md,
// "Fidelity", and compare with the reference ray march of the analytic field. The half-annulus sampled in
// cells against as many nodes, in one block and in several. Clip planes and light for every level, and with
// tools/test.sh --whole every function: the rows of the table of fidelity that go beyond
// fidelity_corrections_test's, each of which the picture without its correction misses.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <filesystem>
#include <glm/geometric.hpp>
#include <memory>
#include <optional>
#include <utility>
#include <vector>

#include "preprocess/convert/convert.h"
#include "preprocess/scenes/scenes.h"
#include "render/image/image.h"
#include "render/image/image_file.h"
#include "render/project/footprint.h"
#include "render/project/screen_view.h"
#include "stream/base/file.h"
#include "stream/cache/cache_reader.h"
#include "tests/reference/direct_picture.h"
#include "tests/reference/function_grid.h"
#include "tests/reference/grid_field.h"
#include "tests/reference/known_pictures.h"
#include "tests/reference/reference_march.h"
#include "tests/support/fault_sweep.h"
#include "tests/support/program_test.h"

namespace curvisplat {
namespace {

constexpr ImageSize kSize{256, 256};

Image absoluteDifference(const Image& a, const Image& b) {
  Image difference(a.size);
  for (size_t n = 0; n < a.rgba.size(); ++n)
    difference.rgba[n] = n % 4 == 3 ? 1 : 20 * std::abs(a.rgba[n] - b.rgba[n]);
  return difference;
}

// Leaves what a person needs to see what went wrong: the picture, what it should be, and 20 times the
// difference.
void leavePictures(const std::string& name, const Image& picture, const Image& reference) {
  const std::filesystem::path folder = std::filesystem::path(testing::TempDir()) / "curvisplat_fidelity";
  std::filesystem::create_directories(folder);
  writeImage(picture, folder / (name + "_picture.png"));
  writeImage(reference, folder / (name + "_reference.png"));
  if (picture.size == reference.size)  // else the reference is of some of its pixels
    writeImage(absoluteDifference(picture, reference), folder / (name + "_difference_x20.png"));
  ADD_FAILURE() << "pictures are in " << folder;
}

class Fidelity : public ProgramSuite<Fidelity> {
 protected:
  static void prepare() {}

  static void runSilently(const Words& words) {
    EXPECT_EQ(run(words).err, "") << testing::PrintToString(words);
  }

  /// The cache of a scene of 128 x 64 x 64 nodes, converted by the first who asks.
  static std::string cacheOf(const std::string& scene) {
    const std::string cache = file(scene + ".splats");
    if (!std::filesystem::exists(cache)) {
      runSilently({"generate", scene, "--size", "128x64x64", "-o", file(scene)});
      runSilently({"convert", file(scene + ".xyz"), file(scene + ".fun"), "-o", cache});
    }
    return cache;
  }

  static void render(const std::string& scene, const std::string& function, const std::string& output,
                     const Words& more = {}, const std::string& lod_pixels = "0") {
    runSilently(halfAnnulusWords(cacheOf(scene), output, function, kSize, lod_pixels) + more);
  }

  /// OpenGL draws the same picture, and no better but for what the painter leaves out, or fits (tile.h).
  static void expectOpenGlAlike(const std::string& name, const Image& picture, const Image& reference,
                                double psnr_db, const std::string& lod_pixels) {
    render("half-annulus", name, file("gl.pfm"), {"--backend", "osmesa"}, lod_pixels);
    const Image by_gl = readImage(file("gl.pfm"));
    EXPECT_GE(psnr_db, compareImages(by_gl, reference).psnr_db - 0.3) << "at " << lod_pixels << " pixels";
    const ImageDifference difference = compareImages(picture, by_gl);
    fmt::print("{} at {} pixels: {:.1f} dB, {:.5f} at the most from OpenGL\n", name, lod_pixels,
               difference.psnr_db, difference.largest);
    EXPECT_GE(difference.psnr_db, 70);
    EXPECT_LT(difference.largest, 1.0 / 255);
  }

  /// Bricks that stay on the card have the same fidelity, or a better one, since no layers are merged there.
  static void expectCardAlike(const std::string& name, const Image& picture, const Image& reference,
                              double psnr_db, const std::string& lod_pixels) {
    static const bool has_tiles = run({"info", "--system"}).out.find("compute shaders") != std::string::npos;
    if (!has_tiles) return;
    render("half-annulus", name, file("card.pfm"), {"--backend", "egl", "--card-memory", "256M"}, lod_pixels);
    const Image by_card = readImage(file("card.pfm"));
    EXPECT_GE(compareImages(by_card, reference).psnr_db, psnr_db - 0.3) << "at " << lod_pixels << " pixels";
    EXPECT_GE(compareImages(by_card, picture).psnr_db, 60) << "at " << lod_pixels << " pixels";
  }

  /// Expects a least fidelity of the processor's painter from the finest level and from the root alone, and
  /// that detail never costs any but what layers of thin cells lose that are merged, which no one sees.
  static void expectPsnr(const std::string& name, double least_db, double least_of_root_db) {
    const Image& reference = knownReference(name, kSize);
    constexpr double kLayersDb = 0.3, kUnseenDb = 60;
    double coarser_db = least_of_root_db;
    for (const char* lod_pixels : {"1000", "8", "4", "2", "0"}) {
      if ((lod_pixels == std::string("4") || lod_pixels == std::string("2")) && !faults::isWholeSweep())
        continue;
      render("half-annulus", name, file(name + ".pfm"), {"--backend", "cpu", "--stats", file("stats.json")},
             lod_pixels);
      const auto stats = jsonOf(file("stats.json"))["frames"][0];
      const Image picture = readImage(file(name + ".pfm"));
      const double psnr_db = compareImages(picture, reference).psnr_db;
      fmt::print("{} at {} pixels: {} splats, {:.2f} dB\n", name, lod_pixels,
                 stats["splats_drawn"].get<int>(), psnr_db);
      if (lod_pixels == std::string("1000")) {
        EXPECT_EQ(stats["largest_level"], 0);
      }
      const double expected_db = lod_pixels == std::string("0") ? std::max(least_db, coarser_db)
                                                                : std::min(coarser_db - kLayersDb, kUnseenDb);
      EXPECT_GE(psnr_db, expected_db - 1e-6) << "at " << lod_pixels << " pixels";
      if (psnr_db < expected_db - 1e-6) leavePictures(name, picture, reference);
      coarser_db = psnr_db;
      // Usually the coarser picture, one of each function: it takes OpenGL seconds on the processor to draw half a million splats.
      const bool is_usual = lod_pixels == std::string("8"), is_whole = faults::isWholeSweep();
      if (!is_usual && !(is_whole && lod_pixels == std::string("0"))) continue;
      if (name == "step" || is_whole) expectOpenGlAlike(name, picture, reference, psnr_db, lod_pixels);
      if (name == "smooth" || is_whole) expectCardAlike(name, picture, reference, psnr_db, lod_pixels);
    }
  }
};

// Whether every pixel within `distance` of (x, y) is one that sees the scene.
bool insideSilhouette(const ReferenceImage& reference, int x, int y, int distance) {
  for (int dy = -distance; dy <= distance; ++dy)
    for (int dx = -distance; dx <= distance; ++dx) {
      if (dx * dx + dy * dy > distance * distance) continue;
      const int nx = x + dx, ny = y + dy;
      if (nx < 0 || ny < 0 || nx >= reference.size.width || ny >= reference.size.height) return false;
      if (reference.at(nx, ny).transmittance == 1) return false;
    }
  return true;
}

// The transmittance that a pixel of a picture half as large sees: the renderer's pixels are Gaussians with a
// variance of the low-pass times the kernel's, and the scene's edges are sharp.
double filteredTransmittance(const ReferenceImage& fine, int x, int y) {
  constexpr double kVariancePx2 = kLowPass * kKernelSigma * kKernelSigma;
  double sum = 0, weights = 0;
  for (int fy = 2 * y - 6; fy < 2 * y + 8; ++fy)
    for (int fx = 2 * x - 6; fx < 2 * x + 8; ++fx) {
      const double dx = 0.5 * (fx + 0.5) - (x + 0.5), dy = 0.5 * (fy + 0.5) - (y + 0.5);
      const double weight = std::exp(-(dx * dx + dy * dy) / (2 * kVariancePx2));
      sum += weight * fine.at(fx, fy).transmittance;
      weights += weight;
    }
  return sum / weights;
}

TEST_F(Fidelity, ConstantFieldHasTheAnalyticTransmittance) {
  render("half-annulus-constant", "smooth", file("constant.pfm"));
  const Image picture = readImage(file("constant.pfm"));
  const auto scene = makeScene("half-annulus-constant");
  const auto march = [&](ImageSize size) {
    return referenceMarch(*scene, smoothFunction, halfAnnulusCamera(), size);
  };
  const ReferenceImage at_centres = march(kSize), fine = march({2 * kSize.width, 2 * kSize.height});
  double largest = 0, largest_at_centre = 0;
  int pixels = 0, beyond_at_centre = 0;
  for (int y = 4; y < kSize.height - 4; ++y)
    for (int x = 4; x < kSize.width - 4; ++x) {
      if (!insideSilhouette(at_centres, x, y, 4)) continue;
      ++pixels;
      // f = 0.5 has no blue, so that the blue over white is the transmittance.
      const double transmittance = picture.pixel(x, y)[2];
      largest = std::max(largest, std::abs(transmittance - filteredTransmittance(fine, x, y)));
      const double at_centre = std::abs(transmittance - at_centres.at(x, y).transmittance);
      largest_at_centre = std::max(largest_at_centre, at_centre);
      beyond_at_centre += at_centre > 0.015;
    }
  fmt::print(
      "constant: {} pixels, largest error {:.4f}; against rays through the centres {:.4f}, {} over 0.015\n",
      pixels, largest, largest_at_centre, beyond_at_centre);
  EXPECT_GT(pixels, 20000);
  EXPECT_LE(largest, 0.015);
  // A single ray does not see what the pixel does where an edge of the grid crosses it.
  EXPECT_LE(beyond_at_centre, pixels / 200);
  if (HasFailure()) leavePictures("constant", picture, toImage(at_centres));
}

TEST_F(Fidelity, SmoothFunction) {
  expectPsnr("smooth", 62, 48);
}

TEST_F(Fidelity, NarrowBand) {
  expectPsnr("band", 64, 46);
}

TEST_F(Fidelity, Step) {
  expectPsnr("step", 55, 37.5);
}

TEST_F(Fidelity, IsTheSameBytesForAnyThreadsAndAgain) {
  for (const std::string backend : {"osmesa", "cpu"}) {
    const std::string lod_pixels = backend == "cpu" ? "2" : "32";
    render("half-annulus", "smooth", file("one.exr"), {"--threads", "1", "--backend", backend}, lod_pixels);
    render("half-annulus", "smooth", file("two.exr"), {"--threads", "2", "--backend", backend}, lod_pixels);
    const std::string one = readTextFile(file("one.exr"));
    EXPECT_EQ(one == readTextFile(file("two.exr")), true) << backend;
    if (backend != "cpu" && !faults::isWholeSweep()) continue;
    render("half-annulus", "smooth", file("again.exr"), {"--threads", "2", "--backend", backend}, lod_pixels);
    EXPECT_EQ(one == readTextFile(file("again.exr")), true) << backend;
  }
}

/// `inside`: a camera inside of the data, which the other view is not. `usual`: how the only view is classified that is usually
/// drawn, that from inside if pixels are.
void expectBackendsAlike(const std::string& cache, const Words& inside, const std::string& usual) {
  const std::string picture = cache + ".pfm";
  for (const Words& view : {Words{"--lod-pixels", "0"}, inside})
    for (const std::string classify : {"pixel", "flat"}) {
      if ((classify != usual || (usual == "pixel") != (view == inside)) && !faults::isWholeSweep()) continue;
      std::vector<Image> pictures;
      for (const std::string backend : {"osmesa", "cpu"}) {
        pictures.push_back(
            pictureOf(cache, picture, Words{"--classify", classify, "--backend", backend} + view, "100x100"));
      }
      const ImageDifference difference = compareImages(pictures[0], pictures[1]);
      EXPECT_GE(difference.psnr_db, 70) << classify;
      EXPECT_LT(difference.largest, 1.0 / 255) << classify;
    }
}

TEST_F(Fidelity, BothBackendsDrawAbuttingBlocksAlike) {
  runSilently({"generate", "duct", "--size", "36x18x18", "-o", file("duct")});
  run({"convert", file("duct.xyz"), file("duct.fun"), "-o", file("duct.splats")});
  expectBackendsAlike(file("duct.splats"),
                      {"--position", "0.7,0.2,0.4", "--focal-point", "2.5,0.8,0.6", "--view-angle", "70"},
                      "pixel");
}

TEST_F(Fidelity, BothBackendsDrawABluntFinAlike) {
  const std::filesystem::path folder = std::filesystem::path(CURVISPLAT_SHARED_DATA) / "bluntfin";
  if (!std::filesystem::is_directory(folder)) GTEST_SKIP() << "needs " << folder;
  run({"convert", (folder / "bluntfinxyz.bin").string(), (folder / "bluntfinq.bin").string(), "-o",
       file("fin.splats"), "--scalar", "density"});
  expectBackendsAlike(file("fin.splats"),
                      {"--position", "2,3,2", "--focal-point", "0,0,0", "--view-angle", "70"}, "flat");
}

class CellFidelity : public ProgramTest {
 protected:
  void convertTo(const std::string& name, const GridSource& source, uint32_t scalar) {
    ConvertOptions options;
    options.output = folder_ / name;
    options.scalars = {scalar};
    Progress progress;
    convert(source, options, progress);
  }

  Image render(const std::string& name, const std::string& function) {
    const std::string picture = folder_ / "picture.pfm";
    run(halfAnnulusWords(folder_ / name, picture, function, {256, 256}, "0"));
    return readImage(picture);
  }
};

TEST_F(CellFidelity, IsNearThatOfNodes) {
  const std::shared_ptr<const Scene> scene = makeScene("half-annulus");
  const SceneGridSource at_nodes(scene, {128, 64, 64}), corners(scene, {129, 65, 65});
  const CellGridSource in_cells(corners, {[&](const GridCell& cell) { return scene->scalar(cell.centre); }});
  convertTo("nodes.splats", at_nodes, 0);
  convertTo("cells.splats", in_cells, 1);
  Rearrangement blocks;
  blocks.cuts = {2, 2, 1};
  const RearrangedGridSource cut(corners, blocks);
  convertTo("blocks.splats",
            CellGridSource(cut, {[&](const GridCell& cell) { return scene->scalar(cell.centre); }}), 1);
  const struct {
    const char* name;
    double least_db, most_lost_db;
  } functions[] = {// The border's cells are wider than half cells.
                   {"smooth", 68, 3.5},
                   {"band", 67.5, 1.5},
                   {"step", 56, 1}};
  for (const auto& [name, least_db, most_lost_db] : functions) {
    if (name == std::string("band") && !faults::isWholeSweep()) continue;
    const Image& reference = knownReference(name, kSize);
    const double nodes_db = compareImages(render("nodes.splats", name), reference).psnr_db;
    const double cells_db = compareImages(render("cells.splats", name), reference).psnr_db;
    const double blocks_db = compareImages(render("blocks.splats", name), reference).psnr_db;
    fmt::print("{}: {:.2f} dB at nodes, {:.2f} dB in cells, {:.2f} dB of four blocks\n", name, nodes_db,
               cells_db, blocks_db);
    EXPECT_GE(blocks_db, cells_db - 0.5);
    EXPECT_GE(cells_db, least_db);
    EXPECT_GE(cells_db, nodes_db - most_lost_db);
  }
}

// A plane across the half-annulus, obliquely.
const ClipPlane kObliquePlane{{-0.4, 0, 0.5}, {0.6, 0.5, -0.7}};

struct LeastFidelity {
  const char* function;
  std::array<double, 3> least_db;  // finest, 4 pixels, 8 pixels
};

/// Only with tools/test.sh --whole: Corrections.* hold the same of a coarser grid.
class AroundTheVolume : public testing::Test {
 protected:
  void SetUp() override {
    if (!faults::isWholeSweep()) GTEST_SKIP() << "only with tools/test.sh --whole";
  }
  Image marched(const ReferenceField& field, const KnownFunction& function,
                const ReferenceLight* light) const {
    return toImage(referenceMarch(field, function.exact, camera_, kSize, stepsFor(field), {light}));
  }
  static DirectOptions atLevel(size_t level) {
    DirectOptions options;
    options.voxel = std::array{0.0, 4.0, 8.0}[level] * 2 * halfAnnulusCamera().parallel_scale / kSize.height;
    return options;
  }
  double db(const DirectOptions& options, const KnownFunction& function, const Image& reference) const {
    return compareImages(drawDirectly(source_, 0, options, function.table, camera_, kSize), reference)
        .psnr_db;
  }

  const std::shared_ptr<const Scene> annulus_ = makeScene("half-annulus");
  const SceneField field_{*annulus_};
  const SceneGridSource source_{annulus_, {128, 64, 64}, 4};
  const Camera camera_ = halfAnnulusCamera();
};

TEST_F(AroundTheVolume, APlaneCutsTheSplats) {
  const ClippedField clipped(field_, {kObliquePlane});
  for (const LeastFidelity& row :
       {LeastFidelity{"smooth", {71, 58, 50.5}}, LeastFidelity{"band", {60, 51.4, 42.5}},
        LeastFidelity{"step", {59.5, 49, 38.5}}}) {
    const auto& [name, least_db] = row;
    const KnownFunction function = KnownFunction::of(name);
    const Image reference = marched(clipped, function, nullptr);
    for (size_t level = 0; level < 3; ++level) {
      DirectOptions options = atLevel(level);
      options.clip_planes = {kObliquePlane};
      const double cut = db(options, function, reference);
      options.cut_splats = false;
      const double by_centre = db(options, function, reference);
      fmt::print("clip plane, {}, level {}: {:.1f} dB, by centres {:.1f} dB\n", name, level, cut, by_centre);
      EXPECT_GE(cut, least_db[level]) << name << ", level " << level;
      EXPECT_LT(by_centre, least_db[level]) << name << ", level " << level;
    }
  }
}

TEST_F(AroundTheVolume, LightIsFromEachSplatsGradient) {
  const ReferenceLight truth;
  for (const LeastFidelity& row :
       {LeastFidelity{"smooth", {66, 54, 47}}, LeastFidelity{"band", {65, 52, 40.5}},
        LeastFidelity{"step", {54, 43.5, 33}}}) {
    const auto& [name, least_db] = row;
    const KnownFunction function = KnownFunction::of(name);
    const Image reference = marched(field_, function, &truth);
    for (size_t level = 0; level < 3; ++level) {
      DirectOptions options = atLevel(level);
      const double unlit = db(options, function, reference);
      options.light = Light{};
      const double lit = db(options, function, reference);
      fmt::print("light, {}, level {}: {:.1f} dB, unlit {:.1f} dB\n", name, level, lit, unlit);
      EXPECT_GE(lit, least_db[level]) << name << ", level " << level;
      EXPECT_LT(unlit, least_db[level]) << name << ", level " << level;
    }
  }
}

/// Magnitudes of a field's gradient, from the least steep part of its volume, by central differences at points that fill
/// its box evenly.
std::vector<double> steepnessOf(const ReferenceField& field) {
  constexpr int kAlong = 60;
  constexpr double kStep = 1e-4;
  const auto [lower, upper] = field.bounds();
  const auto probe = field.probe();
  std::vector<double> found;
  for (int n = 0; n < kAlong * kAlong * kAlong; ++n) {
    const glm::dvec3 part(n % kAlong, n / kAlong % kAlong, n / kAlong / kAlong);
    const glm::dvec3 at = lower + (part + 0.5) / static_cast<double>(kAlong) * (upper - lower);
    glm::dvec3 gradient(0.0);
    bool inside = true;
    for (int axis = 0; axis < 3; ++axis) {
      glm::dvec3 step(0.0);
      step[axis] = kStep;
      const auto before = probe->at(at - step), after = probe->at(at + step);
      inside = inside && before && after;
      if (inside) gradient[axis] = (*after - *before) / (2 * kStep);
    }
    if (inside) found.push_back(glm::length(gradient));
  }
  std::sort(found.begin(), found.end());
  return found;
}

/// Pictures that leave out the flattest 30 % of the volume and dim the next 40 %.
class GradientOpacityFidelity : public Fidelity {
 protected:
  static constexpr double kHidden = 0.3, kWhole = 0.7;  // shares of the volume that is less steep

  Image marched(const ReferenceLight* light) const {
    ReferenceExtras extras;
    extras.light = light;
    extras.gradient_opacity = [this](double magnitude) {
      const auto below =
          std::lower_bound(steepness_.begin(), steepness_.end(), magnitude) - steepness_.begin();
      const double share = static_cast<double>(below) / static_cast<double>(steepness_.size());
      return std::clamp((share - kHidden) / (kWhole - kHidden), 0.0, 1.0);
    };
    MarchSteps steps = stepsFor(field_);
    steps.every = faults::isWholeSweep() ? 1 : 2;  // gradients take six more values of the field
    return toImage(referenceMarch(field_, function_.exact, halfAnnulusCamera(), kSize, steps, extras));
  }

  /// Every painter draws what is marched, at the finest level and a coarse one, and neither without the opacity by
  /// gradient nor, where there is light, without that.
  void expectMarched(const std::string& name, const std::optional<Light>& light, const Image& reference,
                     const std::array<double, 2>& least_db) const {
    constexpr std::array<double, 2> kLodPixels{0, 8};
    for (size_t level = 0; level < kLodPixels.size(); ++level) {
      FrameOptions whole = knownFrame(kSize);
      whole.lod_pixels = kLodPixels[level];
      whole.light = light;
      FrameOptions options = whole;
      options.gradient_opacity = {{0, 0}, {kHidden, 0}, {kWhole, 1}, {1, 1}};
      FrameOptions unlit = options;
      unlit.light = std::nullopt;
      const Image drawn = drawnWith(options, Backend::kCpu);
      const auto dbOf = [&](const Image& picture) {
        return compareWithReference(picture, reference).psnr_db;
      };
      const double db = dbOf(drawn), whole_db = dbOf(drawnWith(whole, Backend::kCpu));
      fmt::print("{} at {} pixels: {:.1f} dB; without {:.1f} dB\n", name, whole.lod_pixels, db, whole_db);
      EXPECT_GE(db, least_db[level]) << name << whole.lod_pixels;
      if (level > 0 || faults::isWholeSweep()) {  // as in expectPsnr(), usually the coarser picture
        const Image by_gl = drawnWith(options, Backend::kOsmesa);
        EXPECT_GE(dbOf(by_gl), least_db[level]) << name << whole.lod_pixels;
        EXPECT_GE(compareImages(by_gl, drawn).psnr_db, 60) << name << whole.lod_pixels;
      }
      EXPECT_LT(whole_db, 30) << name << whole.lod_pixels;
      if (light) {
        EXPECT_LT(dbOf(drawnWith(unlit, Backend::kCpu)), 30) << name << whole.lod_pixels;
      }
      if (db < least_db[level]) leavePictures(name, drawn, reference);
    }
  }

  Image drawnWith(const FrameOptions& options, Backend backend) const {
    return drawCache(cacheOf("half-annulus"), function_.table, halfAnnulusCamera(), options, nullptr,
                     backend);
  }

  const std::shared_ptr<const Scene> annulus_ = makeScene("half-annulus");
  const SceneField field_{*annulus_};
  const KnownFunction function_ = KnownFunction::of("smooth");
  const std::vector<double> steepness_ = steepnessOf(field_);
};

TEST_F(GradientOpacityFidelity, IsThatOfEachSplatsGradient) {
  expectMarched("gradient", std::nullopt, marched(nullptr), {67, 60});
}

TEST_F(GradientOpacityFidelity, IsLitByTheSameGradient) {
  Light light;
  light.towards = glm::dvec3(1, -1, 2);
  ReferenceLight truth;
  truth.towards = light.towards;
  const CacheReader cache(cacheOf("half-annulus"));
  truth.g0 = 1 / glm::length(cache.manifest().upper - cache.manifest().lower);  // the function's range is 1
  expectMarched("lit gradient", light, marched(&truth), {65, 58.5});
}

}  // namespace
}  // namespace curvisplat
