#pragma once

namespace palpate::deformable {

/// E / (1 - nu^2) of the elastic layer of a node, Pa. They differ where the stiffness varies with the depth.
struct LayerModulus {
  double round;  ///< under a capsule or sphere
  double flat;   ///< under a cylinder or flat end
};

}  // namespace palpate::deformable
