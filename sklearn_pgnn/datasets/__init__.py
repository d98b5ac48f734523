"""Records: simulated rigs, machines with a hidden effect, and measured public benchmarks."""

from sklearn_pgnn.datasets.hidden_effect import (
    HiddenEffect,
    make_cart,
    make_hidden_effect,
    make_two_tanks,
)
from sklearn_pgnn.datasets.plants import (
    golf_robot_plant,
    make_golf_robot,
    make_servo_valve,
    servo_valve_plant,
)
from sklearn_pgnn.datasets.public import (
    PublicBenchmark,
    load_cascaded_tanks,
    load_coupled_drives,
    load_emps,
    load_silverbox,
)

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
