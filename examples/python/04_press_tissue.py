"""Build a block of soft tissue, press it by hand, then within the servo loop."""

import tempfile
from pathlib import Path

import palpate
from palpate import fem

path = Path(tempfile.mkdtemp()) / "tissue.h5"
body = fem.build(
    fem.block(("40 mm", "40 mm", "20 mm"), "4 mm"),
    young="20 kPa",
    poisson=0.45,
    fixed="z <= 0 mm",
    touch="z >= 20 mm",
    output=path,
)
for depth in ("1 mm", "2 mm", "3 mm"):
    result = body.indent(["20 mm", "20 mm", "20 mm"], radius="10 mm", depth=depth)
    print(depth, f"{result.force[2]:.3f} N")

trace = palpate.simulate(
    {
        "device": {"name": "phantom-premium-1.5a"},
        "start": {"pose": ["0 deg", "120 deg", "190 deg"]},
        "servo": {"period": "1 ms", "topology": "impedance_display"},
        "operator": {"kind": "arm", "mass": "0.15 kg", "damping": "4.5 N*s/m", "stiffness": "200 N/m",
                     "force": ["0 N", "0 N", "-1 N"]},
        "object": {"kind": "body", "position": ["-20 mm", "-20 mm", "-32 mm"],
                   "body": {"file": str(path), "radius": "10 mm"}},
        "run": {"duration": "0.5 s"},
    }
)  # fmt: skip
print("force in the loop at the end, N:", trace["object_force"][-1].round(3))
