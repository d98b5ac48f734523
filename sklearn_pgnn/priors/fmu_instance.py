"""A functional mock-up unit for model exchange as a function of numbers.

A unit has internal states: time, states, inputs and parameters are set, then rates and outputs are
read. Conditions (event indicators) are evaluated at every point: the unit enters its event mode
there, so that its results belong to that point, not to the previous one.
"""

import ctypes
import io
import zipfile
from dataclasses import dataclass
from functools import cached_property
from tempfile import TemporaryDirectory
from threading import RLock
from typing import Any

from sklearn_pgnn.exceptions import ModelError

#: largest number of updates of a unit's discrete part at one point
SETTLED = 100
#: highest status of a successful call
WARNING = 1
_STATUS = ctypes.PYFUNCTYPE(ctypes.c_int)


@dataclass(frozen=True)
class UnitFunction:
    """Rates and outputs of a unit, opened where first called, as a function of a tuple."""

    archive: bytes
    inputs: tuple[str, ...]
    parameters: tuple[str, ...]
    outputs: tuple[str, ...]

    def __call__(self, point: tuple[float, ...]) -> list[float]:
        """Return rates and outputs at a point."""
        return self.unit.at(point)

    @cached_property
    def unit(self) -> "Unit":
        """The unit, opened in this process."""
        return Unit(self)

    def __reduce__(self):
        return UnitFunction, (self.archive, self.inputs, self.parameters, self.outputs)


class Unit:
    """An opened unit, for one call at a time."""

    fmu: Any = None

    def __init__(self, function: UnitFunction):
        from fmpy import read_model_description

        self.folder = TemporaryDirectory(prefix="unit-")
        with zipfile.ZipFile(io.BytesIO(function.archive)) as archive:
            archive.extractall(self.folder.name)
        self.description = read_model_description(self.folder.name, validate=False)
        self.is_fmi2 = self.description.fmiVersion.startswith("2")
        known = {v.name: v for v in self.description.modelVariables}
        self.n = len(self.description.derivatives)
        self.has_events = bool(
            self.description.numberOfEventIndicators or self.description.eventIndicators
        )
        told = [known[name] for name in function.parameters]
        tunable = [i for i, v in enumerate(told) if v.variability == "tunable"]
        self.tunable = _Values(told, tunable)
        self.fixed = _Values(told, [i for i in range(len(told)) if i not in tunable])
        self.inputs = _Values([known[name] for name in function.inputs])
        self.outputs = _Values([known[name] for name in function.outputs])
        self.time = ctypes.c_double()
        self.x, self.rates = ((ctypes.c_double * self.n)() for _ in range(2))
        self.lock, self.said, self.jumps = RLock(), "", False
        self._begin([float(v.start) for v in told])
        self.fmu.getContinuousStates(self.x, self.n)
        self.start = (0.0, *self.x, *(float(v.start or 0) for v in self.inputs.variables),
                      *(float(v.start) for v in told))  # fmt: skip

    @property
    def start_states(self) -> list[float]:
        """The start values of its states."""
        return list(self.start[1 : 1 + self.n])

    @cached_property
    def nominal_states(self) -> list[float]:
        """The nominal magnitudes of its states."""
        found = (ctypes.c_double * self.n)()
        self.fmu.getNominalsOfContinuousStates(found, self.n)
        return [abs(value) or 1.0 for value in found]

    def at(self, point: tuple[float, ...]) -> list[float]:
        """Return rates and outputs at a point; after an error the unit is started anew."""
        given = [
            own if value != value else value for value, own in zip(point, self.start, strict=True)
        ]
        with self.lock:
            self.said = ""
            try:
                return self._at(given)
            except Exception as error:
                self._end()
                raise ModelError(f"{error} {self.said}".strip()) from error

    def _at(self, given: list[float]) -> list[float]:
        first = 1 + self.n + len(self.inputs.numbers)
        parameters = given[first:]
        if self.fmu is None or self._part(parameters, self.fixed) != self.fixed.held:
            self._begin(parameters)
        self.time.value = given[0]
        self.x[:] = given[1 : 1 + self.n]  # type: ignore[assignment]
        self.inputs.numbers[:] = given[1 + self.n : first]
        self._call(self.given)
        tunable = self._part(parameters, self.tunable)
        if self.has_events or tunable != self.tunable.held:
            self.fmu.enterEventMode()
            self._set(self.tunable, tunable)
            self._settle()
        self._call(self.asked)
        return [*self.rates, *self.outputs.numbers]

    def _call(self, calls) -> None:
        for name, function, arguments in calls:
            status = function(*arguments)
            if status > WARNING:
                raise ModelError(f"{name} failed with status {status}.")

    def _part(self, parameters, part: "_Values") -> list[float]:
        return [parameters[place] for place in part.places]

    # -- its life ----------------------------------------------------------------------------------

    def _begin(self, parameters) -> None:
        """Start the unit with parameters, some of which cannot be changed afterwards."""
        if self.fmu is None:
            self._open()
        else:
            self.fmu.reset()
        if self.is_fmi2:
            self.fmu.setupExperiment(startTime=0.0)
        self._set(self.fixed, self._part(parameters, self.fixed))
        self._set(self.tunable, self._part(parameters, self.tunable))
        self.fmu.enterInitializationMode()
        self.fmu.exitInitializationMode()
        self._settle()

    def _open(self) -> None:
        from fmpy.simulation import instantiate_fmu

        self.fmu = instantiate_fmu(
            self.folder.name, self.description, "ModelExchange", logger=self._listen
        )
        self._bind()

    def _listen(self, *told) -> None:
        """Store the last message of the unit."""
        self.said = (told[-1] or b"").decode("utf-8", "replace")

    def _end(self) -> None:
        """Release an instance that an error has left in an unknown state."""
        fmu, self.fmu = self.fmu, None
        if fmu is not None:
            (fmu.fmi2FreeInstance if self.is_fmi2 else fmu.fmi3FreeInstance)(fmu.component)

    def _settle(self) -> None:
        """Update the discrete part until it no longer changes, then return to continuous time."""
        update = self.fmu.newDiscreteStates if self.is_fmi2 else self.fmu.updateDiscreteStates
        for _ in range(SETTLED):
            again, ends, _, jumps, *_ = update()
            self.jumps |= bool(jumps)
            if jumps or ends:
                raise ModelError(
                    "the FMU resets its states at an event."
                    if jumps
                    else "the FMU terminates the simulation."
                )
            if not again:
                return self.fmu.enterContinuousTimeMode()
        raise ModelError(f"the FMU does not finish an event iteration within {SETTLED} steps.")

    # -- its numbers -------------------------------------------------------------------------------

    def _set(self, part: "_Values", values) -> None:
        part.numbers[:] = values
        part.held = values
        if part.variables:
            self._call([self._values("Set", part)])

    def _values(self, do: str, part: "_Values"):
        """Return the call that sets or gets variables."""
        count = ctypes.c_size_t(len(part.variables))
        given = (part.references, count, part.numbers)
        if self.is_fmi2:
            return self._bound(f"fmi2{do}Real", *given)
        return self._bound(f"fmi3{do}Float64", *given, count)

    def _bound(self, name: str, *arguments):
        """Return a function of the unit with its arguments; it does not release the GIL."""
        address = ctypes.cast(getattr(self.fmu.dll, name), ctypes.c_void_p).value or 0
        component = self.fmu.component
        if not isinstance(component, ctypes.c_void_p):
            component = ctypes.c_void_p(component)
        return name, _STATUS(address), (component, *arguments)

    def _bind(self) -> None:
        """Prepare the calls that set and get variables at every point."""
        fmi, n = ("fmi2" if self.is_fmi2 else "fmi3"), ctypes.c_size_t(self.n)
        rates = "GetDerivatives" if self.is_fmi2 else "GetContinuousStateDerivatives"
        self.given = [self._bound(f"{fmi}SetTime", self.time),
                      self._bound(f"{fmi}SetContinuousStates", self.x, n)]  # fmt: skip
        self.asked = [self._bound(f"{fmi}{rates}", self.rates, n)]
        if self.inputs.variables:
            self.given.append(self._values("Set", self.inputs))
        if self.outputs.variables:
            self.asked.append(self._values("Get", self.outputs))


class _Values:
    """Some variables of a unit in the form that its functions take, with their values."""

    def __init__(self, variables, places=None):
        self.places = range(len(variables)) if places is None else places
        self.variables = [variables[place] for place in self.places]
        n = len(self.variables)
        self.references = (ctypes.c_uint * n)(*(v.valueReference for v in self.variables))
        self.numbers, self.held = (ctypes.c_double * n)(), None
