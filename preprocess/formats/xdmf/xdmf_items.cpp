#include "preprocess/formats/xdmf/xdmf_items.h"

#include <fmt/format.h>
#include <hdf5.h>

#include <algorithm>
#include <array>
#include <utility>

#include "preprocess/formats/common/byte_source.h"
#include "preprocess/formats/common/hdf5_objects.h"
#include "preprocess/formats/common/library_trial.h"
#include "preprocess/formats/common/text_reader.h"
#include "stream/base/error.h"
#include "stream/base/text.h"

namespace curvisplat {
namespace {

/// Three coordinates and a scalar for each of a few threads, which wait for one another in HDF5 anyway.
constexpr size_t kMaxOpen = 16;

/// The numbers of an HDF5 data set.
class Hdf5Values final : public XdmfValues {
 public:
  /// Throws Error unless the data set has as many numbers as `dims` say.
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

XdmfItems::XdmfItems(const XdmfDocument& document, std::filesystem::path folder)
    : document_(document), folder_(std::move(folder)) {}

std::shared_ptr<const XdmfValues> XdmfItems::readItem(const pugi::xml_node& given, int depth) {
  if (depth > kXdmfMaxDepth)
    throw Error("{}: data items are nested more than {} deep", document_.name(), kXdmfMaxDepth);
  const pugi::xml_node item = document_.resolved(given);
  // Items that many grids refer to are kept once.
  std::shared_ptr<const XdmfValues>& known = items_[item];
  if (!known) known = readNewItem(item, depth);
  return known;
}

std::shared_ptr<const XdmfValues> XdmfItems::readNewItem(const pugi::xml_node& item, int depth) {
  const std::string type = lowerCase(xdmfAttribute(item, {"ItemType", "Type"}));
  if (type == "hyperslab") return readSlab(item, depth);
  if (type == "function") return readFunction(item, depth);
  if (!type.empty() && type != "uniform")
    throw Error("{} is a {}, which is not computed; write its numbers", document_.describe(item),
                printable(type.substr(0, 40)));
  std::vector<uint64_t> dims = document_.countsIn(item, xdmfAttribute(item, {"Dimensions"}));
  const std::string format = lowerCase(xdmfAttribute(item, {"Format"}));
  const std::string text(trimmed(item.text().get()));
  if (format.empty() || format == "xml")
    return xdmfInline(document_.numbersIn(item, text), std::move(dims), document_.describe(item));
  if (format == "hdf") return readHdf5(item, text, std::move(dims));
  if (format == "binary") return readBinary(item, text, std::move(dims));
  throw Error("{} has the format {}; expected XML, HDF or Binary", document_.describe(item),
              printable(format.substr(0, 40)));
}

/// JOIN($0, $1, ...) of all its items in their order: how many programs write vectors.
std::shared_ptr<const XdmfValues> XdmfItems::readFunction(const pugi::xml_node& item, int depth) {
  std::string function = lowerCase(xdmfAttribute(item, {"Function"})), expected;
  std::erase_if(function, [](char c) { return c == ' ' || c == '\t' || c == '\r' || c == '\n'; });
  constexpr size_t kMaxParts = 64;
  std::vector<pugi::xml_node> parts;
  for (const pugi::xml_node part : item.children("DataItem"))
    if (parts.size() < kMaxParts) parts.push_back(part);
  for (size_t n = 0; n < parts.size(); ++n) expected += fmt::format("{}${}", n > 0 ? "," : "join(", n);
  if (parts.empty() || function != expected + ")")
    throw XdmfComputedItem("{} is a function {}, which is not computed; write its numbers",
                           document_.describe(item), printable(function.substr(0, 40)));
  std::vector<std::shared_ptr<const XdmfValues>> joined;
  for (const pugi::xml_node& part : parts) joined.push_back(readItem(part, depth + 1));
  return xdmfJoined(std::move(joined), document_.describe(item));
}

std::shared_ptr<const XdmfValues> XdmfItems::readSlab(const pugi::xml_node& item, int depth) {
  const pugi::xml_node selection = item.child("DataItem"), source = selection.next_sibling("DataItem");
  if (!source) throw Error("{} is a HyperSlab without two data items", document_.describe(item));
  const std::vector<uint64_t> numbers = document_.countsIn(selection, selection.text().get());
  const std::shared_ptr<const XdmfValues> all = readItem(source, depth + 1);
  const size_t rank = all->dims().size();
  if (numbers.size() != 3 * rank)
    throw Error("{} has {} numbers; expected start, stride and count of {} dimensions",
                document_.describe(item), numbers.size(), rank);
  const auto part = [&](size_t n) {
    return std::vector<uint64_t>(numbers.begin() + static_cast<ptrdiff_t>(n * rank),
                                 numbers.begin() + static_cast<ptrdiff_t>((n + 1) * rank));
  };
  return xdmfHyperslab(all, {part(0), part(1), part(2)}, document_.describe(item));
}

void XdmfItems::addFile(const std::filesystem::path& path) {
  if (std::find(files_.begin(), files_.end(), path.string()) == files_.end()) files_.push_back(path.string());
}

std::filesystem::path XdmfItems::existing(const pugi::xml_node& item, const std::string& text) const {
  return existingFile(document_.describe(item), folder_, text);
}

std::shared_ptr<const XdmfValues> XdmfItems::readHdf5(const pugi::xml_node& item, const std::string& text,
                                                      std::vector<uint64_t> dims) {
  const size_t colon = text.rfind(':');
  if (colon == std::string::npos || colon + 1 == text.size())
    throw Error("{} has \"{}\"; expected FILE:/DATA", document_.describe(item),
                printable(text.substr(0, 60)));
  const std::filesystem::path path = existing(item, text.substr(0, colon));
  addFile(path);
  return std::make_shared<Hdf5Values>(hdf5_sets_, path, text.substr(colon + 1), std::move(dims));
}

std::shared_ptr<const XdmfValues> XdmfItems::readBinary(const pugi::xml_node& item, const std::string& text,
                                                        std::vector<uint64_t> dims) {
  XdmfBinary binary;
  binary.where = document_.describe(item);
  const std::filesystem::path path = existing(item, text);
  addFile(path);
  binary.file = std::make_shared<const PooledFile>(pool_, path);
  const std::string kind = lowerCase(xdmfAttribute(item, {"NumberType", "DataType"}));
  const std::string precision = xdmfAttribute(item, {"Precision"}), seek = xdmfAttribute(item, {"Seek"});
  binary.kind = kind == "int" ? 'i' : kind == "uint" || kind == "uchar" ? 'u' : kind == "char" ? 'i' : 'f';
  binary.bytes = kind == "uchar" || kind == "char" ? 1 : 4;
  if (!precision.empty())
    binary.bytes = static_cast<int>(std::clamp(document_.numberIn(item, precision), 0.0, 99.0));
  const bool known = binary.bytes == 4 || binary.bytes == 8 ||
                     (binary.kind != 'f' && (binary.bytes == 1 || binary.bytes == 2));
  if (!known)
    throw Error("{} has numbers of {} bytes; expected 4 or 8", document_.describe(item), binary.bytes);
  if (!seek.empty()) binary.seek = document_.countsIn(item, seek).at(0);
  const std::string order = lowerCase(xdmfAttribute(item, {"Endian"}));
  if (order == "big") binary.swap = kMachineByteOrder == ByteOrder::kLittle;
  if (order == "little") binary.swap = kMachineByteOrder == ByteOrder::kBig;
  return openXdmfBinary(binary, std::move(dims));
}

}  // namespace curvisplat
