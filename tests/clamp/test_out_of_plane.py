"""Whether an equilibrium is one in space, against an optimiser that moves points on the parts' outlines in space."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from outlines import outline
from random_clamps import whole_clamp
from scipy.optimize import minimize

from clamp3d.baselines.cas import Cas
from clamp3d.baselines.factory import contact_model
from clamp3d.clamp.dimensions import Clamp, Wire
from clamp3d.clamp.equilibria import equilibria
from clamp3d.clamp.final_state import solve_final_state
from clamp3d.clamp.loader import load_clamp
from clamp3d.clamp.out_of_plane import out_of_plane
from clamp3d.clamp.section import D, S, Section


def tipping_clamp() -> Clamp:
    """Thick wires against the bolt, on the outer lips of small grooves in both splints: they may turn, and sink."""
    clamp = load_clamp()
    groove = replace(clamp.down_splint.line_groove, radius=8.0, offset=30.0, centre_depth=clamp.down_splint.face_depth)
    above = replace(groove, centre_depth=clamp.up_splint.thickness)
    wire = Wire(diameter=46.0)
    return replace(
        clamp,
        line=wire,
        jumper=wire,
        up_splint=replace(clamp.up_splint, line_groove=above, jumper_groove=above),
        down_splint=replace(clamp.down_splint, line_groove=groove, jumper_groove=groove),
        bolt=replace(clamp.bolt, shank_length=260.0),
    )


class InSpace:
    """A clamp near a state of its section, by points at both ends and in the middle of the lines of its outlines.

    A state: x and y (down) of both wires, d, tilt; the wires' slopes along the wires, and the down splint's yaw and
    pitch. The saddle is a straight edge under the round back, and turns with it.
    """

    def __init__(self, section: Section, q: np.ndarray, near: float = 0.2) -> None:
        clamp, self.section, self.q = section.clamp, section, q
        self.half = 0.5 * clamp.up_splint.length
        self.radii = clamp.line.radius, clamp.jumper.radius
        self.z0 = np.array([*q[:4], q[D], q[S] / section.lever])
        self.rows = [[self._spread(outline(clamp, p, side, 0.01)) for p in ("P1", "P2")] for side in (-1.0, 1.0)]
        here = self.gaps(np.zeros(12), every=True)
        self.rows = [
            [points[gap < near] for points, gap in zip(*two, strict=True)] for two in zip(self.rows, here, strict=True)
        ]

    def _spread(self, points: np.ndarray) -> np.ndarray:
        return np.vstack([np.insert(points, 1, y, axis=1) for y in (-self.half, 0.0, self.half)])

    def gaps(self, move: np.ndarray, every: bool = False):
        """Gaps of wires and splints at ``move`` (12,) from the state, and of faces, shank and back."""
        clamp, bolt = self.section.clamp, self.section.bolt_x
        z = self.z0 + move[:6]
        yaw, pitch = move[10], move[11]
        c, s = math.cos(z[5]), math.sin(z[5])

        def placed(points: np.ndarray) -> np.ndarray:
            x, y, down = points.T
            x, down = x * c + down * s, down * c - x * s
            y, down = y * math.cos(pitch) - down * math.sin(pitch), y * math.sin(pitch) + down * math.cos(pitch)
            x, y = x * math.cos(yaw) + y * math.sin(yaw), y * math.cos(yaw) - x * math.sin(yaw)
            return np.column_stack([x + bolt, y, down + z[4]])

        found = []
        for i, (up, low) in enumerate(self.rows):
            axis = np.array([move[6 + 2 * i], 1.0, move[7 + 2 * i]])
            centre = np.array([z[2 * i], 0.0, z[2 * i + 1]])
            for points in (up, placed(low)):
                off = np.cross(points - centre, axis / np.linalg.norm(axis))
                found.append(np.linalg.norm(off, axis=1) - self.radii[i])
        if every:
            return [found[:2], found[2:]]
        for i, r in enumerate(self.radii):
            aside = abs(z[2 * i] - bolt) / math.hypot(1.0, move[6 + 2 * i])
            found.append(np.array([aside - 0.5 * clamp.bolt.diameter - r]))
        corners = [(x, y, clamp.down_splint.face_depth) for x in (-1.0, 1.0) for y in (-self.half, self.half)]
        width = 0.5 * clamp.down_splint.width
        found.append(placed(np.array(corners) * (width, 1.0, 1.0))[:, 2] - clamp.up_splint.thickness)
        return np.concatenate(found)

    def lowest(self, slopes: np.ndarray) -> float:
        """How much the saddle sinks at most with these slopes (line, jumper, down splint), the rest left free; mm."""
        fixed = [*range(6, 11)]
        reach = 0.5 * self.section.clamp.saddle.length

        def whole(free: np.ndarray) -> np.ndarray:
            move = np.zeros(12)
            move[[0, 1, 2, 3, 4, 5, 11]], move[fixed] = free[:7], slopes
            return move

        # The saddle stands as low as the back's centre line, pitched, does at either end.
        rules = [
            {"type": "ineq", "fun": lambda f: self.gaps(whole(f))},
            {"type": "ineq", "fun": lambda f: np.array([f[7] - f[4] - f[6] * reach, f[7] - f[4] + f[6] * reach])},
        ]
        start = np.zeros(8)
        start[[1, 3]], start[[4, 7]] = 0.01, 0.02
        found = minimize(
            lambda f: f[7], start, constraints=rules, method="SLSQP", options={"ftol": 1e-13, "maxiter": 300}
        )
        assert self.gaps(whole(found.x)).min() > -1e-9
        return float(found.x[7])


def assert_curvature(section: Section, q: np.ndarray, found, share: float = 0.03) -> None:
    """The optimiser's distance along the motion of least curvature rises by what that says, or falls."""
    space, slopes = InSpace(section, q), np.array(found.slopes)
    step = math.sqrt(2.0 * 3e-4 / abs(found.curvature))
    rise = space.lowest(step * slopes) - space.lowest(0.0 * slopes)
    assert 2.0 * rise / step**2 == pytest.approx(found.curvature, rel=share)
    assert not found.stable or rise > 0.0


@pytest.mark.parametrize("k", [0, 1])
def test_the_reference_is_stable_in_space_as_an_optimiser_says(k):
    section = Section(load_clamp(), Cas())
    state = equilibria(section)[k]
    found = out_of_plane(section, state)
    assert found.stable
    assert found.motions == ()
    assert_curvature(section, state.q, found)


def test_a_clamp_on_outer_lips_turns_and_closes_further():
    """Stable in its plane, with a proof; in space it is not: the down splint turns about the bolt, and sinks."""
    section = Section(tipping_clamp(), Cas())
    state = equilibria(section)[-1]
    assert state.curvature > 0.0
    assert {pair for pair, feature in state.active if feature == "shank"} == {("P4", "P6"), ("P4", "P7")}
    found = out_of_plane(section, state)
    assert found.stable is False
    assert found.motions == ("power line and jumper and down splint turn out of the section",)
    # Where all four normals lean by one angle the wires turn half as far as the splint, and as much up or down.
    r, away = 23.0, 0.5 * section.clamp.bolt.diameter + 23.0
    lean = math.asin((38.0 - away) / r)
    slopes = 1.0 + 2.0 * (0.25 + 0.25 * math.tan(lean) ** 2)
    assert found.curvature * slopes == pytest.approx(-0.5 * away * math.tan(lean), rel=1e-6)
    assert_curvature(section, state.q, found)


@pytest.mark.parametrize(("clamp", "k"), [(4, 1), (16, 0), (28, 4)])
def test_random_clamps_rise_out_of_the_plane_as_an_optimiser_says(clamp, k):
    section = Section(whole_clamp(np.random.default_rng([11, clamp])), Cas())
    state = equilibria(section)[k]
    found = out_of_plane(section, state)
    assert found.stable
    assert_curvature(section, state.q, found)


def test_what_is_resisted_at_first_order_rises_whatever_turns():
    section = Section(whole_clamp(np.random.default_rng([11, 24])), Cas())
    state = solve_final_state(section)
    found = out_of_plane(section, state)
    assert found.stable
    assert found.to_dict()["curvature_mm"] is None
    space, rng = InSpace(section, state.q), np.random.default_rng(0)
    here = space.lowest(np.zeros(5))
    for _ in range(4):
        slopes = rng.normal(size=5)
        slopes *= 1e-3 / np.linalg.norm(slopes)
        assert space.lowest(slopes) - here > 1e-4  # as much as the slopes, not as their squares


def test_a_splint_on_flat_faces_turns_freely_and_is_said_to():
    """Both wires loose: the inner faces lie on each other, and slide."""
    clamp = replace(load_clamp(), line=Wire(diameter=2.0), jumper=Wire(diameter=2.0))
    section = Section(clamp, Cas())
    found = out_of_plane(section, solve_final_state(section))
    assert found.stable is None
    assert str(found) == "level: down splint turns out of the section"
    assert found.curvature == 0.0


def test_other_models_say_nothing_of_it():
    section = Section(load_clamp(), contact_model("chords"))
    assert out_of_plane(section, solve_final_state(section)) is None
