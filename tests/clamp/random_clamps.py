"""Random clamps of all dimensions, closed by every command and judged by means that know nothing of the solver."""

import math
from collections import Counter, defaultdict
from dataclasses import dataclass, field, replace

import numpy as np

from clamp3d import load_clamp
from clamp3d.baselines import Cas
from clamp3d.bench.stress.assemblies.clamps import Case
from clamp3d.bench.stress.assemblies.family import EXACT, Assemblies, Rest, Truths
from clamp3d.clamp.dimensions import Joints, Wire
from clamp3d.clamp.equilibria import equilibria
from clamp3d.clamp.final_state import solve_final_state
from clamp3d.clamp.section import D, Section
from clamp3d.errors import SolverError
from tests.clamp.outlines import Outlines

OPTIMISER = 1e-5
"""Mm to which the optimiser on points agrees."""
_PLAY = Joints(hole=True, saddle=True, washer=True)


@dataclass
class Score:
    """``asked`` counts of each check, the ``worst`` of each, and ``findings``: (number of the clamp, what is wrong)."""

    asked: Counter[str] = field(default_factory=Counter)
    worst: dict[str, float] = field(default_factory=dict)
    findings: list[tuple[int, str]] = field(default_factory=list)

    def note(self, k, what, error, allowed):
        """Count a check of clamp ``k``; not a number is a finding too."""
        self.asked[what] += 1
        self.worst[what] = max(self.worst.get(what, 0.0), error)
        if not error <= allowed:
            self.findings.append((k, f"{what}: {error:.3g}"))


def changed(thing, values):
    """The thing with other values at dotted names, all at once."""
    inner = defaultdict(dict)
    for path, value in values.items():
        name, _, rest = path.partition(".")
        inner[name][rest] = value
    made = {key: own[""] if "" in own else changed(getattr(thing, key), own) for key, own in inner.items()}
    return replace(thing, **made)


def whole_clamp(rng, *, major=0.25):
    """A clamp with all dimensions varied by 15 %; the share ``major`` of the grooves are major arcs."""
    base = load_clamp()

    def about(value, share=0.15):
        return float(value * rng.uniform(1.0 - share, 1.0 + share))

    while True:
        bolt = float(rng.choice([12.0, 16.0, 20.0, 24.0]) * rng.uniform(0.95, 1.05))
        thickness, face, back = about(27.7), about(24.55), about(48.0)
        grooves = []
        for surface, sign in ((thickness, 1.0), (thickness, 1.0), (face, -1.0), (face, -1.0)):
            half = rng.uniform(0.3, 1.4) if rng.random() >= major else rng.uniform(1.6, 2.2)
            radius = float(rng.uniform(8.0, 30.0) if half < 1.5 else rng.uniform(5.0, 13.0))
            depth = float(surface + sign * radius * math.cos(half))
            old = base.up_splint.line_groove
            grooves.append(replace(old, radius=radius, offset=about(48.0, 0.2), centre_depth=depth))
        try:
            up = replace(
                base.up_splint,
                width=about(137.0),
                thickness=thickness,
                hole_diameter=bolt + rng.uniform(0.5, 3.0),
                line_groove=grooves[0],
                jumper_groove=grooves[1],
            )
            down = replace(
                base.down_splint,
                width=about(137.0),
                face_depth=face,
                back_radius=back,
                back_half_angle_deg=float(rng.uniform(36.0, 50.0)),
                slot_width=about(42.0, 0.2),
                slot_length=bolt + rng.uniform(0.5, 4.0),
                max_tilt_deg=None,
                line_groove=grooves[2],
                jumper_groove=grooves[3],
            )
            saddle = replace(
                base.saddle,
                radius=back + rng.uniform(0.3, 3.0),
                width=about(44.0),
                apex_thickness=about(12.19),
                hole_diameter=bolt + rng.uniform(0.5, 3.0),
            )
            wires = [
                Wire(diameter=float(2.0 * rng.uniform(0.15, 1.2) * min(grooves[i].radius, grooves[i + 2].radius)))
                for i in (0, 1)
            ]
            return replace(
                base,
                name="random",
                line=wires[0],
                jumper=wires[1],
                up_splint=up,
                down_splint=down,
                saddle=saddle,
                bolt=replace(base.bolt, diameter=bolt, shank_length=about(170.0)),
                nut=replace(base.nut, across_flats=1.5 * bolt),
            )
        except ValueError:
            continue


def check_clamps(n, seed, first=0, listen=lambda k, score: None):
    """Check ``n`` random clamps from number ``first`` on.

    All are closed by an optimiser too, and each sixth has its equilibria from a grid.
    """
    score = Score()
    for k in range(first, first + n):
        rng = np.random.default_rng([seed, k])
        clamp = whole_clamp(rng)
        for joints in (Joints(), _PLAY):
            optimised(score, k, replace(clamp, joints=joints))
        if k % 6 == 0:
            grid(score, k, whole_clamp(rng, major=0.0))
        listen(k, score)
    return score


def optimised(score, k, clamp):
    """The distance against that of the optimiser on sampled outlines."""
    play = "with play" if clamp.joints.hole else "without play"
    try:
        final = solve_final_state(Section(clamp, Cas()))
    except SolverError as error:
        score.note(k, f"refused {play} ({error})", np.inf, 0.0)
        return
    q = final.q
    least, overlap = Outlines(clamp).lowest(q)
    score.note(k, f"optimiser {play}", max(abs(least - float(q[D])), overlap), OPTIMISER)


def grid(score, k, clamp):
    """All equilibria of a clamp of minor arcs against those of a grid of tilts."""
    states = equilibria(Section(clamp, Cas()))
    truths = Truths(Assemblies([Case(clamp)], np.arange(1)))
    rest = Rest(states[0].q, tuple(state.q for state in states))
    score.note(k, "equilibria at rest", truths.error(0, rest), EXACT)
    score.note(k, "equilibria named", float(np.isfinite(truths.missed(0, rest))), 0.0)
