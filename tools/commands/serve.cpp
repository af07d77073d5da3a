// `curvisplat serve`: shows caches in browsers.
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <boost/asio/ip/address.hpp>
#include <cstdio>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "stream/base/error.h"
#include "stream/base/memory.h"
#include "stream/base/progress.h"
#include "stream/base/text.h"
#include "tools/commands/commands.h"
#include "tools/commands/grid_faces.h"
#include "tools/options/grid_surfaces.h"
#include "tools/options/kept_caches.h"
#include "tools/options/option_parsers.h"
#include "tools/options/shared_options.h"
#include "tools/output/command_run.h"
#include "tools/output/start_checks.h"
#include "tools/serve/client_requests.h"
#include "tools/serve/server.h"

namespace curvisplat {
namespace {

struct ServeArguments {
  std::vector<std::filesystem::path> caches;
  std::string listen = "127.0.0.1", memory = "4G", viewer_memory = "512M", backend = "auto";
  uint16_t port = 8642;
  std::vector<std::string> hosts;
  std::optional<std::filesystem::path> token_file;
  std::optional<std::string> frame_time;
};

constexpr uint64_t kMinViewerMemory = 32 << 20;  // less than any picture needs (FrameBudget)
constexpr size_t kLargeBlock = size_t{1} << 20;  // goes back to the system as soon as it is freed

ServerOptions optionsFrom(const ServeArguments& arguments) {
  ServerOptions options;
  options.address = arguments.listen;
  options.port = arguments.port;
  options.host_names = arguments.hosts;
  options.each.memory_bytes = parseByteSize("--viewer-memory", arguments.viewer_memory);
  if (options.each.memory_bytes < kMinViewerMemory)
    throw UsageError("--viewer-memory {}: no picture fits into this; give 32M or more",
                     arguments.viewer_memory);
  options.each.backend = parseBackend(arguments.backend);
  options.each.faces_at = facesAtStep;
  options.each.require_threads = [] { requireThreads(); };
  if (arguments.frame_time)
    options.each.target_s = parsePositive("--frame-time", *arguments.frame_time) / 1000;
  const uint64_t memory = parseByteSize("--memory", arguments.memory);
  options.viewers = memory / options.each.memory_bytes;
  if (options.viewers == 0)
    throw UsageError("--memory {} is less than one viewer's: {} (--viewer-memory)", arguments.memory,
                     arguments.viewer_memory);
  options.token = arguments.token_file ? readToken(*arguments.token_file) : newToken();
  return options;
}

void warnOfNetwork(const ServerOptions& options) {
  boost::system::error_code error;
  const auto address = boost::asio::ip::make_address(options.address, error);
  if (error || address.is_loopback()) return;
  printMessage(
      "warning: --listen {}: whoever can read this network's traffic can read the address and the pictures, "
      "which are "
      "not encrypted; an SSH tunnel to a server without --listen is safer",
      options.address);
}

/// The caches; of the other files, a grid with its solutions, the one that is kept for them, last.
std::vector<std::filesystem::path> cachesToServe(const std::vector<std::filesystem::path>& files) {
  std::vector<std::filesystem::path> caches, grid;
  for (const std::filesystem::path& file : files) (isGrid({file}) ? grid : caches).push_back(file);
  if (grid.empty()) return caches;
  Progress progress{progressBar()};
  const StopOnSignals stopping(progress);
  KeptCacheEvents events;
  events.say = [](const std::string& text) { printMessage("{}", text); };
  caches.push_back(keptCacheOf(grid, progress, events));
  return caches;
}

void serve(const ServeArguments& arguments) {
  const ServerOptions options = optionsFrom(arguments);
  const std::vector<std::filesystem::path> caches = cachesToServe(arguments.caches);
  // What viewers had goes back to the system once they have left: of three of 96 MiB, a heap for each thread kept up to 480 MiB. A
  // picture takes the same time (on two cores).
  limitHeaps(1);
  returnFreedMemory(kLargeBlock);
  warnOfNetwork(options);
  ServedFolders folders(caches, faceNamesOf);
  const size_t served = folders.caches()->size();
  requireThreads();
  Progress progress;
  const StopOnSignals stopping(progress);
  runServer(folders, options, progress, [&](const std::string& address) {
    fmt::print("{}\n", address);
    std::fflush(stdout);
    printMessage(
        "serving {} to at most {} at a time; anyone who has the address above can look at "
        "{}",
        countText(served, "cache"), countText(options.viewers, "viewer"), served == 1 ? "it" : "them");
  });
}

}  // namespace

void addServe(CLI::App& app) {
  auto arguments = std::make_shared<ServeArguments>();
  CLI::App* command = app.add_subcommand("serve", "Show caches or a grid in a web browser");
  command
      ->add_option("CACHE", arguments->caches,
                   "Splat caches, directories NAME.splats; a grid and its solutions are converted into the "
                   "user's cache folder")
      ->required();
  command->add_option("--port", arguments->port, "Port to listen on; 0: any free one")
      ->check(CLI::Range(0u, 65535u))
      ->capture_default_str();
  command
      ->add_option("--listen", arguments->listen,
                   "Address to listen on; any but the loopback's lets other machines connect, unencrypted")
      ->capture_default_str();
  command->add_option(
      "--host", arguments->hosts,
      "Further host name under which browsers may reach the server, besides localhost and numeric addresses");
  command->add_option(
      "--token-file", arguments->token_file,
      "File with the access token of the address, readable by its owner only (default: a new random token)");
  command->add_option("--viewer-memory", arguments->viewer_memory, "Memory limit of each viewer")
      ->capture_default_str();
  addMemoryOption(*command, arguments->memory,
                  ", of all viewers together. At most --memory / --viewer-memory viewers can connect");
  addBackendOption(*command, arguments->backend);
  addFrameTimeOption(*command, arguments->frame_time, " (default: 40)");
  command->callback([arguments] { serve(*arguments); });
}

}  // namespace curvisplat
