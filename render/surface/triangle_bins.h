// Which triangles may be seen in which tiles of a picture.
//
// A triangle is listed in every tile that its box of pixels touches; triangles outside of the picture, before the
// near plane or without a size on the grid of samples are listed nowhere. Batches of triangles are sorted by tile in
// parallel, each on its own. Consecutive triangles in the same tiles, which meshes mostly have, are one run: 8 bytes a
// run and tile.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "render/surface/scene_triangles.h"

namespace curvisplat {

/// Consecutive triangles of a surface.
struct TriangleRun {
  uint32_t first, count;
};

/// Immutable; any thread.
class TriangleBins {
 public:
  /// Parallel on the caller's TBB arena.
  explicit TriangleBins(const SceneTriangles& triangles);

  int columns() const { return columns_; }
  int rows() const { return rows_; }
  /// Calls draw(surface, runs of its triangles) for each batch that the tile sees a part of; false if none.
  template <typename Draw>
  bool forTile(int column, int row, const Draw& draw) const {
    bool any = false;
    for (const Batch& batch : batches_) {
      const std::span<const TriangleRun> seen = batch.at(column, row);
      if (seen.empty()) continue;
      any = true;
      draw(batch.surface, seen);
    }
    return any;
  }

 private:
  /// Tiles, the last included.
  struct TileBox {
    int16_t x0 = 0, y0 = 0, x1 = -1, y1 = -1;
    bool empty() const { return x0 > x1 || y0 > y1; }
    bool operator==(const TileBox&) const = default;
  };
  struct Batch {
    size_t surface = 0;
    uint32_t first = 0, count = 0;
    TileBox box;
    std::vector<uint32_t> begins;  // [tiles of the box + 1], into `runs`
    std::vector<TriangleRun> runs;

    std::span<const TriangleRun> at(int column, int row) const {
      if (column < box.x0 || column > box.x1 || row < box.y0 || row > box.y1) return {};
      const auto tile = static_cast<size_t>(row - box.y0) * static_cast<size_t>(box.x1 - box.x0 + 1) +
                        static_cast<size_t>(column - box.x0);
      return {runs.data() + begins[tile], begins[tile + 1] - begins[tile]};
    }
  };
  /// Consecutive triangles that touch the same tiles.
  struct Piece {
    TileBox box;
    TriangleRun run;
  };
  TileBox tilesOf(const ScreenVertex* vertices, size_t count) const;
  std::vector<Piece> piecesOf(const SceneTriangles& triangles, const Batch& batch) const;
  void sort(const SceneTriangles& triangles, Batch& batch) const;

  int columns_, rows_;
  ImageSize size_;
  std::vector<Batch> batches_;
};

}  // namespace curvisplat
