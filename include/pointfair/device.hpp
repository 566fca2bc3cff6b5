// SPDX-License-Identifier: Apache-2.0
// Where to compute, what devices this machine has, and host memory that a device copies fastest.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "pointfair/cloud.hpp"
#include "pointfair/export.hpp"

namespace pointfair {

/// Where to compute. `automatic` is CUDA if this build has it and a card can be used, else the CPU; runs that read the
/// faces of a mesh, or that need the whole of a cloud which one card cannot hold, are then done on the CPU.
struct Device {
  enum class Kind : std::uint8_t { automatic, cpu, cuda };
  Kind kind = Kind::automatic;
  int index = 0;         ///< which CUDA card
  unsigned threads = 0;  ///< CPU threads; 0: all cores
  /// Two or more CUDA cards, of which the first is `index`; empty: the card `index` alone. They share the
  /// stages of clouds of 4 million points or more, clouds that do not fit into the first card, and the tiles of a run
  /// over files (TiledRun).
  std::vector<int> cards{};

  static constexpr Kind automatic = Kind::automatic, cpu = Kind::cpu, cuda = Kind::cuda;
  Device() = default;
  Device(Kind its_kind, int card = 0, unsigned cpu_threads = 0) : kind(its_kind), index(card), threads(cpu_threads) {}
};

/// The device of this name: "auto", "cpu", "cuda", a card such as "cuda:1", cards such as "cuda:0,2", or "cuda:all",
/// which are all cards of this machine that can be used. Throws ErrorKind::usage for other names.
POINTFAIR_EXPORT Device parse_device(std::string_view name, unsigned threads = 0);

/// The device that a pipeline runs on, and why it is that one.
struct DeviceInfo {
  Device::Kind kind = Device::cpu;
  std::string name;    ///< "AMD EPYC, 2 threads, AVX-512"; "NVIDIA H200"; "2 x NVIDIA H200"
  std::string reason;  ///< "requested"; "no CUDA device: driver not found"
};

/// A device of this machine, and whether it can be used.
struct DeviceStatus {
  DeviceInfo info;
  bool usable = false;
  std::vector<std::string> details;  ///< driver, runtime, memory, and why it cannot be used
};

/// Every device that this build can see, the CPU first. A missing driver is no error.
POINTFAIR_EXPORT std::vector<DeviceStatus> list_devices();

/// Host memory for points that the pipeline's device copies at full speed: page-locked for a card, ordinary for the
/// CPU. Owns the memory and may outlive the pipeline. Can be moved, not copied.
class HostBuffer {
 public:
  using Release = void (*)(Point*) noexcept;

  HostBuffer() = default;
  /// Takes ownership of `points`; `release` frees it.
  HostBuffer(Point* points, std::size_t count, Release release) : memory_(points, release), count_(count) {}

  /// The points; their values are undefined until they are written.
  std::span<Point> points() const { return {memory_.get(), count_}; }

 private:
  static void release_nothing(Point*) noexcept {}
  std::unique_ptr<Point[], Release> memory_{nullptr, release_nothing};
  std::size_t count_ = 0;
};

}  // namespace pointfair
