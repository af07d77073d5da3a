#include "preprocess/formats/tecplot/tecplot_data.h"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <limits>

#include "preprocess/formats/common/byte_source.h"
#include "preprocess/formats/common/text_reader.h"
#include "stream/base/error.h"

namespace curvisplat {
namespace {

constexpr std::string_view kMagic = "#!TDV";
constexpr size_t kMagicBytes = 8;
constexpr int kOldest = 104, kNewest = 113;
constexpr float kZone = 299, kGeometry = 399, kText = 499, kLabels = 599, kUserRecord = 699, kAuxiliary = 799,
                kVariableAuxiliary = 899, kEndOfHeader = 357;
constexpr const char* kTypeNames[] = {"ORDERED",       "FELINESEG", "FETRIANGLE", "FEQUADRILATERAL",
                                      "FETETRAHEDRON", "FEBRICK",   "FEPOLYGON",  "FEPOLYHEDRON"};

/// The file in its order, through a buffer.
class BinaryReader {
 public:
  explicit BinaryReader(std::shared_ptr<const PooledFile> file) : file_(std::move(file)) {}

  const std::shared_ptr<const PooledFile>& file() const { return file_; }
  std::string name() const { return file_->name(); }
  uint64_t offset() const { return offset_; }
  uint64_t size() const { return file_->size(); }
  bool swap() const { return swap_; }
  void setSwap(bool swap) { swap_ = swap; }
  void seek(uint64_t offset) { offset_ = offset; }
  void skip(uint64_t bytes) {
    need(bytes);
    offset_ += bytes;
  }

  template <typename Value>
  Value read() {
    need(sizeof(Value));
    if (offset_ < begin_ || offset_ + sizeof(Value) > begin_ + buffer_.size()) fill();
    const Value value = loadStored<Value>(buffer_.data() + (offset_ - begin_), swap_);
    offset_ += sizeof(Value);
    return value;
  }
  int32_t integer() { return read<int32_t>(); }
  /// 0 or 1, or another number that `what` must not have.
  bool flag(const char* what) {
    const int32_t value = integer();
    if (value != 0 && value != 1) damaged(what, value, "0 or 1");
    return value == 1;
  }
  uint64_t count(const char* what) {
    const int32_t value = integer();
    if (value < 0) damaged(what, value, "a count");
    return static_cast<uint64_t>(value);
  }
  std::string text() {
    constexpr size_t kMax = 1 << 20;
    std::string text;
    for (int32_t c = integer(); c != 0; c = integer()) {
      text += static_cast<char>(c & 0xff);
      if (text.size() > kMax)
        throw Error("{}: byte {}: a text does not end; the file is damaged", name(), offset_);
    }
    return text;
  }

  template <typename Value>
  [[noreturn]] void damaged(const char* what, Value found, const char* expected) const {
    throw Error("{}: byte {}: {} is {} (expected {}); the file is damaged or of an unsupported version",
                name(), offset_, what, found, expected);
  }

 private:
  void need(uint64_t bytes) const {
    if (bytes > size() || offset_ > size() - bytes)
      throw Error("{}: ends at byte {}, within {} bytes that begin at byte {}; the file is truncated", name(),
                  size(), bytes, offset_);
  }
  void fill() {
    constexpr uint64_t kBytes = 64 << 10;
    buffer_.resize(static_cast<size_t>(std::min(kBytes, size() - offset_)));
    file_->readAt(offset_, buffer_);
    begin_ = offset_;
  }

  std::shared_ptr<const PooledFile> file_;
  bool swap_ = false;
  uint64_t offset_ = 0, begin_ = 0;
  std::vector<std::byte> buffer_;
};

/// The facts in a zone's header that its data need.
struct ZoneLayout {
  bool point = false;  // packing
  uint64_t neighbours = 0;
  bool has_face_neighbours = false;  // of all faces of its elements
};

bool isOfCells(const TecplotValues& values) {
  return values.centring == Centring::kCell;
}

class ZoneReader {
 public:
  ZoneReader(std::shared_ptr<const PooledFile> file, int version, bool has_packing)
      : words_(std::move(file)), version_(version), has_packing_(has_packing) {}

  TecplotData run() {
    words_.seek(kMagicBytes);
    readOrder();
    if (version_ >= 111) checkFileType();
    words_.text();
    readVariables();
    readHeader();
    for (size_t zone = 0; zone < data_.zones.size(); ++zone) readData(zone);
    data_.encoding =
        fmt::format("binary, version {}, {}-endian", version_,
                    words_.swap() == (kMachineByteOrder == ByteOrder::kLittle) ? "big" : "little");
    return std::move(data_);
  }

 private:
  void readOrder() {
    const int32_t one = words_.integer();
    words_.setSwap(byteSwapped(static_cast<uint32_t>(one)) == 1);
    if (one != 1 && !words_.swap()) words_.damaged("the mark of the byte order", one, "1");
  }

  void checkFileType() {
    const int32_t type = words_.integer();
    if (type == 2)
      throw Error(
          "{}: is a Tecplot file of solutions alone, which is not read; write the grid into the same file",
          words_.name());
    if (type != 0 && type != 1) words_.damaged("the file type", type, "0 to 2");
  }

  void readVariables() {
    const uint64_t count = words_.count("the number of variables");
    checkTecplotCounts(words_.name(), 0, count);
    for (uint64_t n = 0; n < count; ++n) data_.variables.push_back(words_.text());
  }

  void readHeader() {
    for (;;) {
      const auto mark = words_.read<float>();
      if (mark == kEndOfHeader) return;
      if (mark == kZone) {
        readZone();
      } else if (mark == kGeometry) {
        skipGeometry();
      } else if (mark == kText) {
        skipText();
      } else if (mark == kLabels) {
        for (uint64_t n = words_.count("the number of labels"); n > 0; --n) words_.text();
      } else if (mark == kUserRecord) {
        words_.text();
      } else if (mark == kAuxiliary || mark == kVariableAuxiliary) {
        if (mark == kVariableAuxiliary) words_.integer();
        skipAuxiliary();
      } else {
        words_.damaged("a mark", mark, "that of a zone or of the header's end");
      }
    }
  }

  void readZone() {
    const size_t number = data_.zones.size();
    TecplotZone zone;
    ZoneLayout layout;
    zone.name = words_.text();
    if (version_ >= 107) words_.integer();  // the parent
    const int32_t strand = words_.integer();
    const auto time = words_.read<double>();
    // -1: static; -2: to be given a strand by whoever reads it.
    if (strand != -1 && std::isfinite(time)) zone.time = time;
    words_.integer();  // colour
    const int32_t type = words_.integer();
    if (type > 0 && static_cast<size_t>(type) < std::size(kTypeNames))
      setTecplotElements(words_.name(), zone, number, kTypeNames[type]);
    if (type != 0 && !zone.ofElements()) words_.damaged("the type of a zone", type, "0 to 7");
    if (has_packing_) layout.point = words_.flag("the packing of a zone");
    checkTecplotCounts(words_.name(), number + 1, data_.variables.size());
    // Each has a type in the data.
    if ((number + 1) * data_.variables.size() > words_.size() / 4)
      words_.damaged("the number of zones", number + 1, "fewer, by the size of the file");
    zone.values.resize(data_.variables.size());
    if (words_.flag("the mark of centrings"))
      for (TecplotValues& values : zone.values)
        values.centring = words_.flag("the centring of a variable") ? Centring::kCell : Centring::kNode;
    if (layout.point && std::any_of(zone.values.begin(), zone.values.end(), isOfCells))
      words_.damaged("the packing of a zone with values of cells", "by points", "by blocks");
    layout.has_face_neighbours = words_.flag("the mark of face neighbours");
    if (layout.has_face_neighbours && !zone.ofElements())
      words_.damaged("the mark of face neighbours", 1, "0");
    if (version_ >= 108) {
      layout.neighbours = words_.count("the number of face neighbours");
      if (layout.neighbours > 0) words_.integer();                       // their mode
      if (layout.neighbours > 0 && zone.ofElements()) words_.integer();  // whether they are all
    }
    if (zone.ofElements()) {
      zone.nodes[0] = words_.count("the number of nodes");
      if (zone.of_faces)
        for (uint64_t* const count :
             {&zone.faces.count, &zone.faces.corner_count, &zone.faces.connected, &zone.faces.connections})
          *count = words_.count("a number of faces");
      zone.elements = words_.count("the number of elements");
      if (zone.elements == 0) words_.damaged("the number of elements", 0, "1 or more");
      words_.skip(3 * 4);
    } else {
      for (uint64_t& nodes : zone.nodes) nodes = words_.count("a dimension of a zone");
    }
    checkTecplotZone(words_.name(), zone, number, words_.size());
    while (words_.flag("the mark of auxiliary data")) skipAuxiliary();
    data_.zones.push_back(std::move(zone));
    layouts_.push_back(layout);
  }

  void skipAuxiliary() {
    words_.text();
    words_.integer();
    words_.text();
  }

  void skipText() {
    words_.skip(2 * 4 + 3 * 8 + 2 * 4 + 8 + 4 + 2 * 8 + 2 * 4 + 2 * 8 + 3 * 4);
    words_.text();
    words_.integer();
    words_.text();
  }

  void skipGeometry() {
    const int32_t coordinates = words_.integer();
    words_.skip(2 * 4 + 3 * 8 + 4 * 4);
    const int32_t type = words_.integer();
    words_.skip(4 + 2 * 8 + 3 * 4 + 2 * 8);
    words_.text();
    const uint64_t width = words_.integer() == 1 ? 4 : 8;
    words_.integer();
    constexpr int32_t kGrid3d = 4;
    constexpr uint64_t kNumbers[] = {0, 2, 1, 1, 2};  // rectangle, square, circle, ellipse
    if (type < 0 || type > 4) words_.damaged("the type of a geometry", type, "0 to 4");
    words_.skip(width * kNumbers[type]);
    if (type != 0) return;
    for (uint64_t n = words_.count("the number of lines"); n > 0; --n)
      words_.skip(words_.count("the number of points") * width * (coordinates == kGrid3d ? 3 : 2));
  }

  void readData(size_t number) {
    TecplotZone& zone = data_.zones[number];
    const auto mark = words_.read<float>();
    if (mark != kZone) words_.damaged("the mark of a zone's data", mark, "299");
    for (TecplotValues& values : zone.values) {
      const int32_t type = words_.integer();
      if (type < 1 || type > static_cast<int32_t>(TecplotType::kByte))
        words_.damaged("the type of a variable", type, "1 to 5; packed bits are not read");
      values.type = static_cast<TecplotType>(type);
      values.swap = words_.swap();
    }
    if (words_.flag("the mark of passive variables"))
      for (TecplotValues& values : zone.values)
        values.passive = words_.flag("the mark of a passive variable");
    std::vector<bool> shared(zone.values.size());
    if (words_.flag("the mark of shared variables"))
      for (size_t n = 0; n < shared.size(); ++n) {
        const int32_t from = words_.integer();
        if (from < 0) continue;
        shared[n] = true;
        shareTecplotValues(words_.name(), data_, static_cast<size_t>(from), number, n);
      }
    const int32_t connectivity = words_.integer();
    std::vector<TecplotValues*> stored;
    for (size_t n = 0; n < shared.size(); ++n)
      if (!shared[n] && !zone.values[n].passive) stored.push_back(&zone.values[n]);
    words_.skip(16 * stored.size());  // minimum and maximum
    const uint64_t begin = words_.offset();
    uint64_t end = placeValues(zone, layouts_[number], stored, begin, false);
    if (zone.elements == 0 && !endsWell(number, end, connectivity) && hasCells(stored)) {
      // Some writers keep the last plane of cells.
      end = placeValues(zone, layouts_[number], stored, begin, true);
    }
    if (end == kNoEnd)
      throw Error("{}: {} ends beyond the file's {} bytes; the file is truncated", words_.name(),
                  zone.describe(number), words_.size());
    words_.seek(end);
    if (zone.elements > 0) placeElements(zone, number, connectivity);
    if (connectivity == -1) skipNeighbours(layouts_[number].neighbours, number);
  }

  void placeElements(TecplotZone& zone, size_t number, int32_t shared) {
    if (shared >= 0) return shareTecplotElements(words_.name(), data_, static_cast<size_t>(shared), number);
    const auto place = [&](TecplotValues& values, uint64_t numbers) {
      values.type = TecplotType::kInt32;
      values.swap = words_.swap();
      values.bytes = std::make_shared<FileBytes>(words_.file(), 0, words_.size());
      values.begin = words_.offset();
      values.stride = 4;
      words_.skip(4 * numbers);
    };
    if (zone.of_faces) {
      TecplotFaces& faces = zone.faces;
      faces.has_begins = true;
      const bool flat = zone.flat();
      if (!flat) place(faces.sizes, faces.count + 1);
      place(faces.corners, flat ? 2 * faces.count : faces.corner_count);
      place(faces.left, faces.count);
      place(faces.right, faces.count);
      if (faces.connected > 0) words_.skip(4 * (faces.connected + 1) + 6 * faces.connections);
      return;
    }
    place(zone.connectivity, zone.elements * zone.element_nodes);
    if (layouts_[number].has_face_neighbours)
      words_.skip(4 * zone.elements * (zone.element_nodes == 8 ? 6 : zone.element_nodes));
  }

  static bool hasCells(const std::vector<TecplotValues*>& stored) {
    return std::any_of(stored.begin(), stored.end(),
                       [](const TecplotValues* values) { return isOfCells(*values); });
  }

  /// Sets the positions and returns the end of the values; kNoEnd if the file ends before.
  uint64_t placeValues(TecplotZone& zone, const ZoneLayout& layout, const std::vector<TecplotValues*>& stored,
                       uint64_t begin, bool last_plane) const {
    const auto bytes = std::make_shared<FileBytes>(words_.file(), 0, words_.size());
    uint64_t node_bytes = 0, end = begin;
    for (const TecplotValues* values : stored) node_bytes += bytesOf(values->type);
    for (TecplotValues* values : stored) {
      values->bytes = bytes;
      values->begin = end;
      values->row_pitch = zone.nodes[0];
      values->columns = zone.nodes[1];
      values->stride = layout.point ? node_bytes : bytesOf(values->type);
      const bool cells = values->centring == Centring::kCell && !last_plane;
      const uint64_t count = zone.elements > 0 && isOfCells(*values) ? zone.elements
                             : cells
                                 ? zone.nodes[0] * zone.nodes[1] * std::max<uint64_t>(1, zone.nodes[2] - 1)
                                 : zone.nodeCount();
      // No overflow: both are at most a few times the file's size.
      end += layout.point ? bytesOf(values->type) : count * bytesOf(values->type);
      if (end > words_.size()) return kNoEnd;
    }
    if (!layout.point || stored.empty()) return end;
    const uint64_t room = words_.size() - begin;
    return node_bytes > room / zone.nodeCount() ? kNoEnd : begin + node_bytes * zone.nodeCount();
  }

  /// Whether the next zone, or the end of the file, follows the values.
  bool endsWell(size_t number, uint64_t end, int32_t connectivity) {
    if (layouts_[number].neighbours > 0 && connectivity == -1) return true;
    if (number + 1 == data_.zones.size()) return end == words_.size();
    if (end == kNoEnd || end > words_.size() - 4) return false;
    words_.seek(end);
    return words_.read<float>() == kZone;
  }

  /// Skips the neighbours of faces, which have no fixed size: up to the mark of the next zone.
  void skipNeighbours(uint64_t neighbours, size_t number) {
    if (neighbours == 0 || number + 1 == data_.zones.size()) return;
    while (words_.read<float>() != kZone) continue;
    words_.seek(words_.offset() - 4);
  }

  static constexpr uint64_t kNoEnd = std::numeric_limits<uint64_t>::max();

  BinaryReader words_;
  int version_ = 0;
  bool has_packing_ = false;
  TecplotData data_;
  std::vector<ZoneLayout> layouts_;
};

int versionOf(const PooledFile& file) {
  std::string magic(kMagicBytes, ' ');
  file.readAt(0, std::as_writable_bytes(std::span(magic)));
  int version = 0;
  std::from_chars(magic.data() + kMagic.size(), magic.data() + magic.size(), version);
  if (version < kOldest || version > kNewest)
    throw Error(
        "{}: is a Tecplot binary file of version {} (expected {} to {}); save it with a newer Tecplot",
        file.name(), printable(magic.substr(kMagic.size())), kOldest, kNewest);
  return version;
}

}  // namespace

bool isTecplotBinary(const InputFile& file) {
  return file.size() >= kMagicBytes && beginningOf(file, kMagic.size()) == kMagic;
}

TecplotData readTecplotBinary(const std::shared_ptr<const PooledFile>& file) {
  const int version = versionOf(*file);
  if (version < 112) return ZoneReader(file, version, true).run();
  try {
    return ZoneReader(file, version, false).run();
  } catch (const Error&) {
    try {
      return ZoneReader(file, version, true).run();
    } catch (const Error&) {
    }
    throw;
  }
}

}  // namespace curvisplat
