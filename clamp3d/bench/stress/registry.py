"""All families and all methods by name, in the order in which they are shown."""

from __future__ import annotations

from collections.abc import Mapping

from clamp3d.bench.stress.assemblies.family import ASSEMBLIES
from clamp3d.bench.stress.family import Family
from clamp3d.bench.stress.meshes.family import MESHES
from clamp3d.bench.stress.motions.family import MOTIONS
from clamp3d.bench.stress.poses.family import POSES

KINDS: dict[str, Mapping[str, Family]] = {"pose": POSES, "motion": MOTIONS, "mesh": MESHES, "assembly": ASSEMBLIES}
"""Kind -> its families by name."""

FAMILIES: dict[str, Family] = {name: family for kind in KINDS.values() for name, family in kind.items()}

METHODS: dict[str, str] = {name: about for f in FAMILIES.values() for name, (about, _) in f.methods.items()}
"""Name -> what it is."""


def expand(names: list[str]) -> list[str]:
    """Families by name; ``pose``, ``motion``, ``mesh`` and ``assembly`` stand for all of their kind.

    >>> expand(["ties", "mesh"])[:2]
    ['ties', 'mesh: open']
    """
    return [family for name in names for family in KINDS.get(name, [name])]
