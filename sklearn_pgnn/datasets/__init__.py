"""Records: simulated rigs, machines with a hidden effect, and measured public benchmarks."""

from sklearn_pgnn.datasets.cart import make_cart
from sklearn_pgnn.datasets.golf_robot import golf_robot_plant, make_golf_robot
from sklearn_pgnn.datasets.hidden_effect import HiddenEffect, make_hidden_effect
from sklearn_pgnn.datasets.public import (
    PublicBenchmark,
    load_cascaded_tanks,
    load_coupled_drives,
    load_emps,
    load_silverbox,
)
from sklearn_pgnn.datasets.servo_valve import make_servo_valve, servo_valve_plant
from sklearn_pgnn.datasets.two_tanks import make_two_tanks

__all__ = [
    "HiddenEffect",
    "PublicBenchmark",
    "golf_robot_plant",
    "load_cascaded_tanks",
    "load_coupled_drives",
    "load_emps",
    "load_silverbox",
    "make_cart",
    "make_golf_robot",
    "make_hidden_effect",
    "make_servo_valve",
    "make_two_tanks",
    "servo_valve_plant",
]
