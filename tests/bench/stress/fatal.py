"""A method that crashes or hangs, apart from the tests: a process that only needs it imports little else."""

import os
import signal
import time
from dataclasses import dataclass

import numpy as np

from clamp3d.bench.stress.poses.cases import Cases
from clamp3d.bench.stress.worker import Measured


@dataclass(frozen=True)
class Fatal:
    """Answers one case at a time; a ``deadly`` gap (mm) ends its process, an ``endless`` one is never answered."""

    deadly: float
    endless: float
    measures = "depth"

    def __call__(self):
        return self

    def measure(self, cases: Cases) -> Measured:
        if (np.abs(cases.gap) > 0).any() and np.round(cases.gap[0], 12) == np.round(self.deadly, 12):
            os.kill(os.getpid(), signal.SIGSEGV)
        if len(cases) > 1:
            raise ValueError("one by one")
        if np.round(cases.gap[0], 12) == np.round(self.endless, 12):
            time.sleep(60)
        return Measured(cases.gap, cases.gap * np.nan, np.zeros(len(cases), bool))
