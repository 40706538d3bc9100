"""Meshes of a file as they are read: brought to mm, with Z up and placed rigidly."""

from __future__ import annotations

import math
from collections.abc import Callable, Hashable

import numpy as np

from clamp3d.errors import InputError
from clamp3d.files.bodies import Reading
from clamp3d.geometry.mesh import IntArray, make_mesh
from clamp3d.geometry.pose import Array, nearest_rigid
from clamp3d.geometry.shapes import MeshShape


class Placer(Reading):
    """A reading to which meshes are added whose unit is ``scale`` mm and whose axes are turned by ``R`` (3, 3)."""

    def __init__(self, scale: float = 1.0, R: Array | None = None) -> None:
        super().__init__()
        self.scale = scale
        self.R = np.eye(3) if R is None else R
        self._shapes: dict[tuple[Hashable, bytes], MeshShape | str] = {}

    def place(self, name: str, key: Hashable, arrays: Callable[[], tuple[Array, IntArray]], T: Array) -> None:
        """One more body: vertices and faces that ``arrays`` gives, the same for each ``key``, at ``T`` (4, 4).

        A scale, shear or reflection in ``T`` goes into the vertices. Raises InputError for too many bodies.
        """
        scales = np.linalg.svd(T[:3, :3], compute_uv=False) if np.isfinite(T).all() else np.zeros(3)
        if not scales[2] > 1e-12 * scales[0] > 1e-100:
            self.add(name, "its placement is flat or not finite", T)
            return
        pose, form = rigid_part(T)
        own = (key, form.round(12 - round(math.log10(scales[0]))).tobytes())
        if own not in self._shapes:
            self._shapes[own] = self._shape(name, arrays, form)
        place = np.eye(4)
        place[:3, :3] = self.R @ pose[:3, :3]
        place[:3, 3] = self.scale * self.R @ pose[:3, 3]
        self.add(name, self._shapes[own], place)

    def _shape(self, name: str, arrays: Callable[[], tuple[Array, IntArray]], form: Array) -> MeshShape | str:
        try:
            V, F = arrays()
            if np.linalg.det(form) < 0.0:
                F = F[:, ::-1]
            mesh = make_mesh(V @ form.T, F, name=name, scale=self.scale, float32=True)
            shape = MeshShape(mesh, "off", name)
        except InputError as error:
            return str(error).removeprefix(f"{name}: ")
        self.notes += [f"{name}: {note}" for note in mesh.notes]
        return shape


def rigid_part(T: Array) -> tuple[Array, Array]:
    """A placement (4, 4) as a rigid pose after a scale, shear or reflection (3, 3): the identity where it is rigid."""
    pose = nearest_rigid(T)
    form = pose[:3, :3].T @ T[:3, :3]
    is_rigid = np.abs(form - np.eye(3)).max() <= 5e-6  # written with few digits
    return pose, np.eye(3) if is_rigid else form
