"""Gazebo's motor models: plugins that turn a rotor's speed into thrust and torque.

The multicopter motor model of Gazebo, classic or new, has f = motorConstant ω² and a drag torque of
momentConstant times that thrust. Rotor speeds lag by timeConstantUp while they rise and by timeConstantDown
while they fall.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

from aerobat.errors import SpecError
from aerobat.interchange.robots.body import Motor
from aerobat.interchange.robots.markup import child_number

if TYPE_CHECKING:
    from xml.etree.ElementTree import Element

SPINS = {"ccw": 1, "cw": -1}


def read_motors(model: Element, children: Mapping[str, str]) -> tuple[Motor, ...]:
    """Return the motors of a model's plugins, in their order, except for motors that hold a position.

    Args:
        model: its elements have the plugins, at any depth.
        children: the link that each joint moves.
    """
    plugins = [plugin for plugin in model.iter("plugin") if plugin.find("motorConstant") is not None]
    return tuple(
        _motor(plugin, children)
        for plugin in plugins
        if (plugin.findtext("motorType") or "velocity").strip() == "velocity"
    )


def _motor(plugin: Element, children: Mapping[str, str]) -> Motor:
    joint = (plugin.findtext("jointName") or "").strip()
    link = (plugin.findtext("linkName") or "").strip() or children.get(joint, "")
    if not link:
        raise SpecError(
            f"a motor model names no link that is there, but the joint '{joint}'; add its linkName"
        )
    what = f"motor model of '{link}'"
    direction = (plugin.findtext("turningDirection") or "").strip()
    if direction not in SPINS:
        raise SpecError(f"{what}: turningDirection must be ccw or cw, got {direction!r}")
    found = {
        key: child_number(plugin, key, what) for key in ("motorConstant", "momentConstant", "maxRotVelocity")
    }
    for key in ("motorConstant", "maxRotVelocity"):
        if found[key] <= 0.0:
            raise SpecError(f"{what}: {key} must be positive, got {found[key]:g}")
    lags = [child_number(plugin, key, what) for key in ("timeConstantUp", "timeConstantDown")]
    return Motor(
        link=link,
        spin=SPINS[direction],
        k_f=found["motorConstant"],
        torque_coefficient=found["momentConstant"],
        max_speed=found["maxRotVelocity"],
        lag=max(lags),
        drag=child_number(plugin, "rotorDragCoefficient", what),
    )
