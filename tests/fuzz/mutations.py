"""Ways to spoil a text, a solution file, a model or a table; all of them draw from one random generator."""

from __future__ import annotations

import io
import random
import re
import struct
import zipfile

#: Numbers where mistakes hide.
NUMBERS = [
    *("0", "-1", "1", "2", "0.5", "1e-300", "1e300", "-1e300", "1e308", "1e999", "nan", "inf", "-inf", "1/0"),
    *("999999999", "4294967296", "-2147483649", "9223372036854775808", "1_000", "0x10", "١", "", "1e", "--1"),
]
#: Words and signs of the language, and some that are not of it.
_PLAIN = """
constants: variables: parameters: definitions: guess: constraints: objective: jumps: method: replay:
lagrangian: forces: contact: n h t i x x' T [0]: [n]: [last]: [n/2]: [n+1]: [-1]: [i] [i-1] [ ] ( ) + - *
/ ^ ' '' , ; : = <= >= < == complements integral( before( after( sin( sqrt( log( atan2( tanh( exp( inf pi
# central; hermite-simpson; trapezoidal;
"""
WORDS = [
    *_PLAIN.split(),
    *("[0, n]:", '"', '"q.xml"', "\n", "set option.gravity.z = 1;", "joint x = x;"),
]
#: Characters that are no part of any of them.
CHARACTERS = ["\x00", "\x1b", "\x1b]0;title\x07", "\r", "\x9b31m", *"\u202e\ufeffé∂𝕏\t\x7f"]

_TOKEN = re.compile(r"\s+|\w+|\d+\.?\d*|.", re.DOTALL)
_NUMBER = re.compile(rb"-?\d+\.?\d*(?:e-?\d+)?")


def text(random_: random.Random, given: str) -> bytes:
    """A spec with tokens lost, doubled, exchanged or replaced, or with spoilt bytes."""
    tokens = _TOKEN.findall(given)
    for _ in range(random_.choice([1, 1, 1, 2, 3, 8])):
        if not tokens:
            break
        at, other = random_.randrange(len(tokens)), random_.randrange(len(tokens))
        way = random_.randrange(9)
        if way == 0:
            del tokens[at]
        elif way == 1:
            tokens.insert(at, tokens[other])
        elif way == 2:
            tokens[at], tokens[other] = tokens[other], tokens[at]
        elif way == 3:
            tokens[at] = random_.choice(WORDS)
        elif way == 4:
            tokens.insert(at, random_.choice(WORDS))
        elif way == 5:
            numbers = [k for k, token in enumerate(tokens) if token[:1].isdigit()]
            if numbers:
                tokens[random_.choice(numbers)] = random_.choice(NUMBERS)
        elif way == 6:
            tokens.insert(at, random_.choice(CHARACTERS))
        elif way == 7:
            tokens = (
                tokens[:at] if random_.random() < 0.3 else tokens[: min(at, other)] + tokens[max(at, other) :]
            )
        else:
            repeated = random_.choice(["(", "[", "-", "'", "x^", "sin(", "+x", "*x", ";", ",", "x;", "a:"])
            tokens.insert(at, repeated * random_.choice([5, 200, 5000]))
    spoilt = "".join(tokens).encode("utf-8", "surrogatepass")
    return data(random_, spoilt) if random_.random() < 0.1 else spoilt


def data(random_: random.Random, given: bytes) -> bytes:
    """Bytes of which some are lost, doubled, turned or replaced."""
    spoilt = bytearray(given)
    for _ in range(random_.choice([1, 1, 3, 20])):
        if not spoilt:
            break
        at, size = random_.randrange(len(spoilt)), random_.choice([1, 1, 4, 100, len(spoilt)])
        way = random_.randrange(5)
        if way == 0:
            spoilt[at] ^= 1 << random_.randrange(8)
        elif way == 1:
            del spoilt[at : at + size]
        elif way == 2:
            spoilt[at:at] = spoilt[at : at + size]
        elif way == 3:
            spoilt[at : at + size] = random_.randbytes(min(size, 100))
        else:
            del spoilt[at:]
    return bytes(spoilt)


def solution(random_: random.Random, given: bytes) -> bytes:
    """A solution file with spoilt bytes, or a whole archive with spoilt, lost, exchanged or forged members."""
    if random_.random() < 0.3 or not given.startswith(b"PK"):
        return data(random_, given)
    with zipfile.ZipFile(io.BytesIO(given)) as archive:
        members = {name: archive.read(name) for name in archive.namelist()}
    for _ in range(random_.choice([1, 1, 2, 5])):
        names = list(members)
        if not names:
            break
        name, other = random_.choice(names), random_.choice(names)
        way = random_.randrange(7)
        if way == 0:
            del members[name]
        elif way == 1:
            members[name], members[other] = members[other], members[name]
        elif way == 2:
            members[name] = data(random_, members[name])
        elif way == 3:
            members[name] = _forged_header(random_, members[name])
        elif way == 4:  # numbers within text, as in the facts
            members[name] = _other_number(random_, members[name])
        elif way == 5:
            members[name] = _other_values(random_, members[name])
        else:
            members[random_.choice(["../escape.npy", "extra.npy", "facts.npy", "x" * 300])] = members[name]
    written = io.BytesIO()
    packing = random_.choice([zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED])
    with zipfile.ZipFile(written, "w") as archive:
        for name, held in members.items():
            # With the date that all such entries have, where a bare name would bring the time of the day.
            archive.writestr(zipfile.ZipInfo(name), held, packing)
    return written.getvalue()


def _forged_header(random_: random.Random, member: bytes) -> bytes:
    """An array that says another type or shape of itself, up to more than there is memory for."""
    if not member.startswith(b"\x93NUMPY"):
        return member
    size = struct.unpack("<H", member[8:10])[0]
    kind = random_.choice(
        ["<f8", ">f8", "<f4", "|O", "<U5", "<i8", "|b1", "<c16", "|V9", "<f8, <f8", "<M8[s]"]
    )
    shape = random_.choice(
        [
            "()",
            "(0,)",
            "(1,)",
            "(7, 3)",
            "(1000000000000,)",
            "(-1,)",
            "(3, -4)",
            "(99999999999999999999,)",
            "1",
        ]
    )
    order = random_.choice(["True", "False"])
    text_ = f"{{'descr': '{kind}', 'fortran_order': {order}, 'shape': {shape}, }}"
    header = text_.encode().ljust(size - 1)[: max(size - 1, len(text_))] + b"\n"
    return member[:8] + struct.pack("<H", len(header)) + header + member[10 + size :]


def _other_number(random_: random.Random, member: bytes) -> bytes:
    found = list(_NUMBER.finditer(member))
    if not found:
        return member
    at = random_.choice(found)
    value = random_.choice(NUMBERS).encode().ljust(at.end() - at.start())[: at.end() - at.start()]
    return member[: at.start()] + value + member[at.end() :]


def _other_values(random_: random.Random, member: bytes) -> bytes:
    """Some of the numbers of an array of doubles replaced."""
    spoilt = bytearray(member)
    for _ in range(random_.choice([1, 1, 10])):
        if len(spoilt) >= 136:
            at = 128 + 8 * random_.randrange((len(spoilt) - 128) // 8)
            value = random_.choice([0.0, 1.0, -1e300, 1e300, float("nan"), float("inf"), 1e-320, 5.0])
            spoilt[at : at + 8] = struct.pack("<d", value)
    return bytes(spoilt)


#: What is put into a model.
ELEMENTS = [
    '<replicate count="{n}" offset="1 0 0"><geom size=".1"/></replicate>',
    '<body><replicate count="{n}"><body pos="0 0 1"><joint/><geom size=".1"/></body></replicate></body>',
    '<body><freejoint/><geom size=".1"/></body>',
    '<flexcomp name="f" type="grid" count="{n} {n} 1" spacing=".1 .1 .1" dim="2"/>',
    "<body/>",
    '<geom type="mesh" mesh="none"/>',
    '<geom size="nan nan nan"/>',
    '<body mocap="true"/>',
    "<frame>" * 600 + "</frame>" * 600,
]
TOPS = [
    '<asset><hfield name="q" nrow="{n}" ncol="{n}" size="1 1 1 1"/></asset>',
    '<asset><texture name="q" type="2d" builtin="flat" width="{n}" height="{n}"/></asset>',
    '<size nkey="{n}"/>',
    '<size memory="{n}"/>',
    '<size nuser_body="{n}"/>',
    '<include file="spec.xml"/>',
    '<include file="../none.xml"/>',
    '<asset><mesh name="m" file="spec.stc"/></asset>',
    '<option timestep="0"/>',
    '<option timestep="nan"/>',
    '<option integrator="implicit" timestep="10"/>',
    '<compiler meshdir="/" autolimits="false"/>',
    "<keyframe><key qpos='1 2 3'/></keyframe>",
    '<extension><plugin plugin="none"/></extension>',
]


def model(random_: random.Random, given: str) -> bytes:
    """A model with other numbers, more or fewer elements, or spoilt bytes."""
    spoilt = given
    for _ in range(random_.choice([1, 1, 2, 4])):
        way = random_.randrange(6)
        size = random_.choice(["0", "-1", "3", "100", "3000", "100000", "10000000", "99999999999", "1e7"])
        if way == 0:
            spoilt = _other_number(random_, spoilt.encode()).decode("utf-8", "replace")
        elif way == 1:
            made = random_.choice(ELEMENTS).format(n=size)
            spoilt = spoilt.replace("</worldbody>", made + "</worldbody>", 1)
        elif way == 2:
            spoilt = spoilt.replace("</mujoco>", random_.choice(TOPS).format(n=size) + "</mujoco>", 1)
        elif way == 3:
            lines = spoilt.splitlines(keepends=True)
            if lines:
                at = random_.randrange(len(lines))
                lines[at : at + 1] = random_.choice([[], [lines[at]] * 2])
            spoilt = "".join(lines)
        elif way == 4:
            found = list(re.finditer(r'"[^"]*"', spoilt))
            if found:
                at_ = random_.choice(found)
                value = random_.choice(
                    [*NUMBERS, "\x1b[31mX", "&#27;[31mX", "x" * 5000, "é", "1 2 3 4 5 6 7 8"]
                )
                spoilt = f'{spoilt[: at_.start()]}"{value}"{spoilt[at_.end() :]}'
        else:
            return data(random_, spoilt.encode("utf-8", "replace"))
    return spoilt.encode("utf-8", "replace")


def table(random_: random.Random, names: list[str]) -> bytes:
    """A table of guesses, most of them with something wrong."""
    columns = random_.sample(names, random_.randint(0, len(names)))
    columns += random_.sample(
        ["t", "time", "frame", "x'", "zz", "", "\x1b[31m", "x", "n"], random_.randint(0, 3)
    )
    mark = random_.choice([",", ",", ";", "\t", "|"])
    rows = random_.choice([0, 1, 2, 5, 30])
    lines = [mark.join(columns)]
    for row in range(rows):
        cells = [
            random_.choice(NUMBERS) if random_.random() < 0.1 else f"{row * random_.choice([1, 0.5, -1]):g}"
            for _ in columns
        ]
        if random_.random() < 0.05:
            cells = cells[:-1] or ["1", "2"]
        lines.append(mark.join(cells))
    if random_.random() < 0.1:
        lines.insert(0, "# a comment")
    made = random_.choice(["\n", "\n", "\r\n", "\r"]).join(lines)
    encoded = made.encode(random_.choice(["utf-8", "utf-8", "utf-8-sig", "utf-16", "latin-1"]), "replace")
    return data(random_, encoded) if random_.random() < 0.2 else encoded
