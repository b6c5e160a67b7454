"""Intervals of shares, quantiles, pairs and Sobol indices, against closed forms and other code."""

import math

import numpy as np
import pytest
import scipy.stats

from ttwmr_mj.results.sensitivity import sobol_indices
from ttwmr_mj.results.statistics import paired, quantile, share, share_difference, sign_test

NONE = np.zeros(0)


def rng() -> np.random.Generator:
    return np.random.default_rng(7)


def test_a_share_has_the_exact_binomial_interval() -> None:
    # nothing in n runs: 1 − 0.025^(1/n)
    assert share(0, 10) == pytest.approx((0.0, 0.0, 1.0 - 0.025**0.1))
    assert share(10, 10) == pytest.approx((1.0, 0.025**0.1, 1.0))
    # published: 15 of 20, e.g. Agresti and Coull (1998) by Clopper and Pearson's rule
    assert share(15, 20) == pytest.approx((0.75, 0.508954, 0.913429), abs=1e-6)
    found = share(3, 8)

    def at_most(k: int, p: float) -> float:
        return sum(math.comb(8, i) * p**i * (1 - p) ** (8 - i) for i in range(k + 1))

    # at its ends, what was found and what is beyond is just as rare as 2.5 %
    assert 1.0 - at_most(2, found.low) == pytest.approx(0.025)
    assert at_most(3, found.high) == pytest.approx(0.025)
    for count, of in ((1, 3), (7, 1000), (4999, 10_000)):
        theirs = scipy.stats.binomtest(count, of).proportion_ci(0.95, "exact")
        assert share(count, of)[1:] == pytest.approx((theirs.low, theirs.high))


def test_a_share_of_no_runs_is_unknown() -> None:
    found = share(0, 0)
    assert math.isnan(found.value)
    assert found[1:] == (0.0, 1.0)


@pytest.mark.parametrize("at", [0.05, 0.5, 0.9, 0.95])
@pytest.mark.parametrize("n", [2, 5, 10, 40, 101])
def test_a_quantile_lies_between_the_narrowest_values_that_will_do(at: float, n: int) -> None:
    values = np.arange(1.0, n + 1)
    found = quantile(np.random.default_rng(0).permutation(values), at)
    assert found.value == pytest.approx(np.quantile(values, at))

    def fewer(k: int) -> float:
        """Probability that fewer than k of n runs fall below the population's quantile."""
        return sum(math.comb(n, i) * at**i * (1.0 - at) ** (n - i) for i in range(k))

    low = 0 if math.isinf(found.low) else int(found.low)
    assert fewer(low) <= 0.025 < fewer(low + 1)
    if math.isinf(found.high):  # even that all fall below is not rare enough
        assert found.high > 0.0
        assert fewer(n) < 0.975
    else:
        assert fewer(int(found.high) - 1) < 0.975 <= fewer(int(found.high))


@pytest.mark.parametrize(("n", "at"), [(2, 0.5), (6, 0.5), (10, 0.95), (60, 0.5), (100, 0.95)])
def test_a_quantile_holds_the_truth_as_often_as_it_says(n: int, at: float) -> None:
    draws = np.random.default_rng(1).exponential(size=(1000, n))
    truth = -math.log(1.0 - at)
    held = [low <= truth <= high for _, low, high in (quantile(row, at) for row in draws)]
    assert np.mean(held) >= 0.936  # 1000 repetitions tell 0.95 to ± 0.014 (2 sigma)


@pytest.mark.parametrize("pairs", [2, 3, 5, 6, 10, 20])
def test_between_equals_nobody_is_ahead_more_often_than_the_level_allows(pairs: int) -> None:
    fine, equals = np.zeros(pairs, bool), np.random.default_rng(2).normal(size=(1000, pairs))
    ahead = [paired(row, np.zeros(pairs), (fine, fine)).favours != 0 for row in equals]
    assert np.mean(ahead) <= 0.064  # 2 sigma of 1000 repetitions above 0.05


def test_a_run_without_a_number_counts_as_worse_than_any() -> None:
    values = np.array([1.0, 2.0, 3.0, np.inf, np.inf])
    assert quantile(values, 0.5).value == 3.0
    assert quantile(values, 0.9).value == np.inf
    assert quantile(values, 0.625).value == np.inf  # between 3 and infinity
    assert quantile(values, 0.5).high == np.inf
    assert quantile(np.full(6, np.inf), 0.5) == (np.inf,) * 3


def test_one_value_has_no_interval_and_none_no_value() -> None:
    assert quantile(np.array([2.0]), 0.5) == (2.0, -np.inf, np.inf)
    assert all(math.isnan(number) for number in quantile(NONE, 0.5))


@pytest.mark.parametrize(
    ("runs", "place"), [(6, 1), (8, 1), (9, 2), (10, 2), (11, 2), (12, 3), (20, 6), (100, 40)]
)
def test_the_median_lies_between_two_of_the_values(runs: int, place: int) -> None:
    values = np.random.default_rng(0).permutation(np.arange(1.0, runs + 1))
    assert quantile(values, 0.5)[1:] == (place, runs + 1 - place)

    def outside(k: int) -> float:
        return 2.0 * sum(math.comb(runs, i) for i in range(k)) / 2.0**runs

    assert outside(place) <= 0.05 < outside(place + 1)  # the narrowest that will do


@pytest.mark.parametrize("runs", [1, 2, 5])
def test_few_runs_have_no_interval(runs: int) -> None:
    assert quantile(np.ones(runs), 0.5) == (1.0, -np.inf, np.inf)


def test_runs_that_are_alike_count_as_one() -> None:
    assert share(6, 12, independent=4) == (0.5, *share(2, 4)[1:])
    assert share(0, 12, independent=4).high == pytest.approx(1.0 - 0.025**0.25)
    for runs in (5, 6, 40, 100):
        values = rng().normal(size=runs)
        for at in (0.05, 0.5, 0.95):
            thrice = quantile(np.repeat(values, 3), at, independent=runs)
            assert thrice[1:] == quantile(values, at)[1:]
    ours, fine = rng().normal(size=20), np.zeros(20, bool)
    one = paired(ours, 0.0 * ours, (ours > 1.0, fine))
    thrice_ours, thrice_fine = np.repeat(ours, 3), np.zeros(60, bool)
    found = paired(thrice_ours, 0.0 * thrice_ours, (thrice_ours > 1.0, thrice_fine), independent=20)
    assert found.difference[1:] == one.difference[1:]
    assert (found.wins, found.failures) == (pytest.approx(one.wins), pytest.approx(one.failures))


@pytest.mark.parametrize("alike", [0.0, 0.5, 1.0])
def test_an_interval_over_draws_and_seeds_holds_as_often_as_it_says(alike: float) -> None:
    """30 draws with four seeds each; what share of the variance the draw decides."""
    generator, held = np.random.default_rng(4), 0
    for _ in range(400):
        draws = np.repeat(generator.normal(size=30), 4)
        values = math.sqrt(alike) * draws + math.sqrt(1.0 - alike) * generator.normal(size=120)
        found = quantile(values, 0.5, independent=30)
        failures = share(int((values > 1.0).sum()), 120, independent=30)
        truth = 1.0 - scipy.stats.norm.cdf(1.0)
        held += int(found.low <= 0.0 <= found.high) + int(failures.low <= truth <= failures.high)
    assert held >= 0.93 * 800  # 0.95 less 2 sigma of 800 repetitions


def test_an_even_result_is_no_sign_of_a_difference() -> None:
    assert sign_test(0, 0) == 1.0
    assert sign_test(5, 5) == pytest.approx(1.0)
    assert sign_test(9, 1) == sign_test(1, 9) == pytest.approx(2 * 11 / 1024)
    assert sign_test(8, 2) == pytest.approx(2 * 56 / 1024)


def test_pairs_show_a_difference_that_two_medians_hide() -> None:
    theirs = rng().normal(10.0, 5.0, 100)  # draws differ far more than the two laws
    ours = theirs - 0.1 - 0.01 * rng().random(100)
    fine = np.zeros(100, bool)
    found = paired(ours, theirs, (fine, fine))
    assert -0.12 < found.difference.low <= found.difference.high < -0.1
    assert found.favours == -1
    assert (found.better, found.worse, found.unknown) == (100, 0, 0)
    swapped = paired(theirs, ours, (fine, fine))
    assert swapped.difference.value == -found.difference.value
    assert swapped.favours == 1
    assert quantile(ours, 0.5).high > quantile(theirs, 0.5).low


def test_pairs_count_who_failed_and_who_has_no_number() -> None:
    ours = np.array([1.0, np.inf, 1.0, np.inf, 2.0])
    theirs = np.array([2.0, 1.0, np.inf, np.inf, 2.0])
    failed = (np.array([0, 1, 0, 1, 0], bool), np.array([0, 0, 1, 1, 1], bool))
    found = paired(ours, theirs, failed)
    assert (found.pairs, found.only_ours, found.only_theirs, found.both) == (5, 1, 2, 1)
    assert (found.better, found.worse, found.unknown) == (2, 1, 1)
    assert found.failures.value == pytest.approx(-0.2)
    assert found.equal == 1
    assert found.favours == 0
    nothing = paired(NONE, NONE, (NONE.astype(bool),) * 2)
    assert nothing.pairs == 0
    assert nothing.favours == 0


def test_what_is_undefined_is_no_value_and_in_no_pair() -> None:
    values = np.array([2.0, np.nan, 1.0, 3.0])
    assert quantile(values, 0.5) == (2.0, -np.inf, np.inf)
    assert all(math.isnan(number) for number in quantile(np.full(3, np.nan), 0.5))
    fine = np.zeros(4, bool)
    found = paired(np.array([1.0, 1.0, 1.0, np.inf]), values, (fine, fine))
    assert (found.better, found.worse, found.equal, found.unknown) == (1, 1, 1, 1)


def test_a_difference_of_shares_is_never_too_sure() -> None:
    assert share_difference(0, 0, 10).low < 0.0 < share_difference(0, 0, 10).high
    generator, held = rng(), 0
    for _ in range(500):
        kinds = generator.multinomial(40, [0.15, 0.05, 0.8])
        found = share_difference(int(kinds[0]), int(kinds[1]), 40)
        held += found.low <= 0.1 <= found.high
    assert held >= 475


def ishigami(x: np.ndarray) -> np.ndarray:
    """At (3, …), with a = 7, b = 0.1; its indices are known (Ishigami and Homma, 1990)."""
    return np.asarray(np.sin(x[0]) + 7.0 * np.sin(x[1]) ** 2 + 0.1 * x[2] ** 4 * np.sin(x[0]))


def design(n: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    drawn = scipy.stats.qmc.Sobol(6, rng=np.random.default_rng(3)).random(n).T
    a, b = -math.pi + 2.0 * math.pi * drawn.reshape(2, 3, n)
    mixed = np.repeat(a[None], 3, axis=0)
    mixed[range(3), range(3)] = b
    return tuple(np.asarray(ishigami(x)) for x in (a, b, np.moveaxis(mixed, 0, 1)))  # type: ignore[return-value]


def test_sobol_indices_are_the_known_ones_and_scipys() -> None:
    a, b, ab = design(1024)
    found = sobol_indices(a, b, ab, rng())
    assert found is not None
    known = [(0.3139, 0.5576), (0.4424, 0.4424), (0.0, 0.2437)]
    theirs = scipy.stats.sobol_indices(
        func={"f_A": a[None].copy(), "f_B": b[None].copy(), "f_AB": ab[:, None].copy()}, n=1024
    )
    for i, (first, total) in enumerate(known):
        assert found[i].first.low <= first <= found[i].first.high
        assert found[i].total.low <= total <= found[i].total.high
        assert found[i].first.value == pytest.approx(theirs.first_order[i], abs=1e-12)
        assert found[i].total.value == pytest.approx(theirs.total_order[i], abs=1e-12)
        assert found[i].converged


def test_sobol_indices_of_few_runs_are_called_not_converged() -> None:
    found = sobol_indices(*design(64), rng())
    assert found is not None
    assert not found[0].converged
    assert all(not index.converged for index in sobol_indices(*design(8), rng()) or ())


def test_a_number_that_never_varies_has_no_indices() -> None:
    assert sobol_indices(np.ones(64), np.ones(64), np.ones((3, 64)), rng()) is None


@pytest.mark.parametrize("samples", [32, 64])
def test_rare_failures_make_no_indices_that_converge(samples: int) -> None:
    """A corner of the cube fails, 0.8 % of it; 0.81 of the variance goes with each parameter."""
    converged = 0
    for seed in range(40):
        drawn = scipy.stats.qmc.Sobol(6, rng=np.random.default_rng(seed)).random(samples).T
        a, b = drawn.reshape(2, 3, samples)
        mixed = np.repeat(a[None], 3, axis=0)
        mixed[range(3), range(3)] = b
        failed = [np.all(x > 0.8, axis=0).astype(float) for x in (a, b, *mixed)]
        found = sobol_indices(failed[0], failed[1], np.array(failed[2:]), rng())
        converged += sum(index.converged for index in found or ())
    assert converged == 0


@pytest.mark.parametrize("where", [0, 1, 2])
def test_one_run_that_differs_makes_no_indices_that_converge(where: int) -> None:
    """Of A, of B, or of what is mixed of both."""
    sets = [np.zeros(64), np.zeros(64), np.zeros((3, 64))]
    sets[where][..., 7] = 1.0
    found = sobol_indices(*sets, rng())
    assert found is not None
    assert not any(index.converged for index in found)
    assert np.isfinite([[*index.first, *index.total] for index in found]).all()
