"""State and parameter estimators on a discrete disc-thread model."""

from .base import Discrete, Estimate, ProcessNoise
from .ekf import EKF

__all__ = ["EKF", "Discrete", "Estimate", "ProcessNoise"]
