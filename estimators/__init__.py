"""State and parameter estimators on a discrete disc-thread model."""

from dtcasadi.waist import Discrete

from .base import Estimate, ProcessNoise
from .ekf import EKF
from .mhe import MHE
from .operating import OperatingPoints, operating_points
from .spv import SPV
from .ukf import UKF

__all__ = [
    "EKF",
    "MHE",
    "SPV",
    "UKF",
    "Discrete",
    "Estimate",
    "OperatingPoints",
    "ProcessNoise",
    "operating_points",
]
