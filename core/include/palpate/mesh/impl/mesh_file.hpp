#pragma once

#include <algorithm>
#include <array>
#include <bit>
#include <cctype>
#include <charconv>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <limits>
#include <memory>
#include <string>
#include <string_view>
#include <system_error>
#include <unordered_map>
#include <utility>
#include <vector>

#include "palpate/math/inline.hpp"
#include "palpate/math/vector.hpp"
#include "palpate/mesh/mesh_file.hpp"
#include "palpate/mesh/triangle_mesh.hpp"

namespace palpate::mesh {

namespace detail {

/// Tokens of a text file with their line number. Whitespace separates tokens.
class Tokenizer {
 public:
  explicit Tokenizer(std::string_view text) : text_(text) {}

  /// Return the next token, or an empty view at the end of the text.
  std::string_view next() {
    skip(false);
    return token(false);
  }

  /// Return the next token of the current line, or an empty view at its end. A backslash before the
  /// line break continues the line.
  std::string_view next_in_line() {
    skip(true);
    return token(true);
  }

  /// Skip the remainder of the current line, without its line break.
  void skip_line() { position_ = std::min(text_.find('\n', position_), text_.size()); }

  /// Skip line breaks and whitespace. Return false at the end of the text.
  bool next_line() {
    skip(false);
    return position_ < text_.size();
  }

  [[nodiscard]] std::int64_t line() const { return line_; }

 private:
  void skip(bool in_line) {
    for (; position_ < text_.size(); ++position_) {
      const char c = text_[position_];
      if (c == '\\' && in_line) {
        std::size_t end = position_ + 1;
        if (end < text_.size() && text_[end] == '\r') ++end;
        if (end >= text_.size() || text_[end] != '\n') return;
        position_ = end;
        ++line_;
        continue;
      }
      if (c == '\n') {
        if (in_line) return;
        ++line_;
      } else if (c != ' ' && (c < '\t' || c > '\r')) {
        return;
      }
    }
  }

  std::string_view token(bool in_line) {
    const std::size_t begin = position_;
    while (position_ < text_.size() && text_[position_] != ' ' && (text_[position_] < '\t' || text_[position_] > '\r') &&
           !(in_line && continues(position_)))
      ++position_;
    return text_.substr(begin, position_ - begin);
  }

  /// Return whether a backslash at `position` continues the line.
  [[nodiscard]] bool continues(std::size_t position) const {
    if (text_[position] != '\\') return false;
    const std::string_view after = text_.substr(position + 1, 2);
    return after.substr(0, 1) == "\n" || after == "\r\n";
  }

  std::string_view text_;
  std::size_t position_ = 0;
  std::int64_t line_ = 1;
};

/// Parse a finite decimal number. Return false if the token is anything else.
inline bool parse_number(std::string_view token, double& value) {
  if (token.starts_with('+')) token.remove_prefix(1);
  if (token.empty() || token.front() == '+') return false;
#if defined(__cpp_lib_to_chars)
  const auto [end, error] = std::from_chars(token.data(), token.data() + token.size(), value);
  return error == std::errc() && end == token.data() + token.size() && std::isfinite(value);
#else  // the standard library has no from_chars for double
  if (token.find_first_not_of("0123456789.eE+-") != std::string_view::npos) return false;
  const std::string copy(token);
  char* end = nullptr;
  value = std::strtod(copy.c_str(), &end);
  return end == copy.c_str() + copy.size() && std::isfinite(value);
#endif
}

inline bool parse_integer(std::string_view token, std::int64_t& value) {
  const auto [end, error] = std::from_chars(token.data(), token.data() + token.size(), value);
  return error == std::errc() && end == token.data() + token.size();
}

/// Return the token in quotes, shortened, with unprintable characters replaced.
inline std::string quoted(std::string_view token) {
  std::string out = "'";
  for (const char c : token.substr(0, 40)) out += std::isprint(static_cast<unsigned char>(c)) != 0 ? c : '?';
  return out + (token.size() > 40 ? "...'" : "'");
}

inline std::string lower_case(std::string_view token) {
  std::string out(token);
  for (char& c : out) c = static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  return out;
}

inline MeshFile mesh_file_error(std::string problem) {
  MeshFile out;
  out.error = std::move(problem);
  return out;
}

inline MeshFile mesh_file_error(const Tokenizer& at, const std::string& problem) {
  return mesh_file_error("line " + std::to_string(at.line()) + ": " + problem);
}

constexpr std::int64_t max_file_triangles = std::int64_t{1} << 29;
constexpr const char* too_many_triangles = "the mesh has more than 2^29 triangles; simplify it";

/// Collects triangles given by coordinates and merges vertices with exactly equal coordinates.
class VertexMerger {
 public:
  /// Return the index of the vertex at `x` [file units].
  std::int32_t add(const std::array<double, 3>& x) {
    const std::array<double, 3> key{x[0] + 0.0, x[1] + 0.0, x[2] + 0.0};  // -0 becomes 0
    const auto [entry, is_new] = known_.try_emplace(key, static_cast<std::int32_t>(vertices_.size()));
    if (is_new) vertices_.emplace_back(key[0], key[1], key[2]);
    return entry->second;
  }

  std::vector<Vector3<>> take() { return std::move(vertices_); }

 private:
  struct Hash {
    std::size_t operator()(const std::array<double, 3>& x) const noexcept {
      std::uint64_t h = 0x9e3779b97f4a7c15ULL;
      for (const double c : x) {
        h ^= std::bit_cast<std::uint64_t>(c);
        h *= 0xff51afd7ed558ccdULL;
        h ^= h >> 33;
      }
      return static_cast<std::size_t>(h);
    }
  };
  std::unordered_map<std::array<double, 3>, std::int32_t, Hash> known_;
  std::vector<Vector3<>> vertices_;
};

inline std::uint32_t little_endian(std::string_view bytes, std::size_t at) {
  std::uint32_t value = 0;
  for (std::size_t i = 4; i-- > 0;) value = value << 8 | static_cast<unsigned char>(bytes[at + i]);
  return value;
}

/// Convert vertices from file units to meters. Fail if a coordinate overflows.
inline MeshFile to_meters(MeshFile mesh, double unit) {
  for (Vector3<>& v : mesh.vertices) {
    v *= unit;
    if (!v.allFinite()) return mesh_file_error("a coordinate times the unit is too large; check the unit");
  }
  return mesh;
}

inline MeshFile parse_binary_stl(std::string_view bytes) {
  MeshFile mesh;
  VertexMerger merger;
  const std::size_t count = little_endian(bytes, 80);
  if (static_cast<std::int64_t>(count) > max_file_triangles) return mesh_file_error(too_many_triangles);
  mesh.triangles.reserve(count);
  for (std::size_t f = 0; f < count; ++f) {
    Triangle triangle{};
    for (std::size_t i = 0; i < 3; ++i) {
      std::array<double, 3> x{};
      for (std::size_t k = 0; k < 3; ++k) {
        // Record of 50 bytes: normal, three corners, attribute.
        x[k] = static_cast<double>(std::bit_cast<float>(little_endian(bytes, 84 + 50 * f + 12 * (i + 1) + 4 * k)));
        if (!std::isfinite(x[k]))
          return mesh_file_error("triangle " + std::to_string(f) + ": a coordinate is not finite; export the mesh again");
      }
      triangle[i] = merger.add(x);
    }
    mesh.triangles.push_back(triangle);
  }
  mesh.vertices = merger.take();
  return mesh;
}

inline MeshFile parse_ascii_stl(std::string_view text) {
  MeshFile mesh;
  VertexMerger merger;
  Tokenizer tokens(text);
  Triangle triangle{};
  std::size_t corners = 0;
  bool in_facet = false;
  for (std::string_view token = tokens.next(); !token.empty(); token = tokens.next()) {
    const std::string word = lower_case(token);
    if (word == "solid" || word == "endsolid") {
      tokens.skip_line();  // the name of the solid
    } else if (word == "facet") {
      if (in_facet) return mesh_file_error(tokens, "'facet' inside a facet; export the mesh again");
      in_facet = true;
      corners = 0;
    } else if (word == "normal") {
      for (int i = 0; i < 3; ++i) tokens.next();  // unused: the corners define the normal
    } else if (word == "vertex") {
      if (!in_facet || corners == 3) return mesh_file_error(tokens, "'vertex' outside a facet of three corners; export the mesh again");
      std::array<double, 3> x{};
      for (double& coordinate : x) {
        token = tokens.next();
        if (!parse_number(token, coordinate))
          return mesh_file_error(tokens, "a vertex needs three finite numbers, found " + quoted(token) + "; export the mesh again");
      }
      triangle[corners++] = merger.add(x);
    } else if (word == "endfacet") {
      if (!in_facet || corners != 3)
        return mesh_file_error(tokens, "a facet has " + std::to_string(corners) + " corners, not 3; export the mesh again");
      in_facet = false;
      if (static_cast<std::int64_t>(mesh.triangles.size()) == max_file_triangles) return mesh_file_error(too_many_triangles);
      mesh.triangles.push_back(triangle);
    } else if (word != "outer" && word != "loop" && word != "endloop") {
      return mesh_file_error(tokens, "unknown keyword " + quoted(token) + "; export the mesh again");
    }
  }
  if (in_facet) return mesh_file_error(tokens, "the file ends inside a facet; copy or export it again");
  mesh.vertices = merger.take();
  return mesh;
}

}  // namespace detail

PALPATE_INLINE MeshFile parse_stl(std::string_view bytes, double unit) {
  if (!(unit > 0.0) || !std::isfinite(unit)) return detail::mesh_file_error("the unit must be a positive length in meters");
  // A binary file can also start with "solid", so its exact size decides.
  const std::uint64_t expected = bytes.size() >= 84 ? 84 + 50 * std::uint64_t{detail::little_endian(bytes, 80)} : 0;
  if (bytes.size() >= 84 && bytes.size() == expected) return detail::to_meters(detail::parse_binary_stl(bytes), unit);
  detail::Tokenizer tokens(bytes);
  const bool is_text = bytes.substr(0, 84).find('\0') == std::string_view::npos;
  if (is_text && detail::lower_case(tokens.next()) == "solid") return detail::to_meters(detail::parse_ascii_stl(bytes), unit);
  if (bytes.size() < 84) return detail::mesh_file_error("the file is too short for binary STL and does not start with 'solid'");
  return detail::mesh_file_error("the header of the binary STL announces " + std::to_string(expected) + " bytes, the file has " +
                                 std::to_string(bytes.size()) + "; copy or export it again");
}

PALPATE_INLINE MeshFile parse_obj(std::string_view text, double unit) {
  if (!(unit > 0.0) || !std::isfinite(unit)) return detail::mesh_file_error("the unit must be a positive length in meters");
  MeshFile mesh;
  detail::Tokenizer tokens(text);
  std::vector<std::int32_t> polygon;
  std::int64_t max_index = -1, max_index_line = 0;
  for (; tokens.next_line(); tokens.skip_line()) {
    const std::string_view statement = tokens.next_in_line();
    if (statement == "v") {
      if (mesh.vertices.size() >= std::size_t{1} << 30) return detail::mesh_file_error("the mesh has more than 2^30 vertices; simplify it");
      Vector3<> x;
      for (int i = 0; i < 3; ++i) {
        const std::string_view token = tokens.next_in_line();
        if (!detail::parse_number(token, x[i]))
          return detail::mesh_file_error(tokens,
                                         "a vertex needs three finite numbers, found " + detail::quoted(token) + "; export the mesh again");
      }
      mesh.vertices.push_back(x);
    } else if (statement == "f") {
      polygon.clear();
      for (std::string_view token = tokens.next_in_line(); !token.empty() && token.front() != '#'; token = tokens.next_in_line()) {
        std::int64_t index = 0;  // from 1; the texture and normal indices after '/' are ignored
        if (!detail::parse_integer(token.substr(0, token.find('/')), index))
          return detail::mesh_file_error(tokens, "a face needs vertex indices, found " + detail::quoted(token) + "; export the mesh again");
        const std::int64_t vertex = index < 0 ? static_cast<std::int64_t>(mesh.vertices.size()) + index : index - 1;
        if (index == 0 || vertex < 0 || vertex >= std::int64_t{1} << 30)
          return detail::mesh_file_error(tokens, "the vertex index " + std::to_string(index) + " is out of range; export the mesh again");
        if (vertex > max_index) {
          max_index = vertex;
          max_index_line = tokens.line();
        }
        polygon.push_back(static_cast<std::int32_t>(vertex));
      }
      if (polygon.size() < 3)
        return detail::mesh_file_error(
            tokens, "a face has " + std::to_string(polygon.size()) + " vertices, at least 3 are needed; export the mesh again");
      for (std::size_t i = 2; i < polygon.size(); ++i) {
        if (static_cast<std::int64_t>(mesh.triangles.size()) == detail::max_file_triangles)
          return detail::mesh_file_error(detail::too_many_triangles);
        mesh.triangles.push_back({polygon[0], polygon[i - 1], polygon[i]});
      }
    }
  }
  if (max_index >= static_cast<std::int64_t>(mesh.vertices.size()))  // a face may precede its vertices
    return detail::mesh_file_error("line " + std::to_string(max_index_line) + ": the vertex index " + std::to_string(max_index + 1) +
                                   " exceeds the " + std::to_string(mesh.vertices.size()) + " vertices; export the mesh again");
  return detail::to_meters(std::move(mesh), unit);
}

PALPATE_INLINE MeshFile read_mesh_file(const std::string& path, double unit) {
  const std::size_t dot = path.find_last_of("./\\");
  const std::string extension = dot == std::string::npos || path[dot] != '.' ? "" : detail::lower_case(path.substr(dot));
  if (extension != ".stl" && extension != ".obj")
    return detail::mesh_file_error(path + ": the format " + detail::quoted(extension) +
                                   " is not supported; convert the mesh to STL or OBJ");
  const std::unique_ptr<std::FILE, int (*)(std::FILE*)> file(std::fopen(path.c_str(), "rb"), &std::fclose);
  if (!file) return detail::mesh_file_error(path + ": the file cannot be opened; check its name and permissions");
  std::string bytes;
  std::array<char, 65536> buffer{};
  while (const std::size_t count = std::fread(buffer.data(), 1, buffer.size(), file.get())) bytes.append(buffer.data(), count);
  if (std::ferror(file.get()) != 0) return detail::mesh_file_error(path + ": the file cannot be read; check that it is a regular file");
  MeshFile mesh = extension == ".stl" ? parse_stl(bytes, unit) : parse_obj(bytes, unit);
  if (!mesh) mesh.error = path + ": " + mesh.error;
  return mesh;
}

}  // namespace palpate::mesh
