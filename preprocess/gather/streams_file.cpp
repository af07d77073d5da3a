#include "preprocess/gather/streams_file.h"

#include <algorithm>

#include "stream/base/memory.h"

namespace curvisplat {
StreamsFile::StreamsFile(ScratchFiles scratch, size_t streams, uint64_t memory_bytes)
    : scratch_(std::move(scratch)),
      streams_(streams),
      buffer_bytes_(bufferBytes(streams, memory_bytes)),
      may_stay_(bytesThatStay(streams, memory_bytes)) {}

uint64_t StreamsFile::bufferBytes(size_t streams, uint64_t memory_bytes) {
  return std::clamp<uint64_t>(memory_bytes / 2 / std::max<size_t>(1, streams), kMinBuffer, kMaxBuffer);
}

uint64_t StreamsFile::bytesThatStay(size_t streams, uint64_t memory_bytes) {
  return memory_bytes - std::min(memory_bytes, streams * bufferBytes(streams, memory_bytes));
}

uint64_t StreamsFile::bytesInFile(uint64_t bytes, size_t streams, uint64_t memory_bytes) {
  return bytes - std::min(bytes, bytesThatStay(streams, memory_bytes));
}

StreamsFile::~StreamsFile() = default;

void StreamsFile::append(size_t stream_number, std::span<const std::byte> record) {
  Stream& stream = streams_[stream_number];
  if (!stream.buffer.empty() && stream.buffer.size() + record.size() > buffer_bytes_) flush(stream);
  if (stream.buffer.capacity() == 0) stream.buffer.reserve(std::max(buffer_bytes_, record.size()));
  stream.buffer.insert(stream.buffer.end(), record.begin(), record.end());
  stream.bytes += record.size();
}

void StreamsFile::flush(Stream& stream) {
  Chunk chunk;
  chunk.bytes = stream.buffer.size();
  if (chunk.bytes <= may_stay_) {
    may_stay_ -= chunk.bytes;
    chunk.in_memory.swap(stream.buffer);
  } else {
    if (!file_) file_ = std::make_unique<NamelessFile>(scratch_);
    chunk.offset = file_->out().size();
    file_->out().append(std::span<const std::byte>(stream.buffer));
    stream.buffer.clear();
  }
  stream.chunks.push_back(std::move(chunk));
}

void StreamsFile::close() {
  for (Stream& stream : streams_) {
    if (!stream.buffer.empty()) flush(stream);
    freeMemory(stream.buffer);
  }
}

void StreamsFile::forEach(size_t stream_number,
                          const std::function<void(std::span<const std::byte>)>& use) const {
  std::vector<std::byte> buffer;
  for (const Chunk& chunk : streams_[stream_number].chunks) {
    if (!chunk.in_memory.empty()) {
      use(chunk.in_memory);
      continue;
    }
    buffer.resize(chunk.bytes);
    file_->in().readAt(chunk.offset, std::span(buffer));
    use(buffer);
  }
}

}  // namespace curvisplat
