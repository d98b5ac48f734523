"""Many machines of one kind: which of them has which cause, and what changed since last time.

Every machine is diagnosed separately, as by `ModelDiagnosis`; the fleet is evaluated from the
results.
"""

from sklearn_pgnn.fleet.changes import Change
from sklearn_pgnn.fleet.fleet_diagnosis import FleetDiagnosis
from sklearn_pgnn.fleet.machine import FleetCause, Machine
from sklearn_pgnn.fleet.spread import ParameterSpread

__all__ = ["Change", "FleetCause", "FleetDiagnosis", "Machine", "ParameterSpread"]
