"""The distance of any two bodies: one function, one result type, whatever the bodies are made of."""

from __future__ import annotations

import itertools
from collections.abc import Iterable

import numpy as np
from numpy.typing import ArrayLike

from clamp3d.checks import instance, positive
from clamp3d.collide.answer import Distance, Distances
from clamp3d.collide.batch import by_kernel, exact
from clamp3d.collide.depth import is_exact, penetration, touches_hole
from clamp3d.collide.model import ModelCache
from clamp3d.collide.modelled import modelled
from clamp3d.collide.refine import ACCURACY, from_boxes, measured, refine, with_normal
from clamp3d.collide.scene import Scene, name_pairs
from clamp3d.collide.verdict import Thresholds
from clamp3d.core.contact_model import ContactModel
from clamp3d.core.linear import dot
from clamp3d.core.pose import Array, check_pose, check_pose_array, inverse
from clamp3d.core.primitives import SweptArc
from clamp3d.core.shapes import AnyShape, Shape, as_shape, groove_block

__all__ = ["ACCURACY", "Distance", "Distances", "distance", "distances", "measure"]


def distance(
    a: AnyShape,
    b: AnyShape,
    T_a_b: ArrayLike | None = None,
    *,
    accuracy: float = ACCURACY,
    model: ContactModel | None = None,
    cache: ModelCache | None = None,
) -> Distance:
    """Signed distance of two bodies of any kind.

    Parameters
    ----------
    a, b : Solid, MeshShape, Cylinder or SweptArc
        The bodies; a cylinder has flat ends, a bare groove no faces beside those of `SweptArc`.
    T_a_b : array_like (4, 4), optional
        Pose of b in the frame of a; the same frame by default.
    accuracy : float
        The distance is refined until its bounds are this close, mm, or until the models have no more to say. The
        depth of an overlap is exact where one contact decides it and in closed form; else it is known to 5 % or
        0.01 mm, whichever is more, unless the search for it becomes too long.
    model : ContactModel, optional
        Answers in place of the exact engine where one body has a groove and the other a cylinder.
    cache : ModelCache, optional
        Keeps what is made of the shapes from one call to the next.

    Returns
    -------
    Distance
        Points and normal in the frame of a.

    Raises
    ------
    InputError
        For anything that is no shape or no rigid pose.

    Examples
    --------
    >>> from clamp3d.core import shapes
    >>> from clamp3d.core.pose import translation
    >>> found = distance(shapes.box((10, 10, 10)), shapes.cylinder(3, 10), translation(0, 0, 12))
    >>> round(found.value, 9), (found.normal.round(9) + 0.0).tolist()
    (2.0, [0.0, 0.0, 1.0])
    """
    T = np.eye(4) if T_a_b is None else check_pose(T_a_b, "T_a_b")
    x, y = _bounded(a, b, T[None])
    return _measured(_checked(cache, model), x, y, T, positive("accuracy", accuracy), model)


def distances(
    a: AnyShape,
    b: AnyShape,
    T_a_b: ArrayLike,
    *,
    model: ContactModel | None = None,
    cache: ModelCache | None = None,
) -> Distances:
    """Signed distances of two bodies for many poses: the same as `distance` for each of them.

    Where grooves or holes of one body and a cylinder decide, all poses are measured at once.

    Parameters
    ----------
    a, b : Solid, MeshShape, Cylinder or SweptArc
        The bodies.
    T_a_b : array_like (n, 4, 4)
        Poses of b in the frame of a.
    model, cache
        As for `distance`.

    Returns
    -------
    Distances
        Arrays of n; points and normals in the frame of a.

    Examples
    --------
    >>> from clamp3d.core import shapes
    >>> from clamp3d.core.pose import translation
    >>> block, wire = shapes.groove_block(SweptArc(7, 1.0, 50), 40, 20), shapes.cylinder(6.5, 80)
    >>> distances(block, wire, [translation(0, y, 0) for y in (0.0, -0.2)]).value.round(9).tolist()
    [0.5, 0.3]
    """
    T = check_pose_array(T_a_b, "T_a_b")
    cache = _checked(cache, model)
    shapes = _bounded(a, b, T)
    x, y = (cache.model(shape) for shape in shapes)
    known = by_kernel(x, y, T)
    settled = exact(known) if model is None else np.zeros(len(T), dtype=bool)
    rows = np.flatnonzero(~settled).tolist()
    return known.with_rows(rows, [_measured(cache, *shapes, T[k], ACCURACY, model) for k in rows])


def _bounded(a: AnyShape, b: AnyShape, T: Array) -> tuple[Shape, Shape]:
    """Both as shapes of a scene: a bare groove in a block whose other faces are too far away to matter at ``T``."""
    if isinstance(a, SweptArc) == isinstance(b, SweptArc):
        return as_shape(a), as_shape(b)
    groove, other = (a, as_shape(b)) if isinstance(a, SweptArc) else (b, as_shape(a))
    assert isinstance(groove, SweptArc)
    reach = np.linalg.norm(ModelCache().model(other).bounds, axis=1).max() + np.abs(T[:, :3, 3]).max(initial=0.0)
    far = 8.0 * (float(reach) + groove.radius + groove.length)
    block = groove_block(groove, far, far)
    return (block, other) if groove is a else (other, block)


def measure(
    scene: Scene,
    pairs: Iterable[tuple[str, str]] | None = None,
    *,
    accuracy: float = ACCURACY,
    model: ContactModel | None = None,
    cache: ModelCache | None = None,
) -> dict[tuple[str, str], Distance]:
    """Distances of the pairs of a scene, each as `distance` gives it, points and normals in the world.

    Parameters
    ----------
    scene : Scene
        Parts at their poses.
    pairs : iterable of (str, str), optional
        Names; all pairs in the order of the parts by default.
    accuracy, model, cache
        As for `distance`.

    Returns
    -------
    dict
        From (a, b) to `Distance`.
    """
    instance("scene", scene, Scene)
    accuracy = positive("accuracy", accuracy)
    cache = _checked(cache, model)
    asked = (
        itertools.combinations([part.name for part in scene.parts], 2) if pairs is None else name_pairs("pairs", pairs)
    )
    found = {}
    for a, b in asked:
        first, second = (scene.parts[scene.index(name)] for name in (a, b))
        T = dot(inverse(first.T_world), second.T_world)
        found[a, b] = _measured(cache, first.shape, second.shape, T, accuracy, model).moved(first.T_world)
    return found


def _checked(cache: ModelCache | None, model: ContactModel | None) -> ModelCache:
    """The cache, or a new one. Raises InputError for what is neither a cache nor a contact model."""
    if model is not None:
        instance("model", model, ContactModel)
    if cache is None:
        return ModelCache()
    instance("cache", cache, ModelCache)
    return cache


def _measured(cache: ModelCache, a: Shape, b: Shape, T: Array, accuracy: float, model: ContactModel | None) -> Distance:
    x, y = cache.model(a), cache.model(b)
    exact = is_exact(x, y)  # then closed forms know the depth too

    def enough(known: Distance) -> bool:
        return measured(known, accuracy) or (exact and known.point_a is not None) or touches_hole(x, y, known)

    found = with_normal(refine(x, y, T, Distance() if exact else from_boxes(x, y, T), Thresholds(), enough))
    if model is not None and (asked := modelled(x, y, T, found, model)) is not found:
        return asked
    return penetration(x, y, T, found)
