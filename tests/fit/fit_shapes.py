"""Test parts with a known truth, made from formulas and trimesh, not by the package."""

import manifold3d
import numpy as np
import trimesh

RADIUS = 23.8012
FACE = -27.726
CENTRE_HEIGHT = -48.7901
CENTRES = (-46.0349, 49.8315)
HALF = np.arccos((FACE - CENTRE_HEIGHT) / RADIUS)
LENGTH = 60.0


def facets(radius: float, arc: float, chord_error: float) -> int:
    return int(np.ceil(arc / (2.0 * np.arccos(1.0 - chord_error / radius))))


def arc(centre, radius, start, stop, n):
    t = np.linspace(start, stop, n + 1)
    return [(centre[0] + radius * np.cos(a), centre[1] + radius * np.sin(a)) for a in t]


def prism(outline, length):
    """Closed prism over an outline (n, 2), from z = 0 to ``length``; every wall is one quad."""
    p = np.array(outline, dtype=float)
    if np.sum(p[:, 0] * np.roll(p[:, 1], -1) - p[:, 1] * np.roll(p[:, 0], -1)) < 0:
        p = p[::-1]
    n = len(p)
    cap = np.asarray(manifold3d.triangulate([np.ascontiguousarray(p)]))
    i, j = np.arange(n), np.roll(np.arange(n), -1)
    faces = np.concatenate([cap[:, ::-1], cap + n, np.stack([i, j, j + n], 1), np.stack([i, j + n, i + n], 1)])
    V = np.concatenate([np.column_stack([p, np.full(n, z)]) for z in (0.0, length)])
    return trimesh.Trimesh(V, faces, process=False)


def splint(chord_error=0.05, *, hole=0.0):
    """Block with two shallow grooves (axis z, mouth -y), its arcs inscribed with the chord error; a bolt hole on y."""
    n = facets(RADIUS, 2 * HALF, chord_error)
    outline = [(-68.5, 0.0), (-68.5, FACE)]
    for x in CENTRES:
        outline += arc((x, CENTRE_HEIGHT), RADIUS, np.pi / 2 + HALF, np.pi / 2 - HALF, n)
    outline += [(68.5, FACE), (68.5, 0.0)]
    mesh = prism(outline, LENGTH)
    if hole:
        tool = trimesh.creation.cylinder(hole, 200.0, sections=facets(hole, 2 * np.pi, chord_error))
        tool.apply_transform(trimesh.transformations.rotation_matrix(np.pi / 2, [1, 0, 0], [0, 0, 0]))
        tool.apply_translation([0.0, 0.0, LENGTH / 2])
        mesh = trimesh.boolean.difference([mesh, tool], engine="manifold")
    return mesh


def scan(step, sigma, seed, *, width=40.0, length=40.0):
    """Open patch of one groove and the flat beside it: a jittered grid on the true surface, scattered by ``sigma``."""
    rng = np.random.default_rng(seed)
    x, z = np.arange(-width / 2, width / 2 + 1e-9, step), np.arange(0.0, length + 1e-9, step)
    X, Z = np.meshgrid(x, z, indexing="ij")
    X = X + rng.uniform(-0.3, 0.3, X.shape) * step
    Z = Z + rng.uniform(-0.3, 0.3, Z.shape) * step
    Y = np.maximum(FACE, CENTRE_HEIGHT + np.sqrt(np.maximum(RADIUS**2 - X**2, 0.0)))
    V = np.stack([X, Y, Z], axis=-1).reshape(-1, 3) + rng.normal(0.0, sigma, (X.size, 3))
    i = np.arange(X.size).reshape(X.shape)
    a, b, c, d = i[:-1, :-1].ravel(), i[1:, :-1].ravel(), i[1:, 1:].ravel(), i[:-1, 1:].ravel()
    return V, np.concatenate([np.c_[a, b, c], np.c_[a, c, d]])


def off_groove(feature, x, T=None):
    """How far the fitted surface is at most, over its covered range, from the true groove at ``x`` of a part at T."""
    T = np.eye(4) if T is None else T
    t, z = (q.ravel() for q in np.meshgrid(np.linspace(-1, 1, 15) * feature.half_angle, np.linspace(-0.5, 0.5, 7)))
    local = np.stack([feature.radius * np.sin(t), -feature.radius * np.cos(t), z * feature.length], axis=1)
    points = local @ feature.T_part_feature[:3, :3].T + feature.T_part_feature[:3, 3]
    own = (points - T[:3, 3]) @ T[:3, :3] - np.array([x, CENTRE_HEIGHT, 0.0])
    return np.abs(np.hypot(own[:, 0], own[:, 1]) - RADIUS).max()
