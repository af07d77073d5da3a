#include "tools/serve/server.h"

#include <atomic>
#include <boost/asio/dispatch.hpp>
#include <boost/asio/io_context.hpp>
#include <boost/asio/ip/tcp.hpp>
#include <boost/asio/post.hpp>
#include <boost/asio/steady_timer.hpp>
#include <chrono>
#include <list>
#include <memory>
#include <new>
#include <utility>

#include "stream/base/error.h"
#include "stream/base/mutex.h"
#include "stream/base/os.h"
#include "stream/base/threads.h"
#include "tools/serve/connection.h"

namespace curvisplat {
namespace {

namespace asio = boost::asio;
using asio::ip::tcp;
using AsioError = boost::system::error_code;

constexpr std::chrono::milliseconds kLookForStop{200};
constexpr std::chrono::milliseconds kPauseAfterError{100};
constexpr size_t kMaxRequests = 64;  // connections that are not viewers

/// Ends viewers on a thread of its own: each first ends the picture that it draws.
class ViewerCloser {
 public:
  /// Calls `ended` on its thread for each viewer that has ended.
  explicit ViewerCloser(std::function<void()> ended)
      : ended_(std::move(ended)), thread_([this] { loop(); }) {}
  ~ViewerCloser() {
    {
      const MutexLock lock(mutex_);
      stopping_ = true;
    }
    changed_.notify_all();
    thread_.join();
  }
  ViewerCloser(const ViewerCloser&) = delete;
  ViewerCloser& operator=(const ViewerCloser&) = delete;

  void end(std::unique_ptr<RemoteViewer> viewer) noexcept {
    try {
      const MutexLock lock(mutex_);
      viewers_.push_back(std::move(viewer));
    } catch (const std::bad_alloc&) {  // ends it here and waits for its picture
      viewer.reset();
      ended_();
    }
    changed_.notify_all();
  }

 private:
  void loop() {
    nameThisThread("viewers' end");
    MutexLock lock(mutex_);
    while (true) {
      while (viewers_.empty() && !stopping_) changed_.wait(lock);
      if (viewers_.empty()) return;
      std::unique_ptr<RemoteViewer> viewer = std::move(viewers_.front());
      viewers_.pop_front();
      lock.unlock();
      viewer.reset();
      os::trimHeap();  // what it has freed is the system's again
      ended_();
      lock.lock();
    }
  }

  const std::function<void()> ended_;
  Mutex mutex_;
  ConditionVariable changed_;
  std::list<std::unique_ptr<RemoteViewer>> viewers_ GUARDED_BY(mutex_);
  bool stopping_ GUARDED_BY(mutex_) = false;
  std::thread thread_;
};

class Server : public ConnectionHost {
 public:
  Server(ServedFolders& folders, const ServerOptions& options, const Progress& stopped)
      : folders_(folders),
        options_(options),
        stopped_(stopped),
        acceptor_(io_),
        timer_(io_),
        pause_(io_),
        closer_([this] { --viewers_; }) {
    listen();
  }

  /// Connections first: they give their viewers to the closer.
  ~Server() override {
    for (const auto& weak : connections_)
      if (const auto connection = weak.lock()) connection->drop();
    AsioError ignored;
    acceptor_.close(ignored);
    timer_.cancel();
    pause_.cancel();
    io_.restart();
    while (io_.poll() > 0) {
    }
  }

  std::string address() const {
    const tcp::endpoint endpoint = acceptor_.local_endpoint();
    const auto address = endpoint.address();
    // What one cannot connect to stands for this machine.
    const std::string name = address.is_unspecified() ? "localhost"
                             : address.is_v6()        ? "[" + address.to_string() + "]"
                                                      : address.to_string();
    return fmt::format("http://{}:{}/?token={}", name, endpoint.port(), options_.token);
  }

  /// An exception that leaves a handler, such as a lack of memory, ends that handler's connection, which then has no operation
  /// pending. The server's own operations begin again.
  void run() {
    bool serves = true;
    while (serves) {
      if (!accepting_) accept();
      if (!looking_) lookForStop();
      try {
        io_.run();
        serves = false;
      } catch (const std::exception& error) {
        printMessage("warning: a connection: {}", error.what());
      }
    }
    stopped_.throwIfStopped();
  }

  const ServerOptions& options() const override { return options_; }

  std::unique_ptr<RemoteViewer> newViewer(const std::shared_ptr<Connection>& connection) override {
    if (viewers_ == options_.viewers) return nullptr;
    options_.each.require_threads();
    std::weak_ptr<Connection> weak = connection;
    auto viewer = std::make_unique<RemoteViewer>(
        folders_, options_.each, [this, weak = std::move(weak)](std::string message, bool is_text) {
          asio::post(io_, [weak, is_text, text = std::move(message)]() mutable {
            if (const auto one = weak.lock()) send(*one, std::move(text), is_text);
          });
        });
    ++viewers_;
    return viewer;
  }

  void endViewer(std::unique_ptr<RemoteViewer> viewer) noexcept override { closer_.end(std::move(viewer)); }

 private:
  void listen() {
    AsioError error;
    const auto address = asio::ip::make_address(options_.address, error);
    if (error)
      throw UsageError("--listen {}: expected an address of this machine in digits, such as 127.0.0.1",
                       options_.address);
    const tcp::endpoint endpoint(address, options_.port);
    acceptor_.open(endpoint.protocol(), error);
    if (!error) acceptor_.set_option(asio::socket_base::reuse_address(true), error);
    if (!error) acceptor_.bind(endpoint, error);
    if (!error) acceptor_.listen(asio::socket_base::max_listen_connections, error);
    if (error)
      throw Error("{}:{}: cannot listen: {}; give another --port, or --port 0 for any that is free",
                  options_.address, options_.port, error.message());
  }

  /// A page that lacks a message would wait for it.
  static void send(Connection& connection, std::string message, bool is_text) {
    try {
      connection.send(std::move(message), is_text);
    } catch (const std::bad_alloc&) {
      connection.drop();
      throw;
    }
  }

  void accept() {
    acceptor_.async_accept([this](const AsioError& error, tcp::socket socket) {
      accepting_ = false;
      if (!acceptor_.is_open()) return;
      connections_.remove_if([](const auto& weak) { return weak.expired(); });
      // More than may be are not heard; those that wait for a viewer's end count as viewers.
      if (!error && connections_.size() < kMaxRequests + options_.viewers) {
        const auto connection = std::make_shared<Connection>(std::move(socket), *this);
        connections_.push_back(connection);
        connection->start();
      }
      if (!error) return accept();
      // With no descriptor left, for example, it fails again at once, until a connection ends.
      pause_.expires_after(kPauseAfterError);
      pause_.async_wait([this](const AsioError& stopped) {
        accepting_ = false;
        if (!stopped) accept();
      });
      accepting_ = true;
    });
    accepting_ = true;
  }

  void lookForStop() {
    timer_.expires_after(kLookForStop);
    timer_.async_wait([this](const AsioError& error) {
      looking_ = false;
      if (error) return;
      try {
        stopped_.throwIfStopped();
        lookForStop();
      } catch (const Interrupted&) {
        io_.stop();
      }
    });
    looking_ = true;
  }

  ServedFolders& folders_;
  const ServerOptions& options_;
  const Progress& stopped_;
  asio::io_context io_{1};
  tcp::acceptor acceptor_;
  asio::steady_timer timer_, pause_;
  bool accepting_ = false;  // or pausing, after which it accepts
  bool looking_ = false;    // for a stop
  std::list<std::weak_ptr<Connection>> connections_;
  std::atomic<size_t> viewers_ = 0;  // with those that are ending; the closer lowers it
  ViewerCloser closer_;
};

}  // namespace

void runServer(ServedFolders& folders, const ServerOptions& options, const Progress& stopped,
               const std::function<void(const std::string& address)>& listening) {
  Server server(folders, options, stopped);
  listening(server.address());
  server.run();
}

}  // namespace curvisplat
