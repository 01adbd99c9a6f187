#pragma once

#include <array>

#include "palpate/math/vector.hpp"
#include "palpate/mechanism/parameters.hpp"

namespace palpate::mechanism {

/// Geometry and inertia of a PHANToM Premium: a base that yaws and carries a parallelogram linkage (Cavusoglu, Feygin & Tendick 2002;
/// Hosseini-Zadeh 2004, ch. 2). Segment inertias are diagonal in segment axes. Those of `be` and `df` are about the joint axis, so their
/// centers of mass only enter gravity.
struct PremiumParameters {
  double l1 = 0.0;                              ///< upper arm, m
  double l2 = 0.0;                              ///< forearm, elbow to tip, m
  double l3 = 0.0;                              ///< short side of the parallelogram, m
  double l5 = 0.0;                              ///< center of mass of segment be along the upper arm, m
  double l6 = 0.0;                              ///< center of mass of segment df along the forearm, m
  double mass_a = 0.0;                          ///< forearm tube, kg
  double mass_c = 0.0;                          ///< parallel rod, kg
  double mass_be = 0.0;                         ///< upper arm with its motor, kg
  double mass_df = 0.0;                         ///< short link with its motor, kg
  Vector3<> inertia_a = Vector3<>::Zero();      ///< about the center of mass (xx, yy, zz), kg*m^2
  Vector3<> inertia_c = Vector3<>::Zero();      ///< about the center of mass, kg*m^2
  Vector3<> inertia_be = Vector3<>::Zero();     ///< about the joint, kg*m^2
  Vector3<> inertia_df = Vector3<>::Zero();     ///< about the joint, kg*m^2
  double inertia_base = 0.0;                    ///< base about the vertical, kg*m^2
  Vector3<> rotor_inertia = Vector3<>::Zero();  ///< of the motors, kg*m^2; reflected to the joints by gear^2
  Vector3<> gear = Vector3<>::Ones();           ///< motor turns per joint turn
  double gravity = 9.81;                        ///< m/s^2
};

/// The parameters as device files name them.
inline constexpr std::array premium_parameters = {
    parameter<&PremiumParameters::l1>("geometry.l1", "m", ParameterRange::positive, "upper arm"),
    parameter<&PremiumParameters::l2>("geometry.l2", "m", ParameterRange::positive, "forearm, elbow to tip"),
    parameter<&PremiumParameters::l3>("geometry.l3", "m", ParameterRange::any, "short side of the parallelogram"),
    parameter<&PremiumParameters::l5>("geometry.l5", "m", ParameterRange::any, "center of mass of be along the upper arm"),
    parameter<&PremiumParameters::l6>("geometry.l6", "m", ParameterRange::any, "center of mass of df along the forearm"),
    parameter<&PremiumParameters::mass_a>("mass.a", "kg", ParameterRange::nonnegative, "forearm tube"),
    parameter<&PremiumParameters::mass_c>("mass.c", "kg", ParameterRange::nonnegative, "parallel rod"),
    parameter<&PremiumParameters::mass_be>("mass.be", "kg", ParameterRange::nonnegative, "upper arm with its motor"),
    parameter<&PremiumParameters::mass_df>("mass.df", "kg", ParameterRange::nonnegative, "short link with its motor"),
    parameter<&PremiumParameters::inertia_a>("inertia.a", "kg*m^2", ParameterRange::nonnegative, "about the center of mass"),
    parameter<&PremiumParameters::inertia_c>("inertia.c", "kg*m^2", ParameterRange::nonnegative, "about the center of mass"),
    parameter<&PremiumParameters::inertia_be>("inertia.be", "kg*m^2", ParameterRange::nonnegative, "about the joint"),
    parameter<&PremiumParameters::inertia_df>("inertia.df", "kg*m^2", ParameterRange::nonnegative, "about the joint"),
    parameter<&PremiumParameters::inertia_base>("inertia.base", "kg*m^2", ParameterRange::nonnegative, "about the vertical"),
    parameter<&PremiumParameters::rotor_inertia>("drive.rotor_inertia", "kg*m^2", ParameterRange::nonnegative, "motor rotors", false),
    parameter<&PremiumParameters::gear>("drive.gear", "", ParameterRange::positive, "motor turns per joint turn", false),
    parameter<&PremiumParameters::gravity>("environment.gravity", "m/s^2", ParameterRange::any, "downward", false),
};

}  // namespace palpate::mechanism
