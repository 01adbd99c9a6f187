"""Catalog of devices, and `Device` with its kinematics and dynamics."""

from palpate.devices.catalog import IdentifiedModel, Number, identified_model, load, names
from palpate.devices.device import Device
from palpate.devices.mechanisms import MECHANISMS, Mechanism

__all__ = ["MECHANISMS", "Device", "IdentifiedModel", "Mechanism", "Number", "identified_model", "load", "names"]
