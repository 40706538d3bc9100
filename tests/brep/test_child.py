"""Processes that end with the one that started them, however that ended."""

import os
import signal
import subprocess
import sys

import pytest

_PARENT = """
import multiprocessing, os, signal, sys, time
from clamp3d.brep.child import end_with_parent

def work(said):
    end_with_parent()
    said.send(os.getpid())
    time.sleep(600.0)

if __name__ == "__main__":
    here, there = multiprocessing.Pipe()
    process = multiprocessing.get_context("spawn").Process(target=work, args=(there,))
    process.start()
    print(here.recv(), flush=True)
    if sys.argv[1] == "killed":
        os.kill(os.getpid(), signal.SIGKILL)
    os._exit(0)
"""


@pytest.mark.parametrize("how", ["killed", "gone"])
def test_a_worker_ends_when_its_parent_does(how, tmp_path):
    script = tmp_path / "parent.py"
    script.write_text(_PARENT, encoding="utf-8")
    with subprocess.Popen([sys.executable, script, how], stdout=subprocess.PIPE, text=True) as parent:
        assert parent.stdout is not None
        worker = int(parent.stdout.readline())
        try:
            parent.communicate(timeout=60.0)  # its output, which the worker shares, ends with the last of the two
        except subprocess.TimeoutExpired:
            os.kill(worker, signal.SIGKILL)
            raise


def test_a_worker_of_nobody_goes_on():
    """Called in a process that `multiprocessing` did not start it does nothing."""
    code = (
        "from clamp3d.brep.child import end_with_parent; import time; end_with_parent(); time.sleep(0.3); print('on')"
    )
    run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=120, check=False)
    assert (run.returncode, run.stdout) == (0, "on\n"), run.stderr
