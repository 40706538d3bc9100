"""Before any test: the contact kernel is compiled once, so that no test measures or prints its compilation."""

from clamp3d import Cylinder, SweptArc, signed_distance
from clamp3d.geometry.pieces import groove_pieces
from clamp3d.geometry.pose import translation


def pytest_sessionstart(session):
    groove, wire = SweptArc(7.0, 1.0, 50.0), Cylinder(6.0, 80.0)
    signed_distance(groove, wire, translation(0.0, 3.0, 0.0))
    groove_pieces(groove, wire, translation(0.0, 3.0, 0.0))
