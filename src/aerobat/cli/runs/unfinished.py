"""The folder that keeps the finished parts of an unfinished study, beside the folder of its results."""

from __future__ import annotations

import shutil
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from aerobat.cli.runs.record import RECORD, beside
from aerobat.cli.terminal import say
from aerobat.storage import require_replaceable
from aerobat.studies.kept import is_kept_file
from aerobat.studies.workers import WorkerEnded

PARTS = "finished"  # the folder of the finished parts
PLAN = "sweep.plan"  # what a sweep flies


@dataclass(frozen=True)
class Unfinished:
    """The folder that an unfinished study keeps beside the one that its results will be written to."""

    folder: Path

    @classmethod
    def beside(cls, folder: Path) -> Unfinished:
        """Return the unfinished study whose results will be written to a folder.

        Raises SpecError where its own folder holds what no study wrote, since that folder is removed.
        """
        found = cls(beside(folder, "-unfinished"))
        require_replaceable(found.folder, (PARTS, PLAN, RECORD).__contains__)
        require_replaceable(found.parts, is_kept_file)
        return found

    @property
    def parts(self) -> Path:
        """The folder of the finished parts."""
        return self.folder / PARTS

    @contextmanager
    def kept(self, what: str, count: int, finished: Callable[[Path], int]) -> Iterator[int]:
        """Give the number of parts that an earlier run kept, say it, and remove the folder after the block.

        If the block ends early, the parts that are kept by then are reported.

        Args:
            what: The name of the parts.
            count: The number of all parts.
            finished: Returns the number of these parts in a folder, which may hold others.
        """
        already = finished(self.parts)
        if already:
            say(f"goes on from {already} of {count} {what}, which are kept")
        try:
            yield already
        except BaseException as error:
            done = finished(self.parts)
            if not done:
                self._remove()
            elif isinstance(error, KeyboardInterrupt | WorkerEnded):
                say(f"{done} of {count} {what} are kept: the same command goes on from there")
            raise
        self._remove()

    def _remove(self) -> None:
        shutil.rmtree(self.folder, ignore_errors=True)
