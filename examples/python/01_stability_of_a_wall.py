"""Compute the stiffest stable wall, and check the limit in simulation."""

import palpate
from palpate import stability

print(stability.wall_limit(mass=0.06, damping=0.05, period=1e-3))

for stiffness in ("97 N/m", "103 N/m"):
    scenario = {
        "device": {"name": "slider"},
        "servo": {"period": "1 ms", "topology": "impedance_display"},
        "operator": {"kind": "force", "force": ["-0.5 N", "0 N", "0 N"]},
        "object": {"kind": "spring", "stiffness": stiffness},
        "run": {"duration": "30 s"},
    }
    certificate = stability.certify(scenario)
    trace = palpate.simulate(scenario)
    print(stiffness, "|", certificate.claim, "|", palpate.summarize(trace)["verdict"])
