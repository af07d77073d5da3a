// Cuts under a limit of splats or bytes, and parts of bricks.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <set>

#include "stream/paging/cut.h"
#include "tests/stream/cut_tree.h"

namespace curvisplat {
namespace {

CutOptions limited(double lod_pixels, uint64_t max_splats, uint64_t max_bytes = CutOptions::kNoLimit) {
  CutOptions options;
  options.lod_pixels = lod_pixels;
  options.max_splats = max_splats;
  options.max_bytes = max_bytes;
  return options;
}

/// How often each leaf is drawn: by itself, or by an octant of a brick above it.
std::vector<int> timesDrawn(const CutTestTree& tree, const Cut& cut) {
  std::vector<int> direct(tree.bricks.size()), times(tree.bricks.size());
  std::vector<std::array<int, 8>> octants(tree.bricks.size());
  for (const BrickPart& part : cut.parts) {
    if (tree.bricks[part.brick].isLeaf()) {
      EXPECT_TRUE(part.whole());
      ++direct[part.brick];
    } else {
      for (int octant = 0; octant < 8; ++octant) octants[part.brick][octant] += part.octants >> octant & 1;
    }
  }
  for (uint32_t id = 0; id < tree.bricks.size(); ++id) {
    if (!tree.bricks[id].isLeaf()) continue;
    times[id] = direct[id];
    for (uint32_t down = id; tree.bricks[down].parent != kNoBrick; down = tree.bricks[down].parent)
      times[id] += octants[tree.bricks[down].parent][tree.bricks[down].cell.octantInParent()];
  }
  return times;
}

uint64_t splatsOf(const CutTestTree& tree, const Cut& cut) {
  uint64_t splats = 0;
  for (const BrickPart& part : cut.parts) {
    const Brick& brick = tree.bricks[part.brick];
    if (part.whole())
      splats += brick.splats;
    else
      for (int octant = 0; octant < 8; ++octant)
        if (part.octants >> octant & 1) splats += brick.octant_splats[octant];
  }
  return splats;
}

uint64_t bytesOf(const CutTestTree& tree, const Cut& cut) {
  std::set<uint32_t> bricks;
  for (const BrickPart& part : cut.parts) bricks.insert(part.brick);
  uint64_t bytes = 0;
  for (const uint32_t id : bricks)
    bytes += tree.bricks[id].geometry.length + tree.variables[id].values.length;
  return bytes;
}

TEST(CutLimits, NeverHoldMoreAndCoverEveryLeafOnce) {
  std::mt19937 random(11);
  for (uint32_t seed = 20; seed < 24; ++seed) {
    const CutTestTree tree(seed);
    int in_part = 0;
    for (int n = 0; n < 8; ++n) {
      const CutView view = randomView(random, n % 2 == 0);
      for (uint64_t limit = tree.bricks[0].splats; limit < 40'000; limit = limit * 5 / 4) {
        for (const CutOptions& options : {limited(0, limit), limited(0, CutOptions::kNoLimit, 10 * limit)}) {
          const Cut cut = tree.cut(view, options);
          EXPECT_LE(cut.splats, options.max_splats);
          EXPECT_LE(cut.bytes, options.max_bytes);
          EXPECT_EQ(cut.splats, splatsOf(tree, cut));
          EXPECT_EQ(cut.bytes, bytesOf(tree, cut));
          const std::vector<int> times = timesDrawn(tree, cut);
          for (uint32_t id = 0; id < tree.bricks.size(); ++id)
            if (tree.bricks[id].isLeaf()) {
              ASSERT_EQ(times[id], 1) << "leaf " << id << " under " << limit;
            }
          std::set<uint32_t> partly;
          for (const BrickPart& part : cut.parts)
            if (!part.whole()) partly.insert(part.brick);
          EXPECT_LE(partly.size(), 1u);
          in_part += !partly.empty();
          EXPECT_EQ(cut.parts, tree.cut(view, options).parts);
        }
      }
    }
    EXPECT_GT(in_part, 50);
  }
}

TEST(CutLimits, AHigherLimitRefinesTheSameCut) {
  std::mt19937 random(12);
  const CutTestTree tree(25);
  for (int n = 0; n < 10; ++n) {
    const CutView view = randomView(random, n % 2 == 0);
    Cut coarse = tree.cut(view, limited(0.3, tree.bricks[0].splats));
    for (uint64_t limit = tree.bricks[0].splats; limit < 40'000; limit += 397) {
      const Cut fine = tree.cut(view, limited(0.3, limit));
      // Each part of the fine cut lies in a part of the coarse one: it, or an octant above it.
      std::vector<uint8_t> drawn(tree.bricks.size());  // octants
      for (const BrickPart& part : coarse.parts) drawn[part.brick] |= part.octants;
      const auto holds = [&](uint32_t id, int octant) { return (drawn[id] >> octant & 1) != 0; };
      for (const BrickPart& part : fine.parts) {
        bool covered = false;
        if (part.whole()) {
          covered = holds(part.brick, 0) && holds(part.brick, 7);
        } else {
          covered = true;
          for (int octant = 0; octant < 8; ++octant)
            covered &= !(part.octants >> octant & 1) || holds(part.brick, octant);
        }
        for (uint32_t down = part.brick; !covered && tree.bricks[down].parent != kNoBrick;
             down = tree.bricks[down].parent)
          covered = holds(tree.bricks[down].parent, tree.bricks[down].cell.octantInParent());
        ASSERT_TRUE(covered) << "brick " << part.brick << " under " << limit;
      }
      // The tree's errors halve from level to level, but a child may lie nearer to the eye than its parent.
      if (!view.perspective) {
        EXPECT_LE(fine.largest_error_px, coarse.largest_error_px);
      }
      coarse = fine;
    }
    EXPECT_TRUE(coarse.complete);
  }
}

TEST(CutLimits, RefinesTheLargestErrorFirst) {
  std::mt19937 random(13);
  const CutTestTree tree(26);
  for (int n = 0; n < 6; ++n) {
    const CutView view = randomView(random, false);
    const double px = view.pixels * std::max({view.scale.x, view.scale.y, view.scale.z});
    for (const uint64_t limit : {300u, 1000u, 3000u, 9000u}) {
      const Cut cut = tree.cut(view, limited(0, limit));
      ASSERT_FALSE(cut.complete);
      // Whatever was refined had an error at least as large as all that is drawn.
      double least_refined = 1e9;
      for (const BrickPart& part : cut.parts)
        for (uint32_t up = tree.bricks[part.brick].parent; up != kNoBrick; up = tree.bricks[up].parent)
          least_refined = std::min<double>(least_refined, tree.bricks[up].error * px);
      EXPECT_GE(least_refined, cut.largest_error_px);
    }
  }
}

/// A cut under limits, by its definition: all totals are counted anew after each step.
std::map<uint32_t, uint8_t> refinedStepByStep(const CutTestTree& tree, const CutView& view,
                                              const TransparentBounds& transparent,
                                              const CutOptions& options) {
  // With one brick for a tree, the cut says whether that brick's subtree can be seen.
  const auto visible = [&](uint32_t id) {
    Brick root = tree.bricks[id];
    root.parent = kNoBrick;
    root.child_count = 0;
    const BrickVariable low_and_high[] = {{{}, -1e9f, 1e9f, 0, 0}};
    const Cut seen = chooseCut({tree.root, {&root, 1}, low_and_high, {&tree.subtrees[id], 1}}, view,
                               transparent, CutOptions{});
    return seen.parts.size() == 1;
  };
  const auto drawn = [&](uint32_t id) {
    const BrickVariable& values = tree.variables[id];
    return !transparent({values.min, values.max, values.largest_slope, values.largest_deviation});
  };
  const auto error = [&](uint32_t id) {
    const double scale = std::max({view.scale.x, view.scale.y, view.scale.z});
    return tree.bricks[id].error * scale * view.pixels;
  };
  using Octants = std::map<uint32_t, uint8_t>;  // drawn, by brick
  const auto fits = [&](const Octants& octants) {
    uint64_t splats = 0, bytes = 0;
    for (const auto& [id, mask] : octants) {
      const Brick& brick = tree.bricks[id];
      uint64_t own = mask == kAllOctants ? brick.splats : 0;
      for (int octant = 0; mask != kAllOctants && octant < 8; ++octant)
        if (mask >> octant & 1) own += brick.octant_splats[octant];
      if (own == 0 || !drawn(id)) continue;
      splats += own;
      bytes += brick.geometry.length + tree.variables[id].values.length;
    }
    return splats <= options.max_splats && bytes <= options.max_bytes;
  };

  Octants cut;
  std::set<uint32_t> waiting;
  if (visible(0)) cut[0] = kAllOctants, waiting.insert(0);
  while (true) {
    uint32_t next = kNoBrick;
    for (const uint32_t id : waiting)  // of equal errors the lowest number
      if (!tree.bricks[id].isLeaf() && (next == kNoBrick || error(id) > error(next))) next = id;
    if (next == kNoBrick) return cut;
    waiting.erase(next);
    for (int octant = 0; octant < 8; ++octant) {
      Octants refined = cut;
      refined[next] &= static_cast<uint8_t>(~(1 << octant));
      std::vector<uint32_t> added;
      const Brick& brick = tree.bricks[next];
      for (uint32_t child = brick.first_child; child < brick.first_child + brick.child_count; ++child)
        if (tree.bricks[child].cell.octantInParent() == octant && visible(child)) added.push_back(child);
      for (const uint32_t child : added) refined[child] = kAllOctants;
      if (!fits(refined)) return cut;
      cut = refined;
      waiting.insert(added.begin(), added.end());
    }
  }
}

TEST(CutLimits, AreUsedUpStepByStep) {
  std::mt19937 random(17);
  const CutTestTree tree(31);
  for (int n = 0; n < 12; ++n) {
    CutView view = randomView(random, false);
    if (n % 3 > 0) view.planes = {{randomDirection(random), 0.3}};
    const TransparentBounds low = [&](const ValueBounds& values) { return n % 2 == 1 && values.max < 0.6f; };
    for (const uint64_t limit : {100u, 237u, 501u, 1099u}) {
      for (const CutOptions& options : {limited(0, limit), limited(0, CutOptions::kNoLimit, 20 * limit)}) {
        std::map<uint32_t, uint8_t> octants;
        for (const BrickPart& part : tree.cut(view, options, low).parts) octants[part.brick] |= part.octants;
        std::map<uint32_t, uint8_t> expected;
        for (const auto& [id, mask] : refinedStepByStep(tree, view, low, options)) {
          const Brick& brick = tree.bricks[id];
          const bool transparent = low({tree.variables[id].min, tree.variables[id].max, 0.01f, 0.01f});
          if (!transparent && SplatRanges(brick, mask).splats() > 0) expected[id] = mask;
        }
        // Octants without a splat may be named or not.
        for (auto* masks : {&octants, &expected})
          for (auto& [id, mask] : *masks)
            for (int octant = 0; octant < 8 && !tree.bricks[id].isLeaf(); ++octant)
              if (tree.bricks[id].octant_splats[octant] == 0) mask &= static_cast<uint8_t>(~(1 << octant));
        EXPECT_EQ(octants, expected) << "view " << n << ", " << options.max_splats << " splats, "
                                     << options.max_bytes << " bytes";
      }
    }
  }
}

TEST(CutLimits, WithRoomForAllAreTheCutWithoutThem) {
  std::mt19937 random(14);
  const CutTestTree tree(27);
  for (int n = 0; n < 10; ++n) {
    CutView view = randomView(random, n % 2 == 0);
    view.planes = {{randomDirection(random), 0.4}};
    const TransparentBounds low = [](const ValueBounds& values) { return values.max < 0.5f; };
    for (const double lod_pixels : {0.0, 0.5, 3.0}) {
      const Cut all = tree.cut(view, lod_pixels, low);
      const Cut cut = tree.cut(view, limited(lod_pixels, all.splats + 100'000), low);
      EXPECT_EQ(cut.parts, all.parts);
      EXPECT_TRUE(cut.complete);
      EXPECT_EQ(cut.splats, all.splats);
      EXPECT_EQ(cut.bytes, all.bytes);
      EXPECT_EQ(cut.transparent, all.transparent);
      EXPECT_EQ(cut.out_of_image, all.out_of_image);
      EXPECT_LE(tree.cut(view, limited(lod_pixels, all.splats / 2), low).splats,
                std::max<uint64_t>(all.splats / 2, tree.bricks[0].splats));
    }
  }
}

TEST(CutLimits, NeverNameAFartherBrickAfterANearerOneOnAnyRay) {
  std::mt19937 random(16);
  std::uniform_real_distribution<double> around(-1, 1);
  const CutTestTree tree(30);
  int hits = 0;
  for (int n = 0; n < 80; ++n) {
    const CutView view = randomView(random, n % 2 == 0);
    const Cut cut = tree.cut(view, limited(0, 80 + 30 * static_cast<uint64_t>(n)));
    for (int ray = 0; ray < 50; ++ray) {
      const glm::dvec3 through = view.scale * glm::dvec3(around(random), around(random), around(random));
      const glm::dvec3 origin = view.perspective ? view.eye : through;
      const glm::dvec3 direction = view.perspective ? through - view.eye : -view.towards_viewer;
      double last = 1e9;
      const Cell* last_cell = nullptr;
      for (const BrickPart& part : cut.parts) {
        if (!part.whole()) continue;  // other bricks lie between its octants
        const Cell& cell = tree.bricks[part.brick].cell;
        const auto at = entry(tree, view, cell, origin, direction);
        if (!at) continue;
        ++hits;
        if (!last_cell || !(*last_cell == cell)) {
          EXPECT_LT(*at, last + 1e-9);
        }
        last = *at;
        last_cell = &cell;
      }
    }
  }
  EXPECT_GT(hits, 500);
}

TEST(CutLimits, DrawTheRootWhereNothingFits) {
  const CutTestTree tree(28);
  const Cut cut = tree.cut({}, limited(0, 1));
  EXPECT_EQ(cut.parts, (std::vector<BrickPart>{{0, kAllOctants}}));
  EXPECT_FALSE(cut.complete);
}

TEST(CutLimits, PartsOfABrickAreRunsOfItsSplats) {
  Brick brick;
  brick.octant_splats = {3, 0, 5, 7, 0, 11, 2, 4};
  brick.splats = 32;
  const auto ranges = [&](uint8_t octants) {
    const SplatRanges found(brick, octants);
    return std::vector<SplatRange>(found.begin(), found.end());
  };
  using Ranges = std::vector<SplatRange>;
  EXPECT_EQ(ranges(kAllOctants), (Ranges{{0, 32}}));
  EXPECT_EQ(ranges(0b00000001), (Ranges{{0, 3}}));
  EXPECT_EQ(ranges(0b00000101), (Ranges{{0, 8}}));  // octant 1 is empty
  EXPECT_EQ(ranges(0b10101101), (Ranges{{0, 26}, {28, 32}}));
  EXPECT_EQ(ranges(0b00010010), Ranges{});
  brick.octant_splats = {4, 4, 4, 4, 4, 4, 4, 4};
  EXPECT_EQ(ranges(0b01010101), (Ranges{{0, 4}, {8, 12}, {16, 20}, {24, 28}}));
  EXPECT_EQ(SplatRanges(brick, 0b01010101).splats(), 16u);
}

}  // namespace
}  // namespace curvisplat
