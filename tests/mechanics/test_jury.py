"""Random trees with every effect against an independent program, entry by entry: M, D, K, h along a motion."""

import numpy as np
import pytest

import flexlin as fl
from flexlin.scene import known_effects, parse_scene
from tests.thinned import thin

from .jury import Jury
from .spatial import random_inertia, table_of


def random_link(rng, space, scale):
    """A raw link: rigid or bent in any way, uniform or tapered, on any joint."""
    length, mass, EI = rng.uniform(0.3, 1.0), rng.uniform(0.1, 1.0), rng.uniform(0.5, 50.0)
    about_z, about_y = mass * (scale * length * rng.uniform(0.3, 1.0, 2)) ** 2
    link = {"length": length, "mass_per_length": mass, "bending_stiffness": EI, "joint": "revolute"}
    link["modes"] = int(rng.integers(0, 3))
    shapes = ["clamped-free", "clamped-loaded", "pinned-free", "pinned-hub", "finite-element"]
    link["mode_shapes"] = str(rng.choice(shapes))
    if space:
        y, z, torsion = (int(count) for count in rng.integers(0, 3, 3))
        link |= {"modes": {"y": y, "z": z, "torsion": torsion}, "bending_stiffness": [EI, EI * rng.uniform(0.2, 5.0)]}
        link |= {"torsional_stiffness": EI * rng.uniform(0.2, 2.0), "polar_inertia": about_y + about_z}
        link["mode_shapes"] = str(rng.choice([shapes[0], shapes[1], shapes[4]]))
        link["mount"] = {"xyz": rng.normal(0, 0.2, 3).tolist(), "rpy": rng.uniform(-3, 3, 3).tolist()}
        if rng.random() < 0.7:
            link["axis"] = rng.normal(size=3).tolist() if rng.random() < 0.5 else np.eye(3)[rng.integers(3)].tolist()
    if link["mode_shapes"] == "finite-element":
        link["elements"] = 5
    if not link["mode_shapes"].startswith("pinned"):
        link["joint"] = str(rng.choice(["revolute", "revolute", "revolute", "prismatic", "fixed"]))
    if link["joint"] == "fixed":
        link.pop("axis", None)
    if rng.random() < 0.4:
        link["mount_angle"] = float(rng.uniform(-3, 3))
    if rng.random() < 0.3:
        link["sections"] = {"at": [0.0, 0.4, 1.0], "mass": [1.2, 1.0, 0.6], "stiffness": [1.5, 1.1, 0.5]}
    if space and rng.random() < 0.3:
        body = rng.uniform(0.1, 1.0)
        link["body"] = {"mass": body, "centre": rng.normal(0, 0.1, 3).tolist()}
        link["body"]["inertia"] = table_of(random_inertia(rng, body))
    return link, np.sqrt(about_z / mass)


def effect_tables(rng, space, gyration):
    """Raw tables of all effects but hubs, of so many links as there are radii of gyration."""

    def vector(scale):
        return (scale * (rng.normal(size=3) if space else np.r_[rng.normal(size=2), 0])).tolist()

    def numbers(low, high):
        return rng.uniform(low, high, len(gyration)).tolist()

    def springs():
        return numbers(20, 90)[1:]

    payload = {"mass": numbers(0, 0.3), "inertia": numbers(0, 0.01), "offset": numbers(0, 0.1)}
    if space:
        payload |= {"centre": vector(0.05), "tensor": table_of(random_inertia(rng, 0.2))}
    return {
        "gravity": {"acceleration": 9.81, "direction": vector(1.0)},
        "payload": payload,
        "geometric_stiffening": {},
        "rotary_inertia": {"radius_of_gyration": gyration},
        "bending_torsion_coupling": {},
        "shear": {"stiffness": numbers(50, 500)},
        "modal_damping": {"ratio": [0.01, 0.03]},
        "rayleigh_damping": {"mass_factor": 0.1, "stiffness_factor": 1e-3},
        "kelvin_voigt_damping": {"retardation_time": numbers(1e-3, 1e-2)},
        "joint_flexibility": {"stiffness": [*springs(), 0.0], "motor_inertia": numbers(0.01, 0.1), "damping": 0.3},
        "bearing_compliance": {"stiffness": [0.0, *springs()], "damping": numbers(0, 1), "inertia": numbers(0.01, 0.1)},
        "viscous_friction": {"coefficient": numbers(0, 1), "at": str(rng.choice(["joint", "motor"]))},
        "coulomb_friction": {"torque": numbers(0, 0.4), "rate": 0.5, "static": 0.5, "stribeck": 0.8},
        "motor": {"torque_constant": 0.05, "resistance": 2.0, "gear_ratio": numbers(10, 60), "rotor_inertia": 1e-5},
        "rotor_spin": {"inertia": numbers(1e-6, 3e-5), "gear_ratio": numbers(-80, 80)},
        "tip_force": {
            "force": vector(2.0),
            "torque": vector(0.4) if space else [0, 0, 0.4],
            "harmonic": 2,
            "phase": 0.3,
        },
    }


def random_effects(rng, space, links, gyration):
    """Raw tables of effects, each on with even chances."""
    tables = effect_tables(rng, space, gyration)
    pinned = any(link["mode_shapes"].startswith("pinned") for link in links)
    assert set(tables) | {"hub"} == set(known_effects())
    if rng.random() < 0.5:
        tables["tip_force"]["frame"] = "tip"
    chosen = {name: table for name, table in tables.items() if rng.random() < 0.5}
    if "shear" in chosen and any(link["mode_shapes"] == "finite-element" for link in links):
        del chosen["shear"]
    if pinned or rng.random() < 0.5:
        radius = 0.0 if pinned else rng.uniform(0, 0.1, len(links)).tolist()
        inertia, mass = rng.uniform(0.01, 0.1, len(links)), rng.uniform(0, 0.3, len(links))
        chosen["hub"] = {"inertia": inertia.tolist(), "mass": mass.tolist(), "radius": radius}
    return chosen


def random_scene(seed, **instead):
    """A tree of one to four links in a plane or in space; `instead`: tables of effects."""
    rng = np.random.default_rng(seed)
    space, count = bool(seed % 2), int(rng.integers(1, 5))
    scale = float(rng.choice([0.02, 0.2]))
    links, gyration = (list(part) for part in zip(*[random_link(rng, space, scale) for _ in range(count)], strict=True))
    for i, link in enumerate(links):
        link["name"] = f"link{i}"
        if i and rng.random() < 0.4:
            link["parent"] = str(rng.choice(["base", *(f"link{k}" for k in range(i))]))
        moving = [k for k in range(i) if links[k]["joint"] != "fixed" and "mimic" not in links[k]]
        if moving and link["joint"] != "fixed" and not link["mode_shapes"].startswith("pinned") and rng.random() < 0.2:
            link["mimic"] = {"link": int(rng.choice(moving)), "multiplier": 0.6, "offset": 0.2}
    if all(link["joint"] == "fixed" for link in links):
        return random_scene(seed + 1000, **instead)
    effects = random_effects(rng, space, links, [float(radius) for radius in gyration])
    joints = [
        {"mean": float(rng.uniform(-1, 1)), "amplitude": float(rng.uniform(0.2, 1)), "phase": float(rng.uniform(-3, 3))}
        for link in links
        if link["joint"] != "fixed" and "mimic" not in link
    ]
    motion = {"kind": "harmonic", "frequency": 0.8, "joints": joints}
    return parse_scene({"schema": 1, "title": "tree", "links": links, "effects": effects | instead, "motion": motion})


RARE = (36, 42, 44, 45, 47, 50, 54, 62, 63, 72)
"""Trees whose links bend by shear, some of them pinned."""
QUICK = (11, 42, 50, 63)
"""Small trees that together have every effect."""


@pytest.mark.parametrize(
    "seed", thin([*QUICK, *(seed for seed in (*range(16), 43, *RARE) if seed not in QUICK)], len(QUICK))
)
def test_a_random_tree_entry_by_entry(seed):
    scene = random_scene(seed)
    lin, t = fl.linearize(fl.build_manipulator(scene), scene.motion), 0.21
    q, rate, acceleration = (part[0] for part in lin.motion.sample(np.array([t])))
    expected = Jury(scene).linearized(q, rate, acceleration, t / lin.period)
    for name, own, other in zip("MDKh", (lin.M(t), lin.D(t), lin.K(t), lin.h(t)), expected, strict=True):
        size = max(np.abs(other).max(), 1.0)
        np.testing.assert_allclose(own, other, rtol=0, atol=1e-11 * size, err_msg=f"{name} {lin.names}")
