// SPDX-License-Identifier: Apache-2.0
// A page made of memory: what a session sends, decoded, and waiting for it.
#pragma once

#include <gtest/gtest.h>

#include <chrono>
#include <condition_variable>
#include <cstring>
#include <functional>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include "viewer/quantise.hpp"
#include "viewer/session.hpp"

namespace pointfair::viewer {

struct Decoded {
  Json head;
  Bytes bytes;  // of the whole message

  template <class T>
  std::vector<T> array(const std::string& name) const {
    std::size_t at = 4;
    std::uint32_t length = 0;
    std::memcpy(&length, bytes.data(), 4);
    at += length;
    for (const Json& row : head["arrays"]) {
      const std::size_t width = row[1] == "uint8" ? 1 : row[1] == "int16" ? 2 : 4;
      const std::size_t count = row[2];
      if (row[0] == name) {
        EXPECT_EQ(width, sizeof(T)) << name;
        std::vector<T> values(count);
        if (count > 0) std::memcpy(values.data(), bytes.data() + at, count * sizeof(T));
        return values;
      }
      at += (count * width + 7) / 8 * 8;
    }
    ADD_FAILURE() << "no array " << name;
    return {};
  }
  bool is(std::string_view type) const { return head["type"] == type; }
};

inline Decoded decode(Bytes bytes) {
  std::uint32_t length = 0;
  std::memcpy(&length, bytes.data(), 4);
  Decoded message{Json::parse(std::string(reinterpret_cast<const char*>(bytes.data()) + 4, length)), {}};
  message.bytes = std::move(bytes);
  return message;
}

class FakePage {
 public:
  Session::Send send() {
    return [this](Bytes bytes) {
      const std::lock_guard lock(mutex_);
      messages_.push_back(decode(std::move(bytes)));
      changed_.notify_all();
    };
  }

  /// The first message, from `from` on, that the condition holds for; fails the test after a while.
  Decoded wait(const std::function<bool(const Decoded&)>& wanted, std::size_t from = 0) {
    std::unique_lock lock(mutex_);
    std::size_t next = from;
    std::optional<Decoded> found;
    const auto arrived = [&] {
      for (; next < messages_.size(); ++next) {
        if (wanted(messages_[next])) {
          found = messages_[next];
          return true;
        }
      }
      return false;
    };
    if (!changed_.wait_for(lock, std::chrono::seconds(120), arrived)) throw std::runtime_error("no such message");
    return *found;
  }
  Decoded wait_for(const std::string& type, int id) {
    return wait([&](const Decoded& m) { return m.is(type) && m.head["id"] == id; });
  }
  Decoded wait_for(const std::string& type) {
    return wait([&](const Decoded& m) { return m.is(type); });
  }
  std::vector<Decoded> all() {
    const std::lock_guard lock(mutex_);
    return messages_;
  }

 private:
  std::mutex mutex_;
  std::condition_variable changed_;
  std::vector<Decoded> messages_;
};

/// The displacements of a result, by index in the file, as the page computes them. `normals` are the last that came.
inline std::vector<Point> displacements(const Decoded& result, const std::vector<std::int16_t>& normals,
                                        std::size_t points) {
  const Order order(points);
  const float step = result.head["step"];
  const auto values = result.array<std::int16_t>("displacements");
  const bool along = result.head["along_normals"];
  EXPECT_EQ(values.size(), points * (along ? 1 : 3));
  std::vector<Point> moved(points);
  for (std::size_t place = 0; place < points; ++place) {
    Point& d = moved[order.index(place)];
    if (along) {
      const Point n = decode_normal({normals[2 * place], normals[2 * place + 1]});
      const float s = step * float(values[place]);
      d = {n.x * s, n.y * s, n.z * s};
    } else {
      d = {step * float(values[3 * place]), step * float(values[3 * place + 1]), step * float(values[3 * place + 2])};
    }
  }
  const auto places = result.array<std::uint32_t>("places");
  const auto exceptions = result.array<float>("exceptions");
  for (std::size_t i = 0; i < places.size(); ++i)
    moved[order.index(places[i])] = {exceptions[3 * i], exceptions[3 * i + 1], exceptions[3 * i + 2]};
  return moved;
}

}  // namespace pointfair::viewer
