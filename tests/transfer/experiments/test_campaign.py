"""Tiny campaigns on the planar twin: half a second per trial, a handful of trials."""

import shutil
from collections.abc import Iterable, Iterator
from concurrent.futures import Executor, ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from chromium import chromium

from vvvaltr.controller.core.errors import UserError
from vvvaltr.controller.core.processes import processes
from vvvaltr.transfer.experiments.campaign import list_checkpoints, list_transfer_methods, plan_units, run_campaign
from vvvaltr.transfer.experiments.cluster import cluster
from vvvaltr.transfer.experiments.findings import as_json, gather_findings, holds
from vvvaltr.transfer.experiments.report import to_markdown, write_report
from vvvaltr.transfer.experiments.statistics import measure_gain
from vvvaltr.transfer.experiments.store import Store
from vvvaltr.transfer.experiments.tables import gain_text
from vvvaltr.transfer.experiments.thesis import BODIES, GROUPS, find_pairs, list_pairs
from vvvaltr.transfer.experiments.unit import Result, Settings, Step, Truth, open_condition, work

QUICK = Settings(duration_s=0.5, starts=2, most_trials=6)
METHODS = ("drive", "efficient", "optimistic")


@pytest.fixture(scope="module")
def here() -> Iterator[Executor]:
    with ThreadPoolExecutor(1) as executor:
        yield executor


def silent(units: Iterable[Any], total: int) -> Iterable[Any]:
    return units


@pytest.fixture(scope="module")
def campaign(tmp_path_factory: pytest.TempPathFactory, here: Executor) -> Store:
    store = Store.begin(tmp_path_factory.mktemp("campaigns") / "both", QUICK)
    run_campaign(store, find_pairs("planar", "1"), 2, METHODS, here, silent)
    return store


def files(store: Store) -> dict[str, bytes]:
    root = store.folder / "runs"
    return {str(path.relative_to(root)): path.read_bytes() for path in sorted(root.rglob("*.*"))}


def test_there_are_the_thesis_experiments_and_its_figures_on_both_twins() -> None:
    for robot in BODIES:
        known = {pair.key: pair for pair in list_pairs(robot)}
        assert set(GROUPS["all"]) == set(known)
        assert [known[key].trials for key in ("1", "1b", "2", "3")] == [40, 40, 50, 40]
        assert [pair.key for pair in known.values() if pair.published] == ["1", "2", "3"]
        assert known["1"].target.world.gravity_m_s2 == pytest.approx(5 * known["1"].source.world.gravity_m_s2, rel=0.01)
        assert known["unrelated"].source.body != known["unrelated"].target.body


@pytest.mark.parametrize("robot", BODIES)
def test_every_condition_can_be_set_up(robot: str) -> None:
    for pair in list_pairs(robot):
        for condition in (pair.source, pair.target):
            bodies = open_condition(Settings(robot), condition, seed=1)
            assert bodies[0].motors.motor_count == 3


def test_an_unknown_experiment_is_named_with_those_that_are_known() -> None:
    with pytest.raises(ValueError, match=r"'7'.*1b"):
        find_pairs("planar", "7")


def test_checkpoints_end_with_the_end() -> None:
    assert list_checkpoints(40) == (5, 10, 20, 40)
    assert list_checkpoints(10) == (5, 10)
    assert list_checkpoints(4) == (4,)


def test_experiments_with_one_target_share_its_runs_without_a_source(campaign: Store) -> None:
    names = files(campaign)

    assert sum("plain/" in name and "source" not in name for name in names) == 2 * 3
    assert sum("efficient-from" in name for name in names) == 2 * 2
    assert sum("optimistic/" in name for name in names) == 2
    assert sum("source" in name for name in names) == 2 * 2


def test_an_experiment_reads_the_longer_runs_of_another_up_to_its_own_end() -> None:
    of = {
        key: plan_units(find_pairs("planar", key)[0], Settings(), 1, METHODS) for key in ("1b", "2", "2-friction", "3")
    }

    assert of["1b"].plain == of["2-friction"].plain
    assert of["1b"].plain[0].checkpoints == (5, 10, 20, 40, 50)
    assert of["2"].source == of["3"].source
    assert [of[key].methods["efficient"].trials for key in of] == [40, 50, 50, 40]
    steps = tuple(Step((float(number),), 0.0, (1.0,), 0.0, 0.0, 0.0) for number in range(50))
    run = Result(steps, tuple(Truth(after, (0.1,)) for after in (5, 40, 50)))
    assert run.until((5, 40)) == Result(steps[:40], run.truths[:2])
    assert run.until((5, 50)) == Result(steps, (run.truths[0], run.truths[2]))


def test_a_source_run_differs_from_the_runs_on_the_target_and_repeats_from_each_other(campaign: Store) -> None:
    contents = list(files(campaign).values())

    assert len(set(contents)) == len(contents)


def test_a_true_speed_is_of_as_many_starts_as_asked_for_and_no_two_are_alike(campaign: Store) -> None:
    units = plan_units(find_pairs("planar", "1b")[0], QUICK, 1, METHODS)
    gait = campaign.load(units.plain[0]).steps[-1].recommended_hz
    truth = campaign.load(units.plain[0]).truths[-1]

    assert len(truth.speeds_m_s) == QUICK.starts
    assert len(set(truth.speeds_m_s)) == QUICK.starts
    assert len(gait) == 3


def test_an_interrupted_campaign_goes_on_and_ends_as_an_uninterrupted_one(
    campaign: Store, tmp_path: Path, here: Executor
) -> None:
    store = Store.begin(tmp_path / "again", QUICK)
    whole = files(campaign)
    seen = 0

    def interrupted(units: Iterable[Any], total: int) -> Iterator[Any]:
        nonlocal seen
        for unit in units:
            seen += 1
            if seen == 7:
                raise KeyboardInterrupt
            yield unit

    with pytest.raises(KeyboardInterrupt):
        run_campaign(store, find_pairs("planar", "1"), 2, METHODS, here, interrupted)
    some = files(store)
    stamps = {path: path.stat().st_mtime_ns for path in store.folder.rglob("*.jsonl")}
    run_campaign(Store.begin(tmp_path / "again", QUICK), find_pairs("planar", "1"), 2, METHODS, here, silent)

    assert 0 < len(some) < len(whole)
    assert files(store) == whole
    assert all(path.stat().st_mtime_ns == stamp for path, stamp in stamps.items())


def test_a_process_finds_what_is_found_here(campaign: Store) -> None:
    unit = plan_units(find_pairs("planar", "1b")[0], QUICK, 2, METHODS).plain[0]
    with processes(1) as executor:
        assert executor.submit(work, QUICK, unit, None).result() == campaign.load(unit)


def test_a_dask_cluster_finds_what_is_found_here(campaign: Store) -> None:
    from distributed import LocalCluster

    unit = plan_units(find_pairs("planar", "1b")[0], QUICK, 2, METHODS).plain[0]
    with (
        LocalCluster(n_workers=1, threads_per_worker=1, processes=False, dashboard_address=None) as local,
        cluster(local.scheduler_address) as executor,
    ):
        assert executor.submit(work, QUICK, unit, None).result() == campaign.load(unit)


def test_a_cluster_that_does_not_answer_is_said_in_one_line() -> None:
    with pytest.raises(UserError, match="no Dask scheduler answers"), cluster("nowhere"):
        pass


def test_another_campaign_in_the_same_place_is_refused(campaign: Store, tmp_path: Path) -> None:
    with pytest.raises(UserError, match=r"seed: the campaign in .* has 0, but 1"):
        Store.begin(campaign.folder, Settings(duration_s=0.5, starts=2, most_trials=6, seed=1))
    (tmp_path / "thesis.pdf").touch()
    with pytest.raises(UserError, match="is not a campaign"):
        Store.begin(tmp_path, QUICK)
    with pytest.raises(UserError, match="is not a campaign"):
        Store.open(tmp_path)


def test_a_damaged_result_is_named(campaign: Store, tmp_path: Path) -> None:
    store = Store.begin(tmp_path / "torn", QUICK)
    unit = plan_units(find_pairs("planar", "1b")[0], QUICK, 1, METHODS).source
    store.save(unit, campaign.load(unit))
    path = next(store.folder.rglob("*.jsonl"))
    path.write_bytes(path.read_bytes()[:-20])

    with pytest.raises(UserError, match=r"001-source\.jsonl"):
        store.load(unit)


def test_an_inverted_source_calls_the_slowest_gait_the_fastest(campaign: Store) -> None:
    result = campaign.load(plan_units(find_pairs("planar", "1b")[0], QUICK, 1, METHODS).source)
    upright, inverted = result.source("a", inverted=False), result.source("a", inverted=True)

    assert upright.scores.index(max(upright.scores)) == inverted.scores.index(min(inverted.scores))
    assert max(upright.scores) == pytest.approx(max(inverted.scores))


def test_a_shuffled_source_says_no_more_than_that_strong_gaits_are_fast(campaign: Store) -> None:
    result = campaign.load(plan_units(find_pairs("planar", "shuffled")[0], QUICK, 1, METHODS).source)
    upright, shuffled = result.source("a", inverted=False), result.source("a", inverted=False, shuffled=True)
    assert shuffled.gaits == upright.gaits
    assert sorted(shuffled.scores) == sorted(upright.scores)
    by_strength = sorted(zip(shuffled.gaits, shuffled.scores, strict=True), key=lambda it: sum(it[0].frequency_hz))
    assert [score for _, score in by_strength] == sorted(upright.scores)


def test_findings_compare_every_method_with_plain(campaign: Store) -> None:
    found = as_json(gather_findings(campaign))

    assert list(found) == ["1", "1b"]
    assert found["1b"]["repeats"] == 2
    methods = found["1b"]["methods"]
    assert list(methods) == ["plain", *METHODS]
    assert set(methods["efficient"]["true_m_s"]) == {"5", "end"}
    assert methods["plain"]["gain_over_plain_percent"] == 0.0
    assert methods["efficient"]["gain_over_plain_percent"] == pytest.approx(
        100.0 * (methods["efficient"]["true_m_s"]["end"] / methods["plain"]["true_m_s"]["end"] - 1.0)
    )
    assert 0.0 <= methods["efficient"]["p"] <= 1.0


def test_gains_are_told_over_drive_as_well(campaign: Store) -> None:
    found = as_json(gather_findings(campaign))["1b"]["methods"]

    assert set(found["efficient"]["over_drive"]) == set(found["plain"]["over_drive"]) == {"5", "end"}
    assert found["efficient"]["over_drive"]["end"]["gain_percent"] == pytest.approx(
        100.0 * (found["efficient"]["true_m_s"]["end"] / found["drive"]["true_m_s"]["end"] - 1.0)
    )
    assert found["drive"]["over_drive"] == {}
    assert "Gain in true mean speed over drive" in to_markdown(gather_findings(campaign))


def test_honest_intervals_hold_a_speed_measured_with_an_error_as_often_as_they_say() -> None:
    draws = np.random.default_rng(0)
    within, as_measured = [], []
    for true_m_s in np.full(2000, 10.0):
        mean, measured = true_m_s + draws.normal(0.0, [1.0, 1.0])
        step = Step((1.0,), 0.0, (1.0,), mean, mean - 1.96, mean + 1.96)
        as_measured.append(holds(step, measured))
        within.append(holds(step, measured, 1.0))

    assert np.mean(as_measured) < 0.86
    assert 0.94 < np.mean(within) < 0.96


def test_a_campaign_that_has_just_begun_has_found_nothing(tmp_path: Path) -> None:
    store = Store.begin(tmp_path / "new", QUICK)

    assert gather_findings(store) == ()
    with pytest.raises(UserError, match="no repeat"):
        write_report(store)


def test_a_campaign_interrupted_before_its_first_method_has_nothing_to_compare_yet(
    campaign: Store, tmp_path: Path
) -> None:
    folder = tmp_path / "interrupted"
    shutil.copytree(campaign.folder, folder, ignore=shutil.ignore_patterns(*list_transfer_methods(), "*-from-*"))

    with pytest.raises(UserError, match="no repeat of an experiment is complete yet"):
        write_report(Store.open(folder))


@pytest.fixture(scope="module")
def page(campaign: Store) -> Path:
    return write_report(campaign)


def test_the_report_is_one_file_that_needs_nothing_else(campaign: Store, page: Path) -> None:
    text = page.read_text(encoding="utf-8")

    assert "Experiment 1b" in text and "+11.3 %" in text
    assert text.count("<img src='data:image/png") == 1 + 2 * 3
    assert "http" not in text.replace("http-equiv", "")
    assert {path.name for path in (campaign.folder / "figures").iterdir()} == {
        "overview.png",
        *(f"{key}-{what}.png" for key in ("1", "1b") for what in ("true-speed", "best-so-far", "learned")),
    }


def test_a_browser_shows_every_figure_and_asks_nobody_for_anything(page: Path, tmp_path: Path) -> None:
    assert page.stat().st_size < 3e6
    with chromium(tmp_path / "profile") as browser:
        for width in (1200, 400):
            browser.open(page, width)
            images = browser.evaluate(
                "[...document.images].map(i => [i.complete && i.naturalWidth > 300, i.alt.length > 20])"
            )
            assert images == [[True, True]] * (1 + 2 * 3)
            assert browser.evaluate("document.documentElement.scrollWidth") <= width
            assert browser.evaluate("Math.min(...[...document.images].map(i => i.width))") > 300
        assert set(browser.requests()) == {page.as_uri()}
        assert browser.complaints() == []


def test_the_tables_can_be_had_in_markdown(campaign: Store) -> None:
    text = to_markdown(gather_findings(campaign))

    assert "### Experiment 1b" in text
    assert "| efficient |" in text
    assert len({line.count("|") for line in text.splitlines() if line.startswith("| plain")}) <= 2


def test_what_no_method_was_run_for_has_no_table(campaign: Store) -> None:
    found = gather_findings(campaign)
    control = replace(found[0], methods={"plain": found[0].plain})

    assert "thesis" in to_markdown(found).split("###")[0]
    assert to_markdown([control]).startswith("### Experiment 1:")


def test_the_gain_of_a_single_repeat_has_no_interval() -> None:
    draws = np.random.default_rng(0)

    assert gain_text(measure_gain(np.array([1.1]), np.array([1.0]), draws)) == "+10 % [one repeat has no interval]"
    assert "[+" in gain_text(measure_gain(np.array([1.1, 2.4]), np.array([1.0, 2.0]), draws))
    alike = np.array([1.0, 2.0])
    assert gain_text(measure_gain(alike, alike, draws)) == "+0 % [+0, +0]"


def test_every_registered_method_is_compared() -> None:
    assert {"efficient", "optimistic", "random"} <= set(list_transfer_methods())
    assert "plain" not in list_transfer_methods()
