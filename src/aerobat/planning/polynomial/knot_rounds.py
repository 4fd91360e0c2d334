"""Rounds of the free-knots planner: the box, the samples and the reserve that each solve begins with."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from aerobat.planning.polynomial.knot_samples import ConstraintViolation, Samples
from aerobat.planning.warm_start import WarmStart

COARSE = 2  # segments to begin with
SAMPLES = 25  # of each of them at first
FINE_SAMPLES = 16  # of each of more segments
BOX = 1.0  # the first box of few segments, see KnotVariables
FINE_BOX = 0.25  # of more
REPAIR_BOX = 0.1  # the largest where only excess is to be mended
LEAST_BOX = 1e-3
RESERVE = 1e-4  # of every limit's range, kept at samples at first
TOLERATED = 0.1  # of a limit's range: an excess between samples that the next round can begin with
UNSOLVED = 0.01  # the same, of what the solver leaves violated at samples
SOLVED = 1e-4  # the same, where only excess is to be mended
NEARLY = 0.015  # the same, that a larger reserve makes up for
MENDED = 0.02  # the same, with which a round that gains little tells that little is left to gain
GAIN = 2e-3  # of the duration: little
LOSS = 0.01  # of the duration: more than mending costs


@dataclass
class Round:
    """What one solve begins from."""

    guess: WarmStart
    excess: ConstraintViolation
    samples: Samples
    box: float
    largest_box: float
    reserve: float
    repairing: bool = False  # little is left to gain: what is exceeded is mended, nearby

    @classmethod
    def first(cls, guess: WarmStart, excess: ConstraintViolation, reserve: float) -> Round:
        """To begin with: few samples and a large box; more of them, and a smaller one, of many segments."""
        segments = guess.trajectory.segments
        count, box = (SAMPLES, BOX) if segments <= COARSE else (FINE_SAMPLES, FINE_BOX)
        return cls(guess, excess, (np.linspace(0.0, 1.0, count),) * segments, box, box, RESERVE + reserve)

    @property
    def usable(self) -> bool:
        """Whether other rounds can begin with its guess."""
        return self.excess.worst <= TOLERATED

    @property
    def spent(self) -> bool:
        """Whether no box is left in which an answer would do."""
        return self.box < LEAST_BOX

    def takes(self, guess: WarmStart, excess: ConstraintViolation, violation: float) -> bool:
        """Go on from an answer if it will do, else in a smaller box; either way with more samples."""
        self.samples = excess.joined(self.samples)
        before, gain = self.excess.worst, 1.0 - guess.trajectory.duration / self.guess.trajectory.duration
        unsolved = SOLVED if self.repairing else UNSOLVED
        worse = excess.worst > max(TOLERATED, 0.9 * before) or violation > max(unsolved, 0.9 * before)
        if worse or (before < NEARLY and gain < -LOSS):
            self.largest_box, self.box = self.box / 2.0, self.box / 4.0
            return False
        self.guess, self.excess, self.box = guess, excess, min(2.0 * self.box, self.largest_box)
        self.repairing = self.repairing or (before < MENDED and gain < GAIN)
        if self.repairing:
            self.box = self.largest_box = min(self.box, REPAIR_BOX)
            self.reserve += excess.worst / 2.0 if 0.0 < excess.worst < NEARLY else 0.0
        return True
