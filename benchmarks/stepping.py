"""Vehicle-steps per second of processor time, against other simulators and the processor's peak.

A thousand quadrotors, each with its own mass, inertia, rotors and start, fly flips at 1 kHz. A step is the
trajectory's evaluation, controller, allocation, and one step of RK4 with the rotors' lag. Peers step as many
of their own vehicles at the same rate with the controllers that they ship. Timed are all threads of this
process, after a first run that compiles; medians of RUNS, engines and peers in turn. "A call" is all of
`fly` for one flip; "a step more" is what a longer flight adds, which is compared with peers, whose setup is
not timed either.

With "sensors and filter" each flight draws its vehicle, start and errors, and has an IMU at 1 kHz, motion
capture at 100 Hz and the Kalman filter in its loop, the controller at 500 Hz and 2 ms late; "lab" adds gusts
and a battery. Their floor is 4 M a second.

uv run python benchmarks/stepping.py [RUNS]

Peers that are not installed are left out. MuJoCo is among the tests' dependencies; for the others
uv run --with crazyflow,rotorpy,torch,torchdiffeq,roma python benchmarks/stepping.py
"""

import ctypes
import statistics
import sys
import time
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any
from unittest import mock

import llvmlite.binding as llvm
import numpy as np

import aerobat as ab
from aerobat.engines.llvm import engine as llvm_engine
from aerobat.engines.traced_loop import TracedLoop, trace_loop
from stepping_peers import PEERS, VEHICLES, Peer

ENGINES = ("jax", "jax-float32", "compiled")
CONDITIONS = ("compiled, sensors and filter", "compiled, lab")
FLOORS = {"crazyflow": 20, "RotorPy, batched": 100}
FLIPS = (1, 4)  # in a row, in the shorter and the longer flight
FREE = ("input", "constant")  # operations of a listing that compute nothing
LANES = {"avx512f": 8, "avx2": 4}  # float64 in a register
PORTS = 2  # that add or multiply in one cycle
MULTIPLY = 3  # [cycles] until an integer's product can be multiplied again, on Intel and AMD
PRODUCTS = 100_000_000
CHAIN = """
define i64 @chain(i64 %factor, i64 %count) {
entry:
  br label %loop
loop:
  %left = phi i64 [ %count, %entry ], [ %less, %loop ]
  %product = phi i64 [ %factor, %entry ], [ %next, %loop ]
  %next = mul i64 %product, %factor
  %less = sub i64 %left, 1
  %again = icmp ne i64 %less, 0
  br i1 %again, label %loop, label %exit
exit:
  ret i64 %next
}
"""


def main() -> None:
    runs = int(sys.argv[1]) if len(sys.argv) > 1 else 5
    crew, start = dispersed(ab.load_vehicle("agile-quad"))
    plan = ab.plan(ab.load_problem("flip-roll"), ab.Miqp(), crew[0])
    paths = [in_a_row(plan.trajectory, count) for count in FLIPS]
    flights = {(name, path): flight(path, crew, start, name) for name in ENGINES for path in paths}
    flights |= {(name, path): observed(path, crew[0], name) for name in CONDITIONS for path in paths}
    peers = ready()
    times = measured({**flights, **peers}, runs)

    steps = [len(crew) * (len(path.sample(1000.0)) - 1) for path in paths]
    print(f"| engine | a call, M/s | a step more, M/s | (median of {runs})\n| --- | --- | --- |")
    for name in (*ENGINES[:-1], *CONDITIONS, ENGINES[-1]):
        short, long = (times[name, path] for path in paths)
        speed = (steps[1] - steps[0]) / (long - short)
        print(f"| {name} | {steps[0] / short / 1e6:.2f} | {speed / 1e6:.2f} |")
    against(speed, {peer: peer.vehicles * peer.steps / times[peer] for peer in peers})
    bound(speed, operations(paths[0], crew[0]))


def dispersed(quad: ab.Vehicle) -> tuple[list[ab.Vehicle], ab.BodyState]:
    """A thousand like this one, none quite like another."""
    rng = np.random.default_rng(0)
    crew = [quad]
    while len(crew) < VEHICLES:
        mass, inertia, thrust, lag = rng.uniform(0.95, 1.05, 4)
        rotors = tuple(replace(r, max_thrust=r.max_thrust * thrust, lag=r.lag * lag) for r in quad.rotors)
        crew.append(replace(quad, mass=quad.mass * mass, inertia=quad.inertia * inertia, rotors=rotors))
    scatter = [0.01 * rng.normal(size=(VEHICLES, 3)) for _ in range(3)]
    level = np.tile([1.0, 0.0, 0.0, 0.0], (VEHICLES, 1))
    return crew, ab.BodyState(scatter[0], scatter[1], level, scatter[2])


def in_a_row(trajectory: ab.Trajectory, count: int) -> ab.Trajectory:
    """A flight from rest to rest, again and again from where it ended."""
    start, end = trajectory.evaluate([0.0, trajectory.duration])
    coefficients = np.stack([trajectory.coefficients] * count)
    coefficients[:, :, 0] += np.arange(count)[:, None, None] * (end - start)
    shape = (-1, *trajectory.coefficients.shape[1:])
    return ab.Trajectory(np.tile(trajectory.durations, count), coefficients.reshape(shape))


def flight(
    path: ab.Trajectory, crew: Sequence[ab.Vehicle], start: ab.BodyState, engine: str
) -> Callable[[], object]:
    begin = replace(start, position=start.position + path.evaluate(0.0))
    return lambda: ab.fly(path, crew, start=begin, rate=1000.0, log_rate=1.0, engine=engine)


def observed(path: ab.Trajectory, quad: ab.Vehicle, conditions: str) -> Callable[[], object]:
    """As many flights under conditions, controlled by what a filter makes of sensors."""
    lab = ab.load_dispersion("lab")
    flown = lab if conditions == "compiled, lab" else replace(lab, gusts=None, battery=None)
    return lambda: ab.fly(
        path, quad, conditions=flown, flights=range(VEHICLES), log_rate=1.0, engine="compiled"
    )


def ready() -> dict[Peer, Callable[[], object]]:
    found = {}
    for peer in PEERS:
        try:
            found[peer] = peer.ready(peer.steps)
        except ImportError as missing:
            print(f"{peer.name} is left out: {missing}")
    return found


def measured(jobs: dict[Any, Callable[[], object]], runs: int) -> dict[Any, float]:
    """The median processor time [s] of each job, all in turn, the first run of each not counted."""
    rounds = [{key: seconds(job) for key, job in jobs.items()} for _ in range(runs + 1)][1:]
    return {key: statistics.median(times[key] for times in rounds) for key in jobs}


def seconds(job: Callable[[], object]) -> float:
    began = time.process_time()
    job()
    return time.process_time() - began


def against(speed: float, peers: dict[Peer, float]) -> None:
    print("\n| peer | M/s | compiled is faster | floor | a step of the peer |\n" + "| --- " * 5 + "|")
    for peer, theirs in peers.items():
        floor = f"{FLOORS[peer.name]} ×" if peer.name in FLOORS else "–"
        print(f"| {peer.name} | {theirs / 1e6:.3f} | {speed / theirs:.1f} × | {floor} | {peer.includes} |")


def bound(speed: float, loop: TracedLoop) -> None:
    """How far from a core that does nothing but add and multiply, and always all it can."""
    names = Counter(loop.trace.operations[number].name for number in loop.body)
    count = sum(number for name, number in names.items() if name not in FREE)
    lanes = next((width for flag, width in LANES.items() if flag in cpu_flags()), 2)
    cycles = clock()
    peak = lanes * PORTS * cycles
    print(
        f"\nOne step is {count} operations: "
        + ", ".join(f"{n} {k}" for k, n in names.most_common() if k not in FREE)
    )
    print(f"{speed * count / 1e9:.1f} G operations/s are {speed * count / peak:.0%} of a core's peak of")
    print(
        f"{peak / 1e9:.0f} G: {lanes} lanes × {PORTS} ports × {cycles / 1e9:.2f} GHz as measured, none fused"
    )


def operations(path: ab.Trajectory, quad: ab.Vehicle) -> TracedLoop:
    """What is compiled for a flight."""
    loops = []

    def kept(*given: Any) -> TracedLoop:
        loops.append(trace_loop(*given))
        return loops[-1]

    with mock.patch.object(llvm_engine, "_traced", kept):
        ab.fly(path, quad, rate=1000.0, engine="compiled")
    return loops[0]


def cpu_flags() -> str:
    return Path("/proc/cpuinfo").read_text()


def clock() -> float:
    """Cycles per second, from a chain of products that each wait for the one before."""
    code = llvm.create_mcjit_compiler(llvm.parse_assembly(CHAIN), llvm_engine.target_machine())
    code.finalize_object()
    chain = ctypes.CFUNCTYPE(ctypes.c_int64, ctypes.c_int64, ctypes.c_int64)(
        code.get_function_address("chain")
    )
    times = [seconds(lambda: chain(3, PRODUCTS)) for _ in range(3)]
    return MULTIPLY * PRODUCTS / min(times)


if __name__ == "__main__":
    main()
