// SPDX-License-Identifier: Apache-2.0
#include "pipeline/devices.hpp"

#include <charconv>
#include <string>
#include <utility>

namespace pointfair {
namespace {

std::vector<int> usable_cards() {
  std::vector<int> usable;
  const std::vector<DeviceStatus> all = list_cuda_devices();
  for (std::size_t card = 0; card < all.size(); ++card)
    if (all[card].usable) usable.push_back(int(card));
  return usable;
}

// "0,2"; nothing if it is not a list of numbers.
std::vector<int> parse_cards(std::string_view text) {
  std::vector<int> cards;
  const char *at = text.data(), *const end = at + text.size();
  for (;; ++at) {
    const auto [after, error] = std::from_chars(at, end, cards.emplace_back());
    if (error != std::errc() || cards.back() < 0) return {};
    if (after == end) return cards;
    if (*after != ',') return {};
    at = after;
  }
}

// "2 x NVIDIA H200", or the names with + between them.
std::string name_of(const std::vector<int>& cards) {
  const std::vector<DeviceStatus> all = list_cuda_devices();
  std::string names;
  bool alike = true;
  for (const int card : cards) {
    const std::string& its = all[std::size_t(card)].info.name;
    alike = alike && its == all[std::size_t(cards[0])].info.name;
    names += (names.empty() ? "" : " + ") + its;
  }
  return alike ? std::to_string(cards.size()) + " x " + all[std::size_t(cards[0])].info.name : names;
}

}  // namespace

Device parse_device(std::string_view name, unsigned threads) {
  if (name == "auto") return {Device::automatic, 0, threads};
  if (name == "cpu") return {Device::cpu, 0, threads};
  if (name == "cuda") return {Device::cuda, 0, threads};
  Device device(Device::cuda, 0, threads);
  if (name == "cuda:all") {
    device.cards = usable_cards();
  } else {
    device.cards = name.starts_with("cuda:") ? parse_cards(name.substr(5)) : std::vector<int>();
    if (device.cards.empty())
      throw Error(ErrorKind::usage, "device '" + std::string(name) +
                                        "': use auto, cpu, cuda, cuda:N, cuda:N,M for several cards, or cuda:all");
  }
  if (!device.cards.empty()) device.index = device.cards[0];
  if (device.cards.size() < 2) device.cards.clear();
  return device;
}

std::unique_ptr<Backend> make_backend(const Device& device, DeviceInfo& info) {
  const auto on_cpu = [&](std::string reason) {
    auto backend = make_cpu_backend(device.threads);
    info = backend->device();
    info.reason = std::move(reason);
    return backend;
  };
  if (device.kind == Device::cpu) return on_cpu("requested");
  try {
    const std::vector<Device> cards = single_devices(device);
    auto backend = make_cuda_backend(cards[0].index);
    info = backend->device();
    for (std::size_t i = 1; i < cards.size(); ++i) make_cuda_backend(cards[i].index);  // throws if it cannot be used
    if (cards.size() > 1) info.name = name_of(device.cards);
    info.reason = device.kind == Device::cuda ? "requested" : "a CUDA card was found";
    return backend;
  } catch (const Error& error) {
    if (device.kind == Device::cuda) throw;
    return on_cpu(std::string("no CUDA: ") + error.what());
  }
}

std::vector<Device> single_devices(const Device& device) {
  if (device.kind != Device::cuda || device.cards.size() < 2) return {device};
  std::vector<Device> singles;
  for (const int card : device.cards) singles.emplace_back(Device::cuda, card, device.threads);
  return singles;
}

MakeWorkers make_workers(const Device& device, Device::Kind found) {
  MakeWorkers workers;
  if (found != Device::cuda) return workers;
  for (const Device& single : single_devices(device))
    workers.of_cards.push_back([card = single.index] { return make_cuda_backend(card); });
  if (device.kind == Device::automatic)
    workers.on_cpu = [threads = device.threads] { return make_cpu_backend(threads); };
  return workers;
}

std::vector<DeviceStatus> list_devices() {
  std::vector<DeviceStatus> devices{cpu_status()};
  for (DeviceStatus& cuda : list_cuda_devices()) devices.push_back(std::move(cuda));
  return devices;
}

}  // namespace pointfair
