"""Calls of the vector functions (:mod:`stc.codegen.native_vector`) in compiled Python, as LLVM instructions."""

from __future__ import annotations

import ast
from typing import TYPE_CHECKING, Any

from stc.codegen import native_vector
from stc.codegen.native_blocks import Value
from stc.codegen.native_types import Type
from stc.codegen.vector import PAST_CACHES, WIDTH, prefetch

if TYPE_CHECKING:
    from stc.codegen.native_calls import CallEmitter

__all__ = ["vector_call"]


def vector_call(emitter: CallEmitter, node: ast.Call, target: Any, name: str) -> Value:
    """A call of one of the functions of stc.codegen.native_vector."""
    if target is native_vector.wide:
        return Value(Type.I64, WIDTH)
    # Names end in 8 or w, and what is before that means the same.
    what = target.__name__[:-1]
    type_ = Type.F64W if target.__name__.endswith("w") else Type.F64V
    vector, lanes = type_.ir, type_.lanes
    if what in ("load", "store", "stream"):
        address = _address(emitter, node, name, 2 if what == "load" else 3)
        if what == "load":
            return emitter.compute(type_, f"load {vector}, ptr {address}, align 8")
        value = emitter.convert(emitter.number(node.args[2]), type_, node)
        how = f"align 64{PAST_CACHES}" if what == "stream" else "align 8"
        emitter.emit(f"store {vector} {value.text}, ptr {address}, {how}")
        return Value(Type.NONE, "")
    if what == "prefetch":
        return _prefetched(emitter, node, name)
    if what == "masked":
        return _masked(emitter, node, name)
    if what == "sums":
        return _sums(emitter, node, name)
    if what == "spread":
        return _spread(emitter, node, name)
    if what in ("gather", "scatter"):
        return _by_places(emitter, node, name, stores=what == "scatter")
    arguments = emitter.arguments(node, 2 if what == "max" else 1, name, type_)
    texts = [f"{vector} {argument.text}" for argument in arguments]
    if what == "splat":
        return arguments[0]
    if what == "abs":
        return emitter.compute(type_, f"call {vector} @llvm.fabs.v{lanes}f64({texts[0]})")
    if what == "negative":
        below = emitter.compute(Type.BOOL, f"fcmp olt {texts[0]}, zeroinitializer")
        return emitter.compute(type_, f"uitofp <{lanes} x i1> {below.text} to {vector}")
    if what == "largest":
        return emitter.compute(Type.F64, f"call nnan double @llvm.vector.reduce.fmax.v8f64({texts[0]})")
    if what == "sum":
        call = f"call reassoc double @llvm.vector.reduce.fadd.v8f64(double -0.0, {texts[0]})"
        return emitter.compute(Type.F64, call)
    larger = emitter.compute(Type.BOOL, f"fcmp ogt {texts[0]}, {arguments[1].text}")
    choice = emitter.compute(type_, f"select <{lanes} x i1> {larger.text}, {', '.join(texts)}")
    # Without the fence, where one of the two was just loaded from where the larger one goes, LLVM stores only what has
    # changed, by a mask: processors without AVX-512 take ten times longer for that.
    return emitter.compute(type_, f"call {vector} @llvm.arithmetic.fence.v{lanes}f64({vector} {choice.text})")


def _address(emitter: CallEmitter, node: ast.Call, name: str, count: int) -> str:
    """The address that the first two of ``count`` arguments mean: an array of floats, and a place in it."""
    if len(node.args) != count:
        raise emitter.error(node, f"{name}() takes {count} arguments, not {len(node.args)}")
    return _place_in(emitter, node, name, node.args[0], node.args[1])


def _place_in(emitter: CallEmitter, node: ast.Call, name: str, array: ast.expr, place: ast.expr) -> str:
    """The address of a place in an array of floats, both of them arguments."""
    type_, address = emitter.element_address(ast.copy_location(ast.Subscript(array, place, ast.Load()), node))
    if type_ is not Type.F64S:
        raise emitter.error(node, f"{name}() needs an array of floats")
    return address


def _prefetched(emitter: CallEmitter, node: ast.Call, name: str) -> Value:
    """prefetch8: no address is outside here, since nothing is read."""
    if len(node.args) != 2:
        raise emitter.error(node, f"{name}() takes 2 arguments, not {len(node.args)}")
    array = emitter.expression(node.args[0])
    if array.type is not Type.F64S:
        raise emitter.error(node, f"{name}() needs an array of floats")
    index = emitter.integer(node.args[1], "index")
    address = emitter.compute(Type.F64S, f"getelementptr double, ptr {array.text}, i64 {index.text}")
    emitter.emit(prefetch(address.text))
    return Value(Type.NONE, "")


def _masked(emitter: CallEmitter, node: ast.Call, name: str) -> Value:
    """masked8: nothing is read where the mask is 0, so that only the others need to exist."""
    address = _address(emitter, node, name, 3)
    # Without AVX-512, bits in a register would become a vector one by one.
    integers = "<8 x i64>"
    bits = emitter.integer(node.args[2], "mask").text
    first = emitter.compute(Type.I64, f"insertelement {integers} poison, i64 {bits}, i64 0").text
    same = f"shufflevector {integers} {first}, {integers} poison, <8 x i32> zeroinitializer"
    spread = emitter.compute(Type.I64, same).text
    each = f"<{', '.join(f'i64 {1 << lane}' for lane in range(8))}>"
    found = emitter.compute(Type.I64, f"and {integers} {spread}, {each}").text
    mask = emitter.compute(Type.BOOL, f"icmp eq {integers} {found}, {each}").text
    vector = Type.F64V.ir
    arguments = f"ptr {address}, i32 8, <8 x i1> {mask}, {vector} zeroinitializer"
    return emitter.compute(Type.F64V, f"call {vector} @llvm.masked.load.v8f64.p0({arguments})")


#: What to add of two vectors each: neighbours, then pairs of these, then halves.
_FOLDS = (
    ((0, 8, 2, 10, 4, 12, 6, 14), (1, 9, 3, 11, 5, 13, 7, 15)),
    ((0, 1, 8, 9, 4, 5, 12, 13), (2, 3, 10, 11, 6, 7, 14, 15)),
    ((0, 1, 2, 3, 8, 9, 10, 11), (4, 5, 6, 7, 12, 13, 14, 15)),
)


def _sums(emitter: CallEmitter, node: ast.Call, name: str) -> Value:
    """sums8: a transposition that adds as it goes."""
    address = _address(emitter, node, name, 2)
    vector = Type.F64V.ir
    rows = []
    for k in range(8):
        at = emitter.compute(Type.F64S, f"getelementptr inbounds double, ptr {address}, i64 {8 * k}").text
        rows.append(emitter.compute(Type.F64V, f"load {vector}, ptr {at}, align 8").text)
    for fold in _FOLDS:
        pairs = list(zip(rows[::2], rows[1::2], strict=True))
        rows = []
        for one, other in pairs:
            halves = [_shuffled(emitter, vector, one, other, lanes) for lanes in fold]
            rows.append(emitter.compute(Type.F64V, f"fadd {vector} {halves[0]}, {halves[1]}").text)
    return Value(Type.F64V, rows[0])


#: How four vectors of four become the four of their first, second, ... elements: pairs of them, then pairs of these.
_TURNS = ((0, 4, 2, 6), (1, 5, 3, 7)), ((0, 1, 4, 5), (2, 3, 6, 7))


def _spread(emitter: CallEmitter, node: ast.Call, name: str) -> Value:
    """spread8: the four numbers at each place are loaded at once, and transposed."""
    array, first = _places(emitter, node, name, 8)
    vector = "<4 x double>"
    halves = []
    for half in range(2):
        rows = []
        for lane in range(4 * half, 4 * half + 4):
            element = _element(emitter, array, first, lane)
            rows.append(emitter.compute(Type.F64V, f"load {vector}, ptr {element}, align 8").text)
        evens, odds = _TURNS[0]
        low, high = _TURNS[1]
        pairs = [
            _shuffled(emitter, vector, rows[k], rows[k + 1], lanes) for lanes in (evens, odds) for k in (0, 2)
        ]
        halves.append(
            [
                _shuffled(emitter, vector, pairs[k], pairs[k + 1], lanes)
                for lanes in (low, high)
                for k in (0, 2)
            ]
        )
    for k in range(4):
        whole = _shuffled(emitter, vector, halves[0][k], halves[1][k], tuple(range(8)))
        address = _place_in(emitter, node, name, node.args[3], node.args[4 + k])
        emitter.emit(f"store {Type.F64V.ir} {whole}, ptr {address}, align 8")
    return Value(Type.NONE, "")


def _shuffled(emitter: CallEmitter, vector: str, one: str, other: str, lanes: tuple[int, ...]) -> str:
    """Lanes of two vectors, those of the second counted on from those of the first."""
    order = ", ".join(f"i32 {lane}" for lane in lanes)
    shuffle = f"shufflevector {vector} {one}, {vector} {other}, <{len(lanes)} x i32> <{order}>"
    return emitter.compute(Type.F64V, shuffle).text


def _places(emitter: CallEmitter, node: ast.Call, name: str, count: int) -> tuple[str, str]:
    """The array of floats and the address of the first place that the first three of ``count`` arguments mean."""
    if len(node.args) != count:
        raise emitter.error(node, f"{name}() takes {count} arguments, not {len(node.args)}")
    array = emitter.expression(node.args[0])
    places, first = emitter.element_address(
        ast.copy_location(ast.Subscript(node.args[1], node.args[2], ast.Load()), node)
    )
    if array.type is not Type.F64S or places is not Type.I32S:
        raise emitter.error(node, f"{name}() needs an array of floats and one of 32-bit integers")
    return array.text, first


def _element(emitter: CallEmitter, array: str, first: str, lane: int) -> str:
    """The address of the element of an array at a place, of those from ``first`` on."""
    at = emitter.compute(Type.I64, f"getelementptr inbounds i32, ptr {first}, i64 {lane}").text
    narrow = emitter.compute(Type.I64, f"load i32, ptr {at}, align 4").text
    place = emitter.compute(Type.I64, f"sext i32 {narrow} to i64").text
    return emitter.compute(Type.F64S, f"getelementptr inbounds double, ptr {array}, i64 {place}").text


def _by_places(emitter: CallEmitter, node: ast.Call, name: str, stores: bool) -> Value:
    """gather8 and scatter8: element by element, which is as fast as the instructions for it."""
    vector = Type.F64V.ir
    array, first = _places(emitter, node, name, 3 + stores)
    value = emitter.convert(emitter.number(node.args[3]), Type.F64V, node) if stores else None
    text = "poison"
    for lane in range(8):
        element = _element(emitter, array, first, lane)
        if value is None:
            number = emitter.compute(Type.F64, f"load double, ptr {element}, align 8").text
            text = emitter.compute(
                Type.F64V, f"insertelement {vector} {text}, double {number}, i64 {lane}"
            ).text
        else:
            number = emitter.compute(Type.F64, f"extractelement {vector} {value.text}, i64 {lane}").text
            emitter.emit(f"store double {number}, ptr {element}, align 8")
    return Value(Type.NONE, "") if stores else Value(Type.F64V, text)
