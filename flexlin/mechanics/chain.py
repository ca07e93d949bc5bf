"""From a scene to its manipulator: bodies, energies and dissipation of the chain, the equations, and the curves that pictures show."""

import warnings
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from typing import Any

import casadi as ca

from flexlin.arguments import checked
from flexlin.errors import ArgumentError
from flexlin.mechanics.body import (
    Body,
    Frame,
    InertiaForm,
    Z,
    column,
    directions_across,
    is_same,
    rigid_moments,
    tensor,
    unit,
)
from flexlin.mechanics.closed_loop import close_scene_loops
from flexlin.mechanics.coordinates import Parameters, Symbols, given_to_model, list_coordinates
from flexlin.mechanics.curve import CurvedLink, CurveRule
from flexlin.mechanics.effects import Effect, effects_of
from flexlin.mechanics.effects.base import Chain
from flexlin.mechanics.effects.bending_torsion_coupling import BendingTorsionCoupling
from flexlin.mechanics.effects.geometric_stiffening import GeometricStiffening
from flexlin.mechanics.link_shapes import choose_basis, choose_rule
from flexlin.mechanics.links import PLACES, BentLink, LinkBasis, split_rotation, turned_sections
from flexlin.mechanics.manipulator import FlexibleManipulator, Manipulator
from flexlin.scene.library import registered_model
from flexlin.scene.links import BASE, NO_LINK, Link, list_parents
from flexlin.scene.parameters import PARAMETERS
from flexlin.scene.problems import checked_table
from flexlin.scene.scene import Scene


@checked
def build_manipulator(scene: Scene, parameters: Iterable[str] = ()) -> Manipulator:
    """Derive the equations of the manipulator that a scene describes.

        M(s) s'' + C(s, s') s' + g(s) + d(s, s') = B tau

    Coordinates: first the relative joint displacements q, then the elastic coordinates w link by link, those of bearings that give, then
    those of motors behind flexible joints; passive joints follow from the loops. Energies by recursion over the links, M, C, g by
    Lagrange's equations, reduced by C_1, C_2. An effect that is off adds no instruction and no coordinate. Assumes slender links, and
    deflections small against the length where no `geometric_stiffening` makes them curves.

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
    free = Parameters.of_scene(scene, parameters)
    if scene.model is not None:
        return _build_registered(scene, free)
    arm = _build(scene, free, {})
    if not any(_is_curve(link, scene.effects.on()) for link in scene.links):
        return arm
    return FlexibleManipulator(replace(arm, derive=partial(_build_at_large, scene, free.paths)))


def _is_curve(link: Link, effects: Collection[str]) -> bool:
    """Whether a link is a curve at any deflection: to second order its kinetic energy is the square of no velocity."""
    ways = {way for way, modes in link.counts.by_direction().items() if modes}
    stiffened = "geometric_stiffening" in effects and not ways <= {"torsion"}
    return stiffened or ("bending_torsion_coupling" in effects and len(ways) > 1)


def _build_at_large(scene: Scene, paths: tuple[str, ...], near: Manipulator) -> Manipulator:
    """The equations of a scene at any deflection, in symbols of their own; `near`: those for small ones."""
    rules = {i: choose_rule(scene, i) for i, link in enumerate(scene.links) if _is_curve(link, scene.effects.on())}
    return _build(scene, Parameters.of_scene(scene, paths), rules, near)


def _build(
    scene: Scene, free: Parameters, rules: Mapping[int, CurveRule], near: Manipulator | None = None
) -> Manipulator:
    """The equations of a scene with energies of second order in the deflections; links with `rules` are curves."""
    basis, tables = [choose_basis(scene, i) for i in range(len(scene.links))], scene.effects
    scene = free.placed_in(scene)
    effects = effects_of(scene.effects)
    units = {i: "m" if link.joint == "prismatic" else "rad" for i, link in enumerate(scene.links) if link.moves}
    _check_springs(effects_of(tables), effects, units)
    free_motors = [i for i in units if scene.links[i].driven and any(effect.frees_motor(i) for effect in effects)]
    free_bearings = [i for i in units if any(effect.frees_bearing(i) for effect in effects)]
    coordinates = list_coordinates(scene.links, units, free_motors, free_bearings)
    at, rate = (Symbols.of(coordinates, len(scene.links), mark) for mark in ("", "d_"))
    chain = _build_chain(scene.links, effects, basis, at, rate, rules)
    arm = replace(_derive_equations(chain, effects, at, rate, free), coordinates=coordinates, effects=tables)
    arm = _free_motors(arm) if free_motors else arm
    if not scene.loops:
        return arm
    names = [link.name for link in scene.links]
    holders = {names.index(loop.link): names.index(loop.to) for loop in scene.loops if loop.to != BASE}
    return close_scene_loops(replace(arm, points=list_points(chain, holders)), chain, scene, near)


def _check_springs(own: tuple[Effect, ...], freed: tuple[Effect, ...], moving: Iterable[int]) -> None:
    """Refuse free numbers that are 0 in the scene because a joint is stiff: the symbol would let it go."""
    for i in moving:
        for before, after in zip(own, freed, strict=True):
            if before.frees_motor(i) != after.frees_motor(i) or before.frees_bearing(i) != after.frees_bearing(i):
                raise ArgumentError(
                    f"a stiffness of joint {i + 1} is left free, but 0 there stands for a joint that is stiff",
                    got="0",
                    expected="a stiffness greater than 0, to begin with",
                )


def _derive_equations(
    chain: Chain, effects: tuple[Effect, ...], at: Symbols, rate: Symbols, free: Parameters
) -> Manipulator:
    """Lagrange's equations of the chain; the motors drive, and their encoders read, what the chain says their angles are."""
    T, V, R = _sum_energies(chain, effects)
    measured, points = ca.jacobian(chain.motor, at.all), list_points(chain)
    at_joints = _add((effect.joint_resistance(chain) for effect in effects), ca.SX.zeros(len(chain.moving)))
    at_motors = _add((effect.motor_resistance(chain) for effect in effects), ca.SX.zeros(len(chain.moving)))
    stated = [[gain for effect in effects if (gain := effect.input_gain(i)) is not None] for i in chain.moving]
    gains = ca.vertcat(*[of_joint[-1] if of_joint else ca.SX(1) for of_joint in stated])
    arm = Manipulator.from_lagrangian(
        at.all,
        rate.all,
        T,
        V,
        R,
        resistance=ca.densify(ca.jacobian(chain.q, at.all).T @ at_joints + measured.T @ at_motors),
        B=ca.densify(measured.T @ ca.diag(gains)),
        joints=range(len(chain.moving)),
        parameters=free,
        points=points,
        check=False,
    )
    tip = ca.densify(chain.tips[-1].rotation)
    arm = _add_masses_of_curves(arm, chain.masses) if chain.masses else arm
    arm = replace(arm, measured=measured, axes=list_axes(chain)[: points.size1(), :], rotation=tip)
    return _load(arm, chain, effects)


def _add_masses_of_curves(arm: Manipulator, masses: Sequence[InertiaForm]) -> Manipulator:
    """An arm whose links are curves, with their masses and those of its rigid bodies: by virtual work, far shorter than through T.

        T = 1/2 r'.W r',   forces J^T W r'',   M = J^T W J,   J = dr/ds

    r(s): the coordinates of all vectors one below the other, directions in which nothing lies left out. All other arms have their
    masses in the kinetic energy.
    Source: d'Alembert's principle in Lagrange's form; Khang, Dat, Tuan (2019), Eq (55).
    """
    s, s_dot = arm.s, arm.s_dot
    rows = [ca.sparsify(row.T) for row in ca.vertsplit(ca.horzcat(*[mass.vectors for mass in masses]))]
    form = ca.diagcat(*[mass.form for mass in masses])
    moving = [ca.densify(row) for row in rows if row.nnz()]
    r, W = ca.vertcat(*moving), ca.diagcat(*[form for _ in moving])
    rate, J = ca.jtimes(r, s, s_dot), ca.jacobian(r, s)
    acceleration = ca.jtimes(rate, ca.vertcat(s, s_dot), ca.vertcat(s_dot, arm.s_ddot))
    residual = arm.residual + ca.jtimes(r, s, W @ acceleration, True)
    M = arm.M + ca.densify(J.T @ (W @ J))
    return replace(arm, residual=residual, M=M, energy=arm.energy + ca.bilin(W, rate, rate) / 2)


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
    rules: Mapping[int, CurveRule],
) -> Chain:
    """Carry a frame from the base over joints and links to the tips."""
    mounts, axes, joints, links = [], [], [], []
    tips: list[Frame] = []
    parents = list_parents(tables)
    moving = tuple(i for i, table in enumerate(tables) if table.moves)
    of_links = tuple(effect for effect in effects if not (rules and effect.of_curve))
    coupled, shortened = (
        any(isinstance(effect, kind) for effect in effects) for kind in (BendingTorsionCoupling, GeometricStiffening)
    )
    for i, table in enumerate(tables):
        mounts.append(pass_mount(Frame.fixed() if parents[i] == NO_LINK else tips[parents[i]], table))
        axes.append(unit(table.joint_axis))
        place = moving.index(i) if table.moves else None
        displacement = _follow(table, moving, at, rate) if place is None else (at.q[place], rate.q[place])
        frame = pass_joint(mounts[i], table, axes[i], *displacement, at.bearings[i], rate.bearings[i])
        radius = sum(effect.joint_radius(i) for effect in effects)
        base = frame.moved(column(radius, 0, 0), ca.SX(3, 1))
        link = BentLink.of(i, table, basis[i], base, at.modes[i], rate.modes[i], coupled)
        if i in rules:
            link = CurvedLink(**vars(link), rule=rules[i], shortened=shortened)
        joints.append(frame.turned(Z, *link.base_turn))
        links.append(link)
        moved = [(*effect.tip_displacement(link), *effect.tip_turn(link)) for effect in of_links]
        tips.append(link.tip(*(_add((u[k] for u in moved), ca.SX(3, 1)) for k in range(4))))
    q, q_rate = at.q, rate.q
    if any(links[i].table.pinned for i in moving):
        turns = zip(*[links[i].base_turn for i in moving], strict=True)
        q, q_rate = (x + ca.vertcat(*extra) for x, extra in zip((q, q_rate), turns, strict=True))
    motor, motor_rate = (symbols.with_motors(x, moving) for symbols, x in ((at, q), (rate, q_rate)))
    frames = {"mounts": tuple(mounts), "axes": tuple(axes), "joints": tuple(joints), "tips": tuple(tips)}
    give = {"bearings": at.bearings, "bearing_rates": rate.bearings}
    bare = Chain(q, q_rate, motor, motor_rate, moving, links=tuple(links), parents=tuple(parents), **frames, **give)
    bodies = [body for link in links for body in _list_bodies(link, of_links)]
    bodies += [body for effect in effects for body in effect.bodies(bare)]
    if not rules:
        return replace(bare, bodies=tuple(bodies))
    curves = [form for link in links if isinstance(link, CurvedLink) for form in link.inertia()]
    split = [body.split() for body in bodies if body.is_rigid]
    turning = (*(body for body in bodies if not body.is_rigid), *(body for _, body in split))
    return replace(bare, bodies=turning, masses=(*curves, *(mass for mass, _ in split)))


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
    return moved.turned_by((yaw, pitch, roll))


def pass_joint(frame: Frame, link: Link, axis: ca.SX, q: ca.SX, q_rate: ca.SX, give: ca.SX, give_rate: ca.SX) -> Frame:
    """The frame that a link's joint carries: turned by the mount's angle, then by what its bearing gives, then by q about its axis,
    or moved by q along it."""
    if link.joint == "revolute" and is_same(axis, Z) and not give.numel():
        return frame.turned(Z, q + link.mount_angle, q_rate)
    mounted = pass_bearing(frame.turned(Z, link.mount_angle), link, axis, give, give_rate)
    return mounted.moved(axis * q, axis * q_rate) if link.joint == "prismatic" else mounted.turned(axis, q, q_rate)


def _list_bodies(link: BentLink, effects: tuple[Effect, ...]) -> list[Body]:
    """The link's mass as moments in its base frame, and its sections as bodies of their own where it bends far in space."""
    extra = [effect.link_moments(link) for effect in effects]
    own, body = link.moments(), link.table.body
    if body is not None:
        own = own + rigid_moments(body.mass, tensor(**body.inertia.entries()), column(*body.centre))
    J, sections = _sum_sections(link, effects), list[Body]()
    if J is not None and isinstance(link, CurvedLink) and not link.in_plane:
        sections = link.sections(J)
    elif J is not None:
        own = own + turned_sections(link, J)
    return [Body(link.base, sum((moments for moments in extra if moments is not None), own)), *sections]


def _sum_sections(link: BentLink, effects: tuple[Effect, ...]) -> tuple[Any, Any, Any] | None:
    """The sections' principal inertias about x, y and z (kg m^2 for the whole link) from the link's table and from effects, if any."""
    J = [given for effect in effects if (given := effect.section_inertia(link)) is not None]
    if link.table.polar_inertia is not None:
        J.append((link.table.polar_inertia * link.table.length, 0.0, 0.0))
    return (sum(j[0] for j in J), sum(j[1] for j in J), sum(j[2] for j in J)) if J else None


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


def _load(arm: Manipulator, chain: Chain, effects: tuple[Effect, ...]) -> Manipulator:
    """The arm under forces from outside, which stand beside the resisting ones: the gradient of their power by the rates."""
    power = _add((effect.power(chain) for effect in effects), ca.SX(0))
    if power.is_zero():
        return arm
    forces = ca.densify(ca.gradient(power, arm.s_dot))
    if ca.depends_on(power, chain.seen_rate):
        forces = ca.substitute(forces, chain.seen_rate, chain.q_rate[0])
    phase = chain.phase if ca.depends_on(power, chain.phase) else None
    return replace(arm, residual=arm.residual - forces, damping=arm.damping - forces, phase=phase)


def pass_bearing(frame: Frame, link: Link, axis: ca.SX, give: ca.SX, rate: ca.SX) -> Frame:
    """The frame in which a joint turns or slides: tilted about the axes across it, or moved across it, by `give` (2, 1).

    What does not give has no entries. The tilt is exp((e_1 beta_1 + e_2 beta_2)~) to second order.
    """
    if not give.numel():
        return frame
    directions = directions_across(axis)
    moved, moving = directions @ give, directions @ rate
    if link.joint == "prismatic":
        return frame.moved(moved, moving)
    return frame.turned_by(*split_rotation(moved, moving))


def list_axes(chain: Chain) -> ca.SX:
    """World positions (3, COLUMNS links) of points on the links' axes, each link behind where the one that carries it ends.

    What effects add at a link's tip is added in proportion to x. Links that stand on the ground, or slide as a loop lets them, begin at
    their own joint.
    """
    curves = []
    for i, (link, tip) in enumerate(zip(chain.links, chain.tips, strict=True)):
        slides = link.table.passive and link.table.joint == "prismatic"
        before = chain.joints[i] if slides or chain.parents[i] == NO_LINK else chain.tips[chain.parents[i]]
        own = link.axis()
        curves += [before.position, own + (tip.position - own[:, -1]) @ ca.DM(PLACES).T]
    return ca.densify(ca.horzcat(*curves))


Place = tuple[int, bool]
"""A link's joint (link, False) or its tip (link, True)."""


def list_points(chain: Chain, holders: Mapping[int, int] | None = None) -> ca.SX:
    """Where the joints and the last tip are, (2, k) for an arm that cannot leave its plane, else (3, k).

    Where links branch the way goes back along each branch, so two neighbours lie on one body or on the ground. `holders`: for links
    whose tip a loop holds, the link that does: a branch then goes on to that link's tip.
    """
    lengths = [link.table.length for link in chain.links]
    places = walk_tree(chain.parents, holders or {}, [is_same(ca.SX(length), ca.SX(0)) for length in lengths])
    if list(chain.parents) == list(range(-1, len(chain.links) - 1)):
        visited = [frame.position for frame in (*chain.joints, chain.tips[-1])]
    else:
        met = [(chain.tips if at_tip else chain.joints)[i].position for i, at_tip in places]
        visited = [point for k, point in enumerate(met) if k == 0 or not is_same(point, met[k - 1])]
    points = ca.sparsify(ca.horzcat(*visited))
    return ca.densify(points if points[2, :].nnz() else points[:2, :])


def walk_tree(parents: Sequence[int], holders: Mapping[int, int], short: Sequence[bool]) -> list[Place]:
    """The joints and tips that are met from the first link's base to the last link's tip.

    A body that loops alone carry, whose links on the way from the ground have no length (`short`), is met at its tip only.
    """

    def way_to(link: int) -> list[int]:
        return [] if link == NO_LINK else [*way_to(parents[link]), link]

    def places(path: list[int]) -> list[Place]:
        end = [(holders[path[-1]], True)] if path and path[-1] in holders else []
        return [*((i, at_tip) for i in path for at_tip in (False, True)), *end]

    held = set(holders.values())
    ways = [way_to(end) for end in range(len(parents)) if end not in parents]
    drawn = [way for way in ways if not (way[-1] in held and all(short[i] for i in way))]
    walk, before = list[Place](), list[int]()
    for way in drawn:
        shared = sum(a == b for a, b in zip(way, before, strict=False))
        walk += places(before[shared:])[::-1][1:] + places(way[shared:])
        before = way
    last = (len(parents) - 1, True)
    return walk if walk[-1] == last else [*walk, last]
