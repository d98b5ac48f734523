"""The functions of FMI that a unit without events, strings and clocks has, but does not need.

Every argument is told by a letter, and every pointer is one to anything: the calling convention is
the same.
"""

_TYPES = {
    "P": "const void *",
    "Z": "size_t ",
    "D": "double ",
    "U": "unsigned int ",
    "I": "int ",
    "B": "_Bool ",
}
_OTHER_TYPES = "Float32 Int8 UInt8 Int16 UInt16 Int32 UInt32 Int64 UInt64 Boolean String"
#: name after the version: arguments, and whether it succeeds
_STUBS = {
    2: {
        "SetDebugLogging": ("PIZP", True),
        "EnterInitializationMode": ("P", True),
        "Terminate": ("P", True),
        **{f"{do}{kind}": ("PPZP", False) for do in ("Get", "Set")
           for kind in ("Integer", "Boolean", "String")},
        "GetDirectionalDerivative": ("PPZPZPP", False),
        "SetRealInputDerivatives": ("PPZPP", False),
        "GetRealOutputDerivatives": ("PPZPP", False),
        "CancelStep": ("P", False),
        **{f"Get{kind}Status": ("PIP", False)
           for kind in ("", "Real", "Integer", "Boolean", "String")},
    },
    3: {
        "SetDebugLogging": ("PBZP", True),
        "Terminate": ("P", True),
        **{f"{do}{kind}": ("PPZPZ", False) for do in ("Get", "Set")
           for kind in _OTHER_TYPES.split()},
        **{f"{do}Binary": ("PPZPPZ", False) for do in ("Get", "Set")},
        **{f"{do}Clock": ("PPZP", False) for do in ("Get", "Set")},
        "GetNumberOfVariableDependencies": ("PUP", False),
        "GetVariableDependencies": ("PUPPPPZ", False),
        "GetDirectionalDerivative": ("PPZPZPZPZ", False),
        "GetAdjointDerivative": ("PPZPZPZPZ", False),
        "EnterConfigurationMode": ("P", False),
        "ExitConfigurationMode": ("P", False),
        "GetIntervalDecimal": ("PPZPP", False),
        "GetIntervalFraction": ("PPZPPP", False),
        "GetShiftDecimal": ("PPZP", False),
        "GetShiftFraction": ("PPZPP", False),
        "SetIntervalDecimal": ("PPZP", False),
        "SetIntervalFraction": ("PPZPP", False),
        "SetShiftDecimal": ("PPZP", False),
        "SetShiftFraction": ("PPZPP", False),
        "EvaluateDiscreteStates": ("P", False),
        "UpdateDiscreteStates": ("PPPPPPP", False),
        "EnterEventMode": ("P", False),
        "EnterContinuousTimeMode": ("P", False),
        "CompletedIntegratorStep": ("PBPP", False),
        "SetTime": ("PD", False),
        "SetContinuousStates": ("PPZ", False),
        "GetContinuousStateDerivatives": ("PPZ", False),
        "GetEventIndicators": ("PPZ", False),
        "GetContinuousStates": ("PPZ", False),
        "GetNominalsOfContinuousStates": ("PPZ", False),
        "GetNumberOfEventIndicators": ("PP", False),
        "GetNumberOfContinuousStates": ("PP", False),
        "EnterStepMode": ("P", True),
        "GetOutputDerivatives": ("PPZPPZ", False),
        "ActivateModelPartition": ("PUD", False),
    },
}  # fmt: skip
#: instances of kinds that a unit for co-simulation has none of
_NO_INSTANCE = {
    2: {},
    3: {"InstantiateModelExchange": "PPPBBPP", "InstantiateScheduledExecution": "PPPBBPPPPP"},
}


def fmi_stubs(fmi: int) -> list[dict]:
    """Return the functions that only say that they are not there.

    Parameters
    ----------
    fmi : {2, 3}
        Version of FMI.

    Returns
    -------
    list of dict
        For the template: ``kind``, ``name``, ``taken``, ``arguments`` and ``returned``.

    Examples
    --------
    >>> fmi_stubs(2)[0]["taken"]
    'const void *a0, int a1, size_t a2, const void *a3'
    """
    found = [
        _stub("int", f"fmi{fmi}{name}", arguments, "OK" if succeeds else "FAILED")
        for name, (arguments, succeeds) in _STUBS[fmi].items()
    ]
    nothing = _NO_INSTANCE[fmi].items()
    return found + [_stub("void *", f"fmi{fmi}{name}", given, "NULL") for name, given in nothing]


def _stub(kind: str, name: str, letters: str, returned: str) -> dict:
    arguments = [f"a{i}" for i in range(len(letters))]
    taken = ", ".join(_TYPES[letter] + a for letter, a in zip(letters, arguments, strict=True))
    return {
        "kind": kind,
        "name": name,
        "taken": taken,
        "arguments": arguments,
        "returned": returned,
    }
