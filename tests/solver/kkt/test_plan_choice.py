"""Which of several plans for segments factorises a matrix, and when another one is made."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from solver.kkt.kkt_problems import generic
from solver.kkt.motions import chain_of, motion, system_of
from solver.kkt.test_contract import check

from stc.core.calls import Bound, CallTable
from stc.solver.kkt import DenseKKT, chain, lane_state, plan_calls, plan_choice, planned, segmented
from stc.solver.kkt.contract import Inertia
from stc.solver.kkt.lane_program import plan_panels
from stc.solver.kkt.plan_choice import SETTLED


@pytest.fixture
def planning_is_free(monkeypatch):
    """As few matrices as ever have to be served before another plan is made."""
    monkeypatch.setattr(segmented, "effort_of", lambda ways, size: 0)


def test_a_settled_plan_takes_no_more_operations(planning_is_free):
    """After some matrices a plan is made with more effort; it serves the same ones, and others like them."""
    rng = np.random.default_rng(22)
    pattern = motion(rng, 60, parameters=1)
    kkt = system_of(pattern)
    operations = []
    for _ in range(10):
        check(kkt, pattern, generic(rng, pattern), rng)
        assert kkt._by_plan
        operations.append(kkt._plans.now.operations)
    assert kkt._plans._settle_at > SETTLED[0]
    assert operations[-1] <= operations[0]
    values = np.ones(kkt._kinds[0].rows.size)
    plain, thorough = (
        plan_panels(kkt._kinds[0], values, np.ones(kkt._kinds[0].own), thorough=effort)
        for effort in (False, True)
    )
    assert len(plain) == 1
    assert thorough[0].operations <= plain[0].operations
    operations = [program.operations for program in thorough]
    assert operations == sorted(set(operations))


def test_the_next_best_of_a_search_is_tried_where_the_best_is_no_good(planning_is_free):
    """Orders that expect small pivots take the fewest operations, and sometimes turn out inaccurate."""
    plans, made = plan_choice.Plans(1000, plan(0, 0)), []
    good = plan(0, 100)
    found = [plan(1, 70), plan(2, 80), plan(3, 90), plan(4, 99)]

    def make(number):
        made.append(number)
        if number == 0:
            return good
        return found[number - 1] if number <= len(found) else None

    used = []
    for _ in range(40):
        plans.paused()
        for candidate in plans.candidates(True, make):
            candidate.state[lane_state.LARGEST] = 1e-5 if candidate is found[0] else 1e-8
            candidate.probed[0] = 1e-9
            if candidate is found[1]:  # a pivot is refused
                plans.refused(candidate)
                continue
            if plans.disappoints(candidate):
                continue
            plans.suited(candidate)
            plans.succeeded()
            used.append(candidate)
            break
    assert made == [0, 1, 2, 3]
    assert used[: SETTLED[0] + 2] == [good] * (SETTLED[0] + 2)
    assert used[SETTLED[0] + 2 :] == [found[2]] * (40 - SETTLED[0] - 2)
    assert list(plans) == [good, found[2]]


def test_a_search_ends_where_nothing_found_is_any_good(planning_is_free):
    plans, made = plan_choice.Plans(1000, plan(0, 0)), []
    good = plan(0, 100)

    def make(number):
        made.append(number)
        return good if number == 0 else plan(number, 50 + 10 * number) if number < 4 else None

    for _ in range(200):
        plans.paused()
        for candidate in plans.candidates(True, make):
            if candidate is not good:
                plans.refused(candidate)
                continue
            plans.suited(candidate)
            plans.succeeded()
            break
    assert made == [0, 1, 2, 3, 4, 1, 2, 3, 4]
    assert list(plans) == [good]


def plan(slot, operations):
    """One that is never carried out."""
    nothing, state = np.zeros(0), np.zeros(lane_state.STATE)
    call = Bound.of_python(lambda: 0, ())
    return plan_choice.Prepared(slot, (), nothing, state, (nothing, nothing), call, operations, 0, True)


@pytest.mark.parametrize("unknowns", [1000, 20_000])
def test_plans_that_do_not_even_suit_their_own_matrix_are_made_ever_more_rarely(unknowns):
    """Matrices that no plan can help come again with each solve."""
    plans, made = plan_choice.Plans(unknowns, plan(0, 0)), []

    def make(number):
        made.append(plans.tried)
        return plan(len(made), 100)

    good = None
    for number in range(2000):
        if plans.paused():
            continue
        hopeless = number % 4 == 3
        for candidate in plans.candidates(True, make):
            good = good or candidate
            if candidate is good and not hopeless:
                plans.suited(candidate)
                plans.succeeded()
                break
            candidate.refused(plans.tried)
        else:
            plans.failed()
    assert good is not None
    assert good.served > 1000
    waits = np.diff(made[2:])
    assert 3 <= len(made) <= 20
    assert waits[-1] >= 4 * waits[0]


@pytest.mark.parametrize(
    ("growth", "residual", "given_up"),
    [(1e-5, 1e-9, True), (1e-5, 0.0, False), (1e-5, 2e-12, False), (1e-8, 1e-9, False)],
)
def test_fewer_operations_are_not_worth_less_accuracy(growth, residual, given_up):
    """A plan whose pivots are larger, and whose trial leaves what solves would have to refine, goes as it came."""
    one, other = plan(0, 100), plan(1, 80)
    plans = plan_choice.Plans(1000, plan(0, 0))
    plans.paused()
    for candidate in plans.candidates(True, lambda number: one):
        assert candidate is one
        break
    one.state[lane_state.LARGEST] = 1e-7
    assert not plans.disappoints(one)
    plans.suited(one)
    for _ in range(SETTLED[0] - 1):
        plans.went_well(1)
    plans.paused()
    tried = []
    for candidate in plans.candidates(True, lambda number: other):
        tried.append(candidate)
        if candidate is other:
            other.state[lane_state.LARGEST] = growth
            other.probed[0] = residual
            if plans.disappoints(other):
                continue
        plans.suited(candidate)
        break
    assert tried == ([other, one] if given_up else [other])
    assert (other in list(plans)) != given_up
    assert plans.now is (one if given_up else other)


def test_factors_that_are_tried_once_are_trusted(monkeypatch):
    monkeypatch.setattr(planned, "SUSPECT", 0.0)
    rng = np.random.default_rng(17)
    pattern = motion(rng, 40)
    kkt = system_of(pattern)
    values = generic(rng, pattern)
    tried = []
    check(kkt, pattern, values, rng)
    place = plan_calls.CALLS * kkt._plan_in_use().slot + plan_calls.PROBE
    probe = kkt._calls._parts[place]
    kkt._calls.put(place, Bound.of_python(lambda: tried.append(1) or probe(), ()))
    for _ in range(2):
        check(kkt, pattern, values, rng)
    assert not tried
    kkt.restart()
    check(kkt, pattern, values, rng)
    assert len(tried) == 1


def test_a_plan_that_could_not_be_beaten_early_is_challenged_once_more(monkeypatch, planning_is_free):
    rng = np.random.default_rng(23)
    pattern = motion(rng, 40)
    kkt = system_of(pattern)
    monkeypatch.setattr(plan_choice, "FEWER", 0.0)  # no plan is better
    efforts = []
    programs = kkt._programs

    def counted(thorough):
        efforts.append((kkt._plans.tried, thorough))
        return programs(thorough)

    monkeypatch.setattr(kkt, "_programs", counted)
    values = generic(rng, pattern)
    values.hess[:] = np.where(pattern.hess_rows == pattern.hess_cols, 4.0, 0.1)
    solve_along(kkt, pattern, [values] * 50)
    assert [number for number, thorough in efforts if thorough] == [at + 1 for at in SETTLED]
    found = solve_along(kkt, pattern, [values] * 50)
    assert [ended for ended, _ in found[1:]] == [0] * 49
    assert len(efforts) == 3


def test_planning_waits_until_it_may_pay(monkeypatch):
    """More effort is made when factorisations have taken as long as it takes, not before."""
    rng = np.random.default_rng(24)
    pattern = motion(rng, 40)
    values = generic(rng, pattern)
    values.hess[:] = np.where(pattern.hess_rows == pattern.hess_cols, 4.0, 0.1)
    for share in (2, 5):
        kkt = system_of(pattern)
        kkt.factorize(*values.arguments())
        effort = share * SETTLED[0] * kkt._plans.now.operations
        monkeypatch.setattr(segmented, "effort_of", lambda ways, size, effort=effort: effort)
        kkt = system_of(pattern)
        for _ in range(2):
            solve_along(kkt, pattern, [values] * (share * SETTLED[0] // 2 + 2))
            assert kkt._plans._settled == 0
        # Early in the next solve, but when its entries have reached their sizes.
        solve_along(kkt, pattern, [values] * (SETTLED[0] - 1))
        assert kkt._plans._settled == 0
        solve_along(kkt, pattern, [values] * (SETTLED[0] + 3))
        assert kkt._plans._settled > 0
        alone = system_of(pattern)
        solve_along(alone, pattern, [values] * (share * SETTLED[0] + 2))
        assert alone._plans._settled > 0


def solve_along(kkt, pattern, sequence):
    """How each matrix of several was factorised from a restart on (0: in one call), and by the plan in which slot."""
    kkt.restart()
    found = []
    for values in sequence:
        for mine, its in zip((kkt.hess, kkt.jac, kkt.primal, kkt.dual), values.arguments(), strict=True):
            mine[:] = its
        call = kkt.attempt_call
        ended = call() if call is not None else -1
        if ended:
            inertia = kkt.resume(ended) if ended > 0 else kkt.refactor()
        else:
            inertia = Inertia(*kkt.inertia.tolist())
        assert inertia == Inertia(pattern.n, pattern.m, 0)
        found.append((ended, kkt._plan_in_use().slot))
    return found


def test_matrices_of_a_solve_that_is_repeated_are_factorised_by_one_call_each(planning_is_free):
    rng = np.random.default_rng(21)
    pattern = motion(rng, 40)
    kkt = system_of(pattern)
    convex = generic(rng, pattern)
    convex.hess[:] = np.where(pattern.hess_rows == pattern.hess_cols, 4.0, 0.1)
    flat = replace(convex, hess=np.zeros_like(convex.hess), primal=np.ones(pattern.n))
    bent = (pattern.hess_rows == pattern.hess_cols) & (pattern.hess_rows % 5 == 0)
    early = replace(convex, hess=np.where(bent, 4.0, 0.0), primal=np.zeros(pattern.n))
    sequence = [flat, *[early] * 4, *[convex] * 12]
    first = solve_along(kkt, pattern, sequence)
    used = {slot for _, slot in first}
    assert used == {0, 1, 2}
    assert any(ended for ended, _ in first[1:])
    found = solve_along(kkt, pattern, sequence)
    assert [ended for ended, _ in found[1:]] == [0] * (len(sequence) - 1)
    assert {slot for _, slot in found} == used
    assert kkt.factorizations == len(sequence)
    assert solve_along(kkt, pattern, sequence) == found


class Scripted:
    """Calls of two plans as the compiled choice between them sees them."""

    def __init__(self, **results):
        self.made = []
        self.results = {name: list(values) for name, values in results.items()}
        self.table = CallTable(2 * plan_calls.CALLS)
        self.tally = np.zeros(plan_calls.TALLY, dtype=np.int64)
        self.tally[plan_calls.OTHER] = -1
        for plan in (0, 1):
            for place, name in ((plan_calls.ELIMINATE, "eliminate"), (plan_calls.EQUILIBRATE, "equilibrate")):
                call = Bound.of_python(self.make, (f"{name}{plan}",))
                self.table.put(plan_calls.CALLS * plan + place, call)
        self.begin = plan_calls.begin.bind(1, np.ones(1, dtype=np.int64), self.table.cells, self.tally)
        self.eliminate = plan_calls.eliminate.bind(self.table.cells, self.tally)

    def make(self, name):
        self.made.append(name)
        return self.results[name].pop(0) if self.results.get(name) else 0

    def factorize(self):
        """Which calls were made for a matrix; None where no more are allowed."""
        self.made = []
        if self.begin():
            return None
        ended = self.eliminate()
        self.tally[plan_calls.MADE] += not ended
        return self.made, ended


def test_a_scale_that_does_not_serve_is_found_anew():
    calls = Scripted(eliminate0=[2, 0, 2, 1, 1], equilibrate0=[1, 1, 0])
    calls.tally[plan_calls.ALLOWED] = 9
    again = ["eliminate0", "equilibrate0", "eliminate0"]
    assert calls.factorize() == (again, 0)
    assert calls.factorize() == (again, 1)
    assert calls.factorize() == (["eliminate0", "equilibrate0"], 1)


@pytest.mark.parametrize("suits", [True, False])
def test_a_plan_that_is_due_is_tried_and_kept_where_it_suits(suits):
    calls = Scripted(eliminate1=[0 if suits else 1])
    tally = calls.tally
    tally[[plan_calls.ALLOWED, plan_calls.OTHER, plan_calls.IF_SUITED, plan_calls.IF_REFUSED]] = 2, 1, 3, 1
    for _ in range(2):
        assert calls.factorize() == (["eliminate0"], 0)
    if suits:
        assert calls.factorize() == (["eliminate1"], 0)
    else:
        assert calls.factorize() == (["eliminate1", "equilibrate1", "eliminate0"], 0)
    more = 3 if suits else 1
    for _ in range(more):
        assert calls.factorize() == ([f"eliminate{int(suits)}"], 0)
    assert calls.factorize() is None
    assert tally[plan_calls.OUTCOME] == (plan_calls.SUITED if suits else plan_calls.REFUSED)
    assert tally[plan_calls.MADE_BEFORE] == 2
    assert tally[plan_calls.MADE] == 1 + more
    assert tally[plan_calls.NOW] == tally[plan_calls.NEXT] == int(suits)


@pytest.mark.parametrize(("module", "system"), [(segmented, system_of), (chain, chain_of)])
def test_plans_that_fail_give_way(module, system, monkeypatch):
    """With a growth that nothing keeps to, the whole matrix is pivoted as its values ask for, and then tried less."""
    monkeypatch.setattr(module, "GROWTH", 1e-3)
    rng = np.random.default_rng(9)
    pattern = motion(rng, 30)
    kkt, judge = system(pattern), DenseKKT(*pattern.arguments())
    for _ in range(8):
        values = generic(rng, pattern)
        assert kkt.factorize(*values.arguments()) == judge.factorize(*values.arguments())
        assert not kkt._by_plan
        kkt.solve(rng.normal(size=pattern.n), rng.normal(size=pattern.m))
        assert kkt.last_residual < 1e-12


def test_what_barriers_add_comes_and_goes():
    """Plans are made without it."""
    rng = np.random.default_rng(12)
    pattern = motion(rng, 40)
    kkt = system_of(pattern)
    values = generic(rng, pattern)
    for size in (1e3, 0.0, 1e-6, 1.0):
        values.primal = size * rng.uniform(0.5, 2.0, pattern.n)
        check(kkt, pattern, values, rng)
    before = kkt._programs(thorough=True)
    kkt.primal *= 7.0
    for one, other in zip(before, kkt._programs(thorough=True), strict=True):
        for kind, the_same in zip(one, other, strict=True):
            for panel, same in zip(kind.panels, the_same.panels, strict=True):
                np.testing.assert_array_equal(panel, same)


@pytest.mark.parametrize(
    ("residual", "accurate", "trusted"),
    [
        (1e-12, 1, 0.3),
        (1e-8, 1, plan_calls.MOST_TRUSTED),
        (1e-6, 1, planned.SUSPECT),
        (1e-4, 0, planned.SUSPECT),
    ],
)
def test_factors_are_trusted_as_far_as_they_have_proved_accurate(residual, accurate, trusted):
    state, report = np.zeros(lane_state.STATE), np.zeros(3)
    state[lane_state.LARGEST], state[lane_state.TRUSTED] = 0.1, planned.SUSPECT
    calls = CallTable(plan_calls.CALLS)
    calls.put(plan_calls.PROBE, Bound.of_python(report.__setitem__, (0, residual)))
    assert plan_calls.is_accurate(calls.cells, 0, report, state) == accurate
    calls.check()
    assert state[lane_state.TRUSTED] == pytest.approx(trusted)
