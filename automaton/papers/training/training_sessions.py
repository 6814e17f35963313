"""What `automaton train` does, on the floor of one scenario."""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any, Final

from automaton.atomic_write import atomic_writer
from automaton.papers.training.leg_samples import Data, Site, data_of, judged, network_of, site_of
from automaton.papers.training.prediction_metrics import Counts, precision, recall
from automaton.papers.training.training_settings import LOSSES, Settings
from automaton.world.resolve import resolve
from strategies.routing.routing_parameters import floor_fingerprint, save_network

ProgressCallback = Callable[[str], None]
RESULTS: Final = "automaton traffic tables 1"  # format of a file of results


@dataclass(frozen=True)
class Session:
    """A floor with its legs, drawn once."""

    name: str  # of the scenario
    mode: str  # of its zones
    site: Site
    data: Data
    settings: Settings

    @classmethod
    def of(cls, scenario: str, overrides: Sequence[str], settings: Settings) -> Session:
        """Raises InputError for a bad scenario, or a floor without zones."""
        resolved = resolve(scenario, overrides)
        site = site_of(resolved)
        data = data_of(site, settings.legs, settings.seed)
        return cls(
            resolved.scenario.name, resolved.scenario.world.traffic_zones, site, data, settings
        )

    def train_network(
        self, keep: tuple[str, ...], out: Path, told: ProgressCallback | None = None
    ) -> dict[str, Any]:
        """Train, write the network to `out`, and say how well it predicts."""
        from automaton.papers.training.training import train

        def tell(epoch: int, loss: float, now: Counts) -> None:
            if told is not None:
                told(
                    f"epoch {epoch} of at most {self.settings.epochs}: loss {loss:.5f}, "
                    f"precision {precision(now):.3f}, recall {recall(now):.3f}"
                )

        trained = train(self.data.training, self.settings, (keep,), tell)
        kept = trained.kept[keep]
        about = {
            "settings": asdict(self.settings),
            "monitored": list(keep) or ["loss"],
            "epochs": len(trained.losses),
            "epoch": kept.epoch,
            "loss": kept.loss,
        }
        network = network_of(kept.layers, self.site, self.name, self.mode, about)
        save_network(out, network)
        measures = judged(network, self.data)
        return {"file": str(out), **network.about, "zones": network.zones, "measures": measures}

    def train_tables(
        self, out: Path | None, told: ProgressCallback | None = None
    ) -> dict[str, Any]:
        """Train for Tables 1 to 4, with each loss; written to `out` if there is one."""
        from automaton.papers.training.training_tables import as_json, train_rows

        def tell(loss: str, weighting: str, epoch: int) -> None:
            if told is not None:
                told(f"{loss}, {weighting}: epoch {epoch} of at most {self.settings.epochs}")

        rows = []
        for loss in LOSSES:
            settings = replace(self.settings, loss=loss)
            rows += train_rows(self.data, self.site, settings, tell)
        shared = self._settings_but("loss", "weighting")
        results = {"format": RESULTS, **self._origin(), "settings": shared, "rows": as_json(rows)}
        return written(results, out)

    def train_depths(
        self, out: Path | None, told: ProgressCallback | None = None
    ) -> dict[str, Any]:
        """Train networks of several depths; written to `out` if there is one."""
        from automaton.papers.training.depths import train_depths

        rows = [depth._asdict() for depth in train_depths(self.data.training, self.settings, told)]
        shared = self._settings_but("loss", "weighting", "hidden")
        results = {**self._origin(), "settings": shared, "rows": rows}
        return written(results, out)

    def try_classifiers(self, told: ProgressCallback | None = None) -> dict[str, Any]:
        """Let other classifiers learn the same legs, or as many as they manage."""
        from automaton.papers.training.classifiers import EVALUATED, try_classifiers

        results = try_classifiers(self.data, self.settings.seed, told)
        return {
            **self._origin(),
            "judged_by": EVALUATED,
            "classifiers": [result._asdict() for result in results],
        }

    def _settings_but(self, *varied: str) -> dict[str, Any]:
        """The settings that all rows share."""
        return {name: one for name, one in asdict(self.settings).items() if name not in varied}

    def _origin(self) -> dict[str, Any]:
        grid = self.site.floor.grid
        return {
            "scenario": self.name,
            "mode": self.mode,
            "zones": int(grid.traffic_zone_count),
            "floor": floor_fingerprint(grid, self.site.duration),
        }


def written(results: dict[str, Any], out: Path | None) -> dict[str, Any]:
    """Results, in a file if there is to be one."""
    if out is not None:
        with atomic_writer(out) as file:
            file.write((json.dumps(results, indent=1, ensure_ascii=False) + "\n").encode())
    return results
