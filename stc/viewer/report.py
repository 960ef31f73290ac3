"""Texts of the windows about a motion."""

from __future__ import annotations

from stc.viewer.live import LiveSolve
from stc.viewer.player import Frame, Player
from stc.viewer.tweaks import TweakSession


def summary(player: Player) -> str:
    """The displayed motion: name, status, objective."""
    solution = player.solution
    if player.live is not None and player.live.running:
        state = f"iterate {solution.iterations}"
    else:
        state = solution.status
    size = f"{solution.method}, n = {solution.n}, {solution.duration:.4g} s"
    return f"{solution.name}: {state}\nobjective {solution.objective:.6g}\n{size}"


def simulation(player: Player, frame: Frame | None) -> str:
    """The progress of MuJoCo's simulation."""
    if not player.options.physics:
        return "switched off"
    recording = player.recording
    if recording is None:
        return "waits for the solution"
    if recording.error:
        return recording.error
    law = f", held by {recording.law}" if recording.law else ""
    if recording.broke_at is not None:
        return f"left all bounds by {recording.broke_at:.3g} s{law}"
    if not recording.done:
        return f"simulated: {100 * recording.share:.0f} %{law}"
    if frame is not None and not frame.simulated:
        return f"not simulated here{law}"
    return f"simulated{law}"


def progress(live: LiveSolve) -> str:
    """The progress of a solve."""
    if live.error is not None:
        return str(live.error)
    if live.solution is not None:
        solution = live.solution
        return f"ended {solution.status} after {solution.iterations} iterations\n{solution.message}"
    if live.record is None:
        return "getting ready"
    record = live.record
    return (
        f"iteration {record.iteration}  {record.phase}\nobjective {record.objective:.6g}\n"
        f"violation {record.violation:.1e}  step {record.step:.1e}"
    )


def refusal(tweaks: TweakSession) -> str:
    """Why the displayed motion is not the requested one."""
    solution, outcome = tweaks.solution, tweaks.outcome
    names = [constant.name for constant in tweaks.constants]
    wanted = {name: tweaks.wanted(name) for name in names if name in solution.constants}
    differing = [name for name, value in wanted.items() if value != solution.constants[name]]
    asked = ", ".join(f"{name} = {wanted[name]:.6g}" for name in differing)
    kept = ", ".join(f"{name} = {solution.constants[name]:.6g}" for name in differing)
    reason = "" if outcome is None else f"{outcome.status}. {outcome.message}"
    return f"no motion for {asked}: {reason}\nkept: {kept}"
