"""Machine code in an object file, brought into memory: LLVM's own loader comes with LLVM, 0.02 s of CPU.

For a processor whose addresses have 64 bits LLVM writes code that may lie anywhere: every address that it names is a
whole word to be filled in. That is all that is understood here (System V ABI, ELF-64, AMD64 supplement, table 4.10).
"""

from __future__ import annotations

import ctypes
import mmap
import struct
import sys
from collections.abc import Iterator

_HEAD = struct.Struct("<16sHHIQQQIHHHHHH")
_SECTION = struct.Struct("<IIQQQQIIQQ")
_SYMBOL = struct.Struct("<IBBHQQ")
_RELOCATION = struct.Struct("<QQq")
_START = b"\x7fELF\x02\x01\x01"
_RELOCATABLE, _AMD64 = 1, 62
_WITHOUT_BYTES, _RELOCATIONS, _SYMBOLS = 8, 4, 2
_IN_MEMORY = 2
_WHOLE_WORD = 1
_kept: list[mmap.mmap] = []


def load(code: bytes, function: str) -> int | None:
    """Address of a function of an object file; None where this cannot tell, or the system forbids it."""
    if not sys.platform.startswith("linux") or len(code) < _HEAD.size:
        return None
    start, kind, machine, _, _, _, first, _, _, _, _, _, count, _ = _HEAD.unpack_from(code)
    if start[:7] != _START or (kind, machine) != (_RELOCATABLE, _AMD64):
        return None
    sections = [_SECTION.unpack_from(code, first + k * _SECTION.size) for k in range(count)]
    places, size = [], 0
    for _, _, flags, _, _, length, _, _, grain, _ in sections:
        size += -size % max(grain, 1)
        places.append(size)
        size += length if flags & _IN_MEMORY else 0
    memory = mmap.mmap(-1, max(size, 1), mmap.MAP_PRIVATE | mmap.MAP_ANONYMOUS, mmap.PROT_READ | mmap.PROT_WRITE)
    base = ctypes.addressof(ctypes.c_char.from_buffer(memory))
    for place, (_, what, flags, _, at, length, *_) in zip(places, sections, strict=True):
        if flags & _IN_MEMORY and what != _WITHOUT_BYTES:
            memory[place : place + length] = code[at : at + length]
    for _, what, _, _, at, length, table, target, _, _ in sections:
        if what == _RELOCATIONS and sections[target][2] & _IN_MEMORY:
            known = [address for _, address in _symbols(code, sections, table, [base + x for x in places])]
            for offset, info, addend in _RELOCATION.iter_unpack(code[at : at + length]):
                address = known[info >> 32]
                if info & 0xFFFFFFFF != _WHOLE_WORD or address is None:
                    return None
                struct.pack_into("<Q", memory, places[target] + offset, address + addend)
    protect = ctypes.CDLL(None).mprotect
    protect.argtypes = (ctypes.c_void_p, ctypes.c_size_t, ctypes.c_int)
    if protect(base, len(memory), mmap.PROT_READ | mmap.PROT_EXEC):
        return None
    _kept.append(memory)
    tables = [k for k, section in enumerate(sections) if section[1] == _SYMBOLS]
    symbols = (x for k in tables for x in _symbols(code, sections, k, [base + x for x in places]))
    return next((address for name, address in symbols if name == function), None)


def _symbols(
    code: bytes, sections: list[tuple[int, ...]], table: int, places: list[int]
) -> Iterator[tuple[str, int | None]]:
    """Names and addresses of a table of symbols; None for what neither the file nor this process has."""
    _, _, _, _, at, length, names, _, _, _ = sections[table]
    text = sections[names][4]
    for word, _, _, section, value, _ in _SYMBOL.iter_unpack(code[at : at + length]):
        name = code[text + word : code.index(b"\0", text + word)].decode()
        if 0 < section < len(places):
            yield name, places[section] + value
        else:
            yield name, _of_process(name) if name and section == 0 else None


def _of_process(name: str) -> int | None:
    """Address of a function of the C library."""
    function = getattr(ctypes.CDLL(None), name, None)
    return None if function is None else ctypes.cast(function, ctypes.c_void_p).value
