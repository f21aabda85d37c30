"""The changes of faults.py are of code that is there."""

import pytest
from commands import ROOT
from faults import FAULTS


@pytest.mark.parametrize("name", FAULTS)
def test_a_fault_is_in_one_place_and_its_tests_are_there(name):
    module, code, broken, tests = FAULTS[name]
    assert (ROOT / module).read_text().count(code) == 1
    assert code != broken and tests
    for test in tests:
        assert (ROOT / test).is_file(), test
