#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <utility>

#include "palpate/deformable/multirate/local_model.hpp"
#include "palpate/math/triple_buffer.hpp"

namespace palpate::deformable {

/// What the servo feels of a body whose snapshots come at a lower rate.
///
/// From one snapshot to the next the potential is (1 - s) V_a + s V_b, and s goes from 0 to 1 in the time that the last snapshot took to
/// come. With s held no closed path gives work. As s moves by ds, the energy that the body would give back changes by ds (V_b - V_a): what
/// it gives up goes into an account, and what it gains must be in there, or s waits. So at every moment
///   work of the tips on the body = V + account,  both not negative,
/// and the tips never get out more than they put in. A snapshot that asks for more is first made stiffer about its state, by up to two: its
/// forces there stay, and it promises less. The account is emptied when the last tip leaves: a quasi-static body then holds
/// nothing.
class PassiveModelSwitch {
 public:
  using ModelBuffer = TripleBuffer<LocalModel, 3>;

  struct EnergyTank {
    double potential = 0.0;  ///< V, J
    double saved = 0.0;      ///< J
    double share = 1.0;      ///< s
    bool waits = false;      ///< s wanted energy that was not there
  };

  /// Goes on by one period with the tips where they are. Takes a snapshot from `box` when the last one is blended in.
  const MultiTipResult& step(ModelBuffer& box, const TipPair& tips) noexcept {
    ++since_;
    if (box.has_new() && (account_.share >= 1.0 || account_.waits)) take(box, tips);
    const MultiTipResult& b = solve(box, b_, tips);
    if (account_.share < 1.0) {
      blend(box, tips, solve(box, a_, tips), b);
    } else {
      answer_ = b;
      account_.waits = false;
    }
    account_.potential = answer_.energy;
    if (answer_.nodes == 0) account_ = {};
    before_ = b.nodes;
    std::copy(side_[static_cast<std::size_t>(b_)].contact.pressed(), side_[static_cast<std::size_t>(b_)].contact.pressed() + b.nodes,
              pressed_.begin());
    return answer_;
  }

  [[nodiscard]] const MultiTipResult& last() const noexcept { return answer_; }
  [[nodiscard]] const EnergyTank& account() const noexcept { return account_; }

  /// Calls take(name, force along the inward normal [N], force of the tip [N]) for each node that is pressed, by rising name.
  template <class Take>
  void each_pressed(ModelBuffer& box, Take take) const noexcept {
    const double s = account_.share;
    Pressed one(box, side_[static_cast<std::size_t>(a_)], 1.0 - s), two(box, side_[static_cast<std::size_t>(b_)], s);
    while (one || two) {
      const std::int32_t name = !two || (one && one.name() < two.name()) ? one.name() : two.name();
      double force = 0.0;
      Vector3<> push = Vector3<>::Zero();
      for (Pressed* side : {&one, &two})
        if (*side && side->name() == name) side->add(force, push);
      take(name, force, push);
    }
  }

  [[nodiscard]] const LocalModel& newest(ModelBuffer& box) const noexcept {
    return box.read_slot(side_[static_cast<std::size_t>(b_)].slot);
  }

 private:
  struct Side {
    int slot = 0;
    double share = 1.0;  // of the snapshot's compliance
    LocalModelContact contact;
  };

  /// Goes over the pressed nodes of a side that counts by `weight`.
  class Pressed {
   public:
    Pressed(ModelBuffer& box, const Side& side, double weight) noexcept
        : body_(&box.read_slot(side.slot)), contact_(&side.contact), weight_(weight), count_(weight > 0.0 ? contact_->last().nodes : 0) {}
    explicit operator bool() const noexcept { return at_ < count_; }
    [[nodiscard]] std::int32_t name() const noexcept { return contact_->pressed()[at_]; }
    void add(double& force, Vector3<>& push) noexcept {
      const auto end = body_->name.begin() + body_->nodes.size();
      const auto node = static_cast<std::int32_t>(std::lower_bound(body_->name.begin(), end, name()) - body_->name.begin());
      force += weight_ * contact_->forces()[at_];
      push -= (weight_ * contact_->forces()[at_]) * body_->nodes.normal(node);
      ++at_;
    }

   private:
    const LocalModel* body_;
    const LocalModelContact* contact_;
    double weight_;
    int count_, at_ = 0;
  };

  const MultiTipResult& solve(ModelBuffer& box, int side, const TipPair& tips) noexcept {
    Side& s = side_[static_cast<std::size_t>(side)];
    return s.contact.solve(box.read_slot(s.slot), tips, s.share, pressed_.data(), before_);
  }

  /// Energy of a side with `share` of its compliance, or less if that is more than `allowed`, J.
  double fit(ModelBuffer& box, int side, const TipPair& tips, double share, double allowed) noexcept {
    double& taken = side_[static_cast<std::size_t>(side)].share;
    taken = share;
    double energy = solve(box, side, tips).energy;
    for (int k = 0; k < 3 && energy > allowed && taken > least_share; ++k) {
      taken = std::max(0.98 * taken * allowed / energy, least_share);
      energy = solve(box, side, tips).energy;
    }
    return energy;
  }

  /// A new snapshot: blended in from now on; or, if s waits, in place of the one that it waits for, as far as the account allows.
  void take(ModelBuffer& box, const TipPair& tips) noexcept {
    Side& spare = side_[static_cast<std::size_t>(spare_)];
    if (account_.share >= 1.0) {
      std::swap(a_, b_);
      std::swap(b_, spare_);
      side_[static_cast<std::size_t>(b_)].slot = box.acquire(side_[static_cast<std::size_t>(b_)].slot);
      ticks_ = std::clamp(since_, 1, longest);
      since_ = 0;
      const bool first = box.read_slot(side_[static_cast<std::size_t>(a_)].slot).nodes.size() == 0;
      fit(box, b_, tips, 1.0, first ? most : solve(box, a_, tips).energy + account_.saved);
      account_.share = first ? 1.0 : 0.0;
      return;
    }
    spare.slot = box.acquire(spare.slot);
    const double s = account_.share, now = solve(box, b_, tips).energy;
    const double blended = (1.0 - s) * solve(box, a_, tips).energy + s * now;
    const double gain = s * (fit(box, spare_, tips, 1.0, blended + account_.saved) - now);
    if (gain > account_.saved) return;
    account_.saved -= gain;
    std::swap(b_, spare_);
    since_ = 0;
  }

  void blend(ModelBuffer& box, const TipPair& tips, const MultiTipResult& a, const MultiTipResult& b) noexcept {
    const double more = std::min(1.0 / ticks_, 1.0 - account_.share);
    if (more * (b.energy - a.energy) > account_.saved) {
      const double before = b.energy, share = side_[static_cast<std::size_t>(b_)].share;
      fit(box, b_, tips, share, (1.0 - account_.share) * a.energy + account_.share * before + account_.saved);
      if (b.energy < before)
        account_.saved += account_.share * (before - b.energy);
      else
        fit(box, b_, tips, share, most);
    }
    const double rise = b.energy - a.energy;
    account_.waits = more * rise > account_.saved;
    const double step = account_.waits ? account_.saved / rise : more;
    account_.saved = std::max(account_.saved - step * rise, 0.0);
    account_.share += step;
    if (account_.share > 1.0 - 1e-9) account_.share = 1.0;
    const double s = account_.share;
    answer_ = b;
    answer_.energy = (1.0 - s) * a.energy + s * b.energy;
    answer_.nodes = std::max(a.nodes, b.nodes);
    answer_.solved = a.solved && b.solved;
    for (std::size_t t = 0; t < static_cast<std::size_t>(tips.count); ++t) {
      const ContactResult &one = a.tip[t], &two = b.tip[t];
      ContactResult& to = answer_.tip[t];
      to.touching = one.touching || two.touching;
      to.force = (1.0 - s) * one.force + s * two.force;
      to.deflection = (1.0 - s) * one.deflection + s * two.deflection;
      to.energy = (1.0 - s) * one.energy + s * two.energy;
      to.nodes = std::max(one.nodes, two.nodes);
    }
  }

  static constexpr int longest = 100;         // ticks over which a snapshot is blended in
  static constexpr double least_share = 0.5;  // of a snapshot's compliance
  static constexpr double most = 1e300;       // J

  std::array<Side, 3> side_{Side{0, 1.0, {}}, Side{1, 1.0, {}}, Side{2, 1.0, {}}};
  int a_ = 0, b_ = 1, spare_ = 2;
  int since_ = 0;  // ticks since a snapshot was taken
  int ticks_ = 1;  // that the blending takes
  int before_ = 0;
  std::array<std::int32_t, LocalModel::capacity> pressed_{};
  MultiTipResult answer_;
  EnergyTank account_;
};

}  // namespace palpate::deformable
