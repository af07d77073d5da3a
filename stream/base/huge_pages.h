// Large buffers in large pages, where the system has them: the first touch of each page costs a fault, and a frame's buffers of
// tens of megabytes cost thousands.
#pragma once

#include <cstddef>

namespace curvisplat {

/// Asks for large pages for the part of a buffer that consists of whole ones. A hint: where it is not followed, nothing changes.
/// Before the buffer is written for the first time. Takes no memory beyond the buffer's. Any thread; throws nothing.
void preferHugePages(void* begin, size_t bytes);

}  // namespace curvisplat
