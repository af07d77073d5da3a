#include "stream/base/mirror.h"

#include <fcntl.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <cerrno>
#include <map>
#include <span>
#include <utility>

#include "stream/base/mutex.h"

namespace curvisplat {
namespace {

constexpr uint64_t kBlockBytes = 64 << 10;
// The most that one request asks for: it bounds the memory of a thread that fetches.
constexpr uint64_t kMaxRequest = 1 << 20;

enum class Block : uint8_t { kMissing, kUnderWay, kPresent };

/// Writes all of some bytes. Returns 0 or errno.
int write(int fd, std::span<const std::byte> bytes, uint64_t offset) {
  while (!bytes.empty()) {
    const ssize_t done = ::pwrite(fd, bytes.data(), bytes.size(), static_cast<off_t>(offset));
    if (done < 0 && errno == EINTR) continue;
    if (done < 0) return errno;
    bytes = bytes.subspan(static_cast<size_t>(done));
    offset += static_cast<uint64_t>(done);
  }
  return 0;
}

/// A file of a mirror. Any number of threads may fetch different blocks at once. It is written without
/// SystemCalls, which ask for what it writes.
class MirroredFile {
 public:
  MirroredFile(std::string name, uint64_t size) : name_(std::move(name)), size_(size) {}
  ~MirroredFile() {
    if (fd_ >= 0) ::close(fd_);
  }
  MirroredFile(const MirroredFile&) = delete;
  MirroredFile& operator=(const MirroredFile&) = delete;

  /// Makes the file, with its first bytes; the rest takes no space yet. Returns 0 or errno.
  int make(const std::filesystem::path& path, std::span<const std::byte> first) {
    fd_ = ::open(path.c_str(), O_RDWR | O_CREAT | O_TRUNC | O_CLOEXEC, 0600);
    if (fd_ < 0 || ::ftruncate(fd_, static_cast<off_t>(size_)) != 0) return errno;
    if (const int error = write(fd_, first, 0)) return error;
    const MutexLock lock(mutex_);
    if (!first.empty()) blocks_[0] = Block::kPresent;
    return 0;
  }

  /// Fetches what is missing of some bytes. Returns 0 or errno.
  int fetch(uint64_t offset, uint64_t count, const Fetch& source, std::atomic<uint64_t>& fetched) {
    const uint64_t last = std::min(offset + count, size_);
    if (offset >= last) return 0;
    const uint64_t end = (last + kBlockBytes - 1) / kBlockBytes;
    MutexLock lock(mutex_);
    for (uint64_t n = offset / kBlockBytes; n < end;) {
      const Block block = stateOf(n);
      if (block == Block::kPresent) {
        ++n;
        continue;
      }
      if (block == Block::kUnderWay) {
        changed_.wait(lock);
        continue;
      }
      uint64_t behind = n;
      while (behind < end && stateOf(behind) == Block::kMissing &&
             (behind + 1 - n) * kBlockBytes <= kMaxRequest)
        blocks_[behind++] = Block::kUnderWay;
      lock.unlock();
      const int error = fetchBlocks(n, behind, source, fetched);
      lock.lock();
      for (uint64_t done = n; done < behind; ++done)
        blocks_[done] = error == 0 ? Block::kPresent : Block::kMissing;
      changed_.notify_all();
      if (error != 0) return error;
    }
    return 0;
  }

 private:
  Block stateOf(uint64_t block) const REQUIRES(mutex_) {
    const auto found = blocks_.find(block);
    return found == blocks_.end() ? Block::kMissing : found->second;
  }

  int fetchBlocks(uint64_t begin, uint64_t end, const Fetch& source, std::atomic<uint64_t>& fetched) {
    const uint64_t offset = begin * kBlockBytes, count = std::min(end * kBlockBytes, size_) - offset;
    const Fetched sent = source(name_, offset, count);
    if (sent.error != 0) return sent.error;
    if (sent.file_bytes != size_ || sent.bytes.size() != count) return EIO;
    fetched += count;
    return write(fd_, sent.bytes, offset);
  }

  const std::string name_;
  const uint64_t size_;
  Mutex mutex_;
  ConditionVariable changed_;
  // Only blocks that were asked for are here: a source can say that its file is of any size.
  std::map<uint64_t, Block> blocks_ GUARDED_BY(mutex_);
  int fd_ = -1;
};

}  // namespace

struct Mirror::State {
  State(std::filesystem::path in, Fetch from) : folder(std::move(in)), fetch(std::move(from)) {}

  /// The file `name`, which is made when it is first asked for; null with the source's error.
  std::shared_ptr<MirroredFile> file(const std::string& name, int& error) {
    const MutexLock lock(opening);
    if (const auto known = files.find(name); known != files.end()) return known->second;
    const Fetched first = fetch(name, 0, kBlockBytes);
    error = first.error;
    if (error == 0 && first.bytes.size() != std::min(first.file_bytes, kBlockBytes)) error = EIO;
    if (error != 0) return nullptr;
    fetched += first.bytes.size();
    auto made = std::make_shared<MirroredFile>(name, first.file_bytes);
    error = made->make(folder / name, first.bytes);
    if (error != 0) return nullptr;
    return files[name] = std::move(made);
  }

  const std::filesystem::path folder;
  const Fetch fetch;
  std::atomic<uint64_t> fetched = 0;
  Mutex opening;  // one file at a time
  std::map<std::string, std::shared_ptr<MirroredFile>> files GUARDED_BY(opening);
};

namespace {

template <typename State>
struct OpenFile {
  std::shared_ptr<State> mirror;
  std::shared_ptr<MirroredFile> file;
};

template <typename State>
struct Registry {
  std::atomic<int> mirrors = 0;  // while there are none, nothing is looked up
  Mutex mutex;
  std::vector<std::shared_ptr<State>> all GUARDED_BY(mutex);
  std::map<int, OpenFile<State>> open GUARDED_BY(mutex);

  /// The mirror that a path lies in, and the path there; null if there is none.
  std::shared_ptr<State> find(const std::filesystem::path& path, std::string& name) {
    if (mirrors == 0) return nullptr;
    const MutexLock lock(mutex);
    for (const auto& state : all) {
      const auto [folder, rest] =
          std::mismatch(state->folder.begin(), state->folder.end(), path.begin(), path.end());
      if (folder != state->folder.end() || rest == path.end()) continue;
      std::filesystem::path inside;
      for (auto part = rest; part != path.end(); ++part) {
        if (*part == "..") return nullptr;
        inside /= *part;
      }
      name = inside.generic_string();
      return state;
    }
    return nullptr;
  }
};

/// The mirrors of the process. Never destroyed: threads that outlive main() still read.
template <typename State>
Registry<State>& registryOf(const std::shared_ptr<State>&) {
  static Registry<State>& registry = *new Registry<State>;
  return registry;
}

bool isForReading(int flags) {
  return (flags & O_ACCMODE) == O_RDONLY && (flags & O_DIRECTORY) == 0;
}

}  // namespace

Mirror::Mirror(std::filesystem::path folder, Fetch fetch)
    : state_(std::make_shared<State>(std::move(folder), std::move(fetch))) {
  auto& registry = registryOf(state_);
  const MutexLock lock(registry.mutex);
  registry.all.push_back(state_);
  ++registry.mirrors;
}

Mirror::~Mirror() {
  auto& registry = registryOf(state_);
  const MutexLock lock(registry.mutex);
  std::erase(registry.all, state_);
  --registry.mirrors;
}

const std::filesystem::path& Mirror::folder() const {
  return state_->folder;
}

uint64_t Mirror::fetchedBytes() const {
  return state_->fetched;
}

int MirrorCalls::prepare(const char* path, int flags) {
  auto& registry = registryOf(std::shared_ptr<Mirror::State>());
  std::string name;
  int error = 0;
  if (!isForReading(flags)) return 0;
  if (const auto mirror = registry.find(path, name)) mirror->file(name, error);
  return error;
}

void MirrorCalls::opened(int fd, const char* path, int flags) {
  auto& registry = registryOf(std::shared_ptr<Mirror::State>());
  std::string name;
  int error = 0;
  if (!isForReading(flags)) return;
  const auto mirror = registry.find(path, name);
  if (!mirror) return;
  const auto file = mirror->file(name, error);
  const MutexLock lock(registry.mutex);
  registry.open[fd] = {mirror, file};
}

int MirrorCalls::read(int fd, uint64_t offset, size_t count) {
  auto& registry = registryOf(std::shared_ptr<Mirror::State>());
  if (registry.mirrors == 0) return 0;
  OpenFile<Mirror::State> open;
  {
    const MutexLock lock(registry.mutex);
    const auto found = registry.open.find(fd);
    if (found == registry.open.end()) return 0;
    open = found->second;
  }
  return open.file ? open.file->fetch(offset, count, open.mirror->fetch, open.mirror->fetched) : EIO;
}

void MirrorCalls::closed(int fd) {
  auto& registry = registryOf(std::shared_ptr<Mirror::State>());
  if (registry.mirrors == 0) return;
  const MutexLock lock(registry.mutex);
  registry.open.erase(fd);
}

bool MirrorCalls::has(const std::filesystem::path& path) {
  std::string name;
  return registryOf(std::shared_ptr<Mirror::State>()).find(path, name) != nullptr;
}

bool isMirrored(const std::filesystem::path& path) {
  return MirrorCalls::has(path);
}

void expectMirroredFolder(const std::filesystem::path& path) {
  if (!isMirrored(path)) return;
  std::error_code error;
  std::filesystem::create_directories(path, error);
}

void expectMirroredFile(const std::filesystem::path& path) {
  if (!isMirrored(path)) return;
  expectMirroredFolder(path.parent_path());
  MirrorCalls::prepare(path.c_str(), O_RDONLY);
}

}  // namespace curvisplat
