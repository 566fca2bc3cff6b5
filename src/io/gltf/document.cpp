// SPDX-License-Identifier: Apache-2.0
#include "io/gltf/document.hpp"

#include <algorithm>
#include <filesystem>
#include <limits>
#include <optional>

#include "platform/path_text.hpp"

namespace pointfair::io::gltf {
namespace {

constexpr std::string_view kData = "data:";  // begins a URI that is the data
constexpr std::uint32_t kJsonChunk = 0x4E4F534A, kBinaryChunk = 0x004E4942;

std::uint32_t number_at(std::string_view bytes, std::size_t place) {
  return load_little<std::uint32_t>(bytes.data() + place);
}

std::optional<std::string> from_base64(std::string_view text) {
  static constexpr std::string_view kDigits = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  while (text.ends_with('=')) text.remove_suffix(1);
  std::string bytes;
  bytes.reserve(text.size() * 3 / 4);
  std::uint32_t bits = 0;
  int count = 0;
  for (const char c : text) {
    const std::size_t digit = kDigits.find(c);
    if (digit == std::string_view::npos) return std::nullopt;
    bits = bits << 6 | static_cast<std::uint32_t>(digit);
    count += 6;
    if (count < 8) continue;
    count -= 8;
    bytes += static_cast<char>(bits >> count & 255);
  }
  return bytes;
}

// "a%20b" means "a b".
std::string without_escapes(std::string_view uri) {
  std::string result;
  for (std::size_t i = 0; i < uri.size(); ++i) {
    const std::string digits(uri.substr(i + 1 <= uri.size() ? i + 1 : i, 2));
    const bool escaped =
        uri[i] == '%' && digits.size() == 2 && digits.find_first_not_of("0123456789abcdefABCDEF") == std::string::npos;
    result += escaped ? static_cast<char>(std::stoi(digits, nullptr, 16)) : uri[i];
    if (escaped) i += 2;
  }
  return result;
}

std::size_t size_member(const Json& object, const char* key, std::size_t absent = 0) {
  const auto found = object.find(key);
  if (found == object.end()) return absent;
  if (!found->is_number_unsigned()) throw std::out_of_range(key);
  return found->get<std::size_t>();
}

std::size_t components_of(const std::string& type) {
  constexpr std::string_view kShapes[] = {"SCALAR", "VEC2", "VEC3", "VEC4"};
  const auto its = std::ranges::find(kShapes, type);
  if (its == std::end(kShapes)) throw std::out_of_range("type");
  return static_cast<std::size_t>(its - std::begin(kShapes)) + 1;
}

NativeType type_of(std::size_t component_type) {
  constexpr std::size_t kFirst = 5120, kInt = 5124, kLast = 5126;  // in the order of NativeType; int is not allowed
  if (component_type < kFirst || component_type > kLast || component_type == kInt)
    throw std::out_of_range("componentType");
  return static_cast<NativeType>(component_type - kFirst);
}

}  // namespace

double Values::at(std::size_t element, std::size_t component) const {
  const double value = load_double(bytes.data() + element * stride + component * size_of(type), type, kBigEndian);
  if (!normalized) return value;
  return with_type(type, [&](auto tag) {
    using T = decltype(tag);
    if constexpr (std::is_integral_v<T>) return std::max(value / double(std::numeric_limits<T>::max()), -1.0);
    return value;
  });
}

Document::Document(FileBytes bytes, std::string name)
    : bytes_(std::move(bytes)), name_(std::move(name)), file_size_(bytes_.view().size()) {
  try {
    read_container(bytes_.view());
    if (json_.is_discarded() || !json_.is_object()) damaged("its JSON cannot be read");
    for (const Json& extension : json_.value("extensionsRequired", Json::array())) {
      const std::string known = extension.get<std::string>();
      if (known.find("draco") != std::string::npos || known.find("meshopt") != std::string::npos)
        fail(name_, "its meshes are compressed (" + known + "), which cannot be read; export it without compression");
    }
    read_buffers();
  } catch (const Error&) {
    throw;
  } catch (const std::bad_alloc&) {
    throw;
  } catch (const std::exception&) {
    damaged("its JSON is not that of glTF");
  }
}

void Document::damaged(const std::string& what) const {
  fail(name_, "this glTF file is damaged: " + what + "; export it again");
}

void Document::read_container(std::string_view bytes) {
  std::string_view text = bytes;
  if (bytes.starts_with("glTF")) {
    if (bytes.size() < 20) damaged("it ends within its header");
    if (number_at(bytes, 4) != 2)
      fail(name_, "is glTF version " + std::to_string(number_at(bytes, 4)) + "; version 2 is known: export it as that");
    if (number_at(bytes, 8) > bytes.size())
      fail(name_, "its header promises " + std::to_string(number_at(bytes, 8)) + " bytes, file ends after " +
                      std::to_string(bytes.size()) + "; copy it again");
    const std::size_t length = number_at(bytes, 12);
    if (number_at(bytes, 16) != kJsonChunk || length > bytes.size() - 20) damaged("it does not begin with JSON");
    text = bytes.substr(20, length);
    const std::size_t next = 20 + (length + 3) / 4 * 4;
    if (next + 8 <= bytes.size() && number_at(bytes, next + 4) == kBinaryChunk)
      binary_ = bytes.substr(next + 8, number_at(bytes, next));
  }
  json_ = Json::parse(text.begin(), text.end(), nullptr, false);
}

// The bytes of a data URI, of which `what` has one.
std::string Document::data_of(std::string_view uri, const std::string& what) const {
  constexpr std::string_view kBase64 = ";base64,";
  const std::size_t begin = uri.find(kBase64);
  auto decoded = begin == std::string::npos ? std::nullopt : from_base64(uri.substr(begin + kBase64.size()));
  if (!decoded) damaged(what + " is no base64");
  return std::move(*decoded);
}

void Document::read_buffers() {
  for (const Json& buffer : json_.value("buffers", Json::array())) {
    std::string_view bytes = binary_;
    if (const auto uri = buffer.find("uri"); uri != buffer.end()) {
      const auto& text = uri->get_ref<const std::string&>();
      if (text.starts_with(kData)) {
        const std::string decoded = data_of(text, "a buffer");
        files_.push_back(FileBytes::copy(std::as_bytes(std::span(decoded))));
      } else {
        const std::filesystem::path path = platform::path_of(without_escapes(text));
        if (path.is_absolute() || text.find("://") != std::string::npos)
          fail(name_, "its buffer " + text.substr(0, 80) + " is not a file beside it; export it as .glb");
        const std::filesystem::path whole = platform::path_of(name_).parent_path() / path;
        std::error_code unknown;
        if (!std::filesystem::exists(whole, unknown))
          fail(name_, "its buffer " + platform::text_of(whole) + " is not there; copy it too, or export it as .glb");
        files_.push_back(FileBytes::open(whole));
        file_size_ += files_.back().view().size();
      }
      bytes = files_.back().view();
    }
    const std::size_t length = size_member(buffer, "byteLength");
    if (length > bytes.size())
      damaged("a buffer has " + std::to_string(bytes.size()) + " bytes of " + std::to_string(length));
    buffers_.push_back(bytes.substr(0, length));
  }
}

const Json& Document::element(const char* array, const Json& index) const {
  const auto found = json_.find(array);
  if (found == json_.end() || !found->is_array() || !index.is_number_unsigned() ||
      index.get<std::size_t>() >= found->size())
    damaged(std::string("there is no such element of ") + array);
  return (*found)[index.get<std::size_t>()];
}

Values Document::values(const Json& accessor_index) const {
  const Json& accessor = element("accessors", accessor_index);
  if (accessor.contains("sparse"))
    fail(name_, "has accessors that are sparse, which cannot be read; export it without them");
  Values result;
  result.count = size_member(accessor, "count");
  result.components = components_of(accessor.at("type").get<std::string>());
  result.type = type_of(size_member(accessor, "componentType"));
  result.normalized = accessor.value("normalized", false);
  const Json& view = element("bufferViews", accessor.at("bufferView"));
  const std::string_view bytes = view_bytes(view);
  const std::size_t size = result.components * size_of(result.type), offset = size_member(accessor, "byteOffset");
  result.stride = size_member(view, "byteStride", size);
  const bool has_room = offset <= bytes.size() && result.stride >= size && result.stride <= 65536 &&
                        result.count <= bytes.size() &&
                        (result.count == 0 || (result.count - 1) * result.stride + size <= bytes.size() - offset);
  if (!has_room) damaged("an accessor reaches beyond its buffer");
  result.bytes = bytes.substr(offset);
  return result;
}

// The part of a buffer.
std::string_view Document::view_bytes(const Json& view) const {
  const std::size_t buffer_index = size_member(view, "buffer");
  if (buffer_index >= buffers_.size()) damaged("there is no such buffer");
  const std::size_t begin = size_member(view, "byteOffset"), length = size_member(view, "byteLength");
  const std::string_view bytes = buffers_[buffer_index];
  if (begin > bytes.size() || length > bytes.size() - begin) damaged("a view reaches beyond its buffer");
  return bytes.substr(begin, length);
}

std::pair<std::string, std::shared_ptr<const std::string>> Document::image(const Json& index) const {
  const Json& image = element("images", index);
  const std::string number = "image " + std::to_string(index.get<std::size_t>());
  if (const auto view = image.find("bufferView"); view != image.end())
    return {number, std::make_shared<std::string>(view_bytes(element("bufferViews", *view)))};
  const auto& uri = image.at("uri").get_ref<const std::string&>();
  if (!uri.starts_with(kData)) return {without_escapes(uri), nullptr};
  return {number, std::make_shared<std::string>(data_of(uri, number))};
}

}  // namespace pointfair::io::gltf
