"""How well a loop renders, beyond being stable: impedance, stiffness, rate-hardness, bandwidth, buzz."""

from palpate.performance.buzz import Buzz, buzz, vibration_threshold
from palpate.performance.measure import Performance, measure
from palpate.performance.rate_hardness import rate_hardness
from palpate.performance.response import LoopResponse, hand_stiffness, hold_response

__all__ = [
    "Buzz",
    "LoopResponse",
    "Performance",
    "buzz",
    "hand_stiffness",
    "hold_response",
    "measure",
    "rate_hardness",
    "vibration_threshold",
]
