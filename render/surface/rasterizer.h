// Finds which triangle or capsule is seen at each of a pixel's samples, tile by tile.
//
// Vertices are moved to a grid of 1/16 pixel, in which edge functions are exact, in float for small
// triangles and in double for others: triangles that share an edge leave no gap and share no sample. Eight
// samples a pixel, whose mean is its centre. A sample keeps the least (value, triangle), so the result
// depends neither on the order of the triangles nor on threads.
//
// SampleTile draws a tile, on one thread. Triangles of at most 64 pixels go through drawSmallTriangles(), in
// the widest vectors there are, to the same bits in all instruction sets.
#pragma once

#include <array>
#include <cmath>
#include <cstdint>
#include <functional>
#include <span>
#include <vector>

#include "render/surface/scene_triangles.h"

namespace curvisplat {

/// Pixels [x0, x1] x [y0, y1] of the picture, with rows of kSampleTileWidth.
struct SampleBox {
  PixelSamples* samples;
  const PixelSamples* before;  // only what lies behind these is drawn; may be null
  int x0, y0, x1, y1;
};

/// The farthest values in blocks of pixels of a tile, or more: what lies behind all of a block is not drawn there.
struct TileDepths {
  static constexpr int kSide = 8, kColumns = kSampleTileWidth / kSide, kRows = kSampleTileHeight / kSide;
  std::array<float, size_t{kColumns} * kRows> farthest;
  std::array<int, size_t{kColumns} * kRows> stale;  // pixels that were drawn since it was found

  void clear() {
    farthest.fill(INFINITY);
    stale.fill(0);
  }
};

/// Consecutive numbers, the last included.
struct NumberRange {
  uint32_t first, last;
};

/// Capsules of one curve in a tile, which are drawn from the nearest on, so that most of a dense bundle lies behind what is
/// there already. Their order changes the time alone. It takes up to kBytes. One thread at a time.
class CapsuleQueue {
 public:
  static constexpr size_t kMaxSize = 4096;
  struct Entry {
    Capsule capsule;
    uint32_t number;
    NumberRange inside;
  };
  static constexpr size_t kBytes = 2 * kMaxSize * sizeof(Entry);

  size_t size() const { return entries_.size(); }
  void clear() { entries_.clear(); }
  void add(const Entry& entry) { entries_.push_back(entry); }
  /// All entries, from the nearest on, to a thousandth of their range of depths. Valid until the queue changes.
  std::span<const Entry> sorted();

 private:
  std::vector<Entry> entries_, sorted_;
};

/// The samples of one tile: 256 KiB, to be used for many. One thread at a time.
class SampleTile {
 public:
  SampleTile() : samples_(static_cast<size_t>(kSampleTileWidth) * kSampleTileHeight) {}

  /// Draws the triangles and capsules that a tile sees; with `before`, of the same tile, those that lie behind what its
  /// samples see. False if nothing is seen: then samples are undefined. `throw_if_stopped`: called every thousand
  /// triangles, each of which may cover the tile.
  bool draw(const SceneTriangles& triangles, const TriangleBins& bins, int column, int row,
            const SampleTile* before = nullptr, const std::function<void()>& throw_if_stopped = {});

  int x0() const { return x0_; }
  int y0() const { return y0_; }
  int x1() const { return x1_; }  // the last pixel
  int y1() const { return y1_; }
  /// A pixel of the picture.
  const PixelSamples& at(int x, int y) const {
    return samples_[static_cast<size_t>(y - y0_) * kSampleTileWidth + static_cast<size_t>(x - x0_)];
  }

 private:
  struct Setup;
  void drawSurface(const SceneTriangles& triangles, size_t surface, std::span<const uint32_t> numbers);
  void takeCapsules(const SceneTriangles& triangles, size_t curve, std::span<const uint32_t> points);
  void drawTaken(const SceneTriangles& triangles, const std::function<void()>& throw_if_stopped);
  SampleBox box();
  void drawTriangle(const std::array<ScreenVertex, 3>& corners, uint32_t number);
  void drawGuarded(const std::array<ScreenVertex, 3>& corners, uint32_t number);
  void fill(const Setup& setup, uint32_t number);

  int x0_ = 0, y0_ = 0, x1_ = -1, y1_ = -1;
  const SampleTile* before_ = nullptr;  // while it draws
  TileDepths depths_;
  std::vector<PixelSamples> samples_;  // [kSampleTileHeight][kSampleTileWidth]
  CapsuleQueue capsules_;              // of one curve
};

/// The most pixels along a side of a small triangle: products of a small triangle's differences have fewer
/// bits than a float.
inline constexpr int kSmallTriangle = 64;

/// Triangles of a surface, among which are those to draw.
struct SmallTriangles {
  const ScreenVertex* vertices;
  const std::array<uint32_t, 3>* triangles;
  std::span<const uint32_t> numbers;  // of those to draw
  uint32_t first_number = 0;          // of triangle 0, in the scene
};

/// Draws the small ones into the samples of a tile. Writes the others to `left` ([numbers]), and returns how
/// many they are. Pure but for what it writes; any thread.
size_t drawSmallTriangles(const SmallTriangles& work, const SampleBox& box, uint32_t* left);

/// Capsules of one curve, those to draw.
struct CapsuleWork {
  std::span<const Capsule> capsules;
  const uint32_t* numbers;  // [capsules], in the scene
  // [capsules]: with SampleBox::before, what lies in a capsule with one of these numbers is the inside of the same
  // line.
  const NumberRange* insides;
  TileDepths& depths;  // of the tile; kept up to date
};
/// Draws them, to the same bits in all instruction sets. Pure but for what it writes; any thread.
void drawCapsules(const CapsuleWork& work, const CapsuleLook& look, const SampleBox& box);

}  // namespace curvisplat
