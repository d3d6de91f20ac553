from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from vvvaltr.twin.bodies import BODIES, icosahedron6, make_body, prism3
from vvvaltr.twin.body import ConstantForce, EccentricForce, apply_damage, disable, lighten, snap
from vvvaltr.twin.presets import PLANAR_PARTS

PRISM = prism3(PLANAR_PARTS)
ICOSAHEDRON = icosahedron6(PLANAR_PARTS)


def spring_lengths_m(body):
    nodes = np.array(body.nodes_m)
    return [float(np.linalg.norm(nodes[a] - nodes[b])) for a, b in (spring.nodes for spring in body.springs)]


@pytest.mark.parametrize("body", [PRISM, ICOSAHEDRON], ids=lambda body: body.name)
def test_struts_have_their_length_springs_are_equally_long_and_the_mass_adds_up(body):
    nodes = np.array(body.nodes_m)

    assert np.linalg.norm(nodes[0::2] - nodes[1::2], axis=1) == pytest.approx(0.094)
    assert np.ptp(spring_lengths_m(body)) < 1e-12
    assert body.masses_kg.sum() == pytest.approx(0.080)
    assert nodes[:, 2].min() == pytest.approx(0.0)


def test_the_prism_has_nine_springs_three_at_each_strut_end_and_turns_by_150_degrees_from_bottom_to_top():
    ends = [node for spring in PRISM.springs for node in spring.nodes]
    top, bottom = (complex(*PRISM.nodes_m[node][:2]) for node in (0, 1))

    assert len(PRISM.springs) == 9
    assert set(map(ends.count, range(6))) == {3}
    assert abs(np.degrees(np.angle(top / bottom))) == pytest.approx(150.0)


def test_the_icosahedron_has_four_springs_at_each_strut_end_and_parallel_struts_half_a_strut_apart():
    nodes = np.array(ICOSAHEDRON.nodes_m)
    middles = (nodes[0::2] + nodes[1::2]) / 2.0
    ends = [node for spring in ICOSAHEDRON.springs for node in spring.nodes]

    assert len(ICOSAHEDRON.springs) == 24
    assert set(map(ends.count, range(12))) == {4}
    assert np.linalg.norm(middles[0::2] - middles[1::2], axis=1) == pytest.approx(0.047)
    assert spring_lengths_m(ICOSAHEDRON)[0] == pytest.approx(0.094 * np.sqrt(3.0 / 8.0))


def test_the_icosahedron_stands_on_a_triangle_and_its_motors_sit_on_three_orthogonal_struts():
    nodes = np.array(ICOSAHEDRON.nodes_m)
    axes = (nodes[0::2] - nodes[1::2])[[motor.strut for motor in ICOSAHEDRON.motors]] / 0.094

    assert np.sum(nodes[:, 2] < 1e-9) == 3
    assert axes @ axes.T == pytest.approx(np.eye(3), abs=1e-12)


def test_the_eccentric_force_grows_with_the_square_of_the_frequency_and_the_constant_one_does_not():
    assert EccentricForce(2e-5).at(10.0) == pytest.approx(2e-5 * (20.0 * np.pi) ** 2)
    assert EccentricForce(2e-5).at(-20.0) == pytest.approx(4.0 * EccentricForce(2e-5).at(10.0))
    assert ConstantForce(0.3).at(np.array([0.0, -5.0, 50.0])) == pytest.approx([0.0, 0.3, 0.3])


def test_the_centre_of_mass_is_drawn_to_the_heavier_strut():
    nodes = np.array(ICOSAHEDRON.nodes_m)
    even = replace(ICOSAHEDRON, motors=())
    lighter = lighten(even, 3, 0.5)
    middle = nodes[6:8].mean(axis=0)

    assert even.centre_m(nodes) == pytest.approx(nodes.mean(axis=0))
    toward = lighter.centre_m(nodes) - even.centre_m(nodes)
    assert toward == pytest.approx(-(middle - nodes.mean(axis=0)) / 11.0)


def test_a_viewer_is_told_struts_springs_and_motors():
    structure = snap(PRISM, [0]).structure()

    assert structure.struts == ((0, 1), (2, 3), (4, 5))
    assert len(structure.springs) == 8
    assert structure.motor_struts == (0, 1, 2)


def test_snapped_springs_are_gone_and_nothing_else_changes():
    assert snap(ICOSAHEDRON, [17, 3]) == replace(
        ICOSAHEDRON, springs=tuple(s for i, s in enumerate(ICOSAHEDRON.springs) if i not in (3, 17))
    )


def test_a_lighter_strut_weighs_its_share_its_motor_the_same_and_nothing_else_changes():
    hurt = lighten(ICOSAHEDRON, 2, 0.5)

    assert hurt.struts[2].mass_kg == pytest.approx(ICOSAHEDRON.struts[2].mass_kg / 2.0)
    assert hurt.masses_kg[2] == pytest.approx(ICOSAHEDRON.struts[2].mass_kg / 2.0 + 0.004)
    assert replace(hurt, struts=ICOSAHEDRON.struts) == ICOSAHEDRON
    assert hurt.struts[:2] + hurt.struts[3:] == ICOSAHEDRON.struts[:2] + ICOSAHEDRON.struts[3:]


def test_a_disabled_motor_cannot_turn_and_nothing_else_changes():
    hurt = disable(PRISM, 1)

    assert [motor.max_hz for motor in hurt.motors] == [16.7, 0.0, 16.7]
    assert replace(hurt, motors=PRISM.motors) == PRISM
    assert replace(hurt.motors[1], max_hz=16.7) == PRISM.motors[1]


@given(st.permutations(["snap:4,18", "snap:1", "lighten:3:0.5", "disable:2"]))
def test_numbers_in_damage_mean_the_undamaged_body_in_whatever_order_they_come(specs):
    assert apply_damage(ICOSAHEDRON, specs) == disable(lighten(snap(ICOSAHEDRON, [0, 3, 17]), 2, 0.5), 1)


def test_no_damage_leaves_the_body_as_it_is():
    assert apply_damage(PRISM, []) == PRISM


@pytest.mark.parametrize(
    ("spec", "complaint"),
    [
        ("snap:25", "there is no spring 25; springs are numbered 1 to 24"),
        ("snap:", "'' is not a whole number from 1"),
        ("snap:-1", "'-1' is not a whole number from 1"),
        ("snap:0", "there is no spring 0; springs are numbered 1 to 24"),
        ("lighten:7:0.5", "there is no strut 7; struts are numbered 1 to 6"),
        ("lighten:1:2", "the factor is 2; allowed: 0.2 to 1"),
        ("lighten:1:nan", "the factor is nan; allowed: 0.2 to 1"),
        ("lighten:1:half", "'half' is not a number"),
        ("disable:4", "there is no motor 4; motors are numbered 1 to 3"),
        ("disable", "damage is snap:SPRING,..., lighten:STRUT:FACTOR or disable:MOTOR"),
        ("melt:1", "damage is snap:SPRING,..., lighten:STRUT:FACTOR or disable:MOTOR"),
    ],
)
def test_bad_damage_is_refused_with_the_spec_what_is_wrong_and_what_is_allowed(spec, complaint):
    with pytest.raises(ValueError) as refusal:
        apply_damage(ICOSAHEDRON, ["snap:1", spec])

    assert str(refusal.value) == f"damage {spec!r}: {complaint}"


@given(st.text(max_size=20))
def test_any_other_text_is_refused_in_one_line(text):
    with pytest.raises(ValueError) as refusal:
        apply_damage(PRISM, [f"x{text}"])

    assert len(str(refusal.value).splitlines()) == 1


def test_an_unknown_body_is_refused_with_the_known_ones():
    with pytest.raises(ValueError, match="unknown body 'cube'; choose one of prism3, icosahedron6"):
        make_body("cube", PLANAR_PARTS)
    assert set(BODIES) == {"prism3", "icosahedron6"}
