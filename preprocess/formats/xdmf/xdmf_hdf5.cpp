#include "preprocess/formats/xdmf/xdmf_hdf5.h"

#include <hdf5.h>

#include <algorithm>
#include <array>

#include "preprocess/formats/common/hdf5_attribute.h"
#include "preprocess/formats/common/hdf5_trial.h"
#include "stream/base/error.h"

namespace curvisplat {
namespace {

/// Three coordinates and a scalar for each of a few threads, which wait for one another in HDF5 anyway.
constexpr size_t kMaxOpen = 16;

class Hdf5Values final : public XdmfValues {
 public:
  Hdf5Values(std::shared_ptr<XdmfHdf5Sets> sets, std::filesystem::path path, std::string name,
             std::vector<uint64_t> dims)
      : XdmfValues(std::move(dims), path.string() + ": " + name),
        sets_(std::move(sets)),
        path_(std::move(path)),
        name_(std::move(name)) {
    sets_->with(path_, name_, [&](hid_t set) {
      const Hdf5Type type(H5Dget_type(set));
      const H5T_class_t kind = type ? H5Tget_class(type.id()) : H5T_NO_CLASS;
      if (kind != H5T_INTEGER && kind != H5T_FLOAT)
        fail(std::string("has values of ") + describe(kind) + "; expected numbers");
      bytes_ = kind == H5T_FLOAT && H5Tget_size(type.id()) <= 4 ? 4 : 8;
      stored_ = extentOf(Hdf5Space(H5Dget_space(set)));
    });
    if (stored_.empty()) fail("has no dimensions; expected an array");
    uint64_t values = 1;
    for (const uint64_t n : stored_)
      values = n > 0 && values > kMaxXdmfValues / n ? kMaxXdmfValues + 1 : values * n;
    if (values != size())
      fail("has " + std::to_string(values) + " values; the XDMF file says " + std::to_string(size()));
    as_stored_ = std::equal(stored_.begin(), stored_.end(), this->dims().begin(), this->dims().end());
  }

  int valueBytes() const override { return bytes_; }

  void read(uint64_t first, std::span<double> to) const override {
    readBoxes([&](const ReadBox& readBox) {
      double* at = to.data();
      forEachXdmfBox(stored_, first, to.size(),
                     [&](std::span<const uint64_t> from, std::span<const uint64_t> count) {
                       readBox({{from.begin(), from.end()},
                                std::vector<uint64_t>(from.size(), 1),
                                {count.begin(), count.end()}},
                               at);
                       at += xdmfProduct(count);
                     });
    });
  }

  /// HDF5 takes steps itself, unless the item cuts the numbers into other dimensions than the file does.
  void readPart(const XdmfSlab& part, std::span<double> to) const override {
    if (!as_stored_) return XdmfValues::readPart(part, to);
    readBoxes([&](const ReadBox& readBox) { readBox(part, to.data()); });
  }

 private:
  using ReadBox = std::function<void(const XdmfSlab&, double*)>;

  static std::vector<uint64_t> extentOf(const Hdf5Space& space) {
    const int rank = space ? H5Sget_simple_extent_ndims(space.id()) : -1;
    if (rank < 1 || rank > H5S_MAX_RANK) return {};
    std::array<hsize_t, H5S_MAX_RANK> extent{};
    H5Sget_simple_extent_dims(space.id(), extent.data(), nullptr);
    return {extent.begin(), extent.begin() + rank};
  }

  /// Opens the data set, and lets use(read) read boxes of it.
  void readBoxes(const std::function<void(const ReadBox&)>& use) const {
    sets_->with(path_, name_, [&](hid_t set) {
      const Hdf5Space space(H5Dget_space(set));
      if (extentOf(space) != stored_) fail("has other dimensions than before; the file has been replaced");
      use([&](const XdmfSlab& box, double* to) {
        const std::vector<hsize_t> from(box.start.begin(), box.start.end()),
            step(box.stride.begin(), box.stride.end()), count(box.count.begin(), box.count.end());
        const hsize_t values = xdmfProduct(box.count);
        const Hdf5Space memory(H5Screate_simple(1, &values, nullptr));
        if (!memory ||
            H5Sselect_hyperslab(space.id(), H5S_SELECT_SET, from.data(), step.data(), count.data(), nullptr) <
                0 ||
            H5Dread(set, H5T_NATIVE_DOUBLE, memory.id(), space.id(), H5P_DEFAULT, to) < 0)
          fail("cannot be read (HDF5: " + hdf5Reason() + "); the file is damaged");
      });
    });
  }

  [[noreturn]] void fail(const std::string& what) const {
    throw Error("{}: {}: {}", path_.string(), name_, what);
  }

  std::shared_ptr<XdmfHdf5Sets> sets_;
  std::filesystem::path path_;
  std::string name_;
  std::vector<uint64_t> stored_;
  bool as_stored_ = false;  // the item has the dimensions of the data set
  int bytes_ = 8;
};

}  // namespace

XdmfHdf5Sets::~XdmfHdf5Sets() {
  const QuietHdf5 quiet;
  open_.clear();
}

bool XdmfHdf5Sets::moveToFront(const std::filesystem::path& path, const std::string& name) {
  const auto found = std::find_if(open_.begin(), open_.end(),
                                  [&](const Open& open) { return open.name == name && open.path == path; });
  if (found == open_.end()) return false;
  open_.splice(open_.begin(), open_, found);
  return true;
}

void XdmfHdf5Sets::with(const std::filesystem::path& path, const std::string& name,
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
    if (open_.size() == kMaxOpen) open_.pop_back();
    open_.push_front({path, name, std::move(file), std::move(set)});
  }
  use(open_.front().set.id());
}

std::shared_ptr<const XdmfValues> openXdmfHdf5(std::shared_ptr<XdmfHdf5Sets> sets,
                                               const std::filesystem::path& file, const std::string& name,
                                               std::vector<uint64_t> dims) {
  return std::make_shared<Hdf5Values>(std::move(sets), file, name, std::move(dims));
}

}  // namespace curvisplat
