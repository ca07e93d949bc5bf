"""What an effect is tried with where the scene has no figures for it: small, stated, and of the size that real arms have."""

from collections.abc import Callable
from dataclasses import dataclass

import casadi as ca
import numpy as np

from flexlin.mechanics import build_manipulator
from flexlin.mechanics.link_shapes import shapes_of
from flexlin.motion import build_motion
from flexlin.scene import effects as tables
from flexlin.scene.base import Table
from flexlin.scene.scene import Scene

SLENDERNESS = 0.01
"""Radius of gyration of a section, relative to the link's length."""
SHEAR_RATIO = 0.32
"""kappa G / E of a rectangular section of steel or aluminium: 0.83 / (2 * 1.3)."""
PART = 0.1
"""A body that the scene leaves out, relative to the inertia that is there."""
LOSS = 0.01
"""Damping ratios, and friction relative to the inertia forces of the motion."""


@dataclass(frozen=True)
class Scale:
    """The sizes that defaults are made of: each joint's inertia (kg m^2), mass of the links (kg), motion's and links' frequency (rad/s)."""

    inertias: tuple[float, ...]
    mass: float
    motion: float
    bending: float | None

    @classmethod
    def of(cls, scene: Scene) -> "Scale":
        """Read the sizes off a scene, stretched out and at rest."""
        arm = build_manipulator(scene)
        joints = range(arm.joints)
        M = ca.Function("M", [arm.s], [ca.densify(arm.M)])(np.zeros(arm.n))
        inertias = tuple(float(M[i, i]) for i in joints)
        mass = sum(link.mass_per_length * link.length for link in scene.links)
        slowest = [
            shapes_of(scene, i).beta[0] ** 2 * np.sqrt(link.bending_stiffness / (link.mass_per_length * link.length**4))
            for i, link in enumerate(scene.links)
            if link.modes and link.bending_stiffness is not None
        ]
        period = build_motion(scene.motion, arm.joints).period
        return cls(inertias, mass, 2 * np.pi / period, float(min(slowest)) if slowest else None)


def default_table(name: str, scene: Scene, scale: Scale) -> Table | None:
    """The table with which an effect is tried on a scene that has none; None where the effect has nothing to act on."""
    make = DEFAULTS.get(name)
    return None if make is None else make(scene, scale)


def _scaled(scale: Scale, factor: float) -> tuple[float, ...]:
    return tuple(factor * inertia for inertia in scale.inertias)


def _shear(scene: Scene, scale: Scale) -> Table | None:
    if scale.bending is None:
        return None
    stiffness = [
        SHEAR_RATIO * (link.bending_stiffness or 1.0) / (SLENDERNESS * (link.length or 1.0)) ** 2
        for link in scene.links
    ]
    return tables.Shear(stiffness=tuple(stiffness))


def _flexible_joints(scene: Scene, scale: Scale) -> Table:
    """Joints that alone would swing five times as fast as the slowest link, or fifty times as fast as the motion of a rigid arm."""
    fast = 5 * scale.bending if scale.bending is not None else 50 * scale.motion
    return tables.JointFlexibility(stiffness=_scaled(scale, fast**2), motor_inertia=_scaled(scale, PART))


def _motor(scene: Scene, scale: Scale) -> Table:
    """k = R, so that a volt is a newton metre and the back electromotive force a small damper."""
    constants = _scaled(scale, 2 * LOSS * scale.motion)
    return tables.Motor(torque_constant=constants, resistance=constants, rotor_inertia=_scaled(scale, PART))


def _if_bending(make: Callable[[float], Table]) -> Callable[[Scene, Scale], Table | None]:
    return lambda scene, scale: None if scale.bending is None else make(scale.bending)


DEFAULTS: dict[str, Callable[[Scene, Scale], Table | None]] = {
    "gravity": lambda scene, scale: tables.Gravity(),
    "payload": lambda scene, scale: tables.Payload(mass=PART * scale.mass),
    "hub": lambda scene, scale: tables.Hub(inertia=_scaled(scale, PART)),
    "geometric_stiffening": _if_bending(lambda omega: tables.GeometricStiffening()),
    "rotary_inertia": lambda scene, scale: tables.RotaryInertia(
        radius_of_gyration=tuple(SLENDERNESS * link.length for link in scene.links)
    ),
    "shear": _shear,
    "modal_damping": _if_bending(lambda omega: tables.ModalDamping(ratio=LOSS)),
    "rayleigh_damping": _if_bending(lambda omega: tables.RayleighDamping(stiffness_factor=2 * LOSS / omega)),
    "kelvin_voigt_damping": _if_bending(lambda omega: tables.KelvinVoigtDamping(retardation_time=2 * LOSS / omega)),
    "joint_flexibility": _flexible_joints,
    "viscous_friction": lambda scene, scale: tables.ViscousFriction(
        coefficient=_scaled(scale, 2 * LOSS * scale.motion)
    ),
    "coulomb_friction": lambda scene, scale: tables.CoulombFriction(
        torque=_scaled(scale, LOSS * scale.motion**2), rate=0.1 * scale.motion
    ),
    "motor": _motor,
}
