#include "preprocess/formats/xdmf/xdmf_values.h"

#include <hdf5.h>

#include <algorithm>
#include <array>
#include <functional>
#include <numeric>

#include "preprocess/formats/common/hdf5_attribute.h"
#include "preprocess/formats/common/hdf5_handle.h"
#include "preprocess/formats/common/hdf5_trial.h"
#include "preprocess/formats/common/stored_values.h"
#include "stream/base/error.h"

namespace curvisplat {
namespace {

constexpr uint64_t kMaxValues = uint64_t{1} << 48;

/// Splits a range of numbers into boxes of an array of the given dimensions, and calls use(first, count) for each, in their
/// order.
using UseBox = std::function<void(std::span<const hsize_t> first, std::span<const hsize_t> count)>;
void forEachBox(std::span<const hsize_t> dims, uint64_t begin, uint64_t count, const UseBox& use) {
  const size_t rank = dims.size();
  std::array<hsize_t, H5S_MAX_RANK> first{}, along{};
  while (count > 0) {
    uint64_t rest = begin;
    for (size_t d = rank; d-- > 0;) {
      first[d] = rest % dims[d];
      rest /= dims[d];
      along[d] = 1;
    }
    // The largest box that begins here: whole rows, whole planes, ... as far as the range goes.
    uint64_t block = 1;
    for (size_t d = rank; d-- > 0;) {
      const uint64_t most = std::min<uint64_t>(dims[d] - first[d], count / block);
      if (most == 0) break;
      along[d] = most;
      const bool whole = most == dims[d];
      block *= most;
      if (!whole) break;
    }
    use(std::span(first).first(rank), std::span(along).first(rank));
    begin += block;
    count -= block;
  }
}

class Hdf5Values final : public XdmfValues {
 public:
  Hdf5Values(std::filesystem::path path, std::string name, std::vector<uint64_t> dims)
      : XdmfValues(std::move(dims), path.string() + ": " + name),
        path_(std::move(path)),
        name_(std::move(name)) {
    tryHdf5(path_);
    const QuietHdf5 quiet;
    file_ = Hdf5File(H5Fopen(path_.c_str(), H5F_ACC_RDONLY, H5P_DEFAULT));
    if (!file_) fail("is not an HDF5 file, or is damaged");
    set_ = Hdf5DataSet(H5Dopen2(file_.id(), name_.c_str(), H5P_DEFAULT));
    if (!set_) fail("has no such data set");
    const Hdf5Space space(H5Dget_space(set_.id()));
    const Hdf5Type type(H5Dget_type(set_.id()));
    const H5T_class_t kind = type ? H5Tget_class(type.id()) : H5T_NO_CLASS;
    if (kind != H5T_INTEGER && kind != H5T_FLOAT)
      fail(std::string("has values of ") + describe(kind) + "; expected numbers");
    bytes_ = kind == H5T_FLOAT && H5Tget_size(type.id()) <= 4 ? 4 : 8;
    const int rank = space ? H5Sget_simple_extent_ndims(space.id()) : -1;
    if (rank < 1 || rank > H5S_MAX_RANK) fail("has no dimensions; expected an array");
    stored_.resize(static_cast<size_t>(rank));
    H5Sget_simple_extent_dims(space.id(), stored_.data(), nullptr);
    uint64_t values = 1;
    for (const hsize_t n : stored_) values = n > 0 && values > kMaxValues / n ? kMaxValues + 1 : values * n;
    if (values != size())
      fail("has " + std::to_string(values) + " values; the XDMF file says " + std::to_string(size()));
  }
  ~Hdf5Values() override {
    const QuietHdf5 quiet;
    set_ = Hdf5DataSet();
    file_ = Hdf5File();
  }
  Hdf5Values(const Hdf5Values&) = delete;
  Hdf5Values& operator=(const Hdf5Values&) = delete;

  int valueBytes() const override { return bytes_; }

  void read(uint64_t first, std::span<double> to) const override {
    const QuietHdf5 quiet;
    const Hdf5Space space(H5Dget_space(set_.id()));
    double* at = to.data();
    forEachBox(stored_, first, to.size(), [&](std::span<const hsize_t> from, std::span<const hsize_t> count) {
      const hsize_t values =
          std::accumulate(count.begin(), count.end(), hsize_t{1}, [](hsize_t a, hsize_t b) { return a * b; });
      const Hdf5Space memory(H5Screate_simple(1, &values, nullptr));
      if (!space || !memory ||
          H5Sselect_hyperslab(space.id(), H5S_SELECT_SET, from.data(), nullptr, count.data(), nullptr) < 0 ||
          H5Dread(set_.id(), H5T_NATIVE_DOUBLE, memory.id(), space.id(), H5P_DEFAULT, at) < 0)
        fail("cannot be read (HDF5: " + hdf5Reason() + "); the file is damaged");
      at += values;
    });
  }

 private:
  [[noreturn]] void fail(const std::string& what) const {
    throw Error("{}: {}: {}", path_.string(), name_, what);
  }

  std::filesystem::path path_;
  std::string name_;
  Hdf5File file_;
  Hdf5DataSet set_;
  std::vector<hsize_t> stored_;
  int bytes_ = 8;
};

class BinaryValues final : public XdmfValues {
 public:
  BinaryValues(const XdmfBinary& binary, std::vector<uint64_t> dims)
      : XdmfValues(std::move(dims), binary.file->name()), binary_(binary) {
    const uint64_t bytes = size() * static_cast<uint64_t>(binary.bytes);
    if (binary.seek > binary.file->size() || bytes > binary.file->size() - binary.seek)
      throw Error("{}: has {} bytes; expected {} from byte {} on; the file is truncated", binary.file->name(),
                  binary.file->size(), bytes, binary.seek);
  }

  int valueBytes() const override { return binary_.kind == 'f' && binary_.bytes == 4 ? 4 : 8; }

  void read(uint64_t first, std::span<double> to) const override {
    constexpr size_t kMost = 32 << 10;
    const auto width = static_cast<size_t>(binary_.bytes);
    std::vector<std::byte> bytes(std::min(to.size(), kMost) * width);
    for (size_t done = 0; done < to.size(); done += kMost) {
      const std::span<double> part = to.subspan(done, std::min(kMost, to.size() - done));
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
  }

  int valueBytes() const override { return all_->valueBytes(); }

  void read(uint64_t first, std::span<double> to) const override {
    const size_t rank = slab_.count.size();
    const uint64_t row = slab_.count[rank - 1], step = slab_.stride[rank - 1];
    std::vector<double> spread;
    for (size_t done = 0; done < to.size();) {
      const uint64_t at = first + done, column = at % row;
      const auto count = static_cast<size_t>(std::min<uint64_t>(row - column, to.size() - done));
      uint64_t rest = at / row, source = 0, pitch = 1;
      for (size_t d = rank; d-- > 0;) {
        const uint64_t index = d == rank - 1 ? column : rest % slab_.count[d];
        if (d != rank - 1) rest /= slab_.count[d];
        source += pitch * (slab_.start[d] + slab_.stride[d] * index);
        pitch *= all_->dims()[d];
      }
      if (step == 1) {
        all_->read(source, to.subspan(done, count));
      } else {
        spread.resize((count - 1) * step + 1);
        all_->read(source, spread);
        for (size_t n = 0; n < count; ++n) to[done + n] = spread[n * step];
      }
      done += count;
    }
  }

 private:
  std::shared_ptr<const XdmfValues> all_;
  XdmfSlab slab_;
};

}  // namespace

XdmfValues::XdmfValues(std::vector<uint64_t> dims, const std::string& where) : dims_(std::move(dims)) {
  for (const uint64_t n : dims_) {
    if (n == 0 || size_ > kMaxValues / n)
      throw Error("{}: has impossible dimensions; the file is damaged", where);
    size_ *= n;
  }
  if (dims_.empty() || dims_.size() > H5S_MAX_RANK)
    throw Error("{}: has {} dimensions; expected one or more", where, dims_.size());
}

std::shared_ptr<const XdmfValues> openXdmfHdf5(const std::filesystem::path& file, const std::string& name,
                                               std::vector<uint64_t> dims) {
  return std::make_shared<Hdf5Values>(file, name, std::move(dims));
}

std::shared_ptr<const XdmfValues> openXdmfBinary(const XdmfBinary& binary, std::vector<uint64_t> dims) {
  return std::make_shared<BinaryValues>(binary, std::move(dims));
}

std::shared_ptr<const XdmfValues> xdmfInline(std::vector<double> numbers, std::vector<uint64_t> dims,
                                             const std::string& where) {
  return std::make_shared<InlineValues>(std::move(numbers), std::move(dims), where);
}

std::shared_ptr<const XdmfValues> xdmfHyperslab(std::shared_ptr<const XdmfValues> all, XdmfSlab slab,
                                                const std::string& where) {
  return std::make_shared<SlabValues>(std::move(all), std::move(slab), where);
}

}  // namespace curvisplat
