"""A short version of kills.py, which see."""

import kills
import pytest


@pytest.mark.parametrize("flags", [[], ["--continued"]])
def test_a_run_that_is_killed_ends_as_one_that_is_not(capsys, flags):
    assert kills.main(["--kills", "4", "--seed", "1", *flags]) == 0
    output = capsys.readouterr().out
    assert "4 of 4 kills resumed, no checkpoint lost; 1 of 1 ends the same" in output
