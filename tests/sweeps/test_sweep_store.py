"""A sweep's folder opens as labelled arrays, does again what is missing in it, and takes no other plan."""

import dataclasses
import threading
from concurrent.futures import ThreadPoolExecutor

import jax.numpy as jnp
import numpy as np
import pytest
from rigs import coupled, driven
from sweep_cases import plan, recordings, vehicle

from jaxsub.errors import InputError
from jaxsub.simulation import synthetic
from jaxsub.storage import Manifest
from jaxsub.sweeps import OUTCOMES, Plan, Store, open_sweep, sweep
from jaxsub.sweeps.store import read_chunk


def made_up(chunk, p, d):
    """Answers that say where they belong."""
    size = chunk.last - chunk.first
    at = 1000.0 * chunk.case + np.arange(chunk.first, chunk.last)
    table = {name: at[:, None] + 0.1 * np.arange(p) for name in ("start", "estimate", "standard_error")}
    table |= {"coordinates": at[:, None] + 0.1 * np.arange(d), "cost": at, "away": at}
    return table | {"evaluations": np.full(size, 5), "outcome": np.full(size, 1, np.int8)}


@pytest.fixture
def two(tmp_path):
    """A store of two vehicles with coefficients of their own, two recordings, two noises and 20 starts."""
    times = 0.1 * np.arange(30)
    names = {"a", "b", "b_rate", "x", "x_rate", "f"}
    run = synthetic(coupled(), [driven(coupled(), times, seed=2)], seed=2, noise=False)[0]
    one = synthetic(vehicle(), [driven(vehicle(), times, seed=2)], seed=2, noise=False)[0]
    both = dataclasses.replace(run, columns=one.columns | run.columns)
    assert set(both.columns) == names
    settled = dataclasses.replace(coupled(), layout=_known(coupled().layout))
    axes = {"x": vehicle(), "ab": settled}, {"first": [both], "second": [both]}
    store, made = Store.of(tmp_path / "out", Plan(*axes, 20, noise=(4, 9), width=[16] * 4))
    return tmp_path / "out", store, made


def _known(layout):
    outputs = tuple(dataclasses.replace(output, sigma=0.01) for output in layout.outputs)
    return dataclasses.replace(layout, outputs=outputs)


def test_what_is_done_stands_at_its_place_on_every_axis_and_the_rest_is_missing(two):
    folder, store, made = two
    chunks = made.chunks()
    sizes = [(len(p.prior_mean), len(p.coordinates())) for p in made.problems]
    for chunk in chunks[:-1]:
        store.write(chunk, made_up(chunk, *sizes[chunk.case]))
    assert store.missing(chunks) == chunks[-1:]
    found = open_sweep(folder)
    assert dict(found.sizes) | {"vehicle": 2, "recording": 2, "noise": 2, "start": 20} == dict(found.sizes)
    cell = {"vehicle": "ab", "recording": "first", "noise": 9, "start": 3}
    assert float(found.cost.sel(cell)) == 2023.0
    free = [row.name for row in coupled().layout.free]
    np.testing.assert_allclose(found.estimate.sel(cell).sel(coefficient=free), 2023.0 + 0.1 * np.arange(len(free)))
    assert np.isnan(found.estimate.sel(cell).sel(coefficient="D_x"))
    assert int(found.done.sum()) == 160 - (chunks[-1].last - chunks[-1].first)
    left = found.sel(vehicle="ab", recording="second", noise=9, start=19)
    assert not bool(left.done) and int(left.outcome) == -1 and np.isnan(left.cost)
    assert found.outcome.attrs["flag_meanings"].split() == list(OUTCOMES)
    assert all(found[name].attrs["long_name"] for name in ("estimate", "cost", "standard_error"))
    assert float(found.file_value.sel(vehicle="x", coefficient="K_x")) == 4.6


def test_a_file_that_is_torn_or_of_another_plan_is_missing(two):
    folder, store, made = two
    first, second, third = made.chunks()[:3]
    for chunk in (first, second, third):
        store.write(chunk, made_up(chunk, 3, 5))
    torn = sorted((folder / "cells").iterdir())[1]
    torn.write_bytes(torn.read_bytes()[:300])
    Store(folder, "another").write(third, made_up(third, 3, 5))
    assert store.missing([first, second, third]) == [second, third]
    assert int(open_sweep(folder).done.sum()) == 16


def test_a_write_that_was_cut_off_leaves_nothing_that_counts(two):
    folder, store, made = two
    chunk = made.chunks()[0]
    with pytest.raises(ValueError, match="conflicting sizes"):
        store.write(chunk, made_up(chunk, 3, 5) | {"cost": np.zeros(3)})
    assert store.missing([chunk]) == [chunk]
    assert not list((folder / "cells").rglob("*"))


@pytest.mark.parametrize(
    ("changes", "word"),
    [
        ({"starts": 97}, "starts is 96 there and 97 here"),
        ({"seed": 1}, "seed is 0 there and 1 here"),
        ({"spread": 0.7}, "spread is 0.8 there"),
        ({"noise": (1,)}, "noise is"),
        ({"method": "newton"}, "method is gauss_newton there and newton here"),
        (lambda: {"recordings": {"run": recordings(noise=False)}}, "recordings run .* other contents"),
        (lambda: {"recordings": {"other": recordings()}}, "recordings other .* here alone"),
        (lambda: {"vehicles": {"oscillator": vehicle().with_values({"K_x": jnp.asarray(4.5)})}}, "vehicles oscillator"),
    ],
)
def test_another_plan_is_refused_with_the_difference_and_the_folder_left_alone(tmp_path, changes, word):
    Store.of(tmp_path / "out", plan())
    before = {path: path.read_bytes() for path in (tmp_path / "out").rglob("*") if path.is_file()}
    with pytest.raises(InputError, match=word):
        sweep(plan(**(changes() if callable(changes) else changes)), tmp_path / "out")
    assert {path: path.read_bytes() for path in (tmp_path / "out").rglob("*") if path.is_file()} == before


def test_how_it_is_split_is_no_other_plan_and_stays_as_it_was_begun(tmp_path):
    Store.of(tmp_path / "out", plan())
    _, settled = Store.of(tmp_path / "out", plan(width=[50]))
    assert settled.chunks() == plan().chunks()


def test_noise_that_a_file_leaves_open_is_settled_once_and_kept(tmp_path):
    from rigs import oscillator

    outputs = {"x": {"sigma": "estimate"}, "x_rate": {"sigma": "estimate"}}
    _, first = Store.of(tmp_path / "out", plan(vehicles={"free": oscillator(outputs=outputs)}))
    np.testing.assert_allclose(first.sigma, [[0.01, 0.02]], rtol=0.4)
    _, again = Store.of(tmp_path / "out", plan(vehicles={"free": oscillator(outputs=outputs)}))
    assert again.sigma == [list(first.sigma[0])]


def test_what_is_no_sweep_is_refused(tmp_path):
    with pytest.raises(InputError, match="holds no sweep"):
        open_sweep(tmp_path / "nothing")
    (tmp_path / "mine.txt").write_text("keep", encoding="utf-8")
    with pytest.raises(InputError, match=r"plan\.json"):
        sweep(plan(), tmp_path)
    assert [path.name for path in tmp_path.iterdir()] == ["mine.txt"]


def test_threads_that_write_chunks_leave_what_one_leaves(tmp_path):
    """Claim: all chunks are there, read back as they were written, and listed in the manifest, whoever begins it."""
    found = {}
    for name, count in (("serial", 1), ("threads", len(plan().chunks()))):
        store, made = Store.of(tmp_path / name, plan())
        manifest, begin = Manifest.of_folder(tmp_path / name), threading.Barrier(count)
        manifest.path.unlink()

        def one(chunk, store=store, begin=begin):
            begin.wait()
            store.write(chunk, made_up(chunk, 3, 5))

        with ThreadPoolExecutor(count) as pool:
            list(pool.map(one, made.chunks()))
        assert store.missing(made.chunks()) == []
        files = sorted((tmp_path / name / "cells").glob("*"))
        assert len(files) == len(made.chunks()) and all(manifest.lists(path) for path in files)
        found[name] = [read_chunk(path, store.name) for path in files]
    for (chunk, answers), (other, others) in zip(found["serial"], found["threads"], strict=True):
        assert chunk == other and answers.keys() == others.keys()
        for name in answers:
            np.testing.assert_array_equal(answers[name], others[name])


def test_manifest_is_begun_once_by_threads_that_begin_together(tmp_path):
    """Claim: one first line, and every file listed."""
    count = 16
    begin = threading.Barrier(count)

    def one(number):
        manifest = Manifest.of_folder(tmp_path)
        (tmp_path / f"{number}.txt").write_text(str(number), encoding="utf-8")
        begin.wait()
        manifest.begin("test")
        manifest.add(tmp_path / f"{number}.txt")

    with ThreadPoolExecutor(count) as pool:
        list(pool.map(one, range(count)))
    assert Manifest.of_folder(tmp_path).foreign() is None
    text = Manifest.of_folder(tmp_path).path.read_text(encoding="utf-8")
    assert len(text.splitlines()) == count + 1 and text.count("schema") == 1
