"""Divides the bodies of a model into those that its actuators move and objects without any drive."""

from __future__ import annotations

from collections.abc import Iterator

from stc.mechanism.mechanism import Actuator, Equality, Mechanism


def groups(mechanism: Mechanism) -> dict[int, int]:
    """Bodies that joints or equality constraints join, without the world: a number of its group for each body."""
    # Bodies that hang on the world, each with all that hangs on it, and what joins some of these.
    trees = {body: body for body in range(len(mechanism.bodies))}
    for body in range(1, len(trees)):
        parent = mechanism.bodies[body].parent
        trees[body] = trees[parent] if parent else body
    for equality in mechanism.equalities:
        ends = (
            sorted({trees[body] for body in _of_equality(mechanism, equality)} - {0})
            if equality.active
            else []
        )
        trees = {body: ends[0] if tree in ends else tree for body, tree in trees.items()}
    return trees


def objects(mechanism: Mechanism) -> frozenset[int]:
    """The moving bodies that no actuator can move, as nothing joins them to bodies on which one acts.

    None where the model has no actuators: there everything is alike.
    """
    trees = groups(mechanism)
    driven = {
        trees[body] for one in mechanism.actuators if one.enabled for body in _of_actuator(mechanism, one)
    }
    moving = {trees[joint.body] for joint in mechanism.joints}
    return frozenset(body for body, tree in trees.items() if driven and tree in moving - driven)


def _of_actuator(mechanism: Mechanism, actuator: Actuator) -> Iterator[int]:
    """The bodies on which an actuator acts."""
    if actuator.transmission in ("joint", "jointinparent"):
        yield mechanism.joints[actuator.target].body
    elif actuator.transmission == "tendon":
        for step in mechanism.tendons[actuator.target].path:
            if step.kind == "joint":
                yield mechanism.joints[step.index].body
            elif step.kind == "site":
                yield mechanism.sites[step.index].body
    elif actuator.transmission == "body":
        yield actuator.target
    elif actuator.target >= 0:
        yield mechanism.sites[actuator.target].body


def _of_equality(mechanism: Mechanism, equality: Equality) -> Iterator[int]:
    """The bodies that an equality constraint joins."""
    for index in (equality.first, equality.second):
        if index < 0:
            continue
        if equality.between == "joint":
            yield mechanism.joints[index].body
        elif equality.between == "site":
            yield mechanism.sites[index].body
        elif equality.between == "body":
            yield index
        elif equality.between == "tendon":
            for step in mechanism.tendons[index].path:
                if step.kind == "joint":
                    yield mechanism.joints[step.index].body
