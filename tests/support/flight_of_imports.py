"""What a process imports in a climb, a halt and a landing once its node stands, a name a line."""

from __future__ import annotations

import sys

import aerobat as ab
from aerobat.links.commander import rehearse
from aerobat.links.ros.maneuver_node import ManeuverNode
from ros_sky import AtOnce, Graph, Ros

if __name__ == "__main__":
    vehicle, problem = ab.load_vehicle("agile-quad"), ab.load_problem("flip-roll")
    ManeuverNode(Ros(Graph(2)), vehicle, {"flip": (problem, ab.Miqp())}, AtOnce())
    known = set(sys.modules)
    rehearse(vehicle, problem.environment.gravity)
    print(*sorted(set(sys.modules) - known), sep="\n")
