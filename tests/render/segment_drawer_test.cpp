#include "render/frame/segment_drawer.h"

#include <gtest/gtest.h>

#include <deque>
#include <thread>
#include <vector>

namespace curvisplat {
namespace {

/// Draws two draws later than it is told to, as OpenGL may, and looks at the splats only then.
class LatePainter final : public Painter {
 public:
  DrawingOrder order() const override { return DrawingOrder::kBackToFront; }
  void begin(ImageSize, const glm::vec4&, const ClassificationTable&, PixelShading,
             const PaintResources&) override {}
  void drawOnly(const TileSet&) override {}
  void draw(std::span<const ScreenSplat> splats) override {
    under_way_.push_back(splats);
    if (under_way_.size() > 2) finishOldest();
  }
  size_t drawsUnderWay() const override { return under_way_.size(); }
  void finishDraws() override {
    while (!under_way_.empty()) finishOldest();
  }
  Image end() override { return Image(); }
  double uploadSeconds() const override { return 0; }
  double drawSeconds() const override { return 0; }

  std::vector<float> drawn;  // x of each splat

 private:
  void finishOldest() {
    for (const ScreenSplat& splat : under_way_.front()) drawn.push_back(splat.x);
    under_way_.pop_front();
  }

  std::deque<std::span<const ScreenSplat>> under_way_;
};

TEST(SegmentDrawer, GivesBackWhatIsDrawnAndNeverStarvesTheWorkers) {
  // As large as one segment, as a few, as all.
  for (const size_t capacity : {10u, 35u, 5000u}) {
    constexpr size_t kSegments = 400;
    std::vector<ScreenSplat> memory(capacity);
    SegmentRing ring(memory);
    std::vector<float> expected;
    const auto countOf = [](size_t sequence) { return sequence * 7 % 11; };
    for (size_t sequence = 0; sequence < kSegments; ++sequence)
      expected.insert(expected.end(), countOf(sequence), static_cast<float>(sequence));
    std::thread worker([&] {
      for (size_t sequence = 0; sequence < kSegments; ++sequence) {
        const auto segment = ring.acquire(sequence, countOf(sequence));
        ASSERT_TRUE(segment);
        for (ScreenSplat& splat : *segment) splat.x = static_cast<float>(sequence);
        ring.commit(sequence);
      }
    });
    LatePainter painter;
    double waited_s = 0;
    SegmentDrawer drawer(painter, ring, waited_s);
    for (size_t sequence = 0; sequence < kSegments; ++sequence) ASSERT_TRUE(drawer.drawNext());
    painter.finishDraws();
    worker.join();
    EXPECT_EQ(painter.drawn, expected) << capacity;
    ring.close();
    EXPECT_FALSE(drawer.drawNext());
  }
}

}  // namespace
}  // namespace curvisplat
