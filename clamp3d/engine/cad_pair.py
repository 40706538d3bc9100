"""Two solids from CAD: what their meshes and Open CASCADE say of them, from quick questions to slow ones."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from clamp3d.engine.answer import Distance, Enough
from clamp3d.engine.coaxial import coaxial_distance
from clamp3d.engine.exact import SHARES, exact_distance, exact_overlap, exact_probe
from clamp3d.engine.mesh_distance import CUTS, FEW_CUTS, meshes_distance
from clamp3d.engine.model import CAD_CHORDS, QUICK_TRIANGLES, Model
from clamp3d.engine.slab import slab_distance
from clamp3d.errors import Clamp3dError
from clamp3d.files.faces import SPHERE
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

    def __init__(self, a: Model, b: Model, T: Array, enough: Enough) -> None:
        self.a, self.b, self.T, self.enough = a, b, T, enough
        self._chords = [chord for chord in a.chords if chord in b.chords]
        self._has_fine_meshes = len(self._chords) > 1
        self._is_small = self._has_fine_meshes and a.fine_triangles + b.fine_triangles <= QUICK_TRIANGLES
        self._has_common_part = False
        self._attested = 0.0

    def levels(self, closed_forms: Levels) -> Levels:
        """All levels; ``closed_forms`` come after those that take less time."""
        if self._chords:
            yield "meshes", self._meshes(self._chords[0])
            slab = slab_distance(self.a, self.b, self.T, self.enough)
            if slab is not None:
                yield "boxes", slab
        sections = coaxial_distance(self.a, self.b, self.T, self.enough)
        if sections is not None:
            yield "sections", sections
        yield from self._nearest()
        if self._attested <= _COINCIDENT:
            yield from self._fine_meshes(quick=True)
        yield from self._common_part(quick=True)
        yield from closed_forms
        yield from self._fine_meshes(quick=True)
        yield from self._common_part(quick=False)
        yield from self._fine_meshes(quick=False)
        if CAD_CHORDS[-1] not in self._chords:  # Open CASCADE did not find the common part
            yield "meshes", self._meshes(CAD_CHORDS[-1], thorough=True)

    def _nearest(self) -> Levels:
        """What some points attest, and Open CASCADE's distance, which is bound by what contradicts it now and then."""
        probe = exact_probe(self.a, self.b, self.T)
        yield "exact", probe
        self._attested = -probe.upper
        if probe.upper < 0.0 and not (_may_be_ball(self.a) or _may_be_ball(self.b)):
            return  # they overlap: of other bodies than balls Open CASCADE would say 0
        distance = exact_distance(self.a, self.b, self.T)
        unproven = replace(distance, lower=-np.inf)
        if distance.lower > probe.upper:  # a point lies in both solids
            distance = unproven
        may_be_checked = bool(self._chords) and np.isfinite(distance.lower)
        if not (may_be_checked and (self.a.is_free_form or self.b.is_free_form)):
            yield "exact", distance
            return
        # Of free-form faces it may take a gap for the least of several: meshes must not contradict that.
        yield "exact", unproven
        if self._is_small:
            chord, self._has_fine_meshes = self._chords[-1], False
        else:
            chord = max(self.a.fine_chord, self.b.fine_chord)
        meshes = self._meshes(chord)
        yield "meshes", meshes
        if distance.lower <= meshes.upper:
            yield "exact", distance

    def _fine_meshes(self, *, quick: bool) -> Levels:
        """What fine meshes say, once; ``quick``: only where that takes less time than Open CASCADE."""
        if self._has_fine_meshes and (self._is_small or not quick):
            self._has_fine_meshes = False
            yield "meshes", self._meshes(self._chords[-1])

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

    def _meshes(self, chord: float, *, thorough: bool = False) -> Distance:
        """What meshes say; nothing where they take too long to make."""
        cuts = CUTS if thorough else FEW_CUTS
        try:
            return meshes_distance(self.a, self.b, self.T, chord, self.enough, thorough=thorough, cuts=cuts)
        except Clamp3dError:
            return Distance(method="without fine meshes")


def _may_be_ball(model: Model) -> bool:
    """Whether all faces of a solid are spherical, so that Open CASCADE's distance may be signed."""
    assert model.exact is not None
    return bool((model.exact.surfaces.kind == SPHERE).all())
