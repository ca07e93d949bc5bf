"""Small scenes for the tests of mechanics, and numbers from their manipulators."""

from typing import Any

import casadi as ca
import numpy as np
from scipy.integrate import quad

from flexlin import Linearization, linearize
from flexlin.checks import Array
from flexlin.mechanics import Manipulator, build_manipulator
from flexlin.scene import Scene, parse_scene

LINK = {"length": 0.5, "mass_per_length": 0.2, "bending_stiffness": 1.0, "modes": 2}


def swinging(*joints: dict[str, Any], frequency: float = 1.0, **more: Any) -> dict[str, Any]:
    """The table of a harmonic motion."""
    return {"kind": "harmonic", "frequency": frequency, "joints": list(joints), **more}


def held(angle: float = 0.0, frequency: float = 1.0) -> dict[str, Any]:
    """The motion of one joint that stands still whatever acts on it."""
    return swinging({"mean": angle, "amplitude": 0.0}, frequency=frequency, drive="prescribed")


def clamped_mode(x: Array, d: int = 0) -> Array:
    """The d-th derivative of the first mode of a clamped unit beam, int X^2 = 1. Source: Young, Felgar (1949), beta l = 1.87510407."""
    beta = 1.8751040687119612
    sigma, z = (np.cosh(beta) + np.cos(beta)) / (np.sinh(beta) + np.sin(beta)), beta * np.asarray(x)
    waves = np.cosh(z), np.sinh(z), np.cos(z + d * np.pi / 2), np.sin(z + d * np.pi / 2)
    return beta**d * (waves[d % 2] - sigma * waves[1 - d % 2] - waves[2] + sigma * waves[3])


def clamped_constants() -> tuple[float, float, float]:
    """k11 = beta^4, G = int (1 - x^2)/2 X'^2 and H = int (1 - x) X'^2 of this mode, by quadrature."""
    shares = (lambda x: (1 - x * x) / 2, lambda x: 1 - x)
    G, H = (quad(lambda x, f=f: f(x) * clamped_mode(x, 1) ** 2, 0, 1, epsabs=1e-13)[0] for f in shares)
    return 1.8751040687119611**4, G, H


def plain_scene(links: list[dict[str, Any]], motion: dict[str, Any], **more: Any) -> Scene:
    """A scene of tables as they are."""
    return parse_scene({"schema": 1, "title": "test", "links": links, "motion": motion, **more})


def linear(scene: Scene) -> Linearization:
    """The linearization of a scene's arm without a loop."""
    return linearize(build_manipulator(scene), scene.motion)


def scene_of(*links: dict[str, Any], effects: dict[str, Any] | None = None, **more: Any) -> Scene:
    """A scene of these links (each on top of LINK), swinging harmonically."""
    motion = swinging(*[{"mean": 0.1, "amplitude": 0.2} for _ in links])
    return plain_scene([{**LINK, **link} for link in links], **{"effects": effects or {}, "motion": motion, **more})


def arm_of(*links: dict[str, Any], effects: dict[str, Any] | None = None) -> Manipulator:
    """The manipulator of `scene_of`."""
    return build_manipulator(scene_of(*links, effects=effects))


def value(arm: Manipulator, name: str, *state: Array) -> Array:
    """One of the manipulator's named functions at one state."""
    return np.array(arm.functions[name](*state, arm.parameters.values))


def matrices_at_rest(arm: Manipulator) -> tuple[Array, Array]:
    """Mass and stiffness matrix at s = 0, s' = 0."""
    state, p = ca.vertcat(arm.s, arm.s_dot), arm.parameters.symbols
    function = ca.Function("MK", [state, p], [ca.densify(arm.M), ca.densify(ca.jacobian(arm.g, arm.s))])
    M, K = function(np.zeros(2 * arm.n), arm.parameters.values)
    return np.array(M), np.array(K)


def random_state(arm: Manipulator, seed: int = 0, elastic: float = 0.02) -> tuple[Array, Array, Array]:
    """Coordinates, rates and accelerations: joints of order 1, elastic coordinates small."""
    rng, joints = np.random.default_rng(seed), arm.joints
    scale = np.where(np.arange(arm.n) < joints, 1.0, elastic)
    s, s_dot, s_ddot = rng.normal(size=(3, arm.n)) * scale
    return s, s_dot, s_ddot
