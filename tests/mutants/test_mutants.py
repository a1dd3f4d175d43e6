"""The list of mutants fits the program."""

import pytest
from mutants.run import REPOSITORY, mutants


@pytest.mark.parametrize("mutant", mutants(), ids=lambda mutant: f"{mutant.part}: {mutant.breaks}")
def test_what_a_mutant_replaces_stands_in_its_file_once(mutant):
    found = (REPOSITORY / mutant.file).read_text(encoding="utf-8").count(mutant.old)
    assert found == 1
