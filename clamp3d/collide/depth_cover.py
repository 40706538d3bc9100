"""How far the origin lies from the edge of a union of convex sets of translations, by branch and bound.

Cubes of translations are cut until each lies in one of the sets, or too far away to matter.
"""

from __future__ import annotations

import heapq
import itertools

import numpy as np

from clamp3d.collide.depth_convex import crossed_normals, supports
from clamp3d.collide.hull import Hull, hull
from clamp3d.core.linear import dot, norm
from clamp3d.core.nonnegative import nnls
from clamp3d.core.pose import Array

_CORNERS = np.array(list(itertools.product((-0.5, 0.5), repeat=3)))
_SPREAD = 300
"""Directions that a Minkowski difference with too many normals is bounded in from inside."""
CELLS = 60_000
"""Cubes looked at before the search ends with the bound that it has."""


def difference(a: Hull, b: Hull) -> Array:
    """Planes (k, 4), n . t <= d, of a convex set of translations of b at which it overlaps a.

    Exact for small polyhedra, else a polyhedron inside. Raises ValueError if they are too thin for one.
    """
    here = np.eye(4)
    sa, sb = supports(a, here), supports(b, here)
    crossed = crossed_normals(a, here, b, here)
    if crossed is None:
        k = np.arange(_SPREAD) + 0.5
        up, turn = 1.0 - 2.0 * k / _SPREAD, np.pi * (1.0 + 5.0**0.5) * k
        N = np.column_stack([np.sqrt(1.0 - up * up) * np.cos(turn), np.sqrt(1.0 - up * up) * np.sin(turn), up])
        N = np.vstack([N, a.planes[:200, :3], -b.planes[:200, :3]])
        made = hull(sa(N) - sb(-N)).planes
        return np.column_stack([made[:, :3], -made[:, 3]])
    N = np.vstack([a.planes[:, :3], -b.planes[:, :3], crossed])
    return np.column_stack([N, (N * (sa(N) - sb(-N))).sum(axis=1)])


def nearest_behind(planes: Array, start: Array) -> Array:
    """The point (3,) nearest to ``start`` (3,) with n . x >= d for all ``planes`` (k, 4); ``start`` if there is none.

    Lawson and Hanson, *Solving Least Squares Problems*, 1974, problem LDP.
    """
    lack = planes[:, 3] - dot(planes[:, :3], start)
    size = float(np.abs(lack).max())
    if not lack.max() > 0.0:
        return start
    E, goal = np.vstack([planes[:, :3].T, lack / size]), np.array([0.0, 0.0, 0.0, 1.0])
    r = dot(E, nnls(E, goal)) - goal
    return start if abs(r[3]) < 1e-14 else np.asarray(start - size * r[:3] / r[3])


class Union:
    """Convex sets of translations within ``limit`` mm, each by its planes."""

    def __init__(self, sets: list[Array], limit: float) -> None:
        self.sets: list[tuple[Array, Array]] = []
        self.limit = limit
        self.whole = False  # one set holds all translations up to the limit
        for planes in sets:
            N, d = planes[:, :3], planes[:, 3]
            if (d <= -limit).any():  # does not come so near
                continue
            near = d < limit
            self.whole |= not near.any()
            self.sets.append((N[near], d[near]))
        self.sets.sort(key=lambda item: -float(item[1].min(initial=limit)))

    def reach(self, t: Array) -> Array:
        """How far inside one of the sets translations ``t`` (k, 3) lie at least; negative outside all of them."""
        found = np.full(len(t), -np.inf)
        for N, d in self.sets:
            np.maximum(found, (d - dot(t, N.T)).min(axis=1), out=found)
        return found

    def open_cubes(self, at: Array, half: float) -> Array:
        """Those of the cubes around ``at`` (k, 3), of half size ``half``, that no set holds alone."""
        for N, d in self.sets:
            if not len(at):
                break
            at = at[(dot(at, N.T) + half * np.abs(N).sum(axis=1) > d).any(axis=1)]
        return at

    def shortest(self, nodes: int) -> tuple[float, Array | None]:
        """Shortest translation outside all sets: a lower bound of its length, and itself where the search ends.

        To be outside, a translation must lie behind a plane of every set. Best first over which plane of which set:
        the translation of the first node that is outside is the shortest.
        """
        if self.whole or not self.sets:
            return self.limit if self.whole else 0.0, None
        none = np.empty((0, 4))
        heap: list[tuple[float, int, Array, Array]] = [(0.0, 0, none, np.zeros(3))]
        count = 0
        while heap:
            size, _, planes, t = heap[0]
            if size >= self.limit:
                return self.limit, None
            inside = [float((d - dot(N, t)).min()) for N, d in self.sets]
            left = [k for k, depth in enumerate(inside) if depth > 1e-12 * self.limit]
            if not left:
                return size, t
            if count > nodes:
                return size, None
            heapq.heappop(heap)
            k = max(left, key=lambda k: inside[k] / len(self.sets[k][1]) ** 0.5)
            N, d = self.sets[k]
            for n, offset in zip(N, d, strict=True):
                chosen = np.vstack([planes, [*n, offset]])
                new = nearest_behind(chosen, np.zeros(3))
                lack = float((chosen[:, 3] - dot(chosen[:, :3], new)).max())
                length = norm(new)
                if lack <= 1e-9 * self.limit and length < self.limit:
                    count += 1
                    heapq.heappush(heap, (max(length, size), count, chosen, new))
        return self.limit, None

    def way_out(self, t: Array) -> Array:
        """A translation (3,) outside all sets, near ``t`` (3,) that is outside, as short as planes near it allow."""
        best = t
        for _ in range(8):
            # Of each set the plane that t is furthest behind: all of them together are a convex region outside.
            rows = [(N[k], d[k]) for N, d in self.sets for k in [int(np.argmax(dot(N, best) - d))]]
            new = nearest_behind(np.array([[*n, d] for n, d in rows]), np.zeros(3))
            if not norm(new) < norm(best) * (1.0 - 1e-9):
                break
            best = new
        return best

    def clearance(self, relative: float, absolute: float) -> tuple[float, Array | None]:
        """A proven lower bound of the distance of the origin from the outside, and a point outside if one was found.

        The search ends when the bound is within ``relative`` or ``absolute`` mm of the point's distance, or of the
        limit; or is too long.
        """
        if self.whole:
            return self.limit, None
        best: Array | None = None
        limit = half = self.limit
        at, seen, floor = np.zeros((1, 3)), 0, np.inf
        while len(at):
            near = np.linalg.norm(np.maximum(np.abs(at) - half, 0.0), axis=1)
            closed = near >= limit - max(relative * limit, absolute)
            floor = min(floor, float(near[closed].min(initial=np.inf)))
            at = self.open_cubes(at[~closed], half)
            outside = at[self.reach(at) <= 0.0]
            size = np.linalg.norm(outside, axis=1)
            for k in np.argsort(size, kind="stable")[:3]:
                t = self.way_out(outside[k])
                if norm(t) < limit:
                    best, limit = t, norm(t)
            seen += len(at)
            if seen > CELLS or half < 1e-9 * self.limit:
                near = np.linalg.norm(np.maximum(np.abs(at) - half, 0.0), axis=1)
                return min(floor, limit, float(near.min(initial=np.inf))), best
            half *= 0.5
            at = (at[:, None] + 2.0 * half * _CORNERS[None]).reshape(-1, 3)
        return min(floor, limit), best
