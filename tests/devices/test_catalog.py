"""Device files: a user's own loads like the catalog's; each mistake is one sentence; no number without a source."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from palpate import devices, simulate
from palpate.devices.catalog import FIELDS, read_numbers
from palpate.errors import DeviceError, PoseError

SLIDER = """\
name = "bench"
description = "a sledge on a bench"
mechanism = "slider"
servo_period = { value = "2 ms", source = "chosen" }

[sources]
scale = "kitchen scale, read twice"

[mass]
tip = { value = "250 g", source = "scale", note = "with the handle" }

[friction]
viscous = { value = "2 N*s/m", source = "guess" }
coulomb = { value = "0.3 N", source = "guess" }
"""


def file(folder: Path, text: str) -> Path:
    path = folder / "own.toml"
    path.write_text(text, "utf-8")
    return path


def refusal(folder: Path, text: str) -> str:
    path = file(folder, text)
    with pytest.raises(DeviceError) as caught:
        devices.load(path)
    told = str(caught.value)
    assert str(path) in told
    assert "\n" not in told
    return re.sub(r"^(, line \d+)?: ", "", told.removeprefix(str(path)))


def test_the_catalog_holds_what_the_documentation_names() -> None:
    assert devices.names() == ["haply-2diy", "phantom-premium-1.5a", "phantom-premium-1.5a-rotors", "slider"]


@pytest.mark.parametrize("name", devices.names())
def test_every_number_of_the_catalog_has_a_unit_and_a_source(name: str) -> None:
    """A number that nobody can trace is no parameter: each source is spelt out in the file's [sources]."""
    device, numbers = devices.load(name), read_numbers(name)
    assert device.name == name
    assert device.description
    for number in numbers:
        assert number.unit == FIELDS[device.mechanism][number.key].unit
        assert len(number.source) > 20, f"{number.key}: {number.source!r} is a key that [sources] does not explain"
        assert device.parameters.values[number.key] == number.values
        assert all(np.isfinite(number.values))


def test_the_arm_has_its_published_parameters() -> None:
    """Cavusoglu & Feygin 2001, in SI; encoder counts and forces as the data sheets have them."""
    numbers = {number.key: number for number in read_numbers("phantom-premium-1.5a")}
    published = {
        "geometry.l1": 0.215, "geometry.l2": 0.170, "geometry.l3": 0.0325, "geometry.l5": -0.0368,
        "geometry.l6": 0.0527, "mass.a": 0.0202, "mass.c": 0.0249, "mass.be": 0.2359, "mass.df": 0.1906,
        "inertia.base": 11.87e-4, "drive.peak_force": 8.5, "drive.continuous_force": 1.4, "servo_period": 1e-3,
    }  # fmt: skip
    for key, value in published.items():
        assert numbers[key].values == pytest.approx((value,), rel=1e-15), key
    assert numbers["inertia.be"].values == pytest.approx((11.09e-4, 10.06e-4, 0.591e-4))
    arm = devices.load("phantom-premium-1.5a")
    tip = np.abs(arm.jacobian([0.0, 0.0, 0.0]) * arm.encoder_step).max(axis=0)
    assert 23e-6 < tip.min() < tip.max() < 29.5e-6  # m per count: what the drive's figures give at the tip


def test_rotors_add_gear_squared_times_their_inertia() -> None:
    """Reflected inertia: J_rotor n^2 on the diagonal, at any pose, and nothing else."""
    bare, rotors = devices.load("phantom-premium-1.5a"), devices.load("phantom-premium-1.5a-rotors")
    poses = np.random.default_rng(1).uniform(-3, 3, (50, 3))
    added = np.diag(1.05e-6 * np.array([13.3, 11.2, 11.2]) ** 2)
    np.testing.assert_allclose(rotors.mass_matrix(poses) - bare.mass_matrix(poses), [added] * 50, atol=1e-18)
    np.testing.assert_array_equal(rotors.gravity(poses), bare.gravity(poses))
    assert rotors.coulomb.tolist() == [0.01] * 3
    assert bare.coulomb.tolist() == [0.0] * 3


def test_a_users_own_file_loads_like_the_catalogs(tmp_path: Path) -> None:
    """By path, as text or as a Path; what the file leaves out has its documented default."""
    path = file(tmp_path, SLIDER)
    for device in (devices.load(path), devices.load(str(path))):
        assert (device.name, device.dof, device.servo_period) == ("bench", 1, 2e-3)
        assert device.mass_matrix([0.0]) == pytest.approx(0.25)
        assert device.viscous.tolist() == [2.0]
        assert device.coulomb.tolist() == device.breakaway.tolist() == [0.3]
        assert device.encoder_step.tolist() == [0.0]
        assert device.peak_force == device.continuous_force == np.inf
    sources = {number.key: (number.source, number.note, number.text) for number in read_numbers(path)}
    assert sources["mass.tip"] == ("kitchen scale, read twice", "with the handle", "250 g")


def test_a_file_that_changes_is_read_again(tmp_path: Path) -> None:
    """Loading is cached by what the file says, not by its name."""
    assert devices.load(file(tmp_path, SLIDER)).mass_matrix([0.0]) == pytest.approx(0.25)
    assert devices.load(file(tmp_path, SLIDER.replace("250 g", "1 kg"))).mass_matrix([0.0]) == pytest.approx(1.0)


def test_a_variant_says_only_what_it_changes(tmp_path: Path) -> None:
    """based_on: every other number, and its source, is the catalog device's."""
    path = file(
        tmp_path,
        'name = "heavy"\nbased_on = "phantom-premium-1.5a"\n[mass]\na = { value = "50 g", source = "scale" }\n',
    )
    base, heavy = devices.load("phantom-premium-1.5a"), devices.load(path)
    changed = {key for key, values in heavy.parameters.values.items() if values != base.parameters.values[key]}
    assert changed == {"mass.a"}
    assert set(heavy.parameters.values) == set(base.parameters.values)
    assert heavy.mass_matrix([0, 0, 0])[1, 1] - base.mass_matrix([0, 0, 0])[1, 1] == pytest.approx(0.0298 * 0.215**2)


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        ('"250 g", source = "scale", note = "with the handle"', '"250 g"',
         'mass.tip must be written { value = "…", source = "…" }: each number needs a source'),
        ('{ value = "250 g", source = "scale", note = "with the handle" }', '"250 g"', "mass.tip must be written"),
        ("tip = {", "tipp = {", "unknown key mass.tipp; did you mean mass.tip?"),
        ("[mass]", "[masses]", "unknown key masses.tip; did you mean mass.tip?"),
        ('note = "with', 'notes = "with', "mass.tip: unknown key notes; the keys are value, source and note"),
        ('"250 g"', '"-250 g"', "mass.tip is -0.25 kg; it must be positive"),
        ('"250 g"', '"0 g"', "mass.tip is 0 kg; it must be positive"),
        ('"250 g"', '"250 mm"', 'mass.tip: "250 mm" is a length [m]; a mass is needed, for example "0.15 kg"'),
        ('"250 g"', "0.25", 'mass.tip: 0.25 has no unit, and a mass is needed; write it as "0.25 kg"'),
        ('"250 g"', "nan", "mass.tip: nan is not a finite number"),
        ('"250 g"', '"inf kg"', 'mass.tip: "inf kg" is not a finite number'),
        ('"0.3 N"', '"-0.3 N"', "friction.coulomb is -0.3 N; it must not be negative"),
        ('"2 ms"', '"0 ms"', "servo_period is 0 s; it must be positive"),
        ('mechanism = "slider"', 'mechanism = "hexapod"',
         'mechanism must be "premium", "slider", "five_bar" or "tip_device", not \'hexapod\''),
        ('mechanism = "slider"\n', "", 'mechanism is missing; write mechanism = "…" at the top of the file'),
        ('mechanism = "slider"', 'mechanism = "slider"\nidentified_model = 3',
         "identified_model must be the name of a model or the path of its file"),
        ('name = "bench"\n', "", 'name is missing; write name = "…" at the top of the file'),
        ('viscous = { value = "2 N*s/m", source = "guess" }\n', "", "friction.viscous is missing (a value in N*s/m)"),
        ("[mass]", "[mass", "not valid TOML"),
        ('coulomb = { value = "0.3 N"', 'breakaway = { value = "0.1 N", source = "me" }\ncoulomb = { value = "0.3 N"',
         "friction.breakaway must not be below friction.coulomb"),
    ],
)  # fmt: skip
def test_a_mistake_in_a_file_is_told_with_file_and_field(tmp_path: Path, old: str, new: str, says: str) -> None:
    """One clear sentence: what is wrong, where, what would be right."""
    assert SLIDER.count(old) == 1
    assert refusal(tmp_path, SLIDER.replace(old, new)).startswith(says)


def test_all_mistakes_of_a_file_are_in_one_answer_with_their_lines(tmp_path: Path) -> None:
    text = SLIDER.replace('"250 g"', '"-250 g"').replace("coulomb =", "colomb =").replace('"2 N*s/m"', '"2 N"')
    path = file(tmp_path, text)
    with pytest.raises(DeviceError) as caught:
        devices.load(path)
    lines = {key: 1 + text[: text.index(key)].count("\n") for key in ("tip =", "viscous =", "colomb =")}
    assert str(caught.value).splitlines() == [
        f"{path}, line {lines['tip =']}: mass.tip is -0.25 kg; it must be positive",
        f'{path}, line {lines["viscous ="]}: friction.viscous: "2 N" is a force [N]; a damping is needed, for example '
        '"4.5 N*s/m"',
        f"{path}, line {lines['colomb =']}: unknown key friction.colomb; did you mean friction.coulomb?",
    ]


@pytest.mark.parametrize(
    ("change", "says"),
    [
        ('[inertia]\na = { value = "1e-4 kg*m^2", source = "me" }',
         "inertia.a needs a list of 3 values, one per joint or axis"),
        ('[inertia]\na = { value = ["1 kg*m^2", "1 kg*m^2"], source = "me" }',
         "inertia.a: 2 values where 3 are needed"),
        ('[inertia]\na = { value = ["1e-4 kg*m^2", "-1e-4 kg*m^2", "0 kg*m^2"], source = "me" }',
         "inertia.a is -0.0001 kg*m^2; it must not be negative"),
        ('[drive]\ngear = { value = [13, 0, 11], source = "me" }', "drive.gear is 0; it must be positive"),
        ('[geometry]\nl1 = { value = "-1 mm", source = "me" }', "geometry.l1 is -0.001 m; it must be positive"),
        ('[inertia]\nbase = { value = "0 kg*m^2", source = "me" }\n'
         'be = { value = ["0 kg*m^2", "0 kg*m^2", "0 kg*m^2"], source = "me" }\n'
         'df = { value = ["0 kg*m^2", "0 kg*m^2", "0 kg*m^2"], source = "me" }\n'
         'a = { value = ["0 kg*m^2", "0 kg*m^2", "0 kg*m^2"], source = "me" }\n'
         'c = { value = ["0 kg*m^2", "0 kg*m^2", "0 kg*m^2"], source = "me" }\n'
         '[mass]\na = { value = "0 kg", source = "me" }\nc = { value = "0 kg", source = "me" }',
         "the inertia matrix is not positive definite at every pose: check masses and inertias"),
    ],
)  # fmt: skip
def test_a_variant_that_is_no_arm_is_refused(tmp_path: Path, change: str, says: str) -> None:
    """Lists where joints differ, signs, and a mass matrix that is positive definite everywhere."""
    text = f'name = "odd"\nbased_on = "phantom-premium-1.5a"\n{change}\n'
    assert refusal(tmp_path, text).startswith(says)


def test_links_that_never_meet_are_refused(tmp_path: Path) -> None:
    """Motors one metre apart and two links of 0.16 m on each side."""
    text = 'name = "wide"\nbased_on = "haply-2diy"\n[geometry]\nbase = { value = "1 m", source = "me" }\n'
    assert refusal(tmp_path, text) == "the mechanism cannot be assembled at any pose: check its lengths"


@pytest.mark.parametrize("name", [None, 3, b"slider"])
def test_what_is_no_name_is_refused(name: Any) -> None:
    with pytest.raises(DeviceError, match="a device is given by its name in the catalog"):
        devices.load(name)


def test_a_device_that_is_not_there_says_what_is(tmp_path: Path) -> None:
    """Unknown names list the catalog and suggest; a missing file is named."""
    with pytest.raises(DeviceError, match=r"there is no device 'phantom-premium' in the catalog \(.*, slider\); did"):
        devices.load("phantom-premium")
    with pytest.raises(DeviceError, match=r"none\.toml: there is no such file"):
        devices.load(tmp_path / "none.toml")
    (tmp_path / "noise.toml").write_bytes(b"\xff\xfe")
    with pytest.raises(DeviceError, match="not UTF-8 text"):
        devices.load(tmp_path / "noise.toml")
    told = refusal(tmp_path, 'name = "x"\nbased_on = "omega"\n')
    assert told.startswith("based_on must be a device of the catalog (haply-2diy, phantom-premium-1.5a, ")


def test_friction_can_be_changed_and_taken_away_but_not_made_negative() -> None:
    """Variants share everything else; a bad value is refused when it is set."""
    arm = devices.load("phantom-premium-1.5a-rotors")
    bare = arm.frictionless()
    assert not np.any([bare.viscous, bare.coulomb, bare.breakaway])
    assert arm.coulomb.tolist() == [0.01] * 3, "the original has not changed"
    assert arm.with_viscous([0.1, 0.2, 0.3]).viscous.tolist() == [0.1, 0.2, 0.3]
    assert arm.with_friction(coulomb=0.02).breakaway.tolist() == [0.02] * 3
    np.testing.assert_array_equal(bare.mass_matrix([1, 2, 3]), arm.mass_matrix([1, 2, 3]))
    for wrong in (-0.1, np.nan, np.inf):
        with pytest.raises(DeviceError, match=r"friction\.viscous must be finite and not negative"):
            arm.with_viscous(wrong)
    with pytest.raises(DeviceError, match="must not be below"):
        arm.with_friction(coulomb=0.1, breakaway=0.05)


@pytest.mark.parametrize(
    ("call", "says"),
    [
        (lambda arm: arm.forward([0.0, 1.0]), r"q must have shape \(3,\) or \(n, 3\) for phantom-premium-1\.5a, not"),
        (lambda arm: arm.forward([0.0, np.nan, 0.0]), "q must be finite"),
        (lambda arm: arm.energy([0, 0, 0], [0, np.inf, 0]), "qd must be finite"),
        (lambda arm: arm.coriolis(np.zeros((2, 3)), np.zeros((3, 3))), r"one length; they have \[2, 3\]"),
        (lambda arm: arm.linearization(np.zeros((2, 3)), [0] * 3, [0] * 3), "give one state"),
        (lambda arm: arm.inverse([0.0, 0.0]), "three finite numbers in m"),
        (lambda arm: arm.inverse([0.0, 0.0, np.nan]), "three finite numbers in m"),
    ],
)
def test_a_state_of_the_wrong_shape_is_refused(call: Any, says: str) -> None:
    """Before it reaches the core, which checks nothing."""
    with pytest.raises(PoseError, match=says):
        call(devices.load("phantom-premium-1.5a"))


def test_stacked_states_answer_in_kind() -> None:
    """(n, dof) in, n answers out, each that of its state alone; one state goes with a stack."""
    arm = devices.load("phantom-premium-1.5a")
    draw = np.random.default_rng(2).uniform(-1, 1, (3, 4, 3))
    q, qd, tau = draw
    for name, states in (("forward", (q,)), ("jacobian", (q,)), ("mass_matrix", (q,)), ("gravity", (q,)),
                         ("tip_hessian", (q,)), ("coriolis", (q, qd)), ("energy", (q, qd)),
                         ("acceleration", (q, qd, tau))):  # fmt: skip
        method = getattr(arm, name)
        stacked = method(*states)
        assert len(stacked) == 4
        for i in range(4):
            np.testing.assert_array_equal(stacked[i], method(*(state[i] for state in states)), err_msg=name)
    np.testing.assert_array_equal(arm.coriolis(q, qd[0]), arm.coriolis(q, np.tile(qd[0], (4, 1))))
    assert isinstance(arm.energy(q[0], qd[0]), float)


def test_a_users_device_runs_with_its_own_friction(tmp_path: Path) -> None:
    """Dry friction of 0.3 N: a push of 0.29 N moves nothing, of 0.35 N something."""
    path = file(tmp_path, SLIDER)

    def travel(force: str) -> float:
        trace = simulate(
            {
                "device": {"name": str(path)},
                "servo": {"topology": "impedance_display"},
                "operator": {"kind": "force", "force": [force, "0 N", "0 N"]},
                "object": {"kind": "none"},
            }
        )
        return float(np.ptp(trace["tip"][:, 0]))

    assert travel("0.29 N") == 0.0
    assert travel("0.35 N") > 1e-3
