"""The paper's hardware experiment (IV-B, Fig. 6): how much does each of its four causes of error cost?

A hexarotor flies the half-flip at 8 m/s through gates at 90°, 75°, 60° and 45°, of three openings, in the
paper's flight space. The authors name four causes of what it then was off its path by. Each is switched on
alone, then all together, on the same flights. `examples/paper_figures.py` draws the figure alone.
"""

import sys
from pathlib import Path

import numpy as np

import aerobat as ab
from paper.gates import hardware_figure
from paper.hardware import OPENINGS, TILTS, hardware_causes

HEADINGS = (
    "",
    "plan s",
    "error cm",
    "95 % cm",
    "cost cm (95 %)",
    "at gate cm",
    "at gate °",
    "clear cm",
    "saturated %",
    *(f"{width:g}×{height:g} m %" for width, height in OPENINGS),
)


def table(causes: ab.ErrorCauses) -> list[tuple[str, ...]]:
    """A row a trial: its name, errors, its cost with 95 % interval, the share that passes each opening."""
    rows = []
    for result in causes.results:
        cost = causes.cost(result.cause)
        rows.append(
            (
                result.cause,
                f"{result.plan.duration:.2f}",
                f"{100 * np.median(result.position_error):.1f}",
                f"{100 * np.quantile(result.position_error, 0.95, method='higher'):.1f}",
                f"{100 * cost.median:.1f} ({100 * cost.low:.1f} to {100 * cost.high:.1f})",
                f"{100 * np.median(result.gate_error):.1f}",
                f"{np.median(result.gate_attitude_error):.1f}",
                f"{100 * np.median(result.clearance):.1f}",
                f"{100 * result.scores.saturated_fraction.mean():.0f}",
                *(f"{100 * result.cleared_opening(*opening).fraction:.1f}" for opening in OPENINGS),
            )
        )
    return rows


def main(folder: str = "hardware-experiment", flights: str = "100", jerk: str = "120") -> None:
    """Measure, print a table a tilt, draw the figure."""
    out = Path(folder)
    out.mkdir(parents=True, exist_ok=True)
    measured = {tilt: hardware_causes(tilt, int(flights), float(jerk)) for tilt in TILTS}
    for tilt, causes in measured.items():
        print(
            f"α = {tilt}°, {causes.none.scores.passages[0].speed.mean():.1f} m/s, {len(causes)} flights a row"
        )
        rows = [HEADINGS, *table(causes)]
        widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
        for name, *cells in rows:
            padded = (cell.rjust(width) for cell, width in zip(cells, widths[1:], strict=True))
            print(f"  {name:{widths[0]}}  {'  '.join(padded)}")
    (out / "fig-6-hardware-experiment.png").write_bytes(hardware_figure(measured).png)


if __name__ == "__main__":
    main(*sys.argv[1:])
