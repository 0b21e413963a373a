import numpy as np
import pytest

import armdyn as ad

FAULTS = {
    "rate": [0, -1.0, np.inf, 0.5, 2e6, "fast"],
    "delay": [-1, 1.5, 101],
    "encoder": [-1e-4, np.nan],
    "noise": [-1.0],
    "cutoff": [0.0, np.inf],
    "velocity": ["guessed"],
    "antiwindup": ["some"],
    "hold": ["first_order"],
    "seed": [-1, 0.5],
}


@pytest.mark.parametrize(("name", "value"), [(name, value) for name, values in FAULTS.items() for value in values])
def test_a_field_out_of_range_is_named(name, value):
    with pytest.raises(ad.ArmdynError, match=name):
        ad.Loop(**{name: value})


@pytest.mark.parametrize("flaw", [{"delay": 1}, {"encoder": 1e-4}, {"noise": 1e-5}, {"velocity": "filtered"}])
def test_a_continuous_loop_has_no_flaw(flaw):
    ideal = {"hold": "continuous", "delay": 0, "encoder": 0.0, "velocity": "exact"}
    assert ad.Loop(**ideal) == ad.Loop.ideal(saturate=True)
    with pytest.raises(ad.ArmdynError, match=r"Loop\.ideal"):
        ad.Loop(**{**ideal, **flaw})


@pytest.mark.parametrize(("rate", "cutoff"), [(1000.0, 80.0), (500.0, 20.0), (4000.0, 300.0)])
def test_the_observers_error_decays_with_both_poles(rate, cutoff):
    loop = ad.Loop(rate=rate, cutoff=cutoff, velocity="observer")
    l1, l2 = loop.observer_gains
    h = loop.period
    # Of q̂ = q̂⁻ + l₁ (q - q̂⁻), v̂ = v̂⁻ + l₂ (q - q̂⁻), with q̂⁻ = q̂ + h v̂ and v̂⁻ = v̂.
    error = np.array([[1 - l1, (1 - l1) * h], [-l2, 1 - l2 * h]])
    # A double root moves by the root of rounding, 1e-8; the trace and the determinant do not.
    assert np.trace(error) == pytest.approx(2 * loop.pole, abs=1e-12)
    assert np.linalg.det(error) == pytest.approx(loop.pole**2, abs=1e-12)
    assert loop.pole == pytest.approx(np.exp(-2 * np.pi * cutoff / rate), rel=1e-14)


def test_a_seed_of_thousands_of_digits():
    """Python prints no integer of more than 4300 digits."""
    with pytest.raises(ad.ArmdynError, match="seed is"):
        ad.Loop(seed=10**5000)
