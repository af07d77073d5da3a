#include "preprocess/formats/netcdf/netcdf4_structure.h"

#include <fmt/format.h>
#include <netcdf.h>

#include <array>
#include <exception>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "preprocess/formats/common/hdf5_attribute.h"
#include "preprocess/formats/common/hdf5_lists.h"
#include "stream/base/error.h"

namespace curvisplat {
namespace {

constexpr int kMaxDepth = 100;
constexpr size_t kMaxNameBytes = 4096;
// Smallest size of an object in a file: a link and an object header.
constexpr uint64_t kMinObjectBytes = 32;
constexpr uint64_t kSmallFileObjects = 4096;

using Hdf5Object = Hdf5Handle<H5Oclose>;

class Walk {
 public:
  Walk(const std::filesystem::path& path, const Hdf5File& file) : path_(path) {
    hsize_t bytes = 0;
    if (H5Fget_filesize(file.id(), &bytes) < 0) bytes = 0;
    most_ = kSmallFileObjects + bytes / kMinObjectBytes;
  }

  Netcdf4Structure run(const Hdf5Object& root) {
    checkAttributes(root, "/");
    if (const auto properties = shape(root, "/", "_NCProperties")) {
      if (properties->kind != H5T_STRING || properties->values != 1)
        damaged("/", "_NCProperties", *properties, "one string");
      structure_.netcdf4 = true;
    }
    visitGroup(root, "", 0);
    return structure_;
  }

 private:
  [[noreturn]] void unreadable(const std::string& place, std::string_view what) const {
    throw Error("{}: {}: {} cannot be read (HDF5: {}); the file is damaged: copy or write it again",
                path_.string(), place, what, hdf5Reason());
  }

  void checkAttributes(const Hdf5Object& object, const std::string& place) const {
    if (!attributesAreWhole(object.id())) unreadable(place, "its list of attributes");
  }

  [[noreturn]] void damaged(const std::string& place, const char* attribute, const Hdf5AttributeShape& found,
                            std::string_view expected) const {
    throw Error(
        "{}: {} has an attribute '{}' of {}; expected {}; the file is damaged: copy or write it again",
        path_.string(), place, attribute, found.describe(), expected);
  }

  /// nullopt if there is no such attribute.
  std::optional<Hdf5AttributeShape> shape(const Hdf5Object& object, const std::string& place,
                                          const char* attribute) const {
    if (H5Aexists(object.id(), attribute) <= 0) return std::nullopt;
    const auto found = shapeOf(Hdf5Attribute(H5Aopen(object.id(), attribute, H5P_DEFAULT)));
    if (!found) unreadable(place, fmt::format("attribute '{}'", attribute));
    return found;
  }

  void visitGroup(const Hdf5Object& group, const std::string& place, int depth) {
    if (depth > kMaxDepth)
      throw Error("{}: groups are nested more than {} deep; its links form a cycle, or it is damaged",
                  path_.string(), kMaxDepth);
    if (!linksAreWhole(group.id())) unreadable(place.empty() ? "/" : place, "its list of objects");
    std::vector<std::string> names;
    const auto add = [](hid_t, const char* name, const H5L_info_t*, void* to) -> herr_t {
      try {
        static_cast<std::vector<std::string>*>(to)->push_back(name);
        return 0;
      } catch (const std::exception&) {
        return -1;
      }
    };
    if (H5Literate(group.id(), H5_INDEX_NAME, H5_ITER_NATIVE, nullptr, add, &names) < 0) return;
    objects_ += names.size();
    if (objects_ > most_)
      throw Error("{}: has more than {} objects, more than the file can hold; its links form a cycle",
                  path_.string(), most_);
    for (const std::string& name : names) {
      if (name.size() > NC_MAX_NAME)
        throw Error("{}: {} has an object with a name of {} bytes; NetCDF allows {}: rename it",
                    path_.string(), place.empty() ? "/" : place, name.size(), NC_MAX_NAME);
      const Hdf5Object object(H5Oopen(group.id(), name.c_str(), H5P_DEFAULT));
      if (!object) continue;
      checkAttributes(object, place + "/" + name);
      const H5I_type_t type = H5Iget_type(object.id());
      if (type == H5I_GROUP)
        visitGroup(object, place + "/" + name, depth + 1);
      else if (type == H5I_DATASET)
        visitDataSet(object, place + "/" + name);
    }
  }

  void visitDataSet(const Hdf5Object& set, const std::string& place) {
    const Hdf5Space space(H5Dget_space(set.id()));
    const int rank = space ? H5Sget_simple_extent_ndims(space.id()) : -1;
    if (rank < 0) return;
    const auto dimensions = static_cast<uint64_t>(rank);
    if (const auto list = shape(set, place, "DIMENSION_LIST"))
      if (list->kind != H5T_VLEN || list->element_kind != H5T_REFERENCE || list->values != dimensions)
        damaged(place, "DIMENSION_LIST", *list, fmt::format("{} lists of references", dimensions));
    if (const auto ids = shape(set, place, "_Netcdf4Coordinates"))
      if (ids->kind != H5T_INTEGER || ids->value_bytes != sizeof(int) || ids->values != dimensions)
        damaged(place, "_Netcdf4Coordinates", *ids,
                fmt::format("{} integers of {} bytes", dimensions, sizeof(int)));
    if (const auto id = shape(set, place, "_Netcdf4Dimid"))
      if (id->kind != H5T_INTEGER || id->values != 1) damaged(place, "_Netcdf4Dimid", *id, "one integer");
    const auto kind = shape(set, place, "CLASS");
    if (!kind) return;
    structure_.netcdf4 |= isScale(set, *kind);
    if (const auto name = shape(set, place, "NAME")) checkName(set, place, *name);
  }

  static bool isScale(const Hdf5Object& set, const Hdf5AttributeShape& kind) {
    std::array<char, 64> value{};
    if (kind.kind != H5T_STRING || kind.variable_string || kind.values != 1 ||
        kind.value_bytes >= value.size())
      return false;
    const Hdf5Attribute open(H5Aopen(set.id(), "CLASS", H5P_DEFAULT));
    const Hdf5Type type(open ? H5Aget_type(open.id()) : H5I_INVALID_HID);
    return type && H5Aread(open.id(), type.id(), value.data()) >= 0 &&
           std::string_view(value.data()) == "DIMENSION_SCALE";
  }

  void checkName(const Hdf5Object& set, const std::string& place, const Hdf5AttributeShape& found) const {
    const auto fail = [&] {
      damaged(place, "NAME", found, fmt::format("one terminated string of at most {} bytes", kMaxNameBytes));
    };
    if (found.kind != H5T_STRING || found.variable_string || found.values != 1 ||
        found.value_bytes > kMaxNameBytes)
      fail();
    const Hdf5Attribute name(H5Aopen(set.id(), "NAME", H5P_DEFAULT));
    const Hdf5Type type(name ? H5Aget_type(name.id()) : H5I_INVALID_HID);
    std::string value(found.value_bytes, 'x');
    if (!type || H5Aread(name.id(), type.id(), value.data()) < 0 || value.find('\0') == std::string::npos)
      fail();
  }

  const std::filesystem::path& path_;
  uint64_t most_ = 0, objects_ = 0;
  Netcdf4Structure structure_;
};

}  // namespace

Netcdf4Structure checkNetcdf4Structure(const std::filesystem::path& path) {
  const QuietHdf5 quiet;
  const Hdf5File file(H5Fopen(path.c_str(), H5F_ACC_RDONLY, H5P_DEFAULT));
  const Hdf5Object root(file ? H5Oopen(file.id(), "/", H5P_DEFAULT) : H5I_INVALID_HID);
  if (!root) return {};
  return Walk(path, file).run(root);
}

}  // namespace curvisplat
