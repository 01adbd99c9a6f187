"""The closed loop in MuJoCo and in python-control, in the usual style of each."""

from __future__ import annotations

import numpy as np
from palpate.arrays import Array

from benchmarks.workload import PERIOD, POSE, ForceLaw, Workload

__all__ = ["mujoco_loop", "mujoco_rollout", "python_control_loop"]

SUBSTEPS = 10  # Runge-Kutta steps of a peer in one servo period


def mujoco_loop(work: Workload) -> Array:
    """Return angles (ticks + 1, 3) from MuJoCo: five hinges, and equality constraints for the parallelogram."""
    import mujoco

    model, data = _mujoco_model(work)
    law = ForceLaw(work.device)
    hinges = [model.joint(name).qposadr[0] for name in ("theta1", "theta2", "theta3")]
    rows = np.empty((work.ticks + 1, 3))
    for tick in range(work.ticks + 1):
        rows[tick] = data.qpos[hinges]
        data.ctrl[:] = law.torque(tick, rows[tick])
        mujoco.mj_step(model, data, nstep=SUBSTEPS)
    return rows


def mujoco_rollout(work: Workload, batch: int) -> Array:
    """Return the last angles (3,) of `batch` runs by MuJoCo's native batch, on one thread.

    A rollout needs precomputed torques. It gets those of the closed loop and omits the force law. One Runge-Kutta step
    per servo period is the fastest choice with an error below 1e-6 rad.
    """
    import mujoco
    from mujoco import rollout

    model, data = _mujoco_model(work, 1)
    hinges = [model.joint(name).qposadr[0] for name in ("theta1", "theta2", "theta3")]
    size = mujoco.mj_stateSize(model, mujoco.mjtState.mjSTATE_FULLPHYSICS)
    state = np.empty(size)
    mujoco.mj_getState(model, data, state, mujoco.mjtState.mjSTATE_FULLPHYSICS)
    torques = work.torques()
    states, _ = rollout.rollout(model, data, np.tile(state, (batch, 1)), np.tile(torques, (batch, 1, 1)))
    return np.asarray(states)[0, -1, 1:][hinges]  # time comes first


def _mujoco_model(work: Workload, substeps: int = SUBSTEPS):  # type: ignore[no-untyped-def]
    import mujoco

    p = work.device.parameters
    l1, l2, l3, l5, l6 = (p.one(f"geometry.{name}") for name in ("l1", "l2", "l3", "l5", "l6"))
    mass = {name: p.one(f"mass.{name}") for name in ("a", "c", "be", "df")}
    viscous = work.device.viscous
    # Placeholder inertias: MuJoCo's compiler rejects the true ones, which are set in the compiled model.
    xml = f"""
    <mujoco>
      <compiler angle="radian" inertiafromgeom="false" autolimits="true"/>
      <option gravity="0 -9.81 0" integrator="RK4" timestep="{PERIOD / substeps}">
        <flag contact="disable"/></option>
      <worldbody>
        <body name="base"><inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/>
          <joint name="theta1" type="hinge" axis="0 1 0" damping="{viscous[0]}"/>
          <body name="be"><inertial pos="0 0 {l5}" mass="{mass["be"]}" diaginertia="1 1 1"/>
            <joint name="theta2" type="hinge" axis="-1 0 0" damping="{viscous[1]}"/>
            <body name="a" pos="0 0 {l1}"><inertial pos="0 {-l2 / 2} 0" mass="{mass["a"]}" diaginertia="1 1 1"/>
              <joint name="elbow" type="hinge" axis="-1 0 0"/></body></body>
          <body name="df"><inertial pos="0 {l6} 0" mass="{mass["df"]}" diaginertia="1 1 1"/>
            <joint name="theta3" type="hinge" axis="-1 0 0" damping="{viscous[2]}"/>
            <body name="c" pos="0 {-l3} 0"><inertial pos="0 0 {l1 / 2}" mass="{mass["c"]}" diaginertia="1 1 1"/>
              <joint name="rod" type="hinge" axis="-1 0 0"/></body></body>
        </body>
      </worldbody>
      <tendon><fixed name="parallel"><joint joint="theta2" coef="1"/><joint joint="elbow" coef="1"/>
        <joint joint="theta3" coef="-1"/></fixed></tendon>
      <equality><tendon tendon1="parallel" solref="{2 * PERIOD / substeps} 1" solimp="0.9999 0.9999 1e-6"/>
        <joint joint1="rod" joint2="elbow" polycoef="0 -1 0 0 0" solref="{2 * PERIOD / substeps} 1"
               solimp="0.9999 0.9999 1e-6"/></equality>
      <actuator><motor joint="theta1"/><motor joint="theta2"/><motor joint="theta3"/></actuator>
    </mujoco>"""
    model = mujoco.MjModel.from_xml_string(xml)

    def about_centre(name: str, offset: Array) -> Array:
        x, y, z = offset
        return p.many(f"inertia.{name}", 3) - mass[name] * np.array([y * y + z * z, x * x + z * z, x * x + y * y])

    inertias = {
        "base": np.array([1.0, p.one("inertia.base"), 1.0]),
        "a": p.many("inertia.a", 3),
        "c": p.many("inertia.c", 3),
        "be": about_centre("be", np.array([0.0, 0.0, l5])),
        "df": about_centre("df", np.array([0.0, l6, 0.0])),
    }
    for name, value in inertias.items():
        model.body_inertia[model.body(name).id] = value
    data = mujoco.MjData(model)
    mujoco.mj_setConst(model, data)
    yaw, upper, fore = POSE
    for name, angle in {
        "theta1": yaw,
        "theta2": upper,
        "elbow": fore - upper,
        "theta3": fore,
        "rod": upper - fore,
    }.items():
        data.qpos[model.joint(name).qposadr[0]] = angle
    return model, data


def python_control_loop(work: Workload) -> Array:
    """Return angles (ticks + 1, 3) from python-control: a sampled nonlinear system whose update integrates one hold.

    The dynamics are those of palpate's core, called from Python, which is faster than formulas in Python.
    """
    import control

    law = ForceLaw(work.device)
    tick = iter(range(work.ticks + 2))
    h = PERIOD / SUBSTEPS

    def update(_t: float, x: Array, _u: Array, _params: object) -> Array:
        torque = law.torque(next(tick), x[:3])
        for _ in range(SUBSTEPS):
            k1 = rate(x, torque)
            k2 = rate(x + 0.5 * h * k1, torque)
            k3 = rate(x + 0.5 * h * k2, torque)
            k4 = rate(x + h * k3, torque)
            x = x + (h / 6.0) * (k1 + 2.0 * (k2 + k3) + k4)
        return x

    def rate(x: Array, torque: Array) -> Array:
        return np.concatenate([x[3:], work.acceleration(x[:3], x[3:], torque)])

    system = control.nlsys(update, None, inputs=1, states=6, outputs=6, dt=PERIOD)
    time = PERIOD * np.arange(work.ticks + 1)
    start = np.concatenate([POSE, np.zeros(3)])
    response = control.input_output_response(system, time, np.zeros_like(time), start)
    return np.asarray(response.outputs[:3].T)
