"""Physical effects that a model may lack, and their catalogue."""

from sklearn_pgnn.physics.effects import *  # noqa: F403 - an effect is listed once, there
from sklearn_pgnn.physics.effects import __all__ as __all__
