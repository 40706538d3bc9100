"""Two solids from CAD: what their meshes and Open CASCADE say of them, from quick questions to slow ones."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from functools import cached_property

import numpy as np

from clamp3d.engine.answer import Distance, Enough
from clamp3d.engine.coaxial import coaxial_distance
from clamp3d.engine.exact import SHARES, exact_distance, exact_overlap, exact_probe
from clamp3d.engine.mesh_distance import CUTS, FEW_CUTS, meshes_distance, surface_distance
from clamp3d.engine.model import CAD_CHORDS, MOST_FINE, QUICK_TRIANGLES, CadModel
from clamp3d.engine.near_faces import faces_nearby
from clamp3d.engine.slab import slab_distance
from clamp3d.errors import Clamp3dError
from clamp3d.files.faces import SPHERE
from clamp3d.files.open_cascade import TOLERANCE
from clamp3d.geometry.mesh import IntArray
from clamp3d.geometry.pose import Array

Levels = Iterator[tuple[str, Distance]]
"""What one level after the other says, each measured when it is asked for: its name and its bounds."""

_COINCIDENT = 1e-4
"""Overlap (mm) beyond which there is a common part to ask for; up to it faces coincide, which meshes prove."""
_OPEN = 1.02
"""Ratio of a bound that decides nothing to the closest that it can be at which it is sharpened no further."""


class CadPair:
    """Two solids, ``b`` at ``T`` (4, 4) in a's frame, and which questions about them are left.

    ``enough`` says whether bounds decide what is to be known: then a level sharpens them no further.
    """

    def __init__(self, a: CadModel, b: CadModel, T: Array, enough: Enough) -> None:
        self.a, self.b, self.T, self.enough = a, b, T, enough
        self._has_meshes = bool(a.chords and b.chords)
        self._has_asked_fine_meshes = False
        self._coarse = Distance()
        self._has_common_part = False
        self._attested = 0.0

    def levels(self, closed_forms: Levels) -> Levels:
        """All levels; ``closed_forms`` come after those that take less time."""
        if self._has_meshes:
            self._coarse = meshes_distance(self.a, self.b, self.T, CAD_CHORDS[0], self.enough, FEW_CUTS)
            yield "meshes", self._coarse
            slab = slab_distance(self.a, self.b, self.T, self.enough)
            if slab is not None:
                yield "flat faces", slab
        sections = coaxial_distance(self.a, self.b, self.T, self.enough)
        if sections is not None:
            yield "sections", sections
        yield from self._nearest()
        if self._attested <= _COINCIDENT and self._is_small:
            yield from self._fine_meshes()
        yield from self._common_part(quick=True)
        yield from closed_forms
        yield from self._fine_meshes()
        yield from self._common_part(quick=False)
        if not self._has_asked_fine_meshes:  # Open CASCADE did not find the common part
            yield "meshes", self._fine_meshes_distance(CUTS)

    def _nearest(self) -> Levels:
        """What some points attest, and Open CASCADE's distance, which is bound by what contradicts it now and then."""
        probe = exact_probe(self.a, self.b, self.T)
        yield "exact", probe
        self._attested = -probe.upper
        if probe.upper <= TOLERANCE and not (_may_be_ball(self.a) or _may_be_ball(self.b)):
            return  # they touch or overlap: of other bodies than balls Open CASCADE would say 0
        at_most = probe.upper
        if self._has_meshes and (self.a.is_free_form or self.b.is_free_form):
            # Of free-form faces it may take a gap for the least of several: meshes must not contradict that.
            at_most = min(at_most, self._coarse.upper)
            for level, meshes in self._fine_meshes():
                at_most = min(at_most, meshes.upper)
                yield level, meshes
        distance = exact_distance(self.a, self.b, self.T)
        yield "exact", distance if distance.lower <= at_most else replace(distance, lower=-np.inf)

    @cached_property
    def _nearby(self) -> tuple[IntArray, IntArray]:
        """The faces of both solids that are near the other one."""
        return faces_nearby(self.a.face_meshes, self.b.face_meshes, self.T)

    @cached_property
    def _may_mesh_finely(self) -> bool:
        """Whether meshes of both solids that are fine there are not too large."""
        near_a, near_b = self._nearby
        return max(self.a.fine_triangles_near(near_a), self.b.fine_triangles_near(near_b)) <= MOST_FINE

    @property
    def _is_small(self) -> bool:
        """Whether fine meshes of both solids, which other pairs share, take less time than Open CASCADE."""
        return self._has_meshes and self.a.fine_triangles + self.b.fine_triangles <= QUICK_TRIANGLES

    def _fine_meshes(self) -> Levels:
        """What fine meshes say, once, if they are not too large."""
        if not self._has_asked_fine_meshes and self._has_meshes and self._may_mesh_finely:
            yield "meshes", self._fine_meshes_distance(FEW_CUTS)

    def _common_part(self, *, quick: bool) -> Levels:
        """What the common part says, from coarse samples to fine ones, which take longer: none after one that fails.

        Once it was found it is asked no more. ``quick``: the first, which makes it, within a second, not in five.
        """
        if self._has_common_part:
            return
        for share in SHARES:
            overlap = self._overlap(share, quick=quick and share == SHARES[0])
            yield "exact", overlap
            if np.isinf(overlap.lower):
                break
            self._has_common_part = True

    def _overlap(self, share: float, *, quick: bool) -> Distance:
        """What one of `SHARES` says of the common part, sharpened until that is enough, or finer samples are to."""

        def end(bounds: Distance, closest: Distance) -> bool:
            if self.enough(closest):
                return self.enough(bounds)
            return share != SHARES[-1] or bounds.lower >= _OPEN * closest.lower  # finer samples may decide it

        return exact_overlap(self.a, self.b, self.T, share, end=end, quick=quick, attested=self._attested)

    def _fine_meshes_distance(self, cuts: int) -> Distance:
        """What meshes say that are fine where the solids are near each other; nothing where they take too long."""
        self._has_asked_fine_meshes = True
        try:
            if self._has_meshes:
                near_a, near_b = self._nearby
                a, b = self.a.outer_near(near_a, CAD_CHORDS[-1]), self.b.outer_near(near_b, CAD_CHORDS[-1])
            else:  # coarse ones do not close: fine ones may
                a, b = (model.outer(CAD_CHORDS[-1], thorough=True) for model in (self.a, self.b))
        except Clamp3dError:
            return Distance(method="without fine meshes")
        distance = surface_distance(a, b, self.T, self.enough, cuts)
        return replace(distance, method=f"meshes (FCL), chord error {CAD_CHORDS[-1]:.2g} mm")


def _may_be_ball(model: CadModel) -> bool:
    """Whether all faces of a solid are spherical, so that Open CASCADE's distance may be signed."""
    return bool((model.shape.surfaces.kind == SPHERE).all())
