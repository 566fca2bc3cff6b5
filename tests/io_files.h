// SPDX-License-Identifier: Apache-2.0
// File images for the tests of readers and writers, made by hand or by the plainest code, and short names for calls.
#pragma once

#include <gtest/gtest.h>
#include <sys/resource.h>

#include <algorithm>
#include <csignal>
#include <cstring>
#include <memory>
#include <string>
#include <vector>

#include "pointfair/io.hpp"
#include "runs.h"

namespace pointfair::test {

/// Reads a file image from an allocation of exactly its size, so that a sanitizer sees every over-read.
inline Cloud parse(const std::string& bytes, const std::string& name = "cloud.ply", std::optional<Format> format = {}) {
  const auto exact = std::make_unique_for_overwrite<std::byte[]>(bytes.size());
  if (!bytes.empty()) std::memcpy(exact.get(), bytes.data(), bytes.size());
  return read(std::span<const std::byte>(exact.get(), bytes.size()), name, {.format = format});
}

/// What is said of a file image that must be refused: one line that begins with its name.
inline std::string refusal(const std::string& bytes, const std::string& name, std::optional<Format> format = {}) {
  const Thrown thrown = thrown_by([&] { parse(bytes, name, format); });
  EXPECT_EQ(thrown.kind, ErrorKind::file);
  EXPECT_TRUE(thrown.message.starts_with(name + ": ")) << thrown.message;
  EXPECT_EQ(thrown.message.find('\n'), std::string::npos);
  return thrown.message;
}
inline void expect_refused(const std::string& bytes, const std::string& name, const std::string& part) {
  SCOPED_TRACE(bytes.substr(0, 200));
  EXPECT_PRED_FORMAT2(testing::IsSubstring, part, refusal(bytes, name));
}

/// A file image, and a part of what is said where it is refused.
struct Bad {
  std::string name, bytes, message;
};

inline std::string image(const Cloud& cloud, Format format, std::optional<Encoding> encoding = {}) {
  const std::vector<std::byte> bytes = write_bytes(cloud, format, encoding);
  return std::string(reinterpret_cast<const char*>(bytes.data()), bytes.size());
}

/// What `call` throws while files may have at most so many bytes, which is as a disk that is full.
template <class Call>
Thrown thrown_with_room_for(std::uint64_t bytes, const Call& call) {
  struct rlimit old {};
  ::getrlimit(RLIMIT_FSIZE, &old);
  const struct rlimit small = {static_cast<rlim_t>(bytes), old.rlim_max};
  const auto handler = std::signal(SIGXFSZ, SIG_IGN);
  ::setrlimit(RLIMIT_FSIZE, &small);
  const Thrown thrown = thrown_by(call);
  ::setrlimit(RLIMIT_FSIZE, &old);
  std::signal(SIGXFSZ, handler);
  return thrown;
}

template <class T>
std::vector<T> values(const Cloud& cloud, const std::string& name) {
  const Attribute found = attribute(cloud, name);
  EXPECT_EQ(size_of(found.type), sizeof(T)) << name;
  std::vector<T> result(found.data.size() / sizeof(T));
  std::memcpy(result.data(), found.data.data(), found.data.size());
  return result;
}

template <class T>
Attribute make_attribute(const std::string& name, ScalarType type, const std::vector<T>& values,
                         std::uint32_t components = 1) {
  const auto bytes = std::as_bytes(std::span(values));
  return {{name, type, components}, {bytes.begin(), bytes.end()}};
}

/// The bytes of numbers as a file holds them.
template <class T>
std::string packed(std::initializer_list<T> numbers, bool big_endian = false) {
  std::string bytes;
  for (const T number : numbers) {
    char one[sizeof(T)];
    std::memcpy(one, &number, sizeof(T));
    if (big_endian) std::reverse(one, one + sizeof(T));
    bytes.append(one, sizeof(T));
  }
  return bytes;
}

struct Sample {
  std::string name;  ///< with an extension
  std::string bytes;
  std::size_t points;
  bool binary = false;
};

/// Small valid files of every format and encoding, each with what it may hold beside coordinates.
std::vector<Sample> samples();

}  // namespace pointfair::test
