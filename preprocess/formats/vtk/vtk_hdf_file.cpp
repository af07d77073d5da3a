#include "preprocess/formats/vtk/vtk_hdf_file.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <utility>

#include "preprocess/formats/common/hdf5_objects.h"
#include "preprocess/formats/common/library_trial.h"
#include "stream/base/error.h"

namespace curvisplat {
namespace {

constexpr size_t kMaxNames = 100'000, kMaxTextBytes = 4096;
// Sums of kMaxVtkPieces of them stay below 2^64.
constexpr double kMaxCount = 1e14;
// No filter packs numbers more tightly than this, but the emptiest of arrays.
constexpr uint64_t kMaxPacking = 65536, kSmall = uint64_t{1} << 20;

using Hdf5Object = Hdf5Handle<H5Oclose>;

/// A part of an HDF5 array as bytes.
class Hdf5Bytes final : public ByteSource {
 public:
  Hdf5Bytes(std::shared_ptr<const Hdf5Array> array, uint64_t first, uint64_t values)
      : array_(std::move(array)), first_(first), values_(values) {}

  uint64_t size() const override { return values_ * array_->bytes(); }
  void readAt(uint64_t offset, std::span<std::byte> to) const override {
    array_->readStored(first_ + offset / array_->bytes(), to);
  }

 private:
  std::shared_ptr<const Hdf5Array> array_;
  uint64_t first_ = 0, values_ = 0;
};

VtkType typeOf(const Hdf5Array& array) {
  if (array.isFloat()) return array.bytes() == 4 ? VtkType::kFloat32 : VtkType::kFloat64;
  switch (array.bytes()) {
    case 1:
      return array.isSigned() ? VtkType::kInt8 : VtkType::kUint8;
    case 2:
      return array.isSigned() ? VtkType::kInt16 : VtkType::kUint16;
    case 4:
      return array.isSigned() ? VtkType::kInt32 : VtkType::kUint32;
    default:
      return array.isSigned() ? VtkType::kInt64 : VtkType::kUint64;
  }
}

}  // namespace

VtkArray vtkArrayOf(std::string name, std::shared_ptr<const Hdf5Array> array, uint64_t first, uint64_t tuples,
                    uint32_t components) {
  VtkArray of;
  of.name = std::move(name);
  of.type = typeOf(*array);
  of.components = components;
  of.tuples = tuples;
  of.order = kMachineByteOrder;
  of.bytes = std::make_shared<Hdf5Bytes>(std::move(array), first, tuples * components);
  return of;
}

VtkHdfFile::VtkHdfFile(std::filesystem::path path) : path_(std::move(path)) {
  tryHdf5(path_);
  const QuietHdf5 quiet;
  file_ = Hdf5File(H5Fopen(path_.c_str(), H5F_ACC_RDONLY, H5P_DEFAULT));
  if (!file_)
    fail("/", "cannot be read (HDF5: " + hdf5Reason() + "); the file is damaged: copy or write it again");
}

VtkHdfFile::~VtkHdfFile() {
  const QuietHdf5 quiet;
  file_ = Hdf5File();
}

void VtkHdfFile::fail(const std::string& place, const std::string& what) const {
  throw Error("{}: {}: {}", name(), place, what);
}

std::optional<uint64_t> VtkHdfFile::identity(const std::string& place) const {
  const QuietHdf5 quiet;
  const Hdf5Object object(H5Oopen(file_.id(), place.c_str(), H5P_DEFAULT));
  H5O_info_t info;
  if (!object || H5Oget_info2(object.id(), &info, H5O_INFO_BASIC) < 0) return std::nullopt;
  return info.addr;
}

std::vector<std::string> VtkHdfFile::names(const std::string& group) const {
  const QuietHdf5 quiet;
  const Hdf5Group open(H5Gopen2(file_.id(), group.c_str(), H5P_DEFAULT));
  if (!open) return {};
  const auto links = linksOf(open.id());
  if (!links) fail(group, "its list of objects cannot be read; the file is damaged: copy or write it again");
  if (links->size() > kMaxNames)
    fail(group, fmt::format("has {} objects; expected {} at most", links->size(), kMaxNames));
  std::vector<std::string> names;
  for (const Hdf5Link& link : *links) names.push_back(link.name);
  return names;
}

std::vector<double> VtkHdfFile::numbers(const std::string& group, const char* attribute, size_t count) const {
  const QuietHdf5 quiet;
  const Hdf5Attribute open(H5Aopen_by_name(file_.id(), group.c_str(), attribute, H5P_DEFAULT, H5P_DEFAULT));
  const auto shape = shapeOf(open);
  std::vector<double> values(count);
  if (!shape || (shape->kind != H5T_INTEGER && shape->kind != H5T_FLOAT) || shape->values != count ||
      H5Aread(open.id(), H5T_NATIVE_DOUBLE, values.data()) < 0)
    fail(group, fmt::format("has {} as attribute {}; expected {} numbers",
                            shape ? shape->describe() : "nothing", attribute, count));
  return values;
}

bool VtkHdfFile::hasAttribute(const std::string& group, const char* attribute) const {
  const QuietHdf5 quiet;
  return H5Aexists_by_name(file_.id(), group.c_str(), attribute, H5P_DEFAULT) > 0;
}

std::string VtkHdfFile::text(const std::string& group, const char* attribute) const {
  const QuietHdf5 quiet;
  const Hdf5Attribute open(H5Aopen_by_name(file_.id(), group.c_str(), attribute, H5P_DEFAULT, H5P_DEFAULT));
  if (!open) return "";
  const auto shape = shapeOf(open);
  if (!shape || shape->kind != H5T_STRING || shape->values != 1 || shape->value_bytes > kMaxTextBytes)
    fail(group, fmt::format("has {} as attribute {}; expected a text", shape ? shape->describe() : "nothing",
                            attribute));
  const Hdf5Type type(H5Aget_type(open.id()));
  std::string text(shape->value_bytes, '\0');
  if (shape->variable_string) {
    const Hdf5Space space(H5Aget_space(open.id()));
    char* characters = nullptr;
    if (H5Aread(open.id(), type.id(), &characters) < 0 || !characters) return "";
    text.assign(characters, strnlen(characters, kMaxTextBytes));
    H5Dvlen_reclaim(type.id(), space.id(), H5P_DEFAULT, &characters);
  } else if (H5Aread(open.id(), type.id(), text.data()) < 0) {
    fail(group,
         fmt::format("attribute {} cannot be read (HDF5: {}); the file is damaged", attribute, hdf5Reason()));
  }
  text.resize(std::min(text.find('\0'), text.size()));
  return text;
}

std::shared_ptr<const Hdf5Array> VtkHdfFile::array(const std::string& place) const {
  if (const auto known = arrays_.find(place); known != arrays_.end()) return known->second;
  if (!has(place)) return nullptr;
  auto found = std::make_shared<const Hdf5Array>(sets_, path_, place);
  const uint64_t bytes = found->size() * found->bytes(), stored = found->storedBytes();
  if (bytes > kSmall && bytes / kMaxPacking > stored)
    fail(place,
         fmt::format(
             "states {} values, more than its {} bytes can hold; the file is damaged, or was never completed",
             found->size(), stored));
  return arrays_.emplace(place, std::move(found)).first->second;
}

std::shared_ptr<const Hdf5Array> VtkHdfFile::required(const std::string& place) const {
  auto of = array(place);
  if (!of) fail(place, "is missing; the file is damaged, or was never completed");
  return of;
}

VtkArray VtkHdfFile::tuples(const std::string& place, uint64_t first, uint64_t tuples) const {
  auto of = required(place);
  const uint64_t rows = of->dims().front(), components = rows == 0 ? 1 : of->size() / rows;
  if (first > rows || tuples > rows - first)
    fail(place, fmt::format("has {} tuples; expected {} from number {} on; the file is damaged", rows, tuples,
                            first));
  if (components == 0 || components > kMaxComponents)
    fail(place, fmt::format("has {} components; expected at most {}", components, kMaxComponents));
  return vtkArrayOf(place.substr(place.rfind('/') + 1), std::move(of), first * components, tuples,
                    static_cast<uint32_t>(components));
}

std::vector<int64_t> VtkHdfFile::integers(const std::string& place, uint64_t first, uint64_t count) const {
  const auto of = required(place);
  if (first > of->size() || count > of->size() - first)
    fail(place, fmt::format("has {} numbers; expected {} from number {} on; the file is damaged", of->size(),
                            count, first));
  std::vector<double> values(count);
  of->read(first, values);
  std::vector<int64_t> integers(count);
  for (size_t n = 0; n < count; ++n) {
    if (!(std::abs(values[n]) <= kMaxCount)) fail(place, fmt::format("has {}; expected a count", values[n]));
    integers[n] = static_cast<int64_t>(values[n]);
  }
  return integers;
}

std::vector<uint64_t> VtkHdfFile::counts(const std::string& place, uint64_t first, uint64_t count) const {
  std::vector<uint64_t> counts;
  for (const int64_t value : integers(place, first, count)) {
    if (value < 0) fail(place, fmt::format("has {}; expected a count", value));
    counts.push_back(static_cast<uint64_t>(value));
  }
  return counts;
}

}  // namespace curvisplat
