"""Sections in their own terms against tables and closed forms, and what contradicts them."""

import numpy as np
import pytest

import flexlin as fl
from flexlin.scene import MATERIALS, CrossSection, scene_schema, strip, tube
from tests.mechanics.scenes import swinging

LINK = {"length": 1.0, "modes": 2, "section": {"width": "30 mm", "thickness": "2 mm", "material": "aluminium"}}


def parse(*links, effects=None, **more):
    motion = swinging(*[{"amplitude": 0.3}] * len(links))
    return fl.parse_scene(
        {"schema": 1, "title": "sections", "links": list(links), "motion": motion, "effects": effects or {}}, **more
    )


@pytest.mark.parametrize(
    ("ratio", "known"), [(1, 0.1406), (1.5, 0.196), (2, 0.229), (3, 0.263), (5, 0.291), (10, 0.312)]
)
def test_torsion_of_a_rectangle(ratio, known):
    """J = k a b^3: Timoshenko, Goodier, Theory of Elasticity, section 109, table of k; whichever side is the longer one."""
    for sides in ((ratio * 0.01, 0.01), (0.01, ratio * 0.01)):
        assert strip(*sides, 0.3)[3] / (ratio * 0.01**4) == pytest.approx(known, abs=6e-4)


def test_areas_and_second_moments_are_integrals():
    """Of a strip 3 x 2 and of a tube 3/2, by the midpoint rule on a million cells."""
    y, z = np.meshgrid(*[(np.arange(1200) + 0.5) / 1200 * 6 - 3] * 2)
    r = np.hypot(y, z)
    pairs = (strip(2.0, 3.0, 0.3), (abs(y) < 1.5) & (abs(z) < 1.0)), (tube(3.0, 2.0, 0.3), (r < 3) & (r > 2))
    for made, inside in pairs:
        expected = [0.005**2 * np.sum(part[inside]) for part in (np.ones_like(y), z**2, y**2)]
        np.testing.assert_allclose(made[:3], expected, rtol=1e-4)


def test_shear_coefficients():
    """Cowper (1966), nu = 0.3: rectangle 0.850, circle 0.886, thin tube 0.531."""
    thin = tube(1.0, 0.999999, 0.3)
    assert [strip(1.0, 2.0, 0.3)[4], tube(1.0, 0.0, 0.3)[4], thin[4]] == pytest.approx([0.850, 0.886, 0.531], abs=1e-3)
    assert thin[3] == pytest.approx(2 * np.pi * 1e-6, rel=1e-5)  # J = 2 pi r^3 t


def test_a_strip_of_aluminium():
    """30 x 2 mm: rhoA, E I about y (width^3) and z (thickness^3), G J, rho I_p; a planar arm bends across the thickness."""
    link = parse(LINK).links[0]
    E, density = 68.9e9, 2710.0
    assert link.mass_per_length == pytest.approx(density * 6e-5)
    assert link.bending_stiffness == pytest.approx((E * 0.002 * 0.03**3 / 12, E * 0.03 * 0.002**3 / 12))
    assert link.stiffness_in("y") == pytest.approx(1.378)
    assert link.polar_inertia == pytest.approx(density * (0.002 * 0.03**3 + 0.03 * 0.002**3) / 12)
    assert link.torsional_stiffness == pytest.approx(E / 2.7 * 0.03 * 0.002**3 / 3 * (1 - 0.63 * 2 / 30), rel=1e-4)
    written = {"width": 0.03, "thickness": 0.002, **MATERIALS["aluminium"]}
    assert CrossSection(**written).figures() == CrossSection(**LINK["section"]).figures()


def test_what_is_written_out_goes_before_the_material():
    own = CrossSection(diameter="20 mm", wall="1 mm", material="steel", youngs_modulus="210 GPa", density="7.8 g/cm^3")
    figures = own.figures()
    assert figures["bending_stiffness"][0] == pytest.approx(210e9 * np.pi / 64 * (0.02**4 - 0.018**4))
    assert figures["mass_per_length"] == pytest.approx(7800 * np.pi / 4 * (0.02**2 - 0.018**2))


def test_effects_follow_where_every_link_has_a_section():
    on = parse(LINK, LINK, effects={"shear": {}, "rotary_inertia": {}}).effects
    assert on.rotary_inertia.radius_of_gyration == pytest.approx((0.002 / 12**0.5,) * 2)
    assert on.shear.stiffness == pytest.approx((10 * 1.35 / (12 + 11 * 0.35) * 68.9e9 / 2.7 * 6e-5,) * 2)
    assert parse(LINK, effects={"shear": {"stiffness": 3.0}}).effects.shear.stiffness == 3.0
    plain = {"length": 1.0, "mass_per_length": 1.0, "bending_stiffness": 1.0}
    with pytest.raises(fl.errors.SceneError, match=r"effects\.shear\.stiffness: got nothing"):
        parse(LINK, plain, effects={"shear": {}})


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"bending_stiffness": 3.0}, r"links\.0\.bending_stiffness: got 3\.0 beside section, expected no value"),
        ({"section": {"width": 0.03, "material": "steel"}}, "expected width and thickness of a strip"),
        ({"section": {"diameter": 0.03, "wall": 0.015, "material": "steel"}}, "a wall thinner than half"),
        ({"section": {"diameter": 0.03}}, "material, one of aluminium, steel"),
        ({"section": {"diameter": "3 kg", "material": "steel"}}, r"section\.diameter: got '3 kg', expected a number in m, or a length"),
        ({"section": {"diameter": 0.03, "material": "wood"}}, r"section\.material: got 'wood'"),
        ({"section": {"diamter": 0.03}}, "did you mean 'diameter'"),
        ({"section": 0.03}, r"links\.0\.section: got 0\.03, expected a table"),
    ],
)  # fmt: skip
def test_refusals(change, words):
    with pytest.raises(fl.errors.SceneError, match=words) as refused:
        parse({**LINK, **change})
    assert len(refused.value.problems) == 1


def test_overrides_change_a_section_and_the_schema_knows_it():
    thick = parse(LINK, overrides={"links.0.section.thickness": "4 mm"})
    assert thick.links[0].stiffness_in("y") == pytest.approx(8 * 1.378)
    assert thick.links[0].section is None
    known = scene_schema()["$defs"]
    assert known["Link"]["properties"]["section"]["anyOf"][0] == {"$ref": "#/$defs/CrossSection"}
    assert {"required": ["length", "section"]} in known["Link"]["anyOf"]
    assert "required" not in known["Shear"]
