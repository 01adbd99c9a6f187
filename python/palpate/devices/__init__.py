"""What is held: the catalogue of devices and the `Device` that answers for its kinematics and dynamics."""

from palpate.devices.catalogue import Number, load, names
from palpate.devices.device import Device

__all__ = ["Device", "Number", "load", "names"]
