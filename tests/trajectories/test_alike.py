"""Names and units that are alike, and those that are not."""

import pytest

from sklearn_pgnn.trajectories.titles import names_alike, units_alike


@pytest.mark.parametrize(
    ("own", "theirs"),
    [("force", "F_force"), ("position", "Pos"), ("speed", "spd"), ("motor_torque", "torque (raw)")],
)
def test_names_that_share_a_word_or_their_letters_are_alike(own, theirs):
    assert names_alike(own, theirs)
    assert names_alike(theirs, own)


@pytest.mark.parametrize(
    ("own", "theirs"),
    [("force", "weg"), ("force_1", "level_1"), ("level", "valve"), ("t", "torque")],
)
def test_names_with_little_in_common_are_not_alike(own, theirs):
    assert not names_alike(own, theirs)
    assert not names_alike(theirs, own)


def test_an_unknown_unit_is_like_none():
    assert not units_alike("N", "")
    assert not units_alike("", "")
    assert not units_alike("N", "foo")
