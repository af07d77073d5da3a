// CURVISPLAT_VECTOR_CLONES before a function: it is compiled for AVX2 as well, and the program takes that one on processors
// that have it. For loops that the compiler turns into vector instructions, of what is inlined into them. AVX2 alone has no
// fused multiplications, so results are the same, bit for bit.
#pragma once

// The choice is made while the program is loaded, when the runtimes of sanitizers are not there yet.
#if defined(__has_feature)
#if __has_feature(address_sanitizer) || __has_feature(thread_sanitizer) || __has_feature(memory_sanitizer)
#define CURVISPLAT_VECTOR_CLONES
#endif
#endif
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__) || !defined(__x86_64__)
#define CURVISPLAT_VECTOR_CLONES
#endif
#ifndef CURVISPLAT_VECTOR_CLONES
#define CURVISPLAT_VECTOR_CLONES [[gnu::target_clones("avx2", "default")]]
#endif
