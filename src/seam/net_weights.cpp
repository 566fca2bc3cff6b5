// SPDX-License-Identifier: Apache-2.0
#include "seam/net_weights.hpp"

#include <bit>
#include <cstring>
#include <string_view>

#include "pointfair/cloud.hpp"

namespace pointfair {

// Made of src/learned/weights.bin by the build.
extern const unsigned char kOwnWeightsFile[];
extern const std::size_t kOwnWeightsSize;

namespace {

namespace net = point::net;

constexpr std::string_view kMagic = "pfweight";
constexpr std::uint32_t kVersion = 2;
constexpr std::size_t kHeader = 28;
constexpr std::size_t kWord = 4;  // weights of an output that lie together

template <class T>
T number_at(std::span<const std::byte> bytes, std::size_t at) {
  static_assert(std::endian::native == std::endian::little);
  T value;
  std::memcpy(&value, bytes.data() + at, sizeof value);
  return value;
}

std::uint64_t fingerprint_of(std::span<const std::byte> bytes) {
  std::uint64_t hash = 0xcbf29ce484222325ull;
  for (const std::byte byte : bytes) hash = (hash ^ std::uint64_t(byte)) * 0x100000001b3ull;
  return hash;
}

constexpr std::size_t bytes_of(std::size_t outputs, std::size_t inputs, bool has_bias) {
  return outputs * (inputs + (has_bias ? sizeof(int) : 0));
}
constexpr std::size_t kC = net::kChannels;
constexpr std::size_t kPayload = bytes_of(kC, net::kPointFeatures, true) +
                                 net::kLayers * (bytes_of(kC, kC, true) + bytes_of(kC, kC, false) +
                                                 bytes_of(kC, net::kEdgeFeatures, false) + bytes_of(kC, 3 * kC, true)) +
                                 (net::kLayers - net::kFirstGated) * bytes_of(net::kGates, kC, false) +
                                 bytes_of(net::kOutputs, kC, true);

// Reads matrices one after the other into arrays that do not move.
class Reader {
 public:
  Reader(std::span<const std::byte> from, std::vector<std::int8_t>& weights, std::vector<int>& biases)
      : from_(from), weights_(weights), biases_(biases) {
    weights_.reserve(from.size());
    biases_.reserve(from.size() / sizeof(int));
  }

  // Word by word of the inputs.
  const std::int8_t* words(std::size_t outputs, std::size_t inputs) {
    const std::size_t start = weights_.size();
    for (std::size_t word = 0; word < inputs; word += kWord)
      for (std::size_t o = 0; o < outputs; ++o)
        for (std::size_t i = word; i < word + kWord; ++i) weights_.push_back(weight_at(o * inputs + i));
    at_ += outputs * inputs;
    return weights_.data() + start;
  }
  const std::int8_t* rows(std::size_t outputs, std::size_t inputs) {
    const std::size_t start = weights_.size();
    for (std::size_t i = 0; i < outputs * inputs; ++i) weights_.push_back(weight_at(i));
    at_ += outputs * inputs;
    return weights_.data() + start;
  }
  const int* bias(std::size_t outputs) {
    const std::size_t start = biases_.size();
    for (std::size_t o = 0; o < outputs; ++o, at_ += sizeof(int)) biases_.push_back(number_at<int>(from_, at_));
    return biases_.data() + start;
  }
  bool holds() const { return holds_; }  // every weight is one that sums were made for

 private:
  std::int8_t weight_at(std::size_t i) {
    const auto weight = std::int8_t(from_[at_ + i]);
    holds_ = holds_ && weight >= -127;
    return weight;
  }
  std::span<const std::byte> from_;
  std::vector<std::int8_t>& weights_;
  std::vector<int>& biases_;
  std::size_t at_ = 0;
  bool holds_ = true;
};

}  // namespace

NetWeights::NetWeights(std::span<const std::byte> file, const std::string& name) {
  const auto refuse = [&](const std::string& why) { throw Error(ErrorKind::file, name + ": " + why); };
  const std::size_t compared = std::min(file.size(), kMagic.size());
  if (std::memcmp(file.data(), kMagic.data(), compared) != 0 || compared == 0)
    refuse("this is no file of weights for --method learned");
  if (file.size() < kHeader) refuse("the file of weights is cut after " + std::to_string(file.size()) + " bytes");
  const auto version = number_at<std::uint32_t>(file, 8);
  if (version != kVersion)
    refuse("the weights have version " + std::to_string(version) + ", and this program reads version " +
           std::to_string(kVersion) + (version > kVersion ? "; use a newer program" : ": train them anew"));
  const std::span<const std::byte> payload = file.subspan(kHeader);
  if (number_at<std::uint32_t>(file, 12) != kPayload || payload.size() != kPayload)
    refuse("the file of weights has " + std::to_string(file.size()) + " bytes instead of " +
           std::to_string(kHeader + kPayload) + ": it is cut or damaged");
  fingerprint_ = number_at<std::uint64_t>(file, 16);
  const auto trust = number_at<float>(file, 24);
  if (fingerprint_of(payload) != fingerprint_ || !(trust > 0 && trust < 100))
    refuse("the weights are damaged: their fingerprint does not fit");

  Reader reader(payload, weights_, biases_);
  view_.input = reader.words(kC, net::kPointFeatures);
  view_.input_bias = reader.bias(kC);
  for (int l = 0; l < net::kLayers; ++l) {
    net::Layer& layer = view_.layers[l];
    layer.own = reader.words(kC, kC);
    layer.own_bias = reader.bias(kC);
    layer.other = reader.words(kC, kC);
    layer.edge = reader.words(kC, net::kEdgeFeatures);
    layer.update = reader.words(kC, 3 * kC);
    layer.update_bias = reader.bias(kC);
    layer.gate = l >= net::kFirstGated ? reader.rows(net::kGates, kC) : nullptr;
  }
  view_.output = reader.rows(net::kOutputs, kC);
  view_.output_bias = reader.bias(net::kOutputs);
  view_.squared_trust = trust * trust;
  if (!reader.holds()) refuse("the weights are damaged: one is below -127");
}

net::Weights NetWeights::view_over(const std::int8_t* numbers, const int* biases) const {
  net::Weights view = view_;
  const auto move_numbers = [&](const std::int8_t*& at) {
    if (at != nullptr) at = numbers + (at - weights_.data());
  };
  const auto move_biases = [&](const int*& at) { at = biases + (at - biases_.data()); };
  move_numbers(view.input);
  move_numbers(view.output);
  move_biases(view.input_bias);
  move_biases(view.output_bias);
  for (net::Layer& layer : view.layers) {
    for (const std::int8_t** at : {&layer.own, &layer.other, &layer.edge, &layer.update, &layer.gate})
      move_numbers(*at);
    move_biases(layer.own_bias);
    move_biases(layer.update_bias);
  }
  return view;
}

std::shared_ptr<const NetWeights> own_net_weights() {
  static const auto weights =
      std::make_shared<const NetWeights>(std::as_bytes(std::span(kOwnWeightsFile, kOwnWeightsSize)), "own weights");
  return weights;
}

}  // namespace pointfair
