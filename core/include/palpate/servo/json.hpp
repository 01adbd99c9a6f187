#pragma once

#include <array>
#include <charconv>
#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>
#include <system_error>
#include <utility>
#include <vector>

namespace palpate::servo {

/// A value of a JSON document.
struct JsonValue {
  enum class Kind { null, boolean, number, string, array, object };
  Kind kind = Kind::null;
  bool boolean = false;
  double number = 0.0;
  std::string text;
  std::vector<std::string> keys;  ///< of an object; keys[i] names items[i]
  std::vector<JsonValue> items;   ///< of an array or an object

  /// Return the member of an object, or null if it has none of that name.
  [[nodiscard]] const JsonValue* find(std::string_view key) const noexcept {
    for (std::size_t i = 0; i < keys.size(); ++i)
      if (keys[i] == key) return &items[i];
    return nullptr;
  }
};

/// A parsed document, or the reason why the text is not one.
struct JsonDocument {
  JsonValue value;
  std::string error;  ///< empty on success; otherwise the problem and its line
};

/// Limits that keep a malformed or hostile document from exhausting stack or memory.
struct JsonLimits {
  std::size_t text = std::size_t{1} << 24;    ///< bytes
  std::size_t values = std::size_t{1} << 20;  ///< numbers, strings, arrays and objects together
  std::size_t members = 256;                  ///< of one object
  int depth = 32;                             ///< nested arrays and objects
};

namespace detail {

/// Recursive-descent parser of RFC 8259. Refuses duplicate keys, trailing commas, comments and numbers outside double's range.
class JsonParser {
 public:
  JsonParser(std::string_view text, const JsonLimits& limits) : text_(text), limits_(limits) {}

  JsonDocument run() {
    JsonDocument document;
    if (text_.size() > limits_.text) {
      document.error = "the text is longer than " + std::to_string(limits_.text) + " bytes";
      return document;
    }
    if (parse(document.value, 0)) {
      skip_space();
      if (at_ != text_.size()) fail("text follows the end of the document");
    }
    if (!error_.empty()) document = {{}, error_};
    return document;
  }

 private:
  bool fail(const char* problem) {
    if (!error_.empty()) return false;
    std::size_t line = 1;
    for (std::size_t i = 0; i < at_ && i < text_.size(); ++i) line += text_[i] == '\n' ? 1 : 0;
    error_ = "line " + std::to_string(line) + ": " + problem;
    return false;
  }

  [[nodiscard]] char peek() const noexcept { return at_ < text_.size() ? text_[at_] : '\0'; }
  bool take(char c) noexcept {
    if (at_ >= text_.size() || text_[at_] != c) return false;
    ++at_;
    return true;
  }
  bool take_word(std::string_view word) noexcept {
    if (text_.substr(at_, word.size()) != word) return false;
    at_ += word.size();
    return true;
  }
  void skip_space() noexcept {
    while (at_ < text_.size() && (text_[at_] == ' ' || text_[at_] == '\n' || text_[at_] == '\r' || text_[at_] == '\t')) ++at_;
  }

  bool parse(JsonValue& to, int depth) {
    if (depth > limits_.depth) return fail("arrays and objects are nested too deeply");
    if (++values_ > limits_.values) return fail("the document has too many values");
    skip_space();
    switch (peek()) {
      case '{':
        return parse_object(to, depth);
      case '[':
        return parse_array(to, depth);
      case '"':
        to.kind = JsonValue::Kind::string;
        return parse_string(to.text);
      default:
        break;
    }
    if (take_word("null")) return true;
    to.boolean = peek() == 't';
    if (take_word("true") || take_word("false")) {
      to.kind = JsonValue::Kind::boolean;
      return true;
    }
    return parse_number(to);
  }

  bool parse_object(JsonValue& to, int depth) {
    to.kind = JsonValue::Kind::object;
    ++at_;
    skip_space();
    if (take('}')) return true;
    do {
      skip_space();
      std::string key;
      if (peek() != '"') return fail("the name of a member, in quotes, is missing");
      if (!parse_string(key)) return false;
      if (to.keys.size() >= limits_.members) return fail("an object has too many members");
      if (to.find(key) != nullptr) return fail("a name occurs twice in one object");
      skip_space();
      if (!take(':')) return fail("a colon is missing after the name of a member");
      to.keys.push_back(std::move(key));
      if (!parse(to.items.emplace_back(), depth + 1)) return false;
      skip_space();
    } while (take(','));
    return take('}') || fail("a comma or the closing brace of an object is missing");
  }

  bool parse_array(JsonValue& to, int depth) {
    to.kind = JsonValue::Kind::array;
    ++at_;
    skip_space();
    if (take(']')) return true;
    do {
      if (!parse(to.items.emplace_back(), depth + 1)) return false;
      skip_space();
    } while (take(','));
    return take(']') || fail("a comma or the closing bracket of an array is missing");
  }

  bool parse_number(JsonValue& to) {
    const std::size_t begin = at_;
    take('-');
    if (!take('0') && !take_digits()) return fail("a value is missing or is not JSON");
    if (take('.') && !take_digits()) return fail("a number has no digit after its point");
    if (take('e') || take('E')) {
      if (!take('+')) take('-');
      if (!take_digits()) return fail("a number has no digit in its exponent");
    }
    to.kind = JsonValue::Kind::number;
    const auto [end, problem] = std::from_chars(text_.data() + begin, text_.data() + at_, to.number);
    return (problem == std::errc() && end == text_.data() + at_) || fail("a number is outside the range of double precision");
  }
  bool take_digits() noexcept {
    const std::size_t begin = at_;
    while (peek() >= '0' && peek() <= '9') ++at_;
    return at_ > begin;
  }

  bool parse_string(std::string& to) {
    ++at_;
    while (at_ < text_.size()) {
      const char c = text_[at_++];
      if (c == '"') return true;
      if (static_cast<unsigned char>(c) < 0x20) return fail("a string contains a control character");
      if (c != '\\') {
        to += c;
        continue;
      }
      const char escape = peek();
      ++at_;
      constexpr std::string_view names = "\"\\/bfnrt", meanings = "\"\\/\b\f\n\r\t";
      if (escape == 'u') {
        if (!parse_unicode(to)) return fail("a string has a broken \\u escape");
      } else if (const std::size_t i = names.find(escape); i != std::string_view::npos && escape != '\0') {
        to += meanings[i];
      } else {
        return fail("a string has an unknown escape");
      }
    }
    return fail("a string has no closing quote");
  }

  /// Append the code point of an escape as UTF-8.
  bool parse_unicode(std::string& to) {
    std::uint32_t point = 0, low = 0;
    if (!parse_hex(point) || (point >= 0xdc00 && point < 0xe000)) return false;
    if (point >= 0xd800 && point < 0xdc00) {
      if (!take_word("\\u") || !parse_hex(low) || low < 0xdc00 || low >= 0xe000) return false;
      point = 0x10000 + ((point - 0xd800) << 10) + (low - 0xdc00);
    }
    constexpr std::array<std::uint32_t, 4> lead = {0, 0xc0, 0xe0, 0xf0};
    const std::size_t extra = point < 0x80 ? 0 : point < 0x800 ? 1 : point < 0x10000 ? 2 : 3;
    to += static_cast<char>(lead[extra] | (point >> (6 * extra)));
    for (std::size_t k = extra; k-- > 0;) to += static_cast<char>(0x80 | ((point >> (6 * k)) & 0x3f));
    return true;
  }
  bool parse_hex(std::uint32_t& out) noexcept {
    if (text_.size() - at_ < 4) return false;
    const char* begin = text_.data() + at_;
    at_ += 4;
    return std::from_chars(begin, begin + 4, out, 16).ptr == begin + 4;
  }

  std::string_view text_;
  JsonLimits limits_;
  std::size_t at_ = 0;
  std::size_t values_ = 0;
  std::string error_;
};

}  // namespace detail

/// Parse a JSON document strictly. Numbers are the nearest doubles, so the shortest text that identifies a double gives that double.
[[nodiscard]] inline JsonDocument parse_json(std::string_view text, const JsonLimits& limits = {}) {
  return detail::JsonParser(text, limits).run();
}

}  // namespace palpate::servo
