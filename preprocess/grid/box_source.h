// BoxSource, the base of sources that read any box, and ForwardingGrid, the base of those that change what
// another source reads.
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <utility>
#include <vector>

#include "preprocess/grid/grid_source.h"

namespace curvisplat {

/// A grid whose read() also takes boxes of parts of rows: `out` gets box.rowNodes() nodes of each row, and no
/// whole rows are held in memory. Readers of files are such sources. (A class that derives from GridSource
/// directly need only read whole rows; readPartOfRows() cuts the parts out of them.)
class BoxSource : public GridSource {
 public:
  void readPartOfRows(uint32_t block, const NodeBox& box, std::span<const uint32_t> scalars,
                      NodeArrays& out) const final {
    read(block, box, scalars, out);
  }
  uint64_t rowsInMemory(std::span<const uint32_t> /*scalars*/) const override { return 0; }
};

/// A grid that is read from another one. It passes everything on: a subclass overrides what it changes, and
/// nothing that it does not mention is lost.
class ForwardingGrid : public BoxSource {
 public:
  const GridDescription& description() const override { return description_; }
  /// Reads any box, even if the source reads only whole rows.
  void read(uint32_t block, const NodeBox& box, std::span<const uint32_t> scalars,
            NodeArrays& out) const override {
    readBox(*source_, block, box, scalars, out);
  }
  uint64_t rowsInMemory(std::span<const uint32_t> scalars) const override {
    return source_->rowsInMemory(sourceScalars(scalars));
  }
  bool readFringe(uint32_t block, const NodeBox& box, std::vector<uint8_t>& out) const override {
    return source_->readFringe(block, box, out);
  }

 protected:
  explicit ForwardingGrid(std::shared_ptr<const GridSource> source)
      : description_(source->description()), source_(std::move(source)) {}
  /// `source` must outlive it.
  explicit ForwardingGrid(const GridSource& source)
      : ForwardingGrid(std::shared_ptr<const GridSource>(std::shared_ptr<const void>(), &source)) {}

  /// The indices of the source's scalars that `scalars` (indices in description()) are read or computed from.
  virtual std::vector<uint32_t> sourceScalars(std::span<const uint32_t> scalars) const {
    return {scalars.begin(), scalars.end()};
  }
  const GridSource& source() const { return *source_; }

  GridDescription description_;  // the source's, unless the subclass changes it

 private:
  std::shared_ptr<const GridSource> source_;
};

}  // namespace curvisplat
