"""Other libraries on the same scene, each set up as its own documentation advises."""

from __future__ import annotations

from clamp3d.study.compare_methods import Method, Prepared

PEER_METHODS: tuple[Method, ...] = ()


def missing_peers() -> dict[str, str]:
    """Family of each peer that is not installed, and what to install."""
    return {}


def load_peer(method: Method) -> None:
    """Import the library."""


def prepare_peer(method: Method) -> Prepared:
    """Set a peer up."""
    raise NotImplementedError
