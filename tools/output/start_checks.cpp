#include "tools/output/start_checks.h"

#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <fstream>
#include <string>
#include <system_error>
#include <vector>

#include "stream/base/durable_file.h"
#include "stream/base/error.h"
#include "stream/base/file.h"
#include "stream/base/text.h"
#include "stream/base/threads.h"

namespace curvisplat {

void checkOutputFolder(std::string_view option, const std::filesystem::path& path, std::string_view suffix) {
  const std::filesystem::path folder = folderOf(path);
  std::error_code ignored;
  if (!std::filesystem::is_directory(folder, ignored))
    throw Error("{} {}: the directory {} does not exist; create it first", option, path.string(),
                folder.string());
  if (::access(folder.c_str(), W_OK | X_OK) != 0)
    throw Error("{} {}: the directory {} is not writable: {}; choose another", option, path.string(),
                folder.string(), std::strerror(errno));
  std::error_code error;
  static_cast<void>(std::filesystem::symlink_status(path.string().append(suffix), error));
  if (error != std::errc::filename_too_long) return;
  const long most = ::pathconf(folder.c_str(), _PC_NAME_MAX);
  const size_t bytes = path.filename().string().size() + suffix.size();
  if (most > 0 && bytes > static_cast<size_t>(most))
    throw Error("{} {}: the name is too long; choose one that is {} shorter", option, path.string(),
                countText(bytes - static_cast<size_t>(most), "byte"));
  throw Error("{} {}: the name is too long; choose a shorter one", option, path.string());
}

void checkOutputFile(std::string_view option, const std::filesystem::path& path,
                     const std::vector<std::filesystem::path>& others) {
  namespace fs = std::filesystem;
  checkOutputFolder(option, path);
  std::error_code ignored;
  fs::path target;
  try {
    target = fs::weakly_canonical(writableTarget(path), ignored);
  } catch (const Error& error) {
    throw Error("{} {}", option, error.what());
  }
  if (target != path) checkOutputFolder(option, target);
  removeAbandonedFiles(folderOf(target));
  for (const fs::path& other : others) {
    if (other.empty()) continue;
    const fs::path there = fs::weakly_canonical(linkTarget(other), ignored);
    if (there == target || fs::equivalent(target, there, ignored))
      throw Error("{} {}: would overwrite {}; choose another name", option, path.string(), other.string());
    if (fs::equivalent(target.parent_path(), there, ignored))
      throw Error("{} {}: lies in {}, which is read; choose another folder", option, path.string(),
                  other.string());
  }
}

void checkJsonOutput(std::string_view option, const std::filesystem::path& path,
                     const std::vector<std::filesystem::path>& others) {
  checkOutputFile(option, path, others);
  std::ifstream existing(path, std::ios::binary);
  char first = 0;
  if (existing >> first && first != '{' && first != '[')
    throw Error("{} {}: exists and is not a JSON file; choose another name, or remove it first", option,
                path.string());
}

namespace {

constexpr unsigned kOwnThreads = 4;  // reading ahead, writing, paging, OpenGL
constexpr unsigned kMaxTried = 64;   // memory may allow fewer threads than --threads
constexpr const char* kAdvice = "raise the limits of processes and memory (ulimit -u, ulimit -v)";

void tryThreads(unsigned count, const std::string& hint) {
  count = std::min(threadsOrCores(count), kMaxTried) + kOwnThreads;
  if (const int error = errorOfThreads(count); error != 0)
    throw Error("cannot start {} threads: {}; {}", count, std::strerror(error), hint);
}

}  // namespace

const char* const kNoThread =
    "cannot start a thread: the system has none left; raise the limits of processes and memory (ulimit -u, "
    "ulimit -v)";

void requireThreads(unsigned count, std::string_view option) {
  tryThreads(count, fmt::format("lower {}, or {}", option, kAdvice));
}

void requireThreads() {
  tryThreads(0, kAdvice);
}

bool isForLackOfThreads(const std::exception& error) {
  const auto* const system = dynamic_cast<const std::system_error*>(&error);
  return (system && system->code() == std::errc::resource_unavailable_try_again) ||
         std::string_view(error.what()).starts_with("pthread_create");
}

std::string textOf(const std::filesystem::filesystem_error& error) {
  // Where a directory cannot be read on, its name is not told.
  const std::string path = error.path1().empty() ? "a directory cannot be read" : error.path1().string();
  return path + ": " + error.code().message();
}

}  // namespace curvisplat
