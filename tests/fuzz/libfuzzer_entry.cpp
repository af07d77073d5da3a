// What libFuzzer calls: the program's one target.
#include "tests/fuzz/fuzz_target.h"

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  curvisplat::runFuzzTarget(curvisplat::fuzzTargets().front(), std::as_bytes(std::span(data, size)));
  return 0;
}
