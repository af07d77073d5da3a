// Whether this is a build with sanitizers, of GCC or Clang. What they need of memory is not the program's, so tests that limit or measure
// memory leave that out.
#pragma once

namespace curvisplat {

constexpr bool kHasAddressSanitizer =
#if defined(__has_feature)
    __has_feature(address_sanitizer);
#elif defined(__SANITIZE_ADDRESS__)
    true;
#else
    false;
#endif

// It does not go on in a process that a process with threads has forked.
constexpr bool kHasThreadSanitizer =
#if defined(__has_feature)
    __has_feature(thread_sanitizer);
#elif defined(__SANITIZE_THREAD__)
    true;
#else
    false;
#endif

constexpr bool kIsSanitized = kHasAddressSanitizer || kHasThreadSanitizer;

}  // namespace curvisplat
