"""The look of figures: one family of colours, one set of sizes, for screen and paper alike."""

from __future__ import annotations

from typing import Any

# Blue, yellow and red tell apart in any kind of colour vision and in grey (Paul Tol's high-contrast scheme,
# the red made stronger); all else is a shade of one slate. Yellow is a gate; red says that something is
# wrong, and nothing else.
BLUE = "#004488"
YELLOW = "#ddaa33"
RED = "#c8334e"
SKY = "#6fa3d4"  # a light blue
INK = "#1c2b39"
MUTED = "#66788a"
FAINT = "#a9b6c2"
HAIR = "#dfe6ec"
PAPER = "#f5f7f9"
BAND = "#b4c8dd"  # a reference path, wide enough to show on both sides of the actual one

SMALL = 7.5  # [pt]
NORMAL = 8.5
TITLE = 9.5
HEADLINE = 15.0

RC: dict[str, Any] = {
    "font.family": "sans-serif",
    "font.sans-serif": ["DejaVu Sans"],
    "font.size": NORMAL,
    "text.hinting": "none",  # as their font has letters: 140 dots an inch need no fitting
    "mathtext.fontset": "dejavusans",
    "text.usetex": False,
    "text.color": INK,
    "figure.facecolor": "white",
    "axes.facecolor": "white",
    "axes.edgecolor": FAINT,
    "axes.linewidth": 0.8,
    "axes.labelcolor": INK,
    "axes.labelsize": NORMAL,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "axes.axisbelow": True,
    "axes.formatter.useoffset": False,
    "grid.color": HAIR,
    "grid.linewidth": 0.7,
    "grid.linestyle": "-",
    "xtick.color": FAINT,
    "ytick.color": FAINT,
    "xtick.labelcolor": INK,
    "ytick.labelcolor": INK,
    "xtick.labelsize": SMALL,
    "ytick.labelsize": SMALL,
    "lines.linewidth": 1.3,
    "lines.solid_capstyle": "round",
    "legend.frameon": False,
    "legend.fontsize": SMALL,
    "savefig.bbox": None,
    "savefig.facecolor": "auto",
    "pdf.fonttype": 42,
    "svg.hashsalt": "aerobat",
}
