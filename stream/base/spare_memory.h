// Whether a little memory is left, asked before threads begin to work.
//
// glibc allocates a few bytes when a thread first uses an object of its own (thread_local), and ends the process where it cannot have
// them. Under a limit of address space (ulimit -v), buffers that just fit leave nothing for that.
#pragma once

namespace curvisplat {

/// Throws std::bad_alloc unless 32 MiB can be mapped now. Maps and unmaps them, which takes some microseconds. Any thread.
void requireSpareMemory();

}  // namespace curvisplat
