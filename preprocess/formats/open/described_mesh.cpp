#include "preprocess/formats/open/described_mesh.h"

#include "stream/base/error.h"

namespace curvisplat {
namespace {

class DescribedMesh final : public MeshSource {
 public:
  DescribedMesh(std::unique_ptr<MeshSource> source, GridDescription description,
                std::function<std::string(std::string)> message)
      : source_(std::move(source)), description_(std::move(description)), message_(std::move(message)) {}

  const GridDescription& description() const override { return description_; }

  void readPoints(uint32_t piece, uint64_t first, uint64_t count, std::span<const uint32_t> scalars,
                  MeshPoints& out) const override {
    translating([&] { source_->readPoints(piece, first, count, scalars, out); });
  }
  void readCells(uint32_t piece, uint64_t first, uint64_t count, std::span<const uint32_t> scalars,
                 MeshCells& out) const override {
    translating([&] { source_->readCells(piece, first, count, scalars, out); });
  }

 private:
  template <typename Read>
  void translating(const Read& read) const {
    if (!message_) return read();
    try {
      read();
    } catch (const Error& error) {
      throw Error("{}", message_(error.what()));
    }
  }

  std::unique_ptr<MeshSource> source_;
  GridDescription description_;
  std::function<std::string(std::string)> message_;
};

}  // namespace

std::unique_ptr<DataSource> describedMesh(std::unique_ptr<DataSource>& source, GridDescription description,
                                          std::function<std::string(std::string)> message) {
  auto* const mesh = dynamic_cast<MeshSource*>(source.get());
  if (!mesh) return nullptr;
  source.release();
  return std::make_unique<DescribedMesh>(std::unique_ptr<MeshSource>(mesh), std::move(description),
                                         std::move(message));
}

}  // namespace curvisplat
