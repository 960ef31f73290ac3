"""Data classes made late mean what those of the standard library mean."""

from __future__ import annotations

import copy
import dataclasses
import pickle
from collections.abc import Callable
from functools import cached_property
from typing import Any, ClassVar

import pytest

from stc import records

OPTIONS = [
    {},
    {"frozen": True},
    {"slots": True},
    {"eq": False},
    {"repr": False},
    {"frozen": True, "slots": True},
    {"frozen": True, "eq": False},
    {"slots": True, "eq": False, "kw_only": True, "repr": False},
    {"slots": True, "kw_only": True},
]


def family(decorate: Callable[..., Any], **options: Any) -> dict[str, Any]:
    """Classes of all kinds that the package has, made by one of the two decorators."""

    @decorate(**options)
    class Empty:
        pass

    @decorate(**options)
    class One:
        value: Any

    @decorate(**options)
    class Base:
        start: int = dataclasses.field(compare=False, repr=False)
        end: int = dataclasses.field(compare=False, repr=False)
        shared: ClassVar[int] = 3

    @decorate(**options)
    class Derived(Base):
        name: str
        items: list[int] = dataclasses.field(default_factory=list)
        rest: tuple[int, ...] = ()
        made: int = dataclasses.field(default=5, init=False)

        @property
        def double(self) -> str:
            return self.name * 2

    @decorate(**options)
    class Own:
        value: int = 1

        def __repr__(self) -> str:
            return "own"

        def __eq__(self, other: object) -> bool:
            return True

        def __hash__(self) -> int:
            return 7

    @decorate(**{**options, "slots": False})
    class Later:
        value: int

        def __post_init__(self) -> None:
            object.__setattr__(self, "more", self.value + 1)

        @cached_property
        def square(self) -> int:
            return self.value**2

    return {each.__name__: each for each in (Empty, One, Base, Derived, Own, Later)}


def outcome(action: Callable[[], Any]) -> Any:
    """What an action gives, as text where it is a class's own, or the kind of error it ends in."""
    try:
        return action()
    except Exception as error:
        return type(error).__name__


def behaviour(classes: dict[str, Any]) -> list[Any]:
    """Everything that can be observed of a family."""
    empty, one, base, derived, own, later = classes.values()
    pairs = [
        (lambda: empty(), lambda: empty()),
        (lambda: one(value=3), lambda: one(value=3.0)),
        (lambda: one(value=3), lambda: own(value=3)),
        (lambda: base(start=1, end=2), lambda: base(start=3, end=4)),
        (lambda: base(start=1, end=2), lambda: derived(start=1, end=2, name="a")),
        (lambda: derived(start=1, end=2, name="a"), lambda: derived(start=0, end=0, name="a", items=[])),
        (lambda: derived(start=1, end=2, name="a"), lambda: derived(start=0, end=0, name="b", rest=(1,))),
        (lambda: derived(1, 2, "a", [1], (2,)), lambda: derived(0, 0, "a", [1], (2,))),
        (lambda: own(), lambda: own(2)),
        (lambda: later(3), lambda: later(3)),
        (lambda: later(), lambda: derived(1, 2, "a", unknown=1)),
    ]
    seen: list[Any] = []
    for left, right in pairs:
        seen += [outcome(lambda l=left, r=right: l() == r()), outcome(lambda l=left, r=right: l() != r())]
        for make in (left, right):
            seen.append(outcome(lambda m=make: len({hash(one) for one in (m(), m())})))
            seen.append(outcome(lambda m=make: "object at" if " at 0x" in repr(m()) else repr(m())))
    for name, made in classes.items():
        seen.append((name, made.__qualname__, made.__module__, getattr(made, "__match_args__", None)))
        seen.append([(f.name, f.type, f.init, f.kw_only, f.default) for f in dataclasses.fields(made)])
        seen.append(
            (
                made.__dict__.get("__slots__"),
                made.__hash__ is None,
                sorted(set(vars(made)) & {"value", "made", "rest"}),
            )
        )
    seen += [
        outcome(lambda: setattr(one(value=1), "value", 2)),
        outcome(lambda: delattr(one(value=1), "value")),
        outcome(lambda: dataclasses.asdict(derived(start=1, end=2, name="a", items=[3]))),
        outcome(lambda: dataclasses.replace(derived(start=1, end=2, name="a"), name="b").double),
        outcome(lambda: dataclasses.replace(derived(start=1, end=2, name="a"), made=1)),
        outcome(lambda: copy.copy(derived(start=1, end=2, name="a")).double),
        outcome(lambda: copy.deepcopy(derived(start=1, end=2, name="a", items=[3])).items),
        outcome(lambda: derived(start=1, end=2, name="a").made),
        outcome(
            lambda: derived(start=1, end=2, name="a").items is not derived(start=1, end=2, name="a").items
        ),
        outcome(lambda: (later(value=3).square, later(value=3).more)),
        outcome(lambda: (base.shared, derived(start=1, end=2, name="a").shared)),
        dataclasses.is_dataclass(one),
    ]
    return seen


@pytest.mark.parametrize("options", OPTIONS, ids=lambda one: " ".join(one) or "none")
@pytest.mark.parametrize("often", [0, 3, 1000])
def test_behaviour_is_that_of_the_standard_library(
    options: dict[str, Any], often: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    theirs = behaviour(family(dataclasses.dataclass, **options))
    monkeypatch.setattr(records, "_OFTEN", often)
    assert behaviour(family(records.dataclass, **options)) == theirs


def mixed(decorate: Callable[..., Any], base: dict[str, Any], derived: dict[str, Any]) -> list[Any]:
    """What can be observed of a class whose base has other methods than it has itself."""

    @decorate(**base)
    class Base:
        name: str
        size: float = 1.0

    @decorate(**derived)
    class Derived(Base):
        more: int = 2

    class Plain(Derived):
        pass

    seen: list[Any] = []
    for cls in Base, Derived, Plain:
        one, same, other = cls("a"), cls("a"), cls("a", float("nan"))
        seen += [
            one == same,
            one == other,
            other == other,
            one != same,
            cls("b").size,
            outcome(lambda a=one, b=same: hash(a) == hash(b)),
        ]
        seen.append("object at" if " at 0x" in repr(one) else repr(one))
        seen += [outcome(lambda o=one: setattr(o, "name", "c")), outcome(lambda o=one: setattr(o, "free", 1))]
        seen.append(vars(cls("a", 3.0)))
    seen += [
        Base("a") == Derived("a"),
        Derived("a") == Plain("a"),
        [f.name for f in dataclasses.fields(Plain)],
    ]
    return seen


@pytest.mark.parametrize("frozen", [False, True])
@pytest.mark.parametrize("less", ["eq", "repr"])
@pytest.mark.parametrize("of_base", [False, True])
def test_classes_and_their_bases_keep_their_own_methods(frozen: bool, less: str, of_base: bool) -> None:
    whole, partly = {"frozen": frozen}, {"frozen": frozen, less: False}
    base, derived = (partly, whole) if of_base else (whole, partly)
    assert mixed(records.dataclass, base, derived) == mixed(dataclasses.dataclass, base, derived)


@records.dataclass(frozen=True, slots=True)
class Frozen:
    name: str
    values: tuple[int, ...] = ()


class Heir(Frozen):
    """A plain subclass, which has room for more."""


def test_frozen_slots_survive_pickling_and_their_heirs_have_room() -> None:
    one = Frozen("a", (1, 2))
    assert pickle.loads(pickle.dumps(one)) == one
    heir = Heir("a")
    heir.more = 3  # type: ignore[attr-defined]
    assert heir.more == 3  # type: ignore[attr-defined]
    del heir.more  # type: ignore[attr-defined]
    with pytest.raises(dataclasses.FrozenInstanceError, match="cannot assign to field 'name'"):
        heir.name = "b"  # type: ignore[misc]
    assert heir != one


def test_patterns_match_fields_in_order() -> None:
    match Frozen("a", (1,)):
        case Frozen(name, values):
            assert (name, values) == ("a", (1,))


def test_messages_name_the_class() -> None:
    with pytest.raises(
        TypeError, match=r"Frozen\.__init__\(\) missing 1 required positional argument: 'name'"
    ):
        Frozen()  # type: ignore[call-arg]


def test_defaults_that_can_change_are_refused() -> None:
    with pytest.raises(ValueError, match="default_factory"):

        @records.dataclass
        class Wrong:
            items: list[int] = []
