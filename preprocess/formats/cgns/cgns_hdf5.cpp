#include "preprocess/formats/cgns/cgns_hdf5.h"

#include <algorithm>
#include <array>
#include <optional>

#include "preprocess/formats/common/byte_source.h"
#include "preprocess/formats/common/hdf5_objects.h"
#include "preprocess/formats/common/library_trial.h"
#include "stream/base/error.h"

namespace curvisplat {
namespace {

constexpr size_t kNameBytes = 33, kLabelBytes = 33, kTypeBytes = 3;
constexpr const char* kData = " data";
constexpr const char* kLink = " link";
// Written by versions of libcgns before 3.0, which stored dimensions in the opposite order.
constexpr const char* kOldVersion = " version";
constexpr const char* kLibraryVersion = "CGNSLibraryVersion";
constexpr int kMaxLinks = 100;
// Smallest size of a node in a file: a link, and a group with three attributes.
constexpr uint64_t kMinGroupBytes = 32;
constexpr uint64_t kSmallFileNodes = 4096;
constexpr size_t kTriedNodes = 5000;

std::string placeOf(const std::string& node_path) {
  return node_path.empty() ? "the root" : node_path;
}

}  // namespace

CgnsHdf5::CgnsHdf5(std::filesystem::path path) : path_(std::move(path)) {
  tryHdf5(path_, [this] {
    size_t most = kTriedNodes;
    CgnsHdf5(path_).visitAll({}, 0, most);
  });
  watched_ = WatchedFiles({path_.string()});
  const QuietHdf5 quiet;
  Hdf5File file(H5Fopen(path_.c_str(), H5F_ACC_RDONLY, H5P_DEFAULT));
  if (!file) unreadable("", "the file");
  // Programs other than libcgns may leave out the root's attributes; attributes that exist must be valid.
  const Hdf5Group root(H5Gopen2(file.id(), "/", H5P_DEFAULT));
  if (!root) unreadable("", "the root");
  const auto check = [&](const char* attribute, size_t max_bytes) {
    if (H5Aexists(root.id(), attribute) > 0) text(root, "", attribute, max_bytes);
  };
  check("name", kNameBytes);
  check("label", kLabelBytes);
  check("type", kTypeBytes);
  file_ = std::move(file);
}

CgnsHdf5::~CgnsHdf5() {
  const QuietHdf5 quiet;
  file_ = Hdf5File();
}

bool CgnsHdf5::recognises(const std::filesystem::path& path) {
  tryHdf5(path);
  const QuietHdf5 quiet;
  const Hdf5File file(H5Fopen(path.c_str(), H5F_ACC_RDONLY, H5P_DEFAULT));
  return file && H5Lexists(file.id(), kLibraryVersion, H5P_DEFAULT) > 0 &&
         Hdf5Group(H5Gopen2(file.id(), kLibraryVersion, H5P_DEFAULT));
}

void CgnsHdf5::damaged(const std::string& node_path, std::string_view what) const {
  throw Error("{}: {} {}; the file is damaged or is not CGNS: copy or write it again", path_.string(),
              placeOf(node_path), what);
}

void CgnsHdf5::unreadable(const std::string& node_path, std::string_view what) const {
  throw Error("{}: {}{}{} cannot be read as CGNS (HDF5: {}); if the file is damaged, copy or write it again",
              path_.string(), node_path, node_path.empty() ? "" : ": ", what, hdf5Reason());
}

std::string CgnsHdf5::text(const Hdf5Group& group, const std::string& node_path, const char* attribute,
                           size_t max_bytes) const {
  const auto wrong = [&](const std::string& found) {
    damaged(node_path, fmt::format("has an attribute '{}' of {}; expected text of at most {} bytes",
                                   attribute, found, max_bytes));
  };
  if (H5Aexists(group.id(), attribute) <= 0)
    damaged(node_path, fmt::format("has no attribute '{}'", attribute));
  const Hdf5Attribute open(H5Aopen(group.id(), attribute, H5P_DEFAULT));
  const std::optional<Hdf5AttributeShape> shape = shapeOf(open);
  if (!shape) unreadable(node_path, fmt::format("attribute '{}'", attribute));
  if (shape->values < 1) wrong("no value");
  // Some builds of libcgns write text as an array of one-byte integers.
  const bool letters = shape->kind == H5T_INTEGER && shape->value_bytes == 1 && shape->rank == 1;
  if (!letters) {
    if (shape->kind != H5T_STRING) wrong(describe(shape->kind));
    if (shape->variable_string) wrong("a string of variable length");
    if (shape->values != 1) wrong(fmt::format("{} strings", shape->values));
  }
  if (shape->value_bytes > max_bytes || shape->values > max_bytes)
    wrong(fmt::format("{} bytes", shape->value_bytes * shape->values));
  const Hdf5Type type(H5Aget_type(open.id()));
  std::string read(shape->value_bytes * shape->values, '\0');
  if (!type || H5Aread(open.id(), type.id(), read.data()) < 0)
    unreadable(node_path, fmt::format("attribute '{}'", attribute));
  read.resize(std::min(read.find('\0'), read.size()));
  while (!read.empty() && read.back() == ' ') read.pop_back();
  return read;
}

/// The group itself unless it is a link; otherwise the group at the end of the chain of links. If the target
/// is missing: no group if `may_be_missing`, else an Error.
Hdf5Group CgnsHdf5::behindLinks(Hdf5Group group, const std::string& node_path, bool may_be_missing) const {
  for (int links = 0; text(group, node_path, "type", kTypeBytes) == "LK"; ++links) {
    if (links == kMaxLinks) damaged(node_path, fmt::format("is behind more than {} links", kMaxLinks));
    Hdf5Group target(H5Gopen2(group.id(), kLink, H5P_DEFAULT));
    if (!target && may_be_missing) return target;
    if (!target) unreadable(node_path, "the target of its link");
    group = std::move(target);
  }
  return group;
}

/// The group that holds a node's data and its children.
Hdf5Group CgnsHdf5::open(const std::string& node_path) const {
  Hdf5Group group(H5Gopen2(file_.id(), "/", H5P_DEFAULT));
  if (!group) unreadable("", "the root");
  for (size_t begin = 1; begin < node_path.size();) {
    const size_t end = std::min(node_path.find('/', begin), node_path.size());
    const std::string name = node_path.substr(begin, end - begin);
    Hdf5Group below(H5Gopen2(group.id(), name.c_str(), H5P_DEFAULT));
    if (!below) unreadable(node_path, "the node");
    group = behindLinks(std::move(below), node_path.substr(0, end), false);
    begin = end + 1;
  }
  return group;
}

/// Limits the number of nodes listed to what the files can hold, since links may form cycles.
void CgnsHdf5::count(const Hdf5Group& group, size_t nodes, const std::string& node_path) const {
  std::string name(static_cast<size_t>(std::max<ssize_t>(0, H5Fget_name(group.id(), nullptr, 0))) + 1, '\0');
  H5Fget_name(group.id(), name.data(), name.size());
  if (files_.insert(name).second) {
    const Hdf5File file(H5Iget_file_id(group.id()));
    hsize_t bytes = 0;
    if (!file || H5Fget_filesize(file.id(), &bytes) < 0) unreadable(node_path, "the file");
    files_bytes_ += bytes;
  }
  nodes_listed_ += nodes;
  const uint64_t most = kSmallFileNodes + files_bytes_ / kMinGroupBytes;
  if (nodes_listed_ > most)
    damaged(node_path, fmt::format("has {} child nodes, which makes {} in all, more than the files can hold",
                                   nodes, nodes_listed_));
}

std::vector<CgnsNode> CgnsHdf5::children(const CgnsNode& node) const {
  const QuietHdf5 quiet;
  const Hdf5Group group = open(node.path);
  std::optional<std::vector<Hdf5Link>> links = linksOf(group.id());
  if (!links) unreadable(node.path, "the list of its child nodes");
  std::erase_if(*links, [](const Hdf5Link& link) { return link.name.starts_with(' '); });
  count(group, links->size(), node.path);

  std::vector<CgnsNode> nodes;
  for (const Hdf5Link& link : *links) {
    CgnsNode child{node.path + "/" + link.name, link.name, "", node.linked || link.external};
    Hdf5Group own(H5Gopen2(group.id(), link.name.c_str(), H5P_DEFAULT));
    if (!own) unreadable(child.path, "the node");
    text(own, child.path, "name", kNameBytes);
    child.linked |= text(own, child.path, "type", kTypeBytes) == "LK";
    // The target of a link may be missing; that is an Error only when its data are read.
    if (const Hdf5Group target = behindLinks(std::move(own), child.path, true))
      child.label = text(target, child.path, "label", kLabelBytes);
    nodes.push_back(std::move(child));
  }
  return nodes;
}

void CgnsHdf5::visitAll(const CgnsNode& node, int depth, size_t& most) const {
  constexpr int kMaxDepth = 8;  // links may form cycles
  if (depth > kMaxDepth) return;
  // An Error may be of a node that nobody needs.
  const auto quietly = [](const auto& call) {
    try {
      call();
    } catch (const Error&) {
    }
  };
  std::vector<CgnsNode> nodes;
  quietly([&] { nodes = children(node); });
  for (const CgnsNode& child : nodes) {
    if (most == 0) return;
    --most;
    quietly([&] { shape(child); });
    visitAll(child, depth + 1, most);
  }
}

CgnsHdf5::Data CgnsHdf5::openData(const Hdf5Group& group, const std::string& node_path) const {
  Data data{Hdf5DataSet(H5Dopen2(group.id(), kData, H5P_DEFAULT)), Hdf5Space()};
  if (data.set) data.space = Hdf5Space(H5Dget_space(data.set.id()));
  if (!data.space) unreadable(node_path, "its data");
  return data;
}

CgnsShape CgnsHdf5::shape(const CgnsNode& node) const {
  const QuietHdf5 quiet;
  const Hdf5Group group = open(node.path);
  CgnsShape shape{text(group, node.path, "type", kTypeBytes), {}};
  if (shape.type == "MT") return shape;
  const Data data = openData(group, node.path);
  std::array<hsize_t, H5S_MAX_RANK> dims{};
  const int rank = H5Sget_simple_extent_ndims(data.space.id());
  if (rank < 0 || H5Sget_simple_extent_dims(data.space.id(), dims.data(), nullptr) != rank)
    unreadable(node.path, "the shape of its data");
  if (rank > 1) {
    const Hdf5Group root(H5Gopen2(group.id(), "/", H5P_DEFAULT));
    if (root && H5Lexists(root.id(), kOldVersion, H5P_DEFAULT) > 0)
      throw Error(
          "{}: {} stores its dimensions in the order of CGNS before 3.0; write the file again with CGNS 3.0 "
          "or later",
          path_.string(), node.path);
  }
  shape.dims.assign(dims.begin(), dims.begin() + rank);
  std::reverse(shape.dims.begin(), shape.dims.end());
  return shape;
}

void CgnsHdf5::checkNumbers(const Data& data, const std::string& node_path) const {
  const Hdf5Type type(H5Dget_type(data.set.id()));
  const H5T_class_t kind = type ? H5Tget_class(type.id()) : H5T_NO_CLASS;
  if (kind != H5T_INTEGER && kind != H5T_FLOAT)
    damaged(node_path, fmt::format("has data of {}; expected numbers", describe(kind)));
}

void CgnsHdf5::readAll(const CgnsNode& node, std::span<double> to) const {
  const QuietHdf5 quiet;
  const Data data = openData(open(node.path), node.path);
  checkNumbers(data, node.path);
  const hssize_t count = H5Sget_simple_extent_npoints(data.space.id());
  if (count < 0 || static_cast<uint64_t>(count) != to.size())
    damaged(node.path, fmt::format("has {} values; expected {}", count, to.size()));
  if (H5Dread(data.set.id(), H5T_NATIVE_DOUBLE, H5S_ALL, H5S_ALL, H5P_DEFAULT, to.data()) < 0)
    unreadable(node.path, "its data");
}

void CgnsHdf5::readAll(const CgnsNode& node, std::span<char> to) const {
  const QuietHdf5 quiet;
  const Data data = openData(open(node.path), node.path);
  const Hdf5Type type(H5Dget_type(data.set.id()));
  const H5T_class_t kind = type ? H5Tget_class(type.id()) : H5T_NO_CLASS;
  if (kind != H5T_INTEGER || H5Tget_size(type.id()) != 1)
    damaged(node.path, fmt::format("has data of {}; expected text", describe(kind)));
  const hssize_t count = H5Sget_simple_extent_npoints(data.space.id());
  if (count < 0 || static_cast<uint64_t>(count) != to.size())
    damaged(node.path, fmt::format("has {} characters; expected {}", count, to.size()));
  if (H5Dread(data.set.id(), H5T_NATIVE_CHAR, H5S_ALL, H5S_ALL, H5P_DEFAULT, to.data()) < 0)
    unreadable(node.path, "its data");
}

void CgnsHdf5::readBox(const CgnsNode& node, const CgnsBox& box, hid_t type, void* to) const {
  const QuietHdf5 quiet;
  const Data data = openData(open(node.path), node.path);
  checkNumbers(data, node.path);
  std::array<hsize_t, H5S_MAX_RANK> dims{};
  const int rank = H5Sget_simple_extent_ndims(data.space.id());
  if (rank < 1 || rank > 3 || H5Sget_simple_extent_dims(data.space.id(), dims.data(), nullptr) != rank)
    damaged(node.path, "has data of more than three dimensions");
  // A list is a row.
  const auto absent = static_cast<size_t>(3 - rank);
  std::rotate(dims.begin(), dims.begin() + rank, dims.begin() + 3);
  std::fill_n(dims.begin(), absent, hsize_t{1});
  std::array<hsize_t, 3> first, count;
  for (size_t axis = 0; axis < 3; ++axis) {
    first[2 - axis] = box.first[axis];
    count[2 - axis] = box.count[axis];
    if (dims[2 - axis] < box.first[axis] || dims[2 - axis] - box.first[axis] < box.count[axis])
      damaged(node.path, fmt::format("has {} values along {}; expected {}", dims[2 - axis], "ijk"[axis],
                                     box.first[axis] + box.count[axis]));
  }
  CURVISPLAT_CHECK_OP(box.count[0], <=, box.memory[0]);
  CURVISPLAT_CHECK_OP(box.count[1], <=, box.memory[1]);
  const std::array<hsize_t, 3> memory_dims{box.count[2], box.memory[1], box.memory[0]}, none{};
  const Hdf5Space memory(H5Screate_simple(3, memory_dims.data(), nullptr));
  if (!memory ||
      H5Sselect_hyperslab(memory.id(), H5S_SELECT_SET, none.data(), nullptr, count.data(), nullptr) < 0 ||
      H5Sselect_hyperslab(data.space.id(), H5S_SELECT_SET, first.data() + absent, nullptr,
                          count.data() + absent, nullptr) < 0 ||
      H5Dread(data.set.id(), type, memory.id(), data.space.id(), H5P_DEFAULT, to) < 0)
    unreadable(node.path, "its data");
  watched_.requireWhole();
}

void CgnsHdf5::read(const CgnsNode& node, const CgnsBox& box, double* to) const {
  readBox(node, box, H5T_NATIVE_DOUBLE, to);
}

void CgnsHdf5::read(const CgnsNode& node, const CgnsBox& box, float* to) const {
  readBox(node, box, H5T_NATIVE_FLOAT, to);
  // HDF5 makes 0 of doubles that are too small.
  const size_t plane = box.memory[0] * box.memory[1];
  std::vector<size_t> rows;
  for (size_t k = 0; k < box.count[2]; ++k)
    for (size_t j = 0; j < box.count[1]; ++j) rows.push_back(k * plane + j * box.memory[0]);
  const auto isZero = [](float value) { return value == 0; };
  if (!std::all_of(rows.begin(), rows.end(),
                   [&](size_t row) { return std::all_of(to + row, to + row + box.count[0], isZero); }))
    return;
  std::vector<double> stored(plane * box.count[2]);
  read(node, box, stored.data());
  for (const size_t row : rows)
    std::transform(&stored[row], &stored[row] + box.count[0], to + row, convertedTo<float, double>);
}

}  // namespace curvisplat
