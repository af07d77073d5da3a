// CURVISPLAT_VECTOR_CLONES before a function: it is compiled for AVX2 as well, and the program takes that one on processors
// that have it. For loops that the compiler turns into vector instructions, of what is inlined into them. AVX2 alone has no
// fused multiplications, so results are the same, bit for bit.
#pragma once

// The choice is made while the program is loaded, when the runtimes of sanitizers are not there yet.
#if defined(CURVISPLAT_SANITIZED) || !defined(__x86_64__) || !defined(__ELF__)
#define CURVISPLAT_VECTOR_CLONES
#else
#define CURVISPLAT_VECTOR_CLONES [[gnu::target_clones("avx2", "default")]]
#endif
