"""Other libraries on the same scene, a small file for each, set up as its own authors would for this question.

Every series answers for the same bodies and poses. What a series may know is in its name: ``cylinder`` and ``capsule``
are the wire as the library's own flat-ended or rounded shape (the same surface next to the groove, whose ends the wire
passes); ``axis`` asks its axis, less the radius, against the block's surface, as trimesh and manifold3d do too;
``sector`` and ``face`` look up by hand what of the groove can be nearest and ask only for that, which no library does
by itself. All are given as much of the block as the wire can come near, in the shapes that suit them: `pieces`.
"""

from __future__ import annotations

import importlib
import importlib.util
import math
from collections.abc import Mapping
from types import MappingProxyType

from clamp3d.bench.compare.methods import Method, Prepared, Series
from clamp3d.bench.compare.peers import coal, fcl, manifold3d, mujoco, open_cascade, trimesh

SERIES: Mapping[str, Series] = MappingProxyType(
    coal.SERIES | mujoco.SERIES | fcl.SERIES | trimesh.SERIES | manifold3d.SERIES | open_cascade.SERIES
)
"""All series by family."""
PEER_METHODS = tuple(Method(family, angle) for family, series in SERIES.items() for angle in series.angles)


def missing_peers() -> dict[str, str]:
    """Each series whose library is not installed, with what to install."""
    return {
        family: f"not installed: pip install {series.package} (or 'clamp3d[peers]')"
        for family, series in SERIES.items()
        if importlib.util.find_spec(series.needs[0]) is None
    }


def load_peer(method: Method) -> None:
    """Import what the peer and its input need, so that its set-up time is its own."""
    for module in SERIES[method.family].needs:
        importlib.import_module(module)


def prepare_peer(method: Method) -> Prepared:
    """Set a peer up for the scene of `compare.scene`, everything in the groove's frame."""
    return SERIES[method.family].make(math.radians(method.setting or 0.0))
