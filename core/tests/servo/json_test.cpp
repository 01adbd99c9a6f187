#include <gtest/gtest.h>

#include <cmath>
#include <cstdint>
#include <cstdio>
#include <cstring>
#include <palpate/servo/blob.hpp>
#include <palpate/servo/json.hpp>
#include <random>
#include <string>
#include <string_view>
#include <utility>

namespace {

using palpate::servo::JsonDocument;
using palpate::servo::JsonValue;
using palpate::servo::parse_json;

JsonValue value(const std::string& text) {
  const JsonDocument document = parse_json(text);
  EXPECT_EQ(document.error, "") << text;
  return document.value;
}

TEST(Json, ReadsEveryKindOfValue) {
  const JsonValue v = value(R"( {"a": [1, -2.5e-3, true, false, null], "b": {"c": "text"}, "d": [], "e": {}} )");
  ASSERT_EQ(v.kind, JsonValue::Kind::object);
  const JsonValue& a = *v.find("a");
  ASSERT_EQ(a.items.size(), 5U);
  EXPECT_EQ(a.items[0].number, 1.0);
  EXPECT_EQ(a.items[1].number, -2.5e-3);
  EXPECT_TRUE(a.items[2].boolean);
  EXPECT_FALSE(a.items[3].boolean);
  EXPECT_EQ(a.items[3].kind, JsonValue::Kind::boolean);
  EXPECT_EQ(a.items[4].kind, JsonValue::Kind::null);
  EXPECT_EQ(v.find("b")->find("c")->text, "text");
  EXPECT_EQ(v.find("d")->kind, JsonValue::Kind::array);
  EXPECT_EQ(v.find("e")->kind, JsonValue::Kind::object);
  EXPECT_EQ(v.find("f"), nullptr);
}

TEST(Json, DecodesEscapesToUtf8) {
  EXPECT_EQ(value(R"("\"\\\/\b\f\n\r\t")").text, "\"\\/\b\f\n\r\t");
  EXPECT_EQ(value(R"("A\u00e9\u20AC\ud83d\ude00")").text, "A\xc3\xa9\xe2\x82\xac\xf0\x9f\x98\x80");
}

TEST(Json, DoublesWrittenWithSeventeenDigitsComeBackExactly) {
  std::mt19937_64 random(1);
  for (int i = 0; i < 20000; ++i) {
    const std::uint64_t bits = random();
    double x = 0.0;
    std::memcpy(&x, &bits, sizeof x);
    if (!std::isfinite(x)) continue;
    char text[40];
    std::snprintf(text, sizeof text, "%.17g", x);
    EXPECT_EQ(value(text).number, x) << text;
  }
  EXPECT_TRUE(std::signbit(value("-0.0").number));
}

TEST(Json, RefusesWhatIsNotJson) {
  for (const char* text : {"",          " ",           "{",           "[",
                           "\"",        "[1,]",        "{\"a\":1,}",  "{\"a\" 1}",
                           "{a: 1}",    "[1 2]",       "01",          "+1",
                           ".5",        "1.",          "1e",          "1e+",
                           "-",         "0x10",        "NaN",         "Infinity",
                           "nul",       "tru",         "truefalse",   "1 2",
                           "[1] x",     "// 1",        "'a'",         "\"\\x\"",
                           "\"\\u12\"", "\"\\ud800\"", "\"\\udc00\"", "\"\\ud800\\u0041\"",
                           "\"a\nb\"",  "1e999",       "-1e999",      "{\"a\":1,\"a\":2}",
                           "\"\\"}) {
    const JsonDocument document = parse_json(text);
    EXPECT_NE(document.error, "") << text;
    EXPECT_EQ(document.value.kind, JsonValue::Kind::null) << text;
  }
  EXPECT_NE(parse_json(std::string("1\0", 2)).error, "");
}

TEST(Json, ErrorsNameTheLine) {
  EXPECT_EQ(parse_json("{\n\"a\": 1,\n\"b\": x}").error, "line 3: a value is missing or is not JSON");
}

TEST(Json, LimitsDepthValuesAndLength) {
  EXPECT_EQ(parse_json(std::string(32, '[') + std::string(32, ']')).error, "");
  EXPECT_NE(parse_json(std::string(34, '[') + std::string(34, ']')).error, "");
  EXPECT_NE(parse_json(std::string(1'000'000, '[')).error, "");
  EXPECT_EQ(parse_json("[1, 2, 3]", {.values = 4}).error, "");
  EXPECT_NE(parse_json("[1, 2, 3]", {.values = 3}).error, "");
  EXPECT_NE(parse_json("[1, 2, 3]", {.text = 8}).error, "");
}

TEST(Json, SurvivesEveryChangeOfOneByte) {
  const std::string text = R"({"a": [1.5e3, "\u0041", true, null], "b": {"c": -0.25}})";
  for (std::size_t at = 0; at < text.size(); ++at) {
    std::string changed = text;
    for (int c = 0; c < 256; ++c) {
      changed[at] = static_cast<char>(c);
      static_cast<void>(parse_json(changed));
    }
    static_cast<void>(parse_json(std::string_view(text).substr(0, at)));
  }
}

TEST(Blob, ChecksumIsThatOfZlib) {
  EXPECT_EQ(palpate::servo::crc32("123456789", 9), 0xcbf43926U);
  EXPECT_EQ(palpate::servo::crc32("", 0), 0U);
}

// Law: every code point becomes the bytes of UTF-8, at both ends of each length.
TEST(Json, EscapesBecomeUtf8) {
  const std::pair<const char*, const char*> golden[] = {
      {"\\u007f", "\x7f"},
      {"\\u0080", "\xc2\x80"},
      {"\\u07ff", "\xdf\xbf"},
      {"\\u0800", "\xe0\xa0\x80"},
      {"\\uFFFF", "\xef\xbf\xbf"},
      {"\\ud800\\udc00", "\xf0\x90\x80\x80"},
      {"\\udbff\\udfff", "\xf4\x8f\xbf\xbf"},
  };
  for (const auto& [escape, bytes] : golden) EXPECT_EQ(value("\"" + std::string(escape) + "\"").text, bytes) << escape;
  for (const char* broken : {"\\ud800\\ue000", "\\ud800\\udbff", "\\ud800", "\\udc00", "\\u12g4", "\\u123"})
    EXPECT_NE(parse_json("\"" + std::string(broken) + "\"").error, "") << broken;
}

// Law: a limit is the largest size that is read.
TEST(Json, LimitsAreInclusive) {
  palpate::servo::JsonLimits limits;
  limits.text = 13;
  limits.members = 2;
  EXPECT_EQ(parse_json(R"({"a":0,"b":1})", limits).error, "");
  EXPECT_EQ(parse_json(R"({"a":0,"b":1} )", limits).error, "the text is longer than 13 bytes");
  limits.text = 100;
  EXPECT_EQ(parse_json(R"({"a":0,"b":1,"c":2})", limits).error, "line 1: an object has too many members");
  for (char c = 1; c < 0x20; ++c) EXPECT_NE(parse_json(std::string("\"") + c + "\"").error, "") << static_cast<int>(c);
  EXPECT_EQ(parse_json("\" \"").error, "");
}

}  // namespace
