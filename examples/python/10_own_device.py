"""Describe a device of one's own in a file, and ask what it can render."""

import tempfile
from pathlib import Path

import palpate
from palpate import stability

DEVICE = """
name = "my-slider"
description = "One degree of freedom on a linear guide"
mechanism = "slider"
servo_period = { value = "0.5 ms", source = "me" }

[sources]
me = "measured on the bench"

[mass]
tip = { value = "120 g", source = "me" }

[friction]
viscous = { value = "0.8 N*s/m", source = "me" }
coulomb = { value = "20 mN", source = "me" }
"""
path = Path(tempfile.mkdtemp()) / "my-slider.toml"
path.write_text(DEVICE, "utf-8")
device = palpate.devices.load(path)
print(device.name, device.forward(["5 mm"]), "m")
scenario = {
    "device": {"name": str(path)},
    "servo": {"topology": "impedance_display"},
    "operator": {"kind": "force", "force": ["-1 N", "0 N", "0 N"]},
    "object": {"kind": "wall", "normal": [1, 0, 0], "stiffness": "1 N/mm"},
}
print(stability.certify(scenario).claim)
print("largest passive stiffness:", stability.passive_stiffness(damping=0.8, period=0.5e-3), "N/m")
