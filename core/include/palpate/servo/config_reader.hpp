#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <limits>
#include <string>
#include <string_view>
#include <type_traits>
#include <utility>
#include <vector>

#include "palpate/math/vector.hpp"
#include "palpate/servo/blob.hpp"
#include "palpate/servo/json.hpp"

namespace palpate::servo {

/// Reads typed members of a JSON document and the blobs that it describes. Keeps the first problem as a sentence. After it, every member
/// has its default value.
class ConfigReader {
 public:
  static constexpr std::uint64_t max_blob_bytes = std::uint64_t{1} << 32;

  /// An object of the document and its path, for messages.
  class Section {
   public:
    Section() = default;
    Section(ConfigReader* reader, const JsonValue* value, std::string place) : reader_(reader), value_(value), place_(std::move(place)) {}

    [[nodiscard]] bool has(std::string_view key) const {
      const JsonValue* member = value_ == nullptr ? nullptr : value_->find(key);
      return member != nullptr && member->kind != JsonValue::Kind::null;
    }

    [[nodiscard]] Section section(const char* key) const {
      const JsonValue* member = get(key, JsonValue::Kind::object, "an object");
      return {reader_, member, place(key)};
    }

    [[nodiscard]] const std::vector<std::string>& keys() const {
      static const std::vector<std::string> none;
      return value_ == nullptr ? none : value_->keys;
    }

    [[nodiscard]] std::string text(const char* key) const {
      const JsonValue* member = get(key, JsonValue::Kind::string, "text");
      return member == nullptr ? "" : member->text;
    }

    [[nodiscard]] bool flag(const char* key) const {
      const JsonValue* member = get(key, JsonValue::Kind::boolean, "true or false");
      return member != nullptr && member->boolean;
    }

    [[nodiscard]] double number(const char* key) const {
      const JsonValue* member = get(key, JsonValue::Kind::number, "a number");
      return member == nullptr ? 0.0 : member->number;
    }
    /// Return a number from `low` to `high`.
    [[nodiscard]] double number(const char* key, double low, double high) const {
      const double value = number(key);
      if (reader_->ok() && !(value >= low && value <= high))
        fail(key, "is " + shown(value) + "; it must be between " + shown(low) + " and " + shown(high));
      return value;
    }
    /// Return a number above zero, in finite range.
    [[nodiscard]] double positive(const char* key) const {
      const double value = number(key);
      if (reader_->ok() && !(value > 0.0)) fail(key, "is " + shown(value) + "; it must be positive");
      return value;
    }
    /// Return a number that is at least zero; null stands for infinity.
    [[nodiscard]] double nonnegative_or_infinite(const char* key) const {
      const JsonValue* member = value_ == nullptr ? nullptr : value_->find(key);
      if (member != nullptr && member->kind == JsonValue::Kind::null) return std::numeric_limits<double>::infinity();
      return number(key, 0.0, std::numeric_limits<double>::max());
    }
    [[nodiscard]] std::int64_t integer(const char* key, std::int64_t low, std::int64_t high) const {
      const double value = number(key, static_cast<double>(low), static_cast<double>(high));
      if (reader_->ok() && value != std::floor(value)) fail(key, "is " + shown(value) + "; it must be a whole number");
      return reader_->ok() ? static_cast<std::int64_t>(value) : low;
    }

    /// Return an array of `size` numbers. If `infinite`, null stands for infinity. After a problem: zeros, or nothing if `size` exceeds 16.
    [[nodiscard]] std::vector<double> numbers(const char* key, std::size_t size, bool infinite = false) const {
      std::vector<double> out;
      const JsonValue* member = get(key, JsonValue::Kind::array, "an array of numbers");
      if (member != nullptr && member->items.size() != size)
        fail(key, "has " + std::to_string(member->items.size()) + " numbers instead of " + std::to_string(size));
      if (!reader_->ok()) return std::vector<double>(size <= 16 ? size : 0);
      for (const JsonValue& item : member->items) {
        const bool none = infinite && item.kind == JsonValue::Kind::null;
        if (!none && item.kind != JsonValue::Kind::number) fail(key, "must hold numbers only");
        out.push_back(none ? std::numeric_limits<double>::infinity() : item.number);
      }
      return out;
    }
    [[nodiscard]] Vector3<> vector(const char* key) const {
      const std::vector<double> v = numbers(key, 3);
      return {v[0], v[1], v[2]};
    }
    template <int dof>
    [[nodiscard]] Joints<dof> joints(const char* key, bool infinite = false) const {
      const std::vector<double> v = numbers(key, dof, infinite);
      return Eigen::Map<const Joints<dof>>(v.data());
    }
    /// Return a matrix that is stored row by row; an empty one after a problem.
    [[nodiscard]] Eigen::MatrixXd matrix(const char* key, std::int64_t rows, std::int64_t columns) const {
      const std::vector<double> v = numbers(key, static_cast<std::size_t>(rows * columns));
      if (!reader_->ok()) return {};
      Eigen::MatrixXd out(rows, columns);
      for (std::int64_t r = 0; r < rows; ++r)
        for (std::int64_t c = 0; c < columns; ++c) out(r, c) = v[static_cast<std::size_t>(r * columns + c)];
      return out;
    }

    /// Return the position of a text in a list of choices; 0 if it is none of them.
    [[nodiscard]] std::size_t choice(const char* key, const std::vector<std::string>& choices) const {
      const std::string value = text(key);
      std::string list;
      for (std::size_t i = 0; i < choices.size(); ++i) {
        if (value == choices[i]) return i;
        list += (i == 0 ? "\"" : ", \"") + choices[i] + "\"";
      }
      fail(key, "is \"" + value + "\"; this version knows " + list);
      return 0;
    }

    /// Read the blob that a member describes: rows of `columns` elements, or a list if `columns` is 1. `rows` < 0: any number of rows.
    template <class T>
    [[nodiscard]] std::vector<T> blob(const char* key, std::int64_t rows, std::int64_t columns) const {
      static_assert(dtype_of<T> != nullptr);
      std::vector<T> out;
      const Section about = section(key);
      const std::string file = about.text("file"), dtype = about.text("dtype"), checksum = about.text("crc32");
      const auto bytes = static_cast<std::uint64_t>(about.integer("bytes", 0, static_cast<std::int64_t>(max_blob_bytes)));
      const JsonValue* shape = about.get("shape", JsonValue::Kind::array, "an array of numbers");
      if (!reader_->ok()) return out;
      if (file.empty() || file.find_first_of("/\\:") != std::string::npos || file.front() == '.') {
        about.fail("file", "must be the plain name of a file in the same folder");
        return out;
      }
      if (dtype != dtype_of<T>) {
        about.fail("dtype", "is \"" + dtype + "\" instead of \"" + dtype_of<T> + "\"");
        return out;
      }
      std::vector<std::int64_t> size;
      for (std::size_t i = 0; i < shape->items.size(); ++i) {
        const double n = shape->items[i].number;
        if (shape->items[i].kind != JsonValue::Kind::number || !(n >= 0.0 && n <= 4294967296.0) || n != std::floor(n)) {
          about.fail("shape", "must hold whole numbers from 0 to 2^32");
          return out;
        }
        size.push_back(static_cast<std::int64_t>(n));
      }
      if (size.size() == 1 && columns == 1) size.push_back(1);
      if (size.size() != 2 || (rows >= 0 && size[0] != rows) || size[1] != columns) {
        about.fail("shape", "must be [" + (rows < 0 ? std::string("n") : std::to_string(rows)) +
                                (columns == 1 ? "" : ", " + std::to_string(columns)) + "]");
        return out;
      }
      const double expected = static_cast<double>(size[0]) * static_cast<double>(columns) * static_cast<double>(sizeof(T));
      if (expected != static_cast<double>(bytes)) {
        about.fail("bytes", "is " + std::to_string(bytes) + ", but the shape needs " + shown(expected));
        return out;
      }
      const std::int64_t there = reader_->source_->size(file);
      if (there < 0) return about.refuse("the file \"" + file + "\" is missing", out);
      if (static_cast<std::uint64_t>(there) != bytes)
        return about.refuse("the file \"" + file + "\" has " + std::to_string(there) + " bytes instead of " + std::to_string(bytes), out);
      out.resize(static_cast<std::size_t>(size[0] * columns));
      if (bytes > 0 && !reader_->source_->read(file, out.data(), static_cast<std::size_t>(bytes))) {
        out.clear();
        return about.refuse("the file \"" + file + "\" cannot be read", out);
      }
      char found[9];
      std::snprintf(found, sizeof found, "%08x", static_cast<unsigned>(crc32(out.data(), static_cast<std::size_t>(bytes))));
      if (checksum != found) {
        out.clear();
        return about.refuse("the file \"" + file + "\" is damaged: its checksum is " + found + " instead of " + checksum, out);
      }
      if constexpr (std::is_floating_point_v<T>)
        if (!std::all_of(out.begin(), out.end(), [](T x) { return std::isfinite(x); })) {
          out.clear();
          return about.refuse("the file \"" + file + "\" holds a number that is not finite", out);
        }
      return out;
    }

    /// Read a blob of points.
    [[nodiscard]] std::vector<Vector3<>> points(const char* key, std::int64_t rows = -1) const {
      const std::vector<double> flat = blob<double>(key, rows, 3);
      std::vector<Vector3<>> out(flat.size() / 3);
      for (std::size_t i = 0; i < out.size(); ++i) out[i] = {flat[3 * i], flat[3 * i + 1], flat[3 * i + 2]};
      return out;
    }

    /// Report a problem with a member.
    void fail(const char* key, const std::string& problem) const { reader_->fail(place(key) + " " + problem); }

   private:
    template <class T>
    T refuse(const std::string& problem, const T& out) const {
      reader_->fail(place_ + ": " + problem);
      return out;
    }
    [[nodiscard]] std::string place(const char* key) const { return place_.empty() ? key : place_ + "." + key; }
    static std::string shown(double value) {
      char text[32];
      std::snprintf(text, sizeof text, "%.10g", value);
      return text;
    }
    [[nodiscard]] const JsonValue* get(const char* key, JsonValue::Kind kind, const char* wanted) const {
      if (!reader_->ok() || value_ == nullptr) return nullptr;
      const JsonValue* member = value_->find(key);
      if (member == nullptr) {
        fail(key, "is missing");
        return nullptr;
      }
      if (member->kind == kind) return member;
      fail(key, std::string("must be ") + wanted);
      return nullptr;
    }

    ConfigReader* reader_ = nullptr;
    const JsonValue* value_ = nullptr;
    std::string place_;
  };

  /// The source must outlive the reader.
  explicit ConfigReader(const BlobSource& source) : source_(&source) {}

  [[nodiscard]] Section root(const JsonValue& value) {
    if (value.kind != JsonValue::Kind::object) fail("the document must be an object");
    return {this, ok() ? &value : nullptr, ""};
  }
  [[nodiscard]] bool ok() const noexcept { return error_.empty(); }
  [[nodiscard]] const std::string& error() const noexcept { return error_; }
  /// Keep the first problem, in printable characters. A long text of the document is cut in the middle.
  void fail(std::string problem) {
    if (!ok()) return;
    constexpr std::size_t longest = 240;
    if (problem.size() > longest) problem = problem.substr(0, longest / 2) + "..." + problem.substr(problem.size() - longest / 2);
    for (char& c : problem)
      if (c < 0x20 || c > 0x7e) c = '?';
    error_ = std::move(problem);
  }

 private:
  const BlobSource* source_;
  std::string error_;
};

}  // namespace palpate::servo
