#include "preprocess/convert/bucket_file.h"

#include <algorithm>
#include <atomic>
#include <cstring>
#include <deque>
#include <exception>
#include <new>
#include <optional>
#include <thread>

#include "stream/base/checksum.h"
#include "stream/base/compute_permits.h"
#include "stream/base/error.h"
#include "stream/base/file.h"
#include "stream/base/memory.h"
#include "stream/base/mutex.h"
#include "stream/base/threads.h"
#include "stream/base/trace.h"

namespace curvisplat {
namespace {

constexpr uint64_t kNoChunk = BucketChains::kNoChunk;

struct ChunkHeader {
  uint64_t checksum;
  uint64_t previous;
  uint64_t bytes;
};
static_assert(sizeof(ChunkHeader) == 24);

template <typename T>
struct DirectAllocator {
  using value_type = T;
  DirectAllocator() = default;
  template <typename U>
  DirectAllocator(const DirectAllocator<U>&) {}
  T* allocate(size_t count) {
    return static_cast<T*>(::operator new (count * sizeof(T), std::align_val_t{kDirectAlignment}));
  }
  void deallocate(T* at, size_t) { ::operator delete (at, std::align_val_t{kDirectAlignment}); }
  bool operator==(const DirectAllocator&) const { return true; }
};
/// A chunk in memory, at an address for direct transfers.
using ChunkBuffer = std::vector<std::byte, DirectAllocator<std::byte>>;

/// Writes chunks in its own thread, so that workers wait for the disk only when it is far behind.
class ChunkWriter {
 public:
  struct Chunk {
    uint64_t offset = 0;
    ChunkBuffer bytes;
  };

  explicit ChunkWriter(OutputFile& file) : file_(&file), thread_([this] { writeAll(); }) {}
  ~ChunkWriter() { stop(); }

  /// Waits while too many chunks wait. Throws what writing threw.
  void write(Chunk chunk) {
    MutexLock lock(mutex_);
    if (waiting_.size() >= BucketFile::kWaitingChunks) {
      const TraceScope trace("wait for writing", TraceKind::kWait);
      while (waiting_.size() >= BucketFile::kWaitingChunks && !error_) changed_.wait(lock);
    }
    if (error_) std::rethrow_exception(error_);
    waiting_.push_back(std::move(chunk));
    changed_.notify_all();
  }

  /// A used buffer, emptied, or a new one.
  ChunkBuffer buffer() {
    const MutexLock lock(mutex_);
    if (free_.empty()) return {};
    ChunkBuffer buffer = std::move(free_.back());
    free_.pop_back();
    return buffer;
  }

  /// Waits until all is written. Throws what writing threw.
  void drain() {
    MutexLock lock(mutex_);
    while (!waiting_.empty() && !error_) changed_.wait(lock);
    if (error_) std::rethrow_exception(error_);
  }

  /// Writes what waits. Throws what writing threw.
  void finish() {
    stop();
    const MutexLock lock(mutex_);
    free_ = {};
    if (error_) std::rethrow_exception(error_);
  }

 private:
  void stop() {
    {
      const MutexLock lock(mutex_);
      stopped_ = true;
    }
    changed_.notify_all();
    if (thread_.joinable()) thread_.join();
  }

  void writeAll() {
    nameThisThread("bucket-writer");
    MutexLock lock(mutex_);
    for (;;) {
      while (!stopped_ && waiting_.empty()) changed_.wait(lock);
      if (waiting_.empty() || error_) return;
      Chunk chunk = std::move(waiting_.front());
      lock.unlock();
      std::exception_ptr error;
      try {
        const TraceScope trace("write splats");
        file_->writeAt(chunk.offset, chunk.bytes);
      } catch (...) {
        error = std::current_exception();
      }
      chunk.bytes.clear();
      lock.lock();
      waiting_.pop_front();
      free_.push_back(std::move(chunk.bytes));
      if (error) error_ = error;
      changed_.notify_all();
    }
  }

  OutputFile* file_;
  Mutex mutex_;
  ConditionVariable changed_;
  std::deque<Chunk> waiting_ GUARDED_BY(mutex_);
  std::vector<ChunkBuffer> free_ GUARDED_BY(mutex_);
  bool stopped_ GUARDED_BY(mutex_) = false;
  std::exception_ptr error_ GUARDED_BY(mutex_);
  std::thread thread_;  // last: it uses the others
};

struct Bucket {
  mutable Mutex mutex;
  ChunkBuffer buffer GUARDED_BY(mutex);  // a chunk in the making, header first; empty: none
  BucketChains::OfBucket chains GUARDED_BY(mutex);
  size_t next_chain GUARDED_BY(mutex) = 0;
};

}  // namespace

struct BucketFile::State {
  State(const std::filesystem::path& file, uint32_t bucket_count, size_t chunk)
      : path(file),
        chunk_bytes(chunk),
        buckets(bucket_count),
        output(std::in_place, file, Caching::kDirect),
        writer(*output) {
    CURVISPLAT_CHECK_OP(chunk_bytes % kDirectAlignment, ==, 0u);
  }
  State(const std::filesystem::path& file, const BucketChains& chains)
      : path(file),
        chunk_bytes(chains.chunk_bytes),
        buckets(chains.chains.size()),
        end(chains.size),
        is_foreign(true) {
    for (size_t n = 0; n < buckets.size(); ++n) buckets[n].chains = chains.chains[n];
  }

  const std::filesystem::path path;
  const size_t chunk_bytes;
  std::vector<Bucket> buckets;
  std::atomic<uint64_t> end = 0;
  const bool is_foreign = false;      // another process has written at least a part of it
  std::optional<OutputFile> output;   // unless it is only read
  std::optional<ChunkWriter> writer;  // to it
  std::optional<InputFile> input;     // after close(), or of another's file
  std::vector<std::unique_ptr<BucketFile>> joined;
  bool leave = false;

  void flush(Bucket& bucket) REQUIRES(bucket.mutex) {
    uint64_t& last_chunk = bucket.chains.last_chunks[bucket.next_chain++ % BucketChains::kCount];
    ChunkHeader header{0, last_chunk, bucket.buffer.size() - sizeof(ChunkHeader)};
    header.checksum = checksumOf(header, std::span(bucket.buffer).subspan(sizeof header));
    std::memcpy(bucket.buffer.data(), &header, sizeof header);
    const size_t pages = (bucket.buffer.size() + kDirectAlignment - 1) / kDirectAlignment;
    bucket.buffer.resize(pages * kDirectAlignment);
    last_chunk = end.fetch_add(bucket.buffer.size());
    bucket.chains.bytes += header.bytes;
    writer->write({last_chunk, std::move(bucket.buffer)});
    bucket.buffer = {};
  }

  BucketChains::OfBucket chainsOf(uint32_t number) const {
    const Bucket& bucket = buckets[number];
    const MutexLock lock(bucket.mutex);
    return bucket.chains;
  }

  /// Calls use(records) for each chunk of a chain.
  template <typename Use>
  void forEachChunk(uint32_t number, size_t chain, Use use) const {
    CURVISPLAT_CHECK(input.has_value());
    uint64_t at = chainsOf(number).last_chunks[chain];
    if (at == kNoChunk) return;
    ChunkBuffer chunk(chunk_bytes);
    while (at != kNoChunk) {
      // The next chunk's beginning comes along with a short one.
      const std::span<std::byte> whole = std::span(chunk).first(std::min<uint64_t>(chunk_bytes, end - at));
      {
        const GivenBackPermit given_back;
        input->readAt(at, whole);
      }
      ChunkHeader header;
      std::memcpy(&header, whole.data(), sizeof header);
      require(header.bytes <= whole.size() - sizeof header, at);
      const auto records = std::span<const std::byte>(whole).subspan(sizeof header, header.bytes);
      if (is_foreign) require(checksumOf(header, records) == header.checksum, at);
      use(records);
      at = header.previous;
    }
  }

  static uint64_t checksumOf(const ChunkHeader& header, std::span<const std::byte> records) {
    Checksum checksum;
    checksum.add(std::as_bytes(std::span(&header, 1)).subspan(sizeof header.checksum));
    checksum.add(records);
    return checksum.value();
  }

  /// Throws LostBuckets unless the file is as it was written at `offset`: `condition` says so.
  void require(bool condition, uint64_t offset) const {
    if (!condition)
      throw LostBuckets("{}: is damaged at byte {}; run the same command again", path.string(), offset);
  }
};

BucketFile::BucketFile(const std::filesystem::path& path, uint32_t buckets, size_t chunk_bytes)
    : state_(std::make_unique<State>(path, buckets, chunk_bytes)) {}

BucketFile::BucketFile(const std::filesystem::path& path, BucketChains chains, Access access)
    : state_(std::make_unique<State>(path, chains)) {
  if (!std::filesystem::exists(path))
    throw LostBuckets("{}: was removed while it was needed; run the same command again", path.string());
  {
    InputFile input(path, Caching::kDirect);
    state_->require(input.size() >= chains.size, input.size());
    if (access == Access::kRead) state_->input = std::move(input);
  }
  if (access == Access::kRead) return;
  state_->output.emplace(path, Caching::kDirect, OutputFile::Existing::kKeep);
  state_->output->truncate(chains.size);
  state_->writer.emplace(*state_->output);
}

BucketFile::~BucketFile() {
  const std::filesystem::path path = state_->path;
  const bool leave = state_->leave;
  state_.reset();
  if (!leave) removeFileIfThere(path);
}

void BucketFile::leave() {
  state_->leave = true;
}

BucketChains BucketFile::chains() const {
  BucketChains chains{state_->chunk_bytes, state_->end, {}};
  for (uint32_t n = 0; n < buckets(); ++n) chains.chains.push_back(state_->chainsOf(n));
  return chains;
}

uint32_t BucketFile::buckets() const {
  return static_cast<uint32_t>(state_->buckets.size());
}

void BucketFile::append(uint32_t bucket_number, std::span<const std::byte> records) {
  const size_t room = state_->chunk_bytes - sizeof(ChunkHeader);
  CURVISPLAT_CHECK_OP(records.size(), <=, room);
  Bucket& bucket = state_->buckets[bucket_number];
  const MutexLock lock(bucket.mutex);
  if (bucket.buffer.size() + records.size() > state_->chunk_bytes) state_->flush(bucket);
  if (bucket.buffer.empty()) {
    bucket.buffer = state_->writer->buffer();
    bucket.buffer.reserve(state_->chunk_bytes);
    bucket.buffer.resize(sizeof(ChunkHeader));
  }
  bucket.buffer.insert(bucket.buffer.end(), records.begin(), records.end());
}

void BucketFile::join(const std::filesystem::path& path, BucketChains chains) {
  CURVISPLAT_CHECK_OP(chains.chains.size(), ==, state_->buckets.size());
  state_->joined.push_back(std::make_unique<BucketFile>(path, std::move(chains)));
  state_->joined.back()->leave();
}

void BucketFile::flush() {
  for (Bucket& bucket : state_->buckets) {
    const MutexLock lock(bucket.mutex);
    if (!bucket.buffer.empty()) state_->flush(bucket);
  }
  state_->writer->drain();
}

void BucketFile::close(bool sync) {
  flush();
  state_->writer->finish();
  if (sync) state_->output->close();
  state_->input.emplace(state_->path, Caching::kDirect);
}

uint64_t BucketFile::bytes(uint32_t bucket) const {
  uint64_t bytes = state_->chainsOf(bucket).bytes;
  for (const auto& other : state_->joined) bytes += other->bytes(bucket);
  return bytes;
}

uint64_t BucketFile::size() const {
  uint64_t size = state_->end;
  for (const auto& other : state_->joined) size += other->size();
  return size;
}

void BucketFile::read(uint32_t bucket, std::vector<std::byte>& out) const {
  if (out.capacity() < bytes(bucket)) freeMemory(out);  // or old and new would be in memory together
  out.resize(bytes(bucket));
  size_t done = 0;
  forEachChunk(bucket, [&](std::span<const std::byte> records) {
    CURVISPLAT_CHECK_OP(done + records.size(), <=, out.size());
    std::copy(records.begin(), records.end(), out.begin() + static_cast<ptrdiff_t>(done));
    done += records.size();
  });
  CURVISPLAT_CHECK_OP(done, ==, out.size());
}

void BucketFile::forEachChunk(uint32_t bucket,
                              const std::function<void(std::span<const std::byte>)>& use) const {
  for (size_t chain = 0; chain < BucketChains::kCount; ++chain) forEachChunk(bucket, chain, use);
}

void BucketFile::forEachChunk(uint32_t bucket, size_t chain,
                              const std::function<void(std::span<const std::byte>)>& use) const {
  state_->forEachChunk(bucket, chain, use);
  for (const auto& other : state_->joined) other->forEachChunk(bucket, chain, use);
}

}  // namespace curvisplat
