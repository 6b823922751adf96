"""A Go2-sized quadruped: convex predictive control, Raibert footholds, torque-limited joints."""

from wayproof.models.robots.quadruped.controller import QuadrupedController
from wayproof.models.robots.quadruped.parameters import Parameters
from wayproof.models.robots.quadruped.robot import Quadruped, warm_up

__all__ = ["Parameters", "Quadruped", "QuadrupedController", "warm_up"]
