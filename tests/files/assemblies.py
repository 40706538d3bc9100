"""Assemblies of parts as engineers draw them, and what Open CASCADE says of each pair."""

import itertools
import math
from dataclasses import dataclass

import numpy as np
from igl import winding_number

from clamp3d.files.cad import Key, matrix
from clamp3d.files.open_cascade import explore, occ, require_open_cascade
from clamp3d.files.solid import BrepSolid
from tests.cad import Tree, ball, bounds, cone, cut, location, moved, ring, rod, shift, volume
from tests.cad import block as box
from tests.cad import first_solid as solid_of


def fuse(shape, *others):
    for other in others:
        shape = occ.BRepAlgoAPI_Fuse(shape, other).Shape()
    return shape


def fasteners():
    """Two plates, two shouldered screws with washers and nuts: planes, cylinders, coaxial fits."""
    holes = [(12.0, 0.0), (-12.0, 0.0)]
    plate = cut(box((-25, -10, 0), (25, 10, 6)), *(rod(3.2, -1, 7, *at) for at in holes))
    under = cut(box((-25, -10, -6), (25, 10, 0)), *(rod(3.0, -7, 1, *at) for at in holes))
    parts = {"plate": plate, "under": under}
    for k, (x, y) in enumerate(holes):
        washer = cut(rod(6, 6, 7.2), rod(3.2, 5, 8))
        screw = fuse(rod(3, -12, 7.2), rod(5, 7.2, 12.2))
        nut = cut(box((-5, -5, -11), (5, 5, -6)), rod(3, -12, -5))
        for name, part in (("washer", washer), ("screw", screw), ("nut", nut)):
            parts[f"{name}_{k}"] = moved(part, shift(x, y, 0))
    return parts


def hinge():
    """Two leaves with knuckles on one pin, 0.1 mm between the knuckles."""
    parts = {"pin": fuse(rod(2.0, 0.0, 40.0), rod(3.0, 40.0, 42.0))}
    for name, side, spans in (("left", -1, [(0, 9.9), (20, 29.9)]), ("right", 1, [(10, 19.9), (30, 40)])):
        leaf = None
        for low, high in spans:
            knuckle = fuse(rod(4.0, low, high), box((min(0, 18 * side), -4, low), (max(0, 18 * side), -2, high)))
            leaf = knuckle if leaf is None else fuse(leaf, knuckle)
        spine = box((min(6 * side, 18 * side), -4, 0), (max(6 * side, 18 * side), -2, 40))
        parts[name] = cut(fuse(leaf, spine), rod(2.0, -1, 41))
    return parts


def taper():
    """A taper pin in a hub, a ball in its socket, a rubber ring in its groove: cones, spheres, tori."""
    plate = cut(box((-14, -14, -10), (14, 14, 10)), cone(2.0, 2.5, -10.0, 10.0))
    pin = cone(2.0, 2.5, -10.0, 10.0)
    stud = moved(fuse(rod(3.0, 10, 21), ball(5.0, 25)), shift(9, 9))
    socket = cut(box((0, 0, 25), (18, 18, 33)), moved(ball(5.0, 25), shift(9, 9)))
    groove = moved(cut(rod(9.0, -4, 4), ring(9.0, 1.5)), shift(-30, 0, 0))
    return {"plate": plate, "pin": pin, "stud": stud, "socket": socket, "groove": groove,
            "seal": moved(ring(9.0, 1.5), shift(-30, 0, 0))}  # fmt: skip


def gears():
    """Two spur gears of bd_warehouse with flanks that touch; a shaft in each."""
    from bd_warehouse.gear import SpurGear

    parts = {}
    for k, (teeth, x) in enumerate(((15, 0.0), (20, 1.5 * 17.5 + 0.05))):
        gear = SpurGear(module=1.5, tooth_count=teeth, pressure_angle=20, thickness=6)
        turn = 0.0 if k == 0 else math.pi / teeth * (1 + teeth % 2)
        c, s = math.cos(turn), math.sin(turn)
        T = np.array([[c, -s, 0, x], [s, c, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1.0]])
        body = cut(moved(solid_of(gear.wrapped), T), rod(3.0, -5, 12, x))
        parts[f"gear_{k}"] = body
        parts[f"shaft_{k}"] = rod(3.0, -10, 16, x)
    return parts


def nudged(parts, seed, least=0.003, most=0.05):
    """Each part moved by ``least`` to ``most`` mm in some direction, and turned by up to 1e-3 rad every third time.

    Instances stay instances, and are turned about the origins of their products.
    """
    rng = np.random.default_rng(seed)
    made = {}
    for k, (name, shape) in enumerate(parts.items()):
        way = rng.normal(size=3)
        T = shift(*(way / np.linalg.norm(way) * rng.uniform(least, most)))
        if k % 3 == 2:
            x, y, z = rng.normal(size=3) * 3e-4
            T[:3, :3] = np.linalg.qr(np.eye(3) + np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]]))[0]
            T[:3, :3] *= np.sign(np.diag(T[:3, :3]))
        if (at := shape.Location()).IsIdentity():
            made[name] = moved(shape, T)
        else:
            made[name] = shape.Located(location(matrix(at) @ T))
    return made


@dataclass
class Truth:
    """Distance (mm), common volume (mm3) and depth of the deepest point found (mm, a lower bound)."""

    distance: float
    volume: float = 0.0
    depth: float = 0.0

    def verdict(self, contact=0.01):
        """What the pair is; None where the depth is too near to the threshold to say."""
        if self.distance > contact:
            return "clear"
        if self.depth > contact:
            return "clash"
        return "contact" if self.depth < 0.8 * contact else None


def near(solids, margin=1.0):
    """Pairs (i, j) whose boxes are less than ``margin`` mm apart."""
    corners = [bounds(solid) for solid in solids]
    pairs = itertools.combinations(range(len(solids)), 2)
    return [(i, j) for i, j in pairs
            if np.maximum(corners[i][0] - corners[j][1], corners[j][0] - corners[i][1]).max() < margin]  # fmt: skip


def separation(a, b):
    """Distance of two solids by Open CASCADE, mm."""
    return occ.BRepExtrema_DistShapeShape(a, b).Value()


def truth(a, b):
    """By Open CASCADE: the distance; of an overlap the volume, and corners of its mesh measured against both."""
    distance = separation(a, b)
    if distance > 1e-7:
        return Truth(distance)
    common = occ.BRepAlgoAPI_Common(a, b).Shape()
    if (shared := volume(common)) <= 1e-9:  # or the boolean has failed: ask some points
        return Truth(0.0, 0.0, max(deepest_corner(a, b), deepest_corner(b, a)))
    return Truth(0.0, shared, deepest(common, a, b))


def judged(verdict, lower, upper, known):
    """What a verdict is worth: right, uncertain, wrong, or undecidable from the truth; and whether the bounds hold."""
    value = known.distance if known.distance > 1e-7 else -known.depth
    holds = lower <= value + 1e-6 and (value <= 0.0 or upper >= value - 1e-6)
    wanted, verdict = known.verdict(), verdict.replace("contained", "clash")
    if verdict == "uncertain":
        return verdict, holds
    return ("undecidable" if wanted is None else "right" if verdict == wanted else "wrong"), holds


def write_step(parts, path):
    """The parts as a STEP file of named products, in their order; one shape in several places is one product."""
    require_open_cascade()
    tree, products = Tree(), {}
    root = tree.product("assembly")
    for name, shape in parts.items():
        solid = solid_of(shape)
        if (key := Key(solid)) not in products:
            products[key] = tree.product(name.removesuffix("_0"), key.shape)
        tree.put(root, products[key], matrix(solid.Location()), name)
    return tree.write(path)


def deepest(common, a, b):
    """How deep a corner of the common part's mesh, which lies on the boundary of one solid, is in the other one.

    Where it lies beside its face by as much as the file's tolerance, it is not counted as so much deeper. All corners
    of a solid in its own place lie on both: then points half way between two of them count that are inside.
    """
    from_a, from_b, points = from_shell(a), from_shell(b), mesh_corners(common)
    points = points[:: max(1, len(points) // 60)]
    depth = max((abs(from_a(p) - from_b(p)) for p in points), default=0.0)
    if depth > 1e-6:
        return depth
    place, inside = occ.BRepClass3d_SolidClassifier(a), []
    for p, q in itertools.combinations(points[::4], 2):
        middle = occ.gp_Pnt(*(0.5 * (np.array(p.Coord()) + q.Coord())))
        place.Perform(middle, 1e-7)
        if place.State() == occ.TopAbs_State.TopAbs_IN:
            inside.append(middle)
    return max(map(from_a, inside), default=depth)


def deepest_corner(a, b):
    """The deepest of some corners of a's triangles inside b.

    The classifier has faults: it takes points beside a plate with twelve half holes for the middle of it. So what seems
    deep must be wound round by the triangles too.
    """
    from_boundary, points, place, greatest = from_shell(b), mesh_corners(a), occ.BRepClass3d_SolidClassifier(b), 0.0
    solid = BrepSolid.of(solid_of(b), "solid")
    for point in points[:: max(1, len(points) // 100)]:
        place.Perform(point, 1e-7)
        if place.State() == occ.TopAbs_State.TopAbs_IN and (depth := from_boundary(point)) > greatest:
            corner = np.array([point.Coord()])
            if depth < 0.1 or winding_number(solid.mesh.vertices, solid.mesh.faces, corner)[0] > 0.5:
                greatest = depth
    return greatest


def mesh_corners(shape):
    """Corners of a mesh of a shape's faces."""
    occ.BRepMesh_IncrementalMesh(shape, 0.05, False, 0.3, False)
    points, place = [], occ.TopLoc_Location()
    for face in explore(shape, "FACE"):
        mesh = occ.BRep_Tool.Triangulation_s(face, place)
        move = place.Transformation()
        points += [mesh.Node(i).Transformed(move) for i in range(1, mesh.NbNodes() + 1)] if mesh is not None else []
    return points


def from_shell(solid):
    """The distance of a gp_Pnt from a solid's shell, as a function: the shell is made ready once."""
    between = occ.BRepExtrema_DistShapeShape()
    between.LoadS2(next(iter(explore(solid, "SHELL"))))

    def distance(point):
        between.LoadS1(occ.BRepBuilderAPI_MakeVertex(point).Vertex())
        between.Perform()
        return between.Value()

    return distance


ASSEMBLIES = {made.__name__: made for made in (fasteners, hinge, taper, gears)}
