#include "tests/support/damaged_files.h"

#include <dlfcn.h>
#include <execinfo.h>
#include <fcntl.h>
#include <fmt/format.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <csignal>
#include <cstdio>
#include <cstring>
#include <new>
#include <numeric>
#include <optional>
#include <random>

#include "stream/base/error.h"
#include "stream/base/file.h"
#include "tests/support/memory_limit.h"
#include "tests/support/temporary_folder.h"

namespace curvisplat {
namespace {

// Address space that a child may take beside what it has from its parent. The files are of some tens of KiB.
constexpr uint64_t kMoreMemory = uint64_t{256} << 20;
constexpr unsigned kHangSeconds = 60;

enum Ending : int {
  kSame = 10,
  kChanged,
  kRefused,
  kBadError,
  kTooMuchMemory,
  kOtherException,
  kLibraryCrash,
  kCrash
};

/// Prints from a signal handler: the heap may be damaged, and its lock held, so that even dprintf() would
/// wait for ever.
void printMessage(const char* text) {
  if (::write(STDERR_FILENO, text, std::strlen(text)) < 0) ::_exit(kCrash);
}

constexpr const char* kParsers[] = {"libcgns", "libhdf5", "libnetcdf", "libz.", "libsz."};
constexpr const char* kRuntimes[] = {"libc.so", "libasan", "libubsan", "ld-linux", "libstdc++", "libgcc"};

template <size_t kCount>
const char* libraryOf(const char* file, const char* const (&libraries)[kCount]) {
  for (const char* library : libraries)
    if (std::strstr(file, library)) return library;
  return nullptr;
}

/// Names the source of a crash: the first frame that is neither the C library's nor the sanitizers'.
/// Before the C library's, which calls this function, are this function's own.
void onCrash(int) {
  void* frames[64];
  const int count = ::backtrace(frames, 64);
  bool called = false;
  for (int n = 0; n < count; ++n) {
    Dl_info info{};
    if (!::dladdr(frames[n], &info) || !info.dli_fname) continue;
    if (const char* library = libraryOf(info.dli_fname, kParsers)) {
      printMessage(library);
      printMessage(", ");
      printMessage(info.dli_sname ? info.dli_sname : "a function of its own");
      ::_exit(kLibraryCrash);
    }
    const bool runtime = libraryOf(info.dli_fname, kRuntimes) != nullptr;
    if (called && !runtime) break;
    called |= std::strstr(info.dli_fname, "libc.so") != nullptr;
  }
  ::_exit(kCrash);
}

/// Whether a sanitizer has ended the process for what a parser did: its report begins with the stack.
bool isOfParser(const std::string& report) {
  const size_t top = report.find(" #0 "), caller = report.find(" #1 "), end = report.find(" #2 ");
  if (report.find("AddressSanitizer") == std::string::npos || end == std::string::npos) return false;
  const std::string first = report.substr(top, caller - top), second = report.substr(caller, end - caller);
  return libraryOf(first.c_str(), kParsers) ||
         (first.find("__interceptor_") != std::string::npos && libraryOf(second.c_str(), kParsers));
}

/// All that a grid holds.
struct Content {
  std::vector<std::array<uint64_t, 3>> blocks;
  std::vector<std::string> scalars;
  std::vector<double> coordinates;
  std::vector<float> values;
  std::vector<uint8_t> blank;

  bool operator==(const Content& other) const {
    const auto same = [](const auto& a, const auto& b) {  // NaN is itself
      return a.size() == b.size() &&
             (a.empty() || std::memcmp(a.data(), b.data(), a.size() * sizeof(a[0])) == 0);
    };
    return blocks == other.blocks && scalars == other.scalars && same(coordinates, other.coordinates) &&
           same(values, other.values) && blank == other.blank;
  }
};

Content contentOf(const GridSource& source) {
  Content content;
  std::vector<uint32_t> scalars(source.description().scalars.size());
  std::iota(scalars.begin(), scalars.end(), 0u);
  for (const GridScalar& scalar : source.description().scalars) content.scalars.push_back(scalar.name);
  NodeArrays nodes;
  for (uint32_t b = 0; b < source.description().blocks.size(); ++b) {
    const GridBlock& block = source.description().blocks[b];
    content.blocks.push_back({block.ni, block.nj, block.nk});
    source.read(b, {0, block.nj, 0, block.nk}, scalars, nodes);
    for (const auto* axis : {&nodes.x, &nodes.y, &nodes.z})
      content.coordinates.insert(content.coordinates.end(), axis->begin(), axis->end());
    for (const auto& values : nodes.scalars)
      content.values.insert(content.values.end(), values.begin(), values.end());
    content.blank.insert(content.blank.end(), nodes.blank.begin(), nodes.blank.end());
  }
  return content;
}

[[noreturn]] void tryToOpen(const std::filesystem::path& file, const Content& whole,
                            const OpenDamaged& open) {
  void* warm_up[1];
  ::backtrace(warm_up, 1);  // loads what it needs: not for a signal handler
  for (const int number : {SIGSEGV, SIGBUS, SIGFPE, SIGABRT, SIGILL}) std::signal(number, onCrash);
  std::signal(SIGALRM, SIG_DFL);
  ::alarm(kHangSeconds);
  std::optional<test::MemoryLimit> limit;
  if (!kIsSanitized) limit.emplace(kMoreMemory);
  int ending = kOtherException;
  try {
    ending = contentOf(*open(file)) == whole ? kSame : kChanged;
  } catch (const Error& error) {
    const std::string text = error.what();
    const bool good =
        text.find('\n') == std::string::npos && text.find(file.filename().string()) != std::string::npos;
    ending = good ? kRefused : kBadError;
    if (!good) fmt::print(stderr, "{}\n", text);
  } catch (const std::bad_alloc&) {
    ending = kTooMuchMemory;
  } catch (...) {
  }
  ::_exit(ending);
}

class Trials {
 public:
  Trials(const std::filesystem::path& file, const OpenDamaged& open)
      : bytes_(readTextFile(file)), copy_(folder_ / "damaged"), open_(open) {
    whole_ = contentOf(*open(file));
    copy_.replace_extension(file.extension());
  }

  const std::string& bytes() const { return bytes_; }

  void tryBytes(const std::string& damaged, const std::string& name) {
    std::ofstream(copy_, std::ios::binary | std::ios::trunc) << damaged;
    const std::filesystem::path words = folder_ / "stderr";
    const pid_t child = ::fork();
    if (child == 0) {
      const int out = ::open(words.c_str(), O_CREAT | O_TRUNC | O_WRONLY, 0600);
      ::dup2(out, STDERR_FILENO);
      tryToOpen(copy_, whole_, open_);
    }
    int status = 0;
    ::waitpid(child, &status, 0);
    count(status, name, readTextFile(words));
  }

  DamageReport report;

 private:
  void count(int status, const std::string& name, std::string words) {
    std::replace(words.begin(), words.end(), '\n', ' ');
    const int ending = WIFEXITED(status) ? WEXITSTATUS(status) : -1;
    if (ending == kLibraryCrash || (ending == 1 && isOfParser(words))) {
      report.library_crashes.push_back(name + ": " + words);
      return;
    }
    if (ending == kSame) ++report.same;
    if (ending == kChanged) ++report.changed;
    if (ending == kRefused) ++report.refused;
    if (ending == kSame || ending == kChanged || ending == kRefused) {
      if (!words.empty()) report.failures.push_back(name + ": said on stderr: " + words);
      return;
    }
    const char* const how = ending == kBadError         ? "an Error that is not one line, or names no file: "
                            : ending == kTooMuchMemory  ? "asked for too much memory"
                            : ending == kOtherException ? "another exception"
                            : ending == kCrash          ? "crashed"
                            : WIFSIGNALED(status) && WTERMSIG(status) == SIGALRM ? "hung"
                                                                                 : "ended otherwise ";
    report.failures.push_back(fmt::format("{}: {}{}", name, how, words));
  }

  TemporaryFolder folder_;
  std::string bytes_;
  std::filesystem::path copy_;
  const OpenDamaged& open_;
  Content whole_;
};

}  // namespace

DamageReport openTruncated(const std::filesystem::path& file, int count, const OpenDamaged& open) {
  Trials trials(file, open);
  for (int n = 0; n < count; ++n) {
    const size_t size = trials.bytes().size() * static_cast<size_t>(n) / static_cast<size_t>(count);
    trials.tryBytes(trials.bytes().substr(0, size), fmt::format("cut at byte {}", size));
  }
  return trials.report;
}

DamageReport openCorrupted(const std::filesystem::path& file, int count, uint64_t seed,
                           const OpenDamaged& open) {
  Trials trials(file, open);
  std::mt19937_64 random(seed);
  for (int n = 0; n < count; ++n) {
    std::string damaged = trials.bytes();
    const size_t at = random() % damaged.size();
    const auto before = static_cast<unsigned char>(damaged[at]);
    const auto after = static_cast<unsigned char>(before ^ (1 + random() % 255));
    damaged[at] = static_cast<char>(after);
    trials.tryBytes(damaged, fmt::format("byte {} from {:#04x} to {:#04x}", at, before, after));
  }
  return trials.report;
}

std::string harm(const char* what, const DamageReport& report) {
  fmt::print("{}: {} the same, {} changed, {} refused, {} crashes of libraries\n", what, report.same,
             report.changed, report.refused, report.library_crashes.size());
  for (const std::string& crash : report.library_crashes) fmt::print("  crash of a library: {}\n", crash);
  std::string failures;
  for (const std::string& failure : report.failures) failures += failure + "\n";
  return failures;
}

}  // namespace curvisplat
