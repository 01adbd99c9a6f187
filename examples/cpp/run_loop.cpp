/// Runs a loop that `palpate resolve` wrote, without Python, and writes the recorded rows as binary doubles.
///
///   run_loop FOLDER ROWS [step]
///
/// With `step`, the program steps a servo::Loop sample by sample; otherwise it calls servo::simulate. The rows are the same.
#include <cstddef>
#include <cstdio>
#include <memory>
#include <palpate/mechanism/registry.hpp>
#include <palpate/servo/loop.hpp>
#include <palpate/servo/loop_config.hpp>
#include <string>
#include <vector>

namespace servo = palpate::servo;

namespace {

struct Rows {
  std::vector<double> values;
  int count = 0;
  int unstable_tick = -1;
};

template <class Mechanism>
Rows simulate(const servo::LoopConfig& config, const servo::SimulationSetup<Mechanism>& setup) {
  Rows out;
  const auto width = static_cast<std::size_t>(servo::row_width(setup));
  out.values.resize(static_cast<std::size_t>(config.max_rows()) * width);
  const servo::SimulationOutcome outcome =
      servo::simulate(setup, config.ticks, config.reference.data(), config.operator_force.data(), out.values.data());
  out.count = outcome.rows;
  out.unstable_tick = outcome.unstable_tick;
  out.values.resize(static_cast<std::size_t>(out.count) * width);
  return out;
}

/// Without jitter: the operator's force between samples is linear.
template <class Mechanism>
Rows step(const servo::LoopConfig& config, const servo::SimulationSetup<Mechanism>& setup) {
  Rows out;
  const auto width = static_cast<std::size_t>(servo::row_width(setup));
  servo::Loop<Mechanism> loop(setup);
  const auto force = [](const std::vector<double>& table, int k) {
    return palpate::math::Vector3<>(table[3 * static_cast<std::size_t>(k)], table[3 * static_cast<std::size_t>(k) + 1],
                                    table[3 * static_cast<std::size_t>(k) + 2]);
  };
  for (int k = 0; k <= config.ticks; ++k) {
    loop.tick(force(config.reference, k));
    if (k % setup.record_every == 0) {
      out.values.resize(out.values.size() + width);
      loop.record(force(config.operator_force, k), out.values.data() + out.values.size() - width);
      ++out.count;
    }
    if (k < config.ticks && !loop.advance(force(config.operator_force, k), force(config.operator_force, k + 1))) {
      out.unstable_tick = loop.count();
      break;
    }
  }
  return out;
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 3 && argc != 4) {
    std::fputs("usage: run_loop FOLDER ROWS [step]\n", stderr);
    return 2;
  }
  const servo::LoopConfigResult loaded = servo::load_loop_config(argv[1]);
  if (!loaded) {
    std::fprintf(stderr, "%s\n", loaded.error.c_str());
    return 2;
  }
  Rows rows;
  palpate::mechanism::Registry::for_each([&]<class Mechanism>() {
    const auto setup = loaded.config->setup<Mechanism>();
    if (setup) rows = argc == 4 ? step<Mechanism>(*loaded.config, *setup) : simulate<Mechanism>(*loaded.config, *setup);
  });
  const std::unique_ptr<std::FILE, int (*)(std::FILE*)> file(std::fopen(argv[2], "wb"), &std::fclose);
  if (!file || std::fwrite(rows.values.data(), sizeof(double), rows.values.size(), file.get()) != rows.values.size()) {
    std::fprintf(stderr, "%s: cannot be written\n", argv[2]);
    return 2;
  }
  std::printf("%d rows, diverged at tick %d\n", rows.count, rows.unstable_tick);
}
