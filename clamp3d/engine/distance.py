"""The distance of any two bodies: one function, one result type, whatever the bodies are made of."""

from __future__ import annotations

import itertools
from collections.abc import Iterable

import numpy as np
from numpy.typing import ArrayLike

from clamp3d.checks import instance, positive
from clamp3d.engine.answer import Distance, Distances
from clamp3d.engine.batch import bounds_at_poses
from clamp3d.engine.depth import depth_of_pieces, penetration
from clamp3d.engine.model import Model, ModelCache
from clamp3d.engine.modelled import modelled
from clamp3d.engine.refine import ACCURACY, accuracy_for, from_boxes, measured, refine, with_normal
from clamp3d.engine.scene import Scene, name_pairs
from clamp3d.geometry.pose import Array, check_pose, check_pose_array, inverse
from clamp3d.geometry.primitives import SweptArc
from clamp3d.geometry.shapes import AnyShape, Shape, as_shape, groove_block
from clamp3d.kernel.contact_model import ContactModel

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
        The distance is refined until its bounds are this close, mm (or 1e-10 of the size, if that is more), or until
        the models have no more to say. The depth of an overlap is exact for two convex pieces; else it lies between
        the depth that a point has and the length of a translation that was verified to separate the bodies.
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
    >>> from clamp3d.geometry import shapes
    >>> from clamp3d.geometry.pose import translation
    >>> gap = distance(shapes.box((10, 10, 10)), shapes.cylinder(3, 10), translation(0, 0, 12))
    >>> round(gap.value, 9), (gap.normal.round(9) + 0.0).tolist()
    (2.0, [0.0, 0.0, 1.0])
    """
    T = np.eye(4) if T_a_b is None else check_pose(T_a_b, "T_a_b")
    x, y = as_bounded(a, b, T[None])
    cache = _checked(cache, model)
    return _measured(cache.model(x), cache.model(y), T, positive("accuracy", accuracy), model)


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
    >>> from clamp3d.geometry import shapes
    >>> from clamp3d.geometry.pose import translation
    >>> block, wire = shapes.groove_block(SweptArc(7, 1.0, 50), 40, 20), shapes.cylinder(6.5, 80)
    >>> distances(block, wire, [translation(0, y, 0) for y in (0.0, -0.2)]).value.round(9).tolist()
    [0.5, 0.3]
    """
    T = check_pose_array(T_a_b, "T_a_b")
    cache = _checked(cache, model)
    shapes = as_bounded(a, b, T)
    x, y = (cache.model(shape) for shape in shapes)
    batch = bounds_at_poses(x, y, T)
    is_exact = (batch.lower >= 0.0) & (batch.upper - batch.lower <= ACCURACY)
    rows = np.flatnonzero(~is_exact if model is None else np.ones(len(T), dtype=bool)).tolist()
    fields = {name: getattr(batch, name).copy() for name in ("lower", "upper", "point_a", "point_b", "normal")}
    methods = list(batch.method)
    for k in rows:
        answer = _measured(x, y, T[k], ACCURACY, model)
        methods[k] = answer.method
        for name, values in fields.items():
            value = getattr(answer, name)
            values[k] = np.nan if value is None else value
    return Distances(**fields, method=tuple(methods))


def as_bounded(a: AnyShape, b: AnyShape, T: Array) -> tuple[Shape, Shape]:
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
    chosen = (
        itertools.combinations([part.name for part in scene.parts], 2) if pairs is None else name_pairs("pairs", pairs)
    )
    answers = {}
    for a, b in chosen:
        first, second = (scene.parts[scene.index(name)] for name in (a, b))
        T = inverse(first.T_world) @ second.T_world
        models = cache.model(first.shape), cache.model(second.shape)
        answers[a, b] = _measured(*models, T, accuracy, model).moved(first.T_world)
    return answers


def _checked(cache: ModelCache | None, model: ContactModel | None) -> ModelCache:
    """The cache, or a new one. Raises InputError for what is neither a cache nor a contact model."""
    if model is not None:
        instance("model", model, ContactModel)
    if cache is None:
        return ModelCache()
    instance("cache", cache, ModelCache)
    return cache


def _measured(a: Model, b: Model, T: Array, accuracy: float, model: ContactModel | None) -> Distance:
    """The distance of ``b`` at ``T`` (4, 4) in a's frame, with the depth in an overlap."""
    exact_depth = depth_of_pieces(a, b, T)
    if exact_depth is not None and exact_depth.upper < -ACCURACY:
        return exact_depth
    wide = accuracy_for(a, b, accuracy)
    distance = with_normal(refine(a, b, T, from_boxes(a, b, T), lambda answer: measured(answer, wide)))
    if model is not None and (by_model := modelled(a, b, T, distance, model)) is not distance:
        return by_model
    return penetration(a, b, T, distance) if distance.lower < -ACCURACY else distance
