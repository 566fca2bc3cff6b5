// SPDX-License-Identifier: Apache-2.0
#include "connection.hpp"

#include <algorithm>
#include <boost/asio/co_spawn.hpp>
#include <boost/asio/detached.hpp>
#include <boost/asio/post.hpp>
#include <boost/asio/redirect_error.hpp>
#include <boost/asio/use_awaitable.hpp>
#include <chrono>

namespace pointfair::viewer {
namespace {

namespace net = boost::asio;
namespace beast = boost::beast;
namespace websocket = beast::websocket;
using boost::system::error_code;

constexpr std::size_t kMaxIncoming = 64 * 1024;  // of a message of the page; a lasso of 256 corners takes 10 kB
constexpr std::size_t kMaxWaiting = 64 * 1024;
constexpr std::chrono::seconds kPatience{20};
constexpr std::size_t kSlowestRate = 100'000;  // bytes a second

}  // namespace

Connection::Connection(beast::tcp_stream stream)
    : socket_(std::move(stream)), arrival_(socket_.get_executor()), deadline_(socket_.get_executor()) {
  arrival_.expires_at(net::steady_timer::time_point::max());
}

net::awaitable<void> Connection::run(Request request, std::function<void()> opened, Receive receive) {
  const auto self = shared_from_this();
  beast::get_lowest_layer(socket_).expires_never();  // the WebSocket has its own clock
  beast::get_lowest_layer(socket_).socket().set_option(net::ip::tcp::no_delay(true));
  websocket::stream_base::timeout timeout = websocket::stream_base::timeout::suggested(beast::role_type::server);
  timeout.keep_alive_pings = true;
  socket_.set_option(timeout);
  socket_.read_message_max(kMaxIncoming);
  socket_.auto_fragment(false);
  error_code error;
  co_await socket_.async_accept(request, net::redirect_error(net::use_awaitable, error));
  if (error) co_return close();
  socket_.binary(true);
  net::co_spawn(
      socket_.get_executor(), [self]() { return self->write_messages(); }, net::detached);
  opened();
  beast::flat_buffer buffer;
  while (true) {
    co_await socket_.async_read(buffer, net::redirect_error(net::use_awaitable, error));
    if (error || !socket_.got_text()) break;
    receive({static_cast<const char*>(buffer.data().data()), buffer.size()});
    buffer.clear();
  }
  close();
}

void Connection::send(Bytes message) {
  std::unique_lock lock(mutex_);
  changed_.wait(lock, [this] { return closed_ || dismissed_ || bytes_ <= kMaxWaiting; });
  if (closed_ || dismissed_) return;
  bytes_ += message.size();
  queue_.push_back(std::move(message));
  net::post(socket_.get_executor(), [self = shared_from_this()] { self->arrival_.cancel(); });
}

void Connection::dismiss(Bytes message) {
  {
    const std::lock_guard lock(mutex_);
    dismissed_ = true;
    queue_.clear();
    queue_.push_back(std::move(message));
  }
  changed_.notify_all();
  arrival_.cancel();
}

void Connection::close() {
  {
    const std::lock_guard lock(mutex_);
    closed_ = true;
    queue_.clear();
  }
  changed_.notify_all();
  arrival_.cancel();
  deadline_.cancel();
  beast::get_lowest_layer(socket_).close();
}

bool Connection::take(Bytes& message) {
  const std::lock_guard lock(mutex_);
  if (queue_.empty()) return false;
  message = std::move(queue_.front());
  queue_.pop_front();
  return true;
}

void Connection::written(std::size_t bytes) {
  {
    const std::lock_guard lock(mutex_);
    bytes_ -= std::min(bytes_, bytes);  // a dismissed connection forgot what waited
  }
  changed_.notify_all();
}

net::awaitable<void> Connection::write_messages() {
  const auto self = shared_from_this();
  error_code error;
  while (!closed_) {
    Bytes message;
    if (!take(message)) {
      if (dismissed_) co_return close();
      co_await arrival_.async_wait(net::redirect_error(net::use_awaitable, error));
      continue;
    }
    deadline_.expires_after(kPatience + std::chrono::seconds(message.size() / kSlowestRate));
    deadline_.async_wait([self](const error_code& cancelled) {
      if (!cancelled) self->close();
    });
    co_await socket_.async_write(net::buffer(message), net::redirect_error(net::use_awaitable, error));
    deadline_.cancel();
    written(message.size());
    if (error) co_return close();
  }
}

}  // namespace pointfair::viewer
