// Loading of resolved loops: valid folders run, and damaged ones give one sentence without a crash.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <iterator>
#include <palpate/mechanism/slider.hpp>
#include <palpate/servo/loop_config.hpp>
#include <random>
#include <string>
#include <vector>

#include "support/loop_folder.hpp"
#include "support/rounds.hpp"

namespace {

using loop_folder::Files;
using loop_folder::MemorySource;
using palpate::mechanism::Slider;
using palpate::servo::JsonValue;
using palpate::servo::LoopConfig;
using palpate::servo::LoopConfigResult;

LoopConfigResult load(const Files& files) {
  return palpate::servo::load_loop_config(MemorySource(files));
}

/// Run the first `ticks` periods of a slider loop. Return the rows.
std::vector<double> run(const LoopConfig& config, int ticks) {
  const auto setup = config.setup<Slider>();
  if (!setup) return {};
  ticks = std::min(ticks, config.ticks);
  std::vector<double> rows(static_cast<std::size_t>((ticks / setup->record_every + 1) * palpate::servo::row_width(*setup)));
  palpate::servo::simulate(*setup, ticks, config.reference.data(), config.operator_force.data(), rows.data());
  return rows;
}

class LoopConfigKinds : public testing::TestWithParam<const char*> {};
INSTANTIATE_TEST_SUITE_P(Objects, LoopConfigKinds, testing::ValuesIn(loop_folder::object_kinds),
                         [](const auto& info) { return std::string(info.param); });

TEST_P(LoopConfigKinds, AValidLoopRunsAndTouches) {
  const LoopConfigResult loaded = load(loop_folder::valid(GetParam()));
  ASSERT_TRUE(loaded) << loaded.error;
  const std::vector<double> rows = run(*loaded.config, loaded.config->ticks);
  constexpr std::size_t touching = 3 * Slider::dof + 9;
  const std::size_t width = rows.size() / static_cast<std::size_t>(loaded.config->ticks + 1);
  double ticks = 0.0;
  for (std::size_t row = 0; row < rows.size(); row += width) ticks += rows[row + touching];
  EXPECT_GT(ticks, 10.0);
  for (const double x : rows) ASSERT_TRUE(std::isfinite(x));
}

/// Mutations of a loop folder with a seed.
class Mutation {
 public:
  explicit Mutation(std::uint64_t seed) : engine_(seed) {}

  /// Damage 1 to 3 places of the folder.
  void apply(Files& to) {
    for (std::size_t n = 1 + below(3); n-- > 0;) {
      switch (below(5)) {
        case 0:
          damage_bytes(to["loop.json"]);
          break;
        case 1:
          damage_blob(to, false);
          break;
        case 2:
          damage_blob(to, true);
          break;
        default:
          damage_structure(to);
      }
    }
    if (below(8) > 0) loop_folder::seal(to);
  }

 private:
  std::size_t below(std::size_t limit) { return std::uniform_int_distribution<std::size_t>(0, limit - 1)(engine_); }

  /// Flip, insert, remove or cut bytes.
  void damage_bytes(std::string& data) {
    for (std::size_t n = 1 + below(4); n-- > 0 && !data.empty();) {
      const std::size_t at = below(data.size());
      const char byte = static_cast<char>(below(256));
      switch (below(8)) {
        case 0:
          data.insert(at, 1, byte);
          break;
        case 1:
          data.erase(at, 1 + below(16));
          break;
        case 2:
          if (below(8) == 0) data.resize(at);
          break;
        default:
          data[at] = byte;
      }
    }
  }

  /// Damage one blob, and describe it as it is then if `consistent`.
  void damage_blob(Files& to, bool consistent) {
    auto file = to.begin();
    std::advance(file, static_cast<std::ptrdiff_t>(below(to.size())));
    if (file->first == "loop.json" || file->second.size() < 8) return;
    const std::string before = loop_folder::checksum(file->second);
    std::string& data = file->second;
    if (!consistent) return damage_bytes(data);
    const std::size_t width = data.size() % 8 == 0 && below(2) == 0 ? 8 : 4;
    const double doubles[] = {0.0, -1.0, 1e308, -1e-308, 1e9, 5e-324, std::nan(""), INFINITY};
    const std::int32_t integers[] = {0, -1, 1, 7, 0x7fffffff, -0x7fffffff, 26, 27};
    for (std::size_t n = 1 + below(4); n-- > 0;) {
      char* const at = data.data() + width * below(data.size() / width);
      if (width == 8 && below(4) > 0)
        std::memcpy(at, doubles + below(8), 8);
      else if (width == 4 && below(4) > 0)
        std::memcpy(at, integers + below(8), 4);
      else
        at[below(width)] = static_cast<char>(below(256));
    }
    std::string& text = to["loop.json"];
    if (const std::size_t found = text.find(before); found != std::string::npos) text.replace(found, 8, loop_folder::checksum(data));
  }

  /// Change, remove, repeat or exchange values of the document.
  void damage_structure(Files& to) {
    std::string& text = to["loop.json"];
    palpate::servo::JsonDocument document = palpate::servo::parse_json(text);
    if (!document.error.empty()) return damage_bytes(text);
    if (!document.value.keys.empty() && document.value.keys.back() == "crc32") {
      document.value.keys.pop_back();
      document.value.items.pop_back();
    }
    JsonValue* at = &document.value;
    JsonValue* parent = at;
    while (!at->items.empty() && (at == &document.value || below(3) > 0)) {
      parent = at;
      at = &at->items[below(at->items.size())];
    }
    switch (below(6)) {
      case 0:  // remove the last member
        if (!parent->items.empty()) parent->items.pop_back();
        if (!parent->keys.empty()) parent->keys.pop_back();
        break;
      case 1:  // repeat a value
        if (parent->kind == JsonValue::Kind::array) parent->items.push_back(JsonValue(*at));
        break;
      case 2:  // exchange two values
        std::swap(*at, parent->items[below(parent->items.size())]);
        break;
      case 3:  // rename a member
        if (!parent->keys.empty()) damage_bytes(parent->keys[below(parent->keys.size())]);
        break;
      default:
        *at = any_value();
    }
    text.clear();
    loop_folder::write_json(document.value, text);
  }

  JsonValue any_value() {
    static constexpr const char* const values[] = {
        "null",        "true",       "false",  "0",          "-1",      "1",        "2",       "0.5",           "1e308",     "-1e308",
        "5e-324",      "1e-9",       "1e9",    "4294967296", "8388608", "64",       "4194304", "1000000",       "[]",        "{}",
        "\"\"",        "\"x\"",      "[0]",    "[1, 2, 3]",  "[null]",  "[[[[]]]]", "\"..\"",  "\"loop.json\"", "\"modal\"", "\"a\\nb\"",
        "\"\\u0000\"", "[1e308, 0]", "[3, 3]", "-0.0",
    };
    return palpate::servo::parse_json(values[below(std::size(values))]).value;
  }

  std::mt19937_64 engine_;
};

/// Expect one short sentence without control characters.
void expect_sentence(const std::string& error) {
  EXPECT_FALSE(error.empty());
  EXPECT_LT(error.size(), 400U) << error;
  for (const char c : error) EXPECT_GE(static_cast<unsigned char>(c), 0x20U) << error;
}

// PALPATE_ROUNDS=1000 damages 100,000 folders of each kind.
TEST_P(LoopConfigKinds, ADamagedFolderIsRefusedInOneSentenceOrRuns) {
  const Files valid = loop_folder::valid(GetParam());
  int refused = 0;
  const int count = 100 * rounds();
  for (int k = 0; k < count; ++k) {
    Files files = valid;
    Mutation(static_cast<std::uint64_t>(k)).apply(files);
    const LoopConfigResult loaded = load(files);
    if (loaded) {
      run(*loaded.config, 30);
      continue;
    }
    ++refused;
    expect_sentence(loaded.error);
    ASSERT_FALSE(HasFailure()) << "seed " << k;
  }
  EXPECT_GT(refused, count / 2);
  EXPECT_LT(refused, count);
}

// Law: a CRC-32 finds every error within 32 bits, also in the member that holds it.
TEST_P(LoopConfigKinds, AChangedByteAnywhereIsRefused) {
  std::mt19937_64 engine(3);
  Files files = loop_folder::valid(GetParam());
  for (auto& [name, data] : files) {
    const std::size_t stride =
        std::max<std::size_t>(1, data.size() / (name == "loop.json" ? 150U : 20U) / static_cast<std::size_t>(rounds()));
    for (std::size_t k = engine() % stride; k < data.size(); k += name == "loop.json" && data.size() - k < 30 ? 1 : stride) {
      const char before = data[k];
      data[k] = static_cast<char>(before ^ static_cast<char>(1U + engine() % 255U));
      const LoopConfigResult loaded = load(files);
      ASSERT_FALSE(loaded) << name << ", byte " << k;
      expect_sentence(loaded.error);
      data[k] = before;
    }
  }
  EXPECT_TRUE(load(files));
}

TEST(LoopConfig, AnEditedTextIsRefusedUntilItsChecksumIsWrittenAgain) {
  Files files = loop_folder::valid("wall");
  std::string& text = files["loop.json"];
  text.replace(text.find(R"("delay": 1)"), 10, R"("delay": 2)");
  const std::string error = load(files).error;
  EXPECT_NE(error.find("loop.json: it is damaged or edited: it must end with \"crc32\": \""), std::string::npos) << error;
  loop_folder::seal(files);
  EXPECT_TRUE(load(files));
  EXPECT_NE(error.find(text.substr(text.size() - 12, 8)), std::string::npos) << error;
  text.erase(text.find(", \"crc32\": \"" + text.substr(text.size() - 12, 8)));
  text += '}';
  EXPECT_NE(load(files).error.find("it is damaged or edited"), std::string::npos) << load(files).error;
}

TEST(LoopConfig, AHyperelasticBodyNamesTheLibraryThatItNeeds) {
  Files files = loop_folder::valid("compliance");
  std::string& text = files["loop.json"];
  text.replace(text.find(R"("compliance")"), 12, R"("hyperelastic")");
  loop_folder::seal(files);
  EXPECT_NE(load(files).error.find("object.model is \"hyperelastic\"; link palpate::hyperelastic"), std::string::npos) << load(files).error;
}

TEST(LoopConfig, AFlexiblePlantMovesWithItsMode) {
  const auto with_mode = [](const std::string& mode) {
    Files files = loop_folder::valid("compliance");
    std::string& text = files["loop.json"];
    text.replace(text.find(R"("kind": "nonlinear")"), 19, R"("kind": "flexible", "flexible": )" + mode);
    loop_folder::seal(files);
    return load(files);
  };
  const LoopConfigResult loaded = with_mode(R"({"frequency": 60, "tip_share": 0.4, "damping_ratio": 0.1})");
  ASSERT_TRUE(loaded) << loaded.error;
  const LoopConfigResult rigid = load(loop_folder::valid("compliance"));
  const std::vector<double> rows = run(*loaded.config, 100), without = run(*rigid.config, 100);
  ASSERT_EQ(rows.size(), without.size() + 2 * 101);
  const std::size_t width = rows.size() / 101;
  const double motors = rows[100 * width], tip = rows[101 * width - 2];
  EXPECT_GT(tip, motors + 1e-6);
  EXPECT_NE(motors, without[100 * (width - 2)]);
  EXPECT_NE(with_mode(R"({"frequency": 60, "tip_share": 1.2, "damping_ratio": 0.1})").error.find("plant.flexible: tip_share must be"),
            std::string::npos);
  EXPECT_NE(with_mode(R"({"frequency": 1e9, "tip_share": 0.2, "damping_ratio": 0.1})").error.find("10000 integration steps"),
            std::string::npos);
}

/// A valid loop with an object of a kind, one array of which has other values.
template <class T>
Files with_array(const std::string& kind, const std::string& key, const std::vector<T>& values, std::size_t columns = 0) {
  Files files = loop_folder::valid(kind), other;
  std::string& text = files["loop.json"];
  const std::string name = '"' + key + "\": ", after = text.substr(text.find(name) + name.size());
  const std::string blob = after.substr(0, after.find('}') + 1);
  text.replace(text.find(blob), blob.size(), loop_folder::blob(other, key, values, columns));
  for (const auto& [file, content] : other) files[file] = content;
  loop_folder::seal(files);
  return files;
}

TEST(LoopConfig, AMotionNeedsIncreasingTimes) {
  const Files files = with_array("moving_frame", "motion", std::vector<double>(14, 0.0), 7);
  EXPECT_NE(load(files).error.find("object.motion has times that do not increase"), std::string::npos) << load(files).error;
}

TEST(LoopConfig, ANetworkNeedsPositiveMasses) {
  const std::vector<double> masses(Cube(2).data.masses.size(), -1.0);
  const std::string error = load(with_array("mass_spring", "masses", masses)).error;
  EXPECT_NE(error.find("object.masses and volumes of a network must be positive"), std::string::npos) << error;
}

TEST(LoopConfig, LongAndUnprintableTextsDoNotReachTheSentence) {
  for (const char* const place : {"\"slider\"", "\"mass.tip\"", "\"palpate loop\"", "\"nonlinear\"", "\"half_space\""}) {
    Files files = loop_folder::valid("wall");
    std::string& text = files["loop.json"];
    text.replace(text.find(place) + 1, std::strlen(place) - 2, "a\\n\\u0007" + std::string(10'000, 'x'));
    loop_folder::seal(files);
    expect_sentence(load(files).error);
  }
}

TEST(LoopConfig, AnObjectWithVeryManyMembersIsRefusedAtOnce) {
  std::string text = "{\"a\": 0";
  for (int k = 0; k < 1'000'000; ++k) text += ",\"" + std::to_string(k) + "\":0";
  EXPECT_NE(palpate::servo::parse_json(text + "}").error.find("too many members"), std::string::npos);
}

TEST(LoopConfig, TheLongestRunNeedsLittleMemory) {
  Files files = loop_folder::valid("wall");
  std::string& text = files["loop.json"];
  const std::size_t ticks = text.find("\"ticks\": 100");
  text = text.substr(0, ticks) + "\"ticks\": " + std::to_string(LoopConfig::max_ticks) +
         ", \"record_every\": 1, \"reference\": null, \"operator_force\": null}}";
  loop_folder::seal(files);
  const LoopConfigResult loaded = load(files);
  ASSERT_TRUE(loaded) << loaded.error;
  EXPECT_LE(sizeof(double) * (loaded.config->reference.size() + loaded.config->operator_force.size()), std::size_t{1} << 28);
}

#if defined(__SANITIZE_ADDRESS__)
/// A single allocation above this size stops the tests of this program.
extern "C" const char* __asan_default_options() {
  return "max_allocation_size_mb=256";
}
#endif

}  // namespace
