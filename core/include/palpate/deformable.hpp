#pragma once

/// The deformable bodies: linear and hyperelastic models, their contact, and their objects for the servo loop.
#include "palpate/deformable/contact/signed_distance_contact.hpp"
#include "palpate/deformable/hyperelastic/corotational.hpp"
#include "palpate/deformable/hyperelastic/neo_hookean.hpp"
#include "palpate/deformable/hyperelastic/quasi_static_solver.hpp"
#include "palpate/deformable/linear/compliance.hpp"
#include "palpate/deformable/linear/full_compliance.hpp"
#include "palpate/deformable/linear/mass_spring_model.hpp"
#include "palpate/deformable/linear/modal.hpp"
#include "palpate/deformable/linear/viscoelastic_solid.hpp"
#include "palpate/deformable/multirate/passive_model_switch.hpp"
#include "palpate/object/body_instance.hpp"
#include "palpate/object/deformable_object.hpp"
#include "palpate/object/multirate_object.hpp"
#include "palpate/object/signed_distance_body.hpp"
#include "palpate/object/supported_body.hpp"
