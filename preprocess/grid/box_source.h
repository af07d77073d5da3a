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

/// A grid whose read() takes boxes of parts of rows, too: `out` gets box.rowNodes() nodes of each row. It
/// holds no whole rows beside them. Readers of files are such sources. (A source that is a GridSource itself
/// need only read whole rows, from which parts are then cut.)
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
  /// Any box, whether or not the source reads parts of rows.
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

  /// The scalars of the source that these are read or computed from.
  virtual std::vector<uint32_t> sourceScalars(std::span<const uint32_t> scalars) const {
    return {scalars.begin(), scalars.end()};
  }
  const GridSource& source() const { return *source_; }

  GridDescription description_;  // the source's, unless the subclass changes it

 private:
  std::shared_ptr<const GridSource> source_;
};

}  // namespace curvisplat
