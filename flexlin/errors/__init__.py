"""Named errors: each says what was got, what was expected and what to do.

`InputError` and its children are the user's to correct (exit code 2 on the command line);
`NumericalError` and its children say that a sound question has no trustworthy answer (exit code 1).
"""

from flexlin.errors.given import (
    ArgumentError,
    DesignError,
    InputError,
    ModelError,
    MotionError,
    NotPeriodic,
    OutputError,
    Problem,
    SceneError,
)
from flexlin.errors.numerical import (
    IllPosedSegment,
    NotCertified,
    NotDetectable,
    NotStabilizable,
    NotStable,
    NumericalError,
    ResonantForcing,
    SimulationStopped,
    SingularClosure,
    SingularMassMatrix,
    TimeLimit,
    ToleranceNotReached,
    TooManySegments,
    UnresolvedCoefficient,
)
from flexlin.errors.root import FlexlinError, TooLarge

__all__ = [
    "ArgumentError",
    "DesignError",
    "FlexlinError",
    "IllPosedSegment",
    "InputError",
    "ModelError",
    "MotionError",
    "NotCertified",
    "NotDetectable",
    "NotPeriodic",
    "NotStabilizable",
    "NotStable",
    "NumericalError",
    "OutputError",
    "Problem",
    "ResonantForcing",
    "SceneError",
    "SimulationStopped",
    "SingularClosure",
    "SingularMassMatrix",
    "TimeLimit",
    "ToleranceNotReached",
    "TooLarge",
    "TooManySegments",
    "UnresolvedCoefficient",
]

for name in __all__:
    globals()[name].__module__ = __name__  # the name that users see in a traceback and import
