"""The filter as a loop over time, a row for each instant: a sample ends, a pose is exposed, one arrives."""

from __future__ import annotations

from functools import lru_cache
from typing import NamedTuple

from aerobat.engines.engine import Init, Step
from aerobat.kernels import ekf
from aerobat.kernels.ekf import EkfParameters, EkfState, ImuSample, Pose
from aerobat.kernels.ops import Ops, Scalar, Vector, select_tree

NO_SLOT = -1.0


class FilterParameters(NamedTuple):
    """Parameters of one filter."""

    ekf: EkfParameters
    first_pose: Pose
    first_velocity: Vector  # [m/s] world


class FilterInput(NamedTuple):
    """Inputs of one row, which ends at its instant."""

    elapsed: Scalar  # [s] since the row before
    sample: ImuSample  # of that while
    exposed: Scalar  # slot of the pose that is exposed now, NO_SLOT for none
    arrived: Scalar  # slot of the pose that arrives now, NO_SLOT for none
    measured: Pose  # that pose


class Exposure(NamedTuple):
    """Pose whose measurement has yet to arrive."""

    past: Pose  # the filter's own then, as it is known now
    age: Scalar  # [s]


@lru_cache(maxsize=8)
def filter_loop(slots: int) -> tuple[Init, Step]:
    """The loop for as many poses on their way at once; its rows are the states (see `engines.Compile`)."""

    def init(
        ops: Ops, parameters: FilterParameters, inputs: FilterInput
    ) -> tuple[EkfState, tuple[Exposure, ...]]:
        state = ekf.init(parameters.ekf, parameters.first_pose, parameters.first_velocity)
        return state, (Exposure(parameters.first_pose, 0.0),) * slots

    def step(
        ops: Ops,
        parameters: FilterParameters,
        carry: tuple[EkfState, tuple[Exposure, ...]],
        inputs: FilterInput,
    ) -> tuple[tuple[EkfState, tuple[Exposure, ...]], EkfState]:
        state = ekf.propagate(ops, parameters.ekf, carry[0], inputs.sample, inputs.elapsed)
        predicted = ekf.predict_covariance(ops, parameters.ekf, state)
        exposures = [e._replace(age=e.age + inputs.elapsed) for e in carry[1]]
        past, age = _picked(ops, exposures, inputs.arrived)
        state = ekf.fuse(ops, parameters.ekf, predicted, inputs.measured, past, age, inputs.arrived > NO_SLOT)
        fresh = Exposure(ekf.pose_of(state), 0.0)
        kept = []
        for slot, exposure in enumerate(exposures):
            back = ekf.carried_back(predicted, state, exposure.past, exposure.age)
            kept.append(select_tree(ops, _is_slot(inputs.exposed, slot), fresh, exposure._replace(past=back)))
        return (state, tuple(kept)), state

    return init, step


def _picked(ops: Ops, exposures: list[Exposure], wanted: Scalar) -> Exposure:
    picked = exposures[0]
    for slot, exposure in enumerate(exposures[1:], start=1):
        picked = select_tree(ops, _is_slot(wanted, slot), exposure, picked)
    return picked


def _is_slot(wanted: Scalar, slot: int) -> Scalar:
    """True where a slot is the one that is wanted."""
    return (wanted > slot - 0.5) & (wanted < slot + 0.5)
