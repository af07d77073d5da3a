// Pictures that stay on the card, for a window that shares its textures: the same as those that are read.
#include <gtest/gtest.h>

#include <algorithm>
#include <cstdlib>
#include <functional>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "render/backend/backend.h"
#include "render/frame/first_picture.h"
#include "render/frame/frame.h"
#include "render/mesh/triangle_mesh.h"
#include "render/surface/surface_scene.h"
#include "stream/base/error.h"
#include "tests/support/shared_egl.h"
#include "tests/support/temporary_folder.h"
#include "tests/support/test_caches.h"

namespace curvisplat {
namespace {

constexpr QuickLimits kEverything{};

/// The picture in 8 bits, as FrameLoop makes them.
std::vector<uint8_t> bytesOf(const Image& image) {
  std::vector<uint8_t> bytes;
  for (const float channel : image.rgba)
    bytes.push_back(static_cast<uint8_t>(std::clamp(channel, 0.0f, 1.0f) * 255 + 0.5f));
  return bytes;
}

int largestByteDifference(const std::vector<uint8_t>& a, const std::vector<uint8_t>& b) {
  if (a.size() != b.size()) return 256;
  int largest = 0;
  for (size_t n = 0; n < a.size(); ++n) largest = std::max(largest, std::abs(int{a[n]} - int{b[n]}));
  return largest;
}

class CardPictureTest : public ::testing::Test {
 protected:
  void SetUp() override {
    writeRandomCache(folder_ / "a.splats", 3, 1000);
    cache_ = std::make_unique<CacheReader>(folder_ / "a.splats");
    try {
      window_ = std::make_unique<SharedEgl>();
    } catch (const Error& error) {
      GTEST_SKIP() << error.what();
    }
    renderer_ = rendererFor(window_.get());
    if (renderer_->backendName().find("compute shaders") == std::string::npos)
      GTEST_SKIP() << renderer_->backendName();
  }
  void TearDown() override { renderer_.reset(); }

  std::unique_ptr<FrameRenderer> rendererFor(GlSharing* window) const {
    return std::make_unique<FrameRenderer>(*cache_,
                                           DrawnScalars(0, TransferFunction::preset("viridis", -1, 1, 0.02)),
                                           makeBackend(Backend::kEgl, window));
  }
  static FrameOptions options() {
    FrameOptions made;
    made.size = {61, 47};
    made.lod_pixels = 0;
    made.memory_bytes = 256 << 20;
    made.card_memory_bytes = 64 << 20;
    return made;
  }
  Camera camera(const char* view = "iso") const {
    const Manifest& manifest = cache_->manifest();
    return Camera::named(view, manifest.lower, manifest.upper, {61, 47}, Projection::kOrthographic, 30);
  }
  /// Translucent slices before and behind an opaque triangle, which cover a part of the picture.
  void putLayers(FrameOptions& o) const {
    const glm::dvec3 middle = 0.5 * (cache_->manifest().lower + cache_->manifest().upper);
    auto scene = std::make_shared<SurfaceScene>();
    scene->slices = {{middle, {1, 0.2, 0.1}}, {middle + 0.5, {0, 0.1, 1}}};
    scene->slice_opacity = 0.6;
    auto mesh = std::make_shared<TriangleMesh>();
    const glm::vec3 at(middle);
    mesh->positions = {at + glm::vec3(-2, -2, -1), at + glm::vec3(2, -2, 0), at + glm::vec3(0, 2, 1)};
    mesh->normals.assign(3, {0, 0, 1});
    mesh->triangles = {{0, 1, 2}};
    scene->surfaces.push_back({mesh, {0.8f, 0.7f, 0.2f}});
    o.scene = scene;
  }

  std::shared_ptr<CardPicture> drawn(const FrameOptions& o, const char* view = "iso", double detail_px = 0) {
    std::shared_ptr<CardPicture> on_card;
    bool is_final = false;
    const Image image =
        renderer_->renderQuickly(camera(view), o, {.detail_px = detail_px}, statistics_, is_final, &on_card);
    EXPECT_EQ(image.size.width, 0);
    return on_card;
  }

  TemporaryFolder folder_;
  std::unique_ptr<CacheReader> cache_;
  std::unique_ptr<SharedEgl> window_;
  std::unique_ptr<FrameRenderer> renderer_;
  FrameStatistics statistics_;
};

TEST_F(CardPictureTest, HasTheBytesOfThePictureThatIsRead) {
  const std::pair<const char*, std::function<void(FrameOptions&)>> cases[] = {
      {"plain", [](FrameOptions&) {}},
      {"dark",
       [](FrameOptions& o) {
         o.background = {0.1f, 0.2f, 0.3f, 1};
       }},
      {"through",
       [](FrameOptions& o) {
         o.background = {0.1f, 0.05f, 0, 0.2f};
       }},
      {"layers", [&](FrameOptions& o) { putLayers(o); }},
      {"layers alone", [&](FrameOptions& o) {
         putLayers(o);
         o.clip_box = {cache_->manifest().upper + 1.0, cache_->manifest().upper + 2.0};
       }}};
  for (const auto& [name, set] : cases) {
    FrameOptions wanted = options();
    set(wanted);
    const std::shared_ptr<CardPicture> on_card = drawn(wanted);
    ASSERT_TRUE(on_card) << name;
    EXPECT_EQ(statistics_.card_read_bytes, 0u) << name;
    EXPECT_EQ(on_card->size(), wanted.size) << name;
    const Image read = renderer_->render(camera(), wanted, statistics_);
    EXPECT_GE(statistics_.card_read_bytes, 16 * wanted.size.pixels()) << name;
    // Fused multiply-adds may round a channel to the next number of 8 bits.
    EXPECT_LE(largestByteDifference(window_->read(*on_card), bytesOf(read)), 1) << name;
  }
}

/// The colours of the layers count, two or more of 16 bytes a pixel; lists of tiles may be a little shorter than those of a picture
/// that is read.
TEST_F(CardPictureTest, CountsAsMemoryOfTheCard) {
  FrameOptions wanted = options();
  putLayers(wanted);
  FrameStatistics read;
  rendererFor(window_.get())->render(camera(), wanted, read);
  drawn(wanted);
  const auto pixels = static_cast<int64_t>(wanted.size.pixels());
  const auto more =
      static_cast<int64_t>(statistics_.card_peak_bytes) - static_cast<int64_t>(read.card_peak_bytes);
  EXPECT_GT(more, 16 * pixels);
}

TEST_F(CardPictureTest, StaysWhileLaterOnesAreDrawnAndThenGoes) {
  std::vector<std::shared_ptr<CardPicture>> pictures;
  for (const char* view : {"iso", "+z", "-x"}) pictures.push_back(drawn(options(), view));
  std::vector<std::vector<uint8_t>> bytes;
  for (const char* view : {"iso", "+z", "-x"})
    bytes.push_back(bytesOf(renderer_->render(camera(view), options(), statistics_)));
  std::vector<GLuint> names;
  for (size_t n = 0; n < pictures.size(); ++n) {
    EXPECT_LE(largestByteDifference(window_->read(*pictures[n]), bytes[n]), 1) << n;
    EXPECT_GT(largestByteDifference(window_->read(*pictures[n]), bytes[(n + 1) % 3]), 9) << n;
    names.push_back(pictures[n]->texture());
  }
  pictures.erase(pictures.begin() + 1, pictures.end());
  const std::shared_ptr<CardPicture> next = drawn(options());
  EXPECT_TRUE(window_->isTexture(names[0]));
  for (const size_t gone : {1u, 2u})
    EXPECT_TRUE(names[gone] == next->texture() || !window_->isTexture(names[gone])) << gone;
  // It outlives its painter.
  renderer_.reset();
  EXPECT_LE(largestByteDifference(window_->read(*pictures[0]), bytes[0]), 1);
}

TEST_F(CardPictureTest, OfFewerPixelsIsShownAsItWouldBeEnlarged) {
  FrameOptions wanted = options();
  const std::shared_ptr<CardPicture> on_card = drawn(wanted, "iso", 8);
  const ImageSize reduced = ReducedSize(wanted.size, 8).size();
  EXPECT_LT(reduced.height, wanted.size.height);
  EXPECT_EQ(on_card->size(), reduced);
  // A ramp across the reduced picture, sampled as a texture of which the middle is shown.
  Image ramp(reduced);
  for (int y = 0; y < reduced.height; ++y)
    for (int x = 0; x < reduced.width; ++x) std::fill_n(ramp.pixel(x, y), 4, static_cast<float>(x) + 0.5f);
  const Image enlarged = ReducedSize(wanted.size, 8).enlarge(ramp);
  const double shown = ReducedSize::shownWidth(wanted.size, reduced);
  EXPECT_LE(shown, 1);
  for (int x = 0; x < wanted.size.width; ++x) {
    const double part = 0.5 + shown * ((x + 0.5) / wanted.size.width - 0.5);
    const double sampled = std::clamp(part * reduced.width, 0.5, reduced.width - 0.5);
    EXPECT_NEAR(static_cast<double>(enlarged.pixel(x, 20)[0]), sampled, 1e-4) << x;
  }
}

/// A window whose OpenGL gives no further context, or is another card's.
class Refusing final : public GlSharing {
 public:
  explicit Refusing(std::string renderer) : renderer_(std::move(renderer)) {}
  const std::string& renderer() const override { return renderer_; }
  std::unique_ptr<GlContext> makeContext() override { throw Error("GLX says no"); }

 private:
  const std::string renderer_;
};

TEST_F(CardPictureTest, IsReadBackWhereTheWindowSharesNothing) {
  const std::pair<std::string, const char*> cases[] = {
      {window_->renderer(), "compute shaders (read back for the window: GLX says no)"},
      {"another card", "compute shaders (read back for the window: the window is drawn by another card"}};
  for (const auto& [of_window, expected] : cases) {
    Refusing window(of_window);
    const auto renderer = rendererFor(&window);
    EXPECT_NE(renderer->backendName().find(expected), std::string::npos) << renderer->backendName();
    std::shared_ptr<CardPicture> on_card;
    bool is_final = false;
    const Image image =
        renderer->renderQuickly(camera(), options(), kEverything, statistics_, is_final, &on_card);
    EXPECT_FALSE(on_card);
    EXPECT_TRUE(is_final);
    EXPECT_EQ(image.rgba, renderer_->render(camera(), options(), statistics_).rgba);
  }
}

TEST_F(CardPictureTest, IsNotAskedOfTheProcessor) {
  const auto backend = makeBackend(Backend::kCpu, window_.get());
  backend->run([](Painter& painter) { EXPECT_EQ(painter.endOnCard(), nullptr); });
}

}  // namespace
}  // namespace curvisplat
