// Preloaded into the program: a graphics card that was lost. What OpenGL says of resets is that there was one.
#include <dlfcn.h>

#include <string_view>

namespace {

using GetProcAddress = void* (*)(const char*);
GetProcAddress real_address;

unsigned resetStatus() {
  return 0x8253;  // GL_GUILTY_CONTEXT_RESET
}

void* addressOf(const char* name) {
  if (std::string_view(name) == "glGetGraphicsResetStatus") return reinterpret_cast<void*>(&resetStatus);
  return real_address(name);
}

}  // namespace

/// The program looks the functions of EGL up in the library that it has loaded.
extern "C" void* dlsym(void* library, const char* name) noexcept {
  using Lookup = void* (*)(void*, const char*);
  static const auto real_lookup = [] {
    void* found = nullptr;
    for (const char* version : {"GLIBC_2.2.5", "GLIBC_2.17", "GLIBC_2.34"})
      if (!found) found = dlvsym(RTLD_NEXT, "dlsym", version);
    return reinterpret_cast<Lookup>(found);
  }();
  void* const found = real_lookup(library, name);
  if (std::string_view(name) != "eglGetProcAddress" || !found) return found;
  real_address = reinterpret_cast<GetProcAddress>(found);
  return reinterpret_cast<void*>(&addressOf);
}
