#pragma once

/// Everything of palpate's core: device, touch, control, loop.
#include "palpate/control/state_space.hpp"
#include "palpate/control/virtual_coupling.hpp"
#include "palpate/device/catalogue.hpp"
#include "palpate/device/drive.hpp"
#include "palpate/device/friction.hpp"
#include "palpate/device/hand.hpp"
#include "palpate/device/motion.hpp"
#include "palpate/device/premium.hpp"
#include "palpate/device/slider.hpp"
#include "palpate/loop/linear_plant.hpp"
#include "palpate/loop/servo.hpp"
#include "palpate/loop/simulation.hpp"
#include "palpate/math/dual.hpp"
#include "palpate/math/sincos.hpp"
#include "palpate/math/vector.hpp"
#include "palpate/touch/anchor.hpp"
