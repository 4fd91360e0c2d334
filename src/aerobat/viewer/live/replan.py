"""Plans and flights for the positions of a live page's sliders, and verdicts on them in words."""

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
PATIENCE = 30.0  # [s] of planning: users who move a slider wait no longer
FLIGHTS = 20  # under conditions: enough to see how they spread, few enough to be drawn quickly
POSES = 6000  # rows shown of all flights together; more would delay the drawing
KEPT = 32  # cached plans: sliders are moved to and fro


class Superseded(Exception):
    """The sliders were moved again before the plan was found."""


@dataclass(frozen=True)
class Answer:
    """The verdict on a setting in words, and its scene, None where there is no plan."""

    word: str
    sentence: str
    is_well: bool
    scene: Scene | None = None

    @property
    def verdict(self) -> dict[str, Any]:
        """The verdict as plain data for the page."""
        return {"word": self.word, "sentence": self.sentence, "is_well": self.is_well}

    def record(self) -> dict[str, Any]:
        """Return verdict and scene as plain data for the page."""
        return {"verdict": self.verdict, "scene": None if self.scene is None else packed(self.scene)}


@dataclass
class Replanner:
    """Plans and flies a maneuver for the positions of its sliders, and caches the plans."""

    setting: Setting
    sliders: Sequence[Slider]
    plans: dict[tuple[Any, ...], Plan] = field(default_factory=dict)

    def answer(self, values: Mapping[str, float], is_superseded: Callable[[], bool]) -> Answer:
        """Return the answer to slider positions, by keys. Raise Superseded once sliders are moved again."""
        try:
            setting = moved(self.setting, self.sliders, values)
            planned = self.plan(setting, is_superseded)
            return judged(planned, flown(planned, setting))
        except Infeasible as error:
            return Answer("Infeasible", _capitalized(error.sentence), False)
        except AerobatError as error:
            return Answer("Refused", _capitalized(str(error)), False)

    def plan(self, setting: Setting, is_superseded: Callable[[], bool] = lambda: False) -> Plan:
        """Return the plan of a setting, from the cache if it is there."""
        key = _key(setting)
        if key not in self.plans:
            self.keep(setting, _planned(setting, is_superseded))
        return self.plans[key]

    def keep(self, setting: Setting, plan: Plan) -> None:
        """Add a plan to the cache, in place of the oldest if the cache is full."""
        if len(self.plans) >= KEPT:
            del self.plans[next(iter(self.plans))]
        self.plans[_key(setting)] = plan


def _key(setting: Setting) -> tuple[Any, ...]:
    """Return the parts of a setting on which its plan depends."""
    return setting.problem, setting.planner, setting.vehicle


def flown(plan: Plan, setting: Setting) -> Flight:
    """Return the undisturbed flight of a plan, or several flights under the setting's conditions."""
    if setting.dispersion == 0.0:
        return nominal_flight(plan.trajectory, vehicle_of(plan, None), plan.problem.surroundings)
    conditions = setting.conditions.scaled(setting.dispersion)
    return fly(plan, conditions=conditions, flights=FLIGHTS)


def judged(plan: Plan, flight: Flight) -> Answer:
    """Return the answer for a plan and its flights: feasible, or what is wrong."""
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


class Desk:
    """Answers the questions of many threads in one worker thread, one after another.

    A question is cancelled, before or during its answer, once the same page has sent another one, or the
    page has closed the connection.
    """

    def __init__(self, answering: Callable[[Mapping[str, float], Callable[[], bool]], Answer]) -> None:
        self._answering = answering
        self._worker = ThreadPoolExecutor(max_workers=1, thread_name_prefix="aerobat-planning")
        self._last: dict[str, int] = {}  # number of its last question, by the page that asks, the latest last
        self._lock = threading.Lock()
        self._is_closed = False

    def ask(
        self, page: str, number: int, values: Mapping[str, float], has_hung_up: Callable[[], bool]
    ) -> Answer | None:
        """Return the answer to a page's question; None if the question is cancelled, or the desk is closed.

        Args:
            page: The name of the page.
            number: The number of the question, which rises on a page; questions may arrive in another order.
            values: The positions of the sliders, by their keys.
            has_hung_up: Returns True once the page has closed the connection.
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
        """Cancel the current question, and answer no further ones."""
        self._is_closed = True
        self._worker.shutdown(wait=False)

    def _answer(self, values: Mapping[str, float], is_superseded: Callable[[], bool]) -> Answer | None:
        try:
            return None if is_superseded() else self._answering(values, is_superseded)
        except Superseded:
            return None
