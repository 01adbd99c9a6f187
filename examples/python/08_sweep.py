"""Run a loop for many stiffnesses and delays at once, and compare with the exact limit."""

import tempfile
from pathlib import Path

import palpate
from palpate import stability

scenario = {
    "device": {"name": "slider"},
    "servo": {"period": "1 ms", "topology": "impedance_display"},
    "operator": {"kind": "force", "force": ["-0.5 N", "0 N", "0 N"]},
    "object": {"kind": "spring", "stiffness": "100 N/m"},
    "run": {"duration": "20 s"},
}
result = palpate.sweep(
    scenario,
    {"object.stiffness": "10 N/m..150 N/m:40", "device.delay": [0, 1, 2]},
    out=Path(tempfile.mkdtemp()) / "wall.h5",
)
stiffness = result.values("object.stiffness")
for column, delay in enumerate((0, 1, 2)):
    stable = stiffness[~result.unstable[:, column]]
    exact = stability.wall_limit(mass=0.06, damping=0.05, period=1e-3, delay=delay).critical_stiffness
    print(f"delay {delay}: stable up to {stable.max():.1f} N/m in the sweep, {exact:.1f} N/m exactly")
