from . import baselines as baselines
from . import bench as bench
from . import figures as figures
from . import kernel as kernel
from . import shapes as shapes
from .clamp.assemble import assemble as assemble
from .clamp.dimensions import Clamp as Clamp
from .clamp.loader import load_clamp as load_clamp
from .clamp.result import Assembly as Assembly
from .clamp.sensitivity import sensitivity as sensitivity
from .clamp.tolerance import monte_carlo as monte_carlo
from .collide.bounds import Verdict as Verdict
from .collide.check import check as check
from .collide.distance import Distance as Distance
from .collide.distance import distance as distance
from .collide.distance import measure as measure
from .collide.motion import Motion as Motion
from .collide.result import CheckResult as CheckResult
from .collide.scene import Part as Part
from .collide.scene import Scene as Scene
from .errors import InputError as InputError
from .fit.fit import fit_file as fit_file
from .fit.fit import fit_mesh as fit_mesh
from .output.export import export as export
from .scenefile.file import load_scene as load_scene
from .scenefile.load import load as load

__version__: str
