"""What a caller need not say: the defaults of everything public, as they were once recorded.

``python -m tests.public.test_defaults`` records them again.
"""

import dataclasses
import inspect
from pathlib import Path

import clamp3d
from clamp3d import baselines, kernel, shapes, testing
from clamp3d.clamp import dimensions, placement, tolerance, torque
from clamp3d.geometry import pose
from tests.recorded import record_tests

MODULES = (clamp3d, baselines, kernel, shapes, testing, dimensions, placement, tolerance, torque, pose)
ABSENT = (inspect.Parameter.empty, dataclasses.MISSING)


def defaults():
    """Those of functions and fields, by what has them; and the fields by which nothing is compared."""
    found = {}
    for thing in [getattr(module, name) for module in MODULES for name in dir(module) if name[0] != "_"]:
        given = []
        if inspect.isfunction(thing) and thing.__module__.startswith("clamp3d"):
            given = [(p.name, p.default) for p in inspect.signature(thing).parameters.values()]
        elif inspect.isclass(thing) and dataclasses.is_dataclass(thing):
            fields = dataclasses.fields(thing)
            given = [(f.name, f.default) if f.compare else (f"{f.name}, not compared", None) for f in fields]
        plain = [f"{name} = {value}" for name, value in given if not any(value is absent for absent in ABSENT)]
        found |= {f"{thing.__module__}.{thing.__qualname__}": plain} if plain else {}
    return dict(sorted(found.items()))


test_defaults_are_those_that_were_recorded, record = record_tests(Path(__file__).with_name("data"), defaults)


if __name__ == "__main__":
    record()
