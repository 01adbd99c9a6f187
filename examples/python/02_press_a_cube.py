"""Design a force controller for a stiff cube, check its margins, and press the cube."""

import palpate
from palpate import control, linear

POSE = ["0 deg", "127.8 deg", "187.8 deg"]

arm = palpate.devices.load("phantom-premium-1.5a")
plant = linear.rendering_plant(arm, POSE, stiffness="1 N/mm", period="0.5 ms")
controller = control.lqg(plant)
print(control.margins(controller, plant))

trace = palpate.simulate(
    {
        "device": {"name": arm.name},
        "start": {"pose": POSE},
        "servo": {"period": "0.5 ms"},
        "reference": {"force": ["0 N", "0 N", "-2 N"]},
        "object": {"kind": "spring", "stiffness": "2.5 N/mm"},
        "run": {"duration": "1 s"},
    },
    controller,
)
print(palpate.summarize(trace)["verdict"])
print("deflection at the end, mm:", (1e3 * trace["deflection"][-1]).round(3))
