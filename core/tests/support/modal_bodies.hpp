#pragma once

#include <Eigen/Core>
#include <cmath>
#include <palpate/deformable/contact/tip_contact.hpp>
#include <palpate/deformable/linear/modal.hpp>
#include <vector>

/// One node with one mode that carries its whole compliance: a damped oscillator against a stop.
struct Oscillator {
  double frequency = 60.0, mass = 0.02;
  palpate::deformable::SurfaceNodes nodes{{{0, 0, 0}}, {{0, 0, 1}}, {1e-6}};

  [[nodiscard]] std::vector<float> full(double extra) const {
    const auto c = static_cast<float>(1.0 / (mass * frequency * frequency) + extra);
    return {c, 0, 0, 0, c, 0, 0, 0, c};
  }
  [[nodiscard]] palpate::deformable::Modal modal(double period, double alpha, double beta, double extra = 0.0,
                                                 double instantaneous_ratio = 1.0, double retardation_time = 1.0) const {
    const std::vector<float> shapes{0, 0, static_cast<float>(1.0 / std::sqrt(mass))};
    return {nodes, full(extra).data(), shapes.data(), {frequency}, period, alpha, beta, instantaneous_ratio, retardation_time};
  }
};

/// Nine surface nodes with modes and a static correction.
struct Nine {
  static constexpr int nodes = 9, modes = 5;
  palpate::deformable::SurfaceNodes at;
  Eigen::MatrixXd shapes{nodes, modes}, left{nodes, nodes};  // along the inward normals
  std::vector<double> frequencies;
  std::vector<float> full = std::vector<float>(9 * nodes * nodes, 0.0F), waves = std::vector<float>(3 * nodes * modes, 0.0F);

  Nine() {
    std::vector<palpate::math::Vector3<>> points;
    for (int i = 0; i < nodes; ++i) points.emplace_back(2e-3 * (i % 3 - 1), 2e-3 * (i / 3 - 1), 0.0);
    at = palpate::deformable::SurfaceNodes(points, std::vector<palpate::math::Vector3<>>(nodes, palpate::math::Vector3<>::UnitZ()),
                                           std::vector<double>(nodes, 4e-6));
    for (int k = 0; k < modes; ++k) frequencies.push_back(150.0 + 90.0 * k);
    for (int i = 0; i < nodes; ++i)
      for (int k = 0; k < modes; ++k) {
        const auto wave = static_cast<float>(6.0 * std::cos(0.7 * k * i + 0.3 * k));
        waves[static_cast<std::size_t>((3 * i + 2) * modes + k)] = wave;
        shapes(i, k) = -static_cast<double>(wave);
      }
    for (int i = 0; i < nodes; ++i)
      for (int j = 0; j < nodes; ++j) {
        left(i, j) =
            1e-6 / ((points[static_cast<std::size_t>(i)] - points[static_cast<std::size_t>(j)]).norm() + 1e-3);  // as Boussinesq's solution
        double c = left(i, j);
        for (int k = 0; k < modes; ++k) c += shapes(i, k) * shapes(j, k) / std::pow(frequencies[static_cast<std::size_t>(k)], 2);
        full[static_cast<std::size_t>((3 * i + 2) * 3 * nodes + 3 * j + 2)] = static_cast<float>(c);
      }
  }
  [[nodiscard]] Eigen::MatrixXd whole() const {
    Eigen::MatrixXd c(nodes, nodes);
    for (int i = 0; i < nodes; ++i)
      for (int j = 0; j < nodes; ++j) c(i, j) = static_cast<double>(full[static_cast<std::size_t>((3 * i + 2) * 3 * nodes + 3 * j + 2)]);
    return c;
  }
};

/// Move a sphere over a body with intermittent contact. Calls see(forces on all nodes [N], result) at each tick.
template <class Kind, class See>
void dance(const palpate::deformable::SurfaceNodes& nodes, Kind& kind, int ticks, See see) {
  palpate::deformable::TipContact<Kind> contact(nodes, kind);
  palpate::deformable::Tip tip;
  for (int k = 0; k < ticks; ++k) {
    tip.center = {1.5e-3 * std::sin(0.031 * k), 1.2e-3 * std::cos(0.023 * k), tip.radius - 1.2e-3 * std::sin(0.02 * k)};
    const palpate::deformable::ContactResult& a = contact.step(tip);
    Eigen::VectorXd force = Eigen::VectorXd::Zero(nodes.size());
    for (int c = 0; c < a.nodes; ++c) force[contact.contact_nodes()[c]] = contact.forces()[c];
    see(force, a);
  }
}
