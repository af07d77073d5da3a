// The state after the power goes at any moment of a conversion, an addition, or the writing of a picture: a
// cache that is whole, or none; the old one or the new one. Calls are recorded as they are made, and
// replayed on a model of a disk that keeps for certain only what was synced:
//
//   a file's bytes      as they were at its last fsync, or later ones, or zeros in their place, or half of them
//   names in a folder   as they were at the last fsync of the folder, or as they are; each folder on its own
//                       (a file system's journal is kinder, and promises no more than this)
//
// Renaming and exchanging within a folder is one step.
#include <fcntl.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <set>
#include <string>
#include <vector>

#include "render/image/image.h"
#include "render/image/image_file.h"
#include "stream/base/error.h"
#include "stream/base/file.h"
#include "stream/cache/cache_reader.h"
#include "tests/faults/small_conversion.h"
#include "tests/support/fault_sweep.h"
#include "tests/support/temporary_folder.h"

namespace curvisplat::faults {
namespace {

/// One call that changes the disk.
struct DiskCall {
  enum class Kind { kOpen, kWrite, kTruncate, kSync, kRename, kExchange, kMakeFolder, kRemove } kind;
  std::string path, other;  // as given
  int fd = -1;
  int flags = 0;
  int64_t offset = 0;  // or size
  std::string bytes;
};

/// Does the calls, but for syncing, and writes them down. Put in place with ScopedSystemCalls; any thread.
class RecordingSystemCalls : public SystemCalls {
 public:
  /// The calls in their order, when no more are made.
  const std::vector<DiskCall>& calls() const { return calls_; }

  int open(const char* path, int flags, unsigned mode) override;
  ssize_t pwrite(int fd, const void* from, size_t count, int64_t offset) override;
  int truncate(int fd, int64_t size) override;
  int fsync(int fd) override;
  int rename(const char* from, const char* to) override;
  int exchange(const char* a, const char* b) override;
  int mkdir(const char* path, unsigned mode) override;
  int remove(const char* path) override;

 private:
  std::mutex mutex_;  // the order of calls is that of their effects
  std::vector<DiskCall> calls_;
};

/// Folders below the root, and their files.
using DiskState = std::map<std::string, Files>;

/// Calls `check` with every state that a loss of power could leave of what is below `root` (folders, and
/// files in them; files in the root itself are in the folder ""), and with the number of calls made until
/// then: as nextInSweep() says, and at the last ones, which put files into place. `before`: what was there for
/// certain before the first of `calls`. A state that has been checked is not checked again. Returns after how
/// many numbers of calls the power was lost.
size_t forEachPowerLoss(const std::filesystem::path& root, const DiskState& before,
                        const std::vector<DiskCall>& calls,
                        const std::function<void(const DiskState&, size_t call)>& check);

using Kind = DiskCall::Kind;

/// A file or a folder, as it is and as it was when it was synced last.
struct Node {
  bool is_folder = false;
  std::string bytes, synced_bytes;
  using Names = std::map<std::string, std::shared_ptr<Node>>;
  Names names, synced_names;
};
using NodeOf = std::shared_ptr<Node>;

enum class Unsynced { kLost, kKept, kZeros, kHalf };

class Disk {
 public:
  Disk(const std::filesystem::path& root, const DiskState& before)
      : root_path_(root.string()), root_(std::make_shared<Node>()) {
    root_->is_folder = true;
    for (const auto& [name, files] : before) {
      NodeOf folder = root_;
      if (!name.empty()) {
        folder = root_->names[name] = std::make_shared<Node>();
        folder->is_folder = true;
      }
      for (const auto& [file, bytes] : files) {
        const auto node = folder->names[file] = std::make_shared<Node>();
        node->bytes = node->synced_bytes = bytes;
      }
      folder->synced_names = folder->names;
    }
    root_->synced_names = root_->names;
  }

  void apply(const DiskCall& call) {
    switch (call.kind) {
      case Kind::kOpen:
        return open(call);
      case Kind::kWrite:
        return write(call);
      case Kind::kTruncate:
        if (const NodeOf node = opened_[call.fd]) node->bytes.resize(static_cast<size_t>(call.offset));
        return;
      case Kind::kSync:
        return sync(call);
      case Kind::kRename:
        if (const NodeOf from = parentOf(call.path)) {
          const NodeOf node = from->names.at(nameOf(call.path));
          from->names.erase(nameOf(call.path));
          parentOf(call.other)->names[nameOf(call.other)] = node;
        }
        return;
      case Kind::kExchange:
        if (const NodeOf from = parentOf(call.path))
          std::swap(from->names.at(nameOf(call.path)), parentOf(call.other)->names.at(nameOf(call.other)));
        return;
      case Kind::kMakeFolder:
        if (const NodeOf parent = parentOf(call.path)) {
          const auto node = parent->names[nameOf(call.path)] = std::make_shared<Node>();
          node->is_folder = true;
        }
        return;
      case Kind::kRemove:
        if (const NodeOf parent = parentOf(call.path)) parent->names.erase(nameOf(call.path));
        return;
    }
  }

  void forEachState(const std::function<void(const DiskState&)>& use) const {
    std::vector<const Node*> unsynced;  // folders
    std::set<const Node*> seen;
    bool has_unsynced_bytes = false;
    look(*root_, unsynced, has_unsynced_bytes, seen);
    for (size_t choice = 0; choice < size_t{1} << unsynced.size(); ++choice) {
      std::set<const Node*> old_names;
      for (size_t n = 0; n < unsynced.size(); ++n)
        if ((choice >> n & 1) != 0) old_names.insert(unsynced[n]);
      for (const Unsynced bytes : {Unsynced::kKept, Unsynced::kLost, Unsynced::kZeros, Unsynced::kHalf}) {
        DiskState state;
        fill(*root_, "", old_names, bytes, state);
        use(state);
        if (!has_unsynced_bytes) break;
      }
    }
  }

 private:
  static std::string nameOf(const std::string& path) { return std::filesystem::path(path).filename(); }

  /// Null for what is not below the root, or was not there before.
  NodeOf at(const std::string& path) const {
    if (path == root_path_) return root_;
    const NodeOf parent = parentOf(path);
    if (!parent) return nullptr;
    const auto found = parent->names.find(nameOf(path));
    return found == parent->names.end() ? nullptr : found->second;
  }
  NodeOf parentOf(const std::string& path) const {
    if (path.size() <= root_path_.size() || !path.starts_with(root_path_)) return nullptr;
    return at(std::filesystem::path(path).parent_path());
  }

  void open(const DiskCall& call) {
    NodeOf node = at(call.path);
    if (!node && (call.flags & O_CREAT) != 0)
      if (const NodeOf parent = parentOf(call.path))
        node = parent->names[nameOf(call.path)] = std::make_shared<Node>();
    if (node && (call.flags & O_TRUNC) != 0) node->bytes.clear();
    opened_[call.fd] = node;
  }

  void write(const DiskCall& call) {
    const NodeOf node = opened_[call.fd];
    if (!node) return;
    const auto begin = static_cast<size_t>(call.offset);
    if (node->bytes.size() < begin + call.bytes.size()) node->bytes.resize(begin + call.bytes.size());
    std::copy(call.bytes.begin(), call.bytes.end(), node->bytes.begin() + call.offset);
  }

  void sync(const DiskCall& call) {
    const NodeOf node = opened_[call.fd];
    if (!node) return;
    node->synced_bytes = node->bytes;
    node->synced_names = node->names;
  }

  static void look(const Node& node, std::vector<const Node*>& unsynced, bool& has_unsynced_bytes,
                   std::set<const Node*>& seen) {
    if (!seen.insert(&node).second) return;
    has_unsynced_bytes |= node.bytes != node.synced_bytes;
    if (node.names != node.synced_names) unsynced.push_back(&node);
    for (const Node::Names* names : {&node.names, &node.synced_names})
      for (const auto& [name, below] : *names) look(*below, unsynced, has_unsynced_bytes, seen);
  }

  static void fill(const Node& folder, const std::string& name, const std::set<const Node*>& old_names,
                   Unsynced bytes, DiskState& state) {
    Files& files = state[name];
    for (const auto& [below, node] : old_names.contains(&folder) ? folder.synced_names : folder.names) {
      if (node->is_folder)
        fill(*node, name.empty() ? below : name + "/" + below, old_names, bytes, state);
      else
        files[below] = bytesOf(*node, bytes);
    }
  }

  static std::string bytesOf(const Node& file, Unsynced unsynced) {
    if (file.bytes == file.synced_bytes || unsynced == Unsynced::kKept) return file.bytes;
    if (unsynced == Unsynced::kLost) return file.synced_bytes;
    if (unsynced == Unsynced::kZeros) return std::string(file.bytes.size(), '\0');
    return file.bytes.substr(0, file.bytes.size() / 2);
  }

  const std::string root_path_;
  NodeOf root_;
  std::map<int, NodeOf> opened_;  // by descriptor; null: outside of the root
};

int RecordingSystemCalls::open(const char* path, int flags, unsigned mode) {
  const std::lock_guard lock(mutex_);
  const int fd = SystemCalls::open(path, flags, mode);
  if (fd >= 0) calls_.push_back({Kind::kOpen, path, "", fd, flags, 0, ""});
  return fd;
}

ssize_t RecordingSystemCalls::pwrite(int fd, const void* from, size_t count, int64_t offset) {
  const std::lock_guard lock(mutex_);
  const ssize_t put = SystemCalls::pwrite(fd, from, count, offset);
  if (put >= 0)
    calls_.push_back({Kind::kWrite, "", "", fd, 0, offset,
                      std::string(static_cast<const char*>(from), static_cast<size_t>(put))});
  return put;
}

int RecordingSystemCalls::truncate(int fd, int64_t size) {
  const std::lock_guard lock(mutex_);
  const int result = SystemCalls::truncate(fd, size);
  if (result == 0) calls_.push_back({Kind::kTruncate, "", "", fd, 0, size, ""});
  return result;
}

int RecordingSystemCalls::fsync(int fd) {
  const std::lock_guard lock(mutex_);
  calls_.push_back({Kind::kSync, "", "", fd, 0, 0, ""});
  return 0;
}

int RecordingSystemCalls::rename(const char* from, const char* to) {
  const std::lock_guard lock(mutex_);
  const int result = SystemCalls::rename(from, to);
  if (result == 0) calls_.push_back({Kind::kRename, from, to, -1, 0, 0, ""});
  return result;
}

int RecordingSystemCalls::exchange(const char* a, const char* b) {
  const std::lock_guard lock(mutex_);
  const int result = SystemCalls::exchange(a, b);
  if (result == 0) calls_.push_back({Kind::kExchange, a, b, -1, 0, 0, ""});
  return result;
}

int RecordingSystemCalls::mkdir(const char* path, unsigned mode) {
  const std::lock_guard lock(mutex_);
  const int result = SystemCalls::mkdir(path, mode);
  if (result == 0) calls_.push_back({Kind::kMakeFolder, path, "", -1, 0, 0, ""});
  return result;
}

int RecordingSystemCalls::remove(const char* path) {
  const std::lock_guard lock(mutex_);
  const int result = SystemCalls::remove(path);
  if (result == 0) calls_.push_back({Kind::kRemove, path, "", -1, 0, 0, ""});
  return result;
}

size_t forEachPowerLoss(const std::filesystem::path& root, const DiskState& before,
                        const std::vector<DiskCall>& calls,
                        const std::function<void(const DiskState&, size_t call)>& check) {
  constexpr size_t kLastOnes = 12;
  Disk disk(root, before);
  std::set<DiskState> checked;
  size_t tried = 0;
  int64_t next = 0;
  for (size_t n = 0; n <= calls.size(); ++n) {
    const bool is_next = static_cast<int64_t>(n) == next;
    if (is_next) next = nextInSweep(next, 3);
    if (is_next || n + kLastOnes > calls.size()) {
      ++tried;
      disk.forEachState([&](const DiskState& state) {
        if (checked.insert(state).second) check(state, n);
      });
    }
    if (n < calls.size()) disk.apply(calls[n]);
  }
  return tried;
}

}  // namespace
}  // namespace curvisplat::faults

namespace curvisplat {
namespace {

namespace fs = std::filesystem;
using faults::DiskState;
using faults::forEachPowerLoss;
using faults::RecordingSystemCalls;

class PowerLoss : public SmallConversion {
 protected:
  PowerLoss() { setUp(twoBlocks(8)); }

  /// Every folder that opens as a cache must be one of the two.
  void expectNoneWrong(const DiskState& state) {
    for (const auto& [name, files] : state) {
      if (name.empty() || !files.contains("manifest.json")) continue;  // nothing opens without
      if (holdsAllOf(files, one_) || holdsAllOf(files, both_)) continue;
      writeFiles(folder_ / "state", files);
      EXPECT_THROW(CacheReader{folder_ / "state"}, Error) << name;
    }
  }
  static bool holds(const DiskState& state, const Files& cache) {
    const auto found = state.find("a.splats");
    return found != state.end() && holdsAllOf(found->second, cache);
  }
};

TEST_F(PowerLoss, AConversionIsWholeOrNoCache) {
  RecordingSystemCalls recording;
  {
    const ScopedSystemCalls scope(recording);
    convertNow({0, 1}, {});
  }
  size_t states = 0;
  const size_t tried =
      forEachPowerLoss(work_, {{"", {}}}, recording.calls(), [&](const DiskState& state, size_t call) {
        ++states;
        expectNoneWrong(state);
        // Once the conversion says that it is done, it is.
        EXPECT_TRUE(call < recording.calls().size() || holds(state, both_));
      });
  EXPECT_GT(states, tried);
}

TEST_F(PowerLoss, AnOldCacheIsTheNewOneOrWhatItWas) {
  startWithOne();
  RecordingSystemCalls recording;
  {
    const ScopedSystemCalls scope(recording);
    convertNow({0, 1}, {true, false});
  }
  forEachPowerLoss(work_, {{"", {}}, {"a.splats", one_}}, recording.calls(),
                   [&](const DiskState& state, size_t call) {
                     expectNoneWrong(state);
                     const bool is_new = holds(state, both_);
                     EXPECT_TRUE(is_new || holds(state, one_)) << call;
                     EXPECT_TRUE(is_new || call < recording.calls().size());
                   });
}

TEST_F(PowerLoss, AnAdditionIsThereOrNot) {
  startWithOne();
  RecordingSystemCalls recording;
  {
    const ScopedSystemCalls scope(recording);
    addNow();
  }
  forEachPowerLoss(work_, {{"", {}}, {"a.splats", one_}}, recording.calls(),
                   [&](const DiskState& state, size_t call) {
                     const bool is_new = holds(state, added_);
                     EXPECT_TRUE(is_new || holds(state, one_)) << call;
                     EXPECT_TRUE(is_new || call < recording.calls().size());
                   });
}

TEST_F(PowerLoss, AConversionIsResumedFromWhateverIsLeft) {
  RecordingSystemCalls recording;
  {
    const ScopedSystemCalls scope(recording);
    convertNow({0, 1}, {});
  }
  faults::FaultySystemCalls unsynced;
  unsynced.is_unsynced = true;
  const ScopedSystemCalls scope(unsynced);
  int states = 0;
  forEachPowerLoss(work_, {{"", {}}}, recording.calls(), [&](const DiskState& state, size_t call) {
    if (++states % 4 != 0) return;  // every one is a conversion
    writeFiles(work_, {});
    for (const auto& [name, files] : state) writeFiles(work_ / name, files);
    try {
      convertNow({0, 1}, {false, true});
    } catch (const Error& error) {
      // Nothing of it was left but the cache.
      EXPECT_TRUE(holds(state, both_)) << call << ": " << error.what();
    }
    EXPECT_TRUE(holdsAllOf(filesOf(output_), both_)) << call;
  });
}

TEST_F(PowerLoss, APictureIsTheNewOneOrWhatItWas) {
  const Files old{{"a.png", "an old picture"}};
  writeFiles(work_, old);
  Image image({8, 8});
  std::fill(image.rgba.begin(), image.rgba.end(), 1.f);
  RecordingSystemCalls recording;
  {
    const ScopedSystemCalls scope(recording);
    writeImage(image, work_ / "a.png");
  }
  const std::string written = filesOf(work_).at("a.png");
  forEachPowerLoss(work_, {{"", old}}, recording.calls(), [&](const DiskState& state, size_t call) {
    const std::string& left = state.at("").at("a.png");
    EXPECT_TRUE(left == written || (left == old.at("a.png") && call < recording.calls().size())) << call;
  });
}

}  // namespace
}  // namespace curvisplat
