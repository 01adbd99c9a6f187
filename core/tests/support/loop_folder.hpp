#pragma once

#include <array>
#include <cstdint>
#include <cstdio>
#include <cstring>
#include <map>
#include <palpate/servo/blob.hpp>
#include <palpate/servo/json.hpp>
#include <string>
#include <type_traits>
#include <utility>
#include <vector>

#include "support/mass_spring_cube.hpp"
#include "support/mesh_shapes.hpp"

/// A loop folder in memory: what `palpate resolve` writes for a slider, without Python.
namespace loop_folder {

using palpate::servo::JsonValue;

/// Contents by name.
using Files = std::map<std::string, std::string>;

/// Files in memory. They must outlive the source.
class MemorySource final : public palpate::servo::BlobSource {
 public:
  explicit MemorySource(const Files& files) : files_(files) {}

  [[nodiscard]] std::int64_t size(const std::string& name) const override {
    const auto found = files_.find(name);
    return found == files_.end() ? -1 : static_cast<std::int64_t>(found->second.size());
  }
  [[nodiscard]] bool read(const std::string& name, void* to, std::size_t bytes) const override {
    std::memcpy(to, files_.at(name).data(), bytes);
    return true;
  }

 private:
  const Files& files_;
};

inline std::string checksum(const std::string& data) {
  char text[9];
  std::snprintf(text, sizeof text, "%08x", static_cast<unsigned>(palpate::servo::crc32(data.data(), data.size())));
  return text;
}

/// Give loop.json the checksum of its present text.
inline void seal(Files& to) {
  std::string& text = to["loop.json"];
  const std::size_t length = palpate::servo::checksum_member("").size();
  if (text.size() > length && text.ends_with("\"\n}\n"))
    text.resize(text.size() - length);
  else
    text = text.substr(0, text.rfind('}')) + ", ";
  text += palpate::servo::checksum_member(text);
}

/// Store an array; return its description. `columns` = 0: a list.
template <class T>
std::string blob(Files& to, const std::string& name, const std::vector<T>& values, std::size_t columns = 0) {
  std::string data(values.size() * sizeof(T), '\0');
  if (!values.empty()) std::memcpy(data.data(), values.data(), data.size());
  const std::string shape =
      columns == 0 ? std::to_string(values.size()) : std::to_string(values.size() / columns) + ", " + std::to_string(columns);
  const std::string out = R"({"file": ")" + name + R"(", "dtype": ")" + palpate::servo::dtype_of<T> + R"(", "shape": [)" + shape +
                          R"(], "bytes": )" + std::to_string(data.size()) + R"(, "crc32": ")" + checksum(data) + "\"}";
  to[name] = std::move(data);
  return out;
}

inline std::string points(Files& to, const std::string& name, const std::vector<palpate::math::Vector3<>>& at) {
  std::vector<double> flat;
  for (const auto& p : at) flat.insert(flat.end(), {p[0], p[1], p[2]});
  return blob(to, name, flat, 3);
}

template <std::size_t width>
std::string indices(Files& to, const std::string& name, const std::vector<std::array<std::int32_t, width>>& rows) {
  std::vector<std::int32_t> flat;
  for (const auto& row : rows) flat.insert(flat.end(), row.begin(), row.end());
  return blob(to, name, flat, width);
}

inline const char* const object_kinds[] = {"wall",         "mesh",  "compliance", "standard_linear_solid", "modal",     "mass_spring",
                                           "moving_frame", "scene", "force_law",  "gravity_well",          "vibration", "textured_wall",
                                           "virtual_mass"};

inline std::string wall() {
  return R"({"kind": "spring_wall", "shape": "half_space", "point": [0.0005, 0, 0], "normal": [-1, 0, 0], "stiffness": [100, 100, 100],)"
         R"( "damping": [0.1, 0.1, 0.1], "difference": "backward"})";
}

/// A box in front of the tip.
inline std::string mesh(Files& to) {
  shapes::Shape shape = shapes::box({0.01, 0.01, 0.01}, 2);
  for (auto& v : shape.vertices) v[0] += 0.0125;
  const std::vector<double> stiffness(shape.vertices.size(), 100.0), damping(shape.vertices.size(), 0.1);
  return R"({"kind": "mesh", "radius": 0.002, "open": false, "vertices": )" + points(to, "vertices", shape.vertices) +
         R"(, "triangles": )" + indices<3>(to, "triangles", shape.triangles) + R"(, "surface": {"stiffness": )" +
         blob(to, "stiffness", stiffness) + R"(, "damping": )" + blob(to, "damping", damping) +
         R"(, "tangential": 1.0, "static_friction": 0.5, "dynamic_friction": 0.4, "viscous": 0.1, "field": "continuous", "shading": 0.3,)"
         R"( "period": 0.001}})";
}

/// A cube on its side, whose touched face looks along -x.
inline std::string body(Files& to, const std::string& model) {
  Cube cube(2);
  const std::int32_t n = cube.nodes.size();
  const auto count = static_cast<std::size_t>(n);
  std::vector<palpate::math::Vector3<>> at, normals;
  for (std::int32_t i = 0; i < n; ++i) {
    at.push_back(cube.nodes.point(i));
    normals.push_back(cube.nodes.normal(i));
  }
  std::string out = R"({"kind": "body", "model": ")" + model +
                    R"(", "placement": {"origin": [0.0145, -0.005, 0.005], "rotation": [0, 0, -1, 1, 0, 0, 0, -1, 0], "tip": "sphere",)"
                    R"( "radius": 0.004}, "static_friction": 0.5, "dynamic_friction": 0.4, "points": )" +
                    points(to, "points", at) + R"(, "normals": )" + points(to, "normals", normals) + R"(, "areas": )" +
                    blob(to, "areas", std::vector<double>(count, 2.5e-5));
  if (model != "compliance") out += R"(, "period": 0.001)";
  if (model == "mass_spring" || model == "modal") out += R"(, "rayleigh_alpha": 1.0, "rayleigh_beta": 0.001)";
  if (model == "mass_spring") {
    const auto& d = cube.data;
    std::vector<double> compliance;
    for (const auto& each : cube.patches.compliance) compliance.insert(compliance.end(), each.data(), each.data() + 9);
    return out + R"(, "positions": )" + points(to, "positions", d.rest_positions) + R"(, "masses": )" + blob(to, "masses", d.masses) +
           R"(, "fixed": )" + blob(to, "fixed", d.fixed) + R"(, "springs": )" + indices<2>(to, "springs", d.springs) +
           R"(, "stiffness": )" + blob(to, "stiffness", d.stiffness) + R"(, "tetrahedra": )" + indices<4>(to, "tetrahedra", d.tetrahedra) +
           R"(, "pressure": )" + blob(to, "pressure", d.pressure) + R"(, "patch_begin": )" + blob(to, "patch_begin", cube.patches.begin) +
           R"(, "patch_vertices": )" + blob(to, "patch_vertices", cube.patches.vertices) + R"(, "patch_weights": )" +
           blob(to, "patch_weights", cube.patches.weights) + R"(, "patch_compliance": )" + blob(to, "patch_compliance", compliance, 3) +
           "}";
  }
  std::vector<float> full(9 * count * count, 0.0F);
  for (std::size_t i = 0; i < 3 * count; ++i)
    for (std::size_t j = 0; j < 3 * count; ++j)
      if (i % 3 == j % 3) full[3 * count * i + j] = i == j ? 0.01F : 0.004F;
  out += R"(, "compliance": )" + blob(to, "compliance", full, 3 * count);
  if (model != "compliance") out += R"(, "instantaneous_ratio": 2.0, "retardation_time": 0.05)";
  if (model == "modal") {
    std::vector<float> shapes(6 * count, 0.0F);
    for (std::size_t i = 0; i < count; ++i) {
      shapes[6 * i + 4] = 1.0F;
      shapes[6 * i + 5] = i % 2 == 0 ? 0.5F : -0.5F;
    }
    out += R"(, "frequencies": )" + blob(to, "frequencies", std::vector<double>{60.0, 90.0}) + R"(, "shapes": )" +
           blob(to, "shapes", shapes, 2);
  }
  return out + "}";
}

inline std::string moving_frame(Files& to, const std::string& object) {
  const std::vector<double> motion = {0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.05, -1e-3, 0.0, 0.0, 0.1, 0.0, -0.2};
  return R"({"kind": "moving_frame", "origin": [0, 0, 0], "motion": )" + blob(to, "motion", motion, 7) + R"(, "object": )" + object + "}";
}

inline std::string scene(Files& to) {
  return R"({"kind": "scene", "objects": {"rib": )" + wall() + R"(, "heart": )" + moving_frame(to, mesh(to)) + "}}";
}

inline bool is_force_object(const std::string& kind) {
  return kind == "force_law" || kind == "gravity_well" || kind == "vibration" || kind == "virtual_mass" || kind == "textured_wall";
}

/// A force law or a field in front of the tip.
inline std::string force_object(Files& to, const std::string& kind) {
  const std::string plane = R"(, "point": [0.0005, 0, 0], "normal": [-1, 0, 0])";
  const std::string begin = R"({"kind": ")" + kind + '"';
  if (kind == "force_law")
    return begin + plane + R"(, "depth": )" + blob(to, "depth", std::vector<double>{0.0, 1e-3, 3e-3}) + R"(, "force": )" +
           blob(to, "force", std::vector<double>{0.0, 0.1, 0.4}) + "}";
  if (kind == "gravity_well") return begin + R"(, "center": [0.001, 0, 0], "stiffness": 100, "radius": 0.5, "cap": 0.2})";
  if (kind == "vibration") return begin + plane + R"(, "force": [-0.1, 0, 0], "frequency": 150, "decay": 0.05, "at_contact": true})";
  if (kind == "virtual_mass") return begin + R"(, "mass": 0.2, "stiffness": 100, "damping": 0.5, "period": 0.001})";
  return begin + plane + R"(, "across": [0, 1, 0], "stiffness": 100, "damping": 0.1, "wavelength": 0.001, "height": 0.0001,)" +
         R"( "lateral_force": 0.05})";
}

/// Return the guard of the loop with an object of the given kind, as a member of the document; empty: none.
inline std::string guard(const std::string& kind) {
  if (kind == "wall") return R"(, "guard": {"kind": "energy_bound", "damping": [0.4], "coulomb": [0.008], "lateness": 0.0001})";
  if (kind == "mesh") return R"(, "guard": {"kind": "passivity_controller", "cap": 0.5})";
  if (kind == "scene") return R"(, "guard": {"kind": "half_sample", "velocity": "observer", "horizon": 0.5, "observer": 500})";
  return "";
}

/// A slider that pushes with 0.3 N along x against an object of the given kind for `ticks` periods.
inline Files valid(const std::string& kind, std::size_t ticks = 100) {
  Files to;
  std::vector<double> push(3 * (ticks + 1), 0.0);
  for (std::size_t k = 0; k <= ticks; ++k) push[3 * k] = 0.3;
  const std::string object = kind == "wall"           ? wall()
                             : kind == "mesh"         ? mesh(to)
                             : kind == "moving_frame" ? moving_frame(to, mesh(to))
                             : kind == "scene"        ? scene(to)
                             : is_force_object(kind)  ? force_object(to, kind)
                                                      : body(to, kind);
  to["loop.json"] =
      R"({"format": "palpate loop", "version": 2, "written_by": "test", "title": "a loop", "mechanism": {"name": "slider", "parameters":)"
      R"( {"mass.tip": [0.1]}}, "servo": {"period": 0.001, "delay": 1, "start": [0.0], "gravity_compensation": [0, 0, 0],)"
      R"( "frozen_kinematics": false, "encoder_step": [0.0], "limits": {"peak_force": 8.5, "continuous_force": null, "thermal_time": 10,)"
      R"( "peak_torque": [null]}}, "plant": {"kind": "nonlinear", "start_speed": [0.0], "substeps": 2, "jitter": 0.0, "seed": 1,)"
      R"( "speed_limit": 1000, "friction": {"viscous": [0.5], "coulomb": [0.01], "breakaway": [0.02], "stribeck_speed": [0.01]},)"
      R"( "human_arm": {"mass": 0.1, "damping": 4.5, "stiffness": 20, "tissue": false, "tissue_stiffness": 0, "tissue_damping": 0, "rest":)"
      R"( [0, 0, 0]}}, "object": )" +
      object + guard(kind) +
      R"(, "controller": {"kind": "state_space", "order": 1, "a": [0.5], "b": [0, 0, 0, 0, 0, 0], "c": [0, 0, 0], "d": [1, 0, 0, -1, 0, 0,)"
      R"( 0, 1, 0, 0, -1, 0, 0, 0, 1, 0, 0, -1], "antiwindup": [0, 0, 0]}, "run": {"ticks": )" +
      std::to_string(ticks) + R"(, "record_every": 1, "reference": null, "operator_force": )" + blob(to, "operator_force", push, 3) + "}}";
  seal(to);
  return to;
}

/// Write a document as JSON text.
inline void write_json(const JsonValue& value, std::string& to) {
  const auto quoted = [&to](const std::string& text) {
    to += '"';
    for (const char c : text) {
      char escape[8];
      std::snprintf(escape, sizeof escape, "\\u%04x", static_cast<unsigned>(static_cast<unsigned char>(c)));
      if (c == '"' || c == '\\' || static_cast<unsigned char>(c) < 0x20)
        to += escape;
      else
        to += c;
    }
    to += '"';
  };
  char number[32];
  const bool is_object = value.kind == JsonValue::Kind::object;
  switch (value.kind) {
    case JsonValue::Kind::null:
      to += "null";
      break;
    case JsonValue::Kind::boolean:
      to += value.boolean ? "true" : "false";
      break;
    case JsonValue::Kind::number:
      std::snprintf(number, sizeof number, "%.17g", value.number);
      to += number;
      break;
    case JsonValue::Kind::string:
      quoted(value.text);
      break;
    default:
      to += is_object ? '{' : '[';
      for (std::size_t i = 0; i < value.items.size(); ++i) {
        if (i > 0) to += ", ";
        if (is_object) {
          quoted(value.keys[i]);
          to += ": ";
        }
        write_json(value.items[i], to);
      }
      to += is_object ? '}' : ']';
  }
}

}  // namespace loop_folder
