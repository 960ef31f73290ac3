"""Advice for a motion that failed: one line for each kind of failure.

Causes come before effects: as long as equations of motion or forces are wrong, more frames do not help and are not
suggested.
"""

from __future__ import annotations

from collections.abc import Sequence

from stc.validate.certificate.blame import rank
from stc.validate.certificate.table import EQUATIONS
from stc.validate.metrics import Metric

#: Metrics of the solver's answer, of what in the equations of motion an impulse depends on, and of the ground, by how
#: their names begin.
_SOLVER = ("constraint violation", "KKT residual")
_IMPULSIVE = ("mass matrix", "force, entry")
_GROUND = ("contact", "penetration", "slip", "normal", "external")

#: What is left of all contact forces together, and what is said of them one by one: that explains it.
_FIT = "contact force that no contact gives"
_SINGLE_FORCES = ("friction used", "contact force, solved one pulls")

#: Metrics of a replay.
_REPLAYED = ("open-loop", "tracked", "feedback")

#: Metrics of a motion on the ground that finer frames enlarge or reduce whatever the contacts of the model do.
_TRUNCATION = (
    "residual between",
    "inequality between",
    "energy balance",
    "momentum in flight",
    "angular momentum",
    "external",
)

#: All metrics that the distance of the frames is in.
_STEP = (*_TRUNCATION, *_REPLAYED, "order of convergence")


#: What is said of a body that slides without its friction, before it is said how much that has.
FRICTION_STEP = (
    "where a body slides, state the full friction of the model against its velocity (-mu*N*v/|v|); elsewhere state "
    "that it stands or rolls"
)

#: What is said of equations of motion that differ from the model's.
EQUATIONS_STEP = (
    "make the spec's equations and the model agree, beginning with the term named first: correct one of them, or give "
    "the model the spec's number by a `set` line under replay:"
)

#: What comes before more frames where the residual is not judged.
_UNJUDGED = (
    "the inverse-dynamics residual is not judged here, so that wrong equations and too few frames look the same: add "
    "`joint` lines for the model's other joints, or check with --order whether the drift decreases with more frames; "
    "if it does not, the equations are wrong"
)

#: What helps where something comes down at speed and the replay does not follow from there.
_GENTLY = (
    "land more gently: put the speed of the touchdown into the objective, as `landing = 20` at a contact does, and "
    "raise the number until the replay follows"
)


def next_steps(
    metrics: Sequence[Metric],
    compared: bool,
    more_frames: str = "",
    causes: Sequence[str] = (),
    details: Sequence[str] = (),
    contacts: Sequence[str] = (),
    swings: Sequence[str] = (),
    *,
    refused: bool = False,
    clamped: bool = False,
    unjudged: bool = False,
    drift: str = "",
    soft: str = "",
) -> list[str]:
    """Advice on the failed metrics, most important first; empty if none failed.

    Args:
        metrics: everything that was measured.
        compared: whether the spec's equations of motion were compared with the model's.
        more_frames: options for more frames, such as ``--set n=120``; "" if there is no short form.
        causes: advice on known faults that are not measurements and that more frames would not correct.
        details: more detailed advice; each replaces the general advice with which it begins.
        contacts: advice on the model's contacts, for the case that they give other forces than the solved ones.
        swings: advice on forces that alternate from node to node; since those of right motions may do so too, it comes
            last, and only if contact forces or nothing else is wrong.
        refused: whether the equations cannot be compared (a note has the reason).
        clamped: whether the model clamps solved controls, which explains a residual.
        unjudged: whether the residual could not be judged, so that wrong equations and too few frames look the same.
        drift: the advice on equalities that drift open; "" if the broken ones do not.
        soft: the advice on contacts or equality constraints of the model that give way visibly; "" if none do.
    """
    found: dict[str, None] = {}
    fine = fine_enough(metrics)
    failed = sorted((metric for metric in metrics if metric.verdict == "fail"), key=rank)
    wrong = False
    explained = _explained(failed, clamped)
    for metric in failed:
        if metric.name.startswith(explained):
            continue
        step = _cause(metric, compared, refused, differ=wrong)
        if drift and metric.name.startswith("equality broken"):
            step = drift
        wrong = wrong or bool(step)
        if step:
            found.update(dict.fromkeys([one for one in details if one.startswith(step)] or [step]))
        elif not wrong:
            step = _contacts(metric, soft) if fine else _effect(metric, more_frames, soft)
            if step and unjudged and not fine:
                found[_UNJUDGED] = None
            if step and not causes:
                found.update(dict.fromkeys(contacts if contacts and fine else [step]))
    lands = any(
        metric.name.startswith("energy at velocity jumps") and metric.value < 0.0 for metric in metrics
    )
    if lands and not wrong and any("on the ground" in metric.name for metric in failed):
        # First, since it is what cures most such motions: the others say why, or refine what stays as hard.
        found = {_GENTLY: None, **found}
    # Off the ground and on it the step is the same one, with more to say of it there.
    last = swings if not wrong or any(metric.name.startswith("contact force") for metric in failed) else ()
    found = dict.fromkeys([*causes, *found, *last]) if failed else {}
    return [step for step in found if not any(one != step and one.startswith(step) for one in found)]


def _explained(failed: Sequence[Metric], clamped: bool) -> tuple[str, ...]:
    """Beginnings of the names of metrics that need no advice of their own, because advice on another metric corrects
    them.
    """
    found = ["inverse-dynamics"] if clamped else []
    if _impulses_differ(failed):
        found.append("unexplained impulse")
    if any(metric.name.startswith(_SINGLE_FORCES) for metric in failed):
        found.append(_FIT)
    if any(metric.name.startswith(("jump of position", "equality broken")) for metric in failed):
        # The momentum of one pose is not that of another, nor are forces those of a mechanism that comes apart.
        found += ["unexplained impulse", "inverse-dynamics"]
    return tuple(found)


def fine_enough(metrics: Sequence[Metric]) -> bool:
    """Whether a motion on the ground is right with the solved contact forces in place of MuJoCo's."""
    judged = [metric for metric in metrics if metric.name.startswith(_TRUNCATION)]
    return any(m.name.startswith("external") for m in judged) and all(m.verdict != "fail" for m in judged)


def _contacts(metric: Metric, soft: str) -> str:
    """Advice on the model's contacts if they differ from the solved forces; more frames do not change this."""
    if metric.name.startswith("feedback"):
        return (
            "with the solved contact forces the motion is right: the feedback works against contacts of the model that "
            "give other forces, or more of them; compare both in the page of --report"
        )
    if metric.name.startswith("contact force") or "on the ground" in metric.name:
        return (
            "with the solved contact forces the motion is right, so that more frames do not help: MuJoCo's contacts "
            "give other forces. They may be softer than the spec's (a shorter solref, a smaller timestep), touch where "
            "the spec has no force, or share a force among more points; see the contact forces in the page of --report"
        ) + (f"; {soft}" if soft else "")
    return ""


def _impulses_differ(failed: Sequence[Metric]) -> bool:
    """Whether the equations of motion are wrong in the terms that determine the impulse of a jump: mass or a force's
    share.

    Wrong gravity, for example, gives no impulse.  If the terms were not compared, any of them may be wrong.
    """
    wrong = [metric for metric in failed if metric.name.startswith(EQUATIONS)]
    terms = [metric for metric in wrong if not metric.name.startswith("equations of motion")]
    return any(metric.name.startswith(_IMPULSIVE) for metric in terms) or bool(wrong and not terms)


def _cause(metric: Metric, compared: bool, refused: bool, differ: bool) -> str:
    """Advice on a wrong statement in the spec; "" for metrics of another kind."""
    name = metric.name
    if name.startswith(_SOLVER):
        return "solve with a smaller --tolerance, such as 1e-10"
    if name.startswith("jump of position"):
        return (
            "state that the position does not jump, such as after(x) = before(x), or remove it from `jumps:`; if a "
            "coordinate is changed by whole turns at a frame, write the continuous angle in the joint line"
        )
    if name.startswith("equality broken"):
        return (
            "make the joint lines under replay: satisfy the model's equality: check signs, ratios, and the zero "
            "positions of the model's joints"
        )
    if name.startswith(EQUATIONS):
        return EQUATIONS_STEP
    if name.startswith("unexplained impulse, pulls"):
        return (
            "state that an impulse pushes and stays within the friction of the model: its normal part is >= 0, "
            "its tangential part at most friction times the normal part"
        )
    if name.startswith("unexplained impulse, no contact point"):
        return (
            "an impulse needs a contact of the model: move the jump to the frame of the touchdown and the body onto "
            "the surface, keep moments within what its contact points can give, and at the stop of a joint let the "
            "impulse push away from the stop"
        )
    if name.startswith("unexplained impulse"):
        return (
            "name the contact that supplies the impulse in a `contact` line under replay:, or state that the velocity "
            "does not jump"
        )
    if name.startswith("inverse-dynamics"):
        if differ:
            return ""
        if compared:
            return (
                "the equations are right: check that the joint, actuator, apply and set lines under replay: have the "
                "right variables, then solve with a smaller --tolerance"
            )
        if refused:
            return (
                "check by hand the equations of motion, which cannot be compared with the model's here (the note says "
                "why): masses and inertias, ratios and signs in the joint lines under replay:, and that its actuator "
                "and apply lines name all forces"
            )
        return (
            "check the forces: `--equations` compares the equations of motion term by term, and the "
            "actuator and apply lines under replay: must name all forces"
        )
    if name.startswith("contacts that the model"):
        return (
            "use `apply` lines under replay: for forces without a contact, as at a hand that holds a bar, or "
            "give geoms of the model a contype and conaffinity with which they touch"
        )
    if name.startswith("contact force, solved one pulls"):
        return "state that the contact force pushes, f >= 0: no contact of the model can pull"
    if name.startswith(_FIT):
        return (
            "limit the forces to what the contacts in the solved pose can give: the centre of pressure is on the sole, "
            "-l*fz <= my <= l*fz, the force at every point is >= 0, and moments have the lever arms of the forces; "
            "use an `apply` line for a force that needs no contact"
        )
    if name.startswith("friction missing"):
        return FRICTION_STEP
    if name.startswith("friction used"):
        return (
            "use less friction in the spec than the model has, or give the model more by "
            "`set geom.NAME.friction` under replay:"
        )
    return ""


def cured_by_frames(metric: Metric) -> bool:
    """Whether more frames can reduce a measurement, because it contains a truncation error."""
    return _on_ground(metric) or metric.name.startswith((*_STEP, "equality broken"))


def only_effects(metrics: Sequence[Metric]) -> bool:
    """Whether a replay on the ground failed and nothing shows a mistake in the spec's equations or forces."""
    failed = [metric for metric in metrics if metric.verdict == "fail"]
    return any(_on_ground(one) for one in failed) and all(cured_by_frames(one) for one in failed)


def _on_ground(metric: Metric) -> bool:
    return "on the ground" in metric.name or metric.name.startswith(_GROUND)


def _effect(metric: Metric, more_frames: str, soft: str) -> str:
    """Advice on measurements that more frames can reduce, or stiffer contacts and equality constraints."""
    if metric.name.startswith("order of convergence"):
        return (
            "look for causes that are not smooth: limits that become active within a step, jumps, guesses that lead to "
            "another motion with more frames"
        )
    if not cured_by_frames(metric):
        return ""
    step = f"take more frames: {more_frames}" if more_frames else "take more frames"
    if _on_ground(metric):
        step += f"; or {soft}" if soft else ""
        step += (
            "; if that does not help, compare the solved contact forces with MuJoCo's in the page of --report"
        )
    elif metric.name.startswith("inequality between") and "pushes (force)" in metric.subject:
        step += (
            "; if the number stays as it is and another contact ends within that step, write `sudden` at that contact: "
            "its force need not fade within one step, and hands its load over at once"
        )
    elif soft and metric.name.startswith(_REPLAYED):
        step = f"{soft}; if that does not help, {step}"
    return step
