// libFuzzer target of the readers and of the tick. The first byte of an input chooses one; a folder gets valid checksums before it is
// loaded. The environment variable PALPATE_FUZZ_SEEDS names a folder that receives a valid input of each kind.
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <fstream>
#include <iterator>
#include <palpate/mechanism/slider.hpp>
#include <palpate/mesh/mesh_file.hpp>
#include <palpate/mesh/triangle_mesh.hpp>
#include <palpate/servo/loop_config.hpp>
#include <string>
#include <vector>

#include "support/loop_folder.hpp"

namespace {

using loop_folder::Files;
using palpate::math::Vector3;
using palpate::mechanism::Slider;

/// Stop with a sentence that the fuzzer reports.
void require(bool holds, const char* sentence) {
  if (holds) return;
  std::fprintf(stderr, "%s\n", sentence);
  std::abort();
}

/// Reads parts of an input; zeros after its end.
class Input {
 public:
  Input(const std::uint8_t* data, std::size_t size) : at_(data), left_(size) {}

  [[nodiscard]] std::size_t left() const { return left_; }
  template <class T>
  T next() {
    T out{};
    const std::string bytes = text(sizeof(T));
    std::memcpy(&out, bytes.data(), bytes.size());
    return out;
  }
  std::string text(std::size_t size) {
    size = std::min(size, left_);
    std::string out(reinterpret_cast<const char*>(at_), size);
    at_ += size;
    left_ -= size;
    return out;
  }

 private:
  const std::uint8_t* at_;
  std::size_t left_;
};

/// A folder is a sequence of: length of the name (1 byte), name, length of the content (4 bytes), content.
Files unpack(Input& input) {
  Files out;
  while (input.left() > 0 && out.size() < 32) {
    const std::string name = input.text(input.next<std::uint8_t>());
    out[name] = input.text(input.next<std::uint32_t>());
  }
  return out;
}

std::string pack(const Files& files) {
  std::string out;
  for (const auto& [name, content] : files) {
    const auto size = static_cast<std::uint32_t>(content.size());
    out += static_cast<char>(name.size()) + name + std::string(reinterpret_cast<const char*>(&size), sizeof size) + content;
  }
  return out;
}

/// Write the checksums of the blobs, then that of loop.json.
void seal(Files& files) {
  std::string& text = files["loop.json"];
  for (std::size_t at = 0; (at = text.find("\"file\": \"", at)) != std::string::npos;) {
    at += 9;
    const std::size_t end = text.find('"', at), sum = text.find("\"crc32\": \"", at);
    if (end == std::string::npos || sum == std::string::npos || sum > at + 200 || sum + 18 > text.size()) continue;
    if (const auto file = files.find(text.substr(at, end - at)); file != files.end())
      text.replace(sum + 10, 8, loop_folder::checksum(file->second));
  }
  loop_folder::seal(files);
}

void load_folder(Input& input) {
  Files files = unpack(input);
  seal(files);
  const palpate::servo::LoopConfigResult loaded = palpate::servo::load_loop_config(loop_folder::MemorySource(files));
  require(static_cast<bool>(loaded) == loaded.error.empty(), "a refused folder needs a reason");
  if (!loaded) return;
  const auto setup = loaded.config->setup<Slider>();
  if (!setup) return;
  const int ticks = std::min(loaded.config->ticks, 10);
  std::vector<double> rows(static_cast<std::size_t>((ticks / setup->record_every + 1) * palpate::servo::row_width(*setup)));
  palpate::servo::simulate(*setup, ticks, loaded.config->reference.data(), loaded.config->operator_force.data(), rows.data());
}

void read_mesh(Input& input, bool stl) {
  const std::string text = input.text(input.left());
  const palpate::mesh::MeshFile file = stl ? palpate::mesh::parse_stl(text, 1e-3) : palpate::mesh::parse_obj(text, 1e-3);
  if (!file || file.triangles.size() > 2000) return;
  for (const auto& triangle : file.triangles)
    for (const std::int32_t v : triangle)
      require(v >= 0 && static_cast<std::size_t>(v) < file.vertices.size(), "a triangle has a vertex that does not exist");
  const palpate::mesh::TriangleMesh mesh(file.vertices, file.triangles);
  static_cast<void>(mesh.diagnosis());
}

/// A servo with any encoder counts, references and periods: the torque stays finite and within the drive's limit.
void run_ticks(Input& input) {
  static const auto configs = [] {
    std::vector<palpate::servo::LoopConfig> out;
    for (const char* kind : loop_folder::object_kinds)
      out.push_back(*palpate::servo::load_loop_config(loop_folder::MemorySource(loop_folder::valid(kind))).config);
    return out;
  }();
  auto setup = *configs[input.next<std::uint8_t>() % configs.size()].setup<Slider>();
  setup.faults = {.speed = 2.0, .fade = 10e-3};
  palpate::servo::Servo<Slider, palpate::object::AnyObject, palpate::control::AnyController> servo(setup, setup.object, setup.controller);
  double position = 0.0, elapsed = 1e-3;
  Vector3<> reference = Vector3<>::Zero();
  for (int k = 0; k < 200 && input.left() > 0; ++k) {
    switch (input.next<std::uint8_t>() % 8) {
      case 0:
        position = input.next<double>();
        break;
      case 1:
        reference[k % 3] = input.next<double>();
        break;
      case 2:
        elapsed = input.next<double>();
        break;
      case 3:
        elapsed = 1e-3;
        break;
      default:
        position += 1e-5 * input.next<std::int8_t>();
    }
    const auto& tick = servo.tick(palpate::math::Joints<1>(position), reference, elapsed);
    require(std::abs(tick.torque[0]) <= 8.5 * (1.0 + 1e-12), "a torque exceeds the drive's limit or is not finite");
    servo.update();
  }
}

void write_seeds(const std::string& folder) {
  const auto write = [&folder](const std::string& name, char target, const std::string& content) {
    std::ofstream(folder + "/" + name, std::ios::binary) << target << content;
  };
  for (const char* kind : loop_folder::object_kinds) write(kind, 0, pack(loop_folder::valid(kind, 10)));
  write("stl", 1, "solid a\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0\nendloop\nendfacet\nendsolid a\n");
  write("obj", 2, "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 2 3 4\nf 1/1 -1//2 3\n");
  for (char kind = 0; kind < 9; ++kind) write("tick" + std::to_string(kind), 3, kind + std::string(200, '\x24'));
}

}  // namespace

extern "C" int LLVMFuzzerInitialize(int*, char***) {
  if (const char* folder = std::getenv("PALPATE_FUZZ_SEEDS")) write_seeds(folder);
  return 0;
}

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  Input input(data, size);
  switch (input.next<std::uint8_t>() % 4) {
    case 0:
      load_folder(input);
      break;
    case 1:
      read_mesh(input, true);
      break;
    case 2:
      read_mesh(input, false);
      break;
    default:
      run_ticks(input);
  }
  return 0;
}
