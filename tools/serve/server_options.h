// Where a server listens, and what it allows.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "tools/serve/remote_viewer.h"

namespace curvisplat {

struct ServerOptions {
  std::string address = "127.0.0.1";
  uint16_t port = 8642;  // 0: one that is free
  std::string token;
  std::vector<std::string> host_names;  // under which browsers may reach it, beside localhost and addresses
  size_t viewers = 8;                   // at a time
  ViewerLimits each;
};

}  // namespace curvisplat
