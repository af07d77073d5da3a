#include "stream/cache/faces_file.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>

#include "stream/base/checksum.h"
#include "stream/base/error.h"
#include "stream/cache/cache_index.h"
#include "stream/cache/stream_file.h"
#include "stream/codec/face_codec.h"

namespace curvisplat {
namespace {

constexpr uint64_t kMaxTableBytes = uint64_t{1} << 30;
constexpr uint64_t kMaxNodes = uint64_t{1} << 40;  // along an axis

template <size_t N>
std::array<char, N> padded(const std::string& text) {
  std::array<char, N> out{};
  std::copy_n(text.begin(), std::min(text.size(), N), out.begin());
  return out;
}

template <size_t N>
std::string unpadded(const std::array<char, N>& text) {
  return oneLine(std::string(text.begin(), std::find(text.begin(), text.end(), '\0')));
}

FaceRecord storedRecord(const GridFace& face) {
  return {face.block,
          static_cast<uint8_t>(face.axis),
          static_cast<uint8_t>(face.side),
          0,
          face.index,
          {face.nodes[0], face.nodes[1]},
          face.root,
          0};
}

PatchRecord storedRecord(const FacePatch& patch) {
  PatchRecord record{};
  record.face = patch.face;
  record.first_child = patch.first_child;
  record.child_count = patch.child_count;
  record.error = patch.error;
  record.length = patch.extent.length;
  record.offset = patch.extent.offset;
  record.checksum = patch.extent.checksum;
  for (size_t n = 0; n < 2; ++n) {
    record.stride[n] = patch.stride[n];
    record.nodes[n] = patch.nodes[n];
    record.first[n] = patch.first[n];
  }
  for (int axis = 0; axis < 3; ++axis) {
    record.lower[axis] = patch.lower[axis];
    record.upper[axis] = patch.upper[axis];
  }
  return record;
}

RegionRecord storedRecord(const FaceRegion& region) {
  return {region.face,
          0,
          {region.first[0], region.first[1]},
          {region.last[0], region.last[1]},
          padded<64>(region.name),
          padded<32>(region.type)};
}

/// Takes records from the front of a table.
class TableBytes {
 public:
  explicit TableBytes(std::span<const std::byte> bytes) : rest_(bytes) {}

  template <typename Record>
  std::vector<Record> read(size_t count) {
    std::vector<Record> records(count);
    if (count > 0) std::memcpy(records.data(), rest_.data(), count * sizeof(Record));
    rest_ = rest_.subspan(count * sizeof(Record));
    return records;
  }

 private:
  std::span<const std::byte> rest_;
};

/// Refuses invalid tables. What uses the tables relies on these checks.
class FacesChecker {
 public:
  FacesChecker(const std::filesystem::path& path, std::span<const GridFace> faces,
               std::span<const FacePatch> patches)
      : path_(path), faces_(faces), patches_(patches) {}

  void checkFace(size_t n) const {
    const GridFace& face = faces_[n];
    if (face.axis > 2 || face.side > FaceSide::kPlane) refuse("face", n, "its axis or side is invalid");
    for (const uint64_t nodes : face.nodes)
      if (nodes < 2 || nodes > kMaxNodes)
        refuse("face", n, fmt::format("it has {} nodes along an axis", nodes));
    if (face.root >= patches_.size() || patches_[face.root].face != n)
      refuse("face", n, "its coarsest patch belongs to another face");
  }

  void checkPatch(size_t n, uint64_t streams_end, size_t variables) const {
    const FacePatch& patch = patches_[n];
    if (patch.face >= faces_.size()) refuse("patch", n, "its face is not listed");
    const GridFace& face = faces_[patch.face];
    for (size_t along = 0; along < 2; ++along) {
      const uint64_t nodes = patch.nodes[along], last = face.nodes[along] - 1;
      const bool fits = nodes >= 2 && nodes <= kPatchQuads + 1 && std::has_single_bit(patch.stride[along]) &&
                        patch.first[along] < last &&
                        patch.first[along] + (nodes - 2) * patch.stride[along] < last;
      if (!fits) refuse("patch", n, "its nodes are not those of its face");
    }
    bool sound = std::isfinite(patch.error) && patch.error >= 0;
    for (int axis = 0; axis < 3; ++axis)
      sound = sound && std::isfinite(patch.lower[axis]) && std::isfinite(patch.upper[axis]) &&
              patch.lower[axis] <= patch.upper[axis];
    if (!sound) refuse("patch", n, "its box or its error is not finite");
    if (patch.child_count > 0)
      if (patch.first_child <= n || patch.first_child > patches_.size() ||
          patch.child_count > patches_.size() - patch.first_child)
        refuse("patch", n, "its children do not follow it");
    for (size_t c = patch.first_child; c < patch.first_child + size_t{patch.child_count}; ++c)
      if (patches_[c].face != patch.face) refuse("patch", n, "its children are of another face");
    const uint64_t most = patch.nodeCount() * 8 * (4 + variables) + 4096;
    if (patch.extent.offset < sizeof(FacesHeader) || patch.extent.length > most ||
        patch.extent.offset > streams_end || patch.extent.length > streams_end - patch.extent.offset)
      refuse("patch", n, "its stream is outside the file");
  }

  void checkTree() const {
    size_t reached = faces_.size();
    for (const FacePatch& patch : patches_) reached += patch.child_count;
    if (reached != patches_.size())
      throw Error(
          "{}: has {} patches, but its faces and patches refer to {}; the file is damaged: convert again",
          path_.string(), patches_.size(), reached);
  }

  void checkRegion(size_t n, const FaceRegion& region) const {
    if (region.face >= faces_.size()) refuse("region", n, "its face is not listed");
    for (size_t along = 0; along < 2; ++along)
      if (!(region.first[along] < region.last[along] &&
            region.last[along] < faces_[region.face].nodes[along]))
        refuse("region", n, "its nodes are not those of its face");
  }

 private:
  [[noreturn]] void refuse(const char* what, size_t n, const std::string& why) const {
    throw Error("{}: {} {}: {}; the file is damaged: convert again", path_.string(), what, n, why);
  }

  const std::filesystem::path& path_;
  std::span<const GridFace> faces_;
  std::span<const FacePatch> patches_;
};

}  // namespace

std::string facesFileOfVariable(uint32_t number) {
  return fmt::format("faces.var{}.bin", number);
}

std::string facesFileOfStep(uint64_t step) {
  return fmt::format("faces.step{}.bin", step);
}

bool isFacesFile(const std::string& name) {
  return name.starts_with("faces.") && name.ends_with(".bin");
}

FacesWriter::FacesWriter(const std::filesystem::path& path, const FaceBox& box,
                         std::vector<uint32_t> variables)
    : file_(path), box_(box), variables_(std::move(variables)) {
  file_.append(bytesOf(FacesHeader{}));
}

Extent FacesWriter::append(std::span<const std::byte> stream) {
  const uint64_t offset = appendStream(file_, stream);
  return {offset, static_cast<uint32_t>(stream.size()), checksumOf(stream)};
}

FileInfo FacesWriter::finish(std::span<const GridFace> faces, std::span<const std::vector<FacePatch>> patches,
                             std::span<const FaceRegion> regions) {
  padToPage(file_);
  FacesHeader header;
  header.variables = static_cast<uint32_t>(variables_.size());
  header.faces = static_cast<uint32_t>(faces.size());
  uint64_t count = 0;
  for (const std::vector<FacePatch>& of_face : patches) count += of_face.size();
  header.patches = static_cast<uint32_t>(count);
  header.regions = static_cast<uint32_t>(regions.size());
  header.table_offset = file_.size();
  for (int axis = 0; axis < 3; ++axis) {
    header.lower[axis] = box_.lower[axis];
    header.step[axis] = box_.step[axis];
  }
  std::vector<FaceRecord> face_records;
  for (const GridFace& face : faces) face_records.push_back(storedRecord(face));
  std::vector<RegionRecord> region_records;
  for (const FaceRegion& region : regions) region_records.push_back(storedRecord(region));
  Checksum checksum;
  checksum.add(bytesOf(header));
  const auto append = [&](std::span<const std::byte> part) {
    file_.append(part);
    checksum.add(part);
  };
  append(bytesOf(variables_));
  append(bytesOf(face_records));
  // A few at a time: long thin grids have a million.
  constexpr size_t kRecordsAtOnce = 4096;
  std::vector<PatchRecord> records;
  for (const std::vector<FacePatch>& of_face : patches)
    for (const FacePatch& patch : of_face) {
      records.push_back(storedRecord(patch));
      if (records.size() < kRecordsAtOnce) continue;
      append(bytesOf(records));
      records.clear();
    }
  append(bytesOf(records));
  append(bytesOf(region_records));
  file_.writeAt(0, bytesOf(header));
  const FileInfo info{file_.path().filename().string(), file_.size(), checksum.value()};
  file_.close();
  return info;
}

std::shared_ptr<const FacesReader> FacesReader::open(const std::filesystem::path& folder,
                                                     const Manifest& manifest, const std::string& name) {
  const FileInfo* const info = manifest.file(name);
  if (!info) return nullptr;
  return std::shared_ptr<const FacesReader>(new FacesReader(cacheFile(folder, name.c_str()), *info));
}

FacesReader::FacesReader(const std::filesystem::path& path, const FileInfo& info) : file_(path) {
  checkSize(path, file_.size(), info);
  FacesHeader header;
  if (file_.size() < sizeof header)
    throw Error("{}: is truncated (found {} bytes); convert again", path.string(), file_.size());
  file_.readAt(0, std::span(&header, 1));
  if (header.magic != kFacesMagic || header.version != 1)
    throw Error("{}: is not a file of faces that this program reads (version {}, expected 1); convert again",
                path.string(), header.version);
  const uint64_t table_bytes =
      uint64_t{header.variables} * sizeof(uint32_t) + uint64_t{header.faces} * sizeof(FaceRecord) +
      uint64_t{header.patches} * sizeof(PatchRecord) + uint64_t{header.regions} * sizeof(RegionRecord);
  if (header.table_offset < sizeof header || header.table_offset > file_.size() ||
      table_bytes != file_.size() - header.table_offset || table_bytes > kMaxTableBytes)
    throw Error("{}: its table has {} bytes at {}; expected it to end the file of {}; convert again",
                path.string(), table_bytes, header.table_offset, file_.size());
  std::vector<std::byte> bytes(table_bytes);
  file_.readAt(header.table_offset, std::span(bytes));
  Checksum checksum;
  checksum.add(bytesOf(header));
  checksum.add(bytes);
  if (checksum.value() != info.checksum)
    throw Error(
        "{}: has a wrong checksum (found {:016x}, expected {:016x}); the file is damaged: convert again",
        path.string(), checksum.value(), info.checksum);
  for (int axis = 0; axis < 3; ++axis) {
    box_.lower[axis] = header.lower[axis];
    box_.step[axis] = header.step[axis];
    constexpr double kLargest = 1e100;
    if (!(std::abs(box_.lower[axis]) <= kLargest && box_.step[axis] >= 0 && box_.step[axis] <= kLargest))
      throw Error("{}: its box is not finite; the file is damaged: convert again", path.string());
  }
  TableBytes table(bytes);
  variables_ = table.read<uint32_t>(header.variables);
  for (const FaceRecord& r : table.read<FaceRecord>(header.faces))
    faces_.push_back(
        {r.block, r.axis, static_cast<FaceSide>(r.side), r.index, {r.nodes[0], r.nodes[1]}, r.root});
  for (const PatchRecord& r : table.read<PatchRecord>(header.patches))
    patches_.push_back({r.face,
                        {r.first[0], r.first[1]},
                        {r.stride[0], r.stride[1]},
                        {r.nodes[0], r.nodes[1]},
                        r.first_child,
                        r.child_count,
                        r.error,
                        {r.lower[0], r.lower[1], r.lower[2]},
                        {r.upper[0], r.upper[1], r.upper[2]},
                        {r.offset, r.length, r.checksum}});
  for (const RegionRecord& r : table.read<RegionRecord>(header.regions))
    regions_.push_back(
        {r.face, {r.first[0], r.first[1]}, {r.last[0], r.last[1]}, unpadded(r.name), unpadded(r.type)});
  const FacesChecker checker(path, faces_, patches_);
  for (size_t n = 0; n < faces_.size(); ++n) checker.checkFace(n);
  for (size_t n = 0; n < patches_.size(); ++n) checker.checkPatch(n, header.table_offset, variables_.size());
  checker.checkTree();
  for (size_t n = 0; n < regions_.size(); ++n) checker.checkRegion(n, regions_[n]);
}

std::optional<size_t> FacesReader::scalarOf(uint32_t variable_number) const {
  const auto found = std::find(variables_.begin(), variables_.end(), variable_number);
  if (found == variables_.end()) return std::nullopt;
  return static_cast<size_t>(found - variables_.begin());
}

PatchNodes FacesReader::read(uint32_t patch_number) const {
  const FacePatch& patch = patches_[patch_number];
  std::vector<std::byte> bytes(patch.extent.length);
  file_.readAt(patch.extent.offset, std::span(bytes));
  try {
    if (const uint64_t found = checksumOf(bytes); found != patch.extent.checksum)
      throw Error("has a wrong checksum (found {:016x}, expected {:016x})", found, patch.extent.checksum);
    return decodePatch(patch, variables_.size(), box_, bytes);
  } catch (const Error& error) {
    throw Error("{}: patch {} of the faces: {}; the file is damaged: convert again", path().string(),
                patch_number, error.what());
  }
}

}  // namespace curvisplat
