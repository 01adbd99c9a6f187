#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <utility>
#include <vector>

#include "palpate/deformable/contact/block_matrix.hpp"
#include "palpate/deformable/hyperelastic/layered_surface.hpp"
#include "palpate/deformable/multirate/local_model.hpp"
#include "palpate/math/vector.hpp"

namespace palpate::deformable {

/// Forces of the tips on the surface of a body, through its elastic layer: the negative gradient of one energy by the displacements. For
/// HyperelasticModel::step(). Vectors are those of the model.
class SurfaceContact {
 public:
  SurfaceContact() = default;

  /// @param node_of     node of each mesh point; the first `free` nodes are free
  SurfaceContact(const std::vector<Vector3<>>& points, const LayeredSurface& surface, const std::vector<std::int32_t>& node_of,
                 std::int32_t free)
      : free_(free), rest_(points.size()), force_(3 * at(free)), right_side_(force_), reference_(force_), ahead_(force_) {
    for (std::size_t p = 0; p < points.size(); ++p) rest_[at(node_of[p])] = points[p];
    for (const LayeredSurface::Triangle& triangle : surface.triangles())
      for (std::int32_t& v : triangles_.emplace_back(triangle).vertex) v = node_of[at(v)];
    normals_.resize(triangles_.size());
    cones_.resize(triangles_.size());
    in_tips_.resize(triangles_.size());
    front_.reserve(triangles_.size());
    around_.resize(points.size());
    for (std::size_t f = 0; f < triangles_.size(); ++f)
      for (const std::int32_t v : triangles_[f].vertex) around_[at(v)].push_back(f);
  }

  /// Evaluate the surface normals at a displacement. They stay until the next call.
  void update_normals(const double* displacement) noexcept {
    for (std::size_t f = 0; f < triangles_.size(); ++f) {
      const auto& t = triangles_[f].vertex;
      const Vector3<> a = position(t[0], displacement);
      normals_[f] = (position(t[1], displacement) - a).cross(position(t[2], displacement) - a).normalized();
    }
  }
  [[nodiscard]] const Vector3<>& normal(std::int32_t triangle) const noexcept { return normals_[at(triangle)]; }

  void set_tips(const TipPair& tips) noexcept {
    tips_ = tips;
    for (std::size_t t = 0; t < TipPair::max_tips; ++t) tips_.tip[t].continued = continued_[t];
  }
  /// Whether a cone continues each sphere anywhere, see Tip.
  [[nodiscard]] const std::array<bool, TipPair::max_tips>& continued() const noexcept { return continued_; }
  /// Triangles around a node, ascending.
  [[nodiscard]] const std::vector<std::size_t>& triangles_around(std::int32_t node) const noexcept { return around_[at(node)]; }
  /// Bit t: the cone of tip t presses a triangle.
  [[nodiscard]] std::uint8_t cones(std::int32_t triangle) const noexcept { return cones_[at(triangle)]; }
  /// Select the triangles that the cones of `tips` press from the next set_tips() on, at a displacement of the surface. A triangle in
  /// sphere or cone is selected if such triangles connect it to one with a point in the sphere. So are their neighbors, which may follow
  /// until the next call, but no walls (is_wall()).
  void update_cones(const TipPair& tips, const double* displacement) noexcept {
    continued_.fill(false);
    std::fill(cones_.begin(), cones_.end(), std::uint8_t{0});
    for (std::size_t t = 0; t < at(tips.count); ++t) {
      const Tip& tip = tips.tip[t];
      if (tip.kind != Tip::Kind::sphere) continue;
      const double top = find_in_tip(tip, displacement);
      const auto bit = static_cast<std::uint8_t>(1U << t);
      front_.clear();
      for (std::size_t f = 0; f < triangles_.size(); ++f)
        if (in_tips_[f] == Reach::sphere) mark(f, bit);
      continued_[t] = !front_.empty();
      const auto follows = [&](std::size_t f) { return (cones_[f] & bit) == 0 && !is_wall(f, tip, top); };
      for (std::size_t k = 0; k < front_.size(); ++k)
        for_each_neighbor(front_[k], [&](std::size_t f) {
          if (in_tips_[f] != Reach::none && follows(f)) mark(f, bit);
        });
      for (const std::size_t marked : front_)
        for_each_neighbor(marked, [&](std::size_t f) {
          if (follows(f)) cones_[f] |= bit;
        });
    }
  }
  /// Return to tips that press nothing.
  void reset() noexcept {
    continued_.fill(false);
    std::fill(cones_.begin(), cones_.end(), std::uint8_t{0});
    tips_ = {};
  }

  /// Displacement from the given one [m] at which linearize() takes forces and stiffness; entry 3 x free node + axis. Set to zero first.
  [[nodiscard]] std::vector<double>& ahead() noexcept { return ahead_; }

  /// Evaluate the forces at a displacement, and the linear forces of a Newton step from there.
  void linearize(const double* displacement) noexcept {
    evaluate(displacement, nullptr);
    force_norm_ = 0.0;
    std::fill(force_.begin(), force_.end(), 0.0);
    for (const Pressed& p : pressed_) add_force(p, p.contact.force, force_);
    for (const double f : force_) force_norm_ += f * f;
    force_norm_ = std::sqrt(force_norm_);
    if (std::none_of(ahead_.begin(), ahead_.end(), [](double a) { return a != 0.0; })) {
      right_side_ = reference_ = force_;
      return;
    }
    evaluate(displacement, ahead_.data());
    std::fill(right_side_.begin(), right_side_.end(), 0.0);
    std::fill(reference_.begin(), reference_.end(), 0.0);
    for (const Pressed& p : pressed_) {
      Vector3<> moved = Vector3<>::Zero();
      for (std::size_t c = 0; c < 3; ++c)
        if (const std::int32_t v = triangles_[p.triangle].vertex[c]; v < free_)
          moved += p.weight[c] * Eigen::Map<const Vector3<>>(ahead_.data() + 3 * at(v));
      add_force(p, p.contact.force, reference_);
      add_force(p, p.contact.force + p.contact.stiffness * p.contact.away.dot(moved) * p.contact.away, right_side_);
    }
  }

  /// Part of the forces at the linearization that act on triangles of a set (whether each triangle is in it).
  [[nodiscard]] double part_on(const std::vector<bool>& set) const noexcept {
    double on = 0.0, total = 0.0;
    for (const Pressed& p : pressed_) {
      total += p.contact.force.norm();
      if (set[p.triangle]) on += p.contact.force.norm();
    }
    return total > 0.0 ? on / total : 0.0;
  }

  /// Forces on the free nodes at the displacement of linearize(), N.
  [[nodiscard]] const double* force() const noexcept { return force_.data(); }
  [[nodiscard]] double force_norm() const noexcept { return force_norm_; }
  /// Forces of the linearization, extrapolated back to that displacement, N.
  [[nodiscard]] const double* right_side() const noexcept { return right_side_.data(); }

  /// Forces at the linearization, N.
  [[nodiscard]] const double* reference() const noexcept { return reference_.data(); }

  /// Add the stiffness of the linearization, N/m.
  void add_stiffness(BlockMatrix& tangent) const noexcept {
    for (const Pressed& p : pressed_) {
      const auto& vertex = triangles_[p.triangle].vertex;
      const auto& weight = p.weight;
      for (std::size_t a = 0; a < 3; ++a)
        for (std::size_t b = 0; b < 3; ++b) {
          if (vertex[a] > vertex[b] || vertex[b] >= free_ || weight[a] * weight[b] == 0.0) continue;
          float* block = tangent.block(tangent.block_index(vertex[a], vertex[b]));
          const double k = p.contact.stiffness * weight[a] * weight[b];
          for (int i = 0; i < 3; ++i)
            for (int j = 0; j < 3; ++j) block[3 * i + j] += static_cast<float>(k * p.contact.away[i] * p.contact.away[j]);
        }
    }
  }

  /// Energy of the layer at a displacement, J.
  [[nodiscard]] double energy(const double* displacement) const noexcept {
    double sum = 0.0;
    for_each_contact(displacement, nullptr, [&sum](const Pressed& p) { sum += p.contact.energy; });
    return sum;
  }

 private:
  struct Pressed {
    std::size_t triangle;
    std::array<double, 3> weight;  // of the vertices
    PointContact<double> contact;
  };

  [[nodiscard]] static std::size_t at(std::int32_t i) noexcept { return static_cast<std::size_t>(i); }

  [[nodiscard]] Vector3<> position(std::int32_t node, const double* displacement) const noexcept {
    return rest_[at(node)] + Eigen::Map<const Vector3<>>(displacement + 3 * at(node));
  }

  enum class Reach : std::uint8_t { none, cone, sphere };

  /// Find which triangles have a point in a sphere or its cone. Return the largest height at rest, along `outward`, of the points in the
  /// sphere [m].
  double find_in_tip(const Tip& sphere, const double* displacement) noexcept {
    Tip tip = sphere;
    tip.continued = true;
    double top = -std::numeric_limits<double>::infinity();
    for (std::size_t f = 0; f < triangles_.size(); ++f) {
      const LayeredSurface::Triangle& triangle = triangles_[f];
      std::array<Vector3<>, 3> corner;
      std::array<double, 3> height{};
      for (std::size_t c = 0; c < 3; ++c) {
        corner[c] = position(triangle.vertex[c], displacement) - tip.center;
        height[c] = rest_[at(triangle.vertex[c])].dot(tip.outward);
      }
      in_tips_[f] = Reach::none;
      for (std::size_t c = 0; c < 3; ++c) {
        if (!triangle.corner[c].exists()) continue;
        const std::size_t next = (c + 1) % 3, last = (c + 2) % 3;
        for (const CornerPoint& q : corner_points) {
          const Vector3<> y = q.own * corner[c] + q.next * corner[next] + q.last * corner[last];
          if (y.squaredNorm() < tip.radius * tip.radius) {
            in_tips_[f] = Reach::sphere;
            top = std::max(top, q.own * height[c] + q.next * height[next] + q.last * height[last]);
          } else if (in_tips_[f] == Reach::none && depth_in_sphere<double>(tip, y, y).depth > 0.0) {
            in_tips_[f] = Reach::cone;
          }
        }
      }
    }
    return top;
  }
  /// Whether a triangle is steep at rest and rises there above what the sphere presses, whose largest height is `top` [m]. A sphere passes
  /// beside it, and the cone above would not.
  [[nodiscard]] bool is_wall(std::size_t triangle, const Tip& tip, double top) const noexcept {
    const auto& v = triangles_[triangle].vertex;
    const Vector3<>&a = rest_[at(v[0])], &b = rest_[at(v[1])], &c = rest_[at(v[2])];
    const double highest = std::max({a.dot(tip.outward), b.dot(tip.outward), c.dot(tip.outward)});
    return highest > top + 0.1 * tip.radius && (b - a).cross(c - a).normalized().dot(tip.outward) < 0.5;
  }
  template <class Visit>
  void for_each_neighbor(std::size_t triangle, Visit visit) const noexcept {
    for (const std::int32_t v : triangles_[triangle].vertex)
      for (const std::size_t f : triangles_around(v)) visit(f);
  }
  void mark(std::size_t triangle, std::uint8_t bit) noexcept {
    cones_[triangle] |= bit;
    front_.push_back(triangle);  // within the reserved capacity
  }

  /// Call visit(Pressed) for the points in contact.
  template <class Visit>
  void for_each_contact(const double* displacement, const double* ahead, Visit visit) const noexcept {
    for (std::size_t f = 0; f < triangles_.size(); ++f) {
      std::array<Vector3<>, 3> corner;
      for (std::size_t c = 0; c < 3; ++c) {
        const std::int32_t v = triangles_[f].vertex[c];
        corner[c] = position(v, displacement);
        if (ahead != nullptr && v < free_) corner[c] += Eigen::Map<const Vector3<>>(ahead + 3 * at(v));
      }
      const Vector3<> center = (corner[0] + corner[1] + corner[2]) / 3.0;
      double reach = 0.0;
      for (const Vector3<>& x : corner) reach = std::max(reach, (x - center).norm());
      for (std::size_t t = 0; t < at(tips_.count); ++t) {
        const Tip& tip = tips_.tip[t];
        const Vector3<> y = center - tip.center;
        if ((tip.kind == Tip::Kind::flat ? y.dot(tip.outward) : depth_in_sphere<double>(tip, y, y).depth) <= -reach) continue;
        for (std::size_t c = 0; c < 3; ++c) {
          const LayerCorner& layer = triangles_[f].corner[c];
          if (!layer.exists()) continue;
          for (const CornerPoint& q : corner_points) {
            Pressed pressed{.triangle = f, .weight = {}, .contact = {}};
            pressed.weight[c] = q.own;
            pressed.weight[(c + 1) % 3] = q.next;
            pressed.weight[(c + 2) % 3] = q.last;
            const Vector3<> x = pressed.weight[0] * corner[0] + pressed.weight[1] * corner[1] + pressed.weight[2] * corner[2];
            LayerPoint<double> point = layer.point(tip.kind, q.share);
            if (((cones_[f] >> t) & 1) == 0) point.cone = no_cone;
            pressed.contact = press_point<double>(tip, x - tip.center, normals_[f], point);
            if (pressed.contact.stiffness > 0.0) visit(pressed);
          }
        }
      }
    }
  }

  /// Find the points in contact.
  void evaluate(const double* displacement, const double* ahead) noexcept {
    pressed_.clear();
    for_each_contact(displacement, ahead, [this](const Pressed& p) { pressed_.push_back(p); });
  }

  void add_force(const Pressed& p, const Vector3<>& force, std::vector<double>& to) const noexcept {
    for (std::size_t c = 0; c < 3; ++c)
      if (const std::int32_t v = triangles_[p.triangle].vertex[c]; v < free_)
        Eigen::Map<Vector3<>>(to.data() + 3 * at(v)) += p.weight[c] * force;
  }

  std::int32_t free_ = 0;
  std::vector<Vector3<>> rest_;                         // by node, m
  std::vector<LayeredSurface::Triangle> triangles_;     // vertices are nodes
  std::vector<Vector3<>> normals_;                      // by triangle
  std::vector<Pressed> pressed_;                        // of the linearization
  std::vector<double> force_, right_side_, reference_;  // N
  std::vector<double> ahead_;                           // m
  double force_norm_ = 0.0;                             // N
  TipPair tips_;
  std::array<bool, TipPair::max_tips> continued_{};
  std::vector<std::vector<std::size_t>> around_;  // by node: its triangles
  std::vector<std::uint8_t> cones_;               // by triangle, bits of the tips
  std::vector<Reach> in_tips_;                    // workspace: by triangle
  std::vector<std::size_t> front_;                // workspace: triangles
};

}  // namespace palpate::deformable
