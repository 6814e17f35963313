"""traffic-avoidance with a network: what a fleet predicts is what the network says of its tasks."""

import json
import zipfile

import numpy as np
import pytest
from random_networks import random_network

from automaton.commands import main
from automaton.engine.state import LAYER_NAMES, NIL
from automaton.errors import InputError
from automaton.papers.leg_samples import members
from automaton.runs import provenance
from automaton.runs.simulation import Simulation
from automaton.scenario.text_files import SHIPPED_FOLDER
from automaton.world.building import build_world
from automaton.world.resolve import branched, resolve
from strategies.routing.routing_parameters import (
    floor_fingerprint,
    load_network,
    predicted_zones,
    save_network,
    shipped,
)
from strategies.routing.traffic_avoidance import NEXT, STAND

FLEET = ["fleet.robots=6", "stop.max_duration=400", "measure.warm_up=0"]


def avoiding(scenario, predictor, *overrides):
    picked = f"strategy.routing={{name: traffic-avoidance, predictor: {predictor}}}"
    return resolve(scenario, [picked, *overrides])


def routing_state(simulation):
    return simulation.states[LAYER_NAMES.index("routing")]


def test_a_fleet_foresees_what_the_network_says_of_both_legs():
    simulation = Simulation(avoiding("warehouse-100", "network", *FLEET))
    world, network = simulation.world, load_network(shipped("warehouse-100"))
    started = world.robots.cell.copy()
    simulation.run(1)
    state = routing_state(simulation)
    foreseen = members(state.predicted, world.grid.traffic_zone_count)
    start, pick, drop = (
        world.grid.traffic_zone[cells, 0].astype(np.int64)
        for cells in (started, state.leg_end[:, STAND], state.leg_end[:, NEXT])
    )
    expected = predicted_zones(network, start, pick) | predicted_zones(network, pick, drop)
    assert (state.leg_end[:, NEXT] != NIL).all() and expected.any()
    assert np.array_equal(foreseen, expected)


def test_runs_with_a_network_are_repeated_and_deliver():
    resolved = avoiding("warehouse-100", "network", *FLEET)
    one, other = Simulation(resolved), Simulation(resolved)
    for simulation in (one, other):
        simulation.run(400)
    assert one.digest == other.digest
    assert (one.world.orders.delivered != NIL).sum() >= 6


@pytest.mark.parametrize("information", ["everything", "{radius: 99}"])
def test_what_only_figures_need_decides_nothing(information):
    """What is not in the digest may not decide: from where and when an order was taken."""
    settings = ["fleet.robots=20", f"information={information}"]
    resolved = avoiding("warehouse-100", "network", *FLEET, *settings)
    one, other = Simulation(resolved), Simulation(resolved)
    for tick in range(10, 400, 10):
        one.run(tick)
        other.run(tick)
        other.world.orders.dispatched_from[:] = other.world.slots.access[5, 3]
        other.world.orders.dispatched[:] = 1
        other.world.tally.ticks[:] = 7
    assert one.digest == other.digest


@pytest.fixture
def own_file(tmp_path):
    """A network for the table-top floor; what it has learnt is of no use, but it fits."""
    world = build_world(resolve("tabletop-mini"), 1)[0]
    floor = floor_fingerprint(world.grid, world.rules.duration[0])
    path = tmp_path / "own.npz"
    save_network(path, random_network(1, zones=world.grid.traffic_zone_count, floor=floor))
    return path


def test_a_network_of_ones_own_serves_its_floor(own_file, capsys):
    picked = f"strategy.routing={{name: traffic-avoidance, predictor: {{network: {own_file}}}}}"
    assert main(["run", "tabletop-mini", "--set", picked]) == 0
    assert capsys.readouterr().err == ""


def test_types_that_turn_otherwise_make_another_floor():
    """The first type is the same; the ways of the others are not."""

    def fingerprint(*others):
        types = ", ".join(
            f"{{name: type{k}, robots: 1, kinematics: {way}}}"
            for k, way in enumerate(("differential", *others))
        )
        settings = [f"fleet.robots={1 + len(others)}", f"fleet.types=[{types}]"]
        world = build_world(resolve("tabletop-mini", settings), 1)[0]
        return floor_fingerprint(world.grid, world.rules.duration[0])

    assert fingerprint() == fingerprint("differential")
    assert fingerprint("omni") != fingerprint("differential")


@pytest.fixture
def own_scenario(own_file):
    """A scenario beside the file of the network that it names."""
    text = (SHIPPED_FOLDER / "tabletop-mini.yaml").read_text()
    routing = "{name: traffic-avoidance, predictor: {network: own.npz}}"
    path = own_file.parent / "own.yaml"
    path.write_text(text.replace("routing: shortest", f"routing: {routing}"))
    assert "own.npz" in path.read_text()
    return path


def test_a_network_is_found_from_the_folder_of_the_scenario(own_scenario, own_file, monkeypatch):
    monkeypatch.chdir(SHIPPED_FOLDER)  # it is not there
    resolved = resolve(own_scenario)
    assert resolved.strategies["routing"].parameters.files == (own_file,)
    simulation = Simulation(resolved)
    simulation.run(20)
    branch = branched(resolved, ("world.extra_tick_probability=0.5",))
    assert branch.strategies == resolved.strategies  # so the strategy keeps its memory
    assert main(["check", str(own_scenario)]) == 0


def test_set_on_a_shipped_scenario_finds_a_network_from_where_one_is(own_file, monkeypatch):
    monkeypatch.chdir(own_file.parent)
    resolved = avoiding("tabletop-mini", "{network: own.npz}")
    assert resolved.strategies["routing"].parameters.files == (own_file,)


def test_check_names_a_network_that_is_not_there(own_scenario, own_file, capsys):
    own_file.unlink()
    text = own_scenario.read_text()
    line = 1 + text[: text.index("routing:")].count("\n")
    assert main(["check", str(own_scenario)]) == 2
    said = f"strategy.routing: there is no file {own_file}\n"
    assert capsys.readouterr().err == f"automaton: {own_scenario}:{line}: {said}"
    setting = "strategy.routing={name: traffic-avoidance, predictor: {network: own.npz}}"
    assert main(["check", str(own_scenario), "--set", setting]) == 2
    assert capsys.readouterr().err == f"automaton: --set {setting}: {said}"


def trained_for_another_floor(path):
    save_network(path, random_network(1, zones=5, floor="another"))


def cut_short(path):
    path.write_bytes(path.read_bytes()[:-30])


def of_too_many_numbers(path):
    """Its first layer says that it has 10^15 numbers."""
    head = np.lib.format.header_data_from_array_1_0(np.zeros(1, np.float16)) | {"shape": (10**15,)}
    with zipfile.ZipFile(path, "a") as file, file.open("weights9.npy", "w") as member:
        np.lib.format.write_array_header_1_0(member, head)
    with zipfile.ZipFile(path) as old:
        parts = {name: old.read(name) for name in old.namelist()}
    parts["weights0.npy"] = parts.pop("weights9.npy")
    with zipfile.ZipFile(path, "w") as file:
        for name, data in parts.items():
            file.writestr(name, data)


@pytest.mark.parametrize(
    ("spoil", "said"),
    [
        (trained_for_another_floor, "own.npz was trained for the floor of"),
        (cut_short, "own.npz is not a file of a zone network"),
        (of_too_many_numbers, "own.npz is not a file of a zone network"),
        (lambda path: path.write_text("weights"), "own.npz is not a file of a zone network"),
    ],
)
def test_check_reads_networks_and_not_only_their_names(spoil, said, own_scenario, own_file, capsys):
    assert main(["check", str(own_scenario)]) == 0
    spoil(own_file)
    capsys.readouterr()
    assert main(["check", str(own_scenario)]) == 2
    error = capsys.readouterr().err
    assert error.count("\n") == 1 and said in error
    assert error.startswith(f"automaton: {own_scenario}:") and "strategy.routing: " in error


def test_check_tries_the_shipped_network_on_the_floor(capsys):
    picked = "strategy.routing={name: traffic-avoidance, predictor: network}"
    assert main(["check", "tabletop-mini", "--set", picked]) == 2
    assert "warehouse-100.npz was trained for the floor of" in capsys.readouterr().err
    assert main(["check", "warehouse-100", "--set", picked]) == 0


def test_verify_names_a_network_that_changed(own_scenario, own_file, capsys):
    recording = str(own_file.with_name("own.rec"))
    assert main(["run", str(own_scenario), "--until", "200", "--record", recording]) == 0
    assert main(["verify", recording]) == 0
    assert "is not what it was" not in capsys.readouterr().out
    network = load_network(own_file)
    save_network(own_file, random_network(2, network.zones, floor=network.about["floor"]))
    main(["verify", recording, "--json"])
    assert json.loads(capsys.readouterr().out)["changed_files"] == [str(own_file)]
    main(["verify", recording])
    said = f"{own_file} has changed since the run was recorded"
    assert said in " ".join(capsys.readouterr().out.split())
    own_file.unlink()
    assert main(["verify", recording]) == 2
    assert f"{own_file} changed after the run was recorded" in capsys.readouterr().err


def test_networks_that_are_shipped_are_among_the_sources(tmp_path, monkeypatch):
    package = tmp_path / "decides"
    package.mkdir()
    (package / "__init__.py").write_text("")
    (package / "floor.npz").write_bytes(b"one")
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.setattr(provenance, "PACKAGES", ("decides",))
    before = provenance.sources_of()
    (package / "floor.npz").write_bytes(b"another")
    assert provenance.sources_of() != before


def test_the_shipped_network_refuses_another_floor_before_the_run_begins(capsys):
    picked = "strategy.routing={name: traffic-avoidance, predictor: network}"
    assert main(["run", "tabletop-mini", "--set", picked]) == 2
    said = capsys.readouterr().err
    assert said.startswith(
        "automaton: warehouse-100.npz was trained for the floor of warehouse-100"
    )
    assert "automaton train traffic --scenario" in said and said.count("\n") == 1


@pytest.mark.parametrize(
    ("predictor", "words_of_it"),
    [
        ("nets", "predictor"),
        ("{network: ''}", "network"),
        ("{net: file.npz}", "net"),
        ("{network: none.npz}", "none.npz: No such file"),
    ],
)
def test_bad_predictors_are_refused_in_a_sentence(predictor, words_of_it):
    with pytest.raises(InputError) as caught:
        Simulation(avoiding("warehouse-100", predictor, *FLEET))
    said = str(caught.value)
    assert words_of_it in said and "\n" not in said
