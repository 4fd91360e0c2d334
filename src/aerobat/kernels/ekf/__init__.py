"""Error-state extended Kalman filter for motion and IMU biases, from IMU samples and poses.

Solà, "Quaternion kinematics for the error-state Kalman filter", arXiv:1711.02508, sections 5 and 6. The error
has 15 components: position, velocity, attitude in body axes, biases of gyro and accelerometer. Call
`propagate` at every IMU sample, `predict_covariance` at every or every few samples and always before `fuse`,
which fuses a possibly late pose. The filter does not depend on the vehicle.
"""

from aerobat.kernels.ekf.fusion import carried_back as carried_back
from aerobat.kernels.ekf.fusion import fuse as fuse
from aerobat.kernels.ekf.prediction import predict_covariance as predict_covariance
from aerobat.kernels.ekf.prediction import propagate as propagate
from aerobat.kernels.ekf.states import EkfParameters as EkfParameters
from aerobat.kernels.ekf.states import EkfState as EkfState
from aerobat.kernels.ekf.states import NominalState as NominalState
from aerobat.kernels.ekf.states import estimated_body as estimated_body
from aerobat.kernels.ekf.states import init as init
from aerobat.kernels.ekf.states import pose_of as pose_of
from aerobat.kernels.imu import ImuSample as ImuSample
from aerobat.kernels.rigid_body import Pose as Pose
