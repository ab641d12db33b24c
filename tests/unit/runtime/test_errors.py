import pickle

import pytest

from kincompile import errors


@pytest.mark.parametrize(
    ("error", "builtin"),
    [
        (errors.ModelError, ValueError),
        (errors.StructuralError, ValueError),
        (errors.UnsupportedError, NotImplementedError),
        (errors.ContractError, ValueError),
        (errors.InputError, ValueError),
        (errors.SolveError, ArithmeticError),
        (errors.TemplateError, errors.KincompileError),
        (errors.InternalError, errors.KincompileError),
    ],
)
def test_an_error_is_one_of_ours_and_of_the_builtin_kind(error, builtin):
    assert issubclass(error, errors.KincompileError)
    assert issubclass(error, builtin)


@pytest.mark.parametrize(
    "error",
    [errors.ModelError, errors.StructuralError, errors.ContractError, errors.InputError],
)
def test_an_error_takes_one_message_or_several(error):
    assert str(error("the rod has no length")) == "the rod has no length"
    assert error("the rod has no length").problems == ("the rod has no length",)
    several = error(problem for problem in ("no rod", "no crank"))
    assert several.problems == ("no rod", "no crank")
    assert str(several) == "2 problems:\n  - no rod\n  - no crank"


def test_an_error_without_a_problem_is_a_bug_of_ours():
    with pytest.raises(errors.InternalError, match=r"ModelError.*bug in kincompile"):
        raise errors.ModelError([])


@pytest.mark.parametrize(
    "error",
    [
        errors.InputError(["one", "two"]),
        errors.SolveError("failed at t = 2", {"t": 2}),
        errors.InternalError("a row has no column."),
    ],
)
def test_an_error_survives_the_way_between_processes(error):
    copy = pickle.loads(pickle.dumps(error))
    assert str(copy) == str(error)
    assert vars(copy) == vars(error)


def test_solve_error_carries_the_partial_solution():
    solution = object()
    error = errors.SolveError("failed at t = 2", solution)
    assert error.solution is solution
    assert str(error) == "failed at t = 2"


@pytest.mark.parametrize(
    "warning",
    [
        errors.SingularConfigurationWarning,
        errors.BranchSwitchWarning,
        errors.RedundantConstraintWarning,
    ],
)
def test_warnings_can_be_filtered_together(warning):
    assert issubclass(warning, errors.KincompileWarning)
    assert issubclass(warning, UserWarning)
