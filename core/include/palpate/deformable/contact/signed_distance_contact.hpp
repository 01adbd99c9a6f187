#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <limits>
#include <utility>
#include <vector>

#include "palpate/deformable/contact/contact_result.hpp"
#include "palpate/deformable/contact/near_compliance.hpp"
#include "palpate/deformable/contact/near_nodes.hpp"
#include "palpate/deformable/contact/patch_points.hpp"
#include "palpate/deformable/contact/surface_nodes.hpp"
#include "palpate/deformable/contact/tip_geometry.hpp"
#include "palpate/deformable/linear/full_compliance.hpp"
#include "palpate/math/vector.hpp"

namespace palpate::deformable {

/// Frictionless contact of a rigid tip with a static linear body, without a direction that anybody chooses.
///
/// The tip at c presses the points of the nodes' patches (PatchPoints) along its own normals. With the forces F_i on the nodes and their
/// displacements u = C F, the forces minimize one energy,
///   Pi(F; c) = 1/2 F.C F + sum over the points q of 1/2 kappa_q w_q max(0, depth(x_q + u - c))^2,
/// and the force on the tip is its negative gradient by c: closed paths that begin and end free gain no work, on any mesh. The weight w
/// falls from 1 to 0 where a point's surface looks away from the tip by 90 to 120 degrees.
///
/// Each iteration solves for one number per node, the change of its force along the direction of its points' resultant:
///   (d_i.C_ij d_j + 1/h_i) delta = right-hand side,   h_i the stiffness of the node's points in contact,
/// a positive definite system; the directions follow by fixed point. Start from the forces extrapolated over the last two ticks: one
/// iteration per tick is typical, `max_iterations` bound it.
///
/// Beyond about one radius of depth a thick body is pushed through: the energy has no minimum near the last one. The result is then
/// `lost`, without force, until the tip is outside again. Stored energy is lost, none is gained.
class SignedDistanceContact {  // NOLINT(clang-analyzer-optin.performance.Padding): one object per tip
 public:
  static constexpr int capacity = PlaceForces::capacity;  ///< nodes near the tip; further ones are ignored and `solved` is false
  static constexpr int max_iterations = 8;

  /// The arguments must outlive the contact.
  SignedDistanceContact(const SurfaceNodes& nodes, const FullCompliance& compliance, const ContactPatches& patches)
      : nodes_(&nodes), patches_(&patches), near_(nodes, compliance) {}
  SignedDistanceContact(const SurfaceNodes&&, const FullCompliance&, const ContactPatches&) = delete;
  SignedDistanceContact(const SurfaceNodes&, const FullCompliance&&, const ContactPatches&) = delete;
  SignedDistanceContact(const SurfaceNodes&, const FullCompliance&, const ContactPatches&&) = delete;

  /// Move the tip's center to `center` [m] and find the forces. Does not allocate.
  const ContactResult& step(const TipGeometry& tip, const Vector3<>& center) noexcept {
    result_ = {};
    const bool flat = tip.shape == TipGeometry::Shape::cylinder;
    points_ = flat ? &patches_->flat : &patches_->round;
    const Vector3<> move = started_ ? Vector3<>(center - center_) : Vector3<>::Zero();
    const bool jump = !started_ || move.norm() > max_smooth_move * tip.radius || tip.shape != tip_.shape || tip.radius != tip_.radius;
    tip_ = tip;
    center_ = center;
    result_.solved = near_.update(tip, *points_, center, deflection_, move.norm(), jump);
    check_inside(!started_ || jump);
    started_ = true;
    if (!lost_) {
      const Vector3<> force = force_;
      const double energy = last_energy_;
      predict(move);
      iterate(jump);
      if (!jump) check_pushed_through(move, energy, force);
    }
    last_move_ = move;
    last_energy_ = result_.energy;
    report();
    return result_;
  }

  void reset() noexcept {
    near_.clear();
    started_ = lost_ = false;
    deflection_.setZero();
    last_move_.setZero();
    last_energy_ = 0.0;
    force_.setZero();
    matrix_size_ = -1;
    result_ = {};
  }

  [[nodiscard]] const ContactResult& last() const noexcept { return result_; }

  /// Number of iterations of the last step.
  [[nodiscard]] int iterations() const noexcept { return iterations_; }

  /// Node in contact k < last().nodes, and the force of the tip on it, N.
  [[nodiscard]] std::int32_t contact_node(int k) const noexcept { return near_.place(k).node; }
  [[nodiscard]] const Vector3<>& node_force(int k) const noexcept { return near_.place(k).force; }

 private:
  static constexpr double max_smooth_move = 0.02;  // of the radius per tick; beyond it every node near the tip is evaluated
  static constexpr double tolerance = 1e-3;        // of the last change of the force; the error is about a tenth of it
  static constexpr double acceptable = 20.0;       // times the tolerance: the next tick continues from there
  static constexpr double rounding = 1e-7;         // of positions, relative to the radius
  static constexpr double max_turn = 4e-4;         // square of the change of a direction that renews the matrix

  using Place = NearNodes::Place;

  /// Extrapolate the forces by the share of the last move that this move repeats.
  void predict(const Vector3<>& move) noexcept {
    const double square = last_move_.squaredNorm();
    const double share = square > 0.0 ? std::clamp(move.dot(last_move_) / square, -1.0, 1.0) : 0.0;
    for (int k = 0; k < near_.engaged(); ++k) {
      Place& p = near_.place(k);
      const Vector3<> old = p.force, next = old + share * (old - p.last_force);
      if (next.dot(old) > 0.0) p.force = next;
      p.last_force = old;
      near_.set_force(k);
    }
  }

  void iterate(bool thorough) noexcept {
    double lowest = std::numeric_limits<double>::infinity(), last_error = 0.0;
    int halvings = 0;
    bool factored = false;
    for (int k = 0; k < near_.engaged(); ++k) near_.place(k).change.setZero();
    for (iterations_ = 1; iterations_ <= max_iterations; ++iterations_) {
      const double energy = evaluate(thorough);
      if (energy > lowest + 1e-6 * std::abs(lowest) && halvings < 3) {
        ++halvings;
        halve_last_change();
        continue;
      }
      lowest = energy;
      halvings = 0;
      if (assemble() || !factored) factored = factor();
      if (!factored) break;
      const double error = newton_step();
      factored = iterations_ < 3 || error < 0.3 * last_error;
      last_error = error;
      if (error <= 1.0) break;
    }
    iterations_ = std::min(iterations_, max_iterations);
    result_.energy = lowest < std::numeric_limits<double>::infinity() ? lowest : 0.0;
    result_.solved = result_.solved && last_error <= acceptable;
  }

  void halve_last_change() noexcept {
    for (int k = 0; k < near_.engaged(); ++k) {
      Place& p = near_.place(k);
      p.change *= 0.5;
      p.force -= p.change;
      near_.set_force(k);
    }
  }

  /// Evaluate the points of the engaged nodes and of the others that may have come near. Return the energy.
  double evaluate(bool thorough) noexcept {
    double energy = 0.0;
    for (int k = near_.engaged() - 1; k >= 0; --k) {
      energy += evaluate_node(k);
      const Place& p = near_.place(k);
      if (p.stiffness == 0.0 && p.force.squaredNorm() == 0.0) near_.disengage(k);
    }
    for (int k = near_.engaged(); k < near_.count(); ++k) {
      if (!thorough && near_.certainly_clear(k)) continue;
      energy += evaluate_node(k);
      if (near_.place(k).stiffness > 0.0) near_.engage(k);
    }
    return energy;
  }

  /// Evaluate the displacement of a node and its points' resultant and stiffness. Return the energy of its force and its points.
  double evaluate_node(int k) noexcept {
    Place& p = near_.place(k);
    p.displacement = near_.displacement(k);
    const Vector3<> at = nodes_->point(p.node) + p.displacement - center_;
    const double gap = tip_.distance(at) - points_->reach(p.node);
    near_.set_clearance(k, std::max(gap, 0.0));
    p.target.setZero();
    p.stiffness = 0.0;
    const double energy = gap > 0.0 ? 0.0 : press_points(p, at);
    return energy + 0.5 * p.force.dot(p.displacement);
  }

  /// Press the points of a node at `at` relative to the tip [m]. Return their energy.
  double press_points(Place& p, const Vector3<>& at) const noexcept {
    using Scalar = detail::FloatPack;
    const auto load = [this](std::size_t number, std::size_t q) { return Scalar(*detail::as_floats(points_->coordinate(number) + q)); };
    Vector3<Scalar> force(Scalar(0.0), Scalar(0.0), Scalar(0.0));
    Scalar stiffness(0.0), energy(0.0);
    for (std::size_t q = points_->begin(p.node); q < points_->end(p.node); q += detail::float_lanes) {
      const Vector3<Scalar> y(load(0, q) + Scalar(at[0]), load(1, q) + Scalar(at[1]), load(2, q) + Scalar(at[2]));
      const Vector3<Scalar> normal(load(3, q), load(4, q), load(5, q));
      const auto in = tip_.evaluate<Scalar>(y, normal);
      const Scalar depth = max_of(in.depth, Scalar(0.0));
      const Scalar facing = (in.away[0] * normal[0] + in.away[1] * normal[1]) + in.away[2] * normal[2];
      const Scalar x = min_of(max_of(Scalar(1.0) - Scalar(2.0) * facing, Scalar(0.0)), Scalar(1.0));
      const Scalar pressed = load(6, q) * (x * x * (Scalar(3.0) - Scalar(2.0) * x));
      const Scalar turned = load(6, q) * (Scalar(6.0) * x * (Scalar(1.0) - x)) * depth * depth;
      const Scalar push = pressed * depth;
      for (int a = 0; a < 3; ++a) force[a] += push * in.away[a] + turned * in.bend[a];
      stiffness += select(in.depth > Scalar(0.0), pressed, Scalar(0.0));
      energy += push * depth;
    }
    double total = 0.0;
    for (int l = 0; l < detail::float_lanes; ++l) {
      for (int a = 0; a < 3; ++a) p.target[a] += static_cast<double>(force[a].v[l]);
      p.stiffness += static_cast<double>(stiffness.v[l]);
      total += 0.5 * static_cast<double>(energy.v[l]);
    }
    return total;
  }

  /// Update the directions and, if needed, the matrix. Return whether it is new.
  bool assemble() noexcept {
    int size = 0;
    bool stale = false;
    for (int k = 0; k < near_.engaged(); ++k) {
      Place& p = near_.place(k);
      if (p.stiffness == 0.0) continue;
      const double length = p.target.norm();
      if (length > 0.0) p.direction = p.target / length;
      const auto a = static_cast<std::size_t>(size++);
      stale = stale || row_node_[a] != p.node || row_place_[a] != k || (p.direction - row_direction_[a]).squaredNorm() > max_turn;
      row_place_[a] = k;
    }
    if (!stale && size == matrix_size_) return false;
    matrix_size_ = size;
    system_.resize(size);
    for (int k = 0; k < near_.engaged(); ++k) near_.set_scratch(k, near_.place(k).direction);
    near_.finish_scratch();
    for (int a = 0; a < size; ++a) {
      const auto r = static_cast<std::size_t>(a);
      const int k = row_place_[r];
      row_node_[r] = near_.place(k).node;
      row_direction_[r] = near_.place(k).direction;
      near_.along(k, row_direction_[r], line_.data());
      float* column = system_.column(a);
      for (int b = a; b < size; ++b) column[b] = line_[static_cast<std::size_t>(row_place_[static_cast<std::size_t>(b)])];
    }
    return true;
  }

  bool factor() noexcept {
    for (int a = 0; a < matrix_size_; ++a) {
      const auto r = static_cast<std::size_t>(a);
      row_value_[r] = 1.0 / std::max(near_.place(row_place_[r]).stiffness, 1e-9);
    }
    return system_.factor(row_value_.data());
  }

  /// Change the forces once. Return the size of the change relative to the tolerance.
  double newton_step() noexcept {
    double aside = 0.0;
    for (int k = 0; k < near_.engaged(); ++k) {
      Place& p = near_.place(k);
      const Vector3<> missing = p.target - p.force;
      p.change = p.stiffness > 0.0 ? Vector3<>(missing - missing.dot(p.direction) * p.direction) : Vector3<>(-p.force);
      near_.set_scratch(k, p.change);
      aside = std::max(aside, p.change.squaredNorm());
    }
    near_.finish_scratch();
    const bool turned = aside > 1e-10 * force_.squaredNorm();
    for (int a = 0; a < matrix_size_; ++a) {
      const auto r = static_cast<std::size_t>(a);
      const Place& p = near_.place(row_place_[r]);
      row_value_[r] = p.direction.dot(p.target - p.force) / std::max(p.stiffness, 1e-9);
      if (turned) row_value_[r] -= p.direction.dot(near_.scratch_displacement(row_place_[r]));
    }
    system_.solve(row_value_.data());
    for (int a = 0; a < matrix_size_; ++a) {
      const auto r = static_cast<std::size_t>(a);
      Place& p = near_.place(row_place_[r]);
      p.change += row_value_[r] * p.direction;
    }
    Vector3<> total = Vector3<>::Zero(), change = Vector3<>::Zero();
    double largest = 0.0, stiffest = 0.0;
    for (int k = 0; k < near_.engaged(); ++k) {
      Place& p = near_.place(k);
      p.force += p.change;
      near_.set_force(k);
      total += p.force;
      change += p.change;
      largest = std::max(largest, p.change.squaredNorm());
      stiffest = std::max(stiffest, p.stiffness);
    }
    force_ = total;
    return std::max(change.norm(), 0.3 * std::sqrt(largest)) / (tolerance * total.norm() + rounding * tip_.radius * stiffest + 1e-30);
  }

  /// Find out whether the tip is inside the body at rest without contact; keep that until it is outside and clear of the surface.
  void check_inside(bool first) noexcept {
    if (lost_) {
      const int nearest = near_.nearest(center_);
      if (nearest < 0 ? !first : !(height_over(near_.place(nearest).node) > 0.0 && clear_of_rest())) return;
      lost_ = false;
    }
    if (near_.engaged() > 0) return;
    int node = -1;
    if (near_.count() > 0)
      node = near_.place(near_.nearest(center_)).node;
    else if (first)
      node = nodes_->nearest(center_, std::numeric_limits<float>::max());
    lost_ = node >= 0 && height_over(node) < -max_sunk * tip_.radius;
  }

  /// Whether no point of the body at rest is in the tip.
  [[nodiscard]] bool clear_of_rest() noexcept {
    for (int k = 0; k < near_.count(); ++k) {
      evaluate_node(k);
      if (near_.place(k).stiffness > 0.0) return false;
    }
    return true;
  }

  [[nodiscard]] double height_over(std::int32_t node) const noexcept { return (center_ - nodes_->point(node)).dot(nodes_->normal(node)); }

  /// Release the body if the tip has been pushed through: its center is below the surface at rest, and the energy has dropped by more than
  /// the tip's work and a tenth.
  void check_pushed_through(const Vector3<>& move, double energy, const Vector3<>& force) noexcept {
    const double work = 0.5 * move.dot(force + force_), drop = energy + work - result_.energy;
    if (!(energy > 0.0 && drop > 0.1 * (energy + std::abs(work)))) return;
    const int nearest = near_.nearest(center_);
    if (nearest < 0 || height_over(near_.place(nearest).node) > 0.0) return;
    lost_ = true;
    near_.release_all();
    result_.energy = 0.0;
  }

  void report() noexcept {
    result_.lost = lost_;
    double total = 0.0;
    Vector3<> way = Vector3<>::Zero(), sum = Vector3<>::Zero();
    for (int k = 0; k < near_.engaged(); ++k) {
      const Place& p = near_.place(k);
      const double size = p.force.norm();
      sum += p.force;
      total += size;
      way += size * p.displacement;
      if (p.stiffness > 0.0) way += (size / p.stiffness) * p.force;
    }
    result_.nodes = near_.engaged();
    result_.touching = total > 0.0;
    result_.force = -sum;
    force_ = sum;
    result_.deflection = result_.touching ? Vector3<>(way / total) : Vector3<>::Zero();
    deflection_ = result_.deflection;
  }

  static constexpr double max_sunk = 0.3;  // of the radius: depth of the center below the nearest node's tangent plane

  template <class T>
  using Rows = std::array<T, static_cast<std::size_t>(capacity)>;

  alignas(64) Rows<float> line_{};
  LayeredSystem system_;
  const SurfaceNodes* nodes_;
  const ContactPatches* patches_;
  const PatchPoints* points_ = nullptr;
  NearNodes near_;
  double last_energy_ = 0.0;
  Vector3<> center_ = Vector3<>::Zero(), last_move_ = Vector3<>::Zero(), deflection_ = Vector3<>::Zero(), force_ = Vector3<>::Zero();
  TipGeometry tip_;
  ContactResult result_;
  Rows<double> row_value_{};
  Rows<Vector3<>> row_direction_{};
  int iterations_ = 0, matrix_size_ = -1;
  Rows<int> row_place_{};
  Rows<std::int32_t> row_node_{};
  bool started_ = false, lost_ = false;
};

}  // namespace palpate::deformable
