"""The planar chain: from a scene's links and effects to kinetic energy, potential energy and dissipation."""

from collections.abc import Iterable
from dataclasses import replace
from itertools import accumulate

import casadi as ca

from flexlin.errors import ArgumentError
from flexlin.mechanics.beam import clamped_free, shape_integrals
from flexlin.mechanics.body import Body, Moments
from flexlin.mechanics.effects import Effect, effects_of
from flexlin.mechanics.effects.base import Chain
from flexlin.mechanics.frames import Frame
from flexlin.mechanics.links import BentLink
from flexlin.mechanics.manipulator import Manipulator
from flexlin.mechanics.parameters import Parameters
from flexlin.scene.library import registered_model
from flexlin.scene.links import Link
from flexlin.scene.loading import checked_table
from flexlin.scene.scene import Scene


def build_manipulator(scene: Scene, parameters: Iterable[str] = ()) -> Manipulator:
    """Derive the equations of the manipulator that a scene describes.

    Coordinates: first the relative joint angles q, then the elastic coordinates w link by link. Energies by recursion over the links,
    M, C, g by Lagrange's equations. An effect that is off adds no instruction and no coordinate.

    Assumes Euler-Bernoulli links in a plane, deflections small against the length.

    Parameters: parameters: dotted paths of scene numbers to keep as free symbols (their values may then change without a rebuild).
    Returns: a `Manipulator`.
    Raises: ArgumentError for a path that is no number of the scene; SceneError for a model that is not registered.
    Source: Khang, Dat, Tuan (2019), section 4; Book (1984), Recursive Lagrangian dynamics of flexible manipulator arms.
    """
    free = Parameters.of_scene(scene, parameters)
    if scene.model is not None:
        return _registered(scene, free)
    scene = free.placed_in(scene)
    effects = effects_of(scene.effects)
    joints, sizes = len(scene.links), [link.modes for link in scene.links]
    names = _coordinate_names(sizes)
    s, s_dot = (ca.vertcat(*[ca.SX.sym(mark + name) for name in names]) for mark in ("", "d_"))
    chain = _chain(scene.links, effects, _split(s, joints, sizes), _split(s_dot, joints, sizes))
    T, V, R = _energies(chain, effects)
    points = ca.horzcat(*[frame.position for frame in (*chain.joints, chain.tip)])
    B = ca.DM.eye(len(names))[:, :joints]
    return Manipulator.from_lagrangian(s, s_dot, T, V, R, B, range(joints), names, free, points)


def _registered(scene: Scene, free: Parameters) -> Manipulator:
    """Build a model that Python code has registered, with its own checked parameters."""
    if any(path.startswith("parameters.") for path in free.paths):
        raise ArgumentError(
            "the parameters of a registered model cannot be left free", got=free.paths, expected="none of parameters.*"
        )
    entry = registered_model(str(scene.model))
    table = checked_table(entry.schema, scene.parameters, f"model {scene.model}", "parameters")
    manipulator: Manipulator = entry.build(table)
    return replace(manipulator, parameters=free)


def _coordinate_names(sizes: list[int]) -> tuple[str, ...]:
    joints = [f"q{i + 1}" for i in range(len(sizes))]
    return (
        *joints,
        *[
            f"w{i + 1}{k + 1}" if size < 10 else f"w{i + 1}_{k + 1}"
            for i, size in enumerate(sizes)
            for k in range(size)
        ],
    )


def _split(s: ca.SX, joints: int, sizes: list[int]) -> tuple[ca.SX, list[ca.SX]]:
    """Separate coordinates into joint angles and one elastic vector a link."""
    edges = [0, joints, *[joints + total for total in accumulate(sizes)]]
    q, *w = ca.vertsplit(s, edges)
    return q, w


def _chain(
    tables: tuple[Link, ...],
    effects: tuple[Effect, ...],
    positions: tuple[ca.SX, list[ca.SX]],
    rates: tuple[ca.SX, list[ca.SX]],
) -> Chain:
    """Carry a frame from the base over joints and links to the tip."""
    (q, w), (q_rate, w_rate) = positions, rates
    frame, joints, links = Frame.fixed(), [], []
    for i, table in enumerate(tables):
        frame = frame.turned(q[i], q_rate[i])
        joints.append(frame)
        radius = sum((effect.joint_radius(i) for effect in effects), ca.SX(0))
        base = frame.moved(ca.vertcat(radius, 0), ca.SX.zeros(2))
        links.append(BentLink(table, shape_integrals(clamped_free(table.modes)), base, w[i], w_rate[i]))
        shortening = [effect.tip_shortening(links[-1]) for effect in effects]
        frame = links[-1].tip(
            sum((u for u, _ in shortening), ca.SX(0)), sum((u_rate for _, u_rate in shortening), ca.SX(0))
        )
    bare = Chain(q, q_rate, tuple(joints), tuple(links), frame)
    bodies = [Body(link.base, _moments(link, effects)) for link in links] + [
        b for effect in effects for b in effect.bodies(bare)
    ]
    return Chain(q, q_rate, tuple(joints), tuple(links), frame, tuple(bodies))


def _moments(link: BentLink, effects: tuple[Effect, ...]) -> Moments:
    extra = [effect.link_moments(link) for effect in effects]
    return sum((moments for moments in extra if moments is not None), link.moments())


def _energies(chain: Chain, effects: tuple[Effect, ...]) -> tuple[ca.SX, ca.SX, ca.SX]:
    """Kinetic energy, potential energy and Rayleigh's dissipation of the whole chain."""
    kinetic = sum((body.kinetic_energy() for body in chain.bodies), ca.SX(0))
    bending = sum((link.bending_energy for link in chain.links), ca.SX(0))
    potential = sum((effect.potential_energy(chain) for effect in effects), bending)
    dissipation = sum((effect.dissipation(chain) for effect in effects), ca.SX(0))
    return kinetic, potential, dissipation
