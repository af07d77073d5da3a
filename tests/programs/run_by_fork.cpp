// Stands for the program in tests that start it very often: has a process that has loaded the program's libraries fork itself
// (serve_runs.cpp), and behaves as the fork does. Starts that process where there is none; where something speaks against it, it
// becomes the program itself.
#include <fcntl.h>
#include <signal.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cerrno>
#include <cstdio>
#include <cstdlib>
#include <string_view>
#include <vector>

#include "tests/programs/forked_runs.h"

namespace curvisplat {
namespace {

pid_t forwarded_to = -1;

/// Whether what a program looks at before main() is not as usual, or a test asks for it, since it measures processes.
bool mustBeStarted(char** environment) {
  for (; *environment; ++environment)
    for (const std::string_view prefix : {"LD_", "MALLOC_", "GLIBC_", "CURVISPLAT_START="})
      if (std::string_view(*environment).starts_with(prefix)) return true;
  return false;
}

/// Another one for each build of the program.
std::string socketName() {
  struct stat program {};
  if (stat(CURVISPLAT_PROGRAM, &program) != 0) return {};
  return "curvisplat-runs-" + std::to_string(getuid()) + "-" + std::to_string(program.st_dev) + "-" +
         std::to_string(program.st_ino) + "-" + std::to_string(program.st_mtim.tv_sec) + "." +
         std::to_string(program.st_mtim.tv_nsec);
}

int connected(const SocketAddress& address) {
  const int socket = ::socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0);
  if (connect(socket, address.get(), address.length) == 0) return socket;
  close(socket);
  return -1;
}

void startServer(const std::string& name) {
  if (fork() != 0) return;
  setsid();
  if (fork() != 0) _exit(0);
  const int null = open("/dev/null", O_RDWR);
  for (int n = 0; n < 3; ++n) dup2(null, n);
  close_range(3, ~0u, 0);
  if (chdir("/") != 0) _exit(1);
  for (int n = 1; n < 64; ++n) signal(n, SIG_DFL);
  setenv(kSocketVariable, name.c_str(), 1);
  setenv("LD_PRELOAD", CURVISPLAT_SERVE_RUNS, 1);
  setenv("LD_BIND_NOW", "1", 1);
  execl(CURVISPLAT_PROGRAM, CURVISPLAT_PROGRAM, nullptr);
  _exit(1);
}

bool send(int socket, int argc, char** argv, char** environment) {
  RunRequest request;
  std::string text;
  for (; request.words < static_cast<uint32_t>(argc); ++request.words)
    text.append(argv[request.words]) += '\0';
  for (; *environment; ++environment, ++request.variables) text.append(*environment) += '\0';
  request.bytes = static_cast<uint32_t>(text.size());
  request.umask = umask(0);
  umask(request.umask);
  for (int n = 1; n < 64; ++n) {
    struct sigaction action {};
    if (sigaction(n, nullptr, &action) == 0 && action.sa_handler == SIG_IGN)
      request.ignored_signals |= uint64_t{1} << n;
  }
  for (int n = 0; n < static_cast<int>(request.limits.size()); ++n)
    getrlimit(static_cast<__rlimit_resource>(n), &request.limits[static_cast<size_t>(n)]);
  const std::array<int, kDescriptors> descriptors{0, 1, 2, open(".", O_PATH | O_DIRECTORY | O_CLOEXEC)};
  RunMessage sent_with(request);
  cmsghdr* const header = CMSG_FIRSTHDR(&sent_with.message);
  header->cmsg_level = SOL_SOCKET;
  header->cmsg_type = SCM_RIGHTS;
  header->cmsg_len = CMSG_LEN(sizeof descriptors);
  std::memcpy(CMSG_DATA(header), descriptors.data(), sizeof descriptors);
  if (sendmsg(socket, &sent_with.message, MSG_NOSIGNAL) != sizeof request) return false;
  for (size_t sent = 0; sent < text.size();) {
    const ssize_t got = ::send(socket, text.data() + sent, text.size() - sent, MSG_NOSIGNAL);
    if (got <= 0) return false;
    sent += static_cast<size_t>(got);
  }
  return true;
}

template <class T>
bool receive(int socket, T& value) {
  for (;;) {
    const ssize_t got = read(socket, &value, sizeof value);
    if (got == sizeof value) return true;
    if (got >= 0 || errno != EINTR) return false;
  }
}

[[noreturn]] void endAs(int status) {
  if (WIFSIGNALED(status)) {
    const rlimit none{0, 0};
    setrlimit(RLIMIT_CORE, &none);
    signal(WTERMSIG(status), SIG_DFL);
    raise(WTERMSIG(status));
  }
  _exit(WEXITSTATUS(status));
}

/// Runs by a fork and ends; returns if it was not begun.
void runByFork(int argc, char** argv) {
  const std::string name = socketName();
  const SocketAddress address(name);
  int socket = connected(address);
  if (socket < 0) startServer(name);
  for (int tries = 0; socket < 0 && tries < 1000; ++tries) {
    usleep(5000);
    socket = connected(address);
  }
  if (socket < 0 || !send(socket, argc, argv, environ)) return;
  pid_t process = -1;
  if (!receive(socket, process)) return;
  forwarded_to = process;
  for (const int number : {SIGINT, SIGTERM, SIGHUP, SIGQUIT, SIGUSR1, SIGUSR2, SIGCONT, SIGTSTP, SIGWINCH}) {
    struct sigaction action {};
    if (sigaction(number, nullptr, &action) == 0 && action.sa_handler == SIG_IGN) continue;
    action.sa_handler = [](int received) { kill(forwarded_to, received); };
    sigaction(number, &action, nullptr);
  }
  for (int n = 0; n < 3; ++n) close(n);
  int status = 0;
  if (!receive(socket, status)) raise(SIGKILL);
  endAs(status);
}

}  // namespace
}  // namespace curvisplat

int main(int argc, char** argv) {
  if (!curvisplat::mustBeStarted(environ)) curvisplat::runByFork(argc, argv);
  execv(CURVISPLAT_PROGRAM, argv);
  std::perror("run_by_fork: " CURVISPLAT_PROGRAM);
  return 127;
}
