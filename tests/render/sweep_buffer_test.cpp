#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <deque>
#include <mutex>
#include <random>
#include <thread>
#include <vector>

#include "render/sweep/segment_ring.h"
#include "render/sweep/sweep_buffer.h"

namespace curvisplat {
namespace {

ScreenSplat numberedSplat(size_t number) {
  ScreenSplat splat{};
  splat.x = static_cast<float>(number);
  return splat;
}

TEST(SegmentRing, HandsOverEverythingInSequence) {
  constexpr size_t kSegments = 3000, kCapacity = 100;
  for (const int workers : {1, 2, 5}) {
    std::mt19937 random(4);
    std::vector<size_t> counts(kSegments);
    for (size_t& count : counts) count = random() % 7 == 0 ? 0 : random() % (kCapacity + 1);
    std::vector<ScreenSplat> memory(kCapacity);
    SegmentRing ring(memory);
    std::atomic<size_t> next = 0;
    std::vector<std::thread> threads;
    for (int n = 0; n < workers; ++n)
      threads.emplace_back([&] {
        for (size_t sequence; (sequence = next++) < kSegments;) {
          const auto segment = ring.acquire(sequence, counts[sequence]);
          ASSERT_TRUE(segment);
          ASSERT_EQ(segment->size(), counts[sequence]);
          for (ScreenSplat& splat : *segment) splat = numberedSplat(sequence);
          ring.commit(sequence);
        }
      });
    for (size_t sequence = 0; sequence < kSegments; ++sequence) {
      const auto segment = ring.next();
      ASSERT_TRUE(segment);
      ASSERT_EQ(segment->size(), counts[sequence]);
      for (const ScreenSplat& splat : *segment) ASSERT_EQ(splat.x, static_cast<float>(sequence));
      ring.release();
    }
    for (auto& thread : threads) thread.join();
  }
}

TEST(SegmentRing, KeepsWhatIsHandedOutUntilItIsReleased) {
  std::vector<ScreenSplat> memory(10);
  SegmentRing ring(memory);
  const auto fill = [&](uint64_t sequence, size_t count) {
    const auto segment = ring.acquire(sequence, count);
    ASSERT_TRUE(segment);
    for (ScreenSplat& splat : *segment) splat = numberedSplat(sequence);
    ring.commit(sequence);
  };
  EXPECT_FALSE(ring.nextIfReady());
  fill(0, 4);
  fill(1, 4);
  const auto first = ring.nextIfReady();
  const auto second = ring.nextIfReady();
  ASSERT_TRUE(first && second);
  EXPECT_FALSE(ring.nextIfReady());
  fill(2, 2);
  std::thread worker([&] { fill(3, 4); });  // waits for the first's place
  const auto third = ring.nextIfReady();
  ASSERT_TRUE(third);
  for (size_t n = 0; n < 4; ++n) {
    EXPECT_EQ((*first)[n].x, 0);
    EXPECT_EQ((*second)[n].x, 1);
  }
  ring.release();
  const auto fourth = ring.next();
  ASSERT_TRUE(fourth);
  EXPECT_EQ(fourth->data(), first->data());
  EXPECT_EQ((*fourth)[0].x, 3);
  EXPECT_EQ((*second)[0].x, 1);
  worker.join();
}

TEST(SegmentRing, PausesWhereItIsTold) {
  std::vector<ScreenSplat> memory(10);
  SegmentRing ring(memory);
  const auto fill = [&](uint64_t sequence) {
    ASSERT_TRUE(ring.acquire(sequence, 4));
    ring.commit(sequence);
  };
  fill(0);
  std::thread painter([&] {
    EXPECT_TRUE(ring.next());
    ring.release();
    EXPECT_TRUE(ring.next());
    ring.release();
    EXPECT_FALSE(ring.next());
    EXPECT_FALSE(ring.isClosed());
  });
  fill(1);
  ring.pauseAfter(2);
  ring.pauseAfter(2);
  painter.join();
  ring.resume();
  fill(2);
  EXPECT_TRUE(ring.next());
}

TEST(SegmentRing, ClosingWakesAllWhoWait) {
  std::vector<ScreenSplat> memory(10);
  SegmentRing ring(memory);
  ASSERT_TRUE(ring.acquire(0, 10));
  std::thread full([&] { EXPECT_FALSE(ring.acquire(1, 1)); });
  std::thread early([&] { EXPECT_FALSE(ring.acquire(7, 1)); });
  std::thread painter([&] { EXPECT_FALSE(ring.next()); });
  ring.close();
  full.join();
  early.join();
  painter.join();
  ring.commit(0);
  EXPECT_FALSE(ring.next());
}

/// Notes what it draws.
class NotingPainter final : public Painter {
 public:
  void begin(ImageSize, const glm::vec4&, const ClassificationTable&, PixelShading,
             const PaintResources&) override {}
  void drawOnly(const TileSet&) override {}
  void draw(std::span<const ScreenSplat> splats) override {
    for (const ScreenSplat& splat : splats) drawn.push_back(splat.x);
  }
  Image end() override { return Image(); }
  double uploadSeconds() const override { return 0; }
  double drawSeconds() const override { return 0; }

  std::vector<float> drawn;  // x of each splat
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
    NotingPainter painter;
    double waited_s = 0;
    SegmentDrawer drawer(painter, ring, waited_s);
    for (size_t sequence = 0; sequence < kSegments; ++sequence) ASSERT_TRUE(drawer.drawNext());
    worker.join();
    EXPECT_EQ(painter.drawn, expected) << capacity;
    ring.close();
    EXPECT_FALSE(drawer.drawNext());
  }
}

constexpr size_t kPage = SweepBuffer::kPageSplats;

/// Parts of random extent along the depth, and their splats' keys in index order.
struct SweptScene {
  std::vector<SweptPart> parts;
  std::vector<std::vector<uint32_t>> keys;  // [part]

  /// A scene of `values` different keys; few make long ties.
  SweptScene(uint64_t seed, uint32_t count, uint32_t most_splats, uint32_t values) {
    std::mt19937_64 random(seed);
    for (uint32_t n = 0; n < count; ++n) {
      SweptPart part{{n}, {}};
      part.keys.first = static_cast<uint32_t>(random() % values);
      part.keys.last = static_cast<uint32_t>(
          std::min<uint64_t>(values - 1, part.keys.first + random() % (values / 4 + 1)));
      parts.push_back(part);
    }
    std::sort(parts.begin(), parts.end(),
              [](const SweptPart& a, const SweptPart& b) { return a.begin() < b.begin(); });
    for (const SweptPart& part : parts) {
      auto& of_part = keys.emplace_back(random() % (most_splats + 1));
      for (uint32_t& key : of_part)
        key = part.keys.first + static_cast<uint32_t>(random() % (part.keys.last - part.keys.first + 1));
    }
  }

  /// x: the part, y: the number in it.
  std::vector<ScreenSplat> splatsOf(uint32_t part) const {
    std::vector<ScreenSplat> splats(keys[part].size());
    for (size_t n = 0; n < splats.size(); ++n) {
      splats[n].x = static_cast<float>(part);
      splats[n].y = static_cast<float>(n);
    }
    return splats;
  }

  std::vector<std::pair<float, float>> inOrder() const {
    std::vector<std::tuple<uint32_t, uint32_t, uint32_t, uint32_t>> all;
    for (uint32_t part = 0; part < parts.size(); ++part)
      for (uint32_t n = 0; n < keys[part].size(); ++n)
        all.emplace_back(keys[part][n], parts[part].part.brick, n, part);
    std::sort(all.begin(), all.end());
    std::vector<std::pair<float, float>> order;
    for (const auto& [key, brick, n, part] : all) order.emplace_back(part, n);
    return order;
  }
};

/// Sweeps as a frame's workers do, and collects what comes out.
class Sweeper {
 public:
  Sweeper(const SweptScene& scene, size_t splats, size_t batch) : scene_(scene), buffer_(splats, batch) {}

  std::vector<std::pair<float, float>> sweep(int workers) {
    buffer_.beginFrame();
    batches_.clear();
    while (buffer_.beginSlab(scene_.parts)) {
      next_ = 0;
      std::vector<std::thread> threads;
      for (int n = 0; n < workers; ++n) threads.emplace_back([this] { work(); });
      for (auto& thread : threads) thread.join();
    }
    std::vector<std::pair<float, float>> all;
    for (const auto& batch : batches_) all.insert(all.end(), batch.begin(), batch.end());
    EXPECT_EQ(buffer_.batches(), batches_.size());
    return all;
  }
  SweepBuffer& buffer() { return buffer_; }

 private:
  void work() {
    DepthSorter sorter;
    while (true) {
      if (const auto batch = buffer_.next()) {
        hand(*batch);
        continue;
      }
      const uint64_t sequence = next_++;
      if (sequence >= buffer_.parts().size()) break;
      const uint32_t part = buffer_.parts()[sequence];
      ASSERT_TRUE(part < scene_.parts.size());
      const bool behind = buffer_.isBehind(scene_.parts[part]);
      const auto splats = scene_.splatsOf(part);
      const auto sorted = sorter.sort(scene_.keys[part]);
      ASSERT_TRUE(buffer_.awaitTurn(sequence));
      if (behind) {
        buffer_.skip();
        continue;
      }
      std::shared_ptr<SweepBuffer::Run> run;
      while (!(run = buffer_.enter(scene_.parts[part].part.brick, sorted))) {
        if (const auto batch = buffer_.nextFinal())
          hand(*batch);
        else
          ASSERT_TRUE(buffer_.awaitSpace(scene_.parts[part].part.brick, sorted));
      }
      buffer_.fill(*run, sorted, splats);
    }
    while (const auto batch = buffer_.awaitNext()) hand(*batch);
  }

  void hand(const SweepBuffer::Batch& batch) {
    DepthSorter sorter;
    buffer_.itemsOf(batch, sorter.items(batch.count));
    ASSERT_TRUE(buffer_.awaitFilled(batch));
    std::vector<std::pair<float, float>> splats;
    std::vector<ScreenSplat> copied(batch.count);
    buffer_.copy(sorter.sort(), copied);
    for (const ScreenSplat& splat : copied) splats.emplace_back(splat.x, splat.y);
    buffer_.giveBack(batch);
    const std::lock_guard lock(mutex_);
    batches_.resize(std::max(batches_.size(), batch.sequence + 1));
    EXPECT_TRUE(batches_[batch.sequence].empty());
    batches_[batch.sequence] = std::move(splats);
  }

  const SweptScene& scene_;
  SweepBuffer buffer_;
  std::atomic<uint64_t> next_ = 0;
  std::mutex mutex_;
  std::vector<std::vector<std::pair<float, float>>> batches_;
};

TEST(SweepBuffer, HandsOutAllSplatsInOrderWhateverItsSize) {
  for (const auto& [values, most_splats] :
       {std::pair{1u << 30, 1000u}, std::pair{50u, 600u}, std::pair{1u, 1500u}}) {
    const SweptScene scene(7, 40, most_splats, values);
    const auto expected = scene.inOrder();
    uint64_t last_slabs = 1;
    for (const size_t pages : {2000u, 200u, 40u, 4u}) {
      Sweeper sweeper(scene, pages * kPage, pages == 40 ? 100 : 5000);
      for (const int workers : {1, 2, 5}) {
        ASSERT_EQ(sweeper.sweep(workers), expected) << values << " values, " << pages << " pages";
        EXPECT_LE(sweeper.buffer().peakSplats(), pages * kPage);
      }
      EXPECT_GE(sweeper.buffer().slabs(), last_slabs);
      last_slabs = sweeper.buffer().slabs();
      if (pages == 2000) {
        EXPECT_EQ(last_slabs, 1u);
      }
    }
    EXPECT_GT(last_slabs, 5u);
  }
}

TEST(SweepBuffer, HoldsALayerOnly) {
  // A hundred parts one behind the other, overlapping by half.
  SweptScene scene(1, 0, 0, 1);
  std::mt19937 random(2);
  for (uint32_t n = 0; n < 100; ++n) {
    scene.parts.push_back({{n}, {n * 1000, n * 1000 + 1999}});
    auto& keys = scene.keys.emplace_back(4 * kPage);
    for (uint32_t& key : keys) key = n * 1000 + static_cast<uint32_t>(random() % 2000);
  }
  Sweeper sweeper(scene, 500 * kPage, 2 * kPage);
  EXPECT_EQ(sweeper.sweep(1), scene.inOrder());
  EXPECT_LE(sweeper.buffer().peakSplats(), 14 * kPage);
}

// Painting threads wait for one another at the end of each.
TEST(SweepBuffer, FillsBatches) {
  const SweptScene scene(11, 200, 2000, 1u << 30);
  const auto order = scene.inOrder();
  constexpr size_t kBatch = 10'000;
  Sweeper sweeper(scene, 2 * order.size(), kBatch);
  for (const int workers : {1, 3}) {
    EXPECT_EQ(sweeper.sweep(workers), order);
    EXPECT_LE(sweeper.buffer().batches(), order.size() / (kBatch * 9 / 10) + 2);
  }
}

TEST(SweepBuffer, ClosingWakesAllWhoWait) {
  const SweptScene scene(3, 10, 1000, 100);
  SweepBuffer buffer(8 * kPage, 100);
  ASSERT_TRUE(buffer.beginSlab(scene.parts));
  std::thread early([&] { EXPECT_FALSE(buffer.awaitTurn(3)); });
  std::thread idle([&] { EXPECT_FALSE(buffer.awaitNext()); });
  buffer.close();
  early.join();
  idle.join();
  DepthSorter sorter;
  const auto sorted = sorter.sort(scene.keys[0]);
  EXPECT_FALSE(buffer.awaitTurn(0));
  EXPECT_FALSE(buffer.enter(0, sorted));
  EXPECT_FALSE(buffer.awaitSpace(0, sorted));
  EXPECT_FALSE(buffer.beginSlab(scene.parts));
  buffer.beginFrame();
  EXPECT_TRUE(buffer.beginSlab(scene.parts));
}

}  // namespace
}  // namespace curvisplat
