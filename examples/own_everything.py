"""One's own vehicle, course, maneuver, controller and conditions, from files to a video, exports and a sweep.

    uv run python examples/own_everything.py [FOLDER]

Every step is a command that the documentation names; what one of them prints as JSON, the next ones use.
"""

import json
import subprocess
import sys
import tomllib
from importlib.util import find_spec
from pathlib import Path
from typing import Any

ROTORS = ((0.12, 0.12), (-0.12, 0.12), (-0.12, -0.12), (0.12, -0.12))  # [m] x, y; they spin in turns

LINK = """
  <link name="prop{k}_link"><inertial><origin xyz="{x} {y} 0.02"/><mass value="0"/>
    <inertia ixx="0" ixy="0" ixz="0" iyy="0" iyz="0" izz="0"/></inertial></link>
  <joint name="prop{k}_joint" type="fixed"><parent link="base_link"/><child link="prop{k}_link"/></joint>"""
ROBOT = f"""<?xml version="1.0"?>
<robot name="mine">
  <properties arm="0.17" kf="1.5e-5" km="2.4e-7" thrust2weight="4.2" prop_radius="0.0635"/>
  <link name="base_link"><inertial><mass value="0.62"/>
    <inertia ixx="0.0016" ixy="0" ixz="0" iyy="0.0018" iyz="0" izz="0.0029"/></inertial></link>
  {"".join(LINK.format(k=k, x=x, y=y) for k, (x, y) in enumerate(ROTORS))}
</robot>
"""

COURSE = """
name = "yard"
start.position = [0.0, 0.0, 0.0]
goal.position = [9.0, 0.0, 0.0]
environment.ground = 0.0
gates = [
    { name = "window", position = [3.0, 0.5, 1.5], width = 1.4, height = 1.4 },
    { name = "ring", position = [6.0, -0.5, 1.8], diameter = 1.6 },
]

[maneuver]
kind = "course"

[[maneuver.elements]]
kind = "leaning-pass"
gate = "window"
min_thrust = 8.0

[[maneuver.elements]]
kind = "gate"
gate = "ring"
"""

CONDITIONS = """
description = "a barn: a weighed vehicle, calm air, motion capture"
mass = 0.02
rotor = 0.02
start_position = 0.01
control_rate = 500.0

[imu]
rate = 1000.0
gyro_noise = 1e-3
accelerometer_noise = 0.02
gyro_bias = 0.01
accelerometer_bias = 0.05

[motion_capture]
rate = 100.0
position_noise = 0.001

[gusts]
mean_wind = 0.2
intensity = 0.1
length = 1.0
airspeed = 5.0
"""

PLUGIN = '''
import aerobat as ab
from aerobat.declaration import Positive
from aerobat.kernels.quaternions import axes, conjugate, multiply, to_body
from aerobat.kernels.rigid_body import RotorWrench
from aerobat.kernels.vectors import add, add_scaled, dot, scale, subtract, transform


@ab.maneuver("leaning-pass")
class LeaningPass(ab.Maneuver):
    """Through a gate with a least specific thrust along its upright."""

    min_thrust: Positive = 8.0  # [m/s²]
    gate: str | None = None  # the name of the gate, by which a course gives it

    def stage_sequence(self, gates, max_specific_thrust):
        """Return one stage, the gate's."""
        stage = ab.Stage("leaning", gate=gates[0].name, min_upright_thrust=self.min_thrust)
        return ab.StageSequence((stage,))


@ab.controller("mine")
class Mine(ab.ControlLaw):
    """Proportional and derivative, in position and in attitude, beside the reference's thrust."""

    position_gain: Positive = 20.0  # [1/s²]
    velocity_gain: Positive = 8.0  # [1/s]
    attitude_gain: Positive = 600.0  # [1/s²]
    rate_gain: Positive = 40.0  # [1/s]

    def step(self, ops, model, state, seen, elapsed):
        """Return the state, of which there is none, and the thrust and the moment."""
        body, reference = seen.body, seen.reference
        body_axes = axes(body.q_world_body)
        e_x = subtract(reference.position, body.position)
        e_v = subtract(reference.velocity, body.velocity)
        feedback = add_scaled(scale(self.position_gain, e_x), self.velocity_gain, e_v)
        thrust = dot(add(reference.specific_thrust, feedback), body_axes[2])
        across, ahead = to_body(body_axes, feedback)[:2], ops.maximum(thrust, 5.0)
        w, x, y, z = multiply(conjugate(body.q_world_body), reference.q_world_body)
        twice = ops.select(w < 0.0, -2.0, 2.0)
        error = (twice * x - across[1] / ahead, twice * y + across[0] / ahead, twice * z)
        rates = subtract(to_body(body_axes, reference.omega), body.omega_body)
        turn = add_scaled(scale(self.attitude_gain, error), self.rate_gain, rates)
        turn = add(turn, to_body(body_axes, reference.omega_dot))
        mass, inertia = model.airframe.mass_properties[:2]
        return state, RotorWrench(mass * thrust, transform(inertia, turn))
'''


def aerobat(folder: Path, *arguments: str) -> Any:
    """What a command prints as JSON; it may come to a flight that goes wrong, and to no other failure."""
    command = [sys.executable, "-m", "aerobat", *arguments, "--json"]
    done = subprocess.run(command, cwd=folder, capture_output=True, encoding="utf-8", check=False)
    found = json.loads(done.stdout)
    if done.returncode not in (0, 1) or "error" in found:
        raise SystemExit(f"{' '.join(arguments)}: {found}")
    return found


def write_vehicle(folder: Path) -> None:
    """Import the robot's description, and add what such a file has no words for."""
    (folder / "mine.toml").unlink(missing_ok=True)  # of an earlier run: no command replaces a vehicle's file
    (folder / "mine.urdf").write_text(ROBOT, encoding="utf-8")
    command = [sys.executable, "-m", "aerobat", "show", "mine.urdf", "--out", "mine.toml"]
    subprocess.run(command, cwd=folder, check=True, capture_output=True)
    text = (folder / "mine.toml").read_text(encoding="utf-8")
    text = text.replace("[rotor_defaults]\n", "[rotor_defaults]\nlag = 0.025\n")  # [s] of a thrust stand
    head, *rotors = text.split("[[rotors]]\n")
    spins = (f"[[rotors]]\nspin = {(-1) ** k}\n{rotor}" for k, rotor in enumerate(rotors))
    (folder / "mine.toml").write_text(head + "".join(spins), encoding="utf-8")


def main() -> None:
    folder = Path(sys.argv[1] if len(sys.argv) > 1 else "out") / "own-everything"
    folder.mkdir(parents=True, exist_ok=True)
    write_vehicle(folder)
    for name, text in {"yard.toml": COURSE, "barn.toml": CONDITIONS, "plugin.py": PLUGIN}.items():
        (folder / name).write_text(text, encoding="utf-8")
    print(
        tomllib.loads((folder / "mine.toml").read_text(encoding="utf-8"))["name"],
        "is the vehicle",
        flush=True,
    )

    own = ("--vehicle", "mine.toml", "--import", "plugin.py")
    flown = aerobat(folder, "fly", "yard.toml", *own, "--controller", "mine", "--out", "run")
    plan, flight = flown["plan"], flown["flight"]
    print(f"planned: {plan['duration_s']:.2f} s, certified: {plan['certificate']['certified']}")
    print(f"flown by a law of one's own: {flight['outcome']}")

    known = ("--import", "plugin.py")  # the run's plan has the maneuver in it
    law = ("--controller", "mine", "--conditions", "barn.toml")
    swept = aerobat(folder, "sweep", "run", *known, *law, "--runs", "100", "--out", "swept")
    print(f"in the barn {swept['went_well']['count']} of {swept['flights']} flights succeed")

    for kind, file in {"csv": "path.csv", "px4": "px4", "blender": "path.glb"}.items():
        made = aerobat(folder, "export", "run", *known, "--to", kind, "--out", file)
        print(f"{kind}: within {100 * made['loss']['position_m']:.3f} cm of the plan")
    if find_spec("imageio_ffmpeg") is not None:  # of aerobat[viewer]
        print(aerobat(folder, "view", "run", *known, "--video", "flight.gif", "--speed", "2")["video"])


if __name__ == "__main__":
    main()
