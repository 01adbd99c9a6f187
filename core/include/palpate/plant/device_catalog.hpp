#pragma once

#include "palpate/mechanism/premium.hpp"
#include "palpate/plant/joint_friction.hpp"

namespace palpate::plant {

/// Return the published parameters of the PHANToM Premium 1.5A without rotors (Cavusoglu & Feygin 2001).
/// A test compares them with the device file phantom-premium-1.5a.toml, which gives the source of each number.
inline mechanism::PremiumParameters phantom_premium_1_5a() {
  mechanism::PremiumParameters p;
  p.l1 = 0.215;
  p.l2 = 0.170;
  p.l3 = 0.0325;
  p.l5 = -0.0368;
  p.l6 = 0.0527;
  p.mass_a = 0.0202;
  p.mass_c = 0.0249;
  p.mass_be = 0.2359;
  p.mass_df = 0.1906;
  p.inertia_a = Vector3<>(0.4864e-4, 0.001843e-4, 0.4864e-4);
  p.inertia_c = Vector3<>(0.959e-4, 0.959e-4, 0.0051e-4);
  p.inertia_be = Vector3<>(11.09e-4, 10.06e-4, 0.591e-4);
  p.inertia_df = Vector3<>(7.11e-4, 0.629e-4, 6.246e-4);
  p.inertia_base = 11.87e-4;
  return p;
}

/// Return the viscous joint friction of the same device [N*m*s/rad] (Hosseini-Zadeh 2004, chapter 3).
inline JointFriction<3> phantom_premium_1_5a_friction() {
  JointFriction<3> friction;
  friction.viscous = Joints<3>(0.05, 0.001, 0.01);
  return friction;
}

}  // namespace palpate::plant
