"""The slider on a damped spring, as the text of a scenario file."""

from __future__ import annotations

from typing import Final

SLIDER_TEXT: Final = """
title = "{title}"
[device]
name = "slider"
[servo]
topology = "impedance_display"
[operator]
kind = "force"
force = ["1 N", "0 N", "0 N"]
[object]
stiffness = "100 N/m"
damping = "0.5 N*s/m"
[run]
duration = "{duration}"
"""
