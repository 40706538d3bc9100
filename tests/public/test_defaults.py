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
PLAIN = (str, int, float, tuple, type(None))


def defaults():
    """Those of functions and fields, by what has them; and the fields by which nothing is compared."""
    found = {}
    for thing in [getattr(module, name) for module in MODULES for name in dir(module) if name[0] != "_"]:
        if inspect.isfunction(thing) and thing.__module__.startswith("clamp3d"):
            given = [(p.name, p.default) for p in inspect.signature(thing).parameters.values()]
        elif inspect.isclass(thing) and dataclasses.is_dataclass(thing):
            fields = dataclasses.fields(thing)
            given = [(f.name, f.default if f.compare else (f.default, "not compared")) for f in fields]
        else:
            continue
        absent = (inspect.Parameter.empty, dataclasses.MISSING)
        plain = {
            key: repr(v) if isinstance(v, PLAIN) else f"a {type(v).__name__}"
            for key, v in given
            if not any(v is a for a in absent)
        }
        found |= {f"{thing.__module__}.{thing.__qualname__}": plain} if plain else {}
    return dict(sorted(found.items()))


def test_defaults_are_those_that_were_recorded():
    assert defaults() == json.loads(FILE.read_text(encoding="utf-8"))


if __name__ == "__main__":
    FILE.parent.mkdir(exist_ok=True)
    FILE.write_text(json.dumps(defaults(), indent=0) + "\n", encoding="utf-8")
