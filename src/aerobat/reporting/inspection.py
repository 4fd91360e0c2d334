"""Facts and figure of an inspection: a flight's position error and the part of each cause."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np

from aerobat.arrays import Array
from aerobat.declaration import validated
from aerobat.reporting.facts import Fact, Facts, facts, line, picture, record
from aerobat.reporting.page import blank_page, column, heading, house_style
from aerobat.reporting.style import BLUE, FAINT, INK, RED
from aerobat.studies.inspection import CAUSES, ErrorShare, Inspection

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


@facts.register
def _(found: Inspection) -> Iterator[Fact]:
    yield Fact("verdict", found.verdict, text=found.verdict)
    yield from record(
        cause=found.cause,
        fault=None if found.fault is None else found.fault.cause,
        max_position_error_m=found.largest,
        time_s=found.time,
    )
    yield Fact("shares", found.shares, "shares")
    yield from (line("", remark) for remark in found.remarks)
    place = found.alignment
    yield from record(
        command_delay_s=found.delay,
        saturated_fraction=found.saturated,
        has_observer=found.observed,
        alignment=Facts(
            record(
                time_shift_s=place.time_shift,
                yaw_deg=float(np.rad2deg(place.yaw)),
                translation_m=place.translation,
                misfit_m=place.misfit,
            )
        ),
    )


@facts.register
def _(share: ErrorShare) -> Iterator[Fact]:
    yield Fact("cause", share.cause, "cause", CAUSES[share.cause][0])
    yield Fact("error_m", share.error, "error", f"{100 * share.error:+.1f} cm")
    felt = f"from {share.begin:.2f} to {share.end:.2f} s" if share.is_felt else ""
    yield Fact("begin_s", share.begin, "felt", felt)
    yield Fact("end_s", share.end)


@validated
def inspection_figure(inspection: Inspection) -> Figure:
    """Draw a flight's position error, and below it each cause's part along the largest error.

    The main cause is red; a line marks the time of the largest error.
    """
    with house_style():
        count = len(inspection.shares)
        height = 2.9 + 1.2 * count  # [in] of the whole error, and of each cause with its name
        figure = blank_page(height, "What caused the error", [inspection.verdict])
        whole, *rows = column(figure, height, [2.3, *[1.0] * count])
        heading(whole, "Position error", "[cm] distance from the set-point")
        _draw(whole, inspection, np.linalg.norm(inspection.error, axis=1), INK)
        direction = inspection.direction
        parts = {name: errors @ direction for name, errors in inspection.errors.items()}
        limit = 110.0 * max(float(np.abs(part).max()) for part in parts.values()) + 1e-3
        for share, axes in zip(inspection.shares, rows, strict=True):
            colour = RED if share.cause == inspection.cause else BLUE
            heading(axes, "", str(share))
            _draw(axes, inspection, parts[share.cause], colour)
            axes.set_ylim(-limit, limit)
            axes.tick_params(labelbottom=axes is rows[-1])
        axes.set_xlabel("time [s]")
    return figure


picture.register(Inspection, inspection_figure)


def _draw(axes: Axes, inspection: Inspection, error: Array, colour: str) -> None:
    axes.plot(inspection.times, 100.0 * error, color=colour)
    axes.axvline(inspection.time, color=FAINT, linewidth=0.9)
    axes.set_xlim(inspection.times[0], inspection.times[-1])
