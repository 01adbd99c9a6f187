"""Step a servo loop by hand, then as an environment for learning."""

import palpate
from palpate.simulation import Environment

SCENARIO = {
    "device": {"name": "phantom-premium-1.5a"},
    "start": {"pose": ["0 deg", "120 deg", "190 deg"]},
    "servo": {"period": "1 ms", "topology": "impedance_display"},
    "object": {"kind": "wall", "normal": [0, 0, 1], "position": "-1 mm", "stiffness": "1 N/mm", "damping": "1 N*s/m"},
    "run": {"duration": "0.5 s"},
}
loop = palpate.Loop(SCENARIO)
while not loop.done:
    sample = loop.step(force=[0.0, 0.0, -0.5 - 2.0 * loop.velocity[2]])  # the hand pushes, and damps
    if sample.touching:
        print(f"touches the wall at {1e3 * sample.time:.0f} ms")
        break
trace = loop.run()  # to the end, with the signals of the scenario: nobody pushes
print(trace)

env = Environment(
    {**SCENARIO, "servo": {"period": "1 ms"}, "reference": {"force": ["0 N", "0 N", "-1 N"]}},
    acts="controller",
    periods=5,
)
observation, information = env.reset(seed=1)
total, over = 0.0, False
while not over:
    velocity, force, wanted = observation[3:6], observation[6:9], observation[9:]
    observation, reward, terminated, truncated, information = env.step(wanted - force - 2.0 * velocity)
    total, over = total + reward, terminated or truncated
print(f"return {total:.1f} N, object force at the end {information['sample'].object_force.round(2)} N")
