"""The section's final state is an equilibrium in space too: wires that turn and a splint that yaws open the clamp."""

import numpy as np
import pytest
from scipy.optimize import minimize
from scipy.spatial.transform import Rotation

from clamp3d import load_clamp
from clamp3d.baselines import Cas
from clamp3d.clamp.final_state import solve_final_state
from clamp3d.clamp.section import WIRES, D, S, Section
from clamp3d.geometry.pose import inverse
from clamp3d.kernel import groove_pieces

SLOPES = 5  # line (right, up), jumper (right, up), yaw of the down splint; rad


def pose(x, y, angle=0.0, yaw=0.0, pitch=0.0):
    """A part at (x, y) of the section (right, down), tilted, and turned about the bolt and the cross axis."""
    T = np.eye(4)
    T[:3, :3] = Rotation.from_euler("ZXY", [yaw, pitch, -angle]).as_matrix()
    T[:3, 3] = x, 0.0, -y
    return T


def gaps_in_space(section, x):
    """All pieces of both wires in both splints, by the kernel in three dimensions."""
    q, slopes = x[:-SLOPES], x[-SLOPES:]
    down = section.down_splint(q)
    splints = {"P1": np.eye(4), "P2": pose(down.x, down.y, down.angle, yaw=slopes[4])}
    gaps = []
    for i, wire in enumerate(WIRES):
        T = pose(q[2 * i], q[2 * i + 1], yaw=-slopes[2 * i], pitch=slopes[2 * i + 1])
        for splint, T_splint in splints.items():
            pair = section.pairs[splint, wire]
            T_groove_wire = inverse(T_splint @ pair.T_a_groove) @ T @ pair.T_b_cylinder
            gaps.extend(groove_pieces(pair.groove, pair.cylinder, T_groove_wire).distance[:3])
    return np.array(gaps)


@pytest.mark.parametrize("wires", [{}, {"line": 48, "jumper": 47.8}])
def test_no_motion_out_of_the_plane_closes_the_clamp_further(wires):
    section = Section(load_clamp(**wires), Cas())
    final, rng = solve_final_state(section), np.random.default_rng(0)
    planar = np.append(final.q, np.zeros(SLOPES))
    moving = [0, 1, 2, 3, D, S, *range(len(final.q), len(planar))]

    def whole(x):
        state = planar.copy()
        state[moving] = x
        return state

    near = np.array([0.5] * 6 + [5e-3] * SLOPES)
    scale = np.array([1.0] * 6 + [1.0 / 30.0] * SLOPES)  # slopes by what they are at the splints' ends, mm
    assert gaps_in_space(section, planar).min() == pytest.approx(0.0, abs=1e-9)
    for _ in range(2):
        start = planar[moving] + np.append(np.zeros(6), rng.uniform(-2e-3, 2e-3, SLOPES))
        start[4] += 0.3  # opened, with both wires in between
        start[[1, 3]] += 0.15
        end = (
            scale
            * minimize(
                lambda x: x[4],
                start / scale,
                jac=lambda x: np.eye(len(moving))[4],
                bounds=np.column_stack([planar[moving] - near, planar[moving] + near]) / scale[:, None],
                constraints={"type": "ineq", "fun": lambda x: gaps_in_space(section, whole(scale * x))},
                method="SLSQP",
                options={"maxiter": 100, "ftol": 1e-12},
            ).x
        )
        assert gaps_in_space(section, whole(end)).min() >= -1e-4
        assert end[4] == pytest.approx(final.q[D], abs=1e-4)
