#include "preprocess/grid/reordered_source.h"

#include <map>
#include <utility>

#include "stream/base/check.h"

namespace curvisplat {
namespace {

class ReorderedSource final : public GridSource {
 public:
  ReorderedSource(const GridSource& source, std::vector<uint32_t> order)
      : source_(source), order_(std::move(order)), description_(source.description()) {
    const std::vector<GridBlock>& blocks = source.description().blocks;
    CURVISPLAT_CHECK_OP(order_.size(), ==, blocks.size());
    std::vector<uint32_t> places(order_.size());
    for (uint32_t n = 0; n < order_.size(); ++n) {
      description_.blocks[n] = blocks.at(order_[n]);
      places[order_[n]] = n;
    }
    for (GridBoundary& boundary : description_.boundaries) boundary.block = places.at(boundary.block);
    for (FlowConditions& flow : description_.flow) flow.block = places.at(flow.block);
  }

  const GridDescription& description() const override { return description_; }
  void read(uint32_t block, const NodeBox& box, std::span<const uint32_t> scalars,
            NodeArrays& out) const override {
    source_.read(order_.at(block), box, scalars, out);
  }
  void readPartOfRows(uint32_t block, const NodeBox& box, std::span<const uint32_t> scalars,
                      NodeArrays& out) const override {
    source_.readPartOfRows(order_.at(block), box, scalars, out);
  }
  uint64_t rowsInMemory(std::span<const uint32_t> scalars) const override {
    return source_.rowsInMemory(scalars);
  }
  bool readFringe(uint32_t block, const NodeBox& box, std::vector<uint8_t>& out) const override {
    return source_.readFringe(order_.at(block), box, out);
  }

 private:
  const GridSource& source_;
  std::vector<uint32_t> order_;
  GridDescription description_;
};

}  // namespace

std::vector<uint32_t> orderByName(const std::vector<GridBlock>& blocks,
                                  const std::vector<std::string>& names) {
  if (blocks.size() != names.size()) return {};
  std::map<std::string, uint32_t> numbers;
  for (uint32_t n = 0; n < blocks.size(); ++n) numbers.emplace(blocks[n].name, n);
  if (numbers.size() != blocks.size()) return {};
  std::vector<uint32_t> order;
  bool same = true;
  for (uint32_t n = 0; n < names.size(); ++n) {
    const auto found = numbers.find(names[n]);
    if (found == numbers.end()) return {};
    order.push_back(found->second);
    same &= found->second == n;
    numbers.erase(found);
  }
  return same ? std::vector<uint32_t>{} : order;
}

std::unique_ptr<GridSource> reordered(const GridSource& source, std::vector<uint32_t> order) {
  return std::make_unique<ReorderedSource>(source, std::move(order));
}

}  // namespace curvisplat
