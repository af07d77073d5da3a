// Preloaded into the program: instead of main(), it waits for runs and forks itself for each. Nine of ten milliseconds of a
// short run are the dynamic linker's; a fork has everything loaded. It ends when nothing has run for a while.
#include <dlfcn.h>
#include <fcntl.h>
#include <poll.h>
#include <signal.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cstdarg>
#include <cstdio>
#include <cstdlib>
#include <vector>

#include "tests/programs/forked_runs.h"

namespace curvisplat {
namespace {

using Main = int (*)(int, char**, char**);
Main program_main;

struct Run {
  int client = -1;  // closed by whoever asked when it is killed
  pid_t process = -1;
  int process_ended = -1;
};

bool readAll(int socket, void* to, size_t bytes) {
  for (auto* at = static_cast<char*>(to); bytes > 0;) {
    const ssize_t got = read(socket, at, bytes);
    if (got <= 0) return false;
    at += got;
    bytes -= static_cast<size_t>(got);
  }
  return true;
}

bool receive(int socket, RunRequest& request, std::array<int, kDescriptors>& descriptors,
             std::vector<char>& text) {
  RunMessage received(request);
  if (recvmsg(socket, &received.message, MSG_CMSG_CLOEXEC | MSG_WAITALL) != sizeof request) return false;
  const cmsghdr* const header = CMSG_FIRSTHDR(&received.message);
  if (!header || header->cmsg_len != CMSG_LEN(sizeof descriptors)) return false;
  std::memcpy(descriptors.data(), CMSG_DATA(header), sizeof descriptors);
  text.resize(request.bytes);
  return readAll(socket, text.data(), text.size());
}

/// The forked process: becomes what a program is that was started with these words and descriptors.
[[noreturn]] void runMain(const RunRequest& request, const std::array<int, kDescriptors>& descriptors,
                          std::vector<char>& text) {
  for (int n = 0; n < 3; ++n) dup2(descriptors[static_cast<size_t>(n)], n);
  if (fchdir(descriptors[3]) != 0) _exit(127);
  syscall(SYS_close_range, 3, ~0u, 0);
  umask(request.umask);
  for (int n = 0; n < static_cast<int>(request.limits.size()); ++n)
    setrlimit(static_cast<__rlimit_resource>(n), &request.limits[static_cast<size_t>(n)]);
  for (int n = 1; n < 64; ++n) signal(n, request.ignored_signals >> n & 1 ? SIG_IGN : SIG_DFL);
  std::vector<char*> words;
  for (char* at = text.data(); at < text.data() + text.size(); at += std::strlen(at) + 1) {
    words.push_back(at);
    if (words.size() == request.words) words.push_back(nullptr);
  }
  words.push_back(nullptr);
  environ = words.data() + request.words + 1;
  const int status = program_main(static_cast<int>(request.words), words.data(), environ);
  std::fflush(nullptr);
  _exit(status);  // libraries' threads, which their destructors wait for, are not in this process
}

void start(Run& run) {
  RunRequest request;
  std::array<int, kDescriptors> descriptors{};
  std::vector<char> text;
  if (!receive(run.client, request, descriptors, text)) return;
  run.process = fork();
  if (run.process == 0) runMain(request, descriptors, text);
  for (const int descriptor : descriptors) close(descriptor);
  if (run.process < 0) return;
  run.process_ended = static_cast<int>(syscall(SYS_pidfd_open, run.process, 0));
  if (write(run.client, &run.process, sizeof run.process) < 0) kill(run.process, SIGKILL);
}

/// Tells how it ended; or ends it, when nobody waits for it any more.
void finish(const Run& run, bool is_abandoned) {
  if (is_abandoned) kill(run.process, SIGKILL);
  int status = 0;
  waitpid(run.process, &status, 0);
  if (!is_abandoned && write(run.client, &status, sizeof status) < 0) return;
}

void closeRun(const Run& run) {
  close(run.client);
  if (run.process_ended >= 0) close(run.process_ended);
}

/// Loads OpenVDB as stream/vdb/vdb_library.cpp, and the libraries of formats as preprocess/formats/common/data_libraries.cpp does when they
/// are first needed.
void loadPlugins(const char* program) {
  std::string folder(program);
  folder.resize(folder.rfind('/') + 1);
  dlopen((folder + "curvisplat-vdb.so").c_str(), RTLD_NOW | RTLD_LOCAL | RTLD_DEEPBIND);
  dlopen((folder + "curvisplat-formats.so").c_str(), RTLD_LAZY | RTLD_LOCAL);
}

int serveRuns(int, char** argv, char**) {
  constexpr int kIdleMilliseconds = 5000;
  loadPlugins(argv[0]);
  const SocketAddress address(std::getenv(kSocketVariable));
  signal(SIGPIPE, SIG_IGN);
  const int listener = socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0);
  if (bind(listener, address.get(), address.length) != 0 || listen(listener, 64) != 0) _exit(1);
  std::vector<Run> runs;
  for (;;) {
    std::vector<pollfd> waited{{listener, POLLIN, 0}};
    for (const Run& run : runs) {
      waited.push_back({run.client, POLLIN, 0});
      waited.push_back({run.process_ended, POLLIN, 0});
    }
    const int ready = poll(waited.data(), waited.size(), runs.empty() ? kIdleMilliseconds : -1);
    if (ready == 0) _exit(0);
    for (size_t n = 0; n < runs.size(); ++n) {
      const bool ended = waited[2 * n + 2].revents != 0, abandoned = waited[2 * n + 1].revents != 0;
      if (!ended && !abandoned) continue;
      finish(runs[n], !ended);
      closeRun(runs[n]);
      runs[n].client = -1;
    }
    std::erase_if(runs, [](const Run& run) { return run.client < 0; });
    if (waited[0].revents == 0) continue;
    Run run;
    run.client = accept4(listener, nullptr, nullptr, SOCK_CLOEXEC);
    if (run.client < 0) continue;
    start(run);
    if (run.process > 0)
      runs.push_back(run);
    else
      closeRun(run);
  }
}

}  // namespace
}  // namespace curvisplat

// NOLINTNEXTLINE(bugprone-reserved-identifier): glibc's name; four more arguments follow
extern "C" int __libc_start_main(curvisplat::Main program, int argc, char** argv, ...) {
  va_list rest;
  va_start(rest, argv);
  std::array<void*, 4> others{};
  for (void*& other : others) other = va_arg(rest, void*);
  va_end(rest);
  using Start = int (*)(curvisplat::Main, int, char**, void*, void*, void*, void*);
  const auto start = reinterpret_cast<Start>(dlsym(RTLD_NEXT, "__libc_start_main"));
  curvisplat::program_main = program;
  return start(curvisplat::serveRuns, argc, argv, others[0], others[1], others[2], others[3]);
}
