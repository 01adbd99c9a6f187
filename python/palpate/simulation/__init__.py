"""Simulation of a scenario's servo loop, and the trace that it returns."""

from palpate.contact.force_law import ForceLaw
from palpate.simulation.environment import Environment
from palpate.simulation.joint_run import JointRun, simulate_together
from palpate.simulation.linear_loop import ScenarioLoop, scenario_loop
from palpate.simulation.loop import Loop, Sample
from palpate.simulation.loop_config import resolve
from palpate.simulation.simulator import Simulation, build_simulation, simulate
from palpate.simulation.surface_frames import Frame, SurfaceFrames
from palpate.simulation.trace import CHANNELS, Trace, TraceError
from palpate.simulation.trace_export import Channel
from palpate.simulation.user_object import ContactResult

__all__ = [
    "CHANNELS",
    "Channel",
    "ContactResult",
    "Environment",
    "ForceLaw",
    "Frame",
    "JointRun",
    "Loop",
    "Sample",
    "ScenarioLoop",
    "Simulation",
    "SurfaceFrames",
    "Trace",
    "TraceError",
    "build_simulation",
    "resolve",
    "scenario_loop",
    "simulate",
    "simulate_together",
]
