"""The process that draws the report draws what the figures draw, and goes away with its owner."""

import pytest

import aerobat as ab
from aerobat.errors import AerobatError
from aerobat.reporting.figures import png, report_figure
from aerobat.reporting.illustrator import Illustrator


def test_the_picture_is_the_figure_byte_for_byte() -> None:
    vehicle, problem = ab.load_vehicle("agile-quad"), ab.load_problem("line")
    plan = ab.plan(problem, vehicle=vehicle)
    page = plan, vehicle, ab.fly(plan.trajectory, vehicle), None
    with Illustrator() as illustrator:
        illustrator.begin(*page)
        assert illustrator.picture() == png(report_figure(*page))


def test_nobody_draws_on_after_an_error() -> None:
    with pytest.raises(ZeroDivisionError), Illustrator() as illustrator:
        raise ZeroDivisionError
    assert illustrator._process.poll() is not None


def test_a_page_that_cannot_be_drawn_is_an_error_with_a_sentence(capfd: pytest.CaptureFixture[str]) -> None:
    with Illustrator() as illustrator:
        illustrator.begin("no plan", "no vehicle", None, None)  # type: ignore[arg-type]
        with pytest.raises(AerobatError, match="could not be drawn"):
            illustrator.picture()
    capfd.readouterr()
