"""A kind of maneuver of one's own, known to problem files by its name as the built-in ones are.

Any command of `aerobat` knows it too: aerobat fly out/slalom.toml --import examples/own_maneuver_class.py
"""

import sys
from collections.abc import Sequence
from pathlib import Path

import aerobat as ab
from aerobat.declaration import Positive


@ab.maneuver("slalom")
class Slalom(ab.Maneuver):
    """Through every gate in turn, the thrust along its upright; when is for the solver to choose."""

    min_thrust: Positive = 10.0  # [m/s²] specific thrust there, at least

    def stage_sequence(self, gates: Sequence[ab.Gate], max_specific_thrust: float) -> ab.StageSequence:
        """Return one stage for each gate."""
        stages = (ab.Stage(gate.name, gate=gate.name, min_upright_thrust=self.min_thrust) for gate in gates)
        return ab.StageSequence(tuple(stages))


PROBLEM = """
name = "slalom"
start.position = [0.0, 0.0, 0.0]
goal.position = [9.0, 0.0, 0.0]
gates = [
    { name = "left", position = [3.0, 0.5, 1.0], tilt_deg = -60.0 },
    { name = "right", position = [6.0, -0.5, 1.0], tilt_deg = 60.0 },
]
maneuver = { kind = "slalom", min_thrust = 12.0 }
"""

if __name__ == "__main__":
    file = Path(sys.argv[1] if len(sys.argv) > 1 else "out") / "slalom.toml"
    file.parent.mkdir(parents=True, exist_ok=True)
    file.write_text(PROBLEM, encoding="utf-8")
    plan = ab.plan(ab.load_problem(file), vehicle=ab.load_vehicle("agile-quad"))
    print(plan)
    print(ab.score(ab.fly(plan), plan, plan.vehicle))
