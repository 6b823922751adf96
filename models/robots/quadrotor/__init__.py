"""An X2-sized quadrotor: geometric control on SE(3) behind a smoothing filter."""

from wayproof.models.robots.quadrotor.controller import QuadrotorController
from wayproof.models.robots.quadrotor.parameters import Parameters
from wayproof.models.robots.quadrotor.robot import Quadrotor, warm_up

__all__ = ["Parameters", "Quadrotor", "QuadrotorController", "warm_up"]
