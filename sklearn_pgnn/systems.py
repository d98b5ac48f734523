"""Ready systems, with the tables and the sources they come from."""

from sklearn_pgnn.physics.systems import cart_on_spring, golf_robot, servo_valve, two_tanks

__all__ = ["cart_on_spring", "golf_robot", "servo_valve", "two_tanks"]
