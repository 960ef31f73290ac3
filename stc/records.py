"""Data classes whose methods are made when they are first called.

``dataclass`` is that of the standard library for the classes of this package, with the same meaning: fields,
``field``, ``replace``, ``asdict``, pickling and pattern matching work alike.  The standard library generates and
compiles up to seven methods of each class when its module is imported, 0.3 ms a class, which for the hundred classes
that a solve imports took as long as a small solve itself.  Here they are generated when they are called, which most
never are.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Collection
from dataclasses import MISSING, Field, field
from typing import TYPE_CHECKING, Any

__all__ = ["dataclass", "field"]

if TYPE_CHECKING:  # what type checkers are to take it for
    from dataclasses import dataclass
else:

    def dataclass(
        cls: type | None = None,
        /,
        *,
        frozen: bool = False,
        slots: bool = False,
        eq: bool = True,
        repr: bool = True,
        kw_only: bool = False,
    ) -> Any:
        """Make a class with annotated fields a data class; the arguments mean what they do in the standard library."""

        def make(plain: type) -> type:
            return _Maker(plain, frozen, slots, kw_only).made(eq, repr)

        return make if cls is None else make(cls)


#: Instances that are made before a constructor is worth generating: that takes as long as thirty of them.
_OFTEN = 30


class _Maker:
    """Makes one class."""

    def __init__(self, plain: type, frozen: bool, slots: bool, kw_only: bool) -> None:
        self.plain = plain
        self.frozen = frozen
        self.slots = slots
        self.own = {
            name: _field_of(plain, name, annotation, kw_only)
            for name, annotation in plain.__annotations__.items()
            if not str(annotation).startswith(("ClassVar", "typing.ClassVar"))
        }
        self.fields: dict[str, Field[Any]] = {}
        for base in reversed(plain.__mro__[1:]):
            if "__dataclass_fields__" in base.__dict__:
                self.fields.update(base.__dict__["__dataclass_fields__"])
        self.fields.update(self.own)

    def made(self, eq: bool, repr: bool) -> type:
        """The class."""
        names = dict(self.plain.__dict__)
        added: dict[str, Any] = {
            "__dataclass_fields__": self.fields,
            "__match_args__": tuple(f.name for f in self.fields.values() if f.init and not f.kw_only),
        }
        own_hash = "__hash__" in names and not (names["__hash__"] is None and "__eq__" in names)
        if eq and not own_hash:
            added["__hash__"] = None
        if repr:
            added["__repr__"] = _representation(tuple(f.name for f in self.fields.values() if f.repr))
        methods = {name: added[name] for name in added if name not in names or name == "__hash__"}
        made: Any = self._with_slots(names, methods) if self.slots else self._in_place(methods)
        if eq:
            compared = tuple(f.name for f in self.fields.values() if f.compare)
            if "__eq__" not in names:
                made.__eq__ = _late(made, "__eq__", lambda: (_equal_text(compared), {}))
            if self.frozen and not own_hash:
                made.__hash__ = _late(made, "__hash__", lambda: (_hash_text(compared), {}))
        if "__init__" not in names:
            made.__init__ = _few_inits(made, self.fields, self.frozen)
        if self.frozen:
            made.__setattr__ = _refusing(made, "__setattr__", self.fields, "assign to")
            made.__delattr__ = _refusing(made, "__delattr__", self.fields, "delete")
        return made

    def _in_place(self, methods: dict[str, Any]) -> type:
        for name, value in methods.items():
            setattr(self.plain, name, value)
        for name, each in self.own.items():
            if each.default is not MISSING:
                setattr(self.plain, name, each.default)
            elif isinstance(self.plain.__dict__.get(name), Field):
                delattr(self.plain, name)
        return self.plain

    def _with_slots(self, names: dict[str, Any], methods: dict[str, Any]) -> type:
        """The class anew: slots are settled when a class is made."""
        for name in (*self.own, "__dict__", "__weakref__"):
            names.pop(name, None)
        inherited = {slot for base in self.plain.__mro__[1:-1] for slot in base.__dict__.get("__slots__", ())}
        names["__slots__"] = tuple(name for name in self.own if name not in inherited)
        names.update(methods)
        if self.frozen:  # pickling and copying would set attributes
            names.setdefault("__getstate__", _state)
            names.setdefault("__setstate__", _restore)
        made = type(self.plain)(self.plain.__name__, self.plain.__bases__, names)
        made.__qualname__ = self.plain.__qualname__
        return made


def _field_of(plain: type, name: str, annotation: Any, kw_only: bool) -> Field[Any]:
    default = plain.__dict__.get(name, MISSING)
    made: Any = default if isinstance(default, Field) else field(default=default)
    if made.default is not MISSING and type(made.default).__hash__ is None:
        raise ValueError(f"{plain.__qualname__}.{name}: a default that can change; use default_factory")
    made.name, made.type, made._field_type = name, annotation, dataclasses._FIELD  # type: ignore[attr-defined]
    if made.kw_only is MISSING:
        made.kw_only = kw_only
    return made


def _values(names: tuple[str, ...], of: str) -> str:
    """Text of a tuple of an object's fields."""
    return f"({''.join(f'{of}.{name}, ' for name in names)})"


def _late(cls: type, name: str, text: Callable[[], tuple[str, dict[str, Any]]]) -> Callable[..., Any]:
    """A method that, when it is first called, is replaced by the one that ``text`` gives the source of."""

    def method(self: Any, *args: Any, **kwargs: Any) -> Any:
        source, names = text()
        exec(source, names)
        real = names[name]
        real.__qualname__, real.__module__ = f"{cls.__qualname__}.{name}", cls.__module__
        setattr(cls, name, real)
        return real(self, *args, **kwargs)

    method.__name__, method.__qualname__ = name, f"{cls.__qualname__}.{name}"
    return method


def _representation(names: tuple[str, ...]) -> Callable[[Any], str]:
    from reprlib import recursive_repr

    def __repr__(self: Any) -> str:
        values = ", ".join(f"{name}={getattr(self, name)!r}" for name in names)
        return f"{type(self).__qualname__}({values})"

    return recursive_repr()(__repr__)


def _refusing(cls: type, name: str, fields: Collection[str], what: str) -> Callable[..., None]:
    """A method that refuses to change fields; subclasses may have further attributes."""

    def method(self: Any, attribute: str, *value: Any) -> None:
        if type(self) is cls or attribute in fields:
            raise dataclasses.FrozenInstanceError(f"cannot {what} field {attribute!r}")
        getattr(super(cls, self), name)(attribute, *value)

    return method


def _state(self: Any) -> list[Any]:
    return [getattr(self, name) for name in self.__dataclass_fields__]


def _restore(self: Any, state: list[Any]) -> None:
    for name, value in zip(self.__dataclass_fields__, state, strict=True):
        object.__setattr__(self, name, value)


def _equal_text(names: tuple[str, ...]) -> str:
    return (
        "def __eq__(self, other):\n"
        "    if other.__class__ is self.__class__:\n"
        f"        return {_values(names, 'self')} == {_values(names, 'other')}\n"
        "    return NotImplemented"
    )


def _hash_text(names: tuple[str, ...]) -> str:
    return f"def __hash__(self):\n    return hash({_values(names, 'self')})"


def _few_inits(cls: type, fields: dict[str, Field[Any]], frozen: bool) -> Callable[..., None]:
    """A constructor that reads the fields anew at every call; where it is called often, or wrongly, it is replaced."""
    generated = _late(cls, "__init__", lambda: _init_text(cls, fields, frozen))
    plain = [name for name, each in fields.items() if not each.kw_only]
    ordinary = all(each.init for each in fields.values())
    put = object.__setattr__ if frozen else setattr
    calls = 0

    def __init__(self: Any, *args: Any, **kwargs: Any) -> None:
        nonlocal calls
        calls += 1
        values = {**dict(zip(plain, args)), **kwargs}
        fits = ordinary and len(args) <= len(plain) and len(values) == len(args) + len(kwargs)
        if calls > _OFTEN or not fits or not fields.keys() >= values.keys():
            return generated(self, *args, **kwargs)
        for name, each in fields.items():
            if name in values:
                put(self, name, values[name])
            elif each.default is not MISSING:
                put(self, name, each.default)
            elif each.default_factory is not MISSING:
                put(self, name, each.default_factory())
            else:
                return generated(self, *args, **kwargs)
        if hasattr(cls, "__post_init__"):
            self.__post_init__()
        return None

    __init__.__qualname__ = f"{cls.__qualname__}.__init__"
    return __init__


def _init_text(cls: type, fields: dict[str, Field[Any]], frozen: bool) -> tuple[str, dict[str, Any]]:
    names: dict[str, Any] = {"_missing": MISSING, "_set": object.__setattr__}
    plain: list[str] = []
    by_name: list[str] = []
    body: list[str] = []
    for name, each in fields.items():
        value = name
        if each.default is not MISSING:
            names[f"_default_{name}"] = each.default
        if each.default_factory is not MISSING:
            names[f"_make_{name}"] = each.default_factory
            value = f"_make_{name}()"
            if each.init:
                value += f" if {name} is _missing else {name}"
        elif not each.init:
            if each.default is MISSING:
                continue
            value = f"_default_{name}"
        if each.init:
            optional = f"_default_{name}" in names or f"_make_{name}" in names
            default = f"=_default_{name}" if f"_default_{name}" in names else "=_missing" if optional else ""
            (by_name if each.kw_only else plain).append(name + default)
        body.append(f"_set(self, {name!r}, {value})" if frozen else f"self.{name} = {value}")
    if hasattr(cls, "__post_init__"):
        body.append("self.__post_init__()")
    parameters = ", ".join(["self", *plain, *(["*", *by_name] if by_name else [])])
    return f"def __init__({parameters}):\n    " + ("\n    ".join(body) or "pass"), names
