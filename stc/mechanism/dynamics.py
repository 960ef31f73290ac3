"""The equations of motion of a mechanism and its mechanical quantities, as expressions of its motion."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from functools import cached_property

from stc.mechanism import passive, quantities
from stc.mechanism.actuation import activation_rates, actuator_force
from stc.mechanism.fluid import resistance
from stc.mechanism.forces import Forces, Transmission, Wrench, together
from stc.mechanism.kinematics import Kinematics, Motion
from stc.mechanism.mechanism import Mechanism
from stc.mechanism.newton_euler import generalised_forces, inverse_dynamics
from stc.mechanism.numbers import Numbers
from stc.mechanism.transmissions import tendon_line, transmission
from stc.mechanism.tree import Frame, Tree
from stc.mechanism.vectors import ORIGIN, Vector, vector
from stc.symbolic.expr import ZERO, Expr, add, mul, num, sub, sum_of


class Dynamics:
    """Expressions of one state of motion of a mechanism; each is built when it is first requested.

    Parameters
    ----------
    mechanism
        The model, without what :func:`stc.mechanism.refusals.refusals` lists.
    motion
        Coordinates, velocities and accelerations.  Quaternions are taken to be of length 1.  A free joint's velocities
        are that of the body's origin in the world and the angular velocity in the body's frame; a ball joint's is the
        angular velocity in the body's frame.
    controls, activations
        Of all actuators.
    numbers
        Which of the model's numbers are symbols; none if not given.
    """

    def __init__(
        self,
        mechanism: Mechanism,
        motion: Motion,
        controls: Sequence[Expr] = (),
        activations: Sequence[Expr] = (),
        numbers: Numbers | None = None,
    ) -> None:
        self.mechanism = mechanism
        self.motion = motion
        self.controls = controls
        self.activations = activations
        self.numbers = numbers or Numbers()
        self.tree = Tree(mechanism, self.numbers)
        self.kinematics = Kinematics(self.tree, motion, self._gravity())

    def _gravity(self) -> Vector:
        options = self.mechanism.options
        if "gravity" in options.disabled:
            return ORIGIN
        return self.tree.vector_of(("option", "gravity"), options.gravity)

    # --- frames --------------------------------------------------------------------------------------------------

    def body(self, index: int) -> Frame:
        """The frame of a body."""
        return self.tree.frames[index]

    def point(self, body: int, at: Sequence[float]) -> Frame:
        """A point fixed in a body, given by its position in the body's frame."""
        return self.tree.frame(body, vector(at))

    @cached_property
    def sites(self) -> list[Frame]:
        """The frames of all sites."""
        return [
            self.tree.frame(site.body, self._place(("site", site.name, "pos"), site.pos), site.quat)
            for site in self.mechanism.sites
        ]

    @cached_property
    def geoms(self) -> list[Frame]:
        """The frames of all geoms."""
        return [
            self.tree.frame(geom.body, self._place(("geom", geom.name, "pos"), geom.pos), geom.quat)
            for geom in self.mechanism.geoms
        ]

    def _place(self, path: tuple[str, str, str], pos: Sequence[float]) -> Vector:
        """A position that can be set if the element has a name."""
        return self.tree.vector_of(path, pos) if path[1] else vector(pos)

    # --- lengths -------------------------------------------------------------------------------------------------

    @cached_property
    def tendons(self) -> list[Transmission]:
        """The lengths of all tendons, and their transmissions."""
        return [tendon_line(tendon, self.kinematics, self.sites) for tendon in self.mechanism.tendons]

    @cached_property
    def gears(self) -> list[list[Expr]]:
        """The gear of every actuator; the first number can be set."""
        return [
            [
                self.numbers.number(actuator.gear[0], "actuator", actuator.name, "gear"),
                *[num(value) for value in actuator.gear[1:]],
            ]
            for actuator in self.mechanism.actuators
        ]

    @property
    def _first_gears(self) -> list[Expr]:
        return [gear[0] for gear in self.gears]

    @cached_property
    def lines(self) -> list[Transmission]:
        """The transmission of every actuator, including the gear: MuJoCo's ``actuator_length`` and
        ``actuator_velocity``.
        """
        return [
            transmission(actuator, self.kinematics, gear, self.sites, self.tendons)
            for actuator, gear in zip(self.mechanism.actuators, self.gears, strict=True)
        ]

    # --- forces --------------------------------------------------------------------------------------------------

    @cached_property
    def actuator_forces(self) -> list[Expr]:
        """The force of every actuator before the gear, within its limits: MuJoCo's ``actuator_force``."""
        if "actuation" in self.mechanism.options.disabled:
            return [ZERO] * len(self.mechanism.actuators)
        return [
            actuator_force(actuator, line, self.controls, self.activations)
            for actuator, line in zip(self.mechanism.actuators, self.lines, strict=True)
        ]

    def pull_on_tendon(self, index: int) -> Expr:
        """The force of all actuators along a tendon, including the gear, which ``actuatorfrcrange`` limits."""
        return sum_of(
            [
                mul(gear[0], force)
                for actuator, gear, force in zip(
                    self.mechanism.actuators, self.gears, self.actuator_forces, strict=True
                )
                if (actuator.transmission, actuator.target) == ("tendon", index)
            ]
        )

    @cached_property
    def activation_rates(self) -> list[Expr]:
        """The time derivatives of all activations."""
        rates: dict[int, Expr] = {}
        for actuator, line in zip(self.mechanism.actuators, self.lines, strict=True):
            rates.update(activation_rates(actuator, line, self.controls, self.activations))
        return [rates[index] for index in range(self.mechanism.n_activations)]

    @cached_property
    def _actuation(self) -> Forces:
        forces = Forces()
        for line, force in zip(self.lines, self.actuator_forces, strict=True):
            if force is not ZERO:
                forces.along(line, force)
        return forces

    @cached_property
    def _springs_dampers_medium(self) -> Forces:
        forces = passive.springs_and_dampers(self.kinematics, self.numbers, self.tendons, self._first_gears)
        if not all(passive.disabled_passive(self.mechanism)):
            forces.wrenches += resistance(self.kinematics, self.numbers, self.geoms)
        return forces

    @cached_property
    def _compensation(self) -> list[Wrench]:
        return passive.gravity_compensation(self.kinematics, self.numbers)

    @cached_property
    def _drives(self) -> Forces:
        return passive.drive_inertia(self.kinematics, self.numbers, self.tendons, self._first_gears)

    def passive_forces(self) -> list[Expr]:
        """MuJoCo's ``qfrc_passive``: of springs, dampers, the medium, and gravity compensation without actuators."""
        found = self._on_dofs(self._springs_dampers_medium)
        for dof, force in enumerate(self._compensation_by(actuators=False)):
            found[dof] = add(found[dof], force)
        return found

    def actuation(self) -> list[Expr]:
        """MuJoCo's ``qfrc_actuator``, within its limits: the forces of all actuators on every degree of freedom."""
        found = self._on_dofs(self._actuation)
        if self._actuated:
            for dof, force in enumerate(self._compensation_by(actuators=True)):
                found[dof] = add(found[dof], force)
        return found

    @property
    def _actuated(self) -> bool:
        """Whether any actuators could compensate gravity."""
        return bool(self.mechanism.actuators) and "actuation" not in self.mechanism.options.disabled

    def inverse(self, wrenches: Iterable[Wrench] = ()) -> list[Expr]:
        """MuJoCo's ``qfrc_inverse`` without constraints: M a + c - passive forces - wrenches."""
        return self._beside(Forces(wrenches=list(wrenches)), compensated_by_actuators=False)

    def residual(
        self, wrenches: Iterable[Wrench] = (), on_dofs: Mapping[int, Expr] | None = None
    ) -> list[Expr]:
        """The residual of the equation of motion of every degree of freedom.

        Parameters
        ----------
        wrenches
            Forces of contact and of other constraints on bodies.
        on_dofs
            Further forces by degree of freedom, such as dry friction.
        """
        given = together([Forces(dict(on_dofs or {}), list(wrenches)), self._actuation])
        return self._beside(given, compensated_by_actuators=self._actuated)

    def _beside(self, given: Forces, compensated_by_actuators: bool) -> list[Expr]:
        """The generalised forces that the motion needs besides given ones and all passive ones."""
        every = together(
            [given, self._springs_dampers_medium, self._drives, Forces(wrenches=self._compensation)]
        )
        found = inverse_dynamics(self.kinematics, every.wrenches)
        for dof, force in every.on_dofs.items():
            found[dof] = sub(found[dof], force)
        if compensated_by_actuators:
            return found
        too_much = self._compensation_by(actuators=True)
        return [add(force, more) for force, more in zip(found, too_much, strict=True)]

    def _on_dofs(self, forces: Forces) -> list[Expr]:
        found = generalised_forces(self.kinematics, forces.wrenches)
        for dof, force in forces.on_dofs.items():
            found[dof] = add(found[dof], force)
        return found

    def _compensation_by(self, actuators: bool) -> list[Expr]:
        """Gravity compensation on the degrees of freedom whose actuators supply it, or on the others."""
        found: list[Expr] = [ZERO] * self.mechanism.n_freedoms
        if self._compensation:
            every = generalised_forces(self.kinematics, self._compensation)
            for joint in self.mechanism.joints:
                if joint.gravcomp_by_actuators == actuators:
                    for dof in joint.dofs:
                        found[dof] = every[dof]
        return found

    # --- the whole, or a body and all that hangs on it --------------------------------------------------------------

    def _loads(self, body: int) -> quantities.Loads:
        if body not in self._known_loads:
            self._known_loads[body] = quantities.loads(self.tree, body)
        return self._known_loads[body]

    @cached_property
    def _known_loads(self) -> dict[int, quantities.Loads]:
        return {}

    def mass(self, body: int = 0) -> Expr:
        """The mass of a body and all bodies on it, in kg; of the whole model for the world."""
        return quantities.total_mass(self._loads(body))

    def centre_of_mass(self, body: int = 0) -> Vector:
        """The centre of mass, in the world.

        Raises:
            ValueError: nothing has mass.
        """
        return quantities.centre_of_mass(self.kinematics, self._loads(body))

    def centre_velocity(self, body: int = 0) -> Vector:
        """The velocity of the centre of mass, in the world.

        Raises:
            ValueError: nothing has mass.
        """
        return quantities.centre_velocity(self.kinematics, self._loads(body))

    def momentum(self, body: int = 0) -> Vector:
        """Linear momentum, in the world."""
        return quantities.momentum(self.kinematics, self._loads(body))

    def angular_momentum(self, body: int = 0) -> Vector:
        """Angular momentum about the centre of mass, along the world's axes."""
        return quantities.angular_momentum(self.kinematics, self._loads(body))

    def kinetic_energy(self) -> Expr:
        """Kinetic energy of the whole, drives included."""
        own = quantities.kinetic_energy(self.kinematics, self._loads(0))
        return add(own, passive.drive_energy(self.kinematics, self.numbers, self.tendons, self._first_gears))

    def potential_energy(self) -> Expr:
        """Energy of weight, 0 at the world's origin, and of springs."""
        own = quantities.weight_energy(self.kinematics, self._loads(0))
        return add(own, passive.spring_energy(self.kinematics, self.numbers, self.tendons))
