"""Orthographic views of the world, and the one from which a maneuver is best seen."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from aerobat import so3
from aerobat.arrays import Array
from aerobat.problem.gate import Gate


@dataclass(frozen=True)
class Camera:
    """A viewer infinitely far away, at an azimuth about +z (from +x) and an elevation [rad]."""

    azimuth: float
    elevation: float = 0.0

    @property
    def toward(self) -> Array:
        """The unit vector from the scene to the viewer, (3,)."""
        level = np.cos(self.elevation)
        return np.array([level * np.cos(self.azimuth), level * np.sin(self.azimuth), np.sin(self.elevation)])

    @property
    def screen(self) -> Array:
        """The world directions of right and up on the picture, (2, 3)."""
        right = np.array([-np.sin(self.azimuth), np.cos(self.azimuth), 0.0])
        return np.array([right, so3.cross(self.toward, right)])

    def project(self, points: Array) -> Array:
        """Project world points [m] onto the picture [m], (..., 3) -> (..., 2)."""
        return np.asarray(points @ self.screen.T)

    def nearness(self, points: Array) -> Array:
        """Return the depth of points toward the viewer [m], (..., 3) -> (...)."""
        return np.asarray(points @ self.toward)


def best_view(path: Array, gates: Sequence[Gate], corners: Array, size: Array) -> Camera:
    """Return the view in which a path spreads widest and openings of gates are seen, not their edges.

    Between equal views, the path should lead to the right, and then x should.

    Args:
        path: Positions [m], (T, 3).
        gates: The gates, of which the openings are to be seen.
        corners: The corners of the box that is fitted into the picture [m], (8, 3).
        size: The picture's width and height, (2,).
    """
    azimuths, elevations = np.deg2rad(np.arange(-180.0, 180.0, 5.0)), np.deg2rad([20.0, 27.0])
    cameras = [Camera(float(a), float(e)) for a in azimuths for e in elevations]
    scores = _spread(path, corners, size, cameras)
    scores *= _openness(gates, cameras) * _depth(cameras) * _custom(path, cameras)
    return cameras[int(np.argmax(scores))]


def _spread(path: Array, corners: Array, size: Array, cameras: list[Camera]) -> Array:
    """Return the area over which the path spreads in each picture, (cameras,)."""
    covariance = np.cov(path.T) if len(path) > 1 else np.zeros((3, 3))
    covariance = covariance + 1e-3 * (np.trace(covariance) + 1e-9) * np.eye(3)  # a straight path spreads too
    screens = np.array([camera.screen for camera in cameras])
    areas = np.sqrt(np.linalg.det(screens @ covariance @ np.swapaxes(screens, -1, -2)))
    scales = (size / np.ptp(corners @ np.swapaxes(screens, -1, -2), axis=1)).min(axis=1)
    return np.asarray(areas * scales**2)


def _openness(gates: Sequence[Gate], cameras: list[Camera]) -> Array:
    """Return the root of the least open gate's openness, (cameras,), so that the path weighs more."""
    normals = np.array([gate.normal for gate in gates]).reshape(-1, 3)
    openness = np.abs(np.array([camera.toward for camera in cameras]) @ normals.T)
    return np.asarray(np.sqrt(openness.min(axis=1, initial=1.0)))


def _depth(cameras: list[Camera]) -> Array:
    """Return the depth, (cameras,): views along a horizontal axis look flat, others by 0.3 or more do not."""
    sideways = [np.abs(camera.toward[:2]).min() for camera in cameras]
    return np.asarray(np.minimum(np.array(sideways) / 0.3, 1.0) ** 0.5)


def _custom(path: Array, cameras: list[Camera]) -> Array:
    """Return the preferences between views that are equal otherwise, (cameras,)."""
    travel = path[-1] - path[0]
    travel = travel / max(float(np.linalg.norm(travel)), 1.0)
    onward = np.array([camera.screen[0] @ travel for camera in cameras])
    customary = np.cos([camera.azimuth - np.deg2rad(-60.0) for camera in cameras])  # with x to the right
    return np.asarray(1.0 + 0.15 * onward + 0.02 * customary)
