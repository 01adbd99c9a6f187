"""Two objects of one's own: a wall that stiffens with depth, and a button that snaps."""

import numpy as np
import palpate

SCENARIO = {
    "device": {"name": "slider"},
    "servo": {"period": "1 ms", "topology": "impedance_display"},
    "operator": {"kind": "arm", "mass": "0.15 kg", "damping": "4.5 N*s/m", "stiffness": "560 N/m",
                 "shape": "ramp", "rise": "1 s", "force": ["-4 N", "0 N", "0 N"]},
    "object": {"kind": "none"},
    "run": {"duration": "1.5 s"},
}  # fmt: skip


def stiffening_wall(tip):
    """Return the force of the tip on the wall (3,), N."""
    depth = max(-tip.position[0], 0.0)
    return np.array([-(200.0 * depth + 2e5 * depth**2), 0.0, 0.0])


class Button:
    """A spring that loses half of its force beyond 2 mm, until it is released."""

    def reset(self):
        self.pressed = False

    def step(self, tip):
        depth = max(-tip.position[0], 0.0)
        self.pressed = depth > (1e-3 if self.pressed else 2e-3)
        return [-(250.0 if self.pressed else 500.0) * depth, 0.0, 0.0]


for touched in (stiffening_wall, Button()):
    trace = palpate.simulate(SCENARIO, object=touched)
    depth = -1e3 * trace["tip"].min()
    print(f"{depth:.2f} mm deep, {abs(trace['object_force'][:, 0]).max():.2f} N")
