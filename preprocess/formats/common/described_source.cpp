#include "preprocess/formats/common/described_source.h"

#include <utility>

#include "preprocess/grid/box_source.h"
#include "preprocess/mesh/forwarding_mesh.h"
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

class DescribedGrid final : public ForwardingGrid {
 public:
  DescribedGrid(std::unique_ptr<GridSource> source, GridDescription description, ErrorText text)
      : ForwardingGrid(std::move(source)), text_(std::move(text)) {
    description_ = std::move(description);
  }

  void read(uint32_t block, const NodeBox& box, std::span<const uint32_t> scalars,
            NodeArrays& out) const override {
    withText(text_, [&] { ForwardingGrid::read(block, box, scalars, out); });
  }
  bool readFringe(uint32_t block, const NodeBox& box, std::vector<uint8_t>& out) const override {
    return withText(text_, [&] { return ForwardingGrid::readFringe(block, box, out); });
  }

 private:
  ErrorText text_;
};

class DescribedMesh final : public ForwardingMesh {
 public:
  DescribedMesh(std::unique_ptr<MeshSource> source, GridDescription description, ErrorText text)
      : ForwardingMesh(std::move(source)), text_(std::move(text)) {
    description_ = std::move(description);
  }

  void readPoints(uint32_t piece, uint64_t first, uint64_t count, std::span<const uint32_t> scalars,
                  MeshPoints& out) const override {
    withText(text_, [&] { ForwardingMesh::readPoints(piece, first, count, scalars, out); });
  }
  void readCells(uint32_t piece, uint64_t first, uint64_t count, std::span<const uint32_t> scalars,
                 MeshCells& out) const override {
    withText(text_, [&] { ForwardingMesh::readCells(piece, first, count, scalars, out); });
  }
  void prepare(std::span<const uint32_t> scalars, uint64_t memory_bytes,
               const Progress& progress) const override {
    withText(text_, [&] { ForwardingMesh::prepare(scalars, memory_bytes, progress); });
  }

 private:
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
