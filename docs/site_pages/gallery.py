"""The gallery: every built-in maneuver and those of the examples, planned, flown and replayed for it."""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import aerobat as ab

EXAMPLES = Path(__file__).parents[2] / "examples"
VEHICLE = "agile-quad"  # as the commands take it, but for problems that are made for one
OWN_VEHICLES = {"section-v": "section-v"}
FRAME = '<iframe class="replay" src="{source}" title="{title}" loading="lazy"></iframe>'


@dataclass(frozen=True)
class Exhibit:
    """A problem of the gallery, and how to fly it from a terminal."""

    problem: ab.Problem
    vehicle: str
    command: str


def exhibits() -> Iterator[Exhibit]:
    """The built-in problems, then those of the examples."""
    for name in ab.problem_names():
        vehicle = OWN_VEHICLES.get(name, VEHICLE)
        option = "" if vehicle == VEHICLE else f" --vehicle {vehicle}"
        yield Exhibit(ab.load_problem(name), vehicle, f"aerobat fly {name}{option}")
    for file in sorted(EXAMPLES.glob("*.toml")):
        problem = ab.load_problem(file)
        if problem.name in ab.problem_names():  # a page of that name is there
            problem = replace(problem, name=f"{problem.name}-example")
        yield Exhibit(problem, VEHICLE, f"aerobat fly examples/{file.name}")


def write(folder: Path) -> None:
    """Plan, fly and show all of them: a page each, with its replay, and one that leads to them."""
    pages, replays = folder / "gallery", folder / "extra" / "replays"
    pages.mkdir(parents=True, exist_ok=True)
    replays.mkdir(parents=True, exist_ok=True)
    cards = []
    for exhibit in exhibits():
        name = exhibit.problem.name
        plan = ab.plan(exhibit.problem, vehicle=exhibit.vehicle)
        flight = ab.fly(plan)
        ab.write_replay(flight, replays / f"{name}.html", plan)
        draw(flight, plan, pages / name)
        (pages / f"{name}.md").write_text(page(exhibit, plan, ab.score(flight, plan)), encoding="utf-8")
        picture = f"[![The path of {name}]({name}-path.png){{width=260px}}]({name}.md)"
        text = f"[**{name}**]({name}.md)<br>{exhibit.problem.description}.<br>{plan.duration:.2f} s"
        cards.append(f"| {picture} | {text} |")
    table = "\n".join(["| | |", "| --- | --- |", *cards])
    listed = "\n".join(exhibit.problem.name for exhibit in exhibits())
    (pages / "index.md").write_text(
        "# Gallery\n\nEach maneuver that comes with Aerobat, planned, proven and flown when this page was "
        "built, with its replay: play it, turn it, follow the vehicle.\n\n"
        f"{table}\n\n```{{toctree}}\n:hidden:\n\n{listed}\n```\n",
        encoding="utf-8",
    )


def draw(flight: ab.Flight, plan: ab.Plan, stem: Path) -> None:
    """Draw a flight's page, and its path by itself."""
    figure = ab.draw(flight, plan)
    figure.savefig(stem.with_name(f"{stem.name}.png"), dpi=100)
    path = figure.axes[0].get_window_extent().transformed(figure.dpi_scale_trans.inverted())
    figure.savefig(stem.with_name(f"{stem.name}-path.png"), dpi=80, bbox_inches=path)


def page(exhibit: Exhibit, plan: ab.Plan, score: ab.Score) -> str:
    """One maneuver's page."""
    problem = exhibit.problem
    frame = FRAME.format(source=f"../../replays/{problem.name}.html", title=f"Replay of {problem.name}")
    facts = [f"- flight of {exhibit.vehicle}: {score}"]
    if plan.certificate is not None:
        facts.append(f"- proof: {plan.certificate.why}")
    if plan.assessment is not None:
        facts.append(f"- {plan.assessment}")
    return (
        f"# {problem.name}\n\n{problem.description}.\n\n```\n{exhibit.command}\n```\n\n{frame}\n\n"
        f"{plan.duration:.3f} s, planned by {plan.planner}:\n\n" + "\n".join(facts) + "\n\n"
        f"![Path, errors and thrusts of {problem.name}]({problem.name}.png)\n\n"
        f'<a href="../../replays/{problem.name}.html">The replay by itself</a>\n'
    )
