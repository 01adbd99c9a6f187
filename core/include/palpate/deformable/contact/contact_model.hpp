#pragma once

#include <concepts>
#include <cstdint>

namespace palpate::deformable {

/// Body model that is linear over one servo period, as required by TipContact. Displacements and forces are along the inward normals.
///
///   double compliance(i, j)             displacement of node i at the end of the period per unit force on node j held over it, m/N;
///                                       symmetric
///   double free_displacement(i)         displacement of node i at the end of the period without force, m
///   void advance(nodes, forces, count)  advance by one period under `count` nodal forces [N]
///   void reset()                        return to rest
///
/// Optional members:
///
///   double energy()                     stored energy after advance(), J
///   double energy(compliance_work)      same; the argument is f.C f with the compliance C of the period, N m
///   bool free_displacement_at_least(i, value)
///                                       true only if free_displacement(i) >= value [m]; cheaper than its evaluation
///   bool group_free_displacement_at_least(group, value)
///                                       same for all nodes of a group (SurfaceNodes::for_each_in_group)
///   double layer_compliance(i)          self-compliance of a node that a partial coverage of its patch divides, m/N; without it, that
///                                       within the period. The part of a patch beside an edge yields at once, so a model with
///                                       inertia states the static one
///   Matrix2d tangential_layer(i)        same in SurfaceNodes::tangent_basis, for friction
///   Creep creep()                       creep law, applied to the extra compliance of partially covered patches
///   Matrix2d tangential(i, j)           tangential compliance in SurfaceNodes::tangent_basis, m/N; required by friction
///   Vector2d free_tangential_displacement(i)
///                                       tangential displacement without force, m; for models with tangential memory
///   bool has_tangential()               false if the model was built without tangential compliance: there is no friction
///   void advance(nodes, forces, tangential_forces, count)
///                                       advance with additional forces in the tangent planes [N]
///
/// A model without energy() stores f.C f / 2.
template <class Model>
concept ContactModel = requires(Model& model, const Model& constant, const std::int32_t* nodes, const double* forces) {
  { constant.compliance(0, 0) } -> std::convertible_to<double>;
  { model.free_displacement(0) } -> std::convertible_to<double>;
  model.advance(nodes, forces, 0);
  model.reset();
};

/// A model with tangential compliance: contacts with friction are possible.
template <class Model>
concept HasTangentialCompliance = requires(const Model& model) { model.tangential(0, 0); };

/// Return whether a contact with friction is possible with this model.
template <class Model>
[[nodiscard]] bool has_tangential(const Model& model) noexcept {
  if constexpr (requires { model.has_tangential(); }) return model.has_tangential();
  return HasTangentialCompliance<Model>;
}

/// Return the self-compliance of a node that a partial coverage of its patch divides, m/N; `self` is that within the period.
template <class Model>
[[nodiscard]] double layer_compliance(const Model& model, std::int32_t node, double self) noexcept {
  if constexpr (requires { model.layer_compliance(node); }) return model.layer_compliance(node);
  return self;
}

}  // namespace palpate::deformable
