"""Error-state extended Kalman filter: motion and the biases of an IMU, from its samples and from poses.

Solà, "Quaternion kinematics for the error-state Kalman filter", arXiv:1711.02508, sections 5 and 6. The
error of 15: position, velocity, attitude in body axes, biases of gyro and accelerometer. At every sample of
the IMU `propagate`; at every one or every few `predict_covariance`, and always before `fuse`, which takes a
pose that may be late. It knows nothing of what it observes.
"""

from aerobat.kernels.ekf.fusion import carried_back, fuse
from aerobat.kernels.ekf.prediction import predict_covariance, propagate
from aerobat.kernels.ekf.states import (
    EkfParameters,
    EkfState,
    NominalState,
    estimated_body,
    init,
    pose_of,
)
from aerobat.kernels.imu import ImuSample
from aerobat.kernels.rigid_body import Pose

__all__ = [
    "EkfParameters",
    "EkfState",
    "ImuSample",
    "NominalState",
    "Pose",
    "carried_back",
    "estimated_body",
    "fuse",
    "init",
    "pose_of",
    "predict_covariance",
    "propagate",
]
