"""Error-state extended Kalman filter for motion and IMU biases, from IMU samples and poses.

Solà, "Quaternion kinematics for the error-state Kalman filter", arXiv:1711.02508, sections 5 and 6. The error
has 15 components: position, velocity, attitude in body axes, biases of gyro and accelerometer. Call
`propagate` at every IMU sample, `predict_covariance` at every or every few samples and always before `fuse`,
which fuses a possibly late pose. The filter does not depend on the vehicle.
"""

from aerobat.kernels.ekf.fusion import carried_back, fuse
from aerobat.kernels.ekf.prediction import predict_covariance, propagate
from aerobat.kernels.ekf.states import EkfParameters, EkfState, NominalState, estimated_body, init, pose_of
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
