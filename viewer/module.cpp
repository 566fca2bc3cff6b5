// SPDX-License-Identifier: Apache-2.0
// The session as a module of WebAssembly, for a page without a server (web/src/module.ts). The page's worker calls what
// is exported here; messages go out through the one function that the module imports. Numbers are addresses and sizes
// of bytes in the module's memory.
#include <cstddef>
#include <cstdlib>
#include <memory>
#include <string>
#include <string_view>
#include <utility>

#include "answers.hpp"
#include "pointfair/pointfair.hpp"
#include "session.hpp"

namespace pointfair::viewer {
namespace {

// They take 0.6 GB in a default run and 0.9 GB with k = 32; there are 4 GB of addresses.
constexpr std::uint64_t kMostPoints = 1'000'000;

extern "C" __attribute__((import_module("page"), import_name("send"))) void page_send(const void* bytes,
                                                                                      std::size_t size);

void send(const Bytes& message) { page_send(message.data(), message.size()); }

Session& session() {
  static Session only({.make_pipeline = [] { return Pipeline(Device::cpu); },
                       .most_points = kMostPoints,
                       .saves_to_page = true,
                       .own_thread = false},
                      send);
  return only;
}

using Given = std::unique_ptr<char, decltype(&std::free)>;

void refuse_if(bool full) {
  if (full) send(pack(error_answer(nullptr, "the page asked for more than can wait; try again")));
}

}  // namespace

extern "C" {

/// Memory for what is given to a call below, which frees it; 0 if there is none left.
__attribute__((export_name("allocate"))) void* allocate(std::size_t size) { return std::malloc(size); }

/// A page is there.
__attribute__((export_name("greet"))) void greet() { refuse_if(!session().greet()); }

/// The bytes of a file, and its name. `is_named`: it is one that the mesh names which comes next.
__attribute__((export_name("open"))) void open_file(char* bytes, std::size_t size, char* name, std::size_t name_size,
                                                    int is_named) {
  const Given held(name, std::free);
  std::string text(name, name_size), content;
  {
    const Given file(bytes, std::free);
    content.assign(bytes, size);
  }
  const bool taken = is_named != 0 ? session().hold(std::move(content), std::move(text))
                                   : session().open(std::move(content), std::move(text));
  refuse_if(!taken);
}

/// A message of the page.
__attribute__((export_name("receive"))) void receive(char* text, std::size_t size) {
  const Given held(text, std::free);
  refuse_if(!session().receive(std::string_view(text, size)));
}

/// Does the next task that is due. Returns the milliseconds until the next one is; less than 0: nothing is left to do.
__attribute__((export_name("step"))) double step() {
  const auto wait = session().step();
  return wait ? static_cast<double>(wait->count()) : -1;
}

}  // extern "C"

}  // namespace pointfair::viewer
