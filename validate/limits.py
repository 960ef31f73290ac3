"""Every limit of a verdict, and every setting of the replays.

A motion passes if all its metrics are within their limits.  Lengths are in metres, angles in radians, and a share is a
fraction of one.  Some limits depend on the transcription, because the metric contains its truncation error:
hermite-simpson is of fourth order in the step, trapezoidal and central of second.
"""

from __future__ import annotations

import math
from typing import Final

ByMethod = dict[str, float]
ByUnit = dict[str, float]


def of_extent(most: float, share: float, extent: float, floor: float) -> float:
    """The limit of a distance: ``most``, or less if the whole motion is small, but never less than ``floor``.

    Args:
        most: the limit of large motions, in m or rad.
        share: largest ratio of the limit to the extent.
        extent: the largest travel of a joint, in m or rad.
        floor: the smallest limit, for motions of any size.
    """
    return min(most, max(share * extent, floor))


def left_by_solver(violation: float) -> float:
    """The error of a position due to the solver's largest scaled violation, in m or rad; 0 if there was no solver."""
    return VIOLATIONS_IN_A_POSITION * violation if math.isfinite(violation) else 0.0


# --- the solver's answer -------------------------------------------------------------------------------------

#: Largest first-order optimality error with which a solution may have been found.
KKT_RESIDUAL: Final = 1e-6

#: Largest violation of a row or bound, divided by max(1, |bound|), that a solution may have.
VIOLATION: Final = 1e-6

#: Largest smaller side of a complementary pair, divided by max(1, larger side): twice what solves end with, since the
#: unknowns are moved onto their bounds after that.
COMPLEMENTARITY: Final = 2e-6

# --- what a solution says of itself, against what its text and numbers give --------------------------------------

#: How far apart a claimed and a recomputed objective may be, as a share of the sum of its terms' magnitudes, and by how
#: much besides. The same sum in another order, with functions from another library, is off by 3e-13 at most on bundled
#: and published problems.
CLAIMED_OBJECTIVE: Final = 1e-9
CLAIMED_OBJECTIVE_FLOOR: Final = 1e-12

#: How far apart claimed and recomputed violations and optimality errors may be, besides by that share of themselves.
#: Rounding in rows of large terms comes to 1e-9.
CLAIMED_ERROR: Final = 1e-8
CLAIMED_ERROR_SHARE: Final = 1e-3

#: How far a constant may be from what the text gives, as a share: the last digits of functions differ between machines.
CLAIMED_CONSTANT: Final = 1e-12

# --- how a replay is made ----------------------------------------------------------------------------------

#: Longest time step of the replay, in seconds; a frame step is cut into equal parts no longer than this.
TIME_STEP: Final = 1e-3

#: A frame step is cut into at least so many parts, however short it is.
SUBSTEPS: Final = 4

# --- drift: how far the replayed motion leaves the solved one ------------------------------------------------

#: Largest open-loop drift of a joint or compared output.
OPEN_LOOP_DRIFT: Final[ByMethod] = {"hermite-simpson": 1e-4, "trapezoidal": 1e-2, "central": 1e-2}

#: Largest drift of a joint or compared output when feedback tracks the solved motion.
TRACKED_DRIFT: Final[ByMethod] = {"hermite-simpson": 1e-4, "trapezoidal": 1e-2, "central": 1e-2}

#: Joints and outputs may drift by this share of the motion's extent at most, but always by the floor, in m or rad: a
#: motion of a tenth of a millimetre has to be right as well.
DRIFT_SHARE: Final[ByMethod] = {"hermite-simpson": 1e-2, "trapezoidal": 1e-1, "central": 1e-1}
DRIFT_FLOOR: Final[ByMethod] = {"hermite-simpson": 1e-6, "trapezoidal": 1e-4, "central": 1e-4}

#: Largest share of its torque that the feedback may supply to an actuator.
FEEDBACK_SHARE: Final[ByMethod] = {"hermite-simpson": 5e-3, "trapezoidal": 1e-1, "central": 1e-1}

#: An actuator that the motion uses less than this share of what it uses most is judged as if it used so much, and the
#: regulator, which spends as it is judged, steers with it accordingly.
HARDLY_USED: Final = 1e-3

#: From this growth of small errors on, a motion counts as unstable: open-loop drift then says more about the
#: system than about the solution, and the residual and the tracked replay judge instead.
UNSTABLE_GROWTH: Final = 20.0

#: The growth is looked for between so many instants at most.
GROWTH_INSTANTS: Final = 60

# --- motions on the ground, MuJoCo's own contacts supplying the forces ----------------------------------------

#: RMS error of the base as a share of its travel, and of each other joint by its unit: open loop and tracked.  The
#: errors of joints of the bundled motions are 9e-5 to 8e-3 rad if judged open loop, 2e-6 to 7e-4 rad if tracked.
CONTACT_BASE: Final = 1e-3
CONTACT_JOINTS: Final[ByUnit] = {"m": 5e-3, "rad": 1e-2}
CONTACT_TRACKED_BASE: Final = 5e-3
CONTACT_TRACKED_JOINTS: Final[ByUnit] = {"m": 2.5e-3, "rad": 5e-3}

#: The same at the last frame, open loop.
CONTACT_END_BASE: Final = 1e-3
CONTACT_END_JOINTS: Final[ByUnit] = {"m": 1e-2, "rad": 2e-2}

#: A base that goes less far than this, in m, is measured as if it went so far: soft ground gives way under all that
#: stands on it.
LEAST_WAY: Final = 0.3

#: The base may be off by so many m along the normal of its contacts at most, however far it goes; where a body slides
#: with friction, which bounces on stiff ground, by as much in every direction.
CONTACT_HEIGHT: Final = 5e-3

#: Joints may be off by this share of the motion's extent at most, but always by the floor, in m or rad.
CONTACT_SHARE: Final = 2e-2
CONTACT_FLOOR: Final = 1e-3

#: Largest drift of a joint where the solved contact forces act in place of the model's contacts, phase by phase.
#: It is the truncation error of the steps alone, times what an unstable phase makes of it: 2e-4 to 4e-3 along the
#: bundled motions, most in the long stances on the Moon.
EXTERNAL_DRIFT: Final[ByMethod] = {"hermite-simpson": 5e-3, "trapezoidal": 1e-1, "central": 1e-1}

#: Largest share of its torque that the feedback may supply on the ground.
CONTACT_FEEDBACK_SHARE: Final = 5e-2

# --- feedback ------------------------------------------------------------------------------------------------

#: Longest time, in seconds, for which one gain of the regulator holds.
TRACKING_STEP: Final = 2e-3

#: Tolerable deviation of a position, in m or rad: what the regulator weighs against the next two.
TRACKING_POSITION: Final = 1e-3

#: How fast deviations should die out, 1/s.
TRACKING_RATE: Final = 10.0

#: Tolerable correction of a control, as a share of the largest one along the motion.
TRACKING_CONTROL: Final = 0.01

#: Natural frequency, in rad/s, and damping ratio of the proportional-derivative law.  Stiff, so that torques which are
#: a little too small for the masses leave a small deviation; lightly damped, since much damping answers impacts that
#: come a little early or late with torque that changes the motion little.  docs/motions.md has measurements.
PD_RATE: Final = 35.0
PD_DAMPING: Final = 0.3

# --- physics, instant by instant ---------------------------------------------------------------------------

#: Largest inverse-dynamics residual where the equations of motion hold, as a share of the motion's largest
#: generalised force.  It measures the equations alone: neither the step nor an unstable system enlarges it.
INVERSE_DYNAMICS: Final = 1e-9

#: The same between the nodes, where the method's polynomials decide.
INVERSE_DYNAMICS_BETWEEN: Final[ByMethod] = {"hermite-simpson": 5e-2, "trapezoidal": 1e-1, "central": 1e-1}

#: Places in a step, as shares of it, where the motion between the nodes is looked at.
BETWEEN_SHARES: Final = (0.125, 0.25, 0.375, 0.625, 0.75, 0.875)

#: Largest gap in the energy balance, as a share of the energy that is turned over.
ENERGY_BALANCE: Final[ByMethod] = {"hermite-simpson": 1e-4, "trapezoidal": 2e-2, "central": 2e-2}

#: Largest part of an impulse that no contact gives, as a share of the motion's largest momentum.
VELOCITY_JUMP: Final = 1e-9

#: Largest part of an impulse that contacts give only by pulling or beyond the model's friction, as the same share.
IMPULSE_CONE: Final = 1e-6

#: Largest jump of a position at a frame, as a share of the motion's extent, of 1 m or rad at least: twice what doubles
#: make of the largest unknowns.
POSITION_JUMP: Final = 1e-9

#: A position may be off by so many times the solver's largest scaled violation: a joint may be a sum of some unknowns.
VIOLATIONS_IN_A_POSITION: Final = 10.0

#: A joint may be beyond the range that the model has for it by so much, in m or rad, besides what the solver and the
#: method leave: a bound that is rounded to seven digits.
BEYOND_RANGE: Final = 1e-6

#: Largest departure from the conservation of momentum in flight, as a share of the momentum that moves.
FLIGHT: Final[ByMethod] = {"hermite-simpson": 5e-3, "trapezoidal": 1e-1, "central": 1e-1}

#: Largest share of the model's friction that a solved contact force may use, and how much it may pull, as a share of
#: the largest one.
FRICTION_CONE: Final = 1.0 + 1e-6
CONTACT_PULL: Final = 1e-6

#: Where a contact slides, the solved force is its friction up to this share of it, as MuJoCo's must be in the median.
#: At the nodes it has no truncation error; a coefficient that is less wrong shows in the replay.  In a step that ends
#: in a jump of the forces so much more friction than the model's may be used in the mean.
FRICTION_MISSING: Final = 2e-2

#: A body may slide so many m with another force than its friction: no farther than joints may be off however small the
#: motion is, so that what stops or turns within a step, or starts from a smoothed friction, is not blamed for it.
SLID_WITHOUT_FRICTION: Final = 1e-3

#: Largest part of the solved contact forces that the contact points of the model cannot give, as the same share.
CONTACT_FIT: Final = 1e-3

#: MuJoCo's contact forces and the solved ones are compared as means over so many seconds, and over two frames at least.
CONTACT_WINDOW: Final = 0.05

#: The same while a body slides: friction makes it bounce on stiff ground, 1 to 2 mm high and 10 times a second.
SLIDING_WINDOW: Final = 0.3

#: Largest difference between MuJoCo's contact forces and the solved ones, as a share of the largest solved one: the
#: median, and the 90th percentile, which is 1e-4 to 2e-2 along the bundled motions.
CONTACT_FORCE: Final = 2e-2
CONTACT_FORCE_MOST: Final = 1e-1

#: What stands on something and moves farther than this, in m, is told of.
STANDS: Final = 1e-3

#: Largest violation of an inequality of the spec between the nodes, as a share of what it compares: see
#: stc.statements_between.
INEQUALITY_BETWEEN: Final[ByMethod] = {"hermite-simpson": 2e-2, "trapezoidal": 5e-2, "central": 5e-2}

# --- perturbed replays -------------------------------------------------------------------------------------

#: How far masses and friction are off at most, as a share, and the deviations of the start, in m or rad and per second.
PERTURBED_MASS: Final = 0.02
PERTURBED_FRICTION: Final = 0.05
PERTURBED_POSITION: Final = 2e-3
PERTURBED_VELOCITY: Final = 2e-2

#: The time step of the simulation is between one over this and as many times the usual one.
PERTURBED_TIME_STEP: Final = 1.6

#: Number of different time steps among the samples.
TIME_STEPS: Final = 4

#: Replays of each kind of perturbation.
PERTURBED_SAMPLES: Final = 16

#: A replay that leaves the solved motion by more than this, in m or rad, is lost: nothing brings a fallen lamp back.
LOST: Final = 0.5

# --- files ---------------------------------------------------------------------------------------------------

#: Most numbers of a table, a control sequence or an animation: 160 MB as such, 400 MB as text.
MOST_NUMBERS: Final = 20_000_000

#: Most pixels of a filmstrip, 300 MB while it is put together.
MOST_STRIP_PIXELS: Final = 100_000_000

#: Most pixels of all images of a .webp or .gif, which are encoded together: 1.8 GB.
MOST_ANIMATION_PIXELS: Final = 600_000_000

#: Most images of one picture, which are drawn one after the other: a tenth of a second each.
MOST_IMAGES: Final = 20_000

# --- refinement and equations ------------------------------------------------------------------------------

#: Smallest order of convergence of the replay, observed on the two finest of three grids.
ORDER: Final[ByMethod] = {"hermite-simpson": 3.3, "trapezoidal": 1.8, "central": 1.8}

#: Below this drift, in m or rad, rounding and the solver's tolerance hide the order of convergence.
ORDER_FLOOR: Final = 1e-10

#: Tolerance of the solves that an order is observed on: their own error must not show in the drift.
ORDER_TOLERANCE: Final = 1e-11

#: Largest difference between the spec's equations of motion and the model's at a random state, as a share of
#: the largest generalised force there.
EQUATIONS: Final = 1e-9

#: Number of random states at which they are compared.
EQUATION_STATES: Final = 1000
