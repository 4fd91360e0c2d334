"""Planning and flying anew for sliders that were moved, and the verdict in words."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from typing import Any

from aerobat.errors import AerobatError, Infeasible
from aerobat.flatness import vehicle_of
from aerobat.optimization.deadline import within_time
from aerobat.planning import Plan, nominal_flight, plan
from aerobat.simulation import Flight, fly
from aerobat.viewer.document import packed
from aerobat.viewer.live.sliders import Setting, Slider, moved
from aerobat.viewer.scene import Scene, scene_of

PATIENCE = 30.0  # [s] of planning: whoever moves a slider waits no longer
FLIGHTS = 20  # under conditions: enough to see how they spread, few enough to be drawn quickly
POSES = 6000  # that are shown of all flights together, each some 7 ms of a flip: many would be drawn late
KEPT = 32  # plans: sliders are moved to and fro


class Overtaken(Exception):
    """The sliders were moved again meanwhile."""


@dataclass(frozen=True)
class LiveVerdict:
    """An answer in words."""

    word: str
    sentence: str
    is_well: bool


@dataclass(frozen=True)
class Answer:
    """The verdict on a setting, and what there is to see of it; nothing where there is no plan."""

    verdict: LiveVerdict
    scene: Scene | None = None

    def record(self) -> dict[str, Any]:
        """Plain data for the page."""
        shown = None if self.scene is None else asdict(packed(self.scene))
        return {"verdict": asdict(self.verdict), "scene": shown}


@dataclass
class Replanner:
    """Plans and flies a maneuver for wherever its sliders stand; plans are kept while they may come back."""

    setting: Setting
    sliders: Sequence[Slider]
    plans: dict[tuple[Any, ...], Plan] = field(default_factory=dict)

    def answer(self, values: Mapping[str, float], is_overtaken: Callable[[], bool]) -> Answer:
        """The answer to sliders that were moved, by their keys. Raises Overtaken once it is that."""
        try:
            setting = moved(self.setting, self.sliders, values)
            planned = self.plan(setting, is_overtaken)
            return judged(planned, flown(planned, setting))
        except Infeasible as error:
            return Answer(LiveVerdict("Infeasible", _capitalized(error.sentence), False))
        except AerobatError as error:
            return Answer(LiveVerdict("Refused", _capitalized(str(error)), False))

    def plan(self, setting: Setting, is_overtaken: Callable[[], bool] = lambda: False) -> Plan:
        """The setting's plan, however it is flown."""
        key = _key(setting)
        if key not in self.plans:
            self.keep(setting, _planned(setting, is_overtaken))
        return self.plans[key]

    def keep(self, setting: Setting, plan: Plan) -> None:
        """Keep a plan for when its setting comes back, in place of the oldest."""
        if len(self.plans) >= KEPT:
            del self.plans[next(iter(self.plans))]
        self.plans[_key(setting)] = plan


def _key(setting: Setting) -> tuple[Any, ...]:
    """All of a setting that its plan depends on."""
    return setting.problem, setting.planner, setting.vehicle


def flown(plan: Plan, setting: Setting) -> Flight:
    """The flight of a plan as planned, or under conditions, several of them."""
    if setting.dispersion == 0.0:
        return nominal_flight(plan.trajectory, vehicle_of(plan, None), plan.problem.surroundings)
    conditions = setting.conditions.scaled(setting.dispersion)
    return fly(plan, conditions=conditions, flights=FLIGHTS)


def judged(plan: Plan, flight: Flight) -> Answer:
    """The answer where there is a plan: certified and well flown, or why not."""
    scene = scene_of(flight, plan, poses=POSES)
    proof = "" if plan.certificate is None else plan.certificate.why
    failed = [track.sentence for track in scene.tracks if track.failed]
    many = len(scene.tracks) > 1
    if failed:
        word = f"{len(failed)} of {len(scene.tracks)} flights fail" if many else "Planned, but fails"
        return Answer(LiveVerdict(word, failed[0], False), scene)
    flown = f"; {scene.facts[0]}" if many else ""
    word = "Feasible" if plan.certified else "Not proven"
    return Answer(LiveVerdict(word, f"{plan.duration:.2f} s, {proof}{flown}", plan.certified), scene)


def _planned(setting: Setting, is_overtaken: Callable[[], bool]) -> Plan:
    def look_up(attempt: object) -> None:
        if is_overtaken():
            raise Overtaken

    with within_time(PATIENCE):
        found = plan(setting.problem, setting.planner, setting.vehicle, look_up)
    return replace(found, attempts=())  # nobody looks at them here


def _capitalized(text: str) -> str:
    return text[:1].upper() + text[1:]
