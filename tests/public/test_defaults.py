"""What a caller need not say: the defaults of everything public, as they were once recorded.

``python -m tests.public.test_defaults`` records them again.
"""

import dataclasses
import inspect
import json
from pathlib import Path

import clamp3d
from clamp3d import baselines, kernel, shapes, testing
from clamp3d.clamp import dimensions, placement, tolerance, torque
from clamp3d.geometry import pose

FILE = Path(__file__).with_name("data") / "defaults.json"
MODULES = (clamp3d, baselines, kernel, shapes, testing, dimensions, placement, tolerance, torque, pose)


def arguments(call):
    return [(p.name, p.default) for p in inspect.signature(call).parameters.values() if p.default is not p.empty]


def defaults():
    """Those of functions, methods and fields, by what has them; and the fields by which nothing is compared."""
    found = {}
    for thing in [getattr(module, name) for module in MODULES for name in dir(module) if name[0] != "_"]:
        if not getattr(thing, "__module__", "").startswith("clamp3d"):
            continue
        given = arguments(thing) if inspect.isfunction(thing) else []
        if inspect.isclass(thing):
            for name, method in inspect.getmembers(thing, inspect.isroutine):
                plain = getattr(method, "__func__", method)
                if inspect.isfunction(plain) and name[0] != "_":
                    given += [(f"{name}: {key}", default) for key, default in arguments(plain)]
        if dataclasses.is_dataclass(thing):
            own = dataclasses.fields(thing)
            given += [(field.name, field.default) for field in own if field.default is not dataclasses.MISSING]
            given += [(f"{field.name} in comparisons", False) for field in own if not field.compare]
        if given:
            plain = (str, int, float, tuple, type(None))
            words = {key: repr(v) if isinstance(v, plain) else f"a {type(v).__name__}" for key, v in given}
            found[f"{thing.__module__}.{thing.__qualname__}"] = words
    return dict(sorted(found.items()))


def test_defaults_are_those_that_were_recorded():
    assert defaults() == json.loads(FILE.read_text(encoding="utf-8"))


if __name__ == "__main__":
    FILE.parent.mkdir(exist_ok=True)
    FILE.write_text(json.dumps(defaults(), indent=0) + "\n", encoding="utf-8")
