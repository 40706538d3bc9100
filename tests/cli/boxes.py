"""Scene files of boxes."""

import json

BOX = '[parts.{name}]\nshape = "box"\nsize = [10, 10, 10]\npose = {{ translation = [{x}, 0, 0] }}\n'


def boxes(path, places):
    """A scene file of boxes of 10 mm whose middles are at x: ``places[name]``."""
    path.write_text("".join(BOX.format(name=json.dumps(name), x=x) for name, x in places.items()), encoding="utf-8")
    return path
