"""One worker that answers one question at a time: of each who asks, the last alone."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from concurrent.futures import ThreadPoolExecutor

from aerobat.viewer.live.replan import Answer, Overtaken

Answering = Callable[[Mapping[str, float], Callable[[], bool]], Answer]


class Desk:
    """Takes questions from many threads and has them answered in one, so that those who ask go on.

    A question that was overtaken by another of the same page is given up, before it is begun or on the way.
    """

    def __init__(self, answering: Answering) -> None:
        self._answering = answering
        self._worker = ThreadPoolExecutor(max_workers=1, thread_name_prefix="aerobat-planning")
        self._last: dict[str, int] = {}  # number of its last question, by the page that asks
        self._is_closed = False

    def ask(self, page: str, number: int, values: Mapping[str, float]) -> Answer | None:
        """The answer to what a page asks; None where it has asked something else meanwhile, or all is over.

        Args:
            page: Who asks.
            number: Of its questions, rising: they may come in another order.
            values: Where its sliders stand, by their keys.
        """
        self._last[page] = max(number, self._last.get(page, number))

        def is_overtaken() -> bool:
            return self._is_closed or self._last[page] > number

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
