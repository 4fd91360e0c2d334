"""The options of live links, each with its help."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from cyclopts import Group, Parameter, validators

from aerobat.cli.options import POSITIVE, Plugins, output

linking = Group("Link", sort_key=1)
trials = Group("Trials", sort_key=2)
bounds = Group("Bounds", sort_key=2)

FRACTION = validators.Number(gte=0, lt=1)


@dataclass(frozen=True, kw_only=True)
class MavlinkOptions:
    """Options of a flight over MAVLink."""

    connect: Annotated[str, Parameter(group=linking)] = "udp:127.0.0.1:14540"
    """Where the vehicle is: udp:HOST:PORT sends there first, udpin:HOST:PORT waits for it, tcp:HOST:PORT, or
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
    its parameter MPC_THR_HOVER."""

    vehicle: Annotated[str | None, Parameter(group=linking)] = None
    """The name of the vehicle that is there. A plan that is certified for another one is refused."""

    origin: Annotated[tuple[float, float, float] | None, Parameter(group=linking)] = None
    """Where the plan's origin lies in the vehicle's own frame, metres east, north and up. Default: above that
    frame's origin, the plan's lowest point 3 m up."""

    max_error: Annotated[float, Parameter(group=bounds, validator=POSITIVE)] = 1.0
    """Metres off the path at which the flight is given up: the vehicle hovers, then lands."""

    max_silence: Annotated[float, Parameter(group=bounds, validator=POSITIVE)] = 0.25
    """Seconds without news of the vehicle, in the plan, at which it is given up."""

    max_lateness: Annotated[float, Parameter(group=bounds, validator=POSITIVE)] = 0.1
    """Seconds by which a set-point may be late, in the plan."""

    speed: Annotated[float, Parameter(group=trials, validator=POSITIVE)] = 1.0
    """How fast time goes, for a simulated vehicle that has the same."""

    plugins: Annotated[tuple[Path, ...], Plugins(group=output)] = ()

    json: Annotated[bool, Parameter(group=output, negative="", show_default=False)] = False
    """Print the report as JSON on standard output, and nothing else."""


@dataclass(frozen=True, kw_only=True)
class MavlinkVehicleOptions:
    """Options of a simulated vehicle that speaks MAVLink."""

    listen: Annotated[str, Parameter(group=linking)] = "udp:127.0.0.1:14540"
    """Where it is to be reached: udp:HOST:PORT waits there, udpout:HOST:PORT sends there first, as PX4
    does."""

    loss: Annotated[float, Parameter(group=trials, validator=FRACTION)] = 0.0
    """The probability of each message, either way, to be lost."""

    delay: Annotated[float, Parameter(group=trials, validator=FRACTION)] = 0.0
    """Seconds by which each message is late, either way."""

    seed: Annotated[int, Parameter(group=trials, validator=validators.Number(gte=0))] = 0
    """The seed of the losses."""

    speed: Annotated[float, Parameter(group=trials, validator=POSITIVE)] = 1.0
    """How fast time goes, 1 as it does: below it, slow machines keep up."""

    seconds: Annotated[float | None, Parameter(name="--for", group=trials, validator=POSITIVE)] = None
    """Seconds after which it ends. Default: when it is interrupted."""
