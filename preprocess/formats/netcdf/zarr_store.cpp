#include "preprocess/formats/netcdf/zarr_store.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cstring>
#include <set>
#include <string_view>

#include "preprocess/formats/common/byte_source.h"
#include "stream/base/error.h"

namespace curvisplat {
namespace {

namespace fs = std::filesystem;

constexpr uint64_t kMaxDirectoryBytes = uint64_t{256} << 20;
constexpr std::string_view kLocalMark("PK\3\4", 4), kMemberMark("PK\1\2", 4), kEndMark("PK\5\6", 4),
    kEnd64Mark("PK\6\6", 4), kLocator64Mark("PK\6\7", 4);

template <typename Number>
uint64_t littleAt(std::string_view bytes, size_t at) {
  return loadStored<Number>(reinterpret_cast<const std::byte*>(bytes.data() + at),
                            kMachineByteOrder == ByteOrder::kBig);
}

std::string textAt(const InputFile& file, uint64_t at, uint64_t count) {
  std::string text(count, '\0');
  file.readAt(at, std::span(text.data(), text.size()));
  return text;
}

[[noreturn]] void damaged(const InputFile& file, std::string_view what) {
  throw Error("{}: is a ZIP archive whose {}; it is truncated or damaged: copy or write it again",
              file.path().string(), what);
}

struct Directory {
  uint64_t begin = 0, bytes = 0;
};

/// The place of the list of members, by the records at the archive's end.
/// Source: APPNOTE.TXT of PKWARE, sections 4.3.14 to 4.3.16.
Directory directoryOf(const InputFile& file) {
  constexpr uint64_t kEndBytes = 22, kLocatorBytes = 20, kMaxComment = 65535, kEnd64Bytes = 56;
  const uint64_t tail_bytes = std::min(file.size(), kEndBytes + kMaxComment + kLocatorBytes);
  const uint64_t tail_begin = file.size() - tail_bytes;
  const std::string tail = textAt(file, tail_begin, tail_bytes);
  const size_t end =
      tail_bytes < kEndBytes ? std::string::npos : tail.rfind(kEndMark, tail_bytes - kEndBytes);
  if (end == std::string::npos) damaged(file, "list of members is missing");
  Directory directory{littleAt<uint32_t>(tail, end + 16), littleAt<uint32_t>(tail, end + 12)};
  if (end >= kLocatorBytes &&
      std::string_view(tail).substr(end - kLocatorBytes).starts_with(kLocator64Mark)) {
    const uint64_t at = littleAt<uint64_t>(tail, end - kLocatorBytes + 8);
    if (at > file.size() || file.size() - at < kEnd64Bytes) damaged(file, "list of members is missing");
    const std::string record = textAt(file, at, kEnd64Bytes);
    if (!record.starts_with(kEnd64Mark)) damaged(file, "list of members is missing");
    directory = {littleAt<uint64_t>(record, 48), littleAt<uint64_t>(record, 40)};
  }
  if (directory.begin > file.size() || directory.bytes > file.size() - directory.begin)
    damaged(file, "list of members lies outside of it");
  if (directory.bytes > kMaxDirectoryBytes)
    throw Error(
        "{}: is a ZIP archive with a list of members of {} MiB (expected at most {}); extract it first",
        file.path().string(), directory.bytes >> 20, kMaxDirectoryBytes >> 20);
  return directory;
}

}  // namespace

bool isZip(const InputFile& file) {
  return file.size() > kLocalMark.size() && textAt(file, 0, kLocalMark.size()) == kLocalMark;
}

std::vector<std::byte> ZarrValue::read(uint64_t first, uint64_t count) const {
  if (first > size || count > size - first)
    throw Error("{}: is truncated (found {} bytes, expected {}); copy or write it again",
                file->path().string(), size, first + count);
  std::vector<std::byte> bytes(count);
  file->readAt(begin + first, std::span(bytes));
  return bytes;
}

std::string ZarrValue::text() const {
  constexpr uint64_t kMaxText = 16 << 20;
  if (size > kMaxText)
    throw Error("{}: has {} bytes of metadata; expected at most {}", file->path().string(), size, kMaxText);
  return textAt(*file, begin, size);
}

ZarrStore::ZarrStore(const fs::path& path) : path_(path) {
  std::error_code error;
  if (fs::is_directory(path, error)) return;
  archive_ = std::make_shared<const InputFile>(path);
  readDirectory();
}

void ZarrStore::readDirectory() {
  constexpr size_t kHeaderBytes = 46;
  constexpr uint64_t kElsewhere = 0xffffffff;  // in the member's extra field
  const Directory directory = directoryOf(*archive_);
  const std::string list = textAt(*archive_, directory.begin, directory.bytes);
  for (size_t at = 0; at + kHeaderBytes <= list.size();) {
    const std::string_view entry = std::string_view(list).substr(at);
    if (!entry.starts_with(kMemberMark)) break;
    const size_t name_bytes = littleAt<uint16_t>(entry, 28), extra_bytes = littleAt<uint16_t>(entry, 30),
                 comment_bytes = littleAt<uint16_t>(entry, 32);
    if (name_bytes + extra_bytes + comment_bytes > entry.size() - kHeaderBytes)
      damaged(*archive_, "list of members ends early");
    Member member{littleAt<uint32_t>(entry, 42), littleAt<uint32_t>(entry, 24), littleAt<uint32_t>(entry, 20),
                  static_cast<int>(littleAt<uint16_t>(entry, 10))};
    // Numbers that do not fit in four bytes are in the field 1, in this order.
    const std::string_view extra = entry.substr(kHeaderBytes + name_bytes, extra_bytes);
    for (size_t field = 0; field + 4 <= extra.size(); field += 4 + littleAt<uint16_t>(extra, field + 2)) {
      if (littleAt<uint16_t>(extra, field) != 1) continue;
      size_t number = field + 4;
      for (uint64_t* const value : {&member.size, &member.stored, &member.header})
        if (*value == kElsewhere && number + 8 <= extra.size()) {
          *value = littleAt<uint64_t>(extra, number);
          number += 8;
        }
    }
    members_[std::string(entry.substr(kHeaderBytes, name_bytes))] = member;
    at += kHeaderBytes + name_bytes + extra_bytes + comment_bytes;
  }
  for (const auto& [name, member] : members_)
    for (const std::string_view mark : {".zgroup", "zarr.json"})
      if (std::string_view(name).ends_with(mark) && std::count(name.begin(), name.end(), '/') <= 1 &&
          (root_.empty() || name.size() - mark.size() < root_.size()))
        root_ = name.substr(0, name.size() - mark.size());
  for (const char* mark : {".zgroup", "zarr.json"})
    if (members_.contains(mark)) root_.clear();
}

std::optional<ZarrValue> ZarrStore::find(const std::string& key) const {
  if (!archive_) {
    const fs::path path = path_ / key;
    if (!isFileThere(path)) return std::nullopt;
    auto file = std::make_shared<const InputFile>(path);
    const uint64_t size = file->size();
    return ZarrValue{std::move(file), 0, size};
  }
  const auto found = members_.find(root_ + key);
  if (found == members_.end()) return std::nullopt;
  const Member& member = found->second;
  if (member.method != 0)
    throw Error(
        "{}: {} is compressed by the archive, which is not read; extract it, or write it without (zip -0)",
        path_.string(), key);
  // The name and the extra field before the bytes need not be those of the list.
  constexpr uint64_t kHeaderBytes = 30;
  if (member.header > archive_->size() || archive_->size() - member.header < kHeaderBytes)
    damaged(*archive_, "members lie outside of it");
  const std::string header = textAt(*archive_, member.header, kHeaderBytes);
  const uint64_t begin =
      member.header + kHeaderBytes + littleAt<uint16_t>(header, 26) + littleAt<uint16_t>(header, 28);
  if (!header.starts_with(kLocalMark) || begin > archive_->size() || member.size > archive_->size() - begin)
    damaged(*archive_, "members lie outside of it");
  return ZarrValue{archive_, begin, member.size};
}

std::vector<std::string> ZarrStore::folders() const {
  std::set<std::string> folders;
  if (archive_) {
    for (const auto& [name, member] : members_)
      if (const size_t end = name.find('/', root_.size());
          name.starts_with(root_) && end != std::string::npos)
        folders.insert(name.substr(root_.size(), end - root_.size()));
  } else {
    std::error_code error;
    for (fs::directory_iterator at(path_, error), end; !error && at != end; at.increment(error))
      if (std::error_code ignored; at->is_directory(ignored)) folders.insert(at->path().filename().string());
  }
  return {folders.begin(), folders.end()};
}

bool ZarrStore::hasBytes(const std::string& folder, double bytes) const {
  double found = 0;
  if (archive_) {
    const std::string prefix = root_ + folder + '/';
    for (auto at = members_.lower_bound(prefix); at != members_.end() && at->first.starts_with(prefix); ++at)
      found += static_cast<double>(at->second.size);
    // The list of members may state any sizes.
    return std::min(found, static_cast<double>(archive_->size())) >= bytes;
  }
  std::error_code error;
  for (fs::recursive_directory_iterator at(path_ / folder, error), end; !error && at != end && found < bytes;
       at.increment(error)) {
    std::error_code ignored;
    const uint64_t size = at->is_regular_file(ignored) ? at->file_size(ignored) : 0;
    if (!ignored) found += static_cast<double>(size);
  }
  return found >= bytes;
}

}  // namespace curvisplat
