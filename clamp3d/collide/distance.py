"""The distance of any two bodies: one function, one result type, whatever the bodies are made of."""

from __future__ import annotations

import itertools
from collections.abc import Iterable

import numpy as np
from numpy.typing import ArrayLike

from clamp3d.checks import array, instance, positive
from clamp3d.collide.answer import Distance, Distances
from clamp3d.collide.model import ModelCache
from clamp3d.collide.refine import ACCURACY, from_boxes, measured, refine, with_normal
from clamp3d.collide.scene import Scene, name_pairs
from clamp3d.collide.verdict import Thresholds
from clamp3d.core.contact_model import ContactModel
from clamp3d.core.pose import Array, check_pose, inverse
from clamp3d.core.shapes import AnyShape, Shape, as_shape

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
    a, b : Solid, MeshShape or Cylinder
        The bodies; a cylinder has flat ends.
    T_a_b : array_like (4, 4), optional
        Pose of b in the frame of a; the same frame by default.
    accuracy : float
        The distance is refined until its bounds are this close, mm, or until the models have no more to say. Of an
        overlap only what closed forms tell is asked: its depth may have an upper bound alone.
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
    >>> round(found.value, 9), found.normal.tolist()
    (2.0, [0.0, 0.0, 1.0])
    """
    T = np.eye(4) if T_a_b is None else check_pose(T_a_b, "T_a_b")
    return _measured(cache or ModelCache(), as_shape(a), as_shape(b), T, positive("accuracy", accuracy), model)


def distances(a: AnyShape, b: AnyShape, T_a_b: ArrayLike, *, model: ContactModel | None = None) -> Distances:
    """Signed distances of two bodies for many poses ``T_a_b`` (n, 4, 4) of b in the frame of a.

    The same as `distance` for each of them.
    """
    T = array("T_a_b", T_a_b, (None, 4, 4), finite=False)
    cache = ModelCache()
    x, y = as_shape(a), as_shape(b)
    return Distances.of(
        [_measured(cache, x, y, check_pose(pose, f"T_a_b[{k}]"), ACCURACY, model) for k, pose in enumerate(T)]
    )


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
    cache = cache or ModelCache()
    asked = (
        itertools.combinations([part.name for part in scene.parts], 2) if pairs is None else name_pairs("pairs", pairs)
    )
    found = {}
    for a, b in asked:
        first, second = (scene.parts[scene.index(name)] for name in (a, b))
        T = inverse(first.T_world) @ second.T_world
        found[a, b] = _measured(cache, first.shape, second.shape, T, accuracy, model).moved(first.T_world)
    return found


def _measured(cache: ModelCache, a: Shape, b: Shape, T: Array, accuracy: float, model: ContactModel | None) -> Distance:
    x, y = cache.model(a), cache.model(b)
    start = from_boxes(x, y, T)
    found = refine(x, y, T, start, Thresholds(), lambda known: measured(known, accuracy))
    return with_normal(found)
