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
  const auto says = [&](std::string_view words) { return why_not.find(words) != std::string_view::npos; };
  // The words of the dynamic linker and of the system. A file may also need a thread's storage from the start, or lie where nothing may
  // be executed.
  const bool finds_no_room = says("failed to map") || says("cannot map") || says("annot allocate");
  return finds_no_room && !says("static TLS") && !says("not permitted")
             ? "raise the limit of memory (ulimit -v)"
             : "install curvisplat again";
}

fs::path bundledFile(const char* name) {
  std::error_code error;
  const fs::path folder = thisFile().parent_path();
  for (const fs::path& candidate : {folder / name, folder / "../share/curvisplat" / name})
    if (fs::is_regular_file(candidate, error)) return candidate;
  return {};
}

}  // namespace curvisplat
