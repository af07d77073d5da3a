// One connection of the server: a request over HTTP, which is answered or becomes a WebSocket.
//
// Only the server's thread, which runs the io_context, calls its members. A connection keeps itself alive
// while one of its operations is pending. It sees the server as a ConnectionHost.
#pragma once

#include <boost/asio/steady_timer.hpp>
#include <boost/beast/core/flat_buffer.hpp>
#include <boost/beast/core/tcp_stream.hpp>
#include <boost/beast/http/message.hpp>
#include <boost/beast/http/parser.hpp>
#include <boost/beast/http/string_body.hpp>
#include <boost/beast/websocket/stream.hpp>
#include <cstdint>
#include <deque>
#include <memory>
#include <optional>
#include <string>

#include "tools/serve/client_requests.h"
#include "tools/serve/remote_viewer.h"

namespace curvisplat {

class Connection;

/// The server, as its connections see it.
class ConnectionHost {
 public:
  virtual ~ConnectionHost() = default;
  virtual const ServerOptions& options() const = 0;
  /// Makes a viewer; returns nullptr at the limit of viewers. Its messages go to `connection` while that
  /// lives. Throws Error or std::system_error if the viewer cannot have its threads.
  virtual std::unique_ptr<RemoteViewer> newViewer(const std::shared_ptr<Connection>& connection) = 0;
  /// Ends a viewer, without waiting for it.
  virtual void endViewer(std::unique_ptr<RemoteViewer> viewer) noexcept = 0;
};

class Connection : public std::enable_shared_from_this<Connection> {
 public:
  /// `host` outlives it.
  Connection(boost::asio::ip::tcp::socket socket, ConnectionHost& host);
  ~Connection();
  Connection(const Connection&) = delete;
  Connection& operator=(const Connection&) = delete;

  /// Begins to read the request.
  void start();
  /// Queues a message to the page. Drops the connection if the queue is full: the page reads too slowly.
  void send(std::string message, bool is_text);
  /// Closes the socket at once, without saying goodbye.
  void drop();

 private:
  using Request = boost::beast::http::request<boost::beast::http::string_body>;
  struct Outgoing {
    std::string bytes;
    bool is_text;
  };

  void answer(const Request& request);
  void refuse(boost::beast::http::status status, const std::string& text);
  void respond(boost::beast::http::status status, const char* type, std::string body,
               const std::string& policy);
  void upgrade(const Request& request);
  void openViewer();
  void read();
  void receive();
  void writeNext();
  void limitWriting();
  void close(boost::beast::websocket::close_code code, const std::string& reason);

  ConnectionHost& host_;
  boost::beast::websocket::stream<boost::beast::tcp_stream> socket_;
  boost::asio::steady_timer writing_;  // limits the time that sending a part of a message takes
  boost::beast::flat_buffer buffer_;
  std::optional<boost::beast::http::request_parser<boost::beast::http::string_body>> parser_;
  boost::beast::http::response<boost::beast::http::string_body> response_;
  std::unique_ptr<RemoteViewer> viewer_;
  MessageRate rate_;
  std::deque<Outgoing> outgoing_;  // the first is being sent
  size_t outgoing_bytes_ = 0, sent_ = 0;
  bool closing_ = false;
};

}  // namespace curvisplat
