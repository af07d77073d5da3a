#include "preprocess/formats/common/library_trial.h"

#include <fcntl.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <csignal>
#include <cstring>
#include <exception>
#include <optional>
#include <set>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "preprocess/formats/common/byte_source.h"
#include "preprocess/formats/common/data_libraries.h"
#include "preprocess/formats/common/hdf5_exits.h"
#include "preprocess/formats/common/hdf5_objects.h"
#include "stream/base/error.h"
#include "stream/base/os.h"
#include "stream/base/watched_file.h"

namespace curvisplat {
namespace {

// 8 bytes of signature and the version, then
//
//   version 0    24 bytes in all, of which the 14th tells how long addresses are; base, free space, END
//   version 1    28 bytes in all, otherwise the same
//   2 and 3      12 bytes in all, of which the 10th tells how long addresses are; base, extension, END
constexpr size_t kLooked = 64;

/// nullopt if `begin` is not that of an HDF5 file, or of a version that is not known.
std::optional<uint64_t> statedEnd(const std::array<uint8_t, kLooked>& begin) {
  if (!std::equal(kHdf5Signature.begin(), kHdf5Signature.end(), begin.begin(),
                  [](char a, uint8_t b) { return static_cast<uint8_t>(a) == b; }))
    return std::nullopt;
  const uint8_t version = begin[8];
  if (version > 3) return std::nullopt;
  const size_t address_bytes = begin[version < 2 ? 13 : 9], head = version < 2 ? 24 + 4u * version : 12;
  if (address_bytes != 4 && address_bytes != 8) return std::nullopt;
  const auto address = [&](size_t number) {
    uint64_t value = 0;
    for (size_t n = address_bytes; n-- > 0;) value = value << 8 | begin[head + number * address_bytes + n];
    return value;
  };
  return address(0) == 0 ? std::optional(address(2)) : std::nullopt;
}

}  // namespace

bool isHdf5(const InputFile& file) {
  return beginningOf(file, kHdf5Signature.size()) == kHdf5Signature;
}

void requireWholeHdf5(const InputFile& file) {
  std::array<uint8_t, kLooked> begin{};
  file.readAt(0, std::span(begin).first(std::min<uint64_t>(begin.size(), file.size())));
  if (const auto end = statedEnd(begin); end && *end > file.size())
    throw TruncatedFile("{}: is truncated (found {} bytes, expected {}); copy it again", file.path().string(),
                        file.size(), *end);
}

namespace {

// Processor time and memory for a small file, and what a larger one may take: indices of chunks grow with the file.
constexpr rlim_t kSeconds = 10, kBytesPerSecond = rlim_t{64} << 20, kBytes = rlim_t{512} << 20;
constexpr size_t kMaxAttributeBytes = size_t{1} << 20, kMaxChunkBytes = size_t{1} << 18;
constexpr size_t kMaxReadBytes = size_t{1} << 26;  // of all chunks

/// in_trial: this is the process of a trial. leads_out: its walk met something that exitsOf() has to look at.
bool in_trial = false, leads_out = false;
constexpr int kExitLeadsOut = 3;

/// Size of `points` values of the type in memory; 0: too large, or not known.
size_t bytesOf(hssize_t points, const Hdf5Type& type, size_t most) {
  const size_t value_bytes = type ? H5Tget_size(type.id()) : 0;
  if (points <= 0 || value_bytes == 0 || value_bytes > most) return 0;
  return static_cast<uint64_t>(points) > most / value_bytes ? 0 : static_cast<size_t>(points) * value_bytes;
}

herr_t readAttribute(hid_t object, const char* name, const H5A_info_t*, void*) {
  const Hdf5Attribute attribute(H5Aopen(object, name, H5P_DEFAULT));
  if (!attribute) return 0;
  const Hdf5Type type(H5Aget_type(attribute.id()));
  const Hdf5Space space(H5Aget_space(attribute.id()));
  const size_t bytes =
      space ? bytesOf(H5Sget_simple_extent_npoints(space.id()), type, kMaxAttributeBytes) : 0;
  if (bytes == 0) return 0;
  std::vector<std::byte> values(bytes);
  if (H5Aread(attribute.id(), type.id(), values.data()) >= 0)
    H5Dvlen_reclaim(type.id(), space.id(), H5P_DEFAULT, values.data());
  return 0;
}

/// Size of a chunk, or of the whole of a data set without chunks, if that can be read. 0: leave it alone.
size_t readableBytes(const Hdf5Properties& properties, const Hdf5Space& space, const Hdf5Type& type) {
  if (H5Pget_layout(properties.id()) != H5D_CHUNKED) return bytesOf(1, type, kMaxChunkBytes);
  std::array<hsize_t, H5S_MAX_RANK> chunk{};
  const int rank = H5Pget_chunk(properties.id(), H5S_MAX_RANK, chunk.data());
  hssize_t points = rank > 0 && rank == H5Sget_simple_extent_ndims(space.id()) ? 1 : 0;
  for (int axis = 0; axis < rank && points > 0; ++axis) {
    const auto length = static_cast<hssize_t>(std::min<hsize_t>(chunk[axis], kMaxChunkBytes + 1));
    points = length > 0 && points <= static_cast<hssize_t>(kMaxChunkBytes) / length ? points * length : 0;
  }
  return bytesOf(points, type, kMaxChunkBytes);
}

/// Reads a data set's index, and its first and last value.
void readDataSet(hid_t object, size_t& read) {
  const Hdf5DataSet set(H5Dopen2(object, ".", H5P_DEFAULT));
  if (!set) return;
  const Hdf5Properties properties(H5Dget_create_plist(set.id()));
  if (!properties) return;
  // Not even its extent is looked at: a virtual data set may have that of its sources.
  if (isVirtual(properties) || H5Pget_external_count(properties.id()) != 0) {
    leads_out = true;
    return;
  }
  H5Dget_storage_size(set.id());
  const Hdf5Space space(H5Dget_space(set.id()));
  const Hdf5Type type(H5Dget_type(set.id()));
  if (!space || !type) return;
  const size_t bytes = readableBytes(properties, space, type);
  std::array<hsize_t, H5S_MAX_RANK> dims{}, first{}, one{};
  const int rank = H5Sget_simple_extent_dims(space.id(), dims.data(), nullptr);
  if (bytes == 0 || read + 2 * bytes > kMaxReadBytes || rank <= 0 ||
      std::find(dims.begin(), dims.begin() + rank, hsize_t{0}) != dims.begin() + rank)
    return;
  read += 2 * bytes;
  one.fill(1);
  const Hdf5Space memory(H5Screate(H5S_SCALAR));
  std::vector<std::byte> value(H5Tget_size(type.id()));
  for (const bool last : {false, true}) {
    for (int axis = 0; axis < rank; ++axis) first[axis] = last ? dims[axis] - 1 : 0;
    if (H5Sselect_hyperslab(space.id(), H5S_SELECT_SET, first.data(), nullptr, one.data(), nullptr) < 0 ||
        H5Dread(set.id(), type.id(), memory.id(), space.id(), H5P_DEFAULT, value.data()) < 0)
      return;
    H5Dvlen_reclaim(type.id(), memory.id(), H5P_DEFAULT, value.data());
  }
}

herr_t visitLink(hid_t, const char*, const H5L_info_t* link, void*) {
  leads_out |= link->type == H5L_TYPE_EXTERNAL;
  return 0;
}

/// Visits an object, for H5Ovisit2(), which comes to each once.
herr_t visit(hid_t root, const char* name, const H5O_info_t* info, void* read) {
  const Hdf5Object object(H5Oopen(root, name, H5P_DEFAULT));
  if (!object) return 0;
  H5Aiterate2(object.id(), H5_INDEX_NAME, H5_ITER_NATIVE, nullptr, readAttribute, nullptr);
  H5Aiterate2(object.id(), H5_INDEX_NAME, H5_ITER_INC, nullptr, readAttribute, nullptr);
  if (info->type == H5O_TYPE_GROUP)
    for (const H5_index_t order : {H5_INDEX_NAME, H5_INDEX_CRT_ORDER}) {
      const herr_t whole = H5Literate(object.id(), order, H5_ITER_INC, nullptr, visitLink, nullptr);
      leads_out |= whole < 0 && order == H5_INDEX_NAME;
    }
  if (info->type == H5O_TYPE_DATASET) readDataSet(object.id(), *static_cast<size_t*>(read));
  return 0;
}

void walk(const std::filesystem::path& path) {
  const QuietHdf5 quiet;
  const Hdf5File file(H5Fopen(path.c_str(), H5F_ACC_RDONLY, H5P_DEFAULT));
  size_t read = 0;
  leads_out |= file && H5Ovisit2(file.id(), H5_INDEX_NAME, H5_ITER_NATIVE, visit, &read, H5O_INFO_ALL) < 0;
}

constexpr std::array kStops{SIGINT, SIGTERM, SIGHUP, SIGQUIT};

/// Lets this process allocate `bytes` more: a damaged file may state a chunk of gigabytes.
void limitFurtherMemory([[maybe_unused]] rlim_t bytes) {
#ifndef CURVISPLAT_SANITIZED
  const rlim_t used = os::addressSpaceBytes();
  if (used == 0) return;
  const rlim_t most = used + bytes;
  const rlimit limit{most, most};
  ::setrlimit(RLIMIT_AS, &limit);
#endif
}

/// The resources that a trial may take.
struct TrialLimits {
  rlim_t seconds, bytes;
};

/// A process that has nobody's handlers, prints nothing, and ends with its parent.
[[noreturn]] void runTrial(const std::function<void()>& work, TrialLimits limits, pid_t parent) {
  in_trial = true;
  os::endWithParent();
  if (::getppid() != parent) ::_exit(0);
  for (const int signal : {SIGSEGV, SIGBUS, SIGABRT, SIGFPE, SIGILL, SIGXCPU, SIGPIPE})
    std::signal(signal, SIG_DFL);
  for (const int signal : kStops) std::signal(signal, SIG_DFL);
  if (const int nowhere = ::open("/dev/null", O_RDWR | O_CLOEXEC); nowhere >= 0)
    for (const int stream : {STDOUT_FILENO, STDERR_FILENO}) ::dup2(nowhere, stream);
  const rlimit no_core{0, 0}, seconds{limits.seconds, limits.seconds + 1};
  ::setrlimit(RLIMIT_CORE, &no_core);
  ::setrlimit(RLIMIT_CPU, &seconds);
  limitFurtherMemory(limits.bytes);
  // What is freed or used without having been set is junk: it crashes here rather than later.
  os::junkFreedMemory();
  try {
    work();
  } catch (const std::exception&) {
    // The caller finds the same.
  }
  H5close();  // as at the end of the caller: it frees what a damaged file has left open
  ::_exit(leads_out ? kExitLeadsOut : 0);
}

/// The files that have been tried and stayed as they were.
class TriedFiles {
 public:
  bool has(const struct stat& file) {
    const MutexLock lock(mutex_);
    return files_.contains(keyOf(file));
  }
  void add(const struct stat& file) {
    constexpr size_t kMaxFiles = 4096;
    const MutexLock lock(mutex_);
    if (files_.size() >= kMaxFiles) files_.clear();
    files_.insert(keyOf(file));
  }

 private:
  using Key = std::array<int64_t, 7>;
  static Key keyOf(const struct stat& file) {
    return {static_cast<int64_t>(file.st_dev),
            static_cast<int64_t>(file.st_ino),
            file.st_size,
            file.st_mtim.tv_sec,
            file.st_mtim.tv_nsec,
            file.st_ctim.tv_sec,
            file.st_ctim.tv_nsec};
  }
  Mutex mutex_;
  std::set<Key> files_ GUARDED_BY(mutex_);
};

pid_t forkTrial() {
  loadDataLibraries();  // once, and not in each of the processes
  // HDF5's own state is that of no call, since all calls hold the lock; both processes give it back.
  const MutexLock lock(dataLibraryMutex()), of_links(linksMutex());
  return ::fork();
}

enum class Trial { kNone, kPassed, kLeadsOut };  // none: no process could be started, or it was stopped

/// Throws Error if the work crashes or takes too long.
Trial tryWork(const char* library, const std::filesystem::path& path, const struct stat& before,
              const std::function<void()>& work) {
  const auto file_bytes = static_cast<rlim_t>(before.st_size);
  const TrialLimits limits{kSeconds + file_bytes / kBytesPerSecond, kBytes + file_bytes};
  const pid_t parent = ::getpid(), trial = forkTrial();
  if (trial == 0) runTrial(work, limits, parent);
  if (trial < 0) return Trial::kNone;
  int status = 0;
  while (::waitpid(trial, &status, 0) < 0)
    if (errno != EINTR) return Trial::kNone;  // somebody else has waited for it
  if (WIFSIGNALED(status) && WTERMSIG(status) == SIGXCPU)
    throw Error("{}: {} does not finish reading it within {} s; the file is damaged: copy or write it again",
                path.string(), library, limits.seconds);
  const bool stopped =
      WIFSIGNALED(status) && std::find(kStops.begin(), kStops.end(), WTERMSIG(status)) != kStops.end();
  if (stopped) return Trial::kNone;  // the caller is told, too
  if (WIFEXITED(status) && WEXITSTATUS(status) == kExitLeadsOut) return Trial::kLeadsOut;
  if (WIFSIGNALED(status) || (WIFEXITED(status) && WEXITSTATUS(status) != 0))
    throw Error("{}: {} crashes on its structures ({}); the file is damaged: copy or write it again",
                path.string(), library,
                WIFSIGNALED(status) ? ::strsignal(WTERMSIG(status)) : "an error of memory");
  return Trial::kPassed;
}

}  // namespace

void tryLibrary(const char* library, const std::filesystem::path& path, const std::function<void()>& work) {
  static TriedFiles tried;
  struct stat before {};
  if (in_trial || ::stat(path.c_str(), &before) != 0 || tried.has(before)) return;
  if (tryWork(library, path, before, work) != Trial::kNone) tried.add(before);
}

namespace {

/// Walks a file and all that it leads to, each in a trial before it is looked at here.
void walkAll(const std::filesystem::path& path, TriedFiles& walked) {
  constexpr size_t kMaxFiles = 10000;
  std::vector<std::filesystem::path> files{path};
  std::set<std::filesystem::path> known{path};
  std::vector<struct stat> tried;
  std::vector<Hdf5Exits::VirtualSource> sources;
  for (size_t n = 0; n < files.size(); ++n) {
    const std::filesystem::path file = files[n];
    struct stat before {};
    if (::stat(file.c_str(), &before) != 0 || walked.has(before)) continue;
    const Trial trial = tryWork("HDF5", file, before, [&] { walk(file); });
    if (trial != Trial::kNone) tried.push_back(before);
    if (trial == Trial::kPassed) continue;
    const Hdf5Exits exits = exitsOf(file);
    noteLinks(file, exits.files);
    sources.insert(sources.end(), exits.sources.begin(), exits.sources.end());
    for (const auto& next : exits.files)
      if (known.insert(next).second) files.push_back(next);
    if (files.size() > kMaxFiles) throw Error("{}: leads to more than {} files", path.string(), kMaxFiles);
  }
  requireStored(path, sources);
  for (const struct stat& file : tried) walked.add(file);
}

}  // namespace

void tryHdf5(const std::filesystem::path& path, const std::function<void()>& more) {
  static TriedFiles walked, with_more;
  TriedFiles& tried = more ? with_more : walked;
  struct stat before {};
  if (in_trial || ::stat(path.c_str(), &before) != 0 || tried.has(before)) return;
  walkAll(path, walked);
  if (more && tryWork("HDF5", path, before, more) != Trial::kNone) with_more.add(before);
}

}  // namespace curvisplat
