// SPDX-License-Identifier: Apache-2.0
#include "server.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <boost/asio/co_spawn.hpp>
#include <boost/asio/detached.hpp>
#include <boost/asio/io_context.hpp>
#include <boost/asio/ip/host_name.hpp>
#include <boost/asio/ip/tcp.hpp>
#include <boost/asio/post.hpp>
#include <boost/asio/redirect_error.hpp>
#include <boost/asio/steady_timer.hpp>
#include <boost/asio/use_awaitable.hpp>
#include <limits>
#include <mutex>

#include "answers.hpp"
#include "connection.hpp"
#include "gate.hpp"
#include "page_files.hpp"
#include "pointfair/file_info.hpp"
#include "session.hpp"

namespace pointfair::viewer {
namespace {

namespace net = boost::asio;
namespace beast = boost::beast;
namespace http = beast::http;
using boost::system::error_code;
using net::ip::tcp;
using Response = http::response<http::string_body>;
using HeaderParser = http::request_parser<http::empty_body>;

constexpr int kMaxConnections = 64;
constexpr std::uint32_t kMaxHeaderBytes = 8 * 1024;
constexpr std::chrono::milliseconds kAcceptRest{100};
constexpr std::chrono::seconds kHeaderPatience{10}, kUploadPatience{600}, kWritePatience{30};
constexpr std::string_view kPolicy =
    "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' blob: data:; connect-src 'self'; "
    "base-uri 'none'; form-action 'none'; frame-ancestors 'none'";

constexpr std::string_view kBusy = "the page asked for more than can wait; it connects again";

std::string_view view(beast::string_view text) { return {text.data(), text.size()}; }

class Server {
 public:
  Server(const ServerOptions& options, PageFiles files)
      : options_(options), files_(std::move(files)), acceptor_(context_), session_(session_options(), [this](Bytes m) {
          if (const auto page = current_page()) page->send(std::move(m));
        }) {}

  ~Server() {
    if (const auto page = current_page()) page->close();  // the session may wait for it
  }

  void listen();
  std::string url() const;
  void open(Cloud cloud, const std::filesystem::path& path) { session_.open(std::move(cloud), path); }

  void run(const std::stop_token& stop) {
    const std::stop_callback end(stop, [this] { net::post(context_, [this] { context_.stop(); }); });
    net::co_spawn(
        context_, [this] { return accept_all(); }, net::detached);
    context_.run();
  }

 private:
  Session::Options session_options() const {
    return {.make_pipeline = [device = options_.device] { return Pipeline(device); },
            .save_folder = options_.save_folder,
            .point_budget = options_.point_budget,
            .viewpoint = options_.viewpoint,
            .reading = options_.reading};
  }

  std::shared_ptr<Connection> current_page() {
    const std::lock_guard lock(mutex_);
    return page_;
  }

  net::awaitable<void> accept_all();
  net::awaitable<void> serve(tcp::socket socket);
  net::awaitable<void> answer_requests(beast::tcp_stream& stream);
  net::awaitable<bool> answer(beast::tcp_stream& stream, beast::flat_buffer& buffer, HeaderParser& parser);
  net::awaitable<void> take_page(beast::tcp_stream& stream, HeaderParser& parser);
  net::awaitable<Response> take_upload(beast::tcp_stream& stream, beast::flat_buffer& buffer, HeaderParser& parser);
  Response file_response(const HeaderParser& parser) const;
  bool may_change(const HeaderParser& parser) const;

  const ServerOptions options_;
  const PageFiles files_;
  Gate gate_;
  net::io_context context_{1};
  tcp::acceptor acceptor_;
  int connections_ = 0;
  std::mutex mutex_;
  std::shared_ptr<Connection> page_;
  Session session_;  // last: its thread ends before what it sends to
};

Response text_response(http::status status, std::string_view text) {
  Response response(status, 11);
  response.set(http::field::content_type, "text/plain; charset=utf-8");
  response.body() = std::string(text) + "\n";
  return response;
}

void Server::listen() {
  tcp::resolver resolver(context_);
  error_code error;
  const auto found = resolver.resolve(options_.host, std::to_string(options_.port), tcp::resolver::passive, error);
  if (error || found.empty())
    throw Error(ErrorKind::failed, fmt::format("--host {}: no such address on this machine", options_.host));
  const tcp::endpoint endpoint = found.begin()->endpoint();
  acceptor_.open(endpoint.protocol());
  acceptor_.set_option(net::socket_base::reuse_address(true));
  acceptor_.bind(endpoint, error);
  if (error == net::error::address_in_use && options_.other_port)
    acceptor_.bind(tcp::endpoint(endpoint.address(), 0), error);
  if (!error) acceptor_.listen(net::socket_base::max_listen_connections, error);
  if (error)
    throw Error(ErrorKind::failed,
                fmt::format("cannot listen on {} port {}: {}; choose another --{}", options_.host, options_.port,
                            error.message(), error == boost::system::errc::address_not_available ? "host" : "port"));
  const net::ip::address address = endpoint.address();
  if (!address.is_loopback() || options_.token) gate_.token = make_token();
  if (address.is_unspecified()) return;  // any name may lead here: the token decides
  gate_.hosts = {"localhost", "127.0.0.1", "[::1]"};
  if (!address.is_loopback()) {
    gate_.hosts = {options_.host, net::ip::host_name(error)};
    gate_.hosts.push_back(address.is_v6() ? "[" + address.to_string() + "]" : address.to_string());
  }
}

std::string Server::url() const {
  const tcp::endpoint endpoint = acceptor_.local_endpoint();
  error_code error;
  std::string host = options_.host;
  if (endpoint.address().is_unspecified()) host = net::ip::host_name(error);
  if (host.find(':') != host.npos) host = "[" + host + "]";
  return fmt::format("http://{}:{}/{}", host, endpoint.port(), gate_.token.empty() ? "" : "?token=" + gate_.token);
}

net::awaitable<void> Server::accept_all() {
  net::steady_timer rest(context_);
  while (true) {
    error_code error;
    tcp::socket socket = co_await acceptor_.async_accept(net::redirect_error(net::use_awaitable, error));
    if (error) {  // no file handle is free, most likely: nothing changes until another connection ends
      rest.expires_after(kAcceptRest);
      co_await rest.async_wait(net::redirect_error(net::use_awaitable, error));
      continue;
    }
    if (connections_ >= kMaxConnections) continue;  // the socket closes itself
    net::co_spawn(
        context_, [this, taken = std::make_shared<tcp::socket>(std::move(socket))] { return serve(std::move(*taken)); },
        net::detached);
  }
}

net::awaitable<void> Server::serve(tcp::socket socket) {
  ++connections_;
  try {
    beast::tcp_stream stream(std::move(socket));
    co_await answer_requests(stream);
  } catch (const std::exception&) {
    // whatever one client does or sends ends that client's connection only
  }
  --connections_;
}

net::awaitable<void> Server::answer_requests(beast::tcp_stream& stream) {
  beast::flat_buffer buffer;
  bool more = true;
  while (more) {
    HeaderParser parser;
    parser.header_limit(kMaxHeaderBytes);
    parser.body_limit(std::numeric_limits<std::uint64_t>::max());  // what has a body sets its own limit
    stream.expires_after(kHeaderPatience);
    error_code error;
    co_await http::async_read_header(stream, buffer, parser, net::redirect_error(net::use_awaitable, error));
    if (error) co_return;
    more = co_await answer(stream, buffer, parser);
  }
  error_code ignored;
  stream.socket().shutdown(tcp::socket::shutdown_send, ignored);
}

// Whether the connection stays open for a further request.
net::awaitable<bool> Server::answer(beast::tcp_stream& stream, beast::flat_buffer& buffer, HeaderParser& parser) {
  const auto& request = parser.get();
  const std::string_view path = path_of(view(request.target()));
  const bool head = request.method() == http::verb::head;
  bool keep = request.keep_alive() && request.method() != http::verb::post;
  Response response;
  if (!gate_.admits_host(view(request[http::field::host]))) {
    response =
        text_response(http::status::forbidden, "this server has another name; use the address that pointfair printed");
    keep = false;
  } else if (path == "/session" || path == "/upload") {
    if (!may_change(parser)) {
      response = text_response(http::status::forbidden, "use the address that pointfair printed, with its token");
      keep = false;
    } else if (path == "/session") {
      if (!beast::websocket::is_upgrade(request)) {
        response = text_response(http::status::upgrade_required, "this address is for WebSockets");
        keep = false;
      } else {
        co_await take_page(stream, parser);
        co_return false;
      }
    } else {
      response = co_await take_upload(stream, buffer, parser);
      keep = false;
    }
  } else {
    response = file_response(parser);
  }
  response.set(http::field::server, "pointfair");
  response.set("Content-Security-Policy", std::string(kPolicy));
  response.set("X-Content-Type-Options", "nosniff");
  response.set("Referrer-Policy", "no-referrer");
  response.set("Cross-Origin-Opener-Policy", "same-origin");
  response.set("Cross-Origin-Resource-Policy", "same-origin");
  response.set(http::field::cache_control, "no-store");
  response.keep_alive(keep);
  response.content_length(response.body().size());
  if (head) response.body().clear();
  stream.expires_after(kWritePatience);
  http::response_serializer<http::string_body> serializer(response);
  serializer.split(head);
  error_code error;
  if (head) {
    co_await http::async_write_header(stream, serializer, net::redirect_error(net::use_awaitable, error));
  } else {
    co_await http::async_write(stream, serializer, net::redirect_error(net::use_awaitable, error));
  }
  co_return keep && !error;
}

bool Server::may_change(const HeaderParser& parser) const {
  const auto& request = parser.get();
  return gate_.admits_origin(view(request[http::field::origin]), view(request[http::field::host])) &&
         gate_.admits_target(view(request.target()));
}

Response Server::file_response(const HeaderParser& parser) const {
  const auto& request = parser.get();
  if (request.method() != http::verb::get && request.method() != http::verb::head)
    return text_response(http::status::method_not_allowed, "this address answers GET only");
  const std::string_view path = path_of(view(request.target()));
  const auto file = files_.find(path == "/" ? "/index.html" : path);
  if (file == files_.end()) return text_response(http::status::not_found, "there is no such file");
  Response response(http::status::ok, 11);
  response.set(http::field::content_type, std::string(file->second.type));
  response.body() = file->second.content;
  return response;
}

net::awaitable<Response> Server::take_upload(beast::tcp_stream& stream, beast::flat_buffer& buffer,
                                             HeaderParser& parser) {
  if (parser.get().method() != http::verb::post)
    co_return text_response(http::status::method_not_allowed, "send a file with POST");
  const Response too_large =
      text_response(http::status::payload_too_large,
                    fmt::format("the page can send files of up to {} MiB; start pointfair view with this file instead",
                                options_.upload_limit >> 20));
  if (parser.content_length() && *parser.content_length() > options_.upload_limit) co_return too_large;
  const std::string name = query_value(view(parser.get().target()), "name");
  http::request_parser<http::string_body> body(std::move(parser));
  body.body_limit(options_.upload_limit);
  stream.expires_after(kUploadPatience);
  error_code error;
  co_await http::async_read(stream, buffer, body, net::redirect_error(net::use_awaitable, error));
  if (error == http::error::body_limit) co_return too_large;
  if (error) co_return text_response(http::status::bad_request, "the file did not arrive completely; send it again");
  const bool is_companion = query_value(view(body.get().target()), "named") == "1";
  const bool taken = is_companion ? session_.hold(std::move(body.get().body()), name)
                                  : session_.open(std::move(body.get().body()), name.empty() ? "cloud" : name);
  if (!taken)
    co_return text_response(http::status::service_unavailable, "pointfair is busy; send the file again later");
  co_return text_response(http::status::accepted, "reading");
}

net::awaitable<void> Server::take_page(beast::tcp_stream& stream, HeaderParser& parser) {
  const auto page = std::make_shared<Connection>(std::move(stream));
  // Named, and not temporaries of the co_await: GCC 12 destroys what a temporary closure holds there twice.
  const std::function<void()> opened = [this, page] {
    std::shared_ptr<Connection> former;
    {
      const std::lock_guard lock(mutex_);
      former = std::exchange(page_, page);
    }
    if (former) former->dismiss(pack({{"type", "taken"}}));
    if (!session_.greet()) page->dismiss(pack(error_answer(nullptr, kBusy)));
  };
  const Connection::Receive receive = [this, page](std::string_view text) {
    if (current_page() == page && !session_.receive(text)) page->dismiss(pack(error_answer(nullptr, kBusy)));
  };
  co_await page->run(parser.release(), opened, receive);
  const std::lock_guard lock(mutex_);
  if (page_ == page) page_.reset();
}

}  // namespace

void serve(const std::filesystem::path& input, const ServerOptions& options,
           const std::function<void(const std::string& url)>& ready, std::stop_token stop) {
  Server server(options, read_page(options.page));
  server.listen();
  if (!input.empty()) {
    ReadOptions read_options = options.reading;
    read_options.threads = options.device.threads;
    Cloud cloud = read(input, read_options);
    check_not_geographic(cloud);
    parse_viewpoints(options.viewpoint, cloud);  // refuses names of attributes that it has not
    server.open(std::move(cloud), input);
  }
  ready(server.url());
  server.run(stop);
}

}  // namespace pointfair::viewer
