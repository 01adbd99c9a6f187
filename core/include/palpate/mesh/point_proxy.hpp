#pragma once

#include <Eigen/Geometry>
#include <cmath>
#include <cstdint>
#include <limits>

#include "palpate/mesh/aabb_tree.hpp"
#include "palpate/mesh/friction_cone.hpp"
#include "palpate/mesh/triangle.hpp"
#include "palpate/mesh/triangle_mesh.hpp"

namespace palpate::mesh {

/// Point proxy on a mesh or free.
struct PointProxyState {
  std::int32_t face = TriangleMesh::none;  ///< none: free
  Feature feature = Feature::inside;
  Vector3<> point = Vector3<>::Zero();   ///< m
  Vector3<> normal = Vector3<>::Zero();  ///< unit contact normal towards the free side; zero if free
  double side = 1.0;                     ///< -1: on the back of an open mesh

  [[nodiscard]] bool touching() const noexcept { return face != TriangleMesh::none; }
};

/// Motion of a point proxy (god-object): from its position over the surface to the nearest
/// reachable point to the tip.
///
/// Each step follows one face, edge or free segment and reduces the distance to the tip, so the
/// motion cannot cycle. Adjacency provides the neighbors, so the cost is independent of the mesh
/// size.
///
/// Around a point of the surface the mesh is a cone of faces. The point of that cone nearest to the
/// tip gives the sliding direction. The pseudonormal there (Baerentzen and Aanaes 2005) decides
/// whether the tip is outside, i.e. whether the proxy leaves the surface.
///
/// Keeps references to mesh and tree, which must outlive it.
class PointProxy {
 public:
  static constexpr int max_steps = 512;

  /// A mesh that is not usable() needs the empty tree that AabbTree builds for it.
  PointProxy(const TriangleMesh& mesh, const AabbTree& tree) noexcept
      : mesh_(&mesh), tree_(&tree), one_sided_(mesh.closed()), rounding_(1e-14 * mesh.max_coordinate()) {}
  PointProxy(const TriangleMesh&& mesh, const AabbTree& tree) = delete;
  PointProxy(const TriangleMesh& mesh, const AabbTree&& tree) = delete;
  PointProxy(const TriangleMesh&& mesh, const AabbTree&& tree) = delete;

  /// Return the initial state: at the tip, or on the nearest surface point if the tip is inside a
  /// closed mesh. Without a nearest face (empty tree, invalid tip) the proxy is free.
  [[nodiscard]] PointProxyState start(const Vector3<>& tip) const noexcept {
    PointProxyState state;
    state.point = tip;
    if (!one_sided_) return state;
    const AabbTree::Nearest near = tree_->nearest(*mesh_, tip);
    if (!near.found()) return state;
    const Face& face = mesh_->face(near.face);
    if (pseudonormal(face, near.at.feature).dot(tip - near.at.point) >= 0.0) return state;
    state.face = near.face;
    state.feature = near.at.feature;
    state.point = near.at.point;
    state.normal = face.normal;
    return state;
  }

  /// Update the state after the mesh has moved. A touching proxy moves to the barycentric
  /// coordinates `weights` of its face. A free proxy that is now inside moves to the surface.
  void reattach(PointProxyState& state, const Vector3<>& weights) const noexcept {
    if (!state.touching()) {
      const double side = state.side;
      state = start(state.point);
      if (!state.touching()) state.side = side;
      return;
    }
    const Face& face = mesh_->face(state.face);
    state.point = weights[0] * face.corner[0] + weights[1] * face.corner[1] + weights[2] * face.corner[2];
    state.normal = state.side * face.normal;
  }

  /// Move `state` towards `tip` [m]. Return false if max_steps was reached; the next call
  /// continues.
  ///
  /// cone(face, point) returns the FrictionCone there. `slip` accumulates the sliding distance.
  template <class Cone>
  bool follow(PointProxyState& state, const Vector3<>& tip, const Cone& cone, SlidingState& slip) const noexcept {
    slip.threshold = min_slip_ratio * (tip - state.point).norm();
    bool done = false;
    for (int step = 0; step < max_steps && !done; ++step) {
      if (!state.touching()) {
        done = move_free(state, tip, TriangleMesh::none, Feature::inside);
      } else if (state.feature == Feature::inside) {
        done = step_from_face(state, tip, cone, slip);
      } else if (is_edge(state.feature)) {
        done = step_from_edge(state, tip, cone, slip);
      } else {
        done = step_from_corner(state, tip, cone, slip);
      }
    }
    return done;
  }

  /// Return the pseudonormal at a feature, not normalized. Its sign decides between inside and
  /// outside.
  [[nodiscard]] Vector3<> pseudonormal(const Face& face, Feature feature) const noexcept {
    if (is_corner(feature)) return mesh_->vertex_normal(face.vertex[static_cast<std::size_t>(index_of(feature))]);
    if (is_edge(feature)) {
      const std::int32_t h = face.neighbor[static_cast<std::size_t>(index_of(feature))];
      return h < 0 ? face.normal : Vector3<>(face.normal + mesh_->face(h / 3).normal);
    }
    return face.normal;
  }

 private:
  static constexpr double min_slip_ratio = 1e-9;     // of the tip distance: minimum sliding distance
  static constexpr double corner_tolerance = 1e-12;  // of the edge length: snap distance to its ends

  /// Move straight to the tip, ignoring the faces around the origin; stop at the first face hit.
  /// Return true if the tip was reached.
  bool move_free(PointProxyState& state, const Vector3<>& tip, std::int32_t origin_face, Feature origin_feature) const noexcept {
    const Vector3<> from = state.point, motion = tip - from;
    std::int32_t neighbor_face = TriangleMesh::none, origin_vertex = TriangleMesh::none;
    if (origin_face != TriangleMesh::none) {
      const Face& face = mesh_->face(origin_face);
      if (is_edge(origin_feature)) {
        const std::int32_t h = face.neighbor[static_cast<std::size_t>(index_of(origin_feature))];
        neighbor_face = h < 0 ? TriangleMesh::none : h / 3;
      } else if (is_corner(origin_feature)) {
        origin_vertex = face.vertex[static_cast<std::size_t>(index_of(origin_feature))];
      }
    }
    const double previous_side = state.side;
    std::int32_t hit = TriangleMesh::none;
    double hit_side = 1.0;
    tree_->sweep_sphere(from, motion, rounding_, [&](std::int32_t f, double& end) {
      if (f == origin_face || f == neighbor_face) return;
      const Face& face = mesh_->face(f);
      if (origin_vertex != TriangleMesh::none &&
          (face.vertex[0] == origin_vertex || face.vertex[1] == origin_vertex || face.vertex[2] == origin_vertex))
        return;
      double before = face.height(from), after = face.height(tip);
      double side = 1.0;
      if (!one_sided_) {
        side = before > rounding_ ? 1.0 : (before < -rounding_ ? -1.0 : previous_side);
        before *= side;
        after *= side;
      }
      if (!(after < 0.0) || before < -rounding_ || before <= after) return;
      const double t = before > 0.0 ? before / (before - after) : 0.0;
      if (t > end || (t == end && hit != TriangleMesh::none) || !line_intersects(face, from, motion)) return;
      end = t;
      hit = f;
      hit_side = side;
    });
    if (hit == TriangleMesh::none) {
      state = PointProxyState{};
      state.point = tip;
      state.side = previous_side;
      return true;
    }
    const Face& face = mesh_->face(hit);
    const double before = face.height(from), after = face.height(tip);
    const double t = std::fmin(std::fmax(before / (before - after), 0.0), 1.0);
    state.point = from + t * motion;
    state.point -= face.height(state.point) * face.normal;
    state.face = hit;
    state.feature = Feature::inside;
    state.side = hit_side;
    state.normal = hit_side * face.normal;
    return false;
  }

  bool leave_surface(PointProxyState& state, const Vector3<>& tip) const noexcept {
    return move_free(state, tip, state.face, state.feature);
  }

  template <class Cone>
  bool step_from_face(PointProxyState& state, const Vector3<>& tip, const Cone& cone, SlidingState& slip) const noexcept {
    const Face& face = mesh_->face(state.face);
    const double height = face.height(tip);
    if (state.side * height >= 0.0) return leave_surface(state, tip);
    return slide_on_face(state, face, tip, height, cone, slip);
  }

  /// Slide over one face. Return true if the proxy comes to rest on it.
  template <class Cone>
  bool slide_on_face(PointProxyState& state, const Face& face, const Vector3<>& tip, double height, const Cone& cone,
                     SlidingState& slip) const noexcept {
    state.normal = state.side * face.normal;
    const Vector3<> lag_vector = tip - height * face.normal - state.point;
    const double lag = lag_vector.norm();
    const FrictionCone friction = cone(state.face, state.point);
    const double remaining = friction.remaining_lag(lag, std::fabs(height), slip.distance, slip.sliding());
    if (!(lag - remaining > 1e-15 * (lag + std::fabs(height)))) return true;
    const Vector3<> motion = (1.0 - remaining / lag) * lag_vector;
    const auto [exit_edge, fraction] = first_exit(face, state.point, motion, [&state](int i) {
      return state.feature == edge(i) || state.feature == corner(i) || state.feature == corner((i + 1) % 3);
    });
    if (exit_edge < 0) {
      state.point += motion;
      state.point -= face.height(state.point) * face.normal;
      state.feature = Feature::inside;
      slip.distance += lag - remaining;
      return true;
    }
    slip.distance += fraction * (lag - remaining);
    snap_to_edge(state, face, exit_edge, state.point + fraction * motion);
    return false;
  }

  /// Move the state to an edge of its face, or to a corner if the point is close to one.
  static void snap_to_edge(PointProxyState& state, const Face& face, int i, const Vector3<>& x) noexcept {
    const int j = (i + 1) % 3;
    const Vector3<>& a = face.corner[static_cast<std::size_t>(i)];
    const Vector3<> e = face.corner[static_cast<std::size_t>(j)] - a;
    const double u = (x - a).dot(e) / e.squaredNorm();
    if (u <= corner_tolerance) {
      state.point = a;
      state.feature = corner(i);
    } else if (u >= 1.0 - corner_tolerance) {
      state.point = face.corner[static_cast<std::size_t>(j)];
      state.feature = corner(j);
    } else {
      state.point = a + u * e;
      state.feature = edge(i);
    }
  }

  template <class Cone>
  bool step_from_edge(PointProxyState& state, const Vector3<>& tip, const Cone& cone, SlidingState& slip) const noexcept {
    const int i = index_of(state.feature);
    const Face& one = mesh_->face(state.face);
    const Vector3<> along = one.corner[static_cast<std::size_t>((i + 1) % 3)] - one.corner[static_cast<std::size_t>(i)];
    const Vector3<> d = tip - state.point;
    const double height = one.height(tip);
    const bool into_one = one.normal.cross(along).dot(d) > 0.0;
    const std::int32_t twin = one.neighbor[static_cast<std::size_t>(i)];
    if (twin < 0) {  // border: free beyond it
      if (!into_one || state.side * height >= 0.0) return leave_surface(state, tip);
      return slide_on_face(state, one, tip, height, cone, slip);
    }
    const Face& two = mesh_->face(twin / 3);
    const double other = two.height(tip);
    const bool into_two = two.normal.cross(along).dot(d) < 0.0;
    if (into_one && !(into_two && std::fabs(other) < std::fabs(height))) {
      if (state.side * height >= 0.0) return leave_surface(state, tip);
      return slide_on_face(state, one, tip, height, cone, slip);
    }
    if (into_two) {
      if (state.side * other >= 0.0) return leave_surface(state, tip);
      state.face = twin / 3;
      state.feature = edge(twin % 3);
      return slide_on_face(state, two, tip, other, cone, slip);
    }
    // Both faces push towards the edge: a valley, or the tip is beyond a ridge.
    const double length2 = along.squaredNorm();
    const Vector3<> down = d - d.dot(along) / length2 * along;
    if (state.side * (one.normal + two.normal).dot(down) >= 0.0) return leave_surface(state, tip);
    return slide_on_edge(state, one, i, d, down, cone, slip);
  }

  /// Slide along edge `i` of the face. Return true if the proxy comes to rest on it.
  template <class Cone>
  bool slide_on_edge(PointProxyState& state, const Face& face, int i, const Vector3<>& d, const Vector3<>& down, const Cone& cone,
                     SlidingState& slip) const noexcept {
    const int j = (i + 1) % 3;
    const Vector3<>& a = face.corner[static_cast<std::size_t>(i)];
    const Vector3<> e = face.corner[static_cast<std::size_t>(j)] - a;
    const double length = e.norm(), depth = down.norm();
    const double signed_lag = d.dot(e) / length, lag = std::fabs(signed_lag);
    if (depth > 0.0) state.normal = down / -depth;
    const double remaining = cone(state.face, state.point).remaining_lag(lag, depth, slip.distance, slip.sliding());
    if (!(lag - remaining > 1e-15 * (lag + depth))) return true;
    const double motion = std::copysign(lag - remaining, signed_lag);
    const double from = (state.point - a).dot(e) / length, to = from + motion;
    if (to > corner_tolerance * length && to < (1.0 - corner_tolerance) * length) {
      state.point = a + to / length * e;
      state.feature = edge(i);
      slip.distance += lag - remaining;
      return true;
    }
    const int end = motion > 0.0 ? j : i;
    slip.distance += std::fabs(motion > 0.0 ? length - from : from);
    state.point = face.corner[static_cast<std::size_t>(end)];
    state.feature = corner(end);
    return to >= 0.0 && to <= length;
  }

  template <class Cone>
  bool step_from_corner(PointProxyState& state, const Vector3<>& tip, const Cone& cone, SlidingState& slip) const noexcept {
    const int k = index_of(state.feature);
    const std::int32_t vertex = mesh_->face(state.face).vertex[static_cast<std::size_t>(k)];
    const Vector3<> d = tip - state.point;
    Candidate best{d.norm()};
    bool open = false;
    mesh_->for_each_face_around(state.face, k, [&](std::int32_t f, int c) {
      const Face& face = mesh_->face(f);
      consider_candidate(best, face, f, c, tip, d);
      const int last = (c + 2) % 3;
      if (face.neighbor[static_cast<std::size_t>(last)] >= 0) return;
      open = true;
      consider_edge(best, face, f, last, d, -1.0);
    });
    if (best.face == TriangleMesh::none) {  // the corner itself is nearest
      if (open || state.side * mesh_->vertex_normal(vertex).dot(d) >= 0.0) return leave_surface(state, tip);
      const double depth = d.norm();
      if (depth > 0.0) state.normal = d / -depth;
      return true;
    }
    const Face& face = mesh_->face(best.face);
    if (best.feature == Feature::inside) {
      const double height = face.height(tip);
      if (state.side * height >= 0.0) return leave_surface(state, tip);
      state.face = best.face;
      state.feature = corner(best.corner);
      return slide_from_corner(state, face, best.corner, tip, height, cone, slip);
    }
    const int i = index_of(best.feature);
    const std::int32_t twin = face.neighbor[static_cast<std::size_t>(i)];
    const Vector3<> e = face.corner[static_cast<std::size_t>((i + 1) % 3)] - face.corner[static_cast<std::size_t>(i)];
    const Vector3<> down = d - d.dot(e) / e.squaredNorm() * e;
    if (twin < 0 || state.side * (face.normal + mesh_->face(twin / 3).normal).dot(down) >= 0.0) return leave_surface(state, tip);
    state.face = best.face;
    state.feature = best.feature;
    return slide_on_edge(state, face, i, d, down, cone, slip);
  }

  /// Slide from a corner into the face. Only the opposite edge can be crossed.
  template <class Cone>
  bool slide_from_corner(PointProxyState& state, const Face& face, int c, const Vector3<>& tip, double height, const Cone& cone,
                         SlidingState& slip) const noexcept {
    state.normal = state.side * face.normal;
    const Vector3<> lag_vector = tip - height * face.normal - state.point;
    const double lag = lag_vector.norm();
    const double remaining = cone(state.face, state.point).remaining_lag(lag, std::fabs(height), slip.distance, slip.sliding());
    if (!(lag - remaining > 1e-15 * (lag + std::fabs(height)))) return true;
    const Vector3<> motion = (1.0 - remaining / lag) * lag_vector;
    const int i = (c + 1) % 3;
    const Vector3<>& a = face.corner[static_cast<std::size_t>(i)];
    const Vector3<> inward = face.normal.cross(face.corner[static_cast<std::size_t>((i + 1) % 3)] - a);
    const double distance = inward.dot(state.point - a), rate = inward.dot(motion);
    if (distance + rate >= 0.0) {
      state.point += motion;
      state.feature = Feature::inside;
      slip.distance += lag - remaining;
      return true;
    }
    const double fraction = distance / -rate;
    slip.distance += fraction * (lag - remaining);
    snap_to_edge(state, face, i, state.point + fraction * motion);
    return false;
  }

  /// Candidate for the point nearest to the tip on the cone of faces around a corner.
  struct Candidate {
    double distance;  // m
    std::int32_t face = TriangleMesh::none;
    Feature feature = Feature::inside;
    int corner = 0;
  };

  static void consider_candidate(Candidate& best, const Face& face, std::int32_t f, int c, const Vector3<>& tip,
                                 const Vector3<>& d) noexcept {
    const Vector3<>& v = face.corner[static_cast<std::size_t>(c)];
    const Vector3<> first = face.corner[static_cast<std::size_t>((c + 1) % 3)] - v;
    const Vector3<> second = face.corner[static_cast<std::size_t>((c + 2) % 3)] - v;
    if (face.normal.cross(first).dot(d) > 0.0 && second.cross(face.normal).dot(d) > 0.0) {
      const double distance = std::fabs(face.height(tip));
      if (distance < best.distance) best = {distance, f, Feature::inside, c};
    }
    consider_edge(best, face, f, c, d, 1.0);
  }

  static void consider_edge(Candidate& best, const Face& face, std::int32_t f, int i, const Vector3<>& d, double sense) noexcept {
    const Vector3<> e = face.corner[static_cast<std::size_t>((i + 1) % 3)] - face.corner[static_cast<std::size_t>(i)];
    const double along = d.dot(e);
    if (sense * along <= 0.0) return;
    const double distance = (d - along / e.squaredNorm() * e).norm();
    if (distance < best.distance) best = {distance, f, edge(i), 0};
  }

  const TriangleMesh* mesh_;
  const AabbTree* tree_;
  bool one_sided_;
  double rounding_;  // m
};

}  // namespace palpate::mesh
