#include "preprocess/formats/gmsh/gmsh_tags.h"

#include <algorithm>
#include <numeric>
#include <span>

#include "stream/base/error.h"

namespace curvisplat {
namespace {

constexpr uint64_t kTagsAtOnce = 65536, kTableAtOnce = 1 << 20, kMaxGap = 512;

}  // namespace

void GmshTags::finish() {
  const SpooledNumbers tags = tags_.finish();
  if (in_order_ || count_ == 0) return;
  if ((last_ - first_) / 8 > count_ + kTableAtOnce)
    throw Error("{}: numbers its {} from {} to {}, of which it has {}; renumber them in Gmsh (Mesh.Renumber)",
                file_, what_, first_, last_, count_);
  NumberSpool<uint64_t> table(spool_);
  std::vector<uint64_t> part, some;
  for (uint64_t begin = first_; begin <= last_; begin += kTableAtOnce) {
    part.assign(std::min(kTableAtOnce, last_ - begin + 1), kNowhere);
    uint64_t next = 0;
    for (uint64_t n = 0; n < tags.count; n += some.size()) {
      some.resize(std::min(kTagsAtOnce, tags.count - n));
      tags.read(n, std::span(some));
      for (const uint64_t stored : some) {
        next += (stored & kAnother) == 0 ? 1 : 0;
        const uint64_t tag = stored & ~kAnother;
        if (tag >= begin && tag - begin < part.size()) part[tag - begin] = next - 1;
      }
    }
    for (const uint64_t index : part) table.add(index);
  }
  table_ = table.finish();
}

void GmshTags::replace(std::vector<uint64_t>& tags) const {
  if (in_order_) {
    for (uint64_t& tag : tags) tag = tag >= first_ && tag - first_ < count_ ? tag - first_ : kNowhere;
    return;
  }
  std::vector<size_t> order(tags.size());
  std::iota(order.begin(), order.end(), size_t{0});
  std::sort(order.begin(), order.end(), [&](size_t a, size_t b) { return tags[a] < tags[b]; });
  std::vector<uint64_t> run;
  for (size_t from = 0; from < order.size();) {
    size_t to = from + 1;
    while (to < order.size() && tags[order[to]] - tags[order[to - 1]] < kMaxGap) ++to;
    const uint64_t begin = std::max(first_, tags[order[from]]), end = std::min(last_, tags[order[to - 1]]);
    run.resize(begin <= end ? end - begin + 1 : 0);
    table_.read(begin - first_, std::span(run));
    for (; from < to; ++from) {
      uint64_t& tag = tags[order[from]];
      tag = tag >= begin && tag - begin < run.size() ? run[tag - begin] : kNowhere;
    }
  }
}

}  // namespace curvisplat
