"""One worker that answers one question at a time: of each who asks, the last alone."""

from __future__ import annotations

import threading
from collections.abc import Callable, Mapping
from concurrent.futures import ThreadPoolExecutor

from aerobat.viewer.live.replan import Answer, Overtaken

MAX_PAGES = 1000  # whose last questions are known: a browser has fewer open

Answering = Callable[[Mapping[str, float], Callable[[], bool]], Answer]


class Desk:
    """Takes questions from many threads and has them answered in one, so that those who ask go on.

    A question that was overtaken by another of the same page, or that nobody waits for any more, is given up,
    before it is begun or on the way.
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
        with self._lock:
            self._last[page] = max(number, self._last.pop(page, number))
            if len(self._last) > MAX_PAGES:
                del self._last[next(iter(self._last))]

        def is_overtaken() -> bool:
            return self._is_closed or self._last.get(page, number) > number or has_hung_up()

        try:
            answer = self._worker.submit(self._answer, values, is_overtaken)
        except RuntimeError:  # closed
            return None
        return answer.result()

    def close(self) -> None:
        """Give up what is being answered, and answer nothing more."""
        self._is_closed = True
        self._worker.shutdown(wait=False)

    def _answer(self, values: Mapping[str, float], is_overtaken: Callable[[], bool]) -> Answer | None:
        try:
            return None if is_overtaken() else self._answering(values, is_overtaken)
        except Overtaken:
            return None
