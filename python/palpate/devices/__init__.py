"""The catalog of devices, and the `Device` with its kinematics and dynamics."""

from palpate.devices.catalog import IdentifiedModel, Number, identified_model, load, names
from palpate.devices.device import Device

__all__ = ["Device", "IdentifiedModel", "Number", "identified_model", "load", "names"]
