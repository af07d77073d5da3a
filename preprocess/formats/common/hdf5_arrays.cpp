#include "preprocess/formats/common/hdf5_arrays.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <limits>
#include <utility>

#include "preprocess/formats/common/array_boxes.h"
#include "preprocess/formats/common/library_trial.h"
#include "preprocess/formats/common/text_reader.h"
#include "stream/base/error.h"

namespace curvisplat {
namespace {

/// Three coordinates and a scalar for each of a few threads, which wait for one another in HDF5 anyway.
constexpr size_t kMaxOpen = 16;

std::vector<uint64_t> extentOf(const Hdf5Space& space) {
  const int rank = space ? H5Sget_simple_extent_ndims(space.id()) : -1;
  if (rank < 1 || rank > H5S_MAX_RANK) return {};
  std::array<hsize_t, H5S_MAX_RANK> extent{};
  H5Sget_simple_extent_dims(space.id(), extent.data(), nullptr);
  return {extent.begin(), extent.begin() + rank};
}

/// The first filter of a data set that HDF5 does not have on this machine; empty if it has all.
std::string missingFilter(hid_t set) {
  const Hdf5Properties properties(H5Dget_create_plist(set));
  const int count = properties ? H5Pget_nfilters(properties.id()) : 0;
  for (int n = 0; n < count; ++n) {
    std::array<char, 64> name{};
    unsigned flags = 0;
    size_t values = 0;
    const H5Z_filter_t filter = H5Pget_filter2(properties.id(), static_cast<unsigned>(n), &flags, &values,
                                               nullptr, name.size() - 1, name.data(), nullptr);
    if (filter >= 0 && H5Zfilter_avail(filter) <= 0)
      return name[0] != 0 ? printable(name.data()) : fmt::format("{}", filter);
  }
  return "";
}

}  // namespace

Hdf5Sets::~Hdf5Sets() {
  const QuietHdf5 quiet;
  open_.clear();
}

bool Hdf5Sets::moveToFront(const std::filesystem::path& path, const std::string& name) {
  const auto found = std::find_if(open_.begin(), open_.end(),
                                  [&](const Open& open) { return open.name == name && open.path == path; });
  if (found == open_.end()) return false;
  open_.splice(open_.begin(), open_, found);
  return true;
}

void Hdf5Sets::with(const std::filesystem::path& path, const std::string& name,
                    const std::function<void(hid_t)>& use) {
  {
    const QuietHdf5 quiet;
    if (moveToFront(path, name)) return use(open_.front().set.id());
  }
  tryHdf5(path);  // without the mutex
  const QuietHdf5 quiet;
  if (!moveToFront(path, name)) {
    Hdf5File file(H5Fopen(path.c_str(), H5F_ACC_RDONLY, H5P_DEFAULT));
    if (!file) throw Error("{}: {}: is not an HDF5 file, or is damaged", path.string(), name);
    Hdf5DataSet set(H5Dopen2(file.id(), name.c_str(), H5P_DEFAULT));
    if (!set) throw Error("{}: {}: has no such data set", path.string(), name);
    watched_.try_emplace(path, std::vector<std::string>{path.string()});
    if (open_.size() == kMaxOpen) open_.pop_back();
    open_.push_front({path, name, std::move(file), std::move(set)});
  }
  use(open_.front().set.id());
}

Hdf5Array::Hdf5Array(std::shared_ptr<Hdf5Sets> sets, std::filesystem::path path, std::string name)
    : sets_(std::move(sets)), path_(std::move(path)), name_(std::move(name)) {
  sets_->with(path_, name_, [&](hid_t set) {
    const Hdf5Type type(H5Dget_type(set));
    kind_ = type ? H5Tget_class(type.id()) : H5T_NO_CLASS;
    if (kind_ != H5T_INTEGER && kind_ != H5T_FLOAT)
      throw Hdf5NoNumbers("{}: has values of {}; expected numbers", where(), describe(kind_));
    bytes_ = H5Tget_size(type.id());
    bytes_ = isFloat() ? (bytes_ <= 4 ? 4 : 8) : bytes_ <= 2 ? bytes_ : bytes_ <= 4 ? 4 : 8;
    signed_ = kind_ == H5T_FLOAT || H5Tget_sign(type.id()) != H5T_SGN_NONE;
    dims_ = extentOf(Hdf5Space(H5Dget_space(set)));
    for (const uint64_t n : dims_)
      size_ = n > 0 && size_ > kMaxArrayValues / n ? kMaxArrayValues + 1 : size_ * n;
    if (dims_.empty()) fail("has no dimensions; expected an array");
    if (size_ > kMaxArrayValues) fail("has impossible dimensions; the file is damaged");
    stored_bytes_ = isVirtual(Hdf5Properties(H5Dget_create_plist(set))) ? std::numeric_limits<uint64_t>::max()
                                                                        : H5Dget_storage_size(set);
  });
}

/// Only with the mutex held.
hid_t Hdf5Array::memoryType() const {
  if (isFloat()) return bytes_ == 4 ? H5T_NATIVE_FLOAT : H5T_NATIVE_DOUBLE;
  if (bytes_ == 1) return signed_ ? H5T_NATIVE_INT8 : H5T_NATIVE_UINT8;
  if (bytes_ == 2) return signed_ ? H5T_NATIVE_INT16 : H5T_NATIVE_UINT16;
  if (bytes_ == 4) return signed_ ? H5T_NATIVE_INT32 : H5T_NATIVE_UINT32;
  return signed_ ? H5T_NATIVE_INT64 : H5T_NATIVE_UINT64;
}

void Hdf5Array::read(uint64_t first, std::span<double> to) const {
  readRange(As::kDouble, first, to.size(), std::as_writable_bytes(to).data());
}

void Hdf5Array::readStored(uint64_t first, std::span<std::byte> to) const {
  readRange(As::kStored, first, to.size() / bytes_, to.data());
}

void Hdf5Array::readRange(As as, uint64_t first, uint64_t count, std::byte* to) const {
  const size_t value_bytes = as == As::kDouble ? sizeof(double) : bytes_;
  readParts(as, [&](const ReadPart& readPart) {
    forEachArrayBox(dims_, first, count,
                    [&](std::span<const uint64_t> from, std::span<const uint64_t> along) {
                      readPart({{from.begin(), from.end()},
                                std::vector<uint64_t>(from.size(), 1),
                                {along.begin(), along.end()}},
                               to);
                      to += value_bytes * arrayProduct(along);
                    });
  });
}

void Hdf5Array::readPart(const Hdf5Part& part, double* to) const {
  readParts(As::kDouble, [&](const ReadPart& readPart) { readPart(part, to); });
}

/// Opens the data set, and lets use(read) read parts of it.
void Hdf5Array::readParts(As as, const std::function<void(const ReadPart&)>& use) const {
  sets_->with(path_, name_, [&](hid_t set) {
    const Hdf5Space space(H5Dget_space(set));
    if (extentOf(space) != dims_) fail("has other dimensions than before; the file has been replaced");
    use([&](const Hdf5Part& part, void* to) {
      const std::vector<hsize_t> from(part.start.begin(), part.start.end()),
          step(part.stride.begin(), part.stride.end()), count(part.count.begin(), part.count.end());
      const hsize_t values = arrayProduct(part.count);
      const Hdf5Space memory(H5Screate_simple(1, &values, nullptr));
      if (!memory ||
          H5Sselect_hyperslab(space.id(), H5S_SELECT_SET, from.data(), step.data(), count.data(), nullptr) <
              0 ||
          H5Dread(set, as == As::kDouble ? H5T_NATIVE_DOUBLE : memoryType(), memory.id(), space.id(),
                  H5P_DEFAULT, to) < 0) {
        const std::string reason = hdf5Reason();
        if (const std::string filter = missingFilter(set); !filter.empty())
          fail(
              fmt::format("is compressed by the HDF5 filter '{}', which is not installed; write it with "
                          "gzip, or install the filter's "
                          "plugin where HDF5_PLUGIN_PATH names it",
                          filter));
        fail("cannot be read (HDF5: " + reason + "); the file is damaged");
      }
    });
    sets_->requireWhole(path_);
  });
}

void Hdf5Array::fail(const std::string& what) const {
  throw Error("{}: {}", where(), what);
}

}  // namespace curvisplat
