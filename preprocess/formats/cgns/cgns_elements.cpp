#include "preprocess/formats/cgns/cgns_elements.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <limits>
#include <optional>

#include "preprocess/formats/common/spool_file.h"
#include "stream/base/error.h"

namespace curvisplat {
namespace {

constexpr uint64_t kChunk = 65536;
constexpr int64_t kNone = std::numeric_limits<int64_t>::min();
constexpr double kLargestInteger = 0x1p53;
constexpr int64_t kMaxCorners = 200;  // of a polygon

struct Kind {
  CellKind cell;
  uint8_t nodes;
};
constexpr CellKind kNot = CellKind::kNone, kTet = CellKind::kTetrahedron, kPyr = CellKind::kPyramid,
                   kWed = CellKind::kWedge, kHex = CellKind::kHexahedron;
// [ElementType_t]: CGNS Standard Interface Data Structures, section 3.3, and cgnslib.h.
constexpr std::array<Kind, 57> kKinds{
    {{kNot, 0},  {kNot, 0},  {kNot, 1},  {kNot, 2},  {kNot, 3},  {kNot, 3},  {kNot, 6},  {kNot, 4},
     {kNot, 8},  {kNot, 9},  {kTet, 4},  {kTet, 10}, {kPyr, 5},  {kPyr, 14}, {kWed, 6},  {kWed, 15},
     {kWed, 18}, {kHex, 8},  {kHex, 20}, {kHex, 27}, {kNot, 0},  {kPyr, 13}, {kNot, 0},  {kNot, 0},
     {kNot, 4},  {kNot, 9},  {kNot, 10}, {kNot, 12}, {kNot, 16}, {kTet, 16}, {kTet, 20}, {kPyr, 21},
     {kPyr, 29}, {kPyr, 30}, {kWed, 24}, {kWed, 38}, {kWed, 40}, {kHex, 32}, {kHex, 56}, {kHex, 64},
     {kNot, 5},  {kNot, 12}, {kNot, 15}, {kNot, 16}, {kNot, 25}, {kTet, 22}, {kTet, 34}, {kTet, 35},
     {kPyr, 29}, {kPyr, 50}, {kPyr, 55}, {kWed, 33}, {kWed, 66}, {kWed, 75}, {kHex, 44}, {kHex, 98},
     {kHex, 125}}};

CgnsElementKind elementKind(int64_t type) {
  if (type < 0 || type >= std::ssize(kKinds)) return {};
  return {kKinds[static_cast<size_t>(type)].cell, kKinds[static_cast<size_t>(type)].nodes};
}

/// The number that a type has since version 3.1. Source: cgi_read_section() of libcgns.
int typeNow(int type, double version) {
  constexpr int kPyra5 = 12, kPyra13 = 21;
  if (version < 3 || version >= 3.1 || type <= kPyra5 || type >= kCgnsNgon) return type;
  return type == kPyra5 + 1 ? kPyra13 : type - 1;
}

/// 3.1 is stored in single precision; steps are of a tenth at the least.
double versionOf(const CgnsFile& file) {
  for (const CgnsNode& node : file.children(file.root()))
    if (node.name == "CGNSLibraryVersion")
      if (const std::vector<double> numbers = file.numbers(node); !numbers.empty()) return numbers[0] + 1e-4;
  return kNewestCgns;
}

/// A column of an array of integers.
CgnsIntegers storedIntegers(const CgnsFile& file, const CgnsNode& node) {
  const CgnsShape shape = file.shape(node);
  if (shape.type != "I4" && shape.type != "I8")
    throw Error("{}: {} has values of type '{}'; expected I4 or I8", file.path().string(), node.path,
                shape.type);
  if (shape.dims.empty() || shape.dims.size() > 2)
    throw Error("{}: {} has {} dimensions; expected a list; the file is damaged", file.path().string(),
                node.path, shape.dims.size());
  CgnsIntegers list;
  list.count = shape.count();
  list.read = [&file, node, shape, all = list.count](uint64_t first, std::span<int64_t> to) {
    if (to.empty()) return;
    if (first > all || to.size() > all - first)
      throw Error("{}: {} has {} values; expected at least {}; the file is damaged", file.path().string(),
                  node.path, all, first + to.size());
    std::vector<double> values(to.size());
    // A table is read column by column.
    const uint64_t rows = shape.dims[0];
    for (uint64_t done = 0; done < to.size();) {
      const uint64_t row = (first + done) % rows, column = (first + done) / rows;
      const uint64_t count = std::min<uint64_t>(to.size() - done, rows - row);
      file.read(node, shape, {{row, column, 0}, {count, 1, 1}, {count, 1}}, values.data() + done);
      done += count;
    }
    for (size_t n = 0; n < to.size(); ++n)
      to[n] = std::abs(values[n]) <= kLargestInteger ? static_cast<int64_t>(values[n]) : kNone;
  };
  return list;
}

CgnsIntegers spooledIntegers(SpooledNumbers numbers) {
  const uint64_t count = numbers.count;
  return {[numbers](uint64_t first, std::span<int64_t> to) { numbers.read(first, to); }, count};
}

class SectionReader {
 public:
  SectionReader(const CgnsFile& file, double version, const CgnsNode& node, const ListSpools& spools)
      : file_(file), version_(version), node_(node), spools_(spools) {}

  CgnsSection read();

 private:
  template <typename... Values>
  [[noreturn]] void damaged(fmt::format_string<Values...> words, Values&&... values) const {
    throw Error("{}: {} {}; the file is damaged", file_.path().string(), node_.path,
                fmt::format(words, std::forward<Values>(values)...));
  }
  void readRange(const std::vector<double>& range, CgnsSection& section) const;
  void checkBegins(const CgnsSection& section) const;
  void findBegins(CgnsSection& section) const;

  const CgnsFile& file_;
  const double version_;
  const CgnsNode& node_;
  const ListSpools& spools_;
};

void SectionReader::readRange(const std::vector<double>& range, CgnsSection& section) const {
  if (range.size() != 2 || !(range[0] >= 1 && range[1] >= range[0] && range[1] <= kLargestInteger))
    damaged("has an invalid ElementRange of {} numbers; expected two, the first at most the second",
            range.size());
  section.first = static_cast<uint64_t>(range[0]);
  section.elements = static_cast<uint64_t>(range[1]) - section.first + 1;
}

CgnsSection SectionReader::read() {
  CgnsSection section;
  section.path = node_.path;
  const std::vector<double> type = file_.numbers(node_);
  section.version = version_;
  section.type =
      type.empty() || !(type[0] >= 0 && type[0] < 1000) ? -1 : typeNow(static_cast<int>(type[0]), version_);
  const bool listed = section.type == kCgnsMixed || section.type == kCgnsNgon || section.type == kCgnsNface;
  const CgnsElementKind kind = elementKind(section.type);
  if (!listed && kind.nodes == 0)
    throw Error("{}: {} is of element type {}; expected one of CGNS's (TETRA_4 is 10, HEXA_8 17, MIXED 20)",
                file_.path().string(), node_.path, type.empty() ? -1.0 : type[0]);
  std::optional<CgnsIntegers> parents;
  for (const CgnsNode& child : file_.children(node_)) {
    if (child.name == "ElementRange") readRange(file_.numbers(child), section);
    // What is not drawn is not looked at.
    if (!listed && kind.cell == CellKind::kNone) continue;
    if (child.name == "ElementConnectivity") section.connectivity = storedIntegers(file_, child);
    if (child.name == "ElementStartOffset" && listed) section.begins = storedIntegers(file_, child);
    // ParentData of older files has two columns more.
    if ((child.name == "ParentElements" || child.name == "ParentData") && section.type == kCgnsNgon)
      parents = storedIntegers(file_, child);
  }
  if (section.elements == 0) damaged("has no ElementRange");
  if (!listed && kind.cell == CellKind::kNone) return section;
  if (!section.connectivity.read) damaged("has no ElementConnectivity");
  if (!listed) {
    if (section.connectivity.count / kind.nodes != section.elements ||
        section.connectivity.count % kind.nodes != 0)
      damaged("has {} numbers of nodes; expected {} elements of {}", section.connectivity.count,
              section.elements, kind.nodes);
    return section;
  }
  if (section.elements > section.connectivity.count)
    damaged("has {} elements, but {} numbers", section.elements, section.connectivity.count);
  section.begins.read ? checkBegins(section) : findBegins(section);
  if (parents && parents->count / 2 >= section.elements) section.parents = std::move(*parents);
  return section;
}

void SectionReader::checkBegins(const CgnsSection& section) const {
  if (section.begins.count != section.elements + 1)
    damaged("has {} offsets; expected {}, one more than elements", section.begins.count,
            section.elements + 1);
  std::vector<int64_t> values;
  int64_t last = 0;
  for (uint64_t first = 0; first < section.begins.count; first += kChunk) {
    values.resize(std::min(kChunk, section.begins.count - first));
    section.begins.read(first, values);
    for (const int64_t value : values) {
      if (value < last || static_cast<uint64_t>(value) > section.connectivity.count)
        damaged("has the offset {} after {}; expected offsets that rise to {}", value, last,
                section.connectivity.count);
      last = value;
    }
  }
}

/// Finds where elements begin in files before CGNS 3.4. Elements of NGON_n and NFACE_n are written without
/// their lengths.
void SectionReader::findBegins(CgnsSection& section) const {
  NumberSpool<int64_t> begins(spools_.begins), members(spools_.items);
  const bool counted = section.type != kCgnsMixed;
  std::vector<int64_t> values;
  uint64_t left = 0, elements = 0;  // numbers of this element that are to come
  int64_t written = 0;
  for (uint64_t first = 0; first < section.connectivity.count && (elements < section.elements || left > 0);
       first += kChunk) {
    values.resize(std::min(kChunk, section.connectivity.count - first));
    section.connectivity.read(first, values);
    for (const int64_t value : values) {
      if (left > 0) {
        if (counted) members.add(value);
        ++written;
        --left;
        continue;
      }
      if (elements == section.elements) break;
      const int64_t length = counted ? value : section.kindOf(value).nodes;
      if (length < 1 || static_cast<uint64_t>(length) > section.connectivity.count)
        damaged("has an element {} with {} {}; expected {}", section.first + elements,
                counted ? "length" : "type", value, counted ? "its length" : "a type of CGNS");
      begins.add(written);
      if (!counted) ++written;
      left = static_cast<uint64_t>(length);
      ++elements;
    }
  }
  if (elements != section.elements || left > 0)
    damaged("ends within element {} of {}", elements, section.elements);
  begins.add(written);
  section.begins = spooledIntegers(begins.finish());
  if (counted) section.connectivity = spooledIntegers(members.finish());
}

}  // namespace

CgnsElementKind cgnsElementKind(int64_t type, double version) {
  const int64_t ngon = version < 3 ? kCgnsNgon - 1 : kCgnsNgon;
  if (version < 3.2 && type > ngon + (version < 3 ? 0 : 1) && type < ngon + kMaxCorners)
    return {CellKind::kNone, static_cast<uint32_t>(type - ngon)};
  return elementKind(type < kCgnsNgon ? typeNow(static_cast<int>(type), version) : type);
}

std::vector<CgnsSection> readCgnsSections(const CgnsFile& file, const std::vector<CgnsNode>& nodes,
                                          const ListSpools& spools) {
  std::vector<CgnsSection> sections;
  const double version = versionOf(file);
  for (const CgnsNode& node : nodes) sections.push_back(SectionReader(file, version, node, spools).read());
  std::sort(sections.begin(), sections.end(),
            [](const CgnsSection& a, const CgnsSection& b) { return a.first < b.first; });
  for (size_t n = 1; n < sections.size(); ++n)
    if (sections[n].first < sections[n - 1].first + sections[n - 1].elements)
      throw Error("{}: {} has the numbers of elements of {}; the file is damaged", file.path().string(),
                  sections[n].path, sections[n - 1].path);
  return sections;
}

}  // namespace curvisplat
