#pragma once

namespace palpate::deformable {

/// Energy tank of PassiveModelSwitch: energy released by model switches, available for later ones (passivity-based switching).
struct EnergyTank {
  double potential = 0.0;  ///< recoverable energy V of the blended models, J
  double level = 0.0;      ///< energy in the tank, J
  double blend = 1.0;      ///< s: weight of the newer model, 0 to 1
  bool empty = false;      ///< the blend waits because the tank cannot supply the required energy
};

}  // namespace palpate::deformable
