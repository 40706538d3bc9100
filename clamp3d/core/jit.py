"""How the compiled formulas are built, and kept: as machine code in the cache folder, loaded without numba.

numba's own cache would do, but to read it numba has to be imported with its compiler and its type libraries (0.5 s of
CPU, more than most commands work); machine code needs llvmlite alone (0.05 s). What cannot be kept that way (a formula
that allocates memory, other arrays than those in C order) goes into numba's cache.
"""

from __future__ import annotations

import ctypes
import hashlib
import os
import platform
import re
import sys
from collections.abc import Callable
from contextlib import suppress
from functools import cache, cached_property, partial
from pathlib import Path
from types import CodeType
from typing import Any

# IEEE arithmetic as written (no re-association), and division by zero gives inf instead of a Python exception.
_OPTIONS: dict[str, Any] = {"fastmath": False, "error_model": "numpy", "nogil": True}
_MATHEMATICS = {"sqrt", "sin", "cos", "tan", "asin", "acos", "atan", "atan2", "hypot", "fabs", "exp", "log", "pow"}
_SYMBOLS = _MATHEMATICS | {"memset", "memcpy", "memmove"}
"""What machine code may call: every process has it."""
_OTHERWISE = b""
"""In place of machine code: numba's cache has it."""
_TYPES: dict[str, Any] = {"f8": ctypes.c_double, "i8": ctypes.c_int64, "b1": ctypes.c_bool, "void": None}


class _Formula:
    """A function that numba compiles into its callers; numba is imported when it is asked for the type of this."""

    def __init__(self, function: Callable[..., Any], **options: Any) -> None:
        self._function, self._options = function, options

    def _compile(self, **options: Any) -> Any:
        import numba

        return numba.njit(**_OPTIONS, **self._options, **options)(self._function)

    @cached_property
    def _compiled(self) -> Any:
        """As other formulas call it: without the functions that numba makes for calls from Python and from C."""
        import numba

        compiled = self._compile(no_cpython_wrapper=True, no_cfunc_wrapper=True)
        if "forceinline" not in self._options:  # numba would compile it anew for each constant that it is called with
            template = compiled.get_call_template
            compiled.get_call_template = lambda given, named: template(tuple(map(numba.types.unliteral, given)), named)
        return compiled

    @cached_property
    def _called(self) -> Any:
        return self._compile()

    @property
    def _numba_type_(self) -> Any:
        return self._compiled._numba_type_

    def __call__(self, *arguments: Any) -> Any:
        return self._called(*arguments)


class _Prefetch(_Formula):
    """One instruction that neither Python nor numba has a word for."""

    def _compile(self, **options: Any) -> Any:
        import numba
        from llvmlite import ir
        from numba import types
        from numba.extending import intrinsic

        @intrinsic
        def instruction(typing_context, array, offset):  # type: ignore[no-untyped-def]
            def build(context, builder, signature, given):  # type: ignore[no-untyped-def]
                number, pointer = ir.IntType(32), ir.IntType(8).as_pointer()
                start = builder.bitcast(context.make_array(signature.args[0])(context, builder, given[0]).data, pointer)
                kind = ir.FunctionType(ir.VoidType(), [pointer, number, number, number])
                fetch = builder.module.declare_intrinsic("llvm.prefetch", [pointer], kind)
                builder.call(
                    fetch, [builder.gep(start, [given[1]]), number(0), number(3), number(1)]
                )  # read, keep, data
                return context.get_dummy_value()

            return types.void(array, offset), build

        fetch = partial(numba.njit, **_OPTIONS, **self._options, **options)
        return fetch(lambda array, offset: instruction(array, offset))  # type: ignore[call-arg]


def formula(function: Callable[..., Any]) -> Any:
    """Decorator of a formula: compiled into its callers, not kept by itself."""
    return _Formula(function)


def inlined(function: Callable[..., Any]) -> Any:
    """The same for a small formula: built into each caller, for its constants, without what it does not use."""
    return _Formula(function, forceinline=True)


@partial(_Prefetch, forceinline=True)
def prefetch(array: Any, offset: int) -> None:
    """Have what lies ``offset`` bytes into an array, or beyond it, brought near before it is asked for."""


def entry(function: Callable[..., Any], signature: str) -> Any:
    """An entry point for one ``signature`` as numba writes it, from the cache or compiled; arrays are in C order.

    Called with other types than those of its signature it may end the process: the callers check. Damaged files in
    the cache are written anew; without a place for the cache every run compiles.
    """
    returned, given = re.fullmatch(r"(\w+)\((.*)\)", signature).groups()  # type: ignore[union-attr]
    arguments = re.findall(r"\w+(?:\[[^]]*\])?", given)
    path = _place(function, signature)
    code = _read(path)
    if code is None:
        once = _can_keep(path.parent)
        _say(once)
        code = _machine_code(function, returned, arguments)
        if once:
            _keep(path, code)
    if code == _OTHERWISE:
        return _cached_by_numba(function, signature, path)
    kinds = [ctypes.py_object if "[" in kind else _TYPES[kind] for kind in arguments]
    return ctypes.CFUNCTYPE(_TYPES[returned], *kinds)(_load(code))


# --- The cache --------------------------------------------------------------------------------------------------------


def _stamp(function: Callable[..., Any]) -> str:
    """Hash of what the machine code is made from.

    That is this file, and of the function and all formulas that it calls the bytecode and the values of the globals,
    wherever those were imported from.
    """
    digest = hashlib.sha256(Path(__file__).read_bytes())
    waiting: list[tuple[Any, dict[str, Any], object]] = [(function.__code__, function.__globals__, None)]
    seen = set()
    while waiting:
        code, known, options = waiting.pop()
        if id(code) in seen:  # equal code of two modules may have other globals
            continue
        seen.add(id(code))
        plain = [x for x in code.co_consts if not isinstance(x, CodeType)]
        digest.update(repr((code.co_code, code.co_names, plain, options)).encode())
        waiting += [(x, known, None) for x in code.co_consts if isinstance(x, CodeType)]
        for name in code.co_names:
            value = known.get(name)
            if isinstance(value, _Formula):
                waiting.append((value._function.__code__, value._function.__globals__, value._options))
            elif isinstance(value, (bool, int, float, str, tuple)):
                digest.update(repr(value).encode())
    return digest.hexdigest()


def _place(function: Callable[..., Any], signature: str) -> Path:
    """The file of an entry point: another one for every source, processor and version."""
    import platformdirs

    facts = [_stamp(function), function.__qualname__, signature, *_versions()]
    key = hashlib.sha256(repr(facts).encode()).hexdigest()[:32]
    own = os.environ.get("CLAMP3D_CACHE")
    folder = Path(own).expanduser() if own else platformdirs.user_cache_path("clamp3d", appauthor=False)
    return folder / f"kernel-{function.__name__}-{key}.o"


@cache
def _versions() -> list[str]:
    """What compiles, and what for."""
    import llvmlite
    import llvmlite.binding as llvm
    import numpy

    found = [_numba(Path(llvmlite.__file__).parents[1]), llvmlite.__version__, numpy.__version__]
    triple, cpu = llvm.get_process_triple(), llvm.get_host_cpu_name()
    return [*found, sys.version, platform.machine(), triple, cpu, _features()]


def _numba(folder: Path) -> str:
    """Its version, by what installers leave beside it: importlib.metadata takes 3 % of a run to load and to ask."""
    found = [entry.name[6:-10] for entry in folder.glob("numba-*.dist-info")]
    if len(found) == 1:
        return found[0]
    from importlib import metadata

    return metadata.version("numba")


@cache
def _features() -> str:
    """What this processor can do, in LLVM's words."""
    import llvmlite.binding as llvm

    try:
        return str(llvm.get_host_cpu_features().flatten())
    except RuntimeError:  # not known for this kind of processor
        return ""


def _read(path: Path) -> bytes | None:
    """The machine code in a file; None if there is none or the file is damaged."""
    with suppress(OSError):
        content = path.read_bytes()
        if content[:32] == hashlib.sha256(content[32:]).digest():
            return content[32:]
    return None


def _keep(path: Path, code: bytes) -> None:
    """Write it whole or not at all; a cache that cannot be written is no error."""
    import tempfile

    with suppress(OSError), tempfile.TemporaryDirectory(dir=path.parent) as folder:
        temporary = Path(folder, "code")
        temporary.write_bytes(hashlib.sha256(code).digest() + code)
        os.replace(temporary, path)


@cache
def _say(once: bool) -> None:
    """One line on stderr when compiling begins."""
    when = "once for this machine" if once else "in every run: no cache folder can be written, CLAMP3D_CACHE names one"
    print(f"clamp3d: compiling the contact kernel, {when} (up to a minute) ...", file=sys.stderr, flush=True)


def _can_keep(folder: Path) -> bool:
    import tempfile

    try:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder):
            return True
    except OSError:
        return False


# --- Machine code -----------------------------------------------------------------------------------------------------


@cache
def _engine() -> Any:
    """LLVM's own compiler as a loader of machine code."""
    import llvmlite.binding as llvm

    llvm.initialize_native_target()
    llvm.initialize_native_asmprinter()
    return llvm.create_mcjit_compiler(llvm.parse_assembly(""), _machine())


def _machine() -> Any:
    import llvmlite.binding as llvm

    target = llvm.Target.from_default_triple()
    return target.create_target_machine(
        cpu=llvm.get_host_cpu_name(), features=_features(), opt=3, reloc="default", codemodel="jitdefault", jit=True
    )


def _load(code: bytes) -> int:
    """Address of the one function in ``code``."""
    import llvmlite.binding as llvm

    engine = _engine()
    name = code[: code.index(b"\n")].decode()
    engine.add_object_file(llvm.ObjectFileRef.from_data(code[len(name) + 1 :]))
    engine.finalize_object()
    return int(engine.get_function_address(name))


def _machine_code(function: Callable[..., Any], returned: str, arguments: list[str]) -> bytes:
    """Name and machine code of an entry point; `_OTHERWISE` if it needs more than mathematics.

    numba writes a C function that takes the arrays as NumPy's own objects, whose fields are public
    (PyArrayObject_fields): data and dimensions are behind the head that all objects have.
    """
    import llvmlite.binding as llvm
    import numba
    from llvmlite import ir
    from numba import types
    from numba.extending import intrinsic

    if not all(kind in _TYPES or re.fullmatch(r"(f8|i8|i1)\[(:,)*::1\]", kind) for kind in [returned, *arguments]):
        return _OTHERWISE
    head = object.__basicsize__

    @intrinsic
    def word(typing_context, address, offset):  # type: ignore[no-untyped-def]
        def build(context, builder, signature, given):  # type: ignore[no-untyped-def]
            return builder.load(builder.inttoptr(builder.add(*given), ir.IntType(64).as_pointer()))

        return types.int64(types.int64, types.int64), build

    def pointer(kind: Any, low: Any) -> Any:
        @intrinsic
        def at(typing_context, address):  # type: ignore[no-untyped-def]
            def build(context, builder, signature, given):  # type: ignore[no-untyped-def]
                return builder.inttoptr(given[0], low.as_pointer())

            return types.CPointer(kind)(types.int64), build  # type: ignore[no-untyped-call]

        return at

    names = [f"a{i}" for i in range(len(arguments))]
    passed = []
    for name, kind in zip(names, arguments, strict=True):
        shape = "".join(f"word(word({name}, {head + 16}), {8 * i}), " for i in range(kind.count(":") - 1))
        passed.append(f"carray({kind[:2]}(word({name}, {head})), ({shape}))" if "[" in kind else name)
    text = f"def call({', '.join(names)}):\n    return function({', '.join(passed)})\n"
    known: dict[str, Any] = {
        "carray": numba.carray,  # type: ignore[attr-defined]
        "word": word,
        "f8": pointer(types.float64, ir.DoubleType()),
        "i8": pointer(types.int64, ir.IntType(64)),
        "i1": pointer(types.int8, ir.IntType(8)),
    }
    exec(text, known | {"function": _Formula(function)._compiled}, known)
    plain = ", ".join("i8" if "[" in kind else kind for kind in arguments)
    made = numba.cfunc(f"{returned}({plain})", **_OPTIONS)(known["call"])
    module = llvm.parse_assembly(made.inspect_llvm())
    for part in module.functions:
        if not part.is_declaration and part.name != made.native_name:
            part.linkage = "internal"
    machine = _machine()
    passes = llvm.create_pass_builder(machine, llvm.create_pipeline_tuning_options(speed_level=3))
    passes.getModulePassManager().run(module, passes)
    called = {part.name for part in module.functions if part.is_declaration and not part.name.startswith("llvm.")}
    if not called <= _SYMBOLS or any(part.is_declaration for part in module.global_variables):
        return _OTHERWISE
    return bytes(made.native_name.encode() + b"\n" + machine.emit_object(module))


# --- numba's cache ----------------------------------------------------------------------------------------------------


def _cached_by_numba(function: Callable[..., Any], signature: str, path: Path) -> Any:
    """Compiled by numba for one signature, from its cache if it is there; damaged files are written anew.

    Its files are found by the function's name, and know of no change in a formula or a constant: the name has the key.
    """
    import numba
    from numba.core import event

    class Notice(event.Listener):
        def on_start(self, event: object) -> None:
            _say(_can_keep(path.parent))

        def on_end(self, event: object) -> None:
            pass

    function.__qualname__ = path.stem
    with event.install_listener("numba:compile", Notice()):
        with suppress(OSError, RuntimeError):  # no place for the cache, or none left
            cached = numba.njit(cache=True, **_OPTIONS)(function)
            try:
                cached.compile(signature)
            except Exception:  # unpickling a damaged file can raise anything
                cached._cache.flush()
                cached.compile(signature)
            cached.disable_compile()
            return cached
        return numba.njit(signature, **_OPTIONS)(function)
