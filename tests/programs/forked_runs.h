// How a test's run of the program reaches a process that has already loaded the program's libraries: by a message from
// run_by_fork.cpp to serve_runs.cpp, over a Unix socket. The answers are the number of the forked process and, at its end, its
// status as waitpid() gives it.
#pragma once

#include <sys/resource.h>
#include <sys/socket.h>
#include <sys/un.h>

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <string>

namespace curvisplat {

/// The variable of the environment that names the socket to serve_runs.
inline constexpr const char* kSocketVariable = "CURVISPLAT_SERVE_RUNS";

/// The header before the text: `words` arguments and `variables` of the environment, each with its '\0'. With
/// it go the descriptors 0, 1, 2 and that of the working directory.
struct RunRequest {
  uint32_t words = 0, variables = 0, bytes = 0;
  uint32_t umask = 0;
  uint64_t ignored_signals = 0;  // bit n: signal n
  std::array<rlimit, RLIM_NLIMITS> limits{};
};
inline constexpr size_t kDescriptors = 4;

/// A request as one message, with space for its descriptors. The request has to outlive it.
struct RunMessage {
  explicit RunMessage(RunRequest& request) : part{&request, sizeof request} {
    message.msg_iov = &part;
    message.msg_iovlen = 1;
    message.msg_control = control.data();
    message.msg_controllen = control.size();
  }
  RunMessage(const RunMessage&) = delete;
  RunMessage& operator=(const RunMessage&) = delete;

  iovec part;
  alignas(cmsghdr) std::array<char, CMSG_SPACE(kDescriptors * sizeof(int))> control{};
  msghdr message{};
};

/// An address without a file, which is gone with its last socket.
struct SocketAddress {
  explicit SocketAddress(const std::string& name) {
    address.sun_family = AF_UNIX;
    std::memcpy(address.sun_path + 1, name.data(), std::min(name.size(), sizeof address.sun_path - 1));
    length = static_cast<socklen_t>(offsetof(sockaddr_un, sun_path) + 1 + name.size());
  }
  const sockaddr* get() const { return reinterpret_cast<const sockaddr*>(&address); }
  sockaddr_un address{};
  socklen_t length = 0;
};

}  // namespace curvisplat
