#pragma once

#include <Eigen/SparseCore>
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <utility>
#include <vector>

#include "palpate/deformable/contact/surface_nodes.hpp"
#include "palpate/deformable/linear/spring_network.hpp"
#include "palpate/math/supernodal_cholesky.hpp"
#include "palpate/math/vector.hpp"

namespace palpate::deformable {

/// Which vertices of a network a touchable node's force acts on, and in which shares; its place is their mean with the same shares.
struct PatchWeights {
  std::vector<std::int32_t> begin;     ///< of each node in the two lists; one more than nodes
  std::vector<std::int32_t> vertices;  ///< of the network
  std::vector<double> shares;
};

/// A body of masses, springs and dampers on the vertices of a mesh. One period moves them by d,
///   (M / h^2 + a M / h + b L' / h + L / 2) d = M v / h + F(x) + f,   x + d -> x,   d / h -> v
/// with the network's true forces F at the place it is in, damping a by mass and b by stiffness (dampers beside the springs), and a matrix
/// L that the network is nowhere stiffer than: one factor for all time, the same along each axis. From W(x + d) <= W(x) - F.d + d.L d / 2
/// follows for the kinetic and stored energy E
///   E(after) <= E(before) + f.d
/// at any period and any stiffness. Volumes strained far may be stiffer than L: each step is checked, and one that would break the
/// inequality goes less far or arrives slower. The price is that L / 2 acts as a damper of L h / 2, the less the shorter the period.
class MassSpringModel {
 public:
  MassSpringModel() = default;

  /// `period` [s]; damping by mass `alpha` [1/s] and by stiffness `beta` [s] (of shear).
  MassSpringModel(const SurfaceNodes& nodes, SpringNetworkData parts, PatchWeights patches, double period, double alpha, double beta)
      : network_(std::move(parts)), patches_(std::move(patches)), period_(period) {
    const SpringNetworkData& p = network_.parts();
    const std::size_t count = p.places.size();
    number_.assign(count, -1);
    for (std::size_t v = 0; v < count; ++v)
      if (!p.held[v]) {
        number_[v] = static_cast<std::int32_t>(free_.size());
        free_.push_back(static_cast<std::int32_t>(v));
      }
    place_ = p.places;
    force_.assign(count, Vector3<>::Zero());
    move_.assign(free_.size(), Vector3<>::Zero());
    drift_ = speed_ = move_;
    factorise(alpha, beta);
    if (!factor_.positive_definite()) return;
    respond(nodes);
    for (std::int32_t i = 0; i < nodes.size(); ++i) {
      inward_.push_back(-nodes.normal(i));
      across_.push_back(nodes.across(i));
    }
    reset();
  }

  /// False: the parts do not make a body (a mass or a volume is not positive).
  [[nodiscard]] bool definite() const noexcept { return factor_.positive_definite(); }

  [[nodiscard]] double compliance(std::int32_t i, std::int32_t j) const noexcept {
    return static_cast<double>(between_[index(i) * inward_.size() + index(j)]) * inward_[index(i)].dot(inward_[index(j)]);
  }

  [[nodiscard]] double at_rest(std::int32_t i) const noexcept { return inward_[index(i)].dot(mean(i, drift_)); }

  [[nodiscard]] Eigen::Matrix2d tangential(std::int32_t i, std::int32_t j) const noexcept {
    return static_cast<double>(between_[index(i) * inward_.size() + index(j)]) * across_[index(i)].transpose() * across_[index(j)];
  }

  [[nodiscard]] Eigen::Vector2d tangential_at_rest(std::int32_t i) const noexcept {
    return across_[index(i)].transpose() * mean(i, drift_);
  }

  void advance(const std::int32_t* nodes, const double* forces, int count) noexcept { advance(nodes, forces, nullptr, count); }

  /// `across` are forces in the nodes' tangent planes, or none.
  void advance(const std::int32_t* nodes, const double* forces, const Eigen::Vector2d* across, int count) noexcept {
    move_ = drift_;
    for (int c = 0; c < count; ++c) {
      const Vector3<> push = pushed(nodes[c], forces[c], across == nullptr ? nullptr : across + c);
      const float* column = columns_.data() + index(nodes[c]) * free_.size();
      for (std::size_t k = 0; k < free_.size(); ++k) move_[k] += static_cast<double>(column[k]) * push;
    }
    double work = 0.0;
    for (int c = 0; c < count; ++c) {
      const std::int32_t node = nodes[c];
      Vector3<> moved = Vector3<>::Zero();
      for (std::int32_t e = patches_.begin[index(node)]; e < patches_.begin[index(node) + 1]; ++e) {
        const std::int32_t k = number_[index(patches_.vertices[index(e)])];
        if (k >= 0) moved += patches_.shares[index(e)] * move_[index(k)];
      }
      work += pushed(node, forces[c], across == nullptr ? nullptr : across + c).dot(moved);
    }
    go(work);
    prepare();
  }

  void reset() noexcept {
    place_ = network_.parts().places;
    for (Vector3<>& v : speed_) v.setZero();
    stored_ = network_.pull(place_.data(), force_.data());
    kinetic_ = 0.0;
    held_back_ = 0;
    prepare();
  }

  /// Goes on from vertices at `places` [m] with `speeds` [m/s], as many of each as the network has; held ones stay where they are put.
  void set(const Vector3<>* places, const Vector3<>* speeds) noexcept {
    for (std::size_t v = 0; v < place_.size(); ++v) place_[v] = places[v];
    for (std::size_t k = 0; k < free_.size(); ++k) speed_[k] = speeds[free_[k]];
    stored_ = network_.pull(place_.data(), force_.data());
    kinetic_ = kinetic();
    prepare();
  }

  /// Kinetic and stored energy, J.
  [[nodiscard]] double energy() const noexcept { return kinetic_ + stored_; }
  /// How many periods have lost speed because they would have made energy.
  [[nodiscard]] long held_back() const noexcept { return held_back_; }
  [[nodiscard]] const std::vector<Vector3<>>& places() const noexcept { return place_; }
  [[nodiscard]] std::size_t factor_entries() const noexcept { return factor_.nonzeros(); }

  /// Mean displacement of a node's patch, m.
  [[nodiscard]] Vector3<> displacement(std::int32_t i) const noexcept {
    Vector3<> sum = Vector3<>::Zero();
    for (std::int32_t e = patches_.begin[index(i)]; e < patches_.begin[index(i) + 1]; ++e) {
      const std::size_t v = index(patches_.vertices[index(e)]);
      sum += patches_.shares[index(e)] * (place_[v] - network_.parts().places[v]);
    }
    return sum;
  }

 private:
  static std::size_t index(std::int32_t i) noexcept { return static_cast<std::size_t>(i); }

  /// The whole force on a node, N.
  [[nodiscard]] Vector3<> pushed(std::int32_t node, double inward, const Eigen::Vector2d* across) const noexcept {
    Vector3<> push = inward * inward_[index(node)];
    if (across != nullptr) push += across_[index(node)] * *across;
    return push;
  }

  void factorise(double alpha, double beta) {
    const SpringNetworkData& p = network_.parts();
    // Springs of an isotropic solid hold each vertex five times as stiffly as its shear does.
    const Eigen::SparseMatrix<double> whole = 0.5 * network_.bound() + (0.2 * beta / period_) * network_.links();
    std::vector<Eigen::Triplet<double>> entries;
    for (Eigen::Index c = 0; c < whole.outerSize(); ++c)
      for (Eigen::SparseMatrix<double>::InnerIterator e(whole, c); e; ++e) {
        const std::int32_t i = number_[static_cast<std::size_t>(e.row())], j = number_[static_cast<std::size_t>(e.col())];
        if (i >= 0 && j >= 0) entries.emplace_back(i, j, e.value());
      }
    for (std::size_t k = 0; k < free_.size(); ++k) {
      const double heavy = p.inertia_parameters[index(free_[k])] * (1.0 / period_ + alpha) / period_;
      entries.emplace_back(static_cast<int>(k), static_cast<int>(k), heavy);
    }
    const auto size = static_cast<Eigen::Index>(free_.size());
    Eigen::SparseMatrix<double> matrix(size, size);
    matrix.setFromTriplets(entries.begin(), entries.end());
    factor_ = SupernodalCholesky(matrix);
  }

  /// How all vertices and all nodes move in a period under a unit force on each node; the same along each axis.
  void respond(const SurfaceNodes& nodes) {
    const auto n = static_cast<std::size_t>(nodes.size());
    columns_.resize(n * free_.size());
    between_.resize(n * n);
    for (std::size_t first = 0; first < n; first += 3) {  // one node for each axis
      for (Vector3<>& m : move_) m.setZero();
      for (std::size_t a = 0; a < 3 && first + a < n; ++a)
        for (std::int32_t e = patches_.begin[first + a]; e < patches_.begin[first + a + 1]; ++e) {
          const std::int32_t k = number_[index(patches_.vertices[index(e)])];
          if (k >= 0) move_[index(k)][static_cast<int>(a)] += patches_.shares[index(e)];
        }
      factor_.solve(move_.data());
      for (std::size_t a = 0; a < 3 && first + a < n; ++a) {
        for (std::size_t k = 0; k < free_.size(); ++k)
          columns_[(first + a) * free_.size() + k] = static_cast<float>(move_[k][static_cast<int>(a)]);
        for (std::size_t i = 0; i < n; ++i) {
          double sum = 0.0;
          for (std::int32_t e = patches_.begin[i]; e < patches_.begin[i + 1]; ++e) {
            const std::int32_t k = number_[index(patches_.vertices[index(e)])];
            if (k >= 0) sum += patches_.shares[index(e)] * move_[index(k)][static_cast<int>(a)];
          }
          between_[i * n + first + a] = static_cast<float>(sum);
        }
      }
    }
    for (std::size_t i = 0; i < n; ++i)  // symmetric to the last bit
      for (std::size_t j = 0; j < i; ++j) between_[j * n + i] = between_[i * n + j];
  }

  /// Where node i will be, from rest, after its vertices have moved on by `more`.
  [[nodiscard]] Vector3<> mean(std::int32_t i, const std::vector<Vector3<>>& more) const noexcept {
    Vector3<> sum = Vector3<>::Zero();
    for (std::int32_t e = patches_.begin[index(i)]; e < patches_.begin[index(i) + 1]; ++e) {
      const std::size_t v = index(patches_.vertices[index(e)]);
      const std::int32_t k = number_[v];
      sum += patches_.shares[index(e)] * (place_[v] - network_.parts().places[v]);
      if (k >= 0) sum += patches_.shares[index(e)] * more[index(k)];
    }
    return sum;
  }

  /// By `move_`, in which forces do `work`, J; less far, or slower on arrival, if the energy would be more than that.
  void go(double work) noexcept {
    const double had = energy(), rounding = 1e-13 * had;
    double part = 1.0, before = 0.0;  // of the move: to be gone, and gone
    for (int halving = 0; halving <= 4; ++halving) {
      for (std::size_t k = 0; k < free_.size(); ++k) place_[index(free_[k])] += (part - before) * move_[k];
      stored_ = network_.pull(place_.data(), force_.data());
      const double allowed = had + part * work;
      if (stored_ <= allowed + rounding || part == 0.0) {
        for (std::size_t k = 0; k < free_.size(); ++k) speed_[k] = (part / period_) * move_[k];
        kinetic_ = kinetic();
        bool lossy = part < 1.0;
        if (energy() > allowed + rounding && kinetic_ > 0.0) {
          lossy = true;
          const double left = std::max(allowed - stored_, 0.0) / kinetic_;
          for (Vector3<>& v : speed_) v *= std::sqrt(left);
          kinetic_ *= left;
        }
        held_back_ += lossy ? 1 : 0;
        return;
      }
      before = part;
      part = halving < 3 ? 0.5 * part : 0.0;
    }
  }

  /// Where the vertices would go in the next period without forces.
  void prepare() noexcept {
    for (std::size_t k = 0; k < free_.size(); ++k)
      drift_[k] = (network_.parts().inertia_parameters[index(free_[k])] / period_) * speed_[k] + force_[index(free_[k])];
    factor_.solve(drift_.data());
  }

  [[nodiscard]] double kinetic() const noexcept {
    double sum = 0.0;
    for (std::size_t k = 0; k < free_.size(); ++k)
      sum += 0.5 * network_.parts().inertia_parameters[index(free_[k])] * speed_[k].squaredNorm();
    return sum;
  }

  SpringNetwork network_;
  PatchWeights patches_;
  double period_ = 1e-3;              // s
  std::vector<std::int32_t> free_;    // vertices that move
  std::vector<std::int32_t> number_;  // of each vertex among them, or -1
  SupernodalCholesky factor_;
  std::vector<Vector3<>> inward_;                    // normals of the nodes
  std::vector<Eigen::Matrix<double, 3, 2>> across_;  // their tangent planes
  std::vector<float> columns_;                       // nodes x free vertices: displacement in a period by a unit force, m/N
  std::vector<float> between_;                       // nodes x nodes, the same
  std::vector<Vector3<>> place_;                     // of all vertices, m
  std::vector<Vector3<>> force_;                     // of the network on them, N
  std::vector<Vector3<>> speed_;                     // of the free ones, m/s
  std::vector<Vector3<>> drift_;                     // in the next period without forces, m
  std::vector<Vector3<>> move_;                      // in this one, m
  double stored_ = 0.0, kinetic_ = 0.0;
  long held_back_ = 0;
};

}  // namespace palpate::deformable
