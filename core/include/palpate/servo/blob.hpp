#pragma once

#include <array>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <filesystem>
#include <memory>
#include <string>
#include <string_view>
#include <system_error>
#include <utility>

namespace palpate::servo {

static_assert(std::endian::native == std::endian::little, "palpate: blobs are read on little-endian machines only");

/// Source of the files of a loop folder: a folder, or memory where there is no file system.
class BlobSource {
 public:
  BlobSource() = default;
  BlobSource(const BlobSource&) = delete;
  BlobSource& operator=(const BlobSource&) = delete;
  BlobSource(BlobSource&&) = delete;
  BlobSource& operator=(BlobSource&&) = delete;
  virtual ~BlobSource() = default;

  /// Return the size of a file [bytes], or -1 if there is none.
  [[nodiscard]] virtual std::int64_t size(const std::string& name) const = 0;
  /// Read a whole file of `bytes` bytes. Return false if that fails.
  [[nodiscard]] virtual bool read(const std::string& name, void* to, std::size_t bytes) const = 0;
};

/// The files of a folder.
class FolderSource final : public BlobSource {
 public:
  explicit FolderSource(std::string folder) : folder_(std::move(folder)) {}

  [[nodiscard]] std::int64_t size(const std::string& name) const override {
    std::error_code problem;
    const std::filesystem::path path(folder_ + "/" + name);
    if (!std::filesystem::is_regular_file(path, problem)) return -1;
    const std::uintmax_t bytes = std::filesystem::file_size(path, problem);
    return problem || bytes > (std::uintmax_t{1} << 62) ? -1 : static_cast<std::int64_t>(bytes);
  }
  [[nodiscard]] bool read(const std::string& name, void* to, std::size_t bytes) const override {
    const std::unique_ptr<std::FILE, int (*)(std::FILE*)> file(std::fopen((folder_ + "/" + name).c_str(), "rb"), &std::fclose);
    return file != nullptr && std::fread(to, 1, bytes, file.get()) == bytes;
  }

 private:
  std::string folder_;
};

/// CRC-32 of IEEE 802.3, as zlib computes it.
[[nodiscard]] inline std::uint32_t crc32(const void* data, std::size_t bytes) noexcept {
  static constexpr auto table = [] {
    std::array<std::uint32_t, 256> out{};
    for (std::uint32_t n = 0; n < 256; ++n) {
      std::uint32_t c = n;
      for (int k = 0; k < 8; ++k) c = (c & 1U) != 0 ? 0xedb88320U ^ (c >> 1) : c >> 1;
      out[n] = c;
    }
    return out;
  }();
  const auto* at = static_cast<const unsigned char*>(data);
  std::uint32_t crc = 0xffffffffU;
  for (std::size_t i = 0; i < bytes; ++i) crc = table[(crc ^ at[i]) & 0xffU] ^ (crc >> 8);
  return crc ^ 0xffffffffU;
}

/// Return the end of a `loop.json`: the member with the checksum of the text before it, and the closing brace.
[[nodiscard]] inline std::string checksum_member(std::string_view before) {
  char text[32];
  std::snprintf(text, sizeof text, "\"crc32\": \"%08x\"\n}\n", static_cast<unsigned>(crc32(before.data(), before.size())));
  return text;
}

/// Element types of blobs.
template <class T>
constexpr const char* dtype_of = nullptr;
template <>
inline constexpr const char* dtype_of<double> = "float64";
template <>
inline constexpr const char* dtype_of<float> = "float32";
template <>
inline constexpr const char* dtype_of<std::int32_t> = "int32";
template <>
inline constexpr const char* dtype_of<std::uint8_t> = "uint8";

}  // namespace palpate::servo
