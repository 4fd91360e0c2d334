"""Certificates against dense sampling: random flights in 3D, 4 and 6 rotors, margins of -20 to +20 %.

    uv run python benchmarks/certificate.py [--trajectories N] [--points N] [--lags]

A certificate fails if it accepts what a sample refutes, or refuses what has a margin of 1 % of a rotor's
range in all samples, attitude determined. With --lags the rotors lag, and commands are judged too, samples of
them by differences that are good for 1e-6. The flights are those that the tests take a few of. What it
refuses it either refutes, by a violation with its time, or says that it cannot decide.
"""

import argparse
import os
import sys
import time
from dataclasses import dataclass
from pathlib import Path

os.environ["OPENBLAS_NUM_THREADS"] = "1"
sys.path.append(str(Path(__file__).parents[1] / "tests"))

import numpy as np

from aerobat.certification import Certificate, Verdict, certify
from random_flights import certified_margin, random_flight, sampled

ENOUGH = 0.01  # of a rotor's range: a margin that must be certified
SAMPLED = 1e-6  # of a rotor's range: what samples are good for


@dataclass(frozen=True)
class Row:
    """One flight, certified and sampled."""

    outcome: str  # "accepted", "refuted" or "undecided"
    margin: float  # proven, in ranges
    sampled: float
    determined: bool
    seconds: float

    @property
    def wrongly_accepted(self) -> bool:
        """A sample is outside, or without an attitude."""
        return self.outcome == "accepted" and not self.flyable(-SAMPLED)

    @property
    def wrongly_refused(self) -> bool:
        """All samples are well inside."""
        return self.outcome != "accepted" and self.flyable(ENOUGH)

    def flyable(self, margin: float) -> bool:
        """Whether all samples have an attitude and this margin."""
        return self.determined and self.sampled >= margin


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--trajectories", type=int, default=1000, help="random flights (1000)")
    parser.add_argument("--points", type=int, default=100_000, help="samples of each (100000)")
    parser.add_argument("--lags", action="store_true", help="rotors lag behind their commands")
    options = parser.parse_args()
    judge(0, 1000, options.lags)  # a warm-up
    rows = [judge(seed, options.points, options.lags) for seed in range(options.trajectories)]
    print(f"{len(rows)} trajectories, {options.points} samples each; the floor: 0, 0, 50 ms at the median")
    print(f"wrong acceptances, refuted by a sample            {sum(row.wrongly_accepted for row in rows):4}")
    print(f"wrong refusals, of a margin of 1 % in all samples {sum(row.wrongly_refused for row in rows):4}")
    near = sum(row.outcome != "accepted" and row.flyable(0.0) for row in rows)
    print(f"refusals of any margin in all samples             {near:4}")
    gaps = [row.sampled - row.margin for row in rows if row.outcome == "accepted"]
    print(f"sampled less proven margin of what is accepted    {min(gaps):.0e} to {max(gaps):.0e} ranges")
    report("all", rows)
    for outcome in ("accepted", "refuted", "undecided"):
        report(outcome, [row for row in rows if row.outcome == outcome])


def report(name: str, rows: list[Row]) -> None:
    """How many there are, and how long they took."""
    if not rows:
        print(f"{name:9} {0:5}")
        return
    took = [1e3 * row.seconds for row in rows]
    median, tail, longest = np.percentile(took, [50, 95, 100])
    print(
        f"{name:9} {len(rows):5}: {median:5.1f} ms at the median, {tail:5.1f} at 95 %, {longest:5.1f} at most"
    )


def judge(seed: int, points: int, lags: bool) -> Row:
    flight = random_flight(seed, lags)
    began = time.perf_counter()
    certificate = certify(flight.trajectory, flight.vehicle, flight.environment)
    seconds = time.perf_counter() - began
    found = sampled(flight, points)
    margin = certified_margin(flight, certificate)
    return Row(outcome(certificate), margin, found.margin, found.determined, seconds)


def outcome(certificate: Certificate) -> str:
    if certificate.certified:
        return "accepted"
    violated = any(finding.verdict is Verdict.VIOLATED for finding in certificate.findings)
    return "refuted" if violated or certificate.discontinuities else "undecided"


if __name__ == "__main__":
    main()
