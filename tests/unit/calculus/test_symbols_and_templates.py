"""The textbook's symbols, and what a template says of its coordinates."""

import pytest

from kincompile.calculus.expand import Expansion
from kincompile.calculus.expressions import Basis, ProfileFunction, Symbol, VectorSymbol
from kincompile.calculus.rotations import turned
from kincompile.calculus.symbols import Contact, PlaneFrame, contact_i, i, j, s_i, unit
from kincompile.calculus.template import Template


def test_that_a_frame_names_its_symbols_by_its_body() -> None:
    frame = PlaneFrame("k")
    assert (frame.r, frame.phi) == (VectorSymbol("r_k"), Symbol("phi_k"))
    assert frame.rates == (VectorSymbol("r_k_dot"), Symbol("phi_k_dot"))


def test_that_a_point_is_position_plus_turned_vector() -> None:
    assert i.point(s_i) == i.r + turned(i.phi, s_i)


def test_that_the_tangent_of_a_profile_is_its_derivative() -> None:
    contact = Contact("k")
    rho, rho_prime = (ProfileFunction("rho_k", contact.alpha, order) for order in (0, 1))
    u, u_prime = turned(contact.alpha, Basis()), turned(contact.alpha, Basis(), 1)
    assert contact.a == rho * u
    assert contact.g == rho_prime * u + rho * u_prime


def test_that_a_unit_vector_is_a_turned_basis() -> None:
    assert unit(i.phi) == turned(i.phi, Basis())


def test_that_a_template_lists_coordinates_and_rates_in_the_same_order() -> None:
    template = Template("Pair", (i, j), (contact_i,), (i.point(s_i) - j.r, i.phi - j.phi))
    assert template.coordinates == (i.r, i.phi, j.r, j.phi, contact_i.alpha)
    assert template.rates == (*i.rates, *j.rates, Symbol("alpha_i_dot"))


def test_that_something_else_cannot_be_expanded() -> None:
    expansion = Expansion(None)  # type: ignore[arg-type]
    with pytest.raises(TypeError, match="not a scalar expression"):
        expansion.scalar("x")  # type: ignore[arg-type]
    with pytest.raises(TypeError, match="not a vector expression"):
        expansion.vector("x")  # type: ignore[arg-type]
