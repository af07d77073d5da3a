#include "preprocess/formats/cgns/cgns_file.h"

#include <cgns_io.h>

#include <algorithm>
#include <cstring>
#include <limits>
#include <string>
#include <string_view>

#include "preprocess/formats/cgns/adf_header.h"
#include "preprocess/formats/cgns/cgns_hdf5.h"
#include "preprocess/formats/common/byte_source.h"
#include "preprocess/formats/common/hdf5_objects.h"
#include "preprocess/formats/common/library_trial.h"
#include "stream/base/error.h"
#include "stream/base/file.h"

namespace curvisplat {

CURVISPLAT_LIBRARY_FUNCTION(cgio_children_ids)
CURVISPLAT_LIBRARY_FUNCTION(cgio_close_file)
CURVISPLAT_LIBRARY_FUNCTION(cgio_error_message)
CURVISPLAT_LIBRARY_FUNCTION(cgio_get_data_type)
CURVISPLAT_LIBRARY_FUNCTION(cgio_get_dimensions)
CURVISPLAT_LIBRARY_FUNCTION(cgio_get_label)
CURVISPLAT_LIBRARY_FUNCTION(cgio_get_link)
CURVISPLAT_LIBRARY_FUNCTION(cgio_get_name)
CURVISPLAT_LIBRARY_FUNCTION(cgio_get_node_id)
CURVISPLAT_LIBRARY_FUNCTION(cgio_get_root_id)
CURVISPLAT_LIBRARY_FUNCTION(cgio_is_link)
CURVISPLAT_LIBRARY_FUNCTION(cgio_link_size)
CURVISPLAT_LIBRARY_FUNCTION(cgio_number_children)
CURVISPLAT_LIBRARY_FUNCTION(cgio_open_file)
CURVISPLAT_LIBRARY_FUNCTION(cgio_read_all_data)
CURVISPLAT_LIBRARY_FUNCTION(cgio_read_data)
CURVISPLAT_LIBRARY_FUNCTION(cgio_release_id)

namespace {

// Names and labels have at most 32 characters, but libcgns copies whatever length a damaged file has.
constexpr size_t kTextBytes = 4096;
// Elements that are read from an ADF file at a time; their types are converted here.
constexpr uint64_t kPieceElements = 1 << 16;
// Limit for arrays that are read whole: times, units, names.
constexpr uint64_t kMaxSmallElements = 1 << 22;
// Deflate, the compression of HDF5 files, shrinks zeros to about a thousandth.
constexpr uint64_t kMaxCompression = 1100;
// Smallest size of a node in a file.
constexpr uint64_t kMinNodeBytes = 32;
constexpr int kMaxDimensions = 12;

std::string lastMessage() {
  char message[kTextBytes] = {};
  cgio_error_message(message);
  std::string text = message;
  while (!text.empty() && (text.back() == '\n' || text.back() == ' ' || text.back() == '.')) text.pop_back();
  std::replace(text.begin(), text.end(), '\n', ' ');
  return text;
}

uint64_t bytesOf(std::string_view type) {
  if (type == "C1" || type == "B1" || type == "U1" || type == "I1") return 1;
  if (type == "I4" || type == "U4" || type == "R4") return 4;
  if (type == "I8" || type == "U8" || type == "R8") return 8;
  return 0;
}

std::string trimmed(const char* begin, size_t size) {
  size = static_cast<size_t>(std::find(begin, begin + size, '\0') - begin);
  while (size > 0 && begin[size - 1] == ' ') --size;
  return std::string(begin, size);
}

template <typename Stored, typename Value>
void convert(const std::byte* from, uint64_t count, Value* to) {
  for (uint64_t n = 0; n < count; ++n) {
    Stored stored;
    std::memcpy(&stored, from + n * sizeof(Stored), sizeof(Stored));
    to[n] = convertedTo<Value>(stored);
  }
}

template <typename Value>
void convert(std::string_view type, const std::byte* from, uint64_t count, Value* to) {
  if (type == "R4") return convert<float>(from, count, to);
  if (type == "R8") return convert<double>(from, count, to);
  if (type == "I4") return convert<int32_t>(from, count, to);
  CURVISPLAT_CHECK(type == "I8");
  convert<int64_t>(from, count, to);
}

struct Selection {
  std::array<cgsize_t, 3> start, end, stride{1, 1, 1};
};

Selection selectionOf(const std::array<uint64_t, 3>& first, const std::array<uint64_t, 3>& count) {
  Selection selection;
  for (size_t axis = 0; axis < 3; ++axis) {
    selection.start[axis] = static_cast<cgsize_t>(first[axis] + 1);
    selection.end[axis] = static_cast<cgsize_t>(first[axis] + count[axis]);
  }
  return selection;
}

}  // namespace

uint64_t CgnsShape::count() const {
  uint64_t product = dims.empty() ? 0 : 1;
  for (const uint64_t n : dims) {
    if (n > 0 && product > std::numeric_limits<uint64_t>::max() / n)
      return std::numeric_limits<uint64_t>::max();
    product *= n;
  }
  return product;
}

/// Holds libcgns' id of a node for the duration of a call. The lock must be held.
class CgnsFile::OpenNode {
 public:
  OpenNode(const CgnsFile& file, const std::string& path) : file_(file.file_) {
    if (path.empty()) {
      id_ = file.root_;
      return;
    }
    if (cgio_get_node_id(file_, file.root_, path.c_str(), &id_) != CGIO_ERR_NONE) file.fail(path);
    owned_ = true;
  }
  ~OpenNode() {
    if (owned_) cgio_release_id(file_, id_);
  }
  OpenNode(const OpenNode&) = delete;
  OpenNode& operator=(const OpenNode&) = delete;

  double id() const { return id_; }

 private:
  int file_;
  double id_ = 0;
  bool owned_ = false;
};

CgnsFile::CgnsFile(std::filesystem::path path) : path_(std::move(path)) {
  const InputFile file(path_);
  bytes_ = file.size();
  if (isHdf5(file)) {
    hdf5_ = std::make_unique<CgnsHdf5>(path_);
    return;
  }
  requireWholeAdf(file);
  const MutexLock lock(dataLibraryMutex());
  if (cgio_open_file(path_.c_str(), CGIO_MODE_READ, CGIO_FILE_NONE, &file_) != CGIO_ERR_NONE) fail("");
  if (cgio_get_root_id(file_, &root_) != CGIO_ERR_NONE) {
    const std::string message = lastMessage();
    cgio_close_file(file_);
    throw Error("{}: cannot open as a CGNS file: {}; copy or write it again", path_.string(), message);
  }
}

CgnsFile::~CgnsFile() {
  if (hdf5_) return;
  const MutexLock lock(dataLibraryMutex());
  cgio_close_file(file_);
}

bool CgnsFile::recognises(const InputFile& file) {
  if (isHdf5(file)) return file.path().extension() == ".cgns" || CgnsHdf5::recognises(file.path());
  // The first four bytes of an ADF file differ between versions.
  return beginningOf(file, 32).find("ADF Database Version") == 4;
}

void CgnsFile::fail(const std::string& node_path) const {
  throw Error("{}: {} cannot be read as CGNS: {}; if the file is damaged, copy or write it again",
              path_.string(), node_path.empty() ? "the file" : node_path, lastMessage());
}

void CgnsFile::damaged(const std::string& node_path, std::string_view what) const {
  throw Error("{}: {} {}; the file is damaged: copy or write it again", path_.string(), node_path, what);
}

std::vector<CgnsNode> CgnsFile::children(const CgnsNode& node) const {
  if (hdf5_) return hdf5_->children(node);
  const MutexLock lock(dataLibraryMutex());
  const OpenNode open(*this, node.path);
  int count = 0;
  if (cgio_number_children(file_, open.id(), &count) != CGIO_ERR_NONE) fail(node.path);
  if (count <= 0) return {};
  if (!node.linked && static_cast<uint64_t>(count) > bytes_ / kMinNodeBytes)
    damaged(node.path, fmt::format("declares {} child nodes, more than the file can hold", count));

  std::vector<double> ids(static_cast<size_t>(count), -1);
  int found = 0;
  if (cgio_children_ids(file_, open.id(), 1, count, &found, ids.data()) != CGIO_ERR_NONE) fail(node.path);
  ids.resize(static_cast<size_t>(std::clamp(found, 0, count)));
  std::vector<CgnsNode> nodes;
  std::string error;
  for (const double id : ids) {
    char name[kTextBytes] = {}, label[kTextBytes] = {};
    int link_length = 0;
    const bool named = cgio_get_name(file_, id, name) == CGIO_ERR_NONE &&
                       cgio_is_link(file_, id, &link_length) == CGIO_ERR_NONE;
    if (named && link_length > 0) checkLink(id, node.path + "/" + name);
    // The target of a link may be missing; that is an Error only when its data are read.
    const bool readable = named && (cgio_get_label(file_, id, label) == CGIO_ERR_NONE || link_length > 0);
    if (!readable && error.empty()) error = lastMessage();
    nodes.push_back({node.path + "/" + name, name, label, node.linked || link_length > 0});
    cgio_release_id(file_, id);
  }
  const std::string place = node.path.empty() ? "the root" : node.path;
  if (found != count) damaged(place, fmt::format("declares {} child nodes, but {} were found", count, found));
  if (!error.empty()) damaged(place, "has a child node that cannot be read: " + error);
  return nodes;
}

/// Throws Error if the link leads to a file outside the folder of this one. libcgns itself opens regular files
/// only.
void CgnsFile::checkLink(double id, const std::string& node_path) const {
  int file_length = 0, path_length = 0;
  if (cgio_link_size(file_, id, &file_length, &path_length) != CGIO_ERR_NONE || file_length <= 0 ||
      path_length < 0)
    return;
  std::string file(static_cast<size_t>(file_length) + 1, '\0');
  std::string path(static_cast<size_t>(path_length) + 1, '\0');
  if (cgio_get_link(file_, id, file.data(), path.data()) == CGIO_ERR_NONE)
    noteLinks(path_, {namedFile(path_.string() + ": " + node_path, folderOf(path_), file.c_str())});
}

CgnsShape CgnsFile::storedShape(const OpenNode& open, const CgnsNode& node) const {
  char type[kTextBytes] = {};
  if (cgio_get_data_type(file_, open.id(), type) != CGIO_ERR_NONE) fail(node.path);
  CgnsShape shape{type, {}};
  if (shape.type == "MT" || shape.type == "LK") return {"MT", {}};

  int dimensions = 0;
  if (cgio_get_dimensions(file_, open.id(), &dimensions, nullptr) != CGIO_ERR_NONE) fail(node.path);
  if (dimensions < 0 || dimensions > kMaxDimensions)
    damaged(node.path, fmt::format("has {} dimensions; expected at most {}", dimensions, kMaxDimensions));
  std::array<cgsize_t, kMaxDimensions> dims{};
  if (dimensions > 0 && cgio_get_dimensions(file_, open.id(), &dimensions, dims.data()) != CGIO_ERR_NONE)
    fail(node.path);
  for (int n = 0; n < dimensions; ++n) {
    if (dims[static_cast<size_t>(n)] < 0) damaged(node.path, "has a negative dimension");
    shape.dims.push_back(static_cast<uint64_t>(dims[static_cast<size_t>(n)]));
  }
  checkShape(node, shape);
  return shape;
}

void CgnsFile::checkShape(const CgnsNode& node, const CgnsShape& shape) const {
  if (shape.type == "MT") return;
  const uint64_t bytes = bytesOf(shape.type);
  if (bytes == 0) damaged(node.path, fmt::format("has data of unknown type '{}'", shape.type));
  const uint64_t most = bytes_ / bytes * (hdf5_ ? kMaxCompression : 1);
  if (!node.linked && shape.count() > most)
    damaged(node.path, fmt::format("declares {} values, more than {} bytes can hold", shape.count(), bytes_));
}

CgnsShape CgnsFile::shape(const CgnsNode& node) const {
  if (hdf5_) {
    const CgnsShape shape = hdf5_->shape(node);
    checkShape(node, shape);
    return shape;
  }
  const MutexLock lock(dataLibraryMutex());
  return storedShape(OpenNode(*this, node.path), node);
}

void CgnsFile::checkSmall(const CgnsNode& node, const CgnsShape& shape, std::string_view type) const {
  const bool right = type == "C1" ? shape.type == "C1" : shape.number();
  if (!right || shape.count() == 0)
    damaged(node.path, fmt::format("has {} values of type '{}'; expected {}", shape.count(), shape.type,
                                   type == "C1" ? "text" : "numbers"));
  if (shape.count() > kMaxSmallElements)
    damaged(node.path, fmt::format("has {} values; expected at most {}", shape.count(), kMaxSmallElements));
}

std::vector<double> CgnsFile::numbers(const CgnsNode& node) const {
  if (hdf5_) {
    const CgnsShape found = shape(node);
    checkSmall(node, found, "R8");
    std::vector<double> values(found.count());
    hdf5_->readAll(node, values);
    return values;
  }
  const MutexLock lock(dataLibraryMutex());
  const OpenNode open(*this, node.path);
  const CgnsShape found = storedShape(open, node);
  checkSmall(node, found, "R8");
  std::vector<double> values(found.count());
  std::vector<std::byte> stored(found.count() * bytesOf(found.type));
  if (cgio_read_all_data(file_, open.id(), stored.data()) != CGIO_ERR_NONE) fail(node.path);
  convert(found.type, stored.data(), found.count(), values.data());
  return values;
}

std::string CgnsFile::text(const CgnsNode& node) const {
  const std::vector<std::string> columns = texts(node);
  std::string all;
  for (const std::string& column : columns) all += column;
  return all;
}

std::vector<std::string> CgnsFile::texts(const CgnsNode& node) const {
  std::vector<char> stored;
  size_t column = 0;
  if (hdf5_) {
    const CgnsShape found = shape(node);
    checkSmall(node, found, "C1");
    column = found.dims[0];
    stored.resize(found.count());
    hdf5_->readAll(node, stored);
  } else {
    const MutexLock lock(dataLibraryMutex());
    const OpenNode open(*this, node.path);
    const CgnsShape found = storedShape(open, node);
    checkSmall(node, found, "C1");
    column = found.dims[0];
    stored.resize(found.count());
    if (cgio_read_all_data(file_, open.id(), stored.data()) != CGIO_ERR_NONE) fail(node.path);
  }
  std::vector<std::string> texts;
  for (size_t begin = 0; begin < stored.size(); begin += column)
    texts.push_back(trimmed(&stored[begin], column));
  return texts;
}

template <typename Value>
void CgnsFile::readAdf(const CgnsNode& node, const CgnsShape& shape, const CgnsBox& box, Value* to) const {
  const uint64_t rows = std::clamp<uint64_t>(kPieceElements / box.count[0], 1, box.count[1]);
  std::vector<std::byte> stored(rows * box.count[0] * bytesOf(shape.type));
  for (uint64_t k = 0; k < box.count[2]; ++k)
    for (uint64_t j = 0; j < box.count[1]; j += rows) {
      const std::array<uint64_t, 3> count{box.count[0], std::min(rows, box.count[1] - j), 1};
      const Selection file = selectionOf({box.first[0], box.first[1] + j, box.first[2] + k}, count);
      const Selection memory = selectionOf({}, count);
      {
        const MutexLock lock(dataLibraryMutex());
        const OpenNode open(*this, node.path);
        if (cgio_read_data(file_, open.id(), file.start.data(), file.end.data(), file.stride.data(), 3,
                           memory.end.data(), memory.start.data(), memory.end.data(), memory.stride.data(),
                           stored.data()) != CGIO_ERR_NONE)
          fail(node.path);
      }
      for (uint64_t row = 0; row < count[1]; ++row)
        convert(shape.type, stored.data() + row * count[0] * bytesOf(shape.type), count[0],
                to + box.memory[0] * (j + row + box.memory[1] * k));
    }
}

void CgnsFile::read(const CgnsNode& node, const CgnsShape& shape, const CgnsBox& box, double* to) const {
  hdf5_ ? hdf5_->read(node, box, to) : readAdf(node, shape, box, to);
}

void CgnsFile::read(const CgnsNode& node, const CgnsShape& shape, const CgnsBox& box, float* to) const {
  hdf5_ ? hdf5_->read(node, box, to) : readAdf(node, shape, box, to);
}

}  // namespace curvisplat
