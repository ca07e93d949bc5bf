"""The chain: from a scene's links and effects to kinetic energy, potential energy and dissipation."""

import warnings
from collections.abc import Iterable
from dataclasses import replace

import casadi as ca

from flexlin.arguments import checked, instance
from flexlin.errors import ArgumentError
from flexlin.mechanics.axes import list_axes
from flexlin.mechanics.bearings import pass_bearing
from flexlin.mechanics.body import Body, Moments, rigid_moments, tensor
from flexlin.mechanics.coordinates import Symbols, list_coordinates
from flexlin.mechanics.effects import Effect, effects_of
from flexlin.mechanics.effects.base import Chain
from flexlin.mechanics.frames import Frame, X, Y, Z, column, is_same, unit
from flexlin.mechanics.link_shapes import choose_basis
from flexlin.mechanics.links import BentLink, LinkBasis
from flexlin.mechanics.manipulator import Manipulator
from flexlin.mechanics.parameters import Parameters, given_to_model
from flexlin.mechanics.points import list_points
from flexlin.mechanics.sections import turned_sections
from flexlin.scene.library import registered_model
from flexlin.scene.links import NO_LINK, Link, list_parents
from flexlin.scene.loading import checked_table
from flexlin.scene.parameters import PARAMETERS
from flexlin.scene.scene import Scene
from flexlin.scene.space import RigidPart


@checked
def build_manipulator(scene: Scene, parameters: Iterable[str] = ()) -> Manipulator:
    """Derive the equations of the manipulator that a scene describes.

        M(s) s'' + C(s, s') s' + g(s) + d(s, s') = B tau

    Coordinates: first the relative joint displacements q, then the elastic coordinates w link by link, those of bearings that give, then
    those of motors behind flexible joints; passive joints follow from the loops. Energies by recursion over the links, M, C, g by
    Lagrange's equations, reduced by C_1, C_2. An effect that is off adds no instruction and no coordinate. Assumes slender links, and
    deflections small against the length.

    Parameters
    ----------
    scene : Scene
        From `load_scene` or `parse_scene`.
    parameters : iterable of str
        Dotted paths of scene numbers to keep as free symbols; their values may then change without a rebuild.

    Returns
    -------
    Manipulator
        The equations as CasADi expressions.

    Raises
    ------
    ArgumentError
        For a path that is no number of the scene.
    SceneError
        For a model that is not registered.

    References
    ----------
    Khang, Dat, Tuan (2019), section 4; Book, Recursive Lagrangian dynamics of flexible manipulator arms, Int. J. Robotics Research 3
    (1984) 87.

    Examples
    --------
    >>> import flexlin as fl
    >>> arm = fl.build_manipulator(fl.load_scene("single-link"), ["effects.payload.mass"])
    >>> arm.names, arm.parameters.paths
    (('q1', 'w11', 'w12'), ('effects.payload.mass',))
    """
    instance("scene", scene, Scene, "load one: fl.load_scene(name or path)")
    free = Parameters.of_scene(scene, parameters)
    if scene.model is not None:
        return _build_registered(scene, free)
    basis, tables = [choose_basis(scene, i) for i in range(len(scene.links))], scene.effects
    scene = free.placed_in(scene)
    effects = effects_of(scene.effects)
    units = {i: "m" if link.joint == "prismatic" else "rad" for i, link in enumerate(scene.links) if link.moves}
    free_motors = [i for i in units if scene.links[i].driven and any(effect.frees_motor(i) for effect in effects)]
    free_bearings = [i for i in units if any(effect.frees_bearing(i) for effect in effects)]
    coordinates = list_coordinates([link.counts for link in scene.links], units, free_motors, free_bearings)
    at, rate = (Symbols.of(coordinates, len(scene.links), mark) for mark in ("", "d_"))
    chain = _build_chain(scene.links, effects, basis, at, rate)
    arm = replace(_derive_equations(chain, effects, at, rate, free), coordinates=coordinates, effects=tables)
    arm = _free_motors(arm) if free_motors else arm
    if not scene.loops:
        return arm
    from flexlin.mechanics.loops import close_scene_loops

    return close_scene_loops(arm, chain, scene)


def _derive_equations(
    chain: Chain, effects: tuple[Effect, ...], at: Symbols, rate: Symbols, free: Parameters
) -> Manipulator:
    """Lagrange's equations of the chain; the motors drive, and their encoders read, what the chain says their angles are."""
    T, V, R = _sum_energies(chain, effects)
    measured = ca.jacobian(chain.motor, at.all)
    points = list_points(chain)
    gains = ca.vertcat(*[_choose_input_gain(effects, i) for i in chain.moving])
    arm = Manipulator.from_lagrangian(
        at.all,
        rate.all,
        T,
        V,
        R,
        resistance=_sum_resistance(chain, effects, at.all),
        B=ca.densify(measured.T @ ca.diag(gains)),
        joints=range(len(chain.moving)),
        parameters=free,
        points=points,
        check=False,
    )
    tip = ca.densify(chain.tips[-1].rotation)
    return replace(arm, measured=measured, axes=list_axes(chain)[: points.size1(), :], rotation=tip)


def _free_motors(arm: Manipulator) -> Manipulator:
    """The last coordinates are the motors': rigidly each turns with its joint, and a prescribed joint prescribes its motor."""
    places = {c.link: k for k, c in enumerate(arm.coordinates) if c.kind == "motor"}
    drives = [places.get(c.link, k) for k, c in enumerate(arm.coordinates[: arm.joints])]
    reference = ca.DM.eye(arm.n)[:, : arm.joints]
    for joint, drive in enumerate(drives):
        reference[drive, joint] = 1
    return replace(arm, reference=reference, drives=tuple(drives))


def _build_registered(scene: Scene, free: Parameters) -> Manipulator:
    """Build a model that Python code has registered, with its own checked parameters; the free ones are symbols in its table.

    Raises: ArgumentError where its code asks for numbers and cannot do with symbols.
    """
    entry = registered_model(str(scene.model))
    table = checked_table(entry.schema, scene.parameters, f"model {scene.model}", PARAMETERS)
    own = [path for path in free.paths if path.startswith(f"{PARAMETERS}.")]
    if not own:
        manipulator: Manipulator = entry.build(table)
        return replace(manipulator, parameters=free)
    try:
        with given_to_model(free), warnings.catch_warnings():
            warnings.simplefilter("error")
            manipulator = entry.build(free.placed_in(table, f"{PARAMETERS}."))
    except Exception as error:  # code of the model's own meets symbols that it may not expect
        got = f"{', '.join(own)} ({str(error).splitlines()[0][:120]})"
        raise ArgumentError(f"the model {scene.model} takes numbers, no symbols", got=got) from error
    return replace(manipulator, parameters=free)


def _build_chain(
    tables: tuple[Link, ...],
    effects: tuple[Effect, ...],
    basis: list[LinkBasis],
    at: Symbols,
    rate: Symbols,
) -> Chain:
    """Carry a frame from the base over joints and links to the tips."""
    mounts, axes, joints, links = [], [], [], []
    tips: list[Frame] = []
    parents = list_parents(tables)
    moving = tuple(i for i, table in enumerate(tables) if table.moves)
    for i, table in enumerate(tables):
        mounts.append(pass_mount(Frame.fixed() if parents[i] == NO_LINK else tips[parents[i]], table))
        axes.append(unit(table.joint_axis))
        place = moving.index(i) if table.moves else None
        displacement = _follow(table, moving, at, rate) if place is None else (at.q[place], rate.q[place])
        frame = pass_joint(mounts[i], table, axes[i], *displacement, at.bearings[i], rate.bearings[i])
        radius = sum(effect.joint_radius(i) for effect in effects)
        base = frame.moved(column(radius, 0, 0), ca.SX(3, 1))
        link = BentLink.of(i, table, basis[i], base, at.modes[i], rate.modes[i])
        joints.append(frame.turned(Z, *link.base_turn))
        links.append(link)
        moved = [(*effect.tip_displacement(link), *effect.tip_turn(link)) for effect in effects]
        tips.append(link.tip(*(_add((u[k] for u in moved), ca.SX(3, 1)) for k in range(4))))
    q, q_rate = at.q, rate.q
    if any(links[i].table.pinned for i in moving):
        turns = zip(*[links[i].base_turn for i in moving], strict=True)
        q, q_rate = (x + ca.vertcat(*extra) for x, extra in zip((q, q_rate), turns, strict=True))
    motor, motor_rate = (symbols.with_motors(x, moving) for symbols, x in ((at, q), (rate, q_rate)))
    frames = {"mounts": tuple(mounts), "axes": tuple(axes), "joints": tuple(joints), "tips": tuple(tips)}
    give = {"bearings": at.bearings, "bearing_rates": rate.bearings}
    bare = Chain(q, q_rate, motor, motor_rate, moving, links=tuple(links), parents=tuple(parents), **frames, **give)
    bodies = [Body(link.base, _sum_moments(link, effects)) for link in links]
    return replace(bare, bodies=(*bodies, *(body for effect in effects for body in effect.bodies(bare))))


def _follow(link: Link, moving: tuple[int, ...], at: Symbols, rate: Symbols) -> tuple[ca.SX, ca.SX]:
    """The displacement, with its rate, of a joint that is no coordinate: that of another by a rule, or none."""
    if link.mimic is None:
        return ca.SX(0), ca.SX(0)
    other, by = moving.index(link.mimic.link), link.mimic.multiplier
    return by * at.q[other] + link.mimic.offset, by * rate.q[other]


def pass_mount(frame: Frame, link: Link) -> Frame:
    """The frame before a link's joint: moved by the mount's xyz, turned by its yaw, pitch and roll."""
    if not link.mount.model_fields_set:
        return frame
    roll, pitch, yaw = link.mount.rpy
    moved = frame.moved(column(*link.mount.xyz), ca.SX(3, 1))
    return moved.turned(Z, yaw).turned(Y, pitch).turned(X, roll)


def pass_joint(frame: Frame, link: Link, axis: ca.SX, q: ca.SX, q_rate: ca.SX, give: ca.SX, give_rate: ca.SX) -> Frame:
    """The frame that a link's joint carries: turned by the mount's angle, then by what its bearing gives, then by q about its axis,
    or moved by q along it."""
    if link.joint == "revolute" and is_same(axis, Z) and not give.numel():
        return frame.turned(Z, q + link.mount_angle, q_rate)
    mounted = pass_bearing(frame.turned(Z, link.mount_angle), link, axis, give, give_rate)
    return mounted.moved(axis * q, axis * q_rate) if link.joint == "prismatic" else mounted.turned(axis, q, q_rate)


def _sum_moments(link: BentLink, effects: tuple[Effect, ...]) -> Moments:
    extra = [effect.link_moments(link) for effect in effects]
    own = link.moments() if link.table.body is None else link.moments() + _read_body(link.table.body)
    if link.table.polar_inertia is not None:
        own = own + turned_sections(link, (link.table.polar_inertia * link.table.length, 0.0, 0.0))
    return sum((moments for moments in extra if moments is not None), own)


def _read_body(part: RigidPart) -> Moments:
    """The rigid body where a link begins."""
    return rigid_moments(part.mass, tensor(**part.inertia.entries()), column(*part.centre))


def _sum_energies(chain: Chain, effects: tuple[Effect, ...]) -> tuple[ca.SX, ca.SX, ca.SX]:
    """Kinetic energy, potential energy and Rayleigh's dissipation of the whole chain."""
    carried = _add((body.kinetic_energy() for body in chain.bodies), ca.SX(0))
    kinetic = _add((effect.kinetic_energy(chain) for effect in effects), carried)
    bending = _add((link.elastic_energy for link in chain.links), ca.SX(0))
    potential = _add((effect.potential_energy(chain) for effect in effects), bending)
    dissipation = _add((effect.dissipation(chain) for effect in effects), ca.SX(0))
    return kinetic, potential, dissipation


def _add(parts: Iterable[ca.SX], start: ca.SX) -> ca.SX:
    """The sum of expressions, of which most are zero: each addition costs time, though it adds no instruction."""
    return sum((part for part in parts if not (isinstance(part, ca.SX) and part.is_zero())), start)


def _sum_resistance(chain: Chain, effects: tuple[Effect, ...], s: ca.SX) -> ca.SX:
    """The generalised forces of what resists each joint without being the gradient of a dissipation function."""
    at_joints = _add((effect.joint_resistance(chain) for effect in effects), ca.SX.zeros(len(chain.moving)))
    return ca.densify(ca.jacobian(chain.q, s).T @ at_joints)


def _choose_input_gain(effects: tuple[Effect, ...], joint: int) -> ca.SX:
    """Force of one unit of the joint's input: 1, unless a motor makes it of a voltage."""
    gains = [gain for effect in effects if (gain := effect.input_gain(joint)) is not None]
    return ca.SX(gains[-1]) if gains else ca.SX(1)
