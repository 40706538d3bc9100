"""Exact assembly checking for parts with round grooves (Concave Arc Surface collision detection).

Lengths are millimetres, angles radians, poses 4x4 column-vector matrices ``T_target_source``, Z up.

| name | what it is |
|---|---|
| `load` | a clamp, a scene, or the parts of any file or object: STEP, glTF, 3MF, URDF, meshes, CadQuery, ... |
| `Scene`, `Part` | parts with poses, thresholds, allowed contacts and motions (`Motion`) |
| `check` | verdicts of all pairs of a scene, at rest and in motion (`CheckResult`, `Verdict`) |
| `distance` | signed distance of any two bodies between proven bounds (`Distance`); `measure` for a scene |
| `assemble` | puts a clamp (`Clamp`) together with its wires (`Assembly`) |
| `monte_carlo` | how its final state scatters; `sensitivity` to every dimension; `placement` of a wire it catches |
| `view` | in a browser; `export`, `report`: files for reviewers |
| `fit_file` | round surfaces found in a mesh file; `fit_mesh` in a mesh |
| `clamp3d.shapes` | bodies: cylinders, boxes, groove blocks, meshes |
| `clamp3d.kernel` | the closed forms of groove and cylinder: single poses and batches |
| `clamp3d.baselines` | contact models that chords, wedges, hulls and meshes make of a groove |
| `clamp3d.figures` | drawings |
| `clamp3d.testing` | what every bound promises, as assertions for tests of your own shapes |
| `clamp3d.bench` | experiments on the methods |

Names are loaded on first use (`__init__.pyi` lists them), so ``import clamp3d`` costs next to nothing.
"""

import lazy_loader as _lazy

__version__ = "0.1.0"

__getattr__, __dir__, __all__ = _lazy.attach_stub(__name__, __file__)
