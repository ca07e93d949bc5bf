"""M, D, K, h of any tree of links by an independent program: accelerations of mass points, and nothing of flexlin but the shapes.

Along s(t + d) = s + s' d + s'' d^2/2 places and rotations are series in d to the second order, products of which are exact. The sections
of a link turn by the solution of R' = R kappa~ (Peano and Baker, to second order), r' = R e_x. With accelerations a of the points of all
bodies, Gibbs and Appell's equations are int (da/ds''_i) . a dm = forces_i; M, D, K are derivatives of their left side by complex steps,
exact to rounding. Source: Appell, Traite de mecanique rationnelle II (1904), chapter 24; Squire, Trapp, SIAM Review 40 (1998) 110.
"""

from dataclasses import dataclass

import numpy as np
from numpy.polynomial import legendre

from flexlin.mechanics import make_shapes

STEP = 1e-30


@dataclass
class Series:
    """x0 + x1 d + x2 d^2, arrays (batch, ...)."""

    x: tuple

    @classmethod
    def of(cls, constant):
        return cls((np.asarray(constant), 0.0, 0.0))

    def map(self, rule):
        return Series(tuple(rule(part) if np.ndim(part) else part for part in self.x))

    def __add__(self, other):
        return Series(tuple(a + b for a, b in zip(self.x, other.x, strict=True)))

    def __matmul__(self, other):
        (a, b, c), (d, e, f) = self.x, other.x
        return Series((times(a, d), times(a, e) + times(b, d), times(a, f) + times(b, e) + times(c, d)))


def times(a, b):
    """Matrix product; 0.0 is any zero."""
    return a @ b if np.ndim(a) and np.ndim(b) else 0.0


def skew(v):
    """v~ of vectors (..., 3, 1)."""
    x, y, z = (v[..., i, 0] for i in range(3))
    none = np.zeros_like(x)
    return np.stack([none, -z, y, z, none, -x, -y, x, none], -1).reshape(*x.shape, 3, 3)


def turn_about(axis, angle):
    """exp(angle axis~) of a series of angles (batch, 1, 1)."""
    (a, b, c), K = angle.x, skew(np.asarray(axis, float)[:, None])
    b, c = b + 0 * a, c + 0 * a
    s = np.sin(a), np.cos(a) * b, np.cos(a) * c - np.sin(a) * b**2 / 2
    v = 1 - np.cos(a), np.sin(a) * b, np.sin(a) * c + np.cos(a) * b**2 / 2
    first, *rest = (si * K + vi * (K @ K) for si, vi in zip(s, v, strict=True))
    return Series((np.eye(3) + first, *rest))


def small_turn(tilt):
    """exp(tilt~) to second order, of a series of vectors (..., 3, 1)."""
    K = tilt.map(skew)
    return Series.of(np.eye(3)) + K + (K @ K).map(lambda x: x / 2)


def across(axis):
    """Two directions across an axis: Duff et al., J. Computer Graphics Techniques 6 (2017) 1."""
    x, y, z = axis
    sign = -1.0 if z < 0 else 1.0
    a = -1 / (sign + z)
    return np.array([[1 + sign * x * x * a, x * y * a], [sign * x * y * a, sign + y * y * a], [-sign * x, -y]])


def each(value, i, single=True):
    """A number of an effect for a joint or link: of a list by place, else for every one, or where `single` says so."""
    return (value[i] if i < len(value) else 0.0) if isinstance(value, tuple) else value if single else 0.0


class Elastic:
    """The shapes of a link in one direction at Gauss nodes of pieces."""

    def __init__(self, scene, i, direction, xi, count):
        shapes = make_shapes(scene, i, direction) if count else None
        none, looks = np.zeros((len(xi), 0)), (("values", 0), ("values", 1), ("rotation", 0), ("rotation", 1))
        found = (getattr(shapes, name)(xi, order).T if count else none for name, order in looks)
        self.X, self.dX, self.psi, self.dpsi = found
        self.beta = shapes.beta if count else np.zeros(0)


class Jury:
    """The equations of a scene without closed loops."""

    def __init__(self, scene):
        self.scene, self.effects = scene, {name: getattr(scene.effects, name) for name in scene.effects.on()}
        links = scene.links
        names = [link.name for link in links]
        places = {None: range(-1, len(links) - 1), "base": [-1] * len(links)}
        self.parents = [
            places[link.parent][i] if link.parent in places else names.index(link.parent)
            for i, link in enumerate(links)
        ]
        self.moving = [i for i, link in enumerate(links) if link.joint != "fixed" and link.mimic is None]
        place = len(self.moving)
        self.modes, self.nodes = [], []
        for i, link in enumerate(links):
            self.modes.append({})
            for direction, count in link.counts.by_direction().items():
                self.modes[i][direction] = slice(place, place + count)
                place += count
            self.nodes.append(self.lay_nodes(i, link))
        give, spring = (
            [i for i in self.moving if effect in self.effects and each(self.effects[effect].stiffness, i) > 0]
            for effect in ("bearing_compliance", "joint_flexibility")
        )
        self.bearings = {i: slice(place + 2 * k, place + 2 * k + 2) for k, i in enumerate(give)}
        self.motors = {i: place + 2 * len(give) + k for k, i in enumerate(spring)}
        self.n = place = place + 2 * len(give) + len(spring)
        # the joints' displacements as their bearings and as their motors see them, rows of s
        self.q, self.motor = np.zeros((2, len(self.moving), place))
        for k, i in enumerate(self.moving):
            self.q[k, k] = 1.0
            if links[i].mode_shapes.startswith("pinned"):
                self.q[k, self.modes[i]["y"]] = self.nodes[i]["y"].psi[0] / links[i].length
            self.motor[k] = np.eye(place)[self.motors[i]] if i in self.motors else self.q[k]

    def lay_nodes(self, i, link):
        """Places from 0 to 1 with weights of integrals over all and up to each of them; shapes and profiles there."""
        of = link.counts.by_direction()
        breaks = {b for d, count in of.items() if count for b in make_shapes(self.scene, i, d).breaks}
        table = link.sections
        edges = np.unique([0.0, 1.0, *breaks, *(table.at if table else ())])
        nodes, weights = legendre.leggauss(8 + 40 // (len(edges) - 1))
        half, m = np.diff(edges) / 2, len(nodes)
        xi = np.r_[0.0, (edges[:-1, None] + half[:, None] * (nodes + 1)).ravel(), 1.0]
        weight = np.r_[0.0, np.outer(half, weights).ravel(), 0.0]
        primitives = [legendre.legval(nodes, legendre.legint(row, lbnd=-1)) for row in np.eye(m)]
        inside = np.stack(primitives, 1) @ np.linalg.inv(legendre.legvander(nodes, m - 1))
        upto = np.zeros((len(xi), len(xi)))
        for k, size in enumerate(half):
            own = slice(1 + k * m, 1 + (k + 1) * m)
            upto[own, own], upto[own.stop :, own] = size * inside, weight[own]
        mu, eps = np.ones((2, len(xi)))
        if table:
            mu, eps = (np.interp(xi, table.at, part) for part in (table.mass, table.stiffness))
        found = {"xi": xi, "weight": weight, "upto": upto, "mu": mu, "eps": eps}
        return found | {d: Elastic(self.scene, i, d, xi, count) for d, count in of.items()}

    def bodies(self, s, rate, acceleration):
        """Series of places (batch, N, 3, 1) and rotations (batch, N, 3, 3) of all bodies, with masses and second moments of points.

        Returns: list of (place or None, rotation or None, masses (N,), second moments (N, 3, 3)), rotation and place of the last tip.
        """
        effects, links = self.effects, self.scene.links
        path = [s, rate, acceleration / 2]

        def pick(rows):
            return Series(tuple((part @ rows)[:, :, None] for part in path))

        tips, found, ground = [], [], (Series.of(np.eye(3)[None]), Series.of(np.zeros((1, 3, 1))))
        for i, link in enumerate(links):
            R, p = tips[self.parents[i]] if self.parents[i] >= 0 else ground
            p = p + R @ Series.of(np.array(link.mount.xyz)[:, None])
            roll, pitch, yaw = link.mount.rpy
            for axis, angle in zip("zyxz", (yaw, pitch, roll, link.mount_angle), strict=True):
                R = R @ turn_about(np.eye(3)["xyz".index(axis)], Series.of(np.full((1, 1, 1), angle)))
            axis = np.array(link.axis or ((1.0, 0, 0) if link.joint == "prismatic" else (0, 0, 1.0)), float)
            axis = axis / np.linalg.norm(axis)
            place = self.moving.index(i) if i in self.moving else None
            if place is not None and "rotor_spin" in effects and link.joint == "revolute":
                found += self.rotor(i, place, R, axis, pick)
            if i in self.bearings:
                give = pick(np.eye(self.n)[self.bearings[i]].T @ across(axis).T)
                R, p = (R @ small_turn(give), p) if link.joint == "revolute" else (R, p + R @ give)
            if place is not None:
                q = pick(np.eye(self.n)[:, [place]])
            elif link.mimic is not None:
                followed = np.eye(self.n)[:, [self.moving.index(link.mimic.link)]]
                q = pick(followed * link.mimic.multiplier) + Series.of(np.full((1, 1, 1), link.mimic.offset))
            if link.joint == "prismatic":
                p = p + R @ q.map(lambda x, axis=axis: axis[:, None] * x)
            elif link.joint == "revolute":
                R = R @ turn_about(axis, q)
            hub, before = effects.get("hub"), R
            if hub and link.mode_shapes.startswith("pinned"):
                slope = np.zeros((self.n, 1))
                slope[self.modes[i]["y"], 0] = self.nodes[i]["y"].psi[0] / link.length
                before = R @ turn_about([0, 0, 1], pick(slope))
            if hub:
                inertia = each(hub.inertia, i, i == 0) * np.outer(axis, axis)
                found.append((p, before, each(hub.mass, i, i == 0), np.zeros(3), inertia))
                p = p + R @ Series.of(np.array([each(hub.radius, i, i == 0), 0, 0])[:, None])
            bearing = effects.get("bearing_compliance")
            if bearing and i in self.moving and link.joint == "revolute":
                inertia = each(bearing.inertia, i) * (np.eye(3) - np.outer(axis, axis))
                found.append((p, before, 0.0, np.zeros(3), inertia))
            if link.body:
                found.append((p, R, link.body.mass, np.array(link.body.centre), np.array(link.body.inertia.rows())))
            of_link, tip = self.bend(i, link, R, p, pick)
            found += of_link
            tips.append(tip)
            payload, last = effects.get("payload"), i == len(links) - 1
            if payload:
                mass, inertia, offset = (each(getattr(payload, key), i, last) for key in ("mass", "inertia", "offset"))
                centre, J = np.array([offset, 0.0, 0.0]), np.diag([0.0, 0.0, inertia])
                if last:
                    centre, J = centre + payload.centre, J + np.array(payload.tensor.rows())
                found.append((tip[1], tip[0], mass, centre, J))
        return found, tips[-1]

    def rotor(self, i, place, R, axis, pick):
        """What a rotor on the link before a joint adds by turning N times as fast: the whole, less the two squares that others have."""
        spin = self.effects["rotor_spin"]
        ratio, J = each(spin.gear_ratio, i), each(spin.inertia, i) * np.outer(axis, axis)
        turned = turn_about(axis, pick(self.motor[place][:, None]).map(lambda x: ratio * x))
        parts = (R @ turned, J), (R, -J), (Series.of(np.eye(3)[None]) @ turned, -J)
        return [(Series.of(np.zeros((1, 3, 1))), turn, 0.0, np.zeros(3), inertia) for turn, inertia in parts]

    def bend(self, i, link, R, p, pick):
        """The bodies of a link's points and sections, and its tip."""
        k, length, along_x = self.nodes[i], link.length, np.array([[1.0], [0], [0]])
        coupled, stiffened = (name in self.effects for name in ("bending_torsion_coupling", "geometric_stiffening"))

        def field(**forms):
            """Vectors (batch, places, 3, 1) from what a unit of each coordinate makes of their x, y, z."""
            rows = np.zeros((self.n, len(k["xi"]), 3))
            for axis, (direction, form) in forms.items():
                rows[self.modes[i][direction], :, "xyz".index(axis)] = form.T
            return pick(rows.reshape(self.n, -1)).map(lambda x: x.reshape(len(x), -1, 3, 1))

        def upto(series):
            rule = k["upto"]
            return series.map(lambda x: (rule @ x.reshape(len(x), len(rule), -1)).reshape(x.shape))

        y, z, twist = (k[direction] for direction in ("y", "z", "torsion"))
        shift, slope = field(y=("y", y.X), z=("z", z.X)), field(y=("z", -z.dX / length), z=("y", y.dX / length))
        theta = field(x=("torsion", twist.psi), y=("z", -z.psi / length), z=("y", y.psi / length)).map(skew)
        curved = field(x=("torsion", twist.dpsi), y=("z", -z.dpsi / length), z=("y", y.dpsi / length)).map(skew)
        square = (theta @ theta).map(lambda x: x / 2)
        second = upto(theta @ curved) + square.map(lambda x: x[:, :1])  # of R; shapes that are pinned are turned at 0
        drawn = upto((slope.map(lambda x: np.swapaxes(x, -1, -2)) @ slope).map(lambda x: -length / 2 * x))
        bent = upto(second.map(lambda x: length * x[..., :1]))
        places = shift + Series.of(length * k["xi"][:, None, None] * along_x)
        places = places + Series.of(stiffened * along_x) @ drawn + Series.of(coupled * np.diag([0.0, 1, 1])) @ bent
        turned = Series.of(np.eye(3)) + theta + (second if coupled else square)
        places = p.map(lambda x: x[:, None]) + R.map(lambda x: x[:, None]) @ places
        turned = R.map(lambda x: x[:, None]) @ turned
        found = [(places, None, link.mass_per_length * length * k["mu"] * k["weight"], None, None)]
        J = self.sections(i, link)
        if J is not None:
            found.append((None, turned, None, None, length * (k["eps"] * k["weight"])[:, None, None] * np.diag(J)))
        return found, tuple(part.map(lambda x: x[:, -1]) for part in (turned, places))

    def sections(self, i, link):
        """Inertias of the sections per length about x, y, z."""
        rotary, polar = self.effects.get("rotary_inertia"), link.polar_inertia or 0.0
        if rotary is None:
            return np.array([polar, 0.0, 0.0]) if polar else None
        about_z = link.mass_per_length * each(rotary.radius_of_gyration, i) ** 2
        return np.array([polar, polar - about_z if polar else 0.0, about_z])

    def inertial(self, s, rate, acceleration, phase):
        """Forces of inertia and weight less those of loads, (states, paths, n): of paths through states (states, n).

        From accelerations along the paths, and along each unit of s'' from rest.
        """
        states, paths, n = rate.shape
        at_rest = np.zeros((states, n, n)), np.broadcast_to(np.eye(n), (states, n, n))
        rates, accelerations = np.concatenate([(rate, acceleration), at_rest], axis=2)
        every = paths + n
        found, (R, p) = self.bodies(np.repeat(s, every, axis=0), rates.reshape(-1, n), accelerations.reshape(-1, n))

        def both(series, last=2):
            """An order of a series along the paths and the units."""
            x = np.asarray(series.x[last])
            if not x.ndim:
                return None
            x = np.broadcast_to(x, (states * every, *x.shape[1:]))
            x = x.reshape(states, every, -1, *x.shape[-2:])
            return x[:, :paths], x[:, paths:]

        def add(series, spread, less):
            """(da/ds''_i) . (a - less) over the columns of points with second moments `spread` (..., k, k)."""
            found = both(series)
            if found is None:
                return 0.0
            along, units = found
            pull = (2 * along - less[:, None]) @ spread
            return 2 * pull.reshape(states, paths, -1) @ np.swapaxes(units.reshape(states, n, -1), 1, 2)

        gravity, g = self.effects.get("gravity"), np.zeros(3)
        if gravity:
            g = gravity.acceleration * np.array(gravity.direction) / np.linalg.norm(gravity.direction)
        force = np.zeros((states, paths, n), dtype=complex)
        for place, turned, mass, centre, J in found:
            if mass is not None:
                moved = place if centre is None or not np.any(centre) else place + turned @ Series.of(centre[:, None])
                force = force + add(moved, np.reshape(mass, (-1, 1, 1)), g)
            if J is not None:
                spread = np.trace(J, axis1=-2, axis2=-1)[..., None, None] / 2 * np.eye(3) - J
                force = force + add(turned, spread, np.zeros(3))
        load = self.effects.get("tip_force")
        if load is None:
            return force
        # the units' R'' R^T is the skew matrix of an angular velocity's derivative
        R0, shift, turn = both(R, 0)[0], 2 * both(p)[1], 2 * both(R)[1]
        spin = (turn @ np.swapaxes(R0[:, :1], -1, -2))[:, :, 0]
        spin = np.stack([spin[..., j, i] - spin[..., i, j] for i, j in ((1, 2), (2, 0), (0, 1))], -1) / 2
        push, twist = (np.array(part)[:, None] for part in (load.force, load.torque))
        if load.frame == "tip":
            push, twist = R0[:, :, 0] @ push, R0[:, :, 0] @ twist
        wave = np.cos(2 * np.pi * load.harmonic * phase + load.phase) if load.harmonic else 1.0
        power = shift[:, None, :, 0, :, 0] @ push + spin[:, None] @ twist
        return force - wave * power[..., 0]

    def residual(self, s, rate, acceleration, phase):
        """All forces of the left side, (states, paths, n)."""
        force = self.inertial(s, rate, acceleration, phase)
        stiffness, damping, inertia = self.constant()
        force = force + (s @ stiffness)[:, None] + rate @ damping + acceleration @ inertia
        friction = self.effects.get("coulomb_friction")
        if friction:
            rows = self.motor if friction.at == "motor" else self.q
            for k, i in enumerate(self.moving):
                v, level = rate @ rows[k], each(friction.torque, i)
                if friction.stribeck is not None:
                    slow = np.exp(-((v / each(friction.stribeck, i)) ** 2))
                    level = level + (each(friction.static, i) - level) * slow
                force = force + (level * np.tanh(v / each(friction.rate, i)))[..., None] * rows[k]
        return force

    def constant(self):
        """Stiffness, damping and inertia that do not depend on the state."""
        effects, n = self.effects, self.n
        K, D, M = np.zeros((3, n, n))
        for i, link in enumerate(self.scene.links):
            for direction, own in self.modes[i].items():
                if own.stop > own.start:
                    self.add_link(K, D, i, link, direction, own)
        for k, i in enumerate(self.moving):
            q, motor = self.q[k], self.motor[k]
            if table := effects.get("joint_flexibility"):
                K += each(table.stiffness, i) * np.outer(motor - q, motor - q)
                D += each(table.damping, i) * np.outer(motor - q, motor - q)
                M += each(table.motor_inertia, i) * np.outer(motor, motor)
            if table := effects.get("motor"):
                keys = "gear_ratio", "torque_constant", "resistance", "rotor_inertia"
                N, k_t, ohm, J = (each(getattr(table, key), i) for key in keys)
                M += N**2 * J * np.outer(motor, motor)
                D += (N * k_t) ** 2 / ohm * np.outer(motor, motor)
            if table := effects.get("viscous_friction"):
                row = motor if table.at == "motor" else q
                D += each(table.coefficient, i) * np.outer(row, row)
            if i in self.bearings:
                table, own = effects["bearing_compliance"], self.bearings[i]
                K[own, own] += each(table.stiffness, i) * np.eye(2)
                D[own, own] += each(table.damping, i) * np.eye(2)
        return K, D, M

    def add_link(self, K, D, i, link, direction, own):
        """What a link's modes in one direction resist."""
        k, length, effects = self.nodes[i], link.length, self.effects
        part = k[direction]
        twist = direction == "torsion"
        rigidity = link.torsional_stiffness if twist else link.bending_stiffness
        if isinstance(rigidity, tuple):
            rigidity = rigidity[1] if direction == "y" else rigidity[0]
        bending = rigidity / length ** (1 if twist else 3) * (part.dpsi.T * (k["weight"] * k["eps"])) @ part.dpsi
        shear = np.zeros_like(bending)
        if "shear" in effects and not twist:
            slip = part.dX - part.psi
            shear = each(effects["shear"].stiffness, i) / length * (slip.T * (k["weight"] * k["mu"])) @ slip
        mass = link.polar_inertia * length if twist else link.mass_per_length * length
        shape, profile = (part.psi, k["eps"]) if twist else (part.X, k["mu"])
        own_mass = mass * (shape.T * (k["weight"] * profile)) @ shape
        K[own, own] += bending + shear
        if table := effects.get("modal_damping"):
            density = link.polar_inertia if twist else link.mass_per_length * length**2
            omega = part.beta**2 * np.sqrt(rigidity / density) / length
            given = table.ratio if isinstance(table.ratio, tuple) else (table.ratio,)
            ratio = np.array([given[min(m, len(given) - 1)] for m in range(len(omega))])
            D[own, own] += np.diag(2 * ratio * np.diag(bending + shear) / omega)
        if table := effects.get("rayleigh_damping"):
            D[own, own] += table.mass_factor * own_mass + table.stiffness_factor * bending
        if table := effects.get("kelvin_voigt_damping"):
            D[own, own] += each(table.retardation_time, i) * bending

    def linearized(self, q, rate, acceleration, phase):
        """M, D, K, h about the rigid motion whose joints are at q with these rates and accelerations."""
        n, at = self.n, np.zeros((3, self.n))
        for k, i in enumerate(self.moving):
            at[:, k] = q[k], rate[k], acceleration[k]
            if i in self.motors:
                at[:, self.motors[i]] = at[:, k]
        step, (still, moving, pushed) = 1j * STEP * np.eye(n), at
        turned = self.residual(still + step, np.tile(moving + 0j, (n, 1, 1)), np.tile(pushed, (n, 1, 1)), phase)
        rates, accelerations = np.r_[moving + step, moving + 0 * step], np.r_[pushed + 0 * step, pushed + step]
        driven = self.residual(still[None], rates[None], accelerations[None], phase)[0]
        K, D, M = (part.imag.T / STEP for part in (turned[:, 0], driven[:n], driven[n:]))
        return M, D, K, -driven[0].real
