"""Training itself; without the extra `learn` only what is said about that is tested."""

import json
import math
import sys
from itertools import product

import numpy as np
import pytest

from automaton.commands import main
from automaton.papers.leg_samples import Data, Legs, site_of, unseen
from automaton.papers.training_report import PRINTED_TABLES, from_json
from automaton.papers.training_sessions import DEPTH_LOSSES as DEPTHS
from automaton.papers.training_sessions import HIDDEN_LAYERS, constant_loss
from automaton.papers.training_settings import LOSSES, Settings, first_bias, measured
from automaton.world.resolve import resolve
from strategies.routing.routing_parameters import (
    ZoneNetwork,
    floor_fingerprint,
    load_network,
    predicted_zones,
)

TINY = """name: tiny
layout:
  picture: |
    #######
    i.....#
    #.r.r.#
    #.....#
    #.r.r.#
    i.....#
    #######
fleet: {robots: 1, kinematics: omni, start: random}
orders: {generator: dock-to-rack, count: 3}
strategy: {allocation: first-come, routing: shortest, right_of_way: wait}
stop: {when: never, max_duration: 10}
"""


@pytest.fixture
def torch():
    return pytest.importorskip("torch", reason="the extra `learn` is not installed")


@pytest.fixture
def tiny(tmp_path):
    path = tmp_path / "tiny.yaml"
    path.write_text(TINY)
    return path


def trained(legs, settings, **options):
    from automaton.papers.training import train

    return train(legs, settings, **options)


def made_up_legs(n=400, zones=12, seed=1):
    """A line of zones: a leg touches what lies between its ends."""
    rng = np.random.default_rng(seed)
    start, end = rng.integers(0, zones, (2, n))
    between = np.arange(zones)
    low, high = np.minimum(start, end)[:, None], np.maximum(start, end)[:, None]
    cells = start.astype(np.int32), end.astype(np.int32)
    return Legs(*cells, start, end, (low <= between) & (between <= high))


def test_without_torch_a_sentence_says_how_to_get_it(capsys, monkeypatch, tiny):
    monkeypatch.setitem(sys.modules, "torch", None)
    assert main(["train", "traffic", "--scenario", str(tiny)]) == 2
    said = capsys.readouterr().err
    assert said == (
        "automaton: `automaton train` needs torch, which is not installed: "
        "pip install 'fleet-automaton[learn]'\n"
    )


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["trafic"], "did you mean 'traffic'?"),
        (["traffic", "--loss", "hing"], "did you mean 'hinge'?"),
        (["traffic", "--weighting", "biased"], "did you mean 'bias'?"),
        (["traffic", "--keep", "precision,recal"], "did you mean 'recall'?"),
        (["traffic", "--epochs", "0"], "--epochs must be at least 1, not 0"),
        (["traffic", "--rate", "2"], "--rate must be above 0 and at most 1, not 2"),
        (["traffic", "--tables", "--loss", "hinge"], "--loss cannot be combined with --tables"),
        (["traffic", "--out", "no/such/folder/x.npz"], "there is no folder no/such/folder"),
        (["traffic", "--out", "."], "--out: . is a folder, not a file"),
        (["traffic", "--classifiers", "--out", "x"], "--out cannot be combined with --class"),
    ],
)
def test_bad_options_are_refused_before_anything_is_trained(capsys, arguments, words):
    assert main(["train", *arguments]) == 2
    said = capsys.readouterr().err
    assert words in said and said.count("\n") == 1


# By hand, at a = log 3, where z = 3/4 and dz/da = 3/16: loss and slope of a zone that no leg
# touches, and of one that a leg touches.
AT_THREE_QUARTERS = {
    "hinge": ((1.0, 0.0), (1 / 4, -3 / 16)),
    "signed-hinge": ((7 / 4, 3 / 16), (1 / 4, -3 / 16)),
    "cross-entropy": ((math.log(4), 3 / 4), (math.log(4 / 3), -1 / 4)),
}


@pytest.mark.parametrize("weight", [1.0, 5.0])
@pytest.mark.parametrize("name", LOSSES)
def test_losses_and_their_slopes_are_those_of_the_formulas(torch, name, weight):
    from automaton.papers.training import mean_loss

    for y, (loss, slope) in enumerate(AT_THREE_QUARTERS[name]):
        logit = torch.tensor([[math.log(3)]], dtype=torch.float64, requires_grad=True)
        label = torch.full((1, 1), float(y), dtype=torch.float64)
        found = mean_loss(name, logit, label, (1.0, weight))
        found.backward()
        times = weight if y else 1.0
        assert found.item() == pytest.approx(times * loss)
        assert logit.grad.item() == pytest.approx(times * slope)


def test_the_printed_hinge_has_no_slope_where_a_zone_is_not_touched(torch):
    from automaton.papers.training import mean_loss

    logit = torch.linspace(-20, 20, 401, dtype=torch.float64, requires_grad=True)
    mean_loss("hinge", logit, torch.zeros(401, dtype=torch.float64), (1.0, 1.0)).backward()
    assert (logit.grad == 0).all()


def test_equal_seeds_give_equal_weights(torch):
    legs = made_up_legs()
    one, same, other = (
        trained(legs, Settings(epochs=3, seed=seed)).kept[()].layers for seed in (1, 1, 2)
    )
    for (weights, bias), (weights_again, bias_again) in zip(one, same, strict=True):
        assert np.array_equal(weights, weights_again) and np.array_equal(bias, bias_again)
    assert not np.array_equal(one[0][0], other[0][0])


def test_weights_are_kept_only_when_all_monitored_metrics_improve(torch):
    """Each epoch is compared with the one that was kept, not with the one before."""
    seen = []
    keeps = ((), ("recall",), ("precision", "recall"))
    done = trained(
        made_up_legs(),
        Settings(epochs=12),
        keeps=keeps,
        on_epoch=lambda epoch, loss, now: seen.append((epoch, loss, now)),
    )
    assert [epoch for epoch, _, _ in seen] == list(range(1, 13))
    assert [loss for _, loss, _ in seen] == done.losses
    for keep in keeps:
        best = seen[0]
        for epoch in seen[1:]:
            better = [measures(epoch)[name] > measures(best)[name] for name in keep]
            if all(better) if keep else epoch[1] < best[1]:
                best = epoch
        assert (done.kept[keep].epoch, done.kept[keep].counts) == (best[0], best[2])


def measures(epoch):
    tp, fp, _, fn = epoch[2]
    return {"precision": tp / max(1, tp + fp), "recall": tp / max(1, tp + fn)}


def test_training_ends_when_the_loss_does_not_fall(torch):
    """The printed hinge comes to its floor, where every output is 1: no epoch lowers it further."""
    legs = made_up_legs()
    done = trained(legs, Settings(loss="hinge", rate=0.05, patience=2))
    assert len(done.losses) < 100
    before = min(done.losses[:-2])
    assert all(loss >= before for loss in done.losses[-2:])
    tp, fp, tn, fn = done.kept[()].counts
    assert (tn, fn) == (0, 0)
    assert tp / (tp + fp) == pytest.approx(legs.touched.mean())


def test_a_network_of_bias_alone_starts_at_the_share_of_touched_zones(torch):
    from automaton.papers.training import first_layers

    touched = made_up_legs().touched
    layers = first_layers(12, first_bias(touched), torch.Generator(), 3)
    assert torch.sigmoid(layers[-1][1]).detach().numpy() == pytest.approx(touched.mean(), abs=1e-6)


def test_a_network_learns_what_lies_between(torch):
    legs, fresh = made_up_legs(1000), made_up_legs(seed=2)
    layers = trained(legs, Settings(epochs=12, rate=0.003)).kept[()].layers
    half = tuple(tuple(part.astype(np.float16) for part in layer) for layer in layers)
    answers = predicted_zones(ZoneNetwork(half, {}), fresh.start_zone, fresh.end_zone)
    values = measured(answers, fresh.touched)
    assert values["precision"] > 0.97 and values["recall"] > 0.97


def test_the_command_writes_a_network_for_its_floor(torch, tiny, tmp_path, capsys):
    out = tmp_path / "tiny.npz"
    arguments = ["--scenario", str(tiny), "--epochs", "2", "--legs", "100", "--out", str(out)]
    assert main(["train", "traffic", *arguments]) == 0
    site = site_of(resolve(tiny))
    assert load_network(out).about["floor"] == floor_fingerprint(site.floor.grid, site.duration)
    said = capsys.readouterr()
    assert said.err == ""
    assert "2 epochs of 100 legs" in said.out and "unused seed" in said.out


def test_a_training_that_is_broken_off_leaves_no_file(torch, tiny, tmp_path, monkeypatch, capsys):
    from automaton.papers import training

    def interrupt(*_):
        raise KeyboardInterrupt

    monkeypatch.setattr(training, "mean_loss", interrupt)
    arguments = ["train", "traffic", "--scenario", str(tiny), "--out", str(tmp_path / "no.npz")]
    assert main(arguments) == 130
    assert capsys.readouterr().err == "automaton: interrupted\n"
    assert [path.name for path in tmp_path.iterdir()] == ["tiny.yaml"]


def test_tables_of_a_floor_have_the_rows_of_the_paper(torch, tiny, tmp_path, capsys):
    out = tmp_path / "tables.json"
    arguments = ["--scenario", str(tiny), "--epochs", "1", "--legs", "60", "--out", str(out)]
    assert main(["train", "traffic", "--tables", *arguments]) == 0
    found = json.loads(out.read_text())
    rows = from_json(found["rows"])
    assert len(rows) == 3 * 19 and found["settings"]["legs"] == 60
    for row in rows:
        assert tuple(row.paper.values()) == PRINTED_TABLES[row.table][row.monitored]
    text = capsys.readouterr().out
    assert "…" not in text and max(map(len, text.splitlines())) <= 80


def test_networks_of_other_depths_are_trained_beside_a_constant_answer(
    torch, tiny, tmp_path, capsys
):
    out = tmp_path / "depths.json"
    arguments = ["--scenario", str(tiny), "--epochs", "1", "--legs", "60", "--out", str(out)]
    assert main(["train", "traffic", "--depths", *arguments]) == 0
    rows = json.loads(out.read_text())["rows"]
    assert [(row["loss"], row["hidden"]) for row in rows] == list(product(DEPTHS, HIDDEN_LAYERS))
    assert len({row["least"] for row in rows}) == len(rows)
    text = capsys.readouterr().out
    assert "cross-entropy" in text and max(map(len, text.splitlines())) <= 80


@pytest.mark.parametrize(("loss", "least"), [("hinge", 3 / 4), ("cross-entropy", 0.5623351)])
def test_a_constant_answer_has_this_loss_at_least(loss, least):
    """One zone of four is touched: -1/4 log 1/4 - 3/4 log 3/4, or all of them said to be."""
    touched = np.array([[True, False, False, False]])
    assert constant_loss(loss, touched) == pytest.approx(least)


def test_other_classifiers_learn_the_same_legs():
    pytest.importorskip("sklearn", reason="the extra `learn` is not installed")
    from automaton.papers.training_sessions import try_classifiers

    legs, fresh = made_up_legs(), made_up_legs(seed=2)
    data = Data(legs, fresh, fresh.some(unseen(fresh, legs)))
    results = try_classifiers(data, seed=1, at_most=300)
    assert [result.learnt_from for result in results] == [300] * 5
    by_name = {result.classifier: result for result in results}
    # Here the zones of its ends decide what a leg touches: its nearest neighbour is its equal.
    assert by_name["nearest neighbours, k = 1"].training["subset"] == 1.0
    assert all(0 < result.training["precision"] <= 1 for result in results)
    assert try_classifiers(data, seed=1, at_most=300) == results
