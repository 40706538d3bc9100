"""Search for the least signed distance from one solid that a point of another's faces has; it can be taken up again."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from clamp3d.brep.surfaces import OTHER
from clamp3d.collide.answer import Distance
from clamp3d.core.linear import dot
from clamp3d.core.pose import Array

if TYPE_CHECKING:
    from clamp3d.collide.faces import FaceModel

VERDICT_WIDTH = 0.01
"""Width of the bounds, by the contact threshold, at which a search for the verdict alone ends without one."""
FEW = 100
"""Pieces added each way before the rest of those that may be is spent."""
_LOOKS = 4
"""Pieces looked at, those of the file among them, for each that may be added while few are asked for."""
_HURRY, _PATIENCE = 400, 3200
"""So many pieces are added, for a depth and for a verdict, before a search can end because it gains too little."""
_GAIN = 0.98
"""Twice as many pieces that leave more than this share of the way to the next threshold tell next to nothing."""
_ANY = 2**62


class Descent:
    """The compiled branch and bound for one solid's pieces, with all that waits in it.

    ``pieces``: corners, parameters, faces, sags of borders, in a's frame; ``tree`` over them, in their own frame, which
    is placed by ``T`` (4, 4); ``surfaces``: kind, size, frame, deviation. ``wanted``: contact and clearance threshold,
    and the width of the bounds at which it ends, minus that to end where the verdict is certain.
    """

    def __init__(
        self,
        a: FaceModel,
        pieces: tuple[NDArray[Any], ...],
        tree: tuple[NDArray[Any], ...],
        T: Array,
        surfaces: tuple[NDArray[Any], ...],
        wanted: tuple[float, float, float],
        most: int,
    ) -> None:
        from clamp3d.collide.faces_block import WORK
        from clamp3d.collide.faces_hollow import TRIED
        from clamp3d.collide.faces_kernel import RESULT, SPACE

        n, nodes, self.out = len(pieces[0]), len(tree[0]), np.zeros(RESULT)
        rows = [np.empty((n + most, *given.shape[1:]), dtype=given.dtype) for given in pieces]
        for row, given in zip(rows, pieces, strict=True):
            row[:n] = given
        self.out[0], self._first, self._state, self.done = np.inf, n, np.zeros(3, dtype=np.int64), False
        self._given = (*rows, np.empty(n + most + nodes), n, *tree, T, *surfaces, *a.arrays, a.slack, *wanted)
        self._work = (
            np.empty(TRIED + len(a.faces.kind)), np.empty((WORK, 3, 3)),
            np.empty(SPACE + n + most + 2 * nodes, dtype=np.int64), self._state, self.out,
        )  # fmt: skip

    def go(self, most: int, above: float, looks: int = _ANY) -> float:
        """Lower bound after at most ``most`` pieces in all; what is known to be ``above`` that is not looked at.

        ``looks`` limits the pieces that are looked at, those of the file among them.
        """
        from clamp3d.collide.faces_kernel import descend

        found = float(descend(*self._given, most, looks, above, *self._work))
        self.done = self.added < most and self.out[9] <= looks
        return found

    @property
    def added(self) -> int:
        """Pieces added so far."""
        return int(self._state[0]) - self._first


class Search:
    """Least signed distance from ``a`` of b's faces, ``b`` at ``T`` (4, 4) in a's frame.

    It ends when the bounds are on the same side of ``contact`` and ``clearance`` mm, or no further apart than ``tol``,
    where that is given. At most ``most`` pieces are added in all. A search ends before where twice as many tell next to
    nothing more: soon, if ``brief`` is given and its bounds are then further apart than that (mm).
    """

    def __init__(
        self,
        a: FaceModel,
        b: FaceModel,
        T: Array,
        contact: float,
        clearance: float,
        tol: float | None,
        most: int,
        brief: float | None = None,
    ) -> None:
        R, t = T[:3, :3], T[:3, 3]
        frames = dot(b.faces.frame, R.T)
        frames[:, 0] += t
        pieces = dot(b.faces.corners, R.T) + t, b.faces.uv, b.faces.face, b.faces.sag
        surfaces = b.faces.kind, b.faces.size, np.ascontiguousarray(frames.reshape(-1, 12)), b.faces.deviation
        wanted = contact, clearance, -VERDICT_WIDTH * contact if tol is None else tol
        self._descent = Descent(a, pieces, b.arrays[3:7], np.ascontiguousarray(T), surfaces, wanted, most)
        self._upper, self._most, self._brief, self.done = np.inf, most, brief, False
        free = any((x.faces.kind == OTHER).any() for x in (a, b))
        self._patience = most if not free else _PATIENCE if brief is None else _HURRY
        self._steps = (-contact, contact, clearance) if tol is None else ()
        self._points: tuple[Array, Array] | tuple[None, None] = None, None

    def more(self, most: int, least: float = np.inf, upper: float = np.inf) -> Distance:
        """What is known with at most ``most`` pieces in all; points in a's frame, b's point first.

        What is above ``least``, and points not below ``upper``, both found by a search the other way, are not looked
        for: without points where none is found below. ``estimate`` is how far at least some point of b is outside of a.
        """
        out, most = self._descent.out, min(most, self._most)
        out[0] = min(out[0], upper)
        before = out[0]
        looks = _LOOKS * most if most <= FEW else _ANY
        part, gap = min(most, self._patience), np.inf
        while True:
            lower = self._descent.go(part, least, looks)
            self.done = self._descent.done
            left = min([x for x in (*self._steps, float(out[0])) if x > lower], default=lower) - lower
            if self.done or part == most or (left > _GAIN * gap and left > (self._brief or 0.0)):
                break
            part, gap = min(2 * part, most), left
        if out[0] < before:
            self._upper, self._points = float(out[0]), (out[1:4].copy(), out[4:7].copy())
        p, q = self._points if self._upper <= out[0] else (None, None)
        return Distance(lower, float(out[0]), p, q, level="faces", method="faces", estimate=float(out[8]))
