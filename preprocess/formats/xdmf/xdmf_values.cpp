#include "preprocess/formats/xdmf/xdmf_values.h"

#include <algorithm>
#include <array>

#include "preprocess/formats/common/array_boxes.h"
#include "preprocess/formats/common/byte_source.h"
#include "stream/base/error.h"

namespace curvisplat {
namespace {

// Strided numbers: runs this long, or this far apart, are read one by one; others through a window.
constexpr size_t kDirect = 4 << 10, kWindow = 32 << 10;

class BinaryValues final : public XdmfValues {
 public:
  BinaryValues(const XdmfBinary& binary, std::vector<uint64_t> dims)
      : XdmfValues(std::move(dims), binary.file->name()), binary_(binary) {
    const uint64_t bytes = size() * static_cast<uint64_t>(binary.bytes);
    if (binary.seek > binary.file->size() || bytes > binary.file->size() - binary.seek)
      throw Error("{}: {} has {} bytes; expected {} from byte {} on; the file is truncated", binary.where,
                  binary.file->name(), binary.file->size(), bytes, binary.seek);
  }

  int valueBytes() const override { return binary_.kind == 'f' && binary_.bytes == 4 ? 4 : 8; }

  void read(uint64_t first, std::span<double> to) const override {
    constexpr size_t kMax = 32 << 10;
    const auto width = static_cast<size_t>(binary_.bytes);
    std::vector<std::byte> bytes(std::min(to.size(), kMax) * width);
    for (size_t done = 0; done < to.size(); done += kMax) {
      const std::span<double> part = to.subspan(done, std::min(kMax, to.size() - done));
      binary_.file->readAt(binary_.seek + (first + done) * width,
                           std::span(bytes).first(part.size() * width));
      convert(bytes.data(), part);
    }
  }

 private:
  void convert(const std::byte* from, std::span<double> to) const {
    const auto as = [&](auto stored) {
      convertStored<decltype(stored)>(from, to.size(), binary_.swap, to.data());
    };
    const bool sign = binary_.kind == 'i';
    if (binary_.kind == 'f') return binary_.bytes == 4 ? as(float{}) : as(double{});
    if (binary_.bytes == 1) return sign ? as(int8_t{}) : as(uint8_t{});
    if (binary_.bytes == 2) return sign ? as(int16_t{}) : as(uint16_t{});
    if (binary_.bytes == 4) return sign ? as(int32_t{}) : as(uint32_t{});
    return sign ? as(int64_t{}) : as(uint64_t{});
  }

  XdmfBinary binary_;
};

class InlineValues final : public XdmfValues {
 public:
  InlineValues(std::vector<double> numbers, std::vector<uint64_t> dims, const std::string& where)
      : XdmfValues(std::move(dims), where), numbers_(std::move(numbers)) {
    if (numbers_.size() != size())
      throw Error("{}: has {} numbers; expected {} by its dimensions", where, numbers_.size(), size());
  }
  int valueBytes() const override { return 8; }
  void read(uint64_t first, std::span<double> to) const override {
    std::copy_n(numbers_.begin() + static_cast<ptrdiff_t>(first), to.size(), to.begin());
  }

 private:
  std::vector<double> numbers_;
};

class SlabValues final : public XdmfValues {
 public:
  SlabValues(std::shared_ptr<const XdmfValues> all, XdmfSlab slab, const std::string& where)
      : XdmfValues(slab.count, where), all_(std::move(all)), slab_(std::move(slab)) {
    const std::vector<uint64_t>& dims = all_->dims();
    bool fits = dims.size() == slab_.start.size();
    for (size_t d = 0; fits && d < dims.size(); ++d)
      fits = slab_.stride[d] > 0 && slab_.count[d] > 0 && slab_.start[d] < dims[d] &&
             slab_.count[d] - 1 <= (dims[d] - 1 - slab_.start[d]) / slab_.stride[d];
    if (!fits) throw Error("{}: selects a part that its DataItem does not have", where);
    for (size_t d = 0; d < dims.size(); ++d)
      if (slab_.count[d] == 1) slab_.stride[d] = 1;
  }

  int valueBytes() const override { return all_->valueBytes(); }

  void read(uint64_t first, std::span<double> to) const override {
    size_t done = 0;
    forEachArrayBox(dims(), first, to.size(),
                    [&](std::span<const uint64_t> from, std::span<const uint64_t> count) {
                      const auto values = static_cast<size_t>(arrayProduct(count));
                      readPart({{from.begin(), from.end()},
                                std::vector<uint64_t>(from.size(), 1),
                                {count.begin(), count.end()}},
                               to.subspan(done, values));
                      done += values;
                    });
  }

  void readPart(const XdmfSlab& part, std::span<double> to) const override {
    XdmfSlab of_all = part;
    for (size_t d = 0; d < part.count.size(); ++d) {
      of_all.start[d] = slab_.start[d] + slab_.stride[d] * part.start[d];
      of_all.stride[d] = part.count[d] == 1 ? 1 : slab_.stride[d] * part.stride[d];
    }
    all_->readPart(of_all, to);
  }

 private:
  std::shared_ptr<const XdmfValues> all_;
  XdmfSlab slab_;
};

std::vector<uint64_t> joinedDims(const std::vector<std::shared_ptr<const XdmfValues>>& parts) {
  std::vector<uint64_t> dims = parts.at(0)->dims();
  dims.push_back(parts.size());
  return dims;
}

class JoinedValues final : public XdmfValues {
 public:
  JoinedValues(std::vector<std::shared_ptr<const XdmfValues>> parts, const std::string& where)
      : XdmfValues(joinedDims(parts), where), parts_(std::move(parts)) {
    for (const auto& part : parts_)
      if (part->size() != parts_[0]->size())
        throw Error("{}: joins {} numbers and {}; expected as many of each", where, parts_[0]->size(),
                    part->size());
  }

  int valueBytes() const override {
    int bytes = 0;
    for (const auto& part : parts_) bytes = std::max(bytes, part->valueBytes());
    return bytes;
  }

  void read(uint64_t first, std::span<double> to) const override {
    constexpr uint64_t kTuples = 8 << 10;
    const uint64_t count = parts_.size(), end = first + to.size();
    std::vector<double> values;
    for (uint64_t at = first; at < end;) {
      const uint64_t tuple = at / count, tuples = std::min(kTuples, (end - 1) / count + 1 - tuple);
      const uint64_t next = std::min(end, (tuple + tuples) * count);
      values.resize(static_cast<size_t>(tuples));
      for (uint64_t part = 0; part < count; ++part) {
        parts_[part]->read(tuple, values);
        for (uint64_t n = 0; n < tuples; ++n)
          if (const uint64_t place = (tuple + n) * count + part; place >= at && place < next)
            to[place - first] = values[n];
      }
      at = next;
    }
  }

 private:
  std::vector<std::shared_ptr<const XdmfValues>> parts_;
};

}  // namespace

XdmfValues::XdmfValues(std::vector<uint64_t> dims, const std::string& where) : dims_(std::move(dims)) {
  for (const uint64_t n : dims_) {
    if (n == 0 || size_ > kMaxArrayValues / n)
      throw Error("{}: has impossible dimensions; the file is damaged", where);
    size_ *= n;
  }
  if (dims_.empty() || dims_.size() > kMaxArrayRank)
    throw Error("{}: has {} dimensions; expected one or more", where, dims_.size());
}

/// Numbers that follow one another are read into place; others through a window on the array, which moves forward only.
void XdmfValues::readPart(const XdmfSlab& part, std::span<double> to) const {
  const size_t rank = dims_.size();
  std::array<uint64_t, kMaxArrayRank> index{}, pitch{};
  uint64_t source = 0, along = 1;
  for (size_t d = rank; d-- > 0; along *= dims_[d]) {
    pitch[d] = along;
    source += along * part.start[d];
  }
  // Whole rows, whole planes, ... and a part of the dimension before them.
  size_t outer = rank;
  uint64_t run = 1;
  while (outer > 0 && part.stride[outer - 1] == 1) {
    run *= part.count[--outer];
    if (part.count[outer] != dims_[outer]) break;
  }
  uint64_t last = source + run - 1, gap = 0;
  for (size_t d = outer; d-- > 0;) {
    if (gap == 0 && part.count[d] > 1) gap = pitch[d] * part.stride[d];
    last += pitch[d] * part.stride[d] * (part.count[d] - 1);
  }
  const bool direct = run >= kDirect || gap >= kDirect;
  std::vector<double> window;
  uint64_t begin = 0;
  for (uint64_t done = 0; done < to.size(); done += run) {
    const std::span<double> into = to.subspan(done, run);
    if (direct) {
      read(source, into);
    } else {
      if (source < begin || source + run > begin + window.size()) {
        begin = source;
        window.resize(static_cast<size_t>(std::min<uint64_t>(kWindow, last + 1 - begin)));
        read(begin, window);
      }
      std::copy_n(window.begin() + static_cast<ptrdiff_t>(source - begin), run, into.begin());
    }
    for (size_t d = outer; d-- > 0;) {
      source += pitch[d] * part.stride[d];
      if (++index[d] < part.count[d]) break;
      source -= pitch[d] * part.stride[d] * part.count[d];
      index[d] = 0;
    }
  }
}

std::shared_ptr<const XdmfValues> openXdmfBinary(const XdmfBinary& binary, std::vector<uint64_t> dims) {
  return std::make_shared<BinaryValues>(binary, std::move(dims));
}

std::shared_ptr<const XdmfValues> xdmfInline(std::vector<double> numbers, std::vector<uint64_t> dims,
                                             const std::string& where) {
  return std::make_shared<InlineValues>(std::move(numbers), std::move(dims), where);
}

std::shared_ptr<const XdmfValues> xdmfJoined(std::vector<std::shared_ptr<const XdmfValues>> parts,
                                             const std::string& where) {
  return std::make_shared<JoinedValues>(std::move(parts), where);
}

std::shared_ptr<const XdmfValues> xdmfHyperslab(std::shared_ptr<const XdmfValues> all, XdmfSlab slab,
                                                const std::string& where) {
  return std::make_shared<SlabValues>(std::move(all), std::move(slab), where);
}

}  // namespace curvisplat
