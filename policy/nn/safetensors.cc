#include "policy/nn/safetensors.h"

#include <fmt/format.h>

#include <bit>
#include <nlohmann/json.hpp>
#include <optional>
#include <utility>

#include "base/check.h"
#include "base/error.h"
#include "base/file.h"
#include "base/json.h"

namespace slalom::nn {
namespace {

using nlohmann::json;

static_assert(std::endian::native == std::endian::little, "files are little-endian");

constexpr const char* kChecksumKey = "checksum_xxh3";
// The format allows 100 MB; ours take a few kB, and as parsed JSON they take many times that.
constexpr std::size_t kMaxHeaderBytes = 4 << 20;

std::optional<std::size_t> ElementBytes(std::string_view type) {
  if (type == "F64" || type == "I64" || type == "U64") return 8;
  if (type == "F32" || type == "I32" || type == "U32") return 4;
  if (type == "F16" || type == "BF16" || type == "I16" || type == "U16") return 2;
  if (type == "I8" || type == "U8" || type == "BOOL") return 1;
  return std::nullopt;
}

template <class... Args>
[[noreturn]] void Fail(std::string_view source, fmt::format_string<Args...> what, Args&&... args) {
  throw base::Error("{}: {}", source, fmt::format(what, std::forward<Args>(args)...));
}

/// A whole number of a tensor's description: a float would be cut to one, or overflow it.
std::uint64_t Whole(std::string_view source, const std::string& name, const json& number) {
  if (number.is_number_unsigned()) return number.get<std::uint64_t>();
  Fail(source, "tensor '{}' is described by {}, expected a whole number from 0 on", name,
       number.dump(-1, ' ', false, json::error_handler_t::replace));
}

/// The tensor that one entry of the header describes, in bytes that no other entry has: `unread` of
/// `data` at most, so that many entries cannot each claim all of it.
StoredTensor ReadEntry(std::string_view source, const std::string& name, const json& entry,
                       std::string_view data, std::size_t unread) {
  StoredTensor tensor;
  std::uint64_t begin = 0;
  std::uint64_t end = 0;
  try {
    tensor.type = entry.at("dtype").get<std::string>();
    for (const json& size : entry.at("shape").get_ref<const json::array_t&>()) {
      tensor.shape.push_back(static_cast<std::int64_t>(Whole(source, name, size)));
    }
    begin = Whole(source, name, entry.at("data_offsets").at(0));
    end = Whole(source, name, entry.at("data_offsets").at(1));
  } catch (const json::exception& error) {
    Fail(source, "tensor '{}' is not described as safetensors expects ({})", name, error.what());
  }
  const std::optional<std::size_t> element = ElementBytes(tensor.type);
  if (!element) Fail(source, "tensor '{}' has unknown type '{}'", name, tensor.type);
  std::uint64_t bytes = *element;
  for (const std::int64_t size : tensor.shape) {
    if (size < 0 || __builtin_mul_overflow(bytes, static_cast<std::uint64_t>(size), &bytes)) {
      Fail(source, "tensor '{}' has an impossible shape", name);
    }
  }
  if (begin > end || end > data.size() || end - begin != bytes || bytes > unread) {
    Fail(source,
         "tensor '{}' claims bytes {} to {}, expected {} bytes within the {} that follow the "
         "header; the file is cut short or damaged",
         name, begin, end, bytes, data.size());
  }
  tensor.bytes = data.substr(begin, bytes);
  return tensor;
}

}  // namespace

const StoredTensor& TensorFile::Find(const std::string& name, std::string_view type,
                                     std::size_t size) const {
  const auto found = tensors.find(name);
  if (found == tensors.end()) Fail(source, "tensor '{}' is missing", name);
  const StoredTensor& tensor = found->second;
  const std::size_t expected_bytes = size * *ElementBytes(type);
  if (tensor.type != type || tensor.bytes.size() != expected_bytes) {
    Fail(source, "tensor '{}' is [{}] {}, expected {} elements of {}", name,
         fmt::join(tensor.shape, ", "), tensor.type, size, type);
  }
  return tensor;
}

std::string PrintTensors(const TensorMap& tensors, const Metadata& metadata) {
  json header = json::object();
  std::uint64_t offset = 0;
  for (const auto& [name, tensor] : tensors) {
    SLALOM_CHECK(ElementBytes(tensor.type).has_value());
    header[name] = {{"dtype", tensor.type},
                    {"shape", tensor.shape},
                    {"data_offsets", {offset, offset + tensor.bytes.size()}}};
    offset += tensor.bytes.size();
  }
  std::string data;
  data.reserve(offset);
  for (const auto& [name, tensor] : tensors) data += tensor.bytes;
  json texts = metadata;
  texts[kChecksumKey] = fmt::format("{:016x}", base::Checksum(data));
  header["__metadata__"] = texts;
  std::string text = header.dump(-1, ' ', false, json::error_handler_t::replace);
  text.resize((text.size() + 7) / 8 * 8, ' ');  // so that the tensors begin aligned
  SLALOM_CHECK_LE(text.size(), kMaxHeaderBytes);
  const std::uint64_t length = text.size();
  std::string bytes(sizeof(length), '\0');
  std::memcpy(bytes.data(), &length, sizeof(length));
  bytes.reserve(sizeof(length) + text.size() + data.size());
  return bytes += text += data;
}

TensorFile ParseTensors(std::span<const std::byte> bytes, std::string_view source) {
  const std::string_view file(reinterpret_cast<const char*>(bytes.data()), bytes.size());
  TensorFile result;
  result.source = source;
  std::uint64_t length = 0;
  if (file.size() < sizeof(length)) {
    Fail(source, "found {} bytes, expected a safetensors file", file.size());
  }
  std::memcpy(&length, file.data(), sizeof(length));
  if (length > kMaxHeaderBytes) Fail(source, "is no safetensors file, or damaged");
  if (length > file.size() - sizeof(length)) {
    Fail(source, "the header should be {} bytes long but {} follow; the file is cut short", length,
         file.size() - sizeof(length));
  }
  const json header = base::ParseJson(file.substr(sizeof(length), length));
  if (!header.is_object()) Fail(source, "the header is not JSON; no safetensors file, or damaged");
  const std::string_view data = file.substr(sizeof(length) + length);
  std::size_t described = 0;
  for (const auto& [name, entry] : header.items()) {
    if (name == "__metadata__") continue;
    StoredTensor tensor = ReadEntry(source, name, entry, data, data.size() - described);
    described += tensor.bytes.size();
    result.tensors.emplace(name, std::move(tensor));
  }
  if (described != data.size()) {
    Fail(source, "the header describes {} bytes of tensors, {} follow; the file is damaged",
         described, data.size());
  }
  if (const auto texts = header.find("__metadata__"); texts != header.end()) {
    if (!texts->is_object()) Fail(source, "its metadata is no JSON object");
    for (const auto& [key, value] : texts->items()) {
      if (!value.is_string()) Fail(source, "metadata '{}' is no text", key);
      result.metadata.emplace(key, value.get<std::string>());
    }
  }
  if (const auto node = result.metadata.extract(kChecksumKey); !node.empty()) {
    const std::string found = fmt::format("{:016x}", base::Checksum(data));
    if (node.mapped() != found) {
      Fail(source, "the checksum of the tensors is {}, expected {}; the file is damaged", found,
           node.mapped());
    }
  }
  return result;
}

void SaveTensors(const std::filesystem::path& path, const TensorMap& tensors,
                 const Metadata& metadata) {
  base::WriteFileAtomically(path, PrintTensors(tensors, metadata));
}

TensorFile LoadTensors(const std::filesystem::path& path) {
  const std::string bytes = base::ReadFile(path);
  return ParseTensors(std::as_bytes(std::span(bytes)), path.string());
}

}  // namespace slalom::nn
