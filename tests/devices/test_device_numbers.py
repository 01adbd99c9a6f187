"""Numbers of a device: what each file may hold, how it is written, and the flexible mode that it describes."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from palpate import _core, devices
from palpate.devices import Device
from palpate.devices.catalog import IdentifiedModel, identified_model, parse_device, read_numbers
from palpate.devices.device import Parameters
from palpate.devices.flexible_mode import FlexibleMode
from palpate.devices.mechanisms import MECHANISMS, Field, _mechanism
from palpate.devices.writer import write_device
from palpate.errors import DeviceError, OutputError, PoseError

ARM, SLIDER, PLANE = (devices.load(name) for name in ("phantom-premium-1.5a", "slider", "haply-2diy"))
MODE = {"flexible.frequency": (40.0,), "flexible.tip_share": (0.3,), "flexible.damping_ratio": (0.05,)}


def having(device: Device, **numbers: Any) -> Device:
    values = {key.replace("__", "."): value for key, value in numbers.items()}
    return replace(device, parameters=Parameters({**device.parameters.values, **values}))


@pytest.mark.parametrize("name", list(MECHANISMS))
def test_every_file_of_a_mechanism_may_have_these_numbers(name: str) -> None:
    """Those of the mechanism between the servo period and those of friction, limits, mode and drive."""
    mechanism = MECHANISMS[name]
    n, revolute = mechanism.dof, name in ("premium", "five_bar")
    assert (n, mechanism.revolute) == ({"premium": 3, "slider": 1, "five_bar": 2, "tip_device": 3}[name], revolute)
    joint, torque = ("rad", "N*m") if revolute else ("m", "N")
    assert (mechanism.joint_unit, mechanism.torque_unit) == (joint, torque)
    expected = {
        "servo_period": Field("s", 1, "positive", True, ""),
        **mechanism.parameters,
        "friction.viscous": Field("N*m*s/rad" if revolute else "N*s/m", n, "nonnegative", True, ""),
        "friction.coulomb": Field(torque, n, "nonnegative", False, ""),
        "friction.breakaway": Field(torque, n, "nonnegative", False, ""),
        "friction.stribeck_speed": Field(f"{joint}/s", n, "positive", False, ""),
        "limits.lower": Field(joint, n, "any", False, "least joint coordinates"),
        "limits.upper": Field(joint, n, "any", False, "largest joint coordinates"),
        "flexible.frequency": Field("Hz", 1, "positive", False, "lowest mode between motors and tip"),
        "flexible.tip_share": Field("", 1, "positive", False, "of the moving mass, below 1"),
        "flexible.damping_ratio": Field("", 1, "nonnegative", False, "of the lowest mode, below 1"),
        "drive.peak_torque": Field(torque, n, "positive", False, ""),
        "drive.peak_force": Field("N", 1, "positive", False, ""),
        "drive.continuous_force": Field("N", 1, "positive", False, ""),
        "drive.thermal_time": Field("s", 1, "positive", False, ""),
    }
    if revolute:
        expected["drive.gear"] = Field("", n, "positive", False, "motor turns per joint turn")
        expected["drive.encoder_counts"] = Field("", n, "positive", False, "counts per motor turn")
    else:
        expected["drive.encoder_step"] = Field("m", n, "nonnegative", False, "length of one count")
    assert mechanism.fields == expected
    assert list(mechanism.fields) == list(expected)
    assert len(mechanism.working_pose) == n
    (info,) = (one for one in _core.mechanisms() if one.name == name)
    assert (info.dof, tuple(info.working_pose), info.class_name) == (n, mechanism.working_pose, mechanism.class_name)
    assert set(info.joints) == {"revolute" if revolute else "prismatic"}
    for one in info.parameters:
        field = Field(one.unit, one.size, one.range, one.required, one.description)
        assert mechanism.parameters[one.key] == field


def test_numbers_that_a_file_leaves_out_have_their_documented_values() -> None:
    bare = Device("bare", "", "tip_device", Parameters({"mass.apparent": (0.1,) * 3, "friction.viscous": (0.0,) * 3}))
    assert bare.coulomb.tolist() == bare.breakaway.tolist() == bare.encoder_step.tolist() == [0.0] * 3
    assert bare.stribeck_speed.tolist() == [0.01] * 3
    assert bare.peak_torque.tolist() == [np.inf] * 3
    assert (bare.peak_force, bare.continuous_force, bare.flexible) == (np.inf, np.inf, None)
    low, high = bare.joint_limits
    assert (low.tolist(), high.tolist()) == ([-np.inf] * 3, [np.inf] * 3)
    with pytest.raises(DeviceError, match=r"^servo_period is missing$"):
        _ = bare.servo_period
    turning = having(ARM, drive__encoder_counts=(100.0, 200.0, 400.0), drive__gear=(1.0, 2.0, 5.0))
    np.testing.assert_allclose(turning.encoder_step, 2.0 * np.pi / np.array([100.0, 400.0, 2000.0]))
    values = dict(turning.parameters.values)
    del values["drive.gear"]
    direct = replace(turning, parameters=Parameters(values))
    np.testing.assert_allclose(direct.encoder_step, 2.0 * np.pi / np.array([100.0, 200.0, 400.0]))
    del values["drive.encoder_counts"]
    assert replace(turning, parameters=Parameters(values)).encoder_step.tolist() == [0.0] * 3
    full = having(
        ARM, drive__peak_torque=(1.0, 2.0, 3.0), friction__breakaway=(4.0, 5.0, 6.0), limits__lower=(-1.0, -2.0, -3.0),
        limits__upper=(1.0, 2.0, 3.0), friction__stribeck_speed=(0.1, 0.2, 0.3),
    )  # fmt: skip
    assert full.peak_torque.tolist() == [1.0, 2.0, 3.0]
    assert full.breakaway.tolist() == [4.0, 5.0, 6.0]
    assert [side.tolist() for side in full.joint_limits] == [[-1.0, -2.0, -3.0], [1.0, 2.0, 3.0]]
    assert full.stribeck_speed.tolist() == [0.1, 0.2, 0.3]
    assert full.core_friction.stribeck_speed.tolist() == [0.1, 0.2, 0.3]
    assert full.core_friction.breakaway.tolist() == [4.0, 5.0, 6.0]


def test_a_flexible_mode_is_two_masses_on_a_spring_and_a_damper() -> None:
    """Shares s and 1 - s of a unit mass oscillate with its frequency and decay with its damping ratio."""
    device = having(SLIDER, **{key.replace(".", "__"): value for key, value in MODE.items()})
    mode = device.flexible
    assert mode == FlexibleMode(40.0, 0.3, 0.05)
    k, b, s = mode.stiffness, mode.damping, mode.tip_share
    system = np.zeros((4, 4))
    system[:2, 2:] = np.eye(2)
    for row, (mass, sign) in enumerate(((1.0 - s, 1.0), (s, -1.0))):
        system[2 + row] = np.array([-k, k, -b, b]) * sign / mass
    moving = [value for value in np.linalg.eigvals(system) if abs(value) > 1e-3]
    omega = 2.0 * math.pi * 40.0
    assert [abs(value) for value in moving] == pytest.approx([omega] * 2)
    assert [-value.real / omega for value in moving] == pytest.approx([0.05] * 2)
    assert str(mode) == "lowest mode of 40 Hz, 0.3 of the mass at the tip, damping ratio 0.05"
    core = device.core_mode
    assert (core.frequency, core.tip_share, core.damping_ratio) == (40.0, 0.3, 0.05)
    assert device.core_flexible is device.core_flexible
    assert device.rigid().flexible is None
    assert device.rigid().parameters.values == SLIDER.parameters.values
    assert SLIDER.rigid() is SLIDER
    assert SLIDER.core_mode is None
    with pytest.raises(DeviceError) as caught:
        _ = SLIDER.core_flexible
    assert str(caught.value) == "slider has no flexible mode: give its file a [flexible] table"


@pytest.mark.parametrize(
    ("numbers", "says"),
    [
        ({"flexible.frequency": (9.0,)}, "flexible.tip_share is missing: a flexible mode has frequency, tip_share and"),
        ({"flexible.tip_share": (0.5,), "flexible.damping_ratio": (0.1,)}, "flexible.frequency is missing: a flexible"),
        ({**MODE, "flexible.tip_share": (1.0,)}, "flexible.tip_share and flexible.damping_ratio must be below 1"),
        ({**MODE, "flexible.damping_ratio": (1.0,)}, "flexible.tip_share and flexible.damping_ratio must be below 1"),
        ({"limits.lower": (1.0,), "limits.upper": (1.0,)}, "limits.lower [1.0] must be below limits.upper [1.0] for"),
        ({"limits.lower": (2.0,), "limits.upper": (1.0,)}, "limits.lower [2.0] must be below limits.upper [1.0] for"),
        ({"friction.breakaway": (0.1,), "friction.coulomb": (0.2,)}, "friction.breakaway must not be below"),
        ({"friction.viscous": (-1.0,)}, "friction.viscous must be finite and not negative, not [-1.0]"),
        ({"friction.stribeck_speed": (-1.0,)}, "friction.stribeck_speed must be finite and not negative, not [-1.0]"),
        ({"friction.coulomb": (math.nan,)}, "friction.coulomb must be finite and not negative, not [nan]"),
        ({"mass.tip": (0.0,)}, "the inertia matrix is not positive definite at every pose: check masses and inertias"),
        ({"mass.tip": (-0.5,)}, "the inertia matrix is not positive definite at every pose: check masses and inertias"),
        ({"mass.tip": (0.5,)}, None),
        ({"mass.tip": (1e-9,)}, None),
        ({**MODE, "flexible.tip_share": (0.999,), "flexible.damping_ratio": (0.999,)}, None),
        ({"friction.breakaway": (0.2,), "friction.coulomb": (0.2,)}, None),
        ({"friction.viscous": (0.0,), "limits.lower": (0.0,), "limits.upper": (1e-9,)}, None),
    ],
)
def test_a_device_is_physical(numbers: dict[str, tuple[float, ...]], says: str | None) -> None:
    device = replace(SLIDER, parameters=Parameters({**SLIDER.parameters.values, **numbers}))
    if says is None:
        device.check()
        return
    with pytest.raises(DeviceError) as caught:
        device.check()
    assert str(caught.value).startswith(says)


def test_the_inertia_is_looked_for_over_the_whole_turn_of_every_joint(monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[np.ndarray] = []

    class Watched(Device):
        def mass_matrix(self, q: Any) -> Any:
            asked.append(np.array(q))
            return super().mass_matrix(q)

    Watched(PLANE.name, "", "five_bar", PLANE.parameters).check()
    turn = np.linspace(-np.pi, np.pi, 13)
    (grid,) = asked
    assert grid.shape == (169, 2)
    np.testing.assert_allclose(np.unique(np.round(grid[:, 0], 9)), np.round(turn, 9))
    np.testing.assert_allclose(np.unique(np.round(grid[:, 1], 9)), np.round(turn, 9))

    def diverges(_: Any) -> Any:
        raise np.linalg.LinAlgError

    monkeypatch.setattr(np.linalg, "eigvalsh", diverges)  # as for numbers near the largest one
    with pytest.raises(DeviceError, match="the inertia matrix is not positive definite at every pose"):
        PLANE.check()


def test_the_derivatives_of_an_acceleration_are_those_of_differences() -> None:
    q, qd, tau = np.array([0.2, 1.9, 2.9]), np.array([0.3, -0.2, 0.5]), np.array([0.01, 0.05, -0.02])
    smooth = ARM.with_friction(viscous=[0.01, 0.02, 0.03], coulomb=0.0)
    found = smooth.linearization(q, qd, tau)
    assert [part.shape for part in found] == [(3, 3)] * 3
    step = 1e-6
    for number, part in enumerate(found):
        for column in range(3):
            moved = [state.copy() for state in (q, qd, tau)]
            back = [state.copy() for state in (q, qd, tau)]
            moved[number][column] += step
            back[number][column] -= step
            difference = (smooth.acceleration(*moved) - smooth.acceleration(*back)) / (2.0 * step)
            np.testing.assert_allclose(part[:, column], difference, rtol=1e-5, atol=1e-4)


def test_states_may_be_texts_with_the_unit_of_their_kind() -> None:
    np.testing.assert_allclose(ARM.forward(["0 deg", "90 deg", "180 deg"]), ARM.forward([0.0, np.pi / 2.0, np.pi]))
    given = ARM.energy(["0 rad"] * 3, ["180 deg/s", "0 rad/s", "0 rad/s"])
    assert given == pytest.approx(ARM.energy([0.0] * 3, [np.pi, 0.0, 0.0]))
    pushed = ARM.acceleration([0.0, 1.9, 2.9], [0.0] * 3, ["10 mN*m", "0 N*m", "0 N*m"])
    np.testing.assert_allclose(pushed, ARM.acceleration([0.0, 1.9, 2.9], [0.0] * 3, [0.01, 0.0, 0.0]))
    assert SLIDER.energy(["5 mm"], ["2 m/s"]) == pytest.approx(0.5 * 0.06 * 4.0)
    assert SLIDER.acceleration(["0 mm"], ["0 m/s"], ["0.6 N"]) == pytest.approx([10.0])
    np.testing.assert_allclose(ARM.inverse(["0 mm", "20 mm", "-30 mm"]), ARM.inverse([0.0, 0.02, -0.03]))
    for read, value, says in (
        (ARM.forward, ["1 m"] * 3, "an angle is needed"),
        (lambda v: ARM.energy([0.0] * 3, v), ["1 rad"] * 3, "an angular velocity is needed"),
        (lambda v: ARM.acceleration([0.0] * 3, [0.0] * 3, v), ["1 rad"] * 3, "a torque is needed"),
        (lambda v: SLIDER.energy([0.0], v), ["1 rad/s"], "a speed is needed"),
        (lambda v: SLIDER.acceleration([0.0], [0.0], v), ["1 N*m"], "a force is needed"),
    ):
        with pytest.raises(PoseError, match=says):
            read(value)


def test_a_pose_of_a_tip_is_the_nearest_one_with_whole_turns() -> None:
    q = np.array([0.3, 1.9, 2.9])
    tip = ARM.forward(q)
    for turns in ([0, 0, 0], [1, -1, 2], [-3, 0, 1]):
        to = q + 2.0 * np.pi * np.array(turns) + 0.01
        np.testing.assert_allclose(ARM.inverse(tip, to), to - 0.01, atol=1e-9)
    several = np.array([tip, ARM.forward(q + 0.1)])
    np.testing.assert_allclose(ARM.inverse(several, q), [q, q + 0.1], atol=1e-9)
    assert ARM.inverse(np.empty((0, 3))).shape == (0, 3)
    for wrong in ([0.0, 0.0], [0.0, np.inf, 0.0], [[[0.0] * 3]]):
        with pytest.raises(PoseError, match=r"^inverse: a tip position is three finite numbers in m, not "):
            ARM.inverse(wrong)
    with pytest.raises(PoseError, match=r"^inverse: the tip cannot be at \[1000., *0., *0.\] mm: "):
        ARM.inverse([1.0, 0.0, 0.0])


WRITTEN = """\
# made for a test
# of two lines

name = "it"
description = "a \\"quoted\\" word, é and \\u007f"
mechanism = "tip_device"
servo_period = { value = "0.002 s", source = "own" }

[sources]
own = "a long reference"

[mass]
apparent = { value = ["0.1 kg", "0.2 kg", "0.3 kg"], source = "own", note = "weighed" }

[friction]
viscous = { value = ["0.0 N*s/m", "0.5 N*s/m", "1.0 N*s/m"], source = "own" }

[flexible]
frequency = { value = "40.0 Hz", source = "own" }
tip_share = { value = 0.3, source = "own" }
damping_ratio = { value = 0.05, source = "own" }
"""


def test_a_written_device_has_each_number_with_its_unit_source_and_note(tmp_path: Path) -> None:
    values = {
        "servo_period": (0.002,), "mass.apparent": (0.1, 0.2, 0.3), "friction.viscous": (0.0, 0.5, 1.0), **MODE,
    }  # fmt: skip
    device = Device("it", 'a "quoted" word, é and \x7f', "tip_device", Parameters(values))
    source_of = dict.fromkeys(values, "own")
    path = write_device(
        tmp_path / "it.toml", device, {"own": "a long reference"}, source_of, {"mass.apparent": "weighed"},
        ["made for a test", "of\ntwo lines"],
    )  # fmt: skip
    assert path.read_text("utf-8") == WRITTEN
    again = devices.load(path)
    assert (again.name, again.description, again.mechanism) == (device.name, device.description, device.mechanism)
    assert dict(again.parameters.values) == values
    bare = write_device(tmp_path / "bare.toml", device, {"own": "a long reference"}, source_of)
    assert bare.read_text("utf-8").startswith('name = "it"\n')
    assert "note" not in bare.read_text("utf-8")
    for name in devices.names():
        known = devices.load(name)
        numbers = {number.key: "own" for number in read_numbers(name)}
        copied = devices.load(write_device(tmp_path / "copy.toml", known, {"own": "it"}, numbers))
        assert dict(copied.parameters.values) == dict(known.parameters.values)
    wrong = replace(device, parameters=Parameters({**values, "mass.apparent": (0.1, 0.2, -0.3)}))
    with pytest.raises(DeviceError, match=r"new\.toml, line .*: mass\.apparent is -0\.3 kg; it must be positive"):
        write_device(tmp_path / "new.toml", wrong, {"own": "x"}, source_of)
    assert not (tmp_path / "new.toml").exists()
    with pytest.raises(OutputError, match="a file is named by text or a Path"):
        write_device(3, device, {"own": "x"}, source_of)  # type: ignore[arg-type]


HEAD = 'name = "it"\nbased_on = "slider"\n'


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ('[mass]\ntip = {value = "1000000000 kg", source = "x"}', None),
        ('[mass]\ntip = {value = "1000000001 kg", source = "x"}', "line 4: mass.tip is 1e+09 kg, which no device has"),
        (
            '[limits]\nlower = {value = "-1e10 m", source = "x"}',
            "line 4: limits.lower is -1e+10 m, which no device has",
        ),
        ('[mass]\ntip = {value = "1 kg", source = 3}', "line 4: mass.tip: source must be text: a key of [sources], or"),
        ('[mass]\ntip = {value = "1 kg"}', 'line 4: mass.tip must be written { value = "…", source = "…" }'),
        ('[mass]\ntip = {source = "1 kg"}', 'line 4: mass.tip must be written { value = "…", source = "…" }'),
        ('[mass]\ntip = {value = "1 kg", source = "x", a = 1, b = 2}', "line 4: mass.tip: unknown key a; the keys are"),
        ('[drive]\nencoder_step = {value = "0 m", source = "x"}', None),
        (
            '[drive]\nencoder_step = {value = "-1 m", source = "x"}',
            "line 4: drive.encoder_step is -1 m; it must not be",
        ),
        ("[sources]\na = 3", "sources must be a table of texts, written [sources]"),
        ('[sources]\na = "x"\nb = 3', "sources must be a table of texts, written [sources]"),
        ("sources = 3", "sources must be a table of texts, written [sources]"),
        ("[xyzzy]\na = 3", "line 4: unknown key xyzzy.a"),
    ],
)
def test_a_number_of_a_file_is_one_that_a_device_has(text: str, says: str | None) -> None:
    where = f"file {text[:20]}"
    if says is None:
        parse_device(HEAD + text, where)
        return
    with pytest.raises(DeviceError) as caught:
        parse_device(HEAD + text, where)
    separator = ": " if says.startswith("sources") else ", "
    assert str(caught.value).startswith(f"{where}{separator}{says}")


def test_the_largest_number_of_a_list_is_named() -> None:
    text = 'name = "it"\nbased_on = "phantom-premium-1.5a"\n[inertia]\na = {value = ["1 kg*m^2", "2e9 kg*m^2", '
    with pytest.raises(DeviceError, match=r"inertia\.a is 2e\+09 kg\*m\^2, which no device has: check its unit$"):
        parse_device(text + '"-1e9 kg*m^2"], source = "x"}', "largest")
    with pytest.raises(DeviceError, match=r"inertia\.a is -3e\+09 kg\*m\^2, which no device has"):
        parse_device(text + '"-3e9 kg*m^2"], source = "x"}', "largest")


def test_a_scenario_and_a_name_nobody_knows_are_told_apart_from_a_device() -> None:
    with pytest.raises(
        DeviceError, match=r"^a: a scenario; its device is the file or the name in its table \[device\]$"
    ):
        parse_device('[device]\nname = "slider"', "a")
    with pytest.raises(
        DeviceError, match=r'^a: description is missing; write description = "…" at the top of the file$'
    ):
        parse_device('name = "a"\nmechanism = "slider"\n[device]\nname = "slider"', "a")
    for name, hint in (("slidr", "did you mean slider? For"), ("xyzzy", "for")):
        with pytest.raises(DeviceError) as caught:
            devices.load(name)
        known = ", ".join(devices.names())
        assert str(caught.value) == (
            f"there is no device {name!r} in the catalog ({known}); {hint} your own, give the path of a .toml file"
        )


IDENTIFIED = """
name = "it"
description = "measured"
source = "a thesis"
period = "2 ms"
a = [[0.5, 0.1], [0.0, 0.6]]
b = [[1.0], [2.0]]
c = [[3.0, 4.0]]
"""


def test_an_identified_model_is_read_from_a_file(tmp_path: Path) -> None:
    path = tmp_path / "model.toml"

    def read(text: str) -> IdentifiedModel:
        path.write_text(text, "utf-8")
        from palpate.devices.catalog import _identified

        _identified.cache_clear()
        return identified_model(replace(SLIDER, identified_model=str(path)))

    found = read(IDENTIFIED)
    assert (found.name, found.description, found.source, found.period) == ("it", "measured", "a thesis", 0.002)
    assert [matrix.tolist() for matrix in (found.a, found.b, found.c)] == [
        [[0.5, 0.1], [0.0, 0.6]], [[1.0], [2.0]], [[3.0, 4.0]],
    ]  # fmt: skip
    for old, new, says in (
        ('source = "a thesis"\n', "", "source is missing"),
        ('"2 ms"', '"0 ms"', "period is 0 s; it must be positive"),
        ('"2 ms"', '"2 mm"', 'period: "2 mm" is a length [m]; a time is needed, for example "0.5 ms"'),
        ("b = [[1.0], [2.0]]", "b = [[1.0, 2.0]]", "b must be 2 x 1, not of shape (1, 2)"),
        ("c = [[3.0, 4.0]]", "c = [[3.0], [4.0]]", "c must be 1 x 2, not of shape (2, 1)"),
        ("a = [[0.5, 0.1], [0.0, 0.6]]", "a = [[0.5, 0.1]]", "a must be 1 x 1, not of shape (1, 2)"),
        ("a = [[0.5, 0.1], [0.0, 0.6]]", "a = 3", "a must be 0 x 0, not of shape ()"),
        ("c = [[3.0, 4.0]]", "c = [[3.0, nan]]", "c has a number that is not finite"),
        ("c = [[3.0, 4.0]]", 'c = [[3.0, "x"]]', "c must be a matrix: a list of rows of numbers"),
    ):
        with pytest.raises(DeviceError) as caught:
            read(IDENTIFIED.replace(old, new))
        assert str(caught.value) == f"{path}: {says}"
    with pytest.raises(DeviceError) as caught:
        identified_model(SLIDER)
    assert str(caught.value) == "slider has no identified model; give one as identified_model in its file"
    assert identified_model(ARM).a.shape[0] == identified_model(ARM).b.shape[0]
    assert identified_model(ARM).c.shape == (3, len(identified_model(ARM).a))


@pytest.mark.parametrize(("peak", "share"), [(8.5, 0.9), (math.inf, 1.0)])
@pytest.mark.parametrize("temperature", [0.0, 0.4])
def test_the_hot_drive_limits_a_force_when_its_falling_limit_meets_it(
    peak: float, share: float, temperature: float
) -> None:
    """Temperature in small steps towards (F/F_c)^2; from 0.9 to 1 the limit falls from the peak to F_c."""
    rating, tau = 1.4, 3.0
    numbers = {"drive__continuous_force": (rating,), "drive__thermal_time": (tau,)}
    device = having(SLIDER, **numbers, **({} if math.isinf(peak) else {"drive__peak_force": (peak,)}))
    assert device.thermal_time == tau
    assert SLIDER.thermal_time == 1.0
    for force in (1.5, 3.0, 8.0):
        step, time, heat = 1e-5, 0.0, temperature
        while heat < share or (heat < 1.0 and force <= peak - (heat - 0.9) / 0.1 * (peak - rating)):
            heat += step / tau * ((force / rating) ** 2 - heat)
            time += step
        assert device.limit_time(force, temperature) == pytest.approx(time, abs=1e-3)
        if temperature == 0.0:
            assert device.limit_time(force) == device.limit_time(force, 0.0)
    assert device.limit_time(rating, temperature) == device.limit_time(1.0, 5.0) == math.inf
    assert device.limit_time(2.0, 1.0) == 0.0
    if math.isfinite(peak):
        assert device.limit_time(8.6, temperature) == 0.0
        assert device.limit_time(8.5, 0.5) > 0.0
        assert device.limit_time(8.5, 0.9) == 0.0
    assert SLIDER.limit_time(1e9) == math.inf


@pytest.mark.parametrize("name", list(MECHANISMS))
def test_a_mechanism_makes_the_loop_of_its_own_setup(name: str) -> None:
    mechanism = MECHANISMS[name]
    (info,) = (one for one in _core.mechanisms() if one.name == name)
    assert _mechanism(info) == mechanism
    for made, kind in ((mechanism.friction(), "Friction"), (mechanism.setup(), "Setup")):
        assert isinstance(made, getattr(_core, f"{mechanism.class_name}{kind}"))
    known = next(device for device in map(devices.load, devices.names()) if device.mechanism == "slider")
    assert type(known.model.loop(known.setup())).__name__ == "SliderLoop"
