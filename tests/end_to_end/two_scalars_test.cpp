// Pictures of two scalars: the opacity of one and the colours of another, against the ray march of both; with clip
// planes, slices and isosurfaces; and the same picture by every painter, with any threads and memory.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <glm/geometric.hpp>
#include <memory>
#include <optional>

#include "preprocess/convert/convert.h"
#include "preprocess/scenes/scenes.h"
#include "render/image/image_file.h"
#include "stream/base/progress.h"
#include "tests/reference/function_grid.h"
#include "tests/reference/known_pictures.h"
#include "tests/support/fault_sweep.h"
#include "tests/support/program_test.h"

namespace curvisplat {
namespace {

constexpr ImageSize kLarge{256, 256}, kSmall{128, 128};

/// The scalar of the colours.
double hueAt(const glm::dvec3& at) {
  return 0.5 + 0.5 * std::sin(4 * at.x + 3 * at.y) * std::cos(3 * at.z);
}

/// A scalar that gives neither colours nor opacities.
double thirdAt(const glm::dvec3& at) {
  return 0.8 * at.x + 0.6 * at.y;
}

const TransferFunction& hues() {
  static const TransferFunction function = TransferFunction::preset("cool-warm", 0, 1, 1);
  return function;
}

class TwoScalarsTest : public ProgramSuite<TwoScalarsTest> {
 protected:
  static void prepare() {
    convertTo("a.splats", 0, {128, 64, 64}, 3);
    convertTo("small.splats", 0, {40, 24, 24});
  }

  static void convertTo(const char* name, double added_to_hues, const std::array<uint64_t, 3>& nodes,
                        size_t scalars = 2) {
    const auto annulus = makeScene("half-annulus");
    const FunctionGridSource source(
        {gridBlock(nodes[0], nodes[1], nodes[2])}, scalars, [&](const GridNode& node) {
          const glm::dvec3 uvw(double(node.i) / (nodes[0] - 1), double(node.j) / (nodes[1] - 1),
                               double(node.k) / (nodes[2] - 1));
          const glm::dvec3 at = annulus->position(uvw);
          NodeValues values{at, {float(annulus->scalar(at)), float(hueAt(at) + added_to_hues)}};
          if (scalars == 3) values.scalars.push_back(float(thirdAt(at)));
          return values;
        });
    ConvertOptions options;
    options.output = *folder_ / name;
    options.overwrite = true;
    options.scalars = {0, 1};
    if (scalars == 3) options.scalars.push_back(2);
    Progress progress;
    convert(source, options, progress);
  }

  Image marched(const OpticalFunction& opacity, const ReferenceField& field,
                const ReferenceLayers& layers = {}, ImageSize size = kLarge) const {
    const TwoScalars scalars{opacity, [](const glm::dvec3& at) { return hues().at(hueAt(at)).colour; }};
    MarchSteps steps = stepsFor(field);
    steps.every = faults::isWholeSweep() ? 1 : size.width / kSmall.width;
    return toImage(referenceMarch(field, scalars, halfAnnulusCamera(), size, steps, layers));
  }
  Image drawn(const TransferFunction& opacity, const FrameOptions& options, Backend backend = Backend::kCpu,
              const char* name = "a.splats") const {
    const CacheReader cache(*folder_ / name);
    FrameRenderer renderer(cache, DrawnScalars({0, opacity}, {1, hues()}), backend);
    FrameStatistics statistics;
    return renderer.render(halfAnnulusCamera(), options, statistics);
  }
  static double db(const Image& image, const Image& reference) {
    return compareWithReference(image, reference).psnr_db;
  }

  const std::shared_ptr<const Scene> annulus_ = makeScene("half-annulus");
  const SceneField field_{*annulus_};
};

TEST_F(TwoScalarsTest, AreThoseOfTheRayMarchAtAllLevels) {
  const struct {
    std::string function;
    std::array<double, 3> least_db;  // finest, 4 pixels, 8 pixels
  } pictures[] = {{"smooth", {79, 73, 68.2}}, {"band", {73.5, 69, 63.5}}, {"step", {65.5, 65, 60}}};
  for (const auto& [name, least_db] : pictures) {
    if (name == "step" && !faults::isWholeSweep()) continue;
    const KnownFunction function = KnownFunction::of(name);
    const Image reference = marched(function.exact, field_);
    for (size_t level = 0; level < 3; ++level) {
      // Usually the smooth function where the picture is finest and coarsest, and the band between.
      const bool is_usual = name == "smooth" ? level != 1 : level == 1;
      if (!is_usual && !faults::isWholeSweep()) continue;
      FrameOptions options = knownFrame(kLarge);
      options.lod_pixels = std::array{0.0, 4.0, 8.0}[level];
      const double all = db(drawn(function.table, options), reference);
      options.classification = Classification::kFlat;
      const double flat = db(drawn(function.table, options), reference);
      fmt::print("two scalars, {}, level {}: {:.1f} dB, one value a splat {:.1f} dB\n", name, level, all,
                 flat);
      EXPECT_GE(all, least_db[level]) << name << ", level " << level;
      EXPECT_LT(flat, least_db[level]) << name << ", level " << level;
    }
  }
}

TEST_F(TwoScalarsTest, AreCutByClipPlanes) {
  const ClipPlane plane{{-0.4, 0, 0.5}, {0.6, 0.5, -0.7}};
  const KnownFunction function = KnownFunction::of("smooth");
  const Image reference = marched(function.exact, ClippedField(field_, {plane}));
  FrameOptions options = knownFrame(kLarge);
  options.clip_planes = {plane};
  for (const double lod : {0.0, 4.0}) {
    options.lod_pixels = lod;
    const double all = db(drawn(function.table, options), reference);
    fmt::print("two scalars, clipped, {} pixels: {:.1f} dB\n", lod, all);
    EXPECT_GE(all, lod == 0 ? 79 : 64.5);
  }
}

TEST_F(TwoScalarsTest, SlicesHaveTheColours) {
  if (!faults::isWholeSweep()) GTEST_SKIP() << "SlicesHaveTheOpacitiesOfTheOther has the same colours";
  const glm::dvec3 point(-0.4, 0, 0.5), normal(0.6, 0.5, -0.7);
  const KnownFunction function = KnownFunction::of("smooth");
  const ReferenceLayers layers = [&](const glm::dvec3& origin, const glm::dvec3& direction) {
    const double distance = glm::dot(normal, point - origin) / glm::dot(normal, direction);
    const glm::dvec3 at = origin + distance * direction;
    std::vector<ReferenceLayer> found;
    if (annulus_->contains(at)) found.push_back({distance, hues().at(hueAt(at)).colour, 0.6});
    return found;
  };
  const Image reference = marched(function.exact, field_, layers);
  FrameOptions options = knownFrame(kLarge);
  auto scene = std::make_shared<SurfaceScene>();
  scene->slices = {{point, normal}};
  scene->slice_opacity = 0.6;
  options.scene = scene;
  const double all = db(drawn(function.table, options), reference);
  fmt::print("two scalars, slice: {:.1f} dB\n", all);
  EXPECT_GE(all, 45);  // outlines of the slice are smooth here
}

TEST_F(TwoScalarsTest, SlicesHaveTheOpacitiesOfTheOther) {
  const glm::dvec3 point(-0.4, 0, 0.5), normal(0.6, 0.5, -0.7);
  const KnownFunction function = KnownFunction::of("smooth");
  const double unit = function.table.opacityUnit();
  const ReferenceLayers layers = [&](const glm::dvec3& origin, const glm::dvec3& direction) {
    const double distance = glm::dot(normal, point - origin) / glm::dot(normal, direction);
    const glm::dvec3 at = origin + distance * direction;
    std::vector<ReferenceLayer> found;
    if (!annulus_->contains(at)) return found;
    const double opacity = -std::expm1(-function.exact(annulus_->scalar(at)).extinction * unit);
    found.push_back({distance, hues().at(hueAt(at)).colour, opacity});
    return found;
  };
  const Image reference = marched(function.exact, field_, layers);
  FrameOptions options = knownFrame(kLarge);
  auto scene = std::make_shared<SurfaceScene>();
  scene->slices = {{point, normal}};
  options.scene = scene;
  const double even = db(drawn(function.table, options), reference);
  scene->slices_by_function = true;
  const double by_function = db(drawn(function.table, options), reference);
  fmt::print("two scalars, slice with the opacity of the other: {:.1f} dB, evenly {:.1f} dB\n", by_function,
             even);
  EXPECT_GE(by_function, 45);  // outlines of the slice are smooth here
  EXPECT_LT(even, 40);
}

/// Lit from where the viewer is.
glm::dvec3 lit(const glm::dvec3& colour, double facing) {
  return (0.3 + 0.7 * facing) * colour;
}

/// The inner cylinder of the half-annulus, jmin, in the colours of the one scalar and with the opacity of the other.
TEST_F(TwoScalarsTest, SurfacesHaveTheOpacitiesOfTheOther) {
  constexpr double kInner = 0.3;
  const KnownFunction function = KnownFunction::of("smooth");
  const double unit = function.table.opacityUnit();
  const ReferenceLayers layers = [&](const glm::dvec3& origin, const glm::dvec3& direction) {
    std::vector<ReferenceLayer> found;
    const double a = direction.x * direction.x + direction.y * direction.y;
    const double b = origin.x * direction.x + origin.y * direction.y;
    const double c = origin.x * origin.x + origin.y * origin.y - kInner * kInner;
    for (const double sign : {-1.0, 1.0}) {
      if (b * b <= a * c) break;
      const double distance = (-b + sign * std::sqrt(b * b - a * c)) / a;
      const glm::dvec3 at = origin + distance * direction, normal = glm::dvec3(at.x, at.y, 0) / kInner;
      if (!annulus_->contains(at + 1e-9 * normal)) continue;
      const double facing = std::abs(glm::dot(normal, direction));
      const double opacity = -std::expm1(-function.exact(annulus_->scalar(at)).extinction * unit);
      found.push_back({distance, lit(hues().at(hueAt(at)).colour, facing), opacity});
    }
    return found;
  };
  const Image reference = marched(function.exact, field_, layers);
  FrameOptions options = knownFrame(kLarge);
  auto scene = std::make_shared<SurfaceScene>();
  GridSurface& surface = scene->grid_surfaces.emplace_back();
  surface.faces = FacesReader::open(*folder_ / "a.splats", CacheReader(*folder_ / "a.splats").manifest());
  for (uint32_t n = 0; n < surface.faces->faces().size(); ++n) {
    const GridFace& face = surface.faces->faces()[n];
    if (face.axis == 1 && face.side == FaceSide::kMin)
      surface.parts.push_back({n, {0, 0}, {face.nodes[0] - 1, face.nodes[1] - 1}});
  }
  surface.scalar = 1;
  surface.opacity = {1, true};
  options.scene = scene;
  const double of_own = db(drawn(function.table, options), reference);
  surface.opacity_faces = surface.faces;
  surface.opacity_scalar = 0;
  const double of_other = db(drawn(function.table, options), reference);
  fmt::print("two scalars, surface with the opacity of the other: {:.1f} dB, of its own {:.1f} dB\n",
             of_other, of_own);
  EXPECT_GE(of_other, 74);
  EXPECT_LT(of_own, 38);
}

/// The isosurface of the colours' scalar, as opaque as the other scalar's function has it there.
TEST_F(TwoScalarsTest, IsosurfacesHaveTheOpacitiesOfTheOther) {
  constexpr double kValue = 0.6;
  const KnownFunction function = KnownFunction::of("smooth");
  const double unit = function.table.opacityUnit();
  const ReferenceLayers layers = isoLayer(
      *annulus_, {hueAt, kValue, hues().at(kValue).colour, [&](const glm::dvec3& at) {
                    return 0.9 * -std::expm1(-function.exact(annulus_->scalar(at)).extinction * unit);
                  }});
  const Image reference = marched(function.exact, field_, layers, kSmall);
  FrameOptions options = knownFrame(kSmall);
  auto scene = std::make_shared<SurfaceScene>();
  scene->further_isosurfaces = {{1, {kValue}}};
  scene->iso_opacity = {0.9, false};
  options.scene = scene;
  const double even = db(drawn(function.table, options), reference);
  scene->iso_opacity.by_function = true;
  const Image picture = drawn(function.table, options);
  const double by_function = db(picture, reference);
  fmt::print("two scalars, isosurface with the opacity of the other: {:.1f} dB, evenly {:.1f} dB\n",
             by_function, even);
  EXPECT_GE(by_function, 67);
  EXPECT_LT(even, 35);
  if (!faults::isWholeSweep()) return;  // AreOfAllScalarsAtOnce has the same bits with any threads, too
  options.threads = 1;
  options.memory_bytes = uint64_t{96} << 20;
  EXPECT_EQ(drawn(function.table, options).rgba, picture.rgba);
}

/// Isosurfaces of the opacities' scalar, of the colours' and of a third one, in the cells of a grid and of the field of splats.
TEST_F(TwoScalarsTest, IsosurfacesAreOfAllScalarsAtOnce) {
  constexpr double kOwn = 0.5, kOfColours = 0.6, kThird = -0.3;
  const glm::vec3 green(0.2f, 0.8f, 0.3f);
  const KnownFunction function = KnownFunction::of("smooth");
  const auto solid = [](const glm::dvec3&) { return 0.7; };
  const auto red = glm::vec3(0.9f, 0.2f, 0.1f);
  const std::array<ReferenceLayers, 3> parts{
      isoLayer(*annulus_, kOwn, glm::dvec3(red), 0.7),
      isoLayer(*annulus_, {hueAt, kOfColours, hues().at(kOfColours).colour, solid}),
      isoLayer(*annulus_, {thirdAt, kThird, glm::dvec3(green), solid})};
  const ReferenceLayers layers = [&](const glm::dvec3& origin, const glm::dvec3& direction) {
    std::vector<ReferenceLayer> found;
    for (const ReferenceLayers& part : parts) {
      const std::vector<ReferenceLayer> of_part = part(origin, direction);
      found.insert(found.end(), of_part.begin(), of_part.end());
    }
    return found;
  };
  const Image reference = marched(function.exact, field_, layers, kSmall);
  FrameOptions options = knownFrame(kSmall);
  auto scene = std::make_shared<SurfaceScene>();
  scene->isovalues = {kOwn};
  scene->iso_colours = {red};
  scene->further_isosurfaces = {{1, {kOfColours}}, {2, {kThird}, {green}}};
  scene->iso_opacity = {0.7};
  options.scene = scene;
  // The first has more nodes than isosurfaces are contoured in the cells of.
  for (const uint64_t nodes : {130, 128}) {
    if (nodes == 130 && !faults::isWholeSweep())
      continue;  // of one scalar Isosurfaces are in the field of splats
    const char* const name = nodes == 128 ? "a.splats" : "three.splats";
    if (nodes != 128) convertTo(name, 0, {nodes, 64, 64}, 3);
    const CacheReader cache(*folder_ / name);
    const auto drawn_with = [&](const FrameOptions& with) {
      FrameRenderer renderer(cache, DrawnScalars({0, function.table}, {1, hues()}), Backend::kCpu);
      FrameStatistics statistics;
      return renderer.render(halfAnnulusCamera(), with, statistics);
    };
    const Image picture = drawn_with(options);
    const double all = db(picture, reference);
    fmt::print("isosurfaces of three scalars, {} nodes along i: {:.1f} dB\n", nodes, all);
    EXPECT_GE(all, 34.5);  // outlines are smooth here
    if (nodes == 128 || faults::isWholeSweep()) {
      FrameOptions fewer = options;
      auto without = std::make_shared<SurfaceScene>(*scene);
      without->further_isosurfaces.pop_back();
      fewer.scene = without;
      const double without_third = db(drawn_with(fewer), reference);
      fmt::print("without the third {:.1f} dB\n", without_third);
      EXPECT_LT(without_third, 30);
    }
    if (nodes == 128 && !faults::isWholeSweep()) continue;
    options.threads = 1;
    options.memory_bytes = uint64_t{192} << 20;
    EXPECT_EQ(drawn_with(options).rgba, picture.rgba);
    options.threads = 0;
    options.memory_bytes = FrameOptions().memory_bytes;
  }
}

/// Isosurfaces of another scalar take their opacities from the function of a picture of one scalar.
TEST_F(TwoScalarsTest, IsosurfacesOfAnotherHaveTheOpacitiesOfTheOneScalar) {
  constexpr double kValue = 0.6;
  const KnownFunction function = KnownFunction::of("smooth");
  const double unit = function.table.opacityUnit();
  const ReferenceLayers layers = isoLayer(
      *annulus_, {hueAt, kValue, glm::dvec3(0.5), [&](const glm::dvec3& at) {
                    return 0.9 * -std::expm1(-function.exact(annulus_->scalar(at)).extinction * unit);
                  }});
  const OpticalFunction nothing = [](double) { return OpticalProperties{}; };
  const Image reference = marched(nothing, field_, layers);
  FrameOptions options = knownFrame(kLarge);
  auto scene = std::make_shared<SurfaceScene>();
  scene->further_isosurfaces = {{1, {kValue}, {glm::vec3(0.5f)}}};
  scene->iso_opacity = {0.9, true};
  scene->volume = false;
  options.scene = scene;
  const Image picture = drawCache(*folder_ / "a.splats", function.table, halfAnnulusCamera(), options);
  fmt::print("one scalar, isosurface of another with its opacity: {:.1f} dB\n", db(picture, reference));
  EXPECT_GE(db(picture, reference), 45);
}

/// Bricks are left out by the bounds of the isosurface's scalar, not of the other's.
TEST_F(TwoScalarsTest, IsosurfacesAreThereWhereTheRangesDoNotMeet) {
  convertTo("far.splats", 10, {40, 24, 24});
  FrameOptions options = knownFrame(kLarge);
  const auto sceneWith = [](double isovalue) {
    auto scene = std::make_shared<SurfaceScene>();
    scene->further_isosurfaces = {{1, {isovalue}}};
    scene->volume = false;
    return scene;
  };
  options.scene = sceneWith(0.6);
  const TransferFunction opacity = KnownFunction::of("smooth").table;
  const Image near = drawn(opacity, options, Backend::kCpu, "small.splats");
  options.scene = sceneWith(10.6);
  const CacheReader cache(*folder_ / "far.splats");
  const TransferFunction far_hues = TransferFunction::preset("cool-warm", 10, 11, 1);
  FrameRenderer renderer(cache, DrawnScalars({0, opacity}, {1, far_hues}), Backend::kCpu);
  FrameStatistics statistics;
  EXPECT_GE(db(renderer.render(halfAnnulusCamera(), options, statistics), near), 50);
}

TEST_F(TwoScalarsTest, IsosurfacesHaveTheColours) {
  // Where the isosurface of the one scalar is, the other's colours are.
  FrameOptions options = knownFrame(kLarge);
  auto scene = std::make_shared<SurfaceScene>();
  scene->isovalues = {0.5};
  scene->volume = false;
  options.scene = scene;
  const TransferFunction opacity = KnownFunction::of("smooth").table;
  const Image coloured = drawn(opacity, options);
  const CacheReader cache(*folder_ / "a.splats");
  FrameRenderer renderer(cache, 0, opacity, Backend::kCpu);
  FrameStatistics statistics;
  const Image plain = renderer.render(halfAnnulusCamera(), options, statistics);
  const Camera camera = halfAnnulusCamera();
  const glm::dvec3 forward = glm::normalize(camera.focal_point - camera.position);
  const glm::dvec3 right = glm::normalize(glm::cross(forward, camera.view_up)),
                   up = glm::cross(right, forward);
  size_t compared = 0, wrong = 0;
  for (int y = 8; y < kLarge.height; y += 8)
    for (int x = 8; x < kLarge.width; x += 8) {
      const double across = camera.parallel_scale * (2 * (x + 0.5) - kLarge.width) / kLarge.height;
      const double upwards = camera.parallel_scale * (kLarge.height - 2 * (y + 0.5)) / kLarge.height;
      const glm::dvec3 origin = camera.position + across * right + upwards * up;
      std::optional<glm::dvec3> first;
      for (double t = 0; t < 12 && !first; t += 0.002) {
        const glm::dvec3 a = origin + t * forward, b = origin + (t + 0.002) * forward;
        if (annulus_->contains(a) && annulus_->contains(b) &&
            (annulus_->scalar(a) < 0.5) != (annulus_->scalar(b) < 0.5))
          first = a;
      }
      if (!first || plain.pixel(x, y)[3] < 0.99f) continue;
      // Light is a factor and something white: the differences between channels show the colour.
      const glm::dvec3 c = hues().at(hueAt(*first)).colour;
      const float* pixel = coloured.pixel(x, y);
      const double light = (pixel[0] - pixel[2]) / (c.r - c.b);
      if (std::abs(c.r - c.b) < 0.3) continue;
      ++compared;
      wrong += !(light > 0.1 && light < 1.1);
    }
  EXPECT_GT(compared, 40u);
  EXPECT_LE(10 * wrong, compared);
}

TEST_F(TwoScalarsTest, EveryPainterDrawsTheSame) {
  const TransferFunction opacity = KnownFunction::of("smooth").table;
  FrameOptions options = knownFrame(kLarge);
  options.lod_pixels = 8;  // OpenGL takes a second for a hundred thousand splats
  options.size = {128, 128};
  for (const bool full : {false, true}) {
    if (!full && !faults::isWholeSweep()) continue;
    if (full) {
      auto scene = std::make_shared<SurfaceScene>();
      scene->slices = {{{-0.4, 0, 0.5}, {0.6, 0.5, -0.7}}};
      scene->slice_opacity = 0.5;
      scene->isovalues = {0.7};
      options.scene = scene;
      options.light = Light{};
      options.clip_planes = {{{0, 0, 0.8}, {0, 0.1, -1}}};
    }
    const Image cpu = drawn(opacity, options);
    EXPECT_GT(db(drawn(opacity, options, Backend::kOsmesa), cpu), 50) << full;
    for (const auto& [threads, memory] : {std::pair(1u, uint64_t{160} << 20)}) {
      FrameOptions other = options;
      other.threads = threads;
      other.memory_bytes = memory;
      EXPECT_EQ(drawn(opacity, other).rgba, cpu.rgba) << full << ", " << threads << " threads";
    }
  }
}

TEST_F(TwoScalarsTest, TheProgramDrawsThemAndRefusesWrongUsage) {
  const std::string cache = file("small.splats"), output = file("a.pfm");
  const auto render = [&](const Words& more) {
    return Words{"render", cache, "-o", output, "--size", "150x150", "--view", "iso"} + more;
  };
  const ProgramResult chosen = run(render({"--scalar", "s1", "--opacity-by", "s0"}));
  const Image once = readImage(output);
  // What it chose draws the same picture.
  const std::string words = "chosen from the data: ";
  const size_t at = chosen.out.find(words);
  ASSERT_NE(at, std::string::npos) << chosen.out;
  Words same{"--scalar", "s1", "--opacity-by", "s0"};
  std::string rest = chosen.out.substr(at + words.size());
  rest.resize(rest.find('\n'));
  for (size_t begin = 0; begin < rest.size();) {
    const size_t end = std::min(rest.find(' ', begin), rest.size());
    same.push_back(rest.substr(begin, end - begin));
    begin = end + 1;
  }
  expectSays(rest, "--opacity-range");
  run(render(same));
  EXPECT_EQ(readImage(output).rgba, once.rgba) << rest;

  run(render({"--scalar", "s1", "--opacity-by", "s0", "--iso", "0.5", "--volume", "off"}));
  const Image of_opacities = readImage(output);
  for (const Words& named : {Words{"--iso", "s0=0.5"}, Words{"--iso", "0.5", "--iso-by", "s0"}}) {
    run(render(Words{"--scalar", "s1", "--volume", "off"} + named));
    EXPECT_EQ(readImage(output).rgba, of_opacities.rgba) << named[1];
  }
  // Faces and isosurfaces with the opacities of the other.
  const Words two{"--scalar", "s1", "--opacity-by", "s0"};
  const auto with = [&](const Words& more) {
    run(render(two + more));
    return readImage(output);
  };
  const Image plain = with({"--surface", "jmin"}),
              seen = with({"--surface", "jmin", "--surface-opacity", "function"});
  EXPECT_LT(db(seen, plain), 40);
  EXPECT_LT(db(with({"--surface", "jmin", "--surface-opacity", "function*0.5"}), seen), 45);
  const Image of_colours = with({"--iso-by", "s1", "--iso", "0.6"});
  EXPECT_LT(db(with({"--iso", "0.6"}), of_colours), 40);
  EXPECT_LT(db(with({"--iso-by", "s1", "--iso", "0.6", "--iso-opacity", "function"}), of_colours), 40);
  // Each value is reported with its scalar; that of --opacity-by is the one of values without a name.
  const ProgramResult unseen = runProgram(
      render(two + Words{"--iso", "0.5", "--iso", "s1=0.6", "--volume", "off", "--focal-point", "900,0,0"}));
  expectSays(unseen.err, "asked for 0.5 of s0, which goes from ");
  expectSays(unseen.err, "; 0.6 of s1, which goes from ");
  const struct {
    Words options;
    int status;
    std::string words;
  } refused[] = {
      {{"--opacity-by", "x"},
       2,
       "--opacity-by: " + cache +
           ": the cache has no scalar 'x'; it has s0, s1; curvisplat convert GRID ... --add-scalar x --to " +
           cache + " adds one that the grid's files have or that can be computed"},
      {{"--opacity-range", "0,1"}, 2, "--opacity-range 0,1: needs --opacity-by NAME"},
      {{"--opacity-by", "s0", "--opacity-range", "1,1"},
       2,
       ": --opacity-range 1,1: expected LO,HI with LO < HI"},
      {{"--opacity-by", "s0", "--opacity-asinh", "1,0"},
       2,
       ": --opacity-asinh 1,0: expected a WIDTH above zero"},
      {{"--iso-by", "s1"}, 2, "--iso-by s1: needs an isosurface: --iso VALUE"},
      {{"--iso-by", "s1", "--iso", "s0=0.5"}, 2, "--iso-by s1: each --iso names its own scalar; leave one"},
      {{"--iso", "=0.5"}, 2, "--iso =0.5: no scalar before the '='; expected NAME=VALUE"},
      {{"--iso", "s0=0.5,s1=0.5"},
       2,
       "--iso s0=0.5,s1=0.5: has two scalars; give --iso NAME=VALUE,... once for each"},
      {{"--iso", "x=0.5"}, 2, "--iso x=0.5: " + cache + ": the cache has no scalar 'x'; it has s0, s1"},
      {{"--iso", "s1=7"}, 2, "--iso 7: no isosurface: the values of s1 go from "},
      {{"--opacity-by", "s0", "--iso", "7"}, 2, "--iso 7: no isosurface: the values of s0 go from "},
      {{"--opacity-by", "s0", "--opacity-tf", "viridis"},
       2,
       "--opacity-tf viridis: expected a ParaView preset"}};
  for (const auto& [options, status, expected] : refused) {
    const ProgramResult result = runProgram(render(options));
    EXPECT_EQ(result.status, status) << result.err;
    expectSays(result.err, expected);
  }
}

}  // namespace
}  // namespace curvisplat
