"""A gate's plane as seen by an upright vehicle that passes it: the opening, and where flights crossed."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from aerobat.arrays import Array, Mask
from aerobat.evaluation import Opening
from aerobat.problem.gate import Gate
from aerobat.reporting.page import set_scale, size_of, write_by
from aerobat.reporting.style import BLUE, FAINT, INK, MUTED, PAPER, RED, SMALL, YELLOW

if TYPE_CHECKING:
    from matplotlib.axes import Axes

RINGS = (0.5, 0.95)  # fractions of the crossings that circles hold


@dataclass(frozen=True, eq=False)
class Crossings:
    """The points at which flights crossed a gate's plane."""

    gate: Gate
    right: Array  # [m] of the opening's centre, NaN where a flight did not cross, (flights,)
    up: Array  # [m] likewise, (flights,)
    wrong: Mask  # true for those that did not pass as they should, (flights,)
    smallest: Opening | None  # the opening of this kind that 99 % pass, if known

    @property
    def crossed(self) -> Mask:
        """True for flights that crossed the plane."""
        return np.asarray(np.isfinite(self.right))

    @property
    def rings(self) -> list[float]:
        """Radii [m] of circles about the opening's centre that hold RINGS of the crossings."""
        distance = np.hypot(self.right, self.up)[self.crossed]
        if not len(distance):
            return [0.0] * len(RINGS)
        return [float(np.quantile(distance, part, method="higher")) for part in RINGS]

    @property
    def note(self) -> str:
        """The number of crossings, and of flights without one, in words."""
        missing = int((~self.crossed).sum())
        text = f"{int(self.crossed.sum())} crossings"
        return text + (f", {missing} without one" if missing else "")


def draw_opening(axes: Axes, crossings: Crossings) -> None:
    """Draw a gate's frame with all crossings, to one scale along both axes [m]."""
    from matplotlib.patches import Polygon

    opening = crossings.gate.opening
    outline = opening.outline * [-1.0, 1.0]  # to the right
    axes.add_patch(Polygon(outline, facecolor=PAPER, edgecolor="none", zorder=0.2))
    axes.add_patch(Polygon(outline, fill=False, edgecolor=YELLOW, linewidth=3.0, zorder=1.5))
    if crossings.smallest is not None:
        needed = outline * [crossings.smallest.width, crossings.smallest.height] / opening.size
        axes.add_patch(Polygon(needed, fill=False, edgecolor=INK, linewidth=0.9, linestyle=(0, (4, 2))))
    half = np.abs(outline).max(axis=0) * 1.3
    off = np.nanmax(np.abs([crossings.right, crossings.up]), axis=1) if crossings.crossed.any() else half
    half = np.clip(1.05 * off, half, 2.0 * half)
    _draw_crossings(axes, crossings, half, 1.0)
    axes.grid(False)
    axes.set(xlabel="to the right [m]", ylabel="up [m]")


def draw_scatter(axes: Axes, crossings: Crossings) -> None:
    """Draw the crossings by themselves, with circles that hold half and 95 % of them [cm]."""
    from matplotlib.patches import Circle

    radii = [100.0 * radius for radius in crossings.rings]
    half = np.full(2, 1.35 * max(radii[-1], 1e-2))  # somewhat beyond the larger circle
    axes.axhline(0.0, color=FAINT, linewidth=0.8)
    axes.axvline(0.0, color=FAINT, linewidth=0.8)
    for radius, style in zip(radii, ("-", (0, (4, 2))), strict=True):
        ring = Circle((0.0, 0.0), radius, fill=False, edgecolor=INK, linewidth=0.9, linestyle=style)
        axes.add_patch(ring)
    _draw_crossings(axes, crossings, half, 100.0)
    axes.set(xlabel="to the right [cm]", ylabel="up [cm]")


def _draw_crossings(axes: Axes, crossings: Crossings, half: Array, scale: float) -> None:
    """Draw blue and red dots to one scale along both axes, and the number of those beyond the picture.

    Args:
        axes: The axes.
        crossings: The crossings.
        half: Half the least width and height of the picture, in its unit, (2,).
        scale: The units of the picture per metre.
    """
    set_scale(axes, np.zeros(2), 2.0 * float((half / size_of(axes)).max()))
    half = np.array([axes.get_xlim()[1], axes.get_ylim()[1]])
    points = scale * np.column_stack([crossings.right, crossings.up])
    inside = crossings.crossed & (np.abs(np.nan_to_num(points)) <= half).all(axis=1)
    opacity = max(0.18, min(1.0, np.sqrt(64 / max(inside.sum(), 1))))  # of up to 64 dots full
    for where, colour, marker, size in (
        (inside & ~crossings.wrong, BLUE, "o", 8.0),
        (inside & crossings.wrong, RED, "X", 22.0),
    ):
        across, up = points[where].T
        axes.scatter(
            across, up, s=size, marker=marker, color=colour, linewidths=0.0, zorder=2.0,
            alpha=opacity if colour == BLUE else 1.0,
        )  # fmt: skip
    beyond = int((crossings.crossed & ~inside).sum())
    if beyond:
        wrong = bool((crossings.crossed & ~inside & crossings.wrong).any())
        colour = RED if wrong else MUTED
        write_by(axes, f"{beyond} beyond", (0.0, 0.0), (0.08, 0.08), size=SMALL, color=colour, zorder=4)
