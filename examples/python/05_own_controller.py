"""Three controllers of one's own: a transfer function, a function, an object with a memory."""

import control
import numpy as np
import palpate

SCENARIO = {
    "device": {"name": "phantom-premium-1.5a"},
    "start": {"pose": ["0 deg", "120 deg", "190 deg"]},
    "servo": {"period": "0.5 ms"},
    "reference": {"force": ["0 N", "0 N", "-1 N"]},
    "operator": {"kind": "arm", "mass": "0.15 kg", "damping": "4.5 N*s/m", "stiffness": "200 N/m"},
    "object": {"kind": "spring", "stiffness": "1 N/mm", "damping": "2 N*s/m"},
    "run": {"duration": "1 s"},
}
s = control.tf("s")


def stiffening(tick):
    """Follow the force with a gain that grows with the error."""
    error = tick.reference - tick.object_force
    return (1.0 + np.linalg.norm(error)) * error - 1.0 * tick.velocity


class Integral:
    """Integrate the force error, and ramp it up over the first 0.2 s."""

    def reset(self):
        self.sum = np.zeros(3)

    def command(self, tick):
        error = min(tick.time / 0.2, 1.0) * tick.reference - tick.object_force
        self.sum = self.sum + 5.0 * 0.5e-3 * error
        return error + self.sum


for controller in (1 + 5 / s, stiffening, Integral()):
    print(palpate.summarize(palpate.simulate(SCENARIO, controller))["verdict"])
