"""Laws with gains of several rollouts: one start for all of them, and other numbers of rows refused by name."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_array_equal

import pathcontrol as pc

ARM, TASK = pc.load_robot("cicese_2dof"), pc.Circle(1.0, 2.0)
Q = np.array([[1.0, 0.0], [0.9, 0.1], [0.8, 0.2]])
LAWS = {
    "ComputedTorque": {"K_p": 800.0, "K_v": 57.0},
    "PDPlus": {"K_p": 100.0, "K_v": 9.0},
    "SlotineLi": {"Lambda": 20.0, "K_d": 9.0},
    "ExtendedMotionPlan": {"K_p": 800.0, "K_v": 57.0, "k": 20.0},
    "Projection": {"k_p": 800.0, "K_v": 57.0},
    "AdaptiveSlotineLi": {"Lambda": 20.0, "K_d": 9.0, "adaptation": 1e-3, "k": 20.0},
    "PassiveVelocityField": {"Lambda": 20.0, "K_v": 40.0, "energy": 400.0, "approach": 2.0, "recharge": 3.0},
    "TransverseLinearization": {"k_p": 800.0, "k_v": 57.0, "k_s": 20.0},
    "ManeuverRegulation": {"K_p": 800.0, "K_v": 57.0},
}
GAINS = [(law, name) for law, gains in LAWS.items() for name in gains]


def make(law, **changed):
    return getattr(pc, law)(ARM, TASK, **(LAWS[law] | changed))


def with_rows(law, name, rows):
    return make(law, **{name: LAWS[law][name] * np.linspace(1.0, 1.5, rows)[:, None]})


def run(law, q=Q, **options):
    return pc.simulate(law, q, **{"duration": 0.02, "progress": False} | options)


@pytest.mark.parametrize(("law", "name"), GAINS)
def test_a_row_of_gains_is_the_law_with_these_gains(law, name):
    """One start serves all rows."""
    one, three = run(with_rows(law, name, 3), Q[0]), run(with_rows(law, name, 3), Q[[0, 0, 0]])
    last = run(make(law, **{name: 1.5 * LAWS[law][name]}), Q[0])
    for value in ("q", "s", "tau"):
        assert_array_equal(one.array(value), three.array(value))
        assert_array_equal(one.array(value)[2], last.array(value)[0])


@pytest.mark.parametrize(("law", "name"), GAINS)
def test_another_number_of_rows_than_of_starts_is_refused_by_name(law, name):
    wrong = with_rows(law, name, 4)
    said = rf"^{law} has {name} of shape \(4,.*a row for each of 3 rollouts.*give 4 initial states, or one$"
    with pytest.raises(pc.InputError, match=said):
        run(wrong)
    with pytest.raises(pc.InputError, match="3 rollouts"):
        run(wrong, Q[0], plant=[ARM] * 3)


@pytest.mark.parametrize("law", LAWS)
def test_it_is_refused_by_the_names_of_a_wrapped_law_and_its_gain(law):
    name = list(LAWS[law])[-1]
    with pytest.raises(pc.InputError, match=rf"Paced\({law}\) has {name} of shape"):
        run(pc.Paced(with_rows(law, name, 4)))


def test_gains_of_different_numbers_of_rollouts_are_refused_by_name():
    law = make("ComputedTorque", K_p=np.full((3, 2), 800.0), K_v=np.full((4, 2), 57.0))
    with pytest.raises(pc.InputError, match=r"K_p of shape \(3, 2\) and K_v of shape \(4, 2\), expected as many"):
        run(law, Q[0])
    with pytest.raises(pc.InputError, match=r"K_v of shape \(4, 2\), expected a row for each of 3"):
        run(law)


@pytest.mark.parametrize("law", ["SlotineLi", "ManeuverRegulation"])
def test_a_sequence_takes_the_gains_of_one_rollout(law):
    wrong = with_rows(law, next(iter(LAWS[law])), 4)
    with pytest.raises(pc.InputError, match=r"of shape \(4, 1\), expected the gains of one rollout"):
        pc.simulate_sequence([wrong], Q[0], duration=1.0, progress=False)


def test_a_run_is_read_with_the_gains_of_its_rollouts():
    recorded = run(make("ComputedTorque"))
    for read in (pc.power_balance, pc.law_states):
        with pytest.raises(pc.InputError, match="K_p of the law has 4 rows, the run 3 rollouts"):
            read(recorded, with_rows("ComputedTorque", "K_p", 4))
        read(recorded, with_rows("ComputedTorque", "K_p", 3))
