"""Values in notebooks: the tables of a terminal as HTML, above them the pictures of reports."""

from __future__ import annotations

from base64 import b64encode
from functools import lru_cache
from io import StringIO
from typing import TYPE_CHECKING, Any

from rich.console import Console
from rich.table import Table

from aerobat.certification import Certificate
from aerobat.errors import SpecError
from aerobat.evaluation.score import Score
from aerobat.planning import Plan
from aerobat.reporting.comparison import comparison_figure, comparison_table
from aerobat.reporting.feasibility.figure import map_figure
from aerobat.reporting.feasibility.table import map_table
from aerobat.reporting.figures import draw
from aerobat.reporting.page import png as png_of
from aerobat.reporting.sweeps.figure import sweep_figure
from aerobat.reporting.sweeps.table import sweep_table
from aerobat.reporting.sweeps.tuning import tuning_table
from aerobat.reporting.tables import certificate_table, facts_table, flight_facts, plan_facts
from aerobat.simulation import Flight
from aerobat.studies.compare import Comparison
from aerobat.studies.feasibility import FeasibilityMap
from aerobat.studies.sweep import Sweep
from aerobat.studies.tune import Tuning

if TYPE_CHECKING:
    from matplotlib.figure import Figure

COLUMNS = 120  # letters to a line of a table
PRE = '<pre style="line-height: 1.3; overflow-x: auto">{code}</pre>'
KEPT = 8  # pictures: a notebook asks for one twice


def html(value: Any) -> str:
    """HTML of a plan, a flight, a score, a certificate, a comparison, a sweep, a map or a tuning."""
    console = Console(record=True, file=StringIO(), width=COLUMNS, force_jupyter=False)
    console.print(_table(value))
    text = console.export_html(inline_styles=True, code_format=PRE)
    picture = png(value)
    if picture is None:
        return text
    encoded = b64encode(picture).decode()
    return f'<img style="max-width: 100%" src="data:image/png;base64,{encoded}">{text}'


@lru_cache(maxsize=KEPT)
def png(value: Any) -> bytes | None:
    """The picture of a value as PNG; None where it has none, or what is to be drawn is not known."""
    try:
        figure = _figure(value)
    except SpecError:  # a plan without a vehicle, a flight of one that is no preset
        return None
    return None if figure is None else png_of(figure)


def _table(value: Any) -> Table:
    """The facts, a row each."""
    if isinstance(value, Plan):
        vehicle = "" if value.vehicle is None else f" · {value.vehicle.name}"
        return facts_table(f"{value.problem.name}{vehicle}", {"plan": plan_facts(value)})
    if isinstance(value, Score):
        return facts_table("", {"flight": flight_facts(value)})
    if isinstance(value, Certificate):
        return certificate_table(value, "certificate")
    if isinstance(value, Comparison):
        return comparison_table(value)
    if isinstance(value, Sweep):
        return sweep_table(value)
    if isinstance(value, FeasibilityMap):
        return map_table(value)
    if isinstance(value, Tuning):
        return tuning_table(value)
    return facts_table(str(value), {})


def _figure(value: Any) -> Figure | None:
    """The picture; None of what has none."""
    if isinstance(value, Comparison):
        return comparison_figure(value)
    if isinstance(value, Sweep):
        return sweep_figure(value)
    if isinstance(value, FeasibilityMap):
        return map_figure(value)
    return draw(value) if isinstance(value, Plan | Flight) else None
