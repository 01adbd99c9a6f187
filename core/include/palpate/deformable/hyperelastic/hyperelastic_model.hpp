#pragma once

#include <Eigen/LU>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <utility>
#include <vector>

#include "palpate/deformable/contact/block_matrix.hpp"
#include "palpate/deformable/hyperelastic/conjugate_gradients.hpp"
#include "palpate/deformable/hyperelastic/two_level_preconditioner.hpp"
#include "palpate/math/pack.hpp"
#include "palpate/math/vector.hpp"

namespace palpate::deformable {

/// Tetrahedra of positive volume, their Lame constants, and which nodes are held.
struct TetMesh {
  std::vector<Vector3<>> points;                        ///< at rest, m
  std::vector<std::array<std::int32_t, 4>> tetrahedra;  ///< of points
  std::vector<double> shear, lame;                      ///< of each tetrahedron, Pa
  std::vector<bool> held;                               ///< which points do not move
};

/// A solid of linear tetrahedra that deforms as far as it is pushed, without inertia: its energy, gradient and tangent, and Newton's
/// steps towards rest under a load. `Material` is Corotational or NeoHookean; `lanes` tetrahedra are looked at side by side.
///
/// Vectors are 3 x free node + axis; `free_nodes()` tells which point each free node is.
template <template <class> class Material, int lanes>
class HyperelasticModel {
 public:
  /// What a Newton step did.
  struct Step {
    int solver_steps = 0;   ///< of conjugate gradients
    double length = 0.0;    ///< of the Newton direction that was gone, 0 to 1
    double residual = 0.0;  ///< load less inner forces, before the step, N
    bool negative = false;  ///< the tangent was seen not to be positive
  };

  explicit HyperelasticModel(const TetMesh& mesh) {
    const auto points = static_cast<std::int32_t>(mesh.points.size());
    std::vector<std::int32_t> number(mesh.points.size());
    for (const bool held : {false, true})
      for (std::int32_t p = 0; p < points; ++p)
        if (mesh.held[static_cast<std::size_t>(p)] == held) {
          number[static_cast<std::size_t>(p)] = static_cast<std::int32_t>(order_.size());
          order_.push_back(p);
          if (!held) ++free_;
        }
    std::vector<Vector3<>> places;
    for (std::size_t i = 0; i < static_cast<std::size_t>(free_); ++i) places.push_back(mesh.points[static_cast<std::size_t>(order_[i])]);
    std::vector<std::pair<std::int32_t, std::int32_t>> pairs;
    pairs.reserve(static_cast<std::size_t>(free_) + 6 * mesh.tetrahedra.size());
    for (std::int32_t i = 0; i < free_; ++i) pairs.emplace_back(i, i);
    for (const auto& cell : mesh.tetrahedra)
      for (const std::int32_t p : cell)
        for (const std::int32_t q : cell) {
          const std::int32_t i = number[static_cast<std::size_t>(p)], j = number[static_cast<std::size_t>(q)];
          if (i < j && j < free_) pairs.emplace_back(i, j);
        }
    std::sort(pairs.begin(), pairs.end());
    pairs.erase(std::unique(pairs.begin(), pairs.end()), pairs.end());
    matrix_ = BlockMatrix(free_, pairs);
    precondition_ = TwoLevelPreconditioner(places);
    const std::size_t cells = mesh.tetrahedra.size();
    group_.resize((cells + lanes - 1) / lanes);
    for (std::size_t c = 0; c < group_.size() * lanes; ++c) add(mesh, number, std::min(c, cells - 1), c, c < cells);
    const std::size_t unknowns = 3 * static_cast<std::size_t>(free_), all = 3 * mesh.points.size();
    place_.assign(all, 0.0);
    trial_.assign(all, 0.0);
    gradient_.assign(unknowns, 0.0);
    trial_gradient_.assign(unknowns, 0.0);
    way_.assign(unknowns, 0.0F);
    left_.assign(unknowns, 0.0F);
    pull_.assign(unknowns, 0.0F);
    solver_ = ConjugateGradients<float>(unknowns);
    reset();
  }

  [[nodiscard]] std::int32_t free_nodes() const noexcept { return free_; }
  [[nodiscard]] std::size_t unknowns() const noexcept { return gradient_.size(); }
  /// The point of the mesh that a node is; free nodes come first, then the held ones.
  [[nodiscard]] std::int32_t point_of(std::int32_t node) const noexcept { return order_[static_cast<std::size_t>(node)]; }
  [[nodiscard]] std::size_t nodes() const noexcept { return order_.size(); }
  [[nodiscard]] const double* displacement() const noexcept { return place_.data(); }  ///< of all nodes, m
  [[nodiscard]] const double* gradient() const noexcept { return gradient_.data(); }   ///< of the energy: inner forces, N
  [[nodiscard]] double energy() const noexcept { return energy_; }                     ///< J
  [[nodiscard]] const BlockMatrix& tangent() const noexcept { return matrix_; }        ///< of the inner forces, N/m
  [[nodiscard]] TwoLevelPreconditioner& precondition() noexcept { return precondition_; }

  /// Takes the tangent exact, here and from now on, or with as much of its geometric part only as leaves it positive, tetrahedron by
  /// tetrahedron. Where it rests does not change with that.
  void take_tangent(bool exact) {
    exact_ = exact;
    settle();
  }

  /// Back to rest, with the exact tangent.
  void reset() {
    exact_ = true;
    move_to(std::vector<double>(place_.size(), 0.0).data());
    precondition_.update_coarse(matrix_);
    usual_ = 0;
  }

  /// Puts all nodes, the held ones too, to these displacements [m], and takes energy, gradient and tangent there.
  void move_to(const double* displacement) {
    std::copy(displacement, displacement + place_.size(), place_.begin());
    std::copy(place_.begin(), place_.end(), trial_.begin());
    settle();
  }

  /// One Newton step towards rest under `load` [N], solved to `tolerance` of the way (in the energy's norm) or `most` steps of conjugate
  /// gradients, and shortened until the energy less the load's work falls. A tangent that is seen not to be positive is made so,
  /// tetrahedron by tetrahedron, and solved again. `guess` [m], if given, is where the solver starts.
  Step step(const double* load, float tolerance, int most, const float* guess = nullptr) {
    Step done;
    double square = 0.0;
    for (std::size_t k = 0; k < unknowns(); ++k) {
      const double r = load[k] - gradient_[k];
      square += r * r;
    }
    done.residual = std::sqrt(square);
    if (!(square > 0.0)) return done;
    if (usual_ > 0 && last_ > 10 + usual_ + usual_ / 2) {
      precondition_.update_coarse(matrix_);
      usual_ = 0;
    }
    if (!find_way(load, tolerance, most, guess, done)) {
      done.negative = true;
      evaluate(place_.data(), gradient_.data(), false);
      precondition_.update(matrix_);
      find_way(load, tolerance, most, nullptr, done);
    } else {
      last_ = done.solver_steps;
      if (usual_ == 0) usual_ = last_;
    }
    double slope = 0.0, before = energy_;
    for (std::size_t k = 0; k < unknowns(); ++k) {
      slope += (gradient_[k] - load[k]) * static_cast<double>(way_[k]);
      before -= load[k] * place_[k];
    }
    double length = 1.0;
    for (int halvings = 0; halvings < 12; ++halvings, length *= 0.5) {
      for (std::size_t k = 0; k < unknowns(); ++k) trial_[k] = place_[k] + length * static_cast<double>(way_[k]);
      const double energy = evaluate(trial_.data(), trial_gradient_.data(), exact_);
      double after = energy;
      for (std::size_t k = 0; k < unknowns(); ++k) after -= load[k] * trial_[k];
      if (after <= before + 1e-4 * length * slope + rounding_) {
        energy_ = energy;
        place_.swap(trial_);
        gradient_.swap(trial_gradient_);
        precondition_.update(matrix_);
        done.length = length;
        return done;
      }
    }
    settle();
    return done;
  }

 private:
  using Scalar = Pack<lanes>;

  /// `lanes` tetrahedra side by side.
  struct Group {
    std::array<std::array<std::int32_t, lanes>, 4> node{};    // of each corner, rising
    std::array<std::array<std::int32_t, lanes>, 10> block{};  // in the matrix, of each pair of corners; -1: one is held
    std::array<Vector3<Scalar>, 3> slope;                     // of the shape functions of corners 1 to 3, 1/m
    Scalar volume, shear, lame;                               // m^3, Pa, Pa
  };

  /// The place of corners a <= b among the ten pairs.
  static constexpr std::size_t pair(std::size_t a, std::size_t b) noexcept { return a * (7 - a) / 2 + b; }

  void add(const TetMesh& mesh, const std::vector<std::int32_t>& number, std::size_t cell, std::size_t at, bool counts) {
    Group& group = group_[at / lanes];
    const auto lane = static_cast<int>(at % lanes);
    const auto l = static_cast<std::size_t>(lane);
    auto corners = mesh.tetrahedra[cell];
    const auto of = [&](std::int32_t point) { return number[static_cast<std::size_t>(point)]; };
    std::sort(corners.begin(), corners.end(), [&](std::int32_t p, std::int32_t q) { return of(p) < of(q); });
    Eigen::Matrix3d edges;
    for (std::size_t c = 0; c < 4; ++c) {
      group.node[c][l] = of(corners[c]);
      if (c > 0)
        edges.col(static_cast<int>(c) - 1) =
            mesh.points[static_cast<std::size_t>(corners[c])] - mesh.points[static_cast<std::size_t>(corners[0])];
    }
    const Eigen::Matrix3d slopes = edges.inverse();  // one in each row
    for (int c = 0; c < 3; ++c)
      for (int a = 0; a < 3; ++a) group.slope[static_cast<std::size_t>(c)][a].set(lane, slopes(c, a));
    const double volume = std::abs(edges.determinant()) / 6.0;
    group.volume.set(lane, counts ? volume : 0.0);
    rounding_ += 1e-14 * volume * (2.0 * mesh.shear[cell] + mesh.lame[cell]);
    group.shear.set(lane, mesh.shear[cell]);
    group.lame.set(lane, mesh.lame[cell]);
    for (std::size_t a = 0; a < 4; ++a)
      for (std::size_t b = a; b < 4; ++b) {
        const std::int32_t i = group.node[a][l], j = group.node[b][l];
        group.block[pair(a, b)][l] = j < free_ ? static_cast<std::int32_t>(matrix_.find(i, j)) : -1;
      }
  }

  void settle() {
    energy_ = evaluate(place_.data(), gradient_.data(), exact_);
    precondition_.update(matrix_);
  }

  /// The Newton direction into way_. False if the tangent was seen not to be positive.
  bool find_way(const double* load, float tolerance, int most, const float* guess, Step& done) {
    for (std::size_t k = 0; k < unknowns(); ++k) left_[k] = static_cast<float>(load[k] - gradient_[k]);
    float limit = 0.0F, unused = 0.0F;
    precondition_.measure(left_.data(), limit);
    if (guess != nullptr) {
      std::copy(guess, guess + unknowns(), way_.begin());
      matrix_.multiply(way_.data(), pull_.data(), unused);
      for (std::size_t k = 0; k < unknowns(); ++k) left_[k] -= pull_[k];
    } else {
      std::fill(way_.begin(), way_.end(), 0.0F);
    }
    const auto solved = solver_.solve(matrix_, precondition_, way_.data(), left_.data(), tolerance * tolerance * limit, most);
    done.solver_steps += solved.steps;
    return !solved.negative;
  }

  /// Energy [J] at `place`; gradient and tangent there, the tangent exact or made positive.
  double evaluate(const double* place, double* gradient, bool exact) noexcept {
    std::fill(gradient, gradient + unknowns(), 0.0);
    matrix_.clear();
    double energy = 0.0;
    for (const Group& group : group_) {
      std::array<Vector3<Scalar>, 4> corner;
      for (std::size_t c = 0; c < 4; ++c)
        for (std::size_t a = 0; a < 3; ++a) {
          Scalar x;
          for (int l = 0; l < lanes; ++l) x.set(l, place[3 * static_cast<std::size_t>(group.node[c][static_cast<std::size_t>(l)]) + a]);
          corner[c][static_cast<int>(a)] = x;
        }
      Matrix3<Scalar> deformation;  // one and the displacement's gradient
      for (int a = 0; a < 3; ++a) {
        const Scalar x = corner[1][a] - corner[0][a], y = corner[2][a] - corner[0][a], z = corner[3][a] - corner[0][a];
        for (int b = 0; b < 3; ++b)
          deformation(a, b) = (x * group.slope[0][b] + y * group.slope[1][b]) + z * group.slope[2][b] + Scalar(a == b ? 1.0 : 0.0);
      }
      const Material<Scalar> material(deformation, group.shear, group.lame);
      const Scalar share = exact ? Scalar(1.0) : material.safe_share();
      const Scalar stored = group.volume * material.energy();
      for (int l = 0; l < lanes; ++l) energy += stored[l];
      const Matrix3<Scalar> stress = material.stress() * group.volume;
      std::array<Vector3<Scalar>, 4> force;
      for (std::size_t c = 1; c < 4; ++c) force[c] = stress * group.slope[c - 1];
      force[0] = -((force[1] + force[2]) + force[3]);
      for (std::size_t c = 0; c < 4; ++c)
        for (int l = 0; l < lanes; ++l) {
          const std::int32_t node = group.node[c][static_cast<std::size_t>(l)];
          if (node >= free_) continue;
          for (int a = 0; a < 3; ++a) gradient[3 * static_cast<std::size_t>(node) + static_cast<std::size_t>(a)] += force[c][a][l];
        }
      // Blocks of corners 1 to 3; those of corner 0 make the sums zero.
      std::array<Matrix3<Scalar>, 10> block;
      for (std::size_t a = 1; a < 4; ++a)
        for (std::size_t b = a; b < 4; ++b)
          block[pair(a, b)] = material.tangent(group.slope[a - 1], group.slope[b - 1], share) * group.volume;
      const Matrix3<Scalar>&xy = block[pair(1, 2)], &xz = block[pair(1, 3)], &yz = block[pair(2, 3)];
      block[pair(0, 1)] = -((block[pair(1, 1)] + xy.transpose()) + xz.transpose());
      block[pair(0, 2)] = -((xy + block[pair(2, 2)]) + yz.transpose());
      block[pair(0, 3)] = -((xz + yz) + block[pair(3, 3)]);
      block[pair(0, 0)] = -((block[pair(0, 1)] + block[pair(0, 2)]) + block[pair(0, 3)]);
      for (std::size_t p = 0; p < block.size(); ++p) {
        std::array<float, 9 * static_cast<std::size_t>(lanes)> number;
        for (std::size_t k = 0; k < 9; ++k)
          store_float(block[p](static_cast<int>(k / 3), static_cast<int>(k % 3)), number.data() + k * lanes);
        for (std::size_t l = 0; l < lanes; ++l) {
          if (group.block[p][l] < 0) continue;
          float* to = matrix_.block(static_cast<std::size_t>(group.block[p][l]));
          for (std::size_t k = 0; k < 9; ++k) to[k] += number[k * lanes + l];
        }
      }
    }
    return energy;
  }

  bool exact_ = true;  // the tangent, or made positive
  std::int32_t free_ = 0;
  std::vector<std::int32_t> order_;  // point of each node, free ones first
  std::vector<Group> group_;
  BlockMatrix matrix_;
  TwoLevelPreconditioner precondition_;
  ConjugateGradients<float> solver_;
  double energy_ = 0.0;
  double rounding_ = 0.0;                          // of the energy, J
  int last_ = 0, usual_ = 0;                       // steps of the solver: the last time, and after the coarse matrix was new
  std::vector<double> place_, trial_;              // displacements of all nodes, m
  std::vector<double> gradient_, trial_gradient_;  // N
  std::vector<float> way_, left_, pull_;           // Newton's direction, m; what it leaves, and its pull, N
};

}  // namespace palpate::deformable
