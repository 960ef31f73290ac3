"""Functions marked ``@native`` that are compiled into one object, and all that its code depends on.

A unit is what one Python module offers, with what that calls elsewhere.  It is found by a hash of the sources of all
these functions and of the numbers that they name, so that nothing is parsed where the machine code is on disk.
"""

from __future__ import annotations

import ast
import contextlib
import functools
import linecache
import types
from collections.abc import Callable, Iterator
from typing import Any

from stc.codegen import cache, engine, shipped
from stc.codegen.native import NativeFunction, registry
from stc.codegen.native_types import NativeError, location
from stc.codegen.sources import digest_of

__all__ = ["Unit", "compile_unit", "definition_of", "load_all", "symbols_of", "unit_ir", "units"]

#: What a function's code can name from outside.
_COMPILED = (bool, int, float, NativeFunction)


def _source_digest(filename: str) -> str:
    """Hash of a file's text as it is on disk, or of what was never in a file."""
    if not filename.startswith("<"):
        with contextlib.suppress(OSError):
            return digest_of(filename)
    return cache.key_of(_text_of(filename))


def _text_of(filename: str) -> str:
    """A file's text, or what was never in a file."""
    return "".join(linecache.getlines(filename))


@functools.lru_cache(maxsize=8)
def _definitions(filename: str, text: str) -> dict[int, ast.FunctionDef]:
    """Function definitions of a file by first line (that of the first decorator)."""
    found = {}
    for node in ast.walk(ast.parse(text, filename)):
        if isinstance(node, ast.FunctionDef):
            found[min([node.lineno, *(decorator.lineno for decorator in node.decorator_list)])] = node
    return found


def definition_of(function: Callable[..., Any]) -> ast.FunctionDef:
    """The syntax of a function.

    Raises:
        NativeError: its source is nowhere to be found.
    """
    code = function.__code__
    text = _text_of(code.co_filename)
    node = _definitions(code.co_filename, text).get(code.co_firstlineno) if text else None
    if node is None or node.name != function.__name__:
        raise NativeError(f"{location(function)}: the source of {function.__name__}() cannot be found")
    return node


def _resolver(function: Callable[..., Any]) -> Callable[[str], Any]:
    """What names mean to a function outside itself; None where undefined."""
    import builtins

    closure = dict(zip(function.__code__.co_freevars, function.__closure__ or (), strict=True))

    def resolve(name: str) -> Any:
        if name in closure:
            try:
                return closure[name].cell_contents
            except ValueError:
                return None
        return function.__globals__.get(name, getattr(builtins, name, None))

    return resolve


def _dependencies(function: Callable[..., Any]) -> Iterator[tuple[str, Any]]:
    """Numbers and compiled functions that a function's code names, directly or as attribute of a module."""
    code, scope = function.__code__, function.__globals__
    resolve = _resolver(function) if code.co_freevars else scope.get
    names = (*code.co_names, *code.co_freevars)
    for name in names:
        found = resolve(name)
        if isinstance(found, _COMPILED):
            yield name, found
        elif isinstance(found, types.ModuleType):
            for inner in names:
                value = getattr(found, inner, None)
                if isinstance(value, _COMPILED):
                    yield f"{name}.{inner}", value


def _reachable(roots: list[NativeFunction[..., Any]]) -> tuple[list[NativeFunction[..., Any]], list[str]]:
    """All functions to compile along with ``roots``, and a description of everything the code depends on."""
    functions = dict.fromkeys(roots)  # the roots come first, whatever they call
    described: list[str] = []
    files: set[str] = set()
    waiting = list(functions)
    for current in waiting:
        inner = current.function
        described.append(current.described())
        filename = inner.__code__.co_filename
        if filename not in files:
            files.add(filename)
            described.append(_source_digest(filename))
        for path, value in _dependencies(inner):
            described.append(f"{path} = {value!r}")
            if isinstance(value, NativeFunction) and value not in functions:
                functions[value] = None
                waiting.append(value)
    return waiting, described


def symbols_of(functions: list[NativeFunction[..., Any]]) -> list[str]:
    """What functions are called in machine code."""
    return [
        f"f{position}." + "".join(c if c.isascii() else "_" for c in native_function.__name__)
        for position, native_function in enumerate(functions)
    ]


def unit_ir(functions: list[NativeFunction[..., Any]], exported: int) -> str:
    """LLVM module of some functions, of which the first ``exported`` can be called from Python."""
    from stc.codegen.native_calls import Callee
    from stc.codegen.native_ir import FunctionEmitter, module_text

    symbols = symbols_of(functions)
    callees = {id(f): Callee(symbol, f.signature) for f, symbol in zip(functions, symbols, strict=True)}
    texts = []
    for position, (native_function, symbol) in enumerate(zip(functions, symbols, strict=True)):
        function = native_function.function
        emitter = FunctionEmitter(
            function.__code__.co_filename,
            definition_of(function),
            symbol,
            native_function.signature,
            flags=native_function.flags,
            inline=native_function.inline,
            small=native_function.small,
            short=native_function.short,
            shared=native_function.shared,
            exported=position < exported,
            resolve=_resolver(function),
            callee_of=lambda target: callees.get(id(target)),
        )
        texts.append(emitter.function())
    return module_text(texts)


class Unit:
    """Functions that are compiled into one object.

    Attributes:
        roots: those that Python calls, in order.
        functions: with those that they call, roots first.
        key: hash of everything that the code depends on but the machine and the code generator.
    """

    def __init__(self, roots: list[NativeFunction[..., Any]]) -> None:
        self.roots = roots
        self.functions, described = _reachable(roots)
        self.key = cache.key_of(*described)

    def ir(self) -> str:
        """The LLVM module."""
        return unit_ir(self.functions, len(self.roots))

    def load(self) -> None:
        """Find the machine code on disk, or compile it, and hand it to the functions."""
        symbols = symbols_of(self.functions)[: len(self.roots)]
        loaded, _ = engine.cached_object(
            cache.key_of("native", engine.fingerprint(), self.key),
            [name for symbol in symbols for name in (symbol, symbol + ".packed")],
            lambda: engine.compile_ir(self.ir(), level=1, optimise=True),
            shipped=lambda: shipped.find(self.key, engine.this_machine(), engine.own_digest()),
        )
        for native_function, symbol in zip(self.roots, symbols, strict=True):
            native_function.install(loaded, symbol)


def units() -> list[Unit]:
    """What the functions known so far would be compiled as, each whole module by itself."""
    roots = [[f for f in functions.values() if not f.inline] for functions in registry.values()]
    return [Unit(some) for some in roots if some]


def load_all() -> None:
    """Find, or compile, the code of this package's functions known so far, as their first calls would."""
    for module, functions in list(registry.items()):
        if module.startswith("stc."):
            for native_function in list(functions.values()):
                if not native_function.inline:
                    native_function.prepare()


def compile_unit(wanted: NativeFunction[..., Any]) -> None:
    """Compile, or find on disk, a function together with those of its module that are not compiled yet.

    What is copied into its callers is a function by itself only where it is the one wanted.
    """
    roots = [wanted]
    if wanted.is_global and not wanted.inline:
        siblings = registry.get(wanted.function.__module__, {}).values()
        roots = [f for f in siblings if f is wanted or not (f.is_compiled or f.inline)]
        if not any(f is wanted for f in roots):  # the module was reloaded, and this is its former self
            roots = [wanted]
    Unit(roots).load()
