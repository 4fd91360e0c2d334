"""Conversions of body states between arrays (..., 3) and the components that kernels read."""

from __future__ import annotations

from aerobat.engines.pytree import components, from_components
from aerobat.kernels.rigid_body import Body
from aerobat.states import BodyState


def bodies(state: BodyState) -> Body:
    """Return a state as components."""
    return Body(*(components(part) for part in vars(state).values()))


def body_states(body: Body) -> BodyState:
    """Return components as a state; the inverse of `bodies`."""
    return BodyState(*(from_components(part) for part in body))
