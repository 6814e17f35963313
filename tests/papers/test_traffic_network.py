"""Tables 1 to 4 and the shipped network: what is stored follows from the legs, and is complete."""

from itertools import product

import numpy as np
import pytest

from automaton.papers.claim_report import evidence
from automaton.papers.claims import judge
from automaton.papers.leg_samples import legs_of, site_of
from automaton.papers.reproduction_study import MadeTable, Reproduced, find
from automaton.papers.traffic_study import TRAFFIC_CLAIMS
from automaton.papers.traffic_trials import DEPTHS_TABLE as DEPTH_TABLE
from automaton.papers.traffic_trials import TABLES_1_TO_4, network, stored, tasks_of, warehouse
from automaton.papers.training_report import COLUMNS, PRINTED_TABLES, from_json
from automaton.papers.training_sessions import DEPTH_LOSSES as DEPTHS
from automaton.papers.training_sessions import HIDDEN_LAYERS, constant_loss
from automaton.papers.training_settings import LOSSES, Settings, measured
from automaton.world.resolve import resolve
from strategies.routing.routing_parameters import (
    floor_fingerprint,
    load_network,
    shipped,
)


@pytest.fixture(scope="module")
def site():
    return site_of(resolve("warehouse-100"))


@pytest.fixture(scope="module")
def rows():
    return from_json(stored()["rows"])


def test_the_stored_tables_are_complete_and_of_this_floor(site, rows):
    assert stored()["floor"] == floor_fingerprint(site.floor.grid, site.duration)
    expected = {
        (table, keep, loss)
        for table in PRINTED_TABLES
        for keep in PRINTED_TABLES[table]
        for loss in LOSSES
    }
    assert {(row.table, row.monitored, row.loss) for row in rows} == expected
    for row in rows:
        assert (
            tuple(row.paper[name] for name in COLUMNS) == PRINTED_TABLES[row.table][row.monitored]
        )
        assert 1 <= row.epoch <= row.epochs <= stored()["settings"]["epochs"]


def test_both_files_were_made_with_the_settings_of_the_paper():
    default = Settings()
    settings = load_network(shipped("warehouse-100")).about["settings"]
    assert Settings(**settings) == default
    assert (default.batch, default.epochs, default.patience, default.legs) == (32, 100, 5, 15_000)
    assert {**settings, **stored()["settings"]} == settings


def test_the_printed_hinge_predicts_every_zone_that_it_ever_saw_touched(site, rows):
    """Its rows follow from the legs: no zone that a leg touched is left out, others may come in."""
    settings = stored()["settings"]
    known = legs_of(site, settings["legs"], settings["seed"])
    fresh = legs_of(site, settings["legs"], settings["seed"] + 1)
    hinge = [row for row in rows if row.loss == "hinge"]
    assert len(hinge) == 19
    for row in hinge:
        truth = (known if row.table in (1, 3) else fresh).touched
        most = measured(np.ones_like(truth), truth)
        least = measured(np.broadcast_to(known.touched.any(axis=0), truth.shape), truth)
        assert row.ours["recall"] == 1.0 and least["recall"] > 0.9999
        for name in ("accuracy", "precision"):
            assert most[name] - 0.0001 < row.ours[name] < least[name] + 0.0001
        assert most["precision"] > 0.028 and least["precision"] < 0.035


def test_the_stored_depths_are_complete_and_of_these_legs(site):
    found = stored("depths")
    assert found["floor"] == floor_fingerprint(site.floor.grid, site.duration)
    assert [(row["loss"], row["hidden"]) for row in found["rows"]] == list(
        product(DEPTHS, HIDDEN_LAYERS)
    )
    known = legs_of(site, found["settings"]["legs"], found["settings"]["seed"])
    for row in found["rows"]:
        assert row["constant"] == pytest.approx(constant_loss(row["loss"], known.touched))
        assert 1 <= row["epochs"] <= found["settings"]["epochs"]


def test_one_training_decides_nothing_about_depths():
    """A training draws its weights and the order of its legs; the margin is 2e-5."""
    cases = DEPTH_TABLE.cases(())
    made = MadeTable(DEPTH_TABLE, cases, DEPTH_TABLE.run(cases, range(1, 61), None, None))
    again = Reproduced(find("traffic"), 60, [made])
    found = {
        claim.text: judge(claim, again.samples(), {}, again.repeated()) for claim in TRAFFIC_CLAIMS
    }
    said = {text: one for text, one in found.items() if one is not None}
    assert list(said) == [
        "Deeper networks do not converge (the printed hinge loss)",
        "Deeper networks do not converge (cross-entropy)",
    ]
    assert [one.verdict for one in said.values()] == ["undecided"] * 2
    hinge, cross = (evidence(one) for one in said.values())
    assert "6 hidden layers: 0.00002 (one training gives no interval), needed at least 0" in hinge
    assert "hidden layers: -0." in cross and "one training" in cross


def test_rows_that_monitor_the_same_thing_twice_are_equal(rows):
    """Hamming loss is 1 - accuracy: monitoring both is monitoring accuracy."""
    found = {(row.table, row.loss, row.monitored): row.ours for row in rows}
    for table in (1, 2):
        for loss in LOSSES:
            assert found[table, loss, ("accuracy",)] == found[table, loss, ("accuracy", "hamming")]


def test_weighed_cross_entropy_finds_nearly_all_zones_on_new_legs(rows):
    """What the paper's network could have learnt with its sample weights."""
    [row] = [
        row
        for row in rows
        if (row.table, row.loss, row.monitored) == (4, "cross-entropy", ("precision", "recall"))
    ]
    assert row.ours["precision"] > 0.8 and row.ours["recall"] > 0.97


def test_the_others_are_counted_once_for_both_legs():
    where = warehouse()
    tasks = tasks_of(where, 5)[:20]
    foreseen = network(where, 5, tasks)
    assert foreseen.shape == (20, where.grid.traffic_zone_count)
    assert foreseen.max() <= tasks.shape[1] - 1 and 100 < foreseen.sum(axis=1).mean() < 160
    alone = tasks.copy()
    alone[:, 2:] = alone[:, 1:2]  # five times the same robot
    assert set(np.unique(network(where, 5, alone))) == {0, 5}


def test_the_table_takes_its_figures_from_the_file(rows):
    cases = TABLES_1_TO_4.cases(())
    results = TABLES_1_TO_4.run(cases, [1], None, None)
    assert len(cases) == len(rows) == 57
    by_name = {(row.table, row.short, row.loss): row for row in rows}
    for case, [result] in zip(cases, results, strict=True):
        assert result.metrics == by_name[case.key].ours
        for name in COLUMNS:
            assert TABLES_1_TO_4.published(case.key, name) == by_name[case.key].paper[name]
