#include "tools/serve/connection.h"

#include <boost/asio/buffer.hpp>
#include <boost/beast/core/buffers_to_string.hpp>
#include <boost/beast/http/read.hpp>
#include <boost/beast/http/write.hpp>
#include <boost/beast/websocket/rfc6455.hpp>
#include <chrono>
#include <utility>

#include "stream/base/error.h"
#include "tools/serve/client_requests.h"
#include "tools/serve/page.h"

namespace curvisplat {
namespace {

namespace beast = boost::beast;
namespace http = beast::http;
namespace websocket = beast::websocket;
using std::chrono::seconds;
using ErrorCode = boost::system::error_code;

constexpr uint32_t kLongestHeader = 8 << 10;
constexpr seconds kRequestTime{10};      // for a whole request, and for its answer
constexpr seconds kQuietTime{60};        // without a sign of life; half of it after a ping
constexpr seconds kPartTime{20};         // for a part of a message
constexpr size_t kPartBytes = 32 << 10;  // sent at a time
constexpr size_t kMaxWaitingBytes = 64 << 20;
constexpr size_t kMaxWaiting = 64;

constexpr const char* kPath = "/socket";

double clockSeconds() {
  return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count();
}

std::string_view viewOf(beast::string_view text) {
  return {text.data(), text.size()};
}

/// The policy that says what the page may load: itself, its own socket, and pictures that it has been sent.
std::string policyFor(const std::string& nonce) {
  return "default-src 'none'; script-src 'nonce-" + nonce + "'; style-src 'nonce-" + nonce +
         "'; connect-src 'self'; img-src blob: data:; base-uri 'none'; form-action 'none'";
}

std::string pageWith(const std::string& nonce) {
  constexpr std::string_view kMark = "@NONCE@";
  std::string page(kPage);
  for (size_t at = page.find(kMark); at != std::string::npos; at = page.find(kMark, at))
    page.replace(at, kMark.size(), nonce);
  return page;
}

}  // namespace

Connection::Connection(boost::asio::ip::tcp::socket socket, ConnectionHost& host)
    : host_(host), socket_(std::move(socket)), writing_(socket_.get_executor()) {}

Connection::~Connection() {
  if (viewer_) host_.endViewer(std::move(viewer_));
}

void Connection::start() {
  parser_.emplace();
  parser_->header_limit(kLongestHeader);
  parser_->body_limit(0);
  socket_.next_layer().expires_after(kRequestTime);
  http::async_read(socket_.next_layer(), buffer_, *parser_,
                   [self = shared_from_this()](const ErrorCode& error, size_t) {
                     if (error == http::error::end_of_stream || error == beast::error::timeout) return;
                     if (error == http::error::header_limit || error == http::error::body_limit)
                       self->refuse(http::status::payload_too_large, "the request is too long");
                     else if (error.category() == http::make_error_code(http::error::bad_method).category())
                       self->refuse(http::status::bad_request, "this is not HTTP");
                     else if (!error)
                       self->answer(self->parser_->get());
                   });
}

void Connection::answer(const Request& request) {
  const RequestTarget target = targetOf(viewOf(request.target()));
  if (!isKnownHost(viewOf(request[http::field::host]), host_.options().host_names))
    return refuse(http::status::misdirected_request,
                  "unknown host name; to allow it, start the server with --host NAME");
  const bool is_socket = target.path == kPath;
  if (!is_socket && target.path != "/") return refuse(http::status::not_found, "there is nothing here");
  if (!isSameToken(target.token, host_.options().token))
    return refuse(http::status::forbidden,
                  "the token is wrong or missing; use the whole address that 'curvisplat serve' has printed");
  if (is_socket) {
    if (!websocket::is_upgrade(request))
      return refuse(http::status::upgrade_required, "expected a WebSocket");
    if (!isOwnOrigin(viewOf(request[http::field::origin]), viewOf(request[http::field::host])))
      return refuse(http::status::forbidden, "pages of other sites may not connect");
    return upgrade(request);
  }
  if (request.method() != http::verb::get && request.method() != http::verb::head)
    return refuse(http::status::method_not_allowed, "expected GET");
  const std::string nonce = newToken();
  respond(http::status::ok, "text/html; charset=utf-8", pageWith(nonce), policyFor(nonce));
}

void Connection::refuse(http::status status, const std::string& text) {
  respond(status, "text/plain; charset=utf-8", text + "\n", "default-src 'none'");
}

void Connection::respond(http::status status, const char* type, std::string body, const std::string& policy) {
  const bool head_only = parser_->is_header_done() && parser_->get().method() == http::verb::head;
  response_.result(status);
  response_.version(11);
  response_.keep_alive(false);
  response_.set(http::field::content_type, type);
  response_.set(http::field::cache_control, "no-store");
  response_.set("Content-Security-Policy", policy);
  response_.set("Referrer-Policy", "no-referrer");  // the address has the token
  response_.set("X-Content-Type-Options", "nosniff");
  response_.set("Cross-Origin-Resource-Policy", "same-origin");
  response_.content_length(body.size());
  if (!head_only) response_.body() = std::move(body);
  socket_.next_layer().expires_after(kRequestTime);
  http::async_write(socket_.next_layer(), response_, [self = shared_from_this()](const ErrorCode&, size_t) {
    ErrorCode ignored;
    self->socket_.next_layer().socket().shutdown(boost::asio::ip::tcp::socket::shutdown_both, ignored);
  });
}

void Connection::upgrade(const Request& request) {
  socket_.next_layer().expires_never();  // the stream has times of its own
  websocket::stream_base::timeout times{};
  times.handshake_timeout = kRequestTime;
  times.idle_timeout = kQuietTime;
  times.keep_alive_pings = true;
  socket_.set_option(times);
  socket_.read_message_max(kLongestMessage);
  socket_.auto_fragment(false);
  socket_.async_accept(request, [self = shared_from_this()](const ErrorCode& error) {
    if (!error) self->openViewer();
  });
}

void Connection::openViewer() {
  parser_.reset();
  ErrorCode ignored;
  socket_.next_layer().socket().set_option(boost::asio::ip::tcp::no_delay(true), ignored);
  // Pings count as messages do.
  socket_.control_callback([this](websocket::frame_type, beast::string_view) {
    if (!rate_.admits(clockSeconds())) drop();
  });
  try {
    viewer_ = host_.newViewer(shared_from_this());
  } catch (const std::exception& error) {
    printMessage("warning: a viewer is refused: {}", error.what());
    return close(websocket::close_code::try_again_later,
                 "the server has no threads or memory left for another viewer");
  }
  if (!viewer_)
    return close(websocket::close_code::try_again_later,
                 "as many viewers as the server allows are connected");
  read();
}

void Connection::read() {
  socket_.async_read(buffer_, [self = shared_from_this()](const ErrorCode& error, size_t) {
    if (error || self->closing_) {
      if (self->viewer_) self->host_.endViewer(std::move(self->viewer_));
      return self->drop();
    }
    self->receive();
  });
}

void Connection::receive() {
  if (!rate_.admits(clockSeconds())) return close(websocket::close_code::policy_error, "too many messages");
  if (!socket_.got_text()) return close(websocket::close_code::unknown_data, "expected text");
  try {
    viewer_->receive(parseClientMessage(beast::buffers_to_string(buffer_.data())));
  } catch (const Error& error) {
    send(ServedCaches::refusalText(error.what()), true);
  }
  buffer_.consume(buffer_.size());
  if (!closing_) read();
}

void Connection::send(std::string message, bool is_text) {
  if (closing_) return;
  const size_t bytes = message.size();
  outgoing_.push_back({std::move(message), is_text});
  outgoing_bytes_ += bytes;
  if (outgoing_.size() > kMaxWaiting || outgoing_bytes_ > kMaxWaitingBytes) return drop();
  if (outgoing_.size() == 1) writeNext();
}

/// Sends a part of the first message: so that each part, not each message, has its time.
void Connection::writeNext() {
  const Outgoing& message = outgoing_.front();
  const size_t bytes = std::min(kPartBytes, message.bytes.size() - sent_);
  const bool is_last = sent_ + bytes == message.bytes.size();
  if (sent_ == 0) socket_.text(message.is_text);
  limitWriting();
  socket_.async_write_some(is_last, boost::asio::buffer(message.bytes.data() + sent_, bytes),
                           [self = shared_from_this(), bytes, is_last](const ErrorCode& error, size_t) {
                             self->writing_.cancel();
                             if (error || self->closing_) return;
                             self->sent_ += bytes;
                             if (is_last) {
                               self->outgoing_bytes_ -= self->outgoing_.front().bytes.size();
                               self->outgoing_.pop_front();
                               self->sent_ = 0;
                             }
                             if (!self->outgoing_.empty()) self->writeNext();
                           });
}

void Connection::limitWriting() {
  writing_.expires_after(kPartTime);
  writing_.async_wait([weak = weak_from_this()](const ErrorCode& error) {
    if (error) return;  // it was sent in time
    if (const auto self = weak.lock()) self->drop();
  });
}

/// Says goodbye. The page must not keep us waiting: the other side has kRequestTime for its own.
void Connection::close(websocket::close_code code, const std::string& reason) {
  if (closing_) return;
  closing_ = true;
  if (viewer_) host_.endViewer(std::move(viewer_));
  limitWriting();
  socket_.async_close({code, reason}, [self = shared_from_this()](const ErrorCode&) { self->drop(); });
}

void Connection::drop() {
  closing_ = true;
  writing_.cancel();
  socket_.next_layer().close();
}

}  // namespace curvisplat
