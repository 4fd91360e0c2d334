"""Tables of what an audit measured, each line beside its floor."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from statistics import median
from typing import Any

from audit_advice import WRONG
from audit_measures import ALL_PLANNERS, PLANNERS, YARDSTICK, at_equal_reserve

Row = dict[str, Any]
VIOLATION = 1e-6  # [SI]: less is rounding
ROTOR_EXCESS = 1e-6  # of a rotor's range
COMMAND_EXCESS = 1e-3  # likewise; they are differences of samples
MAX_ERROR = 0.05  # [m] flown, of a certified plan
YARDSTICK_SLACK = 0.995
AT_SIGHT = 0.05  # [s] of the processor, for a refusal that solves nothing
SUCCESS = ("COMPLETE", "THROUGH_GATES")
FORESEEN = ("planned", "infeasible")
HARD = ("refusals", "advice")  # measures on hard problems
SAID = "refused"  # in words, as input that makes no sense: to be expected of hard problems only


def defect(row: Row) -> str:
    """What is wrong with a row, in a few words; nothing otherwise."""
    if row["status"] not in FORESEEN and not (row["status"] == SAID and row["what"] in HARD):
        return f"{row['status']}: {row['message']}"
    if row["what"] == "plans" and row["status"] == "planned":
        if not row["certified"]:
            return f"uncertified plan: {row['why']}"
        if row.get("violation", 0.0) > VIOLATION:
            return f"certified, {row['violated']} violated by {row['violation']:.3g}"
        if row.get("thrust_excess", 0.0) > ROTOR_EXCESS or row.get("command_excess", 0.0) > COMMAND_EXCESS:
            excess = f"{row['thrust_excess']:.2g}, commands by {row['command_excess']:.2g} of their range"
            return f"certified, rotor thrusts beyond their limits by {excess}"
        if row.get("error", 0.0) > MAX_ERROR or row.get("outcome", "COMPLETE") not in SUCCESS:
            said = f"{row.get('sentence', row['outcome'])}; said: {row['said']}"
            return f"certified, flown {100 * row['error']:.1f} cm off, {said}"
        if (
            max(row.get("planned_deg", 0.0), row.get("flown_deg", 0.0))
            > row.get("tolerance_deg", 180.0) + 0.5
        ):
            return f"attitude in the gate {row['planned_deg']:.1f}° off, flown {row['flown_deg']:.1f}°"
    if row.get("advice", "").startswith(WRONG):
        return f"refused, {row['advice']}: {row['message']}"
    if row.get("planned_by") or row.get("free_knots"):
        return f"refused, planned by {row['planned_by'] or 'free knots'}"
    if row.get("shorter"):
        return f"{row['duration']:.3f} s, but {min(row['shorter']):.3f} s can be planned"
    return ""


def attitude(rows: list[Row]) -> Iterable[str]:
    for name in PLANNERS:
        for kind in ("flip", "half-flip", "tilted-flip"):
            own = [r for r in _certified(rows, name) if r["kind"] == kind and "planned_deg" in r]
            if own:
                yield (
                    f"{name:>14} {kind:>11} {len(own):4} plans: plan {_spread(own, 'planned_deg', '°')}, "
                    f"flight {_spread(own, 'flown_deg', '°')}; beyond the tolerance: {_beyond(own)}"
                )


def _beyond(rows: list[Row]) -> str:
    counts = [sum(r[key] > r["tolerance_deg"] for r in rows) for key in ("planned_deg", "flown_deg")]
    return f"{counts[0]} planned, {counts[1]} flown (floor: none)"


def samples(rows: list[Row]) -> Iterable[str]:
    for name, own in _by_planner(rows, "violation"):
        beyond = {
            "what holds always": sum(r["violation"] > VIOLATION for r in own),
            "rotors' limits": sum(r["thrust_excess"] > ROTOR_EXCESS for r in own),
            "their commands' limits": sum(r["command_excess"] > COMMAND_EXCESS for r in own),
        }
        counts = ", ".join(f"{what} in {n}" for what, n in beyond.items())
        most = max(r["violation"] for r in own)
        yield f"{name:>14} {len(own):4} plans violate {counts} (floor: none); the first by {most:.3g} at most"


def flyability(rows: list[Row]) -> Iterable[str]:
    for name, own in _by_planner(rows, "error"):
        off = [r for r in own if r["error"] > MAX_ERROR]
        missed = [r for r in own if r["error"] <= MAX_ERROR and r["outcome"] not in SUCCESS]
        silent = sum(not r["said"] for r in off)
        yield (
            f"{name:>14} {len(own):4} plans: {100 * (1 - len(off) / len(own)):.1f} % within 5 cm "
            f"(floor: 99 %), {silent} of {len(off)} others in silence (floor: none), at most "
            f"{100 * max(r['error'] for r in own):.1f} cm; of those within, {len(missed)} miss a gate or "
            "its attitude"
        )


def durations(rows: list[Row]) -> Iterable[str]:
    best = {r["case"]: r["duration"] for r in _certified(rows, YARDSTICK)}
    floors = {"miqp": "1.25", "free-knots": "1.05", at_equal_reserve("free-knots"): "1.05"}
    for name in (*PLANNERS, at_equal_reserve("free-knots")):
        own = [r for r in _certified(rows, name) if r["case"] in best]
        ratios = sorted(r["duration"] / best[r["case"]] for r in own)
        if ratios:
            under = sum(ratio < YARDSTICK_SLACK for ratio in ratios)
            yield (
                f"{name:>14} {len(ratios):4} plans: median {median(ratios):.3f} (floor: "
                f"{floors.get(name, '-')}), {ratios[0]:.3f} to {ratios[-1]:.3f}; {under} under "
                f"{YARDSTICK_SLACK} (floor: none)"
            )


def speed(rows: list[Row]) -> Iterable[str]:
    for name in ALL_PLANNERS:
        own = sorted(r["seconds"] for r in rows if r["what"] == "plans" and r["planner"] == name)
        if own:
            yield f"{name:>14} {len(own):4} calls: median {median(own):.2f} s, {own[-1]:.2f} s at most"


def outcomes(rows: list[Row]) -> Iterable[str]:
    for name in ALL_PLANNERS:
        own = [r for r in rows if r["what"] == "plans" and r["planner"] == name]
        if own:
            counts = {"certified": len([*_certified(rows, name)])}
            counts["uncertified"] = sum(r["status"] == "planned" for r in own) - counts["certified"]
            for row in own:
                if row["status"] != "planned":
                    counts[row["status"]] = counts.get(row["status"], 0) + 1
            yield f"{name:>14} {len(own):4} calls: " + ", ".join(
                f"{n} {status}" for status, n in counts.items()
            )


def refusals(rows: list[Row]) -> Iterable[str]:
    tried = [r for r in rows if r["what"] == "refusals"]
    own = [r for r in tried if "planned_by" in r]
    rescued = [r["rescue"].rpartition("; ")[2] for r in tried if r.get("rescue")]
    if own:
        wrong, free = sum(bool(r["planned_by"]) for r in own), sum(r["free_knots"] for r in own)
        at_sight = sum(r["seconds"] < AT_SIGHT for r in own)
        seconds = sorted(r["seconds"] for r in own)
        ways = sum(r["tried"] for r in own) / len(own)
        yield (
            f"{len(own)} refusals of {len(tried)} problems, {at_sight} of them at sight: {wrong} planned "
            f"with another N or at a fixed dt (floor: none), {free} by free-knots (floor: none); "
            f"{ways:.0f} ways tried on average; {median(seconds):.1f} s a refusal at the median, "
            f"{seconds[-1]:.1f} at most"
        )
        counts = ", ".join(f"{rescued.count(how)} {how}" for how in sorted(set(rescued)))
        patience = sum(r["status"] == "TimeoutError" for r in tried)
        yield f"{len(rescued)} others rescued: {counts}; {patience} without any answer in time"


def advice(rows: list[Row]) -> Iterable[str]:
    own = [r for r in rows if r["what"] == "advice"]
    told = [r["advice"] for r in own if "advice" in r]
    if told:
        seconds = sorted(r["seconds"] for r in own if r["status"] == "infeasible")
        words = ", ".join(f"{told.count(what)} {what}" for what in sorted(set(told)))
        yield (
            f"{len(told)} refusals of {len(own)} problems: {words} (floor: none in vain); "
            f"{median(seconds):.1f} s at the median, {seconds[-1]:.1f} at most"
        )


def smallest_dt(rows: list[Row]) -> Iterable[str]:
    own = [r for r in rows if r["what"] == "smallest-dt" and "shorter" in r]
    if own:
        missed = [1.0 - min(r["shorter"]) / r["duration"] for r in own if r["shorter"]]
        yield (
            f"{len(own)} plans: {len(missed)} are not the shortest (floor: none), by "
            f"{100 * max(missed, default=0.0):.0f} % at most"
        )


def price(rows: list[Row]) -> Iterable[str]:
    own = [r for r in rows if r["what"] == "price" and r.get("duration")]
    for name, key in (("upright in the plane of the turn only", "in_plane"), ("passed half-way", "half_way")):
        ratios = sorted(r["duration"] / r[key] - 1.0 for r in own if r.get(key))
        if ratios:
            yield (
                f"over {name} ({len(ratios)} of {len(own)}): {100 * median(ratios):+.1f} % at the median, "
                f"{100 * ratios[0]:+.1f} to {100 * ratios[-1]:+.1f} %"
            )


def _by_planner(rows: list[Row], key: str) -> Iterable[tuple[str, list[Row]]]:
    """The certified plans of each planner, of those that have any with that measure."""
    for name in PLANNERS:
        own = [r for r in _certified(rows, name) if key in r]
        if own:
            yield name, own


def _certified(rows: list[Row], planner: str) -> list[Row]:
    own = [r for r in rows if r["what"] == "plans" and r["planner"] == planner]
    return [r for r in own if r.get("certified")]


def _spread(rows: list[Row], key: str, unit: str) -> str:
    values = [r[key] for r in rows]
    return f"{median(values):.2f}{unit} (at most {max(values):.2f}{unit})"


TABLES: dict[str, Callable[[list[Row]], Iterable[str]]] = {
    "Outcomes": outcomes,
    "Attitude in the gate, medians": attitude,
    "Samples of certified plans, 10^5 of conditions": samples,
    "Flyability of certified plans": flyability,
    "Durations over time-optimal's": durations,
    "Speed, processor time": speed,
    "Refusals by MIQP": refusals,
    "What refusals advise, followed": advice,
    "Smallest dt of MIQP": smallest_dt,
    "Price in duration of the attitude in the gate, and what its free time gains": price,
}
