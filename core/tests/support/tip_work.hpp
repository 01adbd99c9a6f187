#pragma once

#include <algorithm>
#include <palpate/deformable/contact/signed_distance_contact.hpp>

namespace contact_bodies {

/// Work of a tip on a body along its path, against the energy that the body stores.
struct TipWork {
  palpate::math::Vector3<> place;  ///< of the tip's center at first, out of contact, and then the last one, m
  palpate::math::Vector3<> force = palpate::math::Vector3<>::Zero();  ///< on the tip there, N
  double work = 0.0;                                                  ///< J
  double ahead = 0.0;                                                 ///< most by which the stored energy was ahead of the work, J
  double largest = 0.0;                                               ///< stored energy, J

  const palpate::deformable::ContactResult& step(palpate::deformable::SignedDistanceContact& contact,
                                                 const palpate::deformable::TipGeometry& tip, const palpate::math::Vector3<>& next) {
    const palpate::deformable::ContactResult& now = contact.step(tip, next);
    work -= 0.5 * (now.force + force).dot(next - place);
    ahead = std::max(ahead, now.energy - work);
    largest = std::max(largest, now.energy);
    force = now.force;
    place = next;
    return now;
  }
};

}  // namespace contact_bodies
