"""Networks that predict zones: whole-number inference, their files, and the one that is shipped."""

import io
import json

import numpy as np
import pytest
from random_networks import random_network

from automaton.engine.state import NIL
from automaton.errors import InputError
from automaton.papers.leg_samples import legs_of, members, site_of, unseen
from automaton.papers.training_settings import measured
from automaton.world.building import build_world
from automaton.world.resolve import resolve
from strategies.routing import routing_parameters as networks
from strategies.routing.predicted_paths import kernel_network, predict_legs, words
from strategies.routing.routing_parameters import (
    check_floor,
    floor_fingerprint,
    load_network,
    predicted_zones,
    save_network,
)

SHIPPED = networks.shipped("warehouse-100")


def drawn_pairs(seed, zones, n=300):
    rng = np.random.default_rng(seed)
    return tuple(rng.integers(NIL, zones, n) for _ in range(2))


def compiled(network, start, end):
    """What the kernel answers, as (n, zones) bool."""
    used = np.full((len(start), words(network.zones)), -1, np.int64)
    predict_legs(kernel_network(network), start, end, used)
    return members(used, network.zones)


def with_floats(network, start, end):
    """Logits in float64, straight from the definition."""
    n = np.arange(len(start))
    x = np.zeros((len(start), 2 * network.zones))
    x[n[start != NIL], start[start != NIL]] = 1
    x[n[end != NIL], end[end != NIL] + network.zones] = 1
    for k, (weights, bias) in enumerate(network.layers):
        x = (np.maximum(x, 0) if k else x) @ weights.astype(float) + bias.astype(float)
    return x


@pytest.mark.parametrize(("seed", "scale"), [(1, 1.0), (2, 3.0), (3, 40.0)])
def test_the_compiled_form_and_numpy_agree_in_every_zone(seed, scale):
    network = random_network(seed, scale=scale)
    start, end = drawn_pairs(seed, network.zones)
    answer = predicted_zones(network, start, end)
    assert answer.any() and not answer.all()
    assert np.array_equal(compiled(network, start, end), answer)


def test_whole_numbers_answer_as_floats_do_unless_it_is_close():
    network = random_network(5)
    start, end = drawn_pairs(5, network.zones)
    logits = with_floats(network, start, end)
    sure = np.abs(logits) > 0.005
    assert sure.mean() > 0.95
    assert np.array_equal(predicted_zones(network, start, end)[sure], (logits > 0)[sure])


def test_large_weights_leave_fewer_bits_and_very_large_ones_are_refused():
    assert networks.whole_layers(random_network(1))[0] == networks.MOST_BITS
    bits, layers = networks.whole_layers(random_network(1, scale=200.0))
    assert networks.FEWEST_BITS <= bits < networks.MOST_BITS
    assert networks.largest_sum(layers, bits) < 2**53
    with pytest.raises(InputError, match="weights of the network are too large"):
        networks.whole_layers(random_network(1, scale=60_000.0))


def test_a_file_gives_back_the_network(tmp_path):
    network, path = random_network(4), tmp_path / "some.npz"
    save_network(path, network)
    again = load_network(path)
    for (weights, bias), (weights_again, bias_again) in zip(
        network.layers, again.layers, strict=True
    ):
        assert np.array_equal(weights, weights_again) and np.array_equal(bias, bias_again)
    assert again.about == {"format": networks.NETWORK_FORMAT, **network.about}
    assert [file.name for file in tmp_path.iterdir()] == ["some.npz"]
    before = path.read_bytes()
    save_network(path, network)
    assert path.read_bytes() == before


def spoilt_files():
    """Contents that are no network: nothing, text, a pickle, and arrays that do not fit."""
    yield "empty", b""
    yield "text", b"weights"
    buffer = io.BytesIO()
    np.savez(buffer, about=np.array({"a": 1}, dtype=object), allow_pickle=True)
    yield "pickled", buffer.getvalue()
    network = random_network(6)
    for name, change in {
        "cut": {"bias3": networks.bytes_apart(network.layers[3][1][:-1])},
        "wide": {"weights1": network.layers[1][0].astype(np.float64)},
        "infinite": {"bias0": networks.bytes_apart(network.layers[0][1] * np.float16(np.inf))},
        "other": {"about": np.array(json.dumps({"format": "something else"}))},
        "no object": {"about": np.array("[1]")},
    }.items():
        arrays = {"about": np.array(json.dumps({"format": networks.NETWORK_FORMAT}))}
        for k, (weights, bias) in enumerate(network.layers):
            arrays[f"weights{k}"] = networks.bytes_apart(weights)
            arrays[f"bias{k}"] = networks.bytes_apart(bias)
        buffer = io.BytesIO()
        np.savez(buffer, **arrays | change)
        yield name, buffer.getvalue()


@pytest.mark.parametrize(
    ("name", "content"), list(spoilt_files()), ids=lambda value: str(value)[:9]
)
def test_what_is_no_network_is_refused_in_a_sentence(tmp_path, name, content):
    path = tmp_path / "spoilt.npz"
    path.write_bytes(content)
    with pytest.raises(InputError, match=r"spoilt\.npz is not a file of a zone network$"):
        load_network(path)


def test_a_missing_file_is_named(tmp_path):
    with pytest.raises(InputError, match=r"cannot read .*none\.npz: No such file"):
        load_network(tmp_path / "none.npz")


@pytest.fixture(scope="module")
def warehouse():
    resolved = resolve("warehouse-100")
    site = site_of(resolved)
    return resolved, site, load_network(SHIPPED)


def test_legs_lead_between_racks_and_docks_by_turns(warehouse):
    _, site, _ = warehouse
    legs = legs_of(site, 400, seed=3)
    assert set(legs.start[::2]) <= set(site.racks) and set(legs.end[::2]) <= set(site.docks)
    assert set(legs.start[1::2]) <= set(site.docks) and set(legs.end[1::2]) <= set(site.racks)
    again, other = legs_of(site, 400, seed=3), legs_of(site, 400, seed=4)
    assert all(np.array_equal(a, b) for a, b in zip(legs, again, strict=True))
    assert not np.array_equal(legs.start, other.start)


def test_a_leg_touches_the_zones_that_its_moves_leave(warehouse):
    """The first move leaves the start's zone; a leg inside one zone touches nothing else."""
    _, site, _ = warehouse
    legs = legs_of(site, 400, seed=3)
    moved = (legs.start != legs.end) & (legs.start_zone != NIL)
    assert legs.touched[moved, legs.start_zone[moved]].all()
    assert 10 < legs.touched.sum(axis=1).mean() < 20


def test_the_shipped_network_predicts_legs_that_it_never_saw(warehouse):
    _, site, network = warehouse
    known = legs_of(site, 15_000, seed=network.about["settings"]["seed"])
    fresh = legs_of(site, 4_000, seed=977)
    found = predicted_zones(network, fresh.start_zone, fresh.end_zone)
    values = measured(found, fresh.touched)
    assert values["precision"] >= 0.95 and values["recall"] >= 0.95
    new = unseen(fresh, known)
    assert 0.2 < new.mean() < 0.5
    values = measured(found[new], fresh.touched[new])
    assert values["precision"] >= 0.91 and values["recall"] >= 0.91
    some = slice(0, 200)
    start, end = fresh.start_zone[some], fresh.end_zone[some]
    assert np.array_equal(compiled(network, start, end), found[some])


def test_the_shipped_network_is_small_and_says_where_it_comes_from(warehouse):
    _, site, network = warehouse
    assert SHIPPED.stat().st_size < 2_000_000
    about = network.about
    assert (about["scenario"], about["mode"], network.zones) == ("warehouse-100", "undirected", 522)
    assert about["floor"] == floor_fingerprint(site.floor.grid, site.duration)
    assert about["settings"]["loss"] == "cross-entropy"


@pytest.mark.parametrize(
    ("scenario", "overrides"),
    [
        ("warehouse-100", ["world.traffic_zones=directed"]),
        ("warehouse-100", ["layout={generator: racks, preset: L1}"]),
        ("tabletop-1", []),
    ],
)
def test_a_network_refuses_another_floor_and_says_how_to_train_for_it(
    warehouse, scenario, overrides
):
    world = build_world(resolve(scenario, overrides), 1)[0]
    with pytest.raises(InputError) as caught:
        check_floor(warehouse[2], world.grid, world.rules.duration[0], SHIPPED)
    said = str(caught.value)
    assert said.startswith("warehouse-100.npz was trained for the floor of warehouse-100")
    assert "automaton train traffic --scenario" in said and "\n" not in said


def test_a_network_takes_its_floor_whatever_its_robots_and_capacities(warehouse):
    overrides = ["layout={generator: racks, capacity: 2}", "fleet.robots=3", "world.slowdown=none"]
    world = build_world(resolve("warehouse-100", overrides), 1)[0]
    check_floor(warehouse[2], world.grid, world.rules.duration[0], SHIPPED)
