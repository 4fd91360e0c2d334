"""Position over time: piecewise polynomials, their extrema, and minimum-effort polynomials."""

from aerobat.trajectory.files import load_trajectory as load_trajectory
from aerobat.trajectory.files import save_trajectory as save_trajectory
from aerobat.trajectory.minimum_effort import ContinuityRule as ContinuityRule
from aerobat.trajectory.minimum_effort import minimum_effort as minimum_effort
from aerobat.trajectory.piecewise import Carrier as Carrier
from aerobat.trajectory.piecewise import Extremum as Extremum
from aerobat.trajectory.piecewise import HasTrajectory as HasTrajectory
from aerobat.trajectory.piecewise import Trajectory as Trajectory
from aerobat.trajectory.piecewise import as_trajectory as as_trajectory
