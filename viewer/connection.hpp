// SPDX-License-Identifier: Apache-2.0
// The WebSocket of one page: messages leave in order, and a sender waits while earlier messages are on their way.
#pragma once

#include <boost/asio/awaitable.hpp>
#include <boost/asio/steady_timer.hpp>
#include <boost/beast/core.hpp>
#include <boost/beast/http.hpp>
#include <boost/beast/websocket.hpp>
#include <condition_variable>
#include <deque>
#include <functional>
#include <memory>
#include <mutex>
#include <string_view>

#include "message.hpp"

namespace pointfair::viewer {

class Connection : public std::enable_shared_from_this<Connection> {
 public:
  using Request = boost::beast::http::request<boost::beast::http::empty_body>;
  using Receive = std::function<void(std::string_view)>;

  explicit Connection(boost::beast::tcp_stream stream);

  /// Answers the upgrade and passes messages to `receive` until the page leaves, is too slow, or breaks the rules.
  /// `opened` is called once messages can be sent.
  boost::asio::awaitable<void> run(Request request, std::function<void()> opened, Receive receive);

  /// From any thread but the network's. Waits while more than a little is on its way; a closed connection takes all.
  void send(Bytes message);

  /// Sends a last message and ends the connection. From the network's thread.
  void dismiss(Bytes message);

  /// Ends the connection at once. From the network's thread.
  void close();

 private:
  boost::asio::awaitable<void> write_messages();
  bool take(Bytes& message);
  void written(std::size_t bytes);

  boost::beast::websocket::stream<boost::beast::tcp_stream> socket_;
  boost::asio::steady_timer arrival_, deadline_;

  std::mutex mutex_;
  std::condition_variable changed_;
  std::deque<Bytes> queue_;
  std::size_t bytes_ = 0;  // in the queue and in the write under way
  bool closed_ = false, dismissed_ = false;
};

}  // namespace pointfair::viewer
