import numpy as np
import pytest

from vvvaltr.transfer.bayes.initial_design import initial_design


def test_every_slice_of_every_axis_has_one_place() -> None:
    design = initial_design(10, 6, np.random.default_rng(0))
    assert design.shape == (10, 6)
    for axis in design.T:
        assert sorted((10 * axis).astype(int)) == list(range(10))


def test_the_places_are_farther_apart_than_random_ones() -> None:
    def closest(places: np.ndarray) -> float:
        distances = np.linalg.norm(places[:, None] - places[None], axis=2)
        return float(distances[np.triu_indices(len(places), 1)].min())

    rng = np.random.default_rng(1)
    assert closest(initial_design(8, 3, rng)) > 1.5 * np.mean([closest(rng.random((8, 3))) for _ in range(20)])


def test_one_place_is_a_design_and_none_is_not() -> None:
    assert initial_design(1, 2, np.random.default_rng(0)).shape == (1, 2)
    with pytest.raises(ValueError, match="needs at least 1 place"):
        initial_design(0, 2, np.random.default_rng(0))
