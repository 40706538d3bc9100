"""Where a clamp closes, found again from points on its outlines by a general optimiser.

The outlines of the two splints are points, a wire's centre keeps its radius away from each of them; bolt, holes, slot
and saddle are written down from their drawings. Everything has its own coordinates: the wires' centres, the down
splint's x and y and tilt, the bolt's x, the saddle's x and height. The saddle's height is lowered by SLSQP [Kraft, A
software package for sequential quadratic programming, 1988], first with a coarse row of points, then with fine ones
where something is near. Nothing is taken from the solver's closed forms, its joints or its gradients. Points miss at
most ``_FINE**2 / (8 r)`` of an arc, 1e-6 mm.
"""

import math

import numpy as np
from scipy.optimize import minimize

_COARSE, _FINE = 0.05, 0.005
_NEAR = (0.6, 0.03)
"""Gaps in mm of the points that count, of the coarse and of the fine row."""


def _row(start, end, step):
    n = max(2, math.ceil(math.dist(start, end) / step) + 1)
    return np.linspace(start, end, n)


def outline(clamp, part, side, step):
    """Points (n, 2) on the outline of "P1" or "P2" on one side of the bolt, in the part's own (x, y), y down."""
    own, middle = (clamp.up_splint, clamp.up_splint.width / 2) if part == "P1" else (clamp.down_splint, 0.0)
    face = clamp.up_splint.thickness if part == "P1" else clamp.down_splint.face_depth
    into = -1.0 if part == "P1" else 1.0  # from the face into the material
    groove = own.line_groove if side < 0.0 else own.jumper_groove
    x, R = middle + side * groove.offset, groove.radius
    deep = into * (groove.centre_depth - face)  # of the centre, in the material
    mouth = math.sqrt(R * R - deep * deep)
    half = math.acos(max(-1.0, min(1.0, -deep / R)))
    angle = np.linspace(-half, half, math.ceil(2.0 * half * R / step) + 2)
    arc = np.column_stack([x + R * np.sin(angle), groove.centre_depth + into * R * np.cos(angle)])
    edge = middle + side * own.width / 2
    lips = sorted((x - mouth, x + mouth), key=lambda lip: abs(lip - middle))
    faces = [_row(np.array([a, face]), np.array([b, face]), step) for a, b in ((middle, lips[0]), (lips[1], edge))]
    return np.vstack([arc, *faces, _row(np.array([edge, face]), np.array([edge, face + into * 0.5 * R]), step)])


class Outlines:
    """A clamp by points; a state is (x6, y6, x7, y7, x, y and tilt of P2, bolt x, saddle x and height), P1 at rest."""

    def __init__(self, clamp):
        self.clamp = clamp
        self.middle = clamp.up_splint.width / 2
        self.rows = {
            step: [(outline(clamp, "P1", side, step), outline(clamp, "P2", side, step)) for side in (-1.0, 1.0)]
            for step in (_COARSE, _FINE)
        }
        self.radii = clamp.line.radius, clamp.jumper.radius
        self.clear = clamp.saddle.radius - clamp.down_splint.back_radius

    def state(self, q):
        """The state of a `Section`'s ``q``, with the parts placed by hand."""
        clamp = self.clamp
        bolt = self.middle + q[6]
        saddle, x = bolt + q[7], bolt + q[7] + q[8]
        return np.array([*q[:4], x, q[4] - q[9], q[5] / (clamp.down_splint.width / 2), bolt, saddle, q[4]])

    def gaps(self, z, chosen):
        """All gaps: wires to the points ``chosen``, wires to the shank, faces, slot, saddle, joints."""
        clamp, down = self.clamp, self.clamp.down_splint
        x, y, tilt, bolt, saddle, height = z[4:]
        c, s = math.cos(tilt), math.sin(tilt)

        found = []
        for i, (up, low) in enumerate(chosen):
            centre, r, side = z[2 * i : 2 * i + 2], self.radii[i], 2.0 * i - 1.0
            for points in (up, _placed(z, low)):
                found.append(np.hypot(*(points - centre).T) - r)
            found.append(np.array([side * (centre[0] - bolt) - 0.5 * clamp.bolt.diameter - r]))
        half, face = down.width / 2, down.face_depth
        thickness, width = clamp.up_splint.thickness, clamp.up_splint.width
        stops = [height - self.clear + clamp.saddle.radius * math.cos(clamp.saddle.half_angle)]
        for side in (-1.0, 1.0):
            corner = _placed(z, np.array([[side * half, face]]))[0]
            inner = 0.0 <= corner[0] <= width
            ux, uy = self.middle + side * width / 2 - x, thickness - y
            found.append(np.array([corner[1] - thickness if inner else face - (ux * s + uy * c)]))
            ex, ey = saddle + side * clamp.saddle.width / 2 - x, stops[0] - y
            found.append(np.array([ex * s + ey * c - down.underside_depth]))
            walls = _placed(z, np.array([[side * down.slot_width / 2, v] for v in (down.slot_bottom, face)]))
            found.append(side * (walls[:, 0] - bolt) - 0.5 * clamp.bolt.diameter)
        return np.concatenate(found)

    def joints(self, z):
        """What the joints leave: round back over the saddle's arc, bolt in the hole, saddle on the bolt (>= 0)."""
        clamp, joints = self.clamp, self.clamp.joints
        x, y, _, bolt, saddle, height = z[4:]
        hole = 0.5 * (clamp.up_splint.hole_diameter - clamp.bolt.diameter) * joints.hole
        washer = 0.5 * (clamp.saddle.hole_diameter - clamp.bolt.diameter) * joints.washer
        slide = math.inf if joints.saddle else 0.0
        # The arc's centre is `clear` above the height. Toward the arc the back's centre stays within `clear` of it,
        # beside the arc its own radius away from the nearer lip, and above it is free.
        off, below = abs(x - saddle), y - height + self.clear
        half = clamp.saddle.half_angle
        if math.atan2(off, below) <= half:
            within = self.clear - math.hypot(off, below)
        else:
            lip = clamp.saddle.radius * math.sin(half) - off, clamp.saddle.radius * math.cos(half) - below
            within = math.hypot(*lip) - clamp.down_splint.back_radius
        plays = ((hole, bolt - self.middle), (washer, saddle - bolt), (slide, x - saddle))
        walls = (play - side * shift for play, shift in plays if math.isfinite(play) for side in (-1.0, 1.0))
        return np.array([within, *walls])

    def lowest(self, q):
        """The saddle's least height near the state ``q`` of a `Section`, and by how much ``q`` itself overlaps; mm."""
        z = self.state(q)
        overlap = -min(float(self.gaps(z, self.rows[_FINE]).min()), float(self.joints(z).min()))
        z[[1, 3]] += 0.01
        z[[5, 9]] += 0.02
        for step, near in zip((_COARSE, _FINE), _NEAR, strict=True):
            z = self._descend(z, step, near)
        return float(z[9]), max(0.0, overlap)

    def _descend(self, z, step, near):
        """Down from ``z`` in stretches short enough that the points near its beginning are those that count."""
        spread = np.array([1.0] * 6 + [0.5 / self.clamp.down_splint.width] + [1.0] * 3) * 0.4 * near
        for _ in range(20):
            chosen = [
                tuple(
                    points[np.hypot(*(at - z[2 * i : 2 * i + 2]).T) - self.radii[i] < near]
                    for points, at in ((up, up), (low, _placed(z, low)))
                )
                for i, (up, low) in enumerate(self.rows[step])
            ]
            rules = [
                {"type": "ineq", "fun": lambda v, rows=chosen: self.gaps(v, rows)},
                {"type": "ineq", "fun": self.joints},
            ]
            before, z = (
                z,
                minimize(
                    lambda v: v[9],
                    z,
                    jac=lambda v: np.eye(10)[9],
                    method="SLSQP",
                    constraints=rules,
                    bounds=np.column_stack([z - spread, z + spread]),
                    options={"ftol": 1e-12, "maxiter": 60},
                ).x,
            )
            if before[9] - z[9] < 1e-9:
                break
        return z


def _placed(z, points):
    """Points (n, 2) of the down splint at the state ``z``."""
    c, s = math.cos(z[6]), math.sin(z[6])
    return np.column_stack([z[4] + points[:, 0] * c + points[:, 1] * s, z[5] - points[:, 0] * s + points[:, 1] * c])
