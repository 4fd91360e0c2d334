"""States of bodies, as arrays (..., 3) and as leaves of components that kernels read."""

from __future__ import annotations

from aerobat.engines.pytree import components, from_components
from aerobat.kernels.rigid_body import Body
from aerobat.states import BodyState


def bodies(state: BodyState) -> Body:
    """A state with leaves of components."""
    return Body(*(components(part) for part in vars(state).values()))


def body_states(body: Body) -> BodyState:
    """The inverse of `bodies`."""
    return BodyState(*(from_components(part) for part in body))
