"""The five-bar linkage against a MuJoCo model of its four links, closed by the kinematics of the tip."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from palpate import devices, simulate

mujoco = pytest.importorskip("mujoco")

HALF_BASE, PROXIMAL, DISTAL = 0.019, 0.07, 0.09  # m
GRAVITY = 9.81


def model() -> mujoco.MjModel:
    """Return both open chains of the Haply 2diy; the handle is on the right one."""

    proximal = 1.63e-5 - 0.010 * 0.035**2  # kg*m^2, about the center of mass

    def chain(x: float, side: str, handle: str) -> str:
        return f"""
        <body pos="{x} 0 0"><joint name="crank_{side}" axis="0 0 1"/>
          <inertial pos="0.035 0 0" mass="0.010" diaginertia="1e-9 {proximal} {proximal}"/>
          <body pos="{PROXIMAL} 0 0"><joint name="elbow_{side}" axis="0 0 1"/>
            <inertial pos="0.045 0 0" mass="0.012" diaginertia="1e-9 0.81e-5 0.81e-5"/>
            <site name="tip_{side}" pos="{DISTAL} 0 0"/>{handle}
          </body></body>"""

    handle = f'<body pos="{DISTAL} 0 0"><inertial pos="0 0 0" mass="0.015" diaginertia="1e-12 1e-12 1e-12"/></body>'
    return mujoco.MjModel.from_xml_string(
        f"""<mujoco><compiler angle="radian"/><option gravity="0 {-GRAVITY} 0"/><worldbody>
        {chain(HALF_BASE, "right", handle)}{chain(-HALF_BASE, "left", "")}</worldbody></mujoco>"""
    )


@pytest.mark.parametrize("pose", [(0.7, 2.4), (1.0, 2.2), (0.3, 2.8), (0.9, 2.9)])
def test_inertia_and_gravity_agree_with_mujoco(pose: tuple[float, float]) -> None:
    """The open chains' mass matrix and weight, reduced by the closure of the loop."""
    device = devices.load("haply-2diy")
    device = replace(device, parameters=device.parameters.with_values(environment__gravity=GRAVITY))
    tip = device.forward(pose)
    world = model()
    data = mujoco.MjData(world)
    for side, (x, angle) in {"right": (HALF_BASE, pose[0]), "left": (-HALF_BASE, pose[1])}.items():
        elbow = np.array([x, 0.0]) + PROXIMAL * np.array([np.cos(angle), np.sin(angle)])
        link = np.arctan2(*(tip[:2] - elbow)[::-1])
        data.joint(f"crank_{side}").qpos[0] = angle
        data.joint(f"elbow_{side}").qpos[0] = link - angle
    mujoco.mj_forward(world, data)
    np.testing.assert_allclose(data.site("tip_right").xpos, tip, atol=1e-12)
    np.testing.assert_allclose(data.site("tip_left").xpos, tip, atol=1e-12)
    inertia = np.zeros((4, 4))
    for row, unit in zip(inertia, np.eye(4), strict=True):  # symmetric: a product with a unit vector is a row
        mujoco.mj_mulM(world, data, row, unit)
    jacobians = {}
    for side in ("right", "left"):
        jacobians[side] = np.zeros((3, 4))
        mujoco.mj_jacSite(world, data, jacobians[side], None, data.site(f"tip_{side}").id)
    closure = (jacobians["right"] - jacobians["left"])[:2]  # of qd = (crank, elbow, crank, elbow) is zero
    reduction = np.zeros((4, 2))
    reduction[[0, 2]] = np.eye(2)
    reduction[[1, 3]] = -np.linalg.solve(closure[:, [1, 3]], closure[:, [0, 2]])
    np.testing.assert_allclose(device.jacobian(pose), jacobians["right"] @ reduction, atol=1e-12)
    np.testing.assert_allclose(device.mass_matrix(pose), reduction.T @ inertia @ reduction, rtol=1e-8, atol=1e-12)
    np.testing.assert_allclose(device.gravity(pose), reduction.T @ data.qfrc_bias, rtol=1e-8, atol=1e-12)


def test_inverse_returns_the_nearest_pose() -> None:
    device = devices.load("haply-2diy")
    for pose in ((0.7, 2.4), (0.4, 2.6), (1.1, 2.3)):
        np.testing.assert_allclose(device.inverse(device.forward(pose), nearest_to=pose), pose, atol=1e-9)


def test_a_wall_on_the_haply_holds_the_tip() -> None:
    """A scenario runs on a mechanism of two joints like on the others."""
    trace = simulate(
        {
            "device": {"name": "haply-2diy"},
            "start": {"tip": ["0 m", "118 mm", "0 m"]},
            "servo": {"topology": "impedance_display"},
            "operator": {"kind": "arm", "mass": "0.15 kg", "damping": "4.5 N*s/m", "stiffness": "200 N/m",
                         "force": ["0 N", "1 N", "0 N"]},
            "object": {"kind": "spring", "stiffness": "100 N/m", "damping": "1 N*s/m"},
            "run": {"duration": "1 s"},
        }
    )  # fmt: skip
    assert trace.unstable_from is None
    moved = trace["tip"][-1] - trace["tip"][0]
    assert 2e-3 < moved[1] < 5e-3
    assert trace["angle"].shape[1] == 2
