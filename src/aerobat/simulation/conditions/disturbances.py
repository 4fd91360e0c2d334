"""The loop's components that act on the plant: wind with gusts, and a battery that sags."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from aerobat.arrays import Array
from aerobat.engines.engine import Coded
from aerobat.engines.pytree import Tree
from aerobat.kernels import battery, wind
from aerobat.kernels.battery import BatteryParameters, BatteryState
from aerobat.kernels.ops import Ops
from aerobat.kernels.wind import GustNoise, WindParameters, WindState
from aerobat.simulation.conditions.draw import Draws
from aerobat.simulation.conditions.random_source import RandomSource
from aerobat.simulation.loop import Signals


@dataclass(frozen=True)
class Wind:
    """The wind, held from one step to the next; the plant and the accelerometer feel it."""

    period: int = 1
    feedthrough: bool = True

    def init(self, ops: Ops, parameters: WindParameters, noise: GustNoise, signals: Signals) -> WindState:
        """See `Component.init`."""
        return wind.init(parameters)

    def step(
        self, ops: Ops, parameters: WindParameters, state: WindState, noise: GustNoise, signals: Signals
    ) -> WindState:
        """See `Component.step`."""
        return wind.step(parameters, state, noise)


class WindSource:
    """Random numbers of gusts."""

    per_vehicle = True

    def __init__(self, draws: Draws, period: int) -> None:
        """Prepare to draw, for a component that steps at every so many ticks."""
        self._numbers = RandomSource(draws.stream("wind"), normals=5, period=period, block=32)

    def chunk(self, begin: int, end: int) -> Tree:
        """See `Source.chunk`; a GustNoise."""

        def noise(x: Sequence[Coded], _: Array) -> GustNoise:
            return GustNoise(x[0], (x[1], x[2]), (x[3], x[4]))

        return self._numbers.inputs(begin, end, noise)


@dataclass(frozen=True)
class BatterySag:
    """The battery, emptied by the rotors' thrusts; the plant's ceilings are what it leaves of them."""

    period: int = 1
    feedthrough: bool = True

    def init(
        self, ops: Ops, parameters: BatteryParameters, inputs: tuple[()], signals: Signals
    ) -> BatteryState:
        """See `Component.init`."""
        return battery.init(parameters)

    def step(
        self,
        ops: Ops,
        parameters: BatteryParameters,
        state: BatteryState,
        inputs: tuple[()],
        signals: Signals,
    ) -> BatteryState:
        """See `Component.step`."""
        return battery.step(ops, parameters, state, signals.plant.thrusts, signals.clock.elapsed)
