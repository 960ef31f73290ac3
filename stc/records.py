"""Data classes whose methods are generated when they are first called.

``dataclass`` replaces that of the standard library for the classes of this package, with the same meaning: fields,
``field``, ``replace``, ``asdict``, pickling and pattern matching work alike.  The standard library generates and
compiles up to seven methods of each class when its module is imported, which takes 0.3 ms a class; for the hundred
classes that a solve imports this took as long as a small solve.  Here all classes share the same methods at first,
which generate the class's own methods when they are called.  Most are never called.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from dataclasses import MISSING, Field, FrozenInstanceError, field
from operator import attrgetter
from reprlib import recursive_repr
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
            return _made(plain, frozen, slots, eq, repr, kw_only)

        return make if cls is None else make(cls)


#: Instances that are made before a constructor is worth generating: that takes as long as a hundred of them.
_OFTEN = 100
#: Where the fields of a class are, under the name that the standard library has for them.
_FIELDS = "__dataclass_fields__"


def _made(plain: type, frozen: bool, slots: bool, eq: bool, repr: bool, kw_only: bool) -> type:
    """A class with the fields that another one annotates, as a data class."""
    names = dict(plain.__dict__)
    own = {
        name: (annotation, names.get(name, MISSING), kw_only)
        for name, annotation in plain.__annotations__.items()
        if not str(annotation).startswith(("ClassVar", "typing.ClassVar"))
    }
    for name, (_, default, _) in own.items():
        value = default.default if isinstance(default, Field) else default
        if type(value).__hash__ is None:
            raise ValueError(f"{plain.__qualname__}.{name}: a default that can change; use default_factory")
    late = _LateFields(plain, own)
    added: dict[str, Any] = {_FIELDS: late, "__match_args__": late.match_args()}
    own_hash = "__hash__" in names and not (names["__hash__"] is None and "__eq__" in names)
    methods: dict[str, Any] = {"__init__": _init}
    if repr:
        methods["__repr__"] = _repr
    if eq:
        methods["__eq__"] = _eq
    added.update((name, method) for name, method in methods.items() if name not in names)
    if frozen:
        added["__setattr__"], added["__delattr__"] = _setattr, _delattr
    if eq and not own_hash:
        added["__hash__"] = _hash if frozen else None
    for name, (_, default, _) in own.items():
        if isinstance(default, Field) and default.default is not MISSING:
            added[name] = default.default
    if slots:
        return _with_slots(plain, frozen, names, own, added)
    for name, value in added.items():
        setattr(plain, name, value)
    for name, (_, default, _) in own.items():
        if isinstance(default, Field) and default.default is MISSING:
            delattr(plain, name)
    return plain


def _with_slots(
    plain: type, frozen: bool, names: dict[str, Any], own: dict[str, Any], added: dict[str, Any]
) -> type:
    """The class anew: slots are settled when a class is made."""
    names.update(added)
    for name in (*own, "__dict__", "__weakref__"):
        names.pop(name, None)
    inherited = {slot for base in plain.__mro__[1:-1] for slot in base.__dict__.get("__slots__", ())}
    names["__slots__"] = tuple(name for name in own if name not in inherited)
    if frozen:  # pickling and copying would set attributes
        names.setdefault("__getstate__", _state)
        names.setdefault("__setstate__", _restore)
    made = type(plain)(plain.__name__, plain.__bases__, names)
    made.__qualname__ = plain.__qualname__
    return made


class _LateFields:
    """A class attribute that makes the list of the class's fields on first use, and is then replaced by it.

    ``own`` has for each field its annotation, its default (or what ``field`` returned), and whether it can only be
    given by keyword.
    """

    def __init__(self, plain: type, own: dict[str, tuple[Any, Any, bool]]) -> None:
        self.all: dict[str, tuple[Any, Any, bool]] = {}
        for base in reversed(plain.__mro__[1:]):
            inherited = base.__dict__.get(_FIELDS)
            if isinstance(inherited, _LateFields):
                self.all.update(inherited.all)
            elif inherited is not None:
                self.all.update({name: (each.type, each, each.kw_only) for name, each in inherited.items()})
        self.all.update(own)

    def match_args(self) -> tuple[str, ...]:
        """The fields that a constructor takes by position."""
        return tuple([name for name, (_, default, late) in self.all.items() if not _is_apart(default, late)])

    def __get__(self, instance: Any, cls: type) -> dict[str, Field[Any]]:
        owner = next(each for each in cls.__mro__ if each.__dict__.get(_FIELDS) is self)
        fields = {name: _field_of(name, *each) for name, each in self.all.items()}
        setattr(owner, _FIELDS, fields)
        return fields


def _is_apart(default: Any, kw_only: bool) -> bool:
    """Whether no constructor takes a field by position."""
    if not isinstance(default, Field):
        return kw_only
    return not default.init or (kw_only if default.kw_only is MISSING else default.kw_only)


def _field_of(name: str, annotation: Any, default: Any, kw_only: bool) -> Field[Any]:
    made: Any = default if isinstance(default, Field) else field(default=default)
    made.name, made.type, made._field_type = name, annotation, dataclasses._FIELD  # type: ignore[attr-defined]
    if made.kw_only is MISSING:
        made.kw_only = kw_only
    return made


def _owner(self: Any, method: str, shared: Callable[..., Any]) -> type:
    """The class whose ``method`` has been called for an object: the first one that has this."""
    return next(cls for cls in type(self).__mro__ if cls.__dict__.get(method) is shared)


def _fields_of(cls: type) -> dict[str, Field[Any]]:
    found: dict[str, Field[Any]] = getattr(cls, _FIELDS)
    return found


def _put(cls: type, name: str, real: Callable[..., Any]) -> Callable[..., Any]:
    """Put a method in the place of the shared one."""
    real.__name__, real.__qualname__, real.__module__ = name, f"{cls.__qualname__}.{name}", cls.__module__
    setattr(cls, name, real)
    return real


def _compared(cls: type) -> Callable[[Any], tuple[Any, ...]]:
    """A function that returns the fields of an object that count in comparisons."""
    names = [f.name for f in _fields_of(cls).values() if f.compare]
    if len(names) > 1:
        return attrgetter(*names)
    get = attrgetter(*names) if names else None
    return lambda self: () if get is None else (get(self),)


def _eq(self: Any, other: object) -> Any:
    cls = _owner(self, "__eq__", _eq)
    values = _compared(cls)

    def __eq__(self: Any, other: object) -> Any:
        return values(self) == values(other) if other.__class__ is self.__class__ else NotImplemented

    return _put(cls, "__eq__", __eq__)(self, other)


def _hash(self: Any) -> int:
    cls = _owner(self, "__hash__", _hash)
    values = _compared(cls)

    def __hash__(self: Any) -> int:
        return hash(values(self))

    found: int = _put(cls, "__hash__", __hash__)(self)
    return found


@recursive_repr()
def _repr(self: Any) -> str:
    fields = _fields_of(_owner(self, "__repr__", _repr)).values()
    values = ", ".join(f"{f.name}={getattr(self, f.name)!r}" for f in fields if f.repr)
    return f"{type(self).__qualname__}({values})"


def _change(
    self: Any, method: str, shared: Callable[..., Any], what: str, attribute: str, *value: Any
) -> None:
    """Refuse to change fields; subclasses may have further attributes."""
    cls: Any = None
    for cls in [each for each in type(self).__mro__ if each.__dict__.get(method) is shared]:
        if type(self) is cls or attribute in _fields_of(cls):
            raise FrozenInstanceError(f"cannot {what} field {attribute!r}")
    getattr(super(cls, self), method)(attribute, *value)


def _setattr(self: Any, attribute: str, value: Any) -> None:
    _change(self, "__setattr__", _setattr, "assign to", attribute, value)


def _delattr(self: Any, attribute: str) -> None:
    _change(self, "__delattr__", _delattr, "delete", attribute)


def _state(self: Any) -> list[Any]:
    return [getattr(self, name) for name in self.__dataclass_fields__]


def _restore(self: Any, state: list[Any]) -> None:
    for name, value in zip(self.__dataclass_fields__, state, strict=True):
        object.__setattr__(self, name, value)


class _Constructor:
    """The shared constructor's steps for a class, as a table instead of generated and compiled code.

    Attributes:
        calls: how often it has been called.
        plain: fields that are given by position; ordinary: whether all fields can be given.
        optional: of each field, in order, its default and what makes it.
        put: sets an attribute.
    """

    def __init__(self, cls: type) -> None:
        fields = _fields_of(cls)
        self.cls = cls
        self.calls = 0
        self.plain = [name for name, each in fields.items() if not each.kw_only]
        self.ordinary = all(each.init for each in fields.values())
        self.optional = {name: (each.default, each.default_factory) for name, each in fields.items()}
        self.frozen = cls.__dict__.get("__setattr__") is _setattr
        self.put = object.__setattr__ if self.frozen else setattr
        self.has_more = hasattr(cls, "__post_init__")

    def construct(self, instance: Any, args: tuple[Any, ...], kwargs: dict[str, Any]) -> None:
        """``__init__``; it is replaced if it is called often, or with wrong arguments."""
        self.calls += 1
        if self.calls > _OFTEN or not self.ordinary or len(args) > len(self.plain):
            return self._generate(instance, args, kwargs)
        put = self.put
        given = dict(zip(self.plain, args))
        if kwargs:
            given.update(kwargs)
            if len(given) < len(args) + len(kwargs) or not self.optional.keys() >= kwargs.keys():
                return self._generate(instance, args, kwargs)
        for name, value in given.items():
            put(instance, name, value)
        if len(given) < len(self.optional):
            for name, (default, make) in self.optional.items():
                if name in given:
                    continue
                if default is not MISSING:
                    put(instance, name, default)
                elif make is not MISSING:
                    put(instance, name, make())
                else:
                    return self._generate(instance, args, kwargs)
        if self.has_more:
            instance.__post_init__()
        return None

    def _generate(self, instance: Any, args: tuple[Any, ...], kwargs: dict[str, Any]) -> None:
        source, names = _init_text(self.cls, _fields_of(self.cls), self.frozen)
        exec(source, names)
        _put(self.cls, "__init__", names["__init__"])(instance, *args, **kwargs)


_constructors: dict[type, _Constructor] = {}


def _init(self: Any, *args: Any, **kwargs: Any) -> None:
    found = _constructors.get(type(self))
    if found is None:
        cls = _owner(self, "__init__", _init)
        found = _constructors.get(cls) or _Constructor(cls)
        _constructors[cls] = _constructors[type(self)] = found
    found.construct(self, args, kwargs)


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
