"""The options of live links, each with its help."""

from dataclasses import dataclass
from typing import Annotated, Literal

from cyclopts import Group, Parameter, validators

from aerobat.cli.options import POSITIVE, PluginOptions, RunOptions, planning
from aerobat.links.mission import MissionSettings

linking = Group("Link", sort_key=1)
trials = Group("Trials", sort_key=2)
bounds = Group("Bounds", sort_key=2)

FRACTION = validators.Number(gte=0, lt=1)


@dataclass(frozen=True, kw_only=True)
class MissionOptions(PluginOptions):
    """Options of the abort criteria of a flight over a link."""

    max_error: Annotated[float, Parameter(group=bounds, validator=POSITIVE)] = 1.0
    """Metres off the path at which the flight is given up: the vehicle is brought to a hover, and by MAVLink
    it lands."""

    max_silence: Annotated[float, Parameter(group=bounds, validator=POSITIVE)] = 0.25
    """Seconds without news of the vehicle, in the plan, at which it is given up."""

    max_lateness: Annotated[float, Parameter(group=bounds, validator=POSITIVE)] = 0.1
    """Seconds by which a set-point may be late, in the plan."""

    @property
    def mission(self) -> MissionSettings:
        """The options as settings of a mission."""
        return MissionSettings(
            max_error=self.max_error, max_silence=self.max_silence, max_lateness=self.max_lateness
        )


@Parameter(name="*")
@dataclass(frozen=True, kw_only=True)
class EndOptions:
    """Options of commands that run until they are interrupted."""

    seconds: Annotated[float | None, Parameter(name="--for", group=trials, validator=POSITIVE)] = None
    """Seconds after which it ends. Default: when it is interrupted."""


@dataclass(frozen=True, kw_only=True)
class SimulatedVehicleOptions(EndOptions):
    """Options of a simulated vehicle."""

    environment: Annotated[str | None, Parameter(group=trials)] = None
    """The problem whose gravity and wind the vehicle is simulated in: a name that `aerobat show` lists, a
    TOML file, a .plan file or a run's folder. Default: the Earth's gravity and still air."""


@dataclass(frozen=True, kw_only=True)
class RosNodeOptions(EndOptions):
    """Options of a ROS node."""

    generation: Annotated[
        Literal["1", "2"], Parameter(name="--ros", group=linking, env_var="ROS_VERSION")
    ] = "2"
    """The generation of ROS."""

    goal: Annotated[str, Parameter(group=linking)] = "/aerobat/goal"
    """The topic of goals; or, as crazyswarm2:/cf231, a Crazyflie of crazyswarm2's server to stand in for."""

    odometry: Annotated[str | None, Parameter(group=linking)] = None
    """The topic of the vehicle's state. Default: /aerobat/odometry, or that of the Crazyflie."""


@dataclass(frozen=True, kw_only=True)
class MavlinkOptions(MissionOptions, RunOptions):
    """Options of a flight over MAVLink."""

    connect: Annotated[str, Parameter(group=linking)] = "udp:127.0.0.1:14540"
    """The vehicle's address: udp:HOST:PORT sends there first, udpin:HOST:PORT waits for it, tcp:HOST:PORT, or
    a serial device."""

    baud: Annotated[int, Parameter(group=linking, validator=validators.Number(gt=0))] = 57600
    """The rate of a serial device, bits a second."""

    rate: Annotated[float, Parameter(group=linking, validator=validators.Number(gte=100, lte=250))] = 200.0
    """Set-points a second."""

    wait: Annotated[float, Parameter(group=linking, validator=POSITIVE)] = 10.0
    """Seconds for a vehicle to answer."""

    hover_thrust: Annotated[
        float | None, Parameter(group=linking, validator=validators.Number(gt=0, lt=1))
    ] = None
    """The part of its thrust at which the vehicle hovers, by which thrusts are scaled. Default: what it says,
    by PX4's parameter MPC_THR_HOVER or ArduPilot's MOT_THST_HOVER."""

    vehicle: Annotated[str | None, Parameter(group=linking)] = None
    """The name of the vehicle that is there. A plan that is certified for another one is refused."""

    system: Annotated[int | None, Parameter(group=linking, validator=validators.Number(gte=1, lte=255))] = (
        None
    )
    """The vehicle's number among MAVLink's systems. Default: the only one that is heard; of two none is
    flown."""

    origin: Annotated[tuple[float, float, float] | None, Parameter(group=linking, negative="")] = None
    """The place of the plan's origin in the vehicle's own frame, metres east, north and up. Default: above
    that frame's origin, the plan's lowest point 3 m up."""

    speed: Annotated[float, Parameter(group=trials, validator=POSITIVE)] = 1.0
    """The pace of time, 1 as in reality, for a simulated vehicle that has the same."""


@dataclass(frozen=True, kw_only=True)
class MavlinkVehicleOptions(SimulatedVehicleOptions):
    """Options of a simulated vehicle for MAVLink clients."""

    dialect: Annotated[Literal["px4", "ardupilot"], Parameter(group=linking)] = "px4"
    """The autopilot that clients take it for."""

    listen: Annotated[str, Parameter(group=linking)] = "udp:127.0.0.1:14540"
    """The address of the vehicle: udp:HOST:PORT waits there, udpout:HOST:PORT sends there first, as PX4
    does."""

    loss: Annotated[float, Parameter(group=trials, validator=FRACTION)] = 0.0
    """The probability of each message, either way, to be lost."""

    delay: Annotated[float, Parameter(group=trials, validator=FRACTION)] = 0.0
    """Seconds by which each message is late, either way."""

    seed: Annotated[int, Parameter(group=trials, validator=validators.Number(gte=0))] = 0
    """The seed of the losses."""

    speed: Annotated[float, Parameter(group=trials, validator=POSITIVE)] = 1.0
    """The pace of time, 1 as in reality: below 1, slow machines keep up."""


@dataclass(frozen=True, kw_only=True)
class RosOptions(MissionOptions, RosNodeOptions):
    """Options of a ROS node that flies maneuvers."""

    vehicle: Annotated[str, Parameter(group=planning)] = "agile-quad"
    """The vehicle that is flown: a name that `aerobat show` lists, or a TOML file."""

    planner: Annotated[str | None, Parameter(group=planning)] = None
    """The planner, with its own defaults; see `aerobat plan`. Default: what suits each problem."""

    reserve: Annotated[float, Parameter(group=planning, validator=FRACTION)] = 0.15
    """The fraction of thrusts that plans leave to the controller."""

    world: Annotated[bool, Parameter(group=planning)] = False
    """Gates and goals stay in the world where their problems have them. Default: they move along, so that
    each maneuver begins where the vehicle is."""

    goal: Annotated[str, Parameter(group=linking)] = "/aerobat/goal"
    """The topic of goals; or a Betaflight board that is flown by rates and thrust instead, its receiver's
    protocol and its line, as msp:/dev/ttyACM0, crsf:/dev/ttyUSB0 or msp:socket://HOST:PORT; or a Crazyflie of
    crazyswarm2's server, as crazyswarm2:/cf231, whose odometry is /cf231/odom."""

    onboard: Annotated[bool, Parameter(group=linking)] = False
    """Plans are uploaded to a Crazyflie and flown by itself, rather than streamed to it."""

    rate: Annotated[float, Parameter(group=linking, validator=validators.Number(gte=50, lte=250))] = 100.0
    """Goals a second."""

    takeoff_height: Annotated[float, Parameter(group=linking, validator=POSITIVE)] = 3.0
    """Metres that the service takeoff climbs."""

    sim_time: Annotated[bool, Parameter(group=linking)] = False
    """Time is that of the topic /clock (use_sim_time); of ROS 2."""

    jerk: Annotated[bool, Parameter(group=linking, negative="--no-jerk")] = True
    """Goals tell the jerk, as a second joint; some controllers warn of more than one."""


@dataclass(frozen=True, kw_only=True)
class RosVehicleOptions(RosNodeOptions, SimulatedVehicleOptions):
    """Options of a simulated vehicle that is a ROS node."""

    rate: Annotated[float, Parameter(group=linking, validator=validators.Number(gte=20, lte=250))] = 100.0
    """States a second."""

    speed: Annotated[float | None, Parameter(group=trials, validator=POSITIVE)] = None
    """The highest pace of time, told to all on the topic /clock; time waits for goals that are late. Default:
    it is ROS time, and nothing is told."""
