"""An interrupt that a solver saw is one that its caller sees, whatever the solver makes of it."""

from __future__ import annotations

import signal
import threading
from contextlib import suppress

import pytest

from aerobat.optimization import solver
from aerobat.optimization.interrupts import interrupts_kept
from aerobat.optimization.nonlinear import NonlinearProgram, import_casadi, solve_nonlinear
from paper_program import FLIP_ROLL, flip


@pytest.fixture(autouse=True)
def _interruptible():
    """Ctrl-C as a terminal gives it, also for tests started in the background, which ignores it."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


def interrupting(ca):
    """A program whose objective raises SIGINT in its own process when it is evaluated for the tenth time."""

    class Interrupting(ca.Callback):
        def __init__(self) -> None:
            ca.Callback.__init__(self)
            self.calls = 0
            self.construct("interrupting", {"enable_fd": True})

        def get_n_in(self) -> int:
            return 1

        def get_n_out(self) -> int:
            return 1

        def get_sparsity_in(self, i: int):
            return ca.Sparsity.dense(2, 1)

        def eval(self, arguments):
            self.calls += 1
            if self.calls == 10:
                signal.raise_signal(signal.SIGINT)
            x = arguments[0]
            return [(1 - x[0]) ** 2 + 100 * (x[1] - x[0] ** 2) ** 2]

    return Interrupting()


def test_ipopt_stopped_by_an_interrupt_gives_no_result(capfd) -> None:
    pytest.importorskip("casadi")
    ca = import_casadi()
    x = ca.MX.sym("x", 2)
    objective = interrupting(ca)
    program = NonlinearProgram(x, objective(x), x[0], -10.0, 10.0)
    with pytest.raises(KeyboardInterrupt):
        solve_nonlinear(program, [-0.5, 0.5], exact_hessian=False)
    assert objective.calls >= 10
    out, err = capfd.readouterr()
    assert (out, err) == ("", "")
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler


def test_scip_stopped_by_an_interrupt_gives_no_result(monkeypatch) -> None:
    pyscipopt = pytest.importorskip("pyscipopt")

    class Interrupting(pyscipopt.Eventhdlr):
        def eventinit(self) -> None:
            self.model.catchEvent(pyscipopt.SCIP_EVENTTYPE.FIRSTLPSOLVED, self)

        def eventexec(self, event) -> None:
            signal.raise_signal(signal.SIGINT)

    class Model(pyscipopt.Model):
        def optimize(self) -> None:
            self.includeEventhdlr(Interrupting(), "interrupting", "Ctrl-C at the first relaxation")
            super().optimize()

    monkeypatch.setattr(pyscipopt, "Model", Model)
    with pytest.raises(KeyboardInterrupt):
        solver("scip").solve(flip(FLIP_ROLL))


def test_gurobi_stopped_by_an_interrupt_gives_no_result(monkeypatch) -> None:
    gurobipy = pytest.importorskip("gurobipy")
    raised = []

    def interrupt(model, where) -> None:
        if where == gurobipy.GRB.Callback.MIPNODE and not raised:
            raised.append(where)
            signal.raise_signal(signal.SIGINT)

    class Model(gurobipy.Model):
        def optimize(self) -> None:
            super().optimize(interrupt)

    monkeypatch.setattr(gurobipy, "Model", Model)
    with pytest.raises(KeyboardInterrupt):
        solver("gurobi").solve(flip(FLIP_ROLL))
    assert raised


def test_an_interrupt_that_was_swallowed_within_is_raised_at_the_end() -> None:
    def swallow() -> None:
        with interrupts_kept(), suppress(KeyboardInterrupt):
            signal.raise_signal(signal.SIGINT)

    with pytest.raises(KeyboardInterrupt):
        swallow()
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler


def test_a_handler_of_ones_own_that_raises_nothing_interrupts_nothing() -> None:
    seen = []
    before = signal.signal(signal.SIGINT, lambda signum, frame: seen.append(signum))
    try:
        with interrupts_kept():
            signal.raise_signal(signal.SIGINT)
    finally:
        signal.signal(signal.SIGINT, before)
    assert seen == [signal.SIGINT]


def test_solves_in_other_threads_leave_signals_alone() -> None:
    handlers = []

    def work() -> None:
        with interrupts_kept():
            handlers.append(signal.getsignal(signal.SIGINT))

    thread = threading.Thread(target=work)
    thread.start()
    thread.join()
    assert handlers == [signal.getsignal(signal.SIGINT)]
