#include "preprocess/formats/common/described_source.h"

#include <utility>

#include "stream/base/error.h"

namespace curvisplat {
namespace {

/// Calls `read`; an Error gets another text, unless `text` is empty.
template <typename Read>
auto withText(const ErrorText& text, const Read& read) {
  if (!text) return read();
  try {
    return read();
  } catch (const Error& error) {
    throw Error("{}", text(error.what()));
  }
}

class DescribedGrid final : public GridSource {
 public:
  DescribedGrid(std::unique_ptr<GridSource> source, GridDescription description, ErrorText text)
      : source_(std::move(source)), description_(std::move(description)), text_(std::move(text)) {}

  const GridDescription& description() const override { return description_; }
  void read(uint32_t block, const NodeBox& box, std::span<const uint32_t> scalars,
            NodeArrays& out) const override {
    withText(text_, [&] { source_->read(block, box, scalars, out); });
  }
  void readPartOfRows(uint32_t block, const NodeBox& box, std::span<const uint32_t> scalars,
                      NodeArrays& out) const override {
    withText(text_, [&] { source_->readPartOfRows(block, box, scalars, out); });
  }
  uint64_t rowsInMemory(std::span<const uint32_t> scalars) const override {
    return source_->rowsInMemory(scalars);
  }
  bool readFringe(uint32_t block, const NodeBox& box, std::vector<uint8_t>& out) const override {
    return withText(text_, [&] { return source_->readFringe(block, box, out); });
  }

 private:
  std::unique_ptr<GridSource> source_;
  GridDescription description_;
  ErrorText text_;
};

class DescribedMesh final : public MeshSource {
 public:
  DescribedMesh(std::unique_ptr<MeshSource> source, GridDescription description, ErrorText text)
      : source_(std::move(source)), description_(std::move(description)), text_(std::move(text)) {}

  const GridDescription& description() const override { return description_; }
  bool hasCurvedCells() const override { return source_->hasCurvedCells(); }
  void readPoints(uint32_t piece, uint64_t first, uint64_t count, std::span<const uint32_t> scalars,
                  MeshPoints& out) const override {
    withText(text_, [&] { source_->readPoints(piece, first, count, scalars, out); });
  }
  void readCells(uint32_t piece, uint64_t first, uint64_t count, std::span<const uint32_t> scalars,
                 MeshCells& out) const override {
    withText(text_, [&] { source_->readCells(piece, first, count, scalars, out); });
  }
  void prepare(std::span<const uint32_t> scalars, uint64_t memory_bytes,
               const Progress& progress) const override {
    withText(text_, [&] { source_->prepare(scalars, memory_bytes, progress); });
  }

 private:
  std::unique_ptr<MeshSource> source_;
  GridDescription description_;
  ErrorText text_;
};

}  // namespace

std::unique_ptr<GridSource> described(std::unique_ptr<GridSource> source, GridDescription description,
                                      ErrorText text) {
  return std::make_unique<DescribedGrid>(std::move(source), std::move(description), std::move(text));
}

std::unique_ptr<DataSource> described(std::unique_ptr<DataSource> source, GridDescription description,
                                      ErrorText text) {
  if (auto* const mesh = dynamic_cast<MeshSource*>(source.get())) {
    source.release();
    return std::make_unique<DescribedMesh>(std::unique_ptr<MeshSource>(mesh), std::move(description),
                                           std::move(text));
  }
  std::unique_ptr<GridSource> grid(dynamic_cast<GridSource*>(source.release()));
  return described(std::move(grid), std::move(description), std::move(text));
}

}  // namespace curvisplat
