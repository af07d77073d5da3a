#include "preprocess/formats/netcdf/netcdf_structure.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cstdint>
#include <exception>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "preprocess/formats/common/hdf5_objects.h"
#include "preprocess/formats/netcdf/netcdf_library.h"
#include "stream/base/error.h"

namespace curvisplat {
namespace {

constexpr uint64_t kBlock = 1 << 16;

/// Reads the big-endian numbers of a header in sequence.
class HeaderCursor {
 public:
  explicit HeaderCursor(const InputFile& file) : file_(file) {}

  uint64_t number(size_t bytes) {
    uint64_t value = 0;
    for (size_t n = 0; n < bytes; ++n) value = value << 8 | next();
    return value;
  }

  /// Skips `bytes`, rounded up to a multiple of 4.
  void skip(uint64_t bytes) {
    if (bytes > file_.size() - position_) end();
    position_ += bytes;
    while (position_ % 4 != 0) next();
  }

  [[noreturn]] void damaged(const char* what) const {
    throw Error("{}: its NetCDF header has {} before byte {}; the file is damaged: copy or write it again",
                file_.path().string(), what, position_);
  }

 private:
  uint8_t next() {
    if (position_ == file_.size()) end();
    if (position_ / kBlock != block_number_) {
      block_number_ = position_ / kBlock;
      block_.resize(std::min(kBlock, file_.size() - block_number_ * kBlock));
      file_.readAt(block_number_ * kBlock, std::span<uint8_t>(block_));
    }
    return block_[position_++ % kBlock];
  }

  [[noreturn]] void end() const {
    throw Error("{}: ends at byte {}, inside its NetCDF header; it is truncated: copy or write it again",
                file_.path().string(), file_.size());
  }

  const InputFile& file_;
  uint64_t position_ = 0;
  uint64_t block_number_ = ~uint64_t{0};
  std::vector<uint8_t> block_;
};

struct Variable {
  double record_bytes;  // of one record, or of the whole variable if it has no records
  double begin;
  bool in_records;
};

class Header {
 public:
  explicit Header(const InputFile& file) : cursor_(file) {
    cursor_.number(3);  // "CDF"
    version_ = cursor_.number(1);
    count_bytes_ = version_ == 5 ? 8 : 4;
    offset_bytes_ = version_ == 1 ? 4 : 8;
    records_ = count();
    const bool unknown = records_ == (count_bytes_ == 4 ? 0xffffffffu : ~uint64_t{0});
    for (uint64_t n = listed(0x0a); n > 0; --n) {
      skipName();
      dimensions_.push_back(count());
    }
    skipAttributes();
    for (uint64_t n = listed(0x0b); n > 0; --n) readVariable();
    if (unknown) records_ = recordsIn(static_cast<double>(file.size()));
  }

  uint64_t records() const { return records_; }

  /// The end of the last value.
  double bytes() const {
    const double record = recordBytes();
    double end = 0;
    for (const Variable& variable : variables_) {
      if (variable.in_records && records_ == 0) continue;
      const double before = variable.in_records ? static_cast<double>(records_ - 1) * record : 0;
      end = std::max(end, variable.begin + before + variable.record_bytes);
    }
    return end;
  }

 private:
  static double padded(double bytes) {
    return static_cast<double>((static_cast<uint64_t>(std::min(bytes, 1e18)) + 3) / 4 * 4);
  }

  /// The bytes of a record of all variables together.
  double recordBytes() const {
    const auto in_records = [](const Variable& variable) { return variable.in_records; };
    const bool one = std::count_if(variables_.begin(), variables_.end(), in_records) == 1;
    double bytes = 0;
    for (const Variable& variable : variables_)
      if (variable.in_records) bytes += one ? variable.record_bytes : padded(variable.record_bytes);
    return bytes;
  }

  /// The number of complete records in a file that is still being written, whose header does not count them.
  uint64_t recordsIn(double file_bytes) const {
    double begin = file_bytes;  // of the first record
    for (const Variable& variable : variables_)
      if (variable.in_records) begin = std::min(begin, variable.begin);
    const double record = recordBytes();
    return record > 0 ? static_cast<uint64_t>(std::max(0.0, file_bytes - begin) / record) : 0;
  }

  uint64_t count() { return cursor_.number(count_bytes_); }
  void skipName() {
    const uint64_t characters = count();
    // The library copies longer ones beyond its callers' buffers.
    if (characters > NC_MAX_NAME) cursor_.damaged("a name longer than 256 characters");
    cursor_.skip(characters);
  }

  /// The number of entries of a list; the list may be absent.
  uint64_t listed(uint64_t tag) {
    const uint64_t found = cursor_.number(4), entries = count();
    if (found != tag && !(found == 0 && entries == 0)) cursor_.damaged("an unknown list tag");
    return entries;
  }

  uint64_t typeBytes() {
    constexpr std::array<uint64_t, 12> kBytes{0, 1, 1, 2, 4, 4, 8, 1, 2, 4, 8, 8};  // byte, char, short, ...
    const uint64_t type = cursor_.number(4);
    if (type == 0 || type >= kBytes.size()) cursor_.damaged("an unknown type");
    return kBytes[type];
  }

  void skipAttributes() {
    for (uint64_t n = listed(0x0c); n > 0; --n) {
      skipName();
      const uint64_t bytes = typeBytes(), values = count();
      if (values > uint64_t{1} << 40) cursor_.damaged("an attribute of impossible length");
      cursor_.skip(values * bytes);
    }
  }

  void readVariable() {
    Variable variable{1, 0, false};
    skipName();
    const uint64_t dimensions = count();
    for (uint64_t n = 0; n < dimensions; ++n) {
      const uint64_t id = count();
      if (id >= dimensions_.size()) cursor_.damaged("an unknown dimension");
      if (n == 0 && dimensions_[id] == 0)
        variable.in_records = true;
      else
        variable.record_bytes *= static_cast<double>(dimensions_[id]);
    }
    skipAttributes();
    variable.record_bytes *= static_cast<double>(typeBytes());
    count();  // vsize: redundant, and wrong for large variables
    variable.begin = static_cast<double>(cursor_.number(offset_bytes_));
    variables_.push_back(variable);
  }

  HeaderCursor cursor_;
  uint64_t version_ = 0, records_ = 0;
  size_t count_bytes_ = 4, offset_bytes_ = 4;
  std::vector<uint64_t> dimensions_;  // lengths; 0: the record dimension
  std::vector<Variable> variables_;
};

}  // namespace

uint64_t checkClassicNetcdf(const InputFile& file) {
  const Header header(file);
  const double bytes = header.bytes();
  if (bytes > static_cast<double>(file.size()))
    throw Error("{}: is truncated or damaged (found {} bytes, expected {:.0f}); copy or write it again",
                file.path().string(), file.size(), bytes);
  return header.records();
}

namespace {

constexpr int kMaxDepth = 100;
constexpr size_t kMaxNameBytes = 4096;
// Smallest size of an object in a file: a link and an object header.
constexpr uint64_t kMinObjectBytes = 32;
constexpr uint64_t kSmallFileObjects = 4096;

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
