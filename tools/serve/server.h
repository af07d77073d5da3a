// Serves caches to browsers: HTTP for the page, one WebSocket for each viewer.
//
//   [ main thread: all connections ] --messages--> [ RemoteViewer, one a viewer ]
//              ^                                        |
//              +------------- post() -------------------+
//
// Limits: connections and viewers by number, requests by size and time, messages by size and rate, memory by the
// viewers' limits. What a viewer sends wrongly closes its connection, and nothing else.
#pragma once

#include <functional>
#include <string>

#include "stream/base/progress.h"
#include "tools/serve/remote_viewer.h"
#include "tools/serve/served_caches.h"

namespace curvisplat {

/// Listens, calls `listening` with the page's address, and serves until `stopped` is stopped; then throws
/// Interrupted. Throws Error if the address cannot be listened at.
void runServer(ServedFolders& folders, const ServerOptions& options, const Progress& stopped,
               const std::function<void(const std::string& address)>& listening);

}  // namespace curvisplat
