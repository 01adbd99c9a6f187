"""Linear response of a deformable body to the tip, about the contact at which a run rests."""

from palpate.simulation.body_response.held_tip import HeldTip
from palpate.simulation.body_response.held_tips import HeldTips
from palpate.simulation.body_response.multirate import MultirateResponse, multirate_response
from palpate.simulation.body_response.response import BodyResponse, body_response

__all__ = [
    "BodyResponse",
    "HeldTip",
    "HeldTips",
    "MultirateResponse",
    "body_response",
    "multirate_response",
]
