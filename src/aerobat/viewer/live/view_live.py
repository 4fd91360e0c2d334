"""view_live(): a page with sliders that plan and fly a maneuver again."""

from __future__ import annotations

import threading
import webbrowser
from dataclasses import replace
from typing import Annotated, Any

from pydantic import Field

from aerobat.declaration import validated
from aerobat.environment import Dispersion, as_dispersion
from aerobat.planning import Plan, Planner, as_planner, planner_for, registered_planners
from aerobat.problem import Problem, as_problem
from aerobat.vehicle import Vehicle, as_vehicle
from aerobat.viewer.document import document
from aerobat.viewer.live.replan import Desk, Replanner, flown, judged
from aerobat.viewer.live.server import HOST, LiveServer
from aerobat.viewer.live.sliders import Setting, sliders_of
from aerobat.viewer.replay import inline_frame

VEHICLE = "agile-quad"  # the default

Port = Annotated[int, Field(ge=0, le=65535, description="whole number from 0 to 65535")]


class LiveView:
    """A live page that is served until it is closed; notebooks show it inline."""

    def __init__(self, server: LiveServer) -> None:
        self._server = server
        self._thread = threading.Thread(target=server.serve_forever, name="aerobat-live", daemon=True)
        self._thread.start()

    @property
    def address(self) -> str:
        """The address of the page, on this machine alone."""
        return f"http://{HOST}:{self._server.server_port}/"

    def wait(self) -> None:
        """Wait until the page is closed, or for Ctrl-C."""
        while self._thread.is_alive():
            self._thread.join(0.5)  # [s] not every system lets Ctrl-C end a longer wait

    def close(self) -> None:
        """Stop serving the page, and cancel its planning."""
        self._server.desk.close()
        self._server.shutdown()
        self._server.server_close()

    def __enter__(self) -> LiveView:
        return self

    def __exit__(self, *stop: object) -> None:
        self.close()

    def __repr__(self) -> str:
        return f"LiveView({self.address})"

    def _repr_html_(self) -> str:
        return inline_frame(f'src="{self.address}"')


@validated
def view_live(
    shown: Problem | Plan | str = "flip-roll",
    planner: Planner | str | None = None,
    vehicle: Vehicle | str | None = None,
    conditions: Dispersion | str = "lab",
    port: Port = 0,
    browser: bool = True,
) -> LiveView:
    """Serve a page on which a maneuver is planned and flown anew whenever one of its sliders is moved.

    The scene is that of `view`. Sliders move and tilt gates, move obstacles, say the maneuver's least
    thrusts, the planner's order, the vehicle's thrust-to-weight and how much flights are dispersed; the
    verdict is in words. It is served to this machine alone until it is closed. Raises Infeasible or SpecError
    where there is no plan to begin with, and SpecError for a port that is taken.

    Args:
        shown: What is planned, or its name, or a plan to begin with.
        planner: How to plan, or its name; by default a plan's own, else what suits the problem.
        vehicle: What flies, or its name; by default a plan's own, else agile-quad.
        conditions: What varies from flight to flight, or its name; the slider multiplies it, from 0.
        port: Of 127.0.0.1; 0 for any that is free.
        browser: True to open the page in the browser.
    """
    setting, plan = _begun(shown, planner, vehicle, as_dispersion(conditions))
    replanner = Replanner(setting, sliders_of(setting, plan))
    replanner.keep(setting, plan)
    first = judged(plan, flown(plan, setting))
    controls = {"sliders": [slider.record() for slider in replanner.sliders], "verdict": first.verdict}
    assert first.scene is not None, "a plan has one"
    page = document(first.scene, controls)
    live = LiveView(LiveServer(port, page, Desk(replanner.answer)))
    if browser:
        webbrowser.open(live.address)
    return live


def _begun(
    shown: Problem | Plan | str,
    planner: Planner | str | None,
    vehicle: Vehicle | str | None,
    conditions: Dispersion,
) -> tuple[Setting, Plan]:
    """Return the first setting and its plan."""
    if not isinstance(shown, Plan):
        problem, flyer = as_problem(shown), as_vehicle(vehicle or VEHICLE)
        method = planner_for(problem, flyer) if planner is None else as_planner(planner)
        setting = Setting(problem, method, flyer, conditions)
        return setting, Replanner(setting, ()).plan(setting)
    flyer = as_vehicle(vehicle or shown.vehicle or VEHICLE)
    plan = shown if flyer == shown.vehicle else shown.for_vehicle(flyer)
    own = _planner_of(shown, flyer) if planner is None else as_planner(planner)
    return Setting(shown.problem, own, flyer, conditions), plan


def _planner_of(plan: Plan, vehicle: Vehicle) -> Planner:
    """Return the planner by a plan's name and order; of an imported path, the one that suits its problem."""
    is_known = plan.planner in registered_planners()
    planner = as_planner(plan.planner) if is_known else planner_for(plan.problem, vehicle)
    changes: dict[str, Any] = {"order": plan.order} if hasattr(planner, "order") else {}
    return replace(planner, **changes)  # type: ignore[type-var]
