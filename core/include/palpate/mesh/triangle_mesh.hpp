#pragma once

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <numeric>
#include <utility>
#include <vector>

#include "palpate/math/vector.hpp"

namespace palpate::mesh {

using Triangle = std::array<std::int32_t, 3>;

/// Defects of a set of triangles.
enum class MeshFault {
  none,
  empty,               ///< no triangle
  too_large,           ///< more than 2^29 triangles or 2^30 vertices
  not_finite,          ///< a vertex has a NaN or infinite coordinate
  index_out_of_range,  ///< a triangle refers to a vertex that does not exist
  degenerate,          ///< a triangle has no area: repeated or collinear vertices
  duplicate,           ///< two triangles have the same three vertices
  non_manifold,        ///< an edge has more than two triangles
  mixed_winding,       ///< two neighbors have opposite orientation
  open,                ///< an edge has only one triangle (can be allowed)
};

/// Number of defects of each kind and the index of the first: a triangle, or a vertex for
/// `not_finite`.
struct MeshDiagnosis {
  struct Count {
    std::int64_t count = 0;
    std::int64_t first = -1;
    void add(std::int64_t index) noexcept {
      if (count++ == 0) first = index;
    }
  };
  Count not_finite, index_out_of_range, degenerate, duplicate, non_manifold, mixed_winding, open;
  bool empty = false;
  bool too_large = false;
  std::int64_t components = 0;  ///< pieces that share no edge
  double volume = 0.0;          ///< enclosed volume, m^3; negative if the normals point inwards

  /// Return the most severe defect.
  [[nodiscard]] MeshFault fault() const noexcept {
    if (empty) return MeshFault::empty;
    if (too_large) return MeshFault::too_large;
    if (not_finite.count > 0) return MeshFault::not_finite;
    if (index_out_of_range.count > 0) return MeshFault::index_out_of_range;
    if (degenerate.count > 0) return MeshFault::degenerate;
    if (duplicate.count > 0) return MeshFault::duplicate;
    if (non_manifold.count > 0) return MeshFault::non_manifold;
    if (mixed_winding.count > 0) return MeshFault::mixed_winding;
    if (open.count > 0) return MeshFault::open;
    return MeshFault::none;
  }
};

/// Triangle with the data that a proxy needs to traverse it: two cache lines.
struct alignas(64) Face {
  std::array<Vector3<>, 3> corner;       // m
  Vector3<> normal;                      // unit, right-hand rule from corner 0 to 1 to 2
  Triangle vertex;                       // indices of the corners
  std::array<std::int32_t, 3> neighbor;  // half-edge opposite to the edge from corner i to i + 1; -1 at a border

  /// Return the signed height of `x` above the plane of the face, m.
  [[nodiscard]] double height(const Vector3<>& x) const noexcept { return normal.dot(x - corner[0]); }
};
static_assert(sizeof(Face) == 128);

/// Triangle mesh with adjacency.
///
/// Half-edge h = 3 f + i runs from corner i of face f to corner i + 1. Its twin belongs to the
/// neighbor and runs the opposite way.
class TriangleMesh {
 public:
  static constexpr std::int32_t none = -1;

  TriangleMesh() = default;

  /// Store the triangles unchanged and record their defects in diagnosis().
  ///
  /// Trees, surface fields and proxies of a mesh that is not usable() touch nothing. `allow_open`
  /// accepts meshes with borders.
  TriangleMesh(std::vector<Vector3<>> vertices, std::vector<Triangle> triangles, bool allow_open = false)
      : vertices_(std::move(vertices)), allow_open_(allow_open) {
    if (!check_input(triangles)) return;
    faces_.resize(triangles.size());
    for (std::size_t f = 0; f < triangles.size(); ++f) faces_[f].vertex = triangles[f];
    build_adjacency();
    compute_geometry();
    count_components();
  }

  [[nodiscard]] const MeshDiagnosis& diagnosis() const noexcept { return diagnosis_; }
  [[nodiscard]] MeshFault fault() const noexcept {
    const MeshFault f = diagnosis_.fault();
    return f == MeshFault::open && allow_open_ ? MeshFault::none : f;
  }
  [[nodiscard]] bool usable() const noexcept { return !faces_.empty() && fault() == MeshFault::none; }

  /// Return whether the mesh has no border, so that it encloses an inside.
  [[nodiscard]] bool closed() const noexcept { return diagnosis_.open.count == 0; }

  [[nodiscard]] std::int32_t size() const noexcept { return static_cast<std::int32_t>(faces_.size()); }
  [[nodiscard]] const Face& face(std::int32_t f) const noexcept { return faces_[static_cast<std::size_t>(f)]; }
  [[nodiscard]] const std::vector<Vector3<>>& vertices() const noexcept { return vertices_; }
  [[nodiscard]] double extent() const noexcept { return extent_; }  ///< diagonal of the bounding box, m

  /// Return the largest absolute coordinate [m], the reference for rounding errors.
  [[nodiscard]] double max_coordinate() const noexcept { return max_coordinate_; }

  /// Return the angle-weighted pseudonormal at vertex `v`, unit. Its sign decides between inside
  /// and outside where the vertex is the nearest point (Baerentzen and Aanaes 2005).
  [[nodiscard]] const Vector3<>& vertex_normal(std::int32_t v) const noexcept { return vertex_normals_[static_cast<std::size_t>(v)]; }

  /// Call visit(face, corner) for every face around corner `k` of face `f`, starting with `f`.
  template <class Visit>
  void for_each_face_around(std::int32_t f, int k, Visit visit) const noexcept {
    const std::int32_t start = 3 * f + k;
    std::int32_t h = start;
    do {  // counterclockwise; if a border ends the loop, clockwise from the start
      visit(h / 3, static_cast<int>(h % 3));
      h = face(h / 3).neighbor[static_cast<std::size_t>((h % 3 + 2) % 3)];
    } while (h >= 0 && h != start);
    if (h >= 0) return;
    h = face(f).neighbor[static_cast<std::size_t>(k)];
    while (h >= 0) {
      const int corner = static_cast<int>(h % 3 + 1) % 3;
      visit(h / 3, corner);
      h = face(h / 3).neighbor[static_cast<std::size_t>(corner)];
    }
  }

  /// Set vertex `v` to `position` [m]. Dependent data becomes stale; use MeshUpdater to update it.
  void set_vertex(std::int32_t v, const Vector3<>& position) noexcept { vertices_[static_cast<std::size_t>(v)] = position; }

  /// Return whether face `f` has a nonzero area at the current vertex positions.
  [[nodiscard]] bool can_update_face(std::int32_t f) const noexcept {
    Face next = face(f);
    return compute_face(next);
  }

  /// Update corners and normal of face `f` from its vertices. Return false, with the face
  /// unchanged, if its area would vanish.
  bool update_face(std::int32_t f) noexcept {
    Face next = face(f);
    if (!compute_face(next)) return false;
    faces_[static_cast<std::size_t>(f)] = next;
    return true;
  }

  /// Update the pseudonormal at vertex `v` from its adjacent faces [first, last).
  void update_vertex_normal(std::int32_t v, const std::int32_t* first, const std::int32_t* last) noexcept {
    Vector3<> sum = Vector3<>::Zero();
    for (; first != last; ++first) {
      const Face& f = face(*first);
      for (std::size_t i = 0; i < 3; ++i)
        if (f.vertex[i] == v) sum += angle_weighted_normal(f, i);
    }
    const double length = sum.norm();
    if (length > 0.0) vertex_normals_[static_cast<std::size_t>(v)] = sum / length;
  }

  /// Return the normal of face `f` times its angle at corner `i` [rad].
  [[nodiscard]] static Vector3<> angle_weighted_normal(const Face& f, std::size_t i) noexcept {
    const Vector3<> a = f.corner[(i + 1) % 3] - f.corner[i], b = f.corner[(i + 2) % 3] - f.corner[i];
    return std::atan2(a.cross(b).norm(), a.dot(b)) * f.normal;
  }

 private:
  bool check_input(const std::vector<Triangle>& triangles) {
    diagnosis_.empty = triangles.empty() || vertices_.empty();
    diagnosis_.too_large = triangles.size() > (std::size_t{1} << 29) || vertices_.size() > (std::size_t{1} << 30);
    for (std::size_t v = 0; v < vertices_.size(); ++v)
      if (!vertices_[v].allFinite()) diagnosis_.not_finite.add(static_cast<std::int64_t>(v));
    const auto count = static_cast<std::int64_t>(vertices_.size());
    for (std::size_t f = 0; f < triangles.size(); ++f)
      for (const std::int32_t v : triangles[f])
        if (v < 0 || v >= count) {
          diagnosis_.index_out_of_range.add(static_cast<std::int64_t>(f));
          break;
        }
    const MeshFault f = diagnosis_.fault();
    return f == MeshFault::none;
  }

  /// Find the twin of each half-edge. Bucket sort by the lower vertex, linear time.
  void build_adjacency() {
    const std::size_t count = faces_.size() * 3;
    const auto ends = [this](std::int32_t h) {
      const Triangle& t = faces_[static_cast<std::size_t>(h / 3)].vertex;
      return std::pair{t[static_cast<std::size_t>(h % 3)], t[static_cast<std::size_t>((h + 1) % 3)]};
    };
    std::vector<std::int32_t> begin(vertices_.size() + 1, 0);
    for (std::size_t h = 0; h < count; ++h) {
      const auto [a, b] = ends(static_cast<std::int32_t>(h));
      ++begin[static_cast<std::size_t>(std::min(a, b)) + 1];
    }
    std::partial_sum(begin.begin(), begin.end(), begin.begin());
    struct Entry {
      std::int32_t upper, half;
      bool operator<(const Entry& o) const { return upper != o.upper ? upper < o.upper : half < o.half; }
    };
    std::vector<Entry> entries(count);
    std::vector<std::int32_t> next(begin.begin(), begin.end() - 1);
    for (std::size_t h = 0; h < count; ++h) {
      const auto [a, b] = ends(static_cast<std::int32_t>(h));
      entries[static_cast<std::size_t>(next[static_cast<std::size_t>(std::min(a, b))]++)] = {std::max(a, b), static_cast<std::int32_t>(h)};
    }
    for (Face& f : faces_) f.neighbor = {none, none, none};
    for (std::size_t v = 0; v < vertices_.size(); ++v) {
      const auto first = entries.begin() + begin[v], last = entries.begin() + begin[v + 1];
      std::sort(first, last);
      for (auto e = first; e != last;) {
        auto after = e + 1;
        while (after != last && after->upper == e->upper) ++after;
        connect_half_edges(e, after, ends);
        e = after;
      }
    }
  }

  template <class Iterator, class Ends>
  void connect_half_edges(Iterator e, Iterator after, const Ends& ends) {
    const auto face_of = [](std::int32_t h) { return static_cast<std::int64_t>(h / 3); };
    if (after - e == 1) {
      diagnosis_.open.add(face_of(e->half));
    } else if (after - e == 2) {
      const std::int32_t one = e->half, two = (e + 1)->half;
      if (ends(one).first == ends(two).first) {
        diagnosis_.mixed_winding.add(face_of(two));
      } else if (same_corners(one / 3, two / 3)) {
        return;  // two sides of one triangle are not neighbors; counted as a duplicate below
      }
      twin(one) = two;
      twin(two) = one;
    } else {
      diagnosis_.non_manifold.add(face_of((after - 1)->half));
    }
    for (auto one = e; one != after; ++one)
      for (auto two = e; two != one; ++two)
        if (same_corners(one->half / 3, two->half / 3) && is_lowest_edge(one->half)) diagnosis_.duplicate.add(face_of(one->half));
  }

  std::int32_t& twin(std::int32_t h) { return faces_[static_cast<std::size_t>(h / 3)].neighbor[static_cast<std::size_t>(h % 3)]; }

  [[nodiscard]] bool same_corners(std::int32_t f, std::int32_t g) const {
    Triangle a = face(f).vertex, b = face(g).vertex;
    std::sort(a.begin(), a.end());
    std::sort(b.begin(), b.end());
    return f != g && a == b;
  }

  /// Return whether `h` joins the two lowest vertices of its triangle. A pair of equal triangles is
  /// counted on this edge only.
  [[nodiscard]] bool is_lowest_edge(std::int32_t h) const {
    const Triangle& t = face(h / 3).vertex;
    return t[static_cast<std::size_t>((h + 2) % 3)] == std::max({t[0], t[1], t[2]});
  }

  /// Compute corners and normal from the vertices. Return false if the area vanishes to rounding.
  bool compute_face(Face& f) const noexcept {
    for (std::size_t i = 0; i < 3; ++i) f.corner[i] = vertices_[static_cast<std::size_t>(f.vertex[i])];
    const Vector3<> e0 = f.corner[1] - f.corner[0], e1 = f.corner[2] - f.corner[1], e2 = f.corner[0] - f.corner[2];
    // Cross product of the two shorter edges: the longest edge has the largest rounding error.
    const double l0 = e0.squaredNorm(), l1 = e1.squaredNorm(), l2 = e2.squaredNorm();
    Vector3<> n = l0 >= l1 && l0 >= l2 ? e1.cross(e2) : (l1 >= l2 ? e2.cross(e0) : e0.cross(e1));
    const double longest = std::sqrt(std::max({l0, l1, l2}));
    const double scale = longest > 0.0 ? 1.0 / longest : 0.0;
    n *= scale;  // twice the area over the longest edge: the height of the triangle
    const double height = n.norm();
    if (!(height > 1e-12 * longest) || !(height > 1e-13 * max_coordinate_)) return false;
    f.normal = n / height;
    return true;
  }

  void compute_geometry() {
    Vector3<> low = vertices_[0], high = vertices_[0];
    for (const Face& f : faces_)
      for (const std::int32_t v : f.vertex) {
        low = low.cwiseMin(vertices_[static_cast<std::size_t>(v)]);
        high = high.cwiseMax(vertices_[static_cast<std::size_t>(v)]);
      }
    extent_ = (high - low).norm();
    max_coordinate_ = std::max(low.cwiseAbs().maxCoeff(), high.cwiseAbs().maxCoeff());
    const Vector3<> center = 0.5 * (low + high);
    for (std::size_t i = 0; i < faces_.size(); ++i) {
      Face& f = faces_[i];
      f.normal.setZero();
      if (!compute_face(f)) diagnosis_.degenerate.add(static_cast<std::int64_t>(i));
      diagnosis_.volume += (f.corner[0] - center).dot((f.corner[1] - center).cross(f.corner[2] - center)) / 6.0;
    }
    compute_vertex_normals();
  }

  void compute_vertex_normals() {
    vertex_normals_.assign(vertices_.size(), Vector3<>::Zero());
    for (const Face& f : faces_)
      for (std::size_t i = 0; i < 3; ++i) vertex_normals_[static_cast<std::size_t>(f.vertex[i])] += angle_weighted_normal(f, i);
    for (Vector3<>& n : vertex_normals_) {
      const double length = n.norm();
      if (length > 0.0) n /= length;
    }
  }

  void count_components() {
    std::vector<bool> visited(faces_.size(), false);
    std::vector<std::int32_t> open;
    for (std::int32_t start = 0; start < size(); ++start) {
      if (visited[static_cast<std::size_t>(start)]) continue;
      ++diagnosis_.components;
      visited[static_cast<std::size_t>(start)] = true;
      open.push_back(start);
      while (!open.empty()) {
        const std::int32_t f = open.back();
        open.pop_back();
        for (const std::int32_t h : face(f).neighbor)
          if (h >= 0 && !visited[static_cast<std::size_t>(h / 3)]) {
            visited[static_cast<std::size_t>(h / 3)] = true;
            open.push_back(h / 3);
          }
      }
    }
  }

  std::vector<Vector3<>> vertices_;  // m
  std::vector<Face> faces_;
  std::vector<Vector3<>> vertex_normals_;  // unit
  MeshDiagnosis diagnosis_;
  double extent_ = 0.0;
  double max_coordinate_ = 0.0;
  bool allow_open_ = false;
};

}  // namespace palpate::mesh
