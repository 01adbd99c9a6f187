"""One Lyapunov matrix for a workspace controller at many poses: x^T P x decays in whatever order the poses follow.

The state is the tip's deflection and velocity and the observer's estimate, the same at every pose. The matrix
is found by linear matrix inequalities at some vertices (poses, inertias, operators) and verified at any others from P
alone, without the solver. Limits of the drive and the reference model are inputs of this loop and are not covered.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.linalg import block_diag

from palpate.arrays import Array
from palpate.control.workspace_controller import WorkspaceController, reachable_axes
from palpate.devices import Device
from palpate.errors import StabilityError
from palpate.linear.linear_device import HumanArm
from palpate.linear.linearization import static_tip_force
from palpate.linear.sampled_loop import assemble_loop, sampled_plants
from palpate.stability.switching import decrease, has_solver, strongest_lyapunov

__all__ = ["WorkspaceCertificate", "certify_workspace", "workspace_loops"]

ESTIMATE = 3  # states of the observer per axis
SHARES = (0.7, 0.4, 0.0)  # of the slowest decay that P is asked to show, tried in turn


@dataclass(frozen=True, eq=False)
class WorkspaceCertificate:
    """Common Lyapunov matrix of a workspace controller.

    Attributes:
        matrix: P (m, m), for the scaled state of `workspace_loops`.
        contraction: largest factor on the norm sqrt(x^T P x) in one tick at the vertices; below 1.
        vertices: number of vertices.
    """

    matrix: Array
    contraction: float
    vertices: int

    def verify(self, loops: Array) -> float:
        """Return the largest factor on the norm in one tick under other loops (n, m, m), from P alone."""
        return float(np.sqrt(1.0 - decrease(loops, self.matrix).min()))


def workspace_loops(
    controller: WorkspaceController,
    poses: Array,
    device: Device | None = None,
    arm: HumanArm | None = None,
    delay: int = 0,
) -> Array:
    """Return the loops in contact about rest at poses (n, dof) as matrices of one tick (n, m, m), m = dof (5 + delay).

    A flexible mode of the device adds 2 dof states: the motion of the tip beside that of the encoders.
    The state per axis is deflection times bandwidth, velocity, the delayed commands as the tip acceleration that they
    give at their pose, over bandwidth, and the estimate in the units of the motion.

    Args:
        controller: knows its own device.
        poses: (n, dof), rad or m.
        device: the real one; None: the one that the controller knows.
        arm: held at the tip; a rigid grip.
        delay: samples from a command to its application.

    Raises:
        StabilityError: the arm has states of its own, or the tip moves in other directions at other poses.
        PoseError: a pose is singular.
    """
    if arm is not None and arm.tissue_stiffness is not None:
        raise StabilityError("workspace_loops: the arm must grip rigidly; fingertip tissue adds states")
    real = controller.device if device is None else device
    stiffness = np.diag(controller.stiffness)
    dof, rate = real.dof, controller.bandwidth
    sides = 1 if real.flexible is None else 2
    scales = [*[rate] * sides, *[1.0] * sides, *[1.0 / rate] * delay, rate, 1.0, 1.0 / rate]
    unit = np.kron(np.diag(scales), np.eye(dof))
    loops, axes = [], None
    for q in np.atleast_2d(np.asarray(poses, dtype=float)):
        jacobian = real.jacobian(q)
        plant = sampled_plants(real, q[None], arm, np.zeros(3), controller.period)
        hold = np.einsum("k,kij->ij", static_tip_force(jacobian, controller.device.gravity(q)), real.tip_hessian(q))
        law = controller.linearized(q)
        a, entry, out = assemble_loop((plant[0][0], plant[1][0], plant[2][0]), jacobian, hold, law, delay)
        closed = a + entry @ stiffness @ out
        size = dof * (2 * sides + delay + ESTIMATE)  # the reference model follows and does not feed back
        own = reachable_axes(jacobian)
        axes = own if axes is None else axes
        turn = axes.T @ own  # of the axes at this pose into those at the first one
        if np.linalg.norm(turn @ turn.T - np.eye(dof)) > 1e-9:
            raise StabilityError("workspace_loops: the tip moves in other directions at other poses; give one pose")
        moved = axes.T @ jacobian
        to_tip = np.kron(np.eye(2 * sides), moved)
        to_acceleration = np.kron(np.eye(delay), moved @ np.linalg.inv(controller.device.mass_matrix(q)))
        into = unit @ block_diag(to_tip, to_acceleration, np.kron(np.eye(ESTIMATE), turn))
        loops.append(into @ closed[:size, :size] @ np.linalg.inv(into))
    return np.array(loops)


def certify_workspace(loops: Array | Sequence[Array]) -> WorkspaceCertificate:
    """Return a common Lyapunov matrix of loops of `workspace_loops`.

    Raises:
        StabilityError: a loop is unstable, Clarabel is not installed, or no common matrix was found.
    """
    a = np.asarray(loops, dtype=float)
    radius = np.abs(np.linalg.eigvals(a)).max(axis=1)
    worst = int(np.argmax(radius))
    if radius[worst] >= 1.0:
        raise StabilityError(f"loop {worst} is unstable by itself (spectral radius {radius[worst]:.6f})")
    if not has_solver():
        raise StabilityError("certify_workspace needs the solver Clarabel: install palpate[lmi]")
    for share in SHARES:
        p = strongest_lyapunov(a / (1.0 - share * (1.0 - radius[worst])))
        if p is not None and (found := float(decrease(a, p).min())) > 0.0:
            return WorkspaceCertificate(p, float(np.sqrt(1.0 - found)), len(a))
    raise StabilityError("no common Lyapunov matrix of these loops was found; test fewer, or a smaller range")
