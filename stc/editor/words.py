"""The meaning of each word of the language, in one line."""

from __future__ import annotations

from stc.language.contact_statements import KINDS
from stc.language.words import OPERATORS, POSE_WORDS, REPLAY_KINDS, RESERVED, SECTIONS
from stc.symbolic.expr import FUNCTIONS
from stc.trajectory import METHODS

__all__ = ["WORDS", "words_in"]

_METHODS = {
    "central": "finite differences of the values at frames; second order",
    "trapezoidal": "derivatives are unknowns of their own, tied by the trapezoid rule; second order",
    "hermite-simpson": "as trapezoidal, with a midpoint in every step; fourth order",
    "stepping": "implicit Euler steps, for contact that is left to the solver; first order",
}
_CONTACT = {
    "foot": "a flat sole, which stands level: `foot(x, z, angle)` or `foot(geom.NAME)`",
    "point": "a point that stands without slipping: `point(x, z)`, `point(site.NAME)` or `point(body.NAME, x, y, z)`",
    "pin": "a point that is held in all directions: `pin(x, z)` or `pin(site.NAME)`",
    "half": "m, from the middle of a foot to heel and toe",
    "reach": "how far from the middle of a foot the centre of pressure may go",
    "friction": "sideways force is at most this share of the pressure",
    "clearance": "m, how high it has to rise in the middle of a flight",
    "landing": "cost of the speed at touchdown, times its square",
    "speed": "limit of the speed at touchdown",
    "spin": "limit of a foot's turning at touchdown",
    "soft": "touches down with no speed at all",
    "sudden": "its force may end at once where it lifts off",
    "slides": "a contact under `free:` may slide; `NAME slides forward;` says that it does",
    "radius": "m, of a ball about a point of a body",
    "at": "where it stands: `NAME at x, z;`, of a model `NAME at x, y;`",
    "on": "which surface of the model it stands on: `NAME on geom.box;`",
    "free": "under `free:` the frames of contact are left to the solver",
}
_POSES = {
    "rest": "every velocity is zero",
    "periodic": "the last frame is like the first",
    "mirrored": "with left and right swapped",
    "grounded": "moved until the lowest place of contact touches the floor",
    "turned": "turned by an angle: `keyframe.stand turned pi about z`",
    "about": "the axis of a turn: `turned pi about z`",
}
_REPLAY = {
    "joint": "where a joint of the model starts; its path is then compared",
    "actuator": "what drives an actuator of the model",
    "apply": "a force that acts on a body: `apply body.NAME.fx = e;`",
    "contact": "what MuJoCo's contacts should supply: `contact body.NAME.fz = e;`",
    "compare": "what is compared with the replay: `compare body.NAME.x = e;`",
    "set": "a number of the model that the spec gives: `set body.NAME.mass = m;`",
    "model": "the MuJoCo model that the motion is replayed in",
}
_DATA = {
    "table": "a function through the numbers of columns: `f = table(data.x, data.y);`",
    "keyframes": "the keyframes of the model, at their times",
    "unwrap": "adds the whole turns that an angle in a file lacks",
    "monotone": "the table rises and falls where its numbers do",
    "linear": "straight lines between the places of the table",
    "outside": "what the table is outside of its numbers: `hold`, `extend` or `error`",
    "extend": "it goes straight on",
    "hold": "it keeps its last value",
    "error": "it has no value",
}
_ANYWHERE = {
    "n": "the last frame; frames are 0, 1, ..., n",
    "h": "s, the time from one frame to the next",
    **RESERVED,
    "integral": "`integral(e)`: the integral of e over the time of the range, in the objective",
    "before": "`before(e)`: the value before a jump",
    "after": "`after(e)`: the value after a jump",
    "momentum": "`momentum(q)`: the generalised momentum dL/dq'; `momentum.x`: of all bodies of the model",
    "abs": "`abs(e)`: of what is known, or in products that are smooth all the same",
    "min": "`min(a, b)`: of what is known",
    "max": "`max(a, b)`: of what is known",
    "sign": "`sign(e)`: of what is known",
    "floor": "`floor(e)`: of what is known",
    "sum": "`sum(k in 1..3: q{k}^2)`: the sum of like terms",
    "for": "`for k in 1..3: q{k} >= 0;`: repeats a statement, or a block in braces",
    "in": "what a repetition runs over: `for k in 1..3:`",
    "complements": "`0 <= a complements b >= 0`: one of the two is an equality at every frame",
    "distance": "`distance(geom.A, geom.B)`: how far apart two surfaces of the model are",
    "effort": "sum of the squared forces and torques of the actuators on the joints",
    "joint.*": "each hinge and slide of the model in turn; the whole statement is repeated",
    "actuator.*": "each actuator of the model in turn; the whole statement is repeated",
    "power": "forces and torques of the actuators times velocity, summed",
    "without": "leaves something of a model out knowingly: `without fluid`",
    **{
        name: f"`{name}({', '.join('xy'[:count])})`, a function of {count} number{'s' * (count > 1)}"
        for name, count in FUNCTIONS.items()
    },
}
_SECTIONS = {name: f"section: {kind.holds}" for name, kind in SECTIONS.items()}

#: The words that have a meaning of their own in some sections.
_OF_SECTION = {
    "method": _METHODS,
    "contact": _CONTACT,
    "constraints": _POSES,
    "poses": _POSES,
    "guess": _POSES,
    "replay": _REPLAY,
    "data": _DATA,
}

#: Every word, with its meaning.
WORDS: dict[str, str] = {**_REPLAY, **_DATA, **_POSES, **_CONTACT, **_METHODS, **_ANYWHERE, **_SECTIONS}

#: What the language's own tables have: a test holds that each of these words has a meaning here.
KNOWN_ELSEWHERE = {
    *SECTIONS, *METHODS, *RESERVED, *FUNCTIONS, *OPERATORS, *POSE_WORDS, *REPLAY_KINDS, *KINDS,
    *(option for _, _, options in KINDS.values() for option in options),
}  # fmt: skip


def words_in(section: str) -> dict[str, str]:
    """The words that can be written in a section, with what they mean there: its own ones first."""
    own = _OF_SECTION.get(section, {})
    return {
        **own,
        **{
            word: text
            for word, text in {**_ANYWHERE, **_SECTIONS}.items()
            if word not in own and "*" not in word
        },
    }
