"""Drake's DirectCollocation of a multibody plant with SNOPT: P2.

Drake collocates by Hermite-Simpson with linear forces and gives its solvers gradients only.
"""

from __future__ import annotations

import numpy as np
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import MultibodyPlant
from pydrake.planning import DirectCollocation
from pydrake.solvers import SnoptSolver, SolverOptions
from pydrake.trajectories import PiecewisePolynomial

from bench.peers import problems
from bench.peers.task import Case, Outcome, Task

URDF = f"""<robot name="cart_pole">
  <link name="cart"><inertial><mass value="{problems.CART}"/>
    <inertia ixx="1e-9" iyy="1e-9" izz="1e-9" ixy="0" ixz="0" iyz="0"/></inertial></link>
  <link name="pole"><inertial><origin xyz="0 0 {-problems.LENGTH}"/><mass value="{problems.POLE}"/>
    <inertia ixx="0" iyy="0" izz="0" ixy="0" ixz="0" iyz="0"/></inertial></link>
  <joint name="slide" type="prismatic"><parent link="world"/><child link="cart"/><axis xyz="1 0 0"/>
    <limit effort="{problems.FORCE}"/></joint>
  <joint name="swing" type="continuous"><parent link="cart"/><child link="pole"/><axis xyz="0 -1 0"/></joint>
  <transmission name="drive"><type>transmission_interface/SimpleTransmission</type>
    <joint name="slide"><hardwareInterface>EffortJointInterface</hardwareInterface></joint>
    <actuator name="motor"/></transmission>
</robot>"""


def build(case: Case, variant: str) -> Task:
    h = problems.SWING_TIME / case.n
    plant = MultibodyPlant(time_step=0.0)
    plant.mutable_gravity_field().set_gravity_vector([0.0, 0.0, -problems.GRAVITY])
    Parser(plant).AddModelsFromString(URDF, "urdf")
    plant.Finalize()
    port = plant.get_actuation_input_port().get_index()
    collocation = DirectCollocation(plant, plant.CreateDefaultContext(), case.n + 1, h, h, port, False)
    program = collocation.prog()
    force, state = collocation.input()[0], collocation.state()
    collocation.AddRunningCost(force**2)
    for value, limit in ((force, problems.FORCE), (state[0], problems.TRACK)):
        collocation.AddConstraintToAllKnotPoints(value <= limit)
        collocation.AddConstraintToAllKnotPoints(value >= -limit)
    end = np.array([problems.DISTANCE, np.pi, 0.0, 0.0])
    program.AddBoundingBoxConstraint(np.zeros(4), np.zeros(4), collocation.initial_state())
    program.AddBoundingBoxConstraint(end, end, collocation.final_state())
    times = [0.0, problems.SWING_TIME]
    collocation.SetInitialTrajectory(
        PiecewisePolynomial.FirstOrderHold(times, np.zeros((1, 2))),
        PiecewisePolynomial.FirstOrderHold(times, np.column_stack([np.zeros(4), end])),
    )
    guess = program.initial_guess()
    guess = np.where(np.isnan(guess), h, guess)
    solver, options = SnoptSolver(), SolverOptions()
    options.SetOption(SnoptSolver.id(), "Time limit", case.time_limit)

    def solve() -> Outcome:
        result = solver.Solve(program, guess, options)
        status = str(result.get_solution_result()).rpartition(".")[2]
        return Outcome(
            float(result.get_optimal_cost()), 0, bool(result.is_success()), status, result.GetSolution()
        )

    return Task(solve, "Hermite-Simpson, quasi-Newton")
