// Bricks that stay on the card: whatever stays there, a picture is the processor's but for rounding, and its bits depend
// on nothing but the plan and the card's memory.
#include <dlfcn.h>
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <memory>
#include <numbers>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "preprocess/convert/convert.h"
#include "render/backend/backend.h"
#include "render/frame/frame.h"
#include "render/gl/card_bricks.h"
#include "render/gl/card_buffer.h"
#include "render/gl/gl_context.h"
#include "render/gl/gl_tile_painter.h"
#include "render/mesh/triangle_mesh.h"
#include "render/project/brick_store.h"
#include "render/surface/surface_scene.h"
#include "stream/base/error.h"
#include "stream/base/progress.h"
#include "stream/model/border_code.h"
#include "tests/reference/function_grid.h"
#include "tests/support/fault_sweep.h"
#include "tests/support/temporary_folder.h"
#include "tests/support/test_caches.h"
#include "tests/support/thread_ranks.h"

namespace curvisplat {
namespace {

constexpr uint64_t kMiB = 1 << 20;

class CardBricksTest : public ::testing::Test {
 protected:
  void SetUp() override {
    writeRandomCache(folder_ / "a.splats", 3);
    open("a.splats");
  }
  void open(const char* name) {
    egl_.reset();
    cache_ = std::make_unique<CacheReader>(folder_ / name);
    try {
      egl_ = rendererBy(Backend::kEgl);
    } catch (const Error& error) {
      GTEST_SKIP() << error.what();
    }
    if (egl_->backendName().find("compute shaders") == std::string::npos) GTEST_SKIP() << egl_->backendName();
  }

  /// Draws one scalar, or two where the cache has them.
  std::unique_ptr<FrameRenderer> rendererBy(Backend backend) const {
    return std::make_unique<FrameRenderer>(*cache_, scalars(), backend);
  }
  DrawnScalars scalars() const {
    const TransferFunction opacities = TransferFunction::preset("viridis", -1, 1, 0.02);
    if (cache_->manifest().variables.size() == 1) return {0, opacities};
    return {{0, opacities}, {1, TransferFunction::preset("plasma", -1, 1, 0.02)}};
  }
  static FrameOptions options(uint64_t card_memory_bytes) {
    FrameOptions made;
    made.size = {60, 50};
    made.lod_pixels = 0;
    made.memory_bytes = 256 * kMiB;
    made.card_memory_bytes = card_memory_bytes;
    return made;
  }
  Camera camera(const char* view, Projection projection = Projection::kOrthographic) const {
    const Manifest& manifest = cache_->manifest();
    return Camera::named(view, manifest.lower, manifest.upper, {60, 50}, projection, 30);
  }
  glm::dvec3 middle() const { return 0.5 * (cache_->manifest().lower + cache_->manifest().upper); }

  /// Two planes across the data and a box in it: seven faces or eight near a corner of the box.
  void clip(FrameOptions& o) const {
    o.clip_planes = {{middle(), {1, 0.2, 0}}, {middle() + glm::dvec3(0, 0.3, 0.1), {0.3, -1, 0.5}}};
    o.clip_box = {cache_->manifest().lower + 0.4, cache_->manifest().upper - glm::dvec3(0.3, 0.9, 0.5)};
  }
  /// Translucent slices and an opaque triangle.
  void putLayers(FrameOptions& o) const {
    auto scene = std::make_shared<SurfaceScene>();
    scene->slices = {{middle(), {1, 0.2, 0.1}}, {middle() + 0.5, {0, 0.1, 1}}};
    scene->slice_opacity = 0.6;
    auto mesh = std::make_shared<TriangleMesh>();
    const glm::vec3 at(middle());
    mesh->positions = {at + glm::vec3(-2, -2, -1), at + glm::vec3(2, -2, 0), at + glm::vec3(0, 2, 1)};
    mesh->normals.assign(3, {0, 0, 1});
    mesh->triangles = {{0, 1, 2}};
    scene->surfaces.push_back({mesh, {0.8f, 0.7f, 0.2f}});
    o.scene = scene;
  }

  /// Compares the picture from the card with the processor's. Returns how many splats came from stored bricks.
  uint64_t compare(const std::string& what, const Camera& camera,
                   const std::function<void(FrameOptions&)>& set, double least_db = 60) {
    FrameOptions wanted = options(64 * kMiB);
    set(wanted);
    FrameStatistics card, cpu;
    const Image stored = egl_->render(camera, wanted, card),
                image = rendererBy(Backend::kCpu)->render(camera, wanted, cpu);
    EXPECT_GE(compareImages(stored, image).psnr_db, least_db) << what;
    EXPECT_EQ(card.splats_read, cpu.splats_read) << what;
    EXPECT_EQ(card.splats_off_screen, cpu.splats_off_screen) << what;
    EXPECT_NEAR(static_cast<double>(card.splats_clipped), static_cast<double>(cpu.splats_clipped), 2) << what;
    EXPECT_NEAR(static_cast<double>(card.splats_behind), static_cast<double>(cpu.splats_behind), 2) << what;
    EXPECT_EQ(card.splats_drawn + card.splats_transparent, cpu.splats_drawn + cpu.splats_transparent) << what;
    read_ = card.splats_read;
    return card.card_splats;
  }

  uint64_t read_ = 0;  // splats of the last picture compared
  TemporaryFolder folder_;
  std::unique_ptr<CacheReader> cache_;
  std::unique_ptr<FrameRenderer> egl_;
};

TEST_F(CardBricksTest, AreDrawnAsTheProcessorDrawsThem) {
  const auto nothing = [](FrameOptions&) {};
  const uint64_t all = compare("plain", camera("iso"), nothing);
  EXPECT_GT(all, 10'000u);
  EXPECT_EQ(compare("perspective", camera("iso", Projection::kPerspective), nothing), all);
  EXPECT_EQ(compare("flat", camera("-x"), [](FrameOptions& o) { o.classification = Classification::kFlat; }),
            all);
  EXPECT_GT(compare("stretched", camera("+y"), [](FrameOptions& o) { o.scale = {1, 2, 0.5}; }), 0u);
  EXPECT_EQ(compare("lit", camera("iso"), [](FrameOptions& o) { o.light = Light{}; }), all);
  const auto light = [](FrameOptions& o) { o.light = Light{0.2f, 0.8f, 0.4f, glm::dvec3(1, 0.4, 0.6)}; };
  EXPECT_EQ(compare("lit from the side", camera("iso", Projection::kPerspective), light), all);
  EXPECT_GT(compare("coarse", camera("iso"), [](FrameOptions& o) { o.lod_pixels = 4; }), 0u);
}

TEST_F(CardBricksTest, DrawSplatsAtBordersInTheSamePieces) {
  for (const bool cells : {false, true}) {
    const char* const name = cells ? "cells.splats" : "nodes.splats";
    writeRandomCacheWithBorders(folder_ / name, 7, cells);
    open(name);
    const auto nothing = [](FrameOptions&) {};
    const uint64_t all = compare(name, camera("iso"), nothing);
    EXPECT_GT(all, 10'000u);
    EXPECT_EQ(compare(name, camera("iso", Projection::kPerspective), nothing), all);
    if (!cells || faults::isWholeSweep()) {
      compare(name, camera("-x"), [](FrameOptions& o) { o.classification = Classification::kFlat; });
      compare(name, camera("+y"), [](FrameOptions& o) { o.scale = {1, 2, 0.5}; });
    }
    const auto light = [](FrameOptions& o) { o.light = Light{0.2f, 0.8f, 0.4f, glm::dvec3(1, 0.4, 0.6)}; };
    compare(name, camera("iso", Projection::kPerspective), light);
    compare(name, camera("iso"), [](FrameOptions& o) { o.lod_pixels = 4; });
  }
}

/// An addition to what splats are drawn with.
struct Addition {
  const char* name;
  std::function<void(FrameOptions&)> set;
};

class CardBricksWith : public CardBricksTest, public ::testing::WithParamInterface<const char*> {};

TEST_P(CardBricksWith, AreCutAndClassifiedAsByTheProcessor) {
  const std::string kind = GetParam();
  writeRandomCacheWithBorders(folder_ / "b.splats", 7, kind == "cells", kind == "two scalars" ? 2 : 1);
  open("b.splats");
  const auto shadows = [](FrameOptions& o) {
    o.light = Light{0.2f, 0.8f, 0.4f, glm::dvec3(1, 0.4, 0.6)};
    o.light->shadow = o.light->ambient_occlusion = 0.7f;
  };
  const auto steep = [](FrameOptions& o) { o.gradient_opacity = {{0, 0}, {0.3, 0.2}, {0.8, 1}}; };
  const Addition additions[] = {
      {"gradient opacity", steep},  // first: before lit pictures have set what light needs
      {"clip", [&](FrameOptions& o) { clip(o); }},
      {"layers", [&](FrameOptions& o) { putLayers(o); }},
      {"shadows", shadows},
      {"all", [&](FrameOptions& o) {
         clip(o);
         putLayers(o);
         shadows(o);
         steep(o);
       }}};
  const Camera parallel = camera("iso"), eye = camera("iso", Projection::kPerspective);
  const bool is_whole = kind == "nodes" || faults::isWholeSweep();  // else shadows with all the others alone
  for (const Addition& addition : additions) {
    if (!is_whole && std::string_view(addition.name) == "shadows") continue;
    const std::string what = fmt::format("{}, {}", kind, addition.name);
    EXPECT_EQ(compare(what, kind == "nodes" ? eye : parallel, addition.set), read_) << what;
  }
  if (is_whole) {
    EXPECT_EQ(compare(kind + ", all", kind == "nodes" ? parallel : eye, additions[4].set), read_);
  }
}

INSTANTIATE_TEST_SUITE_P(, CardBricksWith, ::testing::Values("nodes", "cells", "two scalars"),
                         [](const auto& kind) {
                           std::string name = kind.param;
                           std::erase(name, ' ');
                           return name;
                         });

// Thick and thin layers in cells of which the colours and the opacities change with the depth: where planes and layers of the picture
// cut them, the part that is left has a mean of its own, and what is nearer hides the rest.
TEST_F(CardBricksTest, DrawLayersAsTheProcessorDoes) {
  struct Slab {
    const char* name;
    double thickness;
    uint64_t layers;
    double degrees;  // from its normal
  };
  for (const Slab& slab :
       {Slab{"thick", 0.1, 5, 25}, Slab{"thin", 0.01, 12, 60}, Slab{"grazed", 0.004, 12, 88}})
    for (const size_t scalars : {1u, 2u}) {
      const FunctionGridSource source({gridBlock(9, 9, slab.layers)}, scalars, [&](const GridNode& node) {
        const double w = double(node.k) / double(slab.layers - 1);
        NodeValues values{{node.i / 8.0, node.j / 8.0, slab.thickness * w}, {float(1.6 * w - 0.8)}};
        if (scalars == 2) values.scalars.push_back(float(0.7 - 1.5 * w));
        return values;
      });
      ConvertOptions converting;
      converting.output = folder_ / "layers.splats";
      converting.overwrite = true;
      converting.scalars = {0, 1};
      converting.scalars.resize(scalars);
      Progress progress;
      convert(source, converting, progress);
      open("layers.splats");
      const double angle = slab.degrees * std::numbers::pi / 180;
      Camera looking = camera("+z");
      looking.position = looking.focal_point +
                         5.0 * glm::dvec3(0.8 * std::sin(angle), 0.6 * std::sin(angle), std::cos(angle));
      looking.parallel_scale = 0.15;
      const std::string what = fmt::format("{}, {} scalars", slab.name, scalars);
      const glm::dvec3 normal(0.1, 0.05, 1 / slab.thickness);
      const auto cut = [&](FrameOptions& o) { o.clip_planes = {{middle(), -normal}}; };
      const auto slice = [&](FrameOptions& o) {
        auto scene = std::make_shared<SurfaceScene>();
        scene->slices = {{middle() + glm::dvec3(0, 0, 0.1 * slab.thickness), normal}};
        scene->slice_opacity = 0.4;
        o.scene = scene;
      };
      compare(what, looking, [](FrameOptions&) {});
      compare(what + ", cut", looking, cut);
      compare(what + ", slice", looking, slice);
      compare(what + ", both", looking, [&](FrameOptions& o) { cut(o), slice(o); });
    }
}

TEST_F(CardBricksTest, DrawPlatesAsTheProcessorDoes) {
  writePlatesCache(folder_ / "plates.splats", 0.125);
  open("plates.splats");
  for (const Projection projection : {Projection::kOrthographic, Projection::kPerspective}) {
    Camera looking = camera("+z", projection);
    looking.position = looking.focal_point + 200.0 * glm::dvec3(0.79, 0.59, 0.17);
    looking.parallel_scale = 5;
    looking.view_angle_deg = 3;
    compare(
        "plates", looking, [](FrameOptions&) {}, 50);  // many opaque ones, behind one another
    compare("plates, cut", looking, [&](FrameOptions& o) { o.clip_planes = {{middle(), {0.01, 0, -1}}}; });
  }
}

TEST_F(CardBricksTest, LeaveToTheProcessorWhatPerspectiveCuts) {
  // Some bricks are too near for what they hold, others not: perspective cuts their splats.
  for (const double distance : {0.02, 0.1, 0.3, 0.6}) {
    Camera close = camera("iso", Projection::kPerspective);
    close.position = middle() + distance * (close.position - middle());
    compare(fmt::format("from {} of the distance", distance), close, [](FrameOptions&) {});
  }
}

TEST_F(CardBricksTest, GiveTheSameBitsForAnyHistoryThreadsAndMemory) {
  writeRandomCacheWithBorders(folder_ / "borders.splats", 5, false);
  open("borders.splats");
  for (const uint64_t card_memory : {2 * kMiB, 64 * kMiB}) {
    FrameStatistics statistics;
    const Image iso = egl_->render(camera("iso"), options(card_memory), statistics);
    const uint64_t stored = statistics.card_splats;
    EXPECT_GT(stored, 0u);
    EXPECT_EQ(stored == statistics.splats_read, card_memory > 2 * kMiB);
    for (const unsigned threads : {1u, 3u}) {
      if ((threads == 1) != (card_memory > 2 * kMiB) && !faults::isWholeSweep()) continue;
      const auto fresh = rendererBy(Backend::kEgl);
      FrameOptions wanted = options(card_memory);
      wanted.threads = threads;
      wanted.memory_bytes = (threads == 1 ? 96 : 512) * kMiB;
      fresh->render(camera(threads == 1 ? "+z" : "-x"), wanted, statistics);
      EXPECT_EQ(fresh->render(camera("iso"), wanted, statistics).rgba, iso.rgba) << threads;
      EXPECT_EQ(statistics.card_splats, stored);
    }
  }
}

TEST_F(CardBricksTest, AreReadOnce) {
  FrameStatistics first, second;
  egl_->render(camera("iso"), options(64 * kMiB), first);
  EXPECT_GT(first.bytes_read, 0u);
  egl_->render(camera("-x"), options(64 * kMiB), second);
  EXPECT_EQ(second.bytes_read, 0u);
  EXPECT_EQ(second.card_splats, first.card_splats);
}

TEST_F(CardBricksTest, KeepWhatLiesFarOutsideOfTheFunction) {
  // In cells of the table both ends of a splat's interval are the same float.
  const auto narrow = [&](Backend backend) {
    const TransferFunction function = TransferFunction::preset("viridis", -5, -5 + 1e-4, 0.02);
    FrameStatistics statistics;
    return FrameRenderer(*cache_, 0, function, backend).render(camera("iso"), options(64 * kMiB), statistics);
  };
  EXPECT_GE(compareImages(narrow(Backend::kEgl), narrow(Backend::kCpu)).psnr_db, 60);
}

TEST_F(CardBricksTest, GiveMemoryUpWhereThereIsLessOfIt) {
  writeRandomCacheWithBorders(folder_ / "borders.splats", 5, true);
  open("borders.splats");
  FrameStatistics all, few;
  egl_->render(camera("iso"), options(64 * kMiB), all);
  egl_->render(camera("iso"), options(2 * kMiB), few);
  EXPECT_LT(few.card_splats, all.card_splats);
  egl_->render(camera("iso"), options(64 * kMiB), few);
  EXPECT_EQ(few.card_splats, all.card_splats);
}

/// The textures of layers count: 16 bytes a pixel, of a picture whose bricks would fit without them.
TEST_F(CardBricksTest, LeaveRoomForLayers) {
  FrameOptions wanted = options(0);
  wanted.size = {240, 200};
  const uint64_t of_layers = 16 * wanted.size.pixels();
  FrameStatistics card, ignored;
  const auto stored = [&](uint64_t bytes) {
    wanted.card_memory_bytes = bytes;
    const Image image = egl_->render(camera("iso"), wanted, card);
    EXPECT_GE(compareImages(image, rendererBy(Backend::kCpu)->render(camera("iso"), wanted, ignored)).psnr_db,
              60)
        << bytes;
    return card.card_splats;
  };
  EXPECT_GT(stored(of_layers), 0u);
  putLayers(wanted);
  EXPECT_EQ(stored(of_layers), 0u);
  EXPECT_EQ(stored(of_layers + 64 * kMiB), card.splats_read);
}

TEST_F(CardBricksTest, StayAwayWithoutMemory) {
  FrameStatistics statistics;
  const Image none = egl_->render(camera("iso"), options(0), statistics);
  EXPECT_EQ(statistics.card_splats, 0u);
  EXPECT_EQ(egl_->render(camera("iso"), options(1000), statistics).rgba, none.rgba);
  EXPECT_EQ(statistics.card_splats, 0u);
}

struct Faults {
  int refusals = 0;  // of buffers of 100 kB and more,
  int accepted = 0;  // buffers of that size that are made before one is refused
  bool is_refusing = false, is_reset = false;
};

/// The painter in compute shaders, whose buffers and batches are smaller, and an OpenGL that fails when it is told to.
class FailingBackend final : public PaintingBackend {
 public:
  static inline Faults faults;

  explicit FailingBackend(uint64_t buffer_bytes = UINT64_MAX) {
    faults = {};
    thread_.run([&](const GlContext&) {
      context_ = std::make_unique<Context>();
      painter_ =
          std::make_unique<GlTilePainter>(*context_, GlTilePainter::Capacity{1024, 1 << 17, buffer_bytes});
    });
  }
  ~FailingBackend() override {
    thread_.run([&](const GlContext&) {
      painter_.reset();
      context_.reset();
    });
  }
  void run(const Job& job) override {
    thread_.run([&](const GlContext&) { job(*painter_); });
  }
  const std::string& name() const override { return name_; }
  bool isSoftware() const override { return true; }
  Backend next() const override { return Backend::kEglQuads; }
  uint64_t bytes(ImageSize, const PaintResources&) const override { return 1 << 20; }

 private:
  /// The thread's context, with some functions replaced.
  class Context final : public GlContext {
   public:
    Context() : GlContext("failing", lookUp) {}

   private:
    static void* lookUp(const char* name) {
      static void* const library = dlopen("libEGL.so.1", RTLD_NOW | RTLD_LOCAL);
      using Get = void* (*)(const char*);
      static const auto get = reinterpret_cast<Get>(dlsym(library, "eglGetProcAddress"));
      static const auto buffer_data = reinterpret_cast<PFNGLBUFFERDATAPROC>(get("glBufferData"));
      static const auto error = reinterpret_cast<PFNGLGETERRORPROC>(get("glGetError"));
      const std::string_view wanted = name;
      if (wanted == "glGetGraphicsResetStatus") {
        const PFNGLGETGRAPHICSRESETSTATUSPROC status = [] {
          return GLenum{faults.is_reset ? GLenum{GL_GUILTY_CONTEXT_RESET} : GLenum{GL_NO_ERROR}};
        };
        return reinterpret_cast<void*>(status);
      }
      if (wanted == "glBufferData") {
        const PFNGLBUFFERDATAPROC data = [](GLenum target, GLsizeiptr bytes, const void* from, GLenum usage) {
          faults.is_refusing = bytes >= 100'000 && faults.refusals > 0 && faults.accepted-- <= 0;
          if (faults.is_refusing)
            --faults.refusals;
          else
            buffer_data(target, bytes, from, usage);
        };
        return reinterpret_cast<void*>(data);
      }
      if (wanted == "glGetError") {
        const PFNGLGETERRORPROC instead = [] {
          return std::exchange(faults.is_refusing, false) ? GLenum{GL_OUT_OF_MEMORY} : error();
        };
        return reinterpret_cast<void*>(instead);
      }
      return get(name);
    }
  };

  GlThread thread_{GlLibrary::kEgl};
  std::unique_ptr<Context> context_;
  std::unique_ptr<Painter> painter_;
  const std::string name_ = "failing";
};

class FailingCard : public CardBricksTest {
 protected:
  std::unique_ptr<FrameRenderer> renderer(uint64_t buffer_bytes = UINT64_MAX) const {
    return std::make_unique<FrameRenderer>(*cache_,
                                           DrawnScalars(0, TransferFunction::preset("viridis", -1, 1, 0.02)),
                                           std::make_unique<FailingBackend>(buffer_bytes));
  }
};

TEST_F(FailingCard, ProjectsInSlabsWhatItsBuffersDoNotHoldAtOnce) {
  writeLatticeCache(folder_ / "lattice.splats", -0.5, {0.03, 0.02, 0.01});  // four layers of bricks
  open("lattice.splats");
  FrameOptions large = options(64 * kMiB);
  large.size = {210, 175};  // the depths in which tiles of 4 pixels may order splats are small
  for (const std::string view : {"iso", "+z"}) {
    if (view == "+z" && !faults::isWholeSweep()) continue;  // as the test of its memory
    FrameStatistics whole, slabs;
    const Image wanted = renderer()->render(camera(view.c_str()), large, whole);
    EXPECT_EQ(whole.card_splats, whole.splats_read);
    EXPECT_EQ(whole.card_slabs, 1u);
    bool is_divided = false;
    for (const uint64_t buffer_bytes : {31 * kMiB / 8, 15 * kMiB / 4}) {
      const Image image = renderer(buffer_bytes)->render(camera(view.c_str()), large, slabs);
      EXPECT_EQ(slabs.splats_drawn, whole.splats_drawn) << buffer_bytes;
      EXPECT_EQ(slabs.splats_off_screen, whole.splats_off_screen) << buffer_bytes;
      if (slabs.card_splats == whole.card_splats)
        EXPECT_EQ(image.rgba, wanted.rgba) << buffer_bytes;
      else
        EXPECT_GE(compareImages(image, wanted).psnr_db, 60) << buffer_bytes;
      is_divided |= slabs.card_splats == whole.card_splats && slabs.card_slabs > 1;
    }
    EXPECT_TRUE(is_divided) << view;
  }
}

TEST_F(FailingCard, ProjectsInSlabsWhatItsMemoryDoesNotHoldAtOnce) {
  writeLatticeCache(folder_ / "lattice.splats", -0.5, {0.03, 0.02, 0.01});
  open("lattice.splats");
  FrameOptions large = options(64 * kMiB);
  large.size = {210, 175};
  FrameStatistics whole, slabs;
  const auto card = renderer();
  const Image wanted = card->render(camera("+z"), large, whole);
  // The pages of all bricks and a part of what they are drawn as: the first such size is looked for.
  bool is_divided = false;
  for (uint64_t bytes = whole.card_sent_bytes + 64 * whole.splats_drawn; !is_divided; bytes -= kMiB / 4) {
    ASSERT_GT(bytes, whole.card_sent_bytes);
    large.card_memory_bytes = bytes;
    const Image image = card->render(camera("+z"), large, slabs);
    ASSERT_EQ(slabs.card_splats, whole.card_splats) << bytes;
    is_divided = slabs.card_slabs > 1;
    EXPECT_EQ(image.rgba, wanted.rgba) << bytes;
  }
}

TEST_F(FailingCard, KeepsFewerBricksWhereItRefusesMemory) {
  FrameStatistics statistics;
  const auto card = renderer();
  FailingBackend::faults.refusals = 2;
  const Image image = card->render(camera("iso"), options(64 * kMiB), statistics);
  EXPECT_EQ(FailingBackend::faults.refusals, 0);
  EXPECT_GT(statistics.card_splats, 0u);
  EXPECT_LT(statistics.card_splats, statistics.splats_read);
  EXPECT_EQ(card->backendName(), "failing");
  EXPECT_GE(
      compareImages(image, rendererBy(Backend::kCpu)->render(camera("iso"), options(0), statistics)).psnr_db,
      60);
}

TEST_F(FailingCard, DrawsOnWhicheverOfItsBuffersIsRefused) {
  FrameStatistics statistics;
  const Image wanted = rendererBy(Backend::kCpu)->render(camera("iso"), options(0), statistics);
  int number = 0;
  for (bool is_refused = true; is_refused; ++number) {
    const auto card = renderer();
    FailingBackend::faults = {.refusals = 1, .accepted = number};
    const Image image = card->render(camera("iso"), options(64 * kMiB), statistics);
    is_refused = FailingBackend::faults.refusals == 0;
    EXPECT_EQ(card->backendName(), "failing") << number;
    EXPECT_GT(statistics.card_splats, 0u) << number;
    EXPECT_GE(compareImages(image, wanted).psnr_db, 60) << number;
  }
  EXPECT_GE(number, 4);  // of splats, bricks and the lists of tiles, and none
}

TEST_F(FailingCard, IsLeftByPlayersForGood) {
  writeRandomCacheWithBorders(folder_ / "two.splats", 7, false, 2);
  open("two.splats");
  StepPlayer player(*cache_, scalars(), std::make_unique<FailingBackend>());
  FailingBackend::faults.is_reset = true;
  FrameStatistics statistics;
  player.renderer().render(camera("iso"), options(64 * kMiB), statistics);
  const std::string reached = player.renderer().backendName();
  EXPECT_NE(reached.find("quads (the graphics card was reset"), std::string::npos) << reached;
  player.setFunctions(scalars());
  EXPECT_EQ(player.renderer().backendName(), reached);
  player.renderer().render(camera("iso"), options(64 * kMiB), statistics);
  EXPECT_EQ(player.renderer().backendName(), reached);
}

TEST_F(FailingCard, LeavesItsPictureToQuadsOnceItWasReset) {
  FrameStatistics statistics;
  const Image quads = rendererBy(Backend::kEglQuads)->render(camera("iso"), options(0), statistics);
  const auto card = renderer();
  const Image before = card->render(camera("iso"), options(64 * kMiB), statistics);
  EXPECT_GT(statistics.card_splats, 0u);
  FailingBackend::faults.is_reset = true;
  EXPECT_EQ(card->render(camera("iso"), options(64 * kMiB), statistics).rgba, quads.rgba);
  EXPECT_EQ(statistics.card_splats, 0u);
  EXPECT_NE(card->backendName().find("quads (the graphics card was reset while drawing)"), std::string::npos)
      << card->backendName();
  EXPECT_GE(compareImages(before, quads).psnr_db, 50);
}

/// Several ranks draw a picture, and the card of one of them fails in its midst: all draw it again, that one in another way.
TEST_F(FailingCard, OfOneRankLeavesThePictureToTheOthersAndToQuads) {
  FrameStatistics ignored;
  const Image wanted = rendererBy(Backend::kCpu)->render(camera("iso"), options(0), ignored);
  const std::pair<Faults, const char*> cases[] = {
      {{.is_reset = true}, "quads (the graphics card was reset"},
      {{.refusals = 100}, "quads (OpenGL has no memory left for"}};
  for (const auto& [faults, expected] : cases)
    for (const unsigned failing : {0u, 2u}) {
      Image first, second;
      std::string name;
      runRanks(3, [&, of_rank = faults](Ranks& ranks) {
        const bool fails = ranks.rank() == failing;
        auto backend = fails ? std::make_unique<FailingBackend>() : makeBackend(Backend::kCpu);
        FrameRenderer renderer(*cache_, DrawnScalars(0, TransferFunction::preset("viridis", -1, 1, 0.02)),
                               std::move(backend));
        if (fails) FailingBackend::faults = of_rank;
        FrameOptions with = options(0);
        with.ranks = &ranks;
        FrameStatistics statistics;
        Image a = renderer.render(camera("iso"), with, statistics),
              b = renderer.render(camera("iso"), with, statistics);
        if (fails) name = renderer.backendName();
        if (!ranks.isFirst()) return;
        first = std::move(a);
        second = std::move(b);
      });
      EXPECT_GE(compareImages(first, wanted).psnr_db, 60) << expected;
      EXPECT_EQ(first.rgba, second.rgba) << expected;
      EXPECT_NE(name.find(expected), std::string::npos) << name;
    }
}

TEST(Backends, GoOnWithQuadsAndThenByTheProcessor) {
  std::unique_ptr<PaintingBackend> backend;
  try {
    backend = makeBackend(Backend::kEglQuads);
  } catch (const Error& error) {
    GTEST_SKIP() << error.what();
  }
  replaceFailed(backend, "no memory");
  EXPECT_TRUE(backend->name().starts_with("CPU") && backend->name().ends_with(" (no memory)"))
      << backend->name();
}

/// A backend in compute shaders that has failed.
class FailedBackend final : public PaintingBackend {
 public:
  explicit FailedBackend(bool is_software) : is_software_(is_software) {}
  void run(const Job&) override {}
  const std::string& name() const override { return name_; }
  bool isSoftware() const override { return is_software_; }
  Backend next() const override { return Backend::kEglQuads; }
  uint64_t bytes(ImageSize, const PaintResources&) const override { return 0; }

 private:
  const bool is_software_;
  const std::string name_ = "failed";
};

TEST(Backends, DrawNoQuadsInSoftwareForACardThatFailed) {
  bool quads_are_software = false;
  try {
    quads_are_software = makeBackend(Backend::kEglQuads)->isSoftware();
  } catch (const Error& error) {
    GTEST_SKIP() << error.what();
  }
  for (const bool was_software : {false, true}) {
    std::unique_ptr<PaintingBackend> backend = std::make_unique<FailedBackend>(was_software);
    replaceFailed(backend, "no memory");
    const bool has_quads = backend->name().find("quads (no memory)") != std::string::npos;
    EXPECT_EQ(has_quads, was_software || !quads_are_software) << backend->name();
    EXPECT_TRUE(backend->name().starts_with("CPU") || has_quads) << backend->name();
  }
}

GLint told_kibibytes = 0;
bool is_told = true;
GLenum told_error = GL_NO_ERROR;

TEST(CardMemory, IsTakenByWhatTheDriverTells) {
  const GlFunctions gl([](const char* name) -> void* {
    const PFNGLGETINTEGERVPROC integer = [](GLenum, GLint* value) {
      if (is_told) *value = told_kibibytes;
      told_error = is_told ? GL_NO_ERROR : GL_INVALID_ENUM;
    };
    const PFNGLGETERRORPROC error = [] { return std::exchange(told_error, GLenum{GL_NO_ERROR}); };
    return std::string_view(name) == "glGetError" ? reinterpret_cast<void*>(error)
                                                  : reinterpret_cast<void*>(integer);
  });
  told_kibibytes = 8 << 20;
  EXPECT_EQ(defaultCardBytes(gl, 64 * 1024 * kMiB), 6 * 1024 * kMiB);
  told_kibibytes = 0;  // the processor's memory is the card's
  EXPECT_EQ(defaultCardBytes(gl, 64 * 1024 * kMiB), 768 * kMiB);
  EXPECT_EQ(defaultCardBytes(gl, 4 * 1024 * kMiB), 512 * kMiB);
  is_told = false;
  EXPECT_EQ(defaultCardBytes(gl, 0), 768 * kMiB);
}

/// 64 bricks, of which about four lie at any depth.
std::vector<StoredPart> overlappingParts() {
  Brick brick;
  brick.splats = 1000;
  brick.octant_splats = {1000};
  std::vector<StoredPart> parts;
  for (uint32_t n = 0; n < 64; ++n)
    parts.push_back({n,
                     brick.splats,
                     brick.octant_splats,
                     SplatRanges(brick, kAllOctants),
                     glm::dvec3(0.0),
                     {1000 * n, 1000 * n + 2600}});
  return parts;
}

TEST(CardBricks, TakeFewSlabsNearTheLimitOfTheirMemory) {
  const std::vector<StoredPart> parts = overlappingParts();
  SplatGeometry geometry;
  SplatVariable variable;
  geometry.resize(1000);
  variable.resize(1000);
  GlThread gl(GlLibrary::kEgl);
  gl.run([&](const GlContext& context) {
    if (const std::string why = context.functions().whyNoCompute(); !why.empty()) GTEST_SKIP() << why;
    size_t divided = 0, most = 0;
    for (uint64_t bytes = 9 * kMiB; bytes > kMiB; bytes -= 128 << 10) {
      CardBricks bricks(context.functions(), UINT64_MAX);
      CardBuffer splats(context.functions());
      bricks.open(1, {});
      const size_t fitting = bricks.makeRoom(parts, bytes, splats, 0);
      const std::span<const StoredPart> stored = std::span(parts).first(fitting);
      for (const StoredPart& part : stored) bricks.put(part, arraysOf(geometry), arraysOf(variable), {});
      ASSERT_EQ(bricks.makeRoom(stored, bytes, splats, 0), fitting) << bytes;
      const std::vector<CardSlab> slabs = bricks.beginFrame(stored);
      for (const CardSlab& slab : slabs)
        EXPECT_LE(slab.elements * sizeof(ScreenSplat), splats.bytes()) << bytes;
      EXPECT_LE(splats.bytes() + 68'000 * fitting, bytes);
      divided += fitting == parts.size() && slabs.size() > 1;
      most = std::max(most, slabs.size());
    }
    EXPECT_GT(divided, 5u);
    EXPECT_LE(most, 12u);
  });
}

/// The pieces of `count` splats with this code.
BrickPieces piecesOf(size_t count, uint32_t code, const BorderStyle& borders) {
  SplatGeometry geometry;
  SplatVariable variable;
  geometry.resize(count);
  variable.resize(count);
  for (size_t n = 0; n < count; ++n) {
    geometry.axis0[n] = geometry.axis1[n] = geometry.axis2[n] = geometry.weight[n] = 1;
    geometry.border_code[n] = code;
  }
  return BrickPieces::of(arraysOf(geometry), arraysOf(variable), borders);
}

TEST(BrickPieces, AreFewerWhereABrickWouldHaveTooMany) {
  const std::array<glm::dvec3, 3> axes{glm::dvec3(1, 0, 0), glm::dvec3(0, 1, 0), glm::dvec3(0, 0, 1)};
  const uint32_t face = packBorderCode({axes.data(), 1}, 1), corner = packBorderCode(axes);
  EXPECT_EQ(piecesOf(20'000, face, kWholeCellPairs).pieces.size(), 40'000u);
  EXPECT_EQ(piecesOf(22'000, face, kWholeCellPairs).pieces.size(), 22'000u);
  EXPECT_EQ(piecesOf(8192, corner, kHalfCellStyle).pieces.size(), 65'536u);
  const BrickPieces none = piecesOf(8193, corner, kHalfCellStyle);
  EXPECT_TRUE(none.has_too_many);
  EXPECT_TRUE(none.pieces.empty() && none.splats.empty());
}

}  // namespace
}  // namespace curvisplat
