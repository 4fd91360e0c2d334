"""Wind: a mean, and Dryden turbulence (MIL-F-8785C, 3.7.1.2).

Let T = L/V, and σ² be the variance of a component. With white noise as input, the forming filters are

    along the mean wind     σ √(2T) / (1 + T s);
    across it, vertical     σ √T (1 + √3 T s) / (1 + T s)² = σ √T (√3/(1 + T s) + (1 − √3)/(1 + T s)²).

The second is a sum of two first-order filters in series, so both are solved exactly from tick to tick.
"""

from __future__ import annotations

from typing import NamedTuple

from aerobat.kernels.ops import Scalar, Vector
from aerobat.kernels.vectors import add

_FIRST = 1.7320508075688772  # √3, weight of the first filter in a component across
_SECOND = 1.0 - _FIRST  # weight of the second filter


class GustState(NamedTuple):
    """State of the forming filters, in units of the intensity."""

    along: Scalar
    across: tuple[Scalar, Scalar]  # of the first filter and the second
    vertical: tuple[Scalar, Scalar]


class GustNoise(NamedTuple):
    """Independent standard normals of a tick."""

    along: Scalar
    across: tuple[Scalar, Scalar]
    vertical: tuple[Scalar, Scalar]


class GustFilter(NamedTuple):
    """The filters' exact steps over one period."""

    decay: Scalar  # e^(−dt/T)
    coupling: Scalar  # dt/T e^(−dt/T), of the first filter into the second
    along: Scalar  # gain of the input
    # gains of the inputs: lower triangle of the square root of a covariance
    across: tuple[Scalar, Scalar, Scalar]


class WindParameters(NamedTuple):
    """Wind about one vehicle."""

    mean: Vector  # [m/s] world
    along: tuple[Scalar, Scalar]  # horizontal unit vector
    intensity: Scalar  # [m/s]
    filter: GustFilter
    start: GustState


class WindState(NamedTuple):
    """The wind velocity, and the state of its filters."""

    velocity: Vector  # [m/s] of the air, world
    gust: GustState


def init(parameters: WindParameters) -> WindState:
    """Return the wind at the start."""
    return _shown(parameters, parameters.start)


def step(parameters: WindParameters, state: WindState, noise: GustNoise) -> WindState:
    """Return the wind one period later."""
    forming, gust = parameters.filter, state.gust
    return _shown(
        parameters,
        GustState(
            forming.decay * gust.along + forming.along * noise.along,
            _second_order(forming, gust.across, noise.across),
            _second_order(forming, gust.vertical, noise.vertical),
        ),
    )


def _second_order(
    forming: GustFilter, filters: tuple[Scalar, Scalar], noise: tuple[Scalar, Scalar]
) -> tuple[Scalar, Scalar]:
    first, second = filters
    a, b, c = forming.across
    return (
        forming.decay * first + a * noise[0],
        forming.decay * second + forming.coupling * first + b * noise[0] + c * noise[1],
    )


def _shown(parameters: WindParameters, gust: GustState) -> WindState:
    along = parameters.intensity * gust.along
    across, vertical = (
        parameters.intensity * (_FIRST * first + _SECOND * second)
        for first, second in (gust.across, gust.vertical)
    )
    x, y = parameters.along
    return WindState(add(parameters.mean, (x * along - y * across, y * along + x * across, vertical)), gust)
