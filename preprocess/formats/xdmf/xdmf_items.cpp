#include "preprocess/formats/xdmf/xdmf_items.h"

#include <fmt/format.h>

#include <algorithm>
#include <utility>

#include "preprocess/formats/common/byte_source.h"
#include "preprocess/formats/common/hdf5_arrays.h"
#include "preprocess/formats/common/text_reader.h"
#include "stream/base/error.h"
#include "stream/base/text.h"

namespace curvisplat {
namespace {

/// The numbers of an HDF5 data set.
class Hdf5Values final : public XdmfValues {
 public:
  /// Throws Error unless the data set has as many numbers as `dims` say.
  Hdf5Values(Hdf5Array array, std::vector<uint64_t> dims)
      : XdmfValues(std::move(dims), array.where()), array_(std::move(array)) {
    if (array_.size() != size())
      throw Error("{}: has {} values; the XDMF file says {}", array_.where(), array_.size(), size());
    as_stored_ = array_.dims() == this->dims();
  }

  int valueBytes() const override { return array_.isFloat() && array_.bytes() == 4 ? 4 : 8; }

  void read(uint64_t first, std::span<double> to) const override { array_.read(first, to); }

  /// HDF5 takes steps itself, unless the item cuts the numbers into other dimensions than the file does.
  void readPart(const XdmfSlab& part, std::span<double> to) const override {
    if (!as_stored_) return XdmfValues::readPart(part, to);
    array_.readPart({part.start, part.stride, part.count}, to.data());
  }

 private:
  Hdf5Array array_;
  bool as_stored_ = false;  // the item has the dimensions of the data set
};

}  // namespace

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
  if (const size_t bar = text.find('|'); bar != std::string::npos)
    throw XdmfComputedItem("{} selects a part of its data, \"{}\", which is not read; write a HyperSlab",
                           document_.describe(item), printable(text.substr(bar, 40)));
  const size_t colon = text.rfind(':');
  if (colon == std::string::npos || colon + 1 == text.size())
    throw Error("{} has \"{}\"; expected FILE:/DATA", document_.describe(item),
                printable(text.substr(0, 60)));
  const std::filesystem::path path = existing(item, text.substr(0, colon));
  addFile(path);
  return std::make_shared<Hdf5Values>(Hdf5Array(hdf5_sets_, path, text.substr(colon + 1)), std::move(dims));
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
