"""`aerobat check`: a proof, or its refutation, for any plan or CSV file."""

from __future__ import annotations

import sys
from dataclasses import replace
from math import inf, radians
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from aerobat.cli.options import CheckOptions

NOT_CERTIFIED = 1


def check(plan: Path, options: Annotated[CheckOptions, Parameter(name="*")] = CheckOptions()) -> None:
    """Prove over continuous time that a vehicle can fly a trajectory, or say when and why it cannot.

    The proof covers every rotor's thrust and, where limits are given, speed, tilt, body rates and moments. It
    does not sample: between any two instants it bounds what happens. Exits with 0 only if all is proven.

    Parameters
    ----------
    plan
        A plan.npz, a CSV file (rows of position, velocity, acceleration, jerk), or a folder that
        `aerobat plan` or `aerobat fly` wrote.
    """
    from aerobat.certification import Envelope, certify
    from aerobat.interchange import read_trajectory
    from aerobat.reporting.report_json import to_json
    from aerobat.reporting.tables import certificate_table, show
    from aerobat.vehicle import load_vehicle

    vehicle = load_vehicle(options.vehicle)
    envelope = Envelope(
        speed=options.max_speed or inf,
        tilt=inf if options.max_tilt is None else radians(options.max_tilt),
        body_rate=inf if options.max_rate is None else radians(options.max_rate),
        moment=options.max_moment or inf,
    )
    trajectory = read_trajectory(plan, options.rate)
    if options.heading is not None:
        trajectory = replace(trajectory, heading=radians(options.heading))
    certificate = certify(trajectory, vehicle, envelope=envelope)
    if options.json:
        print(to_json(certificate.record()))
    else:
        show(certificate_table(certificate, f"{plan} · {vehicle.name}"))
    if not certificate.certified:
        sys.exit(NOT_CERTIFIED)
