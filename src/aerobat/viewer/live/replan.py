"""Planning and flying anew for sliders that were moved, one question at a time, and the verdict in words."""

from __future__ import annotations

import threading
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field, replace
from typing import Any

from aerobat.errors import AerobatError, Infeasible
from aerobat.flatness import vehicle_of
from aerobat.optimization.deadline import within_time
from aerobat.planning import Plan, nominal_flight, plan
from aerobat.simulation import Flight, fly
from aerobat.viewer.document import packed
from aerobat.viewer.live.sliders import Setting, Slider, moved
from aerobat.viewer.scene import Scene, scene_of

MAX_PAGES = 1000  # whose last questions are known: a browser has fewer open

PATIENCE = 30.0  # [s] of planning: whoever moves a slider waits no longer
FLIGHTS = 20  # under conditions: enough to see how they spread, few enough to be drawn quickly
POSES = 6000  # that are shown of all flights together, each some 7 ms of a flip: many would be drawn late
KEPT = 32  # plans: sliders are moved to and fro


class Superseded(Exception):
    """The sliders were moved again meanwhile."""


@dataclass(frozen=True)
class Answer:
    """The verdict on a setting in words, and its scene; None where there is no plan."""

    word: str
    sentence: str
    is_well: bool
    scene: Scene | None = None

    @property
    def verdict(self) -> dict[str, Any]:
        """The words as plain data for the page."""
        return {"word": self.word, "sentence": self.sentence, "is_well": self.is_well}

    def record(self) -> dict[str, Any]:
        """All of it as plain data for the page."""
        return {"verdict": self.verdict, "scene": None if self.scene is None else packed(self.scene)}


@dataclass
class Replanner:
    """Plans and flies a maneuver for wherever its sliders stand; plans are kept while they may come back."""

    setting: Setting
    sliders: Sequence[Slider]
    plans: dict[tuple[Any, ...], Plan] = field(default_factory=dict)

    def answer(self, values: Mapping[str, float], is_superseded: Callable[[], bool]) -> Answer:
        """Answer sliders that were moved, by their keys. Raises Superseded once they are moved again."""
        try:
            setting = moved(self.setting, self.sliders, values)
            planned = self.plan(setting, is_superseded)
            return judged(planned, flown(planned, setting))
        except Infeasible as error:
            return Answer("Infeasible", _capitalized(error.sentence), False)
        except AerobatError as error:
            return Answer("Refused", _capitalized(str(error)), False)

    def plan(self, setting: Setting, is_superseded: Callable[[], bool] = lambda: False) -> Plan:
        """The setting's plan, however it is flown."""
        key = _key(setting)
        if key not in self.plans:
            self.keep(setting, _planned(setting, is_superseded))
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
        return Answer(word, failed[0], False, scene)
    flown = f"; {scene.facts[0]}" if many else ""
    word = "Feasible" if plan.certified else "Not proven"
    return Answer(word, f"{plan.duration:.2f} s, {proof}{flown}", plan.certified, scene)


def _planned(setting: Setting, is_superseded: Callable[[], bool]) -> Plan:
    def look_up(attempt: object) -> None:
        if is_superseded():
            raise Superseded

    with within_time(PATIENCE):
        found = plan(setting.problem, setting.planner, setting.vehicle, look_up)
    return replace(found, attempts=())  # nobody looks at them here


def _capitalized(text: str) -> str:
    return text[:1].upper() + text[1:]


Answering = Callable[[Mapping[str, float], Callable[[], bool]], Answer]


class Desk:
    """Takes questions from many threads and answers them in one thread, one after another.

    A question is given up, before or while it is answered, once the same page has asked another, or nobody
    waits for the answer any more.
    """

    def __init__(self, answering: Answering) -> None:
        self._answering = answering
        self._worker = ThreadPoolExecutor(max_workers=1, thread_name_prefix="aerobat-planning")
        self._last: dict[str, int] = {}  # number of its last question, by the page that asks, the latest last
        self._lock = threading.Lock()
        self._is_closed = False

    def ask(
        self, page: str, number: int, values: Mapping[str, float], has_hung_up: Callable[[], bool]
    ) -> Answer | None:
        """The answer to what a page asks; None where it wants none any more, or all is over.

        Args:
            page: Who asks.
            number: Of its questions, rising: they may come in another order.
            values: Where its sliders stand, by their keys.
            has_hung_up: Whether nobody waits for the answer any more.
        """

        def is_superseded() -> bool:
            return self._is_closed or self._last.get(page, number) > number or has_hung_up()

        with self._lock:  # so that questions are answered in the order in which they are noted
            self._last[page] = max(number, self._last.pop(page, number))
            if len(self._last) > MAX_PAGES:
                del self._last[next(iter(self._last))]
            try:
                answer = self._worker.submit(self._answer, values, is_superseded)
            except RuntimeError:  # closed
                return None
        return answer.result()

    def close(self) -> None:
        """Give up what is being answered, and answer nothing more."""
        self._is_closed = True
        self._worker.shutdown(wait=False)

    def _answer(self, values: Mapping[str, float], is_superseded: Callable[[], bool]) -> Answer | None:
        try:
            return None if is_superseded() else self._answering(values, is_superseded)
        except Superseded:
            return None
