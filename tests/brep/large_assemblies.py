"""Assemblies of the size that engineers have: 17 to 58 solids, products that are used several times."""

from bolted import BOLTED
from machines import MACHINES

LARGE = BOLTED | MACHINES
