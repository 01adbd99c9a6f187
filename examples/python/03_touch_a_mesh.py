"""Press a cube of triangles with a round tip, drag it along, and look at the friction."""

import numpy as np
import palpate

trace = palpate.simulate(
    {
        "device": {"name": "phantom-premium-1.5a"},
        "start": {"pose": ["0 deg", "120 deg", "190 deg"]},
        "servo": {"period": "1 ms", "topology": "impedance_display"},
        "operator": {
            "kind": "arm", "mass": "0.15 kg", "damping": "4.5 N*s/m", "stiffness": "200 N/m",
            "shape": "table",
            "table": [
                ["0 s", "0 N", "0 N", "0 N"],
                ["0.2 s", "0 N", "0 N", "-2 N"],
                ["1 s", "3 N", "0 N", "-2 N"],
            ],
        },
        "object": {
            "kind": "mesh",
            "position": "-3 mm",
            "mesh": {"shape": "box", "edge": "80 mm", "divisions": 8, "radius": "1 mm"},
            "surface": {"stiffness": "1 N/mm", "damping": "1 N*s/m", "static_friction": 0.4, "dynamic_friction": 0.3},
        },
        "run": {"duration": "1 s"},
    }
)  # fmt: skip
touching = trace["touching"][:, 0] > 0
force = trace["object_force"][touching]
print(f"touches for {touching.mean():.0%} of the run, largest force {np.linalg.norm(force, axis=1).max():.2f} N")
print("force on the cube at the end, N:", force[-1].round(3))
