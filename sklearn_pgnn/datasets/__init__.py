"""Records made for trying things out: simulated rigs, and machines that hide an effect."""

from sklearn_pgnn.datasets.cart import make_cart
from sklearn_pgnn.datasets.golf_robot import golf_robot_plant, make_golf_robot
from sklearn_pgnn.datasets.hidden_effect import HiddenEffect, make_hidden_effect
from sklearn_pgnn.datasets.servo_valve import make_servo_valve, servo_valve_plant
from sklearn_pgnn.datasets.two_tanks import make_two_tanks

__all__ = [
    "HiddenEffect",
    "golf_robot_plant",
    "make_cart",
    "make_golf_robot",
    "make_hidden_effect",
    "make_servo_valve",
    "make_two_tanks",
    "servo_valve_plant",
]
