#include "stream/base/plugin.h"

#include <dlfcn.h>

#include <filesystem>

#include "stream/base/os.h"

namespace curvisplat {
namespace {

namespace fs = std::filesystem;

/// The file that contains this function.
fs::path thisFile() {
  Dl_info info{};
  std::error_code error;
  if (::dladdr(reinterpret_cast<const void*>(&openPlugin), &info) == 0 || !info.dli_fname) return {};
  const fs::path program = os::programFile();
  // For a program dladdr() gives the name that it was called by.
  const fs::path file = fs::canonical(info.dli_fname, error);
  return file.extension() == ".so" || program.empty() ? file : program;
}

}  // namespace

void* openPlugin(const char* name, int flags, std::string& why_not) {
  std::error_code error;
  const fs::path folder = thisFile().parent_path();
  for (const fs::path& candidate : {folder / name, folder / CURVISPLAT_PLUGINS / name}) {
    if (!fs::exists(candidate, error)) continue;
    if (void* const module = ::dlopen(candidate.c_str(), flags)) return module;
    why_not = ::dlerror();
    return nullptr;
  }
  if (void* const module = ::dlopen(name, flags)) return module;
  why_not = ::dlerror();
  return nullptr;
}

const char* pluginAdvice(std::string_view why_not) {
  // The dynamic linker's and the system's words for a file that finds no room; not those for one that needs a thread's storage from the
  // start, or that lies where nothing may be executed.
  for (const char* words : {"static TLS", "not permitted"})
    if (why_not.find(words) != std::string_view::npos) return "install curvisplat again";
  for (const char* words : {"failed to map", "cannot map", "annot allocate"})
    if (why_not.find(words) != std::string_view::npos) return "raise the limit of memory (ulimit -v)";
  return "install curvisplat again";
}

fs::path bundledFile(const char* name) {
  std::error_code error;
  const fs::path folder = thisFile().parent_path();
  for (const fs::path& candidate : {folder / name, folder / "../share/curvisplat" / name})
    if (fs::is_regular_file(candidate, error)) return candidate;
  return {};
}

}  // namespace curvisplat
