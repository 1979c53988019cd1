"""Restoring modules of every kind, and a machine on the shaft of the drum: laws with a closed
form, and what a file states.
"""

import math

import numpy as np
import pytest
from openlog import motion_run
from own_rigs import RESTORING, SHAFT, own_rig, own_text
from rigs import stage_outputs

from winchcascade.core.errors import RigError
from winchcascade.core.quantity import KGF
from winchcascade.core.rig_file import Rig
from winchcascade.core.rig_toml import parse_rig
from winchcascade.reduction.reduce import reduce
from winchcascade.rig.baseline import NoModel, baseline, model_of
from winchcascade.rig.parts import Model, with_part
from winchcascade.rig.simulate import Simulation, simulate

STEP_ERROR = 5e-4
"""Error of a step of 1 ms, as a share of the plateau of a channel; in open circuit of the whole
torque of a loaded run.
"""

BALANCE = 1e-4
"""Share of the energy of the line that the ledger may miss."""

every_kind = pytest.mark.parametrize("kind", RESTORING)
every_shaft = pytest.mark.parametrize("shaft", SHAFT)


def lossless(kind: str) -> Model:
    """A rig without friction and inertia of the drum, whose machine turns without a load."""
    model = with_part(baseline(own_rig(kind)), "winch", inertia=0.0)
    return with_part(model, "restoring", friction=0.0)


def haul_in(made: Simulation) -> tuple[float, float, float]:
    """Energy that the last haul-in returns to the line [J], and the displacement where it begins
    and ends [m].
    """
    x, line = made.run.channels["displacement"], made.energy["line"]
    begin = int(np.argmax(x))
    return float(line[begin] - line[-1]), float(x[begin]), float(x[-1])


@every_shaft
@every_kind
def test_the_energy_of_the_line_is_accounted_for_and_half_the_step_changes_nothing(
    kind: str, shaft: str
) -> None:
    run, model = motion_run(load=12.0, cycles=1), baseline(own_rig(kind, shaft))
    made, fine = simulate(run, model), simulate(run, model, step=5e-4)
    for at in (int(np.argmax(made.energy["line"])), -1):
        booked = sum(float(joule[at]) for entry, joule in made.energy.items() if entry != "line")
        assert booked == pytest.approx(float(made.energy["line"][at]), rel=BALANCE)
    for name, x in fine.run.channels.items():
        assert np.max(np.abs(x - made.run.channels[name])) < STEP_ERROR * np.quantile(
            np.abs(x), 0.95
        ), name
    assert ("pressure" in made.run.channels) == (kind == "gas_screw")
    assert (made.energy["gas"][-1] != 0.0) == (kind == "gas_screw")


def test_a_counterweight_returns_its_weight_times_the_way_in_haul_in() -> None:
    returned, begin, end = haul_in(simulate(motion_run(cycles=1), lossless("counterweight")))
    assert returned == pytest.approx(40.0 * KGF * (begin - end), rel=1e-3)


def test_a_spring_returns_what_its_force_and_half_its_stiffness_times_the_square_of_the_way_hold() -> (
    None
):
    returned, begin, end = haul_in(simulate(motion_run(cycles=1), lossless("spring")))
    assert returned == pytest.approx(
        300.0 * (begin - end) + 0.5 * 40.0 * (begin**2 - end**2), rel=1e-3
    )


@pytest.mark.parametrize(
    ("kind", "newton"), [("spring", 300.0), ("counterweight", 40.0 * KGF), ("none", 0.0)]
)
def test_the_tension_at_rest_before_a_payout_is_that_of_the_restoring_module_alone(
    kind: str, newton: float
) -> None:
    force = simulate(motion_run(cycles=1), baseline(own_rig(kind))).run.channels["force"]
    assert force[0] == pytest.approx(newton, abs=1e-9)


def test_the_inertia_of_a_counterweight_is_its_mass_times_the_acceleration_of_the_line() -> None:
    run, light = motion_run(load=12.0, cycles=1), lossless("counterweight")
    heavy = with_part(light, "restoring", mass=light.restoring.mass + 10.0)
    made, more = (simulate(run, model) for model in (light, heavy))
    a = np.interp(run.t, made.motion.t, made.motion.a)
    assert more.run.channels["force"] - made.run.channels["force"] == pytest.approx(
        10.0 * (KGF + a), abs=1e-6
    )


@every_shaft
def test_a_rope_that_nothing_keeps_taut_is_slack_in_haul_in_and_a_rod_is_pushed(shaft: str) -> None:
    rod = parse_rig(
        own_text("none", shaft).replace("[winch]", "[winch]\nline_can_push = true"), "rod.toml"
    )
    run = motion_run(load=12.0, cycles=1)
    rope, pushed = (
        simulate(run, with_part(baseline(rig), "winch", friction=4.0)).run
        for rig in (own_rig("none", shaft), rod)
    )
    hauled = run.channels["velocity"] < -0.2
    assert np.all(rope.channels["force"][hauled] == 0.0)
    middle = run.channels["velocity"] == run.channels["velocity"].min()
    assert np.median(pushed.channels["force"][middle]) == pytest.approx(-4.0 / 0.2, rel=1e-3)


@every_shaft
@every_kind
def test_stages_of_a_simulation_give_it_back(kind: str, shaft: str) -> None:
    model = baseline(own_rig(kind, shaft))
    run = simulate(motion_run(load=12.0, cycles=1), model).run
    plateau = reduce(run, rig=own_rig(kind, shaft)).complete[0].summary.payout.plateau
    assert plateau is not None
    on = (run.t >= plateau.begin) & (run.t <= plateau.braking)
    stages = [output.stage for output in stage_outputs(run, model)]
    assert stages == [
        *(["restoring"] if kind == "gas_screw" else []),
        "transmission",
        "gearbox",
        "generator",
        "load",
    ]
    for output in stage_outputs(run, model):
        seen = run.channels[output.channel][on]
        assert np.sqrt(np.mean((output.predicted[on] - seen) ** 2)) < 5e-3 * np.mean(seen), (
            output.stage
        )


def test_a_direct_drive_turns_the_machine_with_the_drum_and_its_bins_are_narrower_than_its_speed() -> (
    None
):
    rig = own_rig("spring", "direct")
    made = simulate(motion_run(load=12.0, cycles=1), baseline(rig))
    top = int(np.argmax(made.run.channels["velocity"]))
    assert made.rpm_gen[top] == pytest.approx(
        made.run.channels["velocity"][top] / 0.2 * 30.0 / math.pi, rel=0.01
    )
    bins = reduce(made.run, rig=rig).bins
    assert len(bins) >= 5
    assert bins[-1].rpm_high <= 60.0


# ------------------------------------------------------------------------- what a rig file states
def lacking(text: str) -> str:
    found = model_of(parse_rig(text, "mine.toml"))
    assert isinstance(found, NoModel)
    return found.why


def without(text: str, *numbers: str) -> str:
    return "\n".join(line for line in text.splitlines() if line.split(" ")[0] not in numbers)


@pytest.mark.parametrize(
    ("kind", "gone", "named"),
    [
        ("gas_screw", "lead", ('"spring"', '"counterweight"', '"none"', "gas_screw", "based_on")),
        ("spring", "stiffness", ("spring", '"gas_screw"')),
        ("counterweight", "mass", ("counterweight", '"gas_screw"')),
    ],
)
def test_what_a_restoring_module_lacks_is_named_with_the_other_kinds(
    kind: str, gone: str, named: tuple[str, ...]
) -> None:
    said = lacking(without(own_text(kind), gone))
    assert all(word in said for word in (*named, f"{gone} under [restoring]"))
    assert said.count(" under [") == 1


def test_a_gear_needs_its_mesh_efficiency_and_a_direct_drive_does_not() -> None:
    assert "eta_mesh under [drivetrain]" in lacking(without(own_text("spring"), "eta_mesh"))
    assert baseline(own_rig("spring", "direct")).drivetrain.eta_mesh == 1.0


@pytest.mark.parametrize(
    ("kind", "entry", "named"),
    [
        ("spring", 'mass = { value = 1, unit = "kg" }', "mass"),
        ("none", 'friction = { value = 1, unit = "N" }', "friction"),
        ("gas_screw", 'stiffness = { value = 1, unit = "N/m" }', "stiffness"),
    ],
)
def test_a_number_of_another_kind_is_rejected(kind: str, entry: str, named: str) -> None:
    with pytest.raises(RigError, match=rf"\[restoring\].*{named}.*{kind}"):
        parse_rig(own_text(kind).replace("[restoring]", f"[restoring]\n{entry}"), "mine.toml")


def test_a_module_of_another_kind_replaces_that_of_the_rig_below_whole() -> None:
    based = f'based_on = "hsu2026"\nname = "mine"\n[restoring]{RESTORING["spring"]}\n'
    rig: Rig = parse_rig(based, "mine.toml")
    assert rig.restoring == own_rig("spring").restoring
    assert baseline(rig).restoring.stiffness == 40.0
    assert "pressure" not in rig.sensors
    assert (
        parse_rig(
            'based_on = "hsu2026"\n[restoring]\nkind = "gas_screw"\n', "mine.toml"
        ).restoring.lead
        is not None
    )


def test_a_machine_on_the_shaft_of_the_drum_takes_no_mesh_efficiency_from_the_rig_below() -> None:
    direct = 'based_on = "hsu2026"\n[drivetrain]\ngear_ratio = { value = 1, unit = "1" }\n'
    assert baseline(parse_rig(direct, "mine.toml")).drivetrain.eta_mesh == 1.0
    stated = parse_rig(direct + 'eta_mesh = { value = 0.99, unit = "1" }\n', "mine.toml")
    assert baseline(stated).drivetrain.eta_mesh == 0.99


def test_a_light_rotor_gets_steps_that_resolve_it_and_one_that_no_machine_has_is_rejected() -> None:
    model, run = baseline(own_rig("none", "direct")), motion_run(load=12.0, cycles=1)
    light = simulate(run, with_part(model, "drivetrain", inertia_rotor=0.03))
    assert light.motion.step < 5e-4
    booked = sum(float(joule[-1]) for entry, joule in light.energy.items() if entry != "line")
    assert booked == pytest.approx(float(light.energy["line"][-1]), rel=1e-3)
    with pytest.raises(RigError, match=r"0\.000626 kg\.m2.*expected about 0\.0\d+ kg\.m2"):
        simulate(run, with_part(model, "drivetrain", inertia_rotor=6.26e-4))
