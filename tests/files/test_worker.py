"""A process that answers requests: what it gives back, what it keeps from its caller, and how its faults are said."""

import os
import subprocess
import sys

import pytest

from clamp3d import InputError
from clamp3d.errors import SolverError
from clamp3d.files.child import Worker, WorkerEndedError, WorkerTimeoutError
from clamp3d.files.worker import process
from tests.cli.test_faults import alive, until

STAND_IN = """
import os
import time
from clamp3d.errors import InputError, SolverError

def fail(kind):
    raise {"input": InputError("no such thing"), "solver": SolverError("none"), "other": KeyError("x")}[kind]

def pid():
    return os.getpid()

def ask():
    return os.read(0, 1)

def work(seconds):
    end = time.process_time() + seconds
    while time.process_time() < end:
        pass
"""


@pytest.fixture
def worker(tmp_path, monkeypatch):
    (tmp_path / "stand_in.py").write_text(STAND_IN)
    monkeypatch.syspath_prepend(str(tmp_path))
    with Worker(confined=True) as made:
        yield made


def test_one_process_answers_until_it_fails_and_the_next_call_starts_another(worker):
    first = worker.call("stand_in:pid", time_limit=60.0)
    for kind, error, message in (
        ("input", InputError, "no such thing"),
        ("solver", SolverError, "none"),
        ("other", RuntimeError, "KeyError: 'x' at stand_in.py"),
    ):
        with pytest.raises(error, match=message):
            worker.call("stand_in:fail", kind, time_limit=60.0)
    assert worker.call("stand_in:pid", time_limit=60.0) == first
    for function, arguments, message in (("os:abort", (), "SIGABRT"), ("os:_exit", (7,), "exit code 7")):
        with pytest.raises(WorkerEndedError, match=message):
            worker.call(function, *arguments, time_limit=60.0)
    with pytest.raises(WorkerTimeoutError):
        worker.call("time:sleep", 600, time_limit=0.5)
    assert worker.call("stand_in:pid", time_limit=60.0) != first


@pytest.mark.skipif(sys.platform == "win32", reason="Windows limits no processor time")
def test_processor_time_is_limited_for_each_call_alone(worker):
    worker.call("time:sleep", 0.6, time_limit=60.0, cpu=0.3)
    for _ in range(2):
        worker.call("stand_in:work", 0.2, time_limit=60.0, cpu=0.3)
    with pytest.raises(WorkerTimeoutError):
        worker.call("stand_in:work", 600.0, time_limit=600.0, cpu=0.3)


@pytest.mark.skipif(not hasattr(os, "fork"), reason="processes cannot be forked here")
@pytest.mark.filterwarnings("ignore:This process.*fork:DeprecationWarning")
def test_a_forked_process_starts_a_worker_of_its_own():
    first = process().call("os:getpid", time_limit=60.0)
    child = os.fork()
    if child == 0:
        other = process().call("os:getpid", time_limit=60.0)
        process().close()
        os._exit(7 if other != first else 1)
    assert os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) == 7
    assert process().call("os:getpid", time_limit=60.0) == first


@pytest.mark.skipif(sys.platform != "linux", reason="memory is limited on Linux alone")
def test_memory_is_limited_for_each_call_alone(worker):
    with pytest.raises(MemoryError):
        worker.call("numpy:ones", 10**8, time_limit=60.0, memory=2**28)
    assert len(worker.call("numpy:ones", 10**7, time_limit=60.0)) == 10**7


@pytest.mark.parametrize(
    ("function", "argument"),
    [
        ("socket:create_connection", ["127.0.0.1", 9]),
        ("os:system", "true"),
        ("builtins:eval", "__import__('socket').socket(2, 2).sendto(b'x', ('127.0.0.1', 9))"),
        ("builtins:eval", "__import__('os').posix_spawn('/bin/true', ['true'], {})"),
    ],
)
def test_what_it_may_not_do_is_refused(worker, function, argument):
    for confined in (worker, process()):  # the second is the one that reads foreign files
        with pytest.raises(OSError, match="not allowed while a file is read"):
            confined.call(function, argument, time_limit=60.0)


def test_who_reads_the_standard_input_there_takes_no_request(worker):
    assert worker.call("stand_in:ask", time_limit=60.0) == b""


def test_modules_of_the_current_folder_are_not_imported(tmp_path, monkeypatch):
    (tmp_path / "numpy.py").write_text(f"open({str(tmp_path / 'executed')!r}, 'w')")
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "path", ["", *sys.path])  # as in a notebook, and at the prompt
    with Worker() as made:
        assert made.call("numpy:ones", 3, time_limit=60.0).tolist() == [1.0] * 3
    assert not (tmp_path / "executed").exists()


POOL = """
from concurrent.futures import ProcessPoolExecutor
from clamp3d.files.child import end_with_parent
with_parent = ProcessPoolExecutor(1, initializer=end_with_parent)
print(with_parent.submit(os.getpid).result(), flush=True)
"""
WORKER = """
from clamp3d.files.child import Worker
worker = Worker()
print(worker.call("os:getpid", time_limit=60.0), flush=True)
"""


@pytest.mark.skipif(not hasattr(os, "fork"), reason="processes cannot be forked here")
@pytest.mark.parametrize("start", [POOL, WORKER], ids=["pool", "worker"])
def test_it_ends_with_its_caller(start):
    code = f"import os, signal\n{start}\nos.kill(os.getpid(), signal.SIGKILL)"
    run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False, timeout=120)
    until(lambda: not alive(int(run.stdout)))
