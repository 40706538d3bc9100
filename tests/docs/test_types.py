"""What the import of the package gives, and costs; the types that a user sees are in ``user_script.py``."""

from tests.docs.project import ROOT, python


def test_the_package_says_that_it_is_typed():
    assert (ROOT / "clamp3d" / "py.typed").is_file()


def test_the_import_costs_next_to_nothing():
    heavy = {"numpy", "numba", "scipy", "trimesh", "fcl", "click", "matplotlib", "msgspec", "rich"}
    code = f"import sys, clamp3d; print(sorted({heavy} & set(sys.modules)))"
    assert python("-c", code).stdout == "[]\n"
