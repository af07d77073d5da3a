// One viewer of the server: answers the messages of one page, on a thread of its own.
//
//   connection --receive()--> [ viewer's thread ] --request()--> [ frame loop's thread draws ]
//       ^                        |        ^                             |
//       +--------send()----------+        +----------- wake ------------+
//                 encoded
//
// Only the newest request of each kind is kept, so that no page can make this grow. While the camera moves,
// the next picture is asked for as soon as fewer than three are on their way to the page: neither the drawing
// nor the line gets ahead of what the page shows. At rest, pictures become finer, and the last one is
// lossless: the same as `curvisplat render` writes.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include "render/backend/backend.h"
#include "stream/base/mutex.h"
#include "tools/serve/client_requests.h"
#include "tools/serve/served_caches.h"

namespace curvisplat {

/// The limits of each viewer.
struct ViewerLimits {
  uint64_t memory_bytes = 512 << 20;  // for drawing
  double target_s = 0.04;             // to draw a picture while the camera moves
  Backend backend = Backend::kAutomatic;
  FacesAtStep faces_at = {};  // none: no faces are drawn
  /// Throws Error if a viewer's pictures cannot have their threads: libraries that cannot start one may end the process.
  std::function<void()> require_threads = [] {};
};

/// The address at which a server listens, and what it allows.
struct ServerOptions {
  std::string address = "127.0.0.1";
  uint16_t port = 8642;  // 0: one that is free
  std::string token;
  std::vector<std::string> host_names;  // under which browsers may reach it, beside localhost and addresses
  size_t viewers = 8;                   // at a time
  ViewerLimits each;
};

class RemoteViewer {
 public:
  /// Sends a message: a text, or bytes. Called on the viewer's thread.
  using Send = std::function<void(std::string message, bool is_text)>;

  /// Shows the caches as they are now. `folders` must outlive it.
  RemoteViewer(ServedFolders& folders, const ViewerLimits& limits, Send send);
  /// Stops the picture being drawn, and waits for it.
  ~RemoteViewer();
  RemoteViewer(const RemoteViewer&) = delete;
  RemoteViewer& operator=(const RemoteViewer&) = delete;

  /// Takes a request, in place of the one of its kind that has not been answered yet. Any thread.
  void receive(ClientMessage message);

 private:
  class Work;
  struct Inbox {
    std::optional<OpenRequest> open;
    std::optional<ViewRequest> view;
    std::optional<FunctionRequest> function;
    std::optional<HistogramRequest> histogram;
    std::optional<ColoursRequest> colours;
    std::optional<IsosurfaceRequest> isosurface;
    std::optional<PickRequest> pick;
    std::optional<CommandRequest> command;
    std::vector<uint64_t> shown;
    bool woken = false;  // the frame loop has something
  };
  void loop();
  void serve(const ServedCaches& caches);
  void reportFailure(const std::exception& error) noexcept;
  void wake();

  ServedFolders& folders_;
  const ViewerLimits limits_;
  const Send send_;

  Mutex mutex_;
  ConditionVariable changed_;
  Inbox inbox_ GUARDED_BY(mutex_);
  bool news_ GUARDED_BY(mutex_) = false;
  bool stopping_ GUARDED_BY(mutex_) = false;
  std::thread thread_;
};

}  // namespace curvisplat
