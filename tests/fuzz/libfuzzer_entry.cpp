// The function that libFuzzer calls: the program's one target.
//
// A target may try a library on its input in a process of its own, which may crash (library_trial.h). That process inherits
// libFuzzer's callback, which would keep the input as a finding. Here its crash is a finding only if no function of such a
// library is on the stack: then it is a failure of the program itself, and the fuzzing process ends in its place.
// Needs the signals' handlers of the sanitizer (ASAN_OPTIONS of run.sh), since the trial takes others away.
#include <dlfcn.h>
#include <pthread.h>
#include <sanitizer/common_interface_defs.h>
#include <unistd.h>
#include <unwind.h>

#include <algorithm>
#include <csignal>
#include <span>
#include <string_view>

#include "tests/fuzz/fuzz_target.h"

namespace {

/// Notes whether a frame of _Unwind_Backtrace() is of a library that reads data.
_Unwind_Reason_Code noteLibrary(_Unwind_Context* frame, void* found) {
  Dl_info place{};
  if (dladdr(reinterpret_cast<void*>(_Unwind_GetIP(frame)), &place) == 0 || !place.dli_fname)
    return _URC_NO_REASON;
  const std::string_view file = place.dli_fname;
  for (const char* library : {"/libcgns", "/libhdf5", "/libnetcdf"})
    if (file.find(library) != std::string_view::npos) *static_cast<bool*>(found) = true;
  return _URC_NO_REASON;
}

void endOfTrial() {
  bool of_library = false;
  _Unwind_Backtrace(noteLibrary, &of_library);
  if (!of_library) ::kill(::getppid(), SIGABRT);
}

void beginTrial() {
  __sanitizer_set_death_callback(endOfTrial);
}

}  // namespace

/// Leaks of libcgns, when a damaged file is refused, are not ours.
extern "C" const char* __lsan_default_suppressions() {
  return "leak:libcgns\n";
}

extern "C" int LLVMFuzzerInitialize(int*, char***) {
  return pthread_atfork(nullptr, nullptr, beginTrial);
}

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  static const curvisplat::FuzzTarget target = *std::ranges::find(
      curvisplat::fuzzTargets(), std::string_view(CURVISPLAT_FUZZ_TARGET), &curvisplat::FuzzTarget::name);
  curvisplat::runFuzzTarget(target, std::as_bytes(std::span(data, size)));
  return 0;
}
