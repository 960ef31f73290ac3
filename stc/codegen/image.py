"""Object code made ready to run at any address, and mapped without the compiler's linker.

LLVM emits ELF objects whose code refers to its own constants and functions relative to the instruction pointer.
:func:`image_of` lays the sections of such an object out in one block and settles these references for good, so that
a later process only copies the block into memory: it needs neither the linker nor the 100 MB library it is part of,
whose import takes longer than a small solve.  What an object wants from the C library (``memset``, ``memcpy``) is
called through a slot per function, filled when the block is mapped.

Nothing is guessed: an object with a section or a relocation that is not known here has no image, and is left to
LLVM's linker.  Sources: System V ABI, generic (ELF) and AMD64 supplement (relocations).
"""

from __future__ import annotations

import ctypes
import mmap
import struct
import sys
from collections.abc import Callable, Mapping, Sequence
from typing import Any

#: Leads every image; an ELF object starts with another one.
MAGIC = b"stc-image-1\n"
#: After it: bytes of the table of names, of the block.
_SIZES = struct.Struct("<II")
#: Each entry of the table: place in the block, kind, bytes of the name that follows.
_ENTRY = struct.Struct("<IBB")
_DEFINED, _WANTED = 0, 1

_FILE = struct.Struct("<16sHHIQQQIHHHHHH")
_SECTION = struct.Struct("<IIQQQQIIQQ")
_SYMBOL = struct.Struct("<IBBHQQ")
_RELOCATION = struct.Struct("<QQq")
_IDENT = b"\x7fELF\x02\x01\x01"  # 64 bits, little-endian
_RELOCATABLE, _X86_64 = 1, 62
_PROGBITS, _SYMTAB, _RELA, _NOBITS = 1, 2, 4, 8
_WRITE, _ALLOC, _TLS = 0x1, 0x2, 0x400
_UNDEFINED = 0
_GLOBAL = 1
#: Relocations: the distance of a target to the place that refers to it, which is the same at any address.
_PC32, _PLT32 = 2, 4
_JUMP = b"\xff\x25"  # jmp [rip + 32 bits]
_LARGEST_ALIGNMENT = 4096
_PROT_READ, _PROT_EXEC = 1, 4


class _NoImageError(Exception):
    """The object has something in it that this module does not know."""


def supported() -> bool:
    """Whether images run here: on Linux with an x86-64 processor in 64-bit mode."""
    import os

    return sys.platform == "linux" and os.uname().machine == "x86_64" and sys.maxsize > 2**32


def image_of(code: bytes) -> bytes | None:
    """The image of an ELF object for x86-64; None for what is none, or asks for more than is known here."""
    if code[: len(_IDENT)] != _IDENT:
        return None
    try:
        return _Object(code).image()
    except (_NoImageError, struct.error, IndexError, ValueError):
        return None


class _Object:
    """An ELF object while it is laid out."""

    def __init__(self, code: bytes) -> None:
        _, kind, machine, _, _, _, table, _, _, _, _, size, count, _ = _FILE.unpack_from(code)
        if (kind, machine, size) != (_RELOCATABLE, _X86_64, _SECTION.size):
            raise _NoImageError
        self.code = code
        self.sections = [_SECTION.unpack_from(code, table + k * size) for k in range(count)]
        self.block = bytearray()
        self.places: dict[int, int] = {}
        self.slots: dict[str, int] = {}  # stubs of functions from outside
        self.wanted: list[tuple[str, int]] = []

    def image(self) -> bytes:
        """The whole image.

        Raises:
            _NoImageError: not possible.
        """
        self._lay_out()
        symbols, names = self._symbols()
        for section in self.sections:
            kind, target = section[1], section[7]
            if kind == _RELA and target in self.places:
                if section[6] != symbols:
                    raise _NoImageError
                self._settle(section, names)
            elif kind == 9 and target in self.places:  # SHT_REL: without addends, not used on this machine
                raise _NoImageError
        table = bytearray()
        for name, place in self._exported(names):
            table += _entry(place, _DEFINED, name)
        for name, place in self.wanted:
            table += _entry(place, _WANTED, name)
        return MAGIC + _SIZES.pack(len(table), len(self.block)) + bytes(table) + bytes(self.block)

    def _lay_out(self) -> None:
        for number, (_, kind, flags, _, offset, size, _, _, alignment, _) in enumerate(self.sections):
            if not flags & _ALLOC:
                continue
            if kind not in (_PROGBITS, _NOBITS) or flags & (_WRITE | _TLS) or alignment > _LARGEST_ALIGNMENT:
                raise _NoImageError
            self.block += bytes(-len(self.block) % max(alignment, 1))
            self.places[number] = len(self.block)
            content = self.code[offset : offset + size] if kind == _PROGBITS else bytes(size)
            if len(content) != size:
                raise _NoImageError
            self.block += content

    def _symbols(self) -> tuple[int, list[tuple[str, int, int, int]]]:
        """Number of the symbol table, and of each symbol name, binding, section, value."""
        tables = [k for k, section in enumerate(self.sections) if section[1] == _SYMTAB]
        if len(tables) != 1:
            raise _NoImageError
        _, _, _, _, offset, size, link, _, _, _ = self.sections[tables[0]]
        texts = self.sections[link][4]
        found = []
        for place in range(offset, offset + size, _SYMBOL.size):
            name, info, _, section, value, _ = _SYMBOL.unpack_from(self.code, place)
            end = self.code.index(b"\0", texts + name)
            found.append((self.code[texts + name : end].decode(), info >> 4, section, value))
        return tables[0], found

    def _exported(self, names: list[tuple[str, int, int, int]]) -> list[tuple[str, int]]:
        return [
            (name, self.places[section] + value)
            for name, binding, section, value in names
            if name and binding == _GLOBAL and section in self.places
        ]

    def _settle(self, section: tuple[Any, ...], names: list[tuple[str, int, int, int]]) -> None:
        _, _, _, _, offset, size, _, target, _, _ = section
        for at in range(offset, offset + size, _RELOCATION.size):
            where, info, addend = _RELOCATION.unpack_from(self.code, at)
            if info & 0xFFFFFFFF not in (_PC32, _PLT32):
                raise _NoImageError
            name, _, home, value = names[info >> 32]
            if home in self.places:
                aim = self.places[home] + value
            elif home == _UNDEFINED and name and info & 0xFFFFFFFF == _PLT32:
                aim = self._stub(name)
            else:
                raise _NoImageError
            place = self.places[target] + where
            struct.pack_into("<i", self.block, place, aim + addend - place)

    def _stub(self, name: str) -> int:
        """Place of a jump to a function from outside, through a slot that holds its address."""
        if name not in self.slots:
            self.block += bytes(-len(self.block) % 16)
            stub, slot = len(self.block), len(self.block) + 8
            self.block += _JUMP + struct.pack("<i", slot - stub - 6) + bytes(2) + bytes(8)
            self.slots[name] = stub
            self.wanted.append((name, slot))
        return self.slots[name]


def _entry(place: int, kind: int, name: str) -> bytes:
    text = name.encode()
    return _ENTRY.pack(place, kind, len(text)) + text


class MappedImage:
    """An image in this process's memory, executable; unmapped when the last reference to it is dropped."""

    def __init__(self, memory: mmap.mmap, start: int, symbols: dict[str, int]) -> None:
        self._memory = memory
        self._start = start
        self._symbols = symbols

    def address(self, symbol: str) -> int:
        """Address of an exported symbol, valid as long as this object is referenced."""
        return self._start + self._symbols[symbol]


def map_image(image: bytes, symbols: Sequence[str], instead: Mapping[str, int]) -> MappedImage:
    """Copy an image into memory and make it executable (and no longer writable).

    Args:
        image: from :func:`image_of`.
        symbols: what must be in it.
        instead: addresses of functions that it gets instead of those of the C library.

    Raises:
        RuntimeError: not an image, a symbol is missing, or the system does not allow it.
    """
    known: dict[str, int] = {}
    wanted: list[tuple[str, int]] = []
    try:
        if image[: len(MAGIC)] != MAGIC:
            raise RuntimeError("not an image of machine code")
        named, size = _SIZES.unpack_from(image, len(MAGIC))
        at = len(MAGIC) + _SIZES.size
        end = at + named
        while at < end:
            place, kind, length = _ENTRY.unpack_from(image, at)
            at += _ENTRY.size + length
            name = image[at - length : at].decode()
            if kind == _DEFINED:
                known[name] = place
            else:
                wanted.append((name, place))
    except (struct.error, UnicodeDecodeError) as error:
        raise RuntimeError("a damaged image of machine code") from error
    if at != end or len(image) != end + size:
        raise RuntimeError("a damaged image of machine code")
    missing = [name for name in symbols if name not in known]
    if missing:
        raise RuntimeError(f"the machine code has no {', '.join(missing)}")
    try:
        memory = mmap.mmap(-1, max(size, 1), flags=mmap.MAP_PRIVATE | mmap.MAP_ANONYMOUS)
    except OSError as error:
        raise RuntimeError(f"no memory for machine code: {error}") from error
    memory[:size] = image[end:]
    library, protect = _process()
    for name, place in wanted:
        address = instead.get(name)
        if address is None:
            try:
                function = library[name]
            except AttributeError as error:
                raise RuntimeError(f"the machine code wants {name}, which this process lacks") from error
            address = ctypes.cast(function, ctypes.c_void_p).value or 0
        struct.pack_into("<Q", memory, place, address)
    start = ctypes.addressof(ctypes.c_char.from_buffer(memory))
    if protect(start, len(memory), _PROT_READ | _PROT_EXEC):
        raise RuntimeError("this system does not let memory be made executable")
    return MappedImage(memory, start, known)


_known_process: list[tuple[ctypes.CDLL, Callable[[int, int, int], int]]] = []


def _process() -> tuple[ctypes.CDLL, Callable[[int, int, int], int]]:
    """What is loaded into this process, and its ``mprotect``."""
    if not _known_process:
        library = ctypes.CDLL(None)
        protect = ctypes.CFUNCTYPE(ctypes.c_int, ctypes.c_void_p, ctypes.c_size_t, ctypes.c_int)(
            ("mprotect", library)
        )
        _known_process.append((library, protect))
    return _known_process[0]
