"""Tests that are named in docs/mutation.json as those that see a wrong change exist: CI runs some of them each time."""

import ast
import json
from functools import cache

from tests.docs.project import ROOT


@cache
def names(path: str) -> set[str]:
    """The tests of a file, by its text alone."""
    file = ROOT / path
    tree = ast.parse(file.read_text(encoding="utf-8") if file.exists() else "")
    assigned = {n.id for node in tree.body if isinstance(node, ast.Assign) for n in ast.walk(node) if is_target(n)}
    return assigned | {node.name for node in tree.body if isinstance(node, ast.FunctionDef)}


def is_target(node: ast.AST) -> bool:
    return isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store)


def missing(test: str) -> bool:
    path, _, name = test.partition("::")
    return name.partition("[")[0] not in names(path)


def test_every_test_that_is_named_exists():
    rows = json.loads((ROOT / "docs" / "mutation.json").read_text(encoding="utf-8"))
    named = [row["test"] for row in rows if "test" in row]
    assert len(named) > 10
    assert not [test for test in named if missing(test)]
