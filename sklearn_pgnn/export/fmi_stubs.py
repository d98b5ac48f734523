"""The FMI functions that a unit without events, strings and clocks has, but does not need.

Every argument is denoted by a letter, and every pointer is a pointer to void: the calling
convention is the same.
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
#: by name without the version prefix: arguments, and whether the function succeeds
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
        "EnterStepMode": ("P", True),
        "GetOutputDerivatives": ("PPZPPZ", False),
        "ActivateModelPartition": ("PUD", False),
    },
}  # fmt: skip
#: functions of a unit for model exchange: left out for such a unit
_OF_EXCHANGE = {
    2: {
        "EnterEventMode": "P",
        "NewDiscreteStates": "PP",
        "EnterContinuousTimeMode": "P",
        "CompletedIntegratorStep": "PIPP",
        "SetTime": "PD",
        "SetContinuousStates": "PPZ",
        "GetDerivatives": "PPZ",
        "GetEventIndicators": "PPZ",
        "GetContinuousStates": "PPZ",
        "GetNominalsOfContinuousStates": "PPZ",
    },
    3: {
        "EnterEventMode": "P",
        "UpdateDiscreteStates": "PPPPPPP",
        "EnterContinuousTimeMode": "P",
        "CompletedIntegratorStep": "PBPP",
        "SetTime": "PD",
        "SetContinuousStates": "PPZ",
        "GetContinuousStateDerivatives": "PPZ",
        "GetEventIndicators": "PPZ",
        "GetContinuousStates": "PPZ",
        "GetNominalsOfContinuousStates": "PPZ",
        "GetNumberOfEventIndicators": "PP",
        "GetNumberOfContinuousStates": "PP",
    },
}
#: instances of kinds that no exported unit has
_NO_INSTANCE = {
    2: {},
    3: {"InstantiateScheduledExecution": "PPPBBPPPPP"},
}


def fmi_stubs(fmi: int, exchanges: bool = False) -> list[dict]:
    """Return the functions that only report that they are not supported.

    >>> fmi_stubs(2)[0]["taken"]
    'const void *a0, int a1, size_t a2, const void *a3'
    """
    found = [
        _stub("int", f"fmi{fmi}{name}", arguments, "OK" if succeeds else "FAILED")
        for name, (arguments, succeeds) in _STUBS[fmi].items()
    ]
    nothing = dict(_NO_INSTANCE[fmi])
    if not exchanges:
        found += [_stub("int", f"fmi{fmi}{n}", a, "FAILED") for n, a in _OF_EXCHANGE[fmi].items()]
        nothing |= {"InstantiateModelExchange": "PPPBBPP"} if fmi == 3 else {}
    return found + [_stub("void *", f"fmi{fmi}{n}", a, "NULL") for n, a in nothing.items()]


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
