#include "preprocess/formats/common/hdf5_contents.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <string_view>
#include <utility>

#include "preprocess/formats/common/hdf5_objects.h"
#include "preprocess/formats/common/library_trial.h"
#include "stream/base/error.h"
#include "stream/base/file.h"

namespace curvisplat {
namespace {

constexpr size_t kMaxNames = 100'000, kMaxTextBytes = 4096, kMaxDataSetText = 16 << 20;
// Sums of kMaxVtkPieces of them stay below 2^64.
constexpr double kMaxCount = 1e14;
// No filter packs numbers more tightly than this, but the emptiest of arrays.
constexpr uint64_t kMaxPacking = 65536, kSmall = uint64_t{1} << 20;

}  // namespace

std::set<std::string> rootLinksOf(const InputFile& file, std::initializer_list<const char*> names) {
  if (!isHdf5(file)) return {};
  requireWholeHdf5(file);
  tryHdf5(file.path());
  const QuietHdf5 quiet;
  const Hdf5File open(H5Fopen(file.path().c_str(), H5F_ACC_RDONLY, H5P_DEFAULT));
  std::set<std::string> links;
  for (const char* const name : names)
    if (open && H5Lexists(open.id(), name, H5P_DEFAULT) > 0) links.insert(name);
  return links;
}

Hdf5Contents::Hdf5Contents(std::filesystem::path path) : path_(std::move(path)) {
  tryHdf5(path_);
  const QuietHdf5 quiet;
  file_ = Hdf5File(H5Fopen(path_.c_str(), H5F_ACC_RDONLY, H5P_DEFAULT));
  if (!file_)
    fail("/", "cannot be read (HDF5: " + hdf5Reason() + "); the file is damaged: copy or write it again");
}

Hdf5Contents::~Hdf5Contents() {
  const QuietHdf5 quiet;
  file_ = Hdf5File();
}

void Hdf5Contents::fail(const std::string& place, const std::string& what) const {
  throw Error("{}: {}: {}", name(), place, what);
}

std::optional<uint64_t> Hdf5Contents::identity(const std::string& place) const {
  const QuietHdf5 quiet;
  const Hdf5Object object(H5Oopen(file_.id(), place.c_str(), H5P_DEFAULT));
  H5O_info_t info;
  if (!object || H5Oget_info2(object.id(), &info, H5O_INFO_BASIC) < 0) return std::nullopt;
  return info.addr;
}

std::vector<std::string> Hdf5Contents::names(const std::string& group) const {
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

std::vector<double> Hdf5Contents::numbers(const std::string& group, const char* attribute,
                                          size_t count) const {
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

bool Hdf5Contents::hasAttribute(const std::string& group, const char* attribute) const {
  const QuietHdf5 quiet;
  return H5Aexists_by_name(file_.id(), group.c_str(), attribute, H5P_DEFAULT) > 0;
}

std::string Hdf5Contents::text(const std::string& group, const char* attribute) const {
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

std::string Hdf5Contents::textOf(const std::string& place) const {
  const QuietHdf5 quiet;
  const Hdf5DataSet set(H5Dopen2(file_.id(), place.c_str(), H5P_DEFAULT));
  if (!set) return "";
  const Hdf5Space space(H5Dget_space(set.id()));
  const Hdf5Type type(H5Dget_type(set.id()));
  const size_t bytes = type ? H5Tget_size(type.id()) : 0;
  if (!space || !type || H5Tget_class(type.id()) != H5T_STRING || bytes > kMaxDataSetText ||
      H5Sget_simple_extent_npoints(space.id()) != 1)
    fail(place, "is something else than one text");
  std::string text(bytes, '\0');
  char* characters = nullptr;
  const bool variable = H5Tis_variable_str(type.id()) > 0;
  if (H5Dread(set.id(), type.id(), H5S_ALL, H5S_ALL, H5P_DEFAULT,
              variable ? static_cast<void*>(&characters) : static_cast<void*>(text.data())) < 0)
    fail(place, fmt::format("cannot be read (HDF5: {}); the file is damaged", hdf5Reason()));
  if (variable) {
    text = characters ? std::string(characters, strnlen(characters, kMaxDataSetText)) : "";
    H5Dvlen_reclaim(type.id(), space.id(), H5P_DEFAULT, static_cast<void*>(&characters));
  }
  text.resize(std::min(text.find('\0'), text.size()));
  return text;
}

std::shared_ptr<const Hdf5Array> Hdf5Contents::array(const std::string& place) const {
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

std::shared_ptr<const Hdf5Array> Hdf5Contents::required(const std::string& place) const {
  auto of = array(place);
  if (!of) fail(place, "is missing; the file is damaged, or was never completed");
  return of;
}

std::vector<int64_t> Hdf5Contents::integers(const std::string& place, uint64_t first, uint64_t count) const {
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

std::vector<uint64_t> Hdf5Contents::counts(const std::string& place, uint64_t first, uint64_t count) const {
  std::vector<uint64_t> counts;
  for (const int64_t value : integers(place, first, count)) {
    if (value < 0) fail(place, fmt::format("has {}; expected a count", value));
    counts.push_back(static_cast<uint64_t>(value));
  }
  return counts;
}

}  // namespace curvisplat
